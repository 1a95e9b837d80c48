//! The tables of the top-level `spec/` folder as static data.
//!
//! One job: give code, `explain`, hover texts and docs the same facts. Nothing here computes anything.

include!(concat!(env!("OUT_DIR"), "/tables.rs"));

/// How bad a diagnostic is.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, PartialOrd, Ord)]
pub enum Severity {
    /// The program can't be built.
    Error,
    /// The program can be built; someone should look.
    Warning,
    /// Something worth knowing.
    Hint,
}

/// One row of `spec/diagnostics`.
#[derive(Debug)]
pub struct DiagnosticDef {
    /// Stable code, `E0203`.
    pub code: &'static str,
    /// Stable readable name, `arc/radius-mismatch`.
    pub slug: &'static str,
    /// Its usual severity.
    pub severity: Severity,
    /// A machinist's lint: raised on programs the controller accepts.
    pub lint: bool,
    /// The message, with `{0}`, `{1}` … for its arguments.
    pub message: &'static str,
    /// What it means and why it matters (Markdown).
    pub explanation: &'static str,
    /// What to do about it, with the same arguments.
    pub fix: Option<&'static str>,
    /// Dialect of the examples; none = `linuxcnc`.
    pub dialect: Option<&'static str>,
    /// Tool table the examples need.
    pub tools: Option<&'static str>,
    /// Command and options the examples are for, when it is not plain `check` (`machine check`: they are
    /// machine files).
    pub options: Option<&'static str>,
    /// A program that raises exactly this.
    pub bad: Option<&'static str>,
    /// The mended program, which raises nothing.
    pub good: Option<&'static str>,
}

/// Which diagnostic: a row of the registry. Constants are in [`code`].
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Code(u16);

impl Code {
    /// The registry row.
    pub fn def(self) -> &'static DiagnosticDef {
        &DIAGNOSTICS[self.0 as usize]
    }
    /// All rows, in order of their codes.
    pub fn all() -> impl Iterator<Item = Code> {
        (0..DIAGNOSTICS.len() as u16).map(Code)
    }
    /// Finds `E0203` or `arc/radius-mismatch`, in any case.
    pub fn find(name: &str) -> Option<Code> {
        Self::all().find(|c| c.def().code.eq_ignore_ascii_case(name) || c.def().slug.eq_ignore_ascii_case(name))
    }
}

impl std::fmt::Debug for Code {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {}", self.def().code, self.def().slug)
    }
}

/// A message text of the real `rs274`. Constants are in [`rs274`].
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Rs274(u16);

impl Rs274 {
    /// The text, with `{0}`, `{1}` … for its arguments.
    pub fn text(self) -> &'static str {
        RS274[self.0 as usize]
    }
}

/// Puts `args` in place of `{0}`, `{1}` ….
pub fn fill(template: &str, args: &[String]) -> String {
    let mut out = String::with_capacity(template.len() + 16);
    let mut rest = template;
    while let Some(open) = rest.find('{') {
        out.push_str(&rest[..open]);
        let tail = &rest[open..];
        match tail.find('}').and_then(|close| Some((close, tail[1..close].parse::<usize>().ok()?))) {
            Some((close, n)) => {
                out.push_str(args.get(n).map_or("", |s| s.as_str()));
                rest = &tail[close + 1..];
            }
            None => {
                out.push('{');
                rest = &tail[1..];
            }
        }
    }
    out.push_str(rest);
    out
}

/// A template as people read it before anything has happened: `…` where the arguments go.
pub fn open(template: &str) -> String {
    fill(template, &[const { "…" }; 9].map(str::to_string))
}

/// One row of `spec/targets`: something `--target` takes.
#[derive(Debug, PartialEq, Eq)]
pub struct TargetDef {
    /// `rs274ngc`
    pub id: &'static str,
    /// For people.
    pub title: &'static str,
    /// Usual extension of the written file, without dot.
    pub extension: &'static str,
    /// `stable`, `experimental` or `planned`.
    pub status: &'static str,
    /// Options of `build` that it heeds.
    pub options: &'static [&'static str],
    /// What it writes (Markdown).
    pub what: &'static str,
}

impl TargetDef {
    /// All targets.
    pub fn all() -> &'static [TargetDef] {
        TARGETS
    }
    /// By id.
    pub fn find(id: &str) -> Option<&'static TargetDef> {
        TARGETS.iter().find(|t| t.id == id)
    }
}

