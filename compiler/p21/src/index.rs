use memchr::{memchr, memchr2};

/// Where the instances of a file are.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Index {
    /// In file order.
    pub entries: Vec<Entry>,
}

/// One instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry {
    /// Number after `#` (modulo 2^64).
    pub id: u64,
    /// Byte of the `#`.
    pub start: u32,
    /// One past the `;`; where that is missing, where the next statement begins.
    pub end: u32,
    /// Byte of the keyword, or of the `(` of a complex instance.
    pub keyword: u32,
}

/// Finds `#id=…;` statements, skipping strings and comments, and reads nothing else. On damaged files it
/// resumes at the next line that begins with `#id=`; use [`crate::parse`] to hear what is wrong.
pub fn index(text: &[u8]) -> Index {
    let mut entries = Vec::with_capacity(text.len() / 64 + 4);
    let (mut at, mut plain) = (0, 0);
    while at < text.len() {
        at = skip_blank(text, at);
        if at >= text.len() {
            break;
        }
        if text[at] != b'#' {
            at = statement_end(text, at, &mut plain);
            continue;
        }
        let start = at;
        let (id, after) = number(text, at + 1);
        let mut p = skip_blank(text, after);
        if after == at + 1 || text.get(p) != Some(&b'=') {
            at = statement_end(text, at + 1, &mut plain);
            continue;
        }
        p = skip_blank(text, p + 1);
        let end = statement_end(text, p, &mut plain);
        entries.push(Entry { id, start: start as u32, end: end as u32, keyword: p as u32 });
        at = end;
    }
    Index { entries }
}

fn number(text: &[u8], mut at: usize) -> (u64, usize) {
    let mut id = 0u64;
    while let Some(b) = text.get(at) {
        match b {
            b'0'..=b'9' => id = id.wrapping_mul(10).wrapping_add(u64::from(b - b'0')),
            0..=0x1F => {}
            _ => break,
        }
        at += 1;
    }
    (id, at)
}

/// Past blanks, ignored bytes and comments.
pub(crate) fn skip_blank(text: &[u8], mut at: usize) -> usize {
    while let Some(b) = text.get(at) {
        match b {
            0..=0x20 => at += 1,
            b'/' => match crate::lex::comment(text, at) {
                Some(Some(end)) => at = end,
                Some(None) => return text.len(),
                None => break,
            },
            // Print control: a new line, a new page.
            b'\\' if matches!(text.get(at + 1..at + 3), Some(b"N\\" | b"F\\")) => at += 3,
            _ => break,
        }
    }
    at
}

/// Whether nothing but blanks stands before `at` on its line.
pub(crate) fn first_on_line(text: &[u8], at: usize) -> bool {
    let before = text[..at].iter().rev().find(|b| !matches!(b, b' ' | b'\t'));
    matches!(before, None | Some(b'\n' | b'\r'))
}

/// Whether `#n=` and the beginning of an instance stand at `at`.
pub(crate) fn begins_instance(text: &[u8], at: usize) -> bool {
    let (_, after) = number(text, at + 1);
    let p = skip_blank(text, after);
    let q = skip_blank(text, p + 1);
    text.get(at) == Some(&b'#')
        && after > at + 1
        && text.get(p) == Some(&b'=')
        && text.get(q).is_none_or(|b| b.is_ascii_alphabetic() || matches!(b, b'(' | b'!'))
}

/// One past the `;` that ends the statement around `at`. One that lost its end does not reach into the next instance.
/// `plain`: nothing that ends statements, strings or comments stands before it.
fn statement_end(text: &[u8], at: usize, plain: &mut usize) -> usize {
    let before = *plain;
    usual_end(text, at, plain).unwrap_or_else(|| {
        *plain = before;
        careful_end(text, at, plain)
    })
}

/// The same of a statement with a few whole strings, without comments, `=` and another statement's beginning: nearly all.
#[inline(always)]
fn usual_end(text: &[u8], begin: usize, plain: &mut usize) -> Option<usize> {
    let mut at = begin;
    // Far ahead of a statement without an end nothing is looked for.
    for _ in 0..4 {
        if *plain <= at {
            *plain = at + memchr::memchr3(b';', b'\'', b'/', &text[at..])?;
        }
        at = *plain;
        match text.get(at)? {
            b';' => return memchr(b'=', &text[begin..at]).is_none().then_some(at + 1),
            b'\'' if text.get(at + 1) == Some(&b'\'') => at += 2,
            b'\'' => {
                let inside = memchr(b'\'', &text[at + 1..])?;
                if inside > 4 && first_statement(&text[at + 1..at + 1 + inside]).is_some() {
                    return None;
                }
                at += inside + 2;
            }
            _ => return None,
        }
    }
    None
}

