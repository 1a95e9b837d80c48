//! What a machinist would ask about a process plan: units that can't be meant, tools that don't fit, steps that
//! nobody runs. Two readings of a number are both offered; none is chosen.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use gr_spec::{Code, code};
use gr_text::Span;

use crate::model::{Model, Node, Val};

/// How many times wider than its core hole a thread may be: M1 with 1.34 is the widest.
pub const THREAD_OVER_CORE: f64 = 1.4;

/// A finding of [`lint`].
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// Registry row.
    pub code: Code,
    /// Where.
    pub span: Span,
    /// Arguments of the message.
    pub args: Vec<String>,
    /// Further facts.
    pub notes: Vec<String>,
    /// Other places that matter.
    pub labels: Vec<(Span, String)>,
    /// The same again elsewhere: ids.
    pub also: Vec<u64>,
}

/// Looks at the whole plan. Instances for which `faulty` says yes have had their message and get no second one.
pub fn lint<'m>(model: &'m Model<'m>, faulty: &dyn Fn(u32) -> bool) -> Vec<Finding> {
    let mut l = Lints { model, faulty, found: Vec::new(), once: BTreeMap::new(), once_at: BTreeMap::new(), reached: Vec::new() };
    let graph = Graph::new(model);
    l.cycles(&graph);
    l.reach(&graph);
    l.unreferenced(&graph);
    l.numbers();
    l.workpieces();
    l.tools();
    l.operations();
    l.steps();
    l.found
}

struct Lints<'m, 'f> {
    model: &'m Model<'m>,
    faulty: &'f dyn Fn(u32) -> bool,
    found: Vec<Finding>,
    /// Findings that stand for a habit of the whole file: reported where it is first seen.
    once: BTreeMap<Code, usize>,
    once_at: BTreeMap<Code, u32>,
    /// What the project runs.
    reached: Vec<bool>,
}

/// Who refers to whom.
struct Graph {
    first: Vec<u32>,
    to: Vec<u32>,
    referenced: Vec<bool>,
}

impl Graph {
    fn new(model: &Model<'_>) -> Graph {
        let count = model.file().instances.len();
        let mut g = Graph { first: Vec::with_capacity(count + 1), to: Vec::new(), referenced: vec![false; count] };
        for n in 0..count as u32 {
            g.first.push(g.to.len() as u32);
            if let Some(node) = model.at(n) {
                g.to.extend(node.references().map(Node::index));
                if node.damaged() {
                    g.torn(model, n);
                }
            }
        }
        g.first.push(g.to.len() as u32);
        for t in &g.to {
            g.referenced[*t as usize] = true;
        }
        g
    }

    /// A damaged statement still names what it refers to.
    fn torn(&mut self, model: &Model<'_>, n: u32) {
        let all = &model.file().instances;
        let start = all[n as usize].start as usize;
        let stop = all.get(n as usize + 1).map_or(model.text().len(), |i| i.start as usize);
        let Some(body) = model.text().get(start + 1..stop) else { return };
        for part in body.split(|b| *b == b'#').skip(1) {
            let digits: Vec<u8> = part.iter().copied().take_while(u8::is_ascii_digit).collect();
            let id = std::str::from_utf8(&digits).ok().and_then(|d| d.parse().ok());
            self.to.extend(id.and_then(|id| model.get(id)).map(Node::index));
        }
    }

    fn out(&self, n: u32) -> &[u32] {
        &self.to[self.first[n as usize] as usize..self.first[n as usize + 1] as usize]
    }
}

/// The largest that an angle of this name may be, rad: slopes and half angles go up to a quarter of a turn.
fn most(node: Node<'_>, name: &str) -> f64 {
    match name {
        "angle" if node.is_a("approach_retract_strategy") || node.is_a("angle_taper") => PI / 2.0,
        "slope" | "taper_angle" | "tool_tip_half_angle" | "tool_circumference_angle" => PI / 2.0,
        "profile_angle" | "tip_angle" | "point_angle" | "included_angle" => PI,
        _ => 2.0 * PI,
    }
}

/// A number without needless digits.
pub fn short(v: f64) -> String {
    let s = format!("{v:.4}");
    let s = s.trim_end_matches('0').trim_end_matches('.');
    if s == "-0" { "0".into() } else { s.to_string() }
}

