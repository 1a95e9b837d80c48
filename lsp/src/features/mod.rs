//! From requests to features and back. Each function takes a view and gives data of the protocol; failures are that
//! the view was overtaken by an edit, or that the request can't be met and why.

mod custom;
mod edits;
mod look;
mod names;
mod reach;
mod write;

pub use custom::*;
pub use edits::*;
pub use look::*;
pub use names::*;
pub use write::*;

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use gr_driver::Cancelled;
use gr_ide::gcode;
use gr_text::{Diagnostic, FileId, Severity, Span, code};
use tower_lsp::ls_types as lsp;

use crate::documents::{Kind, Motion, View};
use crate::text::Text;

/// Why a request has no answer.
#[derive(Clone, Debug, PartialEq)]
pub enum Failure {
    /// The text changed meanwhile.
    Overtaken,
    /// It can't be met.
    Refused(String),
}

impl From<Cancelled> for Failure {
    fn from(_: Cancelled) -> Failure {
        Failure::Overtaken
    }
}

/// What a request gives.
pub type Answer<T> = Result<T, Failure>;

/// Everything that is to be said about a document.
pub fn diagnostics(view: View) -> Answer<Vec<Diagnostic>> {
    diagnose(view).map(|found| found.0)
}

/// Files that a program calls, as they were when it was run: name and text.
pub type Elsewhere = BTreeMap<FileId, (PathBuf, Text)>;

/// The files besides its own that findings of a program name.
fn elsewhere(session: &gr_driver::Snapshot, own: FileId, found: &[Diagnostic]) -> Elsewhere {
    let labels = found.iter().flat_map(|d| d.labels.iter().map(|l| l.file));
    let files: BTreeSet<FileId> = labels.chain(found.iter().flat_map(|d| d.trace.iter().map(|f| f.file))).filter(|f| *f != own).collect();
    let of = |id: FileId| {
        let contents = session.contents(id)?;
        let text: String = contents.chunks.iter().map(|c| &*c.text).collect();
        Some((id, (PathBuf::from(&*session.path(id)?), Text::new(&text))))
    };
    files.into_iter().filter_map(of).collect()
}

/// The same, with the other files that it names.
pub fn diagnose(mut view: View) -> Answer<(Vec<Diagnostic>, Elsewhere)> {
    let mut others = Elsewhere::default();
    let found = match view.kind {
        Kind::Gcode(..) => {
            let Some((session, file, dialect)) = view.session() else { return Ok(Default::default()) };
            if undeclared(&view) {
                let tables = session.file(file)?;
                syntax_only(&tables, file, dialect)
            } else {
                let mut found = session.check(file)?.diagnostics;
                others = elsewhere(session, file, &found);
                let motion = if asks_machine(&view, &found) { view.motion()? } else { None };
                view.release();
                found.extend(motion.into_iter().flat_map(|m| of_machine(&view, &m)));
                found
            }
        }
        Kind::Exchange => {
            view.release();
            if view.is_overtaken() {
                return Err(Failure::Overtaken);
            }
            let exchange = view.exchange();
            if view.is_overtaken() {
                return Err(Failure::Overtaken);
            }
            if exchange.text.len() > MOST_PLANNED {
                let wanted = || !view.is_overtaken();
                gr_step::diagnostics_while(exchange.text.as_bytes(), &exchange.tables, FileId(0), &wanted).ok_or(Failure::Overtaken)?
            } else {
                let mut found = view.host.check_exchange(&view.path, &exchange.text, &view.station);
                let motion = if asks_machine(&view, &found) { view.motion()? } else { None };
                found.extend(motion.into_iter().flat_map(|m| of_machine(&view, &m)));
                return Ok((found, others));
            }
        }
        Kind::Config(schema) => {
            view.release();
            let text = view.text.to_string();
            match schema {
                gr_ide::config::Schema::Machine => {
                    let found = gr_machine::parse(FileId(0), &text).err().unwrap_or_default();
                    [found, gr_machine::doubts(FileId(0), &text)].concat()
                }
                gr_ide::config::Schema::Job => gr_machine::parse_job(FileId(0), &text).err().unwrap_or_default(),
                gr_ide::config::Schema::Project => view.host.check_project(&view.path, &text),
            }
        }
        Kind::Tools => gr_interp::read_tools(&view.text.to_string(), FileId(0)).1,
        Kind::Ini => gr_interp::read_ini(&view.text.to_string(), FileId(0), None, None).1,
        Kind::Vars => gr_interp::read_parameters(&view.text.to_string(), FileId(0)).err().map(|d| *d).into_iter().collect(),
        Kind::Other => Vec::new(),
    };
    Ok((found.into_iter().filter_map(|d| view.station.harden(d)).collect(), others))
}

/// Whether what a program does may depend on other files: it has control flow, which calls are part of.
pub fn calls(view: &View) -> bool {
    let Some((session, file, dialect)) = view.session() else { return false };
    dialect.id.starts_with("fanuc") || session.file(file).is_ok_and(|f| f.chunks.iter().any(|c| !c.scan.controls.is_empty()))
}

