//! `gcc-robot rs274`: a stand-in for LinuxCNC's command of that name, down to its options, prompts, messages
//! and exit status. Its texts are in spec/rs274; nothing else in this program speaks like that.

use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};
use std::io::{BufRead as _, IsTerminal as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use gr_canon::{At, Call, FrameId, Printer, Sink as _, Units, Version};
use gr_driver::Loaded;
use gr_gcode::Chunk;
use gr_interp::{End, Finding, Interp, Setup, ToolTable};
use gr_spec::{Dialect, Rs274, fill, rs274};
use gr_text::{FileId, code, decode, decode_as_linuxcnc};

use crate::sources::{is_latin1, read_bytes};

/// The tools that the real command reads when no table is named, from LinuxCNC's sample configuration.
const DEFAULT_TOOLS: &str = "T1 P1 D0.125000 Z+0.511000\nT2 P2 D0.062500 Z+0.100000\nT3 P3 D0.201000 Z+1.273000\nT99999 P123 Z+0.100000\n";

/// What to do after an error.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum OnError {
    Continue,
    Mdi,
    Stop,
}

/// The options, as they stand before the run.
struct Choice {
    tools: Option<ToolTable>,
    vars: Option<PathBuf>,
    ini: Option<PathBuf>,
    on_error: OnError,
    block_delete: bool,
    stack: bool,
    go: bool,
    version: Version,
    files: Vec<OsString>,
}

/// Ends the command with this status, after the reason has been said.
struct Quit(u8);

/// Runs the command under the name `name`.
pub fn run(name: &OsStr, args: &[OsString]) -> ExitCode {
    let mut choice = Choice {
        tools: None,
        vars: None,
        ini: None,
        on_error: OnError::Stop,
        block_delete: false,
        stack: false,
        go: false,
        version: version(std::env::var("GCC_ROBOT_LINUXCNC").ok().as_deref()).unwrap_or_default(),
        files: Vec::new(),
    };
    let end = options(&name.to_string_lossy(), args, &mut choice).and_then(|()| {
        if !choice.go {
            menu(&mut choice)?;
        }
        say(rs274::CLI_EXECUTING, &[]);
        execute(&choice)
    });
    match end {
        Ok(code) => ExitCode::from(code),
        Err(Quit(code)) => ExitCode::from(code),
    }
}

fn version(name: Option<&str>) -> Option<Version> {
    match name? {
        "2.9" => Some(Version::V2_9),
        "2.10" => Some(Version::V2_10),
        _ => None,
    }
}

/// A line on standard error.
fn say(text: Rs274, args: &[String]) {
    ask(text, args);
    eprintln!();
}

/// The same without a line end.
fn ask(text: Rs274, args: &[String]) {
    eprint!("{}", fill(text.text(), args));
}

// ---- options -------------------------------------------------------------------------------------------

/// Options may stand anywhere, flags may be joined (`-gs`), values may follow at once (`-tx.tbl`).
fn options(name: &str, args: &[OsString], choice: &mut Choice) -> Result<(), Quit> {
    let mut rest = args.iter();
    while let Some(arg) = rest.next() {
        let text = arg.to_string_lossy();
        if text == "--" {
            choice.files.extend(rest.by_ref().cloned());
        } else if text == "--linuxcnc" || text.starts_with("--linuxcnc=") {
            let value = text.split_once('=').map(|(_, v)| v.to_string());
            let value = value.or_else(|| rest.next().map(|v| v.to_string_lossy().into_owned()));
            choice.version = version(value.as_deref()).ok_or_else(|| usage(name))?;
        } else if text == "--help" {
            return Err(usage(name));
        } else if text.starts_with('-') && text.len() > 1 {
            letters(name, arg, &mut rest, choice)?;
        } else {
            choice.files.push(arg.clone());
        }
    }
    if choice.files.len() > 3 { Err(usage(name)) } else { Ok(()) }
}

fn letters(name: &str, arg: &OsString, rest: &mut std::slice::Iter<'_, OsString>, choice: &mut Choice) -> Result<(), Quit> {
    let text = arg.to_string_lossy();
    for (at, letter) in text.char_indices().skip(1) {
        match letter {
            'b' => choice.block_delete = !choice.block_delete,
            's' => choice.stack = !choice.stack,
            'g' => choice.go = !choice.go,
            'T' => {}
            'p' | 't' | 'v' | 'n' | 'l' | 'i' => {
                let joined = &text[at + letter.len_utf8()..];
                let value = if joined.is_empty() { rest.next().cloned() } else { Some(OsString::from(joined)) };
                let Some(value) = value else {
                    say(rs274::CLI_OPTION_ARGUMENT, &[name.to_string(), letter.to_string()]);
                    return Err(usage(name));
                };
                return with_value(name, letter, value, choice);
            }
            other => {
                say(rs274::CLI_BAD_OPTION, &[name.to_string(), other.to_string()]);
                return Err(usage(name));
            }
        }
    }
    Ok(())
}

