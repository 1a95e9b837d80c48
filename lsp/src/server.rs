//! The handlers: each puts a message on the queue before it waits for anything, so that the queue has the order of the
//! client.

use std::future::Future as _;
use std::path::PathBuf;
use std::sync::mpsc::{Sender, channel};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::task::Poll;

use serde_json::{Value, json};
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::sync::{mpsc, oneshot};
use tower_lsp::jsonrpc::{Error, ErrorCode, Result};
use tower_lsp::ls_types as lsp;
use tower_lsp::{Client, LanguageServer, LspService, Server};

use crate::analysis::{Analysis, Event, Message};
use crate::documents::{Kind, OpenFile, Versions, View};
use crate::features::{self, Answer, Failure};
use crate::frames::BigTexts;
use crate::host::Host;
use crate::protocol::custom;
use crate::settings::Settings;
use crate::text::{Columns, Text};
use crate::workspace::Workspace;

/// What the client can do.
#[derive(Clone, Copy, Default)]
struct Abilities {
    configuration: bool,
    watching: bool,
    progress: bool,
    hint_refresh: bool,
    lens_refresh: bool,
    diagnostic_refresh: bool,
    pulls: bool,
    /// Of code actions, what they do.
    resolves: bool,
    snippets: bool,
    pages: bool,
    /// An edit may say which version of a document it is for.
    versions: bool,
    /// An edit may rename files.
    moves_files: bool,
}

impl Abilities {
    /// An edit in the form that the client knows.
    fn edit(self, edit: lsp::WorkspaceEdit, versions: &Versions) -> lsp::WorkspaceEdit {
        if self.versions { features::versioned(edit, versions) } else { edit }
    }
    /// The same of what an action does.
    fn action(self, action: lsp::CodeAction, versions: &Versions) -> lsp::CodeAction {
        lsp::CodeAction { edit: action.edit.map(|e| self.edit(e, versions)), ..action }
    }
}

#[derive(Clone)]
struct Backend {
    queue: Sender<Message>,
    client: Client,
    abilities: Arc<Mutex<Abilities>>,
    /// What was wrong with the settings when they were read last.
    mistakes: Arc<Mutex<Vec<String>>>,
    /// The client said `shutdown`.
    goodbye: Arc<AtomicBool>,
    /// Folders that are open.
    folders: Arc<Mutex<Vec<lsp::Uri>>>,
    /// One asks for settings at a time: an older answer must not come last.
    asking: Arc<tokio::sync::Mutex<()>>,
    /// Texts of big documents on their way here.
    texts: Arc<BigTexts>,
}

/// The text of an answer that was overtaken.
const OVERTAKEN: &str = "the text changed meanwhile";

fn overtaken() -> Error {
    Error { code: ErrorCode::ContentModified, message: OVERTAKEN.into(), data: None }
}

/// A request that somebody waits for. When it is given up, the worker is told.
#[derive(Default)]
struct Waiting(Arc<Mutex<Option<gr_driver::Canceller>>>);

impl Drop for Waiting {
    fn drop(&mut self) {
        if let Some(running) = self.0.lock().unwrap_or_else(PoisonError::into_inner).take() {
            running.cancel();
        }
    }
}

impl Backend {
    fn new(client: Client, host: Arc<dyn Host>, goodbye: Arc<AtomicBool>, texts: Arc<BigTexts>) -> Backend {
        let (queue, inbox) = channel();
        let (publish, outbox) = mpsc::unbounded_channel::<Event>();
        let own = queue.clone();
        std::thread::spawn(move || {
            Analysis::new(host, own).serve(&inbox, &move |e| {
                let _ = publish.send(e);
            });
        });
        let abilities: Arc<Mutex<Abilities>> = Arc::default();
        tokio::spawn(speak(client.clone(), abilities.clone(), outbox));
        Backend { queue, client, abilities, mistakes: Arc::default(), goodbye, folders: Arc::default(), asking: Arc::default(), texts }
    }

    fn tell(&self, message: Message) {
        // The thread lives as long as the server; when it is gone there is nobody left to tell.
        let _ = self.queue.send(message);
    }

