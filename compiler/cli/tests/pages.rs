//! Pages of targets that show a command: it is run in a folder with the page's files, and what it writes is compared.
//! `UPDATE_DOCS=1` writes what comes out into the page.

use std::path::Path;
use std::process::Command;

const PAGES: [&str; 3] = ["joint-gcode", "setpoints", "rs274ngc"];

/// The first fenced block of a kind: what stands behind the kind, and the text.
fn block<'t>(page: &'t str, kind: &str) -> Option<(&'t str, &'t str)> {
    let open = format!("```{kind}");
    let from = page.find(&open)? + open.len();
    let (head, rest) = page[from..].split_once('\n')?;
    Some((head.trim(), &rest[..rest.find("```")?]))
}

#[test]
fn examples_of_the_pages() {
    let mut wrong = Vec::new();
    for page in PAGES {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/targets").join(format!("{page}.md"));
        let text = std::fs::read_to_string(&path).unwrap();
        let folder = tempfile::tempdir().unwrap();
        for (kind, name) in [("toml", "cell.toml"), ("gcode", "part.ngc")] {
            if let Some((_, body)) = block(&text, kind) {
                std::fs::write(folder.path().join(name), body).unwrap();
            }
        }
        let (_, command) = block(&text, "sh").expect("a command");
        let words: Vec<&str> = command.split_whitespace().skip(1).collect();
        let made = Command::new(env!("CARGO_BIN_EXE_gcc-robot")).args(&words).current_dir(folder.path()).output().unwrap();
        assert!(made.status.success(), "{page}: {}", String::from_utf8_lossy(&made.stderr));
        let (what, now) = block(&text, "text").expect("what it writes");
        let (file, range) = what.split_once(' ').unwrap();
        let (first, last) = range.split_once('-').unwrap();
        let skip = first.parse::<usize>().unwrap() - 1;
        let count = last.parse::<usize>().map_or(usize::MAX, |l| l - skip);
        let written = std::fs::read_to_string(folder.path().join(file)).unwrap();
        let wanted: String = written.lines().skip(skip).take(count).map(|l| format!("{}\n", l.trim_end())).collect();
        if now == wanted {
            continue;
        }
        if std::env::var_os("UPDATE_DOCS").is_some() {
            let at = text.find(&format!("```text {what}\n")).unwrap() + what.len() + 9;
            std::fs::write(&path, format!("{}{wanted}{}", &text[..at], &text[at + now.len()..])).unwrap();
        } else {
            wrong.push(format!("{page}:\n{wanted}"));
        }
    }
    assert!(wrong.is_empty(), "UPDATE_DOCS=1 brings these up to date:\n{}", wrong.join("\n"));
}
