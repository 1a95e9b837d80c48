//! What is left of the raw block while it is cut: heights over a grid, for the planner's own rapids. Feed moves lower
//! it, rapids ask it. It decides how a place is reached, never what is cut; tools that stand upright only.

use std::collections::BTreeMap;

use crate::process::Tool;

/// Most cells. Larger parts have coarser ones, and none where a cell would be wider than the smallest tool.
const MOST_CELLS: f64 = 16e6;
/// Cells in the radius of the smallest tool.
const FINENESS: f64 = 6.0;
/// Cells along the longer side, at least and at most where the tools leave the choice.
const ALONG: [f64; 2] = [48.0, 4000.0];
/// Material that no move is lifted for, mm.
const FILM: f64 = 1e-3;
/// Material beside a tool that none of its moves has touched, mm: arcs are taken off by chords.
const RIM: f64 = 0.05;

/// The shape of a tool below its shank.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Cutter {
    radius: f64,
    /// Radius of its rounded edge.
    edge: f64,
    /// Rise of its point for a step outwards; 0 for a flat face.
    rise: f64,
}

impl Cutter {
    /// None for tools that cut below what they pass.
    pub fn of(tool: &Tool) -> Option<Cutter> {
        if tool.undercuts() || !(tool.diameter > 0.0 && tool.diameter < 1e6) {
            return None;
        }
        let rise = tool.tip_angle.filter(|_| tool.is_pointed()).map_or(0.0, |a| 1.0 / libm::tan(a));
        let radius = tool.diameter / 2.0;
        let rise = if rise.is_finite() && rise > 0.0 { rise } else { 0.0 };
        Some(Cutter { radius, edge: tool.edge_radius.clamp(0.0, radius), rise })
    }
    /// It cuts a flat floor, as wide as it is.
    fn flat(&self) -> bool {
        self.rise == 0.0 && self.edge == 0.0
    }
    /// Height of its surface over its tip, at a distance from its axis.
    fn over_tip(&self, d: f64) -> f64 {
        let into = d - (self.radius - self.edge);
        if self.rise > 0.0 {
            d * self.rise
        } else if into > 0.0 && self.edge > 0.0 {
            self.edge - f64::sqrt((self.edge * self.edge - into * into).max(0.0))
        } else {
            0.0
        }
    }
}

/// A disc that goes straight.
struct Sweep {
    ends: [[f64; 3]; 2],
    reach: f64,
    /// From its way to its left border.
    across: [f64; 2],
}

impl Sweep {
    fn new(a: [f64; 3], b: [f64; 3], reach: f64) -> Sweep {
        let along = [b[0] - a[0], b[1] - a[1]];
        let length = f64::sqrt(along[0] * along[0] + along[1] * along[1]);
        let across = if length > 0.0 { [-along[1] / length * reach, along[0] / length * reach] } else { [0.0; 2] };
        Sweep { ends: [a, b], reach, across }
    }
}

pub(crate) struct Stock {
    low: [f64; 2],
    /// Edge of a cell, mm.
    cell: f64,
    n: [usize; 2],
    /// Height of the material over each cell, row by row along x.
    z: Vec<f32>,
    /// Places where a feed has ended, in millionths of a millimetre: with which tool, and how deep.
    been: BTreeMap<[i64; 2], (Cutter, f64)>,
}

impl Stock {
    /// A whole block. `smallest`: radius of the smallest tool.
    pub fn new(block: [[f64; 3]; 2], smallest: f64) -> Option<Stock> {
        let [low, high] = block;
        let size = [high[0] - low[0], high[1] - low[1]];
        let long = size[0].max(size[1]);
        if !(size.iter().all(|s| *s > 0.0) && long < 1e7 && smallest > 0.0) {
            return None;
        }
        let wanted = (smallest / FINENESS).clamp(long / ALONG[1], long / ALONG[0]);
        let cell = wanted.max(f64::sqrt(size[0] * size[1] / MOST_CELLS));
        if cell > smallest {
            return None;
        }
        let n = size.map(|s| (s / cell).ceil().max(1.0) as usize);
        Some(Stock { low: [low[0], low[1]], cell, n, z: vec![high[2] as f32; n[0] * n[1]], been: BTreeMap::new() })
    }

