//! Marks at the ends of lines while a text is being written: the step of the program that a line is for. Languages put
//! their texts together in many ways, and a mark goes where its line goes; the last thing that is done to a file takes
//! them out. Texts of programs hold no control characters (`Cx::ascii`), so that a mark can't be taken for anything else.

const MARK: char = '\u{1}';

/// Marks the line at whose end the text stands; gives the bytes that took.
pub(crate) fn put(text: &mut String, step: Option<u32>) -> usize {
    let Some(step) = step else { return 0 };
    let before = text.len();
    text.push(MARK);
    text.push_str(&step.to_string());
    text.push(MARK);
    text.len() - before
}

/// The text without its marks, and the step of each line.
pub(crate) fn taken(text: &str) -> (String, Vec<Option<u32>>) {
    let mut out = String::with_capacity(text.len());
    let mut steps = Vec::new();
    for line in text.split_inclusive('\n') {
        let mut pieces = line.split(MARK);
        out.push_str(pieces.next().unwrap_or(""));
        let step = pieces.next().and_then(|n| n.parse().ok());
        pieces.for_each(|p| out.push_str(p));
        steps.push(step);
    }
    (out, steps)
}

#[cfg(test)]
mod tests {
    #[test]
    fn marks_leave_no_trace() {
        let mut text = String::from("head\nG1");
        assert_eq!(super::put(&mut text, Some(12)), 4);
        text.push_str("\r\nG2");
        super::put(&mut text, None);
        text.push_str("\nend");
        assert_eq!(super::taken(&text), ("head\nG1\r\nG2\nend".into(), vec![None, Some(12), None, None]));
    }
}
