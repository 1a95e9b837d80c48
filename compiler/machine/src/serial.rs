use crate::JointKind;
use crate::kinematics::{Control, Kinematics, KinematicsError, Solution, checked};
use crate::math::{Frame, V3, about, cross, dot, norm, rot_x, rot_z, rotate, scale, solve, sub};

/// Chain of joints one after the other, given by the frame of each joint in the one before (as URDF has it) or by
/// Denavit–Hartenberg rows. Forward exact; inverse by damped least squares with respect for the joint limits: it
/// finds solutions, not necessarily all of them.
#[derive(Clone, PartialEq, Debug)]
pub struct Serial {
    links: Vec<Link>,
    tip: Frame,
}

/// One joint of a chain.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Link {
    /// Its frame in the one of the joint before, at joint value 0.
    pub origin: Frame,
    /// Unit vector it turns about or slides along, in its own frame.
    pub axis: V3,
    /// Turns or slides.
    pub kind: JointKind,
    /// Least and greatest value.
    pub limits: (f64, f64),
}

impl Link {
    /// Whether it turns about the axis of the joint before it, or slides along its direction, wherever that one stands.
    pub(crate) fn repeats(&self, before: &Link) -> bool {
        let axis = rotate(&self.origin.turn, self.axis);
        if self.kind != before.kind || norm(cross(axis, before.axis)) > 1e-9 {
            return false;
        }
        let off = sub(self.origin.position, scale(before.axis, dot(self.origin.position, before.axis)));
        self.kind == JointKind::Prismatic || norm(off) <= 1e-9
    }
}

/// A Denavit–Hartenberg row: a and d in mm, alpha and theta in rad; the joint value adds to theta or d.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct DhRow {
    /// Length of the common normal.
    pub a: f64,
    /// Shift along the axis.
    pub d: f64,
    /// Twist.
    pub alpha: f64,
    /// Angle.
    pub theta: f64,
}

impl Serial {
    /// From links and the frame of the flange in the last joint.
    pub fn new(links: Vec<Link>, tip: Frame) -> Serial {
        Serial { links, tip }
    }

    /// From standard (distal) rows: Rz(theta)·Tz(d)·Tx(a)·Rx(alpha).
    pub fn dh(rows: &[(DhRow, JointKind, (f64, f64))]) -> Serial {
        let mut tail = Frame::IDENTITY;
        let mut links = Vec::with_capacity(rows.len());
        for (row, kind, limits) in rows {
            let origin = tail.then(&Frame { turn: rot_z(row.theta), position: [0.0, 0.0, row.d] });
            links.push(Link { origin, axis: [0.0, 0.0, 1.0], kind: *kind, limits: *limits });
            tail = Frame { turn: rot_x(row.alpha), position: [row.a, 0.0, 0.0] };
        }
        Serial { links, tip: tail }
    }

    /// From modified (proximal) rows: Rx(alpha)·Tx(a)·Rz(theta)·Tz(d).
    pub fn mdh(rows: &[(DhRow, JointKind, (f64, f64))], tip: Frame) -> Serial {
        let link = |(row, kind, limits): &(DhRow, JointKind, (f64, f64))| {
            let lean = Frame { turn: rot_x(row.alpha), position: [row.a, 0.0, 0.0] };
            let origin = lean.then(&Frame { turn: rot_z(row.theta), position: [0.0, 0.0, row.d] });
            Link { origin, axis: [0.0, 0.0, 1.0], kind: *kind, limits: *limits }
        };
        Serial { links: rows.iter().map(link).collect(), tip }
    }

    /// The joints.
    pub fn links(&self) -> &[Link] {
        &self.links
    }
    /// The flange in the frame of the last joint.
    pub fn tip(&self) -> &Frame {
        &self.tip
    }

