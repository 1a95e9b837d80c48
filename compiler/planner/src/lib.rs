//! STEP-NC process plans to motion. [`process`] is what a file says, as plain data; [`plan`] makes a motion
//! program of it; [`table`] lists it for people; [`reference`] repeats the results of two published systems;
//! [`stepnc`] writes a motion program back as STEP-NC. Reading Part 21 and checking the schema are elsewhere.

mod ap238;
mod drill;
mod emit;
mod explicit;
pub mod frame;
mod mill;
mod plan;
pub mod process;
mod read;
pub mod reference;
pub mod stepnc;
mod stock;
pub mod table;

use gr_text::{Diagnostic, FileId};
pub use plan::{Loaded, Options, Planned, plan};
pub use process::{Overlap, Process, Tool, Units};

/// Reads the process of a file. Faults of syntax and schema are not told here.
pub fn process(text: &[u8], file: FileId, units: Option<Units>) -> (Option<Process>, Vec<Tool>, Vec<Diagnostic>) {
    let exchange = gr_p21::parse(text);
    of_model(&gr_step::Model::new(text, &exchange), file, units)
}

fn of_model<'m>(model: &'m gr_step::Model<'m>, file: FileId, units: Option<Units>) -> (Option<Process>, Vec<Tool>, Vec<Diagnostic>) {
    if gr_step::dialect(model) == gr_step::Dialect::Ap238 {
        return ap238::read(model, file);
    }
    read::read(model, file, units)
}

/// The tools as LinuxCNC's tool table, in mm: number, pocket, length, diameter, and what the tool is.
pub fn tool_table(tools: &[Tool]) -> String {
    let line = |t: &Tool| {
        let length = t.length.unwrap_or(0.0);
        let name: String = t.name.chars().map(|c| if c < ' ' { ' ' } else { c }).collect();
        let radius = if t.edge_radius > 0.0 { format!(" R{}", t.edge_radius) } else { String::new() };
        format!("T{0} P{0} Z{length:+.4} D{1:+.4} ;{2}{radius} {name}\n", t.number, t.diameter, t.kind)
    };
    tools.iter().map(line).collect()
}
