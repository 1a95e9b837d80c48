//! Second pass: one configuration for every chain of moves, chosen over all chains together.
//!
//! A chain is a place reached by a joint move and the lines and arcs that follow. Along a chain every configuration
//! is followed at once through samples of the real path; a change of joints too great between two samples is looked
//! at closer until it is small or proves to be a jump. What survives, times the whole turns of joints that have room
//! for them, times the tool's turn about its own axis where that is free, are the nodes of a graph; the cheapest way
//! through it, from home to home, is found by dynamic programming.

use gr_ir::Source;
use gr_machine::KinematicsError;
use gr_machine::math::Frame;

use crate::follow::{Follow, Stuck};
use crate::gather::{Gathered, Item, Move, Way};
use crate::path::{Mount, Path, handed_on};
use crate::solver::{Branches, Joints, Limits, Solver};

/// Moves `first ..= last` (indices into the items); the first is reached by a joint move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Chain {
    pub first: usize,
    pub last: usize,
}

/// Why a configuration ends.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Why {
    Reach(KinematicsError),
    /// A joint beyond its limit: where that was seen, and how far the program's move sends it.
    Limit { joint: usize, value: f64, limit: f64, farthest: f64 },
    Jump,
    Condition(gr_machine::Violation),
}

/// Where and why.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Fault {
    pub item: usize,
    /// Share of the move.
    pub share: f64,
    pub position: [f64; 3],
    pub source: Option<Source>,
    pub why: Why,
}

/// A configuration that holds along a chain, joints as at its start; `shift` brings them into the limits.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Node {
    pub branch: u8,
    pub spin: f64,
    pub start: Joints,
    pub end: Joints,
    cost: f64,
}

struct Track {
    /// At the start, and now.
    branch: u8,
    now_in: u8,
    now: Joints,
    start: Joints,
    low: Joints,
    high: Joints,
    close: f64,
    alive: bool,
}

/// Turns of a free tool tried first.
const COARSE: usize = 24;
/// Looks of the first, rough pass over a chain of a free tool.
const ROUGH: usize = 200;

pub(crate) struct Chooser<'a> {
    pub g: &'a Gathered,
    pub solver: &'a Solver,
    pub limits: &'a Limits,
    /// Greatest speed of each joint, for weighing travel.
    pub speeds: Joints,
    /// Nodes kept per chain.
    pub kept: usize,
    /// Where the chain begins, when that is known.
    pub stands: Option<Joints>,
}

/// The chains of a program.
pub(crate) fn chains(items: &[Item]) -> Vec<Chain> {
    let mut out: Vec<Chain> = Vec::new();
    for (i, item) in items.iter().enumerate() {
        let Item::Move(m) = item else { continue };
        match out.last_mut() {
            Some(chain) if m.way != Way::Joint => chain.last = i,
            _ => out.push(Chain { first: i, last: i }),
        }
    }
    out
}

