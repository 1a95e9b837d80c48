//! The STEP-NC to RS274NGC adapter of M. E. Gutierrez Paredes, *Desenvolvimento de uma Fresadora CNC Aderente
//! à Norma STEP-NC Baseado no Controlador de Máquina Avançado (EMC2)*, Universidade de Brasília, 2013: the
//! slot with V walls and base radius (Fig. 4.45), drilled holes (example a), the tool list, the configuration
//! file. Other features it refuses by name.

use std::fmt::Write as _;

use gr_text::{Diagnostic, FileId, Span, code};

use crate::process::*;

const NAME: &str = "unb2013";
/// Height above the tool change point, mm.
const TOOL_CHANGE_CLEARANCE: f64 = 5.0;

/// The twelve keys of `arqConf.txt`. Feeds are mm/min.
#[derive(Clone, PartialEq, Debug)]
pub struct Config {
    /// `Repositorio`: folder of the working file.
    pub repository: String,
    /// `Code_p21`: folder of the copy that the viewer shows.
    pub copy: String,
    /// `ComentariosInf`: what was read, as comments.
    pub read_comments: bool,
    /// `ComentariosCod`: what the blocks are for, as comments.
    pub code_comments: bool,
    /// `Pla_Seg`: highest safety plane, at most 55 mm.
    pub safety_plane: f64,
    /// `VelAvaMaq`: machine feed, at most 900.
    pub machine_feed: f64,
    /// `VelAvaCorte`: cutting feed, at most 400.
    pub cutting_feed: f64,
    /// `AvaProfCorte`: depth of a pass, at most 2 mm.
    pub pass_depth: f64,
    /// `AvaAngSemiCir`: step along base radii, at most 10 degrees.
    pub arc_step: f64,
    /// `PorFerEspiral`: step of spirals, at least 50 percent of the tool.
    pub spiral_percent: f64,
    /// `AvaLinhaProf`: depth step along inclined walls, 0.5 to 2 mm.
    pub wall_step: f64,
    /// `tooltbl`: folder of the tool table.
    pub tool_table: String,
}

impl Default for Config {
    fn default() -> Config {
        Config {
            repository: String::new(),
            copy: String::new(),
            read_comments: false,
            code_comments: false,
            safety_plane: 55.0,
            machine_feed: 900.0,
            cutting_feed: 400.0,
            pass_depth: 2.0,
            arc_step: 10.0,
            spiral_percent: 50.0,
            wall_step: 1.0,
            tool_table: String::new(),
        }
    }
}

/// Reads `arqConf.txt`: `key=value`, one per line.
pub fn config(text: &str, file: FileId) -> (Config, Vec<Diagnostic>) {
    let mut c = Config::default();
    let mut out = Vec::new();
    let mut at = 0u32;
    for line in text.split_inclusive('\n') {
        let span = Span::new(at, at + line.trim_end().len() as u32);
        at += line.len() as u32;
        let line = line.trim();
        if line.is_empty() {
            continue;
        }
        let (key, value) = line.split_once('=').map_or((line, ""), |(k, v)| (k.trim(), v.trim()));
        if let Err(why) = set(&mut c, key, value) {
            let args = [key.to_string(), value.to_string(), why];
            out.push(Diagnostic::new(code::REFERENCE_BAD_SETTING, file, span, &args));
        }
    }
    (c, out)
}

fn set(c: &mut Config, key: &str, value: &str) -> Result<(), String> {
    let number = |low: f64, high: f64| match value.parse::<f64>() {
        Ok(v) if v >= low && v <= high => Ok(v),
        Ok(_) if low == f64::MIN_POSITIVE => Err(format!("must be above 0 and at most {high}")),
        Ok(_) if high == f64::MAX => Err(format!("must be at least {low}")),
        Ok(_) => Err(format!("must be {low} to {high}")),
        Err(_) => Err("is not a number".to_string()),
    };
    let flag = || match value {
        "true" => Ok(true),
        "false" => Ok(false),
        _ => Err("must be true or false".to_string()),
    };
    match key {
        "Repositorio" => c.repository = value.into(),
        "Code_p21" => c.copy = value.into(),
        "ComentariosInf" => c.read_comments = flag()?,
        "ComentariosCod" => c.code_comments = flag()?,
        "Pla_Seg" => c.safety_plane = number(f64::MIN_POSITIVE, 55.0)?,
        "VelAvaMaq" => c.machine_feed = number(f64::MIN_POSITIVE, 900.0)?,
        "VelAvaCorte" => c.cutting_feed = number(f64::MIN_POSITIVE, 400.0)?,
        "AvaProfCorte" => c.pass_depth = number(f64::MIN_POSITIVE, 2.0)?,
        "AvaAngSemiCir" => c.arc_step = number(f64::MIN_POSITIVE, 10.0)?,
        "PorFerEspiral" => c.spiral_percent = number(50.0, f64::MAX)?,
        "AvaLinhaProf" => c.wall_step = number(0.5, 2.0)?,
        "tooltbl" => c.tool_table = value.into(),
        _ => return Err("is none of the twelve keys".to_string()),
    }
    Ok(())
}

