//! One pose, one arc and one configuration per language against numbers derived by hand. The derivations stand at
//! the tests; none of the code under test is used in them.

mod common;
use common::*;
use gr_machine::math::Frame;
use gr_robot::{Action, MAX_JOINTS, RobotProgram, Step, Target, Tool, WorkFrame, Zone};

/// R = Rz(30°)·Rx(180°): the tool points straight down, its X axis lies at 30°. As a quaternion: Rx(180°) is
/// (0, 1, 0, 0), Rz(30°) is (cos 15°, 0, 0, sin 15°), and their product is (0, cos 15°, sin 15°, 0).
const DOWN_30: [f64; 4] = [0.0, 0.965_925_826_289_068_3, 0.258_819_045_102_520_8, 0.0];

/// The joint values are given, not solved: what is written of them is only the configuration. The pose is
/// independent of them.
fn program(id: &str, degrees: [f64; 6]) -> RobotProgram {
    let mut joints = [0.0; MAX_JOINTS];
    for (slot, v) in joints.iter_mut().zip(degrees) {
        *slot = v.to_radians();
    }
    let at = |position: [f64; 3]| Target { position, quaternion: DOWN_30, joints, branch: 0 };
    // A quarter circle about (100, 60, 5) with radius 10, from −90° to 0°, counter-clockwise seen from above. Its middle
    // lies at −45°: 100 + 10/√2 = 107.0711, 60 − 10/√2 = 52.9289.
    let targets = vec![at([100.0, 50.0, 5.0]), at([107.071_067_811_865_48, 52.928_932_188_134_52, 5.0]), at([110.0, 60.0, 5.0])];
    let arc = Action::Arc {
        via: 1,
        to: 2,
        center: [100.0, 60.0, 5.0],
        normal: [0.0, 0.0, 1.0],
        angle: std::f64::consts::FRAC_PI_2,
        speed: 25.0,
        zone: Zone::Stop,
    };
    let actions = [
        Action::UseTool(0),
        Action::UseFrame(0),
        Action::Joint { to: 0, speed: 0.5, zone: Zone::Stop },
        Action::Linear { to: 0, speed: 25.0, zone: Zone::Stop, rapid: false },
        arc,
    ];
    RobotProgram {
        name: "hand".into(),
        machine: machine(id),
        tools: vec![Tool { number: 1, name: "tip".into(), frame: Frame::shift([0.0, 0.0, 100.0]), mass: Some(1.0) }],
        frames: vec![WorkFrame { name: "part".into(), frame: Frame::shift([500.0, 0.0, 200.0]) }],
        home: Target { joints: { let mut h = joints; h[0] = 0.1; h }, ..targets[0] },
        targets,
        steps: actions.map(|action| Step { action, source: None }).into(),
        curves: gr_robot::Curves::default(),
    }
}

/// All files of a language as one text.
fn text(target: &str, program: &RobotProgram) -> String {
    let output = emit(target, program);
    assert!(!output.files.is_empty(), "{:?}", output.findings);
    texts(&output).iter().map(|f| f.1.as_str()).collect()
}

fn has(target: &str, program: &RobotProgram, parts: &[&str]) {
    let text = text(target, program);
    for part in parts {
        assert!(text.contains(part), "{target}: no {part} in\n{text}");
    }
}

