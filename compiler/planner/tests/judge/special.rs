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

/// A countersunk hole: 6 mm through, sunk to 12 mm, 3 mm deep, by a drill and a countersink of this half angle.
/// `tool`: COUNTERSINK, or that of the second edition of part 111; `taper`: how the cone is written, with its small end as `@`.
pub fn sunk(tool: &str, half: f64, taper: &str) -> Part {
    let mut p = Part::new(BLOCK);
    let drill = p.tool("TWIST_DRILL", 6.0, 0.0, Some(59.0));
    let sink = if tool == "COUNTERSINK" {
        let dim = p.add(format!("MILLING_TOOL_DIMENSION(16.,{half:?},$,40.,0.,$,$)"));
        let body = p.add(format!("COUNTERSINK(#{dim},2,.RIGHT.,.F.,$,$)"));
        let cut = p.add("CUTTING_COMPONENT(60.,$,$,$,$)".into());
        p.add(format!("MILLING_CUTTING_TOOL('sink',#{body},(#{cut}),$,$,$)"))
    } else {
        let cut = p.add("CUTTING_COMPONENT(60.,$,$,$,$)".into());
        p.add(format!("COUNTERSINK('sink',(#{cut}),60.,16.,40.,.RIGHT.,.F.,{:?},$,40.)", 2.0 * half))
    };
    let ops = [p.drill("DRILLING", drill, None, ""), p.drill("COUNTER_SINKING", sink, None, "")];
    let (small, wide) = (p.length(6.0), p.length(12.0));
    let taper = p.add(taper.replace('@', &format!("#{small}")));
    let (through, flat) = (p.add("THROUGH_BOTTOM_CONDITION()".into()), p.add("FLAT_HOLE_BOTTOM()".into()));
    let a = p.feature("ROUND_HOLE", &[], [0.0; 3], Some(TOP), &format!(",#{small},$,#{through}"));
    let b = p.feature("ROUND_HOLE", &[], [0.0; 3], Some(3.0), &format!(",#{wide},#{taper},#{flat}"));
    p.machine("COUNTERSUNK_HOLE", &ops, [30.0, 20.0, TOP], None, &format!(",(#{a},#{b})"));
    p
}

/// A thread of 16 mm, 8 mm long, in a hole of 14 mm. `tool`: a body with its dimension as `@`, 16 mm wide if it is a tap, else
/// 8 mm, or TAPPING_CUTTING_TOOL; `pitch` in mm as written; `start`: how far below the top it begins.
pub fn defined_thread(tool: &str, hand: &str, pitch: &str, start: f64) -> Part {
    let d = if tool.starts_with("TAP") { 16.0 } else { 8.0 };
    thread_by(tool, d, hand, pitch, start, true)
}

pub fn thread_by(tool: &str, d: f64, hand: &str, pitch: &str, start: f64, inner: bool) -> Part {
    let mut p = Part::new(BLOCK);
    let cut = p.add("CUTTING_COMPONENT(90.,$,$,$,$)".into());
    let id = if tool == "TAPPING_CUTTING_TOOL" {
        p.add(format!("TAPPING_CUTTING_TOOL('tap',(#{cut}),90.,{d:?},20.,.RIGHT.,.F.,'M',16.,2.,3.)"))
    } else {
        let dim = p.add(format!("MILLING_TOOL_DIMENSION({d:?},$,$,20.,0.,$,$)"));
        let body = p.add(tool.replace('@', &format!("#{dim}")));
        p.add(format!("MILLING_CUTTING_TOOL('threads',#{body},(#{cut}),$,$,$)"))
    };
    let op = if tool.starts_with("TAP") {
        let (t, f) = (p.add(format!("MILLING_TECHNOLOGY(0.04,.TCP.,$,{},$,.F.,.F.,.F.,$)", if tool.contains(".LEFT.") { "20." } else { "-20." })), p.functions());
        p.add(format!("TAPPING($,$,'op',5.,$,#{id},#{t},#{f},$,$,$,$,$,$,.F.)"))
    } else {
        p.mill(&Mill::new("SIDE_FINISH_MILLING", id, 20.0, 1.0))
    };
    let bore = p.add("FLAT_HOLE_BOTTOM()".into());
    let size = p.length(14.0);
    let hole = p.feature("ROUND_HOLE", &[], [30.0, 20.0, TOP], Some(11.0), &format!(",#{size},$,#{bore}"));
    let place = p.place([0.0, 0.0, -start]);
    let area = p.add(format!("PARTIAL_AREA_DEFINITION(8.,#{place},$)"));
    let [fit, form, hand] = ["6H", "M", hand].map(|t| p.add(format!("DESCRIPTIVE_PARAMETER('p','{t}')")));
    let count = p.add(format!("NUMERIC_PARAMETER('pitch',{pitch},'mm')"));
    let flag = if inner { ".T." } else { ".F." };
    let rest = format!(",#{area},(#{hole}),{flag},$,#{fit},#{form},16.,#{count},#{hand},14.7,13.8,$");
    p.machine("DEFINED_THREAD", &[op], [30.0, 20.0, TOP], Some(11.0), &rest);
    p
}

