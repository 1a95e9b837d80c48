use std::collections::BTreeMap;

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
    /// INI file.
    pub ini: Ini,
    /// Folder in which files of subroutines are looked for first; none = the folder the command runs in.
    pub base: Option<std::path::PathBuf>,
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
            ini: Ini::default(),
            base: None,
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
