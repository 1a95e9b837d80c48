//! What a written program does on a machine that is otherwise than the simulation took it: it stands elsewhere when the
//! program begins, has other work offsets in store, another one in force, other reference points, other lengths and
//! diameters of tools, another return of canned cycles. What no file says, nobody knows; source and translation are run on
//! such a machine, and must go the same way. It is a look from outside: it shares nothing with the writer but the interpreter.

use gr_backends::Sources;
use gr_backends::from_line::{self, Restart};
use gr_backends::sources::Words;
use gr_interp::{ASSUMED, Setup};
use gr_ir::diff::{Aspect, Diff, Difference, Tolerance, diff};
use gr_ir::{Builder, FileId, Marker, Op, Program, Source, plane_axes};
use gr_machine::math::Frame;
use gr_machine::{Kind, Machine};
use gr_robot::Coordinates;
use gr_spec::{Dialect, Family};
use gr_text::{Diagnostic, code};

use crate::pipeline::{Begun, Motion, Unit, motion_of, motion_with};

/// Where the translation goes another way: read back as it is, or on such a machine. `begins`: from which of its lines on, from 0, it
/// is that of the source.
pub fn differs(unit: &Unit, source: &Motion, (written, begins): (&str, Option<u32>), to: &'static Dialect, length: f64) -> Option<Diagnostic> {
    // Times follow from the ways; the numbers of tools are told elsewhere.
    let tolerance = Tolerance { rate: 1e-3, limit: 50, ..Tolerance::within(length) };
    let mut there = Setup { dialect: to, ..unit.setup.clone() };
    if to.family != unit.setup.dialect.family {
        // Another control does not run that startup code.
        there.ini = gr_interp::Ini::default();
    }
    let told = |difference: &Difference, code, args: &[String]| {
        let place = difference.a.map_or(Source::default(), |(_, s)| s);
        let (file, span) = gr_backends::Sources::place(&crate::emit::texts(source), place);
        Some(Diagnostic::new(code, file, span, args))
    };
    starts_as(unit, &source.program, &mut there);
    let again = |setup: &Setup| motion_of("<translation>", written.to_string(), setup).program;
    let differs_elsewhere = || {
        // Of a program that begins later, the way to its first block is its own.
        let aspects: &[Aspect] = if source.begun.is_some() { &[Aspect::Path, Aspect::Feed] } else { &[Aspect::Path, Aspect::Feed, Aspect::Event, Aspect::Control] };
        let other = |change: Change<'_>| {
            let program = again(&change(&there));
            let begins = begins.and_then(|line| program.steps().find(|s| s.source.line >= line).map(|s| s.index));
            begins.map(|i| from(&program, i)).unwrap_or(program)
        };
        let (first, why) = first(unit, source, &tolerance, aspects, other)?;
        told(&first, code::EMIT_ELSEWHERE, &[why.machine().into(), why.remedy().into()])
    };
    if source.begun.is_some() {
        return differs_elsewhere();
    }
    let read = again(&there);
    let mut same = diff(&source.program, &read, &tolerance).differences;
    if same.iter().any(|d| d.aspect == Aspect::Feed) {
        // Rounding to few decimals changes the feeds of short moves; a feed of another kind, or of another size, is none.
        let loose = Tolerance { rate: 0.5, ..tolerance };
        same.retain(|d| d.aspect != Aspect::Feed);
        same.extend(diff(&source.program, &read, &loose).differences.into_iter().filter(|d| d.aspect == Aspect::Feed));
    }
    // How the path is followed, each control has its own words for, and what it lacks has been told.
    let none: &[Aspect] = if to.id == "grbl" { &[Aspect::Control, Aspect::Tool, Aspect::Event] } else { &[Aspect::Control] };
    let counts = |d: &&Difference| {
        // A sum of times has no place: it follows from the ways, which rounding moves.
        let placed = d.a.or(d.b).is_some();
        // A Fanuc program has no other end than M30, which changes the pallet; a source that just stops has none.
        let ended = d.a.is_none() && to.family == Family::Fanuc;
        !none.contains(&d.aspect) && placed && !ended
    };
    let worst = same.iter().find(|d| d.aspect == Aspect::Path).or_else(|| same.iter().find(counts));
    if let Some(difference) = worst {
        return told(difference, code::EMIT_NOT_EQUAL, std::slice::from_ref(&difference.message));
    }
    differs_elsewhere()
}

