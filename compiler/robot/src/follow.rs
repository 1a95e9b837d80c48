//! Joint values from look to look along a move: one configuration is kept, and a great change of joints is looked at
//! closer until it proves to be made of small ones, or a jump. Where the wrist goes straight through the line of its
//! axes, the configuration goes over into the one with the wrist bent the other way; no joint jumps there.

use gr_machine::KinematicsError;

use crate::MAX_JOINTS;
use crate::path::{Mount, Path};
use crate::solver::{Branches, Joints, Limits, Solver};

/// A joint that changes more than this between two looks is looked at closer, rad (mm count a hundredth).
const SMALL: f64 = 0.12;
/// The same for speeds that are near a limit: what is found so is less than a thousandth below the peak.
const FINE: f64 = SMALL / 256.0;
/// So often a stretch is halved.
const HALVINGS: u32 = 18;
/// A wrist goes through its straight position when it comes nearer to it than this, rad.
const THROUGH: f64 = 1e-7;

/// A move that is followed.
pub(crate) struct Follow<'a> {
    pub solver: &'a Solver,
    pub limits: &'a Limits,
    pub path: &'a Path,
    pub mount: &'a Mount,
}

/// Why a configuration can't go on.
pub(crate) enum Stuck {
    Reach(KinematicsError),
    Jump,
}

fn delta(a: &Joints, b: &Joints, turns: &[bool; MAX_JOINTS], count: usize) -> f64 {
    let each = |i: usize| (a[i] - b[i]).abs() * if turns[i] { 1.0 } else { 0.01 };
    (0..count).map(each).fold(0.0, f64::max)
}

/// Whole turns added so that angles lie next to others.
pub(crate) fn unwrap(q: &mut Joints, near: &Joints, turns: &[bool; MAX_JOINTS], count: usize) {
    const TURN: f64 = std::f64::consts::TAU;
    for i in 0..count {
        if turns[i] && (near[i] - q[i]).abs() > std::f64::consts::PI {
            q[i] += TURN * libm::round((near[i] - q[i]) / TURN);
        }
    }
}

/// Joint values of the one of two configurations that is next to others.
pub(crate) fn nearer(solver: &Solver, limits: &Limits, all: &Branches, pair: [u8; 2], near: &Joints) -> Option<(Joints, u8)> {
    let one = |b: u8| {
        let mut q = all.joints[usize::from(b)];
        solver.at_the_pole(&mut q, near);
        unwrap(&mut q, near, &limits.turns, solver.count);
        (q, b)
    };
    let far = |q: &Joints| delta(q, near, &limits.turns, solver.count);
    let pair = if pair[0] == pair[1] { &pair[..1] } else { &pair[..] };
    pair.iter().filter(|b| all.has(**b)).map(|b| one(*b)).min_by(|a, b| far(&a.0).total_cmp(&far(&b.0)))
}