fn careful_end(text: &[u8], mut at: usize, plain: &mut usize) -> usize {
    // A doubled apostrophe is passed as the end of one string and the start of another: where the whole began.
    let (mut string, mut closed) = (0, usize::MAX);
    loop {
        if *plain <= at {
            *plain = memchr::memchr3(b';', b'\'', b'/', &text[at..]).map_or(text.len(), |n| at + n);
        }
        // Behind the head of an instance `=` stands in strings and comments alone.
        if memchr(b'=', &text[at..*plain]).is_some()
            && let Some(next) = next_instance(text, at, *plain)
        {
            return next;
        }
        at = *plain;
        if at == text.len() {
            return at;
        }
        match text[at] {
            b';' => return at + 1,
            b'\'' => match memchr(b'\'', &text[at + 1..]) {
                Some(m) if m < 5 || first_statement(&text[at + 1..at + 1 + m]).is_none() => {
                    if at != closed {
                        string = at;
                    }
                    at += m + 2;
                    closed = at;
                }
                _ => {
                    string = if at == closed { string } else { at };
                    // It may end, or be given up, before the quote that was met last.
                    *plain = 0;
                    if let Some(end) = string_end(text, string) {
                        at = end;
                        continue;
                    }
                    at = string + 1;
                    match memchr2(b'\n', b'\r', &text[at..]) {
                        Some(m) => return at + m + 1,
                        None => return text.len(),
                    }
                }
            },
            _ => match crate::lex::comment(text, at) {
                Some(Some(end)) => at = end,
                Some(None) => return text.len(),
                None => at += 1,
            },
        }
    }
}

/// Byte of the first instance between two places that begins on a line of its own.
#[cold]
#[inline(never)]
fn next_instance(text: &[u8], mut at: usize, end: usize) -> Option<usize> {
    loop {
        at += memchr(b'#', &text[at..end])?;
        if first_on_line(text, at) && begins_instance(text, at) {
            return Some(at);
        }
        at += 1;
    }
}

/// One past a string that opens at `start`. One that holds the start of another statement, and behind which no
/// value may end, was never closed.
pub(crate) fn string_end(text: &[u8], start: usize) -> Option<usize> {
    let end = crate::lex::string(text, start)?;
    (first_statement(&text[start + 1..end]).is_none() || ends_value(text, end)).then_some(end)
}

/// Whether what follows ends a value.
pub(crate) fn ends_value(text: &[u8], at: usize) -> bool {
    matches!(text.get(skip_blank(text, at)), None | Some(b',' | b')'))
}

/// Byte of the first `#id=` that follows a `;` or a line end in `inside`.
pub(crate) fn first_statement(inside: &[u8]) -> Option<usize> {
    let mut at = 0;
    loop {
        at += memchr(b'#', &inside[at..])?;
        let before = inside[..at].iter().rev().find(|b| **b != b' ');
        if matches!(before, Some(b';' | b'\n' | b'\r')) && begins_instance(inside, at) {
            return Some(at);
        }
        at += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::index;

    #[test]
    fn strings_and_comments_hide_semicolons() {
        let text = b"DATA;\n#1=A('x;y''#2=B();');/* #9=C(); */\n#2 =\nB(\n)\n;#99999999999=(A()B());ENDSEC;";
        let entries = index(text).entries;
        let found: Vec<(u64, &[u8])> = entries.iter().map(|e| (e.id, &text[e.start as usize..e.end as usize])).collect();
        assert_eq!(found[0], (1, &b"#1=A('x;y''#2=B();');"[..]));
        assert_eq!(found[1].0, 2);
        assert_eq!(found[2].0, 99_999_999_999);
        assert_eq!(found.len(), 3);
    }

    #[test]
    fn a_statement_in_a_string_is_none() {
        let text = b"#1=A('a; #9=X(); b','it''s; #8=Y()','a '';\n#7=Z(); ''');\n#2=B();\n";
        let ids: Vec<u64> = index(text).entries.iter().map(|e| e.id).collect();
        assert_eq!(ids, [1, 2]);
    }

    #[test]
    fn a_lost_end_costs_no_other_instance() {
        let text = b"#1=A('a=b',(#4\n\t#2=B(#3 /* = #9=C( */,'x;\n y'\r\n#3=(A()B());#4=C('#8=D()'\n#5 =D()\n#6\n=E();\nENDSEC;";
        let found: Vec<(u64, u32)> = index(text).entries.iter().map(|e| (e.id, e.end)).collect();
        assert_eq!(found.iter().map(|e| e.0).collect::<Vec<_>>(), [1, 2, 3, 4, 5, 6]);
        assert_eq!(&text[found[0].1 as usize..][..4], b"#2=B");
        // The first on its line alone: `=` for `,` begins nothing.
        let text = b"#1=A(#2, #3=B(1));\n#4=C();";
        assert_eq!(index(text).entries.len(), 2);
    }

    #[test]
    fn files_without_any_end_take_no_longer() {
        for line in ["#1=A()\n", "#1=A('x')\n", "#1=A(/* c */)\n"] {
            assert_eq!(index(line.repeat(200_000).as_bytes()).entries.len(), 200_000);
        }
    }

    #[test]
    fn unclosed_string_costs_one_instance() {
        let text = b"#1=A('open);\n#2=B('x');\n#3=C();\n";
        let ids: Vec<u64> = index(text).entries.iter().map(|e| e.id).collect();
        assert_eq!(ids, [1, 2, 3]);
    }
}
