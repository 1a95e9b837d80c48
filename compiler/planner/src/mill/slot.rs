//! Slots: along a course of travel, level by level as wide as the section is there, with a ball along every place of
//! its section, and with a T-slot cutter in from the open end.

use gr_text::code;
use gr_toolpath as tp;
use gr_toolpath::{P2, Path2, Region, Vertex};

use super::section::{Cut, curve};
use super::{Done, Job, Moves, RUN_OUT, path, words};
use crate::emit::Emit;
use crate::process::*;

/// More levels than this are a mistake.
const MOST: usize = 5_000;

/// Whether a T-slot cutter is low enough for the bar it is to cut.
pub(super) fn suits(e: &mut Emit<'_>, step: &Workingstep, feature: &Feature) -> bool {
    let tool = &step.operation.tool;
    let Shape::Slot { section: Section::Tee { bar_depth, .. }, .. } = &feature.shape else { return true };
    let Some(edge) = tool.edge().filter(|l| tool.kind == "T_SLOT_MILL" && *l > bar_depth + 1e-6) else { return true };
    let ways = ["its_tool_body.cutting_thickness", "cutting_width", "its_tool_body.dimension.cutting_edge_length", "maximum_depth_of_cut"];
    let why = format!("its bar is {} mm high, the disc of its tool {} mm", gr_step::short(*bar_depth), gr_step::short(edge));
    e.say(code::PLAN_CANNOT_CUT, e.attribute(tool.origin, &ways), &[&format!("#{} {}", feature.origin.id, feature.keyword), &why]);
    false
}