/// A T-slot with a neck of 8 mm and a bar of 16 x 4 mm, by a disc of this height; its radius and its chamfers.
pub fn tee_of(tool: &str, thickness: f64, [radius, first, second]: [f64; 3]) -> Part {
    let mut p = Part::new(BLOCK);
    let neck = p.tool("ENDMILL", 6.0, 0.0, None);
    let cut = p.add("CUTTING_COMPONENT(90.,$,$,$,$)".into());
    let bar = if tool == "T_SLOT_MILL" {
        let dim = p.add("MILLING_TOOL_DIMENSION(14.,$,$,$,0.,$,$)".into());
        let body = p.add(format!("T_SLOT_MILL(#{dim},6,.RIGHT.,.F.,$,{thickness:?})"));
        p.add(format!("MILLING_CUTTING_TOOL('T',#{body},(#{cut}),$,$,$)"))
    } else {
        p.add(format!("T_SLOT_MILL('T',(#{cut}),90.,14.,20.,.RIGHT.,.F.,6,$,{thickness:?})"))
    };
    let ops = [neck, bar].map(|t| p.mill(&Mill::new("BOTTOM_AND_SIDE_ROUGH_MILLING", t, 2.5, 3.0)));
    let along = p.direction([1.0, 0.0, 0.0]);
    let length = p.length(60.0);
    let path = p.add(format!("LINEAR_PATH($,#{length},#{along})"));
    let [w, bw, bd, r, a, b] = [8.0, 16.0, 4.0, radius, first, second].map(|v| p.length(v));
    let section = p.add(format!("TEE_PROFILE($,45.,45.,#{bw},#{bd},#{r},#{w},#{a},#{b})"));
    let ends = [p.add("OPEN_SLOT_END_TYPE()".into()), p.add("OPEN_SLOT_END_TYPE()".into())];
    p.machine("SLOT", &ops, [0.0, 20.0, TOP], Some(10.0), &format!(",#{path},#{section},(#{},#{})", ends[0], ends[1]));
    p
}

/// A hole by a boring tool: whether the spindle stops at its bottom, and whether the tool may not be drawn back turning.
pub fn bored(stops: &str, forbidden: &str) -> Part {
    let mut p = Part::new(BLOCK);
    let dim = p.add("MILLING_TOOL_DIMENSION(14.,$,$,20.,0.,$,$)".into());
    let body = p.add(format!("BORING_TOOL(#{dim},1,.RIGHT.,.F.,$,{forbidden})"));
    let cut = p.add("CUTTING_COMPONENT(90.,$,$,$,$)".into());
    let tool = p.add(format!("MILLING_CUTTING_TOOL('bar',#{body},(#{cut}),$,$,$)"));
    let op = p.drill("BORING", tool, None, &format!(",{stops},$,$"));
    let size = p.length(14.0);
    let bottom = p.add("FLAT_HOLE_BOTTOM()".into());
    p.machine("ROUND_HOLE", &[op], [30.0, 20.0, TOP], Some(6.0), &format!(",#{size},$,#{bottom}"));
    p
}

/// A pocket whose walls slope like the side of its tool.
pub fn tapered(angle: f64) -> Part {
    let mut p = Part::new(BLOCK);
    let dim = p.add("MILLING_TOOL_DIMENSION(6.,$,$,40.,0.,$,$)".into());
    let body = p.add(format!("TAPERED_ENDMILL(#{dim},2,.RIGHT.,.F.,$,{angle:?})"));
    let cut = p.add("CUTTING_COMPONENT(90.,$,$,$,$)".into());
    let tool = p.add(format!("MILLING_CUTTING_TOOL('tapered',#{body},(#{cut}),$,$,$)"));
    let o = p.mill(&Mill::new("BOTTOM_AND_SIDE_FINISH_MILLING", tool, 4.0, 3.0));
    let profile = super::cases::rectangle_profile(&mut p, 30.0, 20.0);
    super::cases::closed(&mut p, 4.0, &profile, "", Some(5.0), "PLANAR_POCKET_BOTTOM_CONDITION()", None, Some(6.0), &[o], [30.0, 20.0]);
    p
}
