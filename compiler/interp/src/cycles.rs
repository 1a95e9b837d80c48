//! Canned cycles G73, G74, G81 … G89 in all six planes.
//!
//! A cycle positions in the plane at the clear level, goes down to R, does its work at the hole and comes back.
//! Its words are sticky while the same cycle goes on, and the level it started from is remembered for G98.

use gr_canon::{Axes, Call, Mark, PathMode, Plane, Sink, Units, Version};
use gr_spec::{Rs274, code, rs274};

use crate::queue::plane_axes;
use crate::state::SPINDLES;
use crate::{Fault, Interp, Res};

/// `G81`, `G5.2`
pub(crate) fn code_name(g: i32) -> String {
    if g % 10 == 0 { format!("G{}", g / 10) } else { format!("G{}.{}", g / 10, g % 10) }
}

fn plane_name(plane: Plane) -> &'static str {
    match plane {
        Plane::Xy => "XY",
        Plane::Yz => "YZ",
        Plane::Xz => "XZ",
        Plane::Uv => "UV",
        Plane::Vw => "VW",
        Plane::Uw => "UW",
    }
}

const LETTERS: [u8; 9] = *b"xyzabcuvw";

/// One hole: everything the passes of a cycle need.
struct Hole {
    g: i32,
    plane: Plane,
    axes: [usize; 3],
    /// Position in the plane; moves on with each repeat.
    at: [f64; 2],
    step: [f64; 2],
    /// Polar increments: radius, angle.
    polar_step: [f64; 2],
    retract: f64,
    bottom: f64,
    clear: f64,
    /// Where the tool is along the normal before the first pass.
    level: f64,
    /// P, Q as given or remembered.
    dwell: f64,
    peck: f64,
    /// G87: I, J, K in the order first, second, normal.
    bore: [f64; 3],
    turning: u8,
    spindle: i32,
}

