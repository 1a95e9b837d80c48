//! Setup sheet: what the person at the machine needs before pressing start. Tools with their work, offsets,
//! extents, times. Text for the terminal, JSON for other programs, HTML for paper.

use gr_ir::geometry::Extent;
use gr_ir::measure::{Range, Rates, Report, ToolUse, report};
use gr_ir::{Note, Op, Program};
use std::fmt::Write as _;

/// What the sheet is made with.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Options {
    /// Name of the program.
    pub title: String,
    /// Rapid rates and tool change time.
    pub rates: Rates,
    /// Rows of the tool table.
    pub tools: Vec<ToolRow>,
    /// Rails and positioners of the machine.
    pub external: Vec<Standing>,
}

/// Where a rail or positioner has to stand while the program runs.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Standing {
    /// Name on the controller.
    pub name: String,
    /// mm, or degrees where it turns.
    pub position: f64,
    /// It turns.
    pub turns: bool,
    /// It carries the machine rather than the part.
    pub carries_machine: bool,
}

impl Standing {
    fn text(&self) -> String {
        let unit = if self.turns { "°" } else { " mm" };
        let carries = if self.carries_machine { "machine" } else { "part" };
        format!("stands at {}{unit}, carries the {carries}", number(self.position))
    }
}

/// What a tool table says of a tool.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct ToolRow {
    /// Number.
    pub number: i32,
    /// Diameter, mm; zero when the table names none.
    pub diameter: f64,
    /// The person's own words.
    pub comment: String,
}

/// A finished sheet.
#[derive(Clone, PartialEq, Debug)]
pub struct Sheet {
    title: String,
    report: Report,
    rates: Rates,
    external: Vec<Standing>,
}

/// Gathers everything.
pub fn sheet(program: &Program, options: &Options) -> Sheet {
    let mut report = report(program, &options.rates);
    tool_notes(program, &mut report);
    for tool in &mut report.tools {
        if let Some(row) = options.tools.iter().find(|r| r.number == tool.tool) {
            from_table(tool, row);
        }
    }
    Sheet { title: options.title.clone(), report, rates: options.rates, external: options.external.clone() }
}

/// The table knows the tool better than the program's comments do; a row the program itself wrote (G10 L1) is
/// newer than both.
fn from_table(tool: &mut ToolUse, row: &ToolRow) {
    if !row.comment.trim().is_empty() {
        tool.note = Some(row.comment.trim().to_owned());
    }
    if row.diameter != 0.0 {
        tool.diameter.get_or_insert(row.diameter);
    }
}

/// A comment that begins with the tool's number (`T3 drill 5`), or else the one in the block of its first change,
/// describes the tool.
fn tool_notes(program: &Program, report: &mut Report) {
    let mut notes: Vec<(gr_ir::Source, &str)> = Vec::new();
    for step in program.steps() {
        if let Op::Note(Note::Comment | Note::Message, text) = step.op {
            let text = text.trim();
            if !text.is_empty() && !text.starts_with("interpreter:") {
                notes.push((step.source, text));
            }
        }
    }
    for tool in report.tools.iter_mut().filter(|t| t.tool >= 0) {
        let named = notes.iter().find(|(_, text)| describes(text, tool.tool));
        let first = tool.first;
        let there = || notes.iter().find(|(s, _)| s.file == first.file && s.line == first.line);
        tool.note = named.or_else(there).map(|(_, t)| (*t).to_owned());
    }
}

/// Whether a comment begins with `T` and this number.
fn describes(text: &str, tool: i32) -> bool {
    let Some(rest) = text.strip_prefix(['T', 't']) else {
        return false;
    };
    let digits = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
    rest[..digits].parse() == Ok(tool)
}

/// 1 = G54 … 9 = G59.3.
fn offset_name(number: u8) -> String {
    match number {
        1..=6 => format!("G{}", 53 + number),
        7..=9 => format!("G59.{}", number - 6),
        n => format!("offset {n}"),
    }
}

fn number(v: f64) -> String {
    gr_text::figures::number(v, 3)
}

fn range(r: &Range, factor: f64) -> String {
    match r.0 {
        None => "-".into(),
        Some((a, b)) if number(a * factor) == number(b * factor) => number(a * factor),
        Some((a, b)) => format!("{} - {}", number(a * factor), number(b * factor)),
    }
}

fn span(e: &Extent, axis: usize) -> String {
    if e.is_empty() {
        return "-".into();
    }
    format!("{} … {}", number(e.min[axis]), number(e.max[axis]))
}