/// A tool as the system lists it.
#[derive(Clone, PartialEq, Debug)]
pub struct Listed {
    /// Index in the whole program, from 1.
    pub index: u32,
    /// CENTER_DRILL, FACEMILL …
    pub kind: String,
    /// Diameter.
    pub diameter: f64,
    /// Edge radius.
    pub radius: f64,
    /// Tip angle of twist drills, rad.
    pub tip: f64,
    /// Length of the cutting edge.
    pub cutting: f64,
}

/// What the system makes of a file.
#[derive(Clone, PartialEq, Debug)]
pub struct Output {
    /// Program.
    pub program: String,
    /// Tool table.
    pub table: String,
    /// Tool list.
    pub tools: Vec<Listed>,
}

impl Output {
    /// The blocks with an N word, in order.
    pub fn blocks(&self) -> Vec<&str> {
        self.program.lines().filter(|l| l.starts_with('N')).collect()
    }
}

const ORDER: [&str; 5] = ["CENTER_DRILL", "TWIST_DRILL", "FACEMILL", "BALL_ENDMILL", "BULLNOSE_ENDMILL"];

fn kind_of(tool: &Tool) -> &str {
    if tool.kind == "CENTERDRILL" { "CENTER_DRILL" } else { &tool.kind }
}

/// The tool list: by kind, within a kind in the order of first use, no two alike. The cutting length is no
/// part of what makes tools alike.
pub fn tool_list(used: &[Tool]) -> Vec<Listed> {
    let mut out: Vec<Listed> = Vec::new();
    for kind in ORDER {
        for t in used.iter().filter(|t| kind_of(t) == kind) {
            let tip = if kind == "TWIST_DRILL" { t.tip_angle.unwrap_or(0.0) } else { 0.0 };
            if !out.iter().any(|l| same(l, t)) {
                let cutting = t.cutting_length.unwrap_or(0.0);
                out.push(Listed { index: 0, kind: kind.into(), diameter: t.diameter, radius: t.edge_radius, tip, cutting });
            }
        }
    }
    for (i, l) in out.iter_mut().enumerate() {
        l.index = i as u32 + 1;
    }
    out
}

fn same(l: &Listed, t: &Tool) -> bool {
    let radius = l.kind == "CENTER_DRILL" || l.radius == t.edge_radius;
    let tip = l.kind != "TWIST_DRILL" || l.tip == t.tip_angle.unwrap_or(0.0);
    l.kind == kind_of(t) && l.diameter == t.diameter && radius && tip
}

/// `T1 P1 Z40.0 D3.0;FACEMILL` per tool.
pub fn tool_table(tools: &[Listed]) -> String {
    let line = |l: &Listed| format!("T{0} P{0} Z{1} D{2};{3}\n", l.index, java(l.cutting), java(l.diameter), l.kind);
    tools.iter().map(line).collect()
}

/// Numbers as Java prints a double.
fn java(v: f64) -> String {
    if v == v.trunc() && v.abs() < 1e7 { format!("{v:.1}") } else { v.to_string() }
}

/// `0.0000`, no negative zero.
fn f4(v: f64) -> String {
    let s = format!("{v:.4}");
    if s == "-0.0000" { "0.0000".into() } else { s }
}

/// The V-walled slot's section (equations 4-1 and 4-2 of the source).
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Section {
    /// Depth.
    pub depth: f64,
    /// Width at the top.
    pub top: f64,
    /// Width at the bottom.
    pub bottom: f64,
    /// Base radius.
    pub radius: f64,
}

