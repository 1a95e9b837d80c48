use gr_spec::{Code, Severity, code};

use super::Limits;

/// How a lint is to be reported.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Level {
    /// Not at all.
    Off,
    /// As a hint.
    Hint,
    /// As a warning.
    Warning,
    /// As an error.
    Error,
}

/// Which lints are on and how severe they are, and what they compare with.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Rules {
    /// Levels that differ from the registry's.
    pub levels: Vec<(Code, Level)>,
    /// Travel limits of the machine in mm.
    pub(crate) limits: Limits,
}

/// Lints that are off unless asked for.
const OFF: &[Code] = &[code::COOLANT_NONE];

impl Rules {
    /// Sets one lint's level; the last word counts.
    pub fn set(&mut self, code: Code, level: Level) {
        self.levels.retain(|(c, _)| *c != code);
        self.levels.push((code, level));
    }

    /// Severity of a diagnostic under these rules; none = not reported.
    pub fn severity(&self, code: Code) -> Option<Severity> {
        let level = self.levels.iter().find(|(c, _)| *c == code).map(|(_, level)| *level);
        match level {
            Some(Level::Off) => None,
            Some(Level::Hint) => Some(Severity::Hint),
            Some(Level::Warning) => Some(Severity::Warning),
            Some(Level::Error) => Some(Severity::Error),
            None if OFF.contains(&code) => None,
            None => Some(code.def().severity),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels() {
        let mut rules = Rules::default();
        assert_eq!(rules.severity(code::COOLANT_NONE), None);
        assert_eq!(rules.severity(code::SPINDLE_STOPPED), Some(Severity::Warning));
        rules.set(code::COOLANT_NONE, Level::Hint);
        rules.set(code::SPINDLE_STOPPED, Level::Error);
        rules.set(code::SPINDLE_STOPPED, Level::Off);
        assert_eq!(rules.severity(code::COOLANT_NONE), Some(Severity::Hint));
        assert_eq!(rules.severity(code::SPINDLE_STOPPED), None);
    }
}
