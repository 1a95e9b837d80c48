//! The files a machine is set up from: tool table (`.tbl`), stored parameters (`.var`) and INI file.
//!
//! Text in, tables out; what is wrong with a line becomes a diagnostic. Only [`save_parameters`] touches the
//! disk.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::Path;

use gr_canon::Version;
use gr_spec::{IniKey, IniKind};
use gr_text::{Diagnostic, FileId, Span, code};

use crate::{Ini, Tool, ToolTable};

/// Rows of a tool table, the spindle's included.
pub const POCKETS: usize = 1001;
/// Parameters are numbered below this.
pub const MAX_PARAMETER: u32 = 5602;
/// INI files may include others this deep.
const INCLUDE_DEPTH: usize = 16;

/// Lines with their place, without line ends.
fn lines(text: &str) -> impl Iterator<Item = (u32, &str)> {
    let mut at = 0;
    text.split_inclusive('\n').map(move |raw| {
        let start = at;
        at += raw.len() as u32;
        (start, raw.trim_end_matches(['\n', '\r']))
    })
}

fn span_of(start: u32, part: &str) -> Span {
    Span::new(start, start + part.len() as u32)
}

// ---- tool table ----------------------------------------------------------------------------------------

/// A table without tools: only the spindle's empty row.
pub fn no_tools() -> ToolTable {
    ToolTable { rows: vec![empty_row()] }
}

/// Remark of tools that stand in for a table nobody named.
pub const ASSUMED: &str = "assumed";

/// Without a tool table nobody knows which tools there are: all of them, without length and diameter.
pub fn assumed_tools() -> ToolTable {
    let mut table = no_tools();
    for number in 1..POCKETS as i32 {
        table.rows.push(Tool { number, pocket: number, comment: ASSUMED.into(), ..Tool::default() });
    }
    table
}

/// Whether rows of a table are only assumed: there is none, though a machine file may have given some of them.
pub fn assumed(table: &ToolTable) -> bool {
    table.rows.iter().any(|r| &*r.comment == ASSUMED)
}

fn empty_row() -> Tool {
    Tool { number: -1, pocket: -1, ..Tool::default() }
}

/// Reads a tool table. Tools go into rows 1, 2, … in file order, as on a machine without a random tool
/// changer; a tool without P goes into row 0.
pub fn read_tools(text: &str, file: FileId) -> (ToolTable, Vec<Diagnostic>) {
    let mut table = no_tools();
    let (mut found, mut rows) = (Vec::new(), BTreeMap::new());
    for (number, (start, line)) in lines(text).enumerate() {
        let body = line.split(';').next().unwrap_or("");
        if line.starts_with(';') || body.trim().is_empty() {
            continue;
        }
        for lost in behind_tabs(body) {
            let at = start + (lost.as_ptr() as usize - line.as_ptr() as usize) as u32;
            found.push(Diagnostic::new(code::TOOL_TABLE_TAB, file, span_of(at, lost), &[lost.replace('\t', " ")]));
        }
        match tool_line(line) {
            Err((word, why)) => {
                let at = start + (word.as_ptr() as usize - line.as_ptr() as usize) as u32;
                found.push(Diagnostic::new(code::TOOL_TABLE_BAD_LINE, file, span_of(at, word), &[why]));
            }
            Ok(tool) if tool.pocket < 0 => {
                found.push(Diagnostic::new(code::TOOL_TABLE_NO_POCKET, file, span_of(start, body.trim_end()), &[]));
                table.rows[0] = Tool { pocket: 0, ..tool };
            }
            Ok(_) if table.rows.len() == POCKETS => {
                let span = span_of(start, body.trim_end());
                found.push(Diagnostic::new(code::TOOL_TABLE_TOO_MANY, file, span, &[(POCKETS - 1).to_string()]));
                break;
            }
            Ok(tool) => {
                // Of two rows with one number the first is found.
                let first = rows.entry(tool.number).or_insert(number + 1);
                if *first != number + 1 {
                    let args = [tool.number.to_string(), first.to_string()];
                    found.push(Diagnostic::new(code::TOOL_TABLE_TWICE, file, span_of(start, body.trim_end()), &args));
                }
                table.rows.push(tool);
            }
        }
    }
    (table, found)
}