    fn abilities(&self) -> Abilities {
        *self.abilities.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Asks about a document on a worker. `None`: it is not open.
    async fn ask<T: Send + 'static>(&self, uri: lsp::Uri, work: impl FnOnce(View) -> Answer<T> + Send + 'static) -> Result<Option<T>> {
        let (send, receive) = oneshot::channel();
        let waiting = Waiting::default();
        let running = waiting.0.clone();
        self.tell(Message::Ask {
            uri,
            work: Box::new(move |view| {
                *running.lock().unwrap_or_else(PoisonError::into_inner) = view.as_ref().and_then(View::canceller);
                // Nobody waits any more when the request was cancelled.
                if !send.is_closed() {
                    // The tables of an exchange file are made of a whole text: not of one that is outdated already.
                    let late = view.as_ref().is_some_and(|v| matches!(v.kind, Kind::Exchange) && v.is_overtaken());
                    let _ = send.send(if late { Err(Failure::Overtaken) } else { view.map(work).transpose() });
                }
            }),
        });
        // A worker that failed has dropped the sender.
        match receive.await.map_err(|_| Error::internal_error())? {
            Ok(answer) => Ok(answer),
            Err(Failure::Overtaken) => Err(overtaken()),
            Err(f @ Failure::Refused(_)) => Err(Error { code: ErrorCode::ServerError(-32803), message: features::refusal(&f).into(), data: None }),
        }
    }

    /// As [`Backend::ask`], tried again when an edit or new settings overtook it: for all that only looks.
    async fn ask_again<T: Send + 'static>(&self, uri: lsp::Uri, work: impl Fn(View) -> Answer<T> + Send + Clone + 'static) -> Result<Option<T>> {
        for _ in 0..3 {
            match self.ask(uri.clone(), work.clone()).await {
                Err(e) if e.code == ErrorCode::ContentModified => {}
                other => return other,
            }
        }
        Err(overtaken())
    }

    /// Settings of the client, if it lets itself be asked: those of each folder where there are several.
    async fn pull_settings(&self) {
        if !self.abilities().configuration {
            return;
        }
        let _turn = self.asking.lock().await;
        let folders = self.folders.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let several = if folders.len() > 1 { folders } else { Vec::new() };
        let scopes = std::iter::once(None).chain(several.iter().cloned().map(Some));
        let items = scopes.map(|scope_uri| lsp::ConfigurationItem { scope_uri, section: Some("gccRobot".into()) }).collect();
        let Ok(values) = self.client.configuration(items).await else { return };
        let mut values = values.into_iter();
        if let Some(value) = values.next().filter(|v| !v.is_null()) {
            self.settings(&value).await;
        }
        let of_folders = several.iter().zip(values).filter(|(_, v)| !v.is_null());
        let of_folders = of_folders.filter_map(|(uri, value)| Some((folder(uri)?, Settings::read(&value).settings))).collect();
        self.tell(Message::FolderSettings(of_folders));
    }

    async fn settings(&self, value: &Value) {
        let read = Settings::read(value);
        self.tell(Message::Settings(Box::new(read.settings)));
        let known = std::mem::replace(&mut *self.mistakes.lock().unwrap_or_else(PoisonError::into_inner), read.mistakes.clone());
        // Clients send all settings again when one changes: the same mistakes are told once.
        let new: Vec<String> = read.mistakes.into_iter().filter(|m| !known.contains(m)).collect();
        if !new.is_empty() {
            self.client.show_message(lsp::MessageType::WARNING, format!("gcc-robot settings: {}", new.join("; "))).await;
        }
    }

    async fn watch(&self) {
        if !self.abilities().watching {
            return;
        }
        let globs = ["**/gcc-robot.toml", "**/*.{tbl,var,ini,inc,toml}", "**/*.{ngc,nc,tap,cnc,g}", "**/*.{p21,stpnc,stp,step}"];
        let options = json!({ "watchers": globs.map(|g| json!({ "globPattern": g })) });
        let registration = lsp::Registration {
            id: "gcc-robot/files".into(),
            method: "workspace/didChangeWatchedFiles".into(),
            register_options: Some(options),
        };
        let _ = self.client.register_capability(vec![registration]).await;
    }
}