    fn middle(&self, axis: usize, cell: usize) -> f64 {
        self.low[axis] + (cell as f64 + 0.5) * self.cell
    }

    /// Cells along an axis whose middles lie between two coordinates.
    fn cells(&self, axis: usize, from: f64, to: f64) -> std::ops::Range<usize> {
        // Numbers of cells are small: their integers are cheaper than a rounding of reals.
        let index = |v: f64| ((v - self.low[axis]) / self.cell - 0.5).clamp(-1.0, self.n[axis] as f64);
        let (first, last) = (index(from).max(0.0), index(to));
        let below = first as usize;
        let begin = below + usize::from((below as f64) < first);
        begin..if last < 0.0 { 0 } else { (last as usize + 1).min(self.n[axis]) }
    }

    /// Cells of a row that a swept disc reaches: what two discs and the strip between them have of it is one piece.
    fn columns(&self, y: f64, sweep: &Sweep) -> std::ops::Range<usize> {
        let (mut from, mut to) = (f64::INFINITY, f64::NEG_INFINITY);
        for p in sweep.ends {
            let left = sweep.reach * sweep.reach - (y - p[1]) * (y - p[1]);
            if left >= 0.0 {
                let half = f64::sqrt(left);
                (from, to) = (from.min(p[0] - half), to.max(p[0] + half));
            }
        }
        let [a, b] = sweep.ends;
        let rise = b[1] - a[1];
        if rise != 0.0 {
            for side in [-1.0, 1.0] {
                // Where the row crosses the border of the strip.
                let share = (y - a[1] - side * sweep.across[1]) / rise;
                if (0.0..=1.0).contains(&share) {
                    let x = a[0] + share * (b[0] - a[0]) + side * sweep.across[0];
                    (from, to) = (from.min(x), to.max(x));
                }
            }
        }
        if from > to { 0..0 } else { self.cells(0, from, to) }
    }

    /// The cells under a flat tool on one height, row by row.
    fn under(&self, a: [f64; 3], b: [f64; 3], reach: f64) -> impl Iterator<Item = std::ops::Range<usize>> {
        let sweep = Sweep::new(a, b, reach);
        self.cells(1, a[1].min(b[1]) - reach, a[1].max(b[1]) + reach).filter_map(move |row| {
            let columns = self.columns(self.middle(1, row), &sweep);
            (columns.start < columns.end).then(|| row * self.n[0] + columns.start..row * self.n[0] + columns.end)
        })
    }

    /// Cells whose middle is within `reach` of a straight move, with the distance and the part of the move that is
    /// within `reach` of it: closest, first, last. A move straight up or down is near them all the way.
    fn near(&self, a: [f64; 3], b: [f64; 3], reach: f64, mut each: impl FnMut(usize, f64, [f64; 3])) {
        let along = [b[0] - a[0], b[1] - a[1]];
        let length2 = along[0] * along[0] + along[1] * along[1];
        let reach2 = reach * reach;
        let sweep = Sweep::new(a, b, reach);
        for row in self.cells(1, a[1].min(b[1]) - reach, a[1].max(b[1]) + reach) {
            let y = self.middle(1, row);
            for column in self.columns(y, &sweep) {
                let x = self.middle(0, column);
                let (dx, dy) = (x - a[0], y - a[1]);
                let at = if length2 > 0.0 { ((dx * along[0] + dy * along[1]) / length2).clamp(0.0, 1.0) } else { 0.0 };
                let (ex, ey) = (dx - at * along[0], dy - at * along[1]);
                let d2 = ex * ex + ey * ey;
                if d2 <= reach2 {
                    let half = if length2 > 0.0 { f64::sqrt((reach2 - d2) / length2) } else { 1.0 };
                    each(row * self.n[0] + column, f64::sqrt(d2), [at, (at - half).max(0.0), (at + half).min(1.0)]);
                }
            }
        }
    }

