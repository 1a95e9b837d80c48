//! The pages of the targets: their examples are built and compared. `UPDATE_DOCS=1` writes what comes out into the page.

use gr_ir::Texts;
use gr_robot::plan;
use gr_text::FileId;
use gr_vendors::{Options, language, languages};
use std::path::PathBuf;

fn page(id: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../docs/targets").join(format!("{id}.md"))
}

/// The first fenced block of a kind: what stands behind the kind, and the text.
fn block<'t>(page: &'t str, kind: &str) -> (&'t str, &'t str) {
    let open = format!("```{kind}");
    let from = page.find(&open).unwrap_or_else(|| panic!("no {kind}")) + open.len();
    let (head, rest) = page[from..].split_once('\n').unwrap();
    (head.trim(), &rest[..rest.find("```").unwrap()])
}

/// The files of the page's example.
fn built(id: &str, page: &str) -> Vec<(String, String)> {
    let (cell, program) = (block(page, "toml").1, block(page, "gcode").1);
    let machine = gr_machine::parse(FileId(0), cell).unwrap_or_else(|e| panic!("{id}: {e:?}"));
    let setup = gr_interp::Setup { tools: gr_interp::assumed_tools(), ..gr_interp::Setup::default() };
    let motion = gr_driver::lower("part.ngc", program.into(), &setup, None).program;
    let texts = Texts::new([(FileId(0), program)]);
    let options = gr_robot::Options { name: "part".into(), ..gr_robot::Options::default() };
    let planned = plan(&motion, &machine, &texts, &options).unwrap_or_else(|e| panic!("{id}: {e:#?}"));
    let allow_unverified = gr_spec::TargetDef::find(id).is_some_and(|t| t.status == "experimental");
    let output = language(id).unwrap().emit(&planned.program, &texts, &Options { allow_unverified, decimals: None });
    assert!(!output.files.is_empty(), "{id}: {:#?}", output.findings);
    output.files.into_iter().map(|f| (f.name, String::from_utf8(f.bytes).unwrap().replace('\r', ""))).collect()
}

/// The lines that the page shows of a file: `name 5-20`.
fn shown(files: &[(String, String)], what: &str) -> String {
    let (name, range) = what.split_once(' ').unwrap();
    let (first, last) = range.split_once('-').unwrap();
    let file = files.iter().find(|f| f.0 == name).unwrap_or_else(|| panic!("no {name}: {:?}", files.iter().map(|f| &f.0).collect::<Vec<_>>()));
    let skip = first.parse::<usize>().unwrap() - 1;
    let count = last.parse::<usize>().map_or(usize::MAX, |l| l - skip);
    file.1.lines().skip(skip).take(count).map(|l| format!("{}\n", l.trim_end())).collect()
}

#[test]
fn examples_of_the_pages() {
    let mut wrong = Vec::new();
    for l in languages() {
        let path = page(l.id());
        let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let (what, now) = block(&text, "text");
        let wanted = shown(&built(l.id(), &text), what);
        if now == wanted {
            continue;
        }
        if std::env::var_os("UPDATE_DOCS").is_some() {
            let at = text.find(&format!("```text {what}\n")).unwrap() + what.len() + 9;
            std::fs::write(&path, format!("{}{wanted}{}", &text[..at], &text[at + now.len()..])).unwrap();
        } else {
            wrong.push(format!("{}:\n{wanted}", l.id()));
        }
    }
    assert!(wrong.is_empty(), "UPDATE_DOCS=1 brings these up to date:\n{}", wrong.join("\n"));
}