/// What goes to the client without being asked for, in order.
async fn speak(client: Client, abilities: Arc<Mutex<Abilities>>, mut outbox: mpsc::UnboundedReceiver<Event>) {
    let can = || *abilities.lock().unwrap_or_else(PoisonError::into_inner);
    let mut busy: Vec<(lsp::Uri, lsp::ProgressToken)> = Vec::new();
    let mut count = 0;
    while let Some(event) = outbox.recv().await {
        match event {
            Event::Diagnostics { uri, version, diagnostics, open } => {
                // A client that asks for diagnostics itself would show those of open documents twice.
                if !(open && can().pulls) {
                    client.publish_diagnostics(uri, diagnostics, version).await;
                }
            }
            Event::Analysed { uri, version } => {
                let uri = uri.as_str().to_string();
                client.send_notification::<custom::AnalysedNotification>(custom::Analysed { uri, version }).await;
            }
            Event::Busy { uri, begins: true } if can().progress => {
                count += 1;
                let token = lsp::ProgressToken::String(format!("gcc-robot/{count}"));
                busy.push((uri.clone(), token.clone()));
                let client = client.clone();
                // The client's answer must not hold up diagnostics.
                tokio::spawn(async move {
                    let name = uri.path().as_str().rsplit('/').next().unwrap_or("").to_string();
                    if client.create_work_done_progress(token.clone()).await.is_ok() {
                        let begin = lsp::WorkDoneProgressBegin { title: format!("Running {name}"), cancellable: Some(false), ..Default::default() };
                        progress(&client, token, lsp::WorkDoneProgress::Begin(begin)).await;
                    }
                });
            }
            Event::Busy { uri, begins: false } => {
                if let Some(at) = busy.iter().position(|b| b.0 == uri) {
                    let (_, token) = busy.remove(at);
                    progress(&client, token, lsp::WorkDoneProgress::End(lsp::WorkDoneProgressEnd::default())).await;
                }
            }
            Event::Busy { .. } => {}
            Event::Say(kind, text) => client.show_message(kind, text).await,
            Event::Refresh => {
                let (client, can) = (client.clone(), can());
                tokio::spawn(async move {
                    if can.hint_refresh {
                        let _ = client.inlay_hint_refresh().await;
                    }
                    if can.lens_refresh {
                        let _ = client.code_lens_refresh().await;
                    }
                    // Only who asks for diagnostics itself must be told to ask again.
                    if can.pulls && can.diagnostic_refresh {
                        let _ = client.workspace_diagnostic_refresh().await;
                    }
                });
            }
        }
    }
}

async fn progress(client: &Client, token: lsp::ProgressToken, value: lsp::WorkDoneProgress) {
    let params = lsp::ProgressParams { token, value: lsp::ProgressParamsValue::WorkDone(value) };
    client.send_notification::<lsp::notification::Progress>(params).await;
}

/// All open documents and folders: for questions that are about no document.
pub struct Everything {
    /// Columns of the client.
    pub columns: Columns,
    open: Vec<OpenFile>,
    workspace: Arc<Workspace>,
}

/// Outline of a file with its name and text.
type Outline = (lsp::Uri, Text, Vec<gr_ide::Item>);

fn outline_of_plan(text: &str) -> Vec<gr_ide::Item> {
    let tables = gr_p21::parse(text.as_bytes());
    gr_ide::p21::outline::outline(gr_ide::p21::Doc { text: text.as_bytes(), file: &tables, units: gr_ide::p21::Units::default() })
}

impl Everything {
    /// Outlines of all programs and plans, open ones first.
    pub fn outlines(&self) -> Vec<Outline> {
        let mut found = Vec::new();
        for open in &self.open {
            let items = match open.kind {
                Kind::Gcode(_, dialect) => {
                    let file = gr_driver::scan_file("", &open.text.to_string(), dialect);
                    gr_ide::gcode::outline::outline(gr_ide::gcode::Doc { file: &file, dialect })
                }
                Kind::Exchange => {
                    outline_of_plan(&open.text.to_string())
                }
                _ => continue,
            };
            found.push((open.uri.clone(), (*open.text).clone(), items));
        }
        let dialect = gr_spec::Dialect::linuxcnc();
        for path in self.workspace.programs_and_plans() {
            if self.open.iter().any(|o| o.path == path) {
                continue;
            }
            if let (Some(text), Some(uri)) = (self.workspace.plan(&path), lsp::Uri::from_file_path(&path)) {
                let items = outline_of_plan(&text);
                found.push((uri, Text::new(&text), items));
            } else if let (Some(file), Some(uri)) = (self.workspace.file(&path, dialect), lsp::Uri::from_file_path(&path)) {
                let doc = gr_ide::gcode::Doc { file: &file, dialect };
                found.push((uri, Text::new(&doc.text()), gr_ide::gcode::outline::outline(doc)));
            }
        }
        found
    }
}

