//! Any text in every dialect: formatting keeps the words and is idempotent, and numbering leaves as many lines.
#![no_main]

use gr_gcode::{Case, FormatOptions, LeadingZeros, Renumber, edited, format, renumber, scan};
use gr_spec::Dialect;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Some((first, rest)) = data.split_first() else { return };
    let text = String::from_utf8_lossy(rest);
    let case = |bits: u8| [Case::Keep, Case::Upper, Case::Lower, Case::Upper][usize::from(bits & 3)];
    let spaces = first & 16 == 0;
    let options = FormatOptions {
        case: case(*first),
        o_word_case: case(first >> 2),
        spaces,
        indent: usize::from(first >> 5 & 3),
        leading_zeros: if first & 128 == 0 { LeadingZeros::Strip } else { LeadingZeros::Pad },
    };
    for dialect in Dialect::all() {
        let before = scan(&text, dialect);
        let formatted = format(&text, &before, dialect, &options);
        let after = scan(&formatted, dialect);
        assert_eq!(before.faults.len(), after.faults.len());
        assert_eq!(before.words.len(), after.words.len());
        for (a, b) in before.words.iter().zip(&after.words) {
            assert_eq!((a.value.to_bits(), a.letter, a.form), (b.value.to_bits(), b.letter, b.form));
        }
        assert_eq!(before.nodes.len(), after.nodes.len());
        assert_eq!(format(&formatted, &after, dialect, &options), formatted);
        // A jump that nobody can follow is refused.
        if let Ok(edits) = renumber(&text, &before, dialect, Renumber { start: 10, step: 10, all: spaces }) {
            assert_eq!(scan(&edited(&text, &edits), dialect).lines.len(), before.lines.len());
        }
    }
});