/// What a controller reads behind a key of its INI file.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum IniKind {
    /// Anything.
    Text,
    /// A number.
    Number,
    /// A whole number.
    Integer,
    /// A whole number: on, unless it is 0.
    Flag,
    /// 1 or 0.
    Switch,
}

/// One row of `spec/ini`: a key of LinuxCNC's INI file that programs depend on.
#[derive(Debug, PartialEq, Eq)]
pub struct IniKey {
    /// In capitals; `?` is the letter of an axis.
    pub section: &'static str,
    /// In capitals.
    pub name: &'static str,
    /// What stands behind it.
    pub kind: IniKind,
    /// Smallest value.
    pub least: Option<i64>,
    /// Largest value.
    pub most: Option<i64>,
    /// What it means to programs.
    pub what: &'static str,
}

impl IniKey {
    /// All keys.
    pub fn all() -> &'static [IniKey] {
        INI_KEYS
    }
    /// By section and name, in capitals.
    pub fn find(section: &str, name: &str) -> Option<&'static IniKey> {
        INI_KEYS.iter().find(|k| k.name == name && k.stands_in(section))
    }
    /// Whether it belongs into a section.
    pub fn stands_in(&self, section: &str) -> bool {
        match self.section.strip_suffix('?') {
            Some(head) => section.strip_prefix(head).is_some_and(|axis| axis.len() == 1),
            None => self.section == section,
        }
    }
}

/// Which grammar and interpretation rules a dialect follows.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub enum Family {
    /// RS274NGC as LinuxCNC has it: blanks anywhere, O-words, `#<names>`.
    #[default]
    Linuxcnc,
    /// Fanuc Macro B: `#n`, IF/GOTO/WHILE, O-numbers as program numbers, M98 P.
    Fanuc,
    /// grbl: plain words only.
    Grbl,
    /// The UFMG 2008 subset: eleven words, decimal comma allowed.
    Ufmg2008,
}

/// One dialect of `spec/dialects`.
#[derive(Debug)]
pub struct Dialect {
    /// `linuxcnc-2.9`
    pub id: &'static str,
    /// Other names: `linuxcnc`.
    pub aliases: &'static [&'static str],
    /// For people.
    pub title: &'static str,
    /// Rules it follows.
    pub family: Family,
    /// Longest line in bytes the controller reads; 0 = no limit.
    pub line_limit: u32,
    /// A program must end with M2, M30 or `%` (otherwise a missing end is normal).
    pub needs_end: bool,
    /// A comma may stand for the decimal point.
    pub decimal_comma: bool,
    /// File extensions that suggest it.
    pub extensions: &'static [&'static str],
    /// Words.
    pub words: &'static [WordDef],
    /// G, M and other codes.
    pub codes: &'static [CodeDef],
    /// Behaviour that differs between versions.
    pub facts: &'static [FactDef],
}

/// A behaviour of a dialect that another version of it has differently.
#[derive(Debug)]
pub struct FactDef {
    /// Stable name, `peck-clearance`.
    pub key: &'static str,
    /// For people.
    pub title: &'static str,
    /// The value, as people write it.
    pub value: &'static str,
    /// In a sentence.
    pub what: &'static str,
    /// Where the row comes from.
    pub source: &'static str,
}

/// A modal group.
#[derive(Debug)]
pub struct GroupDef {
    /// Name used by [`CodeDef::group`].
    pub slug: &'static str,
    /// Number in RS274NGC, or −1.
    pub number: i8,
    /// For people.
    pub title: &'static str,
}

/// A predefined parameter: one name, or a range of numbers.
#[derive(Debug)]
pub struct ParameterDef {
    /// `_x`; empty for numbered ones.
    pub name: &'static str,
    /// First number; 0 for named ones.
    pub first: u32,
    /// Last number.
    pub last: u32,
    /// Short name of a numbered one.
    pub title: &'static str,
    /// Unit slug.
    pub unit: &'static str,
    /// Kept in the parameter file.
    pub persistent: bool,
    /// What it holds.
    pub what: &'static str,
    /// Where the row comes from.
    pub source: &'static str,
}

