//! The WHERE rules of the standard, each a small function over one instance. A rule that can't be decided
//! because a value is missing or of the wrong kind counts as kept: that fault has its own message.

use crate::model::{Model, Node, Val};

/// Which text a rule belongs to.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Origin {
    /// ISO 14649: the process model.
    Process,
    /// ISO 10303: geometry, topology, dates and people.
    Resource,
}

/// How a rule is decided.
#[derive(Clone, Copy)]
pub enum Decided {
    /// `None`: the values needed are missing.
    By(fn(Node<'_>) -> Option<bool>),
    /// Not decided, and why.
    Never(&'static str),
}

/// One rule.
pub struct Rule {
    /// Entity it is written in, lower case; its subtypes inherit it.
    pub entity: &'static str,
    /// Its label there.
    pub label: &'static str,
    /// What it asks, in plain words.
    pub says: &'static str,
    /// Where it comes from.
    pub origin: Origin,
    /// How it is decided.
    pub decided: Decided,
}

/// Every rule of the table.
pub static RULES: &[Rule] = &[
    process("topological_region", "WR1", "all its faces are ADVANCED_FACE", |n| all(n, "cfs_faces", |f| f.is_a("advanced_face"))),
    process("general_pocket_bottom_condition", "WR1", "the region that gives the bottom its shape has no operations of its own", |n| {
        Some(no_operations(n.node("shape")?))
    }),
    process("slot", "WR1", "a LOOP_SLOT_END_TYPE stands alone: a loop has no second end", |n| {
        let ends = n.nodes("end_conditions");
        let loops = ends.iter().filter(|e| e.is_a("loop_slot_end_type")).count();
        Some(loops != 1 || ends.len() == 1)
    }),
    process("compound_feature", "WR1", "its elements have no operations of their own: the compound feature has them", |n| {
        all(n, "elements", no_operations)
    }),
    process("counterbore_hole", "WR1", "it has exactly two elements", |n| Some(members(n, "elements")? == 2)),
    process("counterbore_hole", "WR2", "both elements are ROUND_HOLE", two_holes),
    process("counterbore_hole", "WR3", "its two holes differ in diameter", two_diameters),
    process("countersunk_hole", "WR1", "it has exactly two elements", |n| Some(members(n, "elements")? == 2)),
    process("countersunk_hole", "WR2", "both elements are ROUND_HOLE", two_holes),
    process("countersunk_hole", "WR3", "its two holes differ in diameter", two_diameters),
    process("countersunk_hole", "WR4", "its first hole has no change_in_diameter, its second has one: the cone", |n| {
        let [first, second] = pair(n)?;
        Some(first.attr("change_in_diameter").is_none() && second.attr("change_in_diameter").is_some())
    }),
    process("rectangular_pattern", "WR1", "it has more than one row, and row_spacing and row_layout_direction are given", |n| {
        let rows = n.attr("number_of_rows").map_or(Some(0), Val::integer)?;
        Some(rows > 1 && n.attr("row_spacing").is_some() && n.attr("row_layout_direction").is_some())
    }),
    process("thread", "WR1", "it is cut on a ROUND_HOLE, a BOSS or a CIRCULAR_CLOSED_SHAPE_PROFILE", |n| {
        all(n, "applied_shape", |f| f.is_a("round_hole") || f.is_a("boss") || f.is_a("circular_closed_shape_profile"))
    }),
    process("in_process_geometry", "WR1", "one of as_is, to_be and removal is given", |n| Some(any_given(n, &["as_is", "to_be", "removal"]))),
    process("offset_vector", "WR1", "all its variables have an initial_value", |n| {
        let mut variables = n.nodes("translate");
        variables.extend(n.nodes("rotate"));
        Some(variables.iter().all(|v| v.attr("initial_value").is_some()))
    }),
    process("workplan", "WR1", "it is not one of its own elements", |n| Some(!n.nodes("its_elements").contains(&n))),
    process("setup_instruction", "WR1", "description or external_document is given", |n| Some(any_given(n, &["description", "external_document"]))),
    process("toolpath_speed", "WR1", "its speed is a curve of one dimension", |n| Some(dimension(n.node("speed")?)? == 1)),
    process("axis_trajectory", "WR1", "its commands are curves of one dimension", |n| {
        Some(n.nodes("commands").into_iter().filter_map(dimension).all(|d| d == 1))
    }),
    process("milling_technology", "WR1", "either cutspeed or spindle is given, not both (or adaptive control decides)", |n| {
        Some(one_given(n, "cutspeed", "spindle") || n.attr("its_adaptive_control").is_some())
    }),
    process("milling_technology", "WR2", "either feedrate or feedrate_per_tooth is given, not both (or adaptive control decides)", |n| {
        Some(one_given(n, "feedrate", "feedrate_per_tooth") || n.attr("its_adaptive_control").is_some())
    }),
    process("plane_rough_milling", "WR1", "allowance_bottom is given and not negative", |n| allowance(n, "allowance_bottom")),
    process("side_rough_milling", "WR1", "allowance_side is given and not negative", |n| allowance(n, "allowance_side")),
    process("bottom_and_side_rough_milling", "WR1", "allowance_side is given and not negative", |n| allowance(n, "allowance_side")),
    process("bottom_and_side_rough_milling", "WR2", "allowance_bottom is given and not negative", |n| allowance(n, "allowance_bottom")),
    process("drilling_type_strategy", "WR1", "with reduced_cut_at_start or reduced_feed_at_start, depth_of_start is given", |n| {
        Some(n.attr("depth_of_start").is_some() || !any_given(n, &["reduced_cut_at_start", "reduced_feed_at_start"]))
    }),
    process("drilling_type_strategy", "WR2", "with reduced_cut_at_end or reduced_feed_at_end, depth_of_end is given", |n| {
        Some(n.attr("depth_of_end").is_some() || !any_given(n, &["reduced_cut_at_end", "reduced_feed_at_end"]))
    }),
    process("ball_endmill", "WR1", "edge_center_horizontal of its dimension is 0 or not given", |n| dimension_is(n, "edge_center_horizontal", 0.0)),
    process("ball_endmill", "WR2", "edge_center_vertical of its dimension is half the diameter or not given", |n| dimension_is(n, "edge_center_vertical", 0.5)),
    process("ball_endmill", "WR3", "edge_radius of its dimension is half the diameter or not given", |n| dimension_is(n, "edge_radius", 0.5)),
    process("ball_endmill", "WR4", "tool_tip_half_angle of its dimension is 0 or not given", |n| dimension_is(n, "tool_tip_half_angle", 0.0)),
    process("ball_endmill", "WR5", "tool_circumference_angle of its dimension is 0 or not given", |n| dimension_is(n, "tool_circumference_angle", 0.0)),
    process("bullnose_endmill", "WR1", "its edge radius is given and smaller than half the diameter", |n| {
        let d = n.real("effective_cutting_diameter").or_else(|| n.node("dimension")?.real("diameter"))?;
        let r = n.real("edge_radius").or_else(|| n.node("dimension")?.real("edge_radius"));
        Some(r.is_some_and(|r| r > 0.0 && r < d / 2.0))
    }),
    process("ballnose_endmill", "WR1", "its edge_radius is half the effective_cutting_diameter or not given", |n| {
        let d = n.real("effective_cutting_diameter")?;
        Some(n.real("edge_radius").is_none_or(|r| near(r, d / 2.0)))
    }),
    process("turning_technology", "WR1", "either feedrate or the feed per revolution is given, not both", |n| {
        let per_turn = any_given(n, &["feed_per_revolution", "feedrate_per_revolution"]);
        Some(n.attr("feedrate").is_some() != per_turn)
    }),
    process("facing_rough", "WR1", "allowance is given and not negative", |n| allowance(n, "allowance")),
    process("grooving_rough", "WR1", "allowance is given and not negative", |n| allowance(n, "allowance")),
    process("cutting_in", "WR1", "allowance is not given", |n| Some(n.attr("allowance").is_none())),
    process("contouring_rough", "WR1", "allowance is given and not negative", |n| allowance(n, "allowance")),
    process("threading_rough", "WR1", "allowance is given and not negative", |n| allowance(n, "allowance")),
    resource("trimmed_curve", "WR1", "a first trim of two values gives a point and a parameter", |n| trims(n, "trim_1")),
    resource("trimmed_curve", "WR2", "a second trim of two values gives a point and a parameter", |n| trims(n, "trim_2")),
    never("trimmed_curve", "WR3", "master_representation is a parameter", "files that are in use prefer points; both are read"),
    resource("composite_curve", "WR1", "only the last segment of an open curve is .DISCONTINUOUS.; a closed one has none", |n| {
        let segments = n.nodes("segments");
        let breaks = |s: &Node<'_>| s.attr("transition").and_then(Val::choice).as_deref() == Some("DISCONTINUOUS");
        let last = segments.last()?;
        Some(segments.iter().filter(|s| breaks(s)).count() == usize::from(breaks(last)))
    }),
    resource("composite_curve_segment", "WR1", "its parent_curve is a bounded curve", |n| Some(n.node("parent_curve")?.is_a("bounded_curve"))),
    resource("axis1_placement", "WR1", "its location has three coordinates", |n| Some(dimension(n.node("location")?)? == 3)),
    resource("axis2_placement_3d", "WR1", "its location has three coordinates", |n| Some(dimension(n.node("location")?)? == 3)),
    resource("axis2_placement_3d", "WR2", "its axis has three components", |n| n.node("axis").map_or(Some(true), |a| Some(dimension(a)? == 3))),
    resource("axis2_placement_3d", "WR3", "its ref_direction has three components", |n| {
        n.node("ref_direction").map_or(Some(true), |a| Some(dimension(a)? == 3))
    }),
    resource("axis2_placement_3d", "WR4", "axis and ref_direction are not parallel", |n| {
        let (Some(a), Some(b)) = (n.node("axis"), n.node("ref_direction")) else { return Some(true) };
        let (a, b) = (vector(a)?, vector(b)?);
        // A direction of no length breaks its own rule.
        if [a, b].contains(&[0.0; 3]) {
            return None;
        }
        let cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        Some(cross.iter().any(|c| c.abs() > 1e-12))
    }),
    resource("pcurve", "WR1", "its reference_to_curve has one item", |n| Some(n.node("reference_to_curve")?.nodes("items").len() == 1)),
    resource("pcurve", "WR2", "that item is a curve", |n| Some(n.node("reference_to_curve")?.nodes("items").first()?.is_a("curve"))),
    resource("pcurve", "WR3", "that curve has two dimensions", |n| {
        Some(dimension(*n.node("reference_to_curve")?.nodes("items").first()?)? == 2)
    }),
    resource("bounded_pcurve", "WR1", "the curve it refers to is bounded", |n| {
        Some(n.node("reference_to_curve")?.nodes("items").first()?.is_a("bounded_curve"))
    }),
    resource("b_spline_curve", "WR1", "it is one of the kinds of B-spline curve: uniform, quasi-uniform, Bezier, with knots", |n| {
        Some(["uniform_curve", "quasi_uniform_curve", "bezier_curve", "b_spline_curve_with_knots"].iter().any(|k| n.is_a(k)))
    }),
    resource("b_spline_curve_with_knots", "WR1", "degree, control points, multiplicities and knots fit together", |n| {
        knots(n, "degree", members(n, "control_points_list")?, "knot_multiplicities", "knots")
    }),
    resource("b_spline_curve_with_knots", "WR2", "there are as many multiplicities as knots", |n| {
        Some(members(n, "knot_multiplicities")? == members(n, "knots")?)
    }),
    resource("b_spline_surface", "WR1", "it is one of the kinds of B-spline surface: uniform, quasi-uniform, Bezier, with knots", |n| {
        Some(["uniform_surface", "quasi_uniform_surface", "bezier_surface", "b_spline_surface_with_knots"].iter().any(|k| n.is_a(k)))
    }),
    resource("b_spline_surface_with_knots", "WR1", "degree, control points, multiplicities and knots fit together along u", |n| {
        knots(n, "u_degree", members(n, "control_points_list")?, "u_multiplicities", "u_knots")
    }),
    resource("b_spline_surface_with_knots", "WR2", "degree, control points, multiplicities and knots fit together along v", |n| {
        let rows = n.attr("control_points_list")?.items().next()?.items().count();
        knots(n, "v_degree", rows, "v_multiplicities", "v_knots")
    }),
    resource("b_spline_surface_with_knots", "WR3", "there are as many u_multiplicities as u_knots", |n| {
        Some(members(n, "u_multiplicities")? == members(n, "u_knots")?)
    }),
    resource("b_spline_surface_with_knots", "WR4", "there are as many v_multiplicities as v_knots", |n| {
        Some(members(n, "v_multiplicities")? == members(n, "v_knots")?)
    }),
    resource("direction", "WR1", "one of its ratios is not zero", |n| Some(ratios(n)?.iter().any(|r| *r != 0.0))),
    never("geometric_representation_item", "WR1", "it is used in a geometric context", "ISO 14649 files write geometry without representations"),
    resource("line", "WR1", "its point and its direction have the same dimension", |n| {
        Some(dimension(n.node("pnt")?)? == dimension(n.node("dir")?.node("orientation")?)?)
    }),
    resource("parabola", "WR1", "focal_dist is not zero", |n| Some(n.real("focal_dist")? != 0.0)),
    resource("rational_b_spline_curve", "WR1", "there are as many weights as control points", |n| {
        Some(members(n, "weights_data")? == members(n, "control_points_list")?)
    }),
    resource("rational_b_spline_curve", "WR2", "all weights are positive", |n| Some(n.attr("weights_data")?.items().filter_map(Val::real).all(|w| w > 0.0))),
    resource("rational_b_spline_surface", "WR1", "there are as many weights as control points, in rows and columns", |n| {
        let (w, p) = (n.attr("weights_data")?, n.attr("control_points_list")?);
        Some(w.items().count() == p.items().count() && w.items().next()?.items().count() == p.items().next()?.items().count())
    }),
    resource("rational_b_spline_surface", "WR2", "all weights are positive", |n| {
        Some(n.attr("weights_data")?.items().flat_map(Val::items).filter_map(Val::real).all(|w| w > 0.0))
    }),
    resource("vector", "WR1", "its magnitude is not negative", |n| Some(n.real("magnitude")? >= 0.0)),
    resource("edge_loop", "WR1", "it ends at the vertex where it begins", |n| {
        let edges = n.nodes("edge_list");
        Some(ends(*edges.first()?)?[0] == ends(*edges.last()?)?[1])
    }),
    resource("face", "WR1", "its bounds are not a mixture of vertex loops and edge loops", |n| {
        let bounds: Vec<Node<'_>> = n.nodes("bounds").iter().filter_map(|b| b.node("bound")).collect();
        let points = bounds.iter().filter(|b| b.is_a("vertex_loop")).count();
        Some(points == 0 || points == bounds.len())
    }),
    resource("face", "WR2", "at most one of its bounds is a FACE_OUTER_BOUND", |n| {
        Some(n.nodes("bounds").iter().filter(|b| b.is_a("face_outer_bound")).count() <= 1)
    }),
    resource("face_surface", "WR1", "its geometry is not an ORIENTED_SURFACE", |n| Some(!n.node("face_geometry")?.is_a("oriented_surface"))),
    resource("oriented_closed_shell", "WR1", "it does not turn another ORIENTED_CLOSED_SHELL", |n| not_again(n, "closed_shell_element", "oriented_closed_shell")),
    resource("oriented_edge", "WR1", "it does not turn another ORIENTED_EDGE", |n| not_again(n, "edge_element", "oriented_edge")),
    resource("oriented_face", "WR1", "it does not turn another ORIENTED_FACE", |n| not_again(n, "face_element", "oriented_face")),
    resource("oriented_open_shell", "WR1", "it does not turn another ORIENTED_OPEN_SHELL", |n| not_again(n, "open_shell_element", "oriented_open_shell")),
    resource("oriented_path", "WR1", "it does not turn another ORIENTED_PATH", |n| not_again(n, "path_element", "oriented_path")),
    resource("path", "WR1", "each edge begins where the one before it ends", |n| {
        let edges: Option<Vec<[Node<'_>; 2]>> = n.nodes("edge_list").into_iter().map(ends).collect();
        Some(edges?.windows(2).all(|w| w[0][1] == w[1][0]))
    }),
    never("mapped_item", "WR1", "it does not contain itself through its representation", "cycles of any kind have a message of their own"),
    never("representation_item", "WR1", "it is used in a representation", "ISO 14649 files write geometry without representations"),
    resource("representation_map", "WR1", "its origin is in the representation that it maps", |n| {
        let origin = n.node("mapping_origin")?;
        Some(n.node("mapped_representation")?.nodes("items").contains(&origin))
    }),
    resource("calendar_date", "WR1", "month and day exist in that year", |n| {
        let (y, m, d) = (integer(n, "year_component")?, integer(n, "month_component")?, integer(n, "day_component")?);
        let days = match m {
            4 | 6 | 9 | 11 => 30,
            2 => 28 + i64::from(leap(y)),
            _ => 31,
        };
        Some((1..=12).contains(&m) && (1..=days).contains(&d))
    }),
    resource("ordinal_date", "WR1", "the day exists in that year", |n| {
        let days = 365 + i64::from(leap(integer(n, "year_component")?));
        Some((1..=days).contains(&integer(n, "day_component")?))
    }),
    resource("local_time", "WR1", "hour, minute and second exist, and seconds stand only with minutes", |n| {
        let hour = integer(n, "hour_component")?;
        let minute = integer(n, "minute_component");
        let second = n.real("second_component");
        let seconds = second.is_none_or(|s| minute.is_some() && (0.0..=60.0).contains(&s));
        Some((0..24).contains(&hour) && minute.is_none_or(|m| (0..60).contains(&m)) && seconds)
    }),
    resource("coordinated_universal_time_offset", "WR1", "hour_offset is 0 to 12", |n| Some((0..=12).contains(&integer(n, "hour_offset")?))),
    resource("coordinated_universal_time_offset", "WR2", "minute_offset is 0 to 59", |n| Some((0..60).contains(&integer(n, "minute_offset")?))),
    resource("coordinated_universal_time_offset", "WR3", "an offset that is not zero is .AHEAD. or .BEHIND.", |n| {
        Some(integer(n, "hour_offset")? == 0 || n.attr("sense")?.choice()? != "EXACT")
    }),
    resource("person", "WR1", "last_name or first_name is given", |n| Some(any_given(n, &["last_name", "first_name"]))),
    resource("address", "WR1", "at least one line of the address is given", |n| Some(n.parameters().any(Val::is_set))),
    resource("advanced_face", "WR1", "its surface is elementary, a B-spline or swept", |n| {
        let g = n.node("face_geometry")?;
        Some(["elementary_surface", "b_spline_surface", "swept_surface"].iter().any(|k| g.is_a(k)))
    }),
    resource("advanced_face", "WR2", "all edges of its edge loops have curves", |n| edges(n, |e| e.is_a("edge_curve"))),
    resource("advanced_face", "WR3", "these curves are lines, conics, polylines or B-splines", |n| {
        edges(n, |e| e.node("edge_geometry").is_none_or(plain_curve))
    }),
    resource("advanced_face", "WR4", "all vertices of its edges are points with coordinates", |n| {
        edges(n, |e| [e.node("edge_start"), e.node("edge_end")].into_iter().flatten().all(point_vertex))
    }),
    resource("advanced_face", "WR5", "no bound is an ORIENTED_PATH", |n| {
        Some(!n.nodes("bounds").iter().filter_map(|b| b.node("bound")).any(|b| b.is_a("oriented_path")))
    }),
    resource("advanced_face", "WR6", "a swept surface is swept by a line, conic, polyline or B-spline", |n| {
        n.node("face_geometry")?.node("swept_curve").map_or(Some(true), |c| Some(plain_curve(c)))
    }),
    resource("advanced_face", "WR7", "vertices of its vertex loops are points with coordinates", |n| {
        let loops = n.nodes("bounds").into_iter().filter_map(|b| b.node("bound")).filter_map(|b| b.node("loop_vertex"));
        Some(loops.into_iter().all(point_vertex))
    }),
    resource("advanced_face", "WR8", "each of its bounds is an edge loop or a vertex loop", |n| {
        let mut bounds = n.nodes("bounds").into_iter().filter_map(|b| b.node("bound"));
        Some(bounds.all(|b| b.is_a("edge_loop") || b.is_a("vertex_loop")))
    }),
    resource("advanced_face", "WR10", "polylines in it have three points or more", |n| {
        let long = |c: Node<'_>| !c.is_a("polyline") || c.nodes("points").len() >= 3;
        let swept = n.node("face_geometry")?.node("swept_curve").is_none_or(long);
        Some(swept && edges(n, |e| e.node("edge_geometry").is_none_or(long))?)
    }),
    resource("advanced_brep_shape_representation", "WR1", "its items are solids, mapped items or placements", |n| {
        all(n, "items", |i| ["manifold_solid_brep", "faceted_brep", "mapped_item", "axis2_placement_3d"].iter().any(|k| i.is_a(k)))
    }),
    resource("advanced_brep_shape_representation", "WR2", "one of its items is a solid or a mapped item", |n| {
        Some(n.nodes("items").iter().any(|i| i.is_a("manifold_solid_brep") || i.is_a("mapped_item")))
    }),
    resource("advanced_brep_shape_representation", "WR4", "the outer shell of a solid is not an ORIENTED_CLOSED_SHELL", |n| {
        all(n, "items", |i| i.node("outer").is_none_or(|o| !o.is_a("oriented_closed_shell")))
    }),
];

const fn process(entity: &'static str, label: &'static str, says: &'static str, check: fn(Node<'_>) -> Option<bool>) -> Rule {
    Rule { entity, label, says, origin: Origin::Process, decided: Decided::By(check) }
}

const fn resource(entity: &'static str, label: &'static str, says: &'static str, check: fn(Node<'_>) -> Option<bool>) -> Rule {
    Rule { entity, label, says, origin: Origin::Resource, decided: Decided::By(check) }
}

const fn never(entity: &'static str, label: &'static str, says: &'static str, why: &'static str) -> Rule {
    Rule { entity, label, says, origin: Origin::Resource, decided: Decided::Never(why) }
}

/// Rules that the file breaks, with the instance that breaks each; in file order. Damaged instances are left out.
pub fn broken<'m>(model: &'m Model<'m>) -> Vec<(Node<'m>, &'static Rule)> {
    // Which rules an entity has: asked once per keyword.
    let mut per_keyword: Vec<Option<Vec<&'static Rule>>> = vec![None; model.file().keywords.len()];
    let mut out = Vec::new();
    for node in model.instances().filter(|n| !n.damaged()) {
        let slot = model.file().instances[node.index() as usize].keyword as usize;
        if node.complex() {
            out.extend(rules_of(node).into_iter().filter(|r| breaks(r, node)).map(|r| (node, r)));
            continue;
        }
        let rules = per_keyword[slot].get_or_insert_with(|| rules_of(node));
        out.extend(rules.iter().filter(|r| breaks(r, node)).map(|r| (node, *r)));
    }
    out
}

/// The rules that instances of an entity are held to, its own and those that it inherits.
pub fn rules_of_entity(keyword: &str) -> Vec<&'static Rule> {
    let decided = RULES.iter().filter(|r| matches!(r.decided, Decided::By(_)));
    decided.filter(|r| keyword.eq_ignore_ascii_case(r.entity) || crate::schema().is_a(keyword, r.entity)).collect()
}

