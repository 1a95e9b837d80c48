//! How far a path is from the border of the reach. A lattice over a box of space knows which of its nodes are within
//! reach; from it come the distance of any place from the nearest node that is not, and the border itself near a path.
//! Holes in the reach that are narrower than the lattice are not seen.

use gr_machine::math::{V3, add, dot, norm, scale, sub};

/// What looks whether a place is within reach.
pub type Reaches<'a> = dyn Fn(V3) -> bool + Sync + 'a;

/// A box no thicker than this is flat, mm: a planar machine's.
const FLAT: f64 = 1e-6;
/// The nodes are no nearer to each other than this, mm.
const FINEST: f64 = 0.25;
/// Most nodes along an axis.
const LONGEST: f64 = 400.0;

/// Nodes at equal distances over a box.
pub struct Lattice {
    low: V3,
    step: f64,
    size: [usize; 3],
    /// Which nodes are within reach, X first.
    reached: Vec<bool>,
}

impl Lattice {
    /// Of about so many nodes; on all cores. `progress` hears how many layers of how many are done.
    pub fn new(
        space: [(f64, f64); 3],
        nodes: usize,
        reaches: &Reaches<'_>,
        progress: &dyn Fn(usize, usize),
    ) -> Lattice {
        let span = space.map(|(a, b)| (b - a).max(0.0));
        let wide: Vec<f64> = span.into_iter().filter(|s| *s > FLAT).collect();
        let volume: f64 = wide.iter().product();
        let step = libm::pow(volume / nodes.max(1) as f64, 1.0 / wide.len().max(1) as f64);
        let step = step.max(wide.iter().fold(0.0, |m: f64, s| m.max(*s)) / LONGEST).max(FINEST);
        let size = span.map(|s| if s > FLAT { libm::ceil(s / step) as usize + 1 } else { 1 });
        let low = [0, 1, 2].map(|i| (space[i].0 + space[i].1 - (size[i] - 1) as f64 * step) / 2.0);
        let mut out = Lattice { low, step, size, reached: Vec::new() };
        let mut reached = vec![false; size.iter().product()];
        let layer = size[0] * size[1];
        let threads = std::thread::available_parallelism().map_or(1, usize::from).min(16);
        let look = |(from, cells): (usize, &mut [bool])| {
            cells.iter_mut().enumerate().for_each(|(n, c)| *c = reaches(out.place(from + n)))
        };
        for (turn, some) in reached.chunks_mut(layer * threads).enumerate() {
            let done = turn * threads;
            std::thread::scope(|s| {
                for (k, cells) in some.chunks_mut(layer).enumerate() {
                    s.spawn(move || look(((done + k) * layer, cells)));
                }
            });
            progress((done + threads).min(size[2]), size[2]);
        }
        out.reached = reached;
        out
    }

    /// Distance of neighbouring nodes, mm.
    pub fn step(&self) -> f64 {
        self.step
    }

    /// Least and greatest coordinate of the nodes within reach.
    pub fn span(&self, axis: usize) -> Option<(f64, f64)> {
        let some = (0..self.reached.len()).filter(|n| self.reached[*n]).map(|n| self.place(n)[axis]);
        some.fold(None, |ends: Option<(f64, f64)>, v| Some(ends.map_or((v, v), |(a, b)| (a.min(v), b.max(v)))))
    }

    fn place(&self, n: usize) -> V3 {
        let [x, y, _] = self.size;
        let at = [n % x, n / x % y, n / (x * y)];
        [0, 1, 2].map(|i| self.low[i] + at[i] as f64 * self.step)
    }

    fn nearest(&self, p: V3) -> usize {
        let at = [0, 1, 2]
            .map(|i| libm::round((p[i] - self.low[i]) / self.step).clamp(0.0, (self.size[i] - 1) as f64) as usize);
        at[0] + self.size[0] * (at[1] + self.size[1] * at[2])
    }

    /// Distance of every node from the nearest one that is out of reach or on the edge of the box, mm.
    pub fn free(&self) -> Vec<f32> {
        self.distances(|n| !self.reached[n] || self.on_edge(n))
    }

    fn on_edge(&self, n: usize) -> bool {
        let [x, y, _] = self.size;
        let at = [n % x, n / x % y, n / (x * y)];
        at.iter().zip(self.size).any(|(at, size)| size > 1 && (*at == 0 || *at == size - 1))
    }

