//! AP238 (AIM): the named subset that is turned into motion. Workplans, workingsteps, operations and tool paths are
//! methods joined by relationships, what they say hangs on them as properties. Read are MACHINING_TOOLPATHs with a
//! polyline, a circle, a trimmed or a composite curve, and dwells, with tool, feed, spindle speed and coolant. Every
//! other kind of path gets one refusal at its statement. There are no features here, so none is planned.

use std::collections::{BTreeMap, BTreeSet};

use gr_step::{Model, Node, Val};
use gr_text::{Diagnostic, FileId, code};

use crate::frame::Frame;
use crate::process::*;
use crate::read::{Reader, origin};

/// Workplans inside workplans.
const DEEPEST: usize = 64;
/// Above the highest point of the paths, mm.
const ABOVE: f64 = 5.0;

/// Reads the process of a file.
pub(crate) fn read(model: &Model<'_>, file: FileId) -> (Option<Process>, Vec<Tool>, Vec<Diagnostic>) {
    let mut a = Aim::new(model, file);
    let process = a.project();
    (process, a.r.tools, a.r.out)
}

struct Aim<'m> {
    r: Reader<'m>,
    /// Relating → related with its place in the order.
    parts: BTreeMap<u64, Vec<(f64, Node<'m>)>>,
    /// What it belongs to → (name, items of the representation).
    properties: BTreeMap<u64, Vec<(String, Node<'m>)>>,
    /// Operation → tool.
    tools: BTreeMap<u64, Node<'m>>,
    /// mm of one unit of length in the file.
    scale: f64,
    seen: BTreeSet<u64>,
    /// Operation → what its sequence of tool paths names.
    sequence: Vec<(u64, Node<'m>)>,
    highest: f64,
}

/// A parameter by its place.
fn at<'m>(node: Node<'m>, i: usize) -> Option<Val<'m>> {
    node.parameters().nth(i)
}
fn text(node: Node<'_>, i: usize) -> String {
    at(node, i).and_then(|v| v.string().map(|s| s.into_owned())).unwrap_or_default()
}

