//! Every dialect table is complete and says where its rows come from.

use gr_spec::{Dialect, groups, parameter, parameters};

/// `G38.2`, `M6`, or a range such as `M100-M199`.
fn is_code(code: &str) -> bool {
    let one = |c: &str| {
        let Some(rest) = c.strip_prefix(['G', 'M', 'T']) else { return false };
        let (whole, part) = rest.split_once('.').unwrap_or((rest, "0"));
        whole.parse::<u16>().is_ok() && part.parse::<u8>().is_ok() && !rest.starts_with('+')
    };
    code.split('-').all(one)
}

#[test]
fn tables_are_complete() {
    for d in Dialect::all() {
        assert!(!d.codes.is_empty() && !d.words.is_empty(), "{} has no rows", d.id);
        for w in d.words {
            assert!(!w.title.is_empty() && !w.what.is_empty(), "{}: word {}", d.id, w.letter);
        }
        for c in d.codes {
            let at = format!("{} {}", d.id, c.code);
            assert!(is_code(c.code), "{at}: not a code");
            assert!(!c.title.is_empty() && c.what.len() > 5 && c.source.len() > 10, "{at}: title, what or source");
            assert!(groups().iter().any(|g| g.slug == c.group), "{at}: group {}", c.group);
            for a in c.args {
                assert!(!a.what.is_empty() && !a.unit.is_empty(), "{at}: {}", a.letters);
                for l in a.letters.chars() {
                    assert!(d.word(l).is_some(), "{at}: takes {l}, which is no word of the dialect");
                }
            }
            for e in c.errors {
                assert!(gr_spec::Code::find(e).is_some(), "{at}: {e}");
            }
        }
        let mut names: Vec<_> = d.codes.iter().map(|c| c.code).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), d.codes.len(), "{}: a code twice", d.id);
        let mut letters: Vec<_> = d.words.iter().map(|w| w.letter).collect();
        letters.sort_unstable();
        letters.dedup();
        assert_eq!(letters.len(), d.words.len(), "{}: a word twice", d.id);
    }
}

#[test]
fn the_six_dialects() {
    let ids: Vec<_> = Dialect::all().iter().map(|d| d.id).collect();
    assert_eq!(ids, ["fanuc-mill", "fanuc-turn", "grbl", "linuxcnc-2.10", "linuxcnc-2.9", "ufmg2008"]);
    assert_eq!(Dialect::find("linuxcnc").map(|d| d.id), Some("linuxcnc-2.9"));
}

#[test]
fn a_later_version_has_the_elders_rows_and_its_own() {
    let (old, new) = (Dialect::linuxcnc(), Dialect::find("linuxcnc-2.10").expect("there"));
    assert!(new.code("G83").expect("there").args.iter().any(|a| a.letters == "D"));
    assert!(!old.code("G83").expect("there").args.iter().any(|a| a.letters == "D"));
    assert!(new.code("G6.2").is_some() && old.code("G6.2").is_none());
    for c in old.codes {
        assert!(new.code(c.code).is_some(), "{} got lost", c.code);
    }
    assert!(new.facts.len() >= old.facts.len(), "the later version may have facts of its own");
    for f in old.facts {
        assert_ne!(Some(f.value), new.fact(f.key).map(|g| g.value), "{} does not differ", f.key);
    }
}

#[test]
fn parameters_are_found() {
    assert_eq!(parameter("5063").map(|p| p.title), Some("probe result"));
    assert_eq!(parameter("5390").map(|p| p.title), Some("G59.3 rotation"));
    assert_eq!(parameter("_ABS_X").map(|p| p.unit), Some("length"));
    assert!(parameter("5100").is_none());
    let mut last = 0;
    for p in parameters().iter().filter(|p| p.name.is_empty()) {
        assert!(p.first > last && p.last >= p.first, "{} overlaps", p.title);
        last = p.last;
    }
    assert_eq!(gr_spec::functions().len(), 14);
}

#[test]
fn user_commands_are_a_range() {
    let d = Dialect::linuxcnc();
    assert_eq!(d.code("M142").map(|c| c.code), Some("M100-M199"));
    assert!(d.code("M200").is_none() && d.code("G142").is_none());
}

/// An extension decides alone: two dialects that claim it would leave the choice to the order of files.
#[test]
fn each_extension_belongs_to_one_dialect() {
    let mut all: Vec<_> = Dialect::all().iter().flat_map(|d| d.extensions).collect();
    all.sort_unstable();
    let before = all.len();
    all.dedup();
    assert_eq!(all.len(), before);
}
