use std::hash::{Hash, Hasher};

use bytemuck::{Pod, Zeroable};
use gr_canon::{Axes, Plane, Units};
use gr_spec::Family;

use crate::queue::Queue;
use crate::world::World;
use crate::{Setup, Tools};

/// Number of spindles a machine may have.
pub const SPINDLES: usize = 8;

/// Which side of the contour the tool is on.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[expect(missing_docs, reason = "plain words")]
#[repr(u8)]
pub enum Side {
    Off = 0,
    Right = 1,
    Left = 2,
}

/// Everything a plain block can change, as plain data: comparing and hashing it is comparing its bytes
/// (`-0.0` is normalised away before a state becomes a key). Lengths in program units.
#[derive(Clone, Copy, Pod, Zeroable, Debug)]
#[repr(C)]
pub struct Modal {
    /// Current point in the active work frame; X and Y are the *tool centre's* while cutter compensation is on.
    pub current: Axes,
    /// The programmed X, Y, Z while cutter compensation is on.
    pub program: [f64; 3],
    /// Active G5x offset.
    pub origin: Axes,
    /// Active G92 offset.
    pub g92: Axes,
    /// The part of it that a Fanuc control counts as G52.
    pub g52: Axes,
    /// Active tool length offset.
    pub tool_offset: Axes,
    /// Rotation of the work frame, degrees.
    pub rotation: f64,
    /// Feed in units per minute, per revolution, or 1/min.
    pub feed: f64,
    /// Rapid speed as the controller reports it.
    pub traverse: f64,
    /// Spindle speeds.
    pub speed: [f64; SPINDLES],
    /// G64 P.
    pub tolerance: f64,
    /// G64 Q.
    pub naivecam: f64,
    /// Cutter compensation radius.
    pub comp_radius: f64,
    /// Canned cycle memory: normal axis bottom, I J K P Q R, old level.
    pub cycle_cc: f64,
    #[expect(missing_docs, reason = "named after the word")]
    pub cycle_i: f64,
    #[expect(missing_docs, reason = "named after the word")]
    pub cycle_j: f64,
    #[expect(missing_docs, reason = "named after the word")]
    pub cycle_k: f64,
    #[expect(missing_docs, reason = "named after the word")]
    pub cycle_p: f64,
    #[expect(missing_docs, reason = "named after the word")]
    pub cycle_q: f64,
    #[expect(missing_docs, reason = "named after the word")]
    pub cycle_r: f64,
    /// Level to come back to (G98).
    pub cycle_il: f64,
    /// Where the last G5 ended: a G5 without I and J continues it only from there. (What it continues with is in
    /// `cycle_i` and `cycle_j`, which G87 shares, as in the controller.)
    pub spline_tail: [f64; 2],
    /// Fanuc, G68: centre of the rotation in the plane, angle in degrees.
    pub turn: [f64; 3],
    /// Fanuc lathe: highest spindle speed of G50 S, 0 = none.
    pub spindle_clamp: f64,
    /// Fanuc: motion code that G80 goes back to.
    pub before_cycle: i32,
    /// Tool whose length is in force, 0 = none or of no one tool.
    pub length_of: i32,
    /// Tool that was in the spindle when that length was put in force, 0 = none.
    pub length_set_with: i32,
    /// Fanuc mill: numbers of the length offset (H) and the radius offset (D) that were named last, −1 = none yet.
    pub length_number: i32,
    #[expect(missing_docs, reason = "see length_number")]
    pub radius_number: i32,
    /// Canned cycle repeats.
    pub cycle_l: i32,
    /// Tool orientation 0 … 9 for lathe compensation.
    pub comp_orientation: i32,
    /// Active motion code times ten, −1 = none (G80 = 800).
    pub motion: i32,
    /// Pocket (index) of the tool in the spindle.
    pub pocket: i32,
    /// Tool number selected by T, and its pocket index; −1 = none.
    pub selected_tool: i32,
    #[expect(missing_docs, reason = "see selected_tool")]
    pub selected_pocket: i32,
    /// 1 = G54 … 9 = G59.3.
    pub origin_index: i32,
    /// Spindle that feed per revolution and surface speed follow.
    pub active_spindle: i32,
    /// N number of the current block, −1 = none.
    pub n_number: i32,
    /// 0 stopped, 1 clockwise, 2 counter-clockwise.
    pub turning: [u8; SPINDLES],
    /// 0 rpm, 1 surface speed.
    pub css: [u8; SPINDLES],
    /// Speed override on.
    pub speed_override: [u8; SPINDLES],
    /// [`Units`] as u8.
    pub units: u8,
    /// [`Plane`] as u8.
    pub plane: u8,
    /// 1 = G91.
    pub incremental: u8,
    /// 1 = G90.1 (I J K absolute).
    pub ijk_absolute: u8,
    /// 0 = G94, 1 = G93, 2 = G95.
    pub feed_mode: u8,
    /// 0 = G98, 1 = G99.
    pub retract_r: u8,
    /// 0 = G61, 1 = G61.1, 2 = G64.
    pub path_mode: u8,
    /// [`Side`] as u8.
    pub comp_side: u8,
    /// The next compensated move is the first.
    pub comp_first: u8,
    /// Straight motion must follow (compensation was just switched off).
    pub arc_not_allowed: u8,
    /// `cycle_il` is valid.
    pub cycle_il_set: u8,
    /// G7.
    pub lathe_diameter: u8,
    /// Feed override on.
    pub feed_override: u8,
    /// Adaptive feed on.
    pub adaptive_feed: u8,
    /// Feed hold on.
    pub feed_hold: u8,
    /// M7.
    pub mist: u8,
    /// M8.
    pub flood: u8,
    /// G92 offsets are applied.
    pub g92_applied: u8,
    /// Program began with `%`.
    pub percent: u8,
    /// A probe move was made and its result is not read yet.
    pub probed: u8,
    /// Set by M6/M61 for #5400.
    pub tool_changed: u8,
    /// M66 ran and its result is not read yet: 1 = digital, 2 = analog.
    pub input_wanted: u8,
    /// Parameters that hold a stand-in for what only the machine knows: bit 0 an input, bit 1 a probe.
    pub stand_ins: u8,
    /// Fanuc: G68 is on.
    pub turned: u8,
    /// Axes X Y Z A B C, by bits, that stand where a probe stopped: no word has sent them to a place since.
    pub loose: u8,
    /// Axes X Y Z, by bits, that a block sent to a place of the machine (G28, G30, G53), and no word to one of the work frame
    /// since. How high that is there, only the machine knows.
    pub parked: u8,
    /// G43 is in force (or what LinuxCNC has beside it).
    pub length_on: u8,
    /// Fanuc lathe: the program has positioned the C axis.
    pub c_axis: u8,
    /// Always 0; keeps the size a multiple of eight.
    pub pad: [u8; 4],
}

