//! The thread that owns the session.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, TryRecvError};

use gr_driver::{Options, Session};
use gr_gcode::FormatOptions;
use gr_interp::Setup;
use gr_spec::Dialect;
use gr_text::{FileId, Span};
use tower_lsp::ls_types as lsp;

use crate::protocol::{Lines, diagnostic};

/// What the thread is asked to do.
pub enum Message {
    /// A document was opened.
    Open { uri: lsp::Uri, text: String },
    /// … edited.
    Change { uri: lsp::Uri, changes: Vec<lsp::TextDocumentContentChangeEvent> },
    /// … closed.
    Close { uri: lsp::Uri },
    /// A question; the answer travels in the closure.
    Ask(Box<dyn FnOnce(&mut Analysis) + Send>),
}

/// Diagnostics that are ready to be published.
pub struct Published {
    pub uri: lsp::Uri,
    pub diagnostics: Vec<lsp::Diagnostic>,
}

struct Document {
    file: FileId,
    text: String,
    dialect: &'static Dialect,
    stale: bool,
}

/// Open documents and the session behind them.
pub struct Analysis {
    session: Session,
    documents: HashMap<lsp::Uri, Document>,
    utf8: bool,
}

impl Analysis {
    pub fn new() -> Analysis {
        Analysis { session: Session::new(), documents: HashMap::new(), utf8: false }
    }

    /// Columns are counted in bytes from now on.
    pub fn count_bytes(&mut self) {
        self.utf8 = true;
    }

    /// Works until the queue's other end is gone.
    pub fn serve(mut self, queue: &Receiver<Message>, publish: impl Fn(Published)) {
        while let Ok(first) = queue.recv() {
            self.take(first, &publish);
            loop {
                match queue.try_recv() {
                    Ok(next) => self.take(next, &publish),
                    Err(TryRecvError::Empty) => break,
                    Err(TryRecvError::Disconnected) => return,
                }
            }
            self.publish(&publish);
        }
    }

    fn take(&mut self, message: Message, publish: &impl Fn(Published)) {
        match message {
            Message::Open { uri, text } => self.open(uri, text),
            Message::Change { uri, changes } => self.change(&uri, changes),
            Message::Close { uri } => {
                if let Some(document) = self.documents.remove(&uri) {
                    self.session.close(document.file);
                    publish(Published { uri, diagnostics: Vec::new() });
                }
            }
            Message::Ask(work) => work(self),
        }
    }

    fn open(&mut self, uri: lsp::Uri, text: String) {
        let path = path_of(&uri);
        let dialect = dialect_of(&path);
        let mut setup = Setup { dialect, ..Setup::default() };
        setup.tools = gr_interp::assumed_tools();
        let file = self.session.open(&path.to_string_lossy(), &text, Options::new(setup));
        self.documents.insert(uri, Document { file, text, dialect, stale: true });
    }

    fn change(&mut self, uri: &lsp::Uri, changes: Vec<lsp::TextDocumentContentChangeEvent>) {
        let Some(document) = self.documents.get_mut(uri) else { return };
        for change in changes {
            let range = match change.range {
                Some(range) => {
                    let lines = Lines::new(&document.text, self.utf8);
                    lines.offset(range.start)..lines.offset(range.end)
                }
                None => 0..document.text.len() as u32,
            };
            let range = range.start..range.end.max(range.start);
            document.text.replace_range(range.start as usize..range.end as usize, &change.text);
            self.session.edit(document.file, range, &change.text);
        }
        document.stale = true;
    }

    fn publish(&mut self, publish: &impl Fn(Published)) {
        for (uri, document) in &mut self.documents {
            if !std::mem::take(&mut document.stale) {
                continue;
            }
            let lines = Lines::new(&document.text, self.utf8);
            let found = self.session.check(document.file).diagnostics;
            let own = found.iter().filter(|d| d.primary().0 == document.file);
            let diagnostics = own.map(|d| diagnostic(d, &lines, uri)).collect();
            publish(Published { uri: uri.clone(), diagnostics });
        }
    }

