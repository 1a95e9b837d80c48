//! G70, G71, G72: finishing and roughing of a turned contour that stands in a subroutine.
//!
//! A point is (Z, X). The contour is turned and mirrored until the stock lies above it and the cut runs towards
//! smaller Z; the moves found there are turned back before they are made. Facing (G72) is roughing of the
//! contour turned by a quarter.

use gr_canon::{Plane, Sink, Version};
use gr_spec::{code, rs274};

use crate::{Fault, Interp, Res};

mod contour;
mod points;
mod segment;

use contour::{Contour, Roughing};
use points::{QUARTER, Zx};
use segment::{Cut, Segment, Trouble};

/// The moves of a contour subroutine, read but not made.
pub(crate) struct Reader {
    contour: Contour,
    at: Zx,
    incremental: bool,
    ijk_absolute: bool,
}

fn refuse(text: gr_spec::Rs274, why: &str) -> Box<Fault> {
    let fault = Fault::new(code::ROUGH_CONTOUR, text).arg(why);
    match why {
        "Not monotonic" => fault.named("it does not rise or fall all the way".into()),
        _ => fault,
    }
}

impl Reader {
    /// Takes the words of one block of the subroutine.
    pub(crate) fn block<S: Sink>(&mut self, interp: &mut Interp<'_, S>) -> Res {
        let end = self.end(interp)?;
        let b = &interp.block;
        let motion = b.g(crate::Group::Motion);
        if motion != -1 {
            interp.m.motion = i32::from(motion);
        }
        if end == self.at {
            return Ok(());
        }
        let start = self.at;
        match interp.m.motion {
            0 | 10 => self.contour.segments.push(Segment::line(start, end)),
            20 | 30 => {
                let ccw = interp.m.motion == 30;
                let centre = self.centre(b, end, ccw)?;
                self.contour.segments.push(Segment::arc(ccw, start, centre, end));
            }
            _ => {}
        }
        if matches!(interp.m.motion, 0 | 10 | 20 | 30) {
            self.corner(b, end)?;
        }
        interp.m.current[0] = end.x;
        interp.m.current[2] = end.z;
        self.at = end;
        Ok(())
    }

    fn end<S: Sink>(&self, interp: &Interp<'_, S>) -> Res<Zx> {
        let b = &interp.block;
        let mut end = if self.incremental { Zx::default() } else { self.at };
        if let Some(u) = b.get(b'u') {
            if self.incremental {
                return Err(refuse(rs274::ROUGH_U_INCREMENTAL, "U in G91"));
            }
            if b.has(b'x') {
                return Err(refuse(rs274::ROUGH_U_AND_X, "U and X in one block"));
            }
            end.x += if interp.m.lathe_diameter != 0 { u / 2.0 } else { u };
        } else if let Some(x) = b.get(b'x') {
            end.x = x;
        }
        if let Some(w) = b.get(b'w') {
            if self.incremental {
                return Err(refuse(rs274::ROUGH_W_INCREMENTAL, "W in G91"));
            }
            if b.has(b'z') {
                return Err(refuse(rs274::ROUGH_W_AND_Z, "W and Z in one block"));
            }
            end.z += w;
        } else if let Some(z) = b.get(b'z') {
            end.z = z;
        }
        Ok(if self.incremental { end + self.at } else { end })
    }

    fn centre(&self, b: &crate::Block, end: Zx, ccw: bool) -> Res<Zx> {
        let given = b.has_any(b"ik");
        if let Some(r) = b.get(b'r') {
            if given {
                return Err(refuse(rs274::ROUGH_R_AND_IK, "R together with I or K"));
            }
            let chord = end - self.at;
            let f = ((r * r - chord.square() / 4.0) / chord.square()).sqrt();
            let aside = QUARTER.scaled(f) * chord;
            let middle = self.at.middle(end);
            return Ok(if ccw { middle + aside } else { middle - aside });
        }
        if !given {
            return Err(refuse(rs274::ROUGH_NO_IK, "an arc needs R, or I and K"));
        }
        let offset = Zx::new(b.or_zero(b'k'), b.or_zero(b'i'));
        Ok(if self.ijk_absolute { offset } else { offset + self.at })
    }

    fn corner(&mut self, b: &crate::Block, end: Zx) -> Res {
        let (a, c) = (b.get(b'a'), b.get(b'c'));
        if a.is_some() && c.is_some() {
            return Err(refuse(rs274::ROUGH_A_AND_C, "A and C on one corner"));
        }
        if let Some(radius) = a {
            self.contour.segments.push(Segment::fillet(radius, end));
        }
        if let Some(size) = c {
            self.contour.segments.push(Segment::chamfer(size, end));
        }
        Ok(())
    }
}

