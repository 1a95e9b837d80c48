//! Numbers and times as people read them, in findings, sheets and hovers. Not for programs: what a machine reads has a
//! fixed number of decimals.

/// At most `places` decimals, no needless zeros: 30, not the 29.999999999999996 of a conversion.
pub fn number(value: f64, places: usize) -> String {
    if !value.is_finite() {
        return value.to_string();
    }
    let text = format!("{value:.places$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text == "-0" { "0".into() } else { text.into() }
}

/// All digits of a value, but for what a conversion of units leaves in the last ones: 11.819851171331011, and 30 for
/// 29.999999999999996.
pub fn exact(value: f64) -> String {
    let near = number(value, 9);
    match near.parse::<f64>() {
        Ok(v) if (v - value).abs() <= 1e-13 * value.abs().max(1.0) => near,
        _ => value.to_string(),
    }
}

/// Seconds: `0.42 s`, `12.5 s`, `3 min 7 s`, `1 h 02 min`.
pub fn duration(seconds: f64) -> String {
    let whole = seconds.round() as u64;
    match whole {
        0..10 => format!("{} s", number(seconds, 2)),
        10..60 => format!("{} s", number(seconds, 1)),
        60..3600 => format!("{} min {} s", whole / 60, whole % 60),
        _ => format!("{} h {:02} min", whole / 3600, whole % 3600 / 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_people_read_them() {
        let numbers = [(29.999999999999996, 4), (0.5, 3), (-0.00001, 3), (1200.0, 0), (f64::INFINITY, 2)];
        assert_eq!(numbers.map(|(v, p)| number(v, p)), ["30", "0.5", "0", "1200", "inf"]);
        assert_eq!([29.999999999999996, 11.819851171331011, -0.0, 0.1 + 0.2].map(exact), ["30", "11.819851171331011", "0", "0.3"]);
        let times = [0.0, 0.416, 37.74, 59.96, 187.0, 3725.0, 100_000.0];
        assert_eq!(times.map(duration), ["0 s", "0.42 s", "37.7 s", "1 min 0 s", "3 min 7 s", "1 h 02 min", "27 h 46 min"]);
    }
}
