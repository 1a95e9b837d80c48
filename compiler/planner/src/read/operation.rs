//! Operations, tools, technology and explicit tool paths.

use std::f64::consts::FRAC_PI_2;

use gr_step::Node;
use gr_text::code;

use super::{Reader, origin};
use crate::frame::{add, cross, dot, scale, sub, unit};
use crate::process::*;

/// Out of the hole no faster than so many times the feed: above it, percent was meant.
const MOST_FEED_ON_RETRACT: f64 = 10.0;
/// Largest cutting speed, m/s, and spindle speed, 1/s, that a mill may mean.
const FASTEST: [f64; 2] = [50.0, 1000.0];

/// Largest cutting speed, m/s, that is taken as it stands when no spindle speed says the same: 600 m/min. Above it nobody but
/// the writer knows whether m/min were meant; everyday values in m/min are 10 to 300.
const DOUBTFUL_CUT: f64 = 10.0;

/// Largest feed per tooth that any mill takes, mm: face mills for high feeds come near it.
const THICKEST: f64 = 4.0;

/// Flattest slope down into the material, rad.
const FLATTEST: f64 = 1e-3;

/// Fastest turn of a lathe, 1/s.
const FASTEST_LATHE: f64 = 200.0;

/// Largest feed, m/s.
const FASTEST_FEED: f64 = 1.0;

/// Whether a spindle speed and a cutting speed on the round of a tool say the same in 1/s and m/s. The numbers agree in
/// rpm and m/min as well, but are then too large for the standard's units.
fn agree(spindle: f64, cut: f64, round: f64) -> bool {
    let turns = spindle.abs();
    round <= 0.0 || turns == 0.0 || ((turns * round - cut * 1000.0).abs() <= 0.02 * cut.abs() * 1000.0 && cut.abs() <= FASTEST[0] && turns <= FASTEST[1])
}

/// Where the angle of a tool's point is written.
fn tip_of<'m>(tool: Node<'m>) -> (Node<'m>, &'static str) {
    let dimension = tool.node("its_tool_body").and_then(|b| b.node("dimension"));
    match dimension.filter(|d| d.real("tool_tip_half_angle").is_some()) {
        Some(d) => (d, "tool_tip_half_angle"),
        None => (tool, "point_angle"),
    }
}

fn feed_words(mm_per_min: f64) -> Option<String> {
    (mm_per_min > 0.0).then(|| format!("feed {mm_per_min:.1} mm/min"))
}

impl<'m> Reader<'m> {
    pub fn operation(&mut self, node: Node<'m>) -> Option<Operation> {
        let tool = node.node("its_tool");
        let Some(tool) = tool else {
            self.missing(node, "its_tool", "nothing is cut without a tool");
            return None;
        };
        let tool = self.tool(tool)?;
        let technology = match node.node("its_technology") {
            Some(t) if t.keyword() == "TURNING_TECHNOLOGY" => {
                if node.node("its_toolpath").is_none() {
                    self.not_lowered(node, " without an explicit tool path");
                    return None;
                }
                self.turning(t)
            }
            Some(t) => self.technology(t, &tool),
            None => {
                self.missing(node, "its_technology", "feed and speed are not known");
                return None;
            }
        };
        if let Some(t) = node.node("its_tool").filter(|_| tool.is_needle()) {
            self.needle(t, &tool);
        }
        let functions = node.node("its_machine_functions").map(|f| self.functions(f)).unwrap_or_default();
        let toolpaths = node.node("its_toolpath").map(|t| self.toolpaths(t, Some(&tool))).unwrap_or_default();
        let direction = node.node("its_tool_direction");
        if let Some(d) = direction.filter(|d| toolpaths.is_empty() && !self.along_feature(*d)) {
            let why = format!(": tool direction {}; a feature is cut by a tool along its own axis", d.keyword());
            self.not_lowered(node, &why);
        }
        let direction = direction.map(|d| d.keyword().to_string());
        if !toolpaths.is_empty() {
            let turning: &[&str] = if node.is_a("turning_machining_operation") { &["approach", "retract", "its_machining_strategy", "allowance"] } else { &[] };
            for a in ["retract_plane", "start_point", "overcut_length"].iter().chain(turning) {
                self.unused(node, a, "the tool path is followed as it is written");
            }
        }
        let kind = if node.is_a("drilling_type_operation") {
            self.unused_in_drilling(node);
            OperationKind::Drill(self.drilling(node))
        } else if node.is_a("two5d_milling_operation") {
            OperationKind::Mill(self.milling(node))
        } else {
            OperationKind::Other
        };
        if node.keyword() != "BACK_BORING"
            && let Some(t) = node.node("its_tool")
        {
            self.unused(t, "direction_for_spindle_orientation", "only back boring stops the spindle in a direction");
            self.unused(t, "tool_holder_diameter_for_spindle_orientation", "only back boring goes through a hole aside");
        }
        Some(Operation {
            origin: origin(node),
            keyword: node.keyword().to_string(),
            name: node.string("its_id").into_owned(),
            retract: node.real("retract_plane"),
            start: node.node("start_point").and_then(|p| self.point(p)),
            tool,
            technology,
            functions,
            overcut: node.real("overcut_length"),
            toolpaths,
            direction,
            kind,
        })
    }

    /// A tool direction that says nothing but the axis of the feature.
    fn along_feature(&mut self, direction: Node<'m>) -> bool {
        match direction.keyword() {
            "TWO_AXES" | "THREE_AXES" => true,
            "THREE_AXES_TILTED_TOOL" => {
                direction.node("its_tool_direction").and_then(|d| self.direction(d)).is_some_and(|d| d[2] > 1.0 - 1e-9)
            }
            _ => false,
        }
    }

