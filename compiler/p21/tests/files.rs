//! Valid and damaged files: what is understood, and the one message per mistake.

use gr_p21::{Exchange, Kind, parse};

fn report(text: &[u8], file: &Exchange) -> Vec<String> {
    let lines = gr_text::LineIndex::new(text);
    file.faults
        .iter()
        .map(|f| {
            let (line, column) = lines.position(f.span.start);
            format!("{}:{} {}", line + 1, column + 1, f.code.def().slug)
        })
        .collect()
}

fn file(data: &str) -> String {
    format!("ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\nFILE_NAME('','',(''),(''),'','','');\nFILE_SCHEMA(('S'));\nENDSEC;\nDATA;\n{data}ENDSEC;\nEND-ISO-10303-21;\n")
}

fn check(data: &str, expected: &[&str]) -> Exchange {
    let text = file(data);
    let parsed = parse(text.as_bytes());
    assert_eq!(report(text.as_bytes(), &parsed), expected, "{data}");
    parsed
}

#[test]
fn everything_valid() {
    let parsed = check(
        "#1=A();\n#2=B($,*,1,-2.5E+3,'it''s',.T.,\"0F\",#1,(),((1,2),(#1)),LENGTH_MEASURE(5.));\n#3=(P(1)Q()R('x',(2)));\n#4=!USER(1.);\n#99999999999=C( /* c */ 'a;b' );\n",
        &[],
    );
    let kinds: Vec<Kind> = parsed.parameters(parsed.find(2).expect("there")).map(|v| v[0].kind()).collect();
    use Kind::*;
    assert_eq!(kinds, [Unset, Derived, Integer, Real, String, Enumeration, Binary, Reference, List, List, Typed]);
    assert!(parsed.instances[parsed.find(3).expect("there") as usize].complex);
    assert_eq!(parsed.keyword(parsed.find(4).expect("there")), "!USER");
}

#[test]
fn sections_of_edition_3() {
    let text = b"ISO-10303-21;\nHEADER;\nFILE_SCHEMA(('S'));\nENDSEC;\nANCHOR;\n<a>=#1;\nENDSEC;\nREFERENCE;\n#7=<http://x#y>;\nENDSEC;\nDATA('one',('S'));\n#1=A(#7);\nENDSEC;\nDATA('two',('S'));\n#2=B(#1);\nENDSEC;\nEND-ISO-10303-21;\nSIGNATURE;\nMIIC;AAA='\nENDSEC;\n";
    let parsed = parse(text);
    assert_eq!(report(text, &parsed), Vec::<String>::new());
    let names: Vec<&str> = parsed.sections.iter().map(|s| s.name).collect();
    assert_eq!(names, ["HEADER", "ANCHOR", "REFERENCE", "DATA", "DATA", "SIGNATURE"]);
    assert_eq!(parsed.dangling(text), []);
}

#[test]
fn one_mistake_one_message() {
    check("#1=A(1)\n#2=B(#1);\n", &["8:8 p21/missing-semicolon"]);
    check("#1=A('x);\n#2=B('y');\n", &["8:6 p21/unterminated-string"]);
    check("#1=A(1,);\n", &["8:8 p21/empty-parameter"]);
    check("#1=A(0.0.1);\n", &["8:6 p21/bad-number"]);
    check("#1=A(1;\n#2=B();\n", &["8:7 p21/unexpected"]);
    check("#1=A(\",(0.,0.));\n", &["8:6 p21/stray-quote"]);
    check("#1=a(1);\n", &["8:4 p21/lower-case"]);
    check("#1=A B(1);\n", &["8:4 p21/blank-in-keyword"]);
    check("#1=A(TCP);\n", &["8:6 p21/bare-word"]);
    check("#1=A(.T);\n", &["8:6 p21/bad-enumeration"]);
    check("#1=A(.5);\n", &["8:6 p21/bad-number"]);
    check("#1=A('\\X2\\00D\\X0\\');\n", &["8:7 p21/bad-escape"]);
    check("#1=A();\n#1=B();\n", &["9:1 p21/duplicate-id"]);
    check("#1 A();\n#2=B();\n", &["8:4 p21/unexpected"]);
    check("#1=A(@@);\n", &["8:6 p21/unexpected"]);
    check("/* open\n#1=A();\n", &["8:1 p21/unterminated-comment"]);
}

