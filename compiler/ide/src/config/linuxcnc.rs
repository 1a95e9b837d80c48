//! Files of a LinuxCNC machine: its INI file, of which those keys are explained that programs depend on here, and its
//! parameter file (`.var`). Facts: LinuxCNC 2.9 documentation, INI configuration, and G-code overview, parameters.

use gr_text::Span;

use super::lines;
use crate::gcode::doc::number;
use crate::{Completion, CompletionKind, Fold, Hover, Item, ItemKind};

/// What a key of an INI file means to programs. `AXIS_?`: the section of an axis.
const KEYS: &[(&str, &str, &str)] = &[
    ("RS274NGC", "PARAMETER_FILE", "File with parameters that outlast a program: work offsets, home positions."),
    ("RS274NGC", "SUBROUTINE_PATH", "Folders in which files of subroutines are looked for, with `:` between them."),
    ("RS274NGC", "RS274NGC_STARTUP_CODE", "Block that is run before every program."),
    ("RS274NGC", "REMAP", "Makes a code call a subroutine: `M400 modalgroup=10 argspec=Pq ngc=myprocedure`."),
    ("RS274NGC", "ORIENT_OFFSET", "Degrees added to R of M19."),
    ("RS274NGC", "CENTER_ARC_RADIUS_TOLERANCE_INCH", "How far the radii at both ends of an arc may differ, in inch programs."),
    ("RS274NGC", "CENTER_ARC_RADIUS_TOLERANCE_MM", "How far the radii at both ends of an arc may differ, in mm programs."),
    ("RS274NGC", "PARAMETER_G73_PECK_CLEARANCE", "Lift that breaks the chip in G73, machine units (2.10)."),
    ("RS274NGC", "PARAMETER_G83_PECK_CLEARANCE", "Height above the last peck at which the rapid ends in G83, machine units (2.10)."),
    ("EMCIO", "TOOL_TABLE", "The tool table."),
    ("TRAJ", "LINEAR_UNITS", "The machine's unit of length: `mm` or `inch`."),
    ("TRAJ", "SPINDLES", "How many spindles the machine has."),
    ("TRAJ", "MAX_LINEAR_VELOCITY", "Largest speed along the path, machine units per second."),
    ("TRAJ", "MAX_VELOCITY", "Largest speed along the path, machine units per second."),
    ("TRAJ", "ARC_BLEND_ENABLE", "Whether corners are rounded by arcs: 1 or 0."),
    ("TRAJ", "ARC_BLEND_OPTIMIZATION_DEPTH", "Blocks that are looked ahead."),
    ("TRAJ", "ARC_BLEND_GAP_CYCLES", "Shortest piece between two blends, in cycles of the servo."),
    ("TRAJ", "ARC_BLEND_RAMP_FREQ", "How fast the acceleration may change, Hz."),
    ("TRAJ", "ARC_BLEND_KINK_RATIO", "Share of the acceleration that a kink may take."),
    ("EMCMOT", "SERVO_PERIOD", "Cycle of the servo, ns."),
    ("DISPLAY", "PROGRAM_PREFIX", "Folder of programs; subroutines are looked for there first."),
    ("DISPLAY", "MAX_FEED_OVERRIDE", "Largest override of the feed: 1.2 is 120 %."),
    ("WIZARD", "WIZARD_ROOT", "Folder in which subroutines are looked for last."),
    ("AXIS_?", "MIN_LIMIT", "Smallest position of the axis, machine units or degrees."),
    ("AXIS_?", "MAX_LIMIT", "Largest position of the axis, machine units or degrees."),
    ("AXIS_?", "MAX_VELOCITY", "Largest speed of the axis, per second."),
    ("AXIS_?", "MAX_ACCELERATION", "Largest acceleration of the axis, per second squared."),
    ("AXIS_?", "WRAPPED_ROTARY", "A rotary axis that knows 0 to 360 degrees only."),
    ("AXIS_?", "LOCKING_INDEXER_JOINT", "Joint that is unlocked for G0 moves of this axis."),
];

/// Whether an INI file is one of LinuxCNC: others are none of ours.
pub fn is_machine_ini(text: &str) -> bool {
    text.lines().any(|l| ["[RS274NGC]", "[EMC]", "[EMCIO]", "[TRAJ]", "[KINS]"].iter().any(|s| l.trim_start().starts_with(s)))
}

fn section_of(line: &str) -> Option<&str> {
    line.trim_start().strip_prefix('[')?.split_once(']').map(|s| s.0)
}

/// The section that a byte is in, and its line.
fn place(text: &str, offset: u32) -> (&str, u32, &str) {
    let (mut section, mut here) = ("", (text.len() as u32, ""));
    for (start, line) in lines(text) {
        if start > offset {
            break;
        }
        section = section_of(line).unwrap_or(section);
        here = (start, line);
    }
    (section, here.0, here.1)
}

fn fits(pattern: &str, section: &str) -> bool {
    match pattern.strip_suffix('?') {
        Some(head) => section.strip_prefix(head).is_some_and(|axis| axis.len() == 1),
        None => pattern == section,
    }
}