    fn drilling(&mut self, node: Node<'m>) -> Drilling {
        let strategy = node.node("its_machining_strategy");
        if let Some(v) = node.real("feed_on_retract") {
            self.in_range(node, "feed_on_retract", v, f64::MIN_POSITIVE, "above zero");
        }
        let mut reduced = |depth: &str, feed: &str, cut: &str| strategy.and_then(|s| self.reduced(s, depth, feed, cut));
        let first = reduced("depth_of_start", "reduced_feed_at_start", "reduced_cut_at_start");
        let last = reduced("depth_of_end", "reduced_feed_at_end", "reduced_cut_at_end");
        let peck = (node.keyword() == "MULTISTEP_DRILLING").then(|| {
            let v = |a: &str| node.real(a).unwrap_or(0.0);
            [v("first_depth"), v("depth_of_step"), v("retract_distance"), v("dwell_time_step")]
        });
        let test = node.real("depth_of_testcut").filter(|d| *d > 0.0);
        let waiting = node.node("waiting_position").and_then(|p| self.point(p));
        Drilling {
            depth: node.real("cutting_depth"),
            depth_span: node.written("cutting_depth").map_or(node.keyword_span(), |v| v.span()),
            previous: node.real("previous_diameter").filter(|d| *d > 0.0 && d.is_finite()),
            dwell: node.real("dwell_time_bottom").filter(|d| *d > 0.0 && d.is_finite()).unwrap_or(0.0),
            feed_on_retract: node.real("feed_on_retract").map(|v| if v > MOST_FEED_ON_RETRACT { v / 100.0 } else { v }),
            first,
            last,
            peck,
            stop_at_bottom: node.attr("spindle_stop_at_bottom").and_then(|v| v.boolean()).unwrap_or(false),
            test_cut: test.map(|d| (d, waiting)),
            helical: node.attr("helical_movement_on_forward").and_then(|v| v.boolean()).unwrap_or(false),
            floating_chuck: node.attr("compensation_chuck").and_then(|v| v.boolean()).unwrap_or(false),
        }
    }

    /// A stretch with less feed or speed, as a strategy's attributes of these names say. Ratios without a length break a
    /// rule of the standard, which is told where the schema is checked.
    fn reduced(&mut self, strategy: Node<'m>, depth: &str, feed: &str, cut: &str) -> Option<Reduced> {
        let mut ratio = |a: &str| self.in_range(strategy, a, strategy.real(a)?, f64::MIN_POSITIVE, "above zero").map(as_ratio);
        let (share, speed) = (ratio(feed), ratio(cut));
        let length = self.in_range(strategy, depth, strategy.real(depth)?, 0.0, "at or above zero")?;
        if strategy.attr(feed).is_none() && strategy.attr(cut).is_none() {
            self.no_effect(strategy, depth, "neither feed nor speed is reduced there");
            return None;
        }
        if length == 0.0 {
            self.no_effect(strategy, depth, "a stretch of 0 mm reduces nothing");
            return None;
        }
        let span = strategy.written(depth).map_or(strategy.keyword_span(), |v| v.span());
        Some(Reduced { span, length, feed: share.unwrap_or(1.0), speed: speed.unwrap_or(1.0) })
    }

    /// What says nothing about holes of this kind.
    fn unused_in_drilling(&mut self, node: Node<'m>) {
        let k = node.keyword();
        self.unused(node, "start_point", "a hole is made on its own axis");
        if matches!(k, "MULTISTEP_DRILLING" | "TAPPING" | "BACK_BORING" | "THREAD_DRILLING") {
            self.unused(node, "its_machining_strategy", "its feed and speed stay the same all the way");
        }
        if matches!(k, "TAPPING" | "BACK_BORING" | "THREAD_DRILLING") {
            self.unused(node, "feed_on_retract", "it goes out as it went in");
        }
        if k != "BACK_BORING" {
            self.unused(node, "previous_diameter", "the whole depth is fed");
        }
        if let Some(v) = node.real("dwell_time_bottom").filter(|d| *d < 0.0) {
            self.no_effect(node, "dwell_time_bottom", &format!("{v} s is no time"));
        }
        if k == "TAPPING" && node.attr("compensation_chuck").and_then(|v| v.boolean()) != Some(true) {
            self.unused(node, "dwell_time_bottom", "a rigid tap turns back at once");
        }
        if node.attr("depth_of_testcut").is_none() {
            self.unused(node, "waiting_position", "there is no test cut");
        }
    }

    fn milling(&mut self, node: Node<'m>) -> Milling {
        let k = node.keyword();
        let number = |a: &str| node.real(a).filter(|v| v.is_finite());
        Milling {
            finish: k.contains("FINISH"),
            bottom: k.contains("BOTTOM") || k.contains("PLANE"),
            side: k.contains("SIDE"),
            axial: number("axial_cutting_depth"),
            radial: number("radial_cutting_depth"),
            allowance_side: number("allowance_side").unwrap_or(0.0),
            allowance_bottom: number("allowance_bottom").unwrap_or(0.0),
            strategy: node.node("its_machining_strategy").map(|s| self.strategy(s)),
            approach: self.approach(node, "approach"),
            retract: self.approach(node, "retract"),
        }
    }

