//! Frames: G5x and G92 offsets, rotation, G10 L2/L20, G28 and G30.

use gr_canon::{Axes, Call, Sink, Units};
use gr_spec::{code, rs274};

use crate::block::AXIS_LETTERS;
use crate::eval::to_int;
use crate::exec::not_with_comp;
use crate::motion::{rotate, turn_of, unwrap_rotary};
use crate::{Fault, Interp, Res};

/// Machine units per millimetre of an inch machine, as the real `rs274` has it.
const INCH_MACHINE: f64 = 0.039_370_078_740_16;

fn rotate_xy(axes: &mut Axes, degrees: f64) {
    let [x, y, ..] = axes;
    rotate(x, y, degrees);
}

impl<S: Sink> Interp<'_, S> {
    fn machine_per_mm(&self) -> f64 {
        if self.setup.machine_units == Units::Inch { INCH_MACHINE } else { 1.0 }
    }
    fn mm_per_program(&self) -> f64 {
        if self.m.units == Units::Inch as u8 { 25.4 } else { 1.0 }
    }
    /// A length of the tool table or of a stored parameter, in program units.
    pub(crate) fn program_length(&self, machine: f64) -> f64 {
        machine / self.machine_per_mm() / self.mm_per_program()
    }
    /// A length in program units as the machine stores it.
    pub(crate) fn machine_length(&self, program: f64) -> f64 {
        program * self.mm_per_program() * self.machine_per_mm()
    }
    /// Stored values of all axes, in program units.
    pub(crate) fn program_axes(&self, machine: &Axes) -> Axes {
        std::array::from_fn(|i| if (3..6).contains(&i) { machine[i] } else { self.program_length(machine[i]) })
    }
    /// Values of all axes as the machine stores them.
    pub(crate) fn machine_axes(&self, program: &Axes) -> Axes {
        std::array::from_fn(|i| if (3..6).contains(&i) { program[i] } else { self.machine_length(program[i]) })
    }
    fn raw_stored(&mut self, base: u32) -> Axes {
        std::array::from_fn(|i| {
            let index = base + 1 + i as u32;
            if let Some(log) = &mut self.log {
                log.read(index);
            }
            self.params.get(index)
        })
    }
    /// The nine values stored after `base`, in program units.
    pub(crate) fn stored_offset(&mut self, base: u32) -> Axes {
        let raw = self.raw_stored(base);
        self.program_axes(&raw)
    }
    fn store_axes(&mut self, base: u32, values: &Axes) {
        for (i, v) in self.machine_axes(values).iter().enumerate() {
            self.write_param(base + 1 + i as u32, *v);
        }
    }
    fn stored_rotation(&mut self, system: u32) -> f64 {
        let index = 5210 + system * 20;
        if let Some(log) = &mut self.log {
            log.read(index);
        }
        self.params.get(index)
    }

    /// What the start of a run takes from the stored parameters.
    pub(crate) fn start_modal(&mut self) {
        let index = to_int(self.params.get(5220) + 0.0001);
        let index = if (1..=9).contains(&index) {
            index
        } else {
            self.params.set(5220, 1.0);
            1
        };
        let base = 5200 + 20 * index as u32;
        self.m.origin_index = index;
        self.m.origin = self.stored_offset(base);
        if self.config.no_g92_persistence {
            for i in 5210..5220 {
                self.params.set(i, 0.0);
            }
        }
        self.m.g92 = if self.params.get(5210) != 0.0 { self.stored_offset(5210) } else { [0.0; 9] };
        // With G92 switched off for the next start the controller reads the rotation from a wrong place.
        let rotation = if self.config.no_g92_persistence { 5230 } else { base + 10 };
        self.m.rotation = self.params.get(rotation);
        self.params.set(5599, 1.0);
        self.set_tool_parameters();
    }

    /// Where the machine stands when a run begins: with stored offsets that is another point of the work frame. The
    /// real `rs274` leaves a stored rotation out of account there.
    pub(crate) fn start_where_it_stands(&mut self) {
        self.m.current = [0.0; 9];
        if self.is_rs274() {
            self.m.current[..6].copy_from_slice(&self.world.position);
            return;
        }
        self.m.current = self.program_axes(&self.setup.start);
        self.arrive_at_origin();
        for i in 0..9 {
            self.m.current[i] -= self.m.g92[i];
        }
        self.world.position.copy_from_slice(&self.m.current[..6]);
        self.world.short = self.setup.probe_short;
    }

    /// From the active frame to machine coordinates without tool offset: origin added.
    pub(crate) fn leave_origin(&mut self) {
        rotate_xy(&mut self.m.current, self.m.rotation);
        for i in 0..9 {
            self.m.current[i] += self.m.origin[i];
        }
    }
    /// The way back with the new origin and rotation.
    pub(crate) fn arrive_at_origin(&mut self) {
        for i in 0..9 {
            self.m.current[i] -= self.m.origin[i];
        }
        rotate_xy(&mut self.m.current, -self.m.rotation);
    }

    /// The present point in machine coordinates, in program units.
    pub(crate) fn machine_position(&self) -> Axes {
        let m = &self.m;
        let mut at: Axes = std::array::from_fn(|i| m.current[i] + m.g92[i]);
        rotate_xy(&mut at, m.rotation);
        std::array::from_fn(|i| at[i] + m.origin[i] + m.tool_offset[i])
    }

    /// The present point seen from another work offset.
    pub(crate) fn current_in_system(&mut self, system: u32, with_tool: bool) -> Axes {
        let m = &self.m;
        let mut at: Axes = std::array::from_fn(|i| m.current[i] + m.g92[i]);
        rotate_xy(&mut at, m.rotation);
        for i in 0..9 {
            at[i] += self.m.origin[i];
            if with_tool {
                at[i] += self.m.tool_offset[i];
            }
        }
        let offset = self.stored_offset(5200 + system * 20);
        for i in 0..9 {
            at[i] -= offset[i];
        }
        let rotation = self.stored_rotation(system);
        rotate_xy(&mut at, -rotation);
        if self.read_applied() {
            let g92 = self.stored_offset(5210);
            for i in 0..9 {
                at[i] -= g92[i];
            }
        }
        at
    }

    pub(crate) fn read_applied(&mut self) -> bool {
        if let Some(log) = &mut self.log {
            log.read(5210);
        }
        self.params.get(5210) != 0.0
    }

    /// A point of the machine frame in the active frame.
    pub(crate) fn find_relative(&self, at: &Axes) -> Res<Axes> {
        let m = &self.m;
        let mut to: Axes = std::array::from_fn(|i| at[i] - m.origin[i] - m.tool_offset[i]);
        rotate_xy(&mut to, -m.rotation);
        to[0] -= m.g92[0];
        to[1] -= m.g92[1];
        to[2] = at[2] - m.origin[2] - m.g92[2] - m.tool_offset[2];
        for i in 3..6 {
            to[i] = if self.config.wrapped[i - 3] {
                let plain = at[i] - m.origin[i] - m.g92[i] - m.tool_offset[i];
                unwrap_rotary(at[i], plain, m.current[i], ['A', 'B', 'C'][i - 3])?
            } else {
                at[i] - m.origin[i] - m.g92[i]
            };
        }
        for i in 6..9 {
            to[i] = at[i] - m.origin[i] - m.g92[i] - m.tool_offset[i];
        }
        Ok(to)
    }

    /// G54 … G59.3.
    pub(crate) fn convert_coordinate_system(&mut self, g: i16) -> Res {
        not_with_comp(self.m.comp_side, rs274::RT_COMP_COORD_SYSTEM, "a change of the work offset")?;
        let system = if g <= 590 { (g - 530) / 10 } else { g - 584 };
        if i32::from(system) == self.m.origin_index {
            self.remark("interpreter: continuing to use same coordinate system");
            return Ok(());
        }
        let system = system as u32;
        self.m.current = self.current_in_system(system, false);
        self.m.origin_index = system as i32;
        self.write_param(5220, f64::from(system));
        self.m.origin = self.stored_offset(5200 + system * 20);
        self.m.rotation = self.stored_rotation(system);
        self.emit(Call::SetG5xOffset(system as u8, self.m.origin));
        self.emit(Call::SetG92Offset(self.m.g92));
        self.emit(Call::SetXyRotation(self.m.rotation));
        Ok(())
    }

    fn check_wrapped_words(&self) -> Res {
        for i in 3..6 {
            let Some(v) = self.block.get(AXIS_LETTERS[i]) else { continue };
            if self.config.wrapped[i - 3] && (v <= -360.0 || v >= 360.0) {
                let axis = ['A', 'B', 'C'][i - 3];
                let fault = Fault::new(code::AXIS_WRAPPED, rs274::RT_WRAPPED_AXIS);
                return Err(fault.arg(format!("{v:5.2}")).arg(axis).at(AXIS_LETTERS[i]));
            }
        }
        Ok(())
    }

    /// G52, G92, G92.1, G92.2, G92.3.
    pub(crate) fn convert_axis_offsets(&mut self, g: i16) -> Res {
        not_with_comp(self.m.comp_side, rs274::RT_COMP_AXIS_OFFSETS, "a change of the axis offsets")?;
        self.check_wrapped_words()?;
        if g == 920 {
            self.rests_on_probed();
        }
        let fanuc = self.is_fanuc();
        match g {
            520 | 920 => {
                self.write_param(5210, 1.0);
                for (i, letter) in AXIS_LETTERS.iter().enumerate() {
                    let Some(v) = self.block.get(*letter) else { continue };
                    let m = &mut self.m;
                    if g == 520 {
                        // LinuxCNC has one shift for both; a Fanuc control adds the two.
                        let shift = if fanuc { m.g92[i] - m.g52[i] + v } else { v };
                        m.current[i] += m.g92[i] - shift;
                        (m.g92[i], m.g52[i]) = (shift, v);
                    } else {
                        m.g92[i] = m.current[i] + m.g92[i] - v;
                        m.current[i] = v;
                        m.g52[i] = 0.0;
                    }
                }
                self.emit(Call::SetG92Offset(self.m.g92));
                let g92 = self.m.g92;
                self.store_axes(5210, &g92);
            }
            921 | 922 => {
                self.write_param(5210, 0.0);
                for i in 0..9 {
                    self.m.current[i] += self.m.g92[i];
                }
                self.emit(Call::SetG92Offset([0.0; 9]));
                self.m.g92 = [0.0; 9];
                if g == 921 {
                    for i in 5211..=5219 {
                        self.write_param(i, 0.0);
                    }
                }
            }
            _ => {
                self.write_param(5210, 1.0);
                let stored = self.stored_offset(5210);
                for i in 0..9 {
                    self.m.current[i] = self.m.current[i] + self.m.g92[i] - stored[i];
                }
                self.m.g92 = stored;
                self.emit(Call::SetG92Offset(stored));
            }
        }
        Ok(())
    }

    /// G10 L2 and L20.
    pub(crate) fn convert_setup(&mut self) -> Res {
        let b = &self.block;
        let l20 = to_int(b.or_minus_one(b'l')) == 20;
        if b.has(b'i') || b.has(b'j') {
            return Err(Fault::new(code::TOOL_OFFSET, rs274::RT_G10_IJ).arg("G10 L2 takes no I or J").at(if b.has(b'i') { b'i' } else { b'j' }));
        }
        let p = to_int(b.or_minus_one(b'p') + 0.0001);
        let system = if p == 0 { self.m.origin_index } else { p } as u32;
        let active = system as i32 == self.m.origin_index;
        if l20 {
            self.check_wrapped_words()?;
            self.rests_on_probed();
        }
        if active {
            not_with_comp(self.m.comp_side, rs274::RT_COMP_ACTIVE_SYSTEM, "a change of the active work offset")?;
        }
        let base = 5200 + system * 20;
        let here = self.current_in_system(system, false);
        let rotation = match self.block.get(b'r') {
            Some(_) if l20 => return Err(Fault::new(code::TOOL_OFFSET, rs274::RT_G10_L20_R).arg("G10 L20 takes no R").at(b'r')),
            Some(r) => {
                self.write_param(base + 10, r);
                r
            }
            None => self.stored_rotation(system),
        };
        let mut to = self.stored_offset(base);
        if l20 {
            let (mut old_x, mut old_y) = (here[0], here[1]);
            let mut x = self.block.get(b'x').unwrap_or(here[0]);
            let mut y = self.block.get(b'y').unwrap_or(here[1]);
            rotate(&mut old_x, &mut old_y, rotation);
            rotate(&mut x, &mut y, rotation);
            to[0] = old_x + to[0] - x;
            to[1] = old_y + to[1] - y;
            let stored = self.machine_axes(&to);
            self.write_param(base + 1, stored[0]);
            self.write_param(base + 2, stored[1]);
            if active {
                rotate_xy(&mut self.m.current, self.m.rotation);
                self.m.rotation = 0.0;
            }
        }
        for (i, letter) in AXIS_LETTERS.iter().enumerate() {
            let Some(v) = self.block.get(*letter) else { continue };
            if l20 && i < 2 {
                continue;
            }
            to[i] = if l20 { here[i] + to[i] - v } else { v };
            let stored = self.machine_axes(&to)[i];
            self.write_param(base + 1 + i as u32, stored);
        }
        if !active {
            self.emit_queued(Call::StoreG5xOffset(system as u8, to, rotation));
            return Ok(());
        }
        self.leave_origin();
        self.m.origin = to;
        for i in 0..9 {
            self.m.current[i] -= to[i];
        }
        self.emit(Call::SetG5xOffset(system as u8, to));
        rotate_xy(&mut self.m.current, -rotation);
        self.m.rotation = rotation;
        self.emit(Call::SetXyRotation(rotation));
        Ok(())
    }

    /// G28, G30.
    pub(crate) fn convert_home(&mut self, g: i16) -> Res {
        match self.m.loose {
            0 => {}
            _ if self.has_axes() => self.leaves_probed(true),
            // The first of its two moves is to where the machine stands.
            _ => self.rests_on_probed(),
        }
        let mut end = self.find_ends()?;
        not_with_comp(self.m.comp_side, rs274::RT_COMP_G28, "G28 or G30")?;
        match self.has_axes() {
            true => self.park(true),
            false => self.m.parked = 0b111,
        }
        self.index_before(&end);
        self.emit(Call::StraightTraverse(end));
        self.m.current = end;
        let stored = self.stored_offset(if g == 280 { 5160 } else { 5180 });
        let home = self.find_relative(&stored)?;
        if self.has_axes() {
            for (i, letter) in AXIS_LETTERS.iter().enumerate() {
                if self.block.has(*letter) {
                    end[i] = home[i];
                }
            }
        } else {
            end = home;
        }
        self.index_before(&end);
        self.emit(Call::StraightTraverse(end));
        self.m.current = end;
        Ok(())
    }

    /// G28.1, G30.1.
    pub(crate) fn convert_save_home(&mut self, g: i16) -> Res {
        not_with_comp(self.m.comp_side, rs274::RT_COMP_SAVEHOME, "setting a reference point")?;
        self.rests_on_probed();
        let mut at = self.machine_position();
        for i in 3..6 {
            if self.config.wrapped[i - 3] {
                at[i] = turn_of(at[i]);
            }
        }
        self.store_axes(if g == 281 { 5160 } else { 5180 }, &at);
        Ok(())
    }
}
