//! The default planner: a process model becomes a motion program. Rapids go by the security plane, never into
//! the part; what cannot be done is an error, never left out.

use std::collections::{BTreeMap, BTreeSet};

use gr_ir::{Marker, Note, Op, PathMode, Program, Source, Stop};
use gr_text::{Diagnostic, FileId, LineIndex, Severity, code};

use crate::emit::Emit;
use crate::process::*;
use crate::stock::Stock;
use crate::{drill, explicit, mill};

/// Above the part, where the security plane is inside it, mm.
const ABOVE_STOCK: f64 = 5.0;
/// The part of the tolerance that the control may use at corners: one in so many.
const BLEND_SHARE: f64 = 5.0;

/// What can be chosen.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Options {
    /// How technology is read; none: as the standard says, and where its speeds contradict that, not at all.
    pub units: Option<Units>,
    /// How overlaps are read; none: millimetres in STEP Modeler's units, else a ratio.
    pub overlap: Option<Overlap>,
    /// Name of the file, for messages and the sources of operations.
    pub name: String,
    /// Greatest distance of a rough wall or a scallop from the true surface, mm; none: the part's tolerance, or 0.05.
    pub tolerance: Option<f64>,
    /// Tools of the control that take the place of the file's own numbers; none: numbers from 1.
    pub tools: Vec<Loaded>,
    /// Greatest axial depth of cut that the machine stands, mm.
    pub axial_depth: Option<f64>,
}

/// The tool of the control that a tool of the file is.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Loaded {
    /// Number as [`crate::process`] gives it.
    pub tool: u32,
    /// Number in the control's tool table.
    pub number: u32,
    /// Length in that table, mm; none: as the file says.
    pub length: Option<f64>,
}

fn load(tool: &mut Tool, loaded: &[Loaded]) {
    if let Some(l) = loaded.iter().find(|l| l.tool == tool.number) {
        tool.number = l.number;
        tool.length = l.length.or(tool.length);
    }
}

fn load_all(elements: &mut [Element], loaded: &[Loaded]) {
    for element in elements {
        match element {
            Element::Plan(p) => load_all(&mut p.elements, loaded),
            Element::Step(s) => load(&mut s.operation.tool, loaded),
            Element::Function(Function { kind: FunctionKind::LoadTool(t), .. }) => load(t, loaded),
            _ => {}
        }
    }
}

/// A planned program.
#[derive(Clone, PartialEq, Debug)]
pub struct Planned {
    /// What the file says.
    pub process: Process,
    /// Motion.
    pub program: Program,
    /// Tools, by number.
    pub tools: Vec<Tool>,
}

