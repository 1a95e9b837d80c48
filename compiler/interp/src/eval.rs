//! Values of expressions, with the controller's own arithmetic: comparison with a tolerance, angles in
//! degrees converted with extended precision (so that `FIX[2*SIN[30]]` is 1), rounding half away from zero.

use gr_canon::{Sink, Version};
use gr_gcode::{Binary, ExprId, Node, Scan, Unary};
use gr_spec::{Rs274, code, rs274};

use crate::angle::sin_cos2;
use crate::{Fault, Interp, Res, fanuc, vacant};

/// Deeper nesting than any line of a controller allows; keeps the stack small on hostile input.
const MAX_DEPTH: u32 = 600;

/// `double` → `int` as the processor does it: out of range gives the smallest integer.
pub(crate) fn to_int(x: f64) -> i32 {
    if x.is_nan() || x >= 2_147_483_648.0 || x <= -2_147_483_649.0 { i32::MIN } else { x as i32 }
}

/// Nearest whole number, ties to even.
pub(crate) fn nearest_int(x: f64) -> i32 {
    to_int(libm::rint(x))
}

/// The whole number that `value` stands for, if it is close enough to one.
pub(crate) fn whole(value: f64) -> Option<i32> {
    let low = to_int(libm::floor(value));
    let rest = value - f64::from(low);
    if rest > 0.9999 {
        Some(to_int(libm::ceil(value)))
    } else if rest > 0.0001 {
        None
    } else {
        Some(low)
    }
}

/// π with a 64-bit significand: what the controller multiplies degrees by.
const PI_SIGNIFICAND: u128 = 0xC90F_DAA2_2168_C235;
const PI_HIGH: f64 = std::f64::consts::PI;
/// The rest of that π beyond the double.
const PI_LOW: f64 = 1.225_148_454_908_620_3e-16;

/// Rounds a significand of `bits` > 64 bits to 64 bits, half to even; the shift is what went away.
fn round64(value: u128, sticky: bool) -> (u128, i32) {
    let bits = 128 - value.leading_zeros() as i32;
    let shift = (bits - 64).max(0);
    if shift == 0 {
        return (value, 0);
    }
    let low = value & ((1 << shift) - 1);
    let half = 1u128 << (shift - 1);
    let mut high = value >> shift;
    if low > half || (low == half && (sticky || high & 1 == 1)) {
        high += 1;
    }
    if high >> 64 != 0 { (high >> 1, shift + 1) } else { (high, shift) }
}

/// `x·π/180` rounded to 64 bits after each operation, as a sum of two doubles.
fn radians(x: f64) -> (f64, f64) {
    let bits = x.abs().to_bits();
    let exponent = (bits >> 52) as i32;
    if exponent == 0 || exponent >= 0x7fe {
        return (x * (PI_HIGH / 180.0), 0.0);
    }
    let significand = u128::from(bits & ((1 << 52) - 1) | (1 << 52));
    // x = significand · 2^(exponent − 1075), π = PI_SIGNIFICAND · 2^−62
    let (product, up) = round64(significand * PI_SIGNIFICAND, false);
    let mut scale = exponent - 1075 - 62 + up;
    // product / 180, with 60 more bits
    let wide = product << 60;
    let (quotient, rest) = (wide / 180, wide % 180);
    scale -= 60;
    let (result, up) = round64(quotient, rest != 0);
    scale += up;
    let (high, low) = (result >> 11 << 11, result & 0x7ff);
    let (high, low) = (libm::ldexp(high as f64, scale), libm::ldexp(low as f64, scale));
    if x < 0.0 { (-high, -low) } else { (high, low) }
}

/// Degrees of an angle in radians.
fn degrees(x: f64) -> f64 {
    let a = x * 180.0;
    let q = a / PI_HIGH;
    let rest = libm::fma(-q, PI_HIGH, a) - q * PI_LOW;
    q + rest / PI_HIGH
}

/// Sine of an angle in degrees.
pub(crate) fn sin_degrees(x: f64) -> f64 {
    let (high, low) = radians(x);
    sin_cos2(high, low).0
}

/// Cosine of an angle in degrees.
pub(crate) fn cos_degrees(x: f64) -> f64 {
    let (high, low) = radians(x);
    sin_cos2(high, low).1
}

