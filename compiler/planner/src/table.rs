//! The plan as a table: what each workingstep machines, where, how deep, with which tool and technology.

use std::fmt::Write as _;

use crate::process::*;

/// The plan as text.
pub fn text(process: &Process, tools: &[Tool]) -> String {
    let mut out = String::new();
    let _ = writeln!(out, "project {}", quoted(&process.name));
    for w in &process.workpieces {
        let _ = write!(out, "workpiece #{} {}", w.origin.id, quoted(&w.name));
        if let Some((frame, size)) = &w.block {
            let _ = write!(out, "  block {} at {}", list(size), list(&frame.origin));
        }
        if !w.material.is_empty() {
            let _ = write!(out, "  material {}", quoted(&w.material));
        }
        if let Some(t) = w.tolerance {
            let _ = write!(out, "  tolerance {}", number(t));
        }
        out.push('\n');
    }
    out.push_str("\ntools\n");
    for t in tools {
        let _ = writeln!(out, "  {}", tool_line(t));
    }
    out.push_str("\nplan\n");
    let mut number = 0;
    elements(&process.elements, 1, &mut number, &mut out);
    if !process.orphans.is_empty() {
        let ids: Vec<String> = process.orphans.iter().map(|o| format!("#{}", o.id)).collect();
        let _ = writeln!(out, "\nnot executed\n  {}", ids.join(" "));
    }
    out
}

fn elements(all: &[Element], depth: usize, number: &mut usize, out: &mut String) {
    let pad = "  ".repeat(depth);
    for e in all {
        match e {
            Element::Plan(p) => {
                let _ = write!(out, "{pad}workplan #{} {}", p.origin.id, quoted(&p.name));
                if let Some(s) = &p.setup {
                    let _ = write!(out, "  setup #{} {}", s.origin.id, quoted(&s.name));
                    if let Some(f) = s.frame.filter(|f| f.origin != [0.0; 3]) {
                        let _ = write!(out, " at {}", list(&f.origin));
                    }
                    if let Some(z) = s.security {
                        let _ = write!(out, "  security plane {}", self::number(z));
                    }
                }
                out.push('\n');
                elements(&p.elements, depth + 1, number, out);
            }
            Element::Step(s) => {
                *number += 1;
                step(s, *number, &pad, out);
            }
            Element::Rapid(r) => {
                let what = if r.home { "return home" } else { "rapid movement" };
                let _ = writeln!(out, "{pad}{what} #{} {}", r.origin.id, quoted(&r.name));
            }
            Element::Function(f) => {
                let _ = writeln!(out, "{pad}{} #{} {}", function(&f.kind), f.origin.id, quoted(&f.name));
            }
            Element::Probe(p) => {
                let _ = writeln!(out, "{pad}probing #{} {} into {}", p.origin.id, quoted(&p.name), quoted(&p.variable));
            }
        }
    }
}

fn function(kind: &FunctionKind) -> String {
    match kind {
        FunctionKind::Message(text) => format!("message {}", quoted(text)),
        FunctionKind::OptionalStop => "optional stop".into(),
        FunctionKind::ProgramStop => "program stop".into(),
        FunctionKind::ExchangePallet => "exchange pallet".into(),
        FunctionKind::LoadTool(t) => format!("load tool T{}", t.number),
        FunctionKind::UnloadTool => "unload tool".into(),
    }
}

fn step(s: &Workingstep, number: usize, pad: &str, out: &mut String) {
    let (f, o) = (&s.feature, &s.operation);
    let _ = writeln!(out, "{pad}{number} workingstep #{} {}", s.origin.id, quoted(&s.name));
    let _ = writeln!(out, "{pad}  feature    #{} {} {}", f.origin.id, f.keyword, quoted(&f.name));
    let _ = writeln!(out, "{pad}  placement  {}{}", list(&f.frame.origin), axes(f));
    let _ = writeln!(out, "{pad}  depth      {}", depth(s));
    let shape = shape(&f.shape, f.depth);
    if !shape.is_empty() {
        let _ = writeln!(out, "{pad}  profile    {shape}");
    }
    let _ = writeln!(out, "{pad}  operation  #{} {}{}", o.origin.id, o.keyword, operation(o));
    let _ = writeln!(out, "{pad}  tool       {}", tool_line(&o.tool));
    let _ = writeln!(out, "{pad}  technology {}", technology(o));
}

