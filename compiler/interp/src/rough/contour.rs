//! A contour as a whole: turned, offset, trimmed, and cut level by level.

use crate::arc::general;

use super::points::{QUARTER, Zx, min_max};
use super::segment::{Corner, Cut, Segment, Shape, TOLERANCE, Trouble};

/// A contour under way.
#[derive(Clone, Debug, Default)]
pub(crate) struct Contour {
    pub segments: Vec<Segment>,
    /// 1: Z mirrored, 2: X mirrored, 4: turned.
    turned: u8,
    /// Segments that turned round when the contour was moved, as the real `rs274` tells them.
    pub(super) notes: Vec<String>,
}

/// Words of G71, G72.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Roughing {
    /// 0 G71, 1 G71.1 (no pockets), 2 G71.2 (pockets last).
    pub kind: u8,
    pub start: Zx,
    /// Allowance along X and Z.
    pub shift: Zx,
    /// Distance to the contour, cut per pass, retract.
    pub distance: f64,
    pub step: f64,
    pub retract: f64,
    pub facing: bool,
    /// Most moves.
    pub limit: usize,
    /// Goes on to the next piece of the contour when a level has nothing to cut, as 2.10 does.
    pub leaves: bool,
}

impl Contour {
    fn ends(&self) -> Trouble<(&Segment, &Segment)> {
        self.segments.first().zip(self.segments.last()).ok_or_else(|| "Not monotonic".into())
    }

    /// Corner words lose their meaning in a copy.
    fn copy(&self) -> Contour {
        let segments = self.segments.iter().map(Segment::plain).collect();
        Contour { segments, turned: self.turned, notes: Vec::new() }
    }

    fn turn(&mut self) {
        self.segments.iter_mut().for_each(|s| s.map(|p| -p * QUARTER, false));
        self.turned ^= 4;
    }

    /// Mirrors the contour so that it falls in Z and X rises behind it.
    fn face(&mut self) -> Trouble {
        let (first, last) = self.ends()?;
        let (up, back) = ((first.end - last.end).x > 0.0, (first.end - last.end).z < 0.0);
        if up {
            self.segments.iter_mut().for_each(|s| s.map(Zx::mirror, true));
            self.turned ^= 2;
        }
        if back {
            self.segments.iter_mut().for_each(|s| s.map(|p| -p.mirror(), true));
            self.turned ^= 1;
        }
        Ok(())
    }

    /// A cut as it is in the program's frame.
    fn restored(&self, cut: Cut) -> Cut {
        let back = |p: Zx| match self.turned {
            1 => -p.mirror(),
            2 => p.mirror(),
            3 => -p,
            4 => QUARTER * p,
            5 => (QUARTER * p).mirror(),
            6 => -(QUARTER * p).mirror(),
            7 => -QUARTER * p,
            _ => p,
        };
        let mirrored = matches!(self.turned, 1 | 2 | 5 | 6);
        match cut {
            Cut::Approach(p) => Cut::Approach(back(p)),
            Cut::Rapid(p) => Cut::Rapid(back(p)),
            Cut::Line(p) => Cut::Line(back(p)),
            Cut::Arc(ccw, c, p) => Cut::Arc(ccw ^ mirrored, back(c), back(p)),
        }
    }

    fn check_monotonic(&mut self) -> Trouble {
        if let Some(first) = self.segments.first_mut()
            && (first.end - first.start).z > 0.0
        {
            first.start.z = first.end.z;
        }
        if self.segments.iter().all(Segment::monotonic) { Ok(()) } else { Err("Not monotonic".into()) }
    }

    /// Makes fillets and chamfers.
    fn finish_corners(&mut self) -> Trouble {
        for i in 1..self.segments.len().saturating_sub(1) {
            if let [before, corner, after] = &mut self.segments[i - 1..=i + 1]
                && corner.corner != Corner::No
            {
                finish_corner(before, corner, after)?;
            }
        }
        self.segments.retain(|s| !s.vanished());
        Ok(())
    }

