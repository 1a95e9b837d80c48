//! `gcc-robot fmt` and `gcc-robot renumber`

use std::path::{Path, PathBuf};

use gr_gcode::{Case, FormatOptions, LeadingZeros, Renumber};
use gr_spec::Dialect;
use gr_text::{Decoded, Encoding, Severity, code};

use crate::commands::check::{byte_order_mark, is_marked};
use crate::exchange::{is_exchange, not_one};
use crate::exit::Exit;
use crate::options::{CaseArg, FmtArgs, Global, LintArgs, RenumberArgs, SetupArgs, StyleArgs, ZerosArg};
use crate::output::{to_stdout, write_all};
use crate::render::Renderer;
use crate::setup::{self, Station, Stations};
use crate::sources::{Sources, read_program, reason, walk};

pub fn run(global: &Global, args: &FmtArgs) -> Exit {
    let mut work = Work::new(global, args.dialect.as_ref());
    let options = style(&args.style);
    let mut exit = Exit::Ok;
    let dialect = args.dialect.as_deref().and_then(Dialect::find);
    let mut all = Vec::new();
    for path in &args.paths {
        let mut files = vec![path.clone()];
        if path.is_dir() {
            files.clear();
            let closed = walk(path, &setup::is_program(dialect), &mut files);
            if closed.is_empty() && files.is_empty() {
                work.complain(path, code::PROJECT_NOTHING_TO_DO, &[path.display().to_string()]);
                exit = exit.max(Exit::Findings);
            }
            for (at, e) in closed {
                exit = exit.max(work.complain(&at, code::FILE_UNREADABLE, &[at.display().to_string(), reason(&e)]));
            }
        }
        all.extend(files);
    }
    let Some(stations) = work.stations(&all) else { return work.failed() };
    for (n, file) in all.iter().enumerate() {
        let Some(station) = stations.get(n) else { break };
        exit = exit.max(work.format(file, station, args.check, &options));
    }
    work.renderer.finish(false);
    exit
}

pub fn renumber(global: &Global, args: &RenumberArgs) -> Exit {
    let mut work = Work::new(global, args.dialect.as_ref());
    let Some(stations) = work.stations(std::slice::from_ref(&args.file)) else { return work.failed() };
    let Some(station) = stations.get(0) else { return Exit::Usage };
    let exit = match read_program(&args.file) {
        Ok(decoded) if is_exchange(&args.file, &decoded.text) => work.exchange(args, &decoded),
        Ok(decoded) => {
            let dialect = station.dialect_of(&args.file, &decoded.text);
            let scan = gr_gcode::scan(&decoded.text, dialect);
            let numbers = Renumber { start: args.start, step: args.step, all: args.all };
            match gr_gcode::renumber(&decoded.text, &scan, dialect, numbers) {
                Ok(edits) => {
                    let text = gr_gcode::edited(&decoded.text, &edits);
                    work.write(args.output.as_deref().unwrap_or(Path::new("-")), &text, decoded.encoding)
                }
                Err(jump) => {
                    let file = work.sources.add(args.file.display().to_string(), decoded.text.as_str());
                    work.renderer
                        .show(&work.sources, &gr_text::Diagnostic::new(code::RENUMBER_JUMP_UNKNOWN, file, jump, &[]));
                    Exit::Findings
                }
            }
        }
        Err((code, list)) => work.complain(&args.file, code, &list),
    };
    work.renderer.finish(false);
    exit
}

fn style(args: &StyleArgs) -> FormatOptions {
    let case = |c: CaseArg| match c {
        CaseArg::Keep => Case::Keep,
        CaseArg::Upper => Case::Upper,
        CaseArg::Lower => Case::Lower,
    };
    FormatOptions {
        case: case(args.case),
        o_word_case: case(args.o_word_case),
        spaces: !args.no_spaces,
        indent: args.indent,
        leading_zeros: match args.leading_zeros {
            ZerosArg::Keep => LeadingZeros::Keep,
            ZerosArg::Strip => LeadingZeros::Strip,
            ZerosArg::Pad => LeadingZeros::Pad,
        },
    }
}

fn formatted(path: &Path, text: &str, station: &Station, options: &FormatOptions) -> String {
    if is_exchange(path, text) {
        return String::from_utf8_lossy(&gr_p21::format(text.as_bytes())).into_owned();
    }
    let dialect: &'static Dialect = station.dialect_of(path, text);
    gr_gcode::format(text, &gr_gcode::scan(text, dialect), dialect, options)
}

struct Work {
    renderer: Renderer,
    sources: Sources,
    setup: SetupArgs,
}

impl Work {
    fn new(global: &Global, dialect: Option<&String>) -> Work {
        let setup = SetupArgs { dialect: dialect.cloned(), ..SetupArgs::default() };
        Work { renderer: global.renderer(true), sources: Sources::default(), setup }
    }