    /// Flange and, for each joint, its axis and a point on it, in the base.
    fn walk(&self, joints: &[f64]) -> (Frame, Vec<(V3, V3)>) {
        let mut here = Frame::IDENTITY;
        let mut axes = Vec::with_capacity(joints.len());
        for (link, q) in self.links.iter().zip(joints) {
            here = here.then(&link.origin);
            axes.push((rotate(&here.turn, link.axis), here.position));
            let step = match link.kind {
                JointKind::Revolute => Frame::turned(about(link.axis, *q)),
                JointKind::Prismatic => Frame::shift(scale(link.axis, *q)),
            };
            here = here.then(&step);
        }
        (here.then(&self.tip), axes)
    }

    /// The base, a point on each joint's axis, the flange.
    pub(crate) fn figure(&self, joints: &[f64]) -> Vec<V3> {
        let (flange, axes) = self.walk(joints);
        let inner = axes.into_iter().map(|(_, point)| point);
        std::iter::once([0.0; 3]).chain(inner).chain([flange.position]).collect()
    }

    /// Velocity of the flange (mm, then rad) per unit of each joint: one column per joint.
    pub fn jacobian(&self, joints: &[f64]) -> Result<Vec<[f64; 6]>, KinematicsError> {
        let (flange, axes) = self.walk(checked(joints, self.links.len())?);
        let column = |(link, (axis, point)): (&Link, &(V3, V3))| match link.kind {
            JointKind::Revolute => {
                let v = cross(*axis, sub(flange.position, *point));
                [v[0], v[1], v[2], axis[0], axis[1], axis[2]]
            }
            JointKind::Prismatic => [axis[0], axis[1], axis[2], 0.0, 0.0, 0.0],
        };
        Ok(self.links.iter().zip(&axes).map(column).collect())
    }

    /// How many mm count as one radian when errors are weighed.
    fn size(&self) -> f64 {
        let sum: f64 = self.links.iter().map(|l| norm(l.origin.position)).sum::<f64>() + norm(self.tip.position);
        (sum / 4.0).max(1.0)
    }

    /// Joint values near a start, within the limits; what is left over when there are none.
    pub fn search(&self, aim: &Frame, start: &[f64]) -> Result<Vec<f64>, KinematicsError> {
        if !aim.is_finite() {
            return Err(KinematicsError::NotFinite);
        }
        let mut q: Vec<f64> = checked(start, self.links.len())?.to_vec();
        self.clamp(&mut q);
        let size = self.size();
        let (mut damping, mut best) = (1e-3, self.residual(&q, aim, size));
        for _ in 0..200 {
            let square: f64 = best.iter().map(|e| e * e).sum();
            if square < 1e-24 {
                break;
            }
            let Some(next) = self.step(&q, &best, size, damping) else { break };
            let trial = self.residual(&next, aim, size);
            let after: f64 = trial.iter().map(|e| e * e).sum();
            if after < square {
                (q, best) = (next, trial);
                damping = (damping * 0.1).max(1e-14);
            } else {
                damping *= 10.0;
                if damping > 1e6 {
                    break;
                }
            }
        }
        let (shift, angle) = (libm::sqrt(best[..3].iter().map(|e| e * e).sum()) * size, libm::sqrt(best[3..].iter().map(|e| e * e).sum()));
        if shift <= 1e-7 * size.max(1.0) / 100.0 && angle <= 1e-8 { Ok(q) } else { Err(KinematicsError::NotFound { distance: shift, angle }) }
    }

    /// Error of the flange: shift in units of `size`, rotation vector in rad.
    fn residual(&self, q: &[f64], aim: &Frame, size: f64) -> [f64; 6] {
        let (p, r) = self.walk(q).0.error_to(aim);
        [p[0] / size, p[1] / size, p[2] / size, r[0], r[1], r[2]]
    }

