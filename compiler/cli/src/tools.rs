//! Which tool of the machine's table is the tool that a STEP-NC file describes: the same diameter, and a remark
//! that names no other type or edge radius.

use gr_interp::ToolTable;
use gr_planner::stepnc::Described;
use gr_planner::{Loaded, Tool};
use gr_text::{Diagnostic, FileId, code};

/// Diameters in a table have four decimals, of an inch at worst.
const DIAMETER: f64 = 0.005;
/// Edge radii are written in tenths.
const RADIUS: f64 = 0.05;

/// A tool table and what its numbers mean.
pub struct Table<'a> {
    /// As the user named it.
    pub name: String,
    /// Its rows.
    pub rows: &'a ToolTable,
    /// mm per unit of the table.
    pub unit: f64,
}

/// Tools of the table for all tools of a file, each row for one of them; with what there is to say. The tools that fit a
/// row best choose first: a row without a remark is left for those that nothing else fits.
pub fn assign(tools: &[Tool], table: &Table<'_>, file: FileId) -> (Vec<Loaded>, Vec<Diagnostic>) {
    let fits = |r: &&gr_interp::Tool| r.number > 0 && &*r.comment != gr_interp::ASSUMED;
    let rows: Vec<&gr_interp::Tool> = table.rows.rows.iter().skip(1).filter(fits).collect();
    let mut wishes: Vec<(&Tool, Vec<(u32, &gr_interp::Tool)>)> = Vec::new();
    for tool in tools {
        let mut scored: Vec<_> = rows.iter().filter_map(|r| Some((fit(tool, r, table.unit)?, *r))).collect();
        scored.sort_by_key(|(score, row)| (std::cmp::Reverse(*score), row.number));
        wishes.push((tool, scored));
    }
    wishes.sort_by_key(|(tool, scored)| (std::cmp::Reverse(scored.first().map_or(0, |s| s.0)), tool.number));
    let mut loaded: Vec<Loaded> = Vec::new();
    let mut found = Vec::new();
    for (tool, scored) in wishes {
        let taken = |row: &gr_interp::Tool| loaded.iter().find(|l| i64::from(l.number) == i64::from(row.number));
        let free: Vec<_> = scored.iter().filter(|(_, row)| taken(row).is_none()).collect();
        let Some((best, row)) = free.first().copied() else {
            let other = scored.first().and_then(|(_, row)| taken(row)).and_then(|l| tools.iter().find(|t| t.number == l.tool));
            found.push(missing(tool, other, table, file));
            continue;
        };
        let equal = free.iter().filter(|(score, r)| score == best && r.number != row.number).count();
        if equal > 0 {
            let args = [(equal + 1).to_string(), title(tool), row.number.to_string()];
            found.push(Diagnostic::new(code::TOOL_TABLE_SEVERAL_TOOLS, file, tool.origin.span, &args));
        }
        if best / 4 == RELATED {
            let args = [title(tool), row.number.to_string(), row.comment.trim().to_string()];
            found.push(Diagnostic::new(code::TOOL_TABLE_OTHER_TYPE, file, tool.origin.span, &args));
        }
        let number = u32::try_from(row.number).unwrap_or_default();
        loaded.push(Loaded { tool: tool.number, number, length: Some(row.offset[2] * table.unit) });
    }
    (loaded, found)
}

/// `other`: the tool of the file that has the only row already.
fn missing(tool: &Tool, other: Option<&Tool>, table: &Table<'_>, file: FileId) -> Diagnostic {
    let args = [table.name.clone(), title(tool)];
    let d = Diagnostic::new(code::TOOL_TABLE_NO_SUCH_TOOL, file, tool.origin.span, &args);
    if let Some(other) = other {
        return d.note(format!("the row that fits is {} ({}) already", title(other), other.name));
    }
    let same = |r: &&gr_interp::Tool| (r.diameter * table.unit - tool.diameter).abs() < DIAMETER;
    match table.rows.rows.iter().skip(1).find(same) {
        Some(r) => d.note(format!("T{} has this diameter, but its remark says `{}`", r.number, r.comment.trim())),
        None => d,
    }
}

/// For people: type, diameter, edge radius.
pub fn title(tool: &Tool) -> String {
    let kind = tool.kind.to_ascii_lowercase().replace('_', " ");
    let radius = if tool.edge_radius > 0.0 { format!(" R{}", tool.edge_radius) } else { String::new() };
    format!("{kind} D{}{radius}", tool.diameter)
}

/// Tools that were numbered `T7` by whoever wrote the file keep their numbers, if all of them are.
pub fn own_numbers(tools: &[Tool]) -> Vec<Loaded> {
    let number = |t: &Tool| t.name.strip_prefix('T').and_then(|n| n.parse::<u32>().ok()).filter(|n| (1..100_000).contains(n));
    let all: Option<Vec<u32>> = tools.iter().map(number).collect();
    let Some(numbers) = all else { return Vec::new() };
    let mut seen = numbers.clone();
    seen.sort_unstable();
    seen.dedup();
    if seen.len() < numbers.len() {
        return Vec::new();
    }
    tools.iter().zip(numbers).map(|(t, number)| Loaded { tool: t.number, number, length: None }).collect()
}