fn with_value(name: &str, letter: char, value: OsString, choice: &mut Choice) -> Result<(), Quit> {
    match letter {
        'p' => {
            eprintln!("{name}: -p {}: other interpreters can't be loaded; this program is its own", value.display());
            return Err(Quit(1));
        }
        't' => choice.tools = Some(read_tools(Path::new(&value)).unwrap_or_else(gr_interp::no_tools)),
        'v' => choice.vars = Some(value.into()),
        'i' => choice.ini = Some(value.into()),
        'n' => {
            let number: String = value.to_string_lossy().trim().chars().take_while(char::is_ascii_digit).collect();
            choice.on_error = match number.trim_start_matches('0') {
                "1" => OnError::Mdi,
                "2" => OnError::Stop,
                _ => OnError::Continue,
            };
        }
        _ => {} // -l: there is no log
    }
    Ok(())
}

fn usage(name: &str) -> Quit {
    eprintln!(
        "Usage: {name} [-t tool.tbl] [-v var-file.var] [-i machine.ini] [-n 0|1|2]\n\
         \x20         [-b] [-s] [-g] [--linuxcnc 2.9|2.10] [input file [output file]]\n\n\
         \x20   -t  tool table\n\
         \x20   -v  parameter file; it is written anew at the end\n\
         \x20   -i  INI file\n\
         \x20   -n  after an error 0: go on, 1: read lines by hand, 2: stop (default)\n\
         \x20   -b  switch block delete on (then off, on …)\n\
         \x20   -s  say how execution came to an error\n\
         \x20   -g  start without asking\n\
         \x20   -l, -T  taken and not used; -p is refused\n\
         \x20   --linuxcnc  which version to be like (or variable GCC_ROBOT_LINUXCNC)"
    );
    Quit(1)
}

/// The bytes of a stored file: a pipe that nobody writes to would never end.
fn stored(path: &Path) -> std::io::Result<Vec<u8>> {
    match std::fs::metadata(path) {
        Ok(m) if !m.is_file() => Err(std::io::ErrorKind::InvalidInput.into()),
        _ => std::fs::read(path),
    }
}

/// Reads a tool table; lines that can't be read are told on standard output, as the real command does.
fn read_tools(path: &Path) -> Option<ToolTable> {
    let text = decode(stored(path).ok()?).text;
    let (table, found) = gr_interp::read_tools(&text, FileId(0));
    for d in found.iter().filter(|d| d.code == gr_text::code::TOOL_TABLE_BAD_LINE) {
        let at = d.primary().1.start as usize;
        let start = text[..at].rfind('\n').map_or(0, |n| n + 1);
        let line = text[start..].split_inclusive('\n').next().unwrap_or("");
        let head = fill(rs274::CLI_TABLE_LINE.text(), &[path.display().to_string()]);
        let _ = crate::output::to_stdout(format!("{head}\n    {line}").as_bytes());
    }
    Some(table)
}

// ---- menu ----------------------------------------------------------------------------------------------

fn input_line() -> Option<String> {
    let mut bytes = Vec::new();
    let count = std::io::stdin().lock().read_until(b'\n', &mut bytes).ok()?;
    if count == 0 {
        return None;
    }
    let text = decode(bytes).text;
    Some(text.trim_end_matches(['\n', '\r']).to_string())
}

/// A number at the start of a line of input; `Some(None)` when there is none.
fn input_number() -> Option<Option<i32>> {
    let line = input_line()?;
    let line = line.trim_start();
    let end = line.char_indices().find(|(i, c)| !(c.is_ascii_digit() || *i == 0 && "+-".contains(*c))).map_or(line.len(), |(i, _)| i);
    Some(line[..end].parse().ok())
}

