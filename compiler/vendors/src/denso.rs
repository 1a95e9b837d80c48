//! DENSO PAC: one program. Sources differ on what the angles of a position mean, so every point is joint values,
//! straight moves and arcs too.

use crate::name::{Names, Rule};
use crate::number::num;
use crate::parts::Lines;
use crate::plain::{Plain, corner, joints, one_file};
use crate::walk::{Arms, Cx, Traits, World};
use crate::{Language, Options, Output};
use gr_ir::Sources;
use gr_machine::math::{Frame, norm};
use gr_robot::{RobotProgram, Target};

pub(crate) struct Denso;

static TRAITS: Traits = Traits {
    title: "DENSO PAC",
    arms: Arms::Any,
    world: World::Foot,
    external: false,
    arcs: true,
    trailing: true,
    unverified: "speeds in mm/s by MPS, and joint values in straight moves",
};

/// Commands, functions and words of the language; a program of the name `MAIN` is the controller's own.
const RESERVED: &[&str] = &[
    "ABS", "ACCEL", "ACOS", "AND", "APPROACH", "ARCHMOVE", "AREA", "AREAPOS", "AREASIZE", "ARRIVE", "ASC", "ASIN", "ATN", "ATN2", "AVEC", "CALL",
    "CASE", "CHANGETOOL", "CHANGEWORK", "CLEARLOG", "COS", "CREATESEM", "CURACC", "CURDEC", "CUREXJ", "CURFIG", "CURJACC", "CURJDEC", "CURJNT", "CURJSPD",
    "CURPOS", "CURSPD", "CURTOOL", "CURTRN", "CURWORK", "DECEL", "DEF", "DEFDBL", "DEFEND", "DEFINT", "DEFIO", "DEFJNT", "DEFPOS", "DEFSNG",
    "DEFSTR", "DEFTRN", "DEFVEC", "DEGRAD", "DELAY", "DELETESEM", "DEPART", "DESTJNT", "DESTPOS", "DESTTRN", "DIM", "DIST", "DO", "DRAW", "DRIVE",
    "DRIVEA", "ELSE", "ELSEIF", "END", "ENDIF", "ERL", "ERR", "EXIT", "EXP", "FALSE", "FIG", "FIGAPRL", "FIGAPRP", "FLUSH", "FOR", "GETENV",
    "GIVEARM", "GIVESEM", "GIVEVIS", "GOHOME", "GOSUB", "GOTO", "HALT", "HOLD", "IF", "IFEND", "IN", "INIT", "INPUT", "INT", "INTERRUPT", "IO",
    "IOBLOCK", "JACCEL", "JDECEL", "JSPEED", "KILL", "KILLALL", "LEN", "LET", "LETA", "LETENV", "LETF", "LETJ", "LETO", "LETP", "LETR", "LETRX",
    "LETRY", "LETRZ", "LETT", "LETX", "LETY", "LETZ", "LINEINPUT", "LOG", "LOG10", "LOOP", "LPRINT", "MAGNITUDE", "MAIN", "MAX", "MIN", "MOD",
    "MOTOR", "MOVE", "MPS", "NEXT", "NOT", "OFF", "ON", "OR", "OUT", "OVEC", "P2J", "P2T", "PI", "POSCLR", "POSRX", "POSRY", "POSRZ", "POSX",
    "POSY", "POSZ", "POW", "PRINT", "PRINTBUZZER", "PRINTDBG", "PRINTLBL", "PRINTMSG", "PROGRAM", "PVEC", "RADDEG", "REM", "REPEAT", "RESET",
    "RESETAREA", "RESUME", "RETURN", "RND", "ROTATE", "ROTATEH", "RUN", "RVEC", "SELECT", "SET", "SETAREA", "SGN", "SIN", "SPEED", "SQR",
    "STARTLOG", "STATUS", "STEP", "STOP", "STOPEND", "STOPLOG", "STRPOS", "SUSPEND", "SUSPENDALL", "T2J", "T2P", "TAKEARM", "TAKESEM", "TAKEVIS",
    "TAN", "THEN", "TIMER", "TINV", "TO", "TOOL", "TOOLPOS", "TRUE", "UNTIL", "VAL", "WAIT", "WEND", "WHILE", "WORK", "WORKPOS", "WRITE", "XOR",
];

