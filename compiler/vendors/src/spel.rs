//! Epson SPEL+: one function. Arcs in space are `Arc3`. Joint moves go to angles.
//!
//! Facts: the *SPEL+ Language Reference*; not run on a controller.

use crate::name::{Names, Rule};
use crate::number::{num, single};
use crate::parts::Lines;
use crate::plain::{Plain, joints, one_file, per_cent, six};
use crate::walk::{Arms, Cx, Traits, World};
use crate::{Language, Options, Output, orient};
use gr_ir::Sources;
use gr_machine::math::Frame;
use gr_robot::{RobotProgram, Target};

pub(crate) struct Spel;

static TRAITS: Traits = Traits {
    title: "Epson SPEL+",
    arms: Arms::Any,
    world: World::Foot,
    external: false,
    arcs: true,
    trailing: true,
    unverified: "points written within moves, without flags of the arm",
};

/// Statements, functions and words of the language.
const RESERVED: &[&str] = &[
    "ABORTMOTION", "ABS", "ACCEL", "ACCELR", "ACCELS", "ACOS", "AGL", "AGLTOPLS", "AND", "AOPEN", "ARC", "ARC3", "ARCH", "ARM", "ARMCLR", "ARMDEF",
    "ARMSET", "ASC", "ASIN", "ATAN", "ATAN2", "ATCLR", "ATRQ", "BASE", "BCLR", "BGO", "BMOVE", "BOOLEAN", "BOPEN", "BOX", "BOXCLR", "BOXDEF", "BRAKE",
    "BSET", "BTST", "BYTE", "CALL", "CASE", "CHDIR", "CLEARPOINTS", "CLOSE", "CLOSECOM", "CLOSENET", "CLS", "CONT", "COPY", "COS", "CP", "CTRESET",
    "CURPOS", "CURVE", "CVMOVE", "CX", "CY", "CZ", "CU", "CV", "CW", "DATE", "DEGTORAD", "DEL", "DIM", "DIST", "DO", "DOUBLE", "ECP", "ECPCLR",
    "ECPSET", "ELBOW", "ELSE", "ELSEIF", "ENDIF", "EOF", "ERR", "ERROR", "EXIT", "EXP", "FALSE", "FEND", "FINE", "FIX", "FOR", "FUNCTION", "GLOBAL",
    "GO", "GOSUB", "GOTO", "HALT", "HAND", "HERE", "HOFS", "HOME", "HOMECLR", "HOMESET", "HORDR", "IF", "IN", "INBCD", "INERTIA", "INPOS", "INPUT",
    "INT", "INTEGER", "INW", "JA", "JRANGE", "JS", "JT", "JUMP", "JUMP3", "JUMP3CP", "KILL", "LEN", "LIMZ", "LINE", "LOADPOINTS", "LOCAL", "LOCALCLR",
    "LOCALDEF", "LOF", "LONG", "LOOP", "MCAL", "MCORDR", "MEMIN", "MEMOFF", "MEMON", "MEMOUT", "MEMSW", "MOD", "MOTOR", "MOVE", "MYTASK", "NEXT",
    "NOT", "OFF", "OLRATE", "ON", "ONERR", "OPENCOM", "OPENNET", "OPORT", "OR", "OUT", "OUTW", "PAGL", "PALLET", "PASS", "PAUSE", "PDEF", "PDEL",
    "PG_SCAN", "PLANE", "PLS", "POWER", "PPLS", "PRESERVE", "PRINT", "PTCLR", "PTRQ", "PULSE", "QUIT", "RADTODEG", "RANDOMIZE", "RANGE", "READ",
    "REAL", "REDIM", "RESET", "RESTART", "RESUME", "RETURN", "RND", "ROBOT", "ROPEN", "SAVEPOINTS", "SELECT", "SEND", "SENSE", "SETCOM", "SETNET",
    "SETSW", "SFREE", "SGN", "SHORT", "SHUTDOWN", "SIGNAL", "SIN", "SLOCK", "SPEED", "SPEEDR", "SPEEDS", "SQR", "STAT", "STEP", "STRING", "SW",
    "SYNCLOCK", "SYNCUNLOCK", "TAN", "TARGETOK", "TCLIM", "TCSPEED", "TGO", "THEN", "TILL", "TIME", "TLCLR", "TLDEF", "TLSET", "TMOUT", "TMOVE",
    "TMR", "TMRESET", "TO", "TOFF", "TON", "TOOL", "TRAP", "TRUE", "TW", "UBOUND", "UNTIL", "UOPEN", "VAL", "WAIT", "WAITNET", "WAITPOS", "WAITSIG",
    "WEIGHT", "WEND", "WHERE", "WHILE", "WINDOW", "WITH", "WOPEN", "WRIST", "WRITE", "XOR", "XQT", "XY", "XYLIM",
];

