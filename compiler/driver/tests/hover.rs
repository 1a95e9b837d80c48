//! The state around a line, and names.

use gr_driver::{Options, Session};
use gr_interp::Setup;

fn open(text: &str, chunk: usize) -> (Session, gr_text::FileId) {
    let mut session = Session::new();
    let mut options = Options::new(Setup::default());
    options.chunk_lines = Some(chunk);
    let file = session.open("part.ngc", text, options);
    (session, file)
}

#[test]
fn position_before_and_after_a_block() {
    let text = "G21 G90\nG0 X1 Y2\nG1 X3 F100\nG91 X4\nM2\nG0 X9\n";
    for chunk in 1..8 {
        let (session, file) = open(text, chunk);
        let x = |line| session.state_at(file, line).map(|s| (s.before.current[0], s.after.current[0]));
        assert_eq!(x(1), Some((0.0, 1.0)), "{chunk}");
        assert_eq!(x(2), Some((1.0, 3.0)), "{chunk}");
        assert_eq!(x(3), Some((3.0, 7.0)), "{chunk}");
        assert_eq!(x(5), None, "behind the end");
        assert_eq!(x(60), None);
        assert_eq!(session.state_at(file, 3).map(|s| (s.before.incremental, s.after.incremental)), Some((0, 1)));
    }
}

#[test]
fn inside_of_subroutines_and_loops_the_first_pass_counts() {
    let text = "o1 sub\nG1 X[#1] F100\no1 endsub\nG0 X5\no1 call [7]\no2 repeat [3]\nG91 G1 X1\no2 endrepeat\no3 if [0]\nG1 X99\no3 endif\nM2\n";
    for chunk in 1..8 {
        let (session, file) = open(text, chunk);
        let x = |line| session.state_at(file, line).map(|s| (s.before.current[0], s.after.current[0]));
        assert_eq!(x(1), Some((5.0, 7.0)), "{chunk}");
        assert_eq!(x(3), Some((0.0, 5.0)), "{chunk}");
        assert_eq!(x(6), Some((7.0, 8.0)), "{chunk}");
        assert_eq!(x(9), None, "never run");
        assert_eq!(x(11), Some((10.0, 10.0)), "{chunk}");
    }
}

#[test]
fn names_of_the_whole_file() {
    let text = "o1 sub\n#<depth> = 2\no1 endsub\nN10 G0 X#5\nN20 o1 call\nM2\n";
    let (session, file) = open(text, 256);
    let whole = session.symbols(file);
    assert_eq!((whole.statements.len(), whole.line_numbers.len()), (3, 2));
    for s in &whole.writes {
        assert!(text[s.span.range()].contains("depth"));
    }
    for chunk in 1..6 {
        let (session, file) = open(text, chunk);
        assert_eq!(session.symbols(file), whole, "{chunk}");
    }
}