fn menu(choice: &mut Choice) -> Result<(), Quit> {
    loop {
        say(rs274::CLI_NUMBER, &[]);
        say(rs274::CLI_MENU_START, &[]);
        say(rs274::CLI_MENU_VARS, &[]);
        say(rs274::CLI_MENU_TOOLS, &[]);
        say(rs274::CLI_MENU_DELETE, &[if choice.block_delete { "OFF" } else { "ON" }.to_string()]);
        say(rs274::CLI_MENU_ERRORS, &[]);
        ask(rs274::CLI_CHOICE, &[]);
        match input_number() {
            None | Some(Some(1)) => return Ok(()),
            Some(Some(2)) => {
                ask(rs274::CLI_NAME_VARS, &[]);
                let name = input_line().ok_or(Quit(1))?;
                if std::fs::File::open(&name).is_err() {
                    say(rs274::CLI_CANNOT_OPEN, &[name]);
                    return Err(Quit(1));
                }
                choice.vars = Some(name.into());
            }
            Some(Some(3)) => {
                ask(rs274::CLI_NAME_TOOLS, &[]);
                let name = input_line().ok_or(Quit(1))?;
                choice.tools = Some(read_tools(Path::new(&name)).ok_or(Quit(1))?);
            }
            Some(Some(4)) => choice.block_delete = !choice.block_delete,
            Some(Some(5)) => error_menu(choice),
            Some(_) => {}
        }
    }
}

/// With an output file the program can't be interrupted for lines by hand.
fn error_menu(choice: &mut Choice) {
    use OnError::{Continue, Mdi, Stop};
    // The real command counts all arguments, itself included.
    let arguments = std::env::args_os().count() - usize::from(!crate::called_as_rs274(std::env::args_os().next().as_ref()));
    loop {
        say(rs274::CLI_NUMBER, &[]);
        say(rs274::CLI_ERRORS_DONE, &[]);
        say(if choice.stack { rs274::CLI_ERRORS_NO_STACK } else { rs274::CLI_ERRORS_STACK }, &[]);
        let offer = match (arguments, choice.on_error) {
            (3, Continue) => Some((rs274::CLI_ERRORS_TO_STOP, Stop)),
            (3, _) => Some((rs274::CLI_ERRORS_TO_CONTINUE, Continue)),
            (2, Continue) => Some((rs274::CLI_ERRORS_TO_MDI, Mdi)),
            (2, Mdi) => Some((rs274::CLI_ERRORS_MDI_TO_STOP, Stop)),
            (2, Stop) => Some((rs274::CLI_ERRORS_STOP_TO_CONTINUE, Continue)),
            _ => None,
        };
        if let Some((text, _)) = offer {
            say(text, &[]);
        }
        ask(rs274::CLI_CHOICE, &[]);
        match (input_number(), offer) {
            (None | Some(Some(1)), _) => return,
            (Some(Some(2)), _) => choice.stack = !choice.stack,
            (Some(Some(3)), Some((_, next))) => choice.on_error = next,
            _ => {}
        }
    }
}

// ---- run -----------------------------------------------------------------------------------------------

/// Standard output or the output file.
type Out = Printer<Box<dyn std::io::Write>>;

fn execute(choice: &Choice) -> Result<u8, Quit> {
    let tools = match &choice.tools {
        Some(tools) => tools.clone(),
        None => gr_interp::read_tools(DEFAULT_TOOLS, FileId(0)).0,
    };
    let program = program(choice);
    let mut printer = printer(choice, program.latin1)?;
    let (mut setup, refused) = setup(choice, tools);
    if !refused.is_empty() {
        printer.flush();
        refused.iter().for_each(|text| eprintln!("{text}"));
        eprintln!("{}\n", rs274::CLI_UNKNOWN_ERROR.text());
        return Err(Quit(1));
    }
    let stored = match parameters(choice) {
        Ok(stored) => stored,
        Err(text) => {
            let at = At { file: FileId(0), line: 0, frame: FrameId::MAIN, now: b"" };
            printer.call(&at, &Call::UseLengthUnits(Units::Mm));
            printer.flush();
            eprintln!("{text}\n");
            return Err(Quit(1));
        }
    };
    setup.params = stored.clone();
    let mut files = Loaded::new(&program.name, program.text.into(), &setup);
    let mut run = Interp::new(&mut files, &setup, printer);
    run.init();
    run.sink().flush();
    save(choice, &run);
    let code = match &program.open {
        None => {
            by_hand(&mut run, choice);
            0
        }
        Some(Err(text)) => {
            eprintln!("{text}\n");
            return Err(Quit(1));
        }
        Some(Ok(())) => {
            if let Err(fault) = run.open(FileId(0)) {
                let line: String = run.line_text().chars().take(254).take_while(|c| *c != '\0').collect();
                report_fault(&fault.rs_text().unwrap_or_default(), &line, &[]);
                return Err(Quit(1));
            }
            let code = from_file(&mut run, choice);
            // With an INI file the real command puts off closing the program, and then forgets it.
            if !choice.ini.as_ref().is_some_and(|p| p.exists()) {
                run.reset();
            }
            code
        }
    };
    run.reset();
    save(choice, &run);
    match run.into_sink().finish() {
        Ok(_) => Ok(code),
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(code),
        Err(e) => {
            eprintln!("{e}");
            Err(Quit(1))
        }
    }
}

