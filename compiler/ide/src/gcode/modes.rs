//! Modal state as codes and sentences.

use gr_canon::{Plane, Units};
use gr_interp::{Modal, Side};
use gr_ir::geometry::{ArcShape, Extent, Length, length};
use gr_ir::measure::{Rates, Totals, measure};
use gr_ir::{Op, Program};

use super::doc::{code_name, number};

/// Axis letters in the order of positions.
pub const AXES: [char; 9] = ['X', 'Y', 'Z', 'A', 'B', 'C', 'U', 'V', 'W'];

/// The active code of every modal group that matters to readers.
pub fn codes(m: &Modal) -> Vec<String> {
    let mut codes = Vec::new();
    if m.motion >= 0 {
        codes.push(code_name(b'g', f64::from(m.motion) / 10.0));
    }
    codes.push(m.plane().code().into());
    codes.push(if m.units() == Units::Inch { "G20" } else { "G21" }.into());
    codes.push(match m.side() {
        Side::Off => "G40",
        Side::Left => "G41",
        Side::Right => "G42",
    }.into());
    codes.push(if m.tool_offset.iter().all(|v| *v == 0.0) { "G49" } else { "G43" }.into());
    codes.push(match m.origin_index {
        1..=6 => format!("G{}", 53 + m.origin_index),
        n => format!("G59.{}", n - 6),
    });
    codes.push(["G61", "G61.1", "G64"][usize::from(m.path_mode.min(2))].into());
    codes.push(if m.incremental != 0 { "G91" } else { "G90" }.into());
    if m.ijk_absolute != 0 {
        codes.push("G90.1".into());
    }
    codes.push(["G94", "G93", "G95"][usize::from(m.feed_mode.min(2))].into());
    codes.push(if m.retract_r != 0 { "G99" } else { "G98" }.into());
    let s = m.active_spindle.clamp(0, 7) as usize;
    codes.push(if m.css[s] != 0 { "G96" } else { "G97" }.into());
    codes.push(["M5", "M3", "M4"][usize::from(m.turning[s].min(2))].into());
    codes.push(match (m.mist != 0, m.flood != 0) {
        (false, false) => "M9".into(),
        (true, false) => "M7".into(),
        (false, true) => "M8".into(),
        (true, true) => "M7 M8".into(),
    });
    if m.lathe_diameter != 0 {
        codes.push("G7".into());
    }
    codes
}

/// `X10 Y5`: axes that differ, or all three linear ones.
pub fn position(m: &Modal, others: Option<&Modal>) -> String {
    let places = if m.units() == Units::Inch { 4 } else { 3 };
    let shown = |i: usize| match others {
        Some(before) => m.current[i] != before.current[i],
        None => i < 3 || m.current[i] != 0.0,
    };
    let words: Vec<String> = (0..9).filter(|i| shown(*i)).map(|i| format!("{}{}", AXES[i], number(m.current[i], places))).collect();
    words.join(" ")
}

/// What the moves of a block come to.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Moves {
    /// Sums.
    pub totals: Totals,
    /// Arcs, in program units.
    pub arc: Option<ArcFacts>,
    /// Box around the moves, mm.
    pub extent: Extent,
    /// Greatest feed, mm/min.
    pub feed: f64,
}

/// An arc as people read it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArcFacts {
    /// Centre, program units.
    pub center: [f64; 3],
    /// Radius at start and end, program units.
    pub radius: [f64; 2],
    /// Degrees, positive counter-clockwise.
    pub sweep: f64,
    /// The plane's axes.
    pub plane: Plane,
}

/// Adds up the moves of a block.
pub fn moves(program: &Program, units: Units) -> Moves {
    let scale = if units == Units::Inch { 25.4 } else { 1.0 };
    let mut out = Moves::default();
    let mut cursor = program.cursor();
    while let Some(view) = cursor.next() {
        out.totals.add(&measure(&view, &Rates::default()));
        if !view.op.moves() {
            continue;
        }
        out.extent.add_move(&view.op, view.start, view.end);
        if let Op::Arc(arc) = &view.op {
            let shape = ArcShape::new(arc, view.start, view.end);
            let plane = if let gr_ir::ArcPlane::Work(plane) = arc.plane { plane } else { Plane::Xy };
            out.arc = Some(ArcFacts {
                center: shape.center.map(|v| v / scale),
                radius: [shape.radius / scale, shape.end_radius / scale],
                sweep: shape.sweep.to_degrees(),
                plane,
            });
        }
        if view.op.feeds() {
            let t = measure(&view, &Rates::default());
            if let (Length::Linear(mm), true) = (length(&view.op, view.start, view.end), t.feed_ns > 0) {
                out.feed = out.feed.max(mm / (t.feed_ns as f64 / 1e9) * 60.0);
            }
        }
    }
    out
}
