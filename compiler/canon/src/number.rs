//! Numbers as C's printf writes them, to the last bit and fast.

/// Two decimal digits for each of 0 … 99.
static PAIRS: [u8; 200] = {
    let mut table = [0; 200];
    let mut i = 0;
    while i < 100 {
        table[2 * i] = b'0' + (i / 10) as u8;
        table[2 * i + 1] = b'0' + (i % 10) as u8;
        i += 1;
    }
    table
};

/// `%d`
pub fn push_int(out: &mut Vec<u8>, value: i64) {
    if value < 0 {
        out.push(b'-');
    }
    push_digits(out, value.unsigned_abs());
}

#[inline]
fn push_digits(out: &mut Vec<u8>, mut value: u64) {
    if value < 10 {
        out.push(b'0' + value as u8);
        return;
    }
    let mut digits = [0_u8; 20];
    let mut at = 20;
    while value >= 100 {
        at -= 2;
        let pair = (value % 100) as usize * 2;
        digits[at..at + 2].copy_from_slice(&PAIRS[pair..pair + 2]);
        value /= 100;
    }
    if value >= 10 {
        at -= 2;
        let pair = value as usize * 2;
        digits[at..at + 2].copy_from_slice(&PAIRS[pair..pair + 2]);
    } else {
        at -= 1;
        digits[at] = b'0' + value as u8;
    }
    out.extend_from_slice(&digits[at..]);
}

/// `%.4f`, `%f` and their like: the exact binary value, rounded half to even at decimal `DECIMALS` (at most 6).
#[inline]
pub fn push_fixed<const DECIMALS: usize>(out: &mut Vec<u8>, value: f64) {
    match scaled::<DECIMALS>(value) {
        Some(units) => push_scaled::<DECIMALS>(out, value.is_sign_negative(), units),
        None => push_unusual::<DECIMALS>(out, value),
    }
}

/// |value|·10^`DECIMALS`, correctly rounded; none when it has no place in 64 bits.
///
/// A double is m·2^e with whole m < 2^53, and m·10^6 < 2^73: one wide product and one shift are exact.
#[inline]
fn scaled<const DECIMALS: usize>(value: f64) -> Option<u64> {
    let bits = value.to_bits();
    let exponent = (bits >> 52 & 0x7FF) as u32;
    let mantissa = bits & ((1 << 52) - 1) | (1 << 52);
    // 1075 − exponent places after the binary point.
    if exponent > 1065 {
        return None;
    }
    let places = 1075 - exponent;
    if places > 80 {
        return Some(0);
    }
    let product = u128::from(mantissa) * u128::from(10_u64.pow(DECIMALS as u32));
    let whole = (product >> places) as u64;
    let rest = product & ((1_u128 << places) - 1);
    let half = 1_u128 << (places - 1);
    let up = rest > half || (rest == half && whole & 1 == 1);
    Some(whole + u64::from(up))
}

/// |value|·10^`decimals`, correctly rounded (half to even); none beyond nine decimals or from a thousand million on.
#[inline]
pub fn fixed_units(value: f64, decimals: usize) -> Option<u64> {
    let size = value.abs();
    // Not a number is not below anything.
    if decimals > 9 || !matches!(size.partial_cmp(&1e9), Some(std::cmp::Ordering::Less)) {
        return None;
    }
    let bits = size.to_bits();
    let exponent = (bits >> 52) as u32;
    let mantissa = bits & ((1 << 52) - 1) | (1 << 52);
    // Places after the binary point: at least 23 below 2^30. The product is below 2^83.
    let places = 1075 - exponent;
    if places > 100 {
        return Some(0);
    }
    let product = u128::from(mantissa) * u128::from(10_u64.pow(decimals as u32));
    let whole = (product >> places) as u64;
    let rest = product & ((1_u128 << places) - 1);
    let half = 1_u128 << (places - 1);
    Some(whole + u64::from(rest > half || (rest == half && whole & 1 == 1)))
}

