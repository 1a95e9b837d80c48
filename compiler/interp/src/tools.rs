//! Tools: T, M6, M61, length offsets, G10 L0, L1, L10, L11.

use gr_canon::{Axes, Call, Mark, Sink, Version};
use gr_spec::{code, rs274};

use crate::block::{AXES, AXIS_LETTERS, Group, letters};
use crate::eval::{nearest_int, to_int};
use crate::exec::not_with_comp;
use crate::motion::rotate;
use crate::remap::step;
use crate::{Fault, Interp, Res, Tool};

fn no_tool() -> Tool {
    Tool { number: -1, pocket: -1, ..Tool::default() }
}

fn near_int(value: f64) -> (i32, bool) {
    let n = to_int(value + 0.5);
    (n, (f64::from(n) - value).abs() < 0.0001)
}

impl<S: Sink> Interp<'_, S> {
    /// The tool in a pocket of the interpreter's table.
    pub(crate) fn tool(&self, index: i32) -> Tool {
        usize::try_from(index).ok().and_then(|i| self.tools.get(i)).cloned().unwrap_or_else(no_tool)
    }

    /// Index of the pocket that holds a tool: the spindle's row counts last, tool 0 is no tool.
    pub(crate) fn find_tool(&self, number: i32, letter: u8) -> Res<i32> {
        if number == 0 {
            return Ok(0);
        }
        let tools = &self.world_tools;
        let found = match number {
            -1 => None,
            _ => tools
                .pockets()
                .iter()
                .position(|t| t.number == number)
                .map(|i| i + 1)
                .or_else(|| tools.get(0).filter(|t| t.number == number).map(|_| 0)),
        };
        match found {
            Some(index) => Ok(index as i32),
            None => Err(Fault::new(code::TOOL_NOT_FOUND, rs274::RT_TOOL_NOT_FOUND).arg(number).at(letter)),
        }
    }

    /// T.
    pub(crate) fn convert_tool_select(&mut self) -> Res {
        let mut number = to_int(self.block.or_zero(b't'));
        // T0101 of a lathe is tool 1 with offset 1: the turret turns, and the offset is in force.
        let lathe = crate::fanuc::is_lathe(self.setup.dialect);
        let offset = (lathe && number >= 100).then_some(number % 100);
        if offset.is_some() {
            number /= 100;
        }
        let index = self.find_tool(number, b't')?;
        self.emit(Call::SelectTool(number));
        self.m.selected_pocket = index;
        self.m.selected_tool = number;
        let Some(offset) = offset else { return Ok(()) };
        if self.world_tools.get(0).is_none_or(|t| t.number != number) {
            self.convert_tool_change()?;
        }
        if offset == 0 {
            return self.convert_tool_length(490);
        }
        let h = self.block.get(b'h');
        self.block.set(b'h', f64::from(offset));
        let done = self.convert_tool_length(430);
        match h {
            Some(h) => self.block.set(b'h', h),
            None => self.block.unset(b'h'),
        }
        done
    }

    /// M6.
    pub(crate) fn convert_tool_change(&mut self) -> Res {
        if self.m.selected_pocket < 0 {
            return Err(Fault::new(code::TOOL_CHANGE, rs274::RT_TOOL_NOT_PREPARED).arg("no tool is selected by T"));
        }
        not_with_comp(self.m.comp_side, rs274::RT_COMP_TOOL_CHANGE, "a tool change")?;
        if self.setup.version == Version::V2_9 {
            self.emit(Call::StartChange);
        }
        // A turret turns while the spindle does.
        if !self.config.change_with_spindle_on && !crate::fanuc::is_lathe(self.setup.dialect) {
            for s in 0..self.config.spindles {
                self.emit(Call::StopSpindleTurning(s));
                self.m.turning[s as usize] = 0;
            }
        }
        if self.config.change_quill_up {
            let up = self.find_relative(&[0.0; 9])?[2];
            let mut to = self.m.current;
            to[2] = up;
            self.hidden_move(to);
            self.m.current[2] = up;
        }
        if self.config.change_at_g30 {
            let stored = self.stored_offset(5180);
            let to = self.find_relative(&stored)?;
            self.hidden_move(to);
            self.m.current = to;
        }
        let pocket = self.m.selected_pocket;
        self.emit(Call::ChangeTool(pocket));
        // The machine puts the tool into the spindle's row; the interpreter hears of it with the next block.
        let tool = usize::try_from(pocket).ok().and_then(|i| self.world_tools.get(i)).cloned();
        let before = self.in_spindle();
        self.world_tools.load(tool.unwrap_or_else(no_tool));
        if self.length_in_force(before) {
            self.mark(&Mark::LengthInForce);
        }
        self.m.pocket = pocket;
        self.m.tool_changed = 1;
        self.set_tool_parameters();
        Ok(())
    }

    /// Number of the tool that the machine has in the spindle, 0 = none.
    fn in_spindle(&self) -> i32 {
        self.world_tools.get(0).map_or(0, |t| t.number.max(0))
    }

    /// Whether the tool that is now in the spindle, after tool `before`, needs no G43: the offset in force was set for it, or
    /// is what the table has of it. Of rows that are only assumed nobody knows a length.
    fn length_in_force(&self, before: i32) -> bool {
        let (m, now) = (&self.m, if self.m.selected_tool == 0 { 0 } else { self.in_spindle() });
        if now == 0 {
            return m.tool_offset == [0.0; 9];
        }
        let kept = m.length_of == now || (before == now && m.length_set_with == now);
        let known = self.world_tools.get(0).filter(|t| &*t.comment != crate::ASSUMED);
        kept || known.is_some_and(|t| self.program_axes(&t.offset) == m.tool_offset)
    }

    fn hidden_move(&mut self, to: Axes) {
        self.emit(Call::Comment("AXIS,hide".into()));
        self.index_before(&to);
        self.emit(Call::StraightTraverse(to));
        self.emit(Call::Comment("AXIS,show".into()));
    }

    /// M61.
    pub(crate) fn convert_tool_number(&mut self) -> Res {
        let number = nearest_int(self.block.or_minus_one(b'q'));
        if number < 0 {
            return Err(Fault::new(code::TOOL_CHANGE, rs274::RT_M61_Q).arg("M61 needs a Q word that is zero or more").at(b'm'));
        }
        let index = self.find_tool(number, b'q')?;
        self.m.pocket = index;
        self.m.tool_changed = 1;
        self.emit(Call::ChangeToolNumber(index, number));
        self.set_tool_parameters();
        Ok(())
    }

    /// Takes over the machine's table.
    pub(crate) fn load_tool_table(&mut self) {
        self.tools = self.world_tools.clone();
        self.set_tool_parameters();
    }

    /// #5400 … #5413.
    pub(crate) fn set_tool_parameters(&mut self) {
        let tool = self.tool(0);
        let none = !self.config.random && tool.number <= 0;
        let (tool, number) = if none { (no_tool(), 0) } else { (tool.clone(), tool.number) };
        self.tool_to_parameters(&tool, number);
    }

    fn tool_to_parameters(&mut self, tool: &Tool, number: i32) {
        self.write_param(5400, f64::from(number));
        for i in 0..9 {
            self.write_param(5401 + i as u32, tool.offset[i]);
        }
        self.write_param(5410, tool.diameter);
        self.write_param(5411, tool.front_angle);
        self.write_param(5412, tool.back_angle);
        self.write_param(5413, f64::from(tool.orientation));
    }

    /// G43, G43.1, G43.2, G49.
    pub(crate) fn convert_tool_length(&mut self, g: i16) -> Res {
        not_with_comp(self.m.comp_side, rs274::RT_COMP_TOOL_OFFSET, "a change of the tool offset")?;
        let h = self.block.get(b'h').map(to_int);
        let mut offset: Axes = [0.0; 9];
        let mut length_of = 0;
        // Offset number 0 of a Fanuc control is no offset; in LinuxCNC it is the tool in the spindle.
        let off = g == 490 || g == 430 && h == Some(0) && self.is_fanuc();
        match g {
            _ if off => {}
            430 => {
                let index = match h {
                    Some(h) => match self.find_tool(h, b'h')? {
                        0 if self.config.random => self.m.pocket,
                        index => index,
                    },
                    None if self.m.tool_changed != 0 => self.m.pocket,
                    None => 0,
                };
                let tool = self.tool(index);
                (offset, length_of) = (self.program_axes(&tool.offset), tool.number.max(0));
            }
            431 => {
                offset = self.m.tool_offset;
                for (i, letter) in AXIS_LETTERS.iter().enumerate() {
                    if let Some(v) = self.block.get(*letter) {
                        offset[i] = v;
                    }
                }
            }
            432 => offset = self.added_tool_length(h)?,
            _ => {}
        }
        let number = h.filter(|_| matches!(g, 430 | 432)).and_then(|h| u32::try_from(h).ok());
        self.emit(Call::UseToolLengthOffset(offset, number));
        let loaded = self.in_spindle();
        let m = &mut self.m;
        let mut change: Axes = std::array::from_fn(|i| m.tool_offset[i] - offset[i]);
        let [x, y, ..] = &mut change;
        rotate(x, y, -m.rotation);
        for i in 0..9 {
            m.current[i] += change[i];
        }
        m.tool_offset = offset;
        m.length_of = length_of;
        m.length_set_with = if off { 0 } else { loaded };
        m.length_on = u8::from(g != 490);
        // 2.10 shows the offset that applies, not the loaded tool's.
        if self.setup.version == Version::V2_10 {
            let stored = self.machine_axes(&offset);
            for (i, value) in stored.into_iter().enumerate() {
                self.write_param(5401 + i as u32, value);
            }
        }
        Ok(())
    }

    fn added_tool_length(&mut self, h: Option<i32>) -> Res<Axes> {
        let axes = self.block.has_any_of(AXES);
        if h.is_some() && axes {
            return Err(Fault::new(code::TOOL_OFFSET, rs274::RT_G432_BOTH).arg("G43.2 takes either H or axis words"));
        }
        if h.is_none() && !axes {
            return Err(Fault::new(code::TOOL_OFFSET, rs274::RT_G432_NONE).arg("G43.2 needs H or axis words"));
        }
        // Even without H the controller looks up the tool of the last H word.
        let number = h.unwrap_or_else(|| to_int(self.last_h()));
        let index = self.find_tool(number, b'h')?;
        let mut offset = self.m.tool_offset;
        if h.is_some() {
            let more = self.program_axes(&self.tool(index).offset);
            for i in 0..9 {
                offset[i] += more[i];
            }
        } else {
            for (i, letter) in AXIS_LETTERS.iter().enumerate() {
                offset[i] += self.block.or_zero(*letter);
            }
        }
        Ok(offset)
    }

    fn last_h(&self) -> f64 {
        -1.0
    }

    /// G10 L0.
    pub(crate) fn reload_tools(&mut self) -> Res {
        let number = self.tool(0).number;
        if number > 0 {
            let fault = Fault::new(code::TOOL_OFFSET, rs274::RT_G10_L0_TOOL).arg(number);
            return Err(fault.named(format!("G10 L0 needs an empty spindle; tool {number} is in it")));
        }
        self.m.tool_changed = 1;
        self.emit(Call::ReloadTooldata);
        Ok(())
    }

    /// G10 L1, L10, L11.
    pub(crate) fn convert_setup_tool(&mut self) -> Res {
        const NEEDED: u32 = AXES | letters(b"rqij");
        let l = to_int(self.block.or_minus_one(b'l'));
        let (number, _) = near_int(self.block.or_minus_one(b'p'));
        let index = self.find_tool(number, b'p')?;
        if !self.block.has_any_of(NEEDED) {
            return Err(Fault::new(code::TOOL_OFFSET, rs274::RT_G10_L1_EMPTY).arg("G10 L1 sets nothing"));
        }
        let mut tool = self.tool(index);
        if l == 1 {
            for (i, letter) in AXIS_LETTERS.iter().enumerate() {
                if let Some(v) = self.block.get(*letter) {
                    tool.offset[i] = if (3..6).contains(&i) { v } else { self.machine_length(v) };
                }
            }
        } else {
            self.touch_off(&mut tool, l == 11);
        }
        if let Some(r) = self.block.get(b'r') {
            tool.diameter = self.machine_length(r) * 2.0;
        }
        if let Some(i) = self.block.get(b'i') {
            tool.front_angle = i;
        }
        if let Some(j) = self.block.get(b'j') {
            tool.back_angle = j;
        }
        let q = self.block.or_minus_one(b'q');
        if q != -1.0 {
            let (n, near) = near_int(q);
            if !near {
                return Err(crate::check::bad_value(rs274::RT_G10_Q_INTEGER, "G10", 'Q'));
            }
            if n > 9 {
                return Err(crate::check::bad_value(rs274::RT_G10_ORIENTATION, "G10", 'Q'));
            }
            tool.orientation = n;
        }
        self.put_tool(index, tool);
        Ok(())
    }

    /// Offsets such that the present point reads as the words say.
    fn touch_off(&mut self, tool: &mut Tool, to_fixture: bool) {
        self.rests_on_probed();
        let system = if to_fixture { 9 } else { self.m.origin_index as u32 };
        let mut at = self.current_in_system(system, true);
        if to_fixture && self.read_applied() {
            let g92 = self.stored_offset(5210);
            for i in 0..9 {
                at[i] += g92[i];
            }
        }
        let turn = self.params.get(5210 + system * 20);
        let (x, y) = (self.block.get(b'x'), self.block.get(b'y'));
        let old = self.program_axes(&tool.offset);
        let (mut old_x, mut old_y) = (old[0], old[1]);
        let (mut tx, mut ty) = (at[0] - x.unwrap_or(0.0), at[1] - y.unwrap_or(0.0));
        if x.is_some() != y.is_some() {
            rotate(&mut old_x, &mut old_y, -turn);
            if x.is_some() { (old_x, ty) = (0.0, 0.0) } else { (old_y, tx) = (0.0, 0.0) }
            rotate(&mut old_x, &mut old_y, turn);
        } else {
            (old_x, old_y) = (0.0, 0.0);
        }
        if x.is_some() || y.is_some() {
            rotate(&mut tx, &mut ty, turn);
            tool.offset[0] = self.machine_length(tx + old_x);
            tool.offset[1] = self.machine_length(ty + old_y);
        }
        for i in 2..9 {
            if let Some(v) = self.block.get(AXIS_LETTERS[i]) {
                let d = at[i] - v;
                tool.offset[i] = if (3..6).contains(&i) { d } else { self.machine_length(d) };
            }
        }
    }

    fn put_tool(&mut self, index: i32, tool: Tool) {
        let call = |index: i32, t: &Tool| {
            Call::SetToolTableEntry(index, t.number, t.offset, t.diameter, t.front_angle, t.back_angle, t.orientation)
        };
        let loaded = !self.config.random && self.m.pocket == index;
        let rows: &[i32] = if loaded { &[index, 0] } else { &[index] };
        self.emit(call(index, &tool));
        for table in [&mut self.tools, &mut self.world_tools] {
            for row in rows.iter().filter_map(|r| usize::try_from(*r).ok()) {
                let pocket = table.get(row).map_or(tool.pocket, |t| if row == 0 { tool.pocket } else { t.pocket });
                table.put(row, Tool { pocket, ..tool.clone() });
            }
        }
        let spindle = self.tool(0);
        let number = match (self.config.random, spindle.number) {
            (true, n) if n >= 0 => n,
            (true, _) => -1,
            (false, n) if n > 0 => n,
            (false, _) => 0,
        };
        self.tool_to_parameters(&spindle, number);
        if loaded {
            self.emit(call(0, &tool));
        }
    }

    /// [RS274NGC]RETAIN_G43: the length offset follows the tool. The controller goes by whether there is an offset, not by
    /// what the block says: G49 and G43.1 are replaced as well, and the code then takes place as if the block had it.
    pub(crate) fn retain_length(&mut self) -> Res {
        let on = self.m.tool_offset.iter().any(|v| *v != 0.0);
        if !on || !self.block.once(step::RETAIN_G43) {
            return Ok(());
        }
        let code = if self.m.selected_pocket > 0 { 430 } else { 490 };
        let present = std::mem::take(&mut self.block.present);
        let done = self.convert_tool_length(code);
        self.block.present = present;
        self.block.set_g(Group::ToolLength as usize, code);
        done
    }
}