/// Explains the key of the line at a byte.
pub fn ini_hover(text: &str, offset: u32) -> Option<Hover> {
    let (section, start, line) = place(text, offset);
    let key = line.split_once('=')?.0.split_whitespace().next().filter(|k| !k.starts_with(['#', ';']))?;
    let from = start + line.find(key)? as u32;
    let span = Span::new(from, from + key.len() as u32);
    if offset > start + line.len() as u32 {
        return None;
    }
    let known = KEYS.iter().find(|(s, k, _)| *k == key && fits(s, section));
    let what = known.map_or("Programs do not depend on it here, unless they read it as `#<_ini[section]key>`.", |k| k.2);
    Some(Hover { span, text: format!("**[{section}] {key}**\n\n{what}\n\n*LinuxCNC 2.9 documentation, INI configuration*") })
}

/// Keys that the section at a byte can have.
pub fn ini_complete(text: &str, offset: u32) -> Vec<Completion> {
    let (section, start, line) = place(text, offset);
    let before = line.get(..(offset.saturating_sub(start)) as usize).unwrap_or(line);
    if before.contains(['=', '#', ';', '[']) {
        return Vec::new();
    }
    let typed = before.trim_start();
    let replace = Span::new(offset - typed.len() as u32, offset);
    let known = KEYS.iter().filter(|(s, k, _)| fits(s, section) && k.starts_with(&typed.to_uppercase()));
    known
        .map(|(_, key, what)| Completion {
            label: (*key).into(),
            insert: format!("{key} = "),
            snippet: false,
            detail: String::new(),
            documentation: (*what).into(),
            kind: CompletionKind::Word,
            rank: 0,
            replace,
        })
        .collect()
}

/// Its sections.
pub fn ini_outline(text: &str) -> Vec<Item> {
    let mut items: Vec<Item> = Vec::new();
    for (start, line) in lines(text) {
        let end = start + line.len() as u32;
        if let Some(name) = section_of(line) {
            let span = Span::new(start, end);
            items.push(Item { kind: ItemKind::Section, name: name.into(), detail: String::new(), range: span, span, children: Vec::new() });
        } else if let Some(last) = items.last_mut().filter(|_| !line.trim().is_empty()) {
            last.range.end = end;
        }
    }
    items
}

/// The same to be folded.
pub fn ini_folds(text: &str) -> Vec<Fold> {
    let index = gr_text::LineIndex::new(text.as_bytes());
    let line = |at: u32| index.position(at).0;
    let folds = ini_outline(text).into_iter().map(|i| Fold { first: line(i.range.start), last: line(i.range.end), comment: false });
    folds.filter(|f| f.last > f.first).collect()
}

/// Says what the parameter in the line at a byte is.
pub fn vars_hover(text: &str, offset: u32) -> Option<Hover> {
    let (_, start, line) = place(text, offset);
    let mut words = line.split_whitespace();
    let name = words.next().filter(|n| n.bytes().all(|b| b.is_ascii_digit()))?;
    let def = gr_spec::parameter(name)?;
    let value = words.next().and_then(|v| v.parse::<f64>().ok()).map_or(String::new(), |v| format!("\n\nIts value: `{}`", number(v, 6)));
    let unit = if def.unit.is_empty() { String::new() } else { format!(" ({})", def.unit) };
    let from = start + line.find(name)? as u32;
    let span = Span::new(from, start + line.trim_end().len() as u32);
    Some(Hover { span, text: format!("**#{name}**{unit}\n\n{}{value}\n\n*{}*", def.what, def.source) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_and_parameters() {
        let ini = "# mine\n[TRAJ]\nLINEAR_UNITS = mm\nSPINDLES = 1\n\n[AXIS_X]\nMIN_LIMIT = -1\nHOME = 0\n\n";
        let at = |what: &str| ini.find(what).expect("there") as u32;
        let told = |what: &str| ini_hover(ini, at(what)).map(|h| h.text).unwrap_or_default();
        assert!(told("LINEAR").starts_with("**[TRAJ] LINEAR_UNITS**\n\nThe machine's unit of length"));
        assert!(told("MIN_L").contains("Smallest position") && told("HOME").contains("do not depend") && told("# mine").is_empty());
        assert_eq!(ini_outline(ini).iter().map(|i| i.name.as_str()).collect::<Vec<_>>(), ["TRAJ", "AXIS_X"]);
        assert_eq!(ini_folds(ini), [Fold { first: 1, last: 3, comment: false }, Fold { first: 5, last: 7, comment: false }]);
        let keys: Vec<String> = ini_complete(&ini.replace("HOME = 0", "MAX_"), at("HOME") + 4).into_iter().map(|c| c.label).collect();
        assert_eq!(keys, ["MAX_LIMIT", "MAX_VELOCITY", "MAX_ACCELERATION"]);
        assert!(is_machine_ini(ini) && !is_machine_ini("[core]\nx = 1\n"));
        let vars = "5161\t0.0\n5221\t12.5\n";
        let h = vars_hover(vars, 12).expect("a parameter");
        assert!(h.text.starts_with("**#5221**") && h.text.contains("`12.5`"), "{}", h.text);
        assert!(vars_hover("", 0).is_none() && vars_hover("nothing\n", 2).is_none());
    }
}