    fn strategy(&mut self, node: Node<'m>) -> Strategy {
        let choice = |a: &str| node.attr(a).and_then(|v| v.choice());
        let feed = node.node("feed_direction").and_then(|d| self.direction(d)).map(|d| [d[0], d[1]]);
        let connection = choice("its_stroke_connection_strategy");
        if connection.as_deref().is_some_and(|c| c == "DEGOUGE" || c == "LOOP_BACK") {
            self.no_effect(node, "its_stroke_connection_strategy", "strokes are joined by the shortest way that stays inside");
        }
        let walls = matches!(node.keyword(), "BIDIRECTIONAL_CONTOUR" | "CONTOUR_BIDIRECTIONAL");
        if walls && choice("rotation_direction").is_some() {
            self.unused(node, "spiral_cutmode", "rotation_direction decides which way it goes round");
        }
        Strategy {
            origin: origin(node),
            keyword: node.keyword().to_string(),
            overlap: node.real("overlap"),
            overlap_span: node.written("overlap").map_or(node.keyword_span(), |v| v.span()),
            multiple: node.attr("allow_multiple_passes").and_then(|v| v.boolean()),
            feed,
            step_left: choice("stepover_direction").map(|c| c == "LEFT"),
            ccw: choice("rotation_direction").map(|c| c == "CCW"),
            climb: choice("cutmode").or_else(|| choice("spiral_cutmode")).map(|c| c == "CLIMB"),
            connection,
        }
    }

    fn approach(&mut self, node: Node<'m>, attribute: &str) -> Approach {
        let Some(a) = node.node(attribute) else { return Approach::None };
        if a.attr("tool_orientation").is_some() {
            self.no_effect(a, "tool_orientation", "the tool stands along the axis of its feature all the way");
        }
        self.way(a).unwrap_or(Approach::None)
    }

    /// None where one of its numbers leads nowhere, which has been told.
    fn way(&mut self, a: Node<'m>) -> Option<Approach> {
        let length = |r: &mut Self, name: &str| r.in_range(a, name, a.real(name).unwrap_or(0.0), 1e-3, "at least 0.001 mm");
        let angle = |r: &mut Self, name: &str| {
            let written = a.real(name).unwrap_or(0.0);
            let v = r.angle(written);
            if FLATTEST <= v && v <= FRAC_PI_2 + 1e-9 {
                return Some(v.min(FRAC_PI_2));
            }
            let must = match r.units {
                Units::Iso => "0.06 to 90 degrees",
                Units::StepModeler => "0.001 to 1.5708 rad",
            };
            r.say_at(code::PLAN_BAD_SIZE, a, name, &[&super::title(a), name, &gr_step::short(written), must]);
            None
        };
        Some(match a.keyword() {
            "PLUNGE_TOOLAXIS" => Approach::Axis,
            "PLUNGE_RAMP" => Approach::Ramp(angle(self, "angle")?),
            "PLUNGE_HELIX" => Approach::Helix(length(self, "radius")?, angle(self, "angle")?),
            "PLUNGE_ZIGZAG" => Approach::Zigzag(angle(self, "angle")?, length(self, "width")?),
            "AP_RETRACT_ANGLE" => Approach::Angle(angle(self, "angle")?, length(self, "travel_length")?),
            "AP_RETRACT_TANGENT" => Approach::Tangent(length(self, "radius")?),
            "ALONG_PATH" => Approach::Along(a.node("path").map(|p| self.toolpaths(p, None)).unwrap_or_default()),
            _ => Approach::None,
        })
    }

    /// Feed and speed of a lathe. Feeds per revolution are in mm (ISO 14649-12 gives no unit, its example means that).
    fn turning(&mut self, node: Node<'m>) -> Technology {
        let iso = self.units == Units::Iso;
        let [feed, fixed] = ["feedrate", "feed_per_revolution"].map(|a| node.real(a).filter(|v| v.is_finite()));
        let rev = fixed.or_else(|| node.real("feedrate_per_revolution").filter(|v| v.is_finite()));
        for (a, v) in [("feedrate", feed), ("feed_per_revolution", rev)] {
            if let Some(v) = v {
                self.in_range(node, a, v, f64::MIN_POSITIVE, "above zero");
            }
        }
        let speed = node.node("spindle_speed");
        let turns = speed.and_then(|s| s.real("rot_speed"));
        let surface = speed.and_then(|s| s.real("speed"));
        if let Some(v) = turns.filter(|v| *v > 0.0) {
            self.say_at(code::STEP_SPINDLE_SIGN, node, "spindle_speed", &[&gr_step::short(v), &gr_step::short(-v)]);
        }
        let most = speed.and_then(|s| s.real("max_speed"));
        let fast = |v: Option<f64>, most: f64| v.is_some_and(|v| v.abs() > most);
        if fast(turns.or(most), FASTEST_LATHE) || fast(surface, FASTEST[0]) || fast(feed, FASTEST_FEED) {
            let show = |turn: f64, cut: f64, feed: f64| {
                let rpm = turns.map(|v| format!("{:.1} rpm", v.abs() * turn));
                let cut = surface.map(|v| format!("{:.1} m/min", v * cut));
                let feed = feed_words(feed);
                [rpm, cut, feed].into_iter().flatten().collect::<Vec<_>>().join(", ")
            };
            let (a, b) = (show(60.0, 60.0, feed.unwrap_or(0.0) * 60_000.0), show(1.0, 1.0, feed.unwrap_or(0.0) * 1000.0));
            self.units_are_open(node, "spindle", &a, &b);
        }
        let per_minute = if iso { 60.0 } else { 1.0 };
        Technology {
            feed: rev.or(feed.map(|f| if iso { f * 1000.0 } else { f * 1000.0 / 60.0 })).filter(|f| *f > 0.0),
            per_rev: rev.is_some(),
            surface: surface.filter(|v| *v > 0.0).map(|v| [v * 1000.0 * per_minute / 60.0, most.map_or(f64::MAX, |m| m.abs() * per_minute)]),
            speed: turns.map(|s| s.abs() * per_minute),
            clockwise: turns.is_none_or(|s| s <= 0.0),
            written: [feed, surface, turns, rev],
            ..self.switches(node, "sync_spindle_and_z_feed")
        }
    }

