//! `gcc-robot init`

use gr_text::code;

use crate::exit::Exit;
use crate::options::{Global, InitArgs};
use crate::output::write_all;
use crate::sources::reason;

/// The project file to start from.
const TEMPLATE: &str = include_str!("../../../../spec/config/template.toml");

pub fn run(global: &Global, args: &InitArgs) -> Exit {
    let path = args.folder.join("gcc-robot.toml");
    if path.exists() && !args.force {
        eprintln!("{} is already there; --force overwrites it", path.display());
        return Exit::Io;
    }
    let written = std::fs::create_dir_all(&args.folder)
        .map_err(|e| (args.folder.clone(), e))
        .and_then(|()| write_all(&[(path.clone(), TEMPLATE.as_bytes().to_vec())]));
    match written {
        Ok(()) => {
            if !global.quiet {
                eprintln!("wrote {}", path.display());
            }
            Exit::Ok
        }
        Err((at, e)) => super::refuse(global, &at, code::FILE_UNWRITABLE, &[at.display().to_string(), reason(&e)]),
    }
}
