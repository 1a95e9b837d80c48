//! `stepnc_to_gcode FILE.p21`: the program on standard output, messages and the tool table on standard error.

use gr_backends::{NoSources, rs274ngc};
use gr_text::FileId;

fn main() -> std::process::ExitCode {
    let Some(name) = std::env::args().nth(1) else { return std::process::ExitCode::FAILURE };
    let Ok(text) = std::fs::read(&name) else { return std::process::ExitCode::FAILURE };
    let options = gr_planner::Options { name: name.clone(), ..Default::default() };
    let (planned, out) = gr_planner::plan(&text, FileId(0), &options);
    for d in &out {
        eprintln!("{:?}: {}", d.code, d.message);
    }
    let Some(planned) = planned else { return std::process::ExitCode::FAILURE };
    let length = |t: &gr_planner::Tool| {
        let mut offset = [0.0; 9];
        offset[2] = t.length.unwrap_or(0.0);
        (t.number as i32, offset)
    };
    let options = rs274ngc::Options { tools: planned.tools.iter().map(length).collect(), ..Default::default() };
    eprint!("{}", gr_planner::tool_table(&planned.tools));
    match rs274ngc::emit(&planned.program, &options, &NoSources) {
        Ok(e) => {
            print!("{}", e.text);
            std::process::ExitCode::SUCCESS
        }
        Err(faults) => {
            for d in faults {
                eprintln!("{:?}: {}", d.code, d.message);
            }
            std::process::ExitCode::FAILURE
        }
    }
}
