//! Cutter radius compensation: the path of the tool centre beside the programmed contour.
//!
//! All geometry here is in the working plane (X, Y in G17; Z, X in G18), third axis and the others are carried
//! along. A move stays in the queue until the next one shows what kind of corner is between them: at an outside
//! corner an arc around the corner joins them, at an inside corner both end where the tool touches both sides.

use gr_canon::{Axes, Call, Plane, Sink};
use gr_spec::{code, rs274};

use crate::arc::{ArcWords, Centre, PlaneEnd, sweep};
use crate::queue::{ArcMove, Front, Line, plane_axes};
use crate::wide::{self, HALF_PI, PI, TWO_PI};
use crate::{Fault, Interp, Res, Side};

/// Below this angle (radians) a corner counts as none.
const SMALL: f64 = 0.05;

/// Whether the tool runs inside the arc.
fn inside(side: Side, turn: i32) -> bool {
    (side == Side::Left && turn > 0) || (side == Side::Right && turn < 0)
}

fn polar(centre: [f64; 2], radius: f64, angle: f64) -> [f64; 2] {
    [centre[0] + radius * libm::cos(angle), centre[1] + radius * libm::sin(angle)]
}

fn direction(from: [f64; 2], to: [f64; 2]) -> f64 {
    libm::atan2(to[1] - from[1], to[0] - from[0])
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    libm::hypot(b[0] - a[0], b[1] - a[1])
}

fn gouge(text: gr_spec::Rs274) -> Box<Fault> {
    Fault::new(code::COMP_GOUGE, text)
}

/// `l` as a sine or cosine; beyond ±1 the tool can't touch both sides.
fn ratio(l: f64, text: gr_spec::Rs274) -> Res<f64> {
    if l.abs() > 1.0 { Err(gouge(text)) } else { Ok(l) }
}

/// Centre of the tool where it touches a straight side of direction `heading` that begins at `corner`, and the
/// compensated arc `before`.
fn corner_arc_line(before: &ArcMove, corner: [f64; 2], heading: f64, side: Side, radius: f64) -> Res<[f64; 2]> {
    let text = rs274::COMP_ARC_STRAIGHT;
    let arc_radius = distance(before.end, before.centre);
    let ccw = before.turn > 0;
    let is_inside = inside(side, before.turn);
    let normal = if ccw { wide::plus(heading, HALF_PI) } else { wide::minus(heading, HALF_PI) };
    let to_centre = direction(corner, before.centre);
    let programmed = if is_inside { arc_radius + radius } else { arc_radius - radius };
    let d = programmed * libm::cos(normal - to_centre);
    let d = if is_inside { d - radius } else { d + radius };
    let opening = libm::acos(ratio(d / arc_radius, text)?);
    let signed = if is_inside == ccw { -opening } else { opening };
    Ok(polar(before.centre, arc_radius, wide::plus(signed + normal, PI)))
}

/// Centre of the tool where it touches the compensated arc `before` and the programmed arc around `centre`.
fn corner_arc_arc(before: &ArcMove, centre: Centre, arc_radius: f64, side: Side, radius: f64) -> Res<[f64; 2]> {
    let old = distance(before.end, before.centre);
    let new = if inside(side, centre.turn) { arc_radius - radius } else { arc_radius + radius };
    let between = distance(before.centre, centre.at);
    if old == 0.0 || between == 0.0 {
        return Err(gouge(rs274::COMP_SAME_CENTRE));
    }
    let a = (old * old + between * between - new * new) / (2.0 * old * between);
    let back = libm::acos(ratio(a, rs274::COMP_ARC_ARC)?);
    let line = direction(before.centre, centre.at);
    let forward = inside(side, before.turn) == (centre.turn > 0);
    Ok(polar(before.centre, old, if forward { line + back } else { line - back }))
}