/// The main program.
struct Program {
    name: String,
    text: String,
    latin1: bool,
    /// None: lines come from the keyboard. Otherwise whether the file can be opened, or why not.
    open: Option<Result<(), String>>,
}

fn program(choice: &Choice) -> Program {
    let none = |open| Program { name: String::new(), text: String::new(), latin1: false, open };
    let Some(name) = choice.files.first() else { return none(None) };
    let path = Path::new(name);
    let name = path.display().to_string();
    match read_bytes(path) {
        Ok(bytes) => {
            let decoded = decode_as_linuxcnc(bytes);
            let latin1 = is_latin1(&decoded);
            Program { name, text: without_lone_returns(decoded.text), latin1, open: Some(Ok(())) }
        }
        Err((code::FILE_TOO_BIG, args)) => {
            // The real command has no such limit; nothing short of its words would tell so much.
            let args: Vec<String> = std::iter::once(name).chain(args).collect();
            none(Some(Err(fill(code::FILE_TOO_BIG.def().message, &args))))
        }
        Err(_) => {
            let text = if path.is_dir() { rs274::CLI_EMPTY_FILE } else { rs274::CLI_OPEN_FAILED };
            none(Some(Err(fill(text.text(), &[name]))))
        }
    }
}

/// A carriage return within a line is a blank to `rs274`, which drops it even in comments; to the other commands it
/// ends a line, as in files of old.
fn without_lone_returns(text: String) -> String {
    let lone = |at: usize| !matches!(text.as_bytes().get(at + 1), Some(b'\n'));
    if !text.bytes().enumerate().any(|(i, b)| b == b'\r' && lone(i)) {
        return text;
    }
    text.char_indices().filter(|(i, c)| *c != '\r' || !lone(*i)).map(|(_, c)| c).collect()
}

fn dialect(version: Version) -> &'static Dialect {
    let name = if version == Version::V2_10 { "linuxcnc-2.10" } else { "linuxcnc-2.9" };
    Dialect::find(name).unwrap_or_else(Dialect::linuxcnc)
}

fn printer(choice: &Choice, latin1: bool) -> Result<Out, Quit> {
    // The third name is taken and not used, and then neither is the second.
    let (out, to_file): (Box<dyn std::io::Write>, bool) = match choice.files.get(1).filter(|_| choice.files.len() == 2) {
        None => (Box::new(std::io::stdout()), false),
        Some(name) => match std::fs::File::create(name) {
            Ok(file) => (Box::new(file), true),
            Err(_) => {
                say(rs274::CLI_OUTPUT_FAILED, &[name.display().to_string()]);
                return Err(Quit(1));
            }
        },
    };
    let printer = Printer::new(out, choice.version).latin1(latin1);
    Ok(if to_file { printer.prints_to(Box::new(std::io::stdout())) } else { printer })
}

/// Settings, and why the INI file does not let the interpreter start.
fn setup(choice: &Choice, tools: ToolTable) -> (Setup, Vec<String>) {
    let mut setup = Setup {
        without_python: false,
        dialect: dialect(choice.version),
        version: choice.version,
        machine_units: Units::Inch,
        user_m_codes: false,
        uvw: false,
        startup_code: false,
        tools,
        block_delete: choice.block_delete,
        keep_going: choice.on_error != OnError::Stop,
        ..Setup::default()
    };
    let mut refused = Vec::new();
    if let Some(path) = &choice.ini {
        match stored(path) {
            Ok(bytes) => {
                let (ini, found) = gr_interp::read_ini(&decode(bytes).text, FileId(0), path.parent(), None);
                for key in gr_interp::wrong_arc_tolerances(&ini) {
                    say(rs274::CLI_INI_TOLERANCE, &[key.to_string()]);
                    eprintln!();
                }
                setup.ini = ini;
                refused.extend(found.into_iter().filter(|d| d.code == code::INI_REMAP).map(|d| d.message));
                let missing = gr_interp::remaps_without_file(&setup, &|p| p.is_file());
                refused.extend(missing.into_iter().map(|(line, _)| fill(rs274::CLI_REMAP_FILE.text(), &[line.to_string()])));
            }
            Err(_) => say(rs274::CLI_INI_FAILED, &[path.display().to_string()]),
        }
    }
    if choice.version == Version::V2_10
        && let Some(units) = setup.ini.machine_units()
    {
        setup.machine_units = units;
    }
    (setup, refused)
}

