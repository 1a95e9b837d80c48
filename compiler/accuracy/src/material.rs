//! Materials and the forces they are cut with.

use std::sync::LazyLock;

/// A row of the table of materials.
#[derive(Clone, PartialEq, Debug)]
pub struct Material {
    /// Its id.
    pub id: String,
    /// Names it is known by.
    pub names: Vec<String>,
    /// For people.
    pub title: String,
    /// Specific cutting force of a chip 1 mm thick, N/mm².
    pub kc11: f64,
    /// Exponent.
    pub mc: f64,
    /// Where the numbers come from.
    pub source: String,
    /// Chip thickness the numbers are good for, mm.
    pub range: (f64, f64),
}

#[derive(serde::Deserialize)]
struct File {
    source: String,
    range: (f64, f64),
    material: Vec<Row>,
}

#[derive(serde::Deserialize)]
struct Row {
    id: String,
    names: Vec<String>,
    title: String,
    kc11: f64,
    mc: f64,
    source: Option<String>,
}

static TABLE: LazyLock<Vec<Material>> = LazyLock::new(|| {
    let file: File = toml::from_str(include_str!("../../../spec/materials/materials.toml"))
        .expect("the table of materials is tested");
    let row = |r: Row| Material {
        id: r.id,
        names: r.names,
        title: r.title,
        kc11: r.kc11,
        mc: r.mc,
        source: r.source.unwrap_or_else(|| file.source.clone()),
        range: file.range,
    };
    file.material.into_iter().map(row).collect()
});

/// All materials, in the order of the table.
pub fn materials() -> &'static [Material] {
    &TABLE
}

/// Letters and digits only, lower case.
fn plain(name: &str) -> String {
    name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect()
}

/// A material by id or any of its names; spaces, hyphens and case don't count.
pub fn find(name: &str) -> Option<&'static Material> {
    let wanted = plain(name);
    let is = |n: &String| plain(n) == wanted;
    materials().iter().find(|m| is(&m.id)).or_else(|| materials().iter().find(|m| m.names.iter().any(is)))
}

/// A cut with a milling tool.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Cut {
    /// Diameter of the tool, mm.
    pub diameter: f64,
    /// Teeth.
    pub teeth: f64,
    /// Feed of the tool point, mm/min.
    pub feed: f64,
    /// Turns per minute.
    pub speed: f64,
    /// Depth along the tool axis, mm.
    pub depth: f64,
    /// Width across the tool axis, mm.
    pub width: f64,
    /// Angle of the cutting edge, rad; 90° on an end mill.
    pub edge: f64,
}

/// The forces of a cut, N.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Force {
    /// Feed per turn, mm.
    pub per_turn: f64,
    /// Feed per tooth, mm.
    pub per_tooth: f64,
    /// Chip thickness, mm.
    pub chip: f64,
    /// Angle of the engaged tooth that is looked at, rad.
    pub angle: f64,
    /// Specific cutting force, N/mm².
    pub specific: f64,
    /// Cutting force.
    pub cutting: f64,
    /// Force against the feed.
    pub feed: f64,
}

/// Share of the cutting force that acts against the feed.
const FEED_SHARE: f64 = 0.2;

impl Cut {
    /// The forces by Kienzle's law, as Gojtan 2009 section 8.3 applies it: the chips of one turn count at once, the
    /// tooth looked at stands at two thirds of the engagement. None when a value is not above zero.
    pub fn force(&self, material: &Material) -> Option<Force> {
        let all = [self.diameter, self.teeth, self.feed, self.speed, self.depth, self.width, self.edge];
        if !all.iter().all(|v| *v > 0.0 && v.is_finite()) {
            return None;
        }
        let per_turn = self.feed / self.speed;
        let per_tooth = per_turn / self.teeth;
        let angle = 2.0 / 3.0 * libm::asin((2.0 * self.width / self.diameter).min(1.0));
        let chip = per_tooth * libm::sin(self.edge);
        let specific = material.kc11 * libm::pow(chip, -material.mc);
        let cutting = self.depth * per_turn * specific;
        Some(Force { per_turn, per_tooth, chip, angle, specific, cutting, feed: FEED_SHARE * cutting })
    }
}

/// A hole drilled into the full or made wider.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Bore {
    /// Diameter of the drill, mm.
    pub diameter: f64,
    /// Diameter of the hole before it, mm; 0 = none.
    pub before: f64,
    /// Lips.
    pub lips: f64,
    /// Angle between the axis and a lip, rad: half of the point's angle.
    pub edge: f64,
    /// Feed along the axis, mm/min.
    pub feed: f64,
    /// Turns per minute.
    pub speed: f64,
}