    pub fn hover(&self, uri: &lsp::Uri, at: lsp::Position) -> Option<lsp::Hover> {
        let document = self.documents.get(uri)?;
        let lines = Lines::new(&document.text, self.utf8);
        let (line, start) = lines.line(at.line);
        let found = gr_ide::hover(line, lines.offset(at) - start, document.dialect)?;
        Some(lsp::Hover {
            contents: lsp::HoverContents::Markup(lsp::MarkupContent { kind: lsp::MarkupKind::Markdown, value: found.text }),
            range: Some(lines.range(found.span.shifted(start))),
        })
    }

    pub fn complete(&self, uri: &lsp::Uri, at: lsp::Position) -> Vec<lsp::CompletionItem> {
        let Some(document) = self.documents.get(uri) else { return Vec::new() };
        let lines = Lines::new(&document.text, self.utf8);
        let (line, start) = lines.line(at.line);
        let before = &line[..(lines.offset(at) - start) as usize];
        let items = gr_ide::complete(before, document.dialect).into_iter();
        items
            .map(|c| lsp::CompletionItem {
                label: c.label,
                detail: Some(c.detail),
                kind: Some(lsp::CompletionItemKind::KEYWORD),
                documentation: Some(lsp::Documentation::MarkupContent(lsp::MarkupContent {
                    kind: lsp::MarkupKind::Markdown,
                    value: c.documentation,
                })),
                ..lsp::CompletionItem::default()
            })
            .collect()
    }

    #[allow(deprecated, reason = "the protocol's struct has a deprecated field without a default")]
    pub fn symbols(&self, uri: &lsp::Uri) -> Vec<lsp::DocumentSymbol> {
        let Some(document) = self.documents.get(uri) else { return Vec::new() };
        let lines = Lines::new(&document.text, self.utf8);
        let scan = gr_gcode::scan(&document.text, document.dialect);
        let items = gr_ide::outline(&document.text, &scan).into_iter();
        items
            .map(|item| {
                let (last, start) = lines.line(item.last_line);
                let selection = lines.range(item.span);
                let end = lines.position(start + last.len() as u32);
                lsp::DocumentSymbol {
                    name: item.name,
                    detail: None,
                    kind: match item.kind {
                        gr_ide::ItemKind::Sub => lsp::SymbolKind::FUNCTION,
                        gr_ide::ItemKind::Tool => lsp::SymbolKind::CLASS,
                        gr_ide::ItemKind::Operation => lsp::SymbolKind::STRING,
                    },
                    tags: None,
                    deprecated: None,
                    range: lsp::Range { start: lsp::Position { line: item.line, character: 0 }, end: end.max(selection.end) },
                    selection_range: selection,
                    children: None,
                }
            })
            .collect()
    }

    pub fn folds(&self, uri: &lsp::Uri) -> Vec<lsp::FoldingRange> {
        let Some(document) = self.documents.get(uri) else { return Vec::new() };
        let scan = gr_gcode::scan(&document.text, document.dialect);
        let folds = gr_ide::folds(&scan).into_iter();
        folds.map(|f| lsp::FoldingRange { start_line: f.first, end_line: f.last, ..lsp::FoldingRange::default() }).collect()
    }

    pub fn format(&self, uri: &lsp::Uri) -> Option<Vec<lsp::TextEdit>> {
        let document = self.documents.get(uri)?;
        let scan = gr_gcode::scan(&document.text, document.dialect);
        let new = gr_gcode::format(&document.text, &scan, document.dialect, &FormatOptions::default());
        if new == document.text {
            return Some(Vec::new());
        }
        let lines = Lines::new(&document.text, self.utf8);
        let whole = Span::new(0, document.text.len() as u32);
        Some(vec![lsp::TextEdit { range: lines.range(whole), new_text: new }])
    }
}

fn path_of(uri: &lsp::Uri) -> PathBuf {
    uri.to_file_path().map_or_else(|| PathBuf::from(uri.as_str()), |p| p.into_owned())
}

/// The dialect that an extension suggests.
fn dialect_of(path: &Path) -> &'static Dialect {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    Dialect::all().iter().find(|d| d.extensions.contains(&extension.as_str())).unwrap_or_else(|| Dialect::linuxcnc())
}
