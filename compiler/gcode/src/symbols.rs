//! What a chunk declares, uses and depends on, without running it.

use crate::model::*;

/// A place in the text with what stands there.
#[derive(Clone, Debug, PartialEq)]
pub struct Symbol<T> {
    /// What.
    pub what: T,
    /// Line of the chunk.
    pub line: u32,
    /// Bytes of the chunk.
    pub span: gr_text::Span,
}

/// A label of an O-word.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Label {
    /// `o100`
    Number(i64),
    /// `o<name>`
    Named(Box<str>),
    /// `o#1`, `o[…]`: known only when it runs.
    Dynamic,
}

/// An O-word or macro statement.
#[derive(Clone, Debug, PartialEq)]
pub struct Statement {
    /// Its label.
    pub label: Label,
    /// Its keyword.
    pub keyword: Keyword,
}

/// A parameter with a fixed name.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Parameter {
    /// `#12`
    Number(u32),
    /// `#<name>`, lower case.
    Named(Box<str>),
}

/// What [`symbols`] finds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Symbols {
    /// N words with their numbers.
    pub line_numbers: Vec<Symbol<f64>>,
    /// O-words and macro statements.
    pub statements: Vec<Symbol<Statement>>,
    /// Parameters read: in values, in `EXISTS`, and in comments that print them.
    pub reads: Vec<Symbol<Parameter>>,
    /// Parameters set.
    pub writes: Vec<Symbol<Parameter>>,
    /// Reads a parameter whose number is computed (`##1`, `#[…]`).
    pub reads_dynamic: bool,
    /// Sets a parameter whose number is computed.
    pub writes_dynamic: bool,
    /// Literal G codes times ten, ascending, each once.
    pub g_codes: Vec<u16>,
    /// Literal M codes, ascending, each once.
    pub m_codes: Vec<u16>,
    /// A G or M word whose code is computed.
    pub dynamic_codes: bool,
}

impl Symbols {
    /// Nothing but plain words: no parameters, no control flow, no calls. What such a chunk does depends on the
    /// state before it alone.
    pub fn is_straight_line(&self) -> bool {
        self.statements.is_empty()
            && self.reads.is_empty()
            && self.writes.is_empty()
            && !self.is_dynamic()
            && !self.m_codes.iter().any(|m| matches!(m, 98 | 99))
    }
    /// Something is known only when the chunk runs.
    pub fn is_dynamic(&self) -> bool {
        self.reads_dynamic || self.writes_dynamic || self.dynamic_codes
    }
    /// The parameters read, ascending, each once.
    pub fn parameters_read(&self) -> Vec<Parameter> {
        let mut all: Vec<Parameter> = self.reads.iter().map(|s| s.what.clone()).collect();
        all.sort();
        all.dedup();
        all
    }
}

/// Collects the symbols of a chunk.
pub fn symbols(text: &str, scan: &Scan) -> Symbols {
    let mut found = Finder { text, scan, out: Symbols::default(), line: 0, codes: Box::new([0; 32]), m: [0; 4] };
    for line in 0..scan.lines.len() as u32 {
        found.line = line;
        for word in scan.words(line) {
            found.word(word);
        }
    }
    found.finish()
}

struct Finder<'a> {
    text: &'a str,
    scan: &'a Scan,
    out: Symbols,
    line: u32,
    /// Set of G codes times ten below 2048.
    codes: Box<[u64; 32]>,
    /// Set of M codes below 256.
    m: [u64; 4],
}

