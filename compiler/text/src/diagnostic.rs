use std::borrow::Cow;

use crate::{Code, FileId, Severity, Span};

/// One finding, ready to be shown: positions are byte offsets into whole files.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Diagnostic {
    /// Registry row.
    pub code: Code,
    /// Usually the registry's; options may raise or lower it.
    pub severity: Severity,
    /// The registry's message with the arguments filled in.
    pub message: String,
    /// Where. The first label is the primary one.
    pub labels: Vec<Label>,
    /// Further facts, one sentence each.
    pub notes: Vec<String>,
    /// What to do about it.
    pub help: Option<String>,
    /// Edits that mend it.
    pub fixes: Vec<Fix>,
    /// How execution came here: innermost call or loop first.
    pub trace: Vec<Frame>,
}

/// A place with a remark.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Label {
    /// File.
    pub file: FileId,
    /// Bytes of that file.
    pub span: Span,
    /// Remark; may be empty on the primary label.
    pub text: String,
}

/// An edit that mends the finding.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Fix {
    /// What it does, as an imperative.
    pub title: String,
    /// Replacements, not overlapping.
    pub edits: Vec<(FileId, Span, String)>,
}

/// One step of the way execution took.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Frame {
    /// File of the call.
    pub file: FileId,
    /// The calling block.
    pub span: Span,
    /// Name of the subroutine, or the loop and its pass.
    pub name: String,
}

impl Diagnostic {
    /// A finding at `span`, its message and help filled from the registry with `args`.
    pub fn new(code: Code, file: FileId, span: Span, args: &[String]) -> Diagnostic {
        let def = code.def();
        let escaped: Vec<String>;
        let args = if args.iter().any(|a| a.contains(char::is_control)) {
            escaped = args.iter().map(|a| visible(a).into_owned()).collect();
            &escaped
        } else {
            args
        };
        Diagnostic {
            code,
            severity: def.severity,
            message: gr_spec::fill(def.message, args),
            labels: vec![Label { file, span, text: String::new() }],
            notes: Vec::new(),
            help: def.fix.map(|f| gr_spec::fill(f, args)),
            fixes: Vec::new(),
            trace: Vec::new(),
        }
    }
    /// Adds a secondary label.
    pub fn label(mut self, file: FileId, span: Span, text: impl Into<String>) -> Diagnostic {
        self.labels.push(Label { file, span, text: visible(&text.into()).into_owned() });
        self
    }
    /// Adds a note.
    pub fn note(mut self, text: impl Into<String>) -> Diagnostic {
        self.notes.push(visible(&text.into()).into_owned());
        self
    }
    /// The primary place.
    pub fn primary(&self) -> (FileId, Span) {
        self.labels.first().map_or((FileId(0), Span::default()), |l| (l.file, l.span))
    }
}

/// Text of a program in a message: control characters, which a terminal would obey, as escapes.
fn visible(text: &str) -> Cow<'_, str> {
    if !text.chars().any(char::is_control) {
        return Cow::Borrowed(text);
    }
    let escaped = |c: char| match c {
        '\n' => "\\n".to_string(),
        '\r' => "\\r".to_string(),
        '\t' => "\\t".to_string(),
        c if c.is_control() => format!("\\x{:02X}", c as u32),
        c => c.to_string(),
    };
    Cow::Owned(text.chars().map(escaped).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_escaped() {
        let d = Diagnostic::new(gr_spec::code::P21_BARE_WORD, FileId(0), Span::default(), &["a\u{1b}[31m\n\u{85}".into()]);
        assert!(d.message.contains("a\\x1B[31m\\n\\x85"), "{}", d.message);
        assert_eq!(visible("plain ü"), "plain ü");
    }
}