fn capabilities(utf8: bool, pulls: bool) -> lsp::ServerCapabilities {
    let value = json!({
        "positionEncoding": if utf8 { "utf-8" } else { "utf-16" },
        "textDocumentSync": { "openClose": true, "change": 2, "save": { "includeText": false } },
        "hoverProvider": true,
        "completionProvider": { "triggerCharacters": ["#", "<", "[", "=", "(", ",", ".", "\""], "resolveProvider": false },
        "signatureHelpProvider": { "triggerCharacters": [" ", "[", "(", ","], "retriggerCharacters": ["]"] },
        "definitionProvider": true,
        "referencesProvider": true,
        "documentHighlightProvider": true,
        "documentSymbolProvider": true,
        "workspaceSymbolProvider": true,
        "codeActionProvider": { "codeActionKinds": ["quickfix", "refactor.rewrite", "refactor.inline", "source"], "resolveProvider": true },
        "codeLensProvider": { "resolveProvider": false },
        "documentFormattingProvider": true,
        "documentRangeFormattingProvider": true,
        "documentOnTypeFormattingProvider": { "firstTriggerCharacter": "\n" },
        "renameProvider": { "prepareProvider": true },
        "documentLinkProvider": { "resolveProvider": false },
        "foldingRangeProvider": true,
        "selectionRangeProvider": true,
        "callHierarchyProvider": true,
        "linkedEditingRangeProvider": true,
        "inlayHintProvider": { "resolveProvider": false },
        "diagnosticProvider": { "identifier": "gcc-robot", "interFileDependencies": true, "workspaceDiagnostics": pulls },
        "workspace": { "workspaceFolders": { "supported": true, "changeNotifications": true } },
        "semanticTokensProvider": { "legend": features::legend(), "range": true, "full": { "delta": true } },
        "experimental": { "gccRobot": ["preview", "output", "state", "targets", "explain", "buildOptions"] },
    });
    serde_json::from_value(value).unwrap_or_default()
}

fn folder(uri: &lsp::Uri) -> Option<PathBuf> {
    uri.to_file_path().map(|p| p.into_owned())
}

impl LanguageServer for Backend {
    async fn initialize(&self, params: lsp::InitializeParams) -> Result<lsp::InitializeResult> {
        let wire = serde_json::to_value(&params.capabilities).unwrap_or_default();
        let can = |path: &str| wire.pointer(path).and_then(Value::as_bool).unwrap_or(false);
        let offered = params.capabilities.general.and_then(|g| g.position_encodings).unwrap_or_default();
        let utf8 = offered.contains(&lsp::PositionEncodingKind::UTF8);
        let watching = can("/workspace/didChangeWatchedFiles/dynamicRegistration");
        self.tell(Message::Client { columns: if utf8 { Columns::Utf8 } else { Columns::Utf16 }, watching });
        let options = params.initialization_options.unwrap_or_default();
        let pulls = options.get("pullDiagnostics").and_then(Value::as_bool).unwrap_or(false);
        *self.abilities.lock().unwrap_or_else(PoisonError::into_inner) = Abilities {
            configuration: can("/workspace/configuration"),
            watching,
            progress: can("/window/workDoneProgress"),
            hint_refresh: can("/workspace/inlayHint/refreshSupport"),
            lens_refresh: can("/workspace/codeLens/refreshSupport"),
            diagnostic_refresh: can("/workspace/diagnostics/refreshSupport") || can("/workspace/diagnostic/refreshSupport"),
            pulls,
            resolves: wire.pointer("/textDocument/codeAction/resolveSupport/properties").and_then(Value::as_array).is_some_and(|p| p.iter().any(|p| p == "edit"))
                && can("/textDocument/codeAction/dataSupport"),
            pages: options.get("explainPages").and_then(Value::as_bool).unwrap_or(false),
            snippets: can("/textDocument/completion/completionItem/snippetSupport"),
            versions: can("/workspace/workspaceEdit/documentChanges"),
            moves_files: can("/workspace/workspaceEdit/documentChanges")
                && wire.pointer("/workspace/workspaceEdit/resourceOperations").and_then(Value::as_array).is_some_and(|o| o.iter().any(|o| o == "rename")),
        };
        let folders = params.workspace_folders.unwrap_or_default();
        *self.folders.lock().unwrap_or_else(PoisonError::into_inner) = folders.iter().map(|f| f.uri.clone()).collect();
        let mut added: Vec<PathBuf> = folders.iter().filter_map(|f| folder(&f.uri)).collect();
        #[allow(deprecated, reason = "clients that know no folders send this")]
        if added.is_empty() {
            added.extend(params.root_uri.as_ref().and_then(folder));
        }
        self.tell(Message::Folders { added, removed: Vec::new() });
        self.settings(&options).await;
        Ok(lsp::InitializeResult {
            capabilities: capabilities(utf8, pulls),
            server_info: Some(lsp::ServerInfo { name: "gcc-robot".into(), version: Some(env!("CARGO_PKG_VERSION").into()) }),
            ..lsp::InitializeResult::default()
        })
    }