impl<S: Sink> Interp<'_, S> {
    /// A canned cycle, one block of it.
    pub(crate) fn convert_cycle(&mut self, g: i16) -> Res {
        let g = i32::from(g);
        let plane = self.m.plane();
        self.check_cycle_modes()?;
        let again = self.m.motion == g;
        // A Fanuc control keeps the levels from one cycle to another until G80.
        let kept = again || self.is_fanuc() && crate::check::is_cycle(self.m.motion as i16);
        let r = match self.block.get(b'r') {
            Some(r) => r,
            None if kept => self.m.cycle_r,
            None => return Err(word_missing("R", rs274::CYCLE_NO_R)),
        };
        // Fanuc controls repeat K times.
        let letter = if self.is_fanuc() { b'k' } else { b'l' };
        let repeats = self.block.get(letter).map_or(1, |l| l as i32);
        if self.is_fanuc() {
            if !crate::check::is_cycle(self.m.motion as i16) {
                self.m.before_cycle = self.m.motion;
            }
            if repeats == 0 && letter == b'k' {
                return self.store_cycle(g, plane, r);
            }
        }
        if repeats <= 0 {
            let needed = format!("{} of at least 1", letter.to_ascii_uppercase() as char);
            return Err(word_missing(&needed, rs274::CYCLE_NO_REPEATS).at(letter));
        }
        self.check_cycle_axes(plane)?;
        self.cycle_in_plane(g, plane, (again, kept), r, repeats)?;
        self.m.cycle_l = repeats;
        self.m.motion = g;
        Ok(())
    }

    /// K0 of a Fanuc control: the words are kept, nothing is drilled.
    fn store_cycle(&mut self, g: i32, plane: Plane, r: f64) -> Res {
        let axes = plane_axes(plane);
        let again = self.m.motion == g;
        if !again && !crate::check::is_cycle(self.m.motion as i16) && !self.block.has(LETTERS[axes[2]]) {
            return Err(normal_missing(plane));
        }
        if self.m.cycle_il_set == 0 {
            (self.m.cycle_il, self.m.cycle_il_set) = (self.m.current[axes[2]], 1);
        }
        let given = self.block.get(LETTERS[axes[2]]).unwrap_or(self.m.cycle_cc);
        let mut hole = self.hole(g, plane, axes, r, given);
        self.cycle_words(&mut hole, again)?;
        self.keep_cycle_words(&hole);
        self.keep_levels(&hole, r, given);
        self.m.motion = g;
        Ok(())
    }

    /// R and the depth for the blocks that go on with the cycle: as programmed, or, on a Fanuc control, where they were.
    fn keep_levels(&mut self, hole: &Hole, r: f64, given: f64) {
        (self.m.cycle_r, self.m.cycle_cc) = if self.is_fanuc() { (hole.retract, hole.bottom) } else { (r, given) };
    }

    fn check_cycle_modes(&self) -> Res {
        if self.m.feed == 0.0 {
            return Err(Fault::new(code::ARC_NO_FEED, rs274::CYCLE_ZERO_FEED).arg("the feed is zero"));
        }
        if self.m.feed_mode == 1 {
            return Err(Fault::new(code::CYCLE_NOT_HERE, rs274::CYCLE_INVERSE_TIME)
                .arg("inverse time feed (G93) is on"));
        }
        if self.m.comp_side != 0 {
            return Err(Fault::new(code::CYCLE_NOT_HERE, rs274::CYCLE_COMP).arg("cutter compensation is on"));
        }
        Ok(())
    }

    fn check_cycle_axes(&self, plane: Plane) -> Res {
        let xyz = matches!(plane, Plane::Xy | Plane::Xz | Plane::Yz);
        let (alien, text): (&[u8], Rs274) =
            if xyz { (b"uvw", rs274::CYCLE_WRONG_AXIS) } else { (b"xyz", rs274::CYCLE_WRONG_AXIS_X) };
        let Some(letter) = alien.iter().copied().find(|l| self.block.has(*l)) else {
            return Ok(());
        };
        let text = if matches!(letter, b'y' | b'z') { rs274::CYCLE_WRONG_AXIS } else { text };
        Err(CycleAxis { letter, plane }.fault(text))
    }

    /// `kept`: R and the depth may be those of before.
    fn cycle_in_plane(&mut self, g: i32, plane: Plane, (again, kept): (bool, bool), r: f64, repeats: i32) -> Res {
        let axes = plane_axes(plane);
        let normal = LETTERS[axes[2]];
        if !kept && !self.block.has(normal) {
            return Err(normal_missing(plane));
        }
        let given = self.block.get(normal).unwrap_or(self.m.cycle_cc);
        let parked = std::mem::replace(&mut self.m.parked, 0);
        let level = self.m.current[axes[2]];
        let first_block = self.m.cycle_il_set == 0;
        if first_block {
            self.m.cycle_il = level;
            self.m.cycle_il_set = 1;
        }
        let mut hole = self.hole(g, plane, axes, r, given);
        let mut old = self.m.cycle_il;
        if hole.retract < hole.bottom {
            return Err(r_below_bottom(plane)
                .at(b'r')
                .arg(format!("{:.4}", hole.retract))
                .arg(format!("{:.4}", hole.bottom)));
        }
        if old < hole.retract {
            let known = parked >> axes[2] & 1 == 0 || !self.setup.params.is_empty();
            if first_block && self.m.incremental == 0 && known {
                self.warn(Fault::own(code::CYCLE_STARTS_BELOW_R).at(b'r').arg(format!("{:.4}", hole.retract)));
            }
            let mut up = self.m.current;
            up[axes[2]] = hole.retract;
            self.emit(Call::StraightTraverse(up));
            old = hole.retract;
            hole.level = old;
        }
        hole.clear = if self.m.retract_r != 0 { hole.retract } else { old };
        // What was given out, not what was programmed: a cycle that failed leaves its exact path behind.
        let path = self.world.path;
        let exact = path == 0;
        let tolerances = [self.world.tolerance, self.world.naivecam];
        if !exact {
            self.emit(Call::SetMotionControlMode(PathMode::ExactPath));
        }
        self.cycle_words(&mut hole, again)?;
        for pass in 0..repeats {
            if self.spent() {
                return Err(self.too_many());
            }
            self.turn_to_hole();
            self.mark(&Mark::CycleBegin(g));
            let done = self.cycle_pass(&mut hole, pass == 0);
            self.mark(&Mark::CycleEnd);
            done?;
        }
        self.keep_cycle_words(&hole);
        self.m.current[axes[0]] = hole.at[0];
        self.m.current[axes[1]] = hole.at[1];
        self.m.current[axes[2]] = hole.clear;
        self.keep_levels(&hole, r, given);
        if !exact {
            self.restore_path_mode(path, tolerances);
        }
        Ok(())
    }

    /// Fanuc: rotary axes turn on the way to the hole, with each repetition.
    fn turn_to_hole(&mut self) {
        if !self.is_fanuc() {
            return;
        }
        for i in 3..6 {
            let Some(word) = self.block.get(LETTERS[i]) else { continue };
            self.m.current[i] = if self.m.incremental != 0 { self.m.current[i] + word } else { word };
        }
    }

    pub(crate) fn restore_path_mode(&mut self, path: u8, [tolerance, naivecam]: [f64; 2]) {
        let mode = match path {
            1 => PathMode::ExactStop,
            2 => PathMode::Continuous(tolerance),
            _ => PathMode::ExactPath,
        };
        self.emit(Call::SetMotionControlMode(mode));
        self.emit(Call::SetNaivecamTolerance(naivecam));
    }

    fn hole(&self, g: i32, plane: Plane, axes: [usize; 3], r: f64, given: f64) -> Hole {
        let current = [self.m.current[axes[0]], self.m.current[axes[1]]];
        let word = |i: usize| self.block.get(LETTERS[axes[i]]);
        let mut hole = Hole {
            g,
            plane,
            axes,
            at: current,
            step: [0.0; 2],
            polar_step: [0.0; 2],
            retract: r,
            bottom: given,
            clear: 0.0,
            level: self.m.current[axes[2]],
            dwell: 0.0,
            peck: 0.0,
            bore: [0.0; 3],
            turning: 0,
            spindle: 0,
        };
        let polar = plane == Plane::Xy && self.block.has_any(b"@^");
        let radians = std::f64::consts::PI / 180.0;
        if self.m.incremental != 0 {
            hole.step = [word(0).unwrap_or(0.0), word(1).unwrap_or(0.0)];
            if polar {
                hole.polar_step = [self.block.or_zero(b'@'), self.block.or_zero(b'^') * radians];
            }
            // A Fanuc control keeps the levels themselves, not the distances.
            let kept = |letter| self.is_fanuc() && !self.block.has(letter);
            hole.retract = if kept(b'r') { r } else { r + self.m.cycle_il };
            hole.bottom = if kept(LETTERS[axes[2]]) { given } else { hole.retract + given };
        } else if polar {
            let radius = self.block.get(b'@').unwrap_or_else(|| libm::hypot(current[1], current[0]));
            let angle =
                self.block.get(b'^').map_or_else(|| libm::atan2(current[1], current[0]), |a| a * radians);
            hole.at = [radius * libm::cos(angle), radius * libm::sin(angle)];
        } else {
            hole.at = [word(0).unwrap_or(current[0]), word(1).unwrap_or(current[1])];
        }
        hole
    }

    /// P, Q, I, J, K and the spindle, given or remembered.
    fn cycle_words(&mut self, hole: &mut Hole, again: bool) -> Res {
        let p = self.block.get(b'p').filter(|p| *p != -1.0);
        let q = self.block.get(b'q').filter(|q| *q != -1.0);
        // G86 of Fanuc controls has no dwell.
        let dwells = !(self.is_fanuc() && hole.g == 860);
        match hole.g {
            820 | 860 | 880 | 890 if p.is_none() && !again && dwells => {
                return Err(word_missing("P", rs274::CYCLE_NO_P).arg(hole.g / 10));
            }
            730 | 830 if q.is_none() && !again => {
                let fault = word_missing("Q", rs274::CYCLE_NO_Q).arg(hole.g / 10);
                return Err(if self.block.has(b'q') { fault.named("Q greater than zero".into()).at(b'q') } else { fault });
            }
            870 if !again => {
                if let Some(missing) = b"ijk".iter().find(|l| !self.block.has(**l)) {
                    let letter = (*missing as char).to_ascii_uppercase().to_string();
                    return Err(word_missing(&letter, rs274::CYCLE_NO_IJK));
                }
            }
            _ => {}
        }
        // Milliseconds on Fanuc controls.
        let unit = if self.is_fanuc() { 0.001 } else { 1.0 };
        hole.dwell = if dwells { p.map_or(self.m.cycle_p, |p| p * unit) } else { 0.0 };
        hole.peck = q.unwrap_or(self.m.cycle_q);
        self.cycle_spindle(hole)?;
        if hole.g == 870 {
            self.bore_words(hole);
        }
        Ok(())
    }

    fn cycle_spindle(&mut self, hole: &mut Hole) -> Res {
        let before = self.m.active_spindle;
        let listens = matches!(hole.g, 740 | 840) || (hole.plane == Plane::Uw && matches!(hole.g, 860..=880));
        if let Some(number) = self.block.get(b'$')
            && listens
        {
            let text =
                if hole.plane == Plane::Xz { rs274::CYCLE_SPINDLE_NUMBER_XZ } else { rs274::CYCLE_SPINDLE_NUMBER };
            self.choose_spindle(number, hole.g, text)?;
        }
        hole.spindle = self.m.active_spindle;
        let asked = if hole.plane == Plane::Uv && matches!(hole.g, 740 | 840) { before } else { hole.spindle };
        hole.turning = self.m.turning[asked.clamp(0, SPINDLES as i32 - 1) as usize];
        Ok(())
    }

    /// `$` makes a spindle the active one.
    pub(crate) fn choose_spindle(&mut self, number: f64, g: i32, text: Rs274) -> Res {
        if number < 0.0 || number >= f64::from(self.config.spindles) {
            return Err(Fault::new(code::CYCLE_SPINDLE, text)
                .at(b'$')
                .arg(code_name(g))
                .arg(format!("there is no spindle {number}")));
        }
        self.m.active_spindle = number as i32;
        Ok(())
    }

    /// The block has made more calls than one may.
    pub(crate) fn spent(&self) -> bool {
        self.emitted - self.begun > self.setup.budgets.passes
    }

    /// What is wrong then.
    pub(crate) fn too_many(&self) -> Box<Fault> {
        self.endless("this cycle makes more moves than the limit allows")
    }

    fn bore_words(&mut self, hole: &mut Hole) {
        let i = self.block.get(b'i').unwrap_or(self.m.cycle_i);
        let j = self.block.get(b'j').unwrap_or(self.m.cycle_j);
        let k = self.block.get(b'k').unwrap_or(self.m.cycle_k);
        (self.m.cycle_i, self.m.cycle_j, self.m.cycle_k) = (i, j, k);
        hole.bore = match hole.plane {
            Plane::Xy | Plane::Uv => [i, j, k],
            Plane::Yz | Plane::Vw => [j, k, i],
            Plane::Xz | Plane::Uw => [k, i, j],
        };
        if self.m.incremental != 0 {
            hole.bore[2] += hole.bottom;
        }
    }

    fn keep_cycle_words(&mut self, hole: &Hole) {
        match hole.g {
            860 if self.is_fanuc() => {}
            820 | 740 | 840 | 860 | 880 | 890 => self.m.cycle_p = hole.dwell,
            730 | 830 => self.m.cycle_q = hole.peck,
            _ => {}
        }
    }

    fn cycle_pass(&mut self, hole: &mut Hole, first: bool) -> Res {
        hole.at = [hole.at[0] + hole.step[0], hole.at[1] + hole.step[1]];
        let [radius, angle] = hole.polar_step;
        if radius != 0.0 || angle != 0.0 {
            hole.at = polar_increment(hole.at, radius, angle)?;
        }
        // A Fanuc control goes to the hole at the level where it stands, whatever level it goes back to.
        if first && (hole.level > hole.retract || self.is_fanuc()) {
            self.cycle_rapid(hole, hole.at, hole.level);
            if hole.level != hole.retract {
                self.cycle_rapid(hole, hole.at, hole.retract);
            }
        } else {
            self.cycle_rapid(hole, hole.at, hole.clear);
            if hole.clear > hole.retract {
                self.cycle_rapid(hole, hole.at, hole.retract);
            }
        }
        self.cycle_work(hole)
    }

    fn cycle_point(&self, hole: &Hole, at: [f64; 2], level: f64) -> Axes {
        let mut point = self.m.current;
        point[hole.axes[0]] = at[0];
        point[hole.axes[1]] = at[1];
        point[hole.axes[2]] = level;
        point
    }

    fn cycle_rapid(&mut self, hole: &Hole, at: [f64; 2], level: f64) {
        let point = self.cycle_point(hole, at, level);
        self.emit(Call::StraightTraverse(point));
    }

    fn cycle_feed(&mut self, hole: &Hole, level: f64) {
        let point = self.cycle_point(hole, hole.at, level);
        self.emit(Call::StraightFeed(point));
    }

    fn cycle_work(&mut self, hole: &Hole) -> Res {
        match hole.g {
            730 | 830 => self.peck(hole),
            740 | 840 => self.tap(hole),
            850 => {
                self.cycle_feed(hole, hole.bottom);
                self.cycle_feed(hole, hole.retract);
                self.cycle_rapid(hole, hole.at, hole.clear);
                Ok(())
            }
            860 => self.bore_stopped(hole),
            870 => self.back_bore(hole),
            880 => self.bore_by_hand(hole),
            g => {
                self.cycle_feed(hole, hole.bottom);
                if g != 810 {
                    self.emit(Call::Dwell(hole.dwell));
                }
                if g == 890 && self.is_fanuc() {
                    self.cycle_feed(hole, hole.retract);
                    if hole.clear > hole.retract {
                        self.cycle_rapid(hole, hole.at, hole.clear);
                    }
                } else if g == 890 {
                    self.cycle_feed(hole, hole.clear);
                } else {
                    self.cycle_rapid(hole, hole.at, hole.clear);
                }
                Ok(())
            }
        }
    }

    /// How far above the last peck the rapid back into the hole ends (G83), or the chip-breaking lift (G73).
    fn peck_clearance(&self, g: i32) -> f64 {
        let mm = self.m.units() == Units::Mm;
        if self.setup.version == Version::V2_9 {
            return if mm { 0.010 * 25.4 } else { 0.010 };
        }
        if let Some(d) = self.block.get(b'd') {
            return d;
        }
        let key = if g == 730 { "parameter_g73_peck_clearance" } else { "parameter_g83_peck_clearance" };
        let machine_mm = self.setup.machine_units == Units::Mm;
        let machine = self.setup.ini.number("rs274ngc", key).unwrap_or(if machine_mm { 1.0 } else { 0.050 });
        match (machine_mm, mm) {
            (true, false) => machine / 25.4,
            (false, true) => machine * 25.4,
            _ => machine,
        }
    }

    fn peck(&mut self, hole: &Hole) -> Res {
        if hole.peck <= 0.0 {
            return Err(word_missing("Q greater than zero", rs274::CYCLE_Q_NOT_POSITIVE).at(b'q'));
        }
        let clearance = self.peck_clearance(hole.g);
        let mut depth = hole.retract - hole.peck;
        while depth > hole.bottom {
            self.cycle_feed(hole, depth);
            if hole.g == 830 {
                self.cycle_rapid(hole, hole.at, hole.retract);
            }
            self.cycle_rapid(hole, hole.at, depth + clearance);
            let next = depth - hole.peck;
            if next == depth {
                break; // a peck too small to change the depth would never end
            }
            if self.spent() {
                return Err(self.too_many());
            }
            depth = next;
        }
        self.cycle_feed(hole, hole.bottom);
        self.cycle_rapid(hole, hole.at, hole.clear);
        Ok(())
    }

    fn turn_spindle(&mut self, spindle: i32, clockwise: bool) {
        self.emit(if clockwise {
            Call::StartSpindleClockwise(spindle)
        } else {
            Call::StartSpindleCounterclockwise(spindle)
        });
    }

    fn check_tap_spindle(&self, hole: &Hole) -> Res {
        let name = code_name(hole.g);
        let fault = |text, why: &str| Err(Fault::new(code::CYCLE_SPINDLE, text).arg(&name).arg(why));
        match (hole.turning, hole.g) {
            (0, _) => fault(rs274::CYCLE_SPINDLE_STOPPED, "the spindle is stopped"),
            (1, 740) => fault(rs274::CYCLE_SPINDLE_CW_G74, "the spindle turns clockwise"),
            (2, 840) => fault(rs274::CYCLE_SPINDLE_CCW_G84, "the spindle turns counter-clockwise"),
            _ => Ok(()),
        }
    }

    /// G84, G74 with a floating tap holder.
    fn tap(&mut self, hole: &Hole) -> Res {
        self.check_tap_spindle(hole)?;
        // A Fanuc control feeds back to R, and goes up from there by rapid (0i/30i operator's manual, machining center, canned cycles).
        let lifts = self.is_fanuc() && hole.clear > hole.retract;
        let top = if lifts { hole.retract } else { hole.clear };
        let Some(depth) = tap_points(hole, top) else {
            return Err(Fault::new(code::CYCLE_NOT_HERE, rs274::CYCLE_TAP_PLANE)
                .arg("tapping works in G17, G18 and G19 only")
                .arg(code_name(hole.g))
                .arg(plane_name(hole.plane)));
        };
        let (feed_held, speed_held) = (self.world.feed_held != 0, self.world.speed_held != 0);
        self.emit(Call::DisableFeedOverride);
        self.emit(Call::DisableSpeedOverride(hole.spindle));
        let back = hole.g == 740;
        for (i, point) in depth.iter().enumerate() {
            let mut to = self.m.current;
            to[..3].copy_from_slice(point);
            if self.is_fanuc() {
                to = self.cycle_point(hole, hole.at, [hole.bottom, top][i]);
            }
            self.emit(Call::StraightFeed(to));
            self.emit(Call::StopSpindleTurning(hole.spindle));
            self.turn_spindle(hole.spindle, if i == 0 { back } else { !back });
            if i == 0 {
                self.emit(Call::Dwell(hole.dwell));
            }
        }
        if !feed_held {
            self.emit(Call::EnableFeedOverride);
        }
        if !speed_held {
            self.emit(Call::EnableSpeedOverride(hole.spindle));
        }
        if lifts {
            self.cycle_rapid(hole, hole.at, hole.clear);
        }
        Ok(())
    }

    fn check_bore_spindle(hole: &Hole) -> Res {
        if hole.turning != 0 {
            return Ok(());
        }
        // rs274's text takes the number alone, ours the name: arguments 0 and 2.
        Err(Fault::new(code::CYCLE_SPINDLE, rs274::CYCLE_SPINDLE_NOT_TURNING)
            .arg(code_name(hole.g))
            .arg("the spindle is stopped")
            .arg(hole.g / 10))
    }

    fn bore_stopped(&mut self, hole: &Hole) -> Res {
        Self::check_bore_spindle(hole)?;
        self.cycle_feed(hole, hole.bottom);
        if !self.is_fanuc() {
            self.emit(Call::Dwell(hole.dwell));
        }
        self.emit(Call::StopSpindleTurning(hole.spindle));
        self.cycle_rapid(hole, hole.at, hole.clear);
        self.turn_spindle(hole.spindle, hole.turning == 1);
        Ok(())
    }

    fn bore_by_hand(&mut self, hole: &Hole) -> Res {
        Self::check_bore_spindle(hole)?;
        self.cycle_feed(hole, hole.bottom);
        self.emit(Call::Dwell(hole.dwell));
        self.emit(Call::StopSpindleTurning(hole.spindle));
        self.emit(Call::ProgramStop);
        self.turn_spindle(hole.spindle, hole.turning == 1);
        Ok(())
    }

    fn back_bore(&mut self, hole: &Hole) -> Res {
        Self::check_bore_spindle(hole)?;
        let aside = [hole.at[0] + hole.bore[0], hole.at[1] + hole.bore[1]];
        let clockwise = hole.turning == 1;
        // The controller's numbers for the direction: 2 clockwise, 3 counter-clockwise.
        let orient = Call::OrientSpindle(hole.spindle, 0.0, i32::from(hole.turning) + 1);
        self.cycle_rapid(hole, aside, hole.retract);
        self.emit(Call::StopSpindleTurning(hole.spindle));
        self.emit(orient.clone());
        self.cycle_rapid(hole, aside, hole.bottom);
        self.cycle_rapid(hole, hole.at, hole.bottom);
        self.turn_spindle(hole.spindle, clockwise);
        self.cycle_feed(hole, hole.bore[2]);
        self.cycle_feed(hole, hole.bottom);
        self.emit(Call::StopSpindleTurning(hole.spindle));
        self.emit(orient);
        self.cycle_rapid(hole, aside, hole.bottom);
        self.cycle_rapid(hole, aside, hole.clear);
        self.cycle_rapid(hole, hole.at, hole.clear);
        self.turn_spindle(hole.spindle, clockwise);
        Ok(())
    }
}