/// Centre of the tool where it touches a straight side and the programmed arc that follows.
fn corner_line_arc(heading: f64, beta: f64, centre: Centre, arc_radius: f64, side: Side, radius: f64) -> Res<[f64; 2]> {
    let across = arc_radius * libm::sin(wide::minus(beta, HALF_PI));
    let ccw = centre.turn > 0;
    let (from_centre, angle) = if inside(side, centre.turn) {
        let from_centre = arc_radius - radius;
        let swing = libm::asin(ratio((across + radius) / from_centre, rs274::COMP_CORNER_ARC)?);
        (from_centre, if ccw { heading + swing } else { heading - swing })
    } else {
        let from_centre = arc_radius + radius;
        let swing = libm::asin(ratio((across - radius) / from_centre, rs274::COMP_CORNER_ARC)?);
        (from_centre, wide::plus2(heading, PI, if ccw { -swing } else { swing }))
    };
    Ok(polar(centre.at, from_centre, angle))
}

/// What happens between two compensated moves.
enum Corner {
    Inside,
    Outside,
    Smooth,
}

/// Everything a compensated move needs to know of its start.
#[derive(Clone, Copy)]
struct Beside {
    plane: Plane,
    side: Side,
    radius: f64,
    /// Tool centre.
    current: PlaneEnd,
    /// Programmed point.
    programmed: [f64; 2],
    programmed_third: f64,
}

