//! DELMIA V5 upload.

use super::simple::State;
use super::xml::{Node, get, nodes, value};
use super::{Event, Fault, File, Place};
use gr_machine::math::Frame;
use std::collections::BTreeMap;

/// Reads an upload file: joint targets in degrees and mm, with the pose that the file gives beside them.
pub fn read(files: &[File]) -> Result<Vec<Event>, Fault> {
    let text = &super::main_file(files, ".xml")?.1;
    let mut s = State::new();
    let mut speeds: BTreeMap<String, (f64, bool)> = BTreeMap::new();
    let mut zones: BTreeMap<String, f64> = BTreeMap::new();
    let (mut open, mut name, mut kind) = (String::new(), String::new(), String::new());
    let (mut activity, mut metric, mut factor) = (String::new(), false, 1.0);
    let (mut joints, mut pose): (Vec<f64>, Option<Frame>) = (Vec::new(), None);
    for node in nodes(text)? {
        match node {
            Node::Open(tag, a, _) => {
                match tag.as_str() {
                    "Activity" => {
                        activity = get(&a, "ActivityType").unwrap_or("").to_string();
                        (joints, pose) = (Vec::new(), None);
                    }
                    "Speed" => metric = get(&a, "Units") == Some("m/s"),
                    "Joint" => factor = if get(&a, "Units") == Some("m") { 1000.0 } else { 1.0 },
                    "Position" => {
                        let v = |n| value(&a, n).map(|v| v * 1000.0).ok_or("a position without numbers");
                        pose = Some(Frame::shift([v("X")?, v("Y")?, v("Z")?]));
                    }
                    "Orientation" => {
                        let v = |n| value(&a, n).ok_or("a turn without numbers");
                        let turn = super::fixed(v("Roll")?, v("Pitch")?, v("Yaw")?);
                        pose = pose.map(|p| Frame { turn, ..p });
                    }
                    "IOSetSignal" => {
                        let state = get(&a, "SignalValue").unwrap_or("");
                        let number = if state == "On" { 1.0 } else { state.parse().unwrap_or(0.0) };
                        s.set(get(&a, "SignalName").unwrap_or(""), number);
                    }
                    "IOWaitSignal" => {
                        let on = get(&a, "SignalValue") == Some("On");
                        s.events.push(Event::Wait(get(&a, "SignalName").unwrap_or("").to_string(), on));
                    }
                    _ => {}
                }
                open = tag;
            }
            Node::Text(t) => match open.as_str() {
                "Name" => name = t,
                "Speed" => {
                    speeds.insert(name.clone(), (t.parse::<f64>().map_err(|_| t)? * 1000.0, metric));
                }
                "AccuracyValue" => {
                    zones.insert(name.clone(), t.parse::<f64>().map_err(|_| t)? * 1000.0);
                }
                "MotionProfile" => s.speed = speeds.get(&t).filter(|p| p.1).map_or(0.0, |p| p.0),
                "AccuracyProfile" => s.zone = zones.get(&t).copied().filter(|z| *z > 0.0),
                "MotionType" => kind = t,
                "JointValue" => joints.push(t.parse::<f64>().map_err(|_| t)? * factor),
                "CallName" => s.events.push(Event::Call(t, None)),
                "EndTime" if activity == "DelayActivity" => s.events.push(Event::Dwell(t.parse().map_err(|_| t)?)),
                _ => {}
            },
            Node::Close(tag) if tag == "Activity" && activity == "DNBRobotMotionActivity" => {
                let place = Place { pose, ..Place::of_joints(joints.clone()) };
                match kind.as_str() {
                    "Joint" => s.events.push(Event::Joint(place)),
                    "Linear" => s.linear(place),
                    "CircularVia" => s.via = Some(place),
                    "Circular" => {
                        let via = s.via.take().ok_or("an arc without its middle")?;
                        s.arc(via, place);
                    }
                    other => return Err(format!("motion {other}")),
                }
            }
            Node::Close(_) => {}
        }
    }
    Ok(s.events)
}