    /// Moves the contour sideways by `distance`, in small steps so that short pieces vanish cleanly. The first
    /// segment is the approach and stays.
    fn add_distance(&mut self, distance: f64) -> Trouble {
        let (first, last) = self.ends()?;
        let side = (first.end - first.start).unturned(last.start - first.start).x;
        let distance = if side < 0.0 { -distance } else { distance };
        let mut approach = self.segments.remove(0);
        let mut done = 0.0;
        let mut rounds = 0;
        while done != distance {
            rounds += 1;
            if rounds > 100_000 || self.segments.is_empty() {
                return Err("Not monotonic".into());
            }
            let mut step = self.segments.iter().fold(1e9, |m: f64, s| min_max(m, s.size() / 2.0).0);
            step = min_max(step, (distance - done).abs()).0;
            if distance < 0.0 {
                step = -step;
            }
            self.offset_all(step, distance);
            self.trim()?;
            done += step;
        }
        for i in 1..self.segments.len() {
            let middle = self.segments[i - 1].end.middle(self.segments[i].start);
            self.segments[i - 1].end = middle;
            self.segments[i].start = middle;
        }
        approach.end = self.segments.first().ok_or("Not monotonic")?.start;
        self.segments.insert(0, approach);
        Ok(())
    }

    fn offset_all(&mut self, step: f64, distance: f64) {
        self.segments.iter_mut().for_each(|s| s.offset(step));
        self.segments.retain(|s| !s.vanished());
        let mut i = 0;
        while i + 1 < self.segments.len() {
            let (a, b) = (self.segments[i], self.segments[i + 1]);
            if (a.end - b.start).z > 1e-2 {
                let (mut before, mut after) = (a.plain(), b.plain());
                before.offset(-step);
                after.offset(-step);
                let centre = before.end.middle(after.start);
                self.segments.insert(i + 1, Segment::arc(distance > 0.0, a.end, centre, b.start));
                i += 1;
            }
            i += 1;
        }
    }

    /// Cuts neighbours to their crossings and drops what turned round or vanished.
    fn trim(&mut self) -> Trouble {
        let mut i = 0;
        while i + 1 < self.segments.len() {
            if !self.segments[i].monotonic() {
                if i == 0 {
                    return Err("Not monotonic".into());
                }
                let back = self.segments[i].start - self.segments[i].end;
                self.notes.push(format!("Oops ({},{})", general(back.z, 6), general(back.x, 6)));
                let smaller = self.segments[i].size() < self.segments[i - 1].size();
                self.segments.remove(if smaller { i } else { i - 1 });
                i = 0;
            }
            if i + 1 >= self.segments.len() {
                break;
            }
            if self.segments[i].vanished() {
                self.segments.remove(i);
                i = 0;
            } else if let [a, b] = &mut self.segments[i..=i + 1] {
                a.join(b)?;
            }
            i += 1;
        }
        Ok(())
    }

    /// 2.10: a contour that ends in the stock is led out of it, straight to the level of the start point.
    pub(super) fn close(&mut self, cycle: i16, start: Zx) {
        let Some((first, last)) = self.segments.first().zip(self.segments.last()) else { return };
        let (front, back, end) = (first.end - first.start, last.end - last.start, last.end);
        let out = match cycle {
            71 if back.z != 0.0 && front.x * (start.x - end.x) < 0.0 => Zx::new(end.z, start.x),
            72 if back.x != 0.0 && front.z * (start.z - end.z) < 0.0 => Zx::new(start.z, end.x),
            _ => return,
        };
        self.segments.push(Segment::line(end, out));
    }

    /// G70: along the contour, `passes` times, from distance `far` to `near`.
    pub(crate) fn finish(&mut self, start: Zx, far: f64, near: f64, passes: f64, out: &mut Vec<Cut>) -> Trouble {
        self.segments.first_mut().ok_or("Not monotonic")?.start = start;
        let mut trial = self.copy();
        trial.segments.remove(0);
        trial.face()?;
        if !trial.segments.iter().all(Segment::monotonic) {
            trial.turn();
            trial.face()?;
        }
        trial.check_monotonic()?;
        if trial.turned & 4 != 0 {
            self.turn();
        }
        self.face()?;
        self.finish_corners()?;
        self.check_monotonic()?;
        let mut pass = passes as i32;
        while pass > 0 {
            let distance = f64::from(pass - 1) * (far - near) / passes + near;
            let mut path = self.copy();
            let moved = path.add_distance(distance);
            self.notes.append(&mut path.notes);
            moved?;
            let first = path.segments[0];
            out.push(self.restored(Cut::Approach(first.start)));
            out.push(self.restored(Cut::Rapid(first.end)));
            out.extend(path.segments[1..].iter().map(|s| self.restored(s.draw())));
            pass -= 1;
        }
        Ok(())
    }