fn axes(f: &Feature) -> String {
    let mut out = String::new();
    if !f.frame.upright() {
        let _ = write!(out, "  axis {}", list(&f.frame.z));
    }
    if f.frame.x[0] < 1.0 - 1e-9 {
        let _ = write!(out, "  x along {}", list(&f.frame.x));
    }
    if f.copies.len() > 1 {
        let _ = write!(out, "  {} places", f.copies.len());
    }
    out
}

/// Depth of the feature, and of the cut where it is another.
fn depth(s: &Workingstep) -> String {
    let own = s.feature.depth;
    match &s.operation.kind {
        OperationKind::Drill(d) => match d.depth.filter(|d| *d != own) {
            Some(cut) => format!("{}, cut {}", number(own), number(cut)),
            None => number(own),
        },
        _ => number(own),
    }
}

fn shape(shape: &Shape, depth: f64) -> String {
    match shape {
        Shape::Face { length, direction, width, .. } => format!("face length {} along {} width {}", number(*length), list(direction), number(*width)),
        Shape::Pocket { boundary, bosses, slope, bottom, planar_radius, orthogonal_radius } => {
            let mut out = closed(boundary);
            pocket(&mut out, bosses.len(), *slope, *bottom, *planar_radius, *orthogonal_radius);
            out
        }
        Shape::OpenPocket { boundary, bosses, slope, bottom, planar_radius, orthogonal_radius, .. } => {
            let mut out = format!("open boundary of {} points", boundary.points.len());
            pocket(&mut out, bosses.len(), *slope, *bottom, *planar_radius, *orthogonal_radius);
            out
        }
        Shape::Slot { path, section, ends } => {
            let mut out = section_text(section, depth);
            match path {
                Travel::Line { direction, length, .. } => {
                    let _ = write!(out, ", length {} along {}", number(*length), list(direction));
                }
                Travel::Curve(c) => {
                    let _ = write!(out, ", along a curve of {} points", c.points.len());
                }
            }
            let names: Vec<&str> = ends.iter().map(end_name).collect();
            if !names.is_empty() {
                let _ = write!(out, ", ends {}", names.join(" and "));
            }
            out
        }
        Shape::Step { length, direction, .. } => format!("step length {} along {}", number(*length), list(direction)),
        Shape::Hole { diameter, final_diameter, bottom } => {
            let mut out = format!("diameter {}", number(*diameter));
            if let Some(f) = final_diameter {
                let _ = write!(out, " to {f}");
            }
            let _ = write!(out, ", {}", bottom_name(bottom));
            out
        }
        Shape::Outside { boundary, .. } => format!("outside of {} points", boundary.points.len()),
        Shape::Thread { major, pitch, .. } => format!("thread {}{}", number(*major), pitch.map_or(String::new(), |p| format!(" pitch {}", number(p)))),
        Shape::Compound(all) => {
            let inner: Vec<String> = all.iter().map(|f| format!("#{} {}", f.origin.id, self::shape(&f.shape, f.depth))).collect();
            inner.join("; ")
        }
        Shape::Boss(_) | Shape::Toolpath | Shape::Other => String::new(),
    }
}

fn pocket(out: &mut String, bosses: usize, slope: f64, bottom: PocketBottom, planar: Option<f64>, orthogonal: Option<f64>) {
    if bosses > 0 {
        let _ = write!(out, ", bosses {bosses}");
    }
    if slope != 0.0 {
        let _ = write!(out, ", slope {}", number(slope.to_degrees()));
    }
    if let Some(r) = planar {
        let _ = write!(out, ", planar radius {}", number(r));
    }
    if let Some(r) = orthogonal {
        let _ = write!(out, ", orthogonal radius {}", number(r));
    }
    match bottom {
        PocketBottom::Through => out.push_str(", through"),
        PocketBottom::Planar => {}
        PocketBottom::Ball(_, radius) => {
            let _ = write!(out, ", ball bottom of radius {radius}");
        }
        PocketBottom::Other(what) => {
            let _ = write!(out, ", {what} bottom");
        }
    }
}

