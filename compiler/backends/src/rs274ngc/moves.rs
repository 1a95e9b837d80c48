//! Moves: which words are written, and with which numbers.

use super::Language;
use super::emit::Emitter;
use super::write::AXES;
use crate::sources::Words;
use gr_ir::{Axes, FeedMode, Marker, Op, Plane, Pose, Source, State, View};

impl Emitter<'_> {
    /// Whether the language has these axes; an error if not.
    fn has_axes(&mut self, start: &Axes, end: &Axes, source: Source) -> bool {
        let lacks = self.lacks(|i| start[i] != end[i]);
        if let Some(axis) = lacks {
            self.cannot(&format!("a move of the {axis} axis"), source);
        }
        lacks.is_none()
    }

    /// The first of these axes that the language does not have.
    pub fn lacks(&self, of: impl Fn(usize) -> bool) -> Option<char> {
        let most = match self.options.language {
            Language::Linuxcnc => 9,
            Language::FanucMill => 6,
            Language::Grbl => 3,
        };
        (most..9).find(|i| of(*i)).map(|i| AXES[i])
    }

    /// Whether the source line gave a word for the axis. Without a text: whether it is a main axis.
    fn given(&mut self, axis: usize, source: Source) -> bool {
        match self.words(source) {
            // Put in by this program: it moves what it means to move.
            _ if source.line == crate::from_line::INSERTED => false,
            Some(words) => {
                let letter = AXES[axis].to_ascii_lowercase() as u8;
                // R of a drilling cycle; that of an arc, of a thread, of roughing or of any cycle of a Fanuc lathe is no place.
                let roughing = || [700, 710, 711, 712, 720, 721, 722, 760].into_iter().any(|g| words.g(g));
                let place = || !self.rounding && !self.sources.increments() && !roughing();
                words.has(letter) || (axis == self.across && words.has(b'r') && place())
            }
            None => axis < 3,
        }
    }

    /// Whether the number of an axis at the end of an arc is known: it moves there, or a block has named its place.
    pub fn is_placed(&mut self, axis: usize, start: &Pose, end: &Pose, source: Source) -> bool {
        self.anchored[axis] || start.axes[axis] != end.axes[axis] || !self.has_text(source) || self.given(axis, source)
    }

    /// Whether there is a text that says which axes a block names.
    fn has_text(&mut self, source: Source) -> bool {
        source.line != crate::from_line::INSERTED && self.words(source).is_some_and(|w| w.names_axes())
    }

    /// The axis words of a move. An axis that stands still has no word, so that where an unknown offset or an
    /// unknown position hides behind a number, the number is not written.
    pub fn axis_words(&mut self, start: &Pose, end: &Pose, source: Source, forced: &[usize]) -> Vec<String> {
        // XYZ words would put an upright tool where the program has a tilted one.
        if end.tool_axis.is_some_and(|a| !(a[2] > 1.0 - 1e-9)) {
            self.cannot("a tool that does not stand along Z", source);
        }
        let mut out = Vec::new();
        let displaced = std::mem::take(&mut self.displaced);
        for i in 0..9 {
            let (from, to) = (start.axes[i], end.axes[i]);
            let force = forced.contains(&i) || displaced && i < 3;
            let moves = from.to_bits() != to.to_bits() && from != to;
            // A height that no block has named since the frame moved is the machine's, whatever a simulation takes it for.
            let nameless = !self.anchored[i] && i == self.across && !self.cycling && self.has_text(source);
            if (self.loose[i].is_some() || nameless) && !force && !self.given(i, source) {
                self.at[i] = to;
                // The simulation goes on from where it has the probe.
                self.loose[i] = self.loose[i].map(|back| if moves { 0.0 } else { back });
                continue;
            }
            let named = !self.anchored[i] && self.has_axis(i) && self.given(i, source);
            let repeated = self.options.repeat_words && self.anchored[i] && i < 3;
            if !(force || moves || named || repeated) {
                continue;
            }
            let (text, said) = self.w.axis(i, to);
            if self.anchored[i] && said == self.at[i] && !force && !repeated {
                continue;
            }
            self.set(i, said);
            out.push(format!("{}{text}", AXES[i]));
        }
        if out.is_empty() {
            // A move to where the axis is: one word keeps it in the program.
            if let Some(i) = (0..9).find(|i| self.anchored[*i] && self.has_axis(*i) && self.given(*i, source)) {
                let (text, said) = self.w.axis(i, end.axes[i]);
                self.set(i, said);
                out.push(format!("{}{text}", AXES[i]));
            }
        }
        out
    }

    /// grbl has words for three axes; where another would move, that is told.
    fn has_axis(&self, axis: usize) -> bool {
        axis < 3 || self.options.language != Language::Grbl
    }

    fn set(&mut self, axis: usize, said: f64) {
        self.at[axis] = said;
        self.anchored[axis] = true;
        self.loose[axis] = None;
    }

    /// A block of motion; nothing when there are no words.
    fn motion_block(&mut self, code: u8, words: &[String], feed: &[String]) {
        if words.is_empty() {
            return;
        }
        self.w.begin();
        if self.motion != Some(code) || self.options.repeat_words {
            self.w.add(if code == 0 { "G0" } else { "G1" });
        }
        self.motion = Some(code);
        for word in words.iter().chain(feed) {
            self.w.add(word);
        }
        self.w.end();
    }

    pub fn rapid(&mut self, view: &View<'_, '_>) {
        if !self.has_axes(&view.start.axes, &view.end.axes, view.source) {
            return;
        }
        if let Some(words) = self.words(view.source) {
            if words.g(530) || !words.names_axes() && crate::sources::is_hidden(self.program, view.index) {
                return self.machine_move(view, "G0", &[]);
            }
            let home = [(280, "G28"), (300, "G30")].into_iter().find(|(g, _)| words.g(*g));
            if let Some((_, code)) = home {
                return self.home(view, code);
            }
        }
        if self.straight_first(view) {
            return;
        }
        if self.displaced {
            return self.come_back(view);
        }
        let (across, cycling) = (self.across, self.cycling);
        if !cycling && !self.anchored[across] && view.start.axes[across] != view.end.axes[across] {
            // A cycle that goes on goes to its level first.
            let begins = |s: gr_ir::Step<'_>| s.source == view.source && matches!(s.op, Op::Begin { marker: Marker::Cycle, .. });
            self.cycling = (1..=3).any(|n| self.program.get(view.index + n).is_some_and(begins));
        }
        match self.step_from_probe(view) {
            Some(words) => self.incremental("G0", &words, &[]),
            None => {
                let words = self.axis_words(view.start, view.end, view.source, &[]);
                self.motion_block(0, &words, &[]);
            }
        }
        self.cycling = cycling;
    }

    /// The words of a step (G91) from where a probe stopped: there only the step is known. None: it is none.
    fn step_from_probe(&mut self, view: &View<'_, '_>) -> Option<Vec<String>> {
        if self.loose.iter().all(Option::is_none) {
            return None;
        }
        let from: Axes = std::array::from_fn(|i| self.loose[i].map_or(self.at[i], |back| view.start.axes[i] + back));
        let by: Axes = std::array::from_fn(|i| view.end.axes[i] - from[i]);
        let given: Vec<usize> = (0..9).filter(|i| self.given(*i, view.source)).collect();
        // Who has named the place since knows the coordinate.
        let unknown = |i: &usize| self.loose[*i].is_some() && !self.anchored[*i];
        // G91 may stand in another file, or where a jump comes from: a plain number tells whether it is a step.
        let steps = Words::goes_by_increments(self.sources, view.source.file, view.source.line);
        let near = |v: f64, to: f64| [v, v / 2.0].iter().any(|v| (v - to).abs() < 1e-6);
        let says = |i: usize| self.literal(AXES[i], view).map_or(steps, |v| near(v, by[i]) && (steps || !near(v, view.end.axes[i])));
        if !given.iter().any(unknown) || !given.iter().copied().filter(unknown).all(says) {
            return None;
        }
        let mut words = Vec::new();
        for i in 0..9 {
            if self.loose[i].is_some() {
                self.loose[i] = Some(0.0);
            }
            if !given.contains(&i) {
                self.at[i] = if self.loose[i].is_some() { view.end.axes[i] } else { self.at[i] };
                continue;
            }
            let (text, said) = self.w.axis(i, by[i]);
            self.at[i] = from[i] + said;
            words.push(format!("{}{text}", AXES[i]));
        }
        Some(words)
    }

    /// A block in increments.
    fn incremental(&mut self, code: &str, words: &[String], feed: &[String]) {
        let words = words.iter().chain(feed).map(String::as_str);
        let block: Vec<&str> = ["G91", code].into_iter().chain(words).collect();
        self.w.block(&block.join(" "));
        self.w.block("G90");
        self.motion = None;
    }

    /// A plan begins by going to a safe height: nobody knows where the machine stands over the part by then, so the
    /// other axes wait for the next move. Says whether it was that.
    fn straight_first(&mut self, view: &View<'_, '_>) -> bool {
        let (a, b) = (&view.start.axes, &view.end.axes);
        let alone = (0..9).all(|i| i == 2 || a[i] == b[i]);
        let unknown = !self.anchored[0] && !self.anchored[1];
        // A move that goes nowhere names the axes that nobody has named yet.
        let stays = a[2] == b[2] && self.anchored[2];
        if !alone || stays || !unknown || self.words(view.source).is_some() || view.source.line == crate::from_line::INSERTED {
            return false;
        }
        let (text, said) = self.w.axis(2, b[2]);
        self.set(2, said);
        self.displaced = false;
        self.motion_block(0, &[format!("Z{text}")], &[]);
        true
    }

    /// The first rapid after a tool change elsewhere: across at the height of the change, then to its own height.
    fn come_back(&mut self, view: &View<'_, '_>) {
        let mut words = self.axis_words(view.start, view.end, view.source, &[0, 1, 2]);
        let height: Vec<String> = words.iter().filter(|w| w.starts_with('Z')).cloned().collect();
        words.retain(|w| !w.starts_with('Z'));
        self.motion_block(0, &words, &[]);
        self.motion_block(0, &height, &[]);
    }

    /// G53: the numbers are the machine's, whatever the offsets are.
    fn machine_move(&mut self, view: &View<'_, '_>, code: &str, forced: &[usize]) {
        let goal = view.state.machine(&view.end.axes);
        let from = view.state.machine(&view.start.axes);
        let mut reached = self.frame.machine(&self.at);
        let feed =
            if code == "G1" { self.feed_words(view.state, view.start, view.end, view.source) } else { Vec::new() };
        let mut words = Vec::new();
        for i in 0..9 {
            // Rotation leaves rounding dust in an axis that stands still.
            let moves = (goal[i] - from[i]).abs() > 1e-9;
            if moves || forced.contains(&i) || (self.has_axis(i) && self.words(view.source).is_some() && self.given(i, view.source)) {
                let (text, said) = self.w.axis(i, goal[i]);
                reached[i] = said;
                words.push(format!("{}{text}", AXES[i]));
                self.anchored[i] = false;
                self.loose[i] = None;
            }
        }
        self.at = self.frame.work_frame(&reached);
        if words.is_empty() {
            return;
        }
        self.motion = None;
        let code = ["G53".to_string(), code.to_string()];
        let line: Vec<String> = code.into_iter().chain(words).chain(feed).collect();
        self.w.block(&line.join(" "));
    }

    /// G28 and G30: over a point to the reference, whose place only the machine knows.
    fn home(&mut self, view: &View<'_, '_>, code: &str) {
        let next = self.program.get(view.index + 1);
        let second = next.filter(|s| s.op == Op::Rapid && s.source == view.source);
        if self.own_reference || self.adrift {
            if second.is_none() {
                // Without words all axes go there, wherever they are.
                let all = !(0..9).any(|i| self.given(i, view.source));
                return self.machine_move(view, "G0", if all { &[0, 1, 2] } else { &[] });
            }
            let words = self.axis_words(view.start, view.end, view.source, &[]);
            return self.motion_block(0, &words, &[]);
        }
        let named: Vec<usize> = (0..9).filter(|i| self.given(*i, view.source)).collect();
        if !named.is_empty() && named.iter().all(|i| !self.has_axis(*i)) {
            // Without its axis the code would send all the others home.
            return self.cannot(&format!("{code} of the axis {}", AXES[named[0]]), view.source);
        }
        let named: Vec<usize> = named.into_iter().filter(|i| self.has_axis(*i)).collect();
        let all = self.options.language == Language::FanucMill && named.is_empty();
        let axes = if all { vec![0, 1, 2] } else { named };
        // Without a way-point the number of a simulation must not become one: where the axis is, only the machine knows.
        let stands = second.is_none() || axes.iter().all(|i| view.start.axes[*i] == view.end.axes[*i]);
        let straight = !axes.is_empty() && stands
            && (all || axes.iter().all(|i| self.anchored[*i]) || Words::goes_by_increments(self.sources, view.source.file, view.source.line));
        let through = if second.is_some() { view.end } else { view.start };
        let mut words = if straight { vec!["G91".to_string(), code.to_string()] } else { vec![code.to_string()] };
        let all = axes.is_empty();
        for &i in &axes {
            words.push(format!("{}{}", AXES[i], self.w.axis(i, if straight { 0.0 } else { through.axes[i] }).0));
        }
        self.w.block(&words.join(" "));
        if straight {
            self.w.block("G90");
        }
        self.motion = None;
        let end = second.map_or(view.end.axes, |s| s.end.axes);
        // An axis that is not named stands where its rounded number took it.
        for i in (0..9).filter(|i| all || axes.contains(i)) {
            self.at[i] = end[i];
            self.loose[i] = None;
        }
        self.anchored = [false; 9];
        if second.is_some() {
            self.done_until = view.index + 2;
        }
    }

    pub fn linear(&mut self, view: &View<'_, '_>) {
        if !self.has_axes(&view.start.axes, &view.end.axes, view.source) {
            return;
        }
        if let Some(sync) = view.state.sync.filter(|s| !s.velocity) {
            return self.thread(view, sync.per_rev, sync.spindle);
        }
        if self.words(view.source).is_some_and(|w| w.g(530)) {
            if self.options.language != Language::FanucMill {
                return self.machine_move(view, "G1", &[]);
            }
            // There G53 is a rapid, whatever stands beside it.
            if !self.options.stored_known {
                return self.cannot("a feed move to a place of the machine (G53 G1; G53 is a rapid there)", view.source);
            }
        }
        if let Some(words) = self.step_from_probe(view) {
            let feed = self.feed_words(view.state, view.start, view.end, view.source);
            return self.incremental("G1", &words, &feed);
        }
        self.straight(view.start, view.end, view.state, view.source);
    }

    /// G1 from one pose to another.
    pub fn straight(&mut self, start: &Pose, end: &Pose, state: &State, source: Source) {
        let words = self.axis_words(start, end, source, &[]);
        if words.is_empty() {
            return;
        }
        let feed = self.feed_words(state, start, end, source);
        self.motion_block(1, &words, &feed);
    }

    /// Straight pieces along a curve.
    pub fn lines(&mut self, pieces: usize, state: &State, source: Source, at: &dyn Fn(f64) -> Pose) {
        let mut from = at(0.0);
        for k in 1..=pieces {
            let to = at(k as f64 / pieces as f64);
            self.straight(&from, &to, state, source);
            from = to;
        }
    }

    fn thread(&mut self, view: &View<'_, '_>, per_rev: f64, spindle: i32) {
        if self.options.language == Language::Grbl {
            return self.cannot("threading (motion that follows the spindle)", view.source);
        }
        let moved: Vec<usize> = (0..9).filter(|i| view.start.axes[*i] != view.end.axes[*i]).collect();
        let mut words = vec!["G33".to_string()];
        words.extend(self.axis_words(view.start, view.end, view.source, &moved));
        if words.len() == 1 {
            return;
        }
        // Fanuc's lead counts along the axis that goes furthest, LinuxCNC's along the way.
        let way: [f64; 3] = std::array::from_fn(|i| (view.end.axes[i] - view.start.axes[i]).abs());
        let length = libm::sqrt(way.iter().map(|d| d * d).sum());
        let share = if self.linuxcnc() || length == 0.0 { 1.0 } else { way.into_iter().fold(0.0, f64::max) / length };
        let (pitch, _) = self.w.length(per_rev * share, self.w.places.max(6));
        words.push(format!("{}{pitch}", if self.linuxcnc() { 'K' } else { 'F' }));
        if !self.linuxcnc() {
            self.feed.clear();
        }
        if spindle > 0 {
            words.push(format!("${spindle}"));
        }
        self.w.block(&words.join(" "));
        self.motion = None;
    }

    pub fn rigid_tap(&mut self, view: &View<'_, '_>, bottom: [f64; 3], scale: f64) {
        let Some(sync) = view.state.sync else {
            return self.cannot("rigid tapping without a pitch", view.source);
        };
        if !self.linuxcnc() {
            return self.cannot("rigid tapping", view.source);
        }
        let mut words = vec!["G33.1".to_string()];
        for i in 0..3 {
            if bottom[i] != view.start.axes[i] {
                words.push(format!("{}{}", AXES[i], self.w.axis(i, bottom[i]).0));
            }
        }
        if words.len() == 1 {
            // A tap that goes nowhere still has to name an axis.
            words.push(format!("Z{}", self.w.axis(2, bottom[2]).0));
        }
        words.push(format!("K{}", self.w.length(sync.per_rev, self.w.places.max(6)).0));
        if scale != 1.0 && scale != 0.0 {
            words.push(format!("I{}", self.w.number(scale, 6)));
        }
        if sync.spindle > 0 {
            words.push(format!("${}", sync.spindle));
        }
        self.w.block(&words.join(" "));
        self.motion = None;
    }

    pub fn probe(&mut self, view: &View<'_, '_>, kind: u8) {
        if self.options.language == Language::FanucMill {
            return self.cannot("probing with an own error rule (G38)", view.source);
        }
        if !self.has_axes(&view.start.axes, &view.end.axes, view.source) {
            return;
        }
        let before = self.loose;
        let moves = |i: &usize| view.start.axes[*i] != view.end.axes[*i];
        // Where another probe stopped, an axis stays unless it is named.
        let moved: Vec<usize> = (0..9).filter(moves).filter(|i| before[*i].is_none() || self.given(*i, view.source)).collect();
        let code = format!("G38.{}", 2 + (kind & 3));
        if let Some(words) = self.step_from_probe(view) {
            let feed = self.feed_words(view.state, view.start, view.end, view.source);
            self.incremental(&code, &words, &feed);
        } else {
            let mut words = vec![code];
            words.extend(self.axis_words(view.start, view.end, view.source, &moved));
            words.extend(self.feed_words(view.state, view.start, view.end, view.source));
            self.w.block(&words.join(" "));
        }
        let way: [f64; 3] = std::array::from_fn(|i| view.start.axes[i] + before[i].unwrap_or(0.0) - view.end.axes[i]);
        let length = way.iter().map(|w| w * w).sum::<f64>().sqrt();
        for i in (0..9).filter(|i| moved.contains(i) || before[*i].is_some()) {
            let back = way.get(i).filter(|_| length > 0.0).map_or(0.0, |w| gr_canon::PROBE_STOPS_SHORT * w / length);
            self.loose[i] = Some(back);
            self.anchored[i] &= !moved.contains(&i);
        }
        self.motion = None;
    }

    /// The words that bring feed and feed mode to what the state says.
    pub fn feed_words(&mut self, state: &State, start: &Pose, end: &Pose, source: Source) -> Vec<String> {
        let mut out = Vec::new();
        let mode = state.feed_mode;
        if mode != self.feed_mode {
            if mode != FeedMode::PerTime && self.options.language == Language::Grbl && mode == FeedMode::PerRev {
                self.cannot("a feed per revolution", source);
                return out;
            }
            self.w.block(match mode {
                FeedMode::PerTime => "G94",
                FeedMode::PerRev => "G95",
                FeedMode::Inverse => "G93",
            });
            self.feed_mode = mode;
            self.feed.clear();
        }
        let straight = [0, 1, 2, 6, 7, 8].iter().any(|i| start.axes[*i] != end.axes[*i]);
        let rotary = (3..6).any(|i| start.axes[i] != end.axes[i]) && !straight;
        let per = if mode == FeedMode::PerRev { 1.0 } else { 60.0 };
        let value = match (mode, rotary) {
            (FeedMode::Inverse, _) => state.feed * 60.0,
            (_, true) => state.feed_angular.to_degrees() * per,
            (_, false) => state.feed * per / self.w.unit,
        };
        let text = self.w.number(value, self.w.places.max(6));
        if value > 0.0 && text.bytes().all(|b| matches!(b, b'0' | b'.')) {
            self.cannot("a feed so slow that its decimals are all zero", source);
        }
        if text != self.feed || mode == FeedMode::Inverse || self.options.repeat_words {
            out.push(format!("F{text}"));
            self.feed = text;
        }
        out
    }

    pub fn nurbs(&mut self, view: &View<'_, '_>, order: u32, points: &[f64]) {
        let count = points.len() / 3;
        let point = |i: usize| [points[3 * i], points[3 * i + 1], points[3 * i + 2]];
        let plain = (0..count).all(|i| point(i)[2] == 1.0);
        let bezier = plain && count == order as usize && (order == 3 || order == 4);
        if !self.linuxcnc() || count < order as usize || order < 3 {
            return self.spline_as_lines(view);
        }
        if self.plane != Plane::Xy {
            self.w.block("G17");
            self.plane = Plane::Xy;
        }
        if !bezier {
            return self.weighted_spline(view, order, points);
        }
        let from = [self.at[0], self.at[1]];
        let offset = |a: [f64; 3], b: [f64; 2]| [a[0] - b[0], a[1] - b[1]];
        let mut words = self.axis_words(view.start, view.end, view.source, &[0, 1]);
        // Words that are only repeated have no place in a spline.
        words.retain(|w| w.starts_with(['X', 'Y']));
        let to = [self.at[0], self.at[1]];
        let mut line = vec![if order == 4 { "G5".to_string() } else { "G5.1".to_string() }];
        line.extend(words);
        let mut pair = |letters: [char; 2], v: [f64; 2]| {
            for (letter, v) in letters.into_iter().zip(v) {
                line.push(format!("{letter}{}", self.w.length(v, self.w.places).0));
            }
        };
        pair(['I', 'J'], offset(point(1), from));
        if order == 4 {
            pair(['P', 'Q'], offset(point(2), to));
        }
        line.extend(self.feed_words(view.state, view.start, view.end, view.source));
        self.w.block(&line.join(" "));
        self.motion = None;
    }

    /// G5.2 … G5.3: control points with weights; the first is where the tool is.
    fn weighted_spline(&mut self, view: &View<'_, '_>, order: u32, points: &[f64]) {
        let feed = self.feed_words(view.state, view.start, view.end, view.source);
        let mut head = vec!["G5.2".to_string()];
        if order > 3 {
            head.push(format!("L{order}"));
        }
        head.extend(feed);
        if points[2] != 1.0 {
            head.push(format!("P{}", self.w.number(points[2], 9)));
            self.w.block(&head.join(" "));
            head.clear();
        }
        for p in points[3..].chunks_exact(3) {
            let ((x, said_x), (y, said_y)) = (self.w.axis(0, p[0]), self.w.axis(1, p[1]));
            head.extend([format!("X{x}"), format!("Y{y}"), format!("P{}", self.w.number(p[2], 9))]);
            self.w.block(&head.join(" "));
            head.clear();
            self.set(0, said_x);
            self.set(1, said_y);
        }
        self.w.block("G5.3");
        self.motion = None;
    }

    fn spline_as_lines(&mut self, view: &View<'_, '_>) {
        let mut from = *view.start;
        let mut poses = Vec::new();
        let tolerance = self.options.arc_tolerance;
        gr_ir::geometry::flatten(&view.op, view.start, view.end, tolerance, |axes| poses.push(Pose::at(*axes)));
        for to in poses {
            self.straight(&from, &to, view.state, view.source);
            from = to;
        }
    }
}
