//! Lists the machine files of `spec/machines` as a table of ids and texts.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

fn main() {
    let root = PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets this")).join("../../spec/machines");
    let out = PathBuf::from(std::env::var_os("OUT_DIR").expect("cargo sets this"));
    println!("cargo:rerun-if-changed=build.rs");
    let mut files = Vec::new();
    for maker in entries(&root).into_iter().filter(|p| p.is_dir()) {
        files.extend(entries(&maker).into_iter().filter(|p| p.extension().is_some_and(|e| e == "toml")));
    }
    let name = |p: &Path| p.file_stem().expect("a file has a name").to_string_lossy().to_string();
    let mut rows: Vec<(String, PathBuf)> =
        files.into_iter().map(|p| (format!("{}/{}", name(p.parent().expect("a folder")), name(&p)), p)).collect();
    rows.sort();
    let mut code = String::from("/// Id and text of the machine files that come with the program.\nconst FILES: &[(&str, &str)] = &[\n");
    for (id, path) in &rows {
        println!("cargo:rerun-if-changed={}", path.display());
        let path = path.canonicalize().expect("the file is there");
        writeln!(code, "    ({id:?}, include_str!({:?})),", path.display().to_string()).expect("string");
    }
    code += "];\n";
    std::fs::write(out.join("library.rs"), code).expect("OUT_DIR is writable");
}

fn entries(dir: &Path) -> Vec<PathBuf> {
    println!("cargo:rerun-if-changed={}", dir.display());
    let read = std::fs::read_dir(dir).unwrap_or_else(|e| panic!("{}: {e}", dir.display()));
    read.map(|f| f.expect("readable folder").path()).collect()
}
