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
#[inline]
pub(crate) fn decimal(bytes: &[u8], at: usize, comma: bool) -> Option<(f64, usize)> {
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
            prop_assert_eq!(ours, text.parse::<f64>().ok().map(f64::to_bits));
        }
    }
}
