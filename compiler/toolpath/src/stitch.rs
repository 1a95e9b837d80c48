//! Joins loose directed segments into closed curves or chains. Ends within a few µm of each other are one node; at a
//! node with several ways out the sharpest left turn is taken, which keeps the curves from crossing themselves.

use crate::geom::{P2, Seg};
use crate::path::{with_end, with_start};
use core::f64::consts::PI;

/// Ends nearer than this are one.
const NODE: f64 = 2e-6;

/// Curves found, and the length of what could not be joined.
pub(crate) struct Stitched {
    pub(crate) loops: Vec<Vec<Seg>>,
    pub(crate) lost: f64,
}

struct Graph {
    edges: Vec<(Seg, usize, usize)>,
    out: Vec<Vec<usize>>,
    into: Vec<usize>,
    alive: Vec<bool>,
}

fn graph(pieces: Vec<Seg>) -> Graph {
    let mut ends: Vec<(P2, usize)> = Vec::with_capacity(pieces.len() * 2);
    for (i, s) in pieces.iter().enumerate() {
        ends.push((s.a(), 2 * i));
        ends.push((s.b(), 2 * i + 1));
    }
    ends.sort_by(|l, r| l.0.x.total_cmp(&r.0.x).then(l.0.y.total_cmp(&r.0.y)).then(l.1.cmp(&r.1)));
    let mut nodes: Vec<P2> = Vec::new();
    let mut node_of = vec![0; pieces.len() * 2];
    for (p, end) in ends {
        let near = nodes.iter().enumerate().rev().take_while(|(_, q)| p.x - q.x <= NODE).find(|(_, q)| p.dist(**q) <= NODE);
        node_of[end] = match near {
            Some((k, _)) => k,
            None => {
                nodes.push(p);
                nodes.len() - 1
            }
        };
    }
    let mut edges: Vec<(Seg, usize, usize)> = Vec::new();
    let mut out: Vec<Vec<usize>> = vec![Vec::new(); nodes.len()];
    let mut into = vec![0; nodes.len()];
    for (i, s) in pieces.into_iter().enumerate() {
        let (a, b) = (node_of[2 * i], node_of[2 * i + 1]);
        if a == b && s.len() < 4.0 * NODE {
            continue;
        }
        let mid = s.at(0.5);
        if out[a].iter().any(|&e| edges[e].2 == b && edges[e].0.at(0.5).dist(mid) < 2.0 * NODE) {
            continue;
        }
        out[a].push(edges.len());
        into[b] += 1;
        edges.push((with_end(with_start(s, nodes[a]), nodes[b]), a, b));
    }
    let alive = vec![true; edges.len()];
    Graph { edges, out, into, alive }
}

impl Graph {
    fn outs(&self, node: usize) -> usize {
        self.out[node].iter().filter(|&&e| self.alive[e]).count()
    }
    /// Takes away what leads nowhere; its length.
    fn prune(&mut self) -> f64 {
        let mut lost = 0.0;
        let mut again = true;
        while again {
            again = false;
            for e in 0..self.edges.len() {
                let (s, a, b) = self.edges[e];
                if self.alive[e] && (self.into[a] == 0 || self.outs(b) == 0) {
                    self.alive[e] = false;
                    self.into[b] -= 1;
                    lost += s.len();
                    again = true;
                }
            }
        }
        lost
    }
    fn next(&self, from: &Seg, node: usize) -> Option<usize> {
        let t = from.tangent(1.0);
        let turn = |e: usize| {
            let s = &self.edges[e].0;
            // Two curves may leave in the same direction: look a little ahead.
            let u = s.tangent(0.0);
            let bend = s.at(0.1).dist(s.a()).min(1.0) * 1e-3;
            let ahead = (s.at(bend) - s.a()).unit();
            t.cross(u).atan2_of(t.dot(u)) + 1e-3 * t.cross(ahead).atan2_of(t.dot(ahead))
        };
        self.out[node].iter().copied().filter(|&e| self.alive[e]).max_by(|&l, &r| turn(l).total_cmp(&turn(r)))
    }
}

trait Atan2 {
    fn atan2_of(self, x: f64) -> f64;
}
impl Atan2 for f64 {
    fn atan2_of(self, x: f64) -> f64 {
        libm::atan2(self, x)
    }
}

/// Closed curves from directed pieces.
pub(crate) fn loops(pieces: Vec<Seg>) -> Stitched {
    let mut g = graph(pieces);
    let mut lost = g.prune();
    let mut loops = Vec::new();
    for first in 0..g.edges.len() {
        if !g.alive[first] {
            continue;
        }
        let mut chain = Vec::new();
        let home = g.edges[first].1;
        let mut e = first;
        let closed = loop {
            g.alive[e] = false;
            let (s, _, b) = g.edges[e];
            chain.push(s);
            if b == home {
                // Go on only if that keeps to the left of what began here.
                break true;
            }
            match g.next(&s, b) {
                Some(n) => e = n,
                None => break false,
            }
        };
        if closed {
            loops.push(merged(chain, true));
        } else {
            lost += chain.iter().map(Seg::len).sum::<f64>();
        }
    }
    Stitched { loops, lost }
}

/// Open chains from directed pieces, each from a node nothing leads to.
pub(crate) fn chains(pieces: Vec<Seg>) -> Vec<Vec<Seg>> {
    let mut g = graph(pieces);
    let starts: Vec<usize> = (0..g.edges.len()).filter(|&e| g.into[g.edges[e].1] == 0).collect();
    let rest: Vec<usize> = (0..g.edges.len()).collect();
    let mut found = Vec::new();
    for first in starts.into_iter().chain(rest) {
        let mut e = first;
        let mut chain = Vec::new();
        while g.alive[e] {
            g.alive[e] = false;
            let (s, _, b) = g.edges[e];
            chain.push(s);
            match g.next(&s, b) {
                Some(n) => e = n,
                None => break,
            }
        }
        if !chain.is_empty() {
            found.push(merged(chain, false));
        }
    }
    found
}

/// Neighbours on the same line or circle become one (arcs up to half a turn).
pub(crate) fn merged(chain: Vec<Seg>, closed: bool) -> Vec<Seg> {
    let mut out: Vec<Seg> = Vec::with_capacity(chain.len());
    for s in chain {
        match out.last().and_then(|l| joined(l, &s)) {
            Some(one) => {
                out.pop();
                out.push(one);
            }
            None => out.push(s),
        }
    }
    if closed && out.len() > 2 {
        if let Some(one) = out.first().and_then(|f| joined(out.last()?, f)) {
            out.pop();
            out[0] = one;
        }
    }
    out
}

fn joined(l: &Seg, r: &Seg) -> Option<Seg> {
    match (*l, *r) {
        (Seg::Line { a, b }, Seg::Line { b: e, .. }) => {
            let (u, v) = (b - a, e - b);
            let straight = u.dot(v) > 0.0 && u.cross(v).abs() <= 1e-9 * u.norm().max(v.norm());
            straight.then_some(Seg::Line { a, b: e })
        }
        (Seg::Arc { a, c, sweep, .. }, Seg::Arc { b, c: d, sweep: more, .. }) => {
            let same = c.dist(d) < 1e-9 && sweep * more > 0.0 && (a.dist(c) - b.dist(d)).abs() < 1e-8;
            (same && (sweep + more).abs() <= PI + 1e-9).then_some(Seg::Arc { a, b, c, sweep: sweep + more })
        }
        _ => None,
    }
}
