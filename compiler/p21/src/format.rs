//! Exchange files written out anew: in one shape, or with ids in order. Works on the text, so that comments,
//! strings and the exact digits of numbers stay as they are.

use crate::index::skip_blank;
use crate::lex;
use crate::model::Fault;
use crate::parse::parse;

/// One statement per line, without blanks that mean nothing. Comments stay: on lines of their own, behind a
/// statement, or inside it. Statements with faults are left exactly as they are. Formatting twice changes
/// nothing.
pub fn format(text: &[u8]) -> Vec<u8> {
    let file = parse(text);
    let faults: Vec<u32> = file.faults.iter().map(|f| f.span.start).collect();
    let signature = file.sections.iter().find(|s| s.name == "SIGNATURE").map(|s| s.span);
    let mut out = Vec::with_capacity(text.len() + text.len() / 16);
    let mut at = 0;
    loop {
        let blank = white(text, at);
        let breaks = text[at..blank].iter().filter(|b| **b == b'\n').count();
        // A comment behind a statement stays on its line; one empty line between statements is kept.
        let comment = lex::comment(text, blank).is_some();
        if blank >= text.len() {
            break;
        }
        if !out.is_empty() {
            if comment && breaks == 0 && at > 0 {
                out.push(b' ');
            } else {
                out.extend_from_slice(if breaks > 1 { b"\n\n" } else { b"\n" });
            }
        }
        at = blank;
        if let Some(s) = signature
            && at >= s.start as usize
            && at < s.end as usize
        {
            out.extend_from_slice(text[at..s.end as usize].trim_ascii_end());
            at = s.end as usize;
            continue;
        }
        let end = if comment { skip_comment(text, at) } else { statement_end(text, at, &faults) };
        let damaged = faults.partition_point(|f| (*f as usize) < at) != faults.partition_point(|f| (*f as usize) <= end);
        if comment || damaged {
            out.extend_from_slice(text[at..end].trim_ascii_end());
        } else {
            statement(&text[at..end], &mut out);
            // A comment that never ends keeps the blanks behind it.
            out.truncate(out.trim_ascii_end().len());
        }
        at = end;
    }
    out.push(b'\n');
    out
}

/// Numbers the instances 1, 2, 3 … in the order they stand; references follow. Everything else stays byte by
/// byte.
///
/// # Errors
/// With faults or dangling references no number is safe to change: they are returned.
pub fn renumber(text: &[u8]) -> Result<Vec<u8>, Vec<Fault>> {
    let mut file = parse(text);
    let dangling = file.dangling(text);
    for (n, id) in dangling {
        let v = file.values[n];
        let span = gr_text::Span::new(v.start, v.start + v.len());
        file.faults.push(Fault { code: gr_spec::code::P21_DANGLING_REFERENCE, span, args: vec![id.to_string()], related: None });
    }
    if !file.faults.is_empty() {
        return Err(file.faults);
    }
    let mut new = rustc_hash::FxHashMap::default();
    for i in file.instances.iter().filter(|i| text.get(i.start as usize) == Some(&b'#')) {
        let next = new.len() as u64 + 1;
        new.insert(i.id, next);
    }
    let stop = file.sections.iter().find(|s| s.name == "SIGNATURE").map_or(text.len(), |s| s.span.start as usize);
    let mut out = Vec::with_capacity(text.len());
    let mut at = 0;
    while at < stop {
        let Some(n) = text[at..stop].iter().position(|b| matches!(b, b'#' | b'\'' | b'/' | b'<')) else { break };
        out.extend_from_slice(&text[at..at + n]);
        at += n;
        let end = match text[at] {
            b'#' => {
                let end = lex::run(text, lex::peek(text, at + 1).1, lex::DIGIT);
                let digits = text[at + 1..end].iter().filter(|b| b.is_ascii_digit());
                let id = digits.fold(0u64, |id, b| id.wrapping_mul(10).wrapping_add(u64::from(b - b'0')));
                if let Some(id) = new.get(&id) {
                    out.extend_from_slice(format!("#{id}").as_bytes());
                    at = end;
                }
                end
            }
            b'\'' => lex::string(text, at).unwrap_or(at + 1),
            b'/' if lex::comment(text, at).is_some() => skip_comment(text, at),
            b'<' => memchr::memchr2(b'>', b';', &text[at..]).map_or(at + 1, |n| at + n + 1),
            _ => at + 1,
        };
        out.extend_from_slice(&text[at..end]);
        at = end;
    }
    out.extend_from_slice(&text[at..]);
    Ok(out)
}

