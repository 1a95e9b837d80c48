//! Writes STEP-NC files for tests: a block of raw material, features, operations and tools.

use std::fmt::Write as _;

pub struct Part {
    data: Vec<String>,
    pub steps: Vec<usize>,
    block: [f64; 3],
    piece: usize,
    security: usize,
    features: Vec<(usize, String, Vec<usize>)>,
}

/// What a milling operation is given.
#[derive(Clone, Debug)]
pub struct Mill {
    pub keyword: &'static str,
    pub tool: usize,
    pub strategy: String,
    pub approach: String,
    pub retract: String,
    pub axial: f64,
    pub radial: f64,
    pub side: f64,
    pub bottom: f64,
}

impl Mill {
    pub fn new(keyword: &'static str, tool: usize, axial: f64, radial: f64) -> Mill {
        let strategy = "CONTOUR_PARALLEL($,$,$,$)".into();
        Mill { keyword, tool, strategy, approach: "$".into(), retract: "$".into(), axial, radial, side: 0.0, bottom: 0.0 }
    }
    pub fn strategy(mut self, s: &str) -> Mill {
        self.strategy = s.into();
        self
    }
    pub fn approach(mut self, s: &str) -> Mill {
        self.approach = s.into();
        self
    }
    pub fn retract(mut self, s: &str) -> Mill {
        self.retract = s.into();
        self
    }
    pub fn leave(mut self, side: f64, bottom: f64) -> Mill {
        (self.side, self.bottom) = (side, bottom);
        self
    }
}

pub fn r(v: f64) -> String {
    let text = format!("{v:?}");
    match text.split_once('e') {
        Some((m, e)) if m.contains('.') => format!("{m}E{e}"),
        Some((m, e)) => format!("{m}.E{e}"),
        None => text,
    }
}

