//! Parts that a height field cannot judge: T-slots, threads, back boring, and a plate with a hole of each drilling
//! operation.

use super::cases::{BLOCK, TOP};
use super::part::{Mill, Part};

pub fn tee(ends: [&str; 2], d: f64, edge: f64) -> Part {
    let mut p = Part::new(BLOCK);
    let neck = p.tool("ENDMILL", 6.0, 0.0, None);
    let dim = p.add(format!("MILLING_TOOL_DIMENSION({d:?},$,$,{edge:?},0.,$,$)"));
    let body = p.add(format!("T_SLOT_MILL(#{dim},6,.RIGHT.,.F.,$,$)"));
    let cut = p.add("CUTTING_COMPONENT(90.,$,$,$,$)".into());
    let bar = p.add(format!("MILLING_CUTTING_TOOL('T',#{body},(#{cut}),$,$,$)"));
    let ops = [neck, bar].map(|t| p.mill(&Mill::new("BOTTOM_AND_SIDE_ROUGH_MILLING", t, 2.5, 3.0)));
    let along = p.direction([1.0, 0.0, 0.0]);
    let length = p.length(60.0);
    let path = p.add(format!("LINEAR_PATH($,#{length},#{along})"));
    let [w, bw, bd, zero] = [8.0, 16.0, 4.0, 0.0].map(|v| p.length(v));
    let section = p.add(format!("TEE_PROFILE($,0.,0.,#{bw},#{bd},#{zero},#{w},#{zero},#{zero})"));
    let ends = ends.map(|e| p.add(e.into()));
    p.machine("SLOT", &ops, [0.0, 20.0, TOP], Some(10.0), &format!(",#{path},#{section},(#{},#{})", ends[0], ends[1]));
    p
}

pub fn thread(inner: bool, hand: &str, climb: &str, edge: f64) -> Part {
    let mut p = Part::new(BLOCK);
    let dim = p.add(format!("MILLING_TOOL_DIMENSION(8.,$,$,{edge:?},0.,$,$)"));
    let body = p.add(format!("THREAD_MILL(#{dim},3,.RIGHT.,.F.,$)"));
    let cut = p.add("CUTTING_COMPONENT(90.,$,$,$,$)".into());
    let tool = p.add(format!("MILLING_CUTTING_TOOL('thread mill',#{body},(#{cut}),$,$,$)"));
    let op = p.mill(&Mill::new("SIDE_FINISH_MILLING", tool, 20.0, 1.0).strategy(&format!("CONTOUR_PARALLEL($,$,$,.{climb}.)")));
    let bore = p.add("FLAT_HOLE_BOTTOM()".into());
    let size = p.length(14.0);
    let hole = p.feature("ROUND_HOLE", &[], [30.0, 20.0, TOP], Some(10.0), &format!(",#{size},$,#{bore}"));
    let place = p.place([0.0; 3]);
    let area = p.add(format!("PARTIAL_AREA_DEFINITION(9.,#{place},$)"));
    let [fit, form, hand] = ["6H", "M", hand].map(|t| p.add(format!("DESCRIPTIVE_PARAMETER('p','{t}')")));
    let count = p.add("NUMERIC_PARAMETER('threads per inch',12.7,'1/in')".into());
    let flag = if inner { ".T." } else { ".F." };
    let doc = p.add("SPECIFICATION((),'ISO 724',$,$)".into());
    let f = p.feature("CATALOGUE_THREAD", &[op], [30.0, 20.0, TOP], Some(9.0), &format!(",#{area},(#{hole}),{flag},$,#{fit},#{form},16.,#{count},#{hand},#{doc}"));
    p.step(f, op);
    p
}

pub fn back(previous: &str, direction: bool) -> Part {
    let mut p = Part::new(BLOCK);
    let dim = p.add("MILLING_TOOL_DIMENSION(14.,$,$,2.,0.,$,$)".into());
    let body = p.add(format!("BORING_TOOL(#{dim},1,.RIGHT.,.F.,$,.F.)"));
    let cut = p.add("CUTTING_COMPONENT(90.,$,$,$,$)".into());
    let edge = if direction { format!("#{}", p.direction([1.0, 0.0, 0.0])) } else { "$".into() };
    let tool = p.add(format!("MILLING_CUTTING_TOOL('bar',#{body},(#{cut}),$,{edge},5.)"));
    let (t, f) = (p.technology(), p.functions());
    let op = p.add(format!("BACK_BORING($,$,'op',5.,$,#{tool},#{t},#{f},$,3.,{previous},0.5,$,$)"));
    let size = p.length(14.0);
    let bottom = p.add("FLAT_HOLE_BOTTOM()".into());
    p.machine("ROUND_HOLE", &[op], [30.0, 20.0, TOP], Some(12.0), &format!(",#{size},$,#{bottom}"));
    p
}

/// From left to right: centre drilling, drilling, in steps, boring, reaming, tapping, countersinking.
pub fn holes() -> Part {
    let mut p = Part::new(BLOCK);
    let all = [
        ("CENTER_DRILLING", "CENTERDRILL", "", "3.", ""),
        ("DRILLING", "TWIST_DRILL", "", "$", ""),
        ("MULTISTEP_DRILLING", "TWIST_DRILL", "", "9.", ",2.,3.,3.,0.25"),
        ("BORING", "BORING_TOOL", ",.F.", "9.", ",.F.,0.5,$"),
        ("REAMING", "REAMER", "", "9.", ",.F.,$,$"),
        ("TAPPING", "TAP", "", "9.", ",.T."),
        ("COUNTER_SINKING", "COUNTERSINK", ",$", "2.", ""),
    ];
    for (k, (keyword, tool, own, depth, more)) in all.into_iter().enumerate() {
        let dim = p.add("MILLING_TOOL_DIMENSION(6.,59.,$,40.,0.,$,$)".into());
        let body = p.add(format!("{tool}(#{dim},2,.RIGHT.,.F.,${own})"));
        let cut = p.add("CUTTING_COMPONENT(90.,$,$,$,$)".into());
        let tool = p.add(format!("MILLING_CUTTING_TOOL('{tool}',#{body},(#{cut}),70.,$,$)"));
        let (t, f) = (p.technology(), p.functions());
        let op = p.add(format!("{keyword}($,$,'op',5.,$,#{tool},#{t},#{f},$,{depth},$,$,$,${more})"));
        let (size, b) = (p.length(6.0), p.add("CONICAL_HOLE_BOTTOM(59.,$)".into()));
        p.machine("ROUND_HOLE", &[op], [6.0 + 8.0 * k as f64, 20.0, TOP], Some(9.0), &format!(",#{size},$,#{b}"));
    }
    p
}