    /// One damped step; a joint at its limit that would leave is held and the step found again without it.
    fn step(&self, q: &[f64], error: &[f64; 6], size: f64, damping: f64) -> Option<Vec<f64>> {
        let columns = self.jacobian(q).ok()?;
        let unit = |i: usize| if self.links[i].kind == JointKind::Prismatic { size } else { 1.0 };
        let columns: Vec<[f64; 6]> = columns
            .iter()
            .enumerate()
            .map(|(i, c)| [0, 1, 2, 3, 4, 5].map(|k| c[k] * unit(i) / if k < 3 { size } else { 1.0 }))
            .collect();
        let mut held = vec![false; q.len()];
        loop {
            let n = q.len();
            let mut a = vec![vec![0.0; n]; n];
            let mut b = vec![0.0; n];
            for i in 0..n {
                if held[i] {
                    a[i][i] = 1.0;
                    continue;
                }
                for k in 0..n {
                    if !held[k] {
                        a[i][k] = (0..6).map(|m| columns[i][m] * columns[k][m]).sum();
                    }
                }
                a[i][i] += damping;
                b[i] = (0..6).map(|m| columns[i][m] * error[m]).sum();
            }
            let d = solve(a, b)?;
            let next: Vec<f64> = (0..n).map(|i| q[i] + (d[i] * unit(i)).clamp(-unit(i), unit(i))).collect();
            let leaves = (0..n).find(|i| {
                let (min, max) = self.links[*i].limits;
                !held[*i] && ((next[*i] > max && q[*i] >= max) || (next[*i] < min && q[*i] <= min))
            });
            match leaves {
                Some(i) => held[i] = true,
                None => {
                    let mut next = next;
                    self.clamp(&mut next);
                    return Some(next);
                }
            }
        }
    }

    fn clamp(&self, q: &mut [f64]) {
        for (v, l) in q.iter_mut().zip(&self.links) {
            *v = v.clamp(l.limits.0, l.limits.1.max(l.limits.0));
        }
    }

    /// Starts spread over the joint ranges, always the same ones.
    fn starts(&self) -> Vec<Vec<f64>> {
        let span = |l: &Link| {
            let wide = if l.kind == JointKind::Revolute { std::f64::consts::PI } else { 1000.0 };
            (l.limits.0.max(-wide), l.limits.1.min(wide))
        };
        let middle = self.links.iter().map(|l| (span(l).0 + span(l).1) / 2.0).collect();
        let mut out = vec![middle];
        let mut state = 0x9E37_79B9_7F4A_7C15u64;
        for _ in 0..40 {
            let mut one = Vec::with_capacity(self.links.len());
            for l in &self.links {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                let (min, max) = span(l);
                one.push(min + (max - min) * (state >> 11) as f64 / (1u64 << 53) as f64);
            }
            out.push(one);
        }
        out
    }
}

impl Kinematics for Serial {
    fn joint_count(&self) -> usize {
        self.links.len()
    }
    fn control(&self) -> Control {
        if self.links.len() < 6 { Control::Axis } else { Control::Full }
    }
    fn forward_frame(&self, joints: &[f64]) -> Result<Frame, KinematicsError> {
        Ok(self.walk(checked(joints, self.links.len())?).0)
    }
    fn inverse_frame(&self, frame: &Frame) -> Result<Vec<Solution>, KinematicsError> {
        let mut out: Vec<Solution> = Vec::new();
        let mut nearest = None;
        for start in self.starts() {
            match self.search(frame, &start) {
                Ok(q) => {
                    let same = |s: &Solution| s.joints.iter().zip(&q).all(|(a, b)| (a - b).abs() < 1e-4);
                    if !out.iter().any(same) && out.len() < 16 {
                        let singular = crate::differential::condition(&self.jacobian(&q)?, self.size()) > 1e8;
                        out.push(Solution { joints: q, branch: out.len() as u8, singular });
                    }
                }
                Err(KinematicsError::NotFound { distance, angle }) => {
                    if nearest.is_none_or(|(d, a): (f64, f64)| distance + angle < d + a) {
                        nearest = Some((distance, angle));
                    }
                }
                Err(other) => return Err(other),
            }
        }
        let (distance, angle) = nearest.unwrap_or_default();
        if out.is_empty() { Err(KinematicsError::NotFound { distance, angle }) } else { Ok(out) }
    }
}

