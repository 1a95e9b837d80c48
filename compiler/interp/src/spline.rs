#![allow(dead_code, clippy::unused_self)]

use gr_canon::Sink;

use crate::{Interp, Res};

impl<S: Sink> Interp<'_, S> {
    pub(crate) fn convert_spline(&mut self, _g: i16) -> Res {
        Ok(())
    }
}