    fn stations(&mut self, programs: &[PathBuf]) -> Option<Stations> {
        Stations::of(&self.setup, &LintArgs::default(), programs, &mut self.sources, &mut self.renderer)
    }

    fn failed(mut self) -> Exit {
        self.renderer.finish(false);
        self.renderer.failed()
    }

    fn complain(&mut self, path: &Path, code: gr_text::Code, args: &[String]) -> Exit {
        super::complain(&mut self.renderer, &mut self.sources, &path.display().to_string(), code, args);
        Exit::Io
    }

    fn format(&mut self, path: &PathBuf, station: &Station, check: bool, options: &FormatOptions) -> Exit {
        let decoded: Decoded = match read_program(path) {
            Ok(d) => d,
            Err((code, args)) => return self.complain(path, code, &args),
        };
        if is_exchange(path, &decoded.text)
            && let Some(d) = not_one(&decoded.text)
        {
            let mut sources = Sources::default();
            sources.add(path.display().to_string(), decoded.text);
            self.renderer.forget();
            self.renderer.show(&sources, &d);
            return Exit::Findings;
        }
        self.doubt_mark(path, &decoded, station);
        let text = formatted(path, &decoded.text, station, options);
        if check {
            if text == decoded.text {
                return Exit::Ok;
            }
            println!("{}", path.display());
            return Exit::Findings;
        }
        if path != Path::new("-") && text == decoded.text {
            return Exit::Ok;
        }
        self.write(path, &text, decoded.encoding)
    }

    /// The byte order mark stays, as the spelling of the file does, but not in silence. No mark keeps a program from being
    /// laid out.
    fn doubt_mark(&mut self, path: &Path, decoded: &Decoded, station: &Station) {
        if !is_marked(decoded.encoding) {
            return;
        }
        let text = decoded.text.as_str().into();
        let Some(mut mark) = byte_order_mark(decoded.encoding, path, &text, station) else { return };
        mark.severity = mark.severity.max(Severity::Warning);
        let mut sources = Sources::default();
        sources.add(path.display().to_string(), text);
        self.renderer.forget();
        self.renderer.show(&sources, &mark);
    }

    /// Instances of an exchange file in order; with faults in it no number is changed.
    fn exchange(&mut self, args: &RenumberArgs, decoded: &Decoded) -> Exit {
        if args.all || args.start != 10 || args.step != 10 {
            eprintln!("--start, --step and --all are for G-code: the instances of a STEP-NC file are numbered from #1 on");
            return Exit::Usage;
        }
        match gr_p21::renumber(decoded.text.as_bytes()) {
            Ok(new) => {
                let text = String::from_utf8_lossy(&new).into_owned();
                self.write(args.output.as_deref().unwrap_or(Path::new("-")), &text, decoded.encoding)
            }
            Err(faults) => {
                let file = self.sources.add(args.file.display().to_string(), decoded.text.as_str());
                for f in faults {
                    let d = gr_text::Diagnostic::new(f.code, file, f.span, &f.args);
                    self.renderer.show(&self.sources, &d);
                }
                Exit::Findings
            }
        }
    }

    /// Writes text in the spelling that the source had.
    fn write(&mut self, path: &Path, text: &str, encoding: Encoding) -> Exit {
        let bytes = encoded(text, encoding);
        let written = if path == Path::new("-") {
            to_stdout(&bytes).map_err(|e| (path.to_path_buf(), e))
        } else {
            write_all(&[(path.to_path_buf(), bytes)])
        };
        match written {
            Ok(()) => Exit::Ok,
            Err((at, e)) => self.complain(&at, code::FILE_UNWRITABLE, &[at.display().to_string(), reason(&e)]),
        }
    }
}

fn encoded(text: &str, encoding: Encoding) -> Vec<u8> {
    match encoding {
        Encoding::Utf8 => text.as_bytes().to_vec(),
        Encoding::Utf8Bom => [b"\xEF\xBB\xBF", text.as_bytes()].concat(),
        Encoding::Latin1 => text.chars().map(|c| u8::try_from(u32::from(c)).unwrap_or(b'?')).collect(),
        Encoding::Utf16Le => std::iter::once(0xFEFF).chain(text.encode_utf16()).flat_map(u16::to_le_bytes).collect(),
        Encoding::Utf16Be => std::iter::once(0xFEFF).chain(text.encode_utf16()).flat_map(u16::to_be_bytes).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gr_text::decode;

    #[test]
    fn spellings_survive() {
        for encoding in [Encoding::Utf8, Encoding::Utf8Bom, Encoding::Utf16Le, Encoding::Utf16Be, Encoding::Latin1] {
            let text = "(über) G1 X1\n";
            assert_eq!(decode(encoded(text, encoding)), Decoded { text: text.into(), encoding });
        }
    }
}