impl Modal {
    /// Program units.
    pub fn units(&self) -> Units {
        if self.units == Units::Inch as u8 { Units::Inch } else { Units::Mm }
    }
    /// Working plane.
    pub fn plane(&self) -> Plane {
        [Plane::Xy, Plane::Yz, Plane::Xz, Plane::Uv, Plane::Vw, Plane::Uw][self.plane.clamp(1, 6) as usize - 1]
    }
    /// Compensation side.
    pub fn side(&self) -> Side {
        [Side::Off, Side::Right, Side::Left][self.comp_side.min(2) as usize]
    }
    /// The bytes that make two states the same state.
    pub fn bytes(&self) -> &[u8] {
        bytemuck::bytes_of(self)
    }
}

/// What M70 and M73 keep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SavedModes {
    /// Active G-codes, as the controller reports them.
    pub g: [i32; 17],
    /// Active M-codes.
    pub m: [i32; 9],
    /// Line, feed, speed, G64 P, G64 Q.
    pub settings: [f64; 5],
}

/// The whole state between two blocks, parameters excepted.
#[derive(Clone, Debug)]
pub struct State {
    /// Plain part.
    pub modal: Modal,
    /// Calls that cutter compensation holds back.
    pub queue: Queue,
    /// What the machine would answer.
    pub world: World,
    /// Modes kept by M70 in the main program.
    pub saved: Option<Box<SavedModes>>,
    /// The tool table, once the program changed it or a tool was changed.
    pub tools: Option<Tools>,
    /// The machine's own table, likewise.
    pub world_tools: Option<Tools>,
}

impl State {
    /// Before the first block.
    pub fn start(setup: &Setup) -> State {
        let mut modal = Modal::zeroed();
        // A Fanuc control wakes up in G0 (or G1, as its parameters say); LinuxCNC in no motion at all.
        modal.motion = if setup.dialect.family == Family::Fanuc { 0 } else { 800 };
        modal.plane = Plane::Xy as u8;
        if crate::fanuc::is_lathe(setup.dialect) {
            (modal.plane, modal.lathe_diameter, modal.feed_mode) = (Plane::Xz as u8, 1, 2);
        }
        modal.units = Units::Mm as u8;
        modal.retract_r = 1;
        if setup.dialect.family == Family::Fanuc {
            modal.retract_r = 0; // G98
        }
        modal.path_mode = 2;
        modal.comp_first = 1;
        modal.feed_override = 1;
        modal.speed_override = [1; SPINDLES];
        modal.feed_hold = 1;
        modal.pocket = 1;
        modal.origin_index = 1;
        modal.n_number = -1;
        (modal.length_number, modal.radius_number) = (-1, -1);
        State { modal, queue: Queue::default(), world: World::new(), saved: None, tools: None, world_tools: None }
    }
    /// The bytes that make two states the same state (`-0.0` counts as `0.0`), tool tables and queue aside.
    pub fn key_bytes(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(1024);
        for part in [self.modal.bytes(), bytemuck::bytes_of(&self.world)] {
            for eight in part.chunks(8) {
                if eight == [0, 0, 0, 0, 0, 0, 0, 0x80] {
                    out.extend_from_slice(&[0; 8]);
                } else {
                    out.extend_from_slice(eight);
                }
            }
        }
        if let Some(saved) = &self.saved {
            out.push(1);
            out.extend(saved.g.iter().chain(&saved.m).flat_map(|v| v.to_le_bytes()));
            out.extend(saved.settings.iter().flat_map(|v| (v + 0.0).to_bits().to_le_bytes()));
        }
        out
    }
    /// The same tools.
    pub fn same_tools(&self, other: &State) -> bool {
        self.tools == other.tools && self.world_tools == other.world_tools
    }
}

impl PartialEq for State {
    fn eq(&self, other: &Self) -> bool {
        self.key_bytes() == other.key_bytes() && self.queue == other.queue && self.same_tools(other)
    }
}

impl Eq for State {}

impl Hash for State {
    fn hash<H: Hasher>(&self, h: &mut H) {
        self.key_bytes().hash(h);
        self.queue.hash(h);
    }
}
