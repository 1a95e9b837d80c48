//! Execution: the fixed order in which the codes of one block take effect.

use gr_canon::{Axes, Call, Mark, PathMode, Plane, Sink, Units};
use gr_spec::{code, rs274};

use crate::block::{Group, letters};
use crate::eval::to_int;
use crate::remap::step;
use crate::{Fault, Interp, Res};

const FST: u32 = letters(b"fst");

/// Refuses a code while cutter compensation is on.
pub(crate) fn not_with_comp(on: u8, rs: gr_spec::Rs274, what: &str) -> Res {
    if on != 0 { Err(Fault::new(code::COMPENSATION_NOT_WHILE_ON, rs).arg(what)) } else { Ok(()) }
}

impl<S: Sink> Interp<'_, S> {
    /// Executes the block.
    #[inline]
    pub(crate) fn execute_block(&mut self) -> Res {
        let b = &self.block;
        let plain = b.g_mask & !(1 << 1) == 0 && b.m_count == 0 && b.remapped == 0 && self.comment.is_none();
        let plain = plain && !self.config.retain_g43;
        if plain && !b.has_any_of(FST) {
            let motion = b.motion;
            return if motion == -1 { Ok(()) } else { self.convert_motion(motion) };
        }
        self.execute_slow()
    }

    fn execute_slow(&mut self) -> Res {
        if self.block.remapped != 0 {
            return self.enter_remap();
        }
        self.execute_steps()
    }

    /// All steps that are not done yet. A remapped step calls its subroutine and leaves; the steps behind it
    /// follow when that returns.
    pub(crate) fn execute_steps(&mut self) -> Res {
        if self.comment.is_some() && self.block.once(step::COMMENT) {
            self.convert_comment()?;
        }
        if self.block.g(Group::SpindleMode) != -1 && self.block.once(step::SPINDLE_MODE) {
            self.select_spindle(rs274::RT_SPINDLE_MODE)?;
            self.convert_spindle_mode();
        }
        if self.block.g(Group::Feed) != -1 && self.block.once(step::FEED_MODE) {
            self.select_spindle(rs274::RT_SPINDLE_FEED)?;
            self.convert_feed_mode();
        }
        if self.block.has(b'f') && self.m.feed_mode != 1 && self.block.once(step::FEED) {
            if self.block.remapped & (1 << step::FEED) != 0 {
                return self.call_remap(step::FEED, 'F', -1);
            }
            let feed = self.block.or_zero(b'f');
            self.m.feed = feed;
            self.emit_queued(Call::SetFeedRate(feed));
        }
        if self.block.has(b's') && self.block.once(step::SPEED) {
            if self.block.remapped & (1 << step::SPEED) != 0 {
                return self.call_remap(step::SPEED, 'S', -1);
            }
            self.convert_speed()?;
        }
        if self.block.has(b't') && self.block.once(step::PREPARE) {
            if self.block.remapped & (1 << step::PREPARE) != 0 {
                return self.call_remap(step::PREPARE, 'T', -1);
            }
            self.convert_tool_select()?;
        }
        if (self.block.m_count != 0 || self.config.retain_g43) && self.convert_m()? {
            return Ok(());
        }
        if self.convert_g()? {
            return Ok(());
        }
        let stop = self.block.m[4];
        if stop != -1 && self.block.once(step::STOP) {
            if self.block.remapped & (1 << step::STOP) != 0 {
                return self.call_remap(step::STOP, 'M', stop.into());
            }
            self.convert_stop(stop)?;
        }
        if self.block.remapped != 0 && !self.remaps.is_empty() {
            return self.leave_remap();
        }
        Ok(())
    }

    fn convert_feed_mode(&mut self) {
        let before = self.m.feed_mode;
        match self.block.g(Group::Feed) {
            930 => {
                self.remark("interpreter: feed mode set to inverse time");
                self.m.feed_mode = 1;
                self.emit_queued(Call::SetFeedMode(0, 0));
                return;
            }
            940 => {
                self.remark("interpreter: feed mode set to units per minute");
                self.m.feed_mode = 0;
                self.emit_queued(Call::SetFeedMode(0, 0));
            }
            _ => {
                self.remark("interpreter: feed mode set to units per revolution");
                self.m.feed_mode = 2;
                self.emit_queued(Call::SetFeedMode(self.m.active_spindle, 1));
            }
        }
        // LinuxCNC forgets F also where the mode stays as it is; other controls do not (grbl 1.1, gcode.c; Fanuc: F is modal).
        if self.m.feed_mode == before && self.setup.dialect.family != gr_spec::Family::Linuxcnc {
            return;
        }
        self.m.feed = 0.0;
        self.emit_queued(Call::SetFeedRate(0.0));
    }

    /// The G-codes but for motion, in their order; then the motion. True: a remap took over.
    fn convert_g(&mut self) -> Res<bool> {
        if self.block.g_mask & !(1 << 1) != 0 {
            self.convert_modes()?;
        }
        if self.block.motion != -1 && self.block.once(step::MOTION) {
            let motion = self.block.motion;
            if self.block.remapped & (1 << step::MOTION) != 0 && self.is_user_g(motion) {
                self.call_remap(step::MOTION, 'G', motion.into())?;
                return Ok(true);
            }
            self.convert_motion(motion)?;
        }
        Ok(false)
    }

    fn todo(&mut self, group: Group, step: u32) -> Option<i16> {
        let g = self.block.g(group);
        (g != -1 && self.block.once(step)).then_some(g)
    }

    fn convert_modes(&mut self) -> Res {
        if self.block.g(Group::NonModal) == 40 && self.block.once(step::DWELL) {
            let seconds = self.block.or_minus_one(b'p');
            self.emit_queued(Call::Dwell(seconds));
        }
        if let Some(g) = self.todo(Group::Plane, step::PLANE) {
            self.convert_plane(g)?;
        }
        if let Some(g) = self.todo(Group::Units, step::UNITS) {
            self.convert_units(if g == 200 { Units::Inch } else { Units::Mm });
        }
        if let Some(g) = self.todo(Group::LatheDiameter, step::DIAMETER) {
            self.convert_diameter(g == 70);
        }
        if let Some(g) = self.todo(Group::CutterComp, step::COMP) {
            if g == 400 { self.comp_off()? } else { self.comp_on(g)? }
        }
        if let Some(g) = self.todo(Group::ToolLength, step::TOOL_LENGTH) {
            self.convert_tool_length(g)?;
        }
        if let Some(g) = self.todo(Group::CoordSystem, step::COORD_SYSTEM) {
            self.convert_coordinate_system(g)?;
        }
        if let Some(g) = self.todo(Group::PathControl, step::PATH) {
            let (p, q) = (self.block.or_minus_one(b'p'), self.block.or_minus_one(b'q'));
            // R chooses the planner in 2.10; in 2.9 it can only be a cycle's.
            let planner = self.block.get(b'r').filter(|_| self.setup.version == gr_canon::Version::V2_10);
            self.convert_path(g, p, q, planner)?;
        }
        if let Some(g) = self.todo(Group::Distance, step::DISTANCE) {
            let incremental = u8::from(g == 910);
            if self.m.incremental != incremental {
                let name = if incremental == 1 { "incremental" } else { "absolute" };
                self.remark(&format!("interpreter: distance mode changed to {name}"));
                self.m.incremental = incremental;
            }
        }
        if let Some(g) = self.todo(Group::IjkDistance, step::IJK_DISTANCE) {
            let absolute = u8::from(g == 901);
            if self.m.ijk_absolute != absolute {
                let name = if absolute == 1 { "absolute" } else { "incremental" };
                self.remark(&format!("interpreter: IJK distance mode changed to {name}"));
                self.m.ijk_absolute = absolute;
            }
        }
        if let Some(g) = self.todo(Group::Retract, step::RETRACT) {
            if !self.is_fanuc() {
                not_with_comp(self.m.comp_side, rs274::RT_COMP_RETRACT, "a change of the retract mode")?;
            }
            let name = if g == 980 { "old_z" } else { "r_plane" };
            self.remark(&format!("interpreter: retract mode set to {name}"));
            self.m.retract_r = u8::from(g == 990);
        }
        if let Some(g) = self.todo(Group::NonModal, step::NON_MODAL) {
            self.convert_non_modal(g)?;
        }
        if let Some(g) = self.todo(Group::G92Applied, step::G92) {
            // The controller forgets to look at the result here.
            let _ = self.convert_axis_offsets(g);
        }
        Ok(())
    }

    fn convert_non_modal(&mut self, g: i16) -> Res {
        match g {
            100 => match to_int(self.block.or_minus_one(b'l')) {
                1 | 10 | 11 => self.convert_setup_tool(),
                0 => self.reload_tools(),
                _ => self.convert_setup(),
            },
            280 | 300 => self.convert_home(g),
            281 | 301 => self.convert_save_home(g),
            520 | 920 => self.convert_axis_offsets(g),
            53 => self.convert_spline(53),
            _ => Ok(()),
        }
    }

    fn convert_plane(&mut self, g: i16) -> Res {
        let plane = match g {
            170 => Plane::Xy,
            180 => Plane::Xz,
            190 => Plane::Yz,
            171 => Plane::Uv,
            181 => Plane::Uw,
            _ => Plane::Vw,
        };
        if self.m.comp_side != 0 && matches!(g, 170 | 180 | 190) {
            let what = "a change of the working plane";
            if self.m.plane != plane as u8 {
                return not_with_comp(1, rs274::RT_COMP_PLANES, what);
            }
            if g == 190 {
                return not_with_comp(1, rs274::RT_COMP_ONLY_XY_XZ, what);
            }
        }
        self.emit(Call::SelectPlane(plane));
        self.m.plane = plane as u8;
        Ok(())
    }

    fn convert_units(&mut self, units: Units) {
        self.emit(Call::UseLengthUnits(units));
        if self.m.units() == units {
            return;
        }
        let factor = if units == Units::Inch { 1.0 / 25.4 } else { 25.4 };
        let m = &mut self.m;
        m.units = units as u8;
        let lengths = |axes: &mut Axes| {
            for i in [0, 1, 2, 6, 7, 8] {
                axes[i] *= factor;
            }
        };
        lengths(&mut m.current);
        lengths(&mut m.g92);
        lengths(&mut m.g52);
        lengths(&mut m.origin);
        m.program.iter_mut().for_each(|v| *v *= factor);
        m.comp_radius *= factor;
        self.scale_queue(factor);
        // These come back from the machine, which does not convert them here.
        self.m.tool_offset = self.world.tool_offset;
        self.m.feed = self.world.feed;
        self.m.tolerance = self.world.tolerance;
        self.m.naivecam = self.world.naivecam;
    }

    fn convert_diameter(&mut self, diameter: bool) {
        if (self.m.lathe_diameter != 0) == diameter {
            return;
        }
        let factor = if diameter { 0.5 } else { 2.0 };
        let scaled: &[u8] = if self.block.motion == 760 { b"xijk" } else { b"x" };
        for l in scaled {
            if *l != b'x' || self.block.has(b'x') {
                self.block.values[crate::block::slot(*l)] *= factor;
            }
        }
        let name = if diameter { "diameter" } else { "radius" };
        self.emit(Call::Comment(format!("interpreter: Lathe diameter mode changed to {name}").into()));
        self.m.lathe_diameter = u8::from(diameter);
    }

    /// G61, G61.1, G64.
    pub(crate) fn convert_path(&mut self, g: i16, tolerance: f64, naive: f64, planner: Option<f64>) -> Res {
        if !self.is_fanuc() {
            not_with_comp(self.m.comp_side, rs274::RT_COMP_CONTROL_MODE, "a change of the path mode")?;
        }
        match g {
            610 => {
                self.emit_queued(Call::SetMotionControlMode(PathMode::ExactPath));
                self.m.path_mode = 0;
            }
            611 => {
                self.emit_queued(Call::SetMotionControlMode(PathMode::ExactStop));
                self.m.path_mode = 1;
            }
            _ => {
                let path = if tolerance >= 0.0 { tolerance } else { 0.0 };
                self.m.path_mode = 2;
                self.m.tolerance = path;
                match planner {
                    Some(r) if r <= 0.0 => self.emit_queued(Call::SetPlannerMode(0, -1.0)),
                    Some(r) => self.emit_queued(Call::SetPlannerMode(1, r.clamp(0.1, 1.0))),
                    None => {}
                }
                self.emit_queued(Call::SetMotionControlMode(PathMode::Continuous(path)));
                let naive = if naive >= 0.0 { naive } else { path };
                self.m.naivecam = naive;
                self.emit_queued(Call::SetNaivecamTolerance(naive));
            }
        }
        Ok(())
    }

    /// Motion of the block.
    #[inline]
    pub(crate) fn convert_motion(&mut self, motion: i16) -> Res {
        if self.m.loose != 0 && motion != 800 {
            // In inverse time the feed comes from the length.
            self.leaves_probed(motion == 0 || self.m.feed_mode != 1 && matches!(motion, 10 | 382..=385));
        }
        let machine = self.block.g(Group::NonModal) == 530;
        if (machine || self.m.parked != 0) && motion != 800 && !crate::check::is_cycle(motion) {
            self.park(machine);
        }
        if self.block.machine_rapid {
            let in_force = self.m.motion;
            let done = self.convert_straight(0);
            self.m.motion = in_force;
            return done;
        }
        if self.config.any_indexer && self.index_motion(motion)? {
            return Ok(());
        }
        if matches!(motion, 0 | 10) {
            self.leave_cycle();
            return self.convert_straight(motion);
        }
        self.convert_other_motion(motion)
    }

    /// No cycle is in force any more. A Fanuc control forgets its dwell and its peck then (Series 0i/30i operator's manual, machining
    /// center system, canned cycles for drilling); LinuxCNC keeps them.
    #[inline]
    pub(crate) fn leave_cycle(&mut self) {
        if self.m.cycle_il_set != 0 {
            self.m.cycle_il_set = 0;
            if self.is_fanuc() {
                (self.m.cycle_p, self.m.cycle_q) = (0.0, 0.0);
            }
        }
    }

    fn convert_other_motion(&mut self, motion: i16) -> Res {
        if !crate::check::is_cycle(motion) {
            self.leave_cycle();
        }
        match motion {
            20 | 30 => self.convert_arc(motion),
            330 | 331 | 760 => self.convert_straight(motion),
            382..=385 => self.convert_probe(motion),
            800 => {
                if self.is_fanuc() {
                    self.end_cycle();
                    return Ok(());
                }
                self.remark("interpreter: motion mode set to none");
                self.m.motion = 800;
                Ok(())
            }
            50..=52 | 60..=63 => self.convert_spline(motion),
            700 | 710 | 711 | 712 | 720 | 721 | 722 => self.convert_roughing(motion),
            g if crate::check::is_cycle(g) => self.convert_cycle(g),
            g if crate::turning::is_turning(g) => self.convert_turning(g),
            _ => Err(Fault::new(code::CODE_UNKNOWN, rs274::RT_BUG_MOTION).named("this motion".into())),
        }
    }

    /// M0, M1, M2, M30, M60, M99.
    fn convert_stop(&mut self, m: i16) -> Res {
        self.flush_comp()?;
        match m {
            0 => self.emit(Call::ProgramStop),
            60 => {
                self.emit(Call::PalletShuttle);
                self.emit(Call::ProgramStop);
            }
            1 => self.emit(Call::OptionalProgramStop),
            // Behind THEN; else M99 makes a line of its own kind.
            99 if self.level() > 0 && self.is_fanuc() => {
                let back = self.block.get(b'p');
                self.convert_return(gr_gcode::Keyword::MacroEnd, true)?;
                return back.map_or(Ok(()), |n| self.go_to_number(n));
            }
            99 if self.level() > 0 => {
                let fault = Fault::new(code::SUB_STRUCTURE, rs274::RT_M99_BUG).at(b'm');
                return Err(fault.own_args(&["M99 ends a subroutine only at the start of its line"]));
            }
            99 if self.setup.loop_on_main_m99 => {
                self.next = 0;
                self.shift = 0;
                self.flow = crate::run::Flow::Jump;
                self.emit(Call::Finish);
                self.count_main_pass()?;
            }
            99 if self.goes_on_below() => {
                let to = self.block.or_zero(b'p');
                return self.go_to_number(to);
            }
            99 => {
                self.warn(Fault::own(code::PROGRAM_REPEATS).at(b'm'));
                self.end_program(m);
            }
            _ => self.end_program(m),
        }
        Ok(())
    }

    /// M99 P of a Fanuc main program goes to a block of that number. One further up is the program over again, unless a GOTO between the two
    /// leads out.
    fn goes_on_below(&mut self) -> bool {
        let Some(number) = self.block.get(b'p').filter(|_| self.is_fanuc()) else { return false };
        let here = self.place.line;
        let line = self.index(self.place.file).numbered(number as i64, here);
        line.is_none_or(|l| l > here || self.has_goto(l, here))
    }

    fn end_program(&mut self, m: i16) {
        self.leave_origin();
        self.m.origin_index = 1;
        self.write_param(5220, 1.0);
        self.m.origin = self.stored_offset(5220);
        self.m.rotation = self.params.get(5230);
        self.arrive_at_origin();
        self.emit(Call::SetG5xOffset(1, self.m.origin));
        self.emit(Call::SetXyRotation(self.m.rotation));
        if self.m.plane != Plane::Xy as u8 {
            self.emit(Call::SelectPlane(Plane::Xy));
            self.m.plane = Plane::Xy as u8;
        }
        self.m.incremental = 0;
        self.m.feed_mode = 0;
        self.emit(Call::SetFeedMode(0, 0));
        self.m.feed = self.block.values[crate::block::slot(b'f')];
        self.emit(Call::SetFeedRate(0.0));
        if self.m.feed_override == 0 {
            self.emit(Call::EnableFeedOverride);
            self.m.feed_override = 1;
        }
        self.m.comp_side = 0;
        self.m.comp_first = 1;
        for s in 0..self.config.spindles {
            self.emit(Call::StopSpindleTurning(s));
            self.m.turning[s as usize] = 0;
            self.m.speed_override[s as usize] = 1;
            self.emit(Call::SetSpindleMode(s, 0.0, None));
        }
        self.m.motion = 10;
        if self.m.mist != 0 {
            self.emit(Call::MistOff);
            self.m.mist = 0;
        }
        if self.m.flood != 0 {
            self.emit(Call::FloodOff);
            self.m.flood = 0;
        }
        if self.config.no_g92_persistence {
            for i in 5210..=5219 {
                self.write_param(i, 0.0);
            }
        }
        if m == 30 {
            self.emit(Call::PalletShuttle);
        }
        self.emit(Call::ProgramEnd);
        if self.m.percent != 0 {
            self.seek_percent();
        }
        self.flow = crate::run::Flow::End(crate::run::End::Program);
        self.unwind();
    }

    /// After M2 in a program that began with `%` the controller looks for the other one.
    fn seek_percent(&mut self) {
        let file = self.files.file(self.place.file);
        let mut last = None;
        let mut found = false;
        for line in self.next..file.line_count() {
            let Some((c, l)) = file.locate(line) else { break };
            last = Some((c, l));
            let chunk = &file.chunks[c];
            let span = chunk.scan.line_span(&chunk.text, l);
            if chunk.text[span.range()].trim() == "%" {
                found = true;
                break;
            }
        }
        if let Some((c, l)) = last {
            // The line read last is now the one it stopped at.
            let chunk = file.chunks[c].clone();
            let span = chunk.scan.line_span(&chunk.text, l);
            (self.reading.start, self.reading.end) = (span.start, span.end);
            (self.reading.text, self.reading.scan, self.reading.line) = (chunk.text, chunk.scan, l);
        }
        if !found {
            self.remark("interpreter: percent sign missing from end of file");
        }
    }

    /// Tells the stream that what follows rests on a stand-in.
    pub(crate) fn mark_runtime(&mut self, what: &str) {
        self.mark(&Mark::RuntimeValue(what.into()));
    }
}