fn rules_of(node: Node<'_>) -> Vec<&'static Rule> {
    RULES.iter().filter(|r| matches!(r.decided, Decided::By(_)) && node.is_a(r.entity)).collect()
}

fn breaks(rule: &Rule, node: Node<'_>) -> bool {
    matches!(rule.decided, Decided::By(check) if check(node) == Some(false))
}

fn all(n: Node<'_>, list: &str, good: impl Fn(Node<'_>) -> bool) -> Option<bool> {
    Some(n.nodes(list).into_iter().all(good))
}

fn members(n: Node<'_>, list: &str) -> Option<usize> {
    Some(n.attr(list)?.items().count())
}

fn integer(n: Node<'_>, name: &str) -> Option<i64> {
    n.attr(name)?.integer()
}

fn any_given(n: Node<'_>, names: &[&str]) -> bool {
    names.iter().any(|a| n.attr(a).is_some())
}

fn one_given(n: Node<'_>, a: &str, b: &str) -> bool {
    n.attr(a).is_some() != n.attr(b).is_some()
}

fn no_operations(n: Node<'_>) -> bool {
    n.attr("its_operations").is_none_or(|o| o.items().next().is_none())
}

fn allowance(n: Node<'_>, name: &str) -> Option<bool> {
    // An edition without the attribute asks nothing.
    n.written(name)?;
    Some(n.real(name).is_some_and(|a| a >= 0.0))
}

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-9 * a.abs().max(b.abs()).max(1.0)
}