/// What the controller loses: what stands behind the tab that ends a number.
fn behind_tabs(body: &str) -> impl Iterator<Item = &str> {
    let lost = |w: &'_ str| -> Option<usize> {
        let number = w.get(1..)?.trim_start_matches('\t');
        let (_, rest) = number.split_once('\t')?;
        Some(rest.trim_start_matches('\t').len())
    };
    body.split([' ', '\r']).filter_map(move |w| w.get(w.len() - lost(w)?..)).filter(|lost| !lost.is_empty())
}

/// One line; on failure the word to blame and what is wrong with it. A tool without P has pocket −1.
fn tool_line(line: &str) -> Result<Tool, (&str, String)> {
    let mut tool = empty_row();
    let (words, comment) = line.split_once(';').unwrap_or((line, ""));
    tool.comment = comment.trim().into();
    for word in words.split([' ', '\r']).filter(|w| !w.is_empty()) {
        let mut rest = word.chars();
        let letter = rest.next().unwrap_or(' ').to_ascii_uppercase();
        // A tab before a number is skipped, one behind it ends it.
        let rest = rest.as_str().trim_start_matches('\t').split('\t').next().unwrap_or("");
        let bad = || (word, format!("`{word}` has no number"));
        let real = || scan_real(rest).map(|(v, _)| v).ok_or_else(bad);
        let whole = || scan_int(rest).map(|(v, _)| v).ok_or_else(bad);
        match letter {
            'T' => tool.number = whole()?,
            'P' => tool.pocket = whole()?.max(0),
            'D' => tool.diameter = real()?,
            'I' => tool.front_angle = real()?,
            'J' => tool.back_angle = real()?,
            'Q' => tool.orientation = whole()?,
            _ => match "XYZABCUVW".find(letter) {
                Some(axis) => tool.offset[axis] = real()?,
                None => return Err((word, format!("no word of a tool table begins with {}", if letter == '\t' { "a tab".into() } else { format!("`{letter}`") }))),
            },
        }
    }
    Ok(tool)
}

/// The table as text that [`read_tools`] and LinuxCNC read.
pub fn write_tools(table: &ToolTable) -> String {
    use std::fmt::Write as _;
    let mut out = String::new();
    for tool in table.rows.iter().skip(1).filter(|t| t.number != -1) {
        let mut line = format!("T{:<3} P{:<3}", tool.number, tool.pocket);
        let offsets = "XYZABCUVW".chars().zip(tool.offset);
        let values = [('D', tool.diameter)].into_iter().chain(offsets).chain([('I', tool.front_angle), ('J', tool.back_angle)]);
        for (letter, value) in values.filter(|(_, v)| *v != 0.0) {
            write!(line, " {letter}{value:+.6}").expect("a string takes everything");
        }
        if tool.orientation != 0 {
            write!(line, " Q{}", tool.orientation).expect("a string takes everything");
        }
        writeln!(out, "{line} ;{}", tool.comment).expect("a string takes everything");
    }
    out
}

// ---- parameters ----------------------------------------------------------------------------------------

/// Parameters that a parameter file always has: home positions, G92, work offsets with their rotation.
pub fn required_parameters() -> impl Iterator<Item = u32> {
    let offsets = (0..9).flat_map(|n| (5220 + 20 * n + u32::from(n > 0))..=(5230 + 20 * n));
    (5161..=5169).chain(5181..=5189).chain(5210..=5219).chain(offsets)
}