impl Follow<'_> {
    fn far(&self, a: &Joints, b: &Joints) -> f64 {
        delta(a, b, &self.limits.turns, self.solver.count)
    }

    /// From joint values and configuration at share `a` to those at share `b`, where `all` are the configurations.
    pub fn step(&self, all: &Branches, (p, branch): (&Joints, u8), (a, b): (f64, f64)) -> Result<(Joints, u8), Stuck> {
        if self.solver.searches() {
            let mut q = self.solver.near(&self.mount.flange(&self.path.at(b)), p).map_err(Stuck::Reach)?;
            unwrap(&mut q, p, &self.limits.turns, self.solver.count);
            return if self.connected(branch, p, &q, (a, b)) { Ok((q, branch)) } else { Err(Stuck::Jump) };
        }
        // Two configurations that meet are told under one number.
        let meet = all.good & all.singular;
        let number = if all.has(branch) { branch } else { meet.trailing_zeros() as u8 };
        if number < 8 {
            let (q, _) = nearer(self.solver, self.limits, all, [number; 2], p).ok_or(Stuck::Jump)?;
            if self.connected(branch, p, &q, (a, b)) {
                return Ok((q, branch));
            }
        }
        self.over(p, branch, (a, b), HALVINGS).ok_or(Stuck::Jump)
    }

    fn connected(&self, branch: u8, p: &Joints, q: &Joints, stretch: (f64, f64)) -> bool {
        self.far(p, q) <= SMALL || self.smooth(branch, p, q, stretch, HALVINGS)
    }

    /// Joint values at a share in one of two configurations.
    fn at(&self, share: f64, pair: [u8; 2], near: &Joints) -> Option<(Joints, u8)> {
        let flange = self.mount.flange(&self.path.at(share));
        if self.solver.searches() {
            let mut q = self.solver.near(&flange, near).ok()?;
            unwrap(&mut q, near, &self.limits.turns, self.solver.count);
            return Some((q, pair[0]));
        }
        let mut all = Branches::NONE;
        self.solver.all(&flange, &mut all).ok()?;
        nearer(self.solver, self.limits, &all, pair, near)
    }

    /// Whether a great change of joints is made of small ones; between `p` at the first share and `q` at the last.
    fn smooth(&self, branch: u8, p: &Joints, q: &Joints, (a, b): (f64, f64), left: u32) -> bool {
        if self.far(p, q) <= SMALL {
            return true;
        }
        if left == 0 {
            return false;
        }
        let middle = (a + b) / 2.0;
        let Some((r, _)) = self.at(middle, [branch; 2], p) else { return false };
        let mut end = *q;
        unwrap(&mut end, &r, &self.limits.turns, self.solver.count);
        // The end must be reached by the same turns.
        self.far(&end, q) < 1e-9 && self.smooth(branch, p, &r, (a, middle), left - 1) && self.smooth(branch, &r, q, (middle, b), left - 1)
    }

    /// How fast each joint goes at most between two looks, per share of the way; looked at closer where that is asked for.
    pub fn rates(&self, from: (&Joints, u8), to: (&Joints, u8), stretch: (f64, f64), closer: bool) -> Joints {
        let mut out = [0.0; MAX_JOINTS];
        self.steepest(from, to, stretch, (HALVINGS, if closer { FINE } else { SMALL }), &mut out);
        out
    }

    fn steepest(&self, (p, from): (&Joints, u8), (q, to): (&Joints, u8), (a, b): (f64, f64), (left, step): (u32, f64), out: &mut Joints) {
        if left > 0 && self.far(p, q) > step {
            let middle = (a + b) / 2.0;
            let mut guide = *p;
            (0..self.solver.count).for_each(|i| guide[i] = (p[i] + q[i]) / 2.0);
            let near = if from == to { p } else { &guide };
            if let Some((r, branch)) = self.at(middle, [from, to], near) {
                self.steepest((p, from), (&r, branch), (a, middle), (left - 1, step), out);
                return self.steepest((&r, branch), (q, to), (middle, b), (left - 1, step), out);
            }
        }
        for i in 0..self.solver.count {
            out[i] = out[i].max((q[i] - p[i]).abs() / (b - a));
        }
    }

    /// Through the straight wrist into the configuration on its other side.
    fn over(&self, p: &Joints, branch: u8, (a, b): (f64, f64), left: u32) -> Option<(Joints, u8)> {
        let other = self.solver.over_the_wrist(branch)?;
        let (q, _) = self.at(b, [other; 2], p)?;
        if self.far(p, &q) <= SMALL {
            return self.straight_between(p, [branch, other], (a, b)).then_some((q, other));
        }
        if left == 0 {
            return None;
        }
        let middle = (a + b) / 2.0;
        if let Some((r, _)) = self.at(middle, [branch; 2], p).filter(|(r, _)| self.connected(branch, p, r, (a, middle))) {
            return self.over(&r, branch, (middle, b), left - 1);
        }
        let (r, other) = self.over(p, branch, (a, middle), left - 1)?;
        let (q, _) = self.at(b, [other; 2], &r)?;
        self.connected(other, &r, &q, (middle, b)).then_some((q, other))
    }

    /// Whether the wrist is really straight where the two configurations take over from each other.
    fn straight_between(&self, p: &Joints, pair: [u8; 2], (a, b): (f64, f64)) -> bool {
        let (mut low, mut high) = (a, b);
        let mut least = f64::INFINITY;
        for _ in 0..48 {
            let middle = (low + high) / 2.0;
            let Some((q, branch)) = self.at(middle, pair, p) else { return false };
            least = least.min(self.solver.bend(&q).map_or(f64::INFINITY, f64::abs));
            if branch == pair[0] { low = middle } else { high = middle }
        }
        least <= THROUGH
    }
}