    /// What technologies of milling and of turning say alike; the attribute that ties the feed to the spindle has two names.
    fn switches(&mut self, node: Node<'m>, synchronised: &str) -> Technology {
        let flag = |a: &str| node.attr(a).and_then(|v| v.boolean()).unwrap_or(false);
        if node.attr("its_adaptive_control").is_some() {
            self.no_effect(node, "its_adaptive_control", "the control does it");
        }
        let reference = node.attr("feedrate_reference").and_then(|v| v.choice());
        Technology {
            origin: origin(node),
            contact_feed: reference.as_deref() == Some("CCP"),
            synchronised: flag(synchronised),
            lock_feed: flag("inhibit_feedrate_override"),
            lock_spindle: flag("inhibit_spindle_override"),
            ..Technology::default()
        }
    }

    /// The tool of a lathe: a point, as long as it says.
    fn lathe_tool(&mut self, node: Node<'m>) -> Tool {
        let hand = node.attr("hand_of_tool").and_then(|v| v.choice());
        for a in ["f_dimension", "a_dimension_on_f", "a_dimension_on_lf", "minimum_cutting_diameter"] {
            self.unused(node, a, "the control has the offsets of its tools");
        }
        let tool = Tool {
            origin: origin(node),
            name: node.string("its_id").into_owned(),
            kind: node.keyword().to_string(),
            length: node.real("functional_length").filter(|l| l.is_finite()),
            right_handed: hand.as_deref().and_then(|h| match h {
                "RIGHT" => Some(true),
                "LEFT" => Some(false),
                _ => None,
            }),
            ..Tool::default()
        };
        self.numbered(tool)
    }

    /// A tool; the same tool gets the same number wherever it is described.
    pub fn tool(&mut self, node: Node<'m>) -> Option<Tool> {
        let body = node.node("its_tool_body");
        if node.is_a("turning_machine_cutting_tool") || node.is_a("turning_machine_tool") {
            return Some(self.lathe_tool(node));
        }
        let dimension = body.and_then(|b| b.node("dimension"));
        let (of, attribute) = match dimension {
            Some(d) => (d, "diameter"),
            None => (node, "effective_cutting_diameter"),
        };
        if dimension.is_none() && node.real(attribute).is_none() {
            let why = "it has neither a body with dimensions nor a diameter of its own";
            self.missing(node, "its_tool_body", why);
            return None;
        }
        let diameter = self.positive(of, attribute, "a tool has a diameter")?;
        if let Some(r) = of.real("edge_radius").filter(|r| *r > diameter / 2.0 + 1e-9) {
            let most = format!("at most the radius of the tool, {}", diameter / 2.0);
            self.say_at(code::PLAN_BAD_SIZE, of, "edge_radius", &[&super::title(node), "edge_radius", &r.to_string(), &most]);
            return None;
        }
        let body = body.unwrap_or(node);
        let edges = [node.nodes("its_cutting_edge"), node.nodes("its_cutting_edges")].concat();
        let length = edges.first().and_then(|e| e.real("tool_offset_length").or_else(|| e.real("tool_functional_length")));
        let hand = body.attr("hand_of_cut").and_then(|v| v.choice());
        let tip = dimension.and_then(|d| d.real("tool_tip_half_angle")).or_else(|| node.real("point_angle").map(|a| a / 2.0));
        let taper = self.taper(body, dimension)?;
        // Not given, or above zero.
        let positive = |r: &mut Self, n: Node<'m>, a: &str| n.real(a).map_or(Some(None), |v| r.in_range(n, a, v, f64::MIN_POSITIVE, "above zero").map(Some));
        let mut tool = Tool {
            origin: origin(node),
            name: node.string("its_id").into_owned(),
            kind: body.keyword().to_string(),
            diameter,
            tip_angle: tip.filter(|a| *a != 0.0).map(|a| self.angle(a)),
            cutting_length: dimension.and_then(|d| d.real("cutting_edge_length")).or_else(|| [node.real("maximum_depth_of_cut"), node.real("maximum_usable_length")].into_iter().flatten().reduce(f64::min)).filter(|l| *l > 0.0),
            edge_radius: of.real("edge_radius").filter(|r| r.is_finite() && *r > 0.0).unwrap_or(0.0),
            taper,
            length: length.or_else(|| node.real("overall_assembly_length")).filter(|l| l.is_finite()),
            teeth: body.attr("number_of_teeth").or_else(|| body.attr("number_of_effective_teeth")).and_then(|v| v.integer()).and_then(|n| u32::try_from(n).ok()),
            right_handed: hand.as_deref().and_then(|h| match h {
                "RIGHT" => Some(true),
                "LEFT" => Some(false),
                _ => None,
            }),
            pitch: positive(self, node, "thread_pitch")?,
            thread_size: positive(self, node, "thread_size")?,
            nose: if body.keyword().contains("COUNTERS") { node.real("minimum_cutting_diameter").filter(|d| *d > 0.0 && *d < diameter).unwrap_or(0.0) } else { 0.0 },
            thickness: match ["cutting_thickness", "cutting_width", "cutter_width"].into_iter().find(|a| body.attr(a).is_some()) {
                Some(a) => positive(self, body, a)?,
                None => None,
            },
            no_retract: body.attr("retract_movement_forbidden").and_then(|v| v.boolean()) == Some(true),
            orientation: node.node("direction_for_spindle_orientation").and_then(|d| self.direction(d)),
            bar: node.real("tool_holder_diameter_for_spindle_orientation").filter(|d| *d > 0.0),
            number: 0,
        };
        if self.units == crate::process::Units::StepModeler && tool.is_pointed() && tool.tip_angle.is_some_and(|a| a > std::f64::consts::FRAC_PI_2 + 1e-3) {
            let (of, name) = tip_of(node);
            let value = of.real(name).unwrap_or(0.0).to_string();
            self.say_at(code::PLAN_BAD_SIZE, of, name, &[&super::title(node), name, &value, "a quarter of a turn at most: with `--step-units step-modeler` angles are radians"]);
            return None;
        }
        self.unused_of_tool(node, body, dimension, &tool);
        tool = self.numbered(tool);
        Some(tool)
    }

