//! Every program that the Debian package of LinuxCNC ships, through both interpreters: alone, and with the
//! package's folders as subroutine path.

use std::path::PathBuf;
use std::process::Command;

use gr_tests::oracle::{Job, missing, must_agree};

fn shipped() -> Vec<PathBuf> {
    let listed = Command::new("dpkg").args(["-L", "linuxcnc-uspace"]).output();
    let listed = listed.map(|o| String::from_utf8_lossy(&o.stdout).into_owned()).unwrap_or_default();
    let mut files: Vec<PathBuf> = listed.lines().filter(|l| l.ends_with(".ngc")).map(PathBuf::from).collect();
    files.retain(|f| f.is_file());
    files.sort();
    files
}

fn jobs(with_paths: bool) -> Vec<(String, Job)> {
    const LIB: &str = "/usr/share/linuxcnc/ncfiles";
    let sub = ["", "/macros/lathe", "/macros/mill", "/ngcgui_lib", "/ngcgui_lib/lathe", "/ngcgui_lib/utilitysubs", "/probe/basic_probe/macros", "/remap-subroutines"];
    shipped()
        .into_iter()
        .filter_map(|file| {
            let bytes = std::fs::read(&file).ok()?;
            let mut job = Job::new(bytes);
            if with_paths {
                let mut paths: Vec<String> = vec![file.parent()?.display().to_string()];
                paths.extend(sub.iter().map(|s| format!("{LIB}{s}")));
                job.ini = Some(format!("[RS274NGC]\nINI_VARS = 1\nSUBROUTINE_PATH = {}\n", paths.join(":")));
            }
            Some((file.display().to_string(), job))
        })
        .collect()
}

fn check(what: &str, with_paths: bool) {
    let jobs = jobs(with_paths);
    if jobs.is_empty() {
        missing("programs of the package linuxcnc-uspace");
        return;
    }
    must_agree(what, &jobs);
}

#[test]
fn shipped_programs_alone() {
    check("shipped programs", false);
}

#[test]
fn shipped_programs_with_their_subs() {
    check("shipped programs with subroutine path", true);
}
