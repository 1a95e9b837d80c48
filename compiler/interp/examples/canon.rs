//! Prints the canonical calls of a program as `rs274 -g` does: `canon [-t tools] [-v parameters] [-i ini] file`.
//! For trying the interpreter alone; the real command is `gcc-robot rs274`.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use gr_canon::{FileId, Printer, Units, Version};
use gr_gcode::{Chunk, File};
use gr_interp::{Files, Interp, Setup, read_ini, read_parameters, read_tools, subroutine_paths};

struct Disk {
    files: Vec<(PathBuf, File)>,
    setup: Setup,
}

fn load(path: &Path, setup: &Setup) -> Option<File> {
    let text = gr_text::decode(std::fs::read(path).ok()?).text;
    let chunks = gr_gcode::split_chunks(&text, 4096)
        .into_iter()
        .map(|t| Chunk { text: gr_text::Text::from(t), scan: Arc::new(gr_gcode::scan(t, setup.dialect)) })
        .collect();
    Some(File::new(&path.to_string_lossy(), chunks))
}

impl Files for Disk {
    fn file(&self, id: FileId) -> &File {
        &self.files[id.0 as usize].1
    }
    fn find_sub(&mut self, name: &str) -> Option<FileId> {
        for path in subroutine_paths(&self.setup, name) {
            if let Some(i) = self.files.iter().position(|(p, _)| *p == path) {
                return Some(FileId(i as u32));
            }
            if let Some(file) = load(&path, &self.setup) {
                self.files.push((path, file));
                return Some(FileId(self.files.len() as u32 - 1));
            }
        }
        None
    }
}

fn main() -> std::process::ExitCode {
    let mut setup = Setup { machine_units: Units::Inch, user_m_codes: false, uvw: false, startup_code: false, ..Setup::default() };
    let mut main = None;
    let mut discard = false;
    let mut args = std::env::args().skip(1);
    while let Some(arg) = args.next() {
        let mut text = || args.next().and_then(|p| std::fs::read_to_string(p).ok()).unwrap_or_default();
        match arg.as_str() {
            "-g" => {}
            "-q" => discard = true,
            "-b" => setup.block_delete = true,
            "-n" => setup.keep_going = args.next().as_deref() == Some("0"),
            "-t" => setup.tools = read_tools(&text(), FileId(0)).0,
            "-v" => setup.params = read_parameters(&text(), FileId(0)).unwrap_or_default(),
            "-i" => setup.ini = read_ini(&text(), FileId(0), None, None).0,
            _ => main = main.or(Some(arg)),
        }
    }
    let Some(file) = main.as_ref().and_then(|p| load(Path::new(p), &setup)) else { return 2.into() };
    let mut disk = Disk { files: vec![(PathBuf::from(main.unwrap_or_default()), file)], setup: setup.clone() };
    let outcome = if discard {
        let began = std::time::Instant::now();
        let outcome = Interp::new(&mut disk, &setup, gr_canon::Discard).run(FileId(0));
        eprintln!("{} blocks in {:?}", outcome.blocks, began.elapsed());
        outcome
    } else {
        let mut printer = Printer::new(std::io::stdout(), Version::V2_9);
        let outcome = Interp::new(&mut disk, &setup, &mut printer).run(FileId(0));
        printer.flush();
        outcome
    };
    for f in &outcome.findings {
        if let Some(text) = f.fault.rs_text() {
            eprintln!("{text}");
            eprintln!("{}", f.text);
        }
    }
    u8::from(!outcome.ok()).into()
}
