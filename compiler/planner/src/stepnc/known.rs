//! Where the tool is as far as the program has said it. A program's simulation has numbers for everything, also for
//! axes that no block has named yet, for places of the machine, and for what a probe has found; a process plan may
//! have none of these. Which words a move had is told from outside, the motion alone does not have them.

use gr_ir::{Axes, State, View};

/// What a move does to X, Y and Z.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Words {
    /// Those that it brings to a place of the work frame.
    pub work: [bool; 3],
    /// Those that it brings to a place of the machine (G53, G28, G30).
    pub machine: [bool; 3],
    /// The machine makes it of itself, before it changes the tool.
    pub hidden: bool,
}

/// Words of a move whose text is not at hand: what changes was named.
pub fn changes(v: &View<'_, '_>) -> Words {
    let (a, b) = (v.start.xyz(), v.end.xyz());
    Words { work: std::array::from_fn(|i| a == b || a[i] != b[i]), ..Words::default() }
}

/// What is known of a coordinate.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(super) enum Known {
    /// Nothing: the machine stands where it happens to.
    #[default]
    No,
    /// It stands still since it was named, but another tool or its offset has come between: its number is that of
    /// the tool table.
    Held,
    /// A word has said it.
    Yes,
}

/// What is known of X, Y and Z.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub(super) struct Place {
    pub of: [Known; 3],
    /// Rapids went by that could not be written, as they came from anywhere.
    pub waits: bool,
}

impl Place {
    pub fn all(&self) -> bool {
        self.of == [Known::Yes; 3]
    }
    /// Axes that nothing is known of.
    pub fn missing(&self) -> String {
        let names: Vec<&str> = ["X", "Y", "Z"].into_iter().zip(self.of).filter(|(_, k)| *k == Known::No).map(|(n, _)| n).collect();
        names.join(" ")
    }
    pub fn name(&mut self, axes: [bool; 3]) {
        self.set(axes, Known::Yes);
    }
    pub fn forget(&mut self, axes: [bool; 3]) {
        self.set(axes, Known::No);
    }
    /// Another tool, or another offset of it.
    pub fn hold(&mut self, axes: [bool; 3]) {
        let held = std::array::from_fn(|i| axes[i] && self.of[i] == Known::Yes);
        self.set(held, Known::Held);
    }
    fn set(&mut self, axes: [bool; 3], to: Known) {
        for (known, named) in self.of.iter_mut().zip(axes) {
            if named {
                *known = to;
            }
        }
    }
}

/// The frame that a program's coordinates are written in.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Frame {
    work: u8,
    offset: Axes,
    local: Axes,
    rotation: f64,
}

impl Frame {
    pub fn of(s: &State) -> Frame {
        Frame { work: s.work, offset: s.work_offset, local: s.local_offset, rotation: s.rotation }
    }
}

/// Axes of X Y Z that differ.
pub(super) fn differ(a: &Axes, b: &Axes) -> [bool; 3] {
    std::array::from_fn(|i| a[i] != b[i])
}