impl<S: Sink> Interp<'_, S> {
    fn beside(&self) -> Beside {
        let plane = self.m.plane();
        let axes = plane_axes(plane);
        let program = self.m.program;
        let at = |i: usize| program.get(axes[i]).copied().unwrap_or(0.0);
        Beside {
            plane,
            side: self.m.side(),
            radius: self.m.comp_radius,
            current: PlaneEnd::of(&self.m.current, axes),
            programmed: [at(0), at(1)],
            programmed_third: at(2),
        }
    }

    /// After a compensated move: tool centre, programmed point, the other axes.
    fn comp_moved(&mut self, plane: Plane, centre: [f64; 2], programmed: [f64; 2], end: &PlaneEnd) {
        let axes = plane_axes(plane);
        for (axis, value) in axes.into_iter().zip([centre[0], centre[1], end.third]) {
            self.m.current[axis] = value;
        }
        self.m.current[3..].copy_from_slice(&end.rest);
        for (axis, value) in axes.into_iter().zip([programmed[0], programmed[1], end.third]) {
            if let Some(p) = self.m.program.get_mut(axis) {
                *p = value;
            }
        }
    }

    fn hold_line(&mut self, plane: Plane, rapid: bool, dir: [f64; 2], at: [f64; 2], third: f64, rest: [f64; 6]) {
        let axes = plane_axes(plane);
        let mut end = [0.0; 9];
        end[axes[0]] = at[0];
        end[axes[1]] = at[1];
        end[axes[2]] = third;
        end[3..].copy_from_slice(&rest);
        self.queue.push_line(Line { rapid, dir, end }, self.place);
    }

    /// First straight move with compensation: brings the tool beside the contour.
    pub(crate) fn convert_straight_comp1(&mut self, g: i16, end: Axes) -> Res {
        let b = self.beside();
        let to = PlaneEnd::of(&end, plane_axes(b.plane));
        if distance(b.current.plane, to.plane) <= b.radius {
            return Err(Fault::new(code::COMP_ENTRY_TOO_SHORT, rs274::COMP_ENTRY_SHORT));
        }
        let heading = direction(b.current.plane, to.plane);
        let across =
            if b.side == Side::Left { wide::plus(heading, HALF_PI) } else { wide::minus(heading, HALF_PI) };
        let centre = polar(to.plane, b.radius, across);
        self.queue.set_start(b.current.plane);
        check_straight(g)?;
        let dir = [libm::cos(across), libm::sin(across)];
        self.hold_line(b.plane, g == 0, dir, centre, to.third, to.rest);
        self.m.comp_first = 0;
        self.comp_moved(b.plane, centre, to.plane, &to);
        Ok(())
    }

    /// Every further straight move with compensation.
    pub(crate) fn convert_straight_comp2(&mut self, g: i16, end: Axes) -> Res {
        let b = self.beside();
        let to = PlaneEnd::of(&end, plane_axes(b.plane));
        let dir = [to.plane[0] - b.programmed[0], to.plane[1] - b.programmed[1]];
        if to.plane == b.programmed {
            check_straight(g)?;
            self.hold_line(b.plane, g == 0, dir, b.current.plane, to.third, to.rest);
            self.comp_moved(b.plane, b.current.plane, to.plane, &to);
            return Ok(());
        }
        let mut theta = direction(b.programmed, b.current.plane);
        let mut heading = direction(b.programmed, to.plane);
        let (beta, across) = if b.side == Side::Left {
            if theta < heading {
                theta = wide::plus(theta, TWO_PI);
            }
            (wide::minus(theta - heading, HALF_PI), std::f64::consts::FRAC_PI_2)
        } else {
            if heading < theta {
                heading = wide::plus(heading, TWO_PI);
            }
            (wide::minus(heading - theta, HALF_PI), -std::f64::consts::FRAC_PI_2)
        };
        let centre = polar(to.plane, b.radius, heading + across);
        match self.straight_corner(beta, b.side) {
            Corner::Outside => self.round_corner(g, &b, heading + across, &to)?,
            Corner::Inside => {
                let touch = self.straight_inside(&b, &to, beta, theta + across)?;
                self.end_queued_at(touch)?;
            }
            Corner::Smooth => {
                self.dequeue_all();
                self.queue.set_start(b.current.plane);
            }
        }
        self.hold_line(b.plane, g == 0, dir, centre, to.third, to.rest);
        self.comp_moved(b.plane, centre, to.plane, &to);
        Ok(())
    }

    fn straight_corner(&self, beta: f64, side: Side) -> Corner {
        let pi = std::f64::consts::PI;
        if beta < -SMALL || beta > pi + SMALL {
            return Corner::Inside;
        }
        // A move that turns back on an arc the tool runs outside of.
        let after_outer_arc = || match self.queue.front() {
            Front::Arc(arc) if !self.queue.is_empty() => arc.turn != 0 && !inside(side, arc.turn),
            _ => false,
        };
        if beta > pi - SMALL && after_outer_arc() {
            Corner::Inside
        } else if beta > SMALL {
            Corner::Outside
        } else {
            Corner::Smooth
        }
    }

    fn straight_inside(&self, b: &Beside, to: &PlaneEnd, beta: f64, along: f64) -> Res<[f64; 2]> {
        if let Front::Arc(before) = self.queue.front() {
            return corner_arc_line(&before, b.programmed, direction(b.programmed, to.plane), b.side, b.radius);
        }
        let half = wide::plus(beta, PI) / 2.0;
        if half == 0.0 {
            return Err(gouge(rs274::COMP_ZERO_CORNER));
        }
        Ok(polar(b.current.plane, b.radius / libm::tan(half), along))
    }

    /// Outside corner before a straight move: an arc around it, or with G0 a straight short cut.
    fn round_corner(&mut self, g: i16, b: &Beside, across: f64, to: &PlaneEnd) -> Res {
        let beyond = polar(b.programmed, b.radius, across);
        self.end_queued_at(b.current.plane)?;
        check_straight(g)?;
        if g == 0 {
            self.hold_line(b.plane, true, [0.0, 0.0], beyond, b.current.third, to.rest);
        } else {
            self.hold_corner(b, beyond, to.rest);
        }
        self.dequeue_all();
        self.queue.set_start(beyond);
        Ok(())
    }

    fn hold_corner(&mut self, b: &Beside, beyond: [f64; 2], rest: [f64; 6]) {
        let turn = if b.side == Side::Left { -1 } else { 1 };
        let arc = ArcMove { sweep: 0.0, end: beyond, centre: b.programmed, turn, third: b.current.third, rest };
        self.queue.push_arc(arc, self.place);
    }

    /// First move with compensation is an arc: from the present point to the point beside the programmed end.
    pub(crate) fn comp_entry_arc(&mut self, words: &ArcWords, end: &Axes) -> Res {
        let b = self.beside();
        let to = PlaneEnd::of(end, plane_axes(b.plane));
        let from = b.current;
        if distance(from.plane, to.plane) <= b.radius {
            return Err(Fault::new(code::COMP_ENTRY_TOO_SHORT, rs274::COMP_ENTRY_ARC_SHORT));
        }
        let too_large = || Fault::new(code::COMP_TOOL_TOO_LARGE, rs274::COMP_TOOL_RADIUS);
        let runs_inside = inside(b.side, if words.clockwise { -1 } else { 1 });
        if words.radius.is_some_and(|r| r.abs() <= b.radius) && runs_inside {
            return Err(too_large());
        }
        let programmed = words.centre(from.plane, to.plane)?;
        let arc_radius = distance(programmed.at, from.plane);
        if words.radius.is_none() && arc_radius <= b.radius && runs_inside {
            return Err(too_large());
        }
        self.inverse_time_arc(&from, programmed, &to);
        let gamma = if inside(b.side, programmed.turn) {
            direction(to.plane, programmed.at)
        } else {
            direction(programmed.at, to.plane)
        };
        self.m.comp_first = 0;
        let target = polar(to.plane, b.radius, gamma);
        let centre = self.entry_centre(from.plane, target, programmed, words).inspect_err(|_| {
            self.set_programmed(b.plane, &to);
        })?;
        if !matches!(self.m.comp_orientation, 0 | 9) {
            self.hold_line(b.plane, false, [0.0, 0.0], from.plane, from.third, to.rest);
            self.queue.set_start(from.plane);
        }
        let arc = ArcMove {
            sweep: sweep(from.plane, centre, programmed.turn, target),
            end: target,
            centre,
            turn: programmed.turn,
            third: to.third,
            rest: to.rest,
        };
        self.queue.push_arc(arc, self.place);
        self.comp_moved(b.plane, target, to.plane, &to);
        Ok(())
    }

    fn set_programmed(&mut self, plane: Plane, to: &PlaneEnd) {
        for (axis, value) in plane_axes(plane).into_iter().zip([to.plane[0], to.plane[1], to.third]) {
            if let Some(p) = self.m.program.get_mut(axis) {
                *p = value;
            }
        }
    }

    /// Centre of the entry arc: on the line from the target to the programmed centre, as far from `from` as
    /// from `target`.
    fn entry_centre(&self, from: [f64; 2], target: [f64; 2], programmed: Centre, words: &ArcWords) -> Res<[f64; 2]> {
        let half = distance(target, from) / 2.0;
        let line = direction(target, programmed.at);
        let angle = direction(target, from) - line;
        if libm::cos(angle).abs() < 0.0001 {
            return Err(Fault::new(code::COMP_TOOL_TOO_LARGE, rs274::COMP_TOOL_RADIUS));
        }
        let centre = polar(target, half / libm::cos(angle), line);
        if (distance(target, centre) - distance(from, centre)).abs() > words.tolerance.spiral {
            return Err(gouge(rs274::COMP_BUG));
        }
        Ok(centre)
    }

    /// Every further arc with compensation.
    pub(crate) fn comp_arc(&mut self, words: &ArcWords, end: &Axes) -> Res {
        let b = self.beside();
        let to = PlaneEnd::of(end, plane_axes(b.plane));
        let from = PlaneEnd { plane: b.programmed, third: b.programmed_third, rest: b.current.rest };
        let centre = words.centre(from.plane, to.plane)?;
        self.inverse_time_arc(&from, centre, &to);
        let arc_radius = distance(to.plane, centre.at);
        let theta = direction(b.programmed, b.current.plane);
        let theta =
            if b.side == Side::Left { wide::minus(theta, HALF_PI) } else { wide::plus(theta, HALF_PI) };
        let mut delta = direction(b.programmed, centre.at);
        let alpha = if words.clockwise { wide::plus(delta, HALF_PI) } else { wide::minus(delta, HALF_PI) };
        let beta = corner_angle(if b.side == Side::Left { theta - alpha } else { alpha - theta });
        let gamma = if inside(b.side, if words.clockwise { -1 } else { 1 }) {
            if arc_radius <= b.radius {
                return Err(Fault::new(code::COMP_TOOL_TOO_LARGE, rs274::COMP_TOOL_RADIUS));
            }
            direction(to.plane, centre.at)
        } else {
            delta = wide::plus(delta, PI);
            direction(centre.at, to.plane)
        };
        let target = polar(to.plane, b.radius, gamma);
        let pi = std::f64::consts::PI;
        let turned_back = (beta - pi).abs() < SMALL && !inside(b.side, centre.turn);
        if beta < -SMALL || beta > pi + SMALL || turned_back {
            let touch = match self.queue.front() {
                Front::Arc(before) => corner_arc_arc(&before, centre, arc_radius, b.side, b.radius)?,
                Front::NotArc => corner_line_arc(theta, beta, centre, arc_radius, b.side, b.radius)?,
            };
            self.end_queued_at(touch)?;
        } else if beta > SMALL {
            let beyond = polar(b.programmed, b.radius, delta);
            self.dequeue_all();
            self.hold_corner(&b, beyond, to.rest);
            self.dequeue_all();
            self.queue.set_start(beyond);
        } else {
            self.dequeue_all();
            self.queue.set_start(b.current.plane);
        }
        let arc = ArcMove {
            sweep: sweep(b.programmed, centre.at, centre.turn, to.plane),
            end: target,
            centre: centre.at,
            turn: centre.turn,
            third: to.third,
            rest: to.rest,
        };
        self.queue.push_arc(arc, self.place);
        self.comp_moved(b.plane, target, to.plane, &to);
        Ok(())
    }

    /// G41, G42, G41.1, G42.1.
    pub(crate) fn comp_on(&mut self, g: i16) -> Res {
        let plane = self.m.plane();
        if !matches!(plane, Plane::Xy | Plane::Xz) {
            return Err(Fault::new(code::COMP_NOT_HERE, rs274::COMP_PLANE).arg(format!("the plane is {}, it must be G17 or G18", plane.code())));
        }
        let twice = self.m.side() != Side::Off;
        if twice && !self.is_fanuc() {
            return Err(Fault::new(code::COMP_NOT_HERE, rs274::COMP_TWICE).arg("it is on already"));
        }
        let (radius, orientation) =
            if g % 10 == 1 { self.comp_from_words(g, plane)? } else { self.comp_from_tool(g, plane)? };
        let right = (g / 10 == 42) != (radius < 0.0);
        if twice {
            // A Fanuc control may be told again what is in force; another side or radius needs a corner of its own.
            let same = right == (self.m.side() == Side::Right) && radius.abs() == self.m.comp_radius;
            let on = if same { Ok(()) } else { Err("it is on already, with another side or radius") };
            return on.map_err(|why| Fault::new(code::COMP_NOT_HERE, rs274::COMP_TWICE).arg(why));
        }
        self.emit_queued(Call::Comment(
            format!("interpreter: cutter radius compensation on {}", if right { "right" } else { "left" }).into(),
        ));
        self.m.comp_radius = radius.abs();
        self.m.comp_orientation = orientation;
        self.m.comp_side = if right { Side::Right } else { Side::Left } as u8;
        Ok(())
    }

    fn comp_from_words(&self, g: i16, plane: Plane) -> Res<(f64, i32)> {
        let Some(diameter) = self.block.get(b'd') else {
            return Err(Fault::new(code::COMP_TOOL_WORD, rs274::COMP_NO_D).arg("D is missing").arg(g / 10));
        };
        let Some(orientation) = self.block.get(b'l') else {
            return Ok((diameter / 2.0, 0));
        };
        if plane != Plane::Xz {
            return Err(Fault::new(code::COMP_NOT_HERE, rs274::COMP_L_PLANE)
                .arg("an orientation (L) needs G18")
                .arg(g / 10)
                .at(b'l'));
        }
        Ok((diameter / 2.0, orientation as i32))
    }

    fn comp_from_tool(&self, g: i16, plane: Plane) -> Res<(f64, i32)> {
        let tools = &self.tools;
        let row = match self.block.get(b'd') {
            None => tools.get(0),
            Some(d) => {
                let number = radius_number(d, g)?;
                // On a Fanuc control offset number 0 is no offset.
                if number == 0 && self.is_fanuc() {
                    return Ok((0.0, 0));
                }
                // The spindle's row counts last.
                let spindle = || tools.get(0).filter(|t| number == 0 || t.number == number);
                let found = tools.pockets().iter().find(|t| number != 0 && t.number == number).or_else(spindle);
                if found.is_none() && number != 0 {
                    return Err(Fault::new(code::COMP_TOOL_WORD, rs274::COMP_D_UNKNOWN)
                        .arg(format!("tool {number} is not in the tool table"))
                        .arg(number)
                        .at(b'd'));
                }
                found
            }
        };
        let (diameter, orientation) = row.map_or((0.0, 0), |t| (t.diameter, t.orientation));
        if plane != Plane::Xz && !matches!(orientation, 0 | 9) {
            return Err(Fault::new(code::COMP_NOT_HERE, rs274::COMP_LATHE_PLANE)
                .arg("a lathe tool needs G18")
                .arg(g / 10));
        }
        Ok((self.program_length(diameter) / 2.0, orientation))
    }

    /// G40.
    pub(crate) fn comp_off(&mut self) -> Res {
        self.emit_queued(Call::Comment("interpreter: cutter radius compensation off".into()));
        if self.m.side() != Side::Off && self.m.comp_radius > 0.0 && self.m.comp_first == 0 {
            let centre = self.beside().current.plane;
            self.end_queued_at(centre)?;
            self.dequeue_all();
            self.m.current[..3].copy_from_slice(&self.m.program);
            self.m.arc_not_allowed = 1;
        }
        self.queue.forget_front();
        self.m.comp_side = Side::Off as u8;
        self.m.comp_first = 1;
        Ok(())
    }
}