    /// A tool goes straight at feed, or stands still.
    pub fn cut(&mut self, tool: Cutter, a: [f64; 3], b: [f64; 3]) {
        let mut z = std::mem::take(&mut self.z);
        let rise = b[2] - a[2];
        if rise == 0.0 && tool.flat() {
            let height = a[2] as f32;
            for cells in self.under(a, b, tool.radius) {
                z[cells].iter_mut().for_each(|z| *z = z.min(height));
            }
            self.z = z;
            return;
        }
        self.near(a, b, tool.radius, |cell, d, [_, first, last]| {
            // The deepest it is while it is over the cell.
            let deepest = a[2] + rise * if rise > 0.0 { first } else { last };
            let height = (deepest + tool.over_tip(d)) as f32;
            if let Some(z) = z.get_mut(cell)
                && *z > height
            {
                *z = height;
            }
        });
        self.z = z;
    }

    /// A feed has ended at a point: nothing is left over it there.
    pub fn reached(&mut self, tool: Cutter, at: [f64; 3]) {
        let depth = self.been.entry(place(at)).or_insert((tool, at[2]));
        let deepest = if depth.0 == tool { depth.1.min(at[2]) } else { at[2] };
        *depth = (tool, deepest);
    }

    /// How high the tip has to stay over a point: no less than material that reaches no middle of a cell wants, no
    /// more than where the tool has been.
    pub fn blocks_way_down(&self, tool: Cutter, from: [f64; 3], to: [f64; 3]) -> Option<f64> {
        let top = self.may_block(tool, from, to)?;
        let been = self.been.get(&place(to)).filter(|b| b.0 == tool).map_or(f64::INFINITY, |b| b.1);
        let top = top.min(been);
        (top > to[2] + FILM).then_some(top)
    }

    /// How high the tip has to stay for a straight move to pass over all material; none: it meets none at any height
    /// of its own.
    pub fn blocks(&self, tool: Cutter, a: [f64; 3], b: [f64; 3]) -> Option<f64> {
        self.blocks_within(tool, (tool.radius - RIM).max(0.0), a, b)
    }

    /// The same with material that reaches no middle of a cell: a way beside it is taken for one through it.
    pub fn may_block(&self, tool: Cutter, a: [f64; 3], b: [f64; 3]) -> Option<f64> {
        self.blocks_within(tool, tool.radius + 0.75 * self.cell, a, b)
    }

    fn blocks_within(&self, tool: Cutter, reach: f64, a: [f64; 3], b: [f64; 3]) -> Option<f64> {
        let mut highest: Option<f64> = None;
        let rise = b[2] - a[2];
        if rise == 0.0 && tool.flat() {
            let top = self.under(a, b, reach).flat_map(|cells| &self.z[cells]).fold(f32::NEG_INFINITY, |a, b| a.max(*b));
            let top = f64::from(top);
            return (top > a[2] + FILM + 1e-6 * top.abs()).then_some(top);
        }
        self.near(a, b, reach, |cell, d, [_, first, last]| {
            let Some(z) = self.z.get(cell) else { return };
            let top = f64::from(*z) - tool.over_tip(d.min(tool.radius));
            let deepest = a[2] + rise * if rise > 0.0 { first } else { last };
            if top > deepest + FILM + 1e-6 * top.abs() {
                highest = Some(highest.map_or(top, |h: f64| h.max(top)));
            }
        });
        highest
    }

    /// Greatest height of the material within a disc.
    pub fn top(&self, at: [f64; 2], radius: f64) -> Option<f64> {
        let p = [at[0], at[1], 0.0];
        let mut highest: Option<f64> = None;
        self.near(p, p, radius, |cell, _, _| {
            let z = self.z.get(cell).map_or(f64::NEG_INFINITY, |z| f64::from(*z));
            highest = Some(highest.map_or(z, |h: f64| h.max(z)));
        });
        highest
    }
}