fn tan_degrees(x: f64) -> f64 {
    let (high, low) = radians(x);
    let t = libm::tan(high);
    // Where the tangent is huge the linear correction does not hold.
    if t.abs() < 1e6 {
        t + low * (1.0 + t * t)
    } else {
        let (s, c) = sin_cos2(high, low);
        s / c
    }
}

/// Arc tangent of y/x in degrees.
pub(crate) fn atan_degrees(y: f64, x: f64) -> f64 {
    degrees(crate::angle::atan2(y, x))
}

fn domain(rs: Rs274, what: &str, value: f64) -> Box<Fault> {
    Fault::new(code::EXPRESSION_DOMAIN, rs).arg(what).arg(value)
}

pub(crate) fn finite(value: f64) -> Res<f64> {
    if value.is_nan() {
        Err(Fault::new(code::EXPRESSION_NOT_FINITE, rs274::RT_NAN).arg("not a number"))
    } else if value.is_infinite() {
        Err(Fault::new(code::EXPRESSION_NOT_FINITE, rs274::RT_INFINITY).arg("infinite"))
    } else {
        Ok(value)
    }
}

fn unary(op: Unary, x: f64) -> Res<f64> {
    Ok(match op {
        Unary::Negate => -x,
        Unary::Abs => {
            if x < 0.0 { -x } else { x }
        }
        Unary::Acos if !(-1.0..=1.0).contains(&x) => return Err(domain(rs274::RT_ACOS, "ACOS", x)),
        Unary::Asin if !(-1.0..=1.0).contains(&x) => return Err(domain(rs274::RT_ASIN, "ASIN", x)),
        Unary::Ln if x <= 0.0 => return Err(domain(rs274::RT_LN, "LN", x)),
        Unary::Sqrt if x < 0.0 => return Err(domain(rs274::RT_SQRT, "SQRT", x)),
        Unary::Acos => degrees(libm::acos(x)),
        Unary::Asin => degrees(libm::asin(x)),
        Unary::Cos => cos_degrees(x),
        Unary::Exp => libm::exp(x),
        Unary::Fix => libm::floor(x),
        Unary::Fup => libm::ceil(x),
        Unary::Ln => libm::log(x),
        Unary::Round => f64::from(to_int(x + if x < 0.0 { -0.5 } else { 0.5 })),
        Unary::Sin => sin_degrees(x),
        Unary::Sqrt => libm::sqrt(x),
        Unary::Tan => tan_degrees(x),
    })
}

fn binary(op: Binary, a: f64, b: f64, tolerance: f64) -> Res<f64> {
    let truth = |t: bool| if t { 1.0 } else { 0.0 };
    Ok(match op {
        Binary::Power => {
            if a < 0.0 && libm::floor(b) != b {
                return Err(domain(rs274::RT_POWER, "a negative number to a power that is not whole", b));
            }
            libm::pow(a, b)
        }
        Binary::Times => a * b,
        Binary::Divide => {
            if b == 0.0 {
                return Err(Fault::new(code::EXPRESSION_DIVISION_BY_ZERO, rs274::RT_DIVIDE_BY_ZERO));
            }
            a / b
        }
        Binary::Modulo => {
            let rest = libm::fmod(a, b);
            if rest < 0.0 { rest + b.abs() } else { rest }
        }
        Binary::Plus => a + b,
        Binary::Minus => a - b,
        Binary::Eq => truth((a - b).abs() < tolerance),
        Binary::Ne => truth((a - b).abs() >= tolerance),
        Binary::Gt => truth(a > b),
        Binary::Ge => truth(a >= b),
        Binary::Lt => truth(a < b),
        Binary::Le => truth(a <= b),
        Binary::And => truth(a != 0.0 && b != 0.0),
        Binary::Or => truth(a != 0.0 || b != 0.0),
        Binary::Xor => truth((a != 0.0) != (b != 0.0)),
    })
}

/// Where a value comes from.
const PROBE: &str = "a probe (G38)";

