//! From a typed model to the process model: follows PROJECT → WORKPLAN → executables, decides conditions,
//! resolves features, operations and tools. What is missing or cannot be decided is a diagnostic at the
//! statement that lacks it.

mod feature;
mod geometry;
mod operation;

use std::collections::{BTreeMap, BTreeSet};

use gr_step::{Model, Node};
use gr_text::{Code, Diagnostic, FileId, Severity, code};

use crate::frame::Frame;
use crate::process::*;

/// More executables than this are a mistake.
const MOST_ELEMENTS: usize = 1_000_000;
/// More passes of one WHILE are a mistake.
const MOST_PASSES: usize = 10_000;
/// Structures inside structures.
const DEEPEST: usize = 64;

pub(crate) struct Reader<'m> {
    pub model: &'m Model<'m>,
    pub file: FileId,
    pub units: Units,
    pub out: Vec<Diagnostic>,
    pub tools: Vec<Tool>,
    /// Elements of compound features and base features of patterns → what they belong to.
    pub parents: BTreeMap<u64, Node<'m>>,
    pub placed_twice: BTreeSet<u64>,
    variables: BTreeMap<String, Option<f64>>,
    stack: Vec<u64>,
    count: usize,
    reached: BTreeSet<u64>,
    units_said: bool,
    /// Raw blocks of the workpieces.
    blocks: Vec<(u64, Frame, [f64; 3])>,
    /// Places and words of what was told, so that it is told once.
    said: BTreeSet<(u32, String)>,
}

pub(crate) fn origin(node: Node<'_>) -> Origin {
    Origin { id: node.id(), span: node.span() }
}

/// `#12 MACHINING_WORKINGSTEP 'name'`
pub(crate) fn title(node: Node<'_>) -> String {
    let name = node.string("its_id");
    if name.trim().is_empty() { format!("#{} {}", node.id(), node.keyword()) } else { format!("#{} {} '{name}'", node.id(), node.keyword()) }
}

/// Reads the process of a file.
pub(crate) fn read<'m>(model: &'m Model<'m>, file: FileId, units: Option<Units>) -> (Option<Process>, Vec<Tool>, Vec<Diagnostic>) {
    let mut parents = BTreeMap::new();
    for kind in ["compound_feature", "replicate_feature"] {
        for parent in model.all(kind) {
            let children = parent.nodes("elements").into_iter().chain(parent.node("replicate_base_feature"));
            parents.extend(children.map(|c| (c.id(), parent)));
        }
    }
    let mut r = Reader {
        model,
        file,
        units: units.unwrap_or(Units::Iso),
        out: Vec::new(),
        tools: Vec::new(),
        parents,
        placed_twice: BTreeSet::new(),
        variables: BTreeMap::new(),
        stack: Vec::new(),
        count: 0,
        reached: BTreeSet::new(),
        units_said: units.is_some(),
        blocks: Vec::new(),
        said: BTreeSet::new(),
    };
    let process = r.project();
    (process, r.tools, r.out)
}