    /// Half the angle of the side of a tapered tool, rad: from 0, a cylinder, to below a quarter of a turn.
    fn taper(&mut self, body: Node<'m>, dimension: Option<Node<'m>>) -> Option<f64> {
        let side = dimension.filter(|d| d.real("tool_circumference_angle").is_some()).map(|d| (d, "tool_circumference_angle"));
        let own = Some((body, "taper_angle")).filter(|_| body.real("taper_angle").is_some());
        if !body.keyword().starts_with("TAPERED") {
            if own.is_some_and(|(n, a)| n.real(a) != Some(0.0)) {
                self.unused(body, "taper_angle", "its side is taken as a cylinder");
            }
            return Some(0.0);
        }
        let Some((node, name)) = own.or(side) else { return Some(0.0) };
        if own.is_some()
            && let Some((d, a)) = side.filter(|(d, a)| d.real(a) != node.real(name))
        {
            self.unused(d, a, "its taper_angle counts");
        }
        let written = node.real(name).unwrap_or(0.0);
        let angle = self.angle(written);
        if !(0.0..std::f64::consts::FRAC_PI_2).contains(&angle) {
            let must = "0 to below a quarter of a turn: tools that grow wider towards the spindle";
            self.say_at(code::PLAN_BAD_SIZE, node, name, &[&super::title(node), name, &written.to_string(), must]);
            return None;
        }
        Some(angle)
    }

    /// The point of a drill that is many times longer than wide: its angle means radians, or nothing.
    fn needle(&mut self, node: Node<'m>, tool: &Tool) {
        let (of, name) = tip_of(node);
        let written = of.real(name).unwrap_or(0.0);
        if self.units_said {
            // That the file is in other units has been told, or the units were chosen by hand.
            if !self.out.iter().any(|d| d.code == code::PLAN_UNITS_OPEN) {
                let must = "more than 2 degrees: in units of the standard angles are degrees; `--step-units step-modeler` reads radians";
                self.say_at(code::PLAN_BAD_SIZE, of, name, &[&super::title(of), name, &gr_step::short(written), must]);
            }
            return;
        }
        let half = tool.tip_angle.unwrap_or(FRAC_PI_2);
        let long = |half: f64| gr_step::short(tool.diameter / 2.0 / libm::tan(half));
        let iso = format!("a point of {} degrees, {} mm long,", gr_step::short(written), long(half));
        let other = format!("one of {} degrees, {} mm long,", gr_step::short(written.to_degrees()), long(half.to_degrees()));
        self.units_are_open(of, name, &iso, &other);
    }

    /// Attributes of tools that no path depends on.
    fn unused_of_tool(&mut self, node: Node<'m>, body: Node<'m>, dimension: Option<Node<'m>>, tool: &Tool) {
        self.unused(body, "pilot_length", "depths count to the tip");
        self.unused(body, "drill_length", "its depth of cut counts to the tip");
        self.unused(body, "countersink_radius", "its cone is taken as straight");
        self.unused(body, "included_angle", "a dovetail mill follows explicit tool paths alone");
        for a in ["thread_form_type", "taper_thread_count"] {
            self.unused(body, a, "its thread is its own");
        }
        if tool.kind.contains("TAPERED_TAP") && tool.taper != 0.0 {
            self.unused(body, "taper_angle", "it goes to its depth whatever its shape");
        }
        self.unused_flag(body, "coolant_through_tool", "the machine functions of the operation switch coolant");
        if tool.length != node.real("overall_assembly_length") {
            self.unused(node, "overall_assembly_length", "the length of its cutting edge counts");
        }
        if tool.edge_radius > 0.0 && !tool.mills() && !tool.is_disc() {
            self.unused(dimension.unwrap_or(node), "edge_radius", "what it makes has its diameter, and its depth counts to the tip");
        }
        if tool.edge() == tool.thickness
            && let Some(t) = tool.thickness
            && tool.cutting_length.is_some_and(|l| l < t - 1e-9)
        {
            let (of, name) = dimension.filter(|d| d.real("cutting_edge_length").is_some()).map_or((node, "maximum_depth_of_cut"), |d| (d, "cutting_edge_length"));
            self.no_effect(of, name, &format!("the disc of the tool is {} mm high", gr_step::short(t)));
        }
        let Some(d) = dimension else { return };
        if !tool.is_pointed() && tool.tip_angle.is_some() {
            self.unused(d, "tool_tip_half_angle", "its face is taken as flat");
        }
        if !tool.kind.starts_with("TAPERED") && d.real("tool_circumference_angle").is_some_and(|a| a != 0.0) {
            self.unused(d, "tool_circumference_angle", "its side is taken as a cylinder");
        }
        let near = |a: &str, v: f64| d.real(a).is_none_or(|x| (x - v).abs() < 1e-6);
        if !near("edge_center_vertical", tool.edge_radius) {
            self.unused(d, "edge_center_vertical", "the rounding of its edge is taken as tangent to its face");
        }
        if !near("edge_center_horizontal", tool.diameter / 2.0 - tool.edge_radius) {
            self.unused(d, "edge_center_horizontal", "the rounding of its edge is taken as tangent to its side");
        }
    }

    /// The tool with its number in the table.
    pub fn numbered(&mut self, mut tool: Tool) -> Tool {
        let same = |t: &Tool| {
            t.name == tool.name && t.kind == tool.kind && t.diameter == tool.diameter && t.edge_radius == tool.edge_radius
                && t.tip_angle == tool.tip_angle && t.cutting_length == tool.cutting_length && t.length == tool.length
                && t.taper == tool.taper && t.pitch == tool.pitch && t.thickness == tool.thickness && t.nose == tool.nose
        };
        match self.tools.iter().find(|t| same(t)) {
            Some(known) => tool.number = known.number,
            None => {
                tool.number = self.tools.len() as u32 + 1;
                self.tools.push(tool.clone());
            }
        }
        tool
    }