/// Two programs that go the same way in the simulation, compared on such a machine.
pub fn compared(same: Diff, a: (&Unit, &Motion), b: &Unit, tolerance: &Tolerance) -> Diff {
    if [a.0, b].iter().any(|u| u.setup.dialect.family == Family::Ufmg2008) {
        return same;
    }
    let found = first(a.0, a.1, tolerance, &[Aspect::Path, Aspect::Feed], |change| lowered(b, &change(&b.setup)));
    let Some((mut first, why)) = found else { return same };
    first.message = format!("the ways part here on a machine {}: {}", why.machine(), why.remedy().replace('`', ""));
    let mut out = same;
    out.differences.push(first);
    out.count += 1;
    out
}

fn lowered(unit: &Unit, setup: &Setup) -> Program {
    motion_with(unit, setup).program
}

/// The same of a program that begins later; none where it doesn't get there on such a machine.
fn begun(unit: &Unit, setup: &Setup, begun: Option<Begun>) -> Option<Program> {
    let motion = motion_with(unit, setup);
    let Some(Begun { line, unsure, room }) = begun else { return Some(motion.program) };
    let options = from_line::Options { unsure, stored: !unit.setup.params.is_empty(), room: Some(room), ..from_line::Options::default() };
    let restart = from_line::from_line(&motion.program, FileId(0), line, &options, &crate::emit::texts(&motion)).ok()?.program;
    let way = restart.steps().filter(|s| s.source.line == from_line::INSERTED).last()?.index;
    Some(from(&restart, way + 1))
}

/// A program from one of its operations on.
fn from(program: &Program, index: usize) -> Program {
    let mut rest = program.cursor_at(index);
    let mut out = Builder::from_state(*rest.pose(), *rest.state());
    out.names_of(program);
    while let Some(view) = rest.next() {
        out.push_to(view.op, view.end, view.source);
    }
    out.finish()
}

/// Where the machine stands before a program, as a setup has it.
fn start_of(program: &Program, setup: &Setup) -> [f64; 9] {
    let length = if setup.machine_units == gr_canon::Units::Inch { 25.4 } else { 1.0 };
    let mut at = program.start_state().machine(&program.start().axes);
    for (i, v) in at.iter_mut().enumerate() {
        *v = if (3..6).contains(&i) { v.to_degrees() } else { *v / length };
    }
    at
}

/// A translation of an arm's program begins where the arm stands: its file says that.
pub fn starts_as(source: &Unit, program: &Program, setup: &mut Setup) {
    if source_is_of_an_arm(source) {
        setup.start = start_of(program, setup);
    }
}

/// A program in Cartesian coordinates of an arm: where that stands before it is no matter of the machine that runs it.
fn source_is_of_an_arm(unit: &Unit) -> bool {
    unit.setup.dialect.family == Family::Ufmg2008
}

/// Axes that move, but not in the first move.
fn moved_late(program: &Program) -> [bool; 9] {
    let moves = || program.steps().filter(|s| s.op.moves());
    let changes = |s: &gr_ir::Step<'_>, i: usize| s.start.axes[i] != s.end.axes[i];
    std::array::from_fn(|i| moves().next().is_some_and(|first| !changes(&first, i)) && moves().any(|s| changes(&s, i)))
}

/// Axes whose place a restart knows only because the simulation takes something for given that no file says.
pub struct Doubt {
    /// These.
    pub axes: [bool; 9],
    /// A machine that has them elsewhere, and what makes it known.
    machine: &'static str,
    remedy: &'static str,
}

impl Doubt {
    /// For the message: the axes, the machine, and what makes it known.
    pub fn told(&self) -> [String; 3] {
        let axes: Vec<String> = "XYZABCUVW".chars().zip(self.axes).filter(|(_, of)| *of).map(|(letter, _)| letter.to_string()).collect();
        [axes.join(" "), self.machine.into(), self.remedy.into()]
    }
}