impl<'m> Reader<'m> {
    /// For curves and messages alone; angles are radians.
    pub fn bare(model: &'m Model<'m>, file: FileId) -> Reader<'m> {
        Reader {
            model,
            file,
            units: Units::StepModeler,
            out: Vec::new(),
            tools: Vec::new(),
            parents: BTreeMap::new(),
            placed_twice: BTreeSet::new(),
            variables: BTreeMap::new(),
            stack: Vec::new(),
            count: 0,
            reached: BTreeSet::new(),
            units_said: true,
            blocks: Vec::new(),
            said: BTreeSet::new(),
        }
    }
    pub fn say(&mut self, code: Code, node: Node<'_>, args: &[&str]) {
        let args: Vec<String> = args.iter().map(|a| (*a).to_string()).collect();
        let d = Diagnostic::new(code, self.file, node.keyword_span(), &args);
        if self.said.insert((d.labels.first().map_or(0, |l| l.span.start), d.message.clone())) {
            self.out.push(d);
        }
    }
    pub fn say_at(&mut self, code: Code, node: Node<'_>, attribute: &str, args: &[&str]) {
        let span = node.written(attribute).map_or(node.keyword_span(), |v| v.span());
        let args: Vec<String> = args.iter().map(|a| (*a).to_string()).collect();
        let d = Diagnostic::new(code, self.file, span, &args);
        if self.said.insert((d.labels.first().map_or(0, |l| l.span.start), d.message.clone())) {
            self.out.push(d);
        }
    }
    pub fn missing(&mut self, node: Node<'_>, attribute: &str, why: &str) {
        // What is given and could not be read has had its message where it is wrong.
        if node.node(attribute).is_some() && self.failed() {
            return;
        }
        self.say_at(code::PLAN_MISSING_VALUE, node, attribute, &[&title(node), attribute, why]);
    }
    pub fn not_lowered(&mut self, node: Node<'_>, why: &str) {
        self.say(code::PLAN_NOT_LOWERED, node, &[&title(node), why]);
    }
    pub fn no_effect(&mut self, node: Node<'_>, attribute: &str, why: &str) {
        self.say_at(code::PLAN_NO_EFFECT, node, attribute, &[attribute, &title(node), why]);
    }
    /// Told to have no effect if it is given.
    pub fn unused(&mut self, node: Node<'_>, attribute: &str, why: &str) {
        if node.attr(attribute).is_some() {
            self.no_effect(node, attribute, why);
        }
    }
    /// Likewise where it is a flag that is set.
    pub fn unused_flag(&mut self, node: Node<'_>, attribute: &str, why: &str) {
        if node.attr(attribute).and_then(|v| v.boolean()) == Some(true) {
            self.no_effect(node, attribute, why);
        }
    }
    pub fn failed(&self) -> bool {
        self.out.iter().any(|d| d.severity == Severity::Error)
    }
    /// A finite positive number, or a diagnostic.
    pub fn positive(&mut self, node: Node<'m>, attribute: &str, why: &str) -> Option<f64> {
        let Some(v) = node.length(attribute) else {
            self.missing(node, attribute, why);
            return None;
        };
        self.in_range(node, attribute, v, f64::MIN_POSITIVE, "above zero")
    }
    pub fn in_range(&mut self, node: Node<'m>, attribute: &str, v: f64, low: f64, what: &str) -> Option<f64> {
        const MOST: f64 = 1e7;
        if v.is_finite() && v >= low && v < MOST {
            return Some(v);
        }
        let what = if v >= MOST { "a number that a machine can have" } else { what };
        self.say_at(code::PLAN_BAD_SIZE, node, attribute, &[&title(node), attribute, &v.to_string(), what]);
        None
    }
    pub fn angle(&self, v: f64) -> f64 {
        match self.units {
            Units::Iso => v.to_radians(),
            Units::StepModeler => v,
        }
    }
    /// Told once in a file: nothing in it says which of two readings is meant.
    pub fn units_are_open(&mut self, node: Node<'_>, attribute: &str, iso: &str, other: &str) {
        if !self.units_said {
            self.units_said = true;
            self.say_at(code::PLAN_UNITS_OPEN, node, attribute, &[iso, other]);
        }
    }

    fn project(&mut self) -> Option<Process> {
        let projects: Vec<Node<'m>> = self.model.all("project").collect();
        let Some(project) = projects.first().copied() else {
            let why = match self.model.header("FILE_SCHEMA").and_then(|s| s.parameters().next()).and_then(|v| v.items().next()) {
                Some(schema) => format!("no PROJECT; its schema is {}", schema.string().unwrap_or_default()),
                None => "no PROJECT".to_string(),
            };
            let d = Diagnostic::new(code::PLAN_NO_PROJECT, self.file, gr_text::Span::new(0, 0), &[why]);
            self.out.push(d);
            return None;
        };
        for other in projects.iter().skip(1) {
            self.say(code::PLAN_SECOND_PROJECT, *other, &[&title(*other), &title(project)]);
            self.mark(&other.node("main_workplan").into_iter().collect::<Vec<_>>());
        }
        for v in self.model.all("nc_variable") {
            self.variables.insert(v.string("its_name").into_owned(), v.real("initial_value"));
        }
        for v in self.model.all("nc_constant") {
            self.variables.insert(v.string("its_name").into_owned(), v.real("its_value"));
        }
        let variables = self.variables.clone().into_iter().collect();
        let Some(main) = project.node("main_workplan") else {
            self.missing(project, "main_workplan", "it says what is executed");
            return None;
        };
        let workpieces: Vec<Workpiece> = self.model.all("workpiece").map(|w| self.workpiece(w)).collect();
        self.blocks = workpieces.iter().filter_map(|w| w.block.map(|(frame, size)| (w.origin.id, frame, size))).collect();
        let mut elements = Vec::new();
        self.element(main, None, &mut elements);
        let orphans: Vec<Origin> =
            self.model.all("workingstep").filter(|w| !self.reached.contains(&w.id())).map(origin).collect();
        if let Some(first) = orphans.first().and_then(|o| self.model.get(o.id)) {
            let ids: Vec<String> = orphans.iter().map(|o| format!("#{}", o.id)).collect();
            self.say(code::PLAN_ORPHAN_STEP, first, &[&ids.len().to_string(), &ids.join(", ")]);
        }
        let name = project.string("its_id").into_owned();
        Some(Process { name, units: self.units, workpieces, elements, orphans, variables })
    }

    fn workpiece(&mut self, w: Node<'m>) -> Workpiece {
        let block = w.node("its_bounding_geometry").filter(|b| b.keyword() == "BLOCK").or_else(|| {
            w.node("its_rawpiece").and_then(|r| r.node("its_bounding_geometry")).filter(|b| b.keyword() == "BLOCK")
        });
        let block = block.and_then(|b| {
            let frame = b.node("position").and_then(|p| self.placement(p)).unwrap_or_default();
            Some((frame, [b.real("x")?, b.real("y")?, b.real("z")?]))
        });
        let stated = w.node("its_material");
        if let Some(t) = w.length("global_tolerance")
            && self.in_range(w, "global_tolerance", t, 0.0, "zero or more").is_some()
            && t < 1.0
            && kept_tolerance(t) != t
        {
            let why = format!("{} mm is none that a path keeps: {} mm is kept", t, kept_tolerance(t));
            self.no_effect(w, "global_tolerance", &why);
        }
        let material = stated.map_or(String::new(), |m| m.string("standard_identifier").into_owned());
        let material_at = stated.map(origin);
        Workpiece { origin: origin(w), name: w.string("its_id").into_owned(), material, material_at, tolerance: w.length("global_tolerance"), block }
    }

    /// Adds what an executable does.
    fn element(&mut self, node: Node<'m>, setup: Option<&Setup>, out: &mut Vec<Element>) {
        self.count += 1;
        if self.count > MOST_ELEMENTS {
            if self.count == MOST_ELEMENTS + 1 {
                self.say(code::PLAN_TOO_MUCH, node, &["the plan", &MOST_ELEMENTS.to_string(), "executables"]);
            }
            return;
        }
        if self.stack.contains(&node.id()) {
            return self.say(code::PLAN_GOES_ROUND, node, &[&title(node)]);
        }
        if self.stack.len() >= DEEPEST {
            return self.say(code::PLAN_TOO_MUCH, node, &["the plan", &DEEPEST.to_string(), "structures inside each other"]);
        }
        self.reached.insert(node.id());
        self.stack.push(node.id());
        self.dispatch(node, setup, out);
        self.stack.pop();
    }

    fn dispatch(&mut self, node: Node<'m>, setup: Option<&Setup>, out: &mut Vec<Element>) {
        match node.keyword() {
            "WORKPLAN" => self.workplan(node, setup, out),
            "MACHINING_WORKINGSTEP" | "TURNING_WORKINGSTEP" => {
                if let Some(step) = self.workingstep(node, setup) {
                    out.push(Element::Step(Box::new(step)));
                }
            }
            "RAPID_MOVEMENT" | "RETURN_HOME" => {
                if let Some(rapid) = self.rapid(node) {
                    out.push(Element::Rapid(Box::new(rapid)));
                }
            }
            "WORKPIECE_PROBING" => {
                if let Some(probe) = self.probe(node, setup) {
                    out.push(Element::Probe(Box::new(probe)));
                }
            }
            "IF_STATEMENT" => self.if_statement(node, setup, out),
            "WHILE_STATEMENT" => self.while_statement(node, setup, out),
            "ASSIGNMENT" => self.assignment(node),
            "NON_SEQUENTIAL" => self.elements(node, "its_elements", setup, out),
            "PARALLEL" => {
                let rule = "its branches run one after another, in the order they are written";
                self.say(code::PLAN_TAKES_TURNS, node, &[&title(node), rule]);
                self.elements(node, "branches", setup, out);
            }
            "SELECTIVE" => {
                let choices = node.nodes("its_elements");
                if let Some(first) = choices.first().copied() {
                    let rule = format!("of its {} alternatives the first is taken, {}", choices.len(), title(first));
                    self.say(code::PLAN_TAKES_TURNS, node, &[&title(node), &rule]);
                    self.mark(&choices);
                    self.element(first, setup, out);
                }
            }
            _ if node.is_a("nc_function") => {
                if let Some(kind) = self.function(node) {
                    out.push(Element::Function(Function { origin: origin(node), name: node.string("its_id").into_owned(), kind }));
                }
            }
            _ if node.is_a("tool_probing") => self.not_lowered(node, ": where the tool setter stands is known to the machine alone"),
            "WORKPIECE_COMPLETE_PROBING" => self.not_lowered(node, ": which points are touched is left to the control; WORKPIECE_PROBING names them"),
            _ if node.is_a("executable") => self.not_lowered(node, ""),
            other => {
                let what = format!("; a workplan takes workingsteps, functions and structures, not {other}");
                self.not_lowered(node, &what);
            }
        }
    }

    /// Alternatives that are not taken still belong to the plan.
    fn mark(&mut self, nodes: &[Node<'m>]) {
        let mut todo: Vec<(Node<'m>, usize)> = nodes.iter().map(|n| (*n, 0)).collect();
        let mut seen = BTreeSet::new();
        while let Some((n, depth)) = todo.pop() {
            if depth < DEEPEST && n.is_a("executable") && seen.insert(n.id()) {
                self.reached.insert(n.id());
                todo.extend(n.references().filter(|r| r.is_a("executable")).map(|r| (r, depth + 1)));
            }
        }
    }

    fn elements(&mut self, node: Node<'m>, attribute: &str, setup: Option<&Setup>, out: &mut Vec<Element>) {
        for child in node.nodes(attribute) {
            self.element(child, setup, out);
        }
    }

    fn workplan(&mut self, node: Node<'m>, setup: Option<&Setup>, out: &mut Vec<Element>) {
        if node.attr("its_channel").is_some() {
            self.no_effect(node, "its_channel", "there is one channel");
        }
        let own = node.node("its_setup").map(|s| self.setup(s));
        let mut elements = Vec::new();
        self.elements(node, "its_elements", own.as_ref().or(setup), &mut elements);
        out.push(Element::Plan(Plan { origin: origin(node), name: node.string("its_id").into_owned(), setup: own, elements }));
    }

    fn setup(&mut self, node: Node<'m>) -> Setup {
        let frame = node.node("its_origin").and_then(|p| self.placement(p));
        let security = node.node("its_secplane").and_then(|p| self.plane(p)).map(|p| p.point[2]);
        let mut workpieces = Vec::new();
        for w in node.nodes("its_workpiece_setup") {
            let frame = w.node("its_origin").and_then(|p| self.placement(p)).unwrap_or_default();
            if let Some(piece) = w.node("its_workpiece") {
                workpieces.push((piece.id(), frame));
            }
            for a in ["its_offset", "its_restricted_area"] {
                if w.attr(a).is_some() {
                    self.no_effect(w, a, "it is known only at the machine");
                }
            }
        }
        Setup { origin: origin(node), name: node.string("its_id").into_owned(), frame, security, workpieces }
    }

    fn workingstep(&mut self, node: Node<'m>, setup: Option<&Setup>) -> Option<Workingstep> {
        let feature = node.node("its_feature").or_else(|| node.nodes("its_features").first().copied());
        let operation = node.node("its_operation");
        let security = node.node("its_secplane").and_then(|p| self.plane(p));
        let (Some(feature), Some(operation)) = (feature, operation) else {
            let which = if feature.is_none() && node.keyword() == "TURNING_WORKINGSTEP" { "its_features" } else if feature.is_none() { "its_feature" } else { "its_operation" };
            self.missing(node, which, "nothing can be machined without it");
            return None;
        };
        let Some(security) = security else {
            self.missing(node, "its_secplane", "rapids need a plane above which they are safe");
            return None;
        };
        if security.normal[2] < 1.0 - 1e-9 {
            self.no_effect(node, "its_secplane", "it is not level; only the height of its point counts");
        }
        let op = self.operation(operation);
        let feature = self.feature(feature, setup, operation.id());
        let (operation, feature) = (op?, feature?);
        let stock = self.stock(setup);
        let stock_top = stock.map(|s| s[1][2]);
        let name = node.string("its_id").into_owned();
        Some(Workingstep { origin: origin(node), name, security, feature, operation, stock_top, stock })
    }

    /// The box around all raw parts of the setup.
    fn stock(&self, setup: Option<&Setup>) -> Option<[[f64; 3]; 2]> {
        let mut bounds: Option<[[f64; 3]; 2]> = None;
        for (id, frame, size) in &self.blocks {
            let place = setup.and_then(|s| s.workpieces.iter().find(|p| p.0 == *id)).map_or(Frame::default(), |p| p.1);
            let frame = place.place(frame);
            for corner in 0..8 {
                let at = |i: usize| if corner >> i & 1 == 1 { size[i] } else { 0.0 };
                let p = frame.point([at(0), at(1), at(2)]);
                let [low, high] = bounds.unwrap_or([p, p]);
                bounds = Some([std::array::from_fn(|i| low[i].min(p[i])), std::array::from_fn(|i| high[i].max(p[i]))]);
            }
        }
        bounds
    }

    fn rapid(&mut self, node: Node<'m>) -> Option<Rapid> {
        let Some(security) = node.node("its_secplane").and_then(|p| self.plane(p)) else {
            self.missing(node, "its_secplane", "rapids need a plane above which they are safe");
            return None;
        };
        let toolpaths = node.node("its_toolpath").map(|t| self.toolpaths(t, None)).unwrap_or_default();
        let home = node.keyword() == "RETURN_HOME";
        if toolpaths.is_empty() && !home {
            self.missing(node, "its_toolpath", "a rapid movement has to say where to");
            return None;
        }
        Some(Rapid { origin: origin(node), name: node.string("its_id").into_owned(), security, toolpaths, home })
    }

    /// A touch probe: of its attributes the program needs a number in the tool table.
    fn probe_tool(&mut self, node: Node<'m>) -> Tool {
        let dimension = node.node("dimension");
        let number = |a: &str| dimension.and_then(|d| d.real(a)).or_else(|| node.real(a)).filter(|v| *v > 0.0 && v.is_finite());
        let tool = Tool {
            origin: origin(node),
            name: node.string("its_id").into_owned(),
            kind: node.keyword().to_string(),
            diameter: number("diameter").unwrap_or(0.0),
            length: number("overall_assembly_length"),
            ..Tool::default()
        };
        self.numbered(tool)
    }

    fn probe(&mut self, node: Node<'m>, setup: Option<&Setup>) -> Option<Probe> {
        let security = node.node("its_secplane").and_then(|p| self.plane(p));
        let start = node.node("start_position").and_then(|p| self.placement(p)).map(|f| f.origin);
        let direction = node.node("its_direction").and_then(|d| self.direction(d));
        let distance = node.length("expected_value");
        let (Some(security), Some(start), Some(direction), Some(distance)) = (security, start, direction, distance) else {
            self.missing(node, "start_position", "probing needs a start, a direction, an expected value and a security plane");
            return None;
        };
        let piece = node.node("its_workpiece").map(|w| w.id());
        let place = setup.and_then(|s| s.workpieces.iter().find(|p| Some(p.0) == piece)).map_or(Frame::default(), |p| p.1);
        let variable = node.node("measured_offset").map_or(String::new(), |v| v.string("its_name").into_owned());
        self.variables.insert(variable.clone(), None);
        let name = node.string("its_id").into_owned();
        let (start, direction) = (place.point(start), place.vector(direction));
        let tool = node.node("its_probe").map(|t| self.probe_tool(t));
        Some(Probe { origin: origin(node), name, security, start, direction, distance, variable, tool })
    }

    fn function(&mut self, node: Node<'m>) -> Option<FunctionKind> {
        Some(match node.keyword() {
            "DISPLAY_MESSAGE" => FunctionKind::Message(node.string("its_text").into_owned()),
            "OPTIONAL_STOP" => FunctionKind::OptionalStop,
            "PROGRAM_STOP" => FunctionKind::ProgramStop,
            "EXCHANGE_PALLET" => FunctionKind::ExchangePallet,
            "UNLOAD_TOOL" => FunctionKind::UnloadTool,
            "LOAD_TOOL" => FunctionKind::LoadTool(node.node("its_tool").and_then(|t| self.tool(t))?),
            "SET_MARK" | "WAIT_FOR_MARK" => {
                self.no_effect(node, "its_id", "there is one channel");
                return None;
            }
            "INDEX_PALLET" | "INDEX_TABLE" => {
                self.not_lowered(node, ": which way the part lies at an index is known to the machine alone; a setup of its own says it");
                return None;
            }
            _ => {
                self.not_lowered(node, "");
                return None;
            }
        })
    }

    fn if_statement(&mut self, node: Node<'m>, setup: Option<&Setup>, out: &mut Vec<Element>) {
        let both: Vec<Node<'m>> = node.node("true_branch").into_iter().chain(node.node("false_branch")).collect();
        self.mark(&both);
        let Some(condition) = node.node("condition") else {
            return self.missing(node, "condition", "the branch cannot be decided without it");
        };
        match self.condition(condition, 0) {
            Some(true) => {
                if let Some(branch) = node.node("true_branch") {
                    self.element(branch, setup, out);
                }
            }
            Some(false) => {
                if let Some(branch) = node.node("false_branch") {
                    self.element(branch, setup, out);
                }
            }
            None => self.undecided(node, condition),
        }
    }

    fn while_statement(&mut self, node: Node<'m>, setup: Option<&Setup>, out: &mut Vec<Element>) {
        let (Some(condition), Some(body)) = (node.node("condition"), node.node("body")) else {
            return self.missing(node, "condition", "the loop cannot be decided without condition and body");
        };
        self.mark(&[body]);
        for _ in 0..MOST_PASSES {
            match self.condition(condition, 0) {
                Some(true) => self.element(body, setup, out),
                Some(false) => return,
                None => return self.undecided(node, condition),
            }
            if self.failed() {
                return;
            }
        }
        self.say(code::PLAN_TOO_MUCH, node, &[&title(node), &MOST_PASSES.to_string(), "passes"]);
    }

    fn undecided(&mut self, node: Node<'m>, condition: Node<'m>) {
        let names: Vec<String> = self.unknown_in(condition, 0);
        self.say(code::PLAN_RUN_TIME_DECISION, node, &[&title(node), &names.join(", ")]);
    }

    fn unknown_in(&self, node: Node<'m>, depth: usize) -> Vec<String> {
        if node.is_a("nc_variable") {
            let name = node.string("its_name").into_owned();
            let unknown = !matches!(self.variables.get(&name), Some(Some(_)));
            return if unknown { vec![format!("variable '{name}'")] } else { Vec::new() };
        }
        if depth > DEEPEST {
            return Vec::new();
        }
        node.references().flat_map(|n| self.unknown_in(n, depth + 1)).collect()
    }

    fn assignment(&mut self, node: Node<'m>) {
        let Some(target) = node.node("its_lvalue") else {
            return self.missing(node, "its_lvalue", "an assignment needs a variable");
        };
        let value = node.node("its_rvalue").and_then(|v| self.value(v));
        self.variables.insert(target.string("its_name").into_owned(), value);
    }

    fn value(&self, node: Node<'m>) -> Option<f64> {
        self.variables.get(node.string("its_name").as_ref()).copied().flatten()
    }

    fn condition(&self, node: Node<'m>, depth: usize) -> Option<bool> {
        if depth > DEEPEST {
            return None;
        }
        let one = |name: &str| self.condition(node.node(name)?, depth + 1);
        let compare = |f: fn(&f64, &f64) -> bool| Some(f(&self.value(node.node("operand1")?)?, &self.value(node.node("operand2")?)?));
        match node.keyword() {
            "NOT_EXPRESSION" => one("operand").map(|v| !v),
            "XOR_EXPRESSION" => Some(one("operand1")? != one("operand2")?),
            "AND_EXPRESSION" | "OR_EXPRESSION" => {
                let and = node.keyword() == "AND_EXPRESSION";
                let all: Vec<Option<bool>> = node.nodes("operands").into_iter().map(|n| self.condition(n, depth + 1)).collect();
                if all.contains(&Some(!and)) {
                    Some(!and)
                } else if all.contains(&None) {
                    None
                } else {
                    Some(and)
                }
            }
            "COMPARISON_EQUAL" => compare(|a, b| a == b),
            "COMPARISON_NOT_EQUAL" => compare(|a, b| a != b),
            "COMPARISON_GREATER" => compare(|a, b| a > b),
            "COMPARISON_GREATER_EQUAL" => compare(|a, b| a >= b),
            "COMPARISON_LESS" => compare(|a, b| a < b),
            "COMPARISON_LESS_EQUAL" => compare(|a, b| a <= b),
            _ => None,
        }
    }
}