impl Language for Denso {
    fn id(&self) -> &'static str {
        "denso-pac"
    }

    fn emit(&self, program: &RobotProgram, sources: &dyn Sources, options: &Options) -> Output {
        let mut names = Names::new(Rule { longest: 32, reserved: RESERVED, upper: false });
        let name = names.give(&program.name.to_lowercase(), "p");
        let writer = Writer { out: Lines::new("  ", "'"), speed: String::new() };
        let file = format!("{name}.pac");
        one_file((program, sources, options), &TRAITS, &names, writer, file, |w| format!("PROGRAM {name}\r\n  TAKEARM\r\n{}  GIVEARM\r\nEND\r\n", w.out.text))
    }
}

struct Writer {
    out: Lines,
    speed: String,
}

fn point(cx: &Cx, t: &Target) -> String {
    format!("J({})", joints(&cx.degrees(t)))
}

impl Writer {
    fn path(&mut self, cx: &mut Cx, speed: f64, zone: Option<f64>) -> String {
        self.out.setting(cx, &mut self.speed, format!("SPEED MPS({})", num(speed, 6)));
        zone.map_or("@0".into(), |r| format!("@{}", num(corner(r), 3)))
    }
}

impl Plain for Writer {
    const PAUSE: &'static str = "STOP";
    const RESERVED: &'static [&'static str] = RESERVED;

    fn out(&mut self) -> &mut Lines {
        &mut self.out
    }
    fn joint(&mut self, cx: &mut Cx, to: &Target, share: f64) {
        let to = point(cx, to);
        self.out.line(cx, &format!("MOVE P, @0 {to}, S={}", num((share * 100.0).clamp(0.1, 100.0), 1)));
    }
    fn linear(&mut self, cx: &mut Cx, to: &Target, speed: f64, zone: Option<f64>) {
        let pass = self.path(cx, speed, zone);
        self.out.line(cx, &format!("MOVE L, {pass} {}", point(cx, to)));
    }
    fn arc(&mut self, cx: &mut Cx, via: &Target, to: &Target, speed: f64, zone: Option<f64>) {
        let pass = self.path(cx, speed, zone);
        self.out.line(cx, &format!("MOVE C, {}, {pass} {}", point(cx, via), point(cx, to)));
    }
    fn tool(&mut self, cx: &mut Cx, number: usize, frame: &Frame) {
        // The arc of a straight move is that of the tool point: the controller must know it.
        if norm(frame.position) > 0.0 {
            let p = frame.position.map(|v| num(v, 3));
            let args = [format!("tool {}", number + 1), format!("X {} Y {} Z {}", p[0], p[1], p[2])];
            cx.say(gr_text::code::VENDOR_SET_BY_HAND, &args);
        }
        self.out.line(cx, &format!("CHANGETOOL {}", number + 1));
    }
    // Points are joint values: no frame is needed.
    fn frame(&mut self, _: &mut Cx, _: usize, _: &Frame) {}
    fn digital(number: u32, on: bool) -> String {
        format!("{} IO[{number}]", if on { "SET" } else { "RESET" })
    }
    fn call(name: &str, value: Option<String>) -> String {
        value.map_or(format!("CALL {name}"), |v| format!("CALL {name}({v})"))
    }
    fn waits(number: u32, on: bool) -> String {
        format!("WAIT IO[{number}] = {}", if on { "ON" } else { "OFF" })
    }
    fn dwell(seconds: f64) -> String {
        format!("DELAY {}", num(seconds * 1000.0, 0))
    }
    fn message(text: &str) -> Option<String> {
        Some(format!("PRINTMSG \"{}\", 1, \"program\"", text.replace('"', "'")))
    }
}
