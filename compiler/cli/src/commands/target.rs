//! `gcc-robot target list | show`

use gr_spec::TargetDef;

use crate::exit::Exit;
use crate::options::{TargetAction, TargetArgs};

pub fn run(args: &TargetArgs) -> Exit {
    match &args.action {
        TargetAction::List => super::print(&list()),
        TargetAction::Show { id } => match TargetDef::find(id) {
            Some(t) => super::print(&show(t)),
            None => {
                eprintln!("there is no target {id}; `gcc-robot target list` shows all");
                Exit::Usage
            }
        },
    }
}

/// Targets that this version can make.
pub fn ready() -> impl Iterator<Item = &'static TargetDef> {
    TargetDef::all().iter().filter(|t| t.status != "planned")
}

fn list() -> String {
    ready().map(|t| format!("{:<14}{}\n", t.id, t.title)).collect()
}

fn show(t: &TargetDef) -> String {
    let mut text = format!("{}: {}\n\n{}\n\nextension  .{}\nstatus     {}\n", t.id, t.title, t.what, t.extension, t.status);
    if !t.options.is_empty() {
        text.push_str(&format!("options    {}\n", t.options.join(" ")));
    }
    text
}