fn closed(c: &Closed) -> String {
    match c {
        Closed::Rectangle { length, width, .. } => format!("rectangle {} x {}", number(*length), number(*width)),
        Closed::Circle { diameter, .. } => format!("circle {}", number(*diameter)),
        Closed::Ngon { diameter, sides, across_flats, .. } => {
            format!("{sides} sides, {} {}", if *across_flats { "across flats" } else { "across corners" }, number(*diameter))
        }
        Closed::General(c) => format!("closed curve of {} points", c.points.len()),
    }
}

fn section_text(s: &Section, depth: f64) -> String {
    match s {
        Section::SquareU { width, radius, angle } => {
            let top = width + depth * angle.iter().map(|a| libm::tan(*a)).sum::<f64>();
            let both = |v: &[f64; 2]| if v[0] == v[1] { number(v[0]) } else { format!("{} and {}", number(v[0]), number(v[1])) };
            let mut text = format!("square U width {} radius {}", number(*width), both(radius));
            if angle.iter().any(|a| *a != 0.0) {
                text = format!("square U width {} at the top, {} at the bottom, radius {}", number(top), number(*width), both(radius));
            }
            text
        }
        Section::RoundedU { width } => format!("rounded U width {}", number(*width)),
        Section::Vee { radius, angle, .. } => format!("V {} degrees radius {}", number(angle.to_degrees()), number(*radius)),
        Section::Tee { width, bar_width, bar_depth, .. } => format!("T width {} bar {} x {}", number(*width), number(*bar_width), number(*bar_depth)),
        Section::Circular { radius, .. } => format!("circular radius {}", number(*radius)),
        Section::General(_) => "general section".into(),
    }
}

fn end_name(e: &SlotEnd) -> &'static str {
    match e {
        SlotEnd::Open => "open",
        SlotEnd::Radiused => "radiused",
        SlotEnd::Flat(..) => "flat",
        SlotEnd::Woodruff(_) => "woodruff",
        SlotEnd::Loop => "loop",
    }
}

fn bottom_name(b: &HoleBottom) -> String {
    match b {
        HoleBottom::Through => "through".into(),
        HoleBottom::Flat => "flat bottom".into(),
        HoleBottom::Radiused(r) => format!("flat bottom with radius {}", number(*r)),
        HoleBottom::Spherical(r) => format!("spherical bottom {}", number(*r)),
        HoleBottom::Conical(a, _) => format!("conical bottom {} degrees", number(a.to_degrees())),
    }
}

fn operation(o: &Operation) -> String {
    let mut out = String::new();
    if let OperationKind::Mill(m) = &o.kind {
        if let Some(a) = m.axial {
            let _ = write!(out, "  axial {}", number(a));
        }
        if let Some(r) = m.radial {
            let _ = write!(out, "  radial {}", number(r));
        }
        if m.allowance_side != 0.0 || m.allowance_bottom != 0.0 {
            let _ = write!(out, "  allowance side {} bottom {}", number(m.allowance_side), number(m.allowance_bottom));
        }
        if let Some(s) = &m.strategy {
            let _ = write!(out, "  {}", s.keyword.to_lowercase());
        }
    }
    if !o.toolpaths.is_empty() {
        out.push_str("  explicit tool path");
    }
    out
}

fn tool_line(t: &Tool) -> String {
    let mut out = format!("T{} {} {} diameter {}", t.number, t.kind, quoted(&t.name), number(t.diameter));
    if t.edge_radius != 0.0 {
        let _ = write!(out, " edge radius {}", number(t.edge_radius));
    }
    if let Some(l) = t.cutting_length {
        let _ = write!(out, " cutting length {}", number(l));
    }
    if let Some(a) = t.tip_angle {
        let _ = write!(out, " tip angle {}", number(a.to_degrees()));
    }
    if let Some(l) = t.length {
        let _ = write!(out, " length {}", number(l));
    }
    out
}

