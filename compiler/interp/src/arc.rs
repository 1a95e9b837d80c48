//! G2 and G3: arcs and helices from words to centre, turns and end. Compensated arcs end in [`crate::comp`].
//!
//! Every test and its order is the controller's, since a program is right or wrong by the first fault it meets.

use gr_canon::{Axes, Call, Plane, Sink, Units};
use gr_spec::{code, rs274};

use crate::queue::plane_axes;
use crate::wide::{self, HALF_PI, TWO_PI};
use crate::{Fault, Ini, Interp, Res, Side};

/// What is known of an arc before its centre: words of the block in the order of the plane's axes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ArcWords {
    /// G2.
    pub clockwise: bool,
    /// R word.
    pub radius: Option<f64>,
    /// I, J, K of the plane.
    pub offset: [f64; 2],
    /// G90.1.
    pub absolute: bool,
    /// P word.
    pub turns: i32,
    pub plane: Plane,
    pub tolerance: Tolerance,
}

/// Tolerances of an arc in program units.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tolerance {
    /// Least radius, and how much too long a chord of an R arc may be.
    pub radius: f64,
    /// Allowed difference of start and end radius.
    pub spiral: f64,
}

/// Centre and signed turns.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Centre {
    pub at: [f64; 2],
    pub turn: i32,
}

/// Relative part of the allowed difference of start and end radius.
const SPIRAL_RELATIVE: f64 = 0.001;

/// Least and most that the INI file may say for the difference of start and end radius, and the key that says it.
fn spiral_limits(units: Units) -> (f64, f64, &'static str) {
    match units {
        Units::Inch => (0.00004, 2.0 * 0.001 * std::f64::consts::SQRT_2, "CENTER_ARC_RADIUS_TOLERANCE_INCH"),
        Units::Mm => (0.001, 2.0 * 0.01 * std::f64::consts::SQRT_2, "CENTER_ARC_RADIUS_TOLERANCE_MM"),
    }
}

/// What may stand behind a key of the INI file that is about the difference of radii.
pub(crate) fn spiral_limits_of(key: &str) -> Option<std::ops::RangeInclusive<f64>> {
    let mut limits = [Units::Inch, Units::Mm].into_iter().map(spiral_limits);
    limits.find(|l| l.2 == key).map(|(least, most, _)| least..=most)
}

/// What the INI file says for it; `Err`: nothing that the controller takes.
fn told_spiral(units: Units, ini: &Ini) -> Result<Option<f64>, &'static str> {
    let (least, most, key) = spiral_limits(units);
    let Some(text) = ini.get("rs274ngc", key).filter(|t| !t.is_empty()) else { return Ok(None) };
    let number = text.parse().ok().filter(|v| (least..=most).contains(v));
    number.map(Some).ok_or(key)
}

/// Keys of the INI file about arcs whose value the controller does not take; it keeps its own.
pub fn wrong_arc_tolerances(ini: &Ini) -> Vec<&'static str> {
    [Units::Inch, Units::Mm].into_iter().filter_map(|units| told_spiral(units, ini).err()).collect()
}

impl Tolerance {
    /// Defaults by unit, or what the INI file says within the controller's limits.
    pub(crate) fn of(units: Units, ini: &Ini) -> Tolerance {
        let radius = if units == Units::Inch { 0.00005 } else { 0.00005 * 25.4 };
        let told = if ini.values.is_empty() { None } else { told_spiral(units, ini).ok().flatten() };
        Tolerance { radius, spiral: told.unwrap_or(spiral_limits(units).1) }
    }
}

/// Angle swept from `from` to `to`, radians, signed, with all full turns.
pub(crate) fn sweep(from: [f64; 2], centre: [f64; 2], turn: i32, to: [f64; 2]) -> f64 {
    if turn == 0 {
        return 0.0;
    }
    let mut a = libm::atan2(from[1] - centre[1], from[0] - centre[0]);
    let mut b = libm::atan2(to[1] - centre[1], to[0] - centre[0]);
    let full = std::f64::consts::TAU;
    if turn > 0 {
        if b <= a {
            b = wide::plus(b, TWO_PI);
        }
        (b - a) + f64::from(turn - 1) * full
    } else {
        if a <= b {
            a = wide::plus(a, TWO_PI);
        }
        (b - a) + f64::from(turn + 1) * full
    }
}

