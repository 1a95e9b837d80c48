//! Text of a million straight moves in ABB RAPID. Run: `cargo bench -p gr-vendors`.

use gr_ir::{NoSources, Source};
use gr_machine::math::Frame;
use gr_robot::{Action, MAX_JOINTS, RobotProgram, Step, Target, Tool, WorkFrame, Zone};
use gr_text::FileId;
use gr_vendors::Options;

fn main() {
    divan::main();
}

const COUNT: u32 = 1_000_000;

/// A wavy surface in lines, the tool straight down, as finishing passes are.
fn program() -> RobotProgram {
    let machine = gr_machine::builtin("abb/irb2400").expect("built in");
    let mut joints = [0.0; MAX_JOINTS];
    joints[..6].copy_from_slice(&[0.1, 0.3, 0.2, 0.4, 0.9, -0.5]);
    let at = |i: u32| {
        let (x, y) = (f64::from(i % 1000) * 0.25, f64::from(i / 1000) * 0.2);
        let position = [x, y, 5.0 * (x * 0.05).sin() + 0.013 * y];
        let mut j = joints;
        j[0] += x * 1e-4;
        Target { position, quaternion: [0.0, 1.0, 0.0, 0.0], joints: j, branch: 0 }
    };
    let source = |line: u32| Some(Source { file: FileId(0), line, ..Source::default() });
    let zone = |i: u32| if i % 1000 == 999 { Zone::Stop } else { Zone::Blend(0.05) };
    let mut steps = vec![Step { action: Action::UseTool(0), source: source(0) }, Step { action: Action::UseFrame(0), source: source(0) }];
    steps.extend((0..COUNT).map(|i| Step {
        action: Action::Linear { to: i, speed: 50.0 / 3.0, zone: zone(i), rapid: false },
        source: source(i + 1),
    }));
    RobotProgram {
        name: "surface".into(),
        machine,
        tools: vec![Tool { number: 1, name: "ball6".into(), frame: Frame::shift([0.0, 0.0, 200.0]), mass: Some(3.0) }],
        frames: vec![WorkFrame { name: "G54".into(), frame: Frame::shift([900.0, 0.0, 400.0]) }],
        targets: (0..COUNT).map(at).collect(),
        home: at(0),
        steps,
        curves: gr_robot::Curves::default(),
    }
}

#[divan::bench(args = ["rapid", "krl", "fanuc-ls", "urscript"], sample_count = 3, sample_size = 1)]
fn a_million_moves(bencher: divan::Bencher, target: &str) {
    let program = program();
    let language = gr_vendors::language(target).expect("a language");
    bencher.bench(|| language.emit(&program, &NoSources, &Options::default()).files.len());
}
