/// Modal groups of G-codes, the same numbers as in the standard where it has them.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
#[expect(missing_docs, reason = "the names are the standard's")]
pub enum Group {
    NonModal = 0,
    Motion = 1,
    Plane = 2,
    Distance = 3,
    IjkDistance = 4,
    Feed = 5,
    Units = 6,
    CutterComp = 7,
    ToolLength = 8,
    Retract = 10,
    CoordSystem = 12,
    PathControl = 13,
    SpindleMode = 14,
    LatheDiameter = 15,
    G92Applied = 16,
}

/// Number of G groups (indices of [`Group`]).
pub const GROUPS: usize = 17;
/// Number of M groups.
pub const M_GROUPS: usize = 11;

/// One block's words after evaluation. Cleared by resetting masks, not by writing every field.
#[derive(Clone, Debug)]
pub struct Block {
    /// Bit `letter - b'a'` for each letter word present (`@` bit 26, `^` bit 27, `$` bit 28).
    pub present: u32,
    /// Values by the same index; where the bit is clear, the value some earlier block had. Integer words
    /// (H L N T $) hold whole numbers.
    pub values: [f64; 29],
    /// G-code of each group times ten, −1 = none.
    pub g: [i16; GROUPS],
    /// Which entries of `g` are set.
    pub g_mask: u32,
    /// M-code of each group, −1 = none.
    pub m: [i16; M_GROUPS],
    /// How many M-codes.
    pub m_count: u8,
    /// M100 … M199, −1 = none.
    pub user_m: i16,
    /// The motion this block makes (G-code times ten), −1 = none.
    pub motion: i16,
    /// Fanuc: G68 or G69 (times ten), −1 = none.
    pub turning: i16,
    /// Fanuc: G67.
    pub ends_modal: bool,
    /// Fanuc: G50.1, whose axis words name what it lets go.
    pub mirror_off: bool,
    /// Fanuc: G5, G5.1 or G8 (times ten), −1 = none.
    pub look_ahead: i16,
    /// Fanuc: G53 without a motion of its own, which leaves the motion in force.
    pub machine_rapid: bool,
    /// Steps of execution that are done already (a remapped block is executed in several goes).
    pub(crate) done: u32,
    /// Steps of execution that a remap takes over.
    pub(crate) remapped: u32,
}

impl Default for Block {
    fn default() -> Self {
        Block {
            present: 0,
            values: [0.0; 29],
            g: [-1; GROUPS],
            g_mask: 0,
            m: [-1; M_GROUPS],
            m_count: 0,
            user_m: -1,
            motion: -1,
            turning: -1,
            ends_modal: false,
            mirror_off: false,
            look_ahead: -1,
            machine_rapid: false,
            done: 0,
            remapped: 0,
        }
    }
}

/// Index of a letter (lower case, `@`, `^`, `$`).
#[inline]
pub const fn slot(letter: u8) -> usize {
    match letter {
        b'@' => 26,
        b'^' => 27,
        b'$' => 28,
        l => (l.wrapping_sub(b'a') & 31) as usize,
    }
}

/// Mask of several letters, for [`Block::has_any_of`].
pub const fn letters(list: &[u8]) -> u32 {
    let (mut mask, mut i) = (0, 0);
    while i < list.len() {
        mask |= 1 << slot(list[i]);
        i += 1;
    }
    mask
}

/// X Y Z A B C U V W.
pub const AXIS_LETTERS: [u8; 9] = *b"xyzabcuvw";
/// Mask of the axis letters.
pub const AXES: u32 = letters(b"xyzabcuvw");

impl Block {
    /// Forgets everything but old values.
    #[inline]
    pub fn clear(&mut self) {
        self.present = 0;
        if self.g_mask != 0 {
            self.g = [-1; GROUPS];
            self.g_mask = 0;
        }
        if self.m_count != 0 {
            self.m = [-1; M_GROUPS];
            self.m_count = 0;
            self.user_m = -1;
        }
        self.motion = -1;
        self.turning = -1;
        self.ends_modal = false;
        self.mirror_off = false;
        self.look_ahead = -1;
        self.machine_rapid = false;
        self.done = 0;
        self.remapped = 0;
    }
    /// Whether a word is there.
    #[inline]
    pub fn has(&self, letter: u8) -> bool {
        self.present & (1 << slot(letter)) != 0
    }
    /// Whether any of these words is there.
    #[inline]
    pub fn has_any(&self, letters: &[u8]) -> bool {
        letters.iter().any(|l| self.has(*l))
    }
    /// Whether any word of a mask made by [`letters`] is there.
    #[inline]
    pub fn has_any_of(&self, mask: u32) -> bool {
        self.present & mask != 0
    }
    /// A word's value.
    #[inline]
    pub fn get(&self, letter: u8) -> Option<f64> {
        self.has(letter).then(|| self.values[slot(letter)])
    }
    /// A word's value, or 0.
    #[inline]
    pub fn or_zero(&self, letter: u8) -> f64 {
        self.get(letter).unwrap_or(0.0)
    }
    /// A word's value, or −1, which is what the controller keeps for P, Q and L when they are missing.
    #[inline]
    pub fn or_minus_one(&self, letter: u8) -> f64 {
        self.get(letter).unwrap_or(-1.0)
    }
    /// Sets a word (also used to put in what is implied).
    #[inline]
    pub fn set(&mut self, letter: u8, value: f64) {
        self.present |= 1 << slot(letter);
        self.values[slot(letter)] = value;
    }
    /// Removes a word.
    pub fn unset(&mut self, letter: u8) {
        self.present &= !(1 << slot(letter));
    }
    /// G-code times ten of a group, −1 = none.
    #[inline]
    pub fn g(&self, group: Group) -> i16 {
        self.g[group as usize]
    }
    /// Sets the G-code of a group.
    #[inline]
    pub fn set_g(&mut self, group: usize, code: i16) {
        self.g[group] = code;
        self.g_mask |= 1 << group;
    }
    /// Whether a step of execution is still to do; marks it as done.
    #[inline]
    pub(crate) fn once(&mut self, step: u32) -> bool {
        let todo = self.done & (1 << step) == 0;
        self.done |= 1 << step;
        todo
    }
    /// The step is to be done after all.
    pub(crate) fn undo(&mut self, step: u32) {
        self.done &= !(1 << step);
    }
}
