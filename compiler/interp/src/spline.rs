//! Splines: G5 (cubic), G5.1 (quadratic), G5.2 … G5.3 (NURBS) and 2.10's G6, G6.1 (the same as G5 and G5.1) and G6.2
//! (NURBS with knots), all sent as NURBS with their control points.

use gr_canon::{Call, Nurbs, Plane, Sink, Version};
use gr_spec::{Rs274, code, rs274};

use crate::{Fault, Interp, Res};

/// The highest order of a spline that is worked out, as in the motion IR. The real controller names no limit; programs
/// have orders of 3 to 6.
const MAX_ORDER: u32 = 64;

fn check_order(order: u32) -> Res {
    if order > MAX_ORDER {
        let what = format!("the order of this spline, {order}, is over {MAX_ORDER}");
        return Err(Fault::own(code::RUN_ENDLESS).arg(what));
    }
    Ok(())
}

fn words(text: Rs274, why: &str) -> Box<Fault> {
    Fault::new(code::SPLINE_WORDS, text).arg(why)
}

impl<S: Sink> Interp<'_, S> {
    /// G5, G5.1, G5.2, G5.3, G6, G6.1, G6.2.
    pub(crate) fn convert_spline(&mut self, g: i16) -> Res {
        match g {
            52 => self.nurbs_point(),
            53 => self.nurbs_end(),
            62 => self.knotted_point(),
            63 => Ok(()), // 2.10 knows the code and does nothing: the knots end the curve.
            _ => {
                self.check_spline()?;
                self.inverse_time_spline();
                if matches!(g, 51 | 61) { self.quadratic_spline() } else { self.cubic_spline() }
            }
        }
    }

    fn check_spline(&self) -> Res {
        if self.m.comp_side != 0 {
            return Err(words(rs274::SPLINE_COMP, "cutter compensation is on"));
        }
        // Feed per revolution is not looked at.
        if self.m.feed_mode != 2 {
            self.check_cutting_feed(rs274::ARC_ZERO_FEED, rs274::ARC_NO_F)?;
        }
        if self.setup.version == Version::V2_10 {
            if self.block.has_any(b"abc") {
                return Err(words(rs274::SPLINE_ROTARY, "it can't move A, B or C"));
            }
            return Ok(());
        }
        if self.m.plane() != Plane::Xy {
            return Err(words(rs274::SPLINE_PLANE, "the plane is not G17"));
        }
        if self.block.has_any(b"zabc") {
            return Err(words(rs274::SPLINE_AXES, "it can't move Z, A, B or C"));
        }
        Ok(())
    }

    /// G93: no feed is made of F and the length of a spline.
    fn inverse_time_spline(&mut self) {
        if self.m.feed_mode == 1 {
            let what = if self.m.feed == 0.0 { "no feed is in force, and the machine does not move".into() } else { format!("the feed in force, F{}, stays", (self.m.feed * 1e4).round() / 1e4) };
            self.warn(Fault::own(code::SPLINE_INVERSE_TIME).at(b'f').arg(what));
        }
    }

    /// First and second axis of the plane of splines: 2.9 knows XY only; 2.10 has (Y, Z) and (Z, X) too.
    fn spline_axes(&self) -> [usize; 2] {
        match self.m.plane() {
            Plane::Yz if self.setup.version == Version::V2_10 => [1, 2],
            Plane::Xz if self.setup.version == Version::V2_10 => [2, 0],
            _ => [0, 1],
        }
    }

    fn spline_plane(&self) -> Plane {
        match self.spline_axes() {
            [1, 2] => Plane::Yz,
            [2, 0] => Plane::Xz,
            _ => Plane::Xy,
        }
    }

    /// I and J belong to X and Z in the XZ plane, in this order.
    fn spline_offset(&self, i: f64, j: f64) -> [f64; 2] {
        if self.spline_plane() == Plane::Xz { [j, i] } else { [i, j] }
    }

    fn send_spline(&mut self, order: u32, points: &[[f64; 2]]) {
        // Points of a G5.2 that no G5.3 has ended are still in the controller's list.
        let mut all = std::mem::take(&mut self.queue.spline.points);
        all.extend(points.iter().map(|p| [p[0], p[1], 1.0]));
        let points = all;
        self.emit(Call::NurbsFeed(Box::new(Nurbs { order, points, plane: self.spline_plane(), knots: Vec::new() })));
    }

    fn quadratic_spline(&mut self) -> Res {
        let (Some(i), Some(j)) = (self.block.get(b'i'), self.block.get(b'j')) else {
            let new = self.setup.version == Version::V2_10;
            return Err(words(if new { rs274::SPLINE_NO_IJ_G6 } else { rs274::SPLINE_NO_IJ }, "I or J is missing"));
        };
        let [first, second] = self.spline_axes();
        let start = [self.m.current[first], self.m.current[second]];
        let ends = self.find_ends()?;
        let (end, by) = ([ends[first], ends[second]], self.spline_offset(i, j));
        self.send_spline(3, &[start, [start[0] + by[0], start[1] + by[1]], end]);
        [self.m.current[first], self.m.current[second]] = end;
        Ok(())
    }

    fn cubic_spline(&mut self) -> Res {
        let [one, two] = self.spline_axes();
        let start = [self.m.current[one], self.m.current[two]];
        let [i, j] = self.spline_tangent(start)?;
        let tangent = self.spline_offset(i, j);
        let ends = self.find_ends()?;
        let end = [ends[one], ends[two]];
        let (Some(p), Some(q)) = (self.block.get(b'p'), self.block.get(b'q')) else {
            return Err(words(rs274::SPLINE_NO_PQ, "P or Q is missing"));
        };
        let first = [start[0] + tangent[0], start[1] + tangent[1]];
        self.send_spline(4, &[start, first, [end[0] + p, end[1] + q], end]);
        (self.m.cycle_i, self.m.cycle_j) = (-p, -q);
        self.m.spline_tail = end;
        [self.m.current[one], self.m.current[two]] = end;
        Ok(())
    }

    /// I and J, or what the last G5 left.
    fn spline_tangent(&mut self, start: [f64; 2]) -> Res<[f64; 2]> {
        match (self.block.get(b'i'), self.block.get(b'j')) {
            (Some(i), Some(j)) => Ok([i, j]),
            (None, None) => {
                let kept = [self.m.cycle_i, self.m.cycle_j];
                if start != self.m.spline_tail || kept == [0.0, 0.0] {
                    self.warn(Fault::own(code::SPLINE_NO_FIRST_TANGENT).arg(kept[0]).arg(kept[1]));
                }
                Ok(kept)
            }
            _ => Err(words(rs274::SPLINE_ONE_OF_IJ, "I or J is missing")),
        }
    }

    /// G5.2: one more control point.
    fn nurbs_point(&mut self) -> Res {
        let [one, two] = self.spline_axes();
        let (x, y) = (self.block.has(b"xyz"[one]), self.block.has(b"xyz"[two]));
        let weight = self.block.get(b'p').unwrap_or(-1.0);
        let begun = !self.queue.spline.points.is_empty();
        let texts = match self.spline_plane() {
            Plane::Yz => [rs274::NURBS_ONE_AXIS_YZ, rs274::NURBS_P_ALONE_YZ],
            Plane::Xz => [rs274::NURBS_ONE_AXIS_XZ, rs274::NURBS_P_ALONE_XZ],
            _ => [rs274::NURBS_ONE_AXIS, rs274::NURBS_P_ALONE],
        };
        if x != y {
            return Err(words(texts[0], "one axis of the plane is missing"));
        }
        if !x && weight > 0.0 && begun {
            return Err(words(texts[1], "P without axes is for the first control point only"));
        }
        if weight <= 0.0 && begun {
            return Err(words(rs274::NURBS_NO_P, "the weight P is missing or not greater than zero"));
        }
        if self.m.feed_mode == 0 && self.m.feed == 0.0 {
            return Err(Fault::new(code::ARC_NO_FEED, rs274::NURBS_ZERO_FEED).arg("the feed is zero"));
        }
        if self.m.motion != 52 {
            self.queue.spline.points.clear();
        }
        if self.queue.spline.points.is_empty() {
            let first = if !x && weight > 0.0 { weight } else { 1.0 };
            self.queue.spline.order = 3;
            self.queue.spline.points.push([self.m.current[one], self.m.current[two], first]);
        }
        if let Some(order) = self.block.get(b'l').filter(|l| *l > 3.0) {
            check_order(order as u32)?;
            self.queue.spline.order = order as u32;
        }
        if x {
            let end = self.find_ends()?;
            self.queue.spline.points.push([end[one], end[two], weight]);
        }
        self.m.motion = 52;
        Ok(())
    }

    /// G6.2: one more control point with its knot, or one of the last knots alone. A knot that has come `order` times
    /// ends the curve.
    fn knotted_point(&mut self) -> Res {
        let plane = self.m.plane();
        if !matches!(plane, Plane::Xy | Plane::Yz | Plane::Xz) {
            return Err(words(rs274::NURBS_G6_PLANE, "the plane is none of G17, G18 and G19"));
        }
        let begun = self.m.motion == 62 && !self.queue.spline.knots.is_empty();
        if !begun {
            self.queue.spline = Nurbs::default();
        }
        self.check_knotted(begun)?;
        if let Some(p) = self.block.get(b'p').filter(|p| *p != -1.0) {
            let order = crate::eval::to_int(p).max(0) as u32;
            check_order(order)?;
            self.queue.spline.order = order;
        }
        let [one, two] = self.spline_axes();
        let both = self.block.has(b"xyz"[one]) && self.block.has(b"xyz"[two]);
        if both || self.block.has(b'k') {
            let end = self.find_ends()?;
            // A word that is missing still has the value of an earlier block.
            let last = self.queue.spline.knots.last().copied().unwrap_or(0.0);
            let knot = self.block.get(b'k').unwrap_or(last);
            self.queue.spline.points.push([end[one], end[two], self.block.values[crate::block::slot(b'r')]]);
            self.queue.spline.knots.push(knot);
        }
        self.m.motion = 62;
        let Nurbs { order, knots, .. } = &self.queue.spline;
        let (order, count) = (*order as usize, knots.len());
        if order > 0 && count > order && knots[count - 1] == knots[count - order] {
            self.send_knotted(plane);
        }
        Ok(())
    }

    fn check_knotted(&self, begun: bool) -> Res {
        let b = &self.block;
        let [one, two] = self.spline_axes();
        if b.has(b"xyz"[one]) != b.has(b"xyz"[two]) {
            let text = match self.spline_plane() {
                Plane::Yz => rs274::NURBS_ONE_AXIS_YZ,
                Plane::Xz => rs274::NURBS_ONE_AXIS_XZ,
                _ => rs274::NURBS_ONE_AXIS,
            };
            return Err(words(text, "one axis of the plane is missing"));
        }
        let whole = |letter: u8| b.get(letter).is_none_or(|v| crate::eval::whole(v).is_some());
        let (p, q) = (b.get(b'p'), b.get(b'q').filter(|q| *q != -1.0));
        if !begun && p.is_none() {
            return Err(words(rs274::NURBS_G6_NO_ORDER, "the order P is missing on the first line"));
        }
        if !whole(b'p') {
            return Err(words(rs274::NURBS_G6_ORDER_INTEGER, "the order P is not a whole number"));
        }
        if !begun && q.is_none_or(|q| q <= 0.0) {
            return Err(words(rs274::NURBS_G6_NO_Q, "the kind of interpolation Q (1, 2 or 3) is missing on the first line"));
        }
        if q.is_some_and(|q| !(1.0..=3.0).contains(&q)) {
            return Err(words(rs274::NURBS_G6_Q_RANGE, "the kind of interpolation Q is not 1, 2 or 3"));
        }
        if !whole(b'q') {
            return Err(words(rs274::NURBS_G6_Q_INTEGER, "the kind of interpolation Q is not a whole number"));
        }
        let kept = |letter: u8| b.values[crate::block::slot(letter)];
        if begun && kept(b'r') <= 0.0 {
            return Err(words(rs274::NURBS_G6_WEIGHT, "the weight R is missing or not greater than zero"));
        }
        if begun && kept(b'k') < 0.0 {
            return Err(words(rs274::NURBS_G6_NO_KNOT, "the knot K is missing or below zero"));
        }
        if !whole(b'k') {
            return Err(words(rs274::NURBS_G6_KNOT_INTEGER, "the knot K is not a whole number"));
        }
        if self.m.feed_mode == 0 && self.m.feed == 0.0 {
            return Err(Fault::new(code::ARC_NO_FEED, rs274::NURBS_G6_ZERO_FEED).arg("the feed is zero"));
        }
        Ok(())
    }

    /// Sends the curve. The last `order` lines hold knots only. In every plane the controller takes the first of the
    /// last point's two coordinates for X and the second for Y.
    fn send_knotted(&mut self, plane: Plane) {
        self.inverse_time_spline();
        let mut spline = std::mem::take(&mut self.queue.spline);
        spline.plane = plane;
        if let Some(last) = spline.points.last() {
            (self.m.current[0], self.m.current[1]) = (last[0], last[1]);
        }
        self.emit(Call::NurbsFeed(Box::new(spline)));
        self.m.motion = -1;
    }

    /// G5.3: sends the NURBS.
    fn nurbs_end(&mut self) -> Res {
        if self.m.motion != 52 {
            return Err(words(rs274::NURBS_NOT_BEGUN, "G5.3 without G5.2"));
        }
        let spline = &self.queue.spline;
        if spline.points.len() < spline.order as usize {
            let order = spline.order;
            return Err(words(rs274::NURBS_TOO_FEW, "too few control points").arg(order));
        }
        self.inverse_time_spline();
        let mut spline = std::mem::take(&mut self.queue.spline);
        spline.plane = self.spline_plane();
        if let Some(last) = spline.points.last() {
            let [one, two] = self.spline_axes();
            [self.m.current[one], self.m.current[two]] = [last[0], last[1]];
        }
        self.queue.spline.order = spline.order;
        self.emit(Call::NurbsFeed(Box::new(spline)));
        self.m.motion = -1;
        Ok(())
    }
}
