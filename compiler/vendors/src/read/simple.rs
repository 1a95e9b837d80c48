//! State and small steps that the readers of one-file languages share.

use super::{Configuration, Event, Place};
use gr_machine::math::Frame;

/// Events so far, and what is in force.
pub(crate) struct State {
    pub events: Vec<Event>,
    pub tool: Option<Frame>,
    pub frame: Option<Frame>,
    pub speed: f64,
    pub zone: Option<f64>,
    /// The corner distance that zones take where moves only say that there is one.
    pub distance: f64,
    /// The first point of an arc given in two statements.
    pub via: Option<Place>,
}

impl State {
    pub(crate) fn new() -> State {
        State { events: Vec::new(), tool: None, frame: None, speed: 0.0, zone: None, distance: 0.0, via: None }
    }
    pub(crate) fn place(&self, pose: Frame, configuration: Configuration) -> Place {
        Place::of_pose(pose, configuration, self.tool, self.frame)
    }
    pub(crate) fn joint(&mut self, joints: Vec<f64>) {
        self.events.push(Event::Joint(Place::of_joints(joints)));
    }
    pub(crate) fn linear(&mut self, place: Place) {
        self.events.push(Event::Linear(place, self.speed, self.zone));
    }
    pub(crate) fn arc(&mut self, via: Place, to: Place) {
        self.events.push(Event::Arc(via, to, self.speed, self.zone));
    }
    pub(crate) fn set(&mut self, name: impl ToString, value: f64) {
        self.events.push(Event::Set(name.to_string(), value));
    }
}

/// Number of a signal as text, from the first number of a statement.
pub(crate) fn signal(text: &str) -> String {
    text.chars().skip_while(|c| !c.is_ascii_digit()).take_while(char::is_ascii_digit).collect()
}