/// ABB. Quaternion as derived, the larger part as √(1 − 0.25881905²) = 0.96592582 so that the length is 1. Quadrants: −100° lies in −180 … −90, number −2; 135° in 90 … 180, number 1; −10° in
/// −90 … 0, number −1. The fourth field of the IRB 140, 0 + 0 + 1: the fifth joint is negative; with the second joint at
/// 10° and the third at 20° (counted from the forearm level, so −70° from the line of the upper arm: the forearm bends
/// forward) nothing else is added. On the IRB 2400 (parallelogram) it stays 0, and the third joint on the controller is
/// 20 + 10 = 30.
#[test]
fn rapid() {
    let joints = [-100.0, 10.0, 20.0, 135.0, -40.0, -10.0];
    let place = "[[100,50,5],[0,0.96592582,0.25881905,0],[-2,1,-1,1],[9E9,9E9,9E9,9E9,9E9,9E9]]";
    let arc = "MoveC [[107.071,52.929,5],[0,0.96592582,0.25881905,0],[-2,1,-1,1],[9E9,9E9,9E9,9E9,9E9,9E9]],[[110,60,5],";
    has("rapid", &program("abb/irb140", joints), &[place, arc, "speeddata vF1:=[25,500,5000,1000]"]);
    has("rapid", &program("abb/irb2400", joints), &["[-2,1,-1,0]", "MoveAbsJ [[5.72958,10,30,135,-40,-10],"]);
}

/// KUKA, R = Rz(A)·Ry(B)·Rx(C): A 30, B 0, C 180. Status: joint 5 negative = 4, and with A2 = −80°, A3 = 90° (the zero
/// of the third joint is the straight arm, so the forearm bends forward by 90°) the wrist lies in front of the line = 2:
/// 6. Turn: A1 < 0 is 1, A2 < 0 is 2, A5 < 0 is 16, together 19. 25 mm/s = 0.025 m/s.
#[test]
fn krl() {
    let p = program("kuka/kr16-2", [-100.0, -80.0, 90.0, 135.0, -40.0, 10.0]);
    let pose = "X 100.0,Y 50.0,Z 5.0,A 30.0,B 0.0,C 180.0";
    let arc = "CIRC {X 107.071,Y 52.929,Z 5.0,A 30.0,B 0.0,C 180.0},{X 110.0,Y 60.0,Z 5.0,A 30.0,B 0.0,C 180.0}";
    has("krl", &p, &[&format!("PTP {{E6POS: {pose},S 6,T 19}}"), &format!("LIN {{{pose}}}"), arc, "$VEL.CP=0.025"]);
}

/// FANUC, R = Rz(R)·Ry(P)·Rx(W): W 180, P 0, R 30. Joint 5 at −40°: N. The arm reaches forward: T. Elbow up: U. Joint 6
/// at 200° has begun its second turn (180 … 539): turns 0, 0, 1; the joint move is then in joint values, J3 on the
/// controller −10 − 10 = −20. 25 mm/s = 150 cm/min.
#[test]
fn fanuc() {
    let p = program("fanuc/m-20ia", [10.0, 10.0, -10.0, 20.0, -40.0, 200.0]);
    let pose = "CONFIG : 'N U T, 0, 0, 1',\r\n\tX =   100.000  mm,\tY =    50.000  mm,\tZ =     5.000  mm,\r\n\t\
                W =   180.000 deg,\tP =     0.000 deg,\tR =    30.000 deg";
    has("fanuc-ls", &p, &[pose, "J3=   -20.000 deg", "J6=   200.000 deg", "150cm/min FINE", "X =   107.071  mm,\tY =    52.929  mm"]);
}

/// Universal Robots: pose in the base = frame + position in m: 0.6, 0.05, 0.205. Half a turn about the axis half way
/// between X and the tool's X axis, at 15°: rotation vector π·(cos 15°, sin 15°, 0) = (3.0345455, 0.8131040, 0).
#[test]
fn urscript() {
    let p = program("universal-robots/ur5", [10.0, -80.0, 100.0, -100.0, -80.0, 20.0]);
    let arc = "movec(p[0.607071,0.052929,0.205,3.0345455,0.813104,0],p[0.61,0.06,0.205,3.0345455,0.813104,0],a=1.2,v=0.025,";
    has("urscript", &p, &["movel(p[0.6,0.05,0.205,3.0345455,0.813104,0],a=1.2,v=0.025,", arc, "[0.174533,-1.396263,1.745329,-1.745329,-1.396263,0.349066]"]);
}