/// X, Y, Z of the bottom and of the clear level. (In G19 and G18 the controller gives its axes in another order
/// than it later reads them; the tool goes where it says.)
fn tap_points(hole: &Hole, top: f64) -> Option<[[f64; 3]; 2]> {
    let [a, b] = hole.at;
    let point = |level: f64| match hole.plane {
        Plane::Xy => Some([a, b, level]),
        Plane::Yz => Some([b, level, a]),
        Plane::Xz => Some([level, a, b]),
        _ => None,
    };
    Some([point(hole.bottom)?, point(top)?])
}

fn polar_increment(at: [f64; 2], radius: f64, angle: f64) -> Res<[f64; 2]> {
    let mut at = at;
    for (dr, da) in [(radius, 0.0), (0.0, angle)] {
        if dr == 0.0 && da == 0.0 {
            continue;
        }
        if at == [0.0, 0.0] {
            return Err(word_missing("X or Y", rs274::CYCLE_POLAR_ORIGIN));
        }
        let theta = libm::atan2(at[1], at[0]) + da;
        let r = libm::hypot(at[1], at[0]) + dr;
        at = [r * libm::cos(theta), r * libm::sin(theta)];
    }
    Ok(at)
}

fn word_missing(word: &str, text: Rs274) -> Box<Fault> {
    Fault::new(code::CYCLE_WORD_MISSING, text).arg(word)
}