/// `%.4g` and its like: `digits` significant digits.
pub(crate) fn general(v: f64, digits: usize) -> String {
    if v == 0.0 || !v.is_finite() {
        return format!("{v}");
    }
    let scientific = format!("{:.*e}", digits - 1, v);
    let (mantissa, exponent) = scientific.split_once('e').expect("formatted with an exponent");
    let exponent: i32 = exponent.parse().expect("formatted as a number");
    let strip = |s: &str| match s.contains('.') {
        true => s.trim_end_matches('0').trim_end_matches('.').to_string(),
        false => s.to_string(),
    };
    if exponent < -4 || exponent >= digits as i32 {
        let sign = if exponent < 0 { '-' } else { '+' };
        return format!("{}e{sign}{:02}", strip(mantissa), exponent.abs());
    }
    strip(&format!("{:.*}", (digits as i32 - 1 - exponent).max(0) as usize, v))
}

/// `X1.0000`-like texts of a point, by the plane's letters.
fn point(plane: Plane, p: [f64; 2]) -> [String; 2] {
    let letters = match plane {
        Plane::Xy => ['X', 'Y'],
        Plane::Xz => ['Z', 'X'],
        Plane::Yz => ['Y', 'Z'],
        _ => ['!', '!'],
    };
    [format!("{}{:.4}", letters[0], p[0]), format!("{}{:.4}", letters[1], p[1])]
}

fn radius_fault(fault: Box<Fault>, plane: Plane, radii: [f64; 2], points: [[f64; 2]; 3]) -> Box<Fault> {
    let mut fault = fault.arg(format!("{:.4}", radii[0])).arg(format!("{:.4}", radii[1]));
    for text in points.iter().flat_map(|p| point(plane, *p)) {
        fault = fault.arg(text);
    }
    fault
}

impl ArcWords {
    /// Centre and turns of the arc from `start` to `end`.
    pub(crate) fn centre(&self, start: [f64; 2], end: [f64; 2]) -> Res<Centre> {
        match self.radius {
            Some(radius) => self.centre_by_radius(start, end, radius),
            None => self.centre_by_offset(start, end),
        }
    }

    fn turn(&self) -> i32 {
        if self.clockwise { self.turns.saturating_neg() } else { self.turns }
    }

    fn centre_by_offset(&self, start: [f64; 2], end: [f64; 2]) -> Res<Centre> {
        let at = if self.absolute {
            self.offset
        } else {
            [start[0] + self.offset[0], start[1] + self.offset[1]]
        };
        let r1 = libm::hypot(at[0] - start[0], at[1] - start[1]);
        let r2 = libm::hypot(at[0] - end[0], at[1] - end[1]);
        let points = [start, at, end];
        if r1 < self.tolerance.radius || r2 < self.tolerance.radius {
            let fault = Fault::new(code::ARC_ZERO_RADIUS, rs274::ARC_ZERO_RADIUS);
            return Err(radius_fault(fault, self.plane, [r1, r2], points));
        }
        let absolute = (r1 - r2).abs();
        let relative = absolute / if r1 < r2 { r2 } else { r1 };
        if absolute > self.tolerance.spiral * 100.0
            || (relative > SPIRAL_RELATIVE && absolute > self.tolerance.spiral)
        {
            let fault = Fault::new(code::ARC_RADIUS_MISMATCH, rs274::ARC_RADIUS_MISMATCH);
            return Err(radius_fault(fault, self.plane, [r1, r2], points)
                .arg(general(absolute, 4))
                .arg(format!("{:.4}", relative * 100.0)));
        }
        Ok(Centre { at, turn: self.turn() })
    }

    fn centre_by_radius(&self, start: [f64; 2], end: [f64; 2], radius: f64) -> Res<Centre> {
        if end == start {
            return Err(Fault::new(code::ARC_END_MISSING, rs274::ARC_SAME_END));
        }
        let size = radius.abs();
        let mid = [(end[0] + start[0]) / 2.0, (end[1] + start[1]) / 2.0];
        let mut half = libm::hypot(mid[0] - end[0], mid[1] - end[1]);
        if half - size > self.tolerance.radius {
            return Err(Fault::new(code::ARC_RADIUS_TOO_SMALL, rs274::ARC_R_TOO_SMALL)
                .at(b'r')
                .arg(format!("{size:.4}"))
                .arg(format!("{half:.4}")));
        }
        if half / size > 1.0 - 1e-12 {
            half = size;
        }
        let chord = libm::atan2(end[1] - start[1], end[0] - start[0]);
        let right = (self.clockwise && radius > 0.0) || (!self.clockwise && radius < 0.0);
        let towards = if right { wide::minus(chord, HALF_PI) } else { wide::plus(chord, HALF_PI) };
        let distance = size * libm::cos(libm::asin(half / size));
        Ok(Centre {
            at: [mid[0] + distance * libm::cos(towards), mid[1] + distance * libm::sin(towards)],
            turn: self.turn(),
        })
    }
}