/// Reads a parameter file. Lines that do not begin with two numbers are passed over.
pub fn read_parameters(text: &str, file: FileId) -> Result<BTreeMap<u32, f64>, Box<Diagnostic>> {
    let mut values = BTreeMap::new();
    let mut last = 0;
    for (start, line) in lines(text) {
        let Some((number, value)) = parameter_line(line) else { continue };
        let fault = |code, args: &[String]| Box::new(Diagnostic::new(code, file, span_of(start, line), args));
        let number = match u32::try_from(number) {
            Ok(n) if n > 0 && n < MAX_PARAMETER => n,
            _ => return Err(fault(code::PARAMETER_FILE_NUMBER_RANGE, &[number.to_string()])),
        };
        if number <= last {
            return Err(fault(code::PARAMETER_FILE_ORDER, &[number.to_string(), last.to_string()]));
        }
        last = number;
        values.insert(number, value);
    }
    Ok(values)
}

fn parameter_line(line: &str) -> Option<(i32, f64)> {
    let (number, rest) = scan_int(line)?;
    let (value, _) = scan_real(rest)?;
    Some((number, value))
}

/// The new text of a parameter file: every parameter that the old text has, and every required one.
pub fn write_parameters(old: &BTreeMap<u32, f64>, value: &dyn Fn(u32) -> f64) -> String {
    let mut out = Vec::new();
    let numbers: std::collections::BTreeSet<u32> = old.keys().copied().chain(required_parameters()).collect();
    for n in numbers {
        gr_canon::push_int(&mut out, i64::from(n));
        out.push(b'\t');
        gr_canon::push_fixed::<6>(&mut out, value(n));
        out.push(b'\n');
    }
    String::from_utf8(out).expect("only digits")
}

/// Writes the parameter file at `path` anew: complete beside it first, then the old one becomes `.bak`.
pub fn save_parameters(path: &Path, old: &BTreeMap<u32, f64>, value: &dyn Fn(u32) -> f64) -> std::io::Result<()> {
    let beside = |suffix: &str| {
        let mut name = path.as_os_str().to_owned();
        name.push(suffix);
        std::path::PathBuf::from(name)
    };
    let new = beside(".new");
    std::fs::write(&new, write_parameters(old, value))?;
    if path.exists() {
        let backup = beside(".bak");
        // A missing old backup is fine, and so is a file system without links.
        let _ = std::fs::remove_file(&backup);
        if std::fs::hard_link(path, &backup).is_err() {
            std::fs::copy(path, &backup)?;
        }
    }
    std::fs::rename(new, path)
}

/// A whole number at the start of `text`, as C's `%d` reads it.
fn scan_int(text: &str) -> Option<(i32, &str)> {
    let text = text.trim_start();
    let sign = usize::from(text.starts_with(['+', '-']));
    let digits = text[sign..].bytes().take_while(u8::is_ascii_digit).count();
    let (number, rest) = text.split_at(sign + digits);
    let value: i64 = number.parse().ok()?;
    Some((value.clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32, rest))
}

/// A number at the start of `text`, as C's `%lf` reads it: decimal, or hexadecimal behind `0x`.
fn scan_real(text: &str) -> Option<(f64, &str)> {
    let text = text.trim_start();
    if let Some(found) = scan_hexadecimal(text) {
        return Some(found);
    }
    let bytes = text.as_bytes();
    let digits = |from: usize| bytes[from.min(bytes.len())..].iter().take_while(|b| b.is_ascii_digit()).count();
    let mut end = usize::from(text.starts_with(['+', '-']));
    let whole = digits(end);
    end += whole;
    let mut fraction = 0;
    if bytes.get(end) == Some(&b'.') {
        fraction = digits(end + 1);
        end += 1 + fraction;
    }
    if whole + fraction == 0 {
        return None;
    }
    if matches!(bytes.get(end), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
        let exponent = digits(end + 1 + sign);
        if exponent > 0 {
            end += 1 + sign + exponent;
        }
    }
    let (number, rest) = text.split_at(end);
    number.parse().ok().map(|v| (v, rest))
}