/// An attribute of the tool dimension is `share` of the diameter, or not given.
fn dimension_is(n: Node<'_>, name: &str, share: f64) -> Option<bool> {
    let dimension = n.node("dimension")?;
    let Some(value) = dimension.real(name) else { return Some(true) };
    Some(near(value, share * dimension.real("diameter")?))
}

fn pair<'m>(n: Node<'m>) -> Option<[Node<'m>; 2]> {
    n.nodes("elements").try_into().ok()
}

fn two_holes(n: Node<'_>) -> Option<bool> {
    let holes = n.nodes("elements");
    Some(holes.iter().filter(|e| e.is_a("round_hole")).count() == 2)
}

fn two_diameters(n: Node<'_>) -> Option<bool> {
    let [a, b] = pair(n)?;
    Some(a.length("diameter")? != b.length("diameter")?)
}

fn ratios(n: Node<'_>) -> Option<Vec<f64>> {
    n.attr("direction_ratios")?.items().map(Val::real).collect()
}

fn vector(n: Node<'_>) -> Option<[f64; 3]> {
    ratios(n)?.try_into().ok()
}

/// Number of coordinates of a point, a direction, or the points of a curve.
fn dimension(n: Node<'_>) -> Option<usize> {
    if let Some(c) = n.attr("coordinates").or_else(|| n.attr("direction_ratios")) {
        return Some(c.items().count());
    }
    let point = n.nodes("control_points_list").first().copied().or_else(|| n.nodes("points").first().copied()).or_else(|| n.node("pnt"))?;
    Some(point.attr("coordinates")?.items().count())
}

