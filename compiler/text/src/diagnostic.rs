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
        self.labels.push(Label { file, span, text: text.into() });
        self
    }
    /// Adds a note.
    pub fn note(mut self, text: impl Into<String>) -> Diagnostic {
        self.notes.push(text.into());
        self
    }
    /// The primary place.
    pub fn primary(&self) -> (FileId, Span) {
        self.labels.first().map_or((FileId(0), Span::default()), |l| (l.file, l.span))
    }
}
