//! `gcc-robot preview part.ngc -o part.svg`; served pages: see `preview_serve`


use gr_backends::plot::{Options, Show};
use gr_text::Severity;

use super::check::{Checked, show};
use crate::emit::{picture, stem, traced};
use crate::exit::Exit;
use crate::options::{Global, LintArgs, PreviewArgs, ViewArg};
use crate::pipeline::{load, motion};
use crate::progress::Progress;
use crate::setup::{beside, station};
use crate::sources::Sources;

pub fn run(global: &Global, args: &PreviewArgs) -> Exit {
    let Some(goal) = args.output.as_ref().filter(|_| !args.serve) else {
        return super::preview_serve::run(global, args);
    };
    let mut renderer = global.renderer(false);
    let mut sources = Sources::default();
    let Some(station) = station(&args.setup, &LintArgs::default(), beside(&args.file), &mut sources, &mut renderer) else {
        renderer.finish(false);
        return renderer.failed();
    };
    let progress = Progress::new(global.quiet, format!("drawing {}", args.file.display()));
    let unit = load(&args.file, &station);
    let (unit, motion) = match unit.and_then(|unit| motion(&unit, station.machine.as_ref()).map(|(motion, _)| (unit, motion))) {
        Ok(made) => made,
        Err(checked) => {
            drop(progress);
            show(&mut renderer, &checked);
            renderer.finish(false);
            return if checked.unreadable { Exit::Io } else { Exit::Findings };
        }
    };
    let bad = motion.found.iter().any(|d| d.severity == Severity::Error);
    let kind = goal.extension().map_or(String::new(), |e| e.to_string_lossy().to_ascii_lowercase());
    let plot = Options { text: unit.text.to_string(), rates: gr_driver::rates(&unit.setup), ..options(args) };
    let trace = (kind == "html" || station.machine.is_some()).then(|| traced(&motion, &unit, station.machine.as_ref()));
    let made = picture(&motion.program, trace.as_ref(), &kind, &plot);
    drop(progress);
    show(&mut renderer, &Checked { sources: motion.sources, found: motion.found, ..Checked::nothing() });
    let exit = match made {
        _ if bad => Exit::Findings,
        Err(text) => {
            eprintln!("{text}");
            Exit::Usage
        }
        Ok(bytes) => super::write(&mut renderer, &mut sources, &args.file, &[(goal.clone(), bytes)]),
    };
    renderer.finish(false);
    exit
}

fn options(args: &PreviewArgs) -> Options {
    let show = match args.view {
        ViewArg::All => Show::All,
        ViewArg::Isometric => Show::Isometric,
        ViewArg::Top => Show::Top,
        ViewArg::Front => Show::Front,
        ViewArg::Right => Show::Right,
    };
    Options { show, width: args.width, height: args.height, title: stem(&args.file), rapids: !args.no_rapids, ..Options::default() }
}