/// Origin and axes of a placement.
struct Frame {
    origin: [f64; 3],
    z: [f64; 3],
}

fn triple(node: Node<'_>, name: &str) -> Option<[f64; 3]> {
    let all: Vec<f64> = node.attr(name)?.items().map(Val::real).collect::<Option<_>>()?;
    all.try_into().ok()
}

fn frame(node: Node<'_>) -> Option<Frame> {
    let origin = triple(node.node("location")?, "coordinates")?;
    let z = node.node("axis").and_then(|a| triple(a, "direction_ratios")).unwrap_or([0.0, 0.0, 1.0]);
    let length = libm::sqrt(z.iter().map(|c| c * c).sum());
    (length > 0.0).then(|| Frame { origin, z: z.map(|c| c / length) })
}

/// Height of a plane in its own placement.
fn plane_height(node: Node<'_>) -> Option<f64> {
    Some(frame(node.node("position")?)?.origin[2])
}

/// Diameter of a tool, in either edition of part 111.
fn diameter(tool: Node<'_>) -> Option<f64> {
    tool.real("effective_cutting_diameter").or_else(|| tool.node("its_tool_body")?.node("dimension")?.real("diameter"))
}

fn edge_length(tool: Node<'_>) -> Option<f64> {
    tool.real("maximum_depth_of_cut").or_else(|| tool.node("its_tool_body")?.node("dimension")?.real("cutting_edge_length"))
}