#[inline]
fn push_scaled<const DECIMALS: usize>(out: &mut Vec<u8>, negative: bool, units: u64) {
    if negative {
        out.push(b'-');
    }
    let one = 10_u64.pow(DECIMALS as u32);
    push_digits(out, units / one);
    let mut fraction = units % one;
    let mut text = [b'.'; 8];
    let mut at = DECIMALS + 1;
    while at > 1 {
        at -= 2;
        let pair = (fraction % 100) as usize * 2;
        text[at..at + 2].copy_from_slice(&PAIRS[pair..pair + 2]);
        fraction /= 100;
    }
    out.extend_from_slice(&text[..=DECIMALS]);
}

/// Huge numbers and those that are none.
#[cold]
fn push_unusual<const DECIMALS: usize>(out: &mut Vec<u8>, value: f64) {
    use std::io::Write as _;
    let sign = if value.is_sign_negative() { "-" } else { "" };
    let written = if value.is_nan() {
        write!(out, "{sign}nan")
    } else if value.is_infinite() {
        write!(out, "{sign}inf")
    } else {
        write!(out, "{value:.DECIMALS$}")
    };
    written.expect("a vector takes everything");
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn fixed<const D: usize>(v: f64) -> String {
        let mut out = Vec::new();
        push_fixed::<D>(&mut out, v);
        String::from_utf8(out).unwrap()
    }

    proptest! {
        #[test]
        fn units_are_those_of_the_exact_text(v in -1.0e9..1.0e9, ties in -4096i32..4096, d in 0usize..10) {
            for v in [v, v / 1e6, v / 1e13, f64::from(ties) / 64.0] {
                let text = format!("{:.d$}", v.abs()).replace('.', "");
                prop_assert_eq!(fixed_units(v, d), text.parse().ok(), "{} with {} decimals", v, d);
            }
        }
    }

    #[test]
    fn numbers_without_units() {
        assert_eq!([f64::NAN, f64::INFINITY, 1e9, -1e300].map(|v| fixed_units(v, 3)), [None; 4]);
        assert_eq!((fixed_units(1.0, 10), fixed_units(5e-324, 9), fixed_units(-0.0, 9)), (None, Some(0), Some(0)));
    }

    #[test]
    fn examples() {
        assert_eq!(fixed::<4>(0.0), "0.0000");
        assert_eq!(fixed::<4>(-0.0), "-0.0000");
        assert_eq!(fixed::<4>(-0.00001), "-0.0000");
        assert_eq!(fixed::<4>(0.03125), "0.0312", "ties go to even");
        assert_eq!(fixed::<4>(0.09375), "0.0938");
        assert_eq!(fixed::<4>(99999.99995), "99999.9999");
        assert_eq!(fixed::<4>(9.99995), "10.0000");
        assert_eq!(fixed::<4>(f64::NAN), "nan");
        assert_eq!(fixed::<4>(f64::NEG_INFINITY), "-inf");
        assert_eq!(fixed::<6>(1e22), "10000000000000000000000.000000");
        assert_eq!(fixed::<4>(f64::MIN_POSITIVE / 2.0), "0.0000");
    }

    #[test]
    fn whole_numbers() {
        for v in [0, 9, 10, 99, 100, 12345, -1, i64::MAX, i64::MIN] {
            let mut out = Vec::new();
            push_int(&mut out, v);
            assert_eq!(String::from_utf8(out).unwrap(), v.to_string());
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]
        #[test]
        fn any_double(bits: u64) {
            let v = f64::from_bits(bits);
            prop_assume!(v.is_finite());
            prop_assert_eq!(fixed::<4>(v), format!("{v:.4}"));
            prop_assert_eq!(fixed::<6>(v), format!("{v:.6}"));
        }
        #[test]
        fn usual_sizes(v in -1e6..1e6_f64) {
            prop_assert_eq!(fixed::<4>(v), format!("{v:.4}"));
            prop_assert_eq!(fixed::<6>(v), format!("{v:.6}"));
        }
        #[test]
        fn at_and_beside_ties(n in -4_000_000_i64..4_000_000, step in -2_i64..=2, scale in 1_u32..20) {
            for v in [(n as f64 + 0.5) / 1e4, (n as f64 + 0.5) / 1e6, n as f64 / f64::from(1_u32 << scale)] {
                let v = f64::from_bits((v.to_bits() as i64 + step) as u64);
                prop_assume!(v.is_finite());
                prop_assert_eq!(fixed::<4>(v), format!("{v:.4}"));
                prop_assert_eq!(fixed::<6>(v), format!("{v:.6}"));
            }
        }
    }
}