impl<'m> Aim<'m> {
    fn new(model: &'m Model<'m>, file: FileId) -> Aim<'m> {
        let mut parts: BTreeMap<u64, Vec<(f64, Node<'m>)>> = BTreeMap::new();
        let mut tools = BTreeMap::new();
        let mut reps: BTreeMap<u64, Vec<Node<'m>>> = BTreeMap::new();
        let mut owners: Vec<(u64, u64, String)> = Vec::new();
        let mut sequence = Vec::new();
        for n in model.instances() {
            match n.keyword() {
                "MACHINING_PROCESS_SEQUENCE_RELATIONSHIP" | "MACHINING_OPERATION_RELATIONSHIP" | "MACHINING_TOOLPATH_SEQUENCE_RELATIONSHIP"
                | "MACHINING_TECHNOLOGY_RELATIONSHIP" | "MACHINING_FUNCTIONS_RELATIONSHIP" => {
                    if let (Some(a), Some(b)) = (at(n, 2).and_then(|v| v.node()), at(n, 3).and_then(|v| v.node())) {
                        let place = at(n, 4).and_then(|v| v.real()).unwrap_or(0.0);
                        parts.entry(a.id()).or_default().push((place, b));
                        if n.keyword() == "MACHINING_TOOLPATH_SEQUENCE_RELATIONSHIP" {
                            sequence.push((a.id(), b));
                        }
                    }
                }
                "MACHINING_TOOL" => {
                    for o in at(n, 2).into_iter().flat_map(|v| v.items().collect::<Vec<_>>()).filter_map(|v| v.node()) {
                        tools.insert(o.id(), n);
                    }
                }
                "ACTION_PROPERTY" | "RESOURCE_PROPERTY" => {
                    if let Some(of) = at(n, 2).and_then(|v| v.node()) {
                        owners.push((n.id(), of.id(), text(n, 0)));
                    }
                }
                "ACTION_PROPERTY_REPRESENTATION" | "RESOURCE_PROPERTY_REPRESENTATION" => {
                    if let (Some(p), Some(r)) = (at(n, 2).and_then(|v| v.node()), at(n, 3).and_then(|v| v.node())) {
                        reps.entry(p.id()).or_default().push(r);
                    }
                }
                _ => {}
            }
        }
        for list in parts.values_mut() {
            list.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.id().cmp(&b.1.id())));
        }
        let mut properties: BTreeMap<u64, Vec<(String, Node<'m>)>> = BTreeMap::new();
        for (property, of, name) in owners {
            for r in reps.get(&property).into_iter().flatten() {
                for item in at(*r, 1).into_iter().flat_map(|v| v.items().collect::<Vec<_>>()).filter_map(|v| v.node()) {
                    properties.entry(of).or_default().push((name.clone(), item));
                }
            }
        }
        let mut a = Aim { r: Reader::bare(model, file), parts, properties, tools, scale: 1.0, seen: BTreeSet::new(), sequence, highest: f64::NEG_INFINITY };
        a.scale = a.length_unit();
        a
    }

    /// mm of the unit of length that the first geometric context names.
    fn length_unit(&self) -> f64 {
        let context = self.r.model.instances().find(|n| self.statement(*n).contains("GLOBAL_UNIT_ASSIGNED_CONTEXT"));
        let units = context.map(|c| c.references().collect::<Vec<_>>()).unwrap_or_default();
        units.into_iter().find(|u| self.statement(*u).contains("LENGTH_UNIT")).map_or(1.0, |u| self.unit(u, 0))
    }
    fn statement(&self, n: Node<'m>) -> String {
        String::from_utf8_lossy(&self.r.model.text()[n.span().range()]).into_owned()
    }

    /// How many mm, s or revolutions a unit is.
    fn unit(&self, n: Node<'m>, depth: usize) -> f64 {
        if depth > 8 {
            return 1.0;
        }
        let s = self.statement(n);
        if s.contains("DERIVED_UNIT(") {
            let parts = n.references().filter(|e| e.keyword() == "DERIVED_UNIT_ELEMENT");
            return parts.map(|e| {
                let power = at(e, 1).and_then(|v| v.real()).unwrap_or(1.0);
                at(e, 0).and_then(|v| v.node()).map_or(1.0, |u| libm::pow(self.unit(u, depth + 1), power))
            }).product();
        }
        if s.contains("CONVERSION_BASED_UNIT") {
            let with = n.references().find(|r| r.keyword().ends_with("MEASURE_WITH_UNIT"));
            return with.map_or(1.0, |w| {
                let value = at(w, 0).and_then(|v| v.real().or_else(|| v.typed().and_then(|t| t.1.real()))).unwrap_or(1.0);
                value * at(w, 1).and_then(|v| v.node()).map_or(1.0, |u| self.unit(u, depth + 1))
            });
        }
        let si = |milli: f64, centi: f64, micro: f64, one: f64| {
            if s.contains(".MILLI.") { milli } else if s.contains(".CENTI.") { centi } else if s.contains(".MICRO.") { micro } else { one }
        };
        if s.contains(".METRE.") { si(1.0, 10.0, 1e-3, 1000.0) } else { si(1e-3, 1e-2, 1e-6, 1.0) }
    }

    /// A measure in mm, s, rev, and whether it is per revolution.
    fn measure(&self, item: Node<'m>) -> Option<(f64, bool)> {
        let value = at(item, 1)?;
        let v = value.real().or_else(|| value.typed().and_then(|t| t.1.real()))?;
        let unit = at(item, 2).and_then(|u| u.node());
        let per_rev = unit.is_some_and(|u| {
            u.references().any(|e| at(e, 1).and_then(|p| p.real()).is_some_and(|p| p < 0.0) && at(e, 0).and_then(|x| x.node()).is_some_and(|x| self.statement(x).contains("'revolution'")))
        });
        Some((v * unit.map_or(1.0, |u| self.unit(u, 0)), per_rev)).filter(|m| m.0.is_finite())
    }

    fn properties(&self, of: u64) -> &[(String, Node<'m>)] {
        self.properties.get(&of).map_or(&[], Vec::as_slice)
    }
    fn words(&self, of: u64, name: &str) -> Option<String> {
        self.properties(of).iter().find(|(n, i)| n.eq_ignore_ascii_case(name) && i.keyword() == "DESCRIPTIVE_REPRESENTATION_ITEM").map(|p| text(p.1, 1))
    }
    fn related(&self, of: u64, keyword: &str) -> Vec<Node<'m>> {
        self.parts.get(&of).into_iter().flatten().map(|p| p.1).filter(|n| n.keyword() == keyword).collect()
    }

    fn project(&mut self) -> Option<Process> {
        let joined: BTreeSet<u64> = self.sequence.iter().map(|s| s.1.id()).collect();
        let loose: Vec<Node<'m>> = self.r.model.instances().filter(|n| n.keyword() == "MACHINING_TOOLPATH" && !joined.contains(&n.id())).collect();
        for n in loose {
            self.refuse(n, ": no sequence joins it to an operation");
        }
        let plans: Vec<Node<'m>> = self.r.model.instances().filter(|n| n.keyword() == "MACHINING_WORKPLAN").collect();
        let inner: BTreeSet<u64> = self.parts.values().flatten().map(|p| p.1.id()).collect();
        let Some(main) = plans.iter().find(|p| !inner.contains(&p.id())).copied() else {
            let why = "no MACHINING_WORKPLAN; it is an AP238 file without a plan".to_string();
            self.r.out.push(Diagnostic::new(code::PLAN_NO_PROJECT, self.r.file, gr_text::Span::new(0, 0), &[why]));
            return None;
        };
        let elements = self.plan(main, 0);
        let high = if self.highest.is_finite() { self.highest } else { 0.0 };
        let mut process = Process { name: text(main, 0), elements: vec![Element::Plan(elements)], ..Process::default() };
        raise(&mut process.elements, high + ABOVE);
        Some(process)
    }

    fn plan(&mut self, node: Node<'m>, depth: usize) -> Plan {
        let mut elements = Vec::new();
        if depth > DEEPEST || !self.seen.insert(node.id()) {
            self.r.say(code::PLAN_GOES_ROUND, node, &[&format!("#{} {}", node.id(), node.keyword())]);
            return Plan { origin: origin(node), name: String::new(), setup: None, elements };
        }
        for (_, part) in self.parts.get(&node.id()).cloned().unwrap_or_default() {
            match part.keyword() {
                "MACHINING_WORKPLAN" => elements.push(Element::Plan(self.plan(part, depth + 1))),
                "MACHINING_WORKINGSTEP" => {
                    let operations: Vec<Node<'m>> = self.parts.get(&part.id()).into_iter().flatten().map(|p| p.1).filter(|o| o.keyword().contains("OPERATION")).collect();
                    if operations.is_empty() {
                        self.refuse(part, ": it has no operation");
                    }
                    for o in operations {
                        elements.extend(self.step(part, o).map(|s| Element::Step(Box::new(s))));
                    }
                }
                _ => self.refuse(part, " in a workplan"),
            }
        }
        self.seen.remove(&node.id());
        Plan { origin: origin(node), name: text(node, 0), setup: None, elements }
    }

    fn refuse(&mut self, node: Node<'m>, why: &str) {
        let name = text(node, 0);
        self.r.say(code::PLAN_NOT_LOWERED, node, &[&format!("#{} {} '{name}'", node.id(), node.keyword()), why]);
    }

    fn step(&mut self, node: Node<'m>, operation: Node<'m>) -> Option<Workingstep> {
        let paths = self.related(operation.id(), "MACHINING_TOOLPATH");
        if paths.is_empty() {
            self.refuse(operation, ": of AP238 only operations with a MACHINING_TOOLPATH are");
            return None;
        }
        let tool = self.tool(operation);
        let technology = self.technology(operation, None);
        let functions = self.functions(operation.id());
        let mut toolpaths = Vec::new();
        for p in paths {
            toolpaths.extend(self.path(p, technology));
        }
        let strange: Vec<Node<'m>> = self.sequence.iter().filter(|(of, n)| *of == operation.id() && n.keyword() != "MACHINING_TOOLPATH").map(|s| s.1).collect();
        for n in strange {
            self.refuse(n, ": in the sequence of tool paths of an operation");
        }
        let feature = Feature {
            origin: origin(node),
            keyword: "TOOLPATH_FEATURE".into(),
            name: text(node, 0),
            frame: Frame::default(),
            placement: Frame::default(),
            depth: 0.0,
            shape: Shape::Toolpath,
            copies: vec![Frame::default()],
            tolerance: None,
            fit: None,
        };
        let operation = Operation {
            origin: origin(operation),
            keyword: operation.keyword().into(),
            name: text(operation, 0),
            retract: None,
            start: None,
            tool,
            technology,
            functions,
            overcut: None,
            toolpaths,
            direction: None,
            kind: OperationKind::Other,
        };
        let security = Plane { point: [0.0; 3], normal: [0.0, 0.0, 1.0] };
        Some(Workingstep { origin: origin(node), name: text(node, 0), security, feature, operation, stock_top: None, stock: None })
    }

    fn tool(&mut self, operation: Node<'m>) -> Tool {
        let node = self.tools.get(&operation.id()).copied();
        let of = node.unwrap_or(operation);
        let name = node.map_or(String::new(), |n| text(n, 0));
        let length = |word: &str| {
            let all = self.properties(of.id()).iter().filter(|(n, _)| n.to_lowercase().contains(word));
            all.filter_map(|(_, item)| self.measure(*item)).map(|m| m.0).find(|v| *v > 0.0)
        };
        let (diameter, long) = (length("diameter").unwrap_or(0.0), length("overall assembly length"));
        self.r.numbered(Tool { origin: origin(of), name, kind: "MACHINING_TOOL".into(), diameter, length: long, ..Tool::default() })
    }

    fn technology(&self, of: Node<'m>, usual: Option<Technology>) -> Technology {
        let mut t = usual.unwrap_or(Technology { origin: origin(of), clockwise: true, ..Technology::default() });
        for node in self.related(of.id(), "MACHINING_TECHNOLOGY") {
            t.origin = origin(node);
            let of = |name: &str| self.properties(node.id()).iter().find(|p| p.0 == name).and_then(|p| self.measure(p.1));
            if let Some((rev_per_s, _)) = of("spindle") {
                // As in ISO 14649: positive is counter-clockwise.
                (t.speed, t.clockwise) = (Some(rev_per_s.abs() * 60.0), rev_per_s <= 0.0);
            }
            if let Some((feed, per_rev)) = of("feedrate") {
                t.feed = if per_rev { t.speed.map(|s| feed * s / 60.0) } else { Some(feed) };
            }
        }
        t.feed = t.feed.filter(|f| *f > 0.0);
        t
    }

    fn functions(&self, of: u64) -> Functions {
        let mut out = Functions::default();
        for f in self.related(of, "MACHINING_FUNCTIONS") {
            let on = self.words(f.id(), "coolant").is_some_and(|w| w.contains("on"));
            let mist = self.words(f.id(), "coolant type").is_some_and(|w| w.contains("mist"));
            (out.flood, out.mist) = (on && !mist, on && mist);
        }
        out
    }

    fn path(&mut self, node: Node<'m>, usual: Technology) -> Option<Toolpath> {
        let kind = text(node, 1);
        let path = if kind == "feedstop" {
            let dwell = self.properties(node.id()).iter().find(|p| p.0 == "dwell").and_then(|p| self.measure(p.1));
            PathKind::Feedstop(dwell.map_or(0.0, |d| d.0.max(0.0)))
        } else if kind.is_empty() || kind == "cutter location trajectory" || kind == "trajectory" {
            let curves = ["POLYLINE", "CIRCLE", "TRIMMED_CURVE", "COMPOSITE_CURVE"];
            let items: Vec<(String, Node<'m>)> = self.properties(node.id()).to_vec();
            let curve = items.iter().find(|p| curves.contains(&p.1.keyword())).map(|p| p.1);
            let Some(curve) = curve else {
                self.refuse(node, ": it has no POLYLINE, CIRCLE, TRIMMED_CURVE or COMPOSITE_CURVE");
                return None;
            };
            let mut curve = self.r.curve(curve, 0)?;
            scaled(&mut curve, self.scale);
            if self.words(node.id(), "direction").is_some_and(|w| w.contains("end to beginning")) {
                curve = curve.reversed();
            }
            if let Some((name, _)) = items.iter().find(|p| p.0.contains("tool axis") || p.0.contains("toolaxis")) {
                self.refuse(node, &format!(": its {name} is not"));
                return None;
            }
            for p in std::iter::once(curve.start).chain(curve.pieces.iter().map(Piece::end)) {
                self.highest = self.highest.max(p[2]);
            }
            PathKind::Location { curve, axis: None }
        } else {
            self.refuse(node, &format!(": a {kind}"));
            return None;
        };
        let rapid = self.properties(node.id()).iter().any(|(n, i)| {
            (n.contains("speed") || n.contains("movement")) && i.keyword() == "DESCRIPTIVE_REPRESENTATION_ITEM" && text(*i, 1).to_lowercase().contains("rapid")
        });
        let own = self.technology(node, Some(usual));
        let functions = (!self.related(node.id(), "MACHINING_FUNCTIONS").is_empty()).then(|| self.functions(node.id()));
        let role = self.words(node.id(), "trajectory type").unwrap_or_default().to_uppercase().replace(' ', "_");
        Some(Toolpath { origin: origin(node), role, rapid, ratio: None, technology: Some(own), functions, path })
    }
}

fn scaled(curve: &mut Curve, by: f64) {
    let s = |p: &mut [f64; 3]| *p = p.map(|c| c * by);
    s(&mut curve.start);
    for piece in &mut curve.pieces {
        match piece {
            Piece::Line(p) => s(p),
            Piece::Arc { center, end, .. } => {
                s(center);
                s(end);
            }
        }
    }
}

/// AP238 files of this subset have no security plane: rapids between workingsteps go above the highest point.
fn raise(elements: &mut [Element], z: f64) {
    for e in elements {
        match e {
            Element::Plan(p) => raise(&mut p.elements, z),
            Element::Step(s) => s.security.point[2] = z,
            _ => {}
        }
    }
}