impl Chooser<'_> {
    fn at(&self, i: usize) -> &Move {
        match &self.g.items[i] {
            Item::Move(m) => m,
            Item::Do(_) => unreachable!("chains begin and end at moves"),
        }
    }

    /// All nodes of a chain, or where the one that got furthest ended.
    pub fn nodes(&self, chain: Chain) -> Result<Vec<Node>, Fault> {
        let free = (chain.first..=chain.last).any(|i| matches!(&self.g.items[i], Item::Move(m) if m.free));
        if !free {
            return self.walked(chain, &[0.0]);
        }
        let turn = std::f64::consts::TAU / COARSE as f64;
        let coarse: Vec<f64> = (0..COARSE).map(|k| turn * k as f64).collect();
        let moves = (chain.first..=chain.last).filter(|i| matches!(self.g.items[*i], Item::Move(_))).count();
        if moves <= ROUGH {
            let all = self.walked(chain, &coarse)?;
            return Ok(self.finer(chain, all, turn));
        }
        // A long chain: rough looks rank the turns, then the best are followed along the whole of it.
        let ranked = self.ranked(chain, &coarse);
        let mut last = None;
        for few in ranked.chunks(3) {
            // Each by itself, in the order of their ranks: as many threads as turns, the same nodes.
            let each = std::thread::scope(|s| {
                let threads: Vec<_> = few.iter().map(|spin| s.spawn(|| self.walk(chain, *spin))).collect();
                threads.into_iter().map(|t| t.join().unwrap_or_else(|e| std::panic::resume_unwind(e))).collect::<Vec<_>>()
            });
            match self.gathered(each) {
                Ok(nodes) => return Ok(nodes),
                Err(fault) => last = furthest(last, fault),
            }
        }
        match last {
            Some(fault) => Err(fault),
            None => self.walked(chain, &coarse),
        }
    }

    /// Turns of the tool between the coarse ones, about the best.
    fn finer(&self, chain: Chain, mut all: Vec<Node>, turn: f64) -> Vec<Node> {
        let Some(best) = all.iter().min_by(|a, b| a.cost.total_cmp(&b.cost)).map(|n| n.spin) else { return all };
        let near = [-0.5, -0.25, 0.25, 0.5].map(|k| best + turn * k);
        all.extend(self.walked(chain, &near).unwrap_or_default());
        trimmed(all, self.kept)
    }

    fn ranked(&self, chain: Chain, spins: &[f64]) -> Vec<f64> {
        let moves: Vec<usize> = (chain.first..=chain.last).filter(|i| matches!(self.g.items[*i], Item::Move(_))).collect();
        let step = moves.len().div_ceil(ROUGH).max(1);
        let score = |spin: f64| {
            let mut out = Branches::NONE;
            let mut sum = [0.0f64; 8];
            for i in moves.iter().step_by(step) {
                let m = self.at(*i);
                let tool = Frame { turn: self.g.turns[m.turn as usize], position: m.position };
                if self.solver.all(&Mount::new(self.g, m, spin).flange(&tool), &mut out).is_err() {
                    return f64::INFINITY;
                }
                for (b, slot) in sum.iter_mut().enumerate() {
                    let good = out.has(b as u8) && (0..self.solver.count).all(|j| self.limits.shifts(j, out.joints[b][j], out.joints[b][j]).is_some());
                    let close = self.solver.closeness(&out.joints[b]).0;
                    *slot += if good { 1.0 / close.max(1e-3) } else { 1e6 };
                }
            }
            sum.into_iter().fold(f64::INFINITY, f64::min)
        };
        let mut rows: Vec<(f64, f64)> = spins.iter().map(|s| (score(*s), *s)).collect();
        rows.sort_by(|a, b| a.0.total_cmp(&b.0));
        rows.into_iter().map(|r| r.1).collect()
    }

    fn walked(&self, chain: Chain, spins: &[f64]) -> Result<Vec<Node>, Fault> {
        self.gathered(spins.iter().map(|spin| self.walk(chain, *spin)))
    }

    /// What came of several turns.
    fn gathered(&self, each: impl IntoIterator<Item = Result<Vec<Node>, Fault>>) -> Result<Vec<Node>, Fault> {
        let mut nodes = Vec::new();
        let mut last = None;
        for one in each {
            match one {
                Ok(more) => nodes.extend(more),
                Err(fault) => last = furthest(last, fault),
            }
        }
        match last {
            Some(fault) if nodes.is_empty() => Err(fault),
            _ => Ok(trimmed(nodes, self.kept)),
        }
    }

    /// Follows all configurations along a chain.
    fn walk(&self, chain: Chain, spin: f64) -> Result<Vec<Node>, Fault> {
        let first = self.at(chain.first);
        let mut all = Branches::NONE;
        let start = Frame { turn: self.g.turns[first.turn as usize], position: first.position };
        let place = |item: usize, share: f64, position: [f64; 3], source: Option<Source>, why: Why| Fault { item, share, position, source, why };
        let begin = |why: Why| place(chain.first, 1.0, first.position, first.source, why);
        if let Err(e) = self.solver.all(&Mount::new(self.g, first, spin).flange(&start), &mut all) {
            return Err(begin(Why::Reach(e)));
        }
        let mut tracks: Vec<Track> = (0..8)
            .filter(|b| all.has(*b))
            .map(|branch| {
                let q = all.joints[usize::from(branch)];
                let close = self.solver.closeness(&q).0;
                Track { branch, now_in: branch, now: q, start: q, low: q, high: q, close, alive: true }
            })
            .collect();
        let mut fault = None;
        for t in &mut tracks {
            if let Some(why) = self.outside(t, &t.now) {
                t.alive = false;
                fault = furthest(fault, begin(why));
            }
        }
        let (mut from, mut before) = (start, first);
        for i in chain.first + 1..=chain.last {
            if !tracks.iter().any(|t| t.alive) {
                break;
            }
            let Item::Move(m) = &self.g.items[i] else { continue };
            let path = Path::new(self.g, self.solver, &handed_on(self.g, from, before, m, spin), m);
            let mount = Mount::new(self.g, m, spin);
            let looks = path.looks();
            for k in 1..=looks {
                let (a, b) = ((k - 1) as f64 / looks as f64, k as f64 / looks as f64);
                let reach = self.solver.all(&mount.flange(&path.at(b)), &mut all);
                for t in tracks.iter_mut().filter(|t| t.alive) {
                    let why = match &reach {
                        Err(e) => Some(Why::Reach(e.clone())),
                        Ok(()) => self.advance(t, &all, &path, &mount, a, b),
                    };
                    if let Some(mut why) = why {
                        t.alive = false;
                        if let Why::Limit { joint, value, limit, farthest } = &mut why {
                            *farthest = self.farthest(t, (i, chain.last), (from, before), (spin, b), (*joint, *value, *limit));
                        }
                        let position = if why == Why::Jump { self.jumps_at(t, &path, &mount, a, b) } else { path.position(b) };
                        fault = furthest(fault, place(i, b, position, m.source, why));
                    }
                }
            }
            (from, before) = (Frame { turn: self.g.turns[m.turn as usize], position: m.position }, m);
        }
        let nodes: Vec<Node> = tracks.iter().filter(|t| t.alive).flat_map(|t| self.turned(t, spin)).collect();
        match fault {
            Some(fault) if nodes.is_empty() => Err(fault),
            _ if nodes.is_empty() => Err(begin(Why::Jump)),
            _ => Ok(nodes),
        }
    }

    /// Takes a track to the next look.
    fn advance(&self, t: &mut Track, all: &Branches, path: &Path, mount: &Mount, a: f64, b: f64) -> Option<Why> {
        let follow = Follow { solver: self.solver, limits: self.limits, path, mount };
        let (q, now_in) = match follow.step(all, (&t.now, t.now_in), (a, b)) {
            Ok(next) => next,
            Err(Stuck::Reach(e)) => return Some(Why::Reach(e)),
            Err(Stuck::Jump) => return Some(Why::Jump),
        };
        t.now_in = now_in;
        t.now = q;
        for i in 0..self.solver.count {
            t.low[i] = t.low[i].min(q[i]);
            t.high[i] = t.high[i].max(q[i]);
        }
        t.close = t.close.min(self.solver.closeness(&q).0);
        self.outside(t, &q)
    }

    /// How far the program's move sends a joint that is beyond its limit from this share of its first item on.
    fn farthest(&self, t: &Track, (i, last): (usize, usize), (mut from, mut before): (Frame, &Move), (spin, since): (f64, f64), (joint, value, limit): (usize, f64, f64)) -> f64 {
        const HALVINGS: u32 = 40;
        let beyond = (value - limit).signum();
        let coupled = self.limits.coupled_outside(&t.now).is_some_and(|(_, v, _)| v == value);
        let reads = |q: &Joints| value + self.limits.change(joint, coupled, &t.now, q);
        let (mut q, mut branch, mut all) = (t.now, t.now_in, Branches::NONE);
        let mut farthest = value;
        let source = self.at(i).source;
        for m in (i..=last).map_while(|k| match &self.g.items[k] {
            Item::Move(m) => (m.source == source && m.way != Way::Joint).then_some(Some(m)),
            Item::Do(_) => Some(None),
        }).flatten() {
            let path = Path::new(self.g, self.solver, &handed_on(self.g, from, before, m, spin), m);
            let mount = Mount::new(self.g, m, spin);
            let follow = Follow { solver: self.solver, limits: self.limits, path: &path, mount: &mount };
            let looks = path.looks();
            let share = |k: usize| k as f64 / looks as f64;
            let mut goes = |(a, q, branch): (f64, &Joints, u8), b: f64| {
                self.solver.all(&mount.flange(&path.at(b)), &mut all).ok()?;
                follow.step(&all, (q, branch), (a, b)).ok()
            };
            let begun = if std::ptr::eq(m, self.at(i)) { since } else { 0.0 };
            let (mut a, mut peak) = (begun, None);
            for b in (1..=looks).map(share).filter(|b| *b > begun) {
                let Some(next) = goes((a, &q, branch), b) else { return farthest };
                if (reads(&next.0) - farthest) * beyond > 0.0 {
                    (farthest, peak) = (reads(&next.0), Some((a, q, branch)));
                }
                (a, (q, branch)) = (b, next);
            }
            // It turns round between two looks.
            if let Some((low, p, branch)) = peak {
                let (mut a, mut b) = (low, (low + 2.0 / looks as f64).min(1.0));
                for _ in 0..HALVINGS {
                    let [c, d] = [a + (b - a) / 3.0, b - (b - a) / 3.0];
                    let [Some(at_c), Some(at_d)] = [c, d].map(|s| goes((low, &p, branch), s).map(|n| reads(&n.0))) else { break };
                    if (at_c - farthest) * beyond > 1e-6 { farthest = at_c }
                    if (at_d - at_c) * beyond > 0.0 { a = c } else { b = d }
                }
            }
            (from, before) = (Frame { turn: self.g.turns[m.turn as usize], position: m.position }, m);
        }
        farthest
    }

    /// Where between two looks a track has to jump.
    fn jumps_at(&self, t: &Track, path: &Path, mount: &Mount, a: f64, b: f64) -> [f64; 3] {
        const HALVINGS: u32 = 24;
        let follow = Follow { solver: self.solver, limits: self.limits, path, mount };
        let (mut good, mut bad) = (a, b);
        let mut all = Branches::NONE;
        for _ in 0..HALVINGS {
            let middle = (good + bad) / 2.0;
            let goes = self.solver.all(&mount.flange(&path.at(middle)), &mut all).is_ok() && follow.step(&all, (&t.now, t.now_in), (a, middle)).is_ok();
            *(if goes { &mut good } else { &mut bad }) = middle;
        }
        path.position(bad)
    }

    fn outside(&self, t: &Track, q: &Joints) -> Option<Why> {
        for i in 0..self.solver.count {
            // Whole turns from where it stands: none are free.
            let turns = self.stands.map(|at| std::f64::consts::TAU * libm::round((at[i] - t.start[i]) / std::f64::consts::TAU));
            let fits = match turns {
                Some(d) => t.low[i] + d >= self.limits.min[i] && t.high[i] + d <= self.limits.max[i],
                None => self.limits.shifts(i, t.low[i], t.high[i]).is_some(),
            };
            if !fits {
                let value = q[i] + turns.unwrap_or(0.0);
                let limit = if value > self.limits.max[i] || value - self.limits.min[i] > self.limits.max[i] - value {
                    self.limits.max[i]
                } else {
                    self.limits.min[i]
                };
                return Some(Why::Limit { joint: i, value, limit, farthest: value });
            }
        }
        if let Some((joint, value, limit)) = self.limits.coupled_outside(q) {
            return Some(Why::Limit { joint, value, limit, farthest: value });
        }
        self.solver.violations(q).into_iter().next().map(Why::Condition)
    }

    /// The track with every set of whole turns that stays within the limits.
    fn turned(&self, t: &Track, spin: f64) -> Vec<Node> {
        let mut out = vec![(t.start, t.now, 0.0f64)];
        for i in 0..self.solver.count {
            let Some((first, last)) = self.limits.shifts(i, t.low[i], t.high[i]) else { return Vec::new() };
            let mut next = Vec::new();
            for (start, end, cost) in &out {
                for k in first..=last {
                    let shift = f64::from(k) * std::f64::consts::TAU;
                    let (mut s, mut e) = (*start, *end);
                    (s[i], e[i]) = (s[i] + shift, e[i] + shift);
                    let range = self.limits.max[i] - self.limits.min[i];
                    let left = (t.low[i] + shift - self.limits.min[i]).min(self.limits.max[i] - t.high[i] - shift);
                    let share = if range.is_finite() && range > 0.0 { (left / range).clamp(0.0, 0.5) } else { 0.5 };
                    next.push((s, e, cost + 0.02 / (share + 0.02)));
                }
            }
            out = next;
        }
        let stands = |q: &Joints, at: &Joints| (0..self.solver.count).all(|i| (q[i] - at[i]).abs() < 1e-6);
        if let Some(at) = self.stands.filter(|at| out.iter().any(|(start, ..)| stands(start, at))) {
            out.retain(|(start, ..)| stands(start, &at));
        }
        let close = 0.3 / (t.close + 0.05);
        out.into_iter().map(|(start, end, cost)| Node { branch: t.branch, spin, start, end, cost: cost + close }).collect()
    }

    /// Travel between two joint values: the time of the slowest joint and a little of all.
    fn travel(&self, a: &Joints, b: &Joints) -> f64 {
        let each = |i: usize| (a[i] - b[i]).abs() / self.speeds[i];
        let (mut most, mut sum) = (0.0f64, 0.0);
        for i in 0..self.solver.count {
            most = most.max(each(i));
            sum += each(i);
        }
        most + 0.1 * sum
    }

    /// One node per chain, the cheapest way from home to home.
    pub fn cheapest(&self, all: &[Vec<Node>], home: &Joints) -> Vec<Node> {
        let Some(first) = all.first() else { return Vec::new() };
        let mut cost: Vec<f64> = first.iter().map(|n| self.travel(home, &n.start) + n.cost).collect();
        let mut back: Vec<Vec<u16>> = Vec::with_capacity(all.len());
        for pair in all.windows(2) {
            let mut links = Vec::with_capacity(pair[1].len());
            let mut next = Vec::with_capacity(pair[1].len());
            for n in &pair[1] {
                let (mut best, mut from) = (f64::INFINITY, 0);
                for (k, p) in pair[0].iter().enumerate() {
                    let c = cost[k] + self.travel(&p.end, &n.start);
                    if c < best {
                        (best, from) = (c, k);
                    }
                }
                next.push(best + n.cost);
                // Nodes of a chain are few.
                links.push(u16::try_from(from).unwrap_or(0));
            }
            cost = next;
            back.push(links);
        }
        let Some(last) = all.last() else { return Vec::new() };
        let total = |i: usize| cost[i] + self.travel(&last[i].end, home);
        let mut at = (0..last.len()).min_by(|a, b| total(*a).total_cmp(&total(*b))).unwrap_or(0);
        let mut out = vec![last[at]];
        for (links, nodes) in back.iter().zip(all).rev() {
            at = usize::from(links[at]);
            out.push(nodes[at]);
        }
        out.reverse();
        out
    }
}

/// The fault that came later; of two at one place the one that says more.
fn furthest(old: Option<Fault>, new: Fault) -> Option<Fault> {
    let rank = |f: &Fault| match f.why {
        Why::Reach(_) => 0,
        Why::Condition(_) => 1,
        Why::Jump => 2,
        Why::Limit { .. } => 3,
    };
    match old {
        Some(o) if (o.item, o.share) > (new.item, new.share) => Some(o),
        Some(o) if (o.item, o.share) == (new.item, new.share) && rank(&o) >= rank(&new) => Some(o),
        _ => Some(new),
    }
}

/// The cheapest nodes, every configuration represented.
fn trimmed(mut nodes: Vec<Node>, most: usize) -> Vec<Node> {
    nodes.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    if nodes.len() <= most {
        return nodes;
    }
    let mut kept: Vec<Node> = Vec::with_capacity(most);
    for branch in 0..8 {
        kept.extend(nodes.iter().filter(|n| n.branch == branch).take(most / 8));
    }
    for n in &nodes {
        if kept.len() >= most {
            break;
        }
        if !kept.iter().any(|k| k.branch == n.branch && k.spin == n.spin && k.start == n.start) {
            kept.push(*n);
        }
    }
    kept.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    kept
}
