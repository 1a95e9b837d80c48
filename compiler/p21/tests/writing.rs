//! Formatting and numbering anew keep what a file says.

use gr_p21::{Kind, format, parse, renumber};
use proptest::prelude::*;

fn shown(text: &[u8]) -> String {
    String::from_utf8_lossy(&format(text)).into_owned()
}

/// What a file says, without places; ids by the order of the instances.
fn meaning(text: &[u8]) -> Vec<String> {
    let parsed = parse(text);
    let place = |id: u64| parsed.find(id).map_or(-1, |n| n as i64);
    let value = |v: gr_p21::Value| match v.kind() {
        Kind::String => format!("{:?}", parsed.string(text, v)),
        Kind::Real | Kind::Integer => format!("{:?}", parsed.real(text, v).map(f64::to_bits)),
        Kind::Reference => format!("#{:?}", parsed.reference(text, v).map(place)),
        Kind::Enumeration => format!("{:?}", parsed.enumeration(text, v)),
        Kind::List | Kind::Typed => format!("{:?}{}", v.kind(), v.len()),
        k => format!("{k:?}"),
    };
    let one = |n: u32| format!("{} {:?}", parsed.keyword(n), parsed.values_of(n).iter().map(|v| value(*v)).collect::<Vec<_>>());
    let mut out: Vec<String> = (0..parsed.instances.len() as u32).map(one).collect();
    out.push(format!("{:?}", parsed.faults.iter().map(|f| f.code).collect::<Vec<_>>()));
    out
}

#[test]
fn one_statement_per_line_and_comments_kept() {
    let text = b"ISO-10303-21;HEADER;/*GRIMA*/FILE_DESCRIPTION(/* what */(''),\n/* level */ '2;1');\nENDSEC;DATA;\n\n\n/* tools */\n#1 = MATERIAL ( 'A  b' ,\n'B',( ) ); /* steel */\n#2=CARTESIAN_\nPOINT('x\ny',(1.\n5,2.,3.));ENDSEC;END-ISO-10303-21;";
    same(
        &shown(text),
        "ISO-10303-21;\nHEADER; /*GRIMA*/\nFILE_DESCRIPTION(/* what */ (''), /* level */ '2;1');\nENDSEC;\nDATA;\n\n/* tools */\n#1=MATERIAL('A  b','B',()); /* steel */\n#2=CARTESIAN_POINT('xy',(1.5,2.,3.));\nENDSEC;\nEND-ISO-10303-21;\n",
    );
}

fn same(found: &str, expected: &str) {
    assert_eq!(found, expected, "\n{found}");
}

#[test]
fn statements_with_faults_stay_as_they_are() {
    let text = b"DATA;\n#1 = A( 1 2 );\n#2 = B( 1 );\n#3 = C( 'open );\n#4 = D( );\n";
    assert_eq!(shown(text), "DATA;\n#1 = A( 1 2 );\n#2=B(1);\n#3 = C( 'open );\n#4=D();\n");
}

#[test]
fn numbers_in_order() {
    let text = b"ISO-10303-21;\nHEADER;\nENDSEC;\nANCHOR;\n<a>=#70;\nENDSEC;\nDATA;\n#70=A(#5,'#5',(#9)); /* #5 */\n#5=B(\"0F\");#9=C(#70,<x#5>);\nENDSEC;\nEND-ISO-10303-21;\n";
    let new = renumber(text).expect("no faults");
    assert_eq!(
        String::from_utf8_lossy(&new),
        "ISO-10303-21;\nHEADER;\nENDSEC;\nANCHOR;\n<a>=#1;\nENDSEC;\nDATA;\n#1=A(#2,'#5',(#3)); /* #5 */\n#2=B(\"0F\");#3=C(#1,<x#5>);\nENDSEC;\nEND-ISO-10303-21;\n"
    );
    assert!(renumber(b"DATA;\n#1=A(#2);\nENDSEC;\n").is_err());
    assert!(renumber(b"DATA;\n#1=A();\n#1=B();\nENDSEC;\n").is_err());
}

#[test]
fn probes_say_the_same_when_formatted() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/probes");
    let mut files: Vec<_> = std::fs::read_dir(folder).expect("probes").map(|f| f.expect("file").path()).collect();
    files.sort();
    for path in files.iter().filter(|p| p.extension().is_some_and(|e| e == "p21")) {
        let text = std::fs::read(path).expect("a probe");
        let once = format(&text);
        assert_eq!(meaning(&once), meaning(&text), "{}", path.display());
        assert_eq!(String::from_utf8_lossy(&format(&once)), String::from_utf8_lossy(&once), "{}", path.display());
        if let Ok(new) = renumber(&text) {
            assert_eq!(meaning(&new), meaning(&text), "{}", path.display());
        }
    }
}

