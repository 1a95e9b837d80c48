/// Degrees of freedom of a mechanism, by the formula of Grübler and Kutzbach for spatial mechanisms.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Mobility {
    /// Links, base and platform included.
    pub links: usize,
    /// Joints.
    pub joints: usize,
    /// Sum of the freedoms of the joints.
    pub freedoms: usize,
    /// M = 6·(links − 1) − Σ(6 − f), plus the joints of a serial part.
    pub freedom: i64,
}

/// From a structure as the literature writes it: legs joined by `+`, each a number and its joints from the base to
/// the platform (`R`, `P` one freedom, `U`, `C` two, `S` three); what follows a `,` is a serial chain on the
/// platform: `2UPS+PRP`, `3UPS+UP,RRR`.
pub fn mobility(structure: &str) -> Result<Mobility, String> {
    let (parallel, serial) = structure.split_once(',').unwrap_or((structure, ""));
    let mut all = Mobility { links: 2, joints: 0, freedoms: 0, freedom: 0 };
    for leg in parallel.split('+') {
        let digits = leg.bytes().take_while(u8::is_ascii_digit).count();
        let (count, chain) = leg.split_at(digits);
        let count: usize = if count.is_empty() { 1 } else { count.parse().map_err(|_| format!("`{count}` legs"))? };
        if chain.is_empty() || count == 0 || count > 64 {
            return Err(format!("`{leg}` is no leg"));
        }
        let freedoms = freedoms(chain)?;
        all.links += count * (chain.len() - 1);
        all.joints += count * chain.len();
        all.freedoms += count * freedoms;
    }
    let serial = freedoms(serial)?;
    all.freedom = 6 * (all.links as i64 - 1) - (6 * all.joints as i64 - all.freedoms as i64) + serial as i64;
    Ok(all)
}

/// The joints of a chain as letters.
pub(crate) fn letters(joints: &[crate::Joint]) -> String {
    joints.iter().map(|j| if j.kind == crate::JointKind::Revolute { 'R' } else { 'P' }).collect()
}

/// Whether a structure, good in itself, is that of another machine: a chain has its joints, in their order; a parallel
/// machine has as many driven joints in parallel legs as its kinematics drive. A mobility that differs is told apart.
pub(crate) fn of_another(structure: &str, machine: &crate::Machine) -> bool {
    let (parallel, wrist) = structure.split_once(',').unwrap_or((structure, ""));
    let legs = parallel.split('+').count();
    let several = legs > 1 || parallel.starts_with(|c: char| c.is_ascii_digit() && c != '1');
    match machine.chain {
        crate::Chain::Incomplete { .. } => false,
        crate::Chain::TwoLegs(_) => !several || !wrist.is_empty(),
        crate::Chain::Tricept(_) => !several || wrist.len() != 3,
        _ => several || single(parallel.trim_start_matches('1')) + &single(wrist) != letters(&machine.joints),
    }
}

/// A chain in joints of one freedom.
fn single(chain: &str) -> String {
    chain.chars().map(|c| match c {
        'U' => "RR",
        'S' => "RRR",
        'C' => "RP",
        'P' => "P",
        _ => "R",
    }).collect()
}

fn freedoms(chain: &str) -> Result<usize, String> {
    let one = |c: char| match c {
        'R' | 'P' | 'H' => Ok(1),
        'U' | 'C' => Ok(2),
        'S' => Ok(3),
        _ => Err(format!("`{c}` is no joint; joints are R P H U C S")),
    };
    chain.chars().map(one).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_mechanisms() {
        let m = mobility("2UPS+PRP").unwrap();
        assert_eq!((m.links, m.joints, m.freedoms, m.freedom), (8, 9, 15, 3));
        assert_eq!(mobility("3UPS+UP,RRR").unwrap().freedom, 6);
        assert_eq!(mobility("6UPS").unwrap().freedom, 6);
        assert_eq!(mobility("RRRRRR").unwrap().freedom, 6);
        assert_eq!(mobility("3UPS+PRP").unwrap().freedom, 3);
        assert!(mobility("2UPX").is_err());
        assert!(mobility("").is_err());
        assert!(mobility("99999999999999999999999RR").is_err());
    }
}