impl Section {
    fn lean(&self) -> f64 {
        (self.top - self.bottom) / 2.0
    }
    /// Angle of the wall from the vertical, rad.
    pub fn wall(&self) -> f64 {
        libm::atan(self.lean() / self.depth)
    }
    /// Depth at which wall and base radius meet, as if the wall were tangent there.
    pub fn tangency(&self) -> f64 {
        (self.depth - self.radius) + self.radius * libm::sin(self.wall())
    }
    /// Half the width at a depth.
    pub fn half(&self, y: f64) -> f64 {
        (self.depth - y) * self.lean() / self.depth + self.bottom / 2.0
    }
    /// Width and depth on the base radius at an angle (rad), as the source tabulates them (Table 4.9).
    pub fn arc(&self, angle: f64) -> (f64, f64) {
        let (c, width) = (self.wall(), 2.0 * self.half(self.tangency()));
        let r = self.radius;
        (2.0 * r * libm::cos(angle) + (width - 2.0 * r * libm::cos(c)), r * libm::sin(angle) + (self.depth - r))
    }
    /// Angles of the layers: where the wall ends, then every multiple of `step` degrees up to 90.
    pub fn arc_angles(&self, step: f64) -> Vec<f64> {
        let first = self.wall().to_degrees();
        let mut out = vec![first];
        let mut a = (first / step).floor() * step + step;
        while a < 90.0 - 1e-9 {
            out.push(a);
            a += step;
        }
        out.push(90.0);
        out
    }
}

struct Writer<'a> {
    c: &'a Config,
    out: String,
    n: u32,
    safety: f64,
}

impl Writer<'_> {
    fn block(&mut self, words: &str) {
        self.n += 1;
        let _ = writeln!(self.out, "N{} {words}", self.n);
    }
    fn note(&mut self, text: &str) {
        if self.c.code_comments {
            let _ = writeln!(self.out, "({text})");
        }
    }
    fn tool_change(&mut self, index: u32) {
        self.note("Desliga o Spindle");
        self.block("M05");
        self.note("Sistema de coordenadas G55");
        self.block(&format!("G90 G40 G55 G00 Z{}", f4(TOOL_CHANGE_CLEARANCE)));
        self.block(&format!("G01 F{} X0.0000 Y0.0000", f4(self.c.machine_feed)));
        self.block("G00 Z0.0000");
        self.note("Troca de ferramenta");
        self.block(&format!("M06 T{index}"));
        self.block(&format!("G00 Z{}", f4(TOOL_CHANGE_CLEARANCE)));
        self.note("Liga o Spindle");
        self.block("M03");
        self.note("Sistema de coordenadas G54");
        self.block("G54");
    }
    /// To the beginning of the slot's axis, down to the raw surface.
    fn start(&mut self, feed: f64, y: f64) {
        self.block(&format!("G40 G90 G01 F{} X0.0000 Y0.0000", java(self.c.machine_feed)));
        self.block(&format!("G90 G01 F{} Y{}", java(feed), f4(y)));
        self.block("G00 Z0.0000");
    }
    /// One layer: a loop without compensation, then wider ones with it.
    fn layer(&mut self, length: f64, y: f64, width: f64, d: f64, index: u32) {
        let r = d / 2.0;
        let (right, left) = (f4(length + r), f4(-r));
        self.block(&format!("G90 G01 X{right}"));
        self.block(&format!("Y{}", f4(y + r)));
        self.block(&format!("X{left}"));
        self.block(&format!("Y{}", f4(y - r)));
        self.block(&format!("X{right}"));
        self.block(&format!("G41 D{index}"));
        let n = (width / r).floor();
        let mut i = 2.0;
        while i < n && i * d <= n * r / 2.0 {
            self.block(&format!("G90 Y{}", f4(y + i * d)));
            self.block(&format!("X{left}"));
            self.block(&format!("G90 Y{}", f4(y - i * d)));
            self.block(&format!("X{right}"));
            i += 1.0;
        }
        self.block(&format!("Y{}", f4(y + width / 2.0)));
        self.block(&format!("X{left}"));
        self.block(&format!("Y{}", f4(y - width / 2.0)));
        self.block(&format!("X{right}"));
    }
}

fn refuse(file: FileId, origin: Origin, what: String) -> Diagnostic {
    Diagnostic::new(code::REFERENCE_REFUSED, file, origin.span, &[NAME.to_string(), what])
}

