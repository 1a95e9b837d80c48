//! Features and profiles.

use std::collections::BTreeMap;

use gr_step::Node;
use gr_text::code;

use super::{DEEPEST, Reader, origin, title};
use crate::frame::{Frame, norm, sub};
use crate::process::*;

/// More copies of one feature than this are a mistake.
const MOST_COPIES: usize = 100_000;

/// Half the band of a fit. The schema has `deviation` and `grade` as lengths: a fundamental deviation is the limit next to the
/// zero line (ISO 286-1), so the whole band, as wide as the standard tolerance, lies on one side of it, and half
/// of it is left each way. A `grade` of 1 and more is the number of a grade, not a length of anything that is called a fit.
fn half_of_fit(fit: Node<'_>) -> Option<f64> {
    fit.real("grade").filter(|g| *g > 0.0 && *g < 1.0).map(|g| g / 2.0)
}

/// Attributes of turned features and of their tapers that are diameters (ISO 14649-12).
const DIAMETERS: [&str; 4] = ["diameter_at_placement", "final_diameter", "major_diameter", "nominal_diameter"];

/// The least of the plus-or-minus tolerances of the lengths that a feature is made of: its diameter, the sides of its
/// profile, its radii; and one that can't be read. Its workpiece, its operations and other features are none of its lengths.
/// A tool that is off by so much makes a turned diameter off by twice as much: of such a one half is left.
fn tolerance(feature: Node<'_>) -> (Option<f64>, Option<Origin>) {
    let mut least: Option<f64> = None;
    let mut fit: Option<Origin> = None;
    let turned = feature.is_a("turning_feature");
    let mut seen = std::collections::BTreeSet::from([(feature.index(), false)]);
    let mut open = vec![(feature, false)];
    while let Some((node, across)) = open.pop() {
        let share = if across { 0.5 } else { 1.0 };
        if node.is_a("plus_minus_value") {
            let [upper, lower] = ["upper_limit", "lower_limit"].map(|n| node.real(n).map_or(0.0, f64::abs));
            // All on one side: the path is in the middle of the band, and half of it is left each way.
            let t = if upper.min(lower) > 0.0 { upper.min(lower) } else { upper.max(lower) / 2.0 };
            if t > 0.0 {
                least = Some(least.map_or(t * share, |l| l.min(t * share)));
            } else {
                fit = Some(fit.filter(|f| f.id < node.id()).unwrap_or(origin(node)));
            }
        }
        if node.is_a("limits_and_fits") {
            match half_of_fit(node) {
                Some(t) => least = Some(least.map_or(t * share, |l| l.min(t * share))),
                None => fit = Some(fit.filter(|f| f.id < node.id()).unwrap_or(origin(node))),
            }
        }
        let foreign = |n: &Node<'_>| n.is_a("workpiece") || n.is_a("machining_operation") || n.is_a("manufacturing_feature");
        let diameters: Vec<u32> = DIAMETERS.iter().filter(|_| turned).filter_map(|a| node.node(a)).map(|n| n.index()).collect();
        for next in node.references().filter(|n| !foreign(n)) {
            let across = across || diameters.contains(&next.index());
            if seen.len() < 10_000 && seen.insert((next.index(), across)) {
                open.push((next, across));
            }
        }
    }
    (least, fit)
}

/// The numbers of a pattern's element, and what leaves it out or moves it.
type Change<'m> = (Vec<i64>, Node<'m>);

/// The first two places of frames that are closer than that, and how far apart they are. Places are kept by cells as wide
/// as that, so that each is compared with those around it alone.
fn closer_than(least: f64, frames: &[Frame]) -> Option<([f64; 3], [f64; 3], f64)> {
    let mut cells: BTreeMap<[i64; 3], Vec<[f64; 3]>> = BTreeMap::new();
    for frame in frames {
        let p = frame.origin;
        let cell = p.map(|v| (v / least).floor() as i64);
        for n in 0..27 {
            let beside = [n % 3, n / 3 % 3, n / 9];
            let beside = std::array::from_fn(|i| cell[i].saturating_add(beside[i] - 1));
            let near = cells.get(&beside).into_iter().flatten().map(|q| (*q, norm(sub(*q, p))));
            if let Some((q, distance)) = near.into_iter().find(|(_, d)| *d < least) {
                return Some((q, p, distance));
            }
        }
        cells.entry(cell).or_default().push(p);
    }
    None
}

impl<'m> Reader<'m> {
    /// A feature in the frame of its setup. `operation` chooses among the elements of a compound feature.
    pub fn feature(&mut self, node: Node<'m>, setup: Option<&Setup>, operation: u64) -> Option<Feature> {
        let piece = node.node("its_workpiece").map(|w| w.id());
        let place = setup.and_then(|s| s.workpieces.iter().find(|p| Some(p.0) == piece)).map_or(Frame::default(), |p| p.1);
        let outer = self.outer(node, &place, 0)?;
        self.feature_in(node, outer, setup, operation)
    }

    /// A feature, or a pattern of it, in frames that its placement is relative to.
    fn feature_in(&mut self, node: Node<'m>, outer: Vec<Frame>, setup: Option<&Setup>, operation: u64) -> Option<Feature> {
        let (patterns, node, copies, replaced) = self.copies(node, outer)?;
        let placement = match node.node("feature_placement") {
            Some(p) => self.placement(p)?,
            None if node.is_a("two5d_manufacturing_feature") => {
                self.missing(node, "feature_placement", "it says where the feature lies");
                return None;
            }
            None => Frame::default(),
        };
        let copies: Vec<Frame> = if replaced { copies } else { copies.iter().map(|c| c.place(&placement)).collect() };
        let depth = self.depth(node, operation)?;
        let frame = copies.first().copied().unwrap_or(placement);
        if let ([first, second, ..], Some(circle)) = (&copies[..], patterns.iter().find(|p| p.keyword() == "CIRCULAR_PATTERN").copied())
            && first.origin.iter().zip(second.origin).all(|(a, b)| (a - b).abs() < 1e-9)
        {
            self.missing(circle, "base_feature_diameter", "all features of the pattern lie on one spot");
            return None;
        }
        let shape = self.shape(node, operation, &placement, &copies, setup)?;
        if let Some(pattern) = patterns.first() {
            self.apart(*pattern, &copies, &shape);
        }
        if shape.is_through() {
            self.goes_through(node, setup, &copies, depth);
        }
        let (keyword, name) = (node.keyword().to_string(), node.string("its_id").into_owned());
        let (tolerance, fit) = tolerance(node);
        Some(Feature { origin: origin(node), keyword, name, frame, placement, depth, shape, copies, tolerance, fit })
    }