fn place(p: [f64; 3]) -> [i64; 2] {
    [(p[0] * 1e6).round() as i64, (p[1] * 1e6).round() as i64]
}

#[cfg(test)]
mod tests {
    use super::*;

    const FLAT: Cutter = Cutter { radius: 5.0, edge: 0.0, rise: 0.0 };

    fn block() -> Stock {
        Stock::new([[0.0; 3], [100.0, 60.0, 20.0]], 3.0).expect("cells")
    }

    #[test]
    fn a_rapid_is_free_where_a_tool_has_cut() {
        let mut s = block();
        let (a, b) = ([10.0, 30.0, 15.0], [90.0, 30.0, 15.0]);
        assert_eq!(s.blocks(FLAT, a, b), Some(20.0));
        s.cut(FLAT, a, b);
        assert_eq!(s.blocks(FLAT, a, b), None);
        assert_eq!(s.blocks(FLAT, [10.0, 30.0, 14.0], [90.0, 30.0, 14.0]), Some(15.0));
        assert_eq!(s.blocks(FLAT, [50.0, 30.0, 15.0], [50.0, 37.0, 15.0]), Some(20.0));
        assert_eq!(s.blocks(FLAT, [50.0, 30.0, 25.0], [50.0, 37.0, 25.0]), None);
        assert_eq!(s.blocks(FLAT, [50.0, 50.0, 25.0], [50.0, 50.0, 18.0]), Some(20.0));
        assert_eq!(s.blocks(FLAT, [50.0, 30.0, 25.0], [50.0, 30.0, 15.0]), None);
        // Beside the block there is nothing.
        assert_eq!(s.blocks(FLAT, [-6.0, 0.0, 0.0], [-6.0, 60.0, 0.0]), None);
    }

    #[test]
    fn a_way_down_is_free_beside_walls_only_where_the_tool_has_been() {
        let mut s = block();
        s.cut(FLAT, [10.0, 30.0, 15.0], [90.0, 30.0, 15.0]);
        let (high, low) = ([50.0, 30.0, 25.0], [50.0, 30.0, 10.0]);
        assert_eq!(s.blocks_way_down(FLAT, high, low), Some(20.0));
        s.reached(FLAT, [50.0, 30.0, 15.0]);
        assert_eq!(s.blocks_way_down(FLAT, high, low), Some(15.0));
        assert_eq!(s.blocks_way_down(FLAT, high, [50.0, 30.0, 15.0]), None);
        // Another tool has not.
        assert_eq!(s.blocks_way_down(Cutter { radius: 5.02, ..FLAT }, high, low), Some(20.0));
    }

    #[test]
    fn a_ramp_cuts_to_its_deepest() {
        let mut s = block();
        s.cut(FLAT, [10.0, 30.0, 20.0], [90.0, 30.0, 12.0]);
        assert_eq!(s.top([90.0, 30.0], 2.0).map(|z| (z * 10.0).round()), Some(120.0));
        assert!(s.blocks(FLAT, [90.0, 30.0, 30.0], [90.0, 30.0, 12.4]).is_none());
    }

    #[test]
    fn points_and_balls() {
        let mut s = block();
        let drill = Cutter { rise: 1.0, ..FLAT };
        s.cut(drill, [50.0, 30.0, 10.0], [50.0, 30.0, 10.0]);
        assert!(s.top([54.0, 30.0], 0.8).is_some_and(|z| (z - 14.0).abs() < 1.5));
        let ball = Cutter { edge: 5.0, ..FLAT };
        s.cut(ball, [20.0, 30.0, 10.0], [20.0, 30.0, 10.0]);
        assert!(s.top([20.0, 30.0], 1.0).is_some_and(|z| z < 10.3));
    }
}
