//! Names a controller accepts: made of letters, digits and `_`, short enough, unique, not reserved.

use crate::Output;
use gr_text::{Diagnostic, FileId, Span, code};
use std::collections::BTreeSet;

/// What names look like in a language.
#[derive(Clone, Copy)]
pub(crate) struct Rule {
    /// At most so many characters.
    pub longest: usize,
    /// Reserved words, upper case.
    pub reserved: &'static [&'static str],
    /// Capital letters only.
    pub upper: bool,
}

/// The names given so far. Capitals don't tell names apart.
pub(crate) struct Names {
    rule: Rule,
    taken: BTreeSet<String>,
    /// What was wanted and what was given.
    changed: Vec<(String, String)>,
}

impl Names {
    pub(crate) fn new(rule: Rule) -> Names {
        Names { rule, taken: BTreeSet::new(), changed: Vec::new() }
    }

    /// A name as near to the wanted one as the language allows; `prefix` where that begins with no letter.
    pub(crate) fn give(&mut self, wanted: &str, prefix: &str) -> String {
        let name = self.find(wanted, prefix);
        if !name.eq_ignore_ascii_case(wanted) {
            self.changed.push((wanted.to_string(), name.clone()));
        }
        name
    }

    /// The name of a program: one that is too long ends in three letters and digits made from the whole of it, so that
    /// programs that only differ further on keep different names.
    pub(crate) fn program(&mut self, wanted: &str, prefix: &str) -> String {
        let more = if wanted.starts_with(|c: char| c.is_ascii_alphabetic()) { 0 } else { prefix.len() };
        if wanted.chars().count() + more <= self.rule.longest {
            return self.give(wanted, prefix);
        }
        let start: String = wanted.chars().take(self.rule.longest.saturating_sub(3 + more)).collect();
        let name = self.find(&format!("{start}{}", digest(wanted)), prefix);
        self.changed.push((wanted.to_string(), name.clone()));
        name
    }

    /// The name of a part of a program, from the program's own name.
    pub(crate) fn part(&mut self, program: &str, number: usize) -> String {
        let tail = format!("_{number:03}");
        if program.len() + tail.len() <= self.rule.longest {
            return self.fresh(&format!("{program}{tail}"));
        }
        let start = &program[..self.rule.longest.saturating_sub(6).min(program.len())];
        self.fresh(&format!("{start}{}{number:03}", digest(program)))
    }

    /// From here on names may be so long.
    pub(crate) fn longer(&mut self, longest: usize) {
        self.rule.longest = longest;
    }

    /// A name for something of our own.
    pub(crate) fn fresh(&mut self, wanted: &str) -> String {
        self.find(wanted, "x")
    }

    /// Tells which names of the program are others in its text.
    pub(crate) fn tell(&self, out: &mut Output, title: &str) {
        for (wanted, name) in &self.changed {
            let args = [wanted.clone(), name.clone(), title.to_string()];
            out.findings.push(Diagnostic::new(code::VENDOR_NAME_CHANGED, FileId(0), Span::default(), &args));
        }
    }

    fn find(&mut self, wanted: &str, prefix: &str) -> String {
        let mut base: String = wanted.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
        if !base.starts_with(|c: char| c.is_ascii_alphabetic()) {
            base = format!("{prefix}{base}");
        }
        if self.rule.upper {
            base.make_ascii_uppercase();
        }
        base.truncate(self.rule.longest);
        let mut name = base.clone();
        for n in 2u64.. {
            if self.free(&name) {
                break;
            }
            let tail = format!("_{n}");
            name = base[..base.len().min(self.rule.longest.saturating_sub(tail.len()))].to_string() + &tail;
        }
        self.taken.insert(name.to_ascii_uppercase());
        name
    }

    fn free(&self, name: &str) -> bool {
        let upper = name.to_ascii_uppercase();
        !self.taken.contains(&upper) && !self.rule.reserved.contains(&upper.as_str()) && !predefined(&upper)
    }
}

/// Three capital letters and digits that depend on every character of a name (FNV-1a, 32 bits).
fn digest(name: &str) -> String {
    const DIGITS: &[u8; 36] = b"0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ";
    let hash = name.to_ascii_uppercase().bytes().fold(0x811c_9dc5_u32, |h, b| (h ^ u32::from(b)).wrapping_mul(0x0100_0193));
    (0..3).map(|i| char::from(DIGITS[(hash / 36u32.pow(i) % 36) as usize])).collect()
}

/// `V100`, `Z50`, `P12` …: the data that controllers come with are called so.
fn predefined(upper: &str) -> bool {
    let mut rest = upper.chars();
    matches!(rest.next(), Some('V' | 'Z' | 'P' | 'R')) && upper.len() > 1 && rest.all(|c| c.is_ascii_digit())
}

/// Whether a name that exists on the controller (a signal, a routine) can be written as it is.
pub(crate) fn plain(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_' || c == '$')
        && name.chars().all(|c| c.is_ascii_alphanumeric() || matches!(c, '_' | '$' | '.' | ':'))
}

pub(crate) use gr_machine::signal_number as number;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names() {
        let mut n = Names::new(Rule { longest: 8, reserved: &["MODULE"], upper: false });
        assert_eq!(n.give("module", "p"), "module_2");
        assert_eq!(n.give("flansch-größe", "p"), "flansch_");
        assert_eq!(n.give("flansch größe", "p"), "flansc_2");
        assert_eq!(n.give("10mm", "t"), "t10mm");
        assert_eq!(n.give("v100", "t"), "v100_2");
        assert_eq!(n.give("", "t"), "t");
        assert_eq!(number("OT#(5)"), Some(5));
        let rule = Rule { longest: 8, reserved: &[], upper: true };
        let program = |wanted: &str| Names::new(rule).program(wanted, "P");
        assert_eq!((program("part").as_str(), program("motion_a").as_str(), program("1 prog").as_str()), ("PART", "MOTION_A", "P1_PROG"));
        let long = [program("bracket_left_side"), program("bracket_left_side2"), program("bracket-left_side")];
        assert!(long.iter().all(|n| n.len() == 8 && n.starts_with("BRAC")) && long[0] != long[1] && long[0] != long[2], "{long:?}");
        let part = |program: &str, n: usize| Names::new(rule).part(program, n);
        assert_eq!(part("PART", 1), "PART_001");
        let parts = [part("MOTION_A", 1), part("MOTION_B", 1), part("MOTION_A", 2), part("MOTION_A", 1000)];
        assert!(parts.iter().all(|n| n.len() <= 8 && n.starts_with("MO")), "{parts:?}");
        assert!(parts[0] != parts[1] && parts[0] != parts[2] && parts[2] != parts[3], "{parts:?}");
        assert_eq!(number("doSpindle"), None);
        assert_eq!(number("a1b2"), None);
        assert!(plain("doSpindle") && !plain("do spindle") && !plain("x;y"));
    }
}
