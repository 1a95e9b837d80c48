use crate::math::{Frame, V3, cross, dot, norm, scale, sub};
use crate::{JointKind, Kinematics, Opw, ParallelWrist, Serial};

/// An arm in closed form that equals a chain.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Fit {
    /// The arm.
    pub arm: Opw,
    /// Turn of the chain's flange on the arm's, where they differ by one (some files give their flange other axes).
    pub flange: Frame,
    /// Greatest distance of the two over a set of joint values, mm.
    pub residual: f64,
}

/// OPW lengths, offsets and signs of a chain of six turning joints, or why it has none.
///
/// The signs and offsets of the arm are those of its axes; the first axis must point along Z of the base, the second
/// and third must be parallel and level, the last three must meet in one point.
pub fn identify(chain: &Serial) -> Result<Fit, String> {
    let joints = chain.links();
    if joints.len() != 6 || joints.iter().any(|l| l.kind != JointKind::Revolute) {
        return Err(format!("it has {} joints; an arm in closed form has six turning ones", joints.len()));
    }
    let axes = axes_at_zero(chain);
    geometry(&axes)?;
    let mut best: Option<Fit> = None;
    for mask in 0..64u8 {
        let signs = [0, 1, 2, 3, 4, 5].map(|i| if mask & (1 << i) == 0 { 1.0 } else { -1.0 });
        for offsets in candidates() {
            if let Some(fit) = try_fit(chain, signs, offsets) {
                if best.as_ref().is_none_or(|b| rank(&fit) < rank(b)) {
                    best = Some(fit);
                }
            }
        }
    }
    best.ok_or_else(|| "its zero position is turned by other than quarter turns".to_string())
}

/// Which of several equal arms is taken: the least. A model whose first axis is turned by half a turn has its front where the arm
/// has its back, a1 below zero, and calls forward what is backward.
fn rank(fit: &Fit) -> (bool, bool, bool, usize) {
    let (offsets, signs) = (fit.arm.offsets(), fit.arm.signs());
    let plain = offsets.iter().filter(|o| **o != 0.0).count() * 8 + signs.iter().filter(|s| **s < 0.0).count();
    (fit.flange != Frame::IDENTITY, fit.arm.lengths()[0] < 0.0, offsets[0] != 0.0, plain)
}

/// Offsets of the joints, quarter turns; the sixth and fourth take halves too.
fn candidates() -> impl Iterator<Item = [f64; 6]> {
    const Q: f64 = std::f64::consts::FRAC_PI_2;
    let quarters = [0.0, Q, -Q, 2.0 * Q];
    let halves = [0.0, 2.0 * Q];
    quarters.into_iter().flat_map(move |a| {
        quarters.into_iter().flat_map(move |b| {
            quarters.into_iter().flat_map(move |c| {
                halves.into_iter().flat_map(move |d| quarters.into_iter().map(move |f| [a, b, c, d, 0.0, f]))
            })
        })
    })
}

fn axes_at_zero(chain: &Serial) -> Vec<(V3, V3)> {
    let mut here = Frame::IDENTITY;
    chain
        .links()
        .iter()
        .map(|l| {
            here = here.then(&l.origin);
            (crate::math::rotate(&here.turn, l.axis), here.position)
        })
        .collect()
}

fn geometry(axes: &[(V3, V3)]) -> Result<(), String> {
    const EPS: f64 = 1e-6;
    let parallel = |a: V3, b: V3| norm(cross(a, b)) < EPS;
    if !parallel(axes[0].0, [0.0, 0.0, 1.0]) || norm([axes[0].1[0], axes[0].1[1], 0.0]) > 1e-3 {
        return Err("its first axis is not the Z axis of the base".into());
    }
    if dot(axes[1].0, axes[0].0).abs() > EPS || !parallel(axes[1].0, axes[2].0) {
        return Err("its second and third axes are not parallel to each other and level".into());
    }
    if parallel(axes[2].0, axes[3].0) || dot(axes[3].0, axes[4].0).abs() > EPS {
        return Err("three of its axes are parallel: it needs the solver for arms with an offset wrist".into());
    }
    let Some(centre) = meeting(axes[3], axes[4]) else {
        return Err("its fourth and fifth axes don't meet: it has no spherical wrist".into());
    };
    let gap = cross(sub(centre, axes[5].1), axes[5].0);
    if norm(gap) > 1e-3 {
        return Err(format!("its sixth axis passes the wrist at {} mm: it has no spherical wrist", crate::short(norm(gap))));
    }
    Ok(())
}