impl Finder<'_> {
    fn finish(mut self) -> Symbols {
        self.out.g_codes = members(self.codes.as_slice());
        self.out.m_codes = members(&self.m);
        self.out
    }

    fn word(&mut self, word: &Word) {
        match word.form {
            Form::Literal => self.literal(word),
            Form::Expr => {
                self.out.dynamic_codes |= matches!(word.letter, b'g' | b'm');
                self.expr(ExprId(word.index() as u32));
            }
            Form::Setting => self.setting(word.index()),
            Form::Control => self.control(word.index()),
            Form::Comment => self.comment(word),
            Form::Bad => {}
        }
    }

    fn literal(&mut self, word: &Word) {
        match word.letter {
            b'g' => insert(self.codes.as_mut_slice(), (word.value * 10.0).round()),
            b'm' => insert(&mut self.m, word.value.round()),
            b'n' => {
                let span = self.scan.word_span(self.text, self.line, word);
                self.out.line_numbers.push(Symbol { what: word.value, line: self.line, span });
            }
            _ => {}
        }
    }

    fn setting(&mut self, index: usize) {
        let setting = self.scan.settings[index];
        let span = setting.span;
        match setting.target {
            Target::Named(name) => {
                let what = Parameter::Named(self.scan.names[name as usize].clone());
                self.out.writes.push(Symbol { what, line: self.line, span });
            }
            Target::Number(number) => match self.number(number) {
                Some(n) => self.out.writes.push(Symbol { what: Parameter::Number(n), line: self.line, span }),
                None => {
                    self.out.writes_dynamic = true;
                    self.expr(number);
                }
            },
        }
        self.expr(setting.value);
    }

    fn control(&mut self, index: usize) {
        let control = self.scan.controls[index];
        let label = match control.label {
            OLabel::Named(name) => Label::Named(self.scan.names[name as usize].clone()),
            OLabel::Number(number) => match self.scan.nodes[number.0 as usize] {
                Node::Number(value) => Label::Number(value as i64),
                _ => {
                    self.expr(number);
                    Label::Dynamic
                }
            },
            OLabel::None => match self.target_of(&control) {
                Some(value) => Label::Number(value as i64),
                None => Label::Dynamic,
            },
        };
        let what = Statement { label, keyword: control.keyword };
        self.out.statements.push(Symbol { what, line: self.line, span: control.span });
        for arg in control.first_arg..control.first_arg + control.arg_count {
            self.expr(self.scan.args[arg as usize]);
        }
    }

    /// The number that a macro statement names: always its last argument.
    fn target_of(&self, control: &Control) -> Option<f64> {
        let last = (control.first_arg + control.arg_count).checked_sub(1)?;
        let node = self.scan.args.get(last as usize).map(|id| self.scan.nodes[id.0 as usize]);
        match node {
            Some(Node::Number(value)) if control.keyword != Keyword::MacroIfThen => Some(value),
            _ => None,
        }
    }

    /// A literal parameter number.
    fn number(&self, expr: ExprId) -> Option<u32> {
        match self.scan.nodes[expr.0 as usize] {
            Node::Number(value) if value >= 0.0 && value < 1e9 => Some(value as u32),
            _ => None,
        }
    }

    fn read(&mut self, what: Parameter, expr: ExprId) {
        let span = self.scan.node_spans[expr.0 as usize];
        self.out.reads.push(Symbol { what, line: self.line, span });
    }

    fn expr(&mut self, expr: ExprId) {
        match self.scan.nodes[expr.0 as usize] {
            Node::Number(_) | Node::Bad => {}
            Node::Param(number) | Node::ExistsParam(number) => match self.number(number) {
                Some(n) => self.read(Parameter::Number(n), expr),
                None => {
                    self.out.reads_dynamic = true;
                    self.expr(number);
                }
            },
            Node::Named(name) | Node::ExistsNamed(name) => {
                self.read(Parameter::Named(self.scan.names[name as usize].clone()), expr);
            }
            Node::Unary(_, value) => self.expr(value),
            Node::Atan(a, b) | Node::Binary(_, a, b) => {
                self.expr(a);
                self.expr(b);
            }
        }
    }

    /// `(DEBUG,…#1…)`, `(PRINT,…#<name>…)`, `(LOG,…)` and `(MSG,…)` show parameters.
    fn comment(&mut self, word: &Word) {
        let span = self.scan.word_span(self.text, self.line, word);
        let text = &self.text[span.range()];
        for (at, _) in text.match_indices('#') {
            let rest = &text[at + 1..];
            let (what, length) = if let Some(name) = rest.strip_prefix('<') {
                let Some(end) = name.find('>') else { continue };
                let name: String = name[..end].chars().filter(|c| !c.is_whitespace()).collect();
                (Parameter::Named(name.to_lowercase().into()), end + 3)
            } else {
                let digits = rest.bytes().take_while(u8::is_ascii_digit).count();
                let Ok(number) = rest[..digits].parse() else { continue };
                (Parameter::Number(number), digits + 1)
            };
            let start = span.start + at as u32;
            let span = gr_text::Span::new(start, start + length as u32);
            self.out.reads.push(Symbol { what, line: self.line, span });
        }
    }
}