    async fn initialized(&self, _: lsp::InitializedParams) {
        // Not waited for: a client that leaves at once never answers.
        let own = self.clone();
        tokio::spawn(async move {
            own.pull_settings().await;
            own.watch().await;
        });
    }

    async fn shutdown(&self) -> Result<()> {
        self.goodbye.store(true, Ordering::Relaxed);
        Ok(())
    }

    async fn did_open(&self, p: lsp::DidOpenTextDocumentParams) {
        let d = p.text_document;
        let text = self.texts.take(&d.text).unwrap_or(d.text).into();
        self.tell(Message::Open { uri: d.uri, language: d.language_id, version: d.version, text });
    }
    async fn did_change(&self, p: lsp::DidChangeTextDocumentParams) {
        self.tell(Message::Change { uri: p.text_document.uri, version: p.text_document.version, changes: p.content_changes });
    }
    async fn did_close(&self, p: lsp::DidCloseTextDocumentParams) {
        self.tell(Message::Close { uri: p.text_document.uri });
    }
    async fn did_save(&self, p: lsp::DidSaveTextDocumentParams) {
        self.tell(Message::Disk { paths: folder(&p.text_document.uri).into_iter().collect() });
    }
    async fn did_change_watched_files(&self, p: lsp::DidChangeWatchedFilesParams) {
        self.tell(Message::Disk { paths: p.changes.iter().filter_map(|c| folder(&c.uri)).collect() });
    }
    async fn did_change_configuration(&self, p: lsp::DidChangeConfigurationParams) {
        if self.abilities().configuration {
            let own = self.clone();
            tokio::spawn(async move { own.pull_settings().await });
        } else {
            self.settings(&p.settings).await;
        }
    }
    async fn did_change_workspace_folders(&self, p: lsp::DidChangeWorkspaceFoldersParams) {
        let paths = |list: &[lsp::WorkspaceFolder]| list.iter().filter_map(|f| folder(&f.uri)).collect();
        self.tell(Message::Folders { added: paths(&p.event.added), removed: paths(&p.event.removed) });
        let mut folders = self.folders.lock().unwrap_or_else(PoisonError::into_inner);
        folders.retain(|f| p.event.removed.iter().all(|r| r.uri != *f));
        folders.extend(p.event.added.iter().map(|f| f.uri.clone()));
        drop(folders);
        let own = self.clone();
        tokio::spawn(async move { own.pull_settings().await });
    }

