//! The pages of targets: the command of each is run in a folder with the page's files, and what it writes is compared.
//! `UPDATE_DOCS=1` writes what comes out into the page.

use std::path::{Path, PathBuf};
use std::process::Command;

fn pages() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/targets")
}

/// The first fenced block of a kind: what stands behind the kind, and the text.
fn block<'t>(page: &'t str, kind: &str) -> Option<(&'t str, &'t str)> {
    let open = format!("```{kind}");
    let from = page.find(&open)? + open.len();
    let (head, rest) = page[from..].split_once('\n')?;
    Some((head.trim(), &rest[..rest.find("```")?]))
}

/// The words of the page's command.
fn command(page: &str) -> Vec<&str> {
    let from = page.find("`gcc-robot build ").expect("a command") + 1;
    page[from..].split('`').next().expect("its end").split_whitespace().skip(1).collect()
}

/// The lines that the page shows of a file: `name 5-20`, the file in the folder that the command names.
fn shown(folder: &Path, words: &[&str], what: &str) -> String {
    let (name, range) = what.split_once(' ').expect("file and lines");
    let (first, last) = range.split_once('-').expect("from-to");
    let out = words.iter().skip_while(|w| **w != "-o").nth(1).filter(|o| o.ends_with('/')).unwrap_or(&"");
    let file = folder.join(out).join(name);
    let written = std::fs::read(&file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    let skip = first.parse::<usize>().expect("a line") - 1;
    let count = last.parse::<usize>().map_or(usize::MAX, |l| l - skip);
    let text = String::from_utf8(written).expect("UTF-8").replace('\r', "");
    text.lines().skip(skip).take(count).map(|l| format!("{}\n", l.trim_end())).collect()
}

#[test]
fn every_robot_language_has_a_page() {
    for language in gr_vendors::languages() {
        assert!(pages().join(format!("{}.md", language.id())).is_file(), "{}", language.id());
    }
}

#[test]
fn examples_of_the_pages() {
    let mut wrong = Vec::new();
    let mut all: Vec<PathBuf> = std::fs::read_dir(pages()).unwrap().map(|f| f.unwrap().path()).collect();
    all.sort();
    for page in all {
        let text = std::fs::read_to_string(&page).unwrap();
        let folder = tempfile::tempdir().unwrap();
        for (kind, name) in [("toml", "cell.toml"), ("gcode", "part.ngc")] {
            if let Some((_, body)) = block(&text, kind) {
                std::fs::write(folder.path().join(name), body).unwrap();
            }
        }
        let words = command(&text);
        let made = Command::new(env!("CARGO_BIN_EXE_gcc-robot")).args(&words).current_dir(folder.path()).output().unwrap();
        assert!(made.status.success(), "{}: {}", page.display(), String::from_utf8_lossy(&made.stderr));
        let (what, now) = block(&text, "text").expect("what it writes");
        let wanted = shown(folder.path(), &words, what);
        if now == wanted {
            continue;
        }
        if std::env::var_os("UPDATE_DOCS").is_some() {
            let at = text.find(&format!("```text {what}\n")).unwrap() + what.len() + 9;
            std::fs::write(&page, format!("{}{wanted}{}", &text[..at], &text[at + now.len()..])).unwrap();
        } else {
            wrong.push(format!("{}:\n{wanted}", page.display()));
        }
    }
    assert!(wrong.is_empty(), "UPDATE_DOCS=1 brings these up to date:\n{}", wrong.join("\n"));
}