/// Yaskawa, R = Rz(Rz)·Ry(Ry)·Rx(Rx). R at 100° lies beyond 90°: no-flip = 1; upper arm, front: 0, 0; R, T, S below 180° but T
/// at 200°: 0, 1, 0.
#[test]
fn inform() {
    let p = program("yaskawa/gp25", [10.0, 10.0, -10.0, 100.0, -60.0, 200.0]);
    has("inform", &p, &["///RCONF 1,0,0,0,1,0,0,0", "=100.000,50.000,5.000,180.0000,0.0000,30.0000", "=107.071,52.929,5.000,180.0000", "V=25.0"]);
}

/// Stäubli, R = Rx(rx)·Ry(ry)·Rz(rz) = Rz(30°)·Rx(180°). Moving Rx(180°) to the front turns Rz(30°) into Rz(−30°): rx 180,
/// ry 0, rz −30. The frame is counted from the second joint, 478 mm up on a TX90: 200 − 478 = −278.
#[test]
fn val3() {
    let p = program("staubli/tx90", [10.0, 20.0, 70.0, 20.0, 50.0, 30.0]);
    has("val3", &p, &["x=\"100\" y=\"50\" z=\"5\" rx=\"180\" ry=\"0\" rz=\"-30\"", "x=\"500\" y=\"0\" z=\"-278\"", "x=\"107.071\" y=\"52.929\"", "tmax=\"25\""]);
    // How it stands is said by the joint values of the joint move; straight moves and arcs go on as it stands.
    has("val3", &p, &["j1=\"10\" j2=\"20\" j3=\"70\" j4=\"20\" j5=\"50\" j6=\"30\"", "shoulder=\"ssame\" elbow=\"esame\" wrist=\"wsame\""]);
}

/// Where the controller counts from. With the forearm level and the wrist bent down by 90° the tool (100 mm) of an M-20iA is at
/// X 150 + 835 = 985, Z 525 + 790 + 250 − 100 − 100 = 1365 over its foot. Its world is on axis 1 at the height of axis 2, 525 mm
/// up (URDF, `m20ia_macro.xacro`: "ROS base_link to Fanuc World Coordinates", 0 0 0.525): the control shows X 985, Z 840. The
/// same of a GP25 (`gp25_macro.xacro`: "ROS base_link to Robot Manufacturer World Coordinates", 0 0 0.505): X 150 + 795 = 945,
/// Z 760 + 200 − 100 − 100 = 760, seen from a user frame at X 500, Z 200 over its foot.
#[test]
fn worlds_of_controllers() {
    let mut p = program("fanuc/m-20ia", [0.0, 0.0, 0.0, 0.0, -90.0, 0.0]);
    p.targets[0].position = [985.0 - 500.0, 0.0, 1365.0 - 200.0];
    has("fanuc-ls", &p, &["PR[91,1]=500.000    ;", "PR[91,3]=(-325.000)    ;", "PR[92,3]=100.000    ;"]);
    let events = gr_vendors::read::read("fanuc-ls", &texts(&emit("fanuc-ls", &p))).unwrap();
    let shown = events.iter().find_map(|e| match e {
        gr_vendors::read::Event::Linear(place, ..) => Some(place.frame?.apply(place.pose?.position)),
        _ => None,
    });
    assert_eq!(shown, Some([985.0, 0.0, 840.0]));

    let mut p = program("yaskawa/gp25", [0.0, 0.0, 0.0, 0.0, -90.0, 0.0]);
    p.home.joints = p.targets[0].joints;
    // At home: Z 760 − (−305) in the user frame, which the operator sets.
    has("inform", &p, &["'UF 1: X 500 Y 0 Z -305", "C00000=445.000,0.000,1065.000"]);
    let told = emit("inform", &p).findings.iter().any(|f| format!("{f:?}").contains("X 500 Y 0 Z -305 Rx 0 Ry 0 Rz 0"));
    assert!(told, "the hint has the same numbers");
}