/// Runs a program that begins later on such machines too: `here`, and how `restart` begins it there.
/// `placed`: the part is where a machine file says, whatever is in store.
pub fn doubt(unit: &Unit, motion: &Motion, here: &Restart, placed: bool, restart: impl Fn(&Motion) -> Option<Restart>) -> Option<Doubt> {
    if motion.plan.is_some() || unit.setup.dialect.family == Family::Ufmg2008 {
        return None;
    }
    let mut doubt: Option<Doubt> = None;
    for machine in &machines(motion) {
        // Both returns of a cycle are clear of the part.
        let counts = |u: &Unknown| *u != Unknown::Return && (u.is(&unit.setup, motion) || placed && *u == Unknown::Stored);
        for unknown in Unknown::ALL.into_iter().filter(counts) {
            let mut setup = unit.setup.clone();
            unknown.change(&mut setup, machine);
            // A program that ends before on such a machine is not for it.
            let Some(there) = restart(&motion_with(unit, &setup)) else { continue };
            let other = |a: f64, b: f64| (a - b).abs() > NEAR_ENOUGH;
            let apart = |a: Option<f64>, b: Option<f64>| a.zip(b).is_some_and(|(a, b)| other(a, b));
            // Where G92 is in force already, it counts from there: that is told of what is written.
            let fresh = machine.local == 0.0;
            let kept = |i: usize| here.kept.iter().any(|(n, h)| there.kept.get(n).is_some_and(|t| apart(h[i], t[i])));
            let away = |i: usize| {
                let elsewhere = match here.goal[i] {
                    Some(goal) => there.goal[i].is_none_or(|t| other(t, goal)),
                    // It stays where it is, and a step (G91) from there is one from another place.
                    None => apart(here.named[i], there.named[i]),
                };
                let set = || here.offsets.iter().any(|(n, h)| there.offsets.get(n).is_none_or(|t| other(h[i], t[i])));
                let probed = unknown == Unknown::Probe && set();
                elsewhere || probed || fresh && (apart(here.shifted[i], there.shifted[i]) || placed && kept(i))
            };
            if (0..9).any(away) {
                let remedy = if unknown == Unknown::Probe { "start at the line of the probe, or before it" } else { unknown.remedy() };
                let first = Doubt { axes: [false; 9], machine: unknown.machine(), remedy };
                let doubt = doubt.get_or_insert(first);
                (0..9).for_each(|i| doubt.axes[i] |= away(i));
            }
        }
    }
    doubt
}

/// Where a coordinate that a program names depends on where the machine stands or on its work offsets, by `#5422` and the like: on the
/// machine of a machine file both are others than in the program's run.
pub fn rests(unit: &Unit, motion: &Motion, machine: &Machine) -> Option<Diagnostic> {
    let asks = |text: &str| text.lines().any(|l| l.contains('#') && l.contains(['5', '<', '[']));
    if motion.plan.is_some() || !motion.sources.iter().any(|(_, f)| asks(&f.text)) || stands_as_run(machine) {
        return None;
    }
    let mut setup = unit.setup.clone();
    Unknown::Start.change(&mut setup, &BELOW);
    let unit_of_length = if setup.machine_units == gr_canon::Units::Inch { 1.0 / 25.4 } else { 1.0 };
    for base in [5161u32, 5181].into_iter().chain((1..=9).map(|n| 5201 + 20 * n)) {
        (0..9u32).for_each(|axis| *setup.params.entry(base + axis).or_default() += unit_of_length * (BELOW.origin + f64::from(axis)));
    }
    let texts = crate::emit::texts(motion);
    let (here, there) = (named(&motion.program, &texts), named(&motion_with(unit, &setup).program, &texts));
    let line = |n: &(Source, [Option<f64>; 3])| (n.0.file, n.0.line);
    let other = |a: &(Source, [Option<f64>; 3]), b: &(Source, [Option<f64>; 3])| {
        let apart = |i: usize| a.1[i].zip(b.1[i]).is_some_and(|(a, b)| (a - b).abs() > NEAR_ENOUGH);
        line(a) != line(b) || (0..3).any(apart)
    };
    let differs = here.iter().zip(&there).find(|(a, b)| other(a, b)).map(|(a, _)| a);
    // One of them may end earlier.
    let (source, _) = differs.or_else(|| here.get(there.len())).or_else(|| here.last().filter(|_| there.len() > here.len()))?;
    let (file, span) = gr_backends::Sources::place(&texts, *source);
    Some(Diagnostic::new(code::MACHINE_ASKED_PLACE, file, span, &[]))
}

/// A mill that begins at its zero point, with the part there too.
fn stands_as_run(machine: &Machine) -> bool {
    let home = machine.cell.home.iter().chain(&machine.start_joints).flatten().all(|v| *v == 0.0);
    machine.kind == Kind::Mill && home && (1..=9).all(|n| gr_robot::words::placed_by(machine, n) == Frame::IDENTITY)
}

