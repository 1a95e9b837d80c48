//! Writes what is made of the tests' features: `cells pictures` the pictures of docs/images/stepnc, `cells seeds` the
//! seeds of the planner's fuzz target.

#[path = "../tests/judge/mod.rs"]
mod judge;

use std::path::Path;

use gr_backends::plot;
use gr_planner::{Options, plan};
use gr_text::FileId;
use judge::cases::{APPROACHES, STRATEGIES};
use judge::cells::features;
use judge::special;

/// One picture per feature.
fn pictures(folder: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let cells = features().into_iter().map(|(name, _, make)| {
        let strategy = if name.contains("face") { STRATEGIES[2] } else { "$" };
        (name, make(strategy, "$").part)
    });
    let open = "OPEN_SLOT_END_TYPE()";
    let others = [
        ("holes", special::holes()),
        ("back boring", special::back("10.", true)),
        ("thread, milled", special::thread(true, "right hand", "CLIMB", 2.0)),
        ("T-slot", special::tee([open, open], 16.0, 4.0)),
    ];
    for (name, part) in cells.chain(others) {
        let (Some(planned), _) = plan(part.text().as_bytes(), FileId(0), &Options::default()) else {
            return Err(format!("no path for {name}").into());
        };
        let file: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect();
        let options = plot::Options { width: 700, height: 450, title: name.into(), ..plot::Options::default() };
        std::fs::write(folder.join(file + ".png"), plot::png(&planned.program, None, &options)?)?;
    }
    Ok(())
}

/// One file per feature.
fn seeds(folder: &Path) -> Result<(), Box<dyn std::error::Error>> {
    for (k, (_, _, make)) in features().iter().enumerate() {
        let c = make(STRATEGIES[k % STRATEGIES.len()], APPROACHES[k % APPROACHES.len()]);
        std::fs::write(folder.join(format!("cell-{k:02}.p21")), c.part.text())?;
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let (folder, write): (_, fn(&Path) -> _) = match std::env::args().nth(1).as_deref() {
        Some("pictures") => (root.join("docs/images/stepnc"), pictures),
        Some("seeds") => (root.join("tests/fuzz/seeds/planner"), seeds),
        _ => return Err("say `pictures` or `seeds`".into()),
    };
    std::fs::create_dir_all(&folder)?;
    write(&folder)
}