    /// The patterns around a feature, what they repeat, and the frames its placement is relative to: in the place of
    /// which a general pattern puts its own, then the last is true.
    #[allow(clippy::type_complexity)]
    fn copies(&mut self, node: Node<'m>, outer: Vec<Frame>) -> Option<(Vec<Node<'m>>, Node<'m>, Vec<Frame>, bool)> {
        let (patterns, node) = self.base_of_pattern(node)?;
        let mut copies = outer;
        let mut replaced = false;
        for pattern in &patterns {
            let mut next = Vec::new();
            for o in &copies {
                next.extend(self.pattern(*pattern, o, replaced)?);
                if next.len() > MOST_COPIES {
                    self.say(code::PLAN_TOO_MUCH, *pattern, &[&title(*pattern), &MOST_COPIES.to_string(), "features"]);
                    return None;
                }
            }
            copies = next;
            // A general pattern says where its feature goes, whatever that feature's own placement.
            replaced = pattern.keyword() == "GENERAL_PATTERN";
        }
        Some((patterns, node, copies, replaced))
    }

    /// Elements of a pattern that lie on one spot, or round ones that overlap: the first two are told.
    fn apart(&mut self, pattern: Node<'m>, copies: &[Frame], shape: &Shape) {
        let width = match shape {
            Shape::Hole { diameter, .. } | Shape::Pocket { boundary: Closed::Circle { diameter, .. }, .. } => *diameter,
            _ => 0.0,
        };
        let least = (width - 1e-6).max(1e-6);
        let Some((a, b, distance)) = closer_than(least, copies) else { return };
        let at = |p: [f64; 3]| format!("X{} Y{}", gr_step::short(p[0]), gr_step::short(p[1]));
        let how = if distance < 1e-6 {
            format!("both lie at {}", at(a))
        } else {
            let (d, w) = (gr_step::short(distance), gr_step::short(width));
            format!("those at {} and {} lie {d} mm apart, each is {w} mm wide", at(a), at(b))
        };
        self.say(code::PLAN_ELEMENTS_OVERLAP, pattern, &[&title(pattern), &how]);
    }