/// `0x1A`, `-0x1.8`, `0x1p4`.
fn scan_hexadecimal(text: &str) -> Option<(f64, &str)> {
    let (sign, rest) = match text.as_bytes().first()? {
        b'-' => (-1.0, &text[1..]),
        b'+' => (1.0, &text[1..]),
        _ => (1.0, text),
    };
    let digits = rest.strip_prefix("0x").or_else(|| rest.strip_prefix("0X"))?;
    let (mut value, mut scale, mut end, mut seen, mut point) = (0.0, 1.0, 0, false, false);
    for c in digits.chars() {
        match c.to_digit(16) {
            Some(d) if point => {
                scale /= 16.0;
                value += f64::from(d) * scale;
            }
            Some(d) => value = value * 16.0 + f64::from(d),
            None if c == '.' && !point => point = true,
            None => break,
        }
        seen |= c != '.';
        end += 1;
    }
    if !seen {
        return None;
    }
    let mut rest = &digits[end..];
    if let Some(power) = rest.strip_prefix(['p', 'P']) {
        let length = usize::from(power.starts_with(['+', '-'])) + power.trim_start_matches(['+', '-']).bytes().take_while(u8::is_ascii_digit).count();
        if let Ok(by) = power[..length].parse::<i32>() {
            value *= libm::exp2(f64::from(by));
            rest = &power[length..];
        }
    }
    Some((sign * value, rest))
}

// ---- INI -----------------------------------------------------------------------------------------------

/// Gives the text of an included file.
pub type Loader<'a> = &'a mut dyn FnMut(&Path) -> Option<String>;

/// Reads an INI file. `load` gives included files; without it `#INCLUDE` lines are remarks, as they are for
/// the real `rs274`.
pub fn read_ini(text: &str, file: FileId, folder: Option<&Path>, load: Option<Loader<'_>>) -> (Ini, Vec<Diagnostic>) {
    let mut reader = IniReader {
        ini: Ini { values: BTreeMap::new(), folder: folder.map(Path::to_path_buf) },
        section: Some(String::new()),
        seen: Default::default(),
        found: Vec::new(),
        file,
        load,
    };
    reader.text(text, 0, None);
    (reader.ini, reader.found)
}

/// Words that switch something on in LinuxCNC 2.10; 2.9 passes over them.
const ON: [&str; 3] = ["yes", "true", "on"];
const OFF: [&str; 3] = ["no", "false", "off"];

/// What the controller would have to find where it finds this value; nothing where it takes it. A value that it does not
/// take is as good as none: it says nothing and goes on with its own.
fn wanted(section: &str, key: &str, value: &str) -> Option<Cow<'static, str>> {
    let known = IniKey::find(&section.to_ascii_uppercase(), key)?;
    let word = ON.iter().chain(&OFF).any(|w| value.eq_ignore_ascii_case(w));
    let inside = |n: i64| known.least.is_none_or(|l| l <= n) && known.most.is_none_or(|m| n <= m);
    match (known.kind, value.parse::<i32>()) {
        (IniKind::Text, _) => None,
        (IniKind::Number, _) => {
            let limits = crate::arc::spiral_limits_of(key);
            match value.parse::<f64>() {
                Ok(v) if limits.is_some_and(|l| !l.contains(&v)) => Some("it is too small or too large".into()),
                Ok(v) if v.is_finite() => None,
                _ => Some("it has to be a number, with nothing behind it".into()),
            }
        }
        (IniKind::Switch, Ok(n)) if !(0..=1).contains(&n) => Some("it has to be 1 or 0".into()),
        (_, Ok(n)) if !inside(n.into()) => {
            let [least, most] = [known.least, known.most].map(|b| b.map_or(String::new(), |b| b.to_string()));
            Some(format!("it has to be from {least} to {most}").into())
        }
        (_, Ok(_)) => None,
        (IniKind::Flag | IniKind::Switch, Err(_)) if word => Some("LinuxCNC 2.9 wants 1 or 0, words are read from 2.10 on".into()),
        (_, Err(_)) => Some("it has to be a whole number, with nothing behind it".into()),
    }
}