/// Plans a file. Faults of syntax and schema are not told here; with an error there is no program.
pub fn plan(text: &[u8], file: FileId, options: &Options) -> (Option<Planned>, Vec<Diagnostic>) {
    let exchange = gr_p21::parse(text);
    let model = gr_step::Model::new(text, &exchange);
    let (process, mut tools, mut out) = crate::of_model(&model, file, options.units);
    let Some(mut process) = process else { return (None, out) };
    load_all(&mut process.elements, &options.tools);
    tools.iter_mut().for_each(|t| load(t, &options.tools));
    let lines = LineIndex::new(text);
    let tilted = process.steps().iter().any(|s| {
        let axis = |t: &Toolpath| matches!(t.path, PathKind::Location { axis: Some(_), .. });
        s.feature.copies.iter().any(|f| !f.upright()) || s.operation.toolpaths.iter().any(axis)
    });
    let mut p = Planner {
        e: Emit::new(&lines, &model, file, tilted),
        security: 0.0,
        setup: None,
        setups: Vec::new(),
        axes: Vec::new(),
        tolerance: tolerance(&process, options),
        tells: tells(&process),
        overlap: options.overlap.unwrap_or(match process.units {
            Units::StepModeler => Overlap::Millimetres,
            Units::Iso => Overlap::Ratio,
        }),
        smallest: tools.iter().map(|t| t.diameter / 2.0).filter(|r| *r > 0.0).fold(f64::INFINITY, f64::min),
        block: None,
        axial_depth: options.axial_depth,
        made: BTreeSet::new(),
        drilled: drilled(&process),
        pallet: None,
    };
    p.e.b.file(file, &options.name);
    p.e.begin();
    // Controls round corners as they please unless they are told how far they may go.
    let share = p.tolerance / BLEND_SHARE;
    p.e.push(Op::PathMode(PathMode::Blend(share)));
    p.security = highest(&process);
    p.elements(&process.elements);
    let security = p.security;
    p.e.end(security);
    p.change_pallet();
    p.e.push(Op::End);
    let mut holes: BTreeMap<u64, Vec<(&Workingstep, &Feature)>> = BTreeMap::new();
    for s in process.steps() {
        for f in targets(s, &p.drilled) {
            holes.entry(f.origin.id).or_default().push((s, f));
        }
    }
    holes.values().for_each(|steps| drill::leftovers(&mut p.e, steps));
    for s in process.steps().into_iter().filter(|s| p.tells.contains(&s.origin.id)) {
        let Shape::Slot { section: Section::Tee { .. }, .. } = s.feature.shape else { continue };
        let own = |t: &&Workingstep| t.feature.origin.id == s.feature.origin.id;
        if process.steps().into_iter().filter(own).all(|t| t.operation.toolpaths.is_empty() && t.operation.tool.kind != "T_SLOT_MILL") {
            let tool = &s.operation.tool;
            let (name, of) = (format!("T{}", tool.number), format!("#{} {}", s.feature.origin.id, s.feature.keyword));
            let why = "its bar, no workingstep has a T_SLOT_MILL";
            p.e.say(code::PLAN_UNREACHABLE_CORNER, s.operation.origin, &[&name, &format!("{:.4}", tool.diameter / 2.0), &of, why]);
        }
    }
    for s in process.steps() {
        let Shape::Compound(all) = &s.feature.shape else { continue };
        for f in all.iter().filter(|f| !holes.contains_key(&f.origin.id)) {
            let tool = &s.operation.tool;
            let (name, of) = (format!("T{}", tool.number), format!("#{} {}", f.origin.id, f.keyword));
            let why = format!("no workingstep makes this element of #{} {}", s.feature.origin.id, s.feature.keyword);
            p.e.say(code::PLAN_UNREACHABLE_CORNER, s.feature.origin, &[&name, &format!("{:.4}", tool.diameter / 2.0), &of, &why]);
        }
    }
    out.append(&mut p.e.out);
    let failed = out.iter().any(|d| d.severity == Severity::Error);
    let program = p.e.b.finish();
    (if failed { None } else { Some(Planned { process, program, tools }) }, out)
}

fn tolerance(process: &Process, options: &Options) -> f64 {
    let written = process.workpieces.iter().filter_map(|w| w.tolerance).find(|t| *t > 0.0);
    options.tolerance.unwrap_or_else(|| kept_tolerance(written.unwrap_or(0.0))).clamp(0.001, 0.5)
}

/// Of each feature, the workingstep that leaves least: least allowance, then the smallest tool, then the last.
fn tells(process: &Process) -> BTreeSet<u64> {
    let mut best: BTreeMap<u64, (f64, f64, u64)> = BTreeMap::new();
    for s in process.steps() {
        let OperationKind::Mill(m) = &s.operation.kind else { continue };
        let own = (m.allowance_side, s.operation.tool.diameter, s.origin.id);
        let kept = best.entry(s.feature.origin.id).or_insert(own);
        if own.0 < kept.0 - 1e-9 || (own.0 - kept.0).abs() <= 1e-9 && own.1 <= kept.1 {
            *kept = own;
        }
    }
    best.into_values().map(|b| b.2).collect()
}