fn trims(n: Node<'_>, name: &str) -> Option<bool> {
    let kinds: Vec<bool> = n.attr(name)?.items().map(|v| v.node().is_some()).collect();
    Some(kinds.len() != 2 || kinds[0] != kinds[1])
}

/// The constraints on a knot vector: ISO 10303-42.
fn knots(n: Node<'_>, degree: &str, points: usize, multiplicities: &str, knots: &str) -> Option<bool> {
    let degree = usize::try_from(integer(n, degree)?).ok()?;
    let many: Vec<i64> = n.attr(multiplicities)?.items().map(Val::integer).collect::<Option<_>>()?;
    let at: Vec<f64> = n.attr(knots)?.items().map(Val::real).collect::<Option<_>>()?;
    if many.len() != at.len() || many.len() < 2 {
        return Some(false);
    }
    let total: i64 = many.iter().sum();
    let inside = many[1..many.len() - 1].iter().all(|m| *m >= 1 && *m <= degree as i64);
    let outside = [many[0], many[many.len() - 1]].iter().all(|m| *m >= 1 && *m <= degree as i64 + 1);
    let rising = at.windows(2).all(|w| w[0] < w[1]);
    Some(degree >= 1 && points > degree && total == (points + degree + 1) as i64 && inside && outside && rising)
}