/// Converts a process. `name` is the path that the header comment shows.
///
/// # Errors
/// Features that the system did not do, and settings outside its bounds.
pub fn convert(process: &Process, config: &Config, file: FileId, name: &str) -> Result<Output, Vec<Diagnostic>> {
    let steps = process.steps();
    let Some(first) = steps.first() else {
        return Err(vec![refuse(file, Origin::default(), "a plan without workingsteps".into())]);
    };
    let used: Vec<Tool> = steps.iter().map(|s| s.operation.tool.clone()).collect();
    let mut faults = Vec::new();
    for t in &used {
        if !ORDER.contains(&kind_of(t)) {
            faults.push(refuse(file, t.origin, format!("tool {}", t.kind)));
        }
    }
    let tools = tool_list(&used);
    let mut w = Writer { c: config, out: String::new(), n: 0, safety: first.security.point[2].min(config.safety_plane) };
    header(&mut w, process, &tools, name);
    w.block("G17 G21 G54 G40 G90");
    let mut features: Vec<u64> = Vec::new();
    for s in &steps {
        if features.contains(&s.feature.origin.id) {
            continue;
        }
        features.push(s.feature.origin.id);
        let own: Vec<&Workingstep> = steps.iter().filter(|o| o.feature.origin.id == s.feature.origin.id).copied().collect();
        let done = if !s.feature.frame.upright() || s.feature.copies.len() > 1 {
            Err("a feature that is tilted or repeated".to_string())
        } else {
            match &s.feature.shape {
                Shape::Slot { .. } => slot(&mut w, &own, &tools),
                Shape::Hole { .. } => hole(&mut w, &own, &tools),
                _ => Err(s.feature.keyword.clone()),
            }
        };
        if let Err(what) = done {
            faults.push(refuse(file, s.feature.origin, what));
        }
    }
    if !faults.is_empty() {
        return Err(faults);
    }
    let safety = w.safety;
    w.block(&format!("G40 G90 G00 Z{}", f4(safety)));
    w.note("Desliga o Spindle");
    w.block("M05");
    w.note("Fim programa");
    w.block("M30");
    Ok(Output { program: w.out, table: tool_table(&tools), tools })
}

fn header(w: &mut Writer<'_>, process: &Process, tools: &[Listed], name: &str) {
    if !w.c.code_comments {
        w.out.push_str("(..::: Header :::..)\n(Codigo G gerado pelo Adaptador de STEP-NC a Codigo G)\n");
        let _ = writeln!(w.out, "(Arquivo: {name})");
        return;
    }
    w.note("Header");
    w.note("Código G gerado pelo protótipo de Adaptador de STEP-NC a Código G v1.0");
    w.note("ALGUMAS INFORMAÇÕES IMPORTANTES");
    w.note(&format!("Arquivo: {name}"));
    if let Some((_, size)) = process.workpieces.first().and_then(|p| p.block) {
        w.note(&format!("Dados da peça ComX:{} ComY:{} CompZ:{}", java(size[0]), java(size[1]), java(size[2])));
    }
    let safety = java(w.safety);
    w.note(&format!("Plano de Segurança:{safety}"));
    w.note("Ferramentas de corte");
    for t in tools {
        w.note(&list_entry(t));
    }
    w.note("COMENTÁRIOS ATIVADOS");
    w.note("Início Programa");
}

fn list_entry(t: &Listed) -> String {
    format!("T{},{},{},{},{};", t.index, t.kind, java(t.diameter), java(t.radius), java(t.cutting))
}

/// `[T1,FACEMILL,3.0,0.0,40.0; , T2,…]`
pub fn list_text(tools: &[Listed]) -> String {
    let all: Vec<String> = tools.iter().map(list_entry).collect();
    format!("[{}]", all.join(" , "))
}