    fn technology(&mut self, node: Node<'m>, tool: &Tool) -> Technology {
        let written = ["feedrate", "cutspeed", "spindle", "feedrate_per_tooth"].map(|a| node.real(a).filter(|v| v.is_finite()));
        let [feed, cut, spindle, tooth] = written;
        let round = std::f64::consts::PI * tool.diameter;
        let iso = self.units == Units::Iso;
        let by_cut = cut.filter(|_| round > 0.0).map(|v| if iso { v * 60_000.0 / round } else { v * 1000.0 / round });
        let speed = if iso { spindle.map(|s| s.abs() * 60.0).or(by_cut) } else { by_cut.or(spindle.map(f64::abs)) };
        let teeth = f64::from(tool.teeth.unwrap_or(1).max(1));
        let per_rev = tooth.map(|t| t * teeth);
        let feed_mm = match (feed, per_rev, speed) {
            (Some(f), ..) if iso => Some(f * 1000.0),
            (Some(f), _, Some(n)) => Some(f * n / 60.0),
            (None, Some(f), Some(n)) => Some(f * n / 60.0),
            _ => None,
        };
        let too_much = [(cut, FASTEST[0]), (spindle, FASTEST[1]), (feed, FASTEST_FEED)];
        // What no tooth can take: as a feed per revolution it may be meant.
        let rev = feed_mm.zip(speed.filter(|s| *s > 0.0)).filter(|_| iso && feed.is_some() && tool.teeth.is_some() && !tool.kind.contains("TAP"));
        let thick = rev.is_some_and(|(f, rpm)| f * 60.0 / rpm / teeth > THICKEST);
        // A cutting speed alone: in m/min it may be an everyday one, and in m/s faster than spindles turn.
        let alone = cut.filter(|_| spindle.is_none()).map(f64::abs);
        let turns = by_cut.filter(|_| iso && alone.is_some()).unwrap_or(0.0) / 60.0;
        let doubtful = iso && alone.is_some_and(|v| v > DOUBTFUL_CUT || turns > FASTEST[1]);
        let open = thick || doubtful || too_much.into_iter().any(|(v, most)| v.is_some_and(|v| v.abs() > most));
        if open || spindle.zip(cut).is_some_and(|(n, vc)| !agree(n, vc, round)) {
            let (n, vc) = (spindle.unwrap_or(0.0), cut.unwrap_or(0.0));
            let by_cut = |v: f64| if round > 0.0 { v * 1000.0 / round } else { 0.0 };
            let rps = if spindle.is_some() { n.abs() } else { by_cut(vc) };
            let rpm = if cut.is_some() { by_cut(vc) } else { n.abs() };
            let fed = feed.map(|f| f * 60_000.0).or(per_rev.map(|f| f * rps * 60.0)).unwrap_or(0.0);
            let iso = format!("{:.1} rpm, feed {fed:.1} mm/min", rps * 60.0);
            let other = format!("{rpm:.1} rpm, feed {:.1} mm/min", feed.or(per_rev).unwrap_or(0.0) * rpm);
            self.units_are_open(node, if doubtful { "cutspeed" } else { "spindle" }, &iso, &other);
        }
        if let Some(v) = cut {
            self.in_range(node, "cutspeed", v, f64::MIN_POSITIVE, "above zero");
        }
        for (a, v) in [("feedrate", feed), ("feedrate_per_tooth", tooth)] {
            if let Some(v) = v {
                self.in_range(node, a, v, f64::MIN_POSITIVE, "above zero");
            }
        }
        // A tooth that takes more is no tooth of a mill: microns, or a feed per minute.
        if let Some(t) = tooth.filter(|t| iso && *t > THICKEST) {
            let must = format!("millimetres, {THICKEST} at most");
            self.say_at(code::PLAN_BAD_SIZE, node, "feedrate_per_tooth", &[&super::title(node), "feedrate_per_tooth", &gr_step::short(t), &must]);
        }
        let by_sign = spindle.is_none_or(|s| s <= 0.0);
        let clockwise = tool.right_handed.unwrap_or(by_sign);
        if let (Some(s), Some(right)) = (spindle.filter(|s| *s != 0.0), tool.right_handed)
            && right != by_sign
        {
            let name = |cw: bool| if cw { "clockwise" } else { "counter-clockwise" };
            let hand = if right { "right" } else { "left" };
            self.say_at(code::PLAN_SPINDLE_SIGN, node, "spindle", &[&s.to_string(), name(by_sign), hand, name(clockwise)]);
        }
        Technology {
            feed: feed_mm.filter(|f| *f > 0.0),
            speed: speed.filter(|s| *s > 0.0 || spindle == Some(0.0)),
            clockwise,
            written,
            ..self.switches(node, "synchronize_spindle_with_feed")
        }
    }

    fn functions(&mut self, node: Node<'m>) -> Functions {
        let flag = |a: &str| node.attr(a).and_then(|v| v.boolean()).unwrap_or(false);
        let why = "the program has no word for it";
        for a in ["through_spindle_coolant", "chip_removal"] {
            if flag(a) {
                self.no_effect(node, a, if a == "chip_removal" { why } else { "flood coolant is switched on instead" });
            }
        }
        for a in ["coolant_pressure", "through_pressure", "oriented_spindle_stop", "its_process_model"] {
            if node.attr(a).is_some() {
                self.no_effect(node, a, why);
            }
        }
        for a in ["axis_clamping", "other_functions"] {
            if node.attr(a).is_some_and(|v| v.items().next().is_some()) {
                self.no_effect(node, a, why);
            }
        }
        for a in ["tail_stock", "steady_rest", "follow_rest"] {
            if flag(a) {
                self.no_effect(node, a, why);
            }
        }
        Functions { flood: flag("coolant") || flag("through_spindle_coolant"), mist: flag("mist") }
    }