impl Bore {
    /// Thrust along the axis, N, and thickness of the chip, mm: Ff = 0.5 · kc · (D − d)/2 · f · sin κ with kc by Kienzle's law
    /// for h = f/z · sin κ (Sandvik Coromant, technical guide, formulas for drilling; with d = 0). The chisel edge is in the
    /// factor, the forces of the lips across the axis hold each other. None when a value is not above zero.
    pub fn thrust(&self, material: &Material) -> Option<(f64, f64)> {
        let all = [self.diameter - self.before, self.lips, self.edge, self.feed, self.speed];
        if !all.iter().all(|v| *v > 0.0 && v.is_finite()) {
            return None;
        }
        let per_turn = self.feed / self.speed;
        let chip = per_turn / self.lips * libm::sin(self.edge);
        let specific = material.kc11 * libm::pow(chip, -material.mc);
        let width = (self.diameter - self.before) / 2.0;
        Some((0.5 * specific * width * per_turn * libm::sin(self.edge), chip))
    }
}

impl Force {
    /// The force on the tool as a vector: against the motion, for a feed direction and the tool axis (unit vectors) from the
    /// tip to the spindle, the tool turning clockwise as seen from there (M3); with the axis turned round it turns the other way.
    /// None for a feed along the axis: the law is that of milling across it, and a drill's thrust is [`Bore`]'s.
    pub fn vector(&self, feed: [f64; 3], axis: [f64; 3]) -> Option<[f64; 3]> {
        use gr_machine::math::{add, cross, dot, norm, scale, sub};
        let across = sub(feed, scale(axis, dot(feed, axis)));
        let size = norm(across);
        if size < 0.1 {
            return None;
        }
        let u = scale(across, 1.0 / size);
        let side = cross(axis, u);
        // The direction of the cutting force lies 90° − angle ahead of the feed.
        let turned = add(scale(u, libm::sin(self.angle)), scale(side, libm::cos(self.angle)));
        Some(scale(add(scale(turned, self.cutting), scale(u, self.feed)), -1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_values() {
        assert_eq!(find("AISI-1045").map(|m| m.kc11), Some(2110.0));
        assert_eq!(find("ck 45").map(|m| m.id.as_str()), Some("c45e"));
        assert!(find("cheese").is_none());
        let mut ids: Vec<&str> = materials().iter().map(|m| m.id.as_str()).collect();
        ids.sort_unstable();
        ids.dedup();
        assert_eq!(ids.len(), materials().len());
        for m in materials() {
            assert!(m.kc11 > 500.0 && m.kc11 < 5000.0 && m.mc > 0.1 && m.mc < 0.4 && !m.source.is_empty(), "{m:?}");
        }
    }

    /// Gojtan 2009, tables 8.2 to 8.4 and section 8.3.
    #[test]
    fn force_of_the_thesis() {
        let speed = 1000.0 * 500.0 / (std::f64::consts::PI * 100.0);
        let edge = std::f64::consts::FRAC_PI_2;
        let cut = Cut { diameter: 100.0, teeth: 14.0, feed: 50.0, speed, depth: 0.5, width: 50.0, edge };
        let f = cut.force(find("1045").unwrap()).unwrap();
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-9 * b.abs().max(1.0), "{a} {b}");
        near(speed, 1591.5494309189532);
        near(f.per_turn, 0.031415926535897934);
        near(f.chip, 0.002243994752564138);
        near(f.specific, 5951.257516549875);
        near(f.cutting, 93.48213446807063);
        near(f.feed, 18.696426893614127);
        near(f.angle, std::f64::consts::FRAC_PI_3);
        near(libm::hypot(f.cutting, f.feed), 95.33344556499935);
        let x = f.vector([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]).unwrap();
        near(x[0], -99.65433014295618);
        near(x[1], -46.74106723403531);
        let y = f.vector([0.0, 1.0, 0.0], [0.0, 0.0, 1.0]).unwrap();
        near(y[0], 46.741067234035334);
        near(y[1], -99.65433014295617);
        assert!(f.vector([0.0, 0.0, -1.0], [0.0, 0.0, 1.0]).is_none());
    }

    /// D10, two lips, point of 118°, 0.3 mm a turn in C45E: kc = 2220 · 0.12858^−0.14 = 2958.5 N/mm².
    #[test]
    fn thrust_of_a_drill() {
        let edge = 59f64.to_radians();
        let bore = Bore { diameter: 10.0, before: 0.0, lips: 2.0, edge, feed: 300.0, speed: 1000.0 };
        let (thrust, chip) = bore.thrust(find("C45E").unwrap()).unwrap();
        assert!((chip - 0.128575).abs() < 1e-6, "{chip}");
        assert!((thrust - 1901.945).abs() < 1e-3, "{thrust}");
        // A hole before it takes its share away; no feed, no thrust.
        let (wider, _) = Bore { before: 5.0, ..bore }.thrust(find("C45E").unwrap()).unwrap();
        assert!((wider - thrust / 2.0).abs() < 1e-9);
        assert!(Bore { feed: 0.0, ..bore }.thrust(find("C45E").unwrap()).is_none());
    }
}
