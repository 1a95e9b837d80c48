//! What moves the tool point of a machine tool where the words of a program put it. How they put it there is `gr_robot::words`.

use crate::error::Sensitivity;
use gr_ir::View;
use gr_machine::math::{Frame, V3};
use gr_machine::{Kinematics, Machine};
pub(crate) use gr_robot::words::{Asked, Slides, Words, as_far_as_known, frame, put_down, rotary, slid, started, tool, unplaced};

/// What moves the tool point there.
pub(crate) fn sensitivity(slides: &Slides, machine: &Machine, kinematics: &dyn Kinematics, asked: &Asked) -> Option<Sensitivity> {
    let stand = slides.stand(machine, kinematics, asked)?;
    Sensitivity::new(machine, &stand.joints, stand.lever).ok()
}

/// Coordinates that a program for an arm has named so far: before that the arm stands where it happens to.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Named([bool; 3]);

impl Named {
    /// With the next operation: a coordinate is named when it changes, all of them by a cut.
    pub fn step(&mut self, view: &View<'_, '_>) -> [bool; 3] {
        for i in 0..3 {
            self.0[i] |= view.op.cuts() || (view.op.moves() && view.start.axes[i] != view.end.axes[i]);
        }
        self.0
    }
}

/// What the errors at a place depend on: point, tool and rotary words.
pub type ZeroKey = (V3, Frame, [f64; 3]);

pub(crate) fn key(asked: &Asked) -> ZeroKey {
    (asked.tip, asked.tool, asked.rotary)
}