    /// More cuts than any sound job has: every level once through every pocket. The real controller goes round
    /// for ever on some unsound contours.
    fn most_cuts(&self, begin: Zx, step: f64) -> usize {
        let (low, high) = self.segments.iter().fold((begin.x, begin.x), |(low, high), s| {
            let radius = match s.shape {
                Shape::Line => 0.0,
                Shape::Arc { .. } => s.size(),
            };
            let (a, b) = min_max(s.start.x, s.end.x);
            (min_max(low, a - radius).0, min_max(high, b + radius).1)
        });
        let levels = ((high - low) / step).min(1e9) as usize;
        64 + 16 * (levels + 2) * (self.segments.len() + 2)
    }

    /// G71, G72: removes the stock between the start point and the contour.
    pub(crate) fn rough(&mut self, job: &Roughing, out: &mut Vec<Cut>) -> Trouble {
        self.segments.first_mut().ok_or("Not monotonic")?.start = job.start;
        if job.facing {
            self.turn();
        }
        self.face()?;
        self.finish_corners()?;
        self.check_monotonic()?;
        self.add_distance(job.distance)?;
        self.segments.iter_mut().for_each(|s| s.map(|p| p + job.shift, false));
        let (first, last) = self.ends()?;
        let (begin, end) = (first.start, last.end);
        let mut cuts = vec![Cut::Rapid(begin)];
        if end.x < begin.x {
            self.segments.push(Segment::line(end, Zx::new(end.z, begin.x)));
        }
        let step = if job.step < 2.0 * TOLERANCE { 2.0 * TOLERANCE } else { job.step };
        let mut pockets = Pockets {
            segments: &self.segments,
            step,
            escape: Zx::new(job.retract, job.retract),
            starts: vec![begin],
            limit: self.most_cuts(begin, step).min(job.limit),
            leaves: job.leaves,
        };
        let done = pockets.cut(job.kind, begin, &mut cuts);
        out.extend(cuts.into_iter().map(|c| self.restored(c)));
        done
    }
}

fn finish_corner(before: &mut Segment, corner: &mut Segment, after: &mut Segment) -> Trouble {
    let apart = |p: &Segment, n: &Segment| (p.end - n.start).z > 1e-2;
    let moved = |finish: f64| {
        let (mut p, mut n) = (before.plain(), after.plain());
        p.offset(finish);
        n.offset(finish);
        (p, n)
    };
    let (mut p, mut n) = moved(corner.finish);
    if apart(&p, &n) {
        corner.finish = -corner.finish;
        (p, n) = moved(corner.finish);
    }
    if apart(&p, &n) {
        let at = before.end;
        return Err(format!("Corner finish failed at ({},{})", general(at.z, 6), general(at.x, 6)));
    }
    p.join(&mut n)?;
    let centre = p.end.middle(n.start);
    p.offset(-corner.finish);
    n.offset(-corner.finish);
    (before.end, corner.start) = (p.end, p.end);
    (after.start, corner.end) = (n.start, n.start);
    if corner.corner == Corner::Fillet {
        let ccw = (corner.start - centre).x > 0.0 || (corner.end - centre).x > 0.0;
        corner.shape = Shape::Arc { ccw, centre };
        corner.finish = 0.0;
    }
    Ok(())
}

/// Level by level down the contour.
struct Pockets<'a> {
    segments: &'a [Segment],
    step: f64,
    /// Retract of one pass, diagonal.
    escape: Zx,
    starts: Vec<Zx>,
    limit: usize,
    leaves: bool,
}

