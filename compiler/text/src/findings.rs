use crate::{Code, Diagnostic, Severity};

/// Findings of one run, so many at most: half the list is no use to anyone, but whether there was an error decides
/// about the result. Errors and lesser findings have room of their own, and what finds no room is counted.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Findings {
    list: Vec<Diagnostic>,
    most: usize,
    errors: Count,
    lesser: Count,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
struct Count {
    kept: usize,
    left_out: usize,
}

impl Findings {
    /// Room for so many errors, and for as many warnings and hints.
    pub fn new(most: usize) -> Findings {
        Findings { list: Vec::new(), most, errors: Count::default(), lesser: Count::default() }
    }
    /// Whether one more of this code has room; one that has none is counted.
    pub fn admits(&mut self, code: Code) -> bool {
        let most = self.most;
        let count = self.count(code.def().severity);
        let room = count.kept < most;
        count.left_out += usize::from(!room);
        room
    }
    /// Adds a finding, or counts it.
    pub fn add(&mut self, finding: Diagnostic) {
        let most = self.most;
        let count = self.count(finding.severity);
        if count.kept < most {
            count.kept += 1;
            self.list.push(finding);
        } else {
            count.left_out += 1;
        }
    }
    /// Errors so far, those without room among them.
    pub fn errors(&self) -> usize {
        self.errors.kept + self.errors.left_out
    }
    /// Whether there is an error.
    pub fn failed(&self) -> bool {
        self.errors() > 0
    }
    /// Whether there is no room for another error: looking further tells nobody anything.
    pub fn full(&self) -> bool {
        self.errors.kept >= self.most
    }
    /// Whether a code is among those kept.
    pub fn has(&self, code: Code) -> bool {
        self.list.iter().any(|d| d.code == code)
    }
    /// The findings in the order they came; the last says how many are left out.
    pub fn into_list(mut self) -> Vec<Diagnostic> {
        let left = |count: Count, what: &str| (count.left_out > 0).then(|| format!("not listed: {} more {what}", count.left_out));
        let notes = [left(self.errors, "errors"), left(self.lesser, "warnings or hints")];
        if let Some(last) = self.list.pop() {
            self.list.push(notes.into_iter().flatten().fold(last, Diagnostic::note));
        }
        self.list
    }
    fn count(&mut self, severity: Severity) -> &mut Count {
        if severity == Severity::Error { &mut self.errors } else { &mut self.lesser }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FileId, Span, code};

    fn finding(code: Code) -> Diagnostic {
        Diagnostic::new(code, FileId(0), Span::default(), &[])
    }

    #[test]
    fn warnings_leave_room_for_errors() {
        let mut all = Findings::new(3);
        for _ in 0..10 {
            all.add(finding(code::ROBOT_RAPID_SWEEP));
        }
        assert!(!all.failed() && !all.full());
        for _ in 0..4 {
            assert!(all.admits(code::ROBOT_CANNOT) || all.full());
            all.add(finding(code::ROBOT_CANNOT));
        }
        assert!(all.failed() && all.full() && all.has(code::ROBOT_CANNOT));
        let list = all.into_list();
        assert_eq!(list.iter().filter(|d| d.severity == Severity::Error).count(), 3);
        assert_eq!(list.len(), 6);
        assert_eq!(list[5].notes, ["not listed: 2 more errors", "not listed: 7 more warnings or hints"]);
        assert!(Findings::new(3).into_list().is_empty());
    }
}