/// The machine file's word comes before what is usual for a language; a UR whose base looks backwards: X −0.6, Y −0.05, and the
/// turn about Z by 180° before the half turn about (cos 15°, sin 15°, 0) is one about (cos 105°, sin 105°, 0), or its opposite.
#[test]
fn a_controller_that_counts_from_elsewhere() {
    let mut p = program("fanuc/m-20ia", [10.0, 10.0, -10.0, 20.0, -40.0, 20.0]);
    p.machine.cell.controller_frame = Some(Frame::shift([0.0, 0.0, 0.0]));
    has("fanuc-ls", &p, &["PR[91,3]=200.000    ;"]);
    let mut p = program("universal-robots/ur5", [10.0, -80.0, 100.0, -100.0, -80.0, 20.0]);
    p.machine.cell.controller_frame = Some(Frame::new([0.0; 3], [0.0, 0.0, std::f64::consts::PI]));
    // π·cos 105° = −0.813104, π·sin 105° = 3.0345455.
    let text = text("urscript", &p);
    let told = ["-0.813104,3.0345455,0]", "0.813104,-3.0345455,0]"].iter().any(|r| text.contains(&format!("movel(p[-0.6,-0.05,0.205,{r}")));
    assert!(told, "{text}");
    let mut p = program("kuka/kr16-2", [-100.0, -80.0, 90.0, 135.0, -40.0, 10.0]);
    p.machine.cell.controller_frame = Some(Frame::shift([0.0, 0.0, 50.0]));
    has("krl", &p, &["X 500.0,Y 0.0,Z 150.0"]);
}

/// DELMIA: degrees and m; turns about Z, Y, X: yaw 30, pitch 0, roll 180.
#[test]
fn delmia() {
    let p = program("abb/irb140", [10.0, 20.0, 5.0, 20.0, 50.0, -30.0]);
    has("delmia-xml", &p, &["X=\"0.1\" Y=\"0.05\" Z=\"0.005\"/><Orientation Units=\"deg\" Yaw=\"30\" Pitch=\"0\" Roll=\"180\"", "<JointValue>-30.000000</JointValue>"]);
    // The configuration: all joints of the joint move, one by one.
    let joint = |n: u8, v: &str| format!("DOFNumber=\"{n}\"><JointValue>{v}</JointValue>");
    for (n, v) in (1..).zip(["10.000000", "20.000000", "5.000000", "20.000000", "50.000000", "-30.000000"]) {
        has("delmia-xml", &p, &[&joint(n, v)]);
    }
}

/// Kawasaki, Comau: R = Rz(O)·Ry(A)·Rz(T). The tool points down, the pole of this convention: A = 180 and only T − O is
/// determined. Rz(O)·Ry(180°)·Rz(T) has the first column (−cos(O − T), −sin(O − T), 0), which must be (cos 30°, sin 30°, 0):
/// O − T = −150. O stays what it was, 0, so T = 150.
#[test]
fn zyz_at_its_pole() {
    let joints = [10.0, 20.0, 5.0, 20.0, 50.0, -30.0];
    has("kawasaki-as", &program("kawasaki/rs020n", joints), &["LMOVE TRANS(100,50,5,0,180,150)", "C1MOVE TRANS(107.071,52.929,5,0,180,150)", "C2MOVE TRANS(110,60,5,"]);
    has("pdl2", &program("abb/irb140", joints), &["MOVE LINEAR TO POS(100,50,5,0,180,150,", "$LIN_SPD := 0.025"]);
    // Kawasaki: the joint move says how it stands. Comau: wrist in front of the first axis, forearm bent forward: neither S
    // nor E; W where the fifth joint is negative.
    has("kawasaki-as", &program("kawasaki/rs020n", joints), &["JMOVE #[10,20,5,20,50,-30]"]);
    has("pdl2", &program("abb/irb140", joints), &["MOVE TO {10,20,5,20,50,-30}", "0,180,150,'T1:0 T2:0 T3:0')"]);
    has("pdl2", &program("abb/irb140", [10.0, 20.0, 5.0, 20.0, -50.0, -30.0]), &["0,180,150,'W T1:0 T2:0 T3:0')"]);
}