impl<'m> Lints<'m, '_> {
    fn add(&mut self, code: Code, node: Node<'m>, span: Span, args: Vec<String>) -> Option<&mut Finding> {
        if (self.faulty)(node.index()) {
            return None;
        }
        self.found.push(Finding { code, span, args, notes: Vec::new(), labels: Vec::new(), also: Vec::new() });
        self.found.last_mut()
    }

    /// As `add`, but a second time only the id is noted.
    fn once(&mut self, code: Code, node: Node<'m>, span: Span, args: Vec<String>) -> Option<&mut Finding> {
        if (self.faulty)(node.index()) {
            return None;
        }
        if let Some(n) = self.once.get(&code) {
            let first = self.once_at.get(&code) == Some(&node.index());
            let also = &mut self.found[*n].also;
            if !first && also.last() != Some(&node.id()) {
                also.push(node.id());
            }
            return None;
        }
        self.once.insert(code, self.found.len());
        self.once_at.insert(code, node.index());
        self.add(code, node, span, args)
    }

    fn cycles(&mut self, graph: &Graph) {
        let count = self.model.file().instances.len();
        // 0 new, 1 on the way, 2 done.
        let mut state = vec![0u8; count];
        let mut way: Vec<(u32, usize)> = Vec::new();
        for start in 0..count as u32 {
            if state[start as usize] != 0 {
                continue;
            }
            state[start as usize] = 1;
            way.push((start, 0));
            while let Some((n, next)) = way.last_mut() {
                let Some(to) = graph.out(*n).get(*next).copied() else {
                    state[*n as usize] = 2;
                    way.pop();
                    continue;
                };
                *next += 1;
                match state[to as usize] {
                    0 => {
                        state[to as usize] = 1;
                        way.push((to, 0));
                    }
                    1 => {
                        let from = way.iter().position(|w| w.0 == to).unwrap_or(0);
                        let ring: Vec<u32> = way[from..].iter().map(|w| w.0).collect();
                        self.cycle(&ring);
                    }
                    _ => {}
                }
            }
        }
    }

    fn cycle(&mut self, ring: &[u32]) {
        let nodes: Vec<Node<'m>> = ring.iter().filter_map(|n| self.model.at(*n)).collect();
        let (Some(first), Some(last)) = (nodes.first().copied(), nodes.last().copied()) else { return };
        let names: Vec<String> = nodes.iter().chain([&first]).map(|n| format!("#{}", n.id())).collect();
        let names = if names.len() > 8 { [&names[..4], &["…".to_string()], &names[names.len() - 3..]].concat() } else { names };
        let values = self.model.file().values_of(last.index());
        let back = values.iter().find(|v| self.model.file().reference(self.model.text(), **v) == Some(first.id()));
        let span = back.map_or(last.span(), |v| Span::new(v.start, v.start + v.len()));
        self.add(code::STEP_CYCLE, last, span, vec![first.id().to_string(), names.join(" → ")]);
    }

    /// What the project's plan runs, and what it leaves out.
    fn reach(&mut self, graph: &Graph) {
        let projects: Vec<Node<'m>> = self.model.all("project").collect();
        let plans: Vec<Node<'m>> = self.model.all("workplan").collect();
        if projects.is_empty() {
            if let Some(plan) = plans.first().or(self.model.all("machining_workingstep").next().as_ref()) {
                self.add(code::STEP_NO_PROJECT, *plan, plan.keyword_span(), vec![]);
            }
        }
        let mains: Vec<Node<'m>> = projects.iter().filter_map(|p| p.node("main_workplan")).collect();
        for main in &mains {
            if !main.damaged() && main.attr("its_elements").is_some_and(|e| e.items().next().is_none()) {
                self.add(code::STEP_EMPTY_WORKPLAN, *main, main.keyword_span(), vec![main.id().to_string()]);
            }
        }
        let mut reached = vec![false; self.model.file().instances.len()];
        let roots = if mains.is_empty() { &plans } else { &mains };
        let mut todo: Vec<u32> = roots.iter().map(|n| n.index()).collect();
        while let Some(n) = todo.pop() {
            if !std::mem::replace(&mut reached[n as usize], true) {
                todo.extend(graph.out(n).iter().copied());
            }
        }
        if roots.is_empty() {
            return;
        }
        self.reached = reached.clone();
        let steps: Vec<Node<'m>> = self.model.all("executable").filter(|s| !reached[s.index() as usize]).collect();
        for step in steps {
            if step.is_a("workingstep") {
                let args = vec![step.id().to_string(), step.string("its_id").into_owned()];
                self.add(code::STEP_ORPHAN_WORKINGSTEP, step, step.keyword_span(), args);
            } else if !graph.referenced[step.index() as usize] {
                let args = vec![step.id().to_string(), step.keyword().into()];
                self.add(code::STEP_UNREFERENCED, step, step.keyword_span(), args);
            }
        }
    }

    fn unreferenced(&mut self, graph: &Graph) {
        let lonely: Vec<Node<'m>> = self
            .model
            .instances()
            .filter(|n| !graph.referenced[n.index() as usize] && n.entity().is_some())
            .filter(|n| !n.is_a("project") && !n.is_a("executable"))
            .collect();
        for n in lonely.iter().take(100) {
            let finding = self.add(code::STEP_UNREFERENCED, *n, n.keyword_span(), vec![n.id().to_string(), n.keyword().into()]);
            if let Some(f) = finding
                && lonely.len() > 100
                && *n == lonely[99]
            {
                f.notes.push(format!("and {} more instances that nothing refers to", lonely.len() - 100));
            }
        }
    }

    /// Ratios and angles, wherever they stand.
    fn numbers(&mut self) {
        let known = |k: &'m str| crate::model::resolve(crate::schema::schema(), k).alias.unwrap_or(k);
        let wanted: Vec<Vec<Measure>> = self.model.file().keywords.iter().map(|k| measures(known(k))).collect();
        for node in self.model.instances() {
            let keyword = self.model.file().instances[node.index() as usize].keyword as usize;
            for (place, name, angle) in &wanted[keyword] {
                let Some(v) = node.parameters().nth(*place) else { continue };
                let Some(number) = v.real() else { continue };
                if *angle {
                    self.angle(node, name, v, number);
                } else if *name != "overlap" && number > if *name == "feed_on_retract" { 10.0 } else { 1.0 } {
                    let args = vec![(*name).into(), short(number), short(number / 100.0)];
                    self.once(code::STEP_RATIO, node, v.span(), args);
                }
            }
        }
    }

    /// Degrees are written with few decimals; a full-length number below 2π is an angle in radians.
    fn angle(&mut self, node: Node<'m>, name: &str, v: Val<'m>, number: f64) {
        let text: String = v.text().chars().filter(|c| *c > ' ').collect();
        let decimals = text.split_once('.').map_or(0, |(_, d)| d.bytes().filter(u8::is_ascii_digit).count());
        if number.abs() > 0.001 && number.abs() <= most(node, name) && decimals >= 5 {
            let args = vec![name.into(), text, short(number.to_degrees())];
            self.once(code::STEP_RADIANS, node, v.span(), args);
        }
    }

    fn workpieces(&mut self) {
        for w in self.model.all("workpiece") {
            if let Some(v) = w.attr("global_tolerance")
                && let Some(t) = v.real()
                && t >= 1.0
            {
                self.add(code::STEP_TOLERANCE, w, v.span(), vec![short(t), short(t / 1000.0)]);
            }
        }
    }

    fn tools(&mut self) {
        let mut names: BTreeMap<String, (Node<'m>, f64)> = BTreeMap::new();
        for tool in self.model.all("cutting_tool") {
            let holder = if tool.attr("effective_cutting_diameter").is_some() { Some(tool) } else { tool.node("its_tool_body").and_then(|b| b.node("dimension")) };
            let Some(d) = diameter(tool) else { continue };
            if d <= 0.0
                && let Some(h) = holder
                && let Some(v) = h.attr("diameter").or_else(|| h.attr("effective_cutting_diameter"))
            {
                self.add(code::STEP_ZERO_TOOL, h, v.span(), vec![short(d)]);
            }
            let name = tool.string("its_id").trim().to_string();
            let numbered = !name.is_empty() && name.bytes().any(|b| b.is_ascii_digit());
            match names.get(&name) {
                Some((first, other)) if numbered && *other != d => {
                    let (first, other, span) = (first.id(), *other, first.keyword_span());
                    let at = tool.attr("its_id").map_or(tool.keyword_span(), Val::span);
                    let args = vec![name, short(d), short(other), first.to_string()];
                    if let Some(f) = self.once(code::STEP_TOOL_NAME, tool, at, args) {
                        f.labels.push((span, "first used here".into()));
                    }
                }
                Some(_) => {}
                None => {
                    names.insert(name, (tool, d));
                }
            }
        }
    }

    fn operations(&mut self) {
        let mut seen = std::collections::BTreeSet::new();
        for op in self.model.all("machining_operation") {
            let tool = op.node("its_tool");
            let d = tool.and_then(diameter).filter(|d| *d > 0.0);
            if let Some(t) = op.node("its_technology").filter(|t| seen.insert(t.index())) {
                self.technology(t, tool, d);
            }
            if let Some(s) = op.node("its_machining_strategy")
                && let Some(v) = s.attr("overlap")
                && let Some(overlap) = v.real()
                && overlap > 1.0
            {
                let of_tool = d.map_or("a ratio of the tool's diameter".into(), |d| short(overlap / d));
                self.once(code::STEP_OVERLAP, s, v.span(), vec![short(overlap), of_tool, short(overlap / 100.0)]);
            }
            if let (Some(v), Some(edge)) = (op.attr("axial_cutting_depth"), tool.and_then(edge_length))
                && let Some(depth) = v.real()
                && edge > 0.0
                && depth > edge / 3.0
            {
                self.add(code::STEP_AXIAL_DEPTH, op, v.span(), vec![short(depth), short(edge)]);
            }
        }
        let unused: Vec<Node<'m>> = self.model.all("milling_technology").filter(|t| !seen.contains(&t.index())).collect();
        for t in unused {
            self.both_speeds(t, None);
        }
    }

    fn both_speeds(&mut self, t: Node<'m>, d: Option<f64>) -> bool {
        let (Some(v), Some(n), Some(vc)) = (t.attr("spindle"), t.real("spindle"), t.real("cutspeed")) else { return false };
        let fresh = self.once(code::STEP_BOTH_SPEEDS, t, v.span(), vec![short(vc), short(n)]);
        if let Some(finding) = fresh {
            finding.notes.extend(readings(n, vc, t.real("feedrate"), d));
        }
        true
    }

    fn technology(&mut self, t: Node<'m>, tool: Option<Node<'m>>, d: Option<f64>) {
        let hand = tool.and_then(|t| t.attr("hand_of_cut").or_else(|| t.node("its_tool_body")?.attr("hand_of_cut")));
        let left = hand.and_then(Val::choice).as_deref() == Some("LEFT");
        let (spindle, cutspeed, feed) = (t.attr("spindle"), t.attr("cutspeed"), t.attr("feedrate"));
        let (n, vc, f) = (spindle.and_then(Val::real), cutspeed.and_then(Val::real), feed.and_then(Val::real));
        if self.both_speeds(t, d) {
            // Which of the two is meant decides about the rest.
        } else if let (Some(n), Some(v)) = (n, spindle)
            && n.abs() > 500.0
        {
            let args = vec![short(n), short(n.abs() * 60.0), short(n / 60.0)];
            self.once(code::STEP_SPINDLE_UNIT, t, v.span(), args);
        } else if let (Some(vc), Some(v)) = (vc, cutspeed)
            && (vc.abs() > 10.0 || d.is_some_and(|d| d > 0.0 && vc.abs() * 1000.0 / (PI * d) > 1000.0))
        {
            self.once(code::STEP_CUTSPEED_UNIT, t, v.span(), vec![short(vc), short(vc * 60.0), short(vc / 60.0)]);
        }
        if let (Some(f), Some(v)) = (f, feed)
            && f > 1.0
        {
            let args = vec![short(f), short(f * 60_000.0), fine(f / 60.0), fine(f / 60_000.0)];
            self.once(code::STEP_FEED_UNIT, t, v.span(), args);
        }
        if let (Some(n), Some(v)) = (n, spindle) {
            let rpm = short(n.abs() * 60.0);
            if n > 0.0 && !left {
                self.once(code::STEP_SPINDLE_SIGN, t, v.span(), vec![short(n), short(-n)]);
            } else if n < 0.0 {
                self.once(code::STEP_NEGATIVE_SPINDLE, t, v.span(), vec![short(n), rpm]);
            }
        }
    }

    fn steps(&mut self) {
        let mut smallest: BTreeMap<u32, (f64, Node<'m>)> = BTreeMap::new();
        let mut seen = std::collections::BTreeSet::new();
        let mut direction: Option<([f64; 3], Node<'m>)> = None;
        for step in self.model.all("machining_workingstep") {
            let (Some(feature), Some(op)) = (step.node("its_feature"), step.node("its_operation")) else { continue };
            let listed = feature.attr("its_operations");
            if listed.is_some() && !feature.nodes("its_operations").contains(&op) && !(self.faulty)(feature.index()) && !(self.faulty)(op.index()) {
                let v = step.attr("its_operation").map_or(step.keyword_span(), Val::span);
                self.add(code::STEP_OPERATION_ELSEWHERE, step, v, vec![op.id().to_string(), feature.id().to_string()]);
            }
            let d = op.node("its_tool").and_then(diameter).filter(|d| *d > 0.0);
            if let Some(d) = d {
                self.tool_fits(feature, op, d);
                let milling = op.is_a("side_milling") || op.is_a("bottom_and_side_milling");
                if milling && smallest.get(&feature.index()).is_none_or(|s| d < s.0) {
                    smallest.insert(feature.index(), (d, op));
                }
            }
            let run = self.reached.get(step.index() as usize) == Some(&true);
            if let Some(f) = feature.node("feature_placement").and_then(frame) {
                let turned = |z: [f64; 3]| z.iter().zip(&f.z).map(|(a, b)| a * b).sum::<f64>() < 0.999;
                if let Some((z, first)) = direction
                    && run
                    && turned(z)
                {
                    let args = vec![step.id().to_string(), first.id().to_string()];
                    self.once(code::STEP_SEVERAL_DIRECTIONS, step, step.keyword_span(), args);
                }
                if run {
                    direction.get_or_insert((f.z, step));
                }
                // Where the frame of a tool path lies says nothing of the material.
                if !feature.is_a("toolpath_feature") {
                    self.security_plane(step, feature, &f);
                }
            }
            if seen.insert(feature.index()) {
                self.below_workpiece(feature);
                self.profiles(feature);
                self.radii(feature);
            }
        }
        for (n, (d, op)) in smallest {
            let Some(feature) = self.model.at(n) else { continue };
            let Some(radius) = feature.length("orthogonal_radius") else { continue };
            if radius < d / 2.0 {
                let v = op.attr("its_tool").map_or(op.keyword_span(), Val::span);
                let args = vec![short(d), short(radius), feature.id().to_string()];
                self.add(code::STEP_CORNER_TOO_TIGHT, op, v, args);
            }
        }
    }

    fn tool_fits(&mut self, feature: Node<'m>, op: Node<'m>, d: f64) {
        if op.is_a("center_drilling") || op.is_a("counter_sinking") || op.is_a("back_boring") || op.is_a("plane_milling") {
            return;
        }
        let profile = feature.node("feature_boundary").or_else(|| feature.node("swept_shape"));
        let sides = |p: Node<'m>| {
            let all = ["profile_width", "profile_length", "diameter", "width"].map(|a| p.length(a));
            all.into_iter().flatten().reduce(f64::min)
        };
        let room = if feature.is_a("round_hole") {
            feature.length("diameter")
        } else if feature.is_a("closed_pocket") || feature.is_a("slot") {
            profile.filter(|p| !p.is_a("tee_profile") && !p.is_a("vee_profile")).and_then(sides)
        } else {
            None
        };
        // A reamer or drill may use the hole's tolerance.
        let slack = feature.node("diameter").and_then(|t| t.node("implicit_tolerance")).and_then(|t| t.real("upper_limit"));
        // The thread of a tap goes into the wall of its core hole: no thread is deeper than this.
        let wide = room.unwrap_or(0.0);
        let room = room.map(|room| if op.is_a("tapping") || op.is_a("thread_drilling") { room * THREAD_OVER_CORE } else { room });
        if let Some(room) = room
            && room > 0.0
            && d > room + slack.unwrap_or(0.0) + 1e-9
        {
            let v = op.attr("its_tool").map_or(op.keyword_span(), Val::span);
            let args = vec![short(d), feature.keyword().into(), short(wide), feature.id().to_string()];
            if let Some(f) = self.add(code::STEP_TOOL_TOO_LARGE, op, v, args) {
                f.labels.push((feature.keyword_span(), "the feature".into()));
            }
        }
    }

    fn security_plane(&mut self, step: Node<'m>, feature: Node<'m>, placement: &Frame) {
        let Some(plane) = step.node("its_secplane") else { return };
        let Some(height) = plane_height(plane) else { return };
        let top = feature.node("its_workpiece").and_then(block_top);
        let upright = placement.z[2] > 0.999;
        let highest = if upright { top.unwrap_or(placement.origin[2]).max(placement.origin[2]) } else { return };
        if height < highest - 1e-9 {
            let v = step.attr("its_secplane").map_or(step.keyword_span(), Val::span);
            self.add(code::STEP_SECURITY_PLANE, step, v, vec![short(height), short(highest)]);
        }
    }

    /// The feature's bottom against the block it is cut from.
    fn below_workpiece(&mut self, feature: Node<'m>) {
        let through = feature.node("bottom_condition").is_some_and(|b| b.is_a("through_bottom_condition") || b.is_a("through_pocket_bottom_condition"));
        let Some(block) = feature.node("its_workpiece").and_then(|w| w.node("its_bounding_geometry")).filter(|b| b.is_a("block")) else { return };
        let (Some(f), Some(depth)) = (feature.node("feature_placement").and_then(frame), feature.node("depth").and_then(plane_height)) else { return };
        let (Some(corner), Some(z)) = (block.node("position").and_then(frame), block.real("z")) else { return };
        let (Some(x), Some(y)) = (block.real("x"), block.real("y")) else { return };
        if through || depth >= 0.0 || corner.z[2] < 0.999 {
            return;
        }
        for axis in 0..3 {
            let at = f.origin[axis] + depth * f.z[axis];
            let (low, high) = (corner.origin[axis], corner.origin[axis] + [x, y, z][axis]);
            let beyond = (low - at).max(at - high);
            if f.z[axis].abs() > 0.5 && beyond > 0.01 {
                let v = feature.attr("depth").map_or(feature.keyword_span(), Val::span);
                let args = vec![feature.id().to_string(), short(-depth), short(beyond)];
                self.add(code::STEP_BELOW_WORKPIECE, feature, v, args);
                return;
            }
        }
    }

    /// A profile is placed in the frame of its feature; the feature's own place again would shift it twice.
    fn profiles(&mut self, feature: Node<'m>) {
        let Some(f) = feature.node("feature_placement").and_then(frame) else { return };
        for name in ["feature_boundary", "swept_shape", "open_boundary", "removal_boundary", "its_boundary"] {
            let Some(profile) = feature.node(name) else { continue };
            let Some(v) = profile.attr("placement") else { continue };
            let Some(p) = v.node().and_then(frame) else { continue };
            if p.origin == f.origin && f.origin != [0.0; 3] {
                let args = vec![profile.keyword().into(), feature.id().to_string(), f.origin.map(short).join(", ")];
                self.add(code::STEP_PROFILE_TWICE, profile, v.span(), args);
            }
        }
    }

    fn radii(&mut self, feature: Node<'m>) {
        let flat = feature.node("bottom_condition").is_some_and(|b| b.is_a("planar_pocket_bottom_condition"));
        if flat
            && feature.attr("orthogonal_radius").is_none()
            && let Some(v) = feature.attr("planar_radius")
            && let Some(r) = feature.length("planar_radius")
            && r > 0.0
        {
            self.add(code::STEP_RADIUS_SWAPPED, feature, v.span(), vec![short(r)]);
        }
    }
}

/// Height of the top of the block a workpiece is bounded by.
/// Place, name and kind (an angle) of a parameter that is a ratio or an angle.
type Measure = (usize, &'static str, bool);

/// Those of a keyword, in any edition.
fn measures(keyword: &str) -> Vec<Measure> {
    let schema = crate::schema::schema();
    let mut out: Vec<Measure> = Vec::new();
    for row in schema.find(keyword) {
        for (n, a) in schema.entity(*row).attributes().iter().enumerate() {
            let angle = a.written == "plane_angle_measure";
            if (angle || a.written == "positive_ratio_measure") && out.iter().all(|m| m.0 != n) {
                out.push((n, a.name, angle));
            }
        }
    }
    out
}

fn block_top(workpiece: Node<'_>) -> Option<f64> {
    let block = workpiece.node("its_bounding_geometry")?;
    let corner = frame(block.node("position")?)?;
    (corner.z[2] > 0.999).then_some(corner.origin[2] + block.real("z")?)
}

/// What two speeds and a feed mean in each unit that is in use.
fn readings(n: f64, vc: f64, feed: Option<f64>, d: Option<f64>) -> Vec<String> {
    let mut notes = vec![format!(
        "spindle {}: {} rpm in 1/s, the standard's unit; {} rpm in rev/min",
        short(n),
        short(n.abs() * 60.0),
        short(n.abs())
    )];
    if let Some(d) = d {
        let rpm = |meters_per_minute: f64| meters_per_minute * 1000.0 / (PI * d);
        let slow = rpm(vc);
        notes.push(format!(
            "cutspeed {} on a tool of {} mm: {} rpm in m/s, the standard's unit; {} rpm in m/min",
            short(vc),
            short(d),
            short(rpm(vc * 60.0)),
            short(slow)
        ));
        let same = |a: f64, b: f64| (a - b).abs() <= 1e-3 * b.abs();
        let agree = if same(n.abs(), slow) {
            Some("m/min with rev/min (or m/s with 1/s)")
        } else if same(n.abs() * 60.0, slow) {
            Some("m/min with 1/s")
        } else if same(n.abs() * 100.0, slow) {
            Some("m/min with rev/min / 100, as STEP Modeler writes it")
        } else {
            None
        };
        notes.push(agree.map_or("no pair of units makes the two agree".into(), |a| format!("the two agree as {a}")));
        if let Some(f) = feed {
            notes.push(format!(
                "feedrate {}: {} mm/min in m/s, the standard's unit; {} mm/min in m/min; {} mm/min in mm per revolution at {} rpm",
                short(f),
                short(f * 60_000.0),
                short(f * 1000.0),
                short(f * slow),
                short(slow)
            ));
        }
    }
    notes
}

/// With three digits that count, however small.
fn fine(v: f64) -> String {
    let places = (2.0 - libm::floor(libm::log10(v.abs().max(1e-12)))).clamp(0.0, 12.0) as usize;
    let text = format!("{v:.places$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_string() } else { text }
}
