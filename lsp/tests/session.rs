//! A client's conversation with the server, over streams in memory.

use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt, DuplexStream};

struct Client {
    to: DuplexStream,
    from: DuplexStream,
    pending: Vec<u8>,
    next: i64,
}

impl Client {
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
            let mut buffer = [0; 4096];
            let wait = std::time::Duration::from_secs(20);
            let n = tokio::time::timeout(wait, self.from.read(&mut buffer)).await.expect("an answer in time").expect("readable");
            assert!(n > 0, "the server hung up");
            self.pending.extend(&buffer[..n]);
        }
    }
    async fn until(&mut self, wanted: impl Fn(&Value) -> bool) -> Value {
        loop {
            let message = self.receive().await;
            if wanted(&message) {
                return message;
            }
        }
    }
    async fn request(&mut self, method: &str, params: Value) -> Value {
        self.next += 1;
        let id = self.next;
        self.send(json!({ "id": id, "method": method, "params": params })).await;
        self.until(|m| m["id"] == id).await["result"].clone()
    }
    async fn notify(&mut self, method: &str, params: Value) {
        self.send(json!({ "method": method, "params": params })).await;
    }
    async fn diagnostics(&mut self) -> Value {
        self.until(|m| m["method"] == "textDocument/publishDiagnostics").await["params"]["diagnostics"].clone()
    }
}

const URI: &str = "file:///programs/part.ngc";

#[test]
fn diagnostics_follow_edits_and_features_answer() {
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_time().build().expect("a runtime");
    runtime.block_on(async {
        let (to, input) = tokio::io::duplex(1 << 16);
        let (output, from) = tokio::io::duplex(1 << 16);
        tokio::spawn(gr_lsp::serve(input, output));
        let mut c = Client { to, from, pending: Vec::new(), next: 0 };
        let hello = c.request("initialize", json!({ "capabilities": {} })).await;
        assert_eq!(hello["capabilities"]["positionEncoding"], "utf-16");
        c.notify("initialized", json!({})).await;

        let text = "(größe)\nG21 G90 F100\nG2 X10 Y0 I4 J0\nM2\n";
        c.notify("textDocument/didOpen", json!({ "textDocument": { "uri": URI, "languageId": "gcode", "version": 1, "text": text } })).await;
        let found = c.diagnostics().await;
        let first = found.as_array().and_then(|d| d.iter().find(|d| d["code"] == "E0203")).expect("the arc").clone();
        assert_eq!((first["range"]["start"]["line"].as_u64(), first["severity"].as_u64()), (Some(2), Some(1)));

        // I4 → I5: the arc is right.
        let change = json!({ "textDocument": { "uri": URI, "version": 2 }, "contentChanges": [
            { "range": { "start": { "line": 2, "character": 11 }, "end": { "line": 2, "character": 12 } }, "text": "5" },
            { "range": { "start": { "line": 0, "character": 1 }, "end": { "line": 0, "character": 6 } }, "text": "part" } ] });
        c.notify("textDocument/didChange", change).await;
        let found = c.diagnostics().await;
        assert!(!found.to_string().contains("E0203"), "{found}");

        let at = json!({ "textDocument": { "uri": URI }, "position": { "line": 2, "character": 1 } });
        let hover = c.request("textDocument/hover", at).await;
        assert!(hover["contents"]["value"].as_str().is_some_and(|t| t.starts_with("**G2**")), "{hover}");
        let at = json!({ "textDocument": { "uri": URI }, "position": { "line": 1, "character": 2 } });
        let items = c.request("textDocument/completion", at).await;
        assert!(items.as_array().is_some_and(|i| i.iter().any(|c| c["label"] == "G21")), "{items}");
        let symbols = c.request("textDocument/documentSymbol", json!({ "textDocument": { "uri": URI } })).await;
        assert_eq!(symbols[0]["name"], "part");
        let edits = c.request("textDocument/formatting", json!({ "textDocument": { "uri": URI }, "options": { "tabSize": 2, "insertSpaces": true } })).await;
        assert!(edits.is_array());
        assert_eq!(c.request("shutdown", Value::Null).await, Value::Null);
    });
}