/// The head of a statement is damaged: one message, and nothing that refers to it is without what it means.
#[test]
fn damaged_heads() {
    for (head, place) in [("#2B(1);", "9:3"), ("#2:B(1);", "9:3"), ("2=B(1);", "9:1"), ("#2 (B(1)C());", "9:4"), ("#2==B(1);", "9:4"), ("// #2=B(1);", "9:1")] {
        let parsed = check(&format!("#1=A(#2);\n{head}\n#3=C(#2);\n"), &[&format!("{place} p21/unexpected")]);
        assert!(parsed.find(2).is_some() && parsed.find(3).is_some(), "{head}");
    }
}

#[test]
fn five_faults_five_messages_and_the_healthy_stay() {
    let parsed = check(
        "#1=A(1.0.0);\n#2=B();\n#3=C('x);\n#4=D();\n#5=E(,);\n#6=F()\n#7=G();\n#8=h();\n#9=I();\n",
        &["8:6 p21/bad-number", "10:6 p21/unterminated-string", "12:6 p21/empty-parameter", "13:7 p21/missing-semicolon", "15:4 p21/lower-case"],
    );
    for id in [2, 4, 6, 7, 9] {
        let n = parsed.find(id).expect("kept");
        assert!(!parsed.instances[n as usize].damaged, "#{id}");
    }
}

/// A statement that lost its end, in all the ways that an end is lost: one message where it stood, the next one is read.
#[test]
fn lost_ends() {
    let ways = ["(#3\n", "((1,2)\n", "((1,#3\n", "(#3)\n", "(#3,\n", "(\n", "(1.5\r\n", "('x'\n\n  ", "(.T.\n", "($\n", "(*,\r", "(L(2.)\n", "(L(#3\n", "\n", "(#\n", "(\"0F\"\n\t", "(#3 /* c */\n"];
    for way in ways {
        for (head, next) in [("A", "#2=B(#1,#3);\n"), ("(A(1)B", "#2=(B(1)C(#3));\n")] {
            if head != "A" && matches!(way, "(#3)\n" | "\n") {
                continue;
            }
            let text = file(&format!("#1={head}{way}{next}#3=C(#2);\n"));
            let parsed = parse(text.as_bytes());
            assert_eq!(parsed.faults.len(), 1, "{head}{way}: {:?}", report(text.as_bytes(), &parsed));
            assert_eq!(parsed.faults, gr_p21::check_syntax(text.as_bytes()), "{head}{way}");
            assert_eq!(parsed.dangling(text.as_bytes()), [], "{head}{way}");
            let ids: Vec<u64> = gr_p21::index(text.as_bytes()).entries.iter().map(|e| e.id).collect();
            assert_eq!(ids, [1, 2, 3], "{head}{way}");
            for id in [2, 3] {
                let n = parsed.find(id).expect("kept");
                assert!(!parsed.instances[n as usize].damaged, "{head}{way}: #{id}");
            }
            let [one, two] = [1, 2].map(|id| parsed.instances[parsed.find(id).expect("there") as usize]);
            assert!(one.end <= two.start, "{head}{way}");
        }
    }
    let parsed = check("#1=A('x',(1,2\n#2=B();\n", &["8:14 p21/missing-semicolon"]);
    assert_eq!(parsed.faults[0].args, ["`))` is missing too, and the next statement begins", "));"]);
    check("#1=A('x',\n#2=B();\n", &["8:10 p21/missing-semicolon"]);
    // The last of its section, and one of the header.
    check("#1=A('x'\n", &["8:9 p21/missing-semicolon"]);
    check("#1=A('x',\n", &["8:10 p21/missing-semicolon"]);
    let text = file("#1=A();\n").replace("'','');\nFILE_SCHEMA", "'',''\nFILE_SCHEMA");
    let parsed = parse(text.as_bytes());
    assert_eq!(report(text.as_bytes(), &parsed), ["4:35 p21/missing-semicolon"]);
    assert!((0..parsed.instances.len() as u32).any(|n| parsed.keyword(n) == "FILE_SCHEMA"));
    // An instance begins with its keyword, and on a line of its own.
    check("#1=A(#2\n#3=4);\n#2=B();\n", &["9:1 p21/unexpected"]);
    check("#1=A(#2, #3=B(1));\n#2=B();\n", &["8:12 p21/unexpected"]);
}

