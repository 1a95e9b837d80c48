//! Calls held back while cutter compensation looks ahead.

use gr_canon::{Call, Sink};

use crate::Interp;
use crate::run::Place;

/// Calls held back, each with the place that asked for it.
#[derive(Clone, Debug, Default)]
pub struct Queue {
    calls: Vec<(Call, Place)>,
}

impl Queue {
    /// Nothing is held back.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.calls.is_empty()
    }
    /// Holds a call back.
    pub fn push(&mut self, call: Call, place: Place) {
        self.calls.push((call, place));
    }
    /// Forgets everything (`qc_reset` of a restart).
    pub fn clear(&mut self) {
        self.calls.clear();
    }
}

impl<S: Sink> Interp<'_, S> {
    /// Sends everything that is held back.
    pub(crate) fn dequeue_all(&mut self) {
        for (call, place) in std::mem::take(&mut self.queue.calls) {
            self.emit_at(place, &call);
        }
    }
    /// G20/G21 while compensation holds moves back.
    pub(crate) fn scale_queue(&mut self, _factor: f64) {}
}