    async fn hover(&self, p: lsp::HoverParams) -> Result<Option<lsp::Hover>> {
        let at = p.text_document_position_params;
        self.ask_again(at.text_document.uri, move |v| features::hover(v, at.position)).await.map(Option::flatten)
    }
    async fn completion(&self, p: lsp::CompletionParams) -> Result<Option<lsp::CompletionResponse>> {
        let at = p.text_document_position;
        let snippets = self.abilities().snippets;
        let list = self.ask_again(at.text_document.uri, move |v| features::completion(v, at.position, snippets)).await?;
        Ok(list.map(lsp::CompletionResponse::List))
    }
    async fn signature_help(&self, p: lsp::SignatureHelpParams) -> Result<Option<lsp::SignatureHelp>> {
        let at = p.text_document_position_params;
        self.ask_again(at.text_document.uri, move |v| features::signature(v, at.position)).await.map(Option::flatten)
    }
    async fn goto_definition(&self, p: lsp::GotoDefinitionParams) -> Result<Option<lsp::GotoDefinitionResponse>> {
        let at = p.text_document_position_params;
        let pages = self.abilities().pages;
        let found = self.ask_again(at.text_document.uri, move |v| features::definition(v, at.position, pages)).await?;
        Ok(found.map(lsp::GotoDefinitionResponse::Array))
    }
    async fn references(&self, p: lsp::ReferenceParams) -> Result<Option<Vec<lsp::Location>>> {
        let at = p.text_document_position;
        let declaration = p.context.include_declaration;
        self.ask_again(at.text_document.uri, move |v| features::references(v, at.position, declaration)).await
    }
    async fn document_highlight(&self, p: lsp::DocumentHighlightParams) -> Result<Option<Vec<lsp::DocumentHighlight>>> {
        let at = p.text_document_position_params;
        self.ask_again(at.text_document.uri, move |v| features::highlights(v, at.position)).await
    }
    async fn document_symbol(&self, p: lsp::DocumentSymbolParams) -> Result<Option<lsp::DocumentSymbolResponse>> {
        let symbols = self.ask_again(p.text_document.uri, features::symbols).await?;
        Ok(symbols.map(lsp::DocumentSymbolResponse::Nested))
    }
    async fn symbol(&self, p: lsp::WorkspaceSymbolParams) -> Result<Option<lsp::WorkspaceSymbolResponse>> {
        let (send, receive) = oneshot::channel();
        self.tell(Message::AskAll {
            work: Box::new(move |a| {
                let _ = send.send(Everything { columns: a.columns(), open: a.open_files(), workspace: a.workspace().clone() });
            }),
        });
        let all = receive.await.map_err(|_| Error::internal_error())?;
        let found = tokio::task::spawn_blocking(move || features::workspace_symbols(&all, &p.query)).await;
        Ok(Some(lsp::WorkspaceSymbolResponse::Nested(found.map_err(|_| Error::internal_error())?)))
    }
    async fn code_action(&self, p: lsp::CodeActionParams) -> Result<Option<lsp::CodeActionResponse>> {
        let (range, only, able) = (p.range, p.context.only, self.abilities());
        let work = move |v: View| {
            let versions = v.versions();
            let found = features::actions(v, range, only.as_deref(), able.resolves)?;
            Ok(found.into_iter().map(|a| able.action(a, &versions)).collect::<Vec<_>>())
        };
        let found = self.ask_again(p.text_document.uri, work).await?;
        Ok(found.map(|f| f.into_iter().map(lsp::CodeActionOrCommand::CodeAction).collect()))
    }
    async fn code_action_resolve(&self, p: lsp::CodeAction) -> Result<lsp::CodeAction> {
        let uri = p.data.as_ref().and_then(|d| serde_json::from_value::<lsp::Uri>(d.get("uri")?.clone()).ok());
        let Some(uri) = uri else { return Ok(p) };
        let (unknown, able) = (p.clone(), self.abilities());
        let work = move |v: View| {
            let versions = v.versions();
            Ok(able.action(features::resolve(v, p)?, &versions))
        };
        Ok(self.ask(uri, work).await?.unwrap_or(unknown))
    }
    async fn code_lens(&self, p: lsp::CodeLensParams) -> Result<Option<Vec<lsp::CodeLens>>> {
        self.ask_again(p.text_document.uri, features::lenses).await
    }
    async fn document_link(&self, p: lsp::DocumentLinkParams) -> Result<Option<Vec<lsp::DocumentLink>>> {
        self.ask_again(p.text_document.uri, features::links).await
    }
    async fn folding_range(&self, p: lsp::FoldingRangeParams) -> Result<Option<Vec<lsp::FoldingRange>>> {
        self.ask_again(p.text_document.uri, features::folds).await
    }
    async fn selection_range(&self, p: lsp::SelectionRangeParams) -> Result<Option<Vec<lsp::SelectionRange>>> {
        let at = p.positions;
        self.ask_again(p.text_document.uri, move |v| features::selections(v, &at)).await
    }
    async fn formatting(&self, p: lsp::DocumentFormattingParams) -> Result<Option<Vec<lsp::TextEdit>>> {
        self.ask(p.text_document.uri, move |v| features::format(v, None, &p.options)).await
    }
    async fn range_formatting(&self, p: lsp::DocumentRangeFormattingParams) -> Result<Option<Vec<lsp::TextEdit>>> {
        self.ask(p.text_document.uri, move |v| features::format(v, Some(p.range), &p.options)).await
    }
    async fn on_type_formatting(&self, p: lsp::DocumentOnTypeFormattingParams) -> Result<Option<Vec<lsp::TextEdit>>> {
        let at = p.text_document_position;
        self.ask(at.text_document.uri, move |v| features::on_type(v, at.position, &p.ch, &p.options)).await
    }
    async fn prepare_rename(&self, p: lsp::TextDocumentPositionParams) -> Result<Option<lsp::PrepareRenameResponse>> {
        self.ask(p.text_document.uri, move |v| features::prepare_rename(v, p.position)).await.map(Option::flatten)
    }
    async fn rename(&self, p: lsp::RenameParams) -> Result<Option<lsp::WorkspaceEdit>> {
        let at = p.text_document_position;
        let able = self.abilities();
        let work = move |v: View| {
            let versions = v.versions();
            Ok(features::rename(v, at.position, &p.new_name, able.moves_files)?.map(|e| able.edit(e, &versions)))
        };
        self.ask(at.text_document.uri, work).await.map(Option::flatten)
    }
    async fn linked_editing_range(&self, p: lsp::LinkedEditingRangeParams) -> Result<Option<lsp::LinkedEditingRanges>> {
        let at = p.text_document_position_params;
        self.ask_again(at.text_document.uri, move |v| features::linked(v, at.position)).await.map(Option::flatten)
    }
    async fn prepare_call_hierarchy(&self, p: lsp::CallHierarchyPrepareParams) -> Result<Option<Vec<lsp::CallHierarchyItem>>> {
        let at = p.text_document_position_params;
        self.ask_again(at.text_document.uri, move |v| features::prepare_calls(v, at.position)).await
    }
    async fn incoming_calls(&self, p: lsp::CallHierarchyIncomingCallsParams) -> Result<Option<Vec<lsp::CallHierarchyIncomingCall>>> {
        let item = p.item;
        self.ask_again(item.uri.clone(), move |v| features::incoming(v, &item)).await
    }
    async fn outgoing_calls(&self, p: lsp::CallHierarchyOutgoingCallsParams) -> Result<Option<Vec<lsp::CallHierarchyOutgoingCall>>> {
        let item = p.item;
        self.ask_again(item.uri.clone(), move |v| features::outgoing(v, &item)).await
    }
    async fn inlay_hint(&self, p: lsp::InlayHintParams) -> Result<Option<Vec<lsp::InlayHint>>> {
        self.ask_again(p.text_document.uri, move |v| features::hints(v, p.range)).await
    }
    async fn semantic_tokens_full(&self, p: lsp::SemanticTokensParams) -> Result<Option<lsp::SemanticTokensResult>> {
        let found = self.ask_again(p.text_document.uri, |v| features::all_tokens(v, None)).await?;
        Ok(found.map(|(id, data, _)| {
            lsp::SemanticTokensResult::Tokens(lsp::SemanticTokens { result_id: Some(id), data: data.to_vec() })
        }))
    }
    async fn semantic_tokens_full_delta(&self, p: lsp::SemanticTokensDeltaParams) -> Result<Option<lsp::SemanticTokensFullDeltaResult>> {
        let have = p.previous_result_id;
        let found = self.ask_again(p.text_document.uri, move |v| features::all_tokens(v, Some(have.clone()))).await?;
        Ok(found.map(|(id, data, edits)| match edits {
            Some(edits) => lsp::SemanticTokensFullDeltaResult::TokensDelta(lsp::SemanticTokensDelta { result_id: Some(id), edits }),
            None => lsp::SemanticTokensFullDeltaResult::Tokens(lsp::SemanticTokens { result_id: Some(id), data: data.to_vec() }),
        }))
    }
    async fn semantic_tokens_range(&self, p: lsp::SemanticTokensRangeParams) -> Result<Option<lsp::SemanticTokensRangeResult>> {
        let found = self.ask_again(p.text_document.uri, move |v| features::tokens(v, Some(p.range)).map(|t| t.1)).await?;
        Ok(found.map(|data| lsp::SemanticTokensRangeResult::Tokens(lsp::SemanticTokens { result_id: None, data: data.to_vec() })))
    }
    async fn diagnostic(&self, p: lsp::DocumentDiagnosticParams) -> Result<lsp::DocumentDiagnosticReportResult> {
        let have = p.previous_result_id;
        let found = self.ask_again(p.text_document.uri, features::pulled).await?;
        let (id, items) = found.unwrap_or_default();
        let report = if have.as_deref() == Some(id.as_str()) && !id.is_empty() {
            lsp::DocumentDiagnosticReport::Unchanged(lsp::RelatedUnchangedDocumentDiagnosticReport {
                related_documents: None,
                unchanged_document_diagnostic_report: lsp::UnchangedDocumentDiagnosticReport { result_id: id },
            })
        } else {
            lsp::DocumentDiagnosticReport::Full(lsp::RelatedFullDocumentDiagnosticReport {
                related_documents: None,
                full_document_diagnostic_report: lsp::FullDocumentDiagnosticReport { result_id: Some(id), items },
            })
        };
        Ok(lsp::DocumentDiagnosticReportResult::Report(report))
    }
    async fn workspace_diagnostic(&self, p: lsp::WorkspaceDiagnosticParams) -> Result<lsp::WorkspaceDiagnosticReportResult> {
        let (send, receive) = oneshot::channel();
        let known = p.previous_result_ids.into_iter().map(|k| (k.uri, k.value)).collect();
        self.tell(Message::AskClosed {
            known,
            work: Box::new(move |items| {
                let _ = send.send(items);
            }),
        });
        let items = receive.await.map_err(|_| Error::internal_error())?;
        Ok(lsp::WorkspaceDiagnosticReportResult::Report(lsp::WorkspaceDiagnosticReport { items }))
    }
}

