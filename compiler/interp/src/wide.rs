//! Sums with π to 64 bits: what an x87 `long double` constant gives, rounded to double once.
//!
//! The controller writes π as a `long double` in its angle sums. A quarter turn then comes out a few 1e-17
//! beside the nearest double, which decides whether a coordinate prints as `0.0000` or `-0.0000`.

/// A constant of more than double precision: `hi + lo`.
#[derive(Clone, Copy)]
pub(crate) struct Wide {
    hi: f64,
    lo: f64,
}

/// What 64 bits of π have more than 53: 565 units of 2⁻⁶².
const REST: f64 = 565.0 / 4_611_686_018_427_387_904.0;
/// π
pub(crate) const PI: Wide = Wide { hi: std::f64::consts::PI, lo: REST };
/// π/2
pub(crate) const HALF_PI: Wide = Wide { hi: std::f64::consts::FRAC_PI_2, lo: REST / 2.0 };
/// 2π
pub(crate) const TWO_PI: Wide = Wide { hi: std::f64::consts::TAU, lo: REST * 2.0 };

/// `x + w`, rounded once.
pub(crate) fn plus(x: f64, w: Wide) -> f64 {
    plus2(x, w, 0.0)
}

/// `x - w`, rounded once.
pub(crate) fn minus(x: f64, w: Wide) -> f64 {
    plus2(x, Wide { hi: -w.hi, lo: -w.lo }, 0.0)
}

/// `x + w + y`, rounded once.
pub(crate) fn plus2(x: f64, w: Wide, y: f64) -> f64 {
    let (s, e) = exact_sum(x, w.hi);
    let (s, e2) = exact_sum(s, y);
    s + (e + e2 + w.lo)
}

/// Sum and what its rounding lost.
fn exact_sum(a: f64, b: f64) -> (f64, f64) {
    let s = a + b;
    let b_part = s - a;
    (s, (a - (s - b_part)) + (b - b_part))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quarter_turn_is_not_quite_zero() {
        let x = minus(std::f64::consts::FRAC_PI_2, HALF_PI);
        assert!(x < 0.0 && x > -7e-17, "{x:e}");
        assert!(plus(-std::f64::consts::PI, PI) > 1.2e-16);
    }
}