impl Job<'_> {
    pub(super) fn slot(&self, e: &mut Emit<'_>, travel: &Travel, section: &Section, ends: &[SlotEnd]) -> Done<Moves> {
        let line = match travel {
            Travel::Line { start, direction, length } => {
                let [a, b] = [*start, [start[0] + direction[0] * length, start[1] + direction[1] * length]];
                Contour { points: vec![[a[0], a[1], 0.0], [b[0], b[1], 0.0]], closed: false }
            }
            Travel::Curve(c) => c.clone(),
        };
        let closed = line.closed || ends.contains(&SlotEnd::Loop);
        let line = path(&line)?;
        if closed && !line.is_closed() {
            return Err("a slot with a loop end whose course does not come back".into());
        }
        if self.step.operation.tool.taper > 0.0 {
            return Err("a slot by a tool that tapers".into());
        }
        let open = |i: usize| ends.get(i).or(ends.first()).is_none_or(|e| *e == SlotEnd::Open);
        let both = [(line.start(), line.start_tangent() * -1.0), (line.end(), line.end_tangent())];
        if !closed {
            let ways: Vec<(P2, P2)> = both.into_iter().enumerate().filter(|(i, _)| open(*i)).map(|(_, way)| way).collect();
            self.open_ends(e, &ways);
        }
        if let Section::Tee { width, bar_width, bar_depth, radius, chamfer, origin } = section {
            self.chamfers(e, *chamfer, *origin);
            if self.step.operation.tool.kind == "T_SLOT_MILL" {
                self.corners_of_bar(e, *radius, *origin);
                self.no_pattern(e);
                if let Some(s) = self.m.strategy.as_ref().filter(|s| s.climb.is_some()) {
                    let of = format!("#{} {}", s.origin.id, s.keyword);
                    let at = e.attribute(s.origin, &["cutmode", "spiral_cutmode"]);
                    e.say(code::PLAN_NO_EFFECT, at, &["the cut mode", &of, "a disc in its slot cuts on both sides"]);
                }
                return self.tee(&line, ends, *width, *bar_width, *bar_depth);
            }
        }
        self.uneven(e, section);
        let land = 2.0 * self.radius + RUN_OUT + self.m.allowance_side;
        let shape = curve(section, self.depth, land)?;
        let cut = Cut::new(&shape, self.depth, self.radius, self.edge)?;
        let rising = ends.iter().any(|e| matches!(e, SlotEnd::Woodruff(_)));
        if rising && (closed || !cut.steady) {
            return Err("a Woodruff end of a slot whose section is not rectangular, or that is a loop".into());
        }
        let floor = cut.deepest().min(self.bottom);
        if !(floor > 1e-6) {
            return Err(format!("its section has no room for a tool of {} mm", 2.0 * self.radius));
        }
        let ball = self.edge + 1e-9 >= self.radius;
        let mut moves = Vec::new();
        if !(ball && self.before_cut(e)) {
            // Where a ball follows the section afterwards, what is before it is roughing.
            let rough = Job { by: if ball && !cut.steady { self.coarse } else { self.by }, ..*self };
            rough.by_levels(&cut, &line, ends, closed, floor, &mut moves)?;
        }
        if ball && !cut.steady {
            let cut = Cut::new(&shape, self.depth, self.radius + self.m.allowance_side, self.edge + self.m.allowance_side)?;
            let places = cut.places(self.tolerance)?.into_iter().map(|(u, y)| (u, (y - self.m.allowance_side).min(self.bottom)));
            self.along_section(&line, ends, closed, places.filter(|p| p.1 > 1e-6).collect(), &mut moves)?;
            if floor < self.bottom - self.tolerance {
                self.leaves(e, &format!("the last {:.4} mm above its floor, where it is too narrow", self.bottom - floor));
            }
        } else if floor < self.bottom - 1e-6 {
            self.leaves(e, &format!("the last {:.4} mm above its floor, where it is too narrow", self.bottom - floor));
        } else if !cut.steady && !self.m.finish && !ball {
            self.leaves(e, "stairs on its walls; a finishing workingstep or a ball takes them");
        }
        if rising && self.m.finish {
            self.rising_ends(&cut, &line, ends, floor, &mut moves)?;
        } else if rising {
            self.leaves(e, &format!("stairs of up to {:.4} mm on its Woodruff ends; a finishing workingstep takes them", self.axial.min(floor)));
        }
        if let Section::SquareU { radius, .. } = section {
            self.foot(e, radius[0].min(radius[1]));
        }
        self.slot_rest(e, &line, &cut, floor, ends, closed);
        let open = closed || ends.iter().all(|e| *e == SlotEnd::Open);
        let several = self.narrowed(cut.across(floor)).iter().any(|(a, b)| b - a > 1e-5);
        if open && several || ball && !cut.steady {
            self.no_pattern(e);
        }
        Ok(moves)
    }

    /// Chamfers of a T-slot, which none of its tools makes.
    fn chamfers(&self, e: &mut Emit<'_>, chamfer: [[f64; 2]; 2], profile: Origin) {
        if !self.tells {
            return;
        }
        let places = [("first_offset", "at its open end"), ("second_offset", "between its neck and its bar")];
        for ([width, lean], (attribute, place)) in chamfer.into_iter().zip(places).filter(|c| c.0[0] > 0.0) {
            let text = format!("the chamfers {place}, {} mm wide at {} degrees, are not cut", gr_step::short(width), gr_step::short(lean.to_degrees()));
            let tool = format!("T{}", self.step.operation.tool.number);
            e.say(code::PLAN_UNREACHABLE_CORNER, e.attribute(profile, &[attribute]), &[&tool, &format!("{:.4}", self.radius), &self.name(), &text]);
        }
    }

    /// The bar of a T-slot has the corners that its cutter has.
    fn corners_of_bar(&self, e: &mut Emit<'_>, radius: f64, profile: Origin) {
        if (radius - self.edge).abs() <= self.tolerance {
            return;
        }
        let at = e.attribute(profile, &["radius"]);
        let short = gr_step::short;
        let text = format!("the corners of its bar have a radius of {} mm, the edge of the tool {} mm", short(radius), short(self.edge));
        let o = &self.step.operation;
        if self.edge > radius {
            e.say(code::PLAN_UNREACHABLE_CORNER, at, &[&format!("T{}", o.tool.number), &format!("{:.4}", self.radius), &self.name(), &text]);
        } else {
            e.say(code::PLAN_BEYOND_FEATURE, at, &[&format!("#{} {}", o.origin.id, o.keyword), &self.name(), &text]);
        }
    }

    /// Where all strokes go along the course, a strategy has no say in it.
    fn no_pattern(&self, e: &mut Emit<'_>) {
        let Some(s) = self.m.strategy.as_ref() else { return };
        let of = format!("#{} {}", s.origin.id, s.keyword);
        let why = "all strokes in such a slot follow its course";
        if s.keyword != "CONTOUR_PARALLEL" {
            e.say(code::PLAN_NO_EFFECT, s.origin, &["the pattern", &of, why]);
        } else if s.ccw.is_some() {
            e.say(code::PLAN_NO_EFFECT, e.attribute(s.origin, &["rotation_direction"]), &["rotation_direction", &of, why]);
        }
    }

    /// How far past the end of the course the tool reaches on the arc of a Woodruff end, its tip at a depth. The arc
    /// is tangent to the floor where the course ends.
    fn risen(&self, radius: f64, y: f64) -> Done<f64> {
        let inner = radius - self.edge;
        if !(inner > 0.0) {
            return Err(format!("a Woodruff end of radius {radius}, no larger than the edge of its tool"));
        }
        let below = inner - (self.depth - y);
        Ok(self.edge + if below <= 0.0 { inner } else { libm::sqrt((inner * inner - below * below).max(0.0)) })
    }

    /// Course and ends on a level: a Woodruff end is a flat one further out.
    fn on_level(&self, line: &Path2, ends: &[SlotEnd], y: f64) -> Done<(Path2, Vec<SlotEnd>)> {
        let mut by = [0.0; 2];
        let mut out = Vec::new();
        for (i, by) in by.iter_mut().enumerate() {
            let Some(end) = ends.get(i).or(ends.first()) else { continue };
            out.push(match end {
                SlotEnd::Woodruff(r) => {
                    *by = self.risen(*r, y)?;
                    SlotEnd::Flat(0.0, 0.0)
                }
                other => *other,
            });
        }
        Ok((lengthened(line, by[0], by[1])?, out))
    }

    /// Down the arcs of Woodruff ends from wall to wall, so finely that no stair stands out beyond the tolerance.
    fn rising_ends(&self, cut: &Cut, line: &Path2, ends: &[SlotEnd], floor: f64, moves: &mut Moves) -> Done<()> {
        for i in 0..2 {
            let Some(SlotEnd::Woodruff(radius)) = ends.get(i).or(ends.first()) else { continue };
            let (at, out, along) = if i == 0 {
                (line.start(), line.start_tangent() * -1.0, line.start_tangent())
            } else {
                (line.end(), line.end_tangent(), line.end_tangent())
            };
            let reach = |y: f64| self.risen(*radius, y).map(|x| x - self.radius - self.m.allowance_side);
            let mut levels = vec![self.tolerance.min(floor)];
            while let Some(y) = levels.last().copied().filter(|y| *y < floor) {
                // As far down as a stair stays low or narrow.
                let fine = |z: f64| Ok::<bool, String>(z - y <= self.tolerance && reach(y)? - reach(z)? <= self.by || reach(y)? - reach(z)? <= self.tolerance);
                let (mut low, mut high) = (y, floor);
                if fine(floor)? {
                    low = floor;
                }
                for _ in 0..40 {
                    let mid = (low + high) / 2.0;
                    if fine(mid)? { low = mid } else { high = mid }
                }
                levels.push(low.max(y + self.tolerance * 1e-2).min(floor));
                if levels.len() > MOST {
                    return Err("its Woodruff end needs too many levels".into());
                }
            }
            for (a, b) in self.narrowed(cut.across(floor)) {
                let place = |y: f64, u: f64| Ok::<P2, String>(at + out * reach(y)? + along.left() * u);
                let go = |to: P2, z: f64, kind: tp::Kind, tag: tp::Tag| tp::Move { to: tp::P3::over(to, z), kind, tag };
                let first = place(levels[0], a)?;
                moves.push(go(first, self.retract, tp::Kind::Rapid, tp::Tag::Approach));
                moves.push(go(first, RUN_OUT.min(self.retract), tp::Kind::Rapid, tp::Tag::Approach));
                for (k, y) in levels.iter().enumerate() {
                    let (from, to) = if k % 2 == 0 { (a, b) } else { (b, a) };
                    moves.push(go(place(*y, from)?, -y, tp::Kind::Line, tp::Tag::Cut));
                    if b - a > 1e-6 {
                        moves.push(go(place(*y, to)?, -y, tp::Kind::Line, tp::Tag::Cut));
                    }
                }
                if let Some(last) = moves.last().copied() {
                    moves.push(go(last.to.flat(), self.retract, tp::Kind::Rapid, tp::Tag::Retract));
                }
            }
        }
        Ok(())
    }

    /// Which wall is the first is not settled where the section is lopsided.
    fn uneven(&self, e: &mut Emit<'_>, section: &Section) {
        let lopsided = match section {
            Section::SquareU { radius, angle, .. } => (radius[0] - radius[1]).abs() > 1e-9 || (angle[0] - angle[1]).abs() > 1e-9,
            Section::Vee { angle, tilt, .. } => *tilt != 0.0 && (tilt + angle / 2.0 - std::f64::consts::FRAC_PI_2).abs() > 1e-9,
            Section::General(_) => true,
            _ => false,
        };
        if lopsided {
            let rule = "the x axis of its section is taken to point to the left, seen along the course of travel";
            e.say(code::PLAN_TAKES_TURNS, self.feature.origin, &[&self.name(), rule]);
        }
    }

    /// An earlier workingstep has emptied the feature: a ball only follows the section.
    pub(super) fn before_cut(&self, e: &Emit<'_>) -> bool {
        e.cut.contains(&self.feature.origin.id)
    }

    fn by_levels(&self, cut: &Cut, line: &Path2, ends: &[SlotEnd], closed: bool, floor: f64, moves: &mut Moves) -> Done<()> {
        let open = ends.is_empty() || ends.contains(&SlotEnd::Open);
        let entry = self.entry(open)?;
        let rising = ends.iter().any(|e| matches!(e, SlotEnd::Woodruff(_)));
        if cut.steady && !rising {
            for (a, b) in self.narrowed(cut.across(floor)) {
                self.across_level(line, (a, b), ends, closed, &self.heights(0.0, floor), &entry, moves)?;
            }
            return self.some(moves);
        }
        let count = (floor / self.axial - 1e-9).ceil().max(1.0);
        let mut above = 0.0;
        for k in 1..=count as usize {
            let y = if k as f64 == count { floor } else { floor * k as f64 / count };
            let (line, ends) = &if rising { self.on_level(line, ends, y)? } else { (line.clone(), ends.to_vec()) };
            for (a, b) in self.narrowed(cut.across(y)) {
                self.across_level(line, (a, b), ends, closed, &self.level(above, y), &entry, moves)?;
            }
            // A ball follows the section afterwards.
            if self.m.finish && !cut.steady && self.edge + 1e-9 < self.radius {
                self.walls_between(cut, line, ends, closed, above, y, moves)?;
            }
            above = y;
        }
        self.some(moves)
    }

    #[allow(clippy::too_many_arguments)]
    fn across_level(&self, line: &Path2, (a, b): (f64, f64), ends: &[SlotEnd], closed: bool, heights: &tp::Depth, entry: &tp::Entry, moves: &mut Moves) -> Done<()> {
        let passes = self.slot_passes(line, a, b, ends, closed)?;
        let room = self.room(line, a, b, ends, closed);
        // Where the tool may be is not known of every course: then it goes down along its axis.
        let entry = if room.is_some() { entry.clone() } else { tp::Entry::default() };
        moves.extend(tp::motion(&passes, heights, &entry, room.as_ref(), self.radius).map_err(words)?);
        Ok(())
    }

    /// Where the tool may be for approaches: the slot as wide as it is on this level, far out at open ends.
    fn room(&self, line: &Path2, a: f64, b: f64, ends: &[SlotEnd], closed: bool) -> Option<Region> {
        let line = shifted(line, (a + b) / 2.0).ok()?;
        let half = (b - a).max(0.0) / 2.0 + self.radius;
        if closed {
            return tp::profile::sweep(&line, half, half, tp::profile::End::Round, tp::profile::End::Round).ok();
        }
        self.blind(&line, half, ends, 2.0 * (self.radius + RUN_OUT)).ok()
    }

    fn some(&self, moves: &Moves) -> Done<()> {
        if moves.is_empty() { Err(format!("its section has no room for a tool of {} mm with its allowance", 2.0 * self.radius)) } else { Ok(()) }
    }

    fn narrowed(&self, all: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
        let by = self.m.allowance_side;
        all.into_iter().map(|(a, b)| (a + by, b - by)).filter(|(a, b)| b - a > -1e-6).collect()
    }

    /// The walls between two levels, so finely that no stair stands out beyond the tolerance.
    #[allow(clippy::too_many_arguments)]
    fn walls_between(&self, cut: &Cut, line: &Path2, ends: &[SlotEnd], closed: bool, above: f64, y: f64, moves: &mut Moves) -> Done<()> {
        let mut at = above;
        let entry = tp::Entry::default();
        for _ in 0..MOST {
            if cut.moves_in(at, y) <= self.tolerance || y - at <= self.tolerance {
                return Ok(());
            }
            let (mut low, mut high) = (at, y);
            for _ in 0..40 {
                let mid = (low + high) / 2.0;
                if cut.moves_in(at, mid) > self.tolerance { high = mid } else { low = mid }
            }
            let next = low.max(at + self.tolerance);
            for (a, b) in self.narrowed(cut.across(next)) {
                let sides = if b - a > 1e-6 { vec![a, b] } else { vec![(a + b) / 2.0] };
                let passes: Done<Vec<tp::Pass>> = sides.into_iter().map(|u| self.one_pass(line, u, ends, closed)).collect();
                moves.extend(tp::motion(&passes?, &self.level(at, next), &entry, None, self.radius).map_err(words)?);
            }
            at = next;
        }
        Err("its walls lean so much that they need too many levels".into())
    }

    fn one_pass(&self, line: &Path2, u: f64, ends: &[SlotEnd], closed: bool) -> Done<tp::Pass> {
        let path = shifted(&self.ended(line, ends, closed)?, u)?;
        Ok(tp::Pass { path, role: tp::Role::Wall, link: tp::Link::Retract })
    }

    /// The slot's middle line from where the tool starts to where it stops.
    fn ended(&self, line: &Path2, ends: &[SlotEnd], closed: bool) -> Done<Path2> {
        if closed {
            return Ok(line.clone());
        }
        let by = self.m.allowance_side;
        let end = |i: usize| match ends.get(i).or(ends.first()) {
            None | Some(SlotEnd::Open) => self.radius + RUN_OUT,
            Some(SlotEnd::Flat(..)) => -self.radius - by,
            _ => 0.0,
        };
        lengthened(line, end(0), end(1))
    }

    /// Passes on one level, the tool's axis between `a` and `b` to the left of the middle line.
    fn slot_passes(&self, line: &Path2, a: f64, b: f64, ends: &[SlotEnd], closed: bool) -> Done<Vec<tp::Pass>> {
        let line = &shifted(line, (a + b) / 2.0)?;
        let width = (b - a).max(0.0) + 2.0 * self.radius;
        let open = ends.is_empty() || ends.iter().all(|e| *e == SlotEnd::Open);
        if !closed && b - a > 1e-5 && !open {
            let half = width / 2.0 + self.m.allowance_side;
            let region = self.blind(line, half, ends, self.radius + RUN_OUT)?;
            return Ok(self.connected(tp::clear(&region, &self.clearing()?).map_err(words)?.passes));
        }
        let mut what = tp::Contour::new(self.radius);
        what.stepover = self.by;
        what.cut_mode = self.cut_mode().unwrap_or(tp::CutMode::Climb);
        tp::slot(&self.ended(line, ends, closed)?, width, &what).map_err(words)
    }

    /// The outline of a slot with a closed end, out in the air at open ones.
    fn blind(&self, line: &Path2, half: f64, ends: &[SlotEnd], out: f64) -> Done<Region> {
        let (a, b) = (line.start(), line.end());
        let end = |i: usize| *ends.get(i).or(ends.first()).unwrap_or(&SlotEnd::Open);
        let reach = |e: SlotEnd| if e == SlotEnd::Open { out } else { 0.0 };
        if line.segs().len() != 1 || (line.length() - a.dist(b)).abs() > 1e-6 {
            let corner = |e: SlotEnd| matches!(e, SlotEnd::Flat(p, q) if p.max(q) > self.radius + 1e-6);
            if corner(end(0)) || corner(end(1)) {
                return Err("a curved slot with corner radii at a flat end that are larger than its tool's".into());
            }
            let kind = |e: SlotEnd| if e == SlotEnd::Radiused { tp::profile::End::Round } else { tp::profile::End::Flat };
            let line = lengthened(line, reach(end(0)), reach(end(1)))?;
            return tp::profile::sweep(&line, half, half, kind(end(0)), kind(end(1))).map_err(words);
        }
        let u = (b - a).unit();
        let (p, q) = (a - u * reach(end(0)), b + u * reach(end(1)));
        let n = u.left();
        // Corners, counterclockwise from the right of the start.
        let mut v: Vec<Vertex> = Vec::new();
        let mut corner = |c: P2, into: P2, onward: P2, r: f64| {
            let r = r.min(half);
            if r > 1e-9 {
                v.push(Vertex { p: c - into * r, bulge: libm::tan(std::f64::consts::PI / 8.0) });
                v.push(Vertex { p: c + onward * r, bulge: 0.0 });
            } else {
                v.push(Vertex { p: c, bulge: 0.0 });
            }
        };
        let radii = |e: SlotEnd| match e {
            SlotEnd::Flat(one, two) => (one, two),
            _ => (0.0, 0.0),
        };
        let round = |e: SlotEnd| e == SlotEnd::Radiused;
        let (r0, r1) = (radii(end(0)), radii(end(1)));
        corner(p - n * half, -n, u, r0.1);
        corner(q - n * half, u, n, r1.0);
        corner(q + n * half, n, -u, r1.1);
        corner(p + n * half, -u, -n, r0.0);
        if round(end(1)) || round(end(0)) {
            for x in v.iter_mut() {
                let at = |c: P2| x.p.dist(c) < 1e-12;
                if round(end(1)) && at(q - n * half) || round(end(0)) && at(p + n * half) {
                    x.bulge = 1.0;
                }
            }
        }
        Region::new(Path2::from_vertices(&v, true).map_err(words)?, Vec::new()).map_err(words)
    }

    /// Corners of closed ends that the tool does not reach.
    fn slot_rest(&self, e: &mut Emit<'_>, line: &Path2, cut: &Cut, floor: f64, ends: &[SlotEnd], closed: bool) {
        if closed || ends.is_empty() || ends.iter().all(|e| *e == SlotEnd::Open) {
            return;
        }
        let [(a, b)] = cut.across(floor)[..] else { return };
        let Ok(line) = shifted(line, (a + b) / 2.0) else { return };
        if let Ok(region) = self.blind(&line, (b - a) / 2.0 + self.radius, ends, self.radius + RUN_OUT) {
            let (p, q) = (line.start(), line.end());
            let near = (b - a) / 2.0 + 2.0 * self.radius;
            let is_open = |i: usize| ends.get(i).or(ends.first()) == Some(&SlotEnd::Open);
            self.rest(e, &region, &[], |at| !(is_open(0) && at.dist(p) < near || is_open(1) && at.dist(q) < near));
        }
    }

    /// Along the middle line, once for each place of the tool in the section: offset and height of its tip.
    fn along_section(&self, line: &Path2, ends: &[SlotEnd], closed: bool, places: Vec<(f64, f64)>, moves: &mut Moves) -> Done<()> {
        let middle = self.ended(line, ends, closed)?;
        let entry = tp::Entry::default();
        for (i, (x, z)) in places.iter().enumerate() {
            let way = shifted(&middle, *x)?;
            let way = if i % 2 == 1 { way.reversed() } else { way };
            let pass = tp::Pass { path: way, role: tp::Role::Wall, link: tp::Link::Retract };
            moves.extend(tp::motion(&[pass], &self.level(0.0, *z), &entry, None, self.radius).map_err(words)?);
        }
        Ok(())
    }

    /// A cutter wider than the neck goes in from the side and comes out where it can.
    fn tee(&self, line: &Path2, ends: &[SlotEnd], neck: f64, bar: f64, height: f64) -> Done<Moves> {
        let open = |i: usize| ends.is_empty() || ends.get(i).or(ends.first()) == Some(&SlotEnd::Open);
        if line.is_closed() || !open(0) && !open(1) {
            return Err("a T-slot without an open end: its cutter gets in only from the side".into());
        }
        let spare = bar / 2.0 - self.radius - self.m.allowance_side;
        if spare < -1e-6 {
            return Err(format!("its bar is {bar} mm wide, the tool {} mm", 2.0 * self.radius));
        }
        if neck >= 2.0 * self.radius {
            return Err(format!("a T-slot cutter of {} mm, no wider than its neck", 2.0 * self.radius));
        }
        let edge = self.step.operation.tool.edge().unwrap_or(height);
        let mut middle = self.ended(line, ends, false)?;
        let back = !open(0) || !open(1);
        if !open(0) {
            middle = middle.reversed();
        }
        let n = (spare.max(0.0) / self.by - 1e-9).ceil().max(0.0) as usize;
        let mut offsets = vec![0.0];
        for k in 1..=n {
            let u = spare * k as f64 / n as f64;
            offsets.extend([u, -u]);
        }
        let levels = ((height - self.m.allowance_bottom) / edge - 1e-9).ceil().max(1.0) as usize;
        let first = self.bottom - (height - self.m.allowance_bottom) + edge;
        let mut moves = Vec::new();
        for k in 0..levels {
            let y = if levels == 1 { self.bottom } else { first + (self.bottom - first) * k as f64 / (levels - 1) as f64 };
            for u in &offsets {
                let way = shifted(&middle, *u)?;
                let way = if back { way.then(&way.reversed()) } else { way };
                let pass = tp::Pass { path: way, role: tp::Role::Wall, link: tp::Link::Retract };
                moves.extend(tp::motion(&[pass], &self.level(0.0, y), &tp::Entry::default(), None, self.radius).map_err(words)?);
            }
        }
        Ok(moves)
    }
}