impl Backend {
    async fn preview(&self, p: custom::PreviewParams) -> Result<Option<Value>> {
        self.ask_again(p.text_document.uri.clone(), move |v| features::preview(v, &p)).await
    }
    async fn output(&self, p: custom::OutputParams) -> Result<Option<custom::Output>> {
        self.ask_again(p.text_document.uri.clone(), move |v| features::output(v, &p)).await
    }
    async fn build_options(&self, p: custom::DocumentParams) -> Result<Option<custom::BuildOptions>> {
        self.ask_again(p.text_document.uri, features::build_options).await
    }
    async fn state(&self, p: custom::StateParams) -> Result<Option<custom::State>> {
        self.ask_again(p.text_document.uri, move |v| features::state(v, p.position)).await
    }
    async fn targets(&self) -> Result<custom::Choices> {
        Ok(features::choices())
    }
    async fn explain(&self, p: custom::ExplainParams) -> Result<custom::Explanation> {
        Ok(features::explain(&p.code, p.dialect.as_deref()))
    }
}

/// A client that is gone gets the answers that are ready within this time.
const GRACE: std::time::Duration = std::time::Duration::from_secs(2);

/// Serves one client on any pair of streams. Whether it said goodbye (`shutdown`) before it left.
pub async fn serve(input: impl AsyncRead + Unpin + Send + 'static, output: impl AsyncWrite, host: Arc<dyn Host>) -> bool {
    let (clean, input_of_server) = tokio::io::duplex(1 << 20);
    let texts: Arc<BigTexts> = Arc::default();
    let reading = tokio::spawn(crate::frames::filter(input, clean, texts.clone()));
    let input = input_of_server;
    let goodbye: Arc<AtomicBool> = Arc::default();
    let said = goodbye.clone();
    let (service, socket) = LspService::build(move |client| Backend::new(client, host, said, texts))
        .custom_method("gccRobot/preview", Backend::preview)
        .custom_method("gccRobot/output", Backend::output)
        .custom_method("gccRobot/state", Backend::state)
        .custom_method("gccRobot/targets", Backend::targets)
        .custom_method("gccRobot/explain", Backend::explain)
        .custom_method("gccRobot/buildOptions", Backend::build_options)
        .finish();
    let serving = Server::new(input, output, socket).concurrency_level(16).serve(service);
    let gone = async {
        let _ = reading.await;
        tokio::time::sleep(GRACE).await;
    };
    let (mut serving, mut gone) = (std::pin::pin!(serving), std::pin::pin!(gone));
    std::future::poll_fn(|cx| match (serving.as_mut().poll(cx), gone.as_mut().poll(cx)) {
        (Poll::Pending, Poll::Pending) => Poll::Pending,
        _ => Poll::Ready(()),
    })
    .await;
    goodbye.load(Ordering::Relaxed)
}
