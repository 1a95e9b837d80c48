//! Any text in every dialect: no panic, both ways of reading agree, spans stay inside their lines.
#![no_main]

use gr_gcode::{scan, scan_by_grammar, split_chunks};
use gr_spec::Dialect;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let text = String::from_utf8_lossy(data);
    for dialect in Dialect::all() {
        let fast = scan(&text, dialect);
        let slow = scan_by_grammar(&text, dialect);
        assert_eq!(fast.lines, slow.lines);
        assert_eq!(fast.faults, slow.faults);
        assert_eq!(fast.words.len(), slow.words.len());
        for (a, b) in fast.words.iter().zip(&slow.words) {
            assert_eq!((a.value.to_bits(), a.start, a.len, a.letter, a.form), (b.value.to_bits(), b.start, b.len, b.letter, b.form));
        }
        for line in 0..fast.lines.len() as u32 {
            let span = fast.line_span(&text, line);
            for word in fast.words(line) {
                let at = fast.word_span(&text, line, word);
                assert!(span.start <= at.start && at.end <= span.end);
                let _ = &text[at.range()];
            }
            for fault in fast.faults_of(line) {
                let _ = &text[fault.span.range()];
            }
        }
        let parts = split_chunks(&text, 3);
        let lines: usize = parts.iter().map(|part| scan(part, dialect).lines.len()).sum();
        assert_eq!(lines, fast.lines.len());
        let _ = gr_gcode::symbols(&text, &fast);
    }
});