impl Part {
    /// A block with a corner at the origin.
    pub fn new(block: [f64; 3]) -> Part {
        let mut p = Part { data: Vec::new(), steps: Vec::new(), block, piece: 0, security: 0, features: Vec::new() };
        p.data.push(String::new());
        let place = p.place([0.0; 3]);
        let raw = p.add(format!("BLOCK('raw',#{place},{},{},{})", r(block[0]), r(block[1]), r(block[2])));
        p.piece = p.add(format!("WORKPIECE('part',$,0.01,$,$,#{raw},())"));
        let high = p.place([0.0, 0.0, block[2] + 20.0]);
        p.security = p.add(format!("PLANE('security',#{high})"));
        p
    }
    pub fn add(&mut self, text: String) -> usize {
        self.data.push(text);
        self.data.len()
    }
    pub fn point(&mut self, p: [f64; 3]) -> usize {
        self.add(format!("CARTESIAN_POINT('',({},{},{}))", r(p[0]), r(p[1]), r(p[2])))
    }
    pub fn direction(&mut self, d: [f64; 3]) -> usize {
        self.add(format!("DIRECTION('',({},{},{}))", r(d[0]), r(d[1]), r(d[2])))
    }
    pub fn place(&mut self, p: [f64; 3]) -> usize {
        let p = self.point(p);
        self.add(format!("AXIS2_PLACEMENT_3D('',#{p},$,$)"))
    }
    pub fn turned(&mut self, p: [f64; 3], z: [f64; 3], x: [f64; 3]) -> usize {
        let (p, z, x) = (self.point(p), self.direction(z), self.direction(x));
        self.add(format!("AXIS2_PLACEMENT_3D('',#{p},#{z},#{x})"))
    }
    pub fn length(&mut self, v: f64) -> usize {
        let t = self.add("PLUS_MINUS_VALUE(0.05,0.05,3)".into());
        self.add(format!("TOLERANCED_LENGTH_MEASURE({},#{t})", r(v)))
    }
    pub fn number(&mut self, v: f64) -> usize {
        self.add(format!("NUMERIC_PARAMETER('length',{},'mm')", r(v)))
    }
    pub fn polyline(&mut self, points: &[(f64, f64)]) -> usize {
        let ids: Vec<String> = points.iter().map(|q| format!("#{}", self.point([q.0, q.1, 0.0]))).collect();
        self.add(format!("POLYLINE('',({}))", ids.join(",")))
    }
    pub fn tool(&mut self, kind: &str, diameter: f64, edge_radius: f64, half_angle: Option<f64>) -> usize {
        let tip = half_angle.map_or("$".into(), r);
        let d = self.add(format!("MILLING_TOOL_DIMENSION({},{tip},$,80.,{},$,$)", r(diameter), r(edge_radius)));
        let b = if kind.contains("DRILL") || kind == "T_SLOT_MILL" || kind == "TAPERED_REAMER" || kind.contains("COUNTERS") {
            format!("{kind}(#{d},4,.RIGHT.,.F.,$)")
        } else {
            format!("{kind}(#{d},4,.RIGHT.,.F.,$)")
        };
        let b = self.add(b);
        let e = self.add("CUTTING_COMPONENT(90.,$,$,$,$)".into());
        self.add(format!("MILLING_CUTTING_TOOL('{kind} {diameter}',#{b},(#{e}),$,$,$)"))
    }
    pub fn technology(&mut self) -> usize {
        self.add("MILLING_TECHNOLOGY(0.01,.TCP.,$,-20.,$,.F.,.F.,.F.,$)".into())
    }
    pub fn functions(&mut self) -> usize {
        self.add("MILLING_MACHINE_FUNCTIONS(.T.,$,$,.F.,$,(),.F.,$,$,())".into())
    }
    fn optional(&mut self, text: &str) -> String {
        if text == "$" { "$".into() } else { format!("#{}", self.add(text.into())) }
    }
    pub fn mill(&mut self, m: &Mill) -> usize {
        let (t, f) = (self.technology(), self.functions());
        let (s, a, b) = (self.optional(&m.strategy), self.optional(&m.approach), self.optional(&m.retract));
        let mut last = String::new();
        let _ = write!(last, "{}", r(m.axial));
        if m.keyword.contains("SIDE") {
            let _ = write!(last, ",{},{}", r(m.radial), r(m.side));
        }
        if m.keyword.contains("BOTTOM") || m.keyword.contains("PLANE") {
            let _ = write!(last, ",{}", r(m.bottom));
        }
        self.add(format!("{}($,$,'op',5.,$,#{},#{t},#{f},$,{a},{b},{s},{last})", m.keyword, m.tool))
    }
    pub fn drill(&mut self, keyword: &str, tool: usize, depth: Option<f64>, more: &str) -> usize {
        let (t, f) = (self.technology(), self.functions());
        let depth = depth.map_or("$".into(), r);
        self.add(format!("{keyword}($,$,'op',5.,$,#{tool},#{t},#{f},$,{depth},$,$,$,${more})"))
    }
    /// A feature with these operations, at a place, as deep as said: `head` is its keyword, `rest` what follows the
    /// depth (or the placement, where it has none).
    pub fn feature(&mut self, head: &str, operations: &[usize], at: [f64; 3], depth: Option<f64>, rest: &str) -> usize {
        let place = self.place(at);
        self.feature_at(head, operations, place, depth, rest)
    }
    pub fn feature_at(&mut self, head: &str, operations: &[usize], place: usize, depth: Option<f64>, rest: &str) -> usize {
        let ids: Vec<String> = operations.iter().map(|o| format!("#{o}")).collect();
        let depth = match depth {
            Some(d) => {
                let p = self.place([0.0, 0.0, -d]);
                format!(",#{}", self.add(format!("PLANE('depth',#{p})")))
            }
            None => String::new(),
        };
        let id = self.add(format!("{head}('feature',#{},({}),#{place}{depth}{rest})", self.piece, ids.join(",")));
        self.features.push((id, head.into(), operations.to_vec()));
        id
    }
    pub fn step(&mut self, feature: usize, operation: usize) {
        let name = format!("step {}", self.steps.len() + 1);
        let id = self.add(format!("MACHINING_WORKINGSTEP('{name}',#{},#{feature},#{operation},$)", self.security));
        self.steps.push(id);
    }
    /// A feature and a workingstep for each operation.
    pub fn machine(&mut self, head: &str, operations: &[usize], at: [f64; 3], depth: Option<f64>, rest: &str) -> usize {
        let f = self.feature(head, operations, at, depth, rest);
        for o in operations {
            self.step(f, *o);
        }
        f
    }
    /// The same part with another retract plane of its operations, which is 5 mm otherwise.
    #[allow(dead_code)]
    pub fn retract(mut self, plane: &str) -> Part {
        self.data.iter_mut().for_each(|d| *d = d.replace("'op',5.,", &format!("'op',{plane},")));
        self
    }
    #[allow(dead_code)]
    pub fn top(&self) -> f64 {
        self.block[2]
    }
    pub fn text(&self) -> String {
        let steps: Vec<String> = self.steps.iter().map(|s| format!("#{s}")).collect();
        let n = self.data.len();
        let mut out = String::from("ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION(('test part'),'2;1');\nFILE_NAME('part','2026-01-01T00:00:00',(''),(''),'','','');\nFILE_SCHEMA(('MACHINING_SCHEMA','MILLING_SCHEMA'));\nENDSEC;\nDATA;\n");
        let _ = writeln!(out, "#1=PROJECT('part',#{},(#{}),$,$,$);", n + 1, self.piece);
        for (i, d) in self.data.iter().enumerate().skip(1) {
            let _ = writeln!(out, "#{}={d};", i + 1);
        }
        let _ = writeln!(out, "#{}=WORKPLAN('main',({}),$,$,$);", n + 1, steps.join(","));
        out.push_str("ENDSEC;\nEND-ISO-10303-21;\n");
        out
    }
}
