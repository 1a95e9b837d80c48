use super::plan::{JointProgram, Rounding, shown};
use std::fmt::Write as _;

impl JointProgram {
    /// The G-code: one G01 per point, the joints in degrees (mm), F in degrees (mm) per second. Where the arm only stands,
    /// as at the first point, there is no feed: G00, for controls refuse F0. The thesis writes it.
    pub fn gcode(&self) -> String {
        let mut out = String::new();
        for point in &self.points {
            let stands = point.speed == 0.0 && !self.options.reference;
            out.push_str(if stands { "G00" } else { "G01" });
            for ((value, kind), word) in point.joints.iter().zip(&self.kinds).zip(&self.words) {
                let _ = write!(out, " {word}{}", self.number(shown(*value, *kind)));
            }
            match stands {
                true => out.push('\n'),
                false => _ = writeln!(out, " F{}", self.feed(point.speed)),
            }
        }
        out
    }

    /// Where each line of [`JointProgram::gcode`] comes from; none for the start.
    pub fn sources(&self) -> Vec<Option<gr_ir::Source>> {
        self.points.iter().map(|p| p.source).collect()
    }

    /// The points in space: time in s, X Y Z in mm, A B C in degrees.
    pub fn cartesian_csv(&self) -> String {
        let head = ["t", "X", "Y", "Z", "A", "B", "C"].map(String::from);
        self.csv(&head, |p| {
            let degrees = |v: f64| v.to_degrees();
            vec![p.pose[0], p.pose[1], p.pose[2], degrees(p.pose[3]), degrees(p.pose[4]), degrees(p.pose[5])]
        })
    }

    /// The same points in joint space: time in s, joints in degrees (mm).
    pub fn joint_csv(&self) -> String {
        let names = (1..=self.kinds.len()).map(|i| format!("J{i}"));
        let head: Vec<String> = std::iter::once("t".to_string()).chain(names).collect();
        self.csv(&head, |p| p.joints.iter().zip(&self.kinds).map(|(v, k)| shown(*v, *k)).collect())
    }

    fn csv(&self, head: &[String], row: impl Fn(&super::JointPoint) -> Vec<f64>) -> String {
        // Where the comma is the decimal sign, spreadsheets expect semicolons between the columns.
        let between = if self.options.comma { ";" } else { "," };
        let mut out = head.join(between);
        out.push('\n');
        for point in &self.points {
            let time = self.trimmed(format!("{:.6}", point.time));
            let cells = row(point).into_iter().map(|v| self.number(v));
            out += &std::iter::once(time).chain(cells).collect::<Vec<_>>().join(between);
            out.push('\n');
        }
        out
    }

    fn number(&self, value: f64) -> String {
        let decimals = self.options.decimals.min(15);
        let value = match self.options.rounding {
            Rounding::Nearest => value,
            // 90 computed as 89.999 999 999 999 9 is 90.
            Rounding::Truncate => {
                let unit = libm::pow(10.0, decimals as f64);
                libm::trunc((value + libm::copysign(1e-9, value)) * unit) / unit
            }
        };
        self.trimmed(format!("{value:.decimals$}"))
    }

    /// A feed; too slow for the decimals it gets as many as it needs.
    fn feed(&self, speed: f64) -> String {
        let text = self.number(speed);
        if text != "0" || self.options.reference {
            return text;
        }
        let decimals = (1..15).find(|d| speed * libm::pow(10.0, f64::from(*d)) >= 100.0).unwrap_or(15);
        self.trimmed(format!("{speed:.*}", decimals as usize))
    }

    fn trimmed(&self, text: String) -> String {
        let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
        let text = if text == "-0" { "0" } else { text };
        if self.options.comma { text.replace('.', ",") } else { text.to_string() }
    }
}