/// Everything that a file says, without places.
fn meaning(text: &[u8]) -> String {
    let parsed = parse(text);
    let mut out = String::new();
    for i in 0..parsed.instances.len() as u32 {
        out += &format!("{} {}", parsed.instances[i as usize].id, parsed.keyword(i));
        for v in parsed.values_of(i) {
            let v = *v;
            out += &match v.kind() {
                Kind::String => format!(" {:?}", parsed.string(text, v)),
                Kind::Real | Kind::Integer => format!(" {:?}", parsed.real(text, v)),
                Kind::Reference => format!(" #{:?}", parsed.reference(text, v)),
                Kind::Enumeration => format!(" {:?}", parsed.enumeration(text, v)),
                Kind::List | Kind::Typed => format!(" {:?}{}", v.kind(), v.len()),
                k => format!(" {k:?}"),
            };
        }
        out.push('\n');
    }
    assert!(parsed.faults.is_empty(), "{:?}", parsed.faults);
    out
}

#[test]
fn broken_at_any_column_it_is_the_same_file() {
    let text = file("#12=CARTESIAN_POINT('it''s \\X2\\00D8\\X0\\',(1.5E+3,-20.25,.T.,#12));\n#13=(AB(1)C($,*,\"0F\"));\n");
    let whole = meaning(text.as_bytes());
    broken_alike(&text, &whole);
}

#[test]
fn comments_broken_at_any_column() {
    // `/` and `*` of a comment's ends may stand on two lines: line ends are no part of the alphabet.
    let text = file("/* one; #7=Z(); ** */#1=A(1,/**/*,2);/***/#2=B(/* it's */#1);/* last */\n");
    let whole = meaning(text.as_bytes());
    broken_alike(&text, &whole);
    check("#1=A(1); /\r\n* #2=B(); *\r\n/ #3=C(#1);\n", &[]);
    check("#1=A(1); /\n* open *\n", &["8:10 p21/unterminated-comment"]);
}

fn broken_alike(text: &str, whole: &str) {
    for width in 1..40 {
        let mut broken = Vec::new();
        for (n, b) in text.bytes().filter(|b| *b != b'\n').enumerate() {
            if n % width == 0 {
                broken.push(b'\n');
            }
            broken.push(b);
        }
        assert_eq!(meaning(&broken), whole, "width {width}");
    }
}

#[test]
fn strings_mean_what_the_standard_says() {
    let text = file("#1=A('a''b\\\\c\\X\\E9\\S\\D\\X2\\00D8\\X0\\\\X4\\0001F642\\X0\\ü');\n");
    let parsed = parse(text.as_bytes());
    let v = parsed.values_of(parsed.find(1).expect("there"))[0];
    assert_eq!(parsed.string(text.as_bytes(), v).as_deref(), Some("a'b\\céÄØ🙂ü"));
}

#[test]
fn no_prefix_and_no_mutation_panics() {
    let text = file("#1=A('x''y',(1.,2.E3),.T.,$,*,\"0F\");\n#2=(A(#1)B(()));\n/* c */#3=!U(L(5));\n");
    for n in 0..text.len() {
        parse(&text.as_bytes()[..n]);
        gr_p21::index(&text.as_bytes()[..n]);
        for b in *b"#'\"(;/\0\xFF=.,)" {
            let mut t = text.clone().into_bytes();
            t[n] = b;
            parse(&t);
            gr_p21::index(&t);
        }
    }
}

/// Whatever a header statement lost behind a comma, the next one is not taken for its value.
#[test]
fn a_cut_header_statement_costs_no_other() {
    let whole = file("#1=A();\n");
    let commas = whole.match_indices(',').map(|(n, _)| n);
    let mut cuts = 0;
    for comma in commas {
        let end = comma + whole[comma..].find('\n').expect("a line's end");
        let text = format!("{}{}", &whole[..=comma], &whole[end..]);
        let parsed = parse(text.as_bytes());
        let found = report(text.as_bytes(), &parsed);
        assert!(found.len() == 1 && found[0].ends_with("p21/missing-semicolon"), "{found:?}\n{text}");
        let names: Vec<&str> = (0..parsed.instances.len() as u32).map(|n| parsed.keyword(n)).collect();
        assert_eq!(names, ["FILE_DESCRIPTION", "FILE_NAME", "FILE_SCHEMA", "A"], "{text}");
        assert_eq!(parsed.instances.iter().filter(|i| i.damaged).count(), 1, "{text}");
        cuts += 1;
    }
    assert_eq!(cuts, 7);
}