/// Angle between the end of the last move and the beginning of an arc, within −π/2 … 3π/2.
fn corner_angle(beta: f64) -> f64 {
    if beta > 1.5 * std::f64::consts::PI {
        wide::minus(beta, TWO_PI)
    } else if beta < -std::f64::consts::FRAC_PI_2 {
        wide::plus(beta, TWO_PI)
    } else {
        beta
    }
}

/// The number that a D word of G41 or G42 names.
pub(crate) fn radius_number(d: f64, g: i16) -> Res<i32> {
    let number = (d + 0.5) as i32;
    if (f64::from(number) - d).abs() >= 0.0001 {
        return Err(Fault::new(code::COMP_TOOL_WORD, rs274::COMP_D_INTEGER)
            .arg("D is the number of a tool, a whole number")
            .arg(g / 10)
            .at(b'd'));
    }
    if number < 0 {
        return Err(Fault::new(code::COMP_TOOL_WORD, rs274::COMP_D_NEGATIVE).arg("D is negative").at(b'd'));
    }
    Ok(number)
}

/// Only G0 and G1 know how to go beside a contour.
fn check_straight(g: i16) -> Res {
    if g == 0 || g == 10 {
        return Ok(());
    }
    Err(Fault::new(code::COMP_NOT_HERE, rs274::COMP_MOTION).arg("only G0, G1, G2 and G3 can be compensated"))
}