/// Hours, minutes, seconds.
pub(crate) fn clock(ns: u64) -> String {
    let s = (ns + 500_000_000) / 1_000_000_000;
    format!("{}:{:02}:{:02}", s / 3600, s / 60 % 60, s % 60)
}

fn tool_name(tool: i32) -> String {
    if tool < 0 { "none named".into() } else { format!("T{tool}") }
}

fn coolant(t: &ToolUse) -> &'static str {
    match t.coolant {
        (true, true) => "flood, mist",
        (true, false) => "flood",
        (false, true) => "mist",
        _ => "off",
    }
}

fn works(t: &ToolUse) -> String {
    let names: Vec<String> = (1..=9).filter(|n| t.work >> n & 1 == 1).map(offset_name).collect();
    names.join(" ")
}

fn speed(t: &ToolUse) -> String {
    match (t.rpm.0, t.surface.0) {
        (_, None) => format!("{} rpm", range(&t.rpm, 1.0)),
        (None, _) => format!("{} m/min", range(&t.surface, 0.06)),
        _ => format!("{} rpm, {} m/min", range(&t.rpm, 1.0), range(&t.surface, 0.06)),
    }
}

/// In one radian.
const DEGREES: f64 = 180.0 / std::f64::consts::PI;

fn feed(t: &ToolUse) -> String {
    let all = [
        (&t.feed, 60.0, "mm/min"),
        (&t.feed_per_rev, 1.0, "mm/rev"),
        (&t.feed_angular, DEGREES * 60.0, "°/min"),
        (&t.feed_angular_per_rev, DEGREES, "°/rev"),
    ];
    let used: Vec<String> = all.iter().filter(|(r, ..)| r.0.is_some()).map(|(r, k, unit)| format!("{} {unit}", range(r, *k))).collect();
    if used.is_empty() { "-".into() } else { used.join(", ") }
}

/// What the person must know beyond numbers.
fn remarks(sheet: &Sheet) -> Vec<String> {
    let r = &sheet.report;
    let mut out = Vec::new();
    if r.totals.untimed > 0 {
        out.push(format!("{} moves have no feed or a stopped spindle: their time is not counted.", r.totals.untimed));
    }
    if r.run_time {
        out.push("The program probes or waits for inputs: path and time depend on what the machine finds.".into());
    }
    let known = sheet.rates.dynamics.filter(gr_ir::timing::Dynamics::has_speeds);
    out.push(match known {
        Some(d) if d.known() => "Times are those of the machine's speeds, accelerations and corners; nobody turns the feed down.".into(),
        Some(_) => "Times are estimates without acceleration; rapids at the speeds of the machine's axes.".into(),
        None => format!("Times are estimates without acceleration; rapids at {} mm/min.", number(sheet.rates.rapid * 60.0)),
    });
    out
}

impl Sheet {
    /// What was measured.
    pub fn report(&self) -> &Report {
        &self.report
    }

    /// For the terminal.
    pub fn text(&self) -> String {
        let r = &self.report;
        let mut out = String::new();
        // Writing to a string cannot fail.
        let _ = writeln!(out, "Setup sheet: {}\n", self.title);
        let t = &r.totals;
        let _ = writeln!(
            out,
            "Time     {}  (cutting {}, rapids {}, waiting {})",
            clock(t.ns()),
            clock(t.feed_ns),
            clock(t.rapid_ns),
            clock(t.wait_ns)
        );
        let _ = writeln!(
            out,
            "Path     {} m at feed, {} m rapid",
            number(t.feed_nm as f64 / 1e9),
            number(t.rapid_nm as f64 / 1e9)
        );
        for (axis, name) in ["X", "Y", "Z"].into_iter().enumerate() {
            let _ = writeln!(
                out,
                "{name}        {} mm at feed; {} all moves; {} in the machine",
                span(&r.cut, axis),
                span(&r.all, axis),
                span(&r.machine, axis)
            );
        }
        for (n, axes) in &r.offsets {
            let values: Vec<String> = axes[..3].iter().map(|v| number(*v)).collect();
            let _ = writeln!(out, "{:<8} X{} Y{} Z{}", offset_name(*n), values[0], values[1], values[2]);
        }
        for e in &self.external {
            let _ = writeln!(out, "{:<8} {}", e.name, e.text());
        }
        out.push('\n');
        out.push_str(&table(&self.tool_rows()));
        for c in &r.cycles {
            let _ = writeln!(out, "\nG{:<7} {} passes, {}", f64::from(c.code) / 10.0, c.passes, clock(c.totals.ns()));
        }
        for s in &r.stretches {
            let name = format!("{:?}", s.marker).to_lowercase();
            let _ = writeln!(out, "{name} {} {}: {}", s.code, s.text, clock(s.totals.ns()));
        }
        out.push('\n');
        for remark in remarks(self) {
            let _ = writeln!(out, "{remark}");
        }
        out
    }

