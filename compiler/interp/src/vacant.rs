//! Variables of Fanuc's custom macro: a variable is *vacant* until it is set, and `#0` always is. (Fanuc Series 16i/18i,
//! B-63684, and 0i/30i, B-64484, custom macro: undefined variable.)
//!
//! In the tables of parameters, where everything begins as 0, 0 stands for vacant and a mark of its own for the number
//! 0; so a run needs no other start than LinuxCNC's. On the way through an expression it is the other way around.

use gr_canon::Sink;
use gr_gcode::{Binary, Unary};
use gr_spec::{code, rs274};

use crate::{Fault, Interp, Res};

/// A number that no arithmetic gives and that is 0 for every practical purpose.
const MARK: f64 = f64::from_bits(0x5641_4341_4E54);

/// Vacant, while an expression is worked out.
pub(crate) const VACANT: f64 = MARK;

pub(crate) fn is_vacant(value: f64) -> bool {
    value.to_bits() == MARK.to_bits()
}

/// Vacant counts as 0 wherever a number is needed.
#[inline]
pub(crate) fn number(value: f64) -> f64 {
    if is_vacant(value) { 0.0 } else { value }
}

/// A value as the table of parameters keeps it.
pub(crate) fn stored(value: f64) -> f64 {
    if is_vacant(value) {
        0.0
    } else if value == 0.0 {
        MARK
    } else {
        value
    }
}

/// Local and common variables, which are vacant at first.
fn may_be_vacant(index: i32) -> bool {
    matches!(index, 1..=33 | 100..=199 | 500..=999)
}

/// What two operands give of which one is vacant; none: count it as 0.
pub(crate) fn compared(op: Binary, a: f64, b: f64) -> Option<f64> {
    let same = is_vacant(a) == is_vacant(b);
    match op {
        Binary::Eq if !same => Some(0.0),
        Binary::Ne if !same => Some(1.0),
        _ => None,
    }
}

/// Roundings that differ from LinuxCNC's; a sign leaves a vacant variable vacant.
pub(crate) fn function(op: Unary, x: f64) -> Option<f64> {
    match op {
        Unary::Negate if is_vacant(x) => Some(x),
        Unary::Fix => Some(libm::trunc(number(x))),
        Unary::Fup if number(x) < 0.0 => Some(libm::floor(x)),
        _ => None,
    }
}

impl<S: Sink> Interp<'_, S> {
    /// Number of a variable that is read.
    pub(crate) fn variable_index(&self, index: i32) -> Res<i32> {
        match index {
            0 => Ok(0),
            _ if may_be_vacant(index) => Ok(index),
            // On a lathe they would be diameters, or not, as the control is set.
            5001..=5006 | 5021..=5026 if !crate::fanuc::is_lathe(self.setup.dialect) => Ok(index),
            5221..=5326 if matches!((index - 5221) % 20, 0..=5) => Ok(index),
            ..=999 => {
                let instead = "use #1 to #33, #100 to #199 or #500 to #999";
                Err(self.not_in_dialect(&format!("variable #{index}"), instead))
            }
            _ => Err(Fault::new(code::CODE_NOT_CARRIED_OUT, rs274::SILENT).arg(format!("#{index}")).arg("System variable")),
        }
    }

    /// Number of a variable that is set.
    pub(crate) fn variable_target(&self, index: i32) -> Res<i32> {
        let name = format!("#{index}");
        match self.variable_index(index)? {
            0 | 5001..=5026 => Err(Fault::new(code::PARAMETER_READ_ONLY, rs274::RT_PARAMETER_READONLY).arg(name)),
            // A Fanuc control moves its work frame at once, LinuxCNC with the next G54 … G59.
            5221.. => {
                let name = format!("{name} as a target");
                Err(Fault::new(code::CODE_NOT_CARRIED_OUT, rs274::SILENT).arg(name).arg("work offset"))
            }
            index => Ok(index),
        }
    }

    /// Value of a variable; vacant ones give [`VACANT`].
    pub(crate) fn read_variable(&mut self, index: i32) -> f64 {
        match index {
            0 => return VACANT,
            5001..=5006 => return self.m.current[(index - 5001) as usize],
            5021..=5026 => return self.machine_position()[(index - 5021) as usize],
            _ => {}
        }
        if let Some(log) = &mut self.log {
            log.read(index as u32);
        }
        let stored = self.params.get(index as u32);
        match may_be_vacant(index) {
            true if stored == 0.0 => VACANT,
            true => number(stored),
            false => stored,
        }
    }

    /// Sets a variable.
    pub(crate) fn write_variable(&mut self, index: u32, value: f64) {
        self.write_param(index, stored(value));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mark_counts_as_nothing() {
        assert!(MARK > 0.0 && MARK < f64::MIN_POSITIVE);
        assert_eq!((number(VACANT), 1.0 + MARK, number(2.0)), (0.0, 1.0, 2.0));
        assert_eq!(function(Unary::Fix, -1.2), Some(-1.0));
        assert_eq!(function(Unary::Fup, -1.2), Some(-2.0));
        assert_eq!(compared(Binary::Eq, VACANT, 0.0), Some(0.0));
        assert_eq!(compared(Binary::Ge, VACANT, 0.0), None);
    }
}
