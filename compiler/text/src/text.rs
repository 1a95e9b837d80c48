use std::fmt;
use std::ops::{Deref, Range};
use std::sync::Arc;

/// A text, or a stretch of one: stretches share the text that they are cut from, so that a big program is in memory
/// once, however many chunks it has. Compares as its characters.
#[derive(Clone, Default)]
pub struct Text {
    whole: Arc<String>,
    start: u32,
    end: u32,
}

impl Text {
    /// The bytes `range` of it; a border within a character gives nothing.
    pub fn part(&self, range: Range<usize>) -> Text {
        let (start, end) = (self.start as usize + range.start, self.start as usize + range.end);
        if self.get(range).is_none() {
            return Text::default();
        }
        Text { whole: self.whole.clone(), start: start as u32, end: end as u32 }
    }
}

impl Deref for Text {
    type Target = str;
    #[inline]
    fn deref(&self) -> &str {
        &self.whole[self.start as usize..self.end as usize]
    }
}

impl AsRef<str> for Text {
    fn as_ref(&self) -> &str {
        self
    }
}

impl From<String> for Text {
    fn from(text: String) -> Text {
        Text { start: 0, end: text.len() as u32, whole: Arc::new(text) }
    }
}

impl From<&str> for Text {
    fn from(text: &str) -> Text {
        text.to_string().into()
    }
}

impl From<&Text> for Text {
    fn from(text: &Text) -> Text {
        text.clone()
    }
}

impl From<&String> for Text {
    fn from(text: &String) -> Text {
        text.clone().into()
    }
}

impl PartialEq for Text {
    fn eq(&self, other: &Text) -> bool {
        **self == **other
    }
}

impl Eq for Text {}

impl fmt::Debug for Text {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        (**self).fmt(f)
    }
}

impl fmt::Display for Text {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self)
    }
}

#[cfg(test)]
mod tests {
    use super::Text;

    #[test]
    fn parts_of_parts() {
        let whole = Text::from("G1 Xé\nM2");
        let part = whole.part(3..7);
        assert_eq!((&*part, &*part.part(1..4)), ("Xé\n", "é\n"));
        assert_eq!((part.part(1..2), part.part(2..9)), (Text::default(), Text::default()));
        assert_eq!(Text::from("Xé\n"), part);
    }
}
