//! What a file adds up to: remembered until the text changes, open subroutine files before those on disk.

use gr_driver::{Options, Session};
use gr_interp::{Setup, assumed_tools};

fn options() -> Options {
    Options::new(Setup { tools: assumed_tools(), ..Setup::default() })
}

#[test]
fn time_distance_and_extents_per_file_and_tool() {
    let text = "G21 G90\nT1 M6\nG0 X0 Y0 Z0\nG1 X60 F60\nT2 M6\nG1 Y30 F120\nM2\n";
    let mut session = Session::new();
    let file = session.open("part.ngc", text, options());
    let stats = session.stats(file);
    assert_eq!(stats.totals.feed_nm, 90_000_000);
    assert_eq!(stats.totals.feed_ns, 75_000_000_000);
    assert_eq!((stats.cut.min[0], stats.cut.max[0], stats.cut.max[1]), (0.0, 60.0, 30.0));
    let tools: Vec<_> = stats.tools.iter().map(|t| (t.tool, t.totals.feed_ns / 1_000_000_000)).collect();
    assert_eq!(tools, [(1, 60), (2, 15)]);
    // Nothing is run again until the text changes.
    assert!(std::sync::Arc::ptr_eq(&stats, &session.stats(file)));
    let at = text.find("X60").unwrap() as u32;
    session.edit(file, at..at + 3, "X30");
    assert_eq!(session.stats(file).totals.feed_nm, 60_000_000);
}

#[test]
fn an_open_subroutine_file_counts() {
    let folder = tempfile::tempdir().unwrap();
    let sub = folder.path().join("row.ngc");
    std::fs::write(&sub, "o<row> sub\nG1 X10\no<row> endsub\nM2\n").unwrap();
    let mut options = options();
    let dir = folder.path().to_string_lossy().into_owned();
    options.setup.ini.values.insert(("rs274ngc".into(), "subroutine_path".into()), vec![dir]);
    let mut session = Session::new();
    let main = session.open("main.ngc", "G21 G90 F60\nG0 X0 Y0 Z0\no<row> call\nM2\n", options.clone());
    assert_eq!(session.stats(main).totals.feed_nm, 10_000_000);
    let open = session.open(&sub.to_string_lossy(), "o<row> sub\nG1 X25\no<row> endsub\nM2\n", options);
    assert_eq!(session.stats(main).totals.feed_nm, 25_000_000);
    session.close(open);
    assert_eq!(session.stats(main).totals.feed_nm, 10_000_000);
}