/// Where words of the work frame bring X, Y and Z, line by line as they are run, mm.
fn named(program: &Program, texts: &dyn Sources) -> Vec<(Source, [Option<f64>; 3])> {
    let mut said = Coordinates::new(program);
    let mut out: Vec<(Source, [Option<f64>; 3])> = Vec::new();
    let mut cursor = program.cursor();
    let mut cycle = None;
    while let Some(view) = cursor.next() {
        match view.op {
            Op::Begin { marker: Marker::Cycle, .. } => cycle = Some(plane_axes(view.state.plane).2),
            Op::Close(Marker::Cycle) => cycle = None,
            _ => {}
        }
        said.step(program, &view, texts);
        let Some(words) = Words::at(texts, view.source.file, view.source.line).filter(|_| view.op.moves()) else { continue };
        let b = said.brought();
        let ends = std::array::from_fn(|i| (b.work[i] && words.has(b"xyz"[i]) && cycle != Some(i)).then_some(view.end.axes[i]));
        // Of several moves of a line the last one goes where it says.
        match out.last_mut().filter(|(s, _)| *s == view.source) {
            Some((_, last)) => *last = ends,
            None => out.push((view.source, ends)),
        }
    }
    out
}

/// Places that differ by less, mm or rad, are the same.
const NEAR_ENOUGH: f64 = 1e-6;

/// Makes of a machine another one.
type Change<'a> = &'a dyn Fn(&Setup) -> Setup;

/// The first difference in one of these aspects, the first of them before the others, and what makes it. `other`: what the
/// other program does there.
fn first(
    unit: &Unit,
    motion: &Motion,
    tolerance: &Tolerance,
    aspects: &[Aspect],
    other: impl Fn(Change<'_>) -> Program,
) -> Option<(Difference, Unknown)> {
    let told = motion.found.iter().any(|d| d.code == code::RUN_VALUE_UNKNOWN);
    // An arm has no offsets in store and no tools.
    let counts = |u: &Unknown| (*u != Unknown::Probe || !told) && (*u == Unknown::Start || !source_is_of_an_arm(unit)) && u.is(&unit.setup, motion);
    let unknown: Vec<Unknown> = Unknown::ALL.into_iter().filter(counts).collect();
    let look = |which: &[Unknown], machine: &Numbers| {
        let change = |setup: &Setup| {
            let mut setup = setup.clone();
            which.iter().for_each(|u| u.change(&mut setup, machine));
            setup
        };
        let a = begun(unit, &change(&unit.setup), motion.begun)?;
        let from = motion.begun.map(|_| start_of(&a, &unit.setup));
        let late = moved_late(&a);
        let change = |setup: &Setup| {
            let arm = source_is_of_an_arm(unit).then_some(setup.start);
            let mut setup = change(setup);
            // What an arm's program never moves, or brings to a place at once, is where its start doesn't count.
            let start = arm.map(|arm| std::array::from_fn(|i| if late[i] { setup.start[i] } else { arm[i] }));
            setup.start = from.or(start).unwrap_or(setup.start);
            setup
        };
        let found = diff(&a, &other(&change), tolerance).differences;
        aspects.iter().find_map(|a| found.iter().find(|d| d.aspect == *a).cloned())
    };
    for machine in &machines(motion) {
        // What differs on every machine is told elsewhere.
        let new = |d: &Difference| d.aspect == Aspect::Path && motion.begun.is_none() || look(&[], machine).is_none();
        let Some(all) = look(&unknown, machine).filter(new) else { continue };
        let alone = unknown.iter().find_map(|u| look(&[*u], machine).filter(new).map(|d| (d, *u)));
        return Some(alone.unwrap_or((all, unknown[0])));
    }
    None
}

/// What no file says.
#[derive(Clone, Copy, PartialEq)]
enum Unknown {
    /// Work offsets, the one in force, G92, reference points.
    Stored,
    /// Lengths and diameters.
    Tools,
    /// Where the machine stands.
    Start,
    /// G98 or G99.
    Return,
    /// Where a probe stops. What a program reads of it is told where it stands.
    Probe,
}

impl Unknown {
    const ALL: [Unknown; 5] = [Unknown::Stored, Unknown::Tools, Unknown::Start, Unknown::Return, Unknown::Probe];

    fn is(self, setup: &Setup, motion: &Motion) -> bool {
        match self {
            Unknown::Stored => setup.params.is_empty(),
            Unknown::Tools => setup.tools.rows.iter().skip(1).any(|t| &*t.comment == ASSUMED),
            Unknown::Start => true,
            Unknown::Return => {
                let cycle = |op| matches!(op, Op::Begin { marker: Marker::Cycle, .. });
                setup.ini.values.is_empty()
                    && setup.dialect.family == Family::Linuxcnc
                    && motion.program.steps().any(|s| cycle(s.op))
            }
            Unknown::Probe => motion.program.steps().any(|s| matches!(s.op, Op::Probe(_))),
        }
    }

    /// Such a machine.
    fn machine(self) -> &'static str {
        match self {
            Unknown::Stored => "with other values in store",
            Unknown::Tools => "with tools of other lengths and diameters",
            Unknown::Start => "that stands elsewhere when the program begins",
            Unknown::Probe => "whose probe stops elsewhere",
            Unknown::Return => "whose startup code selects the other return of canned cycles",
        }
    }

    /// What makes it known.
    fn remedy(self) -> &'static str {
        match self {
            Unknown::Stored => "name its parameter file with `--vars`, or its INI file with `--ini`",
            Unknown::Tools => "name its tool table with `--tools`, or its INI file with `--ini`",
            Unknown::Start => "name the axes by G90 coordinates before anything depends on where they stand",
            Unknown::Probe => "name the axis behind the probe, by a G90 coordinate, G92 or G10 L20",
            Unknown::Return => "write G98 or G99 before the cycle, or name the INI file of the machine with `--ini`",
        }
    }

    fn change(self, setup: &mut Setup, n: &Numbers) {
        let unit = if setup.machine_units == gr_canon::Units::Inch { 1.0 / 25.4 } else { 1.0 };
        match self {
            Unknown::Stored => {
                // No origin is where another is.
                setup.params.insert(5220, n.system);
                for (k, base) in [5161u32, 5181, 5211].into_iter().chain((1..=9).map(|n| 5201 + 20 * n)).enumerate() {
                    for axis in 0..9u32 {
                        setup.params.insert(base + axis, unit * (n.origin + n.step * k as f64 + 0.75 * f64::from(axis)));
                    }
                }
                for system in 0..9u32 {
                    setup.params.insert(5230 + 20 * system, n.rotation * f64::from(1 + system));
                }
                setup.params.insert(5210, n.local);
                // Numbers of the user's own, which a parameter file may keep.
                let own = if setup.dialect.family == Family::Fanuc { 500..1000 } else { 31..5001 };
                setup.params.extend(own.filter(|_| n.own != 0.0).map(|k| (k, n.own)));
            }
            Unknown::Tools => {
                for tool in setup.tools.rows.iter_mut().skip(1).filter(|t| &*t.comment == ASSUMED) {
                    let number = f64::from(tool.number % 100);
                    tool.offset[2] = unit * (n.length + 0.25 * number);
                    tool.diameter = unit * (0.02 + 0.001 * number);
                }
            }
            Unknown::Probe => setup.probe_short = 1.625,
            Unknown::Start => setup.start = std::array::from_fn(|i| unit * n.start * (1.0 + 0.125 * i as f64)),
            Unknown::Return => {
                setup.ini.values.insert(("rs274ngc".into(), "rs274ngc_startup_code".into()), vec!["G98".into()]);
            }
        }
    }
}