/// A function, operator, control word or special comment.
#[derive(Debug)]
pub struct WordingDef {
    /// Upper case for functions, operators and comments, lower case for control words.
    pub name: &'static str,
    /// How it is written.
    pub form: &'static str,
    /// Of an operator: higher binds tighter. 0 otherwise.
    pub precedence: u8,
    /// What it does.
    pub what: &'static str,
    /// Where the row comes from.
    pub source: &'static str,
}

/// All modal groups.
pub fn groups() -> &'static [GroupDef] {
    GROUPS
}

/// All predefined parameters of RS274NGC.
pub fn parameters() -> &'static [ParameterDef] {
    PARAMETERS
}

/// The predefined parameter `5063` or `_x` (any case, without `#` and angle brackets).
pub fn parameter(name: &str) -> Option<&'static ParameterDef> {
    let number = name.parse::<u32>().unwrap_or(0);
    PARAMETERS.iter().find(|p| {
        if p.name.is_empty() { (p.first..=p.last).contains(&number) } else { p.name.eq_ignore_ascii_case(name) }
    })
}

/// Unary functions.
pub fn functions() -> &'static [WordingDef] {
    FUNCTIONS
}

/// Binary operators.
pub fn operators() -> &'static [WordingDef] {
    OPERATORS
}

/// Words of control lines (`o1 while`).
pub fn controls() -> &'static [WordingDef] {
    CONTROLS
}

/// Words that make a comment active (`(MSG, …)`).
pub fn comments() -> &'static [WordingDef] {
    COMMENTS
}

/// A word letter of a dialect.
#[derive(Debug)]
pub struct WordDef {
    /// Upper case; `@ ^ $` too.
    pub letter: char,
    /// Short name.
    pub title: &'static str,
    /// `length`, `angle`, `feed`, `rpm`, `integer`, … or empty.
    pub unit: &'static str,
    /// One sentence or more (Markdown).
    pub what: &'static str,
}

/// A code of a dialect.
#[derive(Debug)]
pub struct CodeDef {
    /// `G83`, `G5.1`, `M6`.
    pub code: &'static str,
    /// Short name.
    pub title: &'static str,
    /// Modal group as a slug (`motion`, `plane`, …), or `none`.
    pub group: &'static str,
    /// Its words.
    pub args: &'static [ArgDef],
    /// What it does (Markdown).
    pub what: &'static str,
    /// Codes of diagnostics it can raise.
    pub errors: &'static [&'static str],
    /// Where the row comes from.
    pub source: &'static str,
}

/// A word that a code takes.
#[derive(Debug)]
pub struct ArgDef {
    /// Upper-case letter(s); several mean each of them.
    pub letters: &'static str,
    /// Must be there.
    pub required: bool,
    /// Unit slug.
    pub unit: &'static str,
    /// What it says.
    pub what: &'static str,
}

impl Dialect {
    /// All dialects.
    pub fn all() -> &'static [Dialect] {
        DIALECTS
    }
    /// By id or alias.
    pub fn find(name: &str) -> Option<&'static Dialect> {
        DIALECTS.iter().find(|d| d.id == name || d.aliases.contains(&name))
    }
    /// The default: LinuxCNC 2.9.
    pub fn linuxcnc() -> &'static Dialect {
        Self::find("linuxcnc-2.9").expect("the table has it")
    }
    /// The row of a code such as `G83`; `M142` finds the row `M100-M199`.
    pub fn code(&self, code: &str) -> Option<&'static CodeDef> {
        self.codes.iter().find(|c| c.code == code).or_else(|| {
            let number: u32 = code.get(1..)?.parse().ok()?;
            self.codes.iter().find(|c| match c.code.split_once('-') {
                Some((a, b)) => {
                    let of = |s: &str| s.get(1..).and_then(|n| n.parse::<u32>().ok());
                    code.starts_with(&c.code[..1]) && of(a).is_some_and(|a| a <= number) && of(b).is_some_and(|b| number <= b)
                }
                None => false,
            })
        })
    }
    /// The row of a word letter, upper case.
    pub fn word(&self, letter: char) -> Option<&'static WordDef> {
        self.words.iter().find(|w| w.letter == letter)
    }
    /// A behaviour that differs between versions.
    pub fn fact(&self, key: &str) -> Option<&'static FactDef> {
        self.facts.iter().find(|f| f.key == key)
    }
}
