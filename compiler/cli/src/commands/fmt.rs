//! `gcc-robot fmt` and `gcc-robot renumber`

use std::path::{Path, PathBuf};

use gr_gcode::{Case, FormatOptions, LeadingZeros, Renumber};
use gr_spec::Dialect;
use gr_text::{Decoded, Encoding, code};

use crate::exit::Exit;
use crate::options::{CaseArg, FmtArgs, Global, LintArgs, RenumberArgs, SetupArgs, StyleArgs, ZerosArg};
use crate::output::{to_stdout, write_all};
use crate::render::Renderer;
use crate::setup::{Station, extensions, station};
use crate::sources::{Sources, read, reason, walk};

pub fn run(global: &Global, args: &FmtArgs) -> Exit {
    let mut work = match Work::new(global, args.dialect.as_ref()) {
        Ok(work) => work,
        Err(exit) => return exit,
    };
    let options = style(&args.style);
    let mut exit = Exit::Ok;
    for path in &args.paths {
        let mut files = vec![path.clone()];
        if path.is_dir() {
            files.clear();
            if let Err(e) = walk(path, &extensions(work.station.dialect), &mut files) {
                exit = exit.max(work.complain(path, code::FILE_UNREADABLE, &[path.display().to_string(), reason(&e)]));
            }
        }
        for file in files {
            exit = exit.max(work.format(&file, args.check, &options));
        }
    }
    work.renderer.finish(false);
    exit
}

pub fn renumber(global: &Global, args: &RenumberArgs) -> Exit {
    let mut work = match Work::new(global, args.dialect.as_ref()) {
        Ok(work) => work,
        Err(exit) => return exit,
    };
    let options = FormatOptions {
        case: Case::Keep,
        o_word_case: Case::Keep,
        spaces: false,
        indent: 0,
        leading_zeros: LeadingZeros::Keep,
        renumber: Some(Renumber { start: args.start, step: args.step, all: args.all }),
    };
    let exit = match read(&args.file) {
        Ok(decoded) => {
            let text = formatted(&args.file, &decoded.text, &work.station, &options);
            work.write(args.output.as_deref().unwrap_or(Path::new("-")), &text, decoded.encoding)
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
        renumber: None,
    }
}

fn formatted(path: &Path, text: &str, station: &Station, options: &FormatOptions) -> String {
    let dialect: &'static Dialect = station.dialect_of(path, text);
    gr_gcode::format(text, &gr_gcode::scan(text, dialect), dialect, options)
}

struct Work {
    renderer: Renderer,
    sources: Sources,
    station: Station,
}

impl Work {
    fn new(global: &Global, dialect: Option<&String>) -> Result<Work, Exit> {
        let mut renderer = global.renderer(true);
        let mut sources = Sources::default();
        let setup = SetupArgs { dialect: dialect.cloned(), ..SetupArgs::default() };
        match station(&setup, &LintArgs::default(), Path::new("."), &mut sources, &mut renderer) {
            Some(station) => Ok(Work { renderer, sources, station }),
            None => {
                renderer.finish(false);
                Err(Exit::Findings)
            }
        }
    }

    fn complain(&mut self, path: &Path, code: gr_text::Code, args: &[String]) -> Exit {
        super::complain(&mut self.renderer, &mut self.sources, &path.display().to_string(), code, args);
        Exit::Io
    }

    fn format(&mut self, path: &PathBuf, check: bool, options: &FormatOptions) -> Exit {
        let decoded: Decoded = match read(path) {
            Ok(d) => d,
            Err((code, args)) => return self.complain(path, code, &args),
        };
        let text = formatted(path, &decoded.text, &self.station, options);
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