/// How well a type fits: named as the file names it, and of a type that does the same work.
const EXACT: u32 = 4;
const RELATED: u32 = 2;

/// How well a row fits a tool; none: not at all.
fn fit(tool: &Tool, row: &gr_interp::Tool, unit: f64) -> Option<u32> {
    if (row.diameter * unit - tool.diameter).abs() > DIAMETER {
        return None;
    }
    let kind = match kind_in(&row.comment) {
        None => 1,
        Some(k) if k == dense(&tool.kind) => EXACT,
        Some(k) => match (type_of(&k), type_of(&dense(&tool.kind))) {
            (Some(a), Some(b)) if a.0 == b.0 => EXACT - 1,
            (Some(a), Some(b)) if a.1 == b.1 => RELATED,
            _ => return None,
        },
    };
    let ball = dense(&tool.kind).starts_with("BALL");
    let radius = match radius_in(&row.comment) {
        Some(r) if (r - tool.edge_radius).abs() < RADIUS => 2,
        Some(_) if !ball => return None,
        None if tool.edge_radius > 0.0 && !ball => 0,
        _ => 1,
    };
    Some(kind * 4 + radius)
}

fn dense(text: &str) -> String {
    text.chars().filter(char::is_ascii_alphanumeric).map(|c| c.to_ascii_uppercase()).collect()
}

/// Types as the standard and as machinists call them. Names of one row are one type; types of one group do the same
/// work, more or less, and that is told.
const TYPES: [(u32, &[&str]); 21] = [
    (0, &["ENDMILL", "SLOTDRILL", "FLATENDMILL"]),
    (0, &["FACEMILL", "SHELLMILL"]),
    (1, &["BALLENDMILL", "BALLNOSEENDMILL", "BALLNOSE", "BALLMILL"]),
    (2, &["BULLNOSEENDMILL", "BULLNOSE", "CORNERRADIUS", "TOROID"]),
    (3, &["TWISTDRILL", "DRILL", "CARBIDEDRILL"]),
    (3, &["SPADEDRILL"]),
    (4, &["CENTERDRILL", "CENTREDRILL"]),
    (4, &["SPOTDRILL", "SPOTTINGDRILL"]),
    (5, &["COUNTERSINK", "COUNTERSINKINGTOOL"]),
    (5, &["CHAMFER", "CHAMFERMILL"]),
    (6, &["COUNTERBORE", "COUNTERBORINGTOOL"]),
    (7, &["REAMER", "REAMING"]),
    (8, &["TAPEREDREAMER"]),
    (9, &["TAPPINGTOOL", "TAP"]),
    (10, &["TAPEREDTAP"]),
    (11, &["BORINGTOOL", "BORINGBAR", "BORINGHEAD"]),
    (12, &["TSLOTMILL", "WOODRUFFKEYSEATMILL"]),
    (12, &["SLOTMILL", "SIDEMILL"]),
    (13, &["DOVETAILMILL"]),
    (14, &["TAPEREDENDMILL"]),
    (15, &["THREADMILL"]),
];

/// The types as entities of part 111 of 2002, row by row.
const ENTITIES: [&str; TYPES.len()] = [
    "ENDMILL", "FACEMILL", "BALL_ENDMILL", "BULLNOSE_ENDMILL", "TWIST_DRILL", "SPADE_DRILL", "CENTERDRILL", "CENTERDRILL", "COUNTERSINK",
    "COUNTERSINK", "COUNTERBORE", "REAMER", "TAPERED_REAMER", "TAP", "TAPERED_TAP", "BORING_TOOL", "T_SLOT_MILL", "SIDE_MILL",
    "DOVETAIL_MILL", "TAPERED_ENDMILL", "THREAD_MILL",
];

fn entity(dense: &str) -> String {
    type_of(dense).map_or("ENDMILL", |(row, _)| ENTITIES[row]).to_string()
}

/// A tool of a plan as a plan describes it.
pub fn described(tool: &Tool) -> Described {
    let number = i32::try_from(tool.number).unwrap_or(i32::MAX);
    let length = tool.length.unwrap_or(0.0);
    Described { number, kind: entity(&dense(&tool.kind)), diameter: tool.diameter, length, edge_radius: tool.edge_radius }
}

/// A row of a tool table, with what its remark says, as a plan describes it; `unit` is that of the table, mm.
pub fn described_row(row: &gr_interp::Tool, unit: f64) -> Described {
    Described {
        number: row.number,
        kind: entity(&kind_in(&row.comment).unwrap_or_default()),
        diameter: row.diameter * unit,
        length: row.offset[2] * unit,
        edge_radius: radius_in(&row.comment).unwrap_or(0.0),
    }
}

/// Row of the table and group of a type.
fn type_of(kind: &str) -> Option<(usize, u32)> {
    TYPES.iter().enumerate().find(|(_, (_, names))| names.contains(&kind)).map(|(row, (group, _))| (row, *group))
}