fn technology(o: &Operation) -> String {
    let t = &o.technology;
    let mut out = String::new();
    if let Some(f) = t.feed {
        let _ = write!(out, "F{} ", number(f * 60.0));
    }
    if let Some(s) = t.speed {
        let _ = write!(out, "S{} {} ", number(s), if t.clockwise { "clockwise" } else { "counter-clockwise" });
    }
    if o.functions.flood {
        out.push_str("flood ");
    }
    if o.functions.mist {
        out.push_str("mist ");
    }
    out.trim_end().to_string()
}

fn number(v: f64) -> String {
    gr_text::figures::exact(v)
}

fn list(v: &[f64]) -> String {
    let all: Vec<String> = v.iter().map(|c| number(*c)).collect();
    all.join(",")
}

fn quoted(s: &str) -> String {
    format!("'{s}'")
}

/// The plan as JSON: the same facts.
pub fn json(process: &Process, tools: &[Tool]) -> String {
    let steps: Vec<String> = process.steps().into_iter().map(step_json).collect();
    let tools: Vec<String> = tools.iter().map(tool_json).collect();
    let orphans: Vec<String> = process.orphans.iter().map(|o| o.id.to_string()).collect();
    format!(
        "{{\n  \"project\": {},\n  \"workingsteps\": [\n    {}\n  ],\n  \"tools\": [\n    {}\n  ],\n  \"notExecuted\": [{}]\n}}\n",
        string(&process.name),
        steps.join(",\n    "),
        tools.join(",\n    "),
        orphans.join(", ")
    )
}

fn step_json(s: &Workingstep) -> String {
    let (f, o) = (&s.feature, &s.operation);
    let fields = [
        format!("\"id\": {}", s.origin.id),
        format!("\"name\": {}", string(&s.name)),
        format!("\"feature\": {{\"id\": {}, \"entity\": {}, \"name\": {}}}", f.origin.id, string(&f.keyword), string(&f.name)),
        format!("\"placement\": {}, \"axis\": {}", array(&f.frame.origin), array(&f.frame.z)),
        format!("\"depth\": {}", real(f.depth)),
        format!("\"cut\": {}", option(match &o.kind { OperationKind::Drill(d) => d.depth, _ => None })),
        format!("\"profile\": {}", string(&shape(&f.shape, f.depth))),
        format!("\"operation\": {{\"id\": {}, \"entity\": {}}}", o.origin.id, string(&o.keyword)),
        format!("\"tool\": {}", o.tool.number),
        format!("\"feed\": {}, \"speed\": {}, \"clockwise\": {}", option(o.technology.feed.map(|f| f * 60.0)), option(o.technology.speed), o.technology.clockwise),
        format!("\"flood\": {}, \"mist\": {}", o.functions.flood, o.functions.mist),
    ];
    format!("{{{}}}", fields.join(", "))
}

fn tool_json(t: &Tool) -> String {
    format!(
        "{{\"number\": {}, \"entity\": {}, \"name\": {}, \"diameter\": {}, \"edgeRadius\": {}, \"cuttingLength\": {}, \"length\": {}}}",
        t.number,
        string(&t.kind),
        string(&t.name),
        real(t.diameter),
        real(t.edge_radius),
        option(t.cutting_length),
        option(t.length)
    )
}

fn real(v: f64) -> String {
    if v.is_finite() { number(v) } else { "null".into() }
}
fn option(v: Option<f64>) -> String {
    v.map_or("null".into(), real)
}
fn array(v: &[f64]) -> String {
    let all: Vec<String> = v.iter().map(|c| real(*c)).collect();
    format!("[{}]", all.join(", "))
}
fn string(s: &str) -> String {
    let mut out = String::from("\"");
    for c in s.chars() {
        match c {
            '"' => out.push_str("\\\""),
            '\\' => out.push_str("\\\\"),
            c if c < ' ' => {
                let _ = write!(out, "\\u{:04x}", c as u32);
            }
            c => out.push(c),
        }
    }
    out.push('"');
    out
}