struct IniReader<'a> {
    ini: Ini,
    /// The present section; none while its lines can't be found.
    section: Option<String>,
    seen: std::collections::BTreeSet<String>,
    found: Vec<Diagnostic>,
    file: FileId,
    load: Option<Loader<'a>>,
}

impl IniReader<'_> {
    /// Reads a file; `blame` is the line of the main file that included it.
    fn text(&mut self, text: &str, depth: usize, blame: Option<Span>) {
        let mut lines = lines(text);
        while let Some((start, first)) = lines.next() {
            let mut line = first.to_string();
            let mut end = start + first.len() as u32;
            // A backslash at the end of a line joins the next one to it.
            while line.ends_with('\\') && !line.trim_start().starts_with(['#', ';']) {
                line.pop();
                let Some((next_start, next)) = lines.next() else { break };
                line.push_str(next.trim_start());
                end = next_start + next.len() as u32;
            }
            self.line(line.trim(), blame.unwrap_or(Span::new(start, end)), depth, blame);
        }
    }

    fn line(&mut self, line: &str, span: Span, depth: usize, blame: Option<Span>) {
        if let Some(name) = included(line) {
            self.include(name, span, depth);
        } else if line.is_empty() || line.starts_with(['#', ';']) {
        } else if let Some(rest) = line.strip_prefix('[')
            && let Some((name, _)) = rest.split_once(']')
        {
            // The controller looks names up in capitals, exactly, and stops at the end of the first such section.
            let first = self.seen.insert(name.to_string());
            self.section = (first && in_capitals(name)).then(|| name.to_ascii_lowercase());
        } else if let Some((key, value)) = line.split_once('=')
            && let Some(key) = key.split_ascii_whitespace().next()
        {
            if let Some(section) = self.section.clone().filter(|_| in_capitals(key)) {
                let key = (section, key.to_ascii_lowercase());
                if key.0 == "rs274ngc" && key.1 == "remap" {
                    let earlier = self.ini.values.get(&key).map_or(&[][..], Vec::as_slice);
                    for (wrong, what) in crate::remap::check_remap(value, earlier) {
                        let code = if wrong { code::INI_REMAP } else { code::INI_REMAP_DOUBT };
                        self.found.push(Diagnostic::new(code, self.file, blame.unwrap_or(span), &[what]));
                    }
                }
                let value = value.trim();
                let values = self.ini.values.entry(key.clone()).or_default();
                // The first value of a key is the one that counts.
                if values.is_empty()
                    && !value.is_empty()
                    && let capitals = key.1.to_ascii_uppercase()
                    && let Some(wanted) = wanted(&key.0, &capitals, value)
                {
                    let words = [value.to_string(), capitals, wanted.to_string()];
                    self.found.push(Diagnostic::new(code::INI_VALUE, self.file, blame.unwrap_or(span), &words));
                }
                values.push(value.to_string());
            }
        } else {
            self.found.push(Diagnostic::new(code::INI_BAD_LINE, self.file, blame.unwrap_or(span), &[]));
        }
    }

    fn include(&mut self, name: &str, span: Span, depth: usize) {
        let path = self.ini.folder.as_deref().unwrap_or(Path::new("")).join(name);
        let Some(load) = &mut self.load else { return };
        let text = if depth < INCLUDE_DEPTH { load(&path) } else { None };
        match text {
            Some(text) => self.text(&text, depth + 1, Some(span)),
            None => self.found.push(Diagnostic::new(code::INI_INCLUDE, self.file, span, &[name.to_string()])),
        }
    }
}

fn in_capitals(name: &str) -> bool {
    !name.contains(|c: char| c.is_ascii_lowercase())
}

