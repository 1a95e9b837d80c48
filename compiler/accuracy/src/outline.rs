//! The outline of a map: closed lines round what is within reach.

use crate::map::Map;
use std::collections::BTreeMap;

/// A corner between four nodes, counted from the lower left one.
type Corner = (i64, i64);

/// Closed lines round the nodes within reach, mm, counter-clockwise round them and clockwise round holes; the longest
/// first. Each is within a step of the grid of the border between nodes in and out of reach.
pub fn outline(map: &Map) -> Vec<Vec<[f64; 2]>> {
    let step = map.step();
    let place = |(i, j): Corner| [0, 1].map(|k| map.window[k].0 + ([i, j][k] as f64 - 0.5) * step[k]);
    let fine = libm::hypot(step[0], step[1]);
    let mut out: Vec<Vec<[f64; 2]>> = loops(map)
        .into_iter()
        .map(|corners| simplified(&corners.into_iter().map(place).collect::<Vec<_>>(), fine))
        .collect();
    out.sort_by(|a, b| around(b).total_cmp(&around(a)));
    out
}

fn around(line: &[[f64; 2]]) -> f64 {
    let next = line.iter().cycle().skip(1);
    line.iter().zip(next).map(|(a, b)| libm::hypot(b[0] - a[0], b[1] - a[1])).sum()
}

/// The sides of nodes within reach that have no such neighbour, as closed chains of corners.
fn loops(map: &Map) -> Vec<Vec<Corner>> {
    let (nx, ny) = (map.size.0 as i64, map.size.1 as i64);
    let inside = |i: i64, j: i64| i >= 0 && j >= 0 && i < nx && j < ny && !map.values[(j * nx + i) as usize].is_nan();
    // From each corner to where its sides lead, reach on the left.
    let mut sides: BTreeMap<Corner, Vec<Corner>> = BTreeMap::new();
    for j in 0..ny {
        for i in (0..nx).filter(|i| inside(*i, j)) {
            for (out, from, to) in [
                ((i, j - 1), (i, j), (i + 1, j)),
                ((i + 1, j), (i + 1, j), (i + 1, j + 1)),
                ((i, j + 1), (i + 1, j + 1), (i, j + 1)),
                ((i - 1, j), (i, j + 1), (i, j)),
            ] {
                if !inside(out.0, out.1) {
                    sides.entry(from).or_default().push(to);
                }
            }
        }
    }
    let mut all = Vec::new();
    while let Some((&start, _)) = sides.first_key_value() {
        let mut chain = vec![start];
        let mut here = start;
        while let Some(next) = step_on(&mut sides, &chain, here) {
            if next == start && !sides.contains_key(&start) {
                break;
            }
            chain.push(next);
            here = next;
        }
        all.push(chain);
    }
    all
}

/// Takes the side that leads on; where two do, the one to the left, which stays with the same node.
fn step_on(sides: &mut BTreeMap<Corner, Vec<Corner>>, chain: &[Corner], here: Corner) -> Option<Corner> {
    let list = sides.get_mut(&here)?;
    let before = chain.len().checked_sub(2).and_then(|n| chain.get(n)).copied().unwrap_or(here);
    let came = (here.0 - before.0, here.1 - before.1);
    let left = |to: &Corner| came.0 * (to.1 - here.1) - came.1 * (to.0 - here.0);
    let best = (0..list.len()).max_by_key(|n| left(&list[*n]))?;
    let next = list.swap_remove(best);
    if list.is_empty() {
        sides.remove(&here);
    }
    Some(next)
}

/// A closed line with the fewest of its points that stays within `fine` of it (Douglas and Peucker).
fn simplified(line: &[[f64; 2]], fine: f64) -> Vec<[f64; 2]> {
    let n = line.len();
    if n < 4 {
        return line.to_vec();
    }
    let far = (0..n).max_by(|a, b| apart(line[*a], line[0]).total_cmp(&apart(line[*b], line[0]))).unwrap_or(0);
    let mut keep = vec![false; n + 1];
    (keep[0], keep[far], keep[n]) = (true, true, true);
    let at = |i: usize| line[i % n];
    let mut open = vec![(0, far), (far, n)];
    while let Some((a, b)) = open.pop() {
        let off = |i: usize| distance(at(i), at(a), at(b));
        let Some(worst) = (a + 1..b).max_by(|p, q| off(*p).total_cmp(&off(*q))) else { continue };
        if off(worst) > fine {
            keep[worst] = true;
            open.extend([(a, worst), (worst, b)]);
        }
    }
    (0..n).filter(|i| keep[*i]).map(at).collect()
}

fn apart(a: [f64; 2], b: [f64; 2]) -> f64 {
    libm::hypot(a[0] - b[0], a[1] - b[1])
}

/// From a point to a straight piece.
fn distance(p: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let (d, e) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let square = d[0] * d[0] + d[1] * d[1];
    let t = if square > 0.0 { ((d[0] * e[0] + d[1] * e[1]) / square).clamp(0.0, 1.0) } else { 0.0 };
    libm::hypot(e[0] - t * d[0], e[1] - t * d[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::{Plane, Quantity};

    fn map(rows: &[&str]) -> Map {
        let size = (rows[0].len(), rows.len());
        let values = rows.iter().rev().flat_map(|r| r.chars()).map(|c| if c == '#' { 1.0 } else { f32::NAN }).collect();
        let window = [(0.0, (size.0 - 1) as f64), (0.0, (size.1 - 1) as f64)];
        Map { quantity: Quantity::Workspace, plane: Plane { axis: 2, at: 0.0 }, size, window, centred: false, elastic: false, lost: 0, values }
    }

    fn area(line: &[[f64; 2]]) -> f64 {
        let next = line.iter().cycle().skip(1);
        line.iter().zip(next).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum::<f64>() / 2.0
    }

    #[test]
    fn a_block_a_hole_and_touching_corners() {
        let block = ["....", ".##.", ".##.", "...."];
        let all = loops(&map(&block));
        assert_eq!(all.len(), 1);
        assert_eq!(all[0].len(), 8);
        let line = outline(&map(&["......", ".####.", ".####.", ".####.", ".####.", "......"]));
        assert_eq!(line.len(), 1);
        assert_eq!(line[0].len(), 4, "{line:?}");
        assert_eq!(area(&line[0]), 16.0);
        let ring = map(&["#####", "#...#", "#...#", "#...#", "#####"]);
        let all = outline(&ring);
        assert_eq!(all.len(), 2);
        assert_eq!((area(&all[0]), area(&all[1])), (25.0, -9.0));
        // Corners that only touch are two pieces.
        assert_eq!(loops(&map(&["#.", ".#"])).len(), 2);
        assert!(outline(&map(&["..", ".."])).is_empty());
    }
}