impl<S: Sink> Interp<'_, S> {
    /// Value of an expression.
    pub(crate) fn eval(&mut self, scan: &Scan, id: ExprId) -> Res<f64> {
        self.eval_or_vacant(scan, id).map(vacant::number)
    }

    /// Value of an expression; [`vacant::VACANT`] where a Fanuc control has none.
    pub(crate) fn eval_or_vacant(&mut self, scan: &Scan, id: ExprId) -> Res<f64> {
        let value = self.eval_node(scan, id, 0).map_err(|f| blame(f, scan, id))?;
        finite(value).map_err(|f| blame(f, scan, id))
    }

    /// A pair of brackets encloses the whole of this expression.
    #[cold]
    fn is_bracketed(&self, scan: &Scan, id: ExprId) -> bool {
        let Some(text) = scan.node_spans.get(id.0 as usize).and_then(|s| self.reading.text.get(s.range())) else {
            return false;
        };
        let mut depth = 0;
        for (i, byte) in text.bytes().enumerate() {
            match byte {
                b'[' => depth += 1,
                b']' => depth -= 1,
                _ => {}
            }
            if depth == 0 {
                return i > 0 && i + 1 == text.len();
            }
        }
        false
    }

    fn eval_node(&mut self, scan: &Scan, id: ExprId, depth: u32) -> Res<f64> {
        if depth > MAX_DEPTH {
            return Err(Fault::own(code::EXPRESSION_TOO_DEEP));
        }
        let Some(node) = scan.nodes.get(id.0 as usize) else { return Err(self.parse_fault(scan)) };
        match *node {
            Node::Number(x) => Ok(x),
            Node::Param(index) if self.is_fanuc() => {
                let index = vacant::number(self.eval_node(scan, index, depth + 1)?);
                let index = whole(index).ok_or_else(|| not_whole(index)).and_then(|i| self.variable_index(i));
                Ok(self.read_variable(index.map_err(|f| blame(f, scan, id))?))
            }
            Node::Param(index) => {
                let index = self.eval_node(scan, index, depth + 1)?;
                let index = self.param_index(index).map_err(|f| blame(f, scan, id))?;
                if self.m.stand_ins != 0 {
                    self.doubt_stand_in(scan, id, index);
                }
                self.read_param(index).map_err(|f| blame(f, scan, id))
            }
            Node::Named(name) => {
                let name = scan.names.get(name as usize).map_or("", |n| n);
                if self.m.loose != 0 {
                    self.doubt_place(scan, id, name);
                }
                self.read_named(name).map_err(|f| blame(f, scan, id))
            }
            Node::Unary(op, x) => {
                let x = self.eval_node(scan, x, depth + 1)?;
                if self.is_fanuc()
                    && let Some(value) = vacant::function(op, x)
                {
                    return Ok(value);
                }
                unary(op, x).and_then(finite).map_err(|f| blame(f, scan, id))
            }
            Node::Atan(y, x) => {
                let y = self.eval_node(scan, y, depth + 1)?;
                let x = self.eval_node(scan, x, depth + 1)?;
                Ok(atan_degrees(y, x))
            }
            Node::ExistsNamed(name) => {
                let name = scan.names.get(name as usize).map_or("", |n| n);
                Ok(if self.find_named(name).is_some() { 1.0 } else { 0.0 })
            }
            Node::ExistsParam(index) => {
                let index = self.eval_node(scan, index, depth + 1)?;
                let index = whole(index).ok_or_else(|| blame(not_whole(index), scan, id))?;
                Ok(if (1..crate::params::MAX).contains(&index) { 1.0 } else { 0.0 })
            }
            Node::Binary(op, a, b) => {
                let a = self.eval_node(scan, a, depth + 1)?;
                let b = self.eval_node(scan, b, depth + 1)?;
                if let Some(value) = vacant::compared(op, a, b) {
                    return Ok(value);
                }
                let (a, b) = (vacant::number(a), vacant::number(b));
                let tolerance = if self.setup.version == Version::V2_9 { 1e-4 } else { 1e-6 };
                let value = match fanuc::bitwise(op, a, b).filter(|_| self.is_fanuc()) {
                    Some(value) => value,
                    None => binary(op, a, b, tolerance).map_err(|f| blame(f, scan, id))?,
                };
                // The controller looks at the value of a bracket, not at what is worked out inside.
                if !value.is_finite() && self.is_bracketed(scan, id) {
                    return finite(value).map_err(|f| blame(f, scan, id));
                }
                Ok(value)
            }
            Node::Bad => Err(self.parse_fault(scan)),
        }
    }

    /// Warns, once per place, of a value that only the running machine knows.
    #[cold]
    fn doubt_stand_in(&mut self, scan: &Scan, id: ExprId, index: i32) {
        let (source, what) = match index {
            5399 if self.m.stand_ins & 1 != 0 => ("an input (M66)", "input"),
            5061..=5070 if self.m.stand_ins & 2 != 0 => (PROBE, "the result of a probe"),
            5420..=5425 if self.m.loose >> (index - 5420) & 1 != 0 => (PROBE, "where the probe stopped"),
            _ => return,
        };
        self.doubt(scan, id, format!("#{index}"), source, what);
    }

    /// The same of the named parameters that say where the machine is.
    #[cold]
    fn doubt_place(&mut self, scan: &Scan, id: ExprId, name: &str) {
        let axis = name.strip_prefix("_abs_").or_else(|| name.strip_prefix('_'));
        let axis = axis.filter(|a| a.len() == 1).and_then(|a| "xyzabc".find(a));
        if axis.is_some_and(|i| self.m.loose >> i & 1 != 0) {
            self.doubt(scan, id, format!("#<{name}>"), PROBE, "where the probe stopped");
        }
    }

    fn doubt(&mut self, scan: &Scan, id: ExprId, name: String, source: &str, what: &str) {
        self.mark_runtime(what);
        let shown = [name, source.to_string()];
        let place = self.place;
        let same = |f: &crate::Finding| {
            f.fault.code == code::RUN_VALUE_UNKNOWN && (f.file, f.line) == (place.file, place.line) && f.fault.args == shown
        };
        if !self.findings.iter().any(same) {
            let fault = Fault::own(code::RUN_VALUE_UNKNOWN).arg(&shown[0]).arg(&shown[1]);
            self.warn(blame(fault, scan, id));
        }
    }

    fn param_index(&self, value: f64) -> Res<i32> {
        let index = whole(value).ok_or_else(|| not_whole(value))?;
        if (1..crate::params::MAX).contains(&index) {
            Ok(index)
        } else {
            Err(Fault::new(code::PARAMETER_NUMBER_RANGE, rs274::RT_PARAMETER_RANGE).arg(index).named(value.to_string()))
        }
    }

    /// Index of a parameter that is to be set.
    pub(crate) fn target_index(&mut self, scan: &Scan, id: ExprId) -> Res<i32> {
        let value = self.eval(scan, id)?;
        if self.is_fanuc() {
            let index = whole(value).ok_or_else(|| not_whole(value));
            return index.and_then(|i| self.variable_target(i)).map_err(|f| blame(f, scan, id));
        }
        let index = self.param_index(value).map_err(|f| blame(f, scan, id))?;
        if (5400..=5413).contains(&index) || (5420..=5428).contains(&index) {
            let fault = Fault::new(code::PARAMETER_READ_ONLY, rs274::RT_PARAMETER_READONLY).arg(format!("#{index}"));
            return Err(blame(fault, scan, id));
        }
        Ok(index)
    }
}