/// The type that a remark names: the longest name in it.
fn kind_in(remark: &str) -> Option<String> {
    let text = dense(remark);
    let names = TYPES.iter().flat_map(|(_, names)| names.iter()).filter(|n| text.contains(**n));
    names.max_by_key(|n| n.len()).map(|n| (*n).to_string())
}

/// The edge radius that a remark names: `R2`, `r0.5`.
fn radius_in(remark: &str) -> Option<f64> {
    let mut words = remark.split([' ', ',', ';', '\t']);
    words.find_map(|w| w.strip_prefix(['R', 'r'])?.trim_start_matches('=').parse::<f64>().ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tool(kind: &str, diameter: f64, edge_radius: f64) -> Tool {
        Tool {
            kind: kind.into(),
            diameter,
            edge_radius,
            number: 1,
            ..Default::default()
        }
    }

    fn chosen(t: Tool, text: &str, unit: f64) -> Option<u32> {
        let (rows, _) = gr_interp::read_tools(text, FileId(1));
        let table = Table { name: "t.tbl".into(), rows: &rows, unit };
        assign(&[t], &table, FileId(0)).0.first().map(|l| l.number)
    }

    #[test]
    fn a_row_is_one_tool() {
        let (rows, _) = gr_interp::read_tools("T1 P1 D6\nT2 P2 D6\nT3 P3 D6 ;drill\n", FileId(1));
        let table = Table { name: "t.tbl".into(), rows: &rows, unit: 1.0 };
        let kinds = ["ENDMILL", "CENTER_DRILL", "TWIST_DRILL", "REAMER"];
        let tools: Vec<Tool> = kinds.iter().zip(1..).map(|(k, number)| Tool { number, ..tool(k, 6.0, 0.0) }).collect();
        let (loaded, found) = assign(&tools, &table, FileId(0));
        let mut numbers: Vec<(u32, u32)> = loaded.iter().map(|l| (l.tool, l.number)).collect();
        numbers.sort_unstable();
        assert_eq!(numbers, [(1, 1), (2, 2), (3, 3)]);
        let errors: Vec<_> = found.iter().filter(|d| d.code == code::TOOL_TABLE_NO_SUCH_TOOL).collect();
        assert!(errors.len() == 1 && errors[0].message.contains("reamer") && errors[0].notes[0].contains("already"), "{found:?}");
    }

    #[test]
    fn another_type_is_told_or_refused() {
        let told = |kind: &str, remark: &str| {
            let (rows, _) = gr_interp::read_tools(&format!("T1 P1 D6 ;{remark}\n"), FileId(1));
            let table = Table { name: "t.tbl".into(), rows: &rows, unit: 1.0 };
            assign(&[tool(kind, 6.0, 0.0)], &table, FileId(0)).1.iter().map(|d| d.code).collect::<Vec<_>>()
        };
        assert_eq!(told("CENTER_DRILL", "spot drill"), [code::TOOL_TABLE_OTHER_TYPE]);
        assert_eq!(told("ENDMILL", "face mill"), [code::TOOL_TABLE_OTHER_TYPE]);
        assert_eq!(told("TWIST_DRILL", "drill"), []);
        assert_eq!(told("TAPERED_ENDMILL", "thread mill"), [code::TOOL_TABLE_NO_SUCH_TOOL]);
        assert_eq!(told("T_SLOT_MILL", "dovetail mill"), [code::TOOL_TABLE_NO_SUCH_TOOL]);
    }

    #[test]
    fn type_diameter_and_radius_decide() {
        let table = "T3 P1 D6 ;center drill\nT5 P2 D6 ;end mill 6 mm\nT7 P3 D6 ;twist drill\nT9 P4 D4\nT11 P5 D6 ;ball nose R3\nT12 P6 D6 ;bull nose R0.5\nT13 P7 D6 ;bull nose R1\n";
        assert_eq!(chosen(tool("TWIST_DRILL", 6.0, 0.0), table, 1.0), Some(7));
        assert_eq!(chosen(tool("CENTER_DRILL", 6.0, 0.0), table, 1.0), Some(3));
        assert_eq!(chosen(tool("FACEMILL", 6.0, 0.0), table, 1.0), Some(5));
        assert_eq!(chosen(tool("BALL_ENDMILL", 6.0, 3.0), table, 1.0), Some(11));
        assert_eq!(chosen(tool("BULLNOSE_ENDMILL", 6.0, 1.0), table, 1.0), Some(13));
        assert_eq!(chosen(tool("BALL_ENDMILL", 4.0, 2.0), table, 1.0), Some(9));
        assert_eq!(chosen(tool("REAMER", 6.0, 0.0), table, 1.0), None);
        assert_eq!(chosen(tool("TWIST_DRILL", 6.01, 0.0), table, 1.0), None);
        assert_eq!(chosen(tool("TWIST_DRILL", 6.35, 0.0), "T1 P1 D0.25 ;1/4 drill\n", 25.4), Some(1));
    }
}