impl<S: Sink> Interp<'_, S> {
    /// G70, G71, G71.1, G71.2, G72, G72.1, G72.2.
    pub(crate) fn convert_roughing(&mut self, g: i16) -> Res {
        let Some(q) = self.block.get(b'q') else {
            return Err(refuse(rs274::ROUGH_NO_Q, "Q, the number of the contour subroutine, is missing"));
        };
        let (cycle, kind) = (g / 10, g % 10);
        let wrong = |text, why: &str| Err(refuse(text, why).arg(cycle).arg(kind));
        if self.m.comp_side != 0 && cycle != 70 {
            return wrong(rs274::ROUGH_COMP, "cutter compensation is on");
        }
        if self.m.plane() != Plane::Xz {
            return wrong(rs274::ROUGH_PLANE, "the plane is not G18");
        }
        let saved = (self.m.incremental, self.m.ijk_absolute);
        (self.m.incremental, self.m.ijk_absolute) = (0, 1);
        let done = self.rough_contour(cycle, kind as u8, q, saved);
        (self.m.incremental, self.m.ijk_absolute) = saved;
        done
    }

    fn rough_contour(&mut self, cycle: i16, kind: u8, q: f64, saved: (u8, u8)) -> Res {
        let words = self.block.clone();
        let start = self.rough_start(saved.0 != 0);
        let before = [self.m.current[0], self.m.current[2]];
        self.rapid_to_contour()?;
        let mut reader = Reader {
            contour: Contour::default(),
            at: start,
            incremental: saved.0 != 0,
            ijk_absolute: saved.1 != 0,
        };
        self.read_contour(q, &mut reader)?;
        if reader.contour.segments.len() <= 1 {
            return Ok(());
        }
        if self.setup.version == Version::V2_10 {
            [self.m.current[0], self.m.current[2]] = before;
            reader.contour.close(cycle, start);
        }
        let mut cuts = Vec::new();
        let done = self.rough_cuts(cycle, kind, &words, start, &mut reader.contour, &mut cuts)?;
        for note in &reader.contour.notes {
            self.sink.print(note);
        }
        self.block.clear();
        for cut in cuts {
            self.make_cut(cut)?;
        }
        done.map_err(|why| refuse(rs274::ROUGH_GEOMETRY, &why))
    }

    /// The rapid before a pass. 2.10 makes it without cutter compensation, which then enters at the contour.
    fn rapid_to_contour(&mut self) -> Res {
        if self.setup.version == Version::V2_9 {
            return self.convert_straight(0);
        }
        let side = std::mem::replace(&mut self.m.comp_side, 0);
        let done = self.convert_straight(0);
        self.m.comp_side = side;
        done
    }

    /// Where the block's X and Z lead.
    fn rough_start(&self, incremental: bool) -> Zx {
        let at = |letter: u8, current: f64| match self.block.get(letter) {
            Some(v) if incremental => current + v,
            Some(v) => v,
            None => current,
        };
        Zx::new(at(b'z', self.m.current[2]), at(b'x', self.m.current[0]))
    }

    fn rough_cuts(
        &self,
        cycle: i16,
        kind: u8,
        words: &crate::Block,
        start: Zx,
        contour: &mut Contour,
        cuts: &mut Vec<Cut>,
    ) -> Res<Trouble> {
        let word = |letter: u8, default: f64| words.get(letter).unwrap_or(default);
        let step = word(b'i', 1.0);
        if step <= 0.0 {
            return Err(refuse(rs274::ROUGH_I, "I must be greater than zero"));
        }
        if cycle == 70 {
            return Ok(contour.finish(start, word(b'd', 0.0), word(b'e', 0.0), word(b'p', 1.0), cuts));
        }
        let job = Roughing {
            kind,
            start,
            shift: Zx::new(word(b'w', 0.0), word(b'u', 0.0)),
            distance: word(b'd', 0.0),
            step,
            retract: word(b'r', 0.5),
            facing: cycle == 72,
            limit: usize::try_from(self.setup.budgets.passes).unwrap_or(usize::MAX),
            leaves: self.setup.version == Version::V2_10,
        };
        Ok(contour.rough(&job, cuts))
    }

    fn make_cut(&mut self, cut: Cut) -> Res {
        let end = match cut {
            Cut::Approach(p) | Cut::Rapid(p) | Cut::Line(p) | Cut::Arc(_, _, p) => p,
        };
        self.block.set(b'x', end.x);
        self.block.set(b'z', end.z);
        match cut {
            Cut::Approach(_) => self.rapid_to_contour(),
            Cut::Rapid(_) => self.convert_straight(0),
            Cut::Line(_) => self.convert_straight(10),
            Cut::Arc(ccw, centre, _) => {
                self.block.set(b'i', centre.x);
                self.block.set(b'k', centre.z);
                let same = |a: f64, b: f64| (a - b).abs() < 0.0001;
                if same(self.m.current[2], end.z) && same(self.m.current[0], end.x) {
                    return Ok(());
                }
                self.convert_arc(if ccw { 30 } else { 20 })
            }
        }
    }
}