    fn tool_rows(&self) -> Vec<[String; 10]> {
        let head = ["Tool", "Line", "Diameter", "Offset Z", "Speed", "Feed", "Coolant", "Work", "Z at feed", "Time"];
        let mut rows = vec![head.map(str::to_owned)];
        for t in &self.report.tools {
            let name = match &t.note {
                Some(note) if describes(note, t.tool) => note.clone(),
                Some(note) => format!("{} {note}", tool_name(t.tool)),
                None => tool_name(t.tool),
            };
            rows.push([
                name,
                if t.tool < 0 { "-".into() } else { (u64::from(t.first.line) + 1).to_string() },
                t.diameter.map_or("-".into(), number),
                range(&t.offset_z, 1.0),
                speed(t),
                feed(t),
                coolant(t).into(),
                works(t),
                span(&t.cut, 2),
                clock(t.totals.ns()),
            ]);
        }
        rows
    }

    /// For other programs: mm, rpm, mm/min, degrees per minute, s.
    pub fn json(&self) -> String {
        let r = &self.report;
        let tools: Vec<_> = r.tools.iter().map(tool_json).collect();
        let offsets: Vec<_> = r
            .offsets
            .iter()
            .map(|(n, axes)| serde_json::json!({"name": offset_name(*n), "number": n, "values": axes}))
            .collect();
        let external: Vec<_> = self
            .external
            .iter()
            .map(|e| {
                let unit = if e.turns { "degrees" } else { "mm" };
                let carries = if e.carries_machine { "machine" } else { "part" };
                serde_json::json!({"name": e.name, "carries": carries, "position": rounded(e.position), "unit": unit})
            })
            .collect();
        let cycles: Vec<_> = r
            .cycles
            .iter()
            .map(|c| serde_json::json!({"code": f64::from(c.code) / 10.0, "passes": c.passes, "seconds": c.totals.seconds()}))
            .collect();
        let stretches: Vec<_> = r
            .stretches
            .iter()
            .map(|s| {
                serde_json::json!({
                    "kind": format!("{:?}", s.marker).to_lowercase(), "code": s.code, "text": s.text,
                    "line": u64::from(s.source.line) + 1, "seconds": s.totals.seconds(),
                })
            })
            .collect();
        let value = serde_json::json!({
            "format": "gcc-robot setup sheet", "version": 1, "program": self.title,
            "seconds": seconds(&r.totals), "feed_mm": r.totals.feed_nm as f64 / 1e6,
            "rapid_mm": r.totals.rapid_nm as f64 / 1e6, "moves": r.totals.moves, "untimed_moves": r.totals.untimed,
            "depends_on_run_time": r.run_time,
            "extent": {"feed": extent_json(&r.cut), "all": extent_json(&r.all), "machine": extent_json(&r.machine)},
            "offsets": offsets, "external": external, "tools": tools, "cycles": cycles, "stretches": stretches, "remarks": remarks(self),
        });
        let mut text = serde_json::to_string_pretty(&value).unwrap_or_default();
        text.push('\n');
        text
    }

