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
    /// Arguments of our own message, when they differ.
    pub own_args: Vec<String>,
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
        Box::new(Fault { code, rs: Some(rs), args: Vec::new(), own_args: Vec::new(), letter: None, span: None })
    }
    /// Our own finding, which the real `rs274` does not have.
    pub fn own(code: Code) -> Box<Fault> {
        Box::new(Fault { code, rs: None, args: Vec::new(), own_args: Vec::new(), letter: None, span: None })
    }
    /// Blames a word.
    pub fn at(mut self: Box<Self>, letter: u8) -> Box<Fault> {
        self.letter = Some(letter);
        self
    }
    /// Replaces the first argument of our own message, where `rs274` shows another form of it.
    pub fn named(mut self: Box<Self>, name: String) -> Box<Fault> {
        self.own_args = vec![name];
        self
    }
    /// Sets the arguments of our own message, where `rs274` has others.
    pub fn own_args(mut self: Box<Self>, args: &[&str]) -> Box<Fault> {
        self.own_args = args.iter().map(|a| (*a).to_string()).collect();
        self
    }
    /// Arguments of our own message.
    pub fn message_args(&self) -> &[String] {
        if self.own_args.is_empty() { &self.args } else { &self.own_args }
    }
    /// What the real `rs274` prints: it has room for 254 bytes.
    pub fn rs_text(&self) -> Option<String> {
        self.rs.map(|rs| {
            let mut text = gr_spec::fill(rs.text(), &self.args);
            if text.len() > 254 {
                text.truncate((0..=254).rev().find(|at| text.is_char_boundary(*at)).unwrap_or(0));
            }
            text
        })
    }
    /// Adds a message argument.
    pub fn arg(mut self: Box<Self>, value: impl std::fmt::Display) -> Box<Fault> {
        self.args.push(value.to_string());
        self
    }
}
