/// How the bytes of a file spell text.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Encoding {
    /// ASCII or UTF-8 without mark.
    Utf8,
    /// UTF-8 with byte order mark.
    Utf8Bom,
    /// UTF-16, little endian, with mark.
    Utf16Le,
    /// UTF-16, big endian, with mark.
    Utf16Be,
    /// None of these: bytes are taken as Latin-1.
    Latin1,
}

/// The text of a file and how it was spelled.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Decoded {
    /// The text, without byte order mark.
    pub text: String,
    /// How the file spelled it.
    pub encoding: Encoding,
}

/// Turns the bytes of a file into text; every byte sequence is accepted.
pub fn decode(bytes: Vec<u8>) -> Decoded {
    if bytes.starts_with(&[0xEF, 0xBB, 0xBF]) {
        let rest = bytes[3..].to_vec();
        let Decoded { text, encoding } = decode(rest);
        let encoding = if encoding == Encoding::Utf8 { Encoding::Utf8Bom } else { encoding };
        return Decoded { text, encoding };
    }
    if bytes.starts_with(&[0xFF, 0xFE]) {
        return Decoded { text: utf16(&bytes[2..], u16::from_le_bytes), encoding: Encoding::Utf16Le };
    }
    if bytes.starts_with(&[0xFE, 0xFF]) {
        return Decoded { text: utf16(&bytes[2..], u16::from_be_bytes), encoding: Encoding::Utf16Be };
    }
    match String::from_utf8(bytes) {
        Ok(text) => Decoded { text, encoding: Encoding::Utf8 },
        Err(e) => Decoded { text: e.into_bytes().iter().map(|b| *b as char).collect(), encoding: Encoding::Latin1 },
    }
}

/// Turns bytes into the text that LinuxCNC reads: it knows neither byte order marks nor UTF-16 and takes them for
/// characters of the program.
pub fn decode_as_linuxcnc(bytes: Vec<u8>) -> Decoded {
    if bytes.starts_with(&[0xFF, 0xFE]) || bytes.starts_with(&[0xFE, 0xFF]) {
        return Decoded { text: bytes.iter().map(|b| *b as char).collect(), encoding: Encoding::Latin1 };
    }
    let mark = bytes.starts_with(&[0xEF, 0xBB, 0xBF]);
    let mut decoded = decode(bytes);
    if mark {
        let latin1 = decoded.encoding == Encoding::Latin1;
        decoded.text.insert_str(0, if latin1 { "\u{EF}\u{BB}\u{BF}" } else { "\u{FEFF}" });
        decoded.encoding = if latin1 { Encoding::Latin1 } else { Encoding::Utf8 };
    }
    decoded
}

fn utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> String {
    let units = bytes.chunks_exact(2).map(|p| unit([p[0], p[1]]));
    char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect()
}

#[cfg(test)]
mod tests {
    use super::{Encoding, decode, decode_as_linuxcnc};

    #[test]
    fn linuxcnc_takes_marks_for_characters() {
        for (bytes, text) in [
            (b"G1".to_vec(), "G1"),
            (b"\xEF\xBB\xBFG1".to_vec(), "\u{FEFF}G1"),
            (b"\xEF\xBB\xBF(\xFC)".to_vec(), "\u{EF}\u{BB}\u{BF}(\u{FC})"),
            (b"\xFF\xFEG\x00".to_vec(), "\u{FF}\u{FE}G\0"),
        ] {
            assert_eq!(decode_as_linuxcnc(bytes).text, text);
        }
    }

    #[test]
    fn marks_and_fallback() {
        for (bytes, encoding) in [
            (b"G1".to_vec(), Encoding::Utf8),
            (b"\xEF\xBB\xBFG1".to_vec(), Encoding::Utf8Bom),
            (b"\xFF\xFEG\x001\x00".to_vec(), Encoding::Utf16Le),
            (b"\xFE\xFF\x00G\x001".to_vec(), Encoding::Utf16Be),
        ] {
            let d = decode(bytes);
            assert_eq!((d.text.as_str(), d.encoding), ("G1", encoding));
        }
        assert_eq!(decode(b"(\xFCber)".to_vec()).text, "(über)");
    }
}