    /// A feature without a bottom that ends above the underside of the raw part. Where the part is clamped more than once
    /// the rest may be cut from another side.
    fn goes_through(&mut self, node: Node<'m>, setup: Option<&Setup>, copies: &[Frame], depth: f64) {
        let Some([low, _]) = self.stock(setup).filter(|_| self.model.all("setup").count() <= 1) else { return };
        // An element of a compound feature opens into one that goes deeper.
        let parent = self.parents.get(&node.id()).copied().filter(|p| p.is_a("compound_feature"));
        let mut ends = |n: Node<'m>| {
            let at = n.node("feature_placement")?.node("location")?;
            let floor = n.node("depth")?.node("position")?.node("location")?;
            Some(self.point(at)?[2] + self.point(floor)?[2])
        };
        let own = ends(node);
        let mut deeper = |n: &Node<'m>| n.id() != node.id() && ends(*n).zip(own).is_some_and(|(a, b)| a < b - 1e-6);
        if parent.is_some_and(|p| p.nodes("elements").iter().any(&mut deeper)) {
            return;
        }
        let ends = copies.iter().filter(|c| c.upright()).map(|c| c.point([0.0, 0.0, -depth])[2]);
        let highest = ends.fold(f64::NEG_INFINITY, f64::max);
        if highest > low[2] + 0.01 {
            let [left, z] = [highest - low[2], low[2]].map(gr_step::short);
            self.say_at(code::PLAN_NOT_THROUGH, node, "depth", &[&title(node), &left, &z]);
        }
    }

    /// Frames that the feature's own placement is relative to: the workpiece's, or those of the compound
    /// feature it is an element of, once for each of its copies.
    fn outer(&mut self, node: Node<'m>, workpiece: &Frame, depth: usize) -> Option<Vec<Frame>> {
        let Some(parent) = self.parents.get(&node.id()).copied().filter(|p| p.is_a("compound_feature")) else {
            return Some(vec![*workpiece]);
        };
        if depth > DEEPEST {
            self.say(code::PLAN_GOES_ROUND, node, &[&title(node)]);
            return None;
        }
        // Patterns around the compound feature repeat its elements with it.
        let mut whole = parent;
        for _ in 0..DEEPEST {
            let Some(pattern) = self.parents.get(&whole.id()).copied().filter(|p| p.is_a("replicate_feature")) else { break };
            whole = pattern;
        }
        let outer = self.outer(whole, workpiece, depth + 1)?;
        let (_, _, copies, replaced) = self.copies(whole, outer)?;
        if replaced {
            return Some(copies);
        }
        let own = parent.node("feature_placement").and_then(|p| self.placement(p))?;
        Some(copies.iter().map(|o| o.place(&own)).collect())
    }

    /// The patterns around a feature, outermost first, and what they repeat.
    fn base_of_pattern(&mut self, node: Node<'m>) -> Option<(Vec<Node<'m>>, Node<'m>)> {
        let (mut patterns, mut at) = (Vec::new(), node);
        while at.is_a("replicate_feature") {
            if patterns.len() >= DEEPEST {
                self.say(code::PLAN_GOES_ROUND, node, &[&title(node)]);
                return None;
            }
            patterns.push(at);
            let Some(base) = at.node("replicate_base_feature") else {
                self.missing(at, "replicate_base_feature", "a pattern repeats a feature");
                return None;
            };
            at = base;
        }
        Some((patterns, at))
    }

    /// Frames to put the base feature's placement into. `replaced`: a pattern around this one says where it lies.
    fn pattern(&mut self, node: Node<'m>, outer: &Frame, replaced: bool) -> Option<Vec<Frame>> {
        let own = match node.node("feature_placement").and_then(|p| self.placement(p)) {
            Some(own) if !replaced => outer.place(&own),
            _ => *outer,
        };
        match node.keyword() {
            "CIRCULAR_PATTERN" => {
                let step = self.angle(node.real("angle_increment").unwrap_or(0.0));
                let turn = self.angle(node.real("base_feature_rotation").unwrap_or(0.0));
                let count = self.count(node, "number_of_feature", 1)?;
                let radius = node.length("base_feature_diameter").unwrap_or(0.0) / 2.0;
                let (gone, moved) = self.changes(node, &[("index", count)]);
                let moved: Vec<(i64, f64)> = moved.iter().map(|(i, m)| (i[0], self.angle(m.real("angular_offset").unwrap_or(0.0)))).collect();
                let at = |i: i64| {
                    let extra = moved.iter().find(|m| m.0 == i).map_or(0.0, |m| m.1);
                    let turned = own.turned(step * (i - 1) as f64 + extra);
                    let place = Frame { origin: turned.point([radius, 0.0, 0.0]), ..turned };
                    // The features keep their own orientation unless the pattern turns them.
                    if turn == 0.0 { place } else { place.turned(turn * (i - 1) as f64) }
                };
                Some((1..=count).filter(|i| !gone.contains(&vec![*i])).map(at).collect())
            }
            "RECTANGULAR_PATTERN" => {
                let spacing = node.length("spacing").unwrap_or(0.0);
                let direction = node.node("its_direction").and_then(|d| self.direction(d)).unwrap_or([1.0, 0.0, 0.0]);
                let rows = if node.attr("number_of_rows").is_some() { self.count(node, "number_of_rows", 1)? } else { 1 };
                let columns = self.count(node, "number_of_columns", 1)?;
                let row_spacing = node.length("row_spacing").unwrap_or(spacing);
                let across = node.node("row_layout_direction").and_then(|d| self.direction(d));
                let across = across.unwrap_or([-direction[1], direction[0], 0.0]);
                let (gone, moved) = self.changes(node, &[("row_index", rows), ("column_index", columns)]);
                let mut out = Vec::new();
                for row in 1..=rows {
                    for column in 1..=columns {
                        if gone.contains(&vec![row, column]) {
                            continue;
                        }
                        let (a, b) = (spacing * (column - 1) as f64, row_spacing * (row - 1) as f64);
                        let mut p: [f64; 3] = std::array::from_fn(|i| direction[i] * a + across[i] * b);
                        if let Some((_, m)) = moved.iter().find(|m| m.0 == [row, column]) {
                            let d = m.node("offset_direction").and_then(|d| self.direction(d)).unwrap_or([0.0; 3]);
                            let by = m.real("offset_distance").unwrap_or(0.0);
                            p = std::array::from_fn(|i| p[i] + d[i] * by);
                        }
                        out.push(own.place(&Frame::at(p)));
                    }
                }
                Some(out)
            }
            "GENERAL_PATTERN" => {
                let all: Option<Vec<Frame>> =
                    node.nodes("replicate_locations").into_iter().map(|p| Some(own.place(&self.placement(p)?))).collect();
                all
            }
            _ => {
                self.not_lowered(node, "");
                None
            }
        }
    }

    /// Elements of a pattern that are left out, and that are moved, by their numbers from 1, which these attributes give and which
    /// go up to these counts. What the pattern does not have and what contradicts itself is told.
    fn changes(&mut self, pattern: Node<'m>, counts: &[(&str, i64)]) -> (Vec<Vec<i64>>, Vec<Change<'m>>) {
        let mut read = |list: &str| -> Vec<Change<'m>> {
            let mut out = Vec::new();
            for change in pattern.nodes(list) {
                let numbers = counts.iter().map(|(attribute, count)| {
                    let v = change.attr(attribute)?.integer()?;
                    if !(1..=*count).contains(&v) {
                        let wanted = format!("1 to {count}, as many as {} has", title(pattern));
                        self.say_at(code::PLAN_BAD_SIZE, change, attribute, &[&title(change), attribute, &v.to_string(), &wanted]);
                        return None;
                    }
                    Some(v)
                });
                if let Some(numbers) = numbers.collect() {
                    out.push((numbers, change));
                }
            }
            out
        };
        let (gone, moved) = (read("missing_base_feature"), read("relocated_base_feature"));
        for (i, (element, change)) in moved.iter().enumerate() {
            let rule = if let Some((_, omit)) = gone.iter().find(|g| g.0 == *element) {
                format!("{} leaves out the element that it moves: the element is left out", title(*omit))
            } else if let Some((_, first)) = moved[..i].iter().find(|m| m.0 == *element) {
                format!("{} moves the same element: that counts", title(*first))
            } else {
                continue;
            };
            self.say(code::PLAN_TAKES_TURNS, *change, &[&title(*change), &rule]);
        }
        (gone.into_iter().map(|g| g.0).collect(), moved)
    }

    fn count(&mut self, node: Node<'m>, attribute: &str, low: i64) -> Option<i64> {
        let v = node.attr(attribute).and_then(|v| v.integer()).unwrap_or(0);
        if (low..=10_000).contains(&v) {
            return Some(v);
        }
        self.say_at(code::PLAN_BAD_SIZE, node, attribute, &[&title(node), attribute, &v.to_string(), "1 to 10000"]);
        None
    }

    fn depth(&mut self, node: Node<'m>, operation: u64) -> Option<f64> {
        if !node.is_a("machining_feature") {
            return Some(0.0);
        }
        let Some(plane) = node.node("depth").and_then(|d| self.plane(d)) else {
            self.missing(node, "depth", "it says how deep the feature is");
            return None;
        };
        if plane.normal[2].abs() < 1.0 - 1e-9 {
            let explicit = |o: &Node<'m>| o.id() == operation && o.node("its_toolpath").is_some();
            // A plane along the axis is no floor at all: files write its direction in the axes of the part.
            if plane.normal[2].abs() > 1e-9 && !node.nodes("its_operations").iter().any(explicit) {
                self.not_lowered(node, ": the plane of its depth is not square to its axis, a floor that leans needs explicit tool paths");
                return None;
            }
            self.no_effect(node, "depth", "its plane is not square to the feature's axis; only how far below its point lies counts");
        }
        let depth = -plane.point[2] + 0.0;
        if depth < 0.0 {
            self.say_at(code::PLAN_BAD_SIZE, node, "depth", &[&title(node), "depth", &format!("{depth} (above the feature)"), "at or below its placement"]);
            return None;
        }
        Some(depth)
    }

    /// `copies`: where the feature lies, for the elements of a compound one.
    fn shape(&mut self, node: Node<'m>, operation: u64, placement: &Frame, copies: &[Frame], setup: Option<&Setup>) -> Option<Shape> {
        Some(match node.keyword() {
            "PLANAR_FACE" => self.face(node)?,
            "CLOSED_POCKET" => {
                let boundary = self.need(node, "feature_boundary")?;
                let boundary = self.closed(boundary, placement)?;
                let (slope, bottom) = (self.slope(node), self.pocket_bottom(node)?);
                let bosses = self.bosses(node, placement)?;
                let (planar_radius, orthogonal_radius) = (node.length("planar_radius"), node.length("orthogonal_radius"));
                Shape::Pocket { boundary, bosses, slope, bottom, planar_radius, orthogonal_radius }
            }
            "OPEN_POCKET" => {
                let boundary = self.need(node, "open_boundary")?;
                let boundary = self.open_contour(boundary, placement)?;
                if node.attr("wall_boundary").is_some() {
                    self.no_effect(node, "wall_boundary", "the standard gives it for information only; the walls are the open_boundary");
                }
                let (slope, bottom) = (self.slope(node), self.pocket_bottom(node)?);
                let bosses = self.bosses(node, placement)?;
                let (planar_radius, orthogonal_radius) = (node.length("planar_radius"), node.length("orthogonal_radius"));
                Shape::OpenPocket { boundary, bosses, slope, bottom, planar_radius, orthogonal_radius }
            }
            "SLOT" => {
                let path = self.need(node, "course_of_travel")?;
                let section = self.need(node, "swept_shape")?;
                let (path, profile, section) = (self.travel(path)?, section, self.section(section)?);
                if let Section::Circular { radius, sweep } = section {
                    self.arc_fits(node, profile, operation, radius, sweep)?;
                }
                let ends = self.slot_ends(node)?;
                Shape::Slot { path, section, ends }
            }
            "STEP" => {
                let path = self.need(node, "open_boundary")?;
                let Travel::Line { start, direction, length } = self.travel(path)? else {
                    self.not_lowered(path, " as the edge of a step");
                    return None;
                };
                let wall = node.node("wall_boundary");
                if let Some(w) = wall {
                    self.unplaced(w, "its wall begins at its edge");
                }
                let radius = wall.and_then(|w| w.length("profile_radius")).unwrap_or(0.0);
                // One side of the V is the floor, the other the wall.
                let square = std::f64::consts::FRAC_PI_2;
                let angle = |a: &str| wall.and_then(|w| w.real(a)).map(|v| self.angle(v));
                let wall = angle("profile_angle").map_or(0.0, |a| a - square) + angle("tilt_angle").unwrap_or(0.0);
                let bosses = self.bosses(node, placement)?;
                Shape::Step { start, length, direction, wall: if wall.abs() < 1e-9 { 0.0 } else { wall }, radius, bosses }
            }
            "ROUND_HOLE" => self.hole(node, operation)?,
            "GENERAL_OUTSIDE_PROFILE" => {
                if let Some(way) = node.node("profile_swept_shape") {
                    self.swept_down(node, way, operation)?;
                }
                let boundary = self.need(node, "feature_boundary")?;
                let boundary = if boundary.is_a("closed_profile") {
                    self.closed_contour(boundary, placement)?
                } else {
                    self.open_contour(boundary, placement)?
                };
                Shape::Outside { boundary, left: Some(false) }
            }
            "GENERAL_SHAPE_PROFILE" | "PARTIAL_CIRCULAR_SHAPE_PROFILE" | "CIRCULAR_CLOSED_SHAPE_PROFILE"
            | "RECTANGULAR_OPEN_SHAPE_PROFILE" | "RECTANGULAR_CLOSED_SHAPE_PROFILE" => self.shape_profile(node, placement)?,
            "BOSS" => Shape::Boss(self.boss(node, placement, placement)?),
            "TOOLPATH_FEATURE" => Shape::Toolpath,
            _ if node.is_a("turning_feature") => Shape::Toolpath,
            "CATALOGUE_THREAD" | "DEFINED_THREAD" => {
                let major = self.positive(node, "major_diameter", "the size of the thread")?;
                let right = self.thread_hand(node)?;
                let pitch = match node.node("number_of_threads") {
                    Some(n) => Some(self.pitch(n)?),
                    None => None,
                };
                let inner = node.attr("inner_or_outer_thread").and_then(|v| v.boolean()).unwrap_or(true);
                let (start, length) = self.thread_reach(node, placement)?;
                let holes = node.nodes("applied_shape").into_iter().filter_map(|h| h.length("diameter")).reduce(f64::min);
                let bore = holes.or(node.real("minor_diameter").filter(|d| *d > 0.0)).filter(|_| inner);
                self.unused_of_thread(node, holes.is_some() || !inner);
                self.thread_fits(node, major, inner, (start, length));
                Shape::Thread { major, pitch, right, inner, start, length, bore }
            }
            _ if node.is_a("compound_feature") => {
                let mut elements = Vec::new();
                for e in node.nodes("elements").into_iter().filter(|e| e.is_a("machining_feature")) {
                    // A compound feature inside itself would go on for ever.
                    if e.is_a("compound_feature") || e.is_a("replicate_feature") {
                        self.not_lowered(e, " as an element of a compound feature");
                        return None;
                    }
                    elements.push(self.feature_in(e, copies.to_vec(), setup, operation)?);
                }
                let own = |f: &Feature| self.model.get(f.origin.id).is_some_and(|n| n.nodes("its_operations").iter().any(|o| o.id() == operation));
                let chosen: Vec<Feature> = elements.iter().filter(|f| own(f)).cloned().collect();
                Shape::Compound(if chosen.is_empty() { elements } else { chosen })
            }
            _ => Shape::Other,
        })
    }

    /// Whether a thread is right-handed. The standard has it as words.
    fn thread_hand(&mut self, node: Node<'m>) -> Option<bool> {
        let Some(hand) = node.node("thread_hand") else {
            self.missing(node, "thread_hand", "a thread is right-handed or left-handed");
            return None;
        };
        let text = hand.string("descriptive_string").into_owned();
        let words = text.to_lowercase();
        let is = |name: &str, short: [&str; 2]| words.contains(name) || short.contains(&words.trim());
        match (is("right", ["r", "rh"]), is("left", ["l", "lh"])) {
            (true, false) => Some(true),
            (false, true) => Some(false),
            _ => {
                let must = "'right' or 'left', the hand of the thread";
                self.say_at(code::PLAN_BAD_SIZE, hand, "descriptive_string", &[&title(hand), "descriptive_string", &format!("'{text}'"), must]);
                None
            }
        }
    }

    /// How far below its placement a thread begins, and how long it is; 0: as its depth says.
    fn thread_reach(&mut self, node: Node<'m>, placement: &Frame) -> Option<(f64, f64)> {
        let Some(area) = node.node("partial_profile") else { return Some((0.0, 0.0)) };
        let length = match area.real("effective_length") {
            Some(l) => self.in_range(area, "effective_length", l, f64::MIN_POSITIVE, "above zero")?,
            None => 0.0,
        };
        self.unused(area, "maximum_length", "its effective_length says how long it is");
        let frame = self.profile_frame(area, placement)?;
        let aside = libm::hypot(frame.origin[0], frame.origin[1]);
        if aside > 1e-9 || frame.z[2] < 1.0 - 1e-9 {
            self.no_effect(area, "placement", "a thread lies on the axis of what it is cut on; only how far below its placement counts");
        }
        let start = -frame.origin[2] + 0.0;
        if start < 0.0 {
            let given = format!("{} mm above the thread", gr_step::short(-start));
            self.say_at(code::PLAN_BAD_SIZE, area, "placement", &[&title(area), "placement", &given, "at or below the placement of the thread"]);
            return None;
        }
        Some((start, length))
    }

    /// What of a thread no path depends on. `hole`: another shape says how wide the hole before it is, or there is none.
    fn unused_of_thread(&mut self, node: Node<'m>, hole: bool) {
        let flank = "the edges of its tool have the form of its flanks";
        for a in ["form", "pitch_diameter", "crest"] {
            self.unused(node, a, flank);
        }
        for a in ["fit_class", "qualifier"] {
            self.unused(node, a, "it is cut to its nominal size");
        }
        if hole {
            self.unused(node, "minor_diameter", "what it is cut on says how wide that is");
        }
    }

    /// A thread that what it is cut on contradicts: an inner one in a hole as wide as it, a longer one than it is deep.
    fn thread_fits(&mut self, node: Node<'m>, major: f64, inner: bool, (start, length): (f64, f64)) {
        let of = title(node);
        for on in node.nodes("applied_shape") {
            let wide = on.length("diameter").filter(|d| inner && *d >= major - 1e-9);
            if let Some(d) = wide {
                let why = format!("#{} {} is {d} mm wide, the thread {major} mm", on.id(), on.keyword());
                self.say_at(code::PLAN_AIR, node, "applied_shape", &[&of, &why]);
            }
            let deep = on.node("depth").and_then(|d| self.plane(d)).map(|p| -p.point[2]);
            let own = node.node("depth").and_then(|d| self.plane(d)).map_or(0.0, |p| -p.point[2]);
            if let Some(d) = deep.filter(|d| own > *d + 1e-9) {
                let why = format!("it is {own} mm deep, what it is cut on {d} mm");
                self.say_at(code::PLAN_BEYOND_FEATURE, node, "depth", &[&of, &format!("#{} {}", on.id(), on.keyword()), &why]);
            }
        }
        let Some(area) = node.node("partial_profile") else { return };
        let own = node.node("depth").and_then(|d| self.plane(d)).map_or(0.0, |p| -p.point[2]);
        if own > 0.0 && start + length > own + 1e-9 {
            let end = if start > 0.0 { format!("it ends {} mm below the top", gr_step::short(start + length)) } else { format!("it is {length} mm") };
            self.no_effect(area, "effective_length", &format!("{end}, the thread only {own} mm deep: that counts"));
        }
    }

    /// The way along which an outside profile is swept: down its axis, as far as its depth.
    fn swept_down(&mut self, node: Node<'m>, way: Node<'m>, operation: u64) -> Option<()> {
        self.unplaced(way, "the depth of the feature says where it ends");
        let frame = match way.node("placement") {
            Some(p) => self.placement(p)?,
            None => Frame::default(),
        };
        if let Some(d) = way.node("its_direction") {
            let d = frame.vector(self.direction(d)?);
            if d[2].abs() < 1.0 - 1e-6 {
                let at = format!("; its direction ({}) leans, and only walls along the axis of the feature are cut", d.map(gr_step::short).join(", "));
                self.say_at(code::PLAN_NOT_LOWERED, way, "its_direction", &[&title(way), &at]);
                return None;
            }
        }
        let depth = self.depth(node, operation)?;
        if let Some(l) = way.length("distance").filter(|l| (l - depth).abs() > 1e-6) {
            let why = format!("it is {} mm, the depth of the feature {} mm: that counts", gr_step::short(l), gr_step::short(depth));
            self.no_effect(way, "distance", &why);
        }
        Some(())
    }

    fn need(&mut self, node: Node<'m>, attribute: &str) -> Option<Node<'m>> {
        let found = node.node(attribute);
        if found.is_none() {
            self.missing(node, attribute, "the shape of the feature is not known without it");
        }
        found
    }

    /// A SHAPE_PROFILE: its wall, and on which side of it the material goes.
    fn shape_profile(&mut self, node: Node<'m>, placement: &Frame) -> Option<Shape> {
        if let Some(floor) = node.node("floor_condition").filter(|f| f.keyword() == "GENERAL_PROFILE_FLOOR") {
            self.not_lowered(floor, "; only flat floors are");
            return None;
        }
        let of = ["profile_boundary", "open_boundary", "closed_boundary"].into_iter().find_map(|a| node.node(a));
        let Some(profile) = of else {
            self.missing(node, "profile_boundary", "the shape of the feature is not known without it");
            return None;
        };
        if profile.is_a("closed_profile") {
            return Some(Shape::Outside { boundary: self.closed_contour(profile, placement)?, left: None });
        }
        let boundary = self.open_contour(profile, placement)?;
        let away = node.node("removal_direction").and_then(|d| self.direction(d));
        let left = match (boundary.points.first(), boundary.points.last(), away) {
            (Some(a), Some(b), Some(d)) => {
                let side = (b[0] - a[0]) * d[1] - (b[1] - a[1]) * d[0];
                (side.abs() > 1e-9).then_some(side > 0.0)
            }
            _ => None,
        };
        Some(Shape::Outside { boundary, left })
    }

    fn slope(&mut self, node: Node<'m>) -> f64 {
        node.real("slope").map_or(0.0, |s| self.angle(s))
    }

    fn pocket_bottom(&mut self, node: Node<'m>) -> Option<PocketBottom> {
        let Some(bottom) = node.node("bottom_condition") else { return Some(PocketBottom::Planar) };
        Some(match bottom.keyword() {
            "THROUGH_POCKET_BOTTOM_CONDITION" => PocketBottom::Through,
            "RADIUSED_POCKET_BOTTOM_CONDITION" => {
                let radius = self.positive(bottom, "floor_radius", "the floor is part of a ball")?;
                let Some(center) = bottom.node("floor_radius_center").and_then(|p| self.point(p)) else {
                    self.missing(bottom, "floor_radius_center", "the floor is part of a ball about it");
                    return None;
                };
                PocketBottom::Ball(center, radius)
            }
            "GENERAL_POCKET_BOTTOM_CONDITION" => PocketBottom::Other("general"),
            _ => PocketBottom::Planar,
        })
    }

    fn bosses(&mut self, node: Node<'m>, placement: &Frame) -> Option<Vec<Boss>> {
        node.nodes("its_boss").into_iter().map(|b| self.boss(b, placement, placement)).collect()
    }

    /// `around`: the frame its own placement is turned into.
    fn boss(&mut self, node: Node<'m>, around: &Frame, _placement: &Frame) -> Option<Boss> {
        let own = node.node("feature_placement").and_then(|p| self.placement(p))?;
        // Placements of features are relative to the workpiece; the pocket wants it in its own frame.
        let local = Frame {
            origin: around.inverse_point(own.origin),
            x: around.inverse_vector(own.x),
            y: around.inverse_vector(own.y),
            z: around.inverse_vector(own.z),
        };
        if local.z[2] < 1.0 - 1e-9 {
            self.not_lowered(node, ": its axis is not that of the feature it stands in");
            return None;
        }
        let profile = self.need(node, "its_boundary")?;
        let contour = self.closed_contour(profile, &own)?;
        let points = contour.points.iter().map(|p| {
            let q = local.point([p[0], p[1], 0.0]);
            [q[0], q[1], p[2]]
        });
        let boundary = Contour { points: points.collect(), closed: true };
        Some(Boss { origin: origin(node), boundary, top: -local.origin[2], slope: self.slope(node) })
    }

    fn face(&mut self, node: Node<'m>) -> Option<Shape> {
        let course = self.need(node, "course_of_travel")?;
        let Travel::Line { direction, length, .. } = self.travel(course)? else {
            self.not_lowered(course, " as the course of a planar face");
            return None;
        };
        if course.node("placement").and_then(|p| self.placement(p)).is_some_and(|f| norm(f.origin) > 1e-9) {
            self.no_effect(course, "placement", "a face begins at its own placement");
        }
        let profile = self.need(node, "removal_boundary")?;
        self.in_millimetres(profile, "profile_length");
        let width = self.positive(profile, "profile_length", "it says how wide the face is")?;
        self.unplaced(profile, "a face begins at its own placement");
        let placed = profile.node("placement").and_then(|p| self.placement(p)).map(|f| [f.x[0], f.x[1]]);
        let square = [direction[1].abs(), direction[0].abs()];
        let across = placed.filter(|p| (p[0] * direction[0] + p[1] * direction[1]).abs() < 1e-6 && libm::hypot(p[0], p[1]) > 0.5);
        let boundary = match node.node("face_boundary") {
            Some(b) => Some(self.closed_contour(b, &Frame::default())?),
            None => None,
        };
        let placement = node.node("feature_placement").and_then(|p| self.placement(p)).unwrap_or_default();
        let bosses = self.bosses(node, &placement)?;
        let across = across.unwrap_or(if direction[0] * direction[1] == 0.0 { square } else { [-direction[1], direction[0]] });
        Some(Shape::Face { length, direction, width, across, boundary, bosses })
    }

    /// Numbers with a unit of their own are read as millimeters.
    fn in_millimetres(&mut self, node: Node<'m>, attribute: &str) {
        let Some(number) = node.node(attribute).filter(|n| n.attr("its_parameter_unit").is_some()) else { return };
        let unit = number.string("its_parameter_unit").trim().to_lowercase();
        if !["", "mm", "millimetre", "millimeter"].contains(&unit.as_str()) {
            self.no_effect(number, "its_parameter_unit", "lengths are millimetres");
        }
    }

    /// Pitch of a thread from its number of threads, mm: per inch, unless its unit says otherwise.
    fn pitch(&mut self, node: Node<'m>) -> Option<f64> {
        let v = self.positive(node, "its_parameter_value", "it says how steep the thread is")?;
        let unit: String = node.string("its_parameter_unit").to_lowercase().split_whitespace().collect();
        Some(match unit.as_str() {
            "" | "1/in" | "1/inch" | "/in" | "/inch" | "in-1" | "in^-1" | "tpi" | "perinch" | "threadsperinch" => 25.4 / v,
            "1/mm" | "/mm" | "mm-1" | "mm^-1" | "permm" => 1.0 / v,
            "mm" => v,
            "in" | "inch" => 25.4 * v,
            other => {
                let given = format!("{v} '{other}'");
                self.say_at(code::PLAN_BAD_SIZE, node, "its_parameter_unit", &[&super::title(node), "its_parameter_unit", &given, "'1/in', '1/mm', or 'mm' for a pitch"]);
                return None;
            }
        })
    }

    fn hole(&mut self, node: Node<'m>, operation: u64) -> Option<Shape> {
        let diameter = self.positive(node, "diameter", "a hole has one")?;
        let taper = node.node("change_in_diameter");
        let depth = self.depth(node, operation)?;
        let final_diameter = match taper.map(|t| (t, t.keyword())) {
            Some((t, "DIAMETER_TAPER")) => t.length("final_diameter"),
            Some((t, "ANGLE_TAPER")) => {
                let angle = self.angle(t.real("angle").unwrap_or(0.0));
                Some(diameter - 2.0 * depth * libm::tan(angle))
            }
            _ => None,
        };
        let Some(bottom) = node.node("bottom_condition") else {
            self.missing(node, "bottom_condition", "a hole is through, or has a bottom of some form");
            return None;
        };
        let bottom = match bottom.keyword() {
            "THROUGH_BOTTOM_CONDITION" => HoleBottom::Through,
            "FLAT_HOLE_BOTTOM" => HoleBottom::Flat,
            "FLAT_WITH_RADIUS_HOLE_BOTTOM" => {
                let half = final_diameter.unwrap_or(diameter) / 2.0;
                let radius = bottom.length("corner_radius").unwrap_or(0.0);
                let must = format!("0 to {}, half the diameter of the hole", gr_step::short(half));
                self.radius_fits(bottom, "corner_radius", radius, (0.0..=half + 1e-6).contains(&radius), &must)?;
                HoleBottom::Radiused(radius)
            }
            "SPHERICAL_HOLE_BOTTOM" => {
                let half = final_diameter.unwrap_or(diameter) / 2.0;
                let radius = bottom.length("radius").unwrap_or(half);
                let must = format!("{} or more, half the diameter of the hole", gr_step::short(half));
                self.radius_fits(bottom, "radius", radius, radius >= half - 1e-6, &must)?;
                // A ball much wider than the hole is a dish: it must end below the top of the hole.
                let dish = radius - libm::sqrt((radius * radius - half * half).max(0.0));
                let must = format!("such that its ball, {} mm deep in this hole, is no deeper than the hole, {} mm", gr_step::short(dish), gr_step::short(depth));
                self.radius_fits(bottom, "radius", radius, dish <= depth + 1e-6, &must)?;
                HoleBottom::Spherical(radius)
            }
            "CONICAL_HOLE_BOTTOM" => {
                HoleBottom::Conical(self.angle(bottom.real("tip_angle").unwrap_or(0.0)), bottom.length("tip_radius"))
            }
            _ => HoleBottom::Flat,
        };
        Some(Shape::Hole { diameter, final_diameter, bottom })
    }

    /// A radius of a bottom that its hole has room for, or what it must be.
    fn radius_fits(&mut self, bottom: Node<'m>, attribute: &str, radius: f64, fits: bool, must: &str) -> Option<()> {
        if !fits {
            self.say_at(code::PLAN_BAD_SIZE, bottom, attribute, &[&title(bottom), attribute, &gr_step::short(radius), must]);
        }
        fits.then_some(())
    }

    /// An arc as the section of a slot ends at its top or above it, and does not close in on the way up.
    fn arc_fits(&mut self, slot: Node<'m>, profile: Node<'m>, operation: u64, radius: f64, sweep: f64) -> Option<()> {
        let depth = self.depth(slot, operation)?;
        let half = sweep / 2.0;
        let high = radius * (1.0 - libm::cos(half));
        let say = |r: &mut Self, must: &str| {
            let written = gr_step::short(profile.real("sweep_angle").unwrap_or(0.0));
            r.say_at(code::PLAN_BAD_SIZE, profile, "sweep_angle", &[&title(profile), "sweep_angle", &written, must]);
            None
        };
        let turn = std::f64::consts::PI;
        if !(half > 0.0 && half < turn) {
            return say(self, "above 0 and below 360 degrees");
        }
        // The section is cut to the width of its arc; as far up as it leans outwards, that is the slot's.
        if half > turn / 2.0 + 1e-9 && depth > radius + 1e-6 {
            return say(self, &format!("180 degrees at most in a slot {} mm deep: the walls of this one lean inwards", gr_step::short(depth)));
        }
        let slack = tolerance(slot).0.unwrap_or(0.0).max(0.01);
        if high < depth - slack {
            let words = format!("such that the arc is as high as the slot is deep: it is {} mm high, the slot {} mm deep", gr_step::short(high), gr_step::short(depth));
            return say(self, &words);
        }
        Some(())
    }

    fn slot_ends(&mut self, node: Node<'m>) -> Option<Vec<SlotEnd>> {
        let ends = node.nodes("end_conditions").into_iter().map(|e| match e.keyword() {
            "OPEN_SLOT_END_TYPE" => SlotEnd::Open,
            "RADIUSED_SLOT_END_TYPE" => SlotEnd::Radiused,
            "FLAT_SLOT_END_TYPE" => {
                SlotEnd::Flat(e.length("corner_radius1").unwrap_or(0.0), e.length("corner_radius2").unwrap_or(0.0))
            }
            "WOODRUFF_SLOT_END_TYPE" => SlotEnd::Woodruff(e.length("radius").unwrap_or(0.0)),
            _ => SlotEnd::Loop,
        });
        Some(ends.collect())
    }

    /// A travel path in the feature frame.
    fn travel(&mut self, node: Node<'m>) -> Option<Travel> {
        let frame = match node.node("placement") {
            Some(p) => self.placement(p)?,
            None => Frame::default(),
        };
        match node.keyword() {
            "LINEAR_PATH" => {
                let length = self.positive(node, "distance", "a path has a length")?;
                let Some(d) = node.node("its_direction").and_then(|d| self.direction(d)) else {
                    self.missing(node, "its_direction", "a path has a direction");
                    return None;
                };
                let flat = libm::hypot(d[0], d[1]);
                if flat < 0.999 {
                    self.not_lowered(node, ": it leaves the plane of the feature");
                    return None;
                }
                let d = frame.vector(d);
                let flat = libm::hypot(d[0], d[1]);
                if flat < 0.999 {
                    self.not_lowered(node, ": it leaves the plane of the feature");
                    return None;
                }
                Some(Travel::Line { start: [frame.origin[0], frame.origin[1]], direction: [d[0] / flat, d[1] / flat], length })
            }
            "CIRCULAR_PATH" | "COMPLETE_CIRCULAR_PATH" => {
                let r = self.positive(node, "radius", "a circle has one")?;
                Some(Travel::Curve(Contour::circle([frame.origin[0], frame.origin[1]], r)))
            }
            "PARTIAL_CIRCULAR_PATH" => {
                let r = self.positive(node, "radius", "a circle has one")?;
                let sweep = self.angle(node.real("sweep_angle").unwrap_or(0.0));
                let at = |t: f64| frame.point([r * libm::cos(t), r * libm::sin(t), 0.0]);
                let b = libm::tan(sweep / 8.0);
                let points = [(0.0, b), (sweep / 2.0, b), (sweep, 0.0)].map(|(t, b)| [at(t)[0], at(t)[1], b]);
                Some(Travel::Curve(Contour { points: points.to_vec(), closed: false }))
            }
            "GENERAL_PATH" => {
                let curve = self.need(node, "swept_path")?;
                Some(Travel::Curve(self.contour(curve, &frame)?))
            }
            _ => {
                self.not_lowered(node, " as a travel path");
                None
            }
        }
    }

    /// A placement of its own that is more than none.
    fn unplaced(&mut self, node: Node<'m>, why: &str) {
        if node.node("placement").and_then(|p| self.placement(p)).is_some_and(|f| norm(f.origin) > 1e-9 || f.z[2] < 1.0 - 1e-9) {
            self.no_effect(node, "placement", why);
        }
    }

    fn section(&mut self, node: Node<'m>) -> Option<Section> {
        if node.keyword() != "GENERAL_PROFILE" {
            self.unplaced(node, "its section lies on the course of travel");
        }
        let angle = |r: &Self, a: &str| node.real(a).map_or(0.0, |v| r.angle(v));
        Some(match node.keyword() {
            "SQUARE_U_PROFILE" => Section::SquareU {
                width: self.positive(node, "width", "a slot has a width")?,
                radius: [node.length("first_radius").unwrap_or(0.0), node.length("second_radius").unwrap_or(0.0)],
                angle: [angle(self, "first_angle"), angle(self, "second_angle")],
            },
            "ROUNDED_U_PROFILE" => Section::RoundedU { width: self.positive(node, "width", "a slot has a width")? },
            "VEE_PROFILE" => Section::Vee {
                radius: node.length("profile_radius").unwrap_or(0.0),
                angle: angle(self, "profile_angle"),
                tilt: angle(self, "tilt_angle"),
            },
            "TEE_PROFILE" => {
                let mut chamfer = [[0.0; 2]; 2];
                for ([width, lean], [angle, offset]) in chamfer.iter_mut().zip([["first_angle", "first_offset"], ["second_angle", "second_offset"]]) {
                    *width = self.in_range(node, offset, node.length(offset).unwrap_or(0.0), 0.0, "at or above zero")?;
                    *lean = node.real(angle).map_or(0.0, |a| self.angle(a));
                    if *width == 0.0 && node.real(angle).is_some_and(|a| a != 0.0) {
                        self.no_effect(node, angle, &format!("it is the angle of a chamfer, and {offset} is 0: there is none"));
                    }
                }
                Section::Tee {
                    width: self.positive(node, "width", "a slot has a width")?,
                    bar_width: self.positive(node, "cross_bar_width", "a T-slot has one")?,
                    bar_depth: self.positive(node, "cross_bar_depth", "a T-slot has one")?,
                    radius: self.in_range(node, "radius", node.length("radius").unwrap_or(0.0), 0.0, "at or above zero")?,
                    chamfer,
                    origin: origin(node),
                }
            }
            "PARTIAL_CIRCULAR_PROFILE" => Section::Circular {
                radius: self.positive(node, "radius", "a circle has one")?,
                sweep: angle(self, "sweep_angle"),
            },
            "GENERAL_PROFILE" => {
                let curve = self.need(node, "its_profile")?;
                let frame = node.node("placement").and_then(|p| self.placement(p)).unwrap_or_default();
                Section::General(self.contour(curve, &frame)?)
            }
            _ => {
                self.not_lowered(node, " as the section of a slot");
                return None;
            }
        })
    }

    /// Where a profile lies in the frame of its feature. Some programs repeat the feature's own placement
    /// there; taken as it is written the feature would be moved twice.
    fn profile_frame(&mut self, node: Node<'m>, feature: &Frame) -> Option<Frame> {
        let Some(p) = node.node("placement") else { return Some(Frame::default()) };
        let frame = self.placement(p)?;
        let repeated = norm(sub(frame.origin, feature.origin)) < 1e-9 && norm(feature.origin) > 1e-9;
        if repeated {
            self.placed_twice.insert(node.id());
            return Some(Frame::default());
        }
        Some(frame)
    }

    fn closed(&mut self, node: Node<'m>, feature: &Frame) -> Option<Closed> {
        let frame = self.profile_frame(node, feature)?;
        Some(match node.keyword() {
            "RECTANGULAR_CLOSED_PROFILE" => Closed::Rectangle {
                frame,
                length: self.positive(node, "profile_length", "a rectangle has one")?,
                width: self.positive(node, "profile_width", "a rectangle has one")?,
            },
            "CIRCULAR_CLOSED_PROFILE" => {
                Closed::Circle { frame, diameter: self.positive(node, "diameter", "a circle has one")? }
            }
            "NGON_PROFILE" => Closed::Ngon {
                frame,
                diameter: self.positive(node, "diameter", "a polygon has one")?,
                sides: self.count(node, "number_of_sides", 3)? as u32,
                across_flats: node.attr("circumscribed_or_across_flats").and_then(|v| v.boolean()).unwrap_or(false),
            },
            "GENERAL_CLOSED_PROFILE" => {
                let curve = self.need(node, "closed_profile_shape")?;
                let mut contour = self.contour(curve, &frame)?;
                if !contour.closed {
                    self.say(code::PLAN_CANNOT_CUT, node, &[&title(node), "its curve does not end where it begins"]);
                    return None;
                }
                contour.closed = true;
                Closed::General(contour)
            }
            _ => {
                self.not_lowered(node, " as a closed profile");
                return None;
            }
        })
    }

    fn closed_contour(&mut self, node: Node<'m>, feature: &Frame) -> Option<Contour> {
        let closed = self.closed(node, feature)?;
        let contour = closed.contour();
        if contour.is_none() {
            self.say(code::PLAN_CANNOT_CUT, node, &[&title(node), "its profile has no size"]);
        }
        contour
    }

    fn open_contour(&mut self, node: Node<'m>, feature: &Frame) -> Option<Contour> {
        let frame = self.profile_frame(node, feature)?;
        match node.keyword() {
            "GENERAL_PROFILE" => {
                let curve = self.need(node, "its_profile")?;
                self.contour(curve, &frame)
            }
            "LINEAR_PROFILE" => {
                let l = self.positive(node, "profile_length", "a line has one")?;
                let points = [[0.0, 0.0, 0.0], [l, 0.0, 0.0]].map(|p| frame.point(p)).map(|p| [p[0], p[1], 0.0]);
                Some(Contour { points: points.to_vec(), closed: false })
            }
            "PARTIAL_CIRCULAR_PROFILE" => {
                let r = self.positive(node, "radius", "a circle has one")?;
                let sweep = self.angle(node.real("sweep_angle").unwrap_or(0.0));
                let at = |t: f64| frame.point([r * libm::cos(t), r * libm::sin(t), 0.0]);
                let b = libm::tan(sweep / 8.0);
                let points = [(0.0, b), (sweep / 2.0, b), (sweep, 0.0)].map(|(t, b)| [at(t)[0], at(t)[1], b]);
                Some(Contour { points: points.to_vec(), closed: false })
            }
            _ => {
                self.not_lowered(node, " as an open boundary");
                None
            }
        }
    }
}