/// Start and end vertex of an oriented edge.
fn ends<'m>(edge: Node<'m>) -> Option<[Node<'m>; 2]> {
    let Some(element) = edge.node("edge_element") else {
        return Some([edge.node("edge_start")?, edge.node("edge_end")?]);
    };
    let (a, b) = (element.node("edge_start")?, element.node("edge_end")?);
    Some(if edge.attr("orientation")?.boolean()? { [a, b] } else { [b, a] })
}

fn not_again(n: Node<'_>, element: &str, kind: &str) -> Option<bool> {
    Some(!n.node(element)?.is_a(kind))
}

/// Whether all edges of a face's edge loops are good.
fn edges(face: Node<'_>, good: impl Fn(Node<'_>) -> bool) -> Option<bool> {
    let loops = face.nodes("bounds").into_iter().filter_map(|b| b.node("bound")).filter(|b| b.is_a("edge_loop"));
    let elements = loops.flat_map(|l| l.nodes("edge_list")).filter_map(|e| e.node("edge_element"));
    Some(elements.into_iter().all(good))
}

fn plain_curve(c: Node<'_>) -> bool {
    ["line", "conic", "polyline", "b_spline_curve"].iter().any(|k| c.is_a(k))
}

fn point_vertex(v: Node<'_>) -> bool {
    v.is_a("vertex_point") && v.node("vertex_geometry").is_some_and(|p| p.is_a("cartesian_point"))
}

fn leap(year: i64) -> bool {
    year % 4 == 0 && (year % 100 != 0 || year % 400 == 0)
}