    /// Distance of every node from the nearest of some, mm; infinite when there are none. One axis after the other: the
    /// least square of the distance within a line, then within a layer, then in space.
    fn distances(&self, some: impl Fn(usize) -> bool) -> Vec<f32> {
        let mut square: Vec<f32> = (0..self.reached.len()).map(|n| if some(n) { 0.0 } else { f32::INFINITY }).collect();
        let mut stride = 1;
        for size in self.size {
            for start in (0..square.len()).filter(|n| n / stride % size == 0) {
                let line: Vec<f32> = (0..size).map(|i| square[start + i * stride]).collect();
                (0..size).for_each(|i| square[start + i * stride] = within_line(&line, i));
            }
            stride *= size;
        }
        square.into_iter().map(|s| s.sqrt() * self.step as f32).collect()
    }

    /// What such distances are between the nodes; 0 outside the box.
    pub fn between(&self, distances: &[f32], p: V3) -> f64 {
        let (mut first, mut share, mut stride) = (0, [(0, 0.0); 3], 1);
        for i in 0..3 {
            if self.size[i] > 1 {
                let along = (p[i] - self.low[i]) / self.step;
                if !(along >= 0.0 && along <= (self.size[i] - 1) as f64) {
                    return 0.0;
                }
                let node = (along as usize).min(self.size[i] - 2);
                first += node * stride;
                share[i] = (stride, along - node as f64);
            }
            stride *= self.size[i];
        }
        let corner = |k: usize| {
            let (mut n, mut weight) = (first, 1.0);
            for (i, (stride, share)) in share.iter().enumerate() {
                let far = k >> i & 1 == 1;
                n += if far { *stride } else { 0 };
                weight *= if far { *share } else { 1.0 - share };
            }
            // Nothing of an infinite distance is nothing.
            if weight > 0.0 { weight * f64::from(distances[n]) } else { 0.0 }
        };
        (0..8).map(corner).sum()
    }
}

fn within_line(line: &[f32], i: usize) -> f32 {
    let mut best = line[i];
    for k in 1..line.len() {
        let far = (k * k) as f32;
        if far >= best {
            break;
        }
        for other in [i.checked_sub(k), Some(i + k)].into_iter().flatten().filter_map(|n| line.get(n)) {
            best = best.min(other + far);
        }
    }
    best
}

/// Fineness of a way across the border.
const HALVINGS: u32 = 24;
/// So often the neighbourhood of the nearest place of the border is looked at.
const ROUNDS: u32 = 14;

/// The nearest place out of reach that is known.
struct Nearest<'a> {
    points: &'a [V3],
    reaches: &'a Reaches<'a>,
    distance: f64,
    place: Option<V3>,
}

impl Nearest<'_> {
    /// The border on the way from the path to a place out of reach.
    fn look(&mut self, out: V3) {
        let far = |p: &&V3| {
            let way = sub(out, **p);
            dot(way, way)
        };
        let Some(from) = self.points.iter().min_by(|a, b| far(a).total_cmp(&far(b))) else { return };
        let way = sub(out, *from);
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let mid = (low + high) / 2.0;
            if (self.reaches)(add(*from, scale(way, mid))) { low = mid } else { high = mid }
        }
        if low * norm(way) < self.distance {
            self.distance = low * norm(way);
            self.place = Some(add(*from, scale(way, high)));
        }
    }
}

