//! What features give back: plain data that any protocol can carry.

use gr_text::Span;

/// What stands under the cursor, explained.
#[derive(Clone, Debug, PartialEq)]
pub struct Hover {
    /// What is explained, in the file's bytes.
    pub span: Span,
    /// Markdown.
    pub text: String,
}

/// Kinds of proposals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "plain words")]
pub enum CompletionKind {
    Code,
    Word,
    Parameter,
    Function,
    Keyword,
    Sub,
    Tool,
    Snippet,
    Entity,
    Enumeration,
    Reference,
    Value,
}

/// A proposal.
#[derive(Clone, Debug, PartialEq)]
pub struct Completion {
    /// What is shown.
    pub label: String,
    /// What is inserted in place of `replace`.
    pub insert: String,
    /// `insert` has places to fill in: `$1`, `${2:text}`.
    pub snippet: bool,
    /// Short name.
    pub detail: String,
    /// Markdown.
    pub documentation: String,
    /// Kind.
    pub kind: CompletionKind,
    /// Lower comes first.
    pub rank: u8,
    /// Bytes that are replaced.
    pub replace: Span,
}

/// The form of something that takes words or arguments.
#[derive(Clone, Debug, PartialEq)]
pub struct Signature {
    /// `G83 X Y Z R Q [L] [F]`
    pub label: String,
    /// Markdown.
    pub documentation: String,
    /// Parameters: bytes of the label, and Markdown.
    pub parameters: Vec<(std::ops::Range<u32>, String)>,
    /// The one being written.
    pub active: Option<u32>,
}

/// Kinds of outline entries.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[expect(missing_docs, reason = "plain words")]
pub enum ItemKind {
    Sub,
    Tool,
    Operation,
    Project,
    Workplan,
    Workingstep,
    Feature,
    MachiningOperation,
    CuttingTool,
    Section,
    Key,
}

/// An entry of the outline.
#[derive(Clone, Debug, PartialEq)]
pub struct Item {
    /// What.
    pub kind: ItemKind,
    /// Its name.
    pub name: String,
    /// More about it.
    pub detail: String,
    /// All of it.
    pub range: Span,
    /// Its name's bytes.
    pub span: Span,
    /// What it holds.
    pub children: Vec<Item>,
}

/// A stretch of lines that can be folded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fold {
    /// First line.
    pub first: u32,
    /// Last line.
    pub last: u32,
    /// A comment.
    pub comment: bool,
}

/// Kinds of inlay hints.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[expect(missing_docs, reason = "see HintKinds")]
pub enum HintKind {
    Motion,
    Position,
    Feed,
    Modes,
    Time,
    Arc,
    Value,
    Attribute,
    Type,
}

/// A remark inside of the text.
#[derive(Clone, Debug, PartialEq)]
pub struct Hint {
    /// Byte before which it stands.
    pub at: u32,
    /// What.
    pub text: String,
    /// Kind.
    pub kind: HintKind,
    /// Markdown.
    pub tooltip: String,
}

/// An edit of one file.
#[derive(Clone, Debug, PartialEq)]
pub struct Edit {
    /// Bytes that are replaced.
    pub span: Span,
    /// By what.
    pub text: String,
}

/// Kinds of actions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "plain words")]
pub enum ActionKind {
    Fix,
    Rewrite,
    Inline,
    Source,
}

/// Something that can be done to a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Action {
    /// As an imperative.
    pub title: String,
    /// Kind.
    pub kind: ActionKind,
    /// What it changes; not overlapping, ascending.
    pub edits: Vec<Edit>,
}

/// What an occurrence of a name does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "plain words")]
pub enum Role {
    Definition,
    Write,
    Read,
}

/// A place where a name occurs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Occurrence {
    /// The name's bytes.
    pub span: Span,
    /// What is done there.
    pub role: Role,
}

/// A remark above a line.
#[derive(Clone, Debug, PartialEq)]
pub struct Lens {
    /// Line.
    pub line: u32,
    /// What it says.
    pub text: String,
}

/// Kinds of tokens, in the order of the legend.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
#[expect(missing_docs, reason = "plain words")]
pub enum TokenKind {
    Motion = 0,
    Code,
    Machine,
    Axis,
    Feed,
    Number,
    Parameter,
    Function,
    Keyword,
    Label,
    Comment,
    Operator,
    Entity,
    Reference,
    String,
    Enumeration,
}

/// Names of [`TokenKind`], as the protocol's own token types where there is a fitting one.
pub const TOKEN_KINDS: [&str; 16] = [
    "keyword", "macro", "method", "property", "property", "number", "variable", "function", "keyword", "label", "comment", "operator", "type",
    "variable", "string", "enumMember",
];

/// Modifier bits, in the order of the legend: written, skipped, documentation.
pub const TOKEN_MODIFIERS: [&str; 3] = ["modification", "deprecated", "documentation"];

/// A token.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Token {
    /// Its bytes, on one line.
    pub span: Span,
    /// Kind.
    pub kind: TokenKind,
    /// Bits: 1 is set here, 2 is never carried out, 4 speaks to the controller.
    pub modifiers: u8,
}