/// An axis word that does not belong to the plane.
struct CycleAxis {
    letter: u8,
    plane: Plane,
}

impl CycleAxis {
    fn fault(self, text: Rs274) -> Box<Fault> {
        let letter = (self.letter as char).to_ascii_uppercase();
        let plane = plane_name(self.plane);
        Fault::new(code::CYCLE_NOT_HERE, text)
            .at(self.letter)
            .arg(format!("{letter} does not belong to a cycle in the {plane} plane"))
            .arg(letter)
            .arg(plane)
    }
}

fn normal_missing(plane: Plane) -> Box<Fault> {
    let (letter, text, g) = match plane {
        Plane::Xy => return word_missing("Z", rs274::CYCLE_NO_Z),
        Plane::Xz => return word_missing("Y", rs274::CYCLE_NO_Y),
        Plane::Yz => return word_missing("X", rs274::CYCLE_NO_X),
        Plane::Uv => ("W", rs274::CYCLE_NO_AXIS, "G17.1"),
        Plane::Vw => ("U", rs274::CYCLE_NO_AXIS, "G19.1"),
        Plane::Uw => ("V", rs274::CYCLE_NO_AXIS, "G18.1"),
    };
    word_missing(letter, text).arg(g)
}

fn r_below_bottom(plane: Plane) -> Box<Fault> {
    let text = match plane {
        Plane::Xy => rs274::CYCLE_R_BELOW_Z,
        Plane::Xz => rs274::CYCLE_R_BELOW_Y,
        Plane::Yz => rs274::CYCLE_R_BELOW_X,
        Plane::Uv => rs274::CYCLE_R_BELOW_W,
        Plane::Vw => rs274::CYCLE_R_BELOW_U,
        Plane::Uw => rs274::CYCLE_R_BELOW_V,
    };
    Fault::new(code::CYCLE_R_BELOW_BOTTOM, text)
}