pub(crate) fn not_whole(value: f64) -> Box<Fault> {
    Fault::new(code::WORD_NOT_INTEGER, rs274::RT_NON_INTEGER).arg(value)
}

fn blame(mut fault: Box<Fault>, scan: &Scan, id: ExprId) -> Box<Fault> {
    if fault.span.is_none() {
        fault.span = scan.node_spans.get(id.0 as usize).copied();
    }
    fault
}

#[cfg(test)]
mod tests {
    use super::{atan_degrees, cos_degrees, degrees, sin_degrees, tan_degrees, whole};

    #[test]
    fn angles_of_the_unit_circle_are_exact() {
        assert_eq!(sin_degrees(30.0), 0.5);
        assert_eq!(sin_degrees(-30.0), -0.5);
        assert_eq!(cos_degrees(60.0), 0.5);
        assert_eq!(tan_degrees(45.0), 1.0);
        assert_eq!(sin_degrees(90.0), 1.0);
        assert!(cos_degrees(90.0).abs() < 1e-19);
        assert!(sin_degrees(180.0).abs() < 1e-18);
        assert_eq!(atan_degrees(1.0, 1.0), 45.0);
        assert_eq!(degrees(libm::acos(0.0)), 90.0);
    }

    #[test]
    fn whole_numbers_have_a_tolerance() {
        assert_eq!(whole(2.00005), Some(2));
        assert_eq!(whole(1.99995), Some(2));
        assert_eq!(whole(1.5), None);
        assert_eq!(whole(-1.0), Some(-1));
    }
}