/// How far the points may be moved together any way, up to `most` along each axis, until the first of them is out of
/// reach, mm; and how far the places are apart that were looked at for it. The points themselves are within reach.
pub fn border(points: &[V3], most: V3, nodes: usize, reaches: &Reaches<'_>) -> (f64, f64) {
    let ends = |i: usize| {
        points.iter().map(|p| p[i]).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)))
    };
    let space = [0, 1, 2].map(|i| (ends(i).0 - most[i], ends(i).1 + most[i]));
    let mut nearest = Nearest { points, reaches, distance: most.into_iter().fold(0.0, f64::max), place: None };
    if points.is_empty() {
        return (nearest.distance, 0.0);
    }
    let lattice = Lattice::new(space, nodes, reaches, &|_, _| {});
    let mut on_path = vec![false; lattice.reached.len()];
    points.iter().for_each(|p| on_path[lattice.nearest(*p)] = true);
    // From the nodes next to the path, so wrong by up to a node's distance.
    let far = lattice.distances(|n| on_path[n]);
    let out = || (0..far.len()).filter(|n| !lattice.reached[*n]);
    let near = out().map(|n| far[n]).fold(f32::INFINITY, f32::min) + 2.5 * lattice.step as f32;
    out().filter(|n| far[*n] <= near).for_each(|n| nearest.look(lattice.place(n)));
    // The border may come nearer between the nodes.
    let mut step = lattice.step / 2.0;
    for _ in 0..ROUNDS {
        let Some(place) = nearest.place else { break };
        let before = nearest.distance;
        for n in 0..125 {
            let by = [n % 5, n / 5 % 5, n / 25].map(|v| (f64::from(v) - 2.0) * step);
            let p = add(place, [0, 1, 2].map(|i| if most[i] > 0.0 { by[i] } else { 0.0 }));
            if !reaches(p) {
                nearest.look(p);
            }
        }
        if nearest.distance > before - 0.1 * step {
            step /= 2.0;
        }
    }
    (nearest.distance, lattice.step)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const BOX: [(f64, f64); 3] = [(-100.0, 100.0), (-80.0, 80.0), (0.0, 60.0)];

    #[test]
    fn distances_of_a_lattice() {
        let wall = |p: V3| p[0] < 30.0;
        let lattice = Lattice::new(BOX, 4000, &wall, &|_, _| {});
        let far = lattice.distances(|n| !lattice.reached[n]);
        let first = (0..lattice.size[0]).map(|i| lattice.place(i)[0]).find(|x| *x >= 30.0).unwrap();
        for p in [[-50.0, 10.0, 30.0], [0.0, -79.0, 5.0], [20.0, 3.0, 59.0]] {
            assert!((lattice.between(&far, p) - (first - p[0])).abs() < 1e-3, "{p:?}");
        }
        assert_eq!(lattice.between(&far, [-120.0, 0.0, 30.0]), 0.0);
        assert_eq!(lattice.between(&far, [90.0, 0.0, 30.0]), 0.0);
        // Its own edge ends the reach too, but in a plane only that within the plane.
        let floor = lattice.between(&lattice.free(), [-10.0, 0.0, 15.0]) - 15.0;
        assert!(floor >= -1e-3 && floor < lattice.step, "{floor}");
        let flat = Lattice::new([BOX[0], BOX[1], (0.0, 0.0)], 500, &wall, &|_, _| {});
        assert!(flat.size[2] == 1 && flat.between(&flat.free(), [0.0; 3]) > 25.0);
        let all = Lattice::new([(0.0, 0.0); 3], 500, &|_| true, &|_, _| {});
        assert!(all.between(&all.free(), [0.0; 3]).is_infinite());
    }

    /// By all pairs.
    #[test]
    fn distances_by_axis_are_those_by_pairs() {
        let some = |n: usize| n % 37 == 5 || n % 101 == 3;
        let lattice = Lattice::new(BOX, 700, &|_| true, &|_, _| {});
        let fast = lattice.distances(some);
        let seeds: Vec<V3> = (0..fast.len()).filter(|n| some(*n)).map(|n| lattice.place(n)).collect();
        for (n, d) in fast.iter().enumerate() {
            let least = seeds.iter().map(|s| norm(sub(*s, lattice.place(n)))).fold(f64::INFINITY, f64::min);
            assert!((f64::from(*d) - least).abs() < 1e-3);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        /// A pillar, a wall and the edge of two walls, each with its distance by formula.
        #[test]
        fn borders_of_known_shapes(turn in 0.0..6.2f64, far in 20.0..90.0f64, radius in 15.0..60.0f64) {
            let (s, k) = libm::sincos(turn);
            let centre = [k * (far + radius), s * (far + radius)];
            let pillar = move |p: V3| libm::hypot(p[0] - centre[0], p[1] - centre[1]) > radius;
            let wall = move |p: V3| p[0] * k + p[1] * s < far;
            // Its edge points at the path.
            let edge = move |p: V3| {
                let (a, b) = (p[0] * k + p[1] * s - far, p[1] * k - p[0] * s);
                a < b.abs()
            };
            let path: Vec<V3> = (0..20).map(|i| [0.0, 0.0, f64::from(i)]).collect();
            let (d, apart) = border(&path, [120.0; 3], 20_000, &pillar);
            prop_assert!((d - far).abs() < 0.05, "pillar {d} for {far}, {apart}");
            prop_assert!((border(&path, [120.0; 3], 20_000, &wall).0 - far).abs() < 0.05);
            let d = border(&path, [120.0; 3], 20_000, &edge).0;
            prop_assert!((d - far).abs() < 0.05, "edge {d} for {far}");
            // No further than is looked at, and no way but in the plane where the machine has no other.
            prop_assert_eq!(border(&path, [10.0; 3], 2_000, &wall).0, 10.0);
            let ceiling = |p: V3| dot(p, [0.0, 0.0, 1.0]) < 30.0 && wall(p);
            prop_assert!((border(&path[..1], [120.0, 120.0, 0.0], 4_000, &ceiling).0 - far).abs() < 0.05);
        }
    }
}
