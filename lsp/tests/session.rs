//! Random edits over streams in memory: what the server says of a text must not depend on how the text came about.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

use gr_lsp::Settings;
use gr_lsp::host::{Host, Made, OutputJob, Plain, Plan, Station};
use gr_text::Diagnostic;
use proptest::prelude::*;
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt, DuplexStream};

struct Client {
    to: DuplexStream,
    from: DuplexStream,
    pending: Vec<u8>,
    next: i64,
}

impl Client {
    async fn start() -> Client {
        Client::of(Arc::new(gr_lsp::host::Plain)).await
    }
    async fn of(host: Arc<dyn Host>) -> Client {
        let (to, input) = tokio::io::duplex(1 << 20);
        let (output, from) = tokio::io::duplex(1 << 20);
        tokio::spawn(gr_lsp::serve(input, output, host));
        let mut c = Client { to, from, pending: Vec::new(), next: 0 };
        let hello = c.request("initialize", json!({ "capabilities": {} })).await;
        assert_eq!(hello["capabilities"]["positionEncoding"], "utf-16");
        c.notify("initialized", json!({})).await;
        c
    }
    async fn send(&mut self, mut message: Value) {
        message["jsonrpc"] = "2.0".into();
        let body = message.to_string();
        let text = format!("Content-Length: {}\r\n\r\n{body}", body.len());
        self.to.write_all(text.as_bytes()).await.expect("the server reads");
    }
    async fn receive(&mut self) -> Value {
        loop {
            if let Some(end) = self.pending.windows(4).position(|w| w == b"\r\n\r\n") {
                let head = String::from_utf8_lossy(&self.pending[..end]).to_string();
                let length: usize = head.rsplit(": ").next().and_then(|n| n.trim().parse().ok()).expect("a length");
                if self.pending.len() >= end + 4 + length {
                    let body: Vec<u8> = self.pending.drain(..end + 4 + length).skip(end + 4).collect();
                    return serde_json::from_slice(&body).expect("JSON");
                }
            }
            let mut buffer = [0; 1 << 16];
            let wait = std::time::Duration::from_secs(60);
            let n = tokio::time::timeout(wait, self.from.read(&mut buffer)).await.expect("an answer in time").expect("readable");
            assert!(n > 0, "the server hung up");
            self.pending.extend(&buffer[..n]);
        }
    }
    async fn begin(&mut self, method: &str, params: Value) -> i64 {
        self.next += 1;
        let id = self.next;
        self.send(json!({ "id": id, "method": method, "params": params })).await;
        id
    }
    async fn request(&mut self, method: &str, params: Value) -> Value {
        let id = self.begin(method, params).await;
        loop {
            let m = self.receive().await;
            if m["id"] == id {
                return if m.get("error").is_some() { m } else { m["result"].clone() };
            }
        }
    }
    async fn notify(&mut self, method: &str, params: Value) {
        self.send(json!({ "method": method, "params": params })).await;
    }
    /// Diagnostics of a version, and what the user is shown until then.
    async fn published(&mut self, version: i64, said: &mut Vec<String>) -> Vec<Value> {
        loop {
            let m = self.receive().await;
            match m["method"].as_str() {
                Some("window/showMessage") => said.push(m["params"]["message"].as_str().unwrap_or("").into()),
                Some("textDocument/publishDiagnostics") if m["params"]["version"] == version => {
                    return m["params"]["diagnostics"].as_array().cloned().unwrap_or_default();
                }
                _ => {}
            }
        }
    }
    async fn open(&mut self, uri: &str, text: &str) {
        let document = json!({ "uri": uri, "languageId": "gcode", "version": 1, "text": text });
        self.notify("textDocument/didOpen", json!({ "textDocument": document })).await;
    }
    /// Everything that the server says of a document, without what counts versions.
    async fn all(&mut self, uri: &str) -> Vec<(String, Value)> {
        let document = json!({ "textDocument": { "uri": uri } });
        let mut out = Vec::new();
        for method in ["diagnostic", "documentSymbol", "foldingRange", "codeLens", "semanticTokens/full", "documentLink"] {
            let mut answer = self.request(&format!("textDocument/{method}"), document.clone()).await;
            if let Some(o) = answer.as_object_mut() {
                o.remove("resultId");
            }
            out.push((method.to_string(), answer));
        }
        let range = json!({ "start": { "line": 0, "character": 0 }, "end": { "line": 60, "character": 0 } });
        out.push(("inlayHint".into(), self.request("textDocument/inlayHint", json!({ "textDocument": { "uri": uri }, "range": range })).await));
        for line in [0, 2, 5] {
            let at = json!({ "textDocument": { "uri": uri }, "position": { "line": line, "character": 1 } });
            for method in ["hover", "definition", "completion"] {
                out.push((format!("{method} {line}"), self.request(&format!("textDocument/{method}"), at.clone()).await));
            }
        }
        out
    }
}