/// In documents above this the lines around an edit are looked at first, bytes.
const EARLY_ABOVE: u32 = 500_000;
/// So many of them.
const EARLY_LINES: u32 = 2_000;

/// What is to be said about the lines around the last edit of a big program, while the rest is not yet known.
pub fn early(view: &View) -> Answer<Option<(std::ops::Range<u32>, Vec<Diagnostic>)>> {
    let Some((session, file, _)) = view.session() else { return Ok(None) };
    if view.version <= 1 || view.text.len() < EARLY_ABOVE || undeclared(view) {
        return Ok(None);
    }
    let from = view.focus.saturating_sub(EARLY_LINES / 2);
    let lines = from..from + EARLY_LINES;
    let found = session.check_range(file, lines.clone())?;
    Ok(Some((lines, found.into_iter().filter(|d| d.primary().0 == file).filter_map(|d| view.station.harden(d)).collect())))
}

/// Programs above this are not planned for a robot while they are edited, bytes.
const MOST_FOR_A_ROBOT: u32 = 1_000_000;
/// … in words.
const TOO_LARGE: &str = "the program is too large to be planned while it is edited";

/// Whether the chosen machine is asked what it can't do: when the program itself is good.
fn asks_machine(view: &View, found: &[Diagnostic]) -> bool {
    let good = found.iter().all(|d| d.severity != Severity::Error);
    let machine = view.station.machine.as_ref().is_some_and(|m| gr_robot::opinion::has_a_say(m));
    good && machine && view.text.len() <= MOST_FOR_A_ROBOT && !view.is_overtaken()
}

/// What the chosen machine has to say about the document.
fn of_machine(view: &View, motion: &Motion) -> Vec<Diagnostic> {
    view.opinion(motion).into_iter().filter(|d| d.primary().0 == motion.main).collect()
}

/// A `.gcode` file of which nobody says what control it is for: mostly a printer's. Its spelling alone is looked at.
fn undeclared(view: &View) -> bool {
    let printer = view.path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gcode"));
    printer && view.host.undeclared(&view.path, &view.text.slice(Span::new(0, crate::analysis::HEAD)), &view.settings)
}

fn syntax_only(tables: &gr_gcode::File, file: FileId, _dialect: &gr_spec::Dialect) -> Vec<Diagnostic> {
    let mut found = vec![Diagnostic::new(code::FILE_UNDECLARED_DIALECT, file, Span::default(), &[])];
    for (chunk, start) in tables.chunks.iter().zip(&tables.starts) {
        found.extend(chunk.scan.faults.iter().map(|fault| {
            let mut d = Diagnostic::new(fault.code, file, fault.span.shifted(*start), &fault.args);
            d.severity = Severity::Hint;
            d
        }));
    }
    found.truncate(gr_driver::MOST_OF_A_KIND);
    found
}

/// Larger exchange files are checked but not planned while they are edited, bytes.
const MOST_PLANNED: usize = 8_000_000;

/// Blocks that are run to find out about one line.
const MOST_BLOCKS: u32 = 2_000_000;
/// … about what is visible.
const MOST_BLOCKS_VISIBLE: u32 = 300_000;

/// The program of a view.
fn doc<'a>(tables: &'a (std::sync::Arc<gr_gcode::File>, &'static gr_spec::Dialect)) -> gcode::Doc<'a> {
    gcode::Doc { file: &tables.0, dialect: tables.1 }
}

/// The exchange file of a view.
fn exchange_doc(exchange: &crate::documents::Exchange) -> gr_ide::p21::Doc<'_> {
    gr_ide::p21::Doc { text: exchange.text.as_bytes(), file: &exchange.tables, units: gr_ide::p21::Units::default() }
}

/// The same where it is told how its speeds and angles are read.
fn exchange_in_units<'a>(view: &View, exchange: &'a crate::documents::Exchange) -> gr_ide::p21::Doc<'a> {
    gr_ide::p21::Doc { units: view.step_units(), ..exchange_doc(exchange) }
}

/// A place taken up to the cursor: at `#` or `o` before a name, the name is meant.
fn with(span: Span, offset: u32) -> Span {
    Span::new(span.start.min(offset), span.end.max(offset))
}

/// Edits of one file as the protocol has them.
fn text_edits(view: &View, edits: Vec<gr_ide::Edit>) -> Vec<lsp::TextEdit> {
    let ends = edits.iter().any(|e| e.text.contains('\n'));
    let returns = ends && view.text.slice(Span::new(0, crate::analysis::HEAD)).split_once('\n').is_some_and(|(first, _)| first.ends_with('\r'));
    // Lines end as those of the document do.
    let text = |t: String| if returns && t.contains('\n') { t.replace("\r\n", "\n").replace('\n', "\r\n") } else { t };
    edits.into_iter().map(|e| lsp::TextEdit { range: view.range(e.span), new_text: text(e.text) }).collect()
}
