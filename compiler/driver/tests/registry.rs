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

/// Rows without examples, as spec/diagnostics/README.md gives the reasons, one by one: a new row is not exempt because of
/// its number.
#[rustfmt::skip]
const EXEMPT: &[u32] = &[
    190, 192, 258, 259, 298,
    318, 319,
    440, 441, 442, 443, 444, 445, 446, 447, 448, 449, 450, 451, 452, 453, 454, 455, 456, 457, 471, 480, 481, 482, 483, 484, 485, 486, 487, 488, 489, 490, 491, 492, 493, 494, 495, 496, 497, 498, 499,
    507, 508, 509, 520, 521, 522, 523, 524, 525, 526, 527, 528, 529, 530, 531, 532, 533, 534, 535, 537, 538, 539, 545, 546, 547, 548, 550, 551, 552, 553, 554, 555, 556, 557, 558, 559, 560, 561, 562,
    602, 603, 604, 605, 606, 607, 608, 609, 610, 611, 612, 613, 614, 615, 616, 617, 618, 619, 620, 621, 622, 623, 624, 625, 626, 627, 628, 629, 630, 631, 632, 633, 634, 635, 636, 637, 638, 639, 640, 641, 650, 651, 652, 653, 654,
    700, 701, 702, 703, 704, 705, 706,
    804, 805, 820, 821, 822, 823, 824, 825, 826, 827, 828, 829, 830, 831, 832, 834, 835, 836, 837, 839, 840, 841, 842, 843, 844, 845, 846, 847, 848, 849, 850, 851, 852, 853, 854,
];

fn number(code: Code) -> u32 {
    code.def().code[1..].parse().expect("digits")
}

#[test]
fn rows_without_examples_are_a_closed_list() {
    let mut wrong = Vec::new();
    for code in Code::all() {
        let def = code.def();
        let exempt = EXEMPT.contains(&number(code));
        let examples = (def.bad.is_some(), def.good.is_some());
        if examples != (!exempt, !exempt) {
            wrong.push(format!("{code:?}: examples {examples:?}, exempt {exempt}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Source and test text of the workspace: what runs, and what tests it.
#[derive(Default)]
struct Sources {
    product: String,
    tests: String,
}

impl Sources {
    fn gather(&mut self, folder: &std::path::Path) {
        let mut entries: Vec<_> = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|e| e.path()).collect();
        entries.sort();
        for path in entries {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            if path.is_dir() {
                if name != "target" && name != "node_modules" {
                    self.gather(&path);
                }
                continue;
            }
            let (rust, snapshot) = (name.ends_with(".rs"), name.ends_with(".snap"));
            // This list is no test of what it lists.
            if !(rust || snapshot) || name == "registry.rs" {
                continue;
            }
            let text = std::fs::read_to_string(&path).unwrap_or_default();
            let whole = snapshot || name == "tests.rs" || path.components().any(|c| c.as_os_str() == "tests");
            let at = if whole { 0 } else { text.find("#[cfg(test)]").unwrap_or(text.len()) };
            self.product += &text[..at];
            self.tests += &text[at..];
        }
    }
}

/// Whether a text has a word that is not a part of a longer one.
fn has_word(text: &str, word: &str) -> bool {
    let part = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    text.match_indices(word).any(|(i, _)| !text[..i].ends_with(part) && !text[i + word.len()..].starts_with(part))
}

/// Every row is raised somewhere, and every row without an example is in some test or snapshot: by its number, its slug
/// or its constant.
#[test]
fn every_row_is_raised_and_tested() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut sources = Sources::default();
    for folder in ["compiler", "lsp", "tests"] {
        sources.gather(&root.join(folder));
    }
    let mut wrong = Vec::new();
    for code in Code::all() {
        let def = code.def();
        let constant = def.slug.replace(['/', '-'], "_").to_uppercase();
        if !has_word(&sources.product, &constant) {
            wrong.push(format!("{code:?} is raised nowhere"));
        }
        let names = [def.code, def.slug, &constant];
        if EXEMPT.contains(&number(code)) && !names.iter().any(|n| has_word(&sources.tests, n)) {
            wrong.push(format!("{code:?} is in no test"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