/// Byte of a position in UTF-16 columns, as the protocol has it.
fn offset(text: &str, line: u32, column: u32) -> usize {
    let bytes = text.as_bytes();
    let mut start = 0;
    let mut at = 0;
    for (i, b) in bytes.iter().enumerate() {
        if at == line {
            break;
        }
        if *b == b'\n' || (*b == b'\r' && bytes.get(i + 1) != Some(&b'\n')) {
            at += 1;
            start = i + 1;
        }
    }
    if at < line {
        return text.len();
    }
    let mut units = 0;
    for (i, c) in text[start..].char_indices() {
        if units >= column || matches!(c, '\n' | '\r') {
            return start + i;
        }
        units += c.len_utf16() as u32;
    }
    text.len()
}

/// Lines that do something, and pieces of them.
fn piece() -> impl Strategy<Value = String> {
    prop::sample::select(vec![
        "G1 X10 F100\n", "G2 X5 Y5 I2.5 J2.5\n", "#1 = [#2 + 3]\n", "#<a> = 4\n", "X#<a>\n", "o1 if [#1 GT 2]\n", "o1 endif\n", "o<s> sub\n", "o<s> endsub\n",
        "o<s> call [1]\n", "G91\n", "G90\n", "T1 M6\n", "(größe 𝄞)\n", "; note\n", "M2\n", "%\n", "G83 Z-1 R1 Q.5\n", "X", "1", "\n", "\r\n", "\r", "(", ")", "#", "[", "é", "",
    ])
    .prop_map(str::to_string)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, ..ProptestConfig::default() })]

    #[test]
    fn edits_lead_where_a_fresh_text_leads(
        start in prop::collection::vec(piece(), 0..10),
        edits in prop::collection::vec((0u32..14, 0u32..12, 0u32..3, 0u32..12, piece(), any::<bool>()), 1..12),
    ) {
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_time().build().expect("a runtime");
        let result = runtime.block_on(async {
            let uri = "file:///programs/part.ngc";
            let mut text = start.concat();
            let mut c = Client::start().await;
            c.open(uri, &text).await;
            for (n, (line, column, lines, until, new, ask)) in edits.into_iter().enumerate() {
                let (from, to) = (offset(&text, line, column), offset(&text, line + lines, until));
                let range = json!({ "start": { "line": line, "character": column }, "end": { "line": line + lines, "character": until } });
                text.replace_range(from..to.max(from), &new);
                let change = json!([{ "range": range, "text": new }]);
                c.notify("textDocument/didChange", json!({ "textDocument": { "uri": uri, "version": n + 2 }, "contentChanges": change })).await;
                if ask {
                    // Questions in between, some cancelled, must not disturb anything.
                    let at = json!({ "textDocument": { "uri": uri }, "position": { "line": line, "character": column } });
                    let id = c.begin("textDocument/hover", at).await;
                    if column % 2 == 0 {
                        c.notify("$/cancelRequest", json!({ "id": id })).await;
                    }
                }
            }
            let edited = c.all(uri).await;
            let mut fresh = Client::start().await;
            fresh.open(uri, &text).await;
            let expected = fresh.all(uri).await;
            (text, edited, expected)
        });
        let (text, edited, expected) = result;
        for ((name, a), (_, b)) in edited.iter().zip(&expected) {
            prop_assert_eq!(a, b, "{} of {:?}", name, text);
        }
        runtime.shutdown_background();
    }
}

