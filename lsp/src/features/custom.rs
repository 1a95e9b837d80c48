//! Requests of our own: tool path, output, state, choices.

use gr_backends::plot::Trace;
use gr_backends::plot::trace::{TraceMachine, TraceOptions};
use gr_backends::sheet::ToolRow;
use gr_ide::gcode::modes::{codes, moves};
use gr_ir::FileId;
use serde_json::Value;
use tower_lsp::ls_types as lsp;

use super::Answer;
use crate::documents::{Kind, Motion, View};
use crate::host::{Made, OutputJob};
use crate::protocol::custom::{
    BlockFacts, BuildOptions, Choice, Choices, Explanation, Modes, Output, OutputFile, OutputParams, PreviewParams, State as StateAnswer, base64, integers,
};

/// The tool path: `gr_backends::plot::Trace` as JSON (`docs/editor-features.md`).
pub fn preview(mut view: View, p: &PreviewParams) -> Answer<Value> {
    let motion = view.motion()?;
    view.release();
    if view.is_overtaken() {
        return Err(super::Failure::Overtaken);
    }
    let mut trace = Trace::default();
    if let Some(motion) = &motion {
        let default = TraceOptions::default();
        let most_points = p.most_points.map_or(default.most_points, |m| m as usize);
        let options = TraceOptions { tolerance: p.tolerance, most_points, document: motion.main, tools: tools(&view, motion), rates: motion.rates };
        trace = Trace::new(&motion.program, &options);
        trace.stock = motion.stock;
        machine(&view, motion, &mut trace);
    }
    let key = trace.key();
    let mut out = trace.json(view.uri.as_str(), &key, p.have.as_deref() == Some(key.as_str()));
    out["version"] = view.version.into();
    out["files"] = motion.map_or(Vec::new(), |m| m.files.clone()).into();
    Ok(out)
}

/// Diameters and comments of the tools.
fn tools(view: &View, motion: &Motion) -> Vec<ToolRow> {
    if !motion.tools.is_empty() {
        return motion.tools.clone();
    }
    let setup = &view.station.setup;
    let scale = if setup.machine_units == gr_canon::Units::Inch { 25.4 } else { 1.0 };
    let row = |t: &gr_interp::Tool| ToolRow { number: t.number, diameter: t.diameter * scale, comment: t.comment.to_string() };
    setup.tools.rows.iter().skip(1).filter(|t| &*t.comment != gr_interp::ASSUMED).map(row).collect()
}

/// Adds the chosen machine along the path.
fn machine(view: &View, motion: &Motion, trace: &mut Trace) {
    let Some(machine) = view.station.machine.as_ref() else { return };
    if view.text.len() > super::MOST_FOR_A_ROBOT {
        trace.machine = Some(TraceMachine::new(machine, super::TOO_LARGE.into()));
        return;
    }
    let planning = view.planning(motion);
    let planned = planning.as_ref().map(|p| p.as_ref().as_ref().map_err(|found| crate::machine::reason(found)));
    crate::machine::along(machine, planned, trace);
}

/// What a target makes of the document.
pub fn output(mut view: View, p: &OutputParams) -> Answer<Output> {
    view.release();
    let mut out = Output { uri: view.uri.as_str().into(), version: view.version, target: p.target.clone(), ..Output::default() };
    let options = p.options.iter().filter_map(|(k, v)| Some((k.clone(), shown(v)?))).collect();
    let job = OutputJob {
        path: &view.path,
        text: view.text.to_string().into(),
        settings: &view.settings,
        station: &view.station,
        target: &p.target,
        options,
        machine: p.machine.as_deref(),
    };
    match view.host.output(&job) {
        Err(why) => out.error = Some(why),
        Ok(Made { files, found }) => {
            let own = |at: (FileId, gr_text::Span)| {
                (at.0 == FileId(0)).then(|| lsp::Location { uri: view.uri.clone(), range: view.range(at.1) })
            };
            out.diagnostics = found.iter().map(|d| crate::protocol::diagnostic(d, &view.text, view.columns, &own)).collect();
            out.files = files
                .into_iter()
                .map(|f| match String::from_utf8(f.bytes) {
                    Ok(text) => OutputFile { name: f.name, text, base64: None, lines: integers(f.lines) },
                    Err(e) => OutputFile { name: f.name, text: String::new(), base64: Some(base64(e.as_bytes())), lines: String::new() },
                })
                .collect();
        }
    }
    Ok(out)
}

