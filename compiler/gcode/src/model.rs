use std::sync::Arc;

use gr_spec::{Code, Rs274};
use gr_text::Span;

/// What [`crate::scan`] makes of a chunk. All spans are relative to the chunk's text.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scan {
    /// One per line of the text; a text that ends with a line end has no empty line after it.
    pub lines: Box<[Line]>,
    /// Words of all lines, in order.
    pub words: Box<[Word]>,
    /// Expression nodes and their spans.
    pub nodes: Box<[Node]>,
    /// Span of each node.
    pub node_spans: Box<[Span]>,
    /// `#… = …` settings.
    pub settings: Box<[Setting]>,
    /// O-words and, in macro dialects, IF/GOTO/WHILE/DO/END.
    pub controls: Box<[Control]>,
    /// Argument lists of controls.
    pub args: Box<[ExprId]>,
    /// Names of parameters and subroutines, lower case, blanks removed.
    pub names: Box<[Box<str>]>,
    /// Faults by line, ascending.
    pub faults: Box<[Fault]>,
}

/// One line of text.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// First byte.
    pub start: u32,
    /// First word's index; the next line's is the end.
    pub first_word: u32,
    /// What kind of line.
    pub kind: LineKind,
    /// `/` at the start (block delete).
    pub deleted: bool,
    /// Has at least one entry in `faults`.
    pub faulty: bool,
}

/// What a line holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum LineKind {
    /// Nothing but blanks and comments.
    Blank,
    /// Literal words (and comments) only.
    Plain,
    /// Something with structure.
    Structured,
    /// `%` alone.
    Percent,
}

/// One word (or comment, setting, control) of a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Word {
    /// The number, when `form` is `Literal`.
    pub value: f64,
    /// First byte.
    pub start: u32,
    /// Length in bytes; `u16::MAX` means: to the end of the line.
    pub len: u16,
    /// Lower-case letter; `@ ^ $` too; `(` and `;` for comments, `#` for settings, `o` for O-words and
    /// macro statements, `?` for text that is nothing.
    pub letter: u8,
    /// How to read the rest.
    pub form: Form,
}

/// How a word carries its value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Form {
    /// In `value`.
    Literal,
    /// `value` holds an [`ExprId`] (see [`Word::index`]).
    Expr,
    /// `value` holds an index into `settings`.
    Setting,
    /// `value` holds an index into `controls`.
    Control,
    /// A comment; its text is the span.
    Comment,
    /// Damaged; see the line's faults.
    Bad,
}

impl Word {
    /// The index that `value` holds for the forms that say so.
    pub fn index(&self) -> usize {
        self.value.to_bits() as usize
    }
    /// Packs an index into `value`.
    pub fn pack(index: usize) -> f64 {
        f64::from_bits(index as u64)
    }
}

/// Index into [`Scan::nodes`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ExprId(pub u32);

/// An expression node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Node {
    /// `3.5`
    Number(f64),
    /// `#12`, `##2`, `#[…]`
    Param(ExprId),
    /// `#<name>`: index into `names`.
    Named(u32),
    /// `SIN[…]`, unary minus too.
    Unary(Unary, ExprId),
    /// `ATAN[y]/[x]`
    Atan(ExprId, ExprId),
    /// `EXISTS[#<name>]`
    ExistsNamed(u32),
    /// `EXISTS[#n]`
    ExistsParam(ExprId),
    /// `a op b`
    Binary(Binary, ExprId, ExprId),
    /// What could not be parsed.
    Bad,
}

/// Functions of one argument.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[expect(missing_docs, reason = "the names are the language's own")]
pub enum Unary {
    Negate,
    Abs,
    Acos,
    Asin,
    Cos,
    Exp,
    Fix,
    Fup,
    Ln,
    Round,
    Sin,
    Sqrt,
    Tan,
}

/// Operators of two arguments.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[expect(missing_docs, reason = "the names are the language's own")]
pub enum Binary {
    Power,
    Times,
    Divide,
    Modulo,
    Plus,
    Minus,
    Eq,
    Ne,
    Gt,
    Ge,
    Lt,
    Le,
    And,
    Or,
    Xor,
}

/// `#target = value`
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setting {
    /// What is set.
    pub target: Target,
    /// To what.
    pub value: ExprId,
    /// The whole `#…=…`.
    pub span: Span,
}

/// What a setting sets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// `#12 =`, `##1 =`, `#[…] =`
    Number(ExprId),
    /// `#<name> =`: index into `names`.
    Named(u32),
}

/// A statement of control flow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Control {
    /// Which.
    pub keyword: Keyword,
    /// Its label.
    pub label: OLabel,
    /// Condition, count, return values, call arguments: `args[first..first + count]`.
    pub first_arg: u32,
    /// How many.
    pub arg_count: u32,
    /// The whole statement.
    pub span: Span,
    /// The label alone.
    pub label_span: Span,
}

/// Label of an O-word.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OLabel {
    /// `o100`, `o#1`, `o[…]`
    Number(ExprId),
    /// `o<name>`: index into `names`.
    Named(u32),
    /// None (macro `GOTO 10`: the target is the first argument).
    None,
}

