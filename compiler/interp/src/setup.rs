use std::collections::BTreeMap;
use std::sync::Arc;

use gr_canon::{Axes, Units, Version};
use gr_spec::Dialect;

/// What a run starts from.
#[derive(Clone, Debug)]
pub struct Setup {
    /// Language.
    pub dialect: &'static Dialect,
    /// Which LinuxCNC's behaviour, where the two differ.
    pub version: Version,
    /// Length units of the machine: of the tool table and of the stored parameters.
    pub machine_units: Units,
    /// Tools.
    pub tools: ToolTable,
    /// Stored numbered parameters (`.var` file): number → value.
    pub params: BTreeMap<u32, f64>,
    /// Where the machine stands when a run begins, in its own coordinates and units. The real `rs274` stands at its zero.
    pub start: Axes,
    /// By how much a probe stops before its target, mm. 0: as the stand-in of the real `rs274` has it, which stops a little before but
    /// reports the target.
    pub probe_short: f64,
    /// INI file.
    pub ini: Ini,
    /// Folder in which files of subroutines are looked for first; none = the folder the command runs in.
    pub base: Option<std::path::PathBuf>,
    /// Files of subroutines are read only below these folders and below those of the search path; none = wherever a call
    /// leads.
    pub confined: Option<Vec<std::path::PathBuf>>,
    /// Skip lines that begin with `/`.
    pub block_delete: bool,
    /// Limits.
    pub budgets: Budgets,
    /// M100 … M199 exist on this machine. The real `rs274` has none.
    pub user_m_codes: bool,
    /// The machine has axes U, V and W. The real `rs274` has not.
    pub uvw: bool,
    /// [RS274NGC]RS274NGC_STARTUP_CODE runs before the program, as on the machine; `rs274` ignores it.
    pub startup_code: bool,
    /// M99 in the main program begins it again, as on the machine; `rs274` ends.
    pub loop_on_main_m99: bool,
    /// The Python parts of remapped codes are left out, with a warning. The real `rs274` without Python knows no such
    /// codes.
    pub without_python: bool,
    /// Go on after an error as `rs274 -n 0` does; `check` does too, to find more than one.
    pub keep_going: bool,
}

impl Default for Setup {
    fn default() -> Self {
        Setup {
            dialect: Dialect::linuxcnc(),
            version: Version::V2_9,
            machine_units: Units::Mm,
            tools: ToolTable::default(),
            params: BTreeMap::new(),
            start: [0.0; 9],
            probe_short: 0.0,
            ini: Ini::default(),
            base: None,
            confined: None,
            block_delete: false,
            budgets: Budgets::default(),
            user_m_codes: true,
            uvw: true,
            startup_code: true,
            loop_on_main_m99: false,
            without_python: true,
            keep_going: false,
        }
    }
}

/// Limits, counted in steps, so that results are the same everywhere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Budgets {
    /// Blocks executed.
    pub blocks: u64,
    /// Passes of one loop.
    pub passes: u64,
    /// Canonical calls.
    pub calls: u64,
}

impl Default for Budgets {
    fn default() -> Self {
        Budgets { blocks: 20_000_000, passes: 1_000_000, calls: 30_000_000 }
    }
}

/// A tool table in file order: row 0 is the spindle.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ToolTable {
    /// Rows; index = pocket index.
    pub rows: Vec<Tool>,
}

/// A tool table as a run changes it. Every tool change writes the spindle's row; the others are shared by all states of a
/// program, as long as no G10 writes one.
#[derive(Clone, Debug)]
pub struct Tools {
    spindle: Option<Arc<Tool>>,
    /// Its row 0 is not looked at.
    others: Arc<ToolTable>,
}

impl Tools {
    /// As the machine has them at the start.
    pub fn new(table: &ToolTable) -> Tools {
        Tools { spindle: table.rows.first().cloned().map(Arc::new), others: Arc::new(table.clone()) }
    }
    /// The tool of a row; row 0 is the spindle.
    pub fn get(&self, row: usize) -> Option<&Tool> {
        if row == 0 { self.spindle.as_deref() } else { self.others.rows.get(row) }
    }
    /// The tools of the pockets.
    pub fn pockets(&self) -> &[Tool] {
        self.others.rows.get(1..).unwrap_or_default()
    }
    /// Puts a tool into the spindle.
    pub fn load(&mut self, tool: Tool) {
        self.spindle = Some(Arc::new(tool));
    }
    /// Puts a tool into a row that is there.
    pub fn put(&mut self, row: usize, tool: Tool) {
        if row == 0 && self.spindle.is_some() {
            self.load(tool);
        } else if row > 0 && row < self.others.rows.len() {
            Arc::make_mut(&mut self.others).rows[row] = tool;
        }
    }
    /// Whether this is what the machine had at the start.
    pub fn is(&self, table: &ToolTable) -> bool {
        self.spindle.as_deref() == table.rows.first() && self.pockets() == table.rows.get(1..).unwrap_or_default()
    }
}

impl PartialEq for Tools {
    fn eq(&self, other: &Tools) -> bool {
        self.spindle == other.spindle && (Arc::ptr_eq(&self.others, &other.others) || self.pockets() == other.pockets())
    }
}

/// One tool, in machine units.
#[derive(Clone, Debug, Default, PartialEq)]
#[expect(missing_docs, reason = "named after the table's words")]
pub struct Tool {
    pub number: i32,
    pub pocket: i32,
    pub offset: Axes,
    pub diameter: f64,
    pub front_angle: f64,
    pub back_angle: f64,
    pub orientation: i32,
    pub comment: Box<str>,
}

/// An INI file: section and key, lower-cased for look-up, to values in file order. Only names that the file
/// spells in capitals, and only the first section of a name, are there: the controller sees no others.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ini {
    /// `(section, key)` → values.
    pub values: BTreeMap<(String, String), Vec<String>>,
    /// Folder of the file, for relative paths in it.
    pub folder: Option<std::path::PathBuf>,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A program has many states, and a machine many tools.
    #[test]
    fn a_tool_change_leaves_the_other_rows_shared() {
        let start = Tools::new(&crate::assumed_tools());
        let mut now = start.clone();
        now.load(Tool { number: 7, ..Tool::default() });
        assert!(Arc::ptr_eq(&start.others, &now.others) && start != now && start.get(0) != now.get(0));
        let mut state = crate::State::start(&Setup::default());
        (state.tools, state.world_tools) = (Some(now.clone()), Some(now.clone()));
        assert!(state.key_bytes().len() < 4_096 && state.same_tools(&state.clone()));
        now.put(5, Tool { number: 5, diameter: 3.0, ..Tool::default() });
        assert!(now.get(5) != start.get(5) && now.get(6) == start.get(6) && now.pockets().len() == start.pockets().len());
        assert_ne!(state, crate::State { tools: Some(now.clone()), ..state.clone() });
        now.put(5, start.get(5).cloned().unwrap_or_default());
        assert_eq!(now, state.tools.unwrap_or(start));
    }
}