/// The options with which `gcc-robot build` runs the document as it is run here.
pub fn build_options(mut view: View) -> Answer<BuildOptions> {
    view.release();
    let dialect = if let Kind::Gcode(_, dialect) = view.kind { Some(dialect) } else { None };
    Ok(BuildOptions { options: view.settings.options(dialect) })
}

/// A value as an option of the command has it; none: the option is not given.
fn shown(v: &serde_json::Value) -> Option<String> {
    match v {
        serde_json::Value::Null | serde_json::Value::Bool(false) => None,
        serde_json::Value::Bool(true) => Some(String::new()),
        serde_json::Value::String(s) => Some(s.clone()),
        other => Some(other.to_string()),
    }
}

/// Everything about a block.
pub fn state(mut view: View, at: lsp::Position) -> Answer<StateAnswer> {
    let mut out = StateAnswer { line: at.line, ..StateAnswer::default() };
    let Kind::Gcode(..) = view.kind else { return Ok(out) };
    let Some(t) = super::look::trace_line(&view, at.line, &[])? else { return Ok(out) };
    let pace = view.pace()?;
    view.release();
    let m = moves(&t.program, t.before.units());
    out.reached = true;
    out.before = Some(modes(&view, &t.before));
    out.after = Some(modes(&view, &t.after));
    let mm = (m.totals.feed_nm + m.totals.rapid_nm) as f64 / 1e6;
    out.block = Some(BlockFacts {
        moves: m.totals.moves as u32,
        length: mm,
        seconds: if m.totals.untimed == 0 { pace.seconds(&t).or((m.totals.moves == 0).then_some(0.0)) } else { None },
        center: m.arc.map(|a| a.center),
        radius: m.arc.map(|a| a.radius[0]),
        sweep: m.arc.map(|a| a.sweep),
    });
    Ok(out)
}

fn modes(view: &View, m: &gr_interp::Modal) -> Modes {
    let s = m.active_spindle.clamp(0, 7) as usize;
    let in_spindle = view.station.setup.tools.rows.get(usize::try_from(m.pocket).unwrap_or(0)).map_or(0, |t| t.number.max(0));
    Modes {
        position: m.current,
        units: if m.units() == gr_canon::Units::Inch { "inch" } else { "mm" }.into(),
        codes: codes(m),
        feed: m.feed,
        speed: m.speed[s],
        tool: if m.tool_changed != 0 || m.selected_tool > 0 { in_spindle } else { 0 },
        selected_tool: m.selected_tool.max(0),
    }
}

/// Targets, machines and dialects.
pub fn choices() -> Choices {
    let targets = gr_spec::TargetDef::all().iter().map(|t| Choice {
        id: t.id.into(),
        title: t.title.into(),
        detail: t.what.into(),
        extension: t.extension.into(),
        status: t.status.into(),
        options: t.options.iter().map(|o| (*o).to_string()).collect(),
    });
    let machines = gr_machine::list().filter_map(|id| {
        let m = gr_machine::builtin(id)?;
        Some(Choice { id: id.into(), title: m.title.clone(), detail: m.source.clone(), ..Choice::default() })
    });
    let dialects = gr_spec::Dialect::all().iter().map(|d| Choice { id: d.id.into(), title: d.title.into(), ..Choice::default() });
    Choices { targets: targets.collect(), machines: machines.collect(), dialects: dialects.collect() }
}

/// The long text of a diagnostic, a code, a word, or an entity of ISO 14649.
pub fn explain(code: &str, dialect: Option<&str>) -> Explanation {
    if let Some(found) = gr_spec::Code::find(code) {
        let def = found.def();
        let mut text = format!("## {} {}\n\n{}\n", def.code, def.slug, def.explanation);
        for (title, example) in [("Raises it", def.bad), ("Does not", def.good)] {
            if let Some(example) = example {
                text.push_str(&format!("\n**{title}**\n\n```gcode\n{}\n```\n", example.trim_end()));
            }
        }
        return Explanation { markdown: Some(text) };
    }
    let dialect = dialect.and_then(gr_spec::Dialect::find).unwrap_or_else(gr_spec::Dialect::linuxcnc);
    let name = code.trim().to_uppercase();
    let of_code = || dialect.code(&name).map(|d| gr_ide::gcode::hover::code(d, dialect));
    let of_word = || {
        let letter = name.chars().next().filter(|c| name.len() == c.len_utf8())?;
        dialect.word(letter).map(|w| format!("**{}** {}\n\n{}\n", w.letter, w.title, w.what))
    };
    Explanation { markdown: of_code().or_else(of_word).or_else(|| gr_ide::p21::page::page(&name)) }
}

