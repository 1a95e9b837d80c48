//! Plain text run chunk by chunk, each from the state the one before left, gives what the whole gives.
#![no_main]

use gr_canon::{FileId, Printer};
use gr_fuzz::{Memory, chunk, is_plain, small_setup};
use gr_interp::{End, Interp, Params, Setup, State, run_chunk};
use libfuzzer_sys::fuzz_target;

/// Nothing when a limit was met: limits count within a chunk.
fn whole(text: &str, setup: &Setup) -> Option<Vec<u8>> {
    let mut files = Memory::of(text, setup, 7);
    let mut printed = Vec::new();
    let mut printer = Printer::new(&mut printed, setup.version);
    let outcome = Interp::new(&mut files, setup, &mut printer).run(FileId(0));
    printer.flush();
    drop(printer);
    // So many mistakes end a run, too.
    let limited = outcome.findings.len() > 90 || outcome.findings.iter().any(|f| f.fault.rs.is_none() && f.fault.code.def().severity == gr_spec::Severity::Error);
    (!limited).then_some(printed)
}

fn by_chunks(text: &str, setup: &Setup, lines: usize) -> Vec<u8> {
    let mut printed = Vec::new();
    let mut printer = Printer::new(&mut printed, setup.version);
    let (mut state, mut params) = (State::start(setup), Params::default());
    params.set(5220, 1.0);
    params.set(5599, 1.0);
    for piece in gr_gcode::split_chunks(text, lines) {
        let exit = run_chunk(&chunk(piece, setup), &state, &params, setup, &mut printer);
        (state, params) = (exit.state, exit.params);
        if exit.end != End::Chunk {
            break;
        }
    }
    printer.flush();
    drop(printer);
    printed
}

/// Lines without the running number.
fn lines(printed: &[u8]) -> Vec<String> {
    let text = String::from_utf8_lossy(printed);
    text.lines().map(|l| l.trim_start().split_once(' ').map_or("", |l| l.1).to_string()).collect()
}

fuzz_target!(|data: &[u8]| {
    let Some((first, rest)) = data.split_first() else { return };
    let text = String::from_utf8_lossy(rest);
    let setup = small_setup(*first & !3);
    if !is_plain(&text, &setup) {
        return;
    }
    let Some(whole) = whole(&text, &setup) else { return };
    let (expected, got) = (lines(&whole), lines(&by_chunks(&text, &setup, 1 + usize::from(first & 7))));
    // Six lines of prologue, resets at the end.
    let expected = expected.get(6..).unwrap_or_default();
    assert!(expected.len() >= got.len(), "{expected:#?} {got:#?}");
    assert_eq!(&expected[..got.len()], &got[..]);
    assert!(expected[got.len()..].iter().all(|l| l.ends_with("ON_RESET()")), "{expected:#?} {got:#?}");
});