/// Control keywords.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[expect(missing_docs, reason = "the names are the language's own")]
pub enum Keyword {
    Sub,
    Endsub,
    Call,
    Do,
    While,
    Endwhile,
    If,
    Elseif,
    Else,
    Endif,
    Break,
    Continue,
    Return,
    Repeat,
    Endrepeat,
    /// `O100` with nothing after it: a program or Fanuc-style subroutine number.
    Program,
    /// Macro B: `IF [c] GOTO n` (arguments: condition, target).
    MacroIfGoto,
    /// Macro B: `IF [c] THEN #…=…` (argument: condition; the setting follows as a word).
    MacroIfThen,
    /// Macro B: `GOTO n`.
    MacroGoto,
    /// Macro B: `WHILE [c] DO n` (arguments: condition, label).
    MacroWhile,
    /// Macro B: `DO n`.
    MacroDo,
    /// Macro B: `END n`.
    MacroEnd,
}

/// A fault found while parsing. It becomes a diagnostic when the line is executed, and a hint when it never is.
///
/// The faults of a line are in the order in which the controller would find them: those of the text first (see
/// [`Fault::when_read`]), then from left to right. The controller evaluates while it reads, so a word whose
/// evaluation fails wins over a fault further right: evaluate the words in order, and report a line's next fault
/// at the first [`Form::Bad`] word or [`Node::Bad`]. A warning ([`Fault::stops`] says no) does not keep the block
/// from being executed.
#[derive(Clone, Debug, PartialEq)]
pub struct Fault {
    /// Line of the chunk.
    pub line: u32,
    /// Exact place, relative to the chunk.
    pub span: Span,
    /// Registry row.
    pub code: Code,
    /// What the real `rs274` says.
    pub rs: Rs274,
    /// Arguments of both messages.
    pub args: Box<[String]>,
}

impl Fault {
    /// Belongs to the line as text: the controller reports it whenever it reads the line, also while it skips
    /// over a branch or a subroutine definition.
    pub fn when_read(&self) -> bool {
        self.code.def().code.starts_with("E01")
    }
    /// Whether the block can't be executed.
    pub fn stops(&self) -> bool {
        self.code.def().severity == gr_spec::Severity::Error
    }
}

/// A stretch of whole lines with its tables.
#[derive(Clone, Debug, PartialEq)]
pub struct Chunk {
    /// Text.
    pub text: gr_text::Text,
    /// Tables.
    pub scan: Arc<Scan>,
}

/// A file as the interpreter sees it.
#[derive(Clone, Debug, Default)]
pub struct File {
    /// Path as given, for messages and `SUBROUTINE_PATH` rules.
    pub path: Box<str>,
    /// Its chunks.
    pub chunks: Vec<Chunk>,
    /// First line of each chunk, and the number of lines.
    pub first_lines: Vec<u32>,
    /// First byte of each chunk, and the length.
    pub starts: Vec<u32>,
}

impl File {
    /// A file from its chunks.
    pub fn new(path: &str, chunks: Vec<Chunk>) -> File {
        let (mut first_lines, mut starts) = (vec![0], vec![0]);
        for c in &chunks {
            first_lines.push(first_lines[first_lines.len() - 1] + c.scan.lines.len() as u32);
            starts.push(starts[starts.len() - 1] + c.text.len() as u32);
        }
        File { path: path.into(), chunks, first_lines, starts }
    }
    /// Number of lines.
    pub fn line_count(&self) -> u32 {
        self.first_lines.last().copied().unwrap_or(0)
    }
    /// Chunk and line in it, for a line of the file.
    pub fn locate(&self, line: u32) -> Option<(usize, u32)> {
        if line >= self.line_count() {
            return None;
        }
        let chunk = self.first_lines.partition_point(|l| *l <= line) - 1;
        Some((chunk, line - self.first_lines[chunk]))
    }
    /// Bytes of a line in the file, without its line end.
    pub fn line_span(&self, line: u32) -> Span {
        match self.locate(line) {
            Some((c, l)) => self.chunks[c].scan.line_span(&self.chunks[c].text, l).shifted(self.starts[c]),
            None => Span::new(self.starts.last().copied().unwrap_or(0), self.starts.last().copied().unwrap_or(0)),
        }
    }
}

impl Scan {
    /// Words of a line.
    pub fn words(&self, line: u32) -> &[Word] {
        let first = self.lines[line as usize].first_word as usize;
        let end = self.lines.get(line as usize + 1).map_or(self.words.len(), |l| l.first_word as usize);
        &self.words[first..end]
    }
    /// Whether a program with an O number of its own (`O100`) begins on a line.
    pub fn begins_program(&self, line: u32) -> bool {
        let keyword = |w: &Word| self.controls.get(w.index()).map(|c| c.keyword);
        self.words(line).iter().any(|w| w.form == Form::Control && keyword(w) == Some(Keyword::Program))
    }
    /// Bytes of a line, without its line end.
    pub fn line_span(&self, text: &str, line: u32) -> Span {
        let start = self.lines[line as usize].start;
        let end = self.lines.get(line as usize + 1).map_or(text.len() as u32, |l| l.start);
        let bytes = &text.as_bytes()[start as usize..end as usize];
        let ends = bytes.iter().rev().take_while(|b| matches!(b, b'\n' | b'\r')).count() as u32;
        Span::new(start, end - ends)
    }
    /// Span of a word of a line.
    pub fn word_span(&self, text: &str, line: u32, word: &Word) -> Span {
        let end = if word.len == u16::MAX { self.line_span(text, line).end } else { word.start + u32::from(word.len) };
        Span::new(word.start, end)
    }
    /// Faults of a line.
    pub fn faults_of(&self, line: u32) -> &[Fault] {
        let from = self.faults.partition_point(|f| f.line < line);
        let to = self.faults.partition_point(|f| f.line <= line);
        &self.faults[from..to]
    }
}