    /// The pieces of an explicit tool path.
    pub fn toolpaths(&mut self, list: Node<'m>, tool: Option<&Tool>) -> Vec<Toolpath> {
        let mut tied: Vec<(usize, Node<'m>)> = Vec::new();
        let mut out = Vec::new();
        for n in list.nodes("its_list") {
            if let Some(path) = self.toolpath(n, tool) {
                if n.is_a("approach_lift_path") {
                    tied.push((out.len(), n));
                }
                out.push(path);
            }
        }
        for (i, node) in tied {
            let curve = |t: &Toolpath| match &t.path {
                PathKind::Location { curve, .. } => Some(curve.clone()),
                _ => None,
            };
            let next = out[i + 1..].iter().find_map(curve);
            let before = out[..i].iter().rev().find_map(curve);
            let way_in = match out[i].role.as_str() {
                "APPROACH" => true,
                "LIFT" => false,
                _ => next.is_some() && before.is_none(),
            };
            let way = if way_in { next.and_then(|c| self.tied(node, &c)) } else { before.and_then(|c| self.tied(node, &c.reversed())).map(|c| c.reversed()) };
            match way {
                Some(curve) => out[i].path = PathKind::Location { curve, axis: None },
                None => self.not_lowered(node, ": no way leads from its fix point onto the path beside it by its angle or radius"),
            }
        }
        out
    }

    /// From the fix point of an approach to the beginning of a path: slanting at an angle to it, or on an arc tangent
    /// to it, in the plane of the path's direction and the fix point.
    fn tied(&mut self, node: Node<'m>, path: &Curve) -> Option<Curve> {
        let fix = node.node("fix_point").and_then(|p| self.point(p))?;
        if node.attr("fix_point_dir").is_some() {
            self.no_effect(node, "fix_point_dir", "the tool keeps the direction that it has on the path");
        }
        let (start, along) = (path.start, path.tangent()?);
        let aside = sub(fix, start);
        let out = sub(aside, scale(along, dot(aside, along)));
        let normal = unit(out).or_else(|| unit(sub([0.0, 0.0, 1.0], scale(along, along[2]))))?;
        let at = |x: f64, y: f64| add(start, add(scale(along, x), scale(normal, y)));
        if node.keyword() == "AP_LIFT_PATH_ANGLE" {
            let angle = self.angle(node.real("angle")?);
            let length = self.positive(node, "benddist", "the slanting way has a length")?;
            let bend = at(-length * libm::cos(angle), length * libm::sin(angle));
            return Some(Curve { start: fix, pieces: vec![Piece::Line(bend), Piece::Line(start)] });
        }
        let radius = self.positive(node, "radius", "an arc has one")?;
        // In the plane: the circle stands on the origin, the path leaves along +x. From the fix point straight on to
        // the circle, then round it counter-clockwise.
        let (x, y) = (dot(aside, along), dot(aside, normal) - radius);
        let far = libm::hypot(x, y);
        if far < radius + 1e-9 || y + radius < 1e-9 {
            return None;
        }
        let turn = libm::atan2(y, x) + libm::acos(radius / far);
        let touch = at(radius * libm::cos(turn), radius + radius * libm::sin(turn));
        let arc = Piece::Arc { center: at(0.0, radius), normal: cross(along, normal), end: start };
        Some(Curve { start: fix, pieces: vec![Piece::Line(touch), arc] })
    }

    /// Positions of machine axes, one curve of one dimension for each axis.
    fn axes(&mut self, node: Node<'m>, forward: bool) -> Option<PathKind> {
        let names: Vec<String> = node.attr("axis_list")?.items().filter_map(|v| v.string().map(|s| s.trim().to_uppercase())).collect();
        let curves = node.nodes("commands");
        let index = |name: &String| ["X", "Y", "Z"].iter().position(|a| a == name);
        let Some(which) = names.iter().map(index).collect::<Option<Vec<usize>>>().filter(|w| w.len() == curves.len() && !w.is_empty()) else {
            self.not_lowered(node, ": of its axes only X, Y and Z are known, each with a command");
            return None;
        };
        let mut rows: Vec<[Option<f64>; 3]> = Vec::new();
        for (axis, curve) in which.into_iter().zip(curves) {
            let Some(values) = (curve.keyword() == "POLYLINE").then(|| self.curve(curve, 0)).flatten().as_ref().and_then(corners) else {
                self.not_lowered(node, ": a command that is no polyline");
                return None;
            };
            if rows.is_empty() {
                rows = vec![[None; 3]; values.len()];
            }
            if rows.len() != values.len() {
                self.not_lowered(node, ": its axes have different numbers of positions");
                return None;
            }
            for (row, value) in rows.iter_mut().zip(values) {
                row[axis] = Some(value[0]);
            }
        }
        self.say(code::PLAN_TAKES_TURNS, node, &[&super::title(node), "positions of its axes are taken as coordinates of the setup, as in G-code"]);
        if !forward {
            rows.reverse();
        }
        Some(PathKind::Axes(rows))
    }

    fn toolpath(&mut self, node: Node<'m>, tool: Option<&Tool>) -> Option<Toolpath> {
        let role = node.attr("its_type").and_then(|v| v.choice()).unwrap_or_default();
        let (mut rapid, mut ratio) = (false, None);
        if let Some(speed) = node.attr("its_speed") {
            match speed.choice() {
                Some(name) => rapid = name == "RAPID",
                None => ratio = speed.real(),
            }
            if speed.node().is_some() {
                self.not_lowered(node, ": a feed along a curve (TOOLPATH_SPEED)");
                return None;
            }
        }
        let technology = node.node("its_technology").map(|t| self.technology(t, tool.unwrap_or(&Tool::default())));
        let functions = node.node("its_machine_functions").map(|f| self.functions(f));
        let path = match node.keyword() {
            "CUTTER_LOCATION_TRAJECTORY" => {
                let forward = node.attr("its_direction").and_then(|v| v.boolean()).unwrap_or(true);
                let curve = node.node("basiccurve").or_else(|| {
                    self.missing(node, "basiccurve", "the path is not known without it");
                    None
                })?;
                let curve = self.curve(curve, 0)?;
                let axis = match node.node("its_toolaxis") {
                    Some(a) => Some(self.curve(a, 0)?),
                    None => None,
                };
                if node.attr("surface_normal").is_some() {
                    self.no_effect(node, "surface_normal", "the path is that of the tool tip");
                }
                let (curve, axis) = if forward { (curve, axis) } else { (curve.reversed(), axis.map(|a| a.reversed())) };
                PathKind::Location { curve, axis }
            }
            "CUTTER_CONTACT_TRAJECTORY" => {
                let (curve, axis) = self.contact(node, tool)?;
                let forward = node.attr("its_direction").and_then(|v| v.boolean()).unwrap_or(true);
                let (curve, axis) = if forward { (curve, axis) } else { (curve.reversed(), axis.map(|a| a.reversed())) };
                PathKind::Location { curve, axis }
            }
            "AXIS_TRAJECTORY" => {
                let forward = node.attr("its_direction").and_then(|v| v.boolean()).unwrap_or(true);
                self.axes(node, forward)?
            }
            // Becomes a curve when its neighbours are known.
            "AP_LIFT_PATH_ANGLE" | "AP_LIFT_PATH_TANGENT" => PathKind::Direct,
            "FEEDSTOP" => PathKind::Feedstop(node.real("dwell").filter(|d| *d >= 0.0 && d.is_finite()).unwrap_or(0.0)),
            "CONNECT_SECPLANE" => PathKind::BySecurityPlane,
            "CONNECT_DIRECT" => PathKind::Direct,
            _ => {
                self.not_lowered(node, " in a tool path");
                return None;
            }
        };
        Some(Toolpath { origin: origin(node), role, rapid, ratio, technology, functions, path })
    }
}

/// Corners of a curve of straight pieces.
fn corners(curve: &Curve) -> Option<Vec<[f64; 3]>> {
    let line = |p: &Piece| match p {
        Piece::Line(q) => Some(*q),
        Piece::Arc { .. } => None,
    };
    std::iter::once(Some(curve.start)).chain(curve.pieces.iter().map(line)).collect()
}

/// Where the tip of a tool is whose edge touches a point: the centre of its rounding is off the surface by the edge
/// radius, its axis further out by what is left of the radius.
fn tip(contact: [f64; 3], normal: [f64; 3], axis: [f64; 3], radius: f64, edge: f64) -> [f64; 3] {
    let up = dot(normal, axis);
    let aside = unit(sub(normal, scale(axis, up))).unwrap_or([0.0; 3]);
    let centre = add(add(contact, scale(normal, edge)), scale(aside, radius - edge));
    sub(centre, scale(axis, edge))
}

impl<'m> Reader<'m> {
    /// A path of contact points as one of the tool's tip.
    fn contact(&mut self, node: Node<'m>, tool: Option<&Tool>) -> Option<(Curve, Option<Curve>)> {
        let Some(tool) = tool else {
            self.not_lowered(node, ": the path of the contact point without a tool");
            return None;
        };
        let Some(base) = node.node("basiccurve").filter(|b| b.keyword() == "CURVE_WITH_NORMAL_VECTOR") else {
            self.not_lowered(node, ": its basiccurve is no CURVE_WITH_NORMAL_VECTOR");
            return None;
        };
        let curve = base.node("basiccurve").and_then(|c| self.curve(c, 0))?;
        let normals = base.node("surface_normal").and_then(|c| self.curve(c, 0))?;
        let axis = match node.node("its_toolaxis") {
            Some(a) => Some(self.curve(a, 0)?),
            None => None,
        };
        let (points, normals) = (corners(&curve), corners(&normals));
        let axes = axis.as_ref().map(corners);
        let (Some(points), Some(normals)) = (points, normals) else {
            self.not_lowered(node, ": the contact path or its normals are no polyline");
            return None;
        };
        let axes = match axes {
            None => vec![[0.0, 0.0, 1.0]; points.len()],
            Some(a) => a.unwrap_or_default(),
        };
        if points.len() != normals.len() || points.len() != axes.len() {
            let what = format!("{} points, {} normals and {} tool axes", points.len(), normals.len(), axes.len());
            self.say(code::PLAN_CANNOT_CUT, node, &["the contact path", &what]);
            return None;
        }
        let (radius, edge) = (tool.diameter / 2.0, tool.edge_radius.min(tool.diameter / 2.0));
        let all: Option<Vec<[f64; 3]>> =
            points.iter().zip(&normals).zip(&axes).map(|((p, n), a)| Some(tip(*p, unit(*n)?, unit(*a)?, radius, edge))).collect();
        let Some(all) = all else {
            self.say(code::PLAN_CANNOT_CUT, node, &["the contact path", "a normal or tool axis has no direction"]);
            return None;
        };
        let start = *all.first()?;
        Some((Curve { start, pieces: all[1..].iter().map(|p| Piece::Line(*p)).collect() }, axis))
    }
}

/// Ratios above one are percent: the example of the standard writes 75.
fn as_ratio(v: f64) -> f64 {
    if v > 1.0 { v / 100.0 } else { v }
}
