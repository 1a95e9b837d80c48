//! Text of a program in parts: a part is closed when the controller would take no more of it.

/// Lines of a program, cut into parts.
pub(crate) struct Parts {
    /// The part in work.
    pub text: String,
    lines: u64,
    points: u64,
    most: (u64, u64, u64),
    done: Vec<String>,
    end: &'static str,
    /// The step that lines are written for.
    pub step: Option<u32>,
    /// Bytes of marks in `text`.
    marks: usize,
    /// Where the statement in work begins: bytes, lines, points and bytes of marks before it.
    began: (usize, u64, u64, usize),
}

impl Parts {
    /// Parts of at most so many lines, points and bytes; `end` ends a line.
    pub(crate) fn new(lines: u64, points: Option<u64>, bytes: Option<u64>, end: &'static str) -> Parts {
        let most = (lines.max(20), points.unwrap_or(u64::MAX).max(10), bytes.unwrap_or(u64::MAX).max(4000));
        Parts { text: String::new(), lines: 0, points: 0, most, done: Vec::new(), end, step: None, marks: 0, began: (0, 0, 0, 0) }
    }
    /// A statement begins: its lines stay together. Where they have no room they begin the next part.
    pub(crate) fn begin(&mut self) {
        self.began = (self.text.len(), self.lines, self.points, self.marks);
    }
    /// Ends the line that was appended to `text`.
    pub(crate) fn end_line(&mut self) {
        self.marks += crate::marks::put(&mut self.text, self.step);
        self.text.push_str(self.end);
        self.lines += 1;
        let (at, lines, points, marks) = self.began;
        let over = self.lines > self.most.0 || self.points > self.most.1 || self.bytes() > self.most.2;
        if over && at > 0 && at <= self.text.len() {
            let rest = self.text.split_off(at);
            self.done.push(std::mem::replace(&mut self.text, rest));
            (self.lines, self.points, self.marks) = (self.lines - lines, self.points - points, self.marks - marks);
            self.began = (0, 0, 0, 0);
        }
    }
    /// Bytes of the part in work.
    fn bytes(&self) -> u64 {
        self.text.len().saturating_sub(self.marks) as u64
    }
    /// Appends a line.
    pub(crate) fn line(&mut self, line: &str) {
        self.text.push_str(line);
        self.end_line();
    }
    /// Counts points used.
    pub(crate) fn points(&mut self, count: u64) {
        self.points += count;
    }
    /// Lines of the part in work.
    pub(crate) fn lines(&self) -> u64 {
        self.lines
    }
    /// Whether the next statements (at most so many lines and two points) still have room.
    pub(crate) fn full(&self, lines: u64) -> bool {
        self.lines + lines > self.most.0 || self.points + 2 > self.most.1 || self.bytes() + 400 > self.most.2
    }
    /// Closes the part in work.
    pub(crate) fn cut(&mut self) {
        self.done.push(std::mem::take(&mut self.text));
        (self.lines, self.points, self.marks, self.began) = (0, 0, 0, (0, 0, 0, 0));
    }
    /// All parts.
    pub(crate) fn finish(mut self) -> Vec<String> {
        if !self.text.is_empty() || self.done.is_empty() {
            self.cut();
        }
        self.done
    }
}

/// Lines of a program that is never split: too many are an error.
pub(crate) struct Lines {
    /// The text.
    pub text: String,
    count: u64,
    points: u64,
    indent: &'static str,
    remark: &'static str,
    /// Bytes of marks in `text`.
    marks: usize,
}

impl Lines {
    /// With so much in front of each line, and what begins a remark.
    pub(crate) fn new(indent: &'static str, remark: &'static str) -> Lines {
        Lines { text: String::new(), count: 0, points: 0, indent, remark, marks: 0 }
    }
    /// Appends a line, with the number of the source line where one is due.
    pub(crate) fn line(&mut self, cx: &mut crate::walk::Cx, text: &str) {
        self.text.push_str(self.indent);
        self.text.push_str(text);
        if let Some(line) = cx.remark {
            self.text.push_str(&format!(" {} {line}", self.remark));
        }
        self.marks += crate::marks::put(&mut self.text, cx.step);
        self.text.push_str("\r\n");
        self.count += 1;
        let limits = &cx.machine.cell.controller;
        too_long(cx, self.count, limits.lines, "lines");
        too_long(cx, self.text.len().saturating_sub(self.marks) as u64, limits.bytes, "bytes");
    }
    /// Counts points used.
    pub(crate) fn points(&mut self, cx: &mut crate::walk::Cx, count: u64) {
        self.points += count;
        too_long(cx, self.points, cx.machine.cell.controller.points, "points");
    }
    /// Appends what holds from here on, when it is another than before. A move's remark waits for the move.
    pub(crate) fn setting(&mut self, cx: &mut crate::walk::Cx, before: &mut String, text: String) {
        if *before != text {
            let remark = cx.remark.take();
            self.line(cx, &text);
            cx.remark = remark;
            *before = text;
        }
    }
    /// Appends remarks.
    pub(crate) fn remark(&mut self, cx: &mut crate::walk::Cx, text: &str) {
        let text = cx.ascii(text);
        for piece in crate::walk::wrapped(&text, 100) {
            let line = format!("{} {piece}", self.remark);
            self.line(cx, &line);
        }
    }
}

fn too_long(cx: &mut crate::walk::Cx, now: u64, most: Option<u64>, what: &str) {
    if let Some(most) = most.filter(|m| now > *m) {
        cx.say(gr_text::code::VENDOR_PROGRAM_TOO_LONG, &["more".to_string(), what.into(), most.to_string(), cx.traits.title.into()]);
    }
}
