//! Everything there is to say about a file: Part 21, schema, rules and lints, one message per mistake.

use std::collections::{BTreeMap, BTreeSet};

use gr_p21::{Exchange, Fault};
use gr_spec::{Severity, code};
use gr_text::{Diagnostic, FileId, Fix, Span};

use crate::dialect::{Dialect, dialect, schema_names};
use crate::lint::Finding;
use crate::model::Model;
use crate::rules::{Origin, broken};

/// Reads `text` and says what is wrong with it, in file order.
pub fn diagnostics(text: &str, file: FileId) -> Vec<Diagnostic> {
    let exchange = gr_p21::parse(text.as_bytes());
    diagnostics_of(text.as_bytes(), &exchange, file)
}

/// As [`diagnostics`], of a file that was read already.
pub fn diagnostics_of(text: &[u8], exchange: &Exchange, file: FileId) -> Vec<Diagnostic> {
    diagnostics_while(text, exchange, file, &|| true).unwrap_or_default()
}

/// The same as long as somebody wants to know, which is asked between the layers of the check; then none.
pub fn diagnostics_while(text: &[u8], exchange: &Exchange, file: FileId, wanted: &dyn Fn() -> bool) -> Option<Vec<Diagnostic>> {
    let model = Model::new(text, exchange);
    let mut out = Out { text, exchange, file, faulty: vec![false; exchange.instances.len()], list: Vec::new() };
    for f in &exchange.faults {
        out.fault(f);
    }
    if exchange.faults.iter().any(|f| f.code == code::P21_NOT_AN_EXCHANGE_FILE) {
        return Some(out.list);
    }
    if !wanted() {
        return None;
    }
    let kind = dialect(&model);
    for f in gr_p21::check_header(text, exchange) {
        out.fault(&f);
    }
    out.schema(&model, kind);
    if understood(&model, kind) {
        out.layers(&model, kind, wanted);
    } else {
        out.dangling();
    }
    if exchange.cut {
        // What was cut off is referred to: that is the same mistake.
        out.list.retain(|d| d.code != code::P21_DANGLING_REFERENCE);
    }
    if !wanted() {
        return None;
    }
    out.lost_names();
    out.in_comments();
    out.list.sort_by_key(|d| (d.primary().1.start, d.primary().1.end));
    Some(out.list)
}

/// Whether the instances are worth comparing with ISO 14649.
fn understood(model: &Model<'_>, kind: Dialect) -> bool {
    match kind {
        Dialect::Unknown | Dialect::Missing => {
            let mut known = 0;
            let mut all = 0;
            for n in model.instances() {
                all += 1;
                known += usize::from(n.entity().is_some());
            }
            known * 2 >= all
        }
        other => other.is_14649(),
    }
}

/// Of more choices than these none is proposed.
const MOST_CHOICES: usize = 4;

/// Names of instances inside of comments, and where the comment begins.
fn swallowed(text: &[u8]) -> BTreeMap<&[u8], usize> {
    let find = |from: usize, what: &[u8]| text.get(from..)?.windows(2).position(|w| w == what).map(|n| from + n);
    let mut out = BTreeMap::new();
    let mut at = 0;
    while let Some(begin) = find(at, b"/*") {
        let end = find(begin + 2, b"*/").unwrap_or(text.len());
        let mut from = begin + 2;
        while let Some(n) = text[from..end].iter().position(|b| *b == b'#') {
            let name = from + n;
            let digits = text[name + 1..end].iter().take_while(|b| b.is_ascii_digit()).count();
            from = name + 1 + digits;
            if digits > 0 && text[from..end].trim_ascii_start().starts_with(b"=") {
                out.entry(&text[name..from]).or_insert(begin);
            }
        }
        at = end;
    }
    out
}

struct Out<'a> {
    text: &'a [u8],
    exchange: &'a Exchange,
    file: FileId,
    /// Statements that have had a message.
    faulty: Vec<bool>,
    list: Vec<Diagnostic>,
}

