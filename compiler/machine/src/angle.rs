//! Arc tangent for the arms: branch-free, so that twenty of them overlap in the processor, where the quadrants of `libm`'s
//! can't be foreseen. Plain arithmetic, the same on every machine; at most 3 units in the last place from `libm`.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

/// tan(π/8): beyond it the ratio is turned back by π/4.
const EIGHTH: f64 = 0.414_213_562_373_095_05;
/// What the doubles π/4, π/2 and π lack.
const LOW_PI: f64 = 1.224_646_799_147_353_2e-16;
/// (atan z − z) / z³ as a polynomial in z² for |z| ≤ tan(π/8): interpolated at the Chebyshev nodes, 5e-18 off.
const SERIES: [f64; 11] = [
    -0.333_333_333_333_333_3,
    0.199_999_999_999_954_8,
    -0.142_857_142_846_578_9,
    0.111_111_110_145_608_4,
    -0.090_909_045_498_775_33,
    0.076_921_825_349_523_82,
    -0.066_645_022_133_599_11,
    0.058_580_687_368_012_42,
    -0.050_850_303_879_408_7,
    0.039_219_549_505_928_92,
    -0.019_162_065_212_984_043,
];

/// The angle of a direction, −π … π; 0 for no direction.
#[inline]
pub(crate) fn atan2(y: f64, x: f64) -> f64 {
    let (across, up) = (x.abs(), y.abs());
    let steep = up > across;
    let (less, more) = if steep { (across, up) } else { (up, across) };
    let far = less > EIGHTH * more;
    let (num, den) = if far { (less - more, less + more) } else { (less, more) };
    let z = num / if den == 0.0 { 1.0 } else { den };
    let w = z * z;
    let (w2, c) = (w * w, &SERIES);
    let w4 = w2 * w2;
    let (p0, p1) = ((c[0] + w * c[1]) + w2 * (c[2] + w * c[3]), (c[4] + w * c[5]) + w2 * (c[6] + w * c[7]));
    let series = p0 + w4 * (p1 + w4 * ((c[8] + w * c[9]) + w2 * c[10]));
    let small = z + z * (w * series);
    // 0 … π/4, then the half and the side of the plane.
    let (base, low) = if far { (FRAC_PI_4, LOW_PI / 4.0) } else { (0.0, 0.0) };
    let (base, low, sign) = if steep { (FRAC_PI_2 - base, LOW_PI / 2.0 - low, -1.0) } else { (base, low, 1.0) };
    let (base, low, sign) = if x < 0.0 { (PI - base, LOW_PI - low, -sign) } else { (base, low, sign) };
    (base + (sign * small + low)).copysign(y)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Units in the last place between two numbers of one sign.
    fn apart(a: f64, b: f64) -> u64 {
        a.to_bits().abs_diff(b.to_bits())
    }

    #[test]
    fn every_direction_is_right_to_three_units() {
        let mut worst = 0;
        for n in 0..400_000u32 {
            let angle = f64::from(n) * 1e-3;
            let length = libm::pow(10.0, f64::from(n % 41) - 20.0);
            let (y, x) = (length * libm::sin(angle), length * libm::cos(angle) * if n % 7 == 0 { 1e-9 } else { 1.0 });
            worst = worst.max(apart(atan2(y, x), libm::atan2(y, x)));
        }
        assert!(worst <= 3, "{worst}");
    }

    #[test]
    fn axes_and_nothing() {
        for (y, x) in [(0.0, 1.0), (0.0, -1.0), (-0.0, -1.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 0.0), (1.0, 1.0), (1.0, -1.0), (-2.0, -2.0)] {
            assert_eq!(atan2(y, x), libm::atan2(y, x), "{y} {x}");
        }
        assert!(atan2(f64::NAN, 1.0).is_nan() && atan2(1.0, f64::NAN).is_nan());
    }
}