fn highest(process: &Process) -> f64 {
    process.steps().iter().map(|s| s.security.point[2]).fold(0.0, f64::max)
}

struct Planner<'a> {
    e: Emit<'a>,
    security: f64,
    setup: Option<Setup>,
    setups: Vec<u64>,
    /// Tilted axes that were told.
    axes: Vec<String>,
    tolerance: f64,
    /// Workingsteps that say what is left of their features.
    tells: BTreeSet<u64>,
    /// How overlaps are written.
    overlap: Overlap,
    /// Radius of the smallest tool.
    smallest: f64,
    /// Raw part of the step before.
    block: Option<[[f64; 3]; 2]>,
    /// Greatest axial depth of the machine.
    axial_depth: Option<f64>,
    /// Operations that were made on their features.
    made: BTreeSet<(u64, u64)>,
    /// Elements of compound features that drills make as wide as they are.
    drilled: BTreeSet<u64>,
    /// The pallet is to be changed before anything else is done.
    pallet: Option<Source>,
}

impl Planner<'_> {
    fn elements(&mut self, all: &[Element]) {
        for element in all {
            if !matches!(element, Element::Plan(_)) {
                self.change_pallet();
            }
            match element {
                Element::Plan(p) => self.workplan(p),
                Element::Step(s) => self.step(s),
                Element::Rapid(r) => self.rapid(r),
                Element::Function(f) => self.function(f),
                Element::Probe(p) => self.probe(p),
            }
        }
    }

    fn workplan(&mut self, p: &Plan) {
        let before = self.setup.clone();
        if let Some(setup) = &p.setup {
            self.change_setup(setup, p.origin);
        }
        self.elements(&p.elements);
        if before.is_some() {
            self.setup = before;
        }
    }

    fn change_setup(&mut self, setup: &Setup, origin: Origin) {
        if self.setup.as_ref().is_some_and(|s| s.origin.id == setup.origin.id) {
            return;
        }
        self.e.from(origin);
        let new = !self.setups.contains(&setup.origin.id);
        if new {
            self.setups.push(setup.origin.id);
        }
        let number = self.setups.iter().position(|s| *s == setup.origin.id).unwrap_or(0) + 1;
        if let Some(before) = self.setup.clone() {
            self.e.say(code::PLAN_NEW_SETUP, setup.origin, &[&format!("'{}'", setup.name), &format!("'{}'", before.name)]);
            let security = self.security;
            self.e.lift(security);
            self.e.stop_spindle();
            self.e.push(Op::Note(Note::Message, &format!("setup {}", setup.name)));
            self.e.push(Op::Stop(Stop::Program));
            self.e.push(Op::WorkOffset(number.min(9) as u8, [0.0; 9]));
            self.e.at = None;
            self.block = None;
        }
        let frame = setup.frame.unwrap_or_default();
        if frame.z[2] < 1.0 - 1e-9 {
            let z = frame.z.map(|c| format!("{:.4}", c + 0.0)).join(",");
            self.e.say(code::PLAN_SETUP_TILTED, setup.origin, &[&format!("'{}'", setup.name), &z]);
        } else {
            self.e.turn_setup(frame.x);
        }
        if new && (frame.origin != [0.0; 3] || frame.x[0] < 1.0 - 1e-9) {
            let turn = libm::atan2(frame.x[1], frame.x[0]).to_degrees();
            let turned = if frame.x[0] < 1.0 - 1e-9 { format!(", turned by {turn:.4} degrees about Z as its coordinates are,") } else { String::new() };
            let at = format!("X{} Y{} Z{}", frame.origin[0], frame.origin[1], frame.origin[2]);
            self.e.say(code::PLAN_SETUP_ORIGIN, setup.origin, &[&format!("'{}'{turned}", setup.name), &at]);
        }
        self.setup = Some(setup.clone());
    }

    fn step(&mut self, s: &Workingstep) {
        self.e.from(s.origin);
        let name = if s.name.is_empty() { format!("#{}", s.origin.id) } else { format!("#{} {}", s.origin.id, s.name) };
        self.e.mark(Marker::Workingstep, s.origin.id, &s.name);
        self.e.note(&name);
        if self.block != s.stock {
            self.block = s.stock;
            self.e.stock = s.stock.and_then(|block| Stock::new(block, self.smallest));
        }
        self.height(s);
        let security = self.security;
        self.e.tool(&s.operation.tool, security);
        self.e.mark(Marker::Feature, s.feature.origin.id, &s.feature.name);
        if s.feature.copies.iter().any(|f| !f.upright()) {
            let z = s.feature.frame.z;
            let axis = format!("{:.4},{:.4},{:.4}", z[0] + 0.0, z[1] + 0.0, z[2] + 0.0);
            if !self.axes.contains(&axis) {
                self.e.say(code::PLAN_TILTED_TOOL, s.origin, &[&axis, "the program states the tool's axis"]);
                self.axes.push(axis);
            }
        }
        self.e.fed = None;
        self.cut(s);
        self.air(s);
        // An explicit path ends where it says; whatever comes next goes by the security plane from there.
        if s.operation.toolpaths.is_empty() {
            self.e.lift(security);
        }
        self.e.push(Op::Close(Marker::Feature));
        self.e.push(Op::Close(Marker::Workingstep));
    }

    /// Steps that meet no material: made before, or beside the raw part.
    fn air(&mut self, s: &Workingstep) {
        let what = format!("#{} {}", s.operation.origin.id, s.operation.keyword);
        if !self.made.insert((s.feature.origin.id, s.operation.origin.id)) {
            let why = format!("the same operation has been made on #{} {} before", s.feature.origin.id, s.feature.keyword);
            self.e.say(code::PLAN_AIR, s.origin, &[&what, &why]);
        }
        let (Some([low, high]), Some([least, most])) = (s.stock, self.e.fed) else { return };
        // The block of a turned part is not where its tool goes.
        if s.operation.tool.diameter == 0.0 {
            return;
        }
        let r = s.operation.tool.diameter / 2.0;
        let beside = (0..2).any(|i| most[i] + r <= low[i] || least[i] - r >= high[i]);
        if beside || least[2] >= high[2] {
            let why = if beside { "all of its way lies beside the raw part" } else { "all of its way lies above the raw part" };
            self.e.say(code::PLAN_AIR, s.origin, &[&what, why]);
        }
    }

    /// The height for rapids: the security plane, unless the part reaches above it.
    fn height(&mut self, s: &Workingstep) {
        let written = s.security.point[2];
        let mut height = written;
        if let Some(top) = s.stock_top.filter(|t| *t > written + 1e-9) {
            height = top + ABOVE_STOCK;
            let (a, b) = (format!("the security plane at Z{written}"), format!("Z{height}"));
            self.e.say(code::PLAN_APPROACH_CHANGED, s.origin, &[&a, &b, &format!("the raw part reaches up to Z{top}")]);
        }
        if self.security > height {
            // Leave from where the step before was safe.
            let before = self.security;
            self.e.lift(before);
        }
        self.security = height;
    }

    fn cut(&mut self, s: &Workingstep) {
        let o = &s.operation;
        let security = self.security;
        let lathe = o.tool.diameter == 0.0;
        let technology = if lathe { "TURNING_TECHNOLOGY" } else { "MILLING_TECHNOLOGY" };
        let moving = |t: &Toolpath| !t.rapid && matches!(t.path, PathKind::Location { .. } | PathKind::Axes(_));
        let fed = |t: &Toolpath| t.technology.unwrap_or(o.technology).feed.is_some();
        // What is given and no good has had its message.
        let [feed, cut, _, tooth] = o.technology.written;
        if o.technology.feed.is_none() && feed.or(tooth).is_none_or(|f| f > 0.0) && (o.toolpaths.is_empty() || o.toolpaths.iter().any(|t| moving(t) && !fed(t))) {
            let why = "the feed follows from a feed, or from a feed per tooth with a spindle speed";
            self.e.say(code::PLAN_MISSING_VALUE, o.technology.origin, &[technology, "feedrate", why]);
        }
        if cut.is_none_or(|c| c > 0.0) && o.technology.surface.is_none() && o.technology.speed.is_none_or(|s| s == 0.0 && o.toolpaths.is_empty()) {
            self.e.say(code::PLAN_MISSING_VALUE, o.technology.origin, &[technology, if lathe { "spindle_speed" } else { "spindle" }, "nothing is cut with a spindle that stands"]);
        }
        if o.technology.contact_feed && o.toolpaths.is_empty() {
            self.e.say(code::PLAN_NO_EFFECT, o.technology.origin, &["feedrate_reference .CCP.", "the operation", "the feed is that of the tool centre"]);
        }
        if o.technology.synchronised && !matches!(o.keyword.as_str(), "TAPPING") {
            self.e.say(code::PLAN_NO_EFFECT, o.technology.origin, &["synchronize_spindle_with_feed", "the operation", "only a tap goes in step with the spindle"]);
        }
        if !o.toolpaths.is_empty() {
            for frame in &s.feature.copies {
                explicit::follow(&mut self.e, &o.toolpaths, frame, Some((&o.technology, o.functions)), security, true);
            }
            return;
        }
        match &o.kind {
            OperationKind::Drill(d) => {
                for f in targets(s, &self.drilled) {
                    drill::drill(&mut self.e, s, d, f, security);
                }
            }
            OperationKind::Mill(m) => {
                let given = mill::Given { security, tolerance: self.tolerance, tells: self.tells.contains(&s.origin.id), overlap: self.overlap, axial_depth: self.axial_depth };
                for f in targets(s, &self.drilled) {
                    mill::mill(&mut self.e, s, m, f, &given);
                    self.e.cut.insert(f.origin.id);
                }
            }
            OperationKind::Other => self.e.say(code::PLAN_NOT_LOWERED, o.origin, &[&o.keyword, " without an explicit tool path"]),
        }
    }

    fn rapid(&mut self, r: &Rapid) {
        self.e.from(r.origin);
        let security = self.security.max(r.security.point[2]);
        self.e.lift(security);
        let frame = crate::frame::Frame::default();
        if r.toolpaths.is_empty() {
            // Home is the machine's; the program ends its way at the security plane.
            self.e.note("return home");
            let why = "where home is only the machine knows";
            self.e.say(code::PLAN_APPROACH_CHANGED, r.origin, &["the way home", "one up to the security plane", why]);
        }
        explicit::follow(&mut self.e, &r.toolpaths, &frame, None, security, true);
        self.security = security;
    }

    /// The pallet change that the plan has come to. At its end it stands right before the end of the program, as M30 has it.
    fn change_pallet(&mut self) {
        if let Some(source) = self.pallet.take() {
            self.e.b.push(Op::Stop(Stop::Pallet), source);
        }
    }

    fn function(&mut self, f: &Function) {
        self.e.from(f.origin);
        let security = self.security;
        match &f.kind {
            FunctionKind::Message(text) => self.e.push(Op::Note(Note::Message, text)),
            FunctionKind::OptionalStop => self.e.push(Op::Stop(Stop::Optional)),
            FunctionKind::ProgramStop => self.e.push(Op::Stop(Stop::Program)),
            FunctionKind::ExchangePallet => {
                self.e.lift(security);
                self.e.stop_spindle();
                self.pallet = Some(self.e.source);
                self.e.at = None;
            }
            FunctionKind::LoadTool(t) => self.e.tool(t, security),
            FunctionKind::UnloadTool => self.e.unload(security),
        }
    }

    fn probe(&mut self, p: &Probe) {
        self.e.from(p.origin);
        let security = self.security.max(p.security.point[2]);
        let axis = [0.0, 0.0, 1.0];
        match &p.tool {
            Some(t) => self.e.tool(t, security),
            None => self.e.say(code::PLAN_MISSING_VALUE, p.origin, &["WORKPIECE_PROBING", "its_probe", "the program would probe with whatever is in the spindle"]),
        }
        let measured = format!("it gives no feed: the probe goes at 60 mm/min; what it measures ('{}') changes no motion of this plan", p.variable);
        self.e.say(code::PLAN_TAKES_TURNS, p.origin, &["WORKPIECE_PROBING", &measured]);
        self.e.stop_spindle();
        self.e.travel(p.start, axis, security);
        let far = p.distance.abs() * 2.0;
        let to = std::array::from_fn(|i| p.start[i] + p.direction[i] * far);
        let pose = self.e.pose(to);
        self.e.feed(1.0);
        let source = self.e.source;
        self.e.b.push_to(Op::Probe(0), &pose, source);
        // What follows names its places; a condition on what was measured is refused when the plan is read.
        self.e.at = Some(to);
        self.e.rapid(p.start);
        self.e.lift(security);
        self.security = security;
    }
}