/// To the left by `u`.
fn shifted(line: &Path2, u: f64) -> Done<Path2> {
    if u.abs() < 1e-9 {
        return Ok(line.clone());
    }
    if !line.is_closed() {
        return tp::offset_open(line, u).map_err(words);
    }
    // Inside a closed course to the left when it runs counterclockwise.
    let inward = (u > 0.0) == line.is_ccw();
    let all = if inward {
        let ring = Region::new(line.clone(), Vec::new()).map_err(words)?;
        tp::erode(&ring, u.abs()).map_err(words)?
    } else {
        tp::grow(std::slice::from_ref(line), u.abs()).map_err(words)?
    };
    match all.as_slice() {
        [one] => Ok(one.outer().oriented(line.is_ccw())),
        _ => Err("a course that comes too near to itself".into()),
    }
}

/// An open path with straight pieces added at its ends, or shortened there (first and last piece straight).
fn lengthened(line: &Path2, first: f64, last: f64) -> Done<Path2> {
    let mut v = line.vertices();
    let n = v.len();
    if n < 2 {
        return Err("a slot without length".into());
    }
    let (u, w) = (line.start_tangent(), line.end_tangent());
    let (a, b) = (v[0].p - u * first, v[n - 1].p + w * last);
    if first < 0.0 && v[0].bulge != 0.0 || last < 0.0 && v[n - 2].bulge != 0.0 {
        return Err("a flat end on an arc".into());
    }
    if (first < 0.0 || last < 0.0) && n == 2 && v[0].p.dist(v[1].p) + first + last < 1e-9 {
        return Err("a slot shorter than its tool is wide".into());
    }
    if v[n - 2].bulge == 0.0 {
        v[n - 1].p = b;
    } else if last > 0.0 {
        v.push(Vertex { p: b, bulge: 0.0 });
    }
    if v[0].bulge == 0.0 {
        v[0].p = a;
    } else if first > 0.0 {
        v.insert(0, Vertex { p: a, bulge: 0.0 });
    }
    Path2::from_vertices(&v, false).map_err(words)
}