/// Adept V+ on a SCARA: the same pole; arcs become lines, the first of them on the circle: radius 10, tolerance 0.01 gives
/// steps of 2·acos(1 − 0.001) = 5.125°, so 90° take 18 steps of 5°: 100 + 10·sin 5° = 100.872, 60 − 10·cos 5° = 50.038.
#[test]
fn vplus() {
    let mut p = program("adept/one", [0.0; 6]);
    // The tool hangs straight down at 30°: q1 + q2 − q4 = 30°; the numbers are those of the arm's kinematics.
    let kinematics = p.machine.kinematics();
    let frame = p.frames[0].frame;
    for t in &mut p.targets {
        let pose = frame.then(&Frame { turn: turn_of(&t.quaternion), position: t.position }).then(&p.tools[0].frame.inverse());
        t.joints[..4].copy_from_slice(&kinematics.inverse_frame(&pose).unwrap()[0].joints);
    }
    has("vplus", &p, &["MOVES part:TRANS(100,50,5,0,180,150)", "MOVES part:TRANS(100.872,50.038,5,0,180,150)", "SPEED 25 MMPS ALWAYS"]);
    // The configuration: the flange is at (600, 50, 305), links 424.942 and 374.904. cos q2 = (600² + 50² − 424.942² −
    // 374.904²)/(2 · 424.942 · 374.904): q2 = ±82.540°. q1 = atan2(50, 600) ∓ atan2(371.73, 473.62), stroke 876.808 − 305, and
    // q4 = q1 + q2 − 30°. Either elbow, but all of it.
    let text = text("vplus", &p);
    let told: Vec<f64> = text.split("MOVE #PPOINT(").last().unwrap().split(')').next().unwrap().split(',').map(|v| v.parse().unwrap()).collect();
    let said = [LEFT, RIGHT].iter().any(|hand| told.iter().zip(hand).all(|(a, b)| (a - b).abs() < 2e-3));
    assert!(told.len() == 4 && said, "{told:?}");
}

const LEFT: [f64; 4] = [-33.3636, 82.5395, 571.808, 19.1758];
const RIGHT: [f64; 4] = [42.8909, -82.5395, 571.808, -69.6486];

/// The others, each with the joint values of its joint move for the configuration. Denso: joint values. Mitsubishi: A B C about X, Y, Z. Epson: U V W about Z, Y, X. Nachi: in the base, turns about Z,
/// Y, X.
#[test]
fn the_others() {
    let p = program("abb/irb140", [10.0, 20.0, 5.0, 20.0, 50.0, -30.0]);
    has("denso-pac", &p, &["MOVE P, @0 J(10,20,5,20,50,-30)", "MOVE L, @0 J(10,20,5,20,50,-30)", "MOVE C, J(", "SPEED MPS(25)"]);
    has("melfa", &p, &["(100,50,5,180,0,30)(7,0)", "Mvr P2,P3,P4", "P3=(107.071,52.929,5,180,0,30)", "Spd 25"]);
    has("spel", &p, &["Move XY(100,50,5,30,0,180)/1", "Go AglToPls(10,20,5,20,50,-30)", "Arc3 XY(107.071,52.929,5,30,0,180)/1, XY(110,60,5,30,0,180)/1", "SpeedS 25"]);
    has("nachi", &p, &["M1J,P,(10,20,5,20,50,-30)", "M1X,L,(600,50,205,30,0,180),S=25.00", "M1X,C1,(607.071,52.929,205,30,0,180)"]);
}
