//! A client of `gcc-robot lsp` on its standard input and output, and ways to show answers as text.

use std::collections::BTreeMap;
use std::io::{BufReader, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use serde_json::{Value, json};

/// Longest wait for an answer.
const PATIENCE: Duration = Duration::from_secs(60);

/// A running server and a folder of files.
pub struct Client {
    child: Child,
    to: Option<ChildStdin>,
    from: Receiver<Value>,
    pub folder: tempfile::TempDir,
    next: i64,
    versions: BTreeMap<String, i64>,
    texts: BTreeMap<String, String>,
    pub settings: Value,
    /// Settings of folders.
    pub scoped: BTreeMap<String, Value>,
    /// Diagnostics that came in, by document: version and list.
    pub found: BTreeMap<String, (i64, Value)>,
    /// Requests of the server that came in.
    pub asked: Vec<String>,
    /// What the user was shown.
    pub said: Vec<String>,
    pub capabilities: Value,
}

impl Client {
    /// Files of the workspace, and settings.
    pub fn new(files: &[(&str, &str)], settings: Value) -> Client {
        Client::with(files, settings, json!({}))
    }

    /// … and further capabilities of the client.
    pub fn with(files: &[(&str, &str)], settings: Value, general: Value) -> Client {
        Client::made(files, settings, general, false, false)
    }

    /// A client that can nothing but the protocol's first version.
    pub fn bare(files: &[(&str, &str)]) -> Client {
        Client::made(files, json!({}), json!({}), false, true)
    }

    /// A client that asks for diagnostics itself.
    pub fn pulling(files: &[(&str, &str)]) -> Client {
        Client::made(files, json!({}), json!({}), true, false)
    }

    fn made(files: &[(&str, &str)], settings: Value, general: Value, pulls: bool, bare: bool) -> Client {
        let folder = tempfile::tempdir().expect("a folder");
        for (name, text) in files {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().expect("a folder")).expect("made");
            std::fs::write(path, text).expect("written");
        }
        let mut child = Command::new(env!("CARGO_BIN_EXE_gcc-robot"))
            .arg("lsp")
            // Where the server is started says nothing about the programs.
            .current_dir(std::env::temp_dir())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("the server starts");
        let to = child.stdin.take().expect("a pipe");
        let mut out = BufReader::new(child.stdout.take().expect("a pipe"));
        let (send, from) = channel();
        std::thread::spawn(move || {
            while let Some(message) = read(&mut out) {
                if send.send(message).is_err() {
                    return;
                }
            }
        });
        let mut c = Client {
            child,
            to: Some(to),
            from,
            folder,
            next: 0,
            versions: BTreeMap::new(),
            texts: BTreeMap::new(),
            settings,
            scoped: BTreeMap::new(),
            found: BTreeMap::new(),
            asked: Vec::new(),
            said: Vec::new(),
            capabilities: Value::Null,
        };
        let root = c.uri("");
        let operations = if general["noFiles"] == true { json!([]) } else { json!(["create", "rename", "delete"]) };
        let mut options = c.settings.clone();
        options["pullDiagnostics"] = pulls.into();
        options["explainPages"] = true.into();
        let mut hello = json!({
            "processId": null,
            "capabilities": {
                "general": general,
                "workspace": { "configuration": true, "workspaceEdit": { "documentChanges": true, "resourceOperations": operations }, "didChangeWatchedFiles": { "dynamicRegistration": true }, "inlayHint": { "refreshSupport": true }, "diagnostics": { "refreshSupport": true } },
                "textDocument": { "completion": { "completionItem": { "snippetSupport": true } }, "codeAction": { "dataSupport": true, "resolveSupport": { "properties": ["edit"] } } },
                "window": { "workDoneProgress": true },
            },
            "initializationOptions": options,
            "workspaceFolders": [{ "uri": root.trim_end_matches('/'), "name": "parts" }],
        });
        if bare {
            hello["capabilities"] = json!({});
        }
        c.capabilities = c.request("initialize", hello)["capabilities"].clone();
        c.notify("initialized", json!({}));
        c
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }
    pub fn uri(&self, name: &str) -> String {
        format!("file://{}", self.path(name).display())
    }
    pub fn raw(&mut self, bytes: &[u8]) {
        let to = self.to.as_mut().expect("the server is there");
        to.write_all(bytes).expect("the server reads");
        to.flush().expect("flushed");
    }
    fn send(&mut self, mut message: Value) {
        message["jsonrpc"] = "2.0".into();
        let body = message.to_string();
        self.raw(format!("Content-Length: {}\r\n\r\n{body}", body.len()).as_bytes());
    }
    pub fn notify(&mut self, method: &str, params: Value) {
        self.send(json!({ "method": method, "params": params }));
    }
    /// Sends a request and does not wait: its number.
    pub fn begin(&mut self, method: &str, params: Value) -> i64 {
        self.next += 1;
        self.send(json!({ "id": self.next, "method": method, "params": params }));
        self.next
    }
    /// The answer to a request, `result` or `error` in it.
    pub fn answer(&mut self, id: i64) -> Value {
        loop {
            let m = self.receive();
            if m["id"] == id && m.get("method").is_none() {
                return m;
            }
            self.take(&m);
        }
    }
    pub fn request(&mut self, method: &str, params: Value) -> Value {
        let id = self.begin(method, params);
        let answer = self.answer(id);
        assert!(answer.get("error").is_none(), "{method}: {answer}");
        answer["result"].clone()
    }
    fn receive(&mut self) -> Value {
        self.from.recv_timeout(PATIENCE).expect("an answer in time")
    }
    /// Messages that are no answers.
    fn take(&mut self, m: &Value) {
        let method = m["method"].as_str().unwrap_or("").to_string();
        if method == "textDocument/publishDiagnostics" {
            let p = &m["params"];
            let uri = p["uri"].as_str().unwrap_or("").to_string();
            self.found.insert(uri, (p["version"].as_i64().unwrap_or(-1), p["diagnostics"].clone()));
        } else if method == "window/showMessage" {
            self.said.push(m["params"]["message"].as_str().unwrap_or("").to_string());
        } else if !m["id"].is_null() {
            let of = |item: &Value| item["scopeUri"].as_str().and_then(|s| self.scoped.get(s)).unwrap_or(&self.settings).clone();
            let items = m["params"]["items"].as_array().map(|l| l.iter().map(of).collect::<Vec<_>>());
            let result = if method == "workspace/configuration" { json!(items) } else { Value::Null };
            self.send(json!({ "id": m["id"], "result": result }));
        }
        self.asked.push(method);
    }
    /// Opens a document; the text is that of the file in the folder unless one is given.
    pub fn open(&mut self, name: &str, text: Option<&str>) -> String {
        let uri = self.uri(name);
        let text = text.map_or_else(|| std::fs::read_to_string(self.path(name)).expect("a file"), str::to_string);
        let language = match Path::new(name).extension().and_then(|e| e.to_str()) {
            Some("p21" | "stpnc") => "p21",
            Some("toml") => "toml",
            Some("ini" | "var") => "plaintext",
            _ => "gcode",
        };
        self.versions.insert(uri.clone(), 1);
        self.texts.insert(uri.clone(), text.clone());
        self.notify("textDocument/didOpen", json!({ "textDocument": { "uri": uri, "languageId": language, "version": 1, "text": text } }));
        uri
    }
    /// Replaces the first occurrence of some text, as an editor would.
    pub fn edit(&mut self, uri: &str, old: &str, new: &str) {
        let text = self.texts[uri].clone();
        let at = text.find(old).unwrap_or_else(|| panic!("{old} is not there"));
        let range = json!({ "start": position(&text, at), "end": position(&text, at + old.len()) });
        let new_text = text.replacen(old, new, 1);
        self.change(uri, json!([{ "range": range, "text": new }]), new_text);
    }
    /// Sends changes; `text` is what comes of them.
    pub fn change(&mut self, uri: &str, changes: Value, text: String) {
        let version = self.versions.get_mut(uri).expect("open");
        *version += 1;
        let version = *version;
        self.texts.insert(uri.to_string(), text);
        self.notify("textDocument/didChange", json!({ "textDocument": { "uri": uri, "version": version }, "contentChanges": changes }));
    }
    /// Diagnostics of the present version.
    pub fn diagnostics(&mut self, uri: &str) -> Vec<Value> {
        let version = self.versions[uri];
        while self.found.get(uri).is_none_or(|f| f.0 < version) {
            let m = self.receive();
            self.take(&m);
        }
        self.found[uri].1.as_array().cloned().unwrap_or_default()
    }
    /// Waits until the server has sent something.
    pub fn wait_for(&mut self, method: &str) {
        while !self.asked.iter().any(|m| m == method) {
            let m = self.receive();
            self.take(&m);
        }
    }
    /// Writes a file, and says so as a client that watches files does.
    pub fn write(&mut self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).expect("written");
        let uri = self.uri(name);
        self.notify("workspace/didChangeWatchedFiles", json!({ "changes": [{ "uri": uri, "type": 2 }] }));
    }
    /// The next diagnostics of a document, whatever version they are of.
    pub fn next_diagnostics(&mut self, uri: &str) -> Vec<Value> {
        self.found.remove(uri);
        while !self.found.contains_key(uri) {
            let m = self.receive();
            self.take(&m);
        }
        self.found[uri].1.as_array().cloned().unwrap_or_default()
    }
    pub fn text(&self, uri: &str) -> &str {
        &self.texts[uri]
    }
    /// Document and position of the first occurrence of a text, behind the part before `|`.
    pub fn at(&self, uri: &str, marked: &str) -> Value {
        json!({ "textDocument": { "uri": uri }, "position": self.position(uri, marked) })
    }
    pub fn position(&self, uri: &str, marked: &str) -> Value {
        let text = &self.texts[uri];
        let bare = marked.replace('|', "");
        let found = text.find(&bare).unwrap_or_else(|| panic!("{bare} is not in the text"));
        position(text, found + marked.find('|').unwrap_or(0))
    }
    pub fn hover(&mut self, uri: &str, marked: &str) -> String {
        let at = self.at(uri, marked);
        let h = self.request("textDocument/hover", at);
        h["contents"]["value"].as_str().unwrap_or("nothing").to_string()
    }
    pub fn labels(&mut self, uri: &str, marked: &str) -> Vec<String> {
        let at = self.at(uri, marked);
        let list = self.request("textDocument/completion", at);
        let mut items: Vec<&Value> = list["items"].as_array().map(|a| a.iter().collect()).unwrap_or_default();
        items.sort_by_key(|i| i["sortText"].as_str().unwrap_or("").to_string());
        items.iter().map(|i| i["label"].as_str().unwrap_or("").to_string()).collect()
    }
    /// The texts of locations, with file and line.
    pub fn places(&self, locations: &Value) -> Vec<String> {
        let list = locations.as_array().cloned().unwrap_or_default();
        let mut out: Vec<String> = list.iter().map(|l| self.place(l["uri"].as_str().unwrap_or(""), &l["range"])).collect();
        out.sort();
        out
    }
    pub fn place(&self, uri: &str, range: &Value) -> String {
        let name = uri.rsplit('/').next().unwrap_or("");
        let text = self.texts.get(uri).cloned().unwrap_or_else(|| std::fs::read_to_string(self.path(name)).unwrap_or_default());
        let (from, to) = (offset(&text, &range["start"]), offset(&text, &range["end"]));
        format!("{name}:{} {}", range["start"]["line"].as_u64().unwrap_or(0) + 1, &text[from..to.max(from)])
    }
    /// A text after the edits of a workspace edit.
    pub fn edited(&self, uri: &str, edit: &Value) -> String {
        apply(&self.texts[uri], &self.edits_of(uri, edit))
    }
    /// Edits of a document in a workspace edit; each is for the version that the client has.
    pub fn edits_of(&self, uri: &str, edit: &Value) -> Value {
        let Some(documents) = edit["documentChanges"].as_array() else { return edit["changes"][uri].clone() };
        let all: Vec<&Value> = documents.iter().filter(|d| d["textDocument"]["uri"] == uri).collect();
        assert!(all.len() < 2 && all.iter().all(|d| d["textDocument"]["version"].as_i64() == self.versions.get(uri).copied()), "{edit}");
        all.first().map_or(json!([]), |d| d["edits"].clone())
    }
    /// The files of the folder after a workspace edit: texts changed, files renamed.
    pub fn carried_out(&self, names: &[&str], edit: &Value) -> BTreeMap<String, String> {
        let text = |name: &&str| self.texts.get(&self.uri(name)).cloned().unwrap_or_else(|| std::fs::read_to_string(self.path(name)).expect("a file"));
        let mut files: BTreeMap<String, String> = names.iter().map(|n| (self.uri(n), text(n))).collect();
        for (uri, edits) in edit["changes"].as_object().into_iter().flatten() {
            let new = apply(&files[uri], edits);
            files.insert(uri.clone(), new);
        }
        for one in edit["documentChanges"].as_array().into_iter().flatten() {
            if one["kind"] == "rename" {
                let text = files.remove(one["oldUri"].as_str().expect("a name")).expect("a file");
                files.insert(one["newUri"].as_str().expect("a name").to_string(), text);
            } else {
                let uri = one["textDocument"]["uri"].as_str().expect("a name");
                let new = apply(&files[uri], &one["edits"]);
                files.insert(uri.to_string(), new);
            }
        }
        files.into_iter().map(|(uri, text)| (uri.rsplit('/').next().unwrap_or("").to_string(), text)).collect()
    }
    pub fn shut_down(mut self) {
        assert_eq!(self.request("shutdown", Value::Null), Value::Null);
        self.notify("exit", Value::Null);
        let status = self.child.wait().expect("it ends");
        assert!(status.success(), "{status}");
    }
    /// Goes away without a word: whether the server ends too, in time.
    pub fn hang_up(&mut self) -> bool {
        self.to = None;
        let start = std::time::Instant::now();
        while start.elapsed() < PATIENCE {
            if !self.lives() {
                return true;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        false
    }
    /// Whether the server still runs.
    pub fn lives(&mut self) -> bool {
        self.child.try_wait().ok().flatten().is_none()
    }
}

impl Drop for Client {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn read(out: &mut impl std::io::BufRead) -> Option<Value> {
    let mut length = 0;
    loop {
        let mut line = String::new();
        if out.read_line(&mut line).ok()? == 0 {
            return None;
        }
        let line = line.trim();
        if line.is_empty() {
            break;
        }
        if let Some(n) = line.strip_prefix("Content-Length: ") {
            length = n.parse().ok()?;
        }
    }
    let mut body = vec![0; length];
    out.read_exact(&mut body).ok()?;
    serde_json::from_slice(&body).ok()
}

/// Line and UTF-16 column of a byte.
pub fn position(text: &str, at: usize) -> Value {
    let line = text[..at].matches('\n').count();
    let start = text[..at].rfind('\n').map_or(0, |p| p + 1);
    json!({ "line": line, "character": text[start..at].encode_utf16().count() })
}

pub fn offset(text: &str, p: &Value) -> usize {
    let (line, column) = (p["line"].as_u64().unwrap_or(0) as usize, p["character"].as_u64().unwrap_or(0) as usize);
    let start = if line == 0 { 0 } else { text.match_indices('\n').nth(line - 1).map_or(text.len(), |(i, _)| i + 1) };
    let mut units = 0;
    for (i, c) in text[start..].char_indices() {
        if units >= column || c == '\n' {
            return start + i;
        }
        units += c.len_utf16();
    }
    text.len()
}

/// A text after edits.
pub fn apply(text: &str, edits: &Value) -> String {
    let mut list: Vec<(usize, usize, String)> = edits
        .as_array()
        .into_iter()
        .flatten()
        .map(|e| (offset(text, &e["range"]["start"]), offset(text, &e["range"]["end"]), e["newText"].as_str().unwrap_or("").to_string()))
        .collect();
    list.sort();
    let mut out = text.to_string();
    for (from, to, new) in list.into_iter().rev() {
        out.replace_range(from..to, &new);
    }
    out
}

/// A text with inlay hints in guillemets where they stand.
pub fn with_hints(text: &str, hints: &Value) -> String {
    let mut list: Vec<(usize, usize, String)> = hints
        .as_array()
        .into_iter()
        .flatten()
        .enumerate()
        .map(|(n, h)| (offset(text, &h["position"]), n, format!("‹{}›", h["label"].as_str().unwrap_or(""))))
        .collect();
    list.sort();
    let mut out = text.to_string();
    for (at, _, label) in list.into_iter().rev() {
        out.insert_str(at, &label);
    }
    out
}

/// An outline as indented lines.
pub fn tree(symbols: &Value, depth: usize) -> String {
    let mut out = String::new();
    for s in symbols.as_array().into_iter().flatten() {
        let lines = format!("{}-{}", s["range"]["start"]["line"], s["range"]["end"]["line"]);
        let detail = s["detail"].as_str().map_or(String::new(), |d| format!(" ({d})"));
        out += &format!("{}{}{detail} [{}] {lines}\n", "  ".repeat(depth), s["name"].as_str().unwrap_or(""), s["kind"]);
        out += &tree(&s["children"], depth + 1);
    }
    out
}