fn slot(w: &mut Writer<'_>, steps: &[&Workingstep], tools: &[Listed]) -> Result<(), String> {
    let f = &steps[0].feature;
    let Shape::Slot { path: Travel::Line { direction, length, .. }, section: crate::process::Section::SquareU { width, radius, angle }, .. } = &f.shape else {
        return Err("a slot that is not a straight one with a square U".into());
    };
    if (direction[0] - 1.0).abs() > 1e-9 {
        return Err("a slot that does not run along X".into());
    }
    if f.frame.origin[0] != 0.0 || angle[0] != angle[1] || radius[0] != radius[1] {
        return Err("a slot that does not begin at X0 or is not symmetric".into());
    }
    let (depth, lean) = (f.depth, f.depth * libm::tan(angle[0]));
    if !(lean > 1e-9) || !(radius[0] > 0.0) || depth <= radius[0] {
        return Err("a slot without inclined walls and base radius".into());
    }
    // The source rounds the top width up to whole millimetres.
    let top = width + 2.0 * lean;
    let top = if (top - top.round()).abs() < 1e-9 { top.round() } else { top.ceil() };
    let section = Section { depth, top, bottom: *width, radius: radius[0] };
    let (limit, wide) = (section.half(section.tangency()), 2.0 * section.half(section.tangency()));
    let own = |kind: &str, fits: &dyn Fn(&Listed) -> bool| {
        let mine = |l: &&Listed| steps.iter().any(|s| same(l, &s.operation.tool));
        tools.iter().filter(mine).filter(|l| l.kind == kind && fits(l)).max_by(|a, b| a.diameter.total_cmp(&b.diameter)).cloned()
    };
    let mill = own("FACEMILL", &|l| l.diameter - 0.1 <= limit).ok_or("a V slot without a face mill that fits")?;
    let ball = own("BALL_ENDMILL", &|l| l.diameter <= wide).ok_or("a V slot without a ball end mill that fits")?;
    if (ball.diameter / 2.0 - section.radius).abs() > 1e-9 {
        return Err("a base radius that is not the radius of the ball end mill".into());
    }
    let (y0, step) = (f.frame.origin[1], w.c.wall_step);
    let feed = w.c.machine_feed / 2.0;
    w.tool_change(mill.index);
    w.note("Primeira parte");
    w.start(feed, y0);
    w.block(&format!("G01 Z-{}", f4(step / 4.0)));
    w.layer(*length, y0, 2.0 * section.half(0.0), mill.diameter, mill.index);
    w.block("Z0.0000");
    let tangency = section.tangency();
    let whole = (tangency / step).floor() as u32;
    let mut depths: Vec<f64> = (1..=whole).map(|i| f64::from(i) * step).collect();
    if tangency - f64::from(whole) * step > 0.0 {
        depths.push(tangency);
    }
    let mut before = 0.0;
    for y in depths {
        w.block(&format!("G40 G90 X0.0000 Y{}", f4(y0)));
        w.block(&format!("G91 G01 F{} Z-{}", java(feed), f4(y - before)));
        w.layer(*length, y0, 2.0 * section.half(y), mill.diameter, mill.index);
        before = y;
    }
    w.tool_change(ball.index);
    w.note("Segunda parte");
    let feed = w.c.cutting_feed;
    w.start(feed, y0);
    w.block(&format!("G90 G00 Z-{}", f4(depth - section.radius)));
    w.block(&format!("G91 G01 Z-{}", f4(section.radius)));
    w.layer(*length, y0, wide, ball.diameter, ball.index);
    w.block(&format!("G90 X{}", f4(length + ball.diameter)));
    Ok(())
}

/// Drilled holes: position, safety plane, then pecks of one tool diameter, each from the surface.
fn hole(w: &mut Writer<'_>, steps: &[&Workingstep], tools: &[Listed]) -> Result<(), String> {
    for s in steps {
        let OperationKind::Drill(d) = &s.operation.kind else {
            return Err("a hole that is milled".into());
        };
        let Some(tool) = tools.iter().find(|l| same(l, &s.operation.tool)).cloned() else {
            return Err(format!("tool {}", s.operation.tool.kind));
        };
        let through = matches!(s.feature.shape, Shape::Hole { bottom: HoleBottom::Through, .. });
        let centre = tool.kind == "CENTER_DRILL";
        let full = if through && !centre { s.feature.depth } else { d.depth.unwrap_or(s.feature.depth) };
        let depth = if centre { full.min(tool.cutting) } else { full };
        if !(depth > 0.0) || depth / tool.diameter > 10_000.0 {
            return Err("a hole without depth".into());
        }
        w.tool_change(tool.index);
        let [x, y, _] = s.feature.frame.origin;
        let feed = java(w.c.machine_feed);
        w.block(&format!("G40 G90 G01 F{feed} X{} Y{}", f4(x), f4(y)));
        let safety = w.safety;
        w.block(&format!("G40 G90 G00 Z{}", f4(safety)));
        let mut z = 0.0;
        while z < depth {
            z = (z + tool.diameter).min(depth);
            w.block("G00 Z0.0000");
            w.block(&format!("G01 Z-{}", f4(z)));
        }
    }
    Ok(())
}