fn insert(set: &mut [u64], code: f64) {
    if code >= 0.0 && code < set.len() as f64 * 64.0 {
        let code = code as usize;
        set[code / 64] |= 1 << (code % 64);
    }
}

fn members(set: &[u64]) -> Vec<u16> {
    (0..set.len() * 64).filter(|n| set[n / 64] >> (n % 64) & 1 == 1).map(|n| n as u16).collect()
}

/// What P of Fanuc's M98 says: the program, and how often where P itself says that. Up to four digits are the program's
/// number; the digits in front of them (three on older controls, four on newer ones) are the number of calls. Beside L the
/// whole of P is the number. (Fanuc Series 0i/30i, B-64484, subprogram call.)
pub fn fanuc_call(p: i64, beside_l: bool) -> (i64, Option<i64>) {
    if beside_l || p < 10_000 { (p, None) } else { (p % 10_000, Some(p / 10_000)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> Symbols {
        symbols(text, &crate::scan(text, gr_spec::Dialect::linuxcnc()))
    }

    #[test]
    fn straight_line() {
        let s = of("N10 G21 G1 X1 F100 (go)\nN20 G43.1 Z1 M3\n");
        assert!(s.is_straight_line());
        assert_eq!((s.g_codes, s.m_codes), (vec![10, 210, 431], vec![3]));
        assert_eq!(s.line_numbers.iter().map(|n| n.what).collect::<Vec<_>>(), [10.0, 20.0]);
        assert!(!of("M98 P100\n").is_straight_line());
    }

    #[test]
    fn parameters() {
        let s = of("#1 = [#<Depth> + 2]\nG1 X#1 Y[SIN[#5]]\n#<x> = EXISTS[#<y>]\n(debug,#7 #<Z z>)\n");
        let reads: Vec<_> = s.parameters_read();
        let named = |n: &str| Parameter::Named(n.into());
        assert_eq!(
            reads,
            [Parameter::Number(1), Parameter::Number(5), Parameter::Number(7), named("depth"), named("y"), named("zz")]
        );
        assert_eq!(s.writes.iter().map(|w| w.what.clone()).collect::<Vec<_>>(), [Parameter::Number(1), named("x")]);
        assert!(!s.is_dynamic() && !s.is_straight_line());
        let s = of("G1 X##1\n#[#2 + 1] = 5\nG#3\n");
        assert!(s.reads_dynamic && s.writes_dynamic && s.dynamic_codes);
    }

    #[test]
    fn labels() {
        let s = of("o100 sub\no<Part A> call [#1]\no#2 if [1]\no100 endsub\n");
        let labels: Vec<_> = s.statements.iter().map(|s| (s.what.label.clone(), s.what.keyword)).collect();
        assert_eq!(
            labels,
            [
                (Label::Number(100), Keyword::Sub),
                (Label::Named("parta".into()), Keyword::Call),
                (Label::Dynamic, Keyword::If),
                (Label::Number(100), Keyword::Endsub)
            ]
        );
    }
}