    /// For paper.
    pub fn html(&self) -> String {
        let r = &self.report;
        let mut out = String::from(HEAD);
        let title = escape(&self.title);
        let _ =
            writeln!(out, "<title>Setup sheet: {title}</title>\n<h1>Setup sheet</h1>\n<p class=\"name\">{title}</p>");
        out.push_str("<table class=\"sums\">\n");
        let t = &r.totals;
        let mut pair = |name: &str, value: String| {
            let _ = writeln!(out, "<tr><th>{name}</th><td>{}</td></tr>", escape(&value));
        };
        pair("Time", clock(t.ns()));
        pair("At feed", format!("{}, {} m", clock(t.feed_ns), number(t.feed_nm as f64 / 1e9)));
        pair("Rapids", format!("{}, {} m", clock(t.rapid_ns), number(t.rapid_nm as f64 / 1e9)));
        pair("Waiting", clock(t.wait_ns));
        for (axis, name) in ["X", "Y", "Z"].into_iter().enumerate() {
            pair(&format!("{name} at feed"), format!("{} mm", span(&r.cut, axis)));
        }
        for (axis, name) in ["X", "Y", "Z"].into_iter().enumerate() {
            pair(&format!("{name} in the machine"), format!("{} mm", span(&r.machine, axis)));
        }
        for (n, axes) in &r.offsets {
            let values: Vec<String> = axes[..3].iter().map(|v| number(*v)).collect();
            pair(&offset_name(*n), format!("X {}   Y {}   Z {}", values[0], values[1], values[2]));
        }
        for e in &self.external {
            pair(&e.name, e.text());
        }
        out.push_str("</table>\n<table class=\"tools\">\n");
        for (i, row) in self.tool_rows().iter().enumerate() {
            let tag = if i == 0 { "th" } else { "td" };
            let cells: String = row.iter().map(|c| format!("<{tag}>{}</{tag}>", escape(c))).collect();
            let _ = writeln!(out, "<tr>{cells}</tr>");
        }
        out.push_str("</table>\n");
        for remark in remarks(self) {
            let _ = writeln!(out, "<p>{}</p>", escape(&remark));
        }
        out.push_str("</html>\n");
        out
    }
}

const HEAD: &str = "<!doctype html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n<style>\n\
body { font: 14px sans-serif; margin: 2em; color: #282c34 }\nh1 { margin: 0 }\n\
.name { font-size: 18px; margin: .2em 0 1em }\ntable { border-collapse: collapse; margin: 0 0 1.5em }\n\
th, td { text-align: left; padding: 3px 10px; border-bottom: 1px solid #ccc; vertical-align: top }\n\
.sums th { font-weight: normal; color: #666 }\n.tools { width: 100% }\n\
@media print { body { margin: 0; font-size: 11px } }\n</style>\n";

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

fn seconds(t: &gr_ir::measure::Totals) -> serde_json::Value {
    serde_json::json!({
        "total": t.seconds(), "feed": t.feed_ns as f64 / 1e9, "rapid": t.rapid_ns as f64 / 1e9,
        "wait": t.wait_ns as f64 / 1e9,
    })
}

/// Without the last bits of a conversion: 1200, not 1199.9999999999998.
fn rounded(v: f64) -> f64 {
    libm::round(v * 1e9) / 1e9 + 0.0
}

fn extent_json(e: &Extent) -> serde_json::Value {
    if e.is_empty() { serde_json::Value::Null } else { serde_json::json!({"min": e.min.map(rounded), "max": e.max.map(rounded)}) }
}

fn range_json(r: &Range, factor: f64) -> serde_json::Value {
    r.0.map_or(serde_json::Value::Null, |(a, b)| serde_json::json!([rounded(a * factor), rounded(b * factor)]))
}

fn tool_json(t: &ToolUse) -> serde_json::Value {
    let work: Vec<String> = (1..=9).filter(|n| t.work >> n & 1 == 1).map(offset_name).collect();
    serde_json::json!({
        "tool": if t.tool < 0 { serde_json::Value::Null } else { t.tool.into() },
        "note": t.note, "changes": t.changes, "line": u64::from(t.first.line) + 1, "diameter_mm": t.diameter.map(rounded),
        "offset_z_mm": range_json(&t.offset_z, 1.0), "rpm": range_json(&t.rpm, 1.0),
        "surface_m_min": range_json(&t.surface, 0.06), "feed_mm_min": range_json(&t.feed, 60.0),
        "feed_mm_rev": range_json(&t.feed_per_rev, 1.0), "feed_deg_min": range_json(&t.feed_angular, DEGREES * 60.0),
        "feed_deg_rev": range_json(&t.feed_angular_per_rev, DEGREES),
        "flood": t.coolant.0, "mist": t.coolant.1, "work_offsets": work,
        "extent": extent_json(&t.cut), "seconds": seconds(&t.totals), "feed_mm": t.totals.feed_nm as f64 / 1e6,
    })
}

/// Columns as wide as their widest cell.
fn table(rows: &[[String; 10]]) -> String {
    let width = |c: usize| rows.iter().map(|r| r[c].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..10).map(width).collect();
    let mut out = String::new();
    for row in rows {
        let mut line = String::new();
        for (cell, width) in row.iter().zip(&widths) {
            let _ = write!(line, "{cell:<width$}  ");
        }
        out.push_str(line.trim_end());
        out.push('\n');
    }
    out
}
