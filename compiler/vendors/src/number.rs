//! Numbers as text: a fixed count of decimals, never `-0`, never an exponent.

const POWERS: [f64; 10] = [1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9];

/// Appends a value with exactly so many decimals (at most nine).
pub(crate) fn fixed(out: &mut String, value: f64, decimals: usize) {
    let decimals = decimals.min(POWERS.len() - 1);
    let scaled = libm::round(value * POWERS[decimals]);
    if !(scaled.abs() < 9e15) {
        out.push_str(&format!("{value:.decimals$}"));
        return;
    }
    let mut digits = [0u8; 24];
    let mut rest = scaled.abs() as u64;
    let mut at = digits.len();
    let mut count = 0;
    while rest > 0 || count <= decimals {
        if count == decimals && decimals > 0 {
            at -= 1;
            digits[at] = b'.';
        }
        at -= 1;
        digits[at] = b'0' + (rest % 10) as u8;
        rest /= 10;
        count += 1;
    }
    if scaled < 0.0 {
        out.push('-');
    }
    out.extend(digits[at..].iter().map(|d| char::from(*d)));
}

/// Appends a value with at most so many decimals and no needless zeros.
pub(crate) fn short(out: &mut String, value: f64, decimals: usize) {
    let start = out.len();
    fixed(out, value, decimals);
    if decimals > 0 {
        let kept = out[start..].trim_end_matches('0').trim_end_matches('.').len();
        out.truncate(start + kept);
    }
}

/// As [`fixed`], on its own.
pub(crate) fn fix(value: f64, decimals: usize) -> String {
    let mut out = String::new();
    fixed(&mut out, value, decimals);
    out
}

/// As [`short`], on its own.
pub(crate) fn num(value: f64, decimals: usize) -> String {
    let mut out = String::new();
    short(&mut out, value, decimals);
    out
}

/// With one decimal at least: some languages tell whole numbers from real ones by the point.
pub(crate) fn real(value: f64, decimals: usize) -> String {
    let mut out = num(value, decimals);
    if !out.contains('.') {
        out.push_str(".0");
    }
    out
}

/// Seven significant digits: what a 32-bit number holds.
pub(crate) fn single(value: f64) -> String {
    let before = if value.abs() < 1.0 { 0 } else { libm::floor(libm::log10(value.abs())) as usize + 1 };
    num(value, 9usize.min(if before == 0 { 9 } else { 7usize.saturating_sub(before) }))
}

/// The greatest number of two significant digits that is not more than the value.
pub(crate) fn down(value: f64) -> f64 {
    if !(value > 1e-6) {
        return 0.0;
    }
    let mut unit = 1.0;
    while value >= unit * 100.0 && unit < 1e12 {
        unit *= 10.0;
    }
    while value < unit * 10.0 {
        unit /= 10.0;
    }
    // The room keeps 0.3 from becoming 0.29 by rounding of the quotient.
    libm::floor(value / unit + 1e-9) * unit
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn forms() {
        assert_eq!(fix(-0.0004, 3), "0.000");
        assert_eq!(fix(-12.3456, 3), "-12.346");
        assert_eq!(fix(0.05, 1), "0.1");
        assert_eq!(fix(7.0, 0), "7");
        assert_eq!(num(100.0, 3), "100");
        assert_eq!(num(-0.00001, 3), "0");
        assert_eq!(num(0.25, 3), "0.25");
        assert_eq!(real(100.0, 3), "100.0");
        assert_eq!(single(1000.0 / 60.0), "16.66667");
        assert_eq!(single(0.016_666_666_7), "0.016666667");
        assert_eq!((num(down(0.3), 6).as_str(), num(down(0.239), 6).as_str(), num(down(12.9), 6).as_str()), ("0.3", "0.23", "12"));
    }

    proptest! {
        #[test]
        fn as_the_standard_library(v in -1e6f64..1e6, d in 0usize..9) {
            let text = fix(v, d);
            prop_assert!((text.parse::<f64>().unwrap() - v).abs() <= 0.5000001 * 10f64.powi(-(d as i32)) + v.abs() * 4e-16);
            prop_assert!(!text.starts_with("-0.") || text[1..].parse::<f64>().unwrap() > 0.0);
        }
    }
}