/// Stored parameters; a file that is not there holds none.
fn parameters(choice: &Choice) -> Result<BTreeMap<u32, f64>, String> {
    let Some(path) = choice.vars.as_ref().filter(|p| p.exists()) else { return Ok(BTreeMap::new()) };
    let bytes = stored(path).map_err(|_| fill(rs274::VAR_FILE_OPEN.text(), &[path.display().to_string()]))?;
    gr_interp::read_parameters(&decode(bytes).text, FileId(0)).map_err(|d| {
        let number = d.code == gr_text::code::PARAMETER_FILE_NUMBER_RANGE;
        (if number { rs274::VAR_FILE_NUMBER } else { rs274::VAR_FILE_ORDER }).text().to_string()
    })
}

/// Writes the parameter file, as the real command does before it opens a program and again at the end.
fn save(choice: &Choice, run: &Interp<'_, Out>) {
    let Some(path) = &choice.vars else { return };
    let missing = !path.exists();
    let Ok(old) = parameters(choice) else { return };
    let written = gr_interp::save_parameters(path, &old, &|n| run.params().get(n));
    if missing && written.is_ok() {
        say(rs274::CLI_LINK_FAILED, &[]);
    }
}

/// Message and source line of an error.
fn report_fault(text: &str, line: &str, stack: &[String]) {
    let text = if text.is_empty() { rs274::CLI_UNKNOWN_ERROR.text() } else { text };
    eprintln!("{text}\n{line}");
    for frame in stack {
        eprintln!("{frame}");
    }
}

/// Reports what was found; whether there was an error.
fn report(run: &mut Interp<'_, Out>, findings: &[Finding], stack: bool) -> bool {
    let mut bad = false;
    for finding in findings {
        let fault = &finding.fault;
        let text = match fault.rs_text() {
            Some(text) => text,
            // Our own limits; doubts that the real command does not have are not told.
            None if fault.code.def().severity == gr_spec::Severity::Error => fill(fault.code.def().message, &fault.args),
            None => continue,
        };
        bad = true;
        run.sink().flush();
        let def = fault.code.def();
        let way = if stack { vec![format!("{} {}, line {}", def.code, def.slug, finding.line + 1)] } else { Vec::new() };
        report_fault(&text, &finding.text, &way);
    }
    bad
}

/// Whether a finding says that the file ended while a label was looked for.
fn seeking(finding: &Finding) -> bool {
    finding.fault.rs.is_some_and(|rs| rs.text().starts_with("EOF in file"))
}

/// Runs the open program; the exit status.
fn from_file(run: &mut Interp<'_, Out>, choice: &Choice) -> u8 {
    if choice.on_error == OnError::Stop {
        let end = run.run_open();
        let findings = run.take_findings();
        return u8::from(report(run, &findings, choice.stack) || end == End::Fault);
    }
    loop {
        let end = run.step_block();
        let findings = run.take_findings();
        let bad = !findings.is_empty() && report(run, &findings, choice.stack);
        if bad && choice.on_error == OnError::Mdi {
            say(rs274::CLI_MDI, &[]);
            by_hand(run, choice);
            ask(rs274::CLI_CONTINUE, &[]);
            if !input_line().is_some_and(|l| l.starts_with('y')) {
                return 1;
            }
        }
        match end {
            // Looking for a label up to the end of the file is, for the real command, a way of ending that is told to
            // go on.
            Some(End::Fault) if choice.on_error == OnError::Continue && findings.last().is_some_and(seeking) => return 0,
            Some(End::Fault) => return 1,
            Some(_) => return 0,
            None => {}
        }
    }
}

/// Lines from standard input until `quit`.
fn by_hand(run: &mut Interp<'_, Out>, choice: &Choice) {
    let asking = std::io::stdin().is_terminal();
    loop {
        run.sink().flush();
        if asking {
            print!("{}", rs274::CLI_PROMPT.text());
            let _ = std::io::stdout().flush();
        }
        let Some(line) = input_line().filter(|l| l != "quit") else { return };
        // Whatever the switch says, the real command passes over these here.
        if line.trim_start().starts_with('/') {
            continue;
        }
        let scan = gr_gcode::scan(&line, dialect(choice.version));
        let chunk = Chunk { text: line.as_str().into(), scan: std::sync::Arc::new(scan) };
        if let Err(finding) = run.mdi(&chunk) {
            report(run, &[finding], choice.stack);
        }
    }
}
