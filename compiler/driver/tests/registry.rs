//! Every row of the registry: its bad example raises exactly its code, its good example raises nothing.

use gr_driver::{Check, Level, Options, Session};
use gr_interp::{Setup, read_ini, read_tools};
use gr_spec::{Code, Dialect, Severity};
use gr_text::FileId;

/// The INI file that examples with `check -i mill.ini` are run with.
const MILL_INI: &str = "[TRAJ]\nLINEAR_UNITS = mm\n[AXIS_X]\nMIN_LIMIT = -10\nMAX_LIMIT = 600\n\
                        [AXIS_Y]\nMIN_LIMIT = -10\nMAX_LIMIT = 400\n[AXIS_Z]\nMIN_LIMIT = -150\nMAX_LIMIT = 50\n";

/// Options for a row's examples; none: they belong to another command.
fn options(code: Code) -> Option<Options> {
    let def = code.def();
    let mut setup = Setup::default();
    if let Some(name) = def.dialect {
        setup.dialect = Dialect::find(name).unwrap_or_else(|| panic!("{}: dialect {name}", def.code));
    }
    if let Some(text) = def.tools {
        setup.tools = read_tools(text, FileId(1)).0;
    }
    let mut levels = Vec::new();
    match def.options {
        None => {}
        Some("check -i mill.ini") => setup.ini = read_ini(MILL_INI, FileId(1), None, None).0,
        Some(other) => {
            let name = other.strip_prefix("check --warn ")?;
            levels.push((Code::find(name)?, Level::Warning));
        }
    }
    let mut options = Options::new(setup);
    for (code, level) in levels {
        options.rules.set(code, level);
    }
    Some(options)
}

fn check(code: Code, text: &str, chunk: Option<usize>) -> Option<Check> {
    let mut options = options(code)?;
    options.chunk_lines = chunk;
    let mut session = Session::new();
    let file = session.open("example.ngc", text, options);
    Some(session.check(file))
}

/// Codes of an example's diagnostics. Hints of lints are not held against examples of other rows.
fn codes(code: Code, text: &str) -> Option<Vec<String>> {
    let check = check(code, text, None)?;
    assert_eq!(check, self::check(code, text, Some(1))?, "chunk size shows: {text}");
    let counts = |d: &&gr_text::Diagnostic| d.code == code || d.severity != Severity::Hint;
    let mut codes: Vec<String> = check.diagnostics.iter().filter(counts).map(|d| format!("{:?}", d.code)).collect();
    codes.dedup();
    Some(codes)
}

#[test]
fn bad_examples_raise_exactly_their_code_and_good_ones_nothing() {
    let mut wrong = Vec::new();
    for code in Code::all() {
        let def = code.def();
        let group = &def.code[..3];
        if !matches!(group, "E01" | "E02") && def.options.is_none() {
            continue;
        }
        if let Some(Some(found)) = def.bad.map(|text| codes(code, text))
            && found != [format!("{code:?}")]
        {
            wrong.push(format!("{code:?}: bad example raises {found:?}"));
        }
        if let Some(Some(found)) = def.good.map(|text| codes(code, text))
            && !found.is_empty()
        {
            wrong.push(format!("{code:?}: good example raises {found:?}"));
        }
    }
    assert!(wrong.is_empty(), "{} examples:\n{}", wrong.len(), wrong.join("\n"));
}

#[test]
fn every_lint_has_both_examples() {
    for code in Code::all().filter(|c| c.def().lint) {
        let def = code.def();
        assert!(def.bad.is_some() && def.good.is_some(), "{code:?}");
        assert_ne!(def.severity, Severity::Error, "{code:?}: a lint is not an error");
    }
}

/// Rows without examples, as spec/diagnostics/README.md gives the reasons. The list only ever gets shorter, or
/// longer with a reason there.
const EXEMPT: &[(u32, u32)] = &[
    (258, 259),
    (298, 298),
    (318, 319),
    (440, 445),
    (480, 499),
    (520, 559),
    (503, 503),
    (507, 509),
    (602, 605),
    (610, 614),
    (620, 649),
    (700, 719),
    (804, 805),
    (820, 849),
];

#[test]
fn rows_without_examples_are_a_closed_list() {
    let mut wrong = Vec::new();
    for code in Code::all() {
        let def = code.def();
        let number: u32 = def.code[1..].parse().expect("digits");
        let exempt = EXEMPT.iter().any(|(first, last)| (*first..=*last).contains(&number));
        let examples = (def.bad.is_some(), def.good.is_some());
        if examples != (!exempt, !exempt) {
            wrong.push(format!("{code:?}: examples {examples:?}, exempt {exempt}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