/// A host that does something when a STEP-NC file is looked at as a whole.
struct Watched<F>(F);

impl<F: Fn(&str) + Send + Sync> Host for Watched<F> {
    fn station(&self, _: &Path, _: &Settings) -> Station {
        Station::default()
    }
    fn check_project(&self, _: &Path, _: &str) -> Vec<Diagnostic> {
        Vec::new()
    }
    fn check_exchange(&self, path: &Path, text: &str, station: &Station) -> Vec<Diagnostic> {
        (self.0)(text);
        Plain.check_exchange(path, text, station)
    }
    fn plan(&self, _: &Path, _: &str, _: &Station) -> Option<Plan> {
        None
    }
    fn undeclared(&self, _: &Path, _: &str, _: &Settings) -> bool {
        false
    }
    fn output(&self, _: &OutputJob<'_>) -> Result<Made, String> {
        Err(String::new())
    }
}

/// A big STEP-NC file is not looked at for every key of a burst, and no version that is outdated waits for its turn.
#[test]
fn a_burst_of_keys_is_looked_at_once() {
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_time().build().expect("a runtime");
    runtime.block_on(async {
        let looks = Arc::new(std::sync::atomic::AtomicUsize::new(0));
        let counter = looks.clone();
        let count = move |_: &str| {
            counter.fetch_add(1, Relaxed);
        };
        let mut c = Client::of(Arc::new(Watched(count))).await;
        let uri = "file:///programs/big.p21";
        let mut text = String::from("ISO-10303-21;\nDATA;\n");
        (1..120_000).for_each(|n| text.push_str(&format!("#{n}=CARTESIAN_POINT('',(0.,0.,0.));\n")));
        assert!(text.len() > 4_000_000 && text.len() < 8_000_000);
        c.open(uri, &text).await;
        let _ = c.published(1, &mut Vec::new()).await;
        for version in 2..62 {
            let range = json!({ "start": { "line": 5, "character": 0 }, "end": { "line": 5, "character": 0 } });
            let change = json!([{ "range": range, "text": " " }]);
            c.notify("textDocument/didChange", json!({ "textDocument": { "uri": uri, "version": version }, "contentChanges": change })).await;
        }
        let _ = c.published(61, &mut Vec::new()).await;
        let looks = looks.load(Relaxed);
        assert!(looks < 10, "{looks} looks for 60 keys");
    });
    runtime.shutdown_background();
}

/// When looking for diagnostics breaks off, those of before stay and the user is told, once.
#[test]
fn a_mistake_of_the_server_is_told() {
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_time().build().expect("a runtime");
    runtime.block_on(async {
        let fragile = |text: &str| assert!(!text.contains("BREAK"), "a mistake of the server, on purpose");
        let mut c = Client::of(Arc::new(Watched(fragile))).await;
        let uri = "file:///programs/part.p21";
        c.open(uri, "ISO-10303-21;\nDATA;\n#1=A(#2);\n").await;
        let mut said = Vec::new();
        let mut found = Vec::new();
        for version in 2..5 {
            found.push(c.published(version - 1, &mut said).await);
            let text = if version < 4 { "/* BREAK */" } else { "" };
            let range = json!({ "start": { "line": 0, "character": 0 }, "end": { "line": 0, "character": if version == 4 { 22 } else { 0 } } });
            let change = json!([{ "range": range, "text": text }]);
            c.notify("textDocument/didChange", json!({ "textDocument": { "uri": uri, "version": version }, "contentChanges": change })).await;
        }
        found.push(c.published(4, &mut said).await);
        assert!(!found[0].is_empty());
        let messages = |found: &Vec<Value>| found.iter().map(|d| d["message"].clone()).collect::<Vec<_>>();
        assert!(found.iter().all(|f| messages(f) == messages(&found[0])), "{found:?}");
        assert_eq!(said.len(), 1, "{said:?}");
        assert!(said[0].contains("part.p21"), "{said:?}");
    });
    runtime.shutdown_background();
}
