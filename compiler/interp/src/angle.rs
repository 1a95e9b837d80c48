//! Sine, cosine, arc tangent and hypotenuse rounded (nearly always) to the nearest double. The controller's C
//! library does that, and a last bit decides whether a zero prints with a minus sign after a turn of the frame
//! or a polar move. Slow next to plain ones; used where a program asks for an angle, not in plain moves.

/// A sum of two doubles, the second the smaller.
type Pair = (f64, f64);

fn two_sum(a: f64, b: f64) -> Pair {
    let s = a + b;
    let t = s - a;
    (s, (a - (s - t)) + (b - t))
}

fn quick_sum(a: f64, b: f64) -> Pair {
    let s = a + b;
    (s, b - (s - a))
}

fn two_product(a: f64, b: f64) -> Pair {
    let p = a * b;
    (p, libm::fma(a, b, -p))
}

fn add(a: Pair, b: Pair) -> Pair {
    let (s, e) = two_sum(a.0, b.0);
    quick_sum(s, e + a.1 + b.1)
}

fn multiply(a: Pair, b: Pair) -> Pair {
    let (p, e) = two_product(a.0, b.0);
    quick_sum(p, e + a.0 * b.1 + a.1 * b.0)
}

fn divide(a: Pair, b: f64) -> Pair {
    let q = a.0 / b;
    let (p, e) = two_product(q, b);
    quick_sum(q, (a.0 - p - e + a.1) / b)
}

const HALF_PI: [f64; 3] = [std::f64::consts::FRAC_PI_2, 6.123_233_995_736_766e-17, -1.497_384_904_859_169_8e-33];

/// `x − k·π/2` as a pair, and k modulo 4.
fn reduce(x: Pair) -> (Pair, i32) {
    let k = libm::rint(x.0 / HALF_PI[0]);
    if k == 0.0 {
        return (x, 0);
    }
    let mut r = x;
    for part in HALF_PI {
        let (p, e) = two_product(-k, part);
        r = add(r, (p, e));
    }
    (r, (libm::fmod(k, 4.0) as i32).rem_euclid(4))
}

/// Sine and cosine of a pair, as pairs. Good to about 100 bits while |x| < 10⁶.
fn sin_cos_pair(x: Pair) -> (Pair, Pair) {
    let (r, quarter) = reduce(x);
    let square = multiply(r, r);
    let (mut sin, mut cos) = (r, (1.0, 0.0));
    let (mut s, mut c) = (r, (1.0, 0.0));
    for n in 1..14 {
        let n = f64::from(2 * n);
        c = divide(multiply(c, square), -(n * (n - 1.0)));
        s = divide(multiply(s, square), -(n * (n + 1.0)));
        cos = add(cos, c);
        sin = add(sin, s);
    }
    let minus = |p: Pair| (-p.0, -p.1);
    match quarter {
        0 => (sin, cos),
        1 => (cos, minus(sin)),
        2 => (minus(sin), minus(cos)),
        _ => (minus(cos), sin),
    }
}

/// Sine and cosine of `high + low` radians.
pub(crate) fn sin_cos2(high: f64, low: f64) -> (f64, f64) {
    if !(high.abs() < 1e6) {
        return (libm::sin(high), libm::cos(high));
    }
    if high == 0.0 {
        return (high, 1.0);
    }
    let (s, c) = sin_cos_pair((high, low));
    (s.0 + s.1, c.0 + c.1)
}

/// Sine and cosine of an angle in radians.
pub(crate) fn sin_cos(x: f64) -> (f64, f64) {
    sin_cos2(x, 0.0)
}

/// Direction of (x, y).
pub(crate) fn atan2(y: f64, x: f64) -> f64 {
    let t = libm::atan2(y, x);
    if y == 0.0 || x == 0.0 || !y.is_finite() || !x.is_finite() {
        return t;
    }
    // By a power of two, so that nothing is rounded.
    let exponent = libm::ilogb(libm::fmax(x.abs(), y.abs()));
    let (x, y) = (libm::scalbn(x, -exponent), libm::scalbn(y, -exponent));
    let (s, c) = sin_cos_pair((t, 0.0));
    let across = add(multiply((y, 0.0), c), multiply((-x, 0.0), s));
    let along = x * c.0 + y * s.0;
    let better = t + across.0 / along;
    if better.is_finite() { better } else { t }
}

/// √(x² + y²)
pub(crate) fn hypot(x: f64, y: f64) -> f64 {
    let plain = libm::hypot(x, y);
    if !(1e-100..1e100).contains(&plain) {
        return plain;
    }
    let sum = add(two_product(x, x), two_product(y, y));
    let (p, e) = two_product(plain, plain);
    plain + (sum.0 - p - e + sum.1) / (2.0 * plain)
}

#[cfg(test)]
mod tests {
    use super::{atan2, hypot, sin_cos};

    #[test]
    fn agrees_with_the_standard_library_within_a_bit() {
        for i in -2000..2000 {
            let x = f64::from(i) * 0.0371;
            let (s, c) = sin_cos(x);
            assert!((s - x.sin()).abs() <= 1.2e-16 && (c - x.cos()).abs() <= 1.2e-16, "{x}");
            let (y, x) = (s * 3.0, c * 5.0);
            assert!((atan2(y, x) - y.atan2(x)).abs() <= 4.5e-16, "{y} {x}");
            assert!((hypot(x, y) - x.hypot(y)).abs() <= 1e-15);
        }
    }

    #[test]
    fn half_a_turn() {
        let (s, c) = sin_cos(std::f64::consts::PI);
        assert_eq!((s, c), (1.224_646_799_147_353_2e-16, -1.0));
    }
}