fn value() -> impl Strategy<Value = String> {
    let leaf = prop_oneof![
        Just("$".to_string()),
        Just("*".to_string()),
        any::<i32>().prop_map(|n| n.to_string()),
        any::<i16>().prop_map(|n| std::format!("{}.5E-3", n)),
        "[ -~äØ]{0,12}".prop_map(|s| std::format!("'{}'", s.replace('\\', "\\\\").replace('\'', "''"))),
        Just(".T.".to_string()),
        Just("\"1F\"".to_string()),
        (1u32..9).prop_map(|n| std::format!("#{n}")),
    ];
    leaf.prop_recursive(3, 24, 4, |inner| {
        prop_oneof![
            proptest::collection::vec(inner.clone(), 0..4).prop_map(|v| std::format!("({})", v.join(","))),
            inner.prop_map(|v| std::format!("LENGTH_MEASURE({v})")),
        ]
    })
}

fn file() -> impl Strategy<Value = String> {
    let instance = (proptest::collection::vec(value(), 0..5), "[A-Z][A-Z0-9_]{0,12}");
    proptest::collection::vec(instance, 1..10).prop_map(|all| {
        let mut text = "ISO-10303-21;\nHEADER;\nFILE_SCHEMA(('S'));\nENDSEC;\nDATA;\n".to_string();
        for (n, (values, keyword)) in all.iter().enumerate() {
            text += &std::format!("#{}=X{keyword}({});\n", n * 3 + 1, values.join(","));
        }
        text + "ENDSEC;\nEND-ISO-10303-21;\n"
    })
}

proptest! {
    #[test]
    fn nothing_panics(text in "\\PC{0,200}|([#'\"();,/*=.$A-C0-9\n\\\\ !<>@-]|ENDSEC;|DATA;|#1=A\\(){0,120}") {
        let text = text.as_bytes();
        let parsed = parse(text);
        prop_assert_eq!(gr_p21::check_syntax(text), parsed.faults);
        gr_p21::index(text);
        format(text);
        let _ = renumber(text);
    }

    #[test]
    fn broken_at_any_column_it_is_the_same(text in file(), width in 1usize..60) {
        let whole: Vec<u8> = text.bytes().filter(|b| *b != b'\n').collect();
        let wrapped = whole.chunks(width).collect::<Vec<_>>().join(&b'\n');
        prop_assert_eq!(meaning(&wrapped), meaning(&whole));
        prop_assert_eq!(parse(&whole).faults, vec![]);
    }

    #[test]
    fn formatted_it_says_the_same(text in file(), width in 1usize..60) {
        let whole: Vec<u8> = text.bytes().filter(|b| *b != b'\n').collect();
        let wrapped = whole.chunks(width).collect::<Vec<_>>().join(&b'\n');
        let once = format(&wrapped);
        prop_assert_eq!(meaning(&once), meaning(&whole));
        prop_assert_eq!(format(&once), once);
    }

    /// Any statement may lose its end: one message, and every other instance stays as it was, for the index as well.
    #[test]
    fn a_lost_end_costs_one_statement(text in file(), which in any::<proptest::sample::Index>(), how in 0usize..4) {
        let lines: Vec<&str> = text.lines().collect();
        let data: Vec<usize> = (0..lines.len()).filter(|n| lines[*n].starts_with('#')).collect();
        let hurt = data[which.index(data.len())];
        let cut = |line: &str| {
            let (open, inside) = line.strip_suffix(");").map(|l| (l.to_string(), !l.ends_with('('))).expect("a whole statement");
            match how {
                0 => open,
                1 => open + ")",
                2 if inside => open + ",",
                _ => open + "  ",
            }
        };
        let broken: Vec<String> = lines.iter().enumerate().map(|(n, l)| if n == hurt { cut(l) } else { (*l).to_string() }).collect();
        let broken = broken.join("\n");
        let (was, is) = (parse(text.as_bytes()), parse(broken.as_bytes()));
        prop_assert_eq!(is.faults.len(), 1, "{}\n{:?}", broken, is.faults);
        prop_assert_eq!(&gr_p21::check_syntax(broken.as_bytes()), &is.faults);
        let ids = |file: &gr_p21::Exchange| -> Vec<u64> { file.instances.iter().filter(|i| i.id > 0).map(|i| i.id).collect() };
        prop_assert_eq!(ids(&is), ids(&was));
        let by_index: Vec<u64> = gr_p21::index(broken.as_bytes()).entries.iter().map(|e| e.id).collect();
        prop_assert_eq!(by_index, ids(&was));
        let damaged = is.instances.iter().filter(|i| i.damaged).count();
        prop_assert!(damaged <= 1, "{}", broken);
    }

    #[test]
    fn index_and_parse_see_the_same_ids(text in file()) {
        let ids: Vec<u64> = gr_p21::index(text.as_bytes()).entries.iter().map(|e| e.id).collect();
        let parsed = parse(text.as_bytes());
        let expected: Vec<u64> = parsed.instances.iter().filter(|i| i.id > 0).map(|i| i.id).collect();
        prop_assert_eq!(ids, expected);
    }
}

/// Found by the fuzzer: a comment without an end grew by an empty line each time.
#[test]
fn a_comment_without_an_end_does_not_grow() {
    let text = b"IS\0\0\0\0O-10303-21:\nHEIDEREND-ISO/*--ISO-02621-.1;\n";
    let once = gr_p21::format(text);
    assert_eq!(gr_p21::format(&once), once);
}
