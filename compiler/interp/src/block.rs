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

/// One block's words after evaluation. Cleared by resetting two masks, not by writing every field.
#[derive(Clone, Debug)]
pub struct Block {
    /// Bit `letter - b'a'` for each letter word present (`@` bit 26, `^` bit 27, `$` bit 28).
    pub present: u32,
    /// Values by the same index; meaningless where the bit is clear. Integer words (D H L N O T $) hold whole numbers.
    pub values: [f64; 29],
    /// G-code of each group times ten, −1 = none.
    pub g: [i16; GROUPS],
    /// M-code of each group, −1 = none.
    pub m: [i16; M_GROUPS],
    /// How many M-codes.
    pub m_count: u8,
    /// M100 … M199, −1 = none.
    pub user_m: i16,
    /// The motion this block makes (G-code times ten), −1 = none.
    pub motion: i16,
}

impl Default for Block {
    fn default() -> Self {
        Block { present: 0, values: [0.0; 29], g: [-1; GROUPS], m: [-1; M_GROUPS], m_count: 0, user_m: -1, motion: -1 }
    }
}

/// Index of a letter (lower case, `@`, `^`, `$`).
pub const fn slot(letter: u8) -> usize {
    match letter {
        b'@' => 26,
        b'^' => 27,
        b'$' => 28,
        l => (l - b'a') as usize,
    }
}

impl Block {
    /// Forgets everything.
    pub fn clear(&mut self) {
        self.present = 0;
        self.g = [-1; GROUPS];
        self.m = [-1; M_GROUPS];
        self.m_count = 0;
        self.user_m = -1;
        self.motion = -1;
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
}