/// Numbers of a machine, mm, none of which can be mistaken for zero or for another.
struct Numbers {
    /// The work offset in force.
    system: f64,
    origin: f64,
    step: f64,
    /// By what work offsets are turned, degrees, each by as much again.
    rotation: f64,
    /// Whether G92 is in force.
    local: f64,
    /// Of a user's own number; 0 where the program reads none.
    own: f64,
    length: f64,
    start: f64,
}

const NEAR: Numbers = Numbers { system: 2.0, origin: 1.5, step: 2.25, rotation: 0.0, local: 0.0, own: 0.5, length: 3.5, start: 0.625 };
const BELOW: Numbers = Numbers { system: 1.0, origin: -411.5, step: 12.25, rotation: 7.5, local: 1.0, own: 3.0, length: 93.5, start: -41.375 };
const ABOVE: Numbers = Numbers { system: 9.0, origin: 211.5, step: 31.25, rotation: 0.0, local: 1.0, own: -2.25, length: 193.5, start: 141.375 };

/// Origins above and below the machine's zero tell whether heights depend on them; where the program asks what its values
/// are, it may take another branch on others.
fn machines(motion: &Motion) -> Vec<Numbers> {
    let any = |asks: fn(&str) -> bool| motion.sources.iter().any(|(_, f)| f.text.lines().any(asks));
    if any(|l| l.contains('#') && l.contains(['5', '<'])) {
        vec![NEAR, BELOW, ABOVE]
    } else if any(|l| l.contains('#')) {
        vec![NEAR, BELOW]
    } else {
        [NEAR, BELOW].map(|n| Numbers { own: 0.0, ..n }).into()
    }
}
