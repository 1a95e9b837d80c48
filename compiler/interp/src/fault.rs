use gr_spec::{Code, Rs274};
use gr_text::Span;

/// Why a block could not be carried out, or what is doubtful about it.
#[derive(Clone, Debug, PartialEq)]
pub struct Fault {
    /// Registry row.
    pub code: Code,
    /// What the real `rs274` says; none for our own warnings.
    pub rs: Option<Rs274>,
    /// Arguments of both messages.
    pub args: Vec<String>,
    /// The word that is to blame: its lower-case letter. The first such word of the block is underlined; no
    /// letter: the whole block.
    pub letter: Option<u8>,
    /// Exact place relative to the chunk, when the blame is narrower than a word.
    pub span: Option<Span>,
}

/// What the functions of the interpreter return. Faults are rare and boxed, so that the good way stays small.
pub type Res<T = ()> = Result<T, Box<Fault>>;

impl Fault {
    /// A fault of the whole block.
    pub fn new(code: Code, rs: Rs274) -> Box<Fault> {
        Box::new(Fault { code, rs: Some(rs), args: Vec::new(), letter: None, span: None })
    }
    /// Our own finding, which the real `rs274` does not have.
    pub fn own(code: Code) -> Box<Fault> {
        Box::new(Fault { code, rs: None, args: Vec::new(), letter: None, span: None })
    }
    /// Blames a word.
    pub fn at(mut self: Box<Self>, letter: u8) -> Box<Fault> {
        self.letter = Some(letter);
        self
    }
    /// Adds a message argument.
    pub fn arg(mut self: Box<Self>, value: impl std::fmt::Display) -> Box<Fault> {
        self.args.push(value.to_string());
        self
    }
}
