//! The pages of the kinds of kinematics: their example is read, and what they say of it computed. `UPDATE_DOCS=1` writes
//! what comes out into the page.

use gr_machine::{JointKind, Machine, parse};
use gr_text::FileId;
use std::path::PathBuf;

const KINDS: [&str; 11] =
    ["cartesian", "planar-3r", "scara", "opw", "ur", "five-axis", "parallel-2ups-prp", "tricept", "dh", "mdh", "origins"];

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../docs/machines")
}

/// The fenced block of a kind.
fn block<'t>(page: &'t str, kind: &str) -> &'t str {
    let from = page.find(&format!("```{kind}\n")).unwrap_or_else(|| panic!("no {kind}")) + kind.len() + 4;
    &page[from..from + page[from..].find("```").unwrap()]
}

fn list(values: &[f64]) -> String {
    let one = |v: &f64| if v.abs() < 5e-4 { "0".into() } else { format!("{v:.3}") };
    values.iter().map(one).collect::<Vec<_>>().join(", ")
}

/// What the page says of its example at the joint values it names.
fn said(machine: &Machine, first: &str) -> String {
    let given: Vec<f64> = first.split_whitespace().skip(1).map(|v| v.parse().unwrap()).collect();
    assert_eq!(given.len(), machine.joints.len(), "{first}");
    let unit = |(v, j): (&f64, &gr_machine::Joint)| if j.kind == JointKind::Revolute { v.to_radians() } else { *v };
    let joints: Vec<f64> = given.iter().zip(&machine.joints).map(unit).collect();
    assert!(machine.outside(&joints).is_empty(), "{first}");
    let k = machine.kinematics();
    let at = k.forward_frame(&joints).unwrap();
    let pose = k.forward(&joints).unwrap();
    let all = k.inverse_frame(&at).unwrap_or_else(|e| panic!("{}: {e}", machine.id));
    for s in &all {
        let (p, _) = k.forward_frame(&s.joints).unwrap().error_to(&at);
        assert!(gr_machine::math::norm(p) < 1e-3, "{}: {p:?}", machine.id);
    }
    let count = if all.len() == 1 { "1 solution".into() } else { format!("{} solutions", all.len()) };
    let turns = pose.rotation.map(f64::to_degrees);
    format!("{first}\nflange at {} mm, turned {}°\n{count}\n", list(&pose.position), list(&turns))
}

#[test]
fn every_kind_has_a_page_whose_example_holds() {
    let mut wrong = Vec::new();
    for kind in KINDS {
        let path = folder().join(format!("{kind}.md"));
        let page = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display())).replace('\r', "");
        let machine = parse(FileId(0), block(&page, "toml")).unwrap_or_else(|e| panic!("{kind}: {e:#?}"));
        let text = block(&page, "text");
        let now = said(&machine, text.lines().next().unwrap());
        if now == text {
            continue;
        }
        if std::env::var_os("UPDATE_DOCS").is_some() {
            std::fs::write(&path, page.replacen(text, &now, 1)).unwrap();
        } else {
            wrong.push(format!("{kind}:\n{now}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The table of the page on machine files names every kind, and leads to its page.
#[test]
fn the_table_leads_to_every_page() {
    let table = include_str!("../../../docs/machines.md");
    for kind in KINDS {
        assert!(table.contains(&format!("[`{kind}`](machines/{kind}.md)")), "{kind}");
    }
    let pages = std::fs::read_dir(folder()).unwrap().count();
    assert_eq!(pages, KINDS.len());
    let known = gr_machine::parse(FileId(0), "format = 1\nid = \"a/b\"\ntitle = \"t\"\nkind = \"robot\"\n[kinematics]\nkind = \"none\"\n").unwrap_err();
    let message = known.iter().map(|d| d.message.clone()).find(|m| m.contains("must be one of")).unwrap();
    assert_eq!(message.matches('"').count(), 2 * KINDS.len(), "{message}");
}