impl Out<'_> {
    /// The statement around a place.
    fn statement(&self, at: u32) -> Option<usize> {
        let after = self.exchange.instances.partition_point(|i| i.start <= at);
        let n = after.checked_sub(1)?;
        let i = &self.exchange.instances[n];
        (at <= i.end || i.damaged).then_some(n)
    }

    fn fault(&mut self, f: &Fault) {
        let mut d = Diagnostic::new(f.code, self.file, f.span, &f.args);
        if let Some((span, what)) = f.related {
            d = d.label(self.file, span, what);
        }
        d.fixes.extend(self.mends(f));
        self.list.push(d);
        if let Some(n) = self.statement(f.span.start) {
            self.faulty[n] = true;
        }
    }

    /// The edits that mend a fault, each by itself.
    fn mends(&self, f: &Fault) -> Vec<Fix> {
        let fix = |title: String, span: Span, new: String| Fix { title, edits: vec![(self.file, span, new)] };
        let at = |offset: u32| Span::new(offset, offset);
        let written = self.text.get(f.span.range()).and_then(|t| std::str::from_utf8(t).ok()).unwrap_or("");
        let word = |w: &str| !w.is_empty() && w.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_');
        let c = f.code;
        if c == code::P21_BARE_WORD && word(written) {
            let upper = format!(".{}.", written.to_ascii_uppercase());
            return vec![fix(format!("write {upper}: an enumeration"), f.span, upper), fix(format!("write '{written}': a string"), f.span, format!("'{written}'"))];
        }
        if c == code::P21_EMPTY_PARAMETER {
            return vec![fix("write `$`: not given".into(), at(f.span.start), "$".into())];
        }
        if c == code::P21_MISSING_ENDSEC {
            return vec![fix("write ENDSEC; before this line".into(), at(f.span.start), "ENDSEC;\n".into())];
        }
        if c == code::P21_IMPLEMENTATION_LEVEL {
            let later = self.exchange.sections.iter().any(|s| matches!(s.name, "ANCHOR" | "REFERENCE"));
            let level = if later { "'4;1'" } else { "'2;1'" };
            return vec![fix(format!("write {level}"), f.span, level.into())];
        }
        if c == code::P21_BAD_NUMBER
            && let Some(v) = written.parse::<f64>().ok().filter(|v| v.is_finite())
            && let new = real(v)
            && new.parse() == Ok(v)
        {
            return vec![fix(format!("write {new}"), f.span, new)];
        }
        if c == code::STEP_NEGATIVE_LENGTH
            && let Some(positive) = written.strip_prefix('-')
        {
            return vec![fix("take the sign away".into(), f.span, positive.into())];
        }
        if c == code::STEP_UNKNOWN_CHOICE {
            let choices = f.args.get(3).map_or("", String::as_str);
            let found = f.args.first().map_or("", String::as_str).to_ascii_uppercase();
            let away = |name: &str| crate::schema::distance(found.as_bytes(), name.as_bytes(), usize::MAX);
            let mut names: Vec<&str> = choices.split([' ', ',']).map(str::trim).filter(|n| word(n)).collect();
            // What is misspelt is meant; else any of a few.
            names.sort_by_key(|n| away(n));
            let near = names.first().is_some_and(|n| away(n) <= 1 + n.len() / 4);
            let some = if near { &names[..1] } else if names.len() <= MOST_CHOICES { &names[..] } else { &[] };
            return some.iter().map(|n| fix(format!("write .{n}."), f.span, format!(".{n}."))).collect();
        }
        if c == code::STEP_SHORT_CUTTING_COMPONENT {
            let end = self.statement(f.span.start).map_or(f.span.end, |n| self.exchange.instances[n].end) as usize;
            let close = self.text.get(f.span.start as usize..end).and_then(|t| t.iter().rposition(|b| *b == b')'));
            return close.map(|p| fix("add `,$` at the end".into(), at(f.span.start + p as u32), ",$".into())).into_iter().collect();
        }
        self.mend(f).into_iter().collect()
    }

    /// The edit that mends a fault, where there is only one.
    fn mend(&self, f: &Fault) -> Option<Fix> {
        let c = f.code;
        let arg = |n: usize| f.args.get(n).cloned();
        let (title, new) = if c == code::P21_STRAY_QUOTE {
            ("write an empty string".to_string(), "''".to_string())
        } else if c == code::P21_MISSING_SEMICOLON {
            let end = arg(1).filter(|end| !end.is_empty())?;
            (format!("end the statement with `{end}`"), end)
        } else if c == code::P21_LOWER_CASE || c == code::P21_BLANK_IN_KEYWORD || c == code::STEP_OTHER_SPELLING {
            (format!("write {}", arg(1)?), arg(1)?)
        } else if c == code::STEP_UNKNOWN_ENTITY {
            let meant = arg(1)?.strip_prefix("; did you mean ")?.trim_end_matches('?').to_string();
            (format!("write {meant}"), meant)
        } else if c == code::STEP_MISSING_NAME {
            ("write an empty string".to_string(), "''".to_string())
        } else {
            return None;
        };
        Some(Fix { title, edits: vec![(self.file, f.span, new)] })
    }

    fn schema(&mut self, model: &Model<'_>, kind: Dialect) {
        let header = model.header("FILE_SCHEMA").map(|h| h.span());
        let section = self.exchange.sections.iter().find(|s| s.name == "HEADER");
        let start = section.map_or(0, |s| s.span.start);
        let span = header.unwrap_or(Span::new(start, (self.text.len() as u32).min(start + 6)));
        let names = schema_names(model).join(", ");
        let row = match kind {
            Dialect::Ap238 => (code::STEP_AP238, vec![names]),
            Dialect::Product(what) => (code::STEP_NO_PROCESS, vec![what.to_string(), names]),
            Dialect::Unknown => (code::STEP_UNKNOWN_SCHEMA, vec![names]),
            Dialect::Missing if !self.exchange.instances.is_empty() && !self.schema_hurt(model) => (code::STEP_NO_SCHEMA, vec![]),
            _ => return,
        };
        let mut d = Diagnostic::new(row.0, self.file, span, &row.1);
        if matches!(kind, Dialect::Ap238 | Dialect::Product(_)) {
            d.notes = crate::product::structure(model);
        }
        self.list.push(d);
    }

    /// Whether the lack of schema names has had its message: a damaged FILE_SCHEMA, or no HEADER at all.
    fn schema_hurt(&self, model: &Model<'_>) -> bool {
        match model.header("FILE_SCHEMA") {
            Some(header) => self.faulty[header.index() as usize],
            None => match self.exchange.sections.iter().find(|s| s.name == "HEADER") {
                Some(h) => {
                    let inside = |d: &Diagnostic| (h.span.start..=h.span.end).contains(&d.primary().1.start);
                    let hurt = |d: &Diagnostic| d.code.def().slug.starts_with("p21/") && d.code != code::P21_HEADER_MISSING && inside(d);
                    self.list.iter().any(hurt)
                }
                None => !self.list.is_empty(),
            },
        }
    }

    /// An instance whose name is damaged is missed where it is referred to: that is one mistake.
    fn lost_names(&mut self) {
        let nameless = |d: &Diagnostic| {
            let before = self.text[..d.primary().1.start as usize].trim_ascii_end();
            let digits = before.iter().rev().take_while(|b| b.is_ascii_digit()).count();
            let name = &before[..before.len() - digits];
            let begins = before.ends_with(b";") || name.strip_suffix(b"#").is_some_and(|b| b.trim_ascii_end().ends_with(b";"));
            d.code == code::P21_DUPLICATE_ID || d.code == code::P21_UNEXPECTED && begins
        };
        let wanted = |d: &Diagnostic| {
            let written = self.text.get(d.primary().1.range()).unwrap_or_default();
            (d.code == code::P21_DANGLING_REFERENCE).then(|| String::from_utf8_lossy(written).into_owned())
        };
        let missing: BTreeSet<String> = self.list.iter().filter_map(wanted).collect();
        let nameless: Vec<usize> = (0..self.list.len()).filter(|n| nameless(&self.list[*n])).collect();
        if missing.is_empty() || missing.len() > nameless.len() {
            return;
        }
        let names = missing.into_iter().collect::<Vec<_>>().join(", ");
        self.list[nameless[0]].notes.push(format!("other instances refer to {names}, which no instance is: its name may be lost here"));
        self.list.retain(|d| d.code != code::P21_DANGLING_REFERENCE);
    }

    /// Instances that a comment has swallowed are told once for each comment.
    fn in_comments(&mut self) {
        let missed = |d: &Diagnostic| d.code == code::P21_DANGLING_REFERENCE;
        if !self.list.iter().any(missed) {
            return;
        }
        let swallowed = swallowed(self.text);
        let mut told: BTreeMap<usize, usize> = BTreeMap::new();
        for mut d in std::mem::take(&mut self.list) {
            let written = self.text.get(d.primary().1.range()).unwrap_or_default();
            let comment = swallowed.get(written).copied().filter(|_| missed(&d));
            let before = comment.map_or(0, |c| {
                let n = told.entry(c).or_default();
                *n += 1;
                *n - 1
            });
            if let Some(c) = comment.filter(|_| before == 0) {
                d = d.label(self.file, Span::new(c as u32, c as u32 + 2), "it stands inside this comment");
            }
            if before == 0 {
                self.list.push(d);
            }
        }
    }

    fn dangling(&mut self) {
        for (n, id) in self.exchange.dangling(self.text) {
            let v = self.exchange.values[n];
            let span = Span::new(v.start, v.start + v.len());
            if self.statement(v.start).is_none_or(|n| !self.faulty[n]) {
                self.list.push(Diagnostic::new(code::P21_DANGLING_REFERENCE, self.file, span, &[id.to_string()]));
            }
        }
    }

    /// The rest of them is left out as soon as nobody wants them.
    fn layers(&mut self, model: &Model<'_>, kind: Dialect, wanted: &dyn Fn() -> bool) {
        self.dangling();
        if !wanted() {
            return;
        }
        let hurt = self.faulty.clone();
        for f in crate::check::check(self.text, self.exchange) {
            // References to nothing are reported above, also those the schema can't see.
            let known = self.statement(f.span.start).is_some_and(|n| hurt[n]);
            if !known && f.code != code::P21_DANGLING_REFERENCE {
                self.fault(&f);
            }
        }
        for d in &self.list {
            if d.code == code::P21_DANGLING_REFERENCE
                && let Some(n) = self.statement(d.primary().1.start)
            {
                self.faulty[n] = true;
            }
        }
        if !wanted() {
            return;
        }
        // Another spelling is no reason to be silent about the rest.
        let mut quiet = self.faulty.clone();
        for d in self.list.iter().filter(|d| d.severity != Severity::Error) {
            if let Some(n) = self.statement(d.primary().1.start)
                && !hurt[n]
                && d.code == code::STEP_OTHER_SPELLING
            {
                quiet[n] = false;
            }
        }
        self.rules(model, &quiet);
        if !wanted() {
            return;
        }
        let findings = crate::lint::lint(model, &|n| quiet.get(n as usize) == Some(&true));
        for f in findings {
            self.finding(f, kind);
        }
    }

    fn rules(&mut self, model: &Model<'_>, quiet: &[bool]) {
        for (node, rule) in broken(model) {
            // Both speeds given: a lint explains the readings.
            let both = rule.entity == "milling_technology" && rule.label == "WR1" && node.attr("spindle").is_some();
            // The numbers it refers to are not what was meant where their statement has had its message.
            let rests = || node.references().any(|n| quiet[n.index() as usize] && n.references().next().is_none());
            if quiet[node.index() as usize] || both || rests() {
                continue;
            }
            let code = match rule.origin {
                Origin::Process => code::STEP_WHERE_RULE,
                Origin::Resource => code::STEP_RESOURCE_RULE,
            };
            let args = [node.keyword().to_string(), rule.says.to_string(), format!("{}.{}", rule.entity, rule.label)];
            let mut told = Diagnostic::new(code, self.file, node.keyword_span(), &args);
            // By its letter the rule forbids a row alone, which the same entity lets its attributes say.
            if rule.entity == "rectangular_pattern" && node.attr("number_of_rows").is_none_or(|v| v.integer().is_some_and(|rows| rows <= 1)) {
                told.severity = Severity::Warning;
                told = told.note("one row alone is read as it is meant; by the letter of the standard it is a GENERAL_PATTERN");
            }
            self.list.push(told);
        }
    }

    fn finding(&mut self, f: Finding, kind: Dialect) {
        let mut d = Diagnostic::new(f.code, self.file, f.span, &f.args);
        d.notes = f.notes;
        for (span, text) in f.labels {
            d = d.label(self.file, span, text);
        }
        if !f.also.is_empty() {
            let shown: Vec<String> = f.also.iter().take(6).map(|id| format!("#{id}")).collect();
            let more = f.also.len() - shown.len();
            let tail = if more > 0 { format!(" and {more} more") } else { String::new() };
            d = d.note(format!("the same in {}{tail}", shown.join(", ")));
        }
        if f.code == code::STEP_BOTH_SPEEDS && kind == Dialect::StepModeler {
            d = d.note("the file was written by STEP Modeler (ST-GENERATOR), which has units of its own");
        }
        d.fixes = self.readings(f.code, f.span, &f.args);
        self.list.push(d);
    }

    /// The values that may have been meant, where a number is in another unit than the standard's.
    fn readings(&self, c: gr_spec::Code, span: Span, args: &[String]) -> Vec<Fix> {
        if c == code::STEP_PROFILE_TWICE {
            return vec![Fix { title: "write `$` for this placement".into(), edits: vec![(self.file, span, "$".into())] }];
        }
        let of_tool = args.get(1).and_then(|a| a.parse::<f64>().ok());
        let written = self.text.get(span.range()).and_then(|t| std::str::from_utf8(t).ok()).and_then(|t| t.trim().parse::<f64>().ok());
        let Some(v) = written.filter(|v| v.is_finite()) else { return Vec::new() };
        let readings: &[(f64, &str)] = match c {
            code::STEP_FEED_UNIT => &[(v / 60.0, "m/min was meant"), (v / 60_000.0, "mm/min was meant")],
            code::STEP_SPINDLE_UNIT => &[(v / 60.0, "rpm was meant")],
            code::STEP_CUTSPEED_UNIT => &[(v / 60.0, "m/min was meant")],
            code::STEP_SPINDLE_SIGN => &[(-v, "the tool turns clockwise (M3)")],
            code::STEP_OVERLAP => &[(of_tool.unwrap_or(0.0), "millimetres were meant"), (v / 100.0, "percent was meant")],
            code::STEP_RATIO => &[(v / 100.0, "percent was meant")],
            code::STEP_TOLERANCE => &[(v / 1000.0, "micrometres were meant")],
            code::STEP_RADIANS => &[(v.to_degrees(), "radians were meant")],
            _ => &[],
        };
        // The share of a tool is a ratio.
        let sound = |(value, _): &&(f64, &str)| c != code::STEP_OVERLAP || (*value > 0.0 && *value < 1.0);
        let fix = |(value, why): &(f64, &str)| {
            let new = real(*value);
            Fix { title: format!("write {new}: {why}"), edits: vec![(self.file, span, new)] }
        };
        readings.iter().filter(sound).map(fix).collect()
    }
}

/// A number as Part 21 writes reals: with a decimal point, at most nine digits that count.
fn real(v: f64) -> String {
    let places = (8.0 - libm::floor(libm::log10(v.abs().max(1e-12)))).clamp(0.0, 15.0) as usize;
    let text = format!("{v:.places$}");
    if text.contains('.') { text.trim_end_matches('0').to_string() } else { format!("{text}.") }
}