/// A drill this much narrower than its hole still makes it as wide as it is, mm.
const DRILL_SLACK: f64 = 0.05;

/// Elements of compound features that a drill makes as wide as they are.
fn drilled(process: &Process) -> BTreeSet<u64> {
    let wide = |s: &Workingstep, f: &Feature| matches!(f.shape, Shape::Hole { diameter, .. } if (diameter - s.operation.tool.diameter).abs() <= DRILL_SLACK);
    let drills = |s: &&Workingstep| matches!(s.operation.kind, OperationKind::Drill(_)) && !matches!(s.operation.keyword.as_str(), "CENTER_DRILLING" | "COUNTER_SINKING");
    let steps = process.steps();
    let none = BTreeSet::new();
    steps.iter().copied().filter(drills).flat_map(|s| targets(s, &none).into_iter().filter(|f| wide(s, f)).map(|f| f.origin.id).collect::<Vec<_>>()).collect()
}

/// The features an operation works on: elements of a compound feature, or the feature itself. `drilled`: elements that
/// need no mill.
fn targets<'a>(s: &'a Workingstep, drilled: &BTreeSet<u64>) -> Vec<&'a Feature> {
    let Shape::Compound(all) = &s.feature.shape else { return vec![&s.feature] };
    let OperationKind::Drill(_) = s.operation.kind else {
        // A mill belongs to the elements it fits into, and of those to the ones that no drill makes.
        let narrow = |f: &&Feature| matches!(f.shape, Shape::Hole { diameter, .. } if diameter < s.operation.tool.diameter - 1e-6);
        let fits: Vec<&Feature> = all.iter().filter(|f| !narrow(f)).collect();
        let milled: Vec<&Feature> = fits.iter().copied().filter(|f| !drilled.contains(&f.origin.id)).collect();
        return [milled, fits].into_iter().find(|l| !l.is_empty()).unwrap_or_else(|| all.iter().collect());
    };
    if s.operation.keyword == "COUNTER_SINKING" {
        // It makes the cone, or what is widest.
        let opens = |f: &&Feature| match f.shape {
            Shape::Hole { diameter, final_diameter, .. } => (final_diameter.is_some(), diameter),
            _ => (false, 0.0),
        };
        return all.iter().max_by(|a, b| opens(a).0.cmp(&opens(b).0).then(opens(a).1.total_cmp(&opens(b).1))).into_iter().collect();
    }
    // A drill belongs to the hole it fits best.
    let width = |f: &&Feature| match f.shape {
        Shape::Hole { diameter, .. } if diameter >= s.operation.tool.diameter - DRILL_SLACK => diameter,
        _ => f64::INFINITY,
    };
    let best = all.iter().min_by(|a, b| width(a).total_cmp(&width(b)));
    best.into_iter().collect()
}
