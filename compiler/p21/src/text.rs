//! What the spans of values say.

use std::borrow::Cow;

use crate::model::{Exchange, Kind, Value};

impl Exchange {
    /// The bytes of a value that is one token; `None` for lists.
    pub fn raw<'t>(&self, text: &'t [u8], value: Value) -> Option<&'t [u8]> {
        match value.kind() {
            Kind::List | Kind::Typed => None,
            _ if value.len() < Value::LONG => text.get(value.start as usize..value.start as usize + value.len() as usize),
            Kind::String => text.get(value.start as usize..crate::lex::string(text, value.start as usize)?),
            _ => None,
        }
    }
    /// A string's meaning: quotes and escapes taken off, ignored bytes left out.
    pub fn string<'t>(&self, text: &'t [u8], value: Value) -> Option<Cow<'t, str>> {
        if value.kind() != Kind::String {
            return None;
        }
        let raw = self.raw(text, value)?;
        Some(decode(&raw[1..raw.len() - 1]))
    }
    /// A real or integer.
    pub fn real(&self, text: &[u8], value: Value) -> Option<f64> {
        if !matches!(value.kind(), Kind::Real | Kind::Integer) {
            return None;
        }
        let raw = std::str::from_utf8(self.raw(text, value)?).ok()?;
        if raw.bytes().any(|b| b < 0x20) {
            return raw.chars().filter(|c| *c >= ' ').collect::<String>().parse().ok();
        }
        raw.parse().ok()
    }
    /// The id a reference names.
    pub fn reference(&self, text: &[u8], value: Value) -> Option<u64> {
        if value.kind() != Kind::Reference {
            return None;
        }
        let digits = self.raw(text, value)?[1..].iter().filter(|b| **b >= b'0');
        Some(digits.fold(0u64, |id, b| id.wrapping_mul(10).wrapping_add(u64::from(b - b'0'))))
    }
    /// An enumeration without its dots.
    pub fn enumeration(&self, text: &[u8], value: Value) -> Option<String> {
        if value.kind() != Kind::Enumeration {
            return None;
        }
        let raw = self.raw(text, value)?;
        Some(raw.iter().filter(|b| **b > b' ' && **b != b'.').map(|b| b.to_ascii_uppercase() as char).collect())
    }
    /// References that name nothing, with the value's place in `values`.
    pub fn dangling(&self, text: &[u8]) -> Vec<(usize, u64)> {
        let refs = self.values.iter().enumerate().filter(|(_, v)| v.kind() == Kind::Reference);
        refs.filter_map(|(n, v)| {
            let id = self.reference(text, *v)?;
            self.find(id).is_none().then_some((n, id))
        })
        .collect()
    }
}

/// Whether the escapes of a string are well formed: the byte of the first that is not, and why.
pub(crate) fn check(inside: &[u8]) -> Result<(), (usize, &'static str)> {
    let mut at = 0;
    while let Some(n) = memchr::memchr(b'\\', &inside[at..]) {
        at += n;
        match escape(&inside[at..]) {
            Ok((len, _)) => at += len,
            // Ignored bytes may break an escape: look again without them.
            Err(why) if inside[at..].iter().any(|b| *b < 0x20) => {
                let clean: Vec<u8> = inside[at..].iter().copied().filter(|b| *b >= 0x20).collect();
                return check(&clean).map_err(|_| (at, why));
            }
            Err(why) => return Err((at, why)),
        }
    }
    Ok(())
}

fn decode(inside: &[u8]) -> Cow<'_, str> {
    let plain = inside.iter().all(|b| *b >= 0x20 && *b < 0x80 && *b != b'\\' && *b != b'\'');
    if plain && let Ok(s) = std::str::from_utf8(inside) {
        return Cow::Borrowed(s);
    }
    let clean: Vec<u8> = inside.iter().copied().filter(|b| *b >= 0x20).collect();
    // Edition 3 writes UTF-8; older files that are not ASCII are Latin-1 in practice.
    let text: String = match String::from_utf8(clean) {
        Ok(s) => s,
        Err(e) => e.into_bytes().iter().map(|b| *b as char).collect(),
    };
    let mut out = String::with_capacity(text.len());
    let mut rest = text.as_str();
    while let Some(n) = rest.find(['\\', '\'']) {
        out.push_str(&rest[..n]);
        rest = &rest[n..];
        if rest.starts_with('\'') {
            out.push('\'');
            rest = rest.strip_prefix("''").or(rest.strip_prefix('\'')).unwrap_or("");
        } else {
            match escape(rest.as_bytes()) {
                Ok((len, s)) => {
                    out.push_str(&s);
                    rest = rest.get(len..).unwrap_or("");
                }
                Err(_) => {
                    out.push('\\');
                    rest = &rest[1..];
                }
            }
        }
    }
    out.push_str(rest);
    Cow::Owned(out)
}

/// One escape at the start of `s`: its length and what it stands for.
fn escape(s: &[u8]) -> Result<(usize, String), &'static str> {
    let hex = |b: &[u8]| std::str::from_utf8(b).ok().and_then(|h| u32::from_str_radix(h, 16).ok());
    match s.get(1) {
        Some(b'\\') => Ok((2, "\\".into())),
        // Print control says nothing.
        Some(b'N' | b'F') if s.get(2) == Some(&b'\\') => Ok((3, String::new())),
        Some(b'S') if s.get(2) == Some(&b'\\') => match s.get(3) {
            Some(b) if (0x20..0x7F).contains(b) => Ok((4, char::from(b + 128).to_string())),
            _ => Err("\\S\\ is followed by one printable character"),
        },
        Some(b'P') if s.get(3) == Some(&b'\\') && s[2].is_ascii_uppercase() && s[2] <= b'I' => Ok((4, String::new())),
        Some(b'X') if s.get(2) == Some(&b'\\') => match s.get(3..5).and_then(hex) {
            Some(c) => Ok((5, char::from_u32(c).unwrap_or('\u{FFFD}').to_string())),
            None => Err("\\X\\ is followed by two hexadecimal digits"),
        },
        Some(b'X') if matches!(s.get(2), Some(b'2' | b'4')) && s.get(3) == Some(&b'\\') => {
            let width = if s[2] == b'2' { 4 } else { 8 };
            let end = memchr::memmem::find(&s[4..], b"\\X0\\").ok_or("\\X2\\ and \\X4\\ end with \\X0\\")?;
            let body = &s[4..4 + end];
            if body.is_empty() || body.len() % width != 0 {
                return Err("\\X2\\ takes groups of four hexadecimal digits, \\X4\\ of eight");
            }
            let units: Option<Vec<u32>> = body.chunks(width).map(hex).collect();
            let units = units.ok_or("only hexadecimal digits stand between \\X2\\ or \\X4\\ and \\X0\\")?;
            let out = if width == 4 {
                char::decode_utf16(units.iter().map(|u| *u as u16)).map(|c| c.unwrap_or('\u{FFFD}')).collect()
            } else {
                units.iter().map(|u| char::from_u32(*u).unwrap_or('\u{FFFD}')).collect()
            };
            Ok((4 + end + 4, out))
        }
        _ => Err("a backslash is written twice, or begins \\S\\, \\P.\\, \\X\\, \\X2\\ or \\X4\\"),
    }
}