/// The part of a move in the plane and across it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlaneEnd {
    pub plane: [f64; 2],
    pub third: f64,
    pub rest: [f64; 6],
}

impl PlaneEnd {
    pub(crate) fn of(end: &Axes, axes: [usize; 3]) -> PlaneEnd {
        PlaneEnd {
            plane: [end[axes[0]], end[axes[1]]],
            third: end[axes[2]],
            rest: [end[3], end[4], end[5], end[6], end[7], end[8]],
        }
    }
}

impl<S: Sink> Interp<'_, S> {
    /// G2, G3.
    pub(crate) fn convert_arc(&mut self, g: i16) -> Res {
        let plane = self.m.plane();
        self.check_arc_start(plane)?;
        let offset = self.arc_offsets(plane)?;
        let end = self.find_ends()?;
        self.m.motion = i32::from(g);
        let words = ArcWords {
            clockwise: g == 20,
            radius: self.block.get(b'r'),
            offset,
            absolute: self.m.ijk_absolute != 0,
            turns: self.block.get(b'p').map_or(1, |p| p.round_ties_even() as i32),
            plane,
            tolerance: Tolerance::of(self.m.units(), &self.setup.ini),
        };
        let compensated = self.m.side() != Side::Off && self.m.comp_radius != 0.0 && plane != Plane::Yz;
        match (compensated, self.m.comp_first != 0) {
            (false, _) => self.plain_arc(&words, &end),
            (true, true) => self.comp_entry_arc(&words, &end),
            (true, false) => self.comp_arc(&words, &end),
        }
    }

    fn check_arc_start(&mut self, plane: Plane) -> Res {
        if self.m.arc_not_allowed != 0 {
            return Err(Fault::new(code::ARC_NOT_HERE, rs274::ARC_AFTER_COMP)
                .arg("the first move after G40 must be straight"));
        }
        if !matches!(plane, Plane::Xy | Plane::Xz | Plane::Yz) {
            return Err(Fault::new(code::ARC_NOT_HERE, rs274::ARC_PLANE_UVW)
                .arg("the working plane is one of the U, V, W axes"));
        }
        let ijk = self.block.has_any(b"ijk");
        if !self.block.has(b'r') && !ijk {
            return Err(Fault::new(code::ARC_CENTRE_WORDS, rs274::ARC_NO_CENTRE));
        }
        if self.block.has(b'r') && ijk {
            return Err(Fault::new(code::ARC_CENTRE_WORDS, rs274::ARC_MIXED).at(b'r'));
        }
        self.check_cutting_feed(rs274::ARC_ZERO_FEED, rs274::ARC_NO_F)
    }

    /// Feed for an arc or a spline.
    pub(crate) fn check_cutting_feed(&self, zero: gr_spec::Rs274, no_f: gr_spec::Rs274) -> Res {
        match self.m.feed_mode {
            1 => {
                if !self.block.has(b'f') {
                    return Err(Fault::new(code::ARC_NO_FEED, no_f).arg("inverse time (G93) needs an F in every block"));
                }
            }
            mode => {
                if self.m.feed == 0.0 {
                    return Err(Fault::new(code::ARC_NO_FEED, zero).arg("the feed is zero"));
                }
                if mode == 2 && self.m.speed[self.m.active_spindle.clamp(0, 7) as usize] == 0.0 {
                    return Err(Fault::new(code::ARC_NO_FEED, rs274::ARC_ZERO_SPEED)
                        .arg("the spindle speed is zero in feed per revolution (G95)"));
                }
            }
        }
        Ok(())
    }

    /// I, J, K of the plane, in the order of its axes; checks for the R form that an end is given.
    fn arc_offsets(&self, plane: Plane) -> Res<[f64; 2]> {
        let b = &self.block;
        // In the order in which the controller asks; the third is the letter that does not belong here.
        let (letters, alien, alien_text) = match plane {
            Plane::Xy => ([b'i', b'j'], b'k', rs274::ARC_K_XY),
            Plane::Yz => ([b'j', b'k'], b'i', rs274::ARC_I_YZ),
            _ => ([b'i', b'k'], b'j', rs274::ARC_J_XZ),
        };
        if !b.has_any(b"ijk") {
            self.check_arc_end(plane)?;
            return Ok([0.0, 0.0]);
        }
        if b.has(alien) {
            return Err(Fault::new(code::ARC_CENTRE_WORDS, alien_text).at(alien));
        }
        if let Some(missing) = letters.iter().find(|l| !b.has(**l))
            && self.m.ijk_absolute != 0
        {
            return Err(Fault::new(code::ARC_CENTRE_WORDS, rs274::ARC_ABSOLUTE_CENTRE)
                .arg((*missing as char).to_ascii_uppercase()));
        }
        let [first, second] = letters.map(|l| b.or_zero(l));
        Ok(if plane == Plane::Xz { [second, first] } else { [first, second] })
    }

    fn check_arc_end(&self, plane: Plane) -> Res {
        let (letters, text): (&[u8], _) = match plane {
            Plane::Xy => (b"xy@^", rs274::ARC_END_XY),
            Plane::Yz => (b"yz", rs274::ARC_END_YZ),
            _ => (b"xz", rs274::ARC_END_XZ),
        };
        if self.block.has_any(letters) { Ok(()) } else { Err(Fault::new(code::ARC_END_MISSING, text)) }
    }

    fn plain_arc(&mut self, words: &ArcWords, end: &Axes) -> Res {
        let axes = plane_axes(words.plane);
        let from = PlaneEnd::of(&self.m.current, axes);
        let to = PlaneEnd::of(end, axes);
        let centre = words.centre(from.plane, to.plane)?;
        self.inverse_time_arc(&from, centre, &to);
        self.emit(Call::ArcFeed {
            first_end: to.plane[0],
            second_end: to.plane[1],
            first_axis: centre.at[0],
            second_axis: centre.at[1],
            rotation: centre.turn,
            axis_end: to.third,
            rest: to.rest,
        });
        self.m.current = *end;
        Ok(())
    }

    /// G93: the feed that makes this arc take 1/F minutes.
    pub(crate) fn inverse_time_arc(&mut self, from: &PlaneEnd, centre: Centre, to: &PlaneEnd) {
        if self.m.feed_mode != 1 {
            return;
        }
        let radius = libm::hypot(centre.at[0] - from.plane[0], centre.at[1] - from.plane[1]);
        let angle = sweep(from.plane, centre.at, centre.turn, to.plane);
        let length = if to.third == from.third {
            radius * angle.abs()
        } else {
            libm::hypot(radius * angle, to.third - from.third)
        };
        let wanted = length * self.block.or_zero(b'f');
        let rate = if 0.1 < wanted { wanted } else { 0.1 };
        self.emit_queued(Call::SetFeedRate(rate));
        self.m.feed = rate;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(clockwise: bool, radius: Option<f64>, offset: [f64; 2]) -> ArcWords {
        let tolerance = Tolerance::of(Units::Mm, &Ini::default());
        ArcWords { clockwise, radius, offset, absolute: false, turns: 1, plane: Plane::Xy, tolerance }
    }

    #[test]
    fn short_and_long_arc_by_radius() {
        let short = words(true, Some(10.0), [0.0; 2]).centre([0.0, 0.0], [10.0, 10.0]).expect("fits");
        let long = words(true, Some(-10.0), [0.0; 2]).centre([0.0, 0.0], [10.0, 10.0]).expect("fits");
        assert!((short.at[0] - 10.0).abs() < 1e-9 && short.at[1].abs() < 1e-9);
        assert!(long.at[0].abs() < 1e-9 && (long.at[1] - 10.0).abs() < 1e-9);
    }

    #[test]
    fn sweep_counts_turns() {
        let quarter = std::f64::consts::FRAC_PI_2;
        assert!((sweep([1.0, 0.0], [0.0, 0.0], 1, [0.0, 1.0]) - quarter).abs() < 1e-12);
        assert!((sweep([1.0, 0.0], [0.0, 0.0], -1, [0.0, 1.0]) + 3.0 * quarter).abs() < 1e-12);
        assert!((sweep([1.0, 0.0], [0.0, 0.0], 2, [0.0, 1.0]) - 5.0 * quarter).abs() < 1e-12);
    }

    #[test]
    fn printf_general_format() {
        for (v, text) in [(0.0123456, "0.01235"), (1.0, "1"), (123456.0, "1.235e+05"), (0.00001, "1e-05"), (12.5, "12.5")] {
            assert_eq!(general(v, 4), text);
        }
    }
}