/// `#INCLUDE name`; in another spelling it is a remark.
fn included(line: &str) -> Option<&str> {
    let name = line.strip_prefix("#INCLUDE")?.strip_prefix([' ', '\t'])?.trim();
    (!name.is_empty()).then_some(name)
}

impl Ini {
    /// First value of a key that the file spells in capitals; `section` and `key` in any case.
    pub fn get(&self, section: &str, key: &str) -> Option<&str> {
        self.all(section, key).first().map(String::as_str)
    }
    /// All values of a key, in file order. The search of the controller ends at an empty one.
    pub fn all(&self, section: &str, key: &str) -> &[String] {
        let told = self.values.get(&(section.to_ascii_lowercase(), key.to_ascii_lowercase())).map_or(&[][..], Vec::as_slice);
        &told[..told.iter().position(String::is_empty).unwrap_or(told.len())]
    }
    /// First value of a key as a number: the whole value has to be one, as for the controller.
    pub fn number(&self, section: &str, key: &str) -> Option<f64> {
        self.get(section, key)?.parse().ok()
    }
    /// First value of a key as an integer: the whole value has to be one.
    pub fn integer(&self, section: &str, key: &str) -> Option<i32> {
        self.get(section, key)?.parse().ok()
    }
    /// A switch: 0 is off, 1 is on, other integers too where the key is no [`IniKind::Switch`]; words switch from 2.10 on.
    /// Nothing where the value is none that the controller takes.
    pub fn switch(&self, section: &str, key: &str, version: Version) -> Option<bool> {
        let is = |words: &[&str]| self.get(section, key).is_some_and(|v| words.iter().any(|w| v.eq_ignore_ascii_case(w)));
        let known = IniKey::find(&section.to_ascii_uppercase(), &key.to_ascii_uppercase());
        let narrow = known.is_some_and(|k| k.kind == IniKind::Switch);
        match self.integer(section, key) {
            Some(n) if (0..=1).contains(&n) || !narrow => Some(n != 0),
            None if version == Version::V2_10 && is(&ON) => Some(true),
            None if version == Version::V2_10 && is(&OFF) => Some(false),
            _ => None,
        }
    }
    /// `[TRAJ] LINEAR_UNITS`, in any of the spellings that the controller knows.
    pub fn machine_units(&self) -> Option<gr_canon::Units> {
        use gr_canon::Units::{Inch, Mm};
        let text = self.get("TRAJ", "LINEAR_UNITS")?.to_ascii_lowercase();
        match text.as_str() {
            "mm" | "metric" | "auto" => Some(Mm),
            "in" | "inch" | "imperial" => Some(Inch),
            other => other.parse::<f64>().ok().map(|v| if v < 0.5 { Inch } else { Mm }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const FILE: FileId = FileId(3);

    #[test]
    fn tools_in_file_order() {
        let text = "; header\nT1 P1 D0.125000 Z+0.511 ;1/8 end mill\n\nt7 p30 x1 y2 w-3 I95 J155 Q6\r\n";
        let (table, found) = read_tools(text, FILE);
        assert!(found.is_empty());
        assert_eq!(table.rows.len(), 3);
        assert_eq!((table.rows[0].number, table.rows[1].number, table.rows[2].pocket), (-1, 1, 30));
        assert_eq!(table.rows[1].offset[2], 0.511);
        assert_eq!(&*table.rows[1].comment, "1/8 end mill");
        let t7 = &table.rows[2];
        assert_eq!((t7.offset[8], t7.front_angle, t7.back_angle, t7.orientation), (-3.0, 95.0, 155.0, 6));
    }

    #[test]
    fn bad_tool_lines_are_named() {
        let (table, found) = read_tools("T1 P1\nT2 P2 K5\nT3 PX\nT4 Z1\n", FILE);
        assert_eq!(table.rows.len(), 2);
        assert_eq!(table.rows[0].number, 4, "no pocket: the spindle's row");
        let seen: Vec<_> = found.iter().map(|d| (d.code, d.primary().1)).collect();
        assert_eq!(
            seen,
            [
                (code::TOOL_TABLE_BAD_LINE, Span::new(12, 14)),
                (code::TOOL_TABLE_BAD_LINE, Span::new(18, 20)),
                (code::TOOL_TABLE_NO_POCKET, Span::new(21, 26)),
            ]
        );
    }

    /// As LinuxCNC 2.9 reads them: words end at blanks, numbers at tabs.
    #[test]
    fn tabs_end_numbers_and_no_words() {
        let (table, found) = read_tools("T1 P1\tZ1 D.5\nT2\tP2 Z1 D.5\t\nT\t3 P3\n\tT4 P4\n", FILE);
        let rows: Vec<_> = table.rows[1..].iter().map(|t| (t.number, t.pocket, t.offset[2], t.diameter)).collect();
        assert_eq!(rows, [(1, 1, 0.0, 0.5), (3, 3, 0.0, 0.0)]);
        assert_eq!((table.rows[0].number, table.rows[0].offset[2]), (2, 1.0), "no pocket: the spindle's row");
        let seen: Vec<_> = found.iter().map(|d| d.code).collect();
        assert_eq!(seen, [code::TOOL_TABLE_TAB, code::TOOL_TABLE_TAB, code::TOOL_TABLE_NO_POCKET, code::TOOL_TABLE_BAD_LINE]);
    }

    #[test]
    fn full_table() {
        let text: String = (1..=1003).map(|n| format!("T{n} P{n}\n")).collect();
        let (table, found) = read_tools(&text, FILE);
        assert_eq!((table.rows.len(), found.len()), (POCKETS, 1));
    }

    #[test]
    fn tools_survive_writing() {
        let (table, _) = read_tools("T1 P1 D6 Z-1.5 ;mill\nT20 P3 X1 I10 J-20 Q4 ;lathe\n", FILE);
        assert_eq!(read_tools(&write_tools(&table), FILE), (table, vec![]));
    }

    #[test]
    fn required_parameters_are_119() {
        let all: Vec<u32> = required_parameters().collect();
        assert_eq!(all.len(), 119);
        assert!(all.is_sorted() && all.contains(&5220) && all.contains(&5230) && all.contains(&5241));
        assert!(!all.contains(&5240) && *all.last().unwrap() == 5390);
    }

    #[test]
    fn parameter_files() {
        let values = read_parameters("junk\n5161\t1.500000\n 5220 2\n", FILE).unwrap();
        assert_eq!(values.get(&5161), Some(&1.5));
        let text = write_parameters(&values, &|n| if n == 5162 { -0.5 } else { values.get(&n).copied().unwrap_or(0.0) });
        assert!(text.starts_with("5161\t1.500000\n5162\t-0.500000\n5163\t0.000000\n"));
        assert_eq!(text.lines().count(), 119);
        let with_more = write_parameters(&read_parameters("31 7\n", FILE).unwrap(), &|_| 0.0);
        assert!(with_more.starts_with("31\t0.000000\n5161"));
        assert_eq!(read_parameters("9 1\n5602 0\n", FILE).unwrap_err().code, code::PARAMETER_FILE_NUMBER_RANGE);
        assert_eq!(read_parameters("-3 1\n", FILE).unwrap_err().code, code::PARAMETER_FILE_NUMBER_RANGE);
        let twice = read_parameters("9 1\n9 2\n", FILE).unwrap_err();
        assert_eq!((twice.code, twice.primary().1), (code::PARAMETER_FILE_ORDER, Span::new(4, 7)));
    }

    #[test]
    fn parameter_file_on_disk() {
        let folder = std::env::temp_dir().join(format!("gcc-robot-var-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("p.var");
        save_parameters(&path, &BTreeMap::new(), &|_| 0.0).unwrap();
        assert!(!folder.join("p.var.bak").exists());
        save_parameters(&path, &BTreeMap::new(), &|_| 1.0).unwrap();
        assert!(std::fs::read_to_string(&path).unwrap().starts_with("5161\t1.000000\n"));
        assert!(std::fs::read_to_string(folder.join("p.var.bak")).unwrap().starts_with("5161\t0.000000\n"));
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn ini_files() {
        let text = "# remark\n[RS274NGC]\nREMAP = M400 modalgroup=10 ngc=a\nREMAP= G88.1 modalgroup=1 ngc=b\n\
                    SUBROUTINE_PATH = a:\\\n  b\n; x\n[TRAJ]\nLINEAR_UNITS = mm\nnonsense\n";
        let (ini, found) = read_ini(text, FILE, None, None);
        assert_eq!(ini.all("rs274ngc", "Remap"), ["M400 modalgroup=10 ngc=a", "G88.1 modalgroup=1 ngc=b"]);
        assert_eq!(ini.get("RS274NGC", "SUBROUTINE_PATH"), Some("a:b"));
        assert_eq!(ini.machine_units(), Some(gr_canon::Units::Mm));
        assert_eq!(found.len(), 1);
        assert_eq!(&text[found[0].primary().1.range()], "nonsense");
    }

    #[test]
    fn hexadecimal_numbers_as_c_reads_them() {
        for (text, value, rest) in [("0x10", 16.0, ""), ("-0x1.8 D2", -1.5, " D2"), ("0x1p4;", 16.0, ";"), ("0xfg", 15.0, "g"), ("0x1p", 1.0, "p")] {
            assert_eq!(scan_real(text), Some((value, rest)), "{text}");
        }
        assert_eq!(scan_real("0x"), Some((0.0, "x")));
        let (table, _) = read_tools("T1 P1 Z0x10\n", FILE);
        assert_eq!(table.rows[1].offset[2], 16.0);
    }

    #[test]
    fn ini_names_are_exact_and_in_capitals() {
        let text = "[my]\nVALUE=1\n[MY]\nvalue=2\nVALUE=3\nVALUE2=4\nA X=5\n[MY]\nLATE=6\n[TWO ]\nA=7\n [FOUR] rest\nA=8\n";
        let (ini, found) = read_ini(text, FILE, None, None);
        assert!(found.is_empty());
        let number = |section: &str, key: &str| ini.number(section, key);
        assert_eq!((number("my", "value"), number("MY", "value2"), number("MY", "A")), (Some(3.0), Some(4.0), Some(5.0)));
        assert_eq!((number("MY", "LATE"), number("TWO", "A"), number("four", "a")), (None, None, Some(8.0)));
    }

    #[test]
    fn ini_includes() {
        let mut load = |path: &Path| (path == Path::new("d/x.inc")).then(|| "B=2\n#INCLUDE x.inc\n".to_string());
        let (ini, found) = read_ini("[A]\n#INCLUDE x.inc\nC=3\n", FILE, Some(Path::new("d")), Some(&mut load));
        assert_eq!((ini.all("a", "b").len(), ini.get("a", "c")), (16, Some("3")));
        assert_eq!((found.len(), found[0].code), (1, code::INI_INCLUDE), "a file that includes itself ends");
        let (_, found) = read_ini("# include this\n#include foo\n#  INCLUDE foo\n[A]\nB=1\n", FILE, Some(Path::new("d")), Some(&mut load));
        assert!(found.is_empty(), "{found:?}");
        let (ini, found) = read_ini("#INCLUDE x.inc\nC=3\n", FILE, None, None);
        assert_eq!((found.len(), ini.get("", "C")), (0, Some("3")));
    }

    proptest! {
        #[test]
        fn any_text_is_read(text in "[ -~\t\r\n]{0,200}|\\PC{0,60}") {
            let _ = read_tools(&text, FILE);
            let _ = read_parameters(&text, FILE);
            let _ = read_ini(&text, FILE, None, None);
        }
    }
}
