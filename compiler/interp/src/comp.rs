#![allow(dead_code, clippy::unused_self)]

use gr_canon::Sink;

use crate::{Interp, Res};

impl<S: Sink> Interp<'_, S> {
    pub(crate) fn convert_straight_comp1(&mut self, _g: i16, _end: gr_canon::Axes) -> Res {
        Ok(())
    }
    pub(crate) fn convert_straight_comp2(&mut self, _g: i16, _end: gr_canon::Axes) -> Res {
        Ok(())
    }
    pub(crate) fn comp_on(&mut self, _g: i16) -> Res {
        Ok(())
    }
    pub(crate) fn comp_off(&mut self) -> Res {
        Ok(())
    }
}