fn white(text: &[u8], mut at: usize) -> usize {
    while at < text.len() && text[at] <= b' ' {
        at += 1;
    }
    at
}

fn skip_comment(text: &[u8], at: usize) -> usize {
    lex::comment(text, at).flatten().unwrap_or(text.len())
}

/// One past the `;`. A statement with a fault ends where the next one begins on a line of its own.
fn statement_end(text: &[u8], start: usize, faults: &[u32]) -> usize {
    let mut at = start;
    while at < text.len() {
        at = match text[at] {
            b';' => return at + 1,
            b'\'' => match crate::index::string_end(text, at) {
                Some(end) => end,
                None => return line_end(text, at),
            },
            b'/' if lex::comment(text, at).is_some() => skip_comment(text, at),
            b'\n' | b'\r' if fault_between(faults, start, at) && next_statement(text, at) => return at,
            _ => at + 1,
        };
    }
    text.len()
}

fn fault_between(faults: &[u32], from: usize, to: usize) -> bool {
    faults.get(faults.partition_point(|f| (*f as usize) < from)).is_some_and(|f| *f as usize <= to)
}

fn next_statement(text: &[u8], at: usize) -> bool {
    let p = skip_blank(text, at);
    if text.get(p) != Some(&b'#') {
        return text[p.min(text.len())..].starts_with(b"ENDSEC");
    }
    let digits = lex::run(text, p + 1, lex::DIGIT);
    digits > p + 1 && text.get(skip_blank(text, digits)) == Some(&b'=')
}

fn line_end(text: &[u8], at: usize) -> usize {
    memchr::memchr2(b'\n', b'\r', &text[at..]).map_or(text.len(), |n| at + n)
}

/// A statement's tokens, without blanks around them.
fn statement(text: &[u8], out: &mut Vec<u8>) {
    let mut at = 0;
    let mut last_word = false;
    let mut blank_before = false;
    while at < text.len() {
        let b = text[at];
        if b < 0x20 {
            at += 1;
            continue;
        }
        if b == b' ' {
            blank_before = true;
            at += 1;
            continue;
        }
        let word = b.is_ascii_alphanumeric() || matches!(b, b'_' | b'-' | b'.' | b'+' | b'!');
        let comment = b == b'/' && lex::comment(text, at).is_some();
        let end = match b {
            b'\'' => lex::string(text, at).unwrap_or(text.len()),
            _ if comment => skip_comment(text, at),
            b'<' => memchr::memchr(b'>', &text[at..]).map_or(at + 1, |n| at + n + 1),
            _ => at + 1,
        };
        // Two words never grow together.
        if blank_before && last_word && word {
            out.push(b' ');
        }
        if comment {
            if !matches!(out.last(), Some(b'(' | b' ' | b'\n') | None) {
                out.push(b' ');
            }
            out.extend_from_slice(&text[at..end]);
            let next = white(text, end);
            if !matches!(text.get(next), Some(b')' | b',' | b';' | b'/') | None) {
                out.push(b' ');
            }
            last_word = false;
        } else {
            out.extend(text[at..end].iter().copied().filter(|b| *b >= 0x20));
            last_word = word;
        }
        blank_before = false;
        at = end;
    }
}
