//! Any text in every dialect is scanned and run with small limits: no panic, no hang, the same twice.
#![no_main]

use std::sync::Arc;

use gr_canon::{FileId, Printer, Version};
use gr_fuzz::{Memory, small_setup};
use gr_interp::Interp;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Some((first, rest)) = data.split_first() else { return };
    let text: Arc<str> = String::from_utf8_lossy(rest).into();
    let setup = small_setup(*first);
    let run = || {
        let mut files = Memory::of(&text, &setup, 1 + usize::from(first & 7));
        let mut printed = Vec::new();
        let mut printer = Printer::new(&mut printed, setup.version);
        let outcome = Interp::new(&mut files, &setup, &mut printer).run(FileId(0));
        printer.flush();
        drop(printer);
        (printed, outcome.findings)
    };
    let (printed, findings) = run();
    for finding in &findings {
        let _ = finding.fault.rs_text();
        let _ = finding.fault.message_args();
        if let Some(span) = finding.span {
            assert!(span.start <= span.end);
        }
    }
    assert!(printed.len() < 64 << 20, "the limits hold the output small");
    if setup.version == Version::V2_10 {
        assert!(run() == (printed, findings), "the same text gives the same result");
    }
});
