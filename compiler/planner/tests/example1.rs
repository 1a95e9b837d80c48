//! Example 1 of ISO 14649-11 twice: as features, by the system of Florianópolis 2016, and as explicit tool paths
//! written here from the coordinates that its author printed (Appendix C, Adept One, 39 of 842 points). Both are the
//! same motion.

mod judge;

use gr_ir::Op;
use gr_planner::reference::ufsc2016::points;
use gr_planner::{Options, plan, process};
use gr_text::FileId;
use judge::part::Part;

const PART1: &str = include_str!("../../../tests/golden/ufsc2016/example1.p21");
const PRINTED: &str = include_str!("../../../tests/golden/ufsc2016/appC_ex1_adept_one.csv");

/// Runs of rows that follow each other, in the frame of the part: the table lies at 300,300,745, the part on it at
/// 0,10,0 (Table 5.1).
fn printed() -> Vec<Vec<(usize, [f64; 3])>> {
    let mut out: Vec<Vec<(usize, [f64; 3])>> = Vec::new();
    for line in PRINTED.lines().skip(1) {
        let v: Vec<f64> = line.split(',').map(|c| c.trim().parse().expect("a number")).collect();
        // Travelled and its error: the target to more digits than it is printed with.
        let row = (v[0] as usize, [v[1] + v[7] - 300.0, v[2] + v[8] - 310.0, v[3] + v[9] - 745.0]);
        match out.last_mut() {
            Some(run) if run.last().is_some_and(|l| l.0 + 1 == row.0) => run.push(row),
            _ => out.push(vec![row]),
        }
    }
    out
}

#[test]
fn features_and_printed_paths_are_the_same_motion() {
    let runs = printed();
    assert_eq!(runs.iter().map(Vec::len).sum::<usize>(), 39);
    let mut p = Part::new([100.0, 120.0, 50.0]);
    let tool = p.tool("ENDMILL", 20.0, 0.0, None);
    let (t, f) = (p.technology(), p.functions());
    let mut wanted = Vec::new();
    for run in &runs {
        let ids: Vec<String> = run.iter().map(|r| format!("#{}", p.point(r.1))).collect();
        let line = p.add(format!("POLYLINE('rows {} to {}',({}))", run[0].0, run[run.len() - 1].0, ids.join(",")));
        let path = p.add(format!("CUTTER_LOCATION_TRAJECTORY(.T.,.TRAJECTORY_PATH.,$,$,$,.T.,#{line},$,$)"));
        let list = p.add(format!("TOOLPATH_LIST((#{path}))"));
        let op = p.add(format!("FREEFORM_OPERATION(#{list},$,'op',5.,$,#{tool},#{t},#{f},$,$,$,$)"));
        p.machine("TOOLPATH_FEATURE", &[op], [0.0; 3], Some(0.0), "");
        wanted.push(run.iter().map(|r| r.1).collect::<Vec<_>>());
    }
    let (planned, out) = plan(p.text().as_bytes(), FileId(0), &Options::default());
    let planned = planned.unwrap_or_else(|| panic!("{out:#?}"));
    // The explicit paths, run by run, as the motion has them.
    let mut made: Vec<Vec<[f64; 3]>> = Vec::new();
    let mut inside = false;
    for s in planned.program.steps() {
        match s.op {
            Op::Begin { marker: gr_ir::Marker::Feature, .. } => {
                made.push(Vec::new());
                inside = true;
            }
            Op::Close(gr_ir::Marker::Feature) => inside = false,
            op if op.moves() && inside => made.last_mut().expect("begun").push(s.end.xyz()),
            _ => {}
        }
    }
    // The same rows of the part as features.
    let (features, _, _) = process(PART1.as_bytes(), FileId(0), None);
    let all = points(&features.expect("a process"), FileId(0)).expect("points");
    for (run, made) in runs.iter().zip(&made) {
        let mut at = made.iter();
        for (row, _) in run {
            // Two rows at one place are one move.
            let from_features = all[row - 1].at;
            let near = |to: &[f64; 3]| (0..3).all(|i| (to[i] - from_features[i]).abs() < 1.1e-5);
            let here = at.clone().next().is_some_and(near) || made.first().is_some_and(near) || at.any(near);
            let again = *row > run[0].0 && all[row - 2].at == from_features;
            assert!(here || again, "row {row}: {from_features:?} in {made:?}");
        }
    }
}
