//! Each WHERE rule: one file that keeps it, one that breaks it. The page that lists them is written from the
//! same table: `GCC_ROBOT_WRITE_DOCS=1 cargo test -p gr-step --test rules`.

mod examples;

use std::fmt::Write;

use examples::{data, diagnostics, file};
use gr_step::{Decided, Model, Origin, RULES, Rule};

struct Example {
    rule: String,
    holds: String,
    broken: String,
}

fn all() -> (String, Vec<Example>) {
    let text = data("rules.txt");
    let mut parts = text.split("\n== ");
    let common = parts.nth(1).and_then(|c| c.split_once('\n')).expect("common").1.trim().to_string();
    let examples = parts.map(|p| {
        let (rule, rest) = p.split_once("\nholds\n").expect("holds");
        let (holds, broken) = rest.split_once("\nbroken\n").expect("broken");
        Example { rule: rule.trim().into(), holds: holds.trim().into(), broken: broken.trim().into() }
    });
    (common, examples.collect())
}

fn name(r: &Rule) -> String {
    format!("{}.{}", r.entity, r.label)
}

fn decide(rule: &Rule, text: &str) -> Option<bool> {
    let exchange = gr_p21::parse(text.as_bytes());
    assert_eq!(exchange.faults, [], "{text}");
    let model = Model::new(text.as_bytes(), &exchange);
    let node = model.get(100).expect("#100");
    assert!(node.is_a(rule.entity), "{} is no {}", node.keyword(), rule.entity);
    let Decided::By(check) = rule.decided else { panic!("{} is not decided", name(rule)) };
    check(node)
}

#[test]
fn every_rule_has_a_passing_and_a_failing_file() {
    let (common, examples) = all();
    let mut wrong = Vec::new();
    for rule in RULES.iter().filter(|r| matches!(r.decided, Decided::By(_))) {
        let Some(e) = examples.iter().find(|e| e.rule == name(rule)) else {
            wrong.push(format!("{}: no example", name(rule)));
            continue;
        };
        let (holds, broken) = (file(&format!("{}\n{common}", e.holds)), file(&format!("{}\n{common}", e.broken)));
        if decide(rule, &holds) != Some(true) {
            wrong.push(format!("{}: not kept: {:?}", name(rule), decide(rule, &holds)));
        }
        if decide(rule, &broken) != Some(false) {
            wrong.push(format!("{}: not broken: {:?}", name(rule), decide(rule, &broken)));
        }
        let said = diagnostics(&broken);
        if !said.iter().any(|d| d.message.starts_with(&format!("rule {} of", name(rule)))) {
            let at100: Vec<&str> = said.iter().filter(|d| broken[d.primary().1.range()].len() < 60).map(|d| d.message.as_str()).collect();
            wrong.push(format!("{}: not reported: {at100:?}", name(rule)));
        }
        if diagnostics(&holds).iter().any(|d| d.message.starts_with(&format!("rule {} of", name(rule)))) {
            wrong.push(format!("{}: reported where it is kept", name(rule)));
        }
    }
    assert!(wrong.is_empty(), "{} of {}:\n{}", wrong.len(), RULES.len(), wrong.join("\n"));
}

/// What the letter of a rule forbids and every reader understands does not stop anybody.
#[test]
fn a_pattern_of_one_row_is_a_warning() {
    let (common, examples) = all();
    let e = examples.iter().find(|e| e.rule == "rectangular_pattern.WR1").expect("its example");
    let said = |text: &str| -> Vec<gr_spec::Severity> {
        let all = diagnostics(&file(&format!("{text}\n{common}")));
        all.into_iter().filter(|d| d.message.starts_with("rule rectangular_pattern.WR1 of the standard asks that")).map(|d| d.severity).collect()
    };
    assert_eq!(said(&e.broken), [gr_spec::Severity::Warning]);
    assert_eq!(said(&e.broken.replace(",1,3,#271,#206,", ",$,3,$,$,")), [gr_spec::Severity::Warning]);
    assert_eq!(said(&e.holds.replace(",2,3,#271,#206,", ",2,3,$,$,")), [gr_spec::Severity::Error]);
    assert_eq!(said(&e.holds), []);
}

#[test]
fn every_rule_of_the_table_is_there() {
    let mut missing = Vec::new();
    for e in &gr_step::schema().entities {
        if e.rules.is_empty() {
            continue;
        }
        let entity = e.keyword.to_ascii_lowercase();
        let labels: Vec<&str> = e.rules.match_indices("WR").map(|(n, _)| e.rules[n..].split([' ', ':']).next().unwrap_or("")).collect();
        let labels = if labels.is_empty() { vec!["WR1"] } else { labels };
        for label in labels {
            if !RULES.iter().any(|r| r.entity == entity && r.label == label) {
                missing.push(format!("{entity}.{label}"));
            }
        }
    }
    assert!(missing.is_empty(), "{missing:?}");
    assert!(RULES.iter().filter(|r| r.origin == Origin::Process).count() >= 38);
}

fn page() -> String {
    let mut out = String::new();
    let decided = RULES.iter().filter(|r| matches!(r.decided, Decided::By(_))).count();
    let _ = writeln!(out, "{} rules, {decided} of them decided on every file.\n", RULES.len());
    out += "| entity | rule | asks that | of | checked |\n|---|---|---|---|---|\n";
    for r in RULES {
        let origin = if r.origin == Origin::Process { "ISO 14649" } else { "ISO 10303" };
        let checked = match r.decided {
            Decided::By(_) => "yes".to_string(),
            Decided::Never(why) => format!("no: {why}"),
        };
        let _ = writeln!(out, "| `{}` | {} | {} | {origin} | {checked} |", r.entity.to_ascii_uppercase(), r.label, r.says);
    }
    out
}

fn messages() -> String {
    let mut out = String::from("| code | | says |\n|---|---|---|\n");
    let mut all: Vec<_> = gr_spec::Code::all().map(|c| c.def()).collect();
    all.sort_by_key(|d| d.code);
    for def in all {
        if ["p21/", "step/", "plan/", "reference/", "stepnc/"].iter().any(|a| def.slug.starts_with(a)) {
            let kind = format!("{:?}", def.severity).to_lowercase();
            let _ = writeln!(out, "| {} `{}` | {kind} | {} |", def.code, def.slug, def.message.replace('|', "\\|"));
        }
    }
    out
}

fn between(text: &str, mark: &str, new: &str) -> String {
    let (open, close) = (format!("<!-- {mark} -->\n"), format!("<!-- end of {mark} -->"));
    let from = text.find(&open).map_or_else(|| panic!("{open}"), |n| n + open.len());
    let to = text.find(&close).unwrap_or_else(|| panic!("{close}"));
    format!("{}\n{new}\n{}", &text[..from], &text[to..])
}

#[test]
fn the_page_is_up_to_date() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/stepnc.md");
    let text = std::fs::read_to_string(&path).expect("docs/stepnc.md");
    let new = between(&between(&text, "rules", &page()), "messages", &messages());
    if std::env::var_os("GCC_ROBOT_WRITE_DOCS").is_some() {
        std::fs::write(&path, &new).expect("writable");
    } else {
        assert!(new == text, "docs/stepnc.md is stale: GCC_ROBOT_WRITE_DOCS=1 cargo test -p gr-step --test rules");
    }
}
