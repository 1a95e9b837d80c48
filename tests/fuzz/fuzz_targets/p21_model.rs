//! Any text as a process plan: every layer looks at it, none panics, every message lies within the text.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let text = String::from_utf8_lossy(data);
    for d in gr_step::diagnostics(&text, gr_text::FileId(0)) {
        for l in &d.labels {
            assert!(l.span.start <= l.span.end && l.span.end as usize <= text.len());
        }
    }
});
