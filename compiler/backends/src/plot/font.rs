//! A stroke font: letters, digits and a few signs on a grid 4 wide and 6 high.

/// Strokes of a character: polylines of points (x 0 … 4, y up), as pairs of digits; `/` and `.` are one and
/// two below the baseline.
fn strokes(c: char) -> &'static str {
    match c {
        '0' => "103041453616050110",
        '1' => "152620 1030",
        '2' => "0516364544000040",
        '3' => "0516364544334241301001 1333",
        '4' => "30360242",
        '5' => "460603334241301001",
        '6' => "4536160501103041423303",
        '7' => "064610",
        '8' => "13040516364544331302011030414233",
        '9' => "0110304145361605041343",
        'A' => "0004264440 0242",
        'B' => "00063645443303 3342413000",
        'C' => "4536160501103041",
        'D' => "000626444220 0020",
        'E' => "46060040 0333",
        'F' => "460600 0333",
        'G' => "45361605011030414323",
        'H' => "0006 4046 0343",
        'I' => "1030 2026 1636",
        'J' => "4641301001",
        'K' => "0006 0246 1340",
        'L' => "060040",
        'M' => "0006234640",
        'N' => "00064046",
        'O' => "103041453616050110",
        'P' => "00063645443303",
        'Q' => "103041453616050110 2240",
        'R' => "00063645443303 2340",
        'S' => "453616050413334241301001",
        'T' => "0646 2026",
        'U' => "060110304146",
        'V' => "062046",
        'W' => "0610233046",
        'X' => "0046 0640",
        'Y' => "062346 2320",
        'Z' => "06460040",
        'a' => "04243330 3010011232",
        'b' => "06002031332404",
        'c' => "341403011030",
        'd' => "36301001031434",
        'e' => "023233241403011030",
        'f' => "10152636 0434",
        'g' => "341403011030 343/2.0.",
        'h' => "0600 04243330",
        'i' => "1014 1516",
        'j' => "242/1.0. 2526",
        'k' => "0600 0234 1230",
        'l' => "1610",
        'm' => "0004 04142320 23344340",
        'n' => "0004 04243330",
        'o' => "102031332414030110",
        'p' => "040. 042433312000",
        'q' => "343. 341403011030",
        'r' => "0004 031434",
        's' => "3414031222312000",
        't' => "16112030 0434",
        'u' => "04011030 3430",
        'v' => "042044",
        'w' => "0410233044",
        'x' => "0034 0430",
        'y' => "0420 441.0.",
        'z' => "04340030",
        '-' => "1333",
        '+' => "1333 2224",
        '.' => "2021",
        ',' => "2110",
        ':' => "2122 2425",
        '/' => "0046",
        '(' => "36242230",
        ')' => "16242210",
        '=' => "0242 0444",
        '_' => "0040",
        '%' => "0046 0506 4041",
        '×' => "1133 1331",
        '°' => "1516262515",
        '#' => "1016 3036 0242 0444",
        '"' => "1416 3436",
        '\'' => "2426",
        ' ' => "",
        _ => "0040460600",
    }
}

/// Advance per character as a share of the height.
const ADVANCE: f32 = 0.92;

/// Width of a text of this height.
pub fn width(text: &str, height: f32) -> f32 {
    (text.chars().count() as f32 * ADVANCE - 0.25).max(0.0) * height
}

/// Gives the lines of a text whose baseline begins at `at` (y down).
pub fn lines(text: &str, at: [f32; 2], height: f32, mut to: impl FnMut([f32; 2], [f32; 2])) {
    let unit = height / 6.0;
    for (i, c) in text.chars().enumerate() {
        let left = at[0] + i as f32 * ADVANCE * height;
        for polyline in strokes(c).split(' ') {
            let mut last = None;
            for pair in polyline.as_bytes().chunks_exact(2) {
                let p = [left + grid(pair[0]) * unit, at[1] - grid(pair[1]) * unit];
                if let Some(q) = last {
                    to(q, p);
                }
                last = Some(p);
            }
        }
    }
}

fn grid(digit: u8) -> f32 {
    f32::from(digit) - f32::from(b'0')
}

#[cfg(test)]
mod tests {
    #[test]
    fn strokes_stay_on_the_grid() {
        for c in (' '..='~').chain("×°".chars()) {
            for part in super::strokes(c).split(' ') {
                for pair in part.as_bytes().chunks(2) {
                    assert!(
                        pair.len() == 2 && (b'0'..=b'4').contains(&pair[0]) && (b'.'..=b'6').contains(&pair[1]),
                        "{c}"
                    );
                }
            }
        }
    }
}
