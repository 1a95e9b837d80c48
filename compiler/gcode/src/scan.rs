//! The one entrance: text of whole lines to tables.

use gr_spec::Dialect;

use crate::build::Tables;
use crate::fast::{self, Rules};
use crate::model::Scan;

/// Reads a chunk of whole lines. Lossless, tolerant of every mistake, and each line on its own: scanning a text
/// piece by piece gives the same as scanning it whole.
///
/// The faults of a line come in the order in which the controller would find them; the first is the one it
/// reports. Not checked here, because it depends on values: whether integers are whole, ranges and signs of
/// words, parameter numbers, unknown G and M codes, conflicts within modal groups, a second P or Q when the
/// first is an expression or at most −1, and whether names exist.
pub fn scan(text: &str, dialect: &'static Dialect) -> Scan {
    let rules = Rules::new(dialect);
    let mut tables = Tables::with_room_for(text.len());
    let bytes = text.as_bytes();
    let mut at = 0;
    while at < bytes.len() {
        at = match fast::plain_line(bytes, at, &rules, &mut tables.words) {
            Some((line, next)) => {
                tables.lines.push(line);
                next
            }
            None => tables.structured_line(text, at, &rules),
        };
    }
    tables.finish()
}

/// The same without the fast path, for tests and fuzzing.
#[doc(hidden)]
pub fn scan_by_grammar(text: &str, dialect: &'static Dialect) -> Scan {
    let rules = Rules::new(dialect);
    let mut tables = Tables::with_room_for(text.len());
    let mut at = 0;
    while at < text.len() {
        at = tables.structured_line(text, at, &rules);
    }
    tables.finish()
}
