//! The turning cycle G90 and the facing cycle G94 of a Fanuc lathe (G-code system A): in, cut, out, back. Not the
//! multiple repetitive cycles G70 to G76, nor threading (G92). (Fanuc Series 0i/30i operator's manual, lathe system,
//! B-63944-1 and B-64484-1, canned cycle G90, G92, G94.)

use gr_canon::{Call, Mark, Sink};
use gr_spec::rs274;

use crate::block::Group;
use crate::{Interp, Res};

const X: usize = 0;
const Z: usize = 2;

/// Whether a motion of a lathe is one of the two cycles.
pub(crate) fn is_turning(motion: i16) -> bool {
    matches!(motion, 900 | 940)
}

impl<S: Sink> Interp<'_, S> {
    /// G90 or G94 in a block.
    pub(crate) fn take_turning_cycle(&mut self, g: i16) -> Res {
        let old = self.block.g(Group::Motion);
        if old != -1 {
            return Err(self.same_group('G', crate::check::code_name(old), crate::check::code_name(g)));
        }
        self.block.set_g(Group::Motion as usize, g);
        Ok(())
    }

    /// One pass of the cycle; the tool ends where it began.
    pub(crate) fn convert_turning(&mut self, g: i16) -> Res {
        if self.m.comp_side != 0 {
            let name = crate::check::code_name(g);
            return Err(self.not_carried_out(rs274::RT_UNKNOWN_G, format!("{name} with G41 or G42")).at(b'g'));
        }
        self.check_feed()?;
        let again = self.m.motion == i32::from(g);
        let start = self.m.current;
        let end = self.find_ends()?;
        // Words of the cycle hold until the next code of its group: the end of the last pass, where none is given now.
        let mut kept = if again { [self.m.cycle_i, self.m.cycle_j, self.m.cycle_k] } else { [start[X], start[Z], 0.0] };
        if self.block.has(b'x') {
            kept[0] = end[X];
        }
        if self.block.has(b'z') {
            kept[1] = end[Z];
        }
        if let Some(taper) = self.block.get(b'r') {
            kept[2] = taper;
        } else if !again {
            kept[2] = 0.0;
        }
        [self.m.cycle_i, self.m.cycle_j, self.m.cycle_k] = kept;
        let [x, z, taper] = kept;
        self.m.motion = i32::from(g);
        self.mark(&Mark::CycleBegin(i32::from(g)));
        let at = |x: f64, z: f64| {
            let mut point = start;
            (point[X], point[Z]) = (x, z);
            point
        };
        let (into, out) = match g {
            900 => (at(x + taper, start[Z]), at(start[X], z)),
            _ => (at(start[X], z + taper), at(x, start[Z])),
        };
        self.emit(Call::StraightTraverse(into));
        self.emit(Call::StraightFeed(at(x, z)));
        self.emit(Call::StraightFeed(out));
        self.emit(Call::StraightTraverse(start));
        self.mark(&Mark::CycleEnd);
        Ok(())
    }
}
