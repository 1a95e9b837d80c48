//! Decimal text to double, rounded correctly.

/// Powers of ten that a double holds exactly.
const POW10: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19,
    1e20, 1e21, 1e22,
];

/// Reads `digits [. digits]` at `at`; a comma too when `comma` says so. Gives the value and where it ends, or
/// nothing when there is no digit.
///
/// A mantissa below 2^53 divided by an exact power of ten is rounded once, so the quotient is the nearest
/// double. Longer numbers take the library's way.
#[inline(always)]
pub(crate) fn decimal(bytes: &[u8], at: usize, comma: bool) -> Option<(f64, usize)> {
    // Up to seven digits on each side of the point, eight bytes at a time and without loops.
    if let Some((whole, wholes)) = run(bytes, at)
        && wholes < 8
    {
        let point = bytes[at + wholes];
        if point != b'.' && !(comma && point == b',') {
            return (wholes > 0).then_some((whole as i64 as f64, at + wholes));
        }
        let from = at + wholes + 1;
        if let Some((fraction, fractions)) = run(bytes, from)
            && fractions < 8
        {
            if wholes + fractions == 0 {
                return None;
            }
            // Signed conversion is one instruction; the mantissa is far below 2^63.
            let mantissa = whole * TENS[fractions] + fraction;
            return Some((mantissa as i64 as f64 / POW10[fractions], from + fractions));
        }
    }
    any_length(bytes, at, comma)
}

/// Whole powers of ten.
const TENS: [u64; 8] = [1, 10, 100, 1_000, 10_000, 100_000, 1_000_000, 10_000_000];

/// The digits at `at`, at most eight: their value and how many; nothing near the end of the text.
#[inline(always)]
fn run(bytes: &[u8], at: usize) -> Option<(u64, usize)> {
    let eight: [u8; 8] = bytes.get(at..at + 8)?.try_into().ok()?;
    let word = u64::from_le_bytes(eight) ^ 0x3030_3030_3030_3030;
    // The high bit of each byte that is no digit; carries only disturb bytes after the first such.
    let others = (word.wrapping_add(0x7676_7676_7676_7676) | word) & 0x8080_8080_8080_8080;
    let count = (others.trailing_zeros() / 8) as usize;
    if count == 0 {
        return Some((0, 0));
    }
    // Leading zeros in front, then pairs, fours and eights are joined at once.
    let digits = word << (64 - 8 * count);
    let pairs = (digits.wrapping_mul(10) + (digits >> 8)) & 0x00ff_00ff_00ff_00ff;
    let fours = (pairs.wrapping_mul(100) + (pairs >> 16)) & 0x0000_ffff_0000_ffff;
    let all = (fours.wrapping_mul(10_000) + (fours >> 32)) & 0xffff_ffff;
    Some((all, count))
}

/// The plain way, for long numbers and for the end of the text.
#[cold]
fn any_length(bytes: &[u8], at: usize, comma: bool) -> Option<(f64, usize)> {
    let mut i = at;
    let mut mantissa = 0u64;
    while let Some(digit) = digit(bytes, i) {
        mantissa = mantissa.wrapping_mul(10).wrapping_add(digit);
        i += 1;
    }
    let whole = i - at;
    let mut fraction = 0;
    if let Some(&point) = bytes.get(i)
        && (point == b'.' || (comma && point == b','))
    {
        i += 1;
        let first = i;
        while let Some(digit) = digit(bytes, i) {
            mantissa = mantissa.wrapping_mul(10).wrapping_add(digit);
            i += 1;
        }
        fraction = i - first;
    }
    let digits = whole + fraction;
    if digits == 0 {
        return None;
    }
    if digits <= 15 {
        return Some((mantissa as f64 / POW10[fraction], i));
    }
    long(&bytes[at..i]).map(|value| (value, i))
}

#[inline(always)]
fn digit(bytes: &[u8], at: usize) -> Option<u64> {
    let digit = bytes.get(at)?.wrapping_sub(b'0');
    (digit < 10).then_some(u64::from(digit))
}

#[cold]
fn long(text: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(text).ok()?.replace(',', ".");
    text.parse().ok().filter(|value: &f64| value.is_finite())
}

#[cfg(test)]
mod tests {
    use super::decimal;
    use proptest::prelude::*;

    #[test]
    fn forms() {
        assert_eq!(decimal(b"12.5x", 0, false), Some((12.5, 4)));
        assert_eq!(decimal(b"7.", 0, false), Some((7.0, 2)));
        assert_eq!(decimal(b".25", 0, false), Some((0.25, 3)));
        assert_eq!(decimal(b".", 0, false), None);
        assert_eq!(decimal(b"", 0, false), None);
        assert_eq!(decimal(b"1,5", 0, true), Some((1.5, 3)));
        assert_eq!(decimal(b"1,5", 0, false), Some((1.0, 1)));
    }

    proptest! {
        #[test]
        fn nearest_double(text in "[0-9]{0,25}(\\.[0-9]{0,25})?") {
            let ours = decimal(text.as_bytes(), 0, false).map(|(value, _)| value.to_bits());
            let theirs = text.parse::<f64>().ok().map(f64::to_bits);
            prop_assert_eq!(ours, theirs);
            let padded = format!("{text} X1234567");
            let padded = decimal(padded.as_bytes(), 0, false).map(|(value, end)| (value.to_bits(), end));
            prop_assert_eq!(padded, theirs.map(|bits| (bits, text.len())));
        }
    }
}