impl Language for Spel {
    fn id(&self) -> &'static str {
        "spel"
    }

    fn emit(&self, program: &RobotProgram, sources: &dyn Sources, options: &Options) -> Output {
        let mut names = Names::new(Rule { longest: 32, reserved: RESERVED, upper: false });
        let name = names.give(&program.name, "p");
        let writer = Writer { out: Lines::new("  ", "'"), angles: [0.0; 3], set: Default::default() };
        let file = format!("{name}.prg");
        one_file((program, sources, options), &TRAITS, &names, writer, file, |w| format!("Function {name}\r\n  Motor On\r\n{}Fend\r\n", w.out.text))
    }
}

struct Writer {
    out: Lines,
    angles: [f64; 3],
    /// Path speed and joint speed in force.
    set: [String; 2],
}

impl Writer {
    fn xy(&mut self, frame: &Frame, decimals: usize) -> String {
        let [w, v, u] = orient::fixed_xyz(&frame.turn, self.angles);
        self.angles = [w, v, u];
        format!("XY({})", six(frame.position, decimals, [u, v, w]))
    }

    fn place(&mut self, cx: &Cx, t: &Target) -> String {
        let local = if cx.frame < cx.program.frames.len() { format!("/{}", cx.frame + 1) } else { String::new() };
        self.xy(&orient::frame(t.position, &t.quaternion), cx.decimals()) + &local
    }

    fn set_frame(&mut self, cx: &mut Cx, word: String, frame: &Frame) {
        self.angles = [0.0; 3];
        let text = self.xy(frame, 4);
        self.angles = [0.0; 3];
        self.out.line(cx, &format!("{word}, {text}"));
    }
}

impl Plain for Writer {
    const PAUSE: &'static str = "Pause";
    const RESERVED: &'static [&'static str] = RESERVED;

    fn out(&mut self) -> &mut Lines {
        &mut self.out
    }
    fn joint(&mut self, cx: &mut Cx, to: &Target, share: f64) {
        self.out.setting(cx, &mut self.set[1], format!("Speed {}", per_cent(share)));
        self.out.line(cx, &format!("Go AglToPls({})", joints(&cx.degrees(to))));
    }
    // `CP` joins moves without a distance that could be said.
    fn linear(&mut self, cx: &mut Cx, to: &Target, speed: f64, zone: Option<f64>) {
        self.out.setting(cx, &mut self.set[0], format!("SpeedS {}", single(speed)));
        let to = self.place(cx, to);
        self.out.line(cx, &format!("Move {to}{}", if zone.is_some() { " CP" } else { "" }));
    }
    fn arc(&mut self, cx: &mut Cx, via: &Target, to: &Target, speed: f64, zone: Option<f64>) {
        self.out.setting(cx, &mut self.set[0], format!("SpeedS {}", single(speed)));
        let (via, to) = (self.place(cx, via), self.place(cx, to));
        self.out.line(cx, &format!("Arc3 {via}, {to}{}", if zone.is_some() { " CP" } else { "" }));
    }
    fn tool(&mut self, cx: &mut Cx, number: usize, frame: &Frame) {
        self.set_frame(cx, format!("TLSet {}", number + 1), frame);
        self.out.line(cx, &format!("Tool {}", number + 1));
    }
    fn frame(&mut self, cx: &mut Cx, number: usize, frame: &Frame) {
        self.set_frame(cx, format!("Local {}", number + 1), frame);
    }
    fn digital(number: u32, on: bool) -> String {
        format!("{} {number}", if on { "On" } else { "Off" })
    }
    fn call(name: &str, value: Option<String>) -> String {
        value.map_or(format!("Call {name}"), |v| format!("Call {name}({v})"))
    }
    fn waits(number: u32, on: bool) -> String {
        format!("Wait Sw({number}) = {}", if on { "On" } else { "Off" })
    }
    fn waits_at_most(number: u32, on: bool, seconds: f64) -> Option<Vec<String>> {
        Some(vec![format!("{}, {}", Self::waits(number, on), num(seconds, 3)), "If TW = True Then Pause".into()])
    }
    fn dwell(seconds: f64) -> String {
        format!("Wait {}", num(seconds, 3))
    }
    fn message(text: &str) -> Option<String> {
        Some(format!("Print \"{}\"", text.replace('"', "'")))
    }
}