impl Pockets<'_> {
    fn cut(&mut self, kind: u8, from: Zx, out: &mut Vec<Cut>) -> Trouble {
        let (mut kind, mut at, mut i) = (kind, from, 0);
        loop {
            let top = self.starts.last().copied().unwrap_or(from);
            if kind == 2 {
                while i < self.segments.len() && !self.segments[i].dive(&mut at, -1e9, out, i == 0)? {
                    i += 1;
                }
                kind = 3;
            }
            if !self.levels(kind, top.x, &mut at, &mut i, out)? {
                return Ok(());
            }
        }
    }

    /// Passes until the contour rises; false at its end.
    fn levels(&mut self, kind: u8, top: f64, at: &mut Zx, i: &mut usize, out: &mut Vec<Cut>) -> Trouble<bool> {
        let mut x = top;
        let mut idle = 0_usize;
        while *i < self.segments.len() {
            idle += 1;
            if out.len() > self.limit || idle > self.limit {
                return Err("too many passes".into());
            }
            if x - TOLERANCE > at.x {
                let gap = ((x - TOLERANCE - at.x) / self.step).floor().max(0.0);
                if gap > self.limit as f64 {
                    return Err("too many passes".into());
                }
                while x - TOLERANCE > at.x {
                    x -= self.step;
                }
            }
            if self.segments[*i].dive(at, x, out, *i == 0)? {
                return self.rise(kind, at, i, out);
            }
            if (at.x - x).abs() > TOLERANCE {
                *i += 1;
                continue;
            }
            self.pass(&mut x, *at, i, out);
        }
        Ok(false)
    }

    /// Up the contour to where it falls again; true when there is a further pocket.
    fn rise(&mut self, kind: u8, at: &mut Zx, i: &mut usize, out: &mut Vec<Cut>) -> Trouble<bool> {
        if kind == 1 {
            self.segments[*i..].iter().for_each(|s| s.climb_only(at, out));
            return Ok(false);
        }
        while *i < self.segments.len() {
            if self.segments[*i].climb(at, out)? {
                if kind == 3 {
                    let above = self.starts.last().is_some_and(|s| at.x > s.x);
                    if above && self.starts.len() > 1 {
                        self.starts.pop();
                    }
                    if self.starts.len() == 1 {
                        self.starts.push(*at);
                    }
                }
                return Ok(true);
            }
            *i += 1;
        }
        Ok(false)
    }

    /// One pass along Z to the contour and back.
    fn pass(&self, x: &mut f64, at: Zx, i: &mut usize, out: &mut Vec<Cut>) {
            for (k, segment) in self.segments.iter().enumerate().skip(*i) {
            let is = segment.crossings(at.x);
            let (Some(front), Some(back)) = (is.first(), is.last()) else {
                continue;
            };
            let goal = if k == *i { *back } else { *front };
            let distance = (goal - at.z).abs();
            if goal - TOLERANCE > at.z {
                continue;
            }
            if distance < TOLERANCE {
                if k == *i {
                    continue;
                }
                if (at - segment.start).len() < TOLERANCE {
                    *i = k;
                } else {
                    *x -= self.step;
                }
                return;
            }
            out.push(Cut::Line(Zx::new(goal, at.x)));
            let scale = distance / 2.0 / self.escape.z;
            let escape = self.escape.scaled(if scale < 1.0 { scale } else { 1.0 });
            out.push(Cut::Rapid(Zx::new(goal, at.x) + escape));
            out.push(Cut::Rapid(at - escape.mirror()));
            out.push(if *i == 0 { Cut::Rapid(at) } else { Cut::Line(at) });
            *x -= self.step;
            return;
        }
        // Nothing is left to cut at this level: 2.9 tries again for ever.
        if self.leaves {
            *i += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shaft() -> Contour {
        let p = |z: f64, x: f64| Zx::new(z, x);
        Contour {
            segments: vec![
                Segment::line(p(1.0, 10.0), p(0.0, 4.0)),
                Segment::line(p(0.0, 4.0), p(-10.0, 4.0)),
                Segment::line(p(-10.0, 4.0), p(-12.0, 10.0)),
            ],
            ..Contour::default()
        }
    }

    fn job() -> Roughing {
        Roughing {
            kind: 0,
            start: Zx::new(1.0, 10.0),
            shift: Zx::default(),
            distance: 0.0,
            step: 2.0,
            retract: 0.5,
            facing: false,
            limit: 10_000,
            leaves: false,
        }
    }

    #[test]
    fn roughing_never_goes_below_the_contour() {
        let mut cuts = Vec::new();
        shaft().rough(&job(), &mut cuts).expect("a plain shaft");
        assert!(cuts.len() > 8);
        let ends = cuts.iter().map(|c| match c {
            Cut::Approach(p) | Cut::Rapid(p) | Cut::Line(p) | Cut::Arc(_, _, p) => *p,
        });
        assert!(ends.into_iter().all(|p| p.x >= 4.0 - 1e-9));
    }

    #[test]
    fn passes_are_limited() {
        let mut cuts = Vec::new();
        let tiny = Roughing { step: 1e-9, limit: 50, ..job() };
        assert!(shaft().rough(&tiny, &mut cuts).is_err());
    }

    #[test]
    fn finishing_follows_the_contour_at_a_distance() {
        let mut cuts = Vec::new();
        shaft().finish(Zx::new(1.0, 10.0), 0.5, 0.0, 2.0, &mut cuts).expect("a plain shaft");
        assert_eq!(cuts.iter().filter(|c| matches!(c, Cut::Approach(_) | Cut::Rapid(_))).count(), 4);
    }
}