/// Where two lines meet.
fn meeting((a, p): (V3, V3), (b, q): (V3, V3)) -> Option<V3> {
    let n = cross(a, b);
    let square = dot(n, n);
    let between = sub(q, p);
    if square < 1e-12 || dot(between, n).abs() / square.sqrt() > 1e-3 {
        return None;
    }
    let t = dot(cross(between, b), n) / square;
    Some(crate::math::add(p, scale(a, t)))
}

/// Lengths by least squares for these signs and offsets, if the chain then equals the arm.
fn try_fit(chain: &Serial, signs: [f64; 6], offsets: [f64; 6]) -> Option<Fit> {
    let unit = |i: usize| {
        let mut lengths = [0.0; 7];
        lengths[i] = 1.0;
        Opw::new(lengths, offsets, signs)
    };
    let zero = chain.forward_frame(&[0.0; 6]).ok()?;
    let turn = Opw::new([0.0; 7], offsets, signs).flange(&[0.0; 6]).inverse().then(&Frame::turned(zero.turn));
    let flange = if turn.error_to(&Frame::IDENTITY).1.iter().all(|v| v.abs() < 1e-9) { Frame::IDENTITY } else { Frame::turned(turn.turn) };
    // Cheap first: one other pose must have the same direction.
    let poses = poses();
    let other = chain.forward_frame(&poses[0]).ok()?;
    let direction = Opw::new([0.0; 7], offsets, signs).flange(&poses[0]).then(&flange);
    if direction.error_to(&other).1.iter().any(|v| v.abs() > 1e-6) {
        return None;
    }
    let arms = [0, 1, 2, 3, 4, 5, 6].map(unit);
    let lengths = least_squares(&poses, |q| Some(chain.forward_frame(q).ok()?.position), |i, q| Some(arms[i].flange(q).position))?;
    let arm = Opw::new(lengths, offsets, signs);
    let mut residual = 0.0f64;
    for q in &poses {
        let (p, r) = arm.flange(q).then(&flange).error_to(&chain.forward_frame(q).ok()?);
        residual = residual.max(norm(p)).max(norm(r) * 100.0);
    }
    (residual < 1e-3 && lengths[4] > 0.0).then_some(Fit { arm, flange, residual })
}

/// Joint values far from each other, to compare arms at.
fn poses() -> Vec<[f64; 6]> {
    (0..8).map(|n| [0, 1, 2, 3, 4, 5].map(|i| libm::sin((n * 7 + i * 3 + 1) as f64) * 1.4)).collect()
}

/// Lengths of an arm whose place is a sum of lengths times directions, from places where it should be; `column` is where it is
/// when one length is 1 and the others are 0.
fn least_squares<const N: usize>(
    poses: &[[f64; 6]],
    want: impl Fn(&[f64; 6]) -> Option<V3>,
    column: impl Fn(usize, &[f64; 6]) -> Option<V3>,
) -> Option<[f64; N]> {
    let (mut a, mut b) = (vec![vec![0.0; N]; N], vec![0.0; N]);
    for q in poses {
        let want = want(q)?;
        let columns: Vec<V3> = (0..N).map(|i| column(i, q)).collect::<Option<_>>()?;
        for i in 0..N {
            (0..N).for_each(|k| a[i][k] += dot(columns[i], columns[k]));
            b[i] += dot(columns[i], want);
        }
    }
    let found = crate::math::solve(a, b)?;
    Some(std::array::from_fn(|i| if found[i].abs() < 1e-6 { 0.0 } else { found[i] }))
}

/// The arm with an offset wrist that equals a chain seen from `base`, if there is one.
pub(crate) fn offset_wrist(chain: &Serial, base: &Frame) -> Option<ParallelWrist> {
    if chain.links().len() != 6 || chain.links().iter().any(|l| l.kind != JointKind::Revolute) {
        return None;
    }
    let seen = |q: &[f64; 6]| Some(base.inverse().then(&chain.forward_frame(q).ok()?));
    let unit = |i: usize| ParallelWrist::new(std::array::from_fn(|k| if i == k { 1.0 } else { 0.0 }));
    let poses = poses();
    let column = |i: usize, q: &[f64; 6]| Some(unit(i).forward_frame(q).ok()?.position);
    let arm = ParallelWrist::new(least_squares(&poses, |q| Some(seen(q)?.position), column)?);
    let equal = |q: &[f64; 6]| {
        let (p, r) = arm.forward_frame(q).ok()?.error_to(&seen(q)?);
        (norm(p) < 1e-3 && norm(r) < 1e-5).then_some(())
    };
    let [_, a2, a3, ..] = arm.lengths();
    (a2 != 0.0 && a3 != 0.0 && poses.iter().all(|q| equal(q).is_some())).then_some(arm)
}
