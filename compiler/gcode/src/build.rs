//! The growing tables.

use gr_text::Span;

use crate::fast::Rules;
use crate::model::*;

/// [`Scan`] under construction.
#[derive(Default)]
pub(crate) struct Tables {
    pub lines: Vec<Line>,
    pub words: Vec<Word>,
    nodes: Vec<Node>,
    node_spans: Vec<Span>,
    settings: Vec<Setting>,
    controls: Vec<Control>,
    args: Vec<ExprId>,
    names: Vec<Box<str>>,
    faults: Vec<Fault>,
}

impl Tables {
    /// Estimates by the density of CAM output, so that most texts need no second allocation.
    pub fn with_room_for(bytes: usize) -> Tables {
        Tables {
            lines: Vec::with_capacity(bytes / 24 + 1),
            words: Vec::with_capacity(bytes / 6 + 4),
            ..Tables::default()
        }
    }

    pub fn finish(self) -> Scan {
        Scan {
            lines: self.lines.into(),
            words: self.words.into(),
            nodes: self.nodes.into(),
            node_spans: self.node_spans.into(),
            settings: self.settings.into(),
            controls: self.controls.into(),
            args: self.args.into(),
            names: self.names.into(),
            faults: self.faults.into(),
        }
    }

    /// Reads the line at `at` by the grammar; gives the first byte of the next line.
    pub fn structured_line(&mut self, text: &str, at: usize, _rules: &Rules) -> usize {
        let bytes = text.as_bytes();
        let end = memchr::memchr2(b'\n', b'\r', &bytes[at..]).map_or(bytes.len(), |n| at + n);
        let next = match bytes.get(end) {
            None => end,
            Some(b'\r') if bytes.get(end + 1) == Some(&b'\n') => end + 2,
            Some(_) => end + 1,
        };
        let percent = text[at..end].trim() == "%";
        self.lines.push(Line {
            start: at as u32,
            first_word: self.words.len() as u32,
            kind: if percent { LineKind::Percent } else { LineKind::Structured },
            deleted: false,
            faulty: false,
        });
        self.words.push(Word {
            value: 0.0,
            start: at as u32,
            len: (end - at).min(0xffff) as u16,
            letter: if percent { b'%' } else { b'?' },
            form: if percent { Form::Comment } else { Form::Bad },
        });
        next
    }
}
