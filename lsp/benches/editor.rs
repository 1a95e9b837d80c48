//! How long an editor waits: a client and a server with a pipe between them, on big files.
//!
//! `cargo bench -p gr-lsp --bench editor [-- LINES]`. The server is this program again, so that its memory is its own.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

struct Client {
    child: Child,
    to: ChildStdin,
    from: BufReader<ChildStdout>,
    next: i64,
    version: i64,
}

impl Client {
    fn start() -> Client {
        let me = std::env::current_exe().expect("a path");
        let mut child = Command::new(me).arg("--serve").stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("a server");
        let to = child.stdin.take().expect("a pipe");
        let from = BufReader::with_capacity(1 << 20, child.stdout.take().expect("a pipe"));
        let mut c = Client { child, to, from, next: 0, version: 0 };
        c.request("initialize", json!({ "capabilities": {} }));
        c.notify("initialized", json!({}));
        c
    }
    fn send(&mut self, mut message: Value) {
        message["jsonrpc"] = "2.0".into();
        let body = message.to_string();
        write!(self.to, "Content-Length: {}\r\n\r\n{body}", body.len()).expect("written");
        self.to.flush().expect("flushed");
    }
    fn notify(&mut self, method: &str, params: Value) {
        self.send(json!({ "method": method, "params": params }));
    }
    fn receive(&mut self) -> Value {
        let mut length = 0;
        loop {
            let mut line = String::new();
            self.from.read_line(&mut line).expect("a line");
            let line = line.trim();
            if line.is_empty() {
                break;
            }
            if let Some(n) = line.strip_prefix("Content-Length: ") {
                length = n.parse().expect("a number");
            }
        }
        let mut body = vec![0; length];
        self.from.read_exact(&mut body).expect("a message");
        serde_json::from_slice(&body).expect("JSON")
    }
    fn request(&mut self, method: &str, params: Value) -> Value {
        self.next += 1;
        let id = self.next;
        self.send(json!({ "id": id, "method": method, "params": params }));
        loop {
            let m = self.receive();
            if m["id"] == id {
                assert!(m.get("error").is_none(), "{m}");
                return m["result"].clone();
            }
        }
    }
    fn diagnostics(&mut self) {
        loop {
            let m = self.receive();
            if m["method"] == "textDocument/publishDiagnostics" && m["params"]["version"].as_i64() >= Some(self.version) {
                return;
            }
        }
    }
    /// Begins to count when the message begins to be sent: how long the client takes to make it is its own business.
    fn open(&mut self, uri: &str, language: &str, text: &str) -> Instant {
        self.version = 1;
        let document = json!({ "uri": uri, "languageId": language, "version": 1, "text": text });
        let body = json!({ "jsonrpc": "2.0", "method": "textDocument/didOpen", "params": { "textDocument": document } }).to_string();
        let began = Instant::now();
        write!(self.to, "Content-Length: {}\r\n\r\n{body}", body.len()).expect("written");
        self.to.flush().expect("flushed");
        began
    }
    fn edit(&mut self, uri: &str, line: usize, column: usize, old: usize, new: &str) {
        self.version += 1;
        let range = json!({ "start": { "line": line, "character": column }, "end": { "line": line, "character": column + old } });
        let changes = json!([{ "range": range, "text": new }]);
        self.notify("textDocument/didChange", json!({ "textDocument": { "uri": uri, "version": self.version }, "contentChanges": changes }));
    }
    /// Processor time of the server so far, all its threads: what a busy machine leaves comparable.
    fn processor(&self) -> Duration {
        let stat = std::fs::read_to_string(format!("/proc/{}/stat", self.child.id())).unwrap_or_default();
        let behind = stat.rsplit(')').next().unwrap_or("");
        // utime and stime, in hundredths of a second.
        let ticks: u64 = behind.split_whitespace().skip(11).take(2).filter_map(|n| n.parse::<u64>().ok()).sum();
        Duration::from_millis(ticks * 10)
    }
    /// Resident memory, MiB, now and at most.
    fn memory(&self) -> (u64, u64) {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.child.id())).unwrap_or_default();
        let of = |key: &str| {
            let line = status.lines().find(|l| l.starts_with(key)).unwrap_or("");
            line.split_whitespace().nth(1).and_then(|n| n.parse::<u64>().ok()).unwrap_or(0) / 1024
        };
        (of("VmRSS:"), of("VmHWM:"))
    }
}

impl Drop for Client {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn ms(d: Duration) -> f64 {
    d.as_secs_f64() * 1e3
}

/// Median and 99th percentile.
fn show(name: &str, mut times: Vec<Duration>) {
    times.sort();
    let at = |share: f64| ms(times[((times.len() - 1) as f64 * share).round() as usize]);
    println!("{name:<44} median {:8.2} ms   99 % {:8.2} ms   of {}", at(0.5), at(0.99), times.len());
}

fn timed(mut work: impl FnMut(), count: usize) -> Vec<Duration> {
    (0..count)
        .map(|_| {
            let began = Instant::now();
            work();
            began.elapsed()
        })
        .collect()
}

fn gcode(lines: usize) {
    println!("G-code, {lines} lines");
    let mut x = 12345u64;
    let mut next = || {
        x = x.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (x >> 40) as f64 / 16_777_216.0 * 100.0
    };
    let mut text = String::from("G21 G90 G17 F1000\nT1 M6\n");
    for _ in 0..lines.saturating_sub(3) {
        let (a, b, c) = (next(), next(), next());
        text.push_str(&format!("G1 X{a:.4} Y{b:.4} Z{c:.4}\n"));
    }
    text.push_str("M2\n");
    let uri = "file:///big.ngc";
    let mut c = Client::start();
    let began = c.open(uri, "gcode", &text);
    c.diagnostics();
    println!("{:<44} {:15.2} ms, processor {:.0} ms", "open → diagnostics", ms(began.elapsed()), ms(c.processor()));
    let document = json!({ "textDocument": { "uri": uri } });
    let places = [10, lines / 2, lines - 10];
    for (name, line) in ["start", "middle", "end"].iter().zip(places) {
        let mut flip = 0;
        let times = timed(
            || {
                flip = (flip + 1) % 10;
                c.edit(uri, line, 4, 1, &flip.to_string());
                c.diagnostics();
            },
            200,
        );
        show(&format!("edit → diagnostics, {name}"), times);
    }
    for (name, line) in ["start", "middle", "end"].iter().zip(places) {
        let at = json!({ "textDocument": { "uri": uri }, "position": { "line": line, "character": 4 } });
        show(&format!("hover, {name}"), timed(|| drop(c.request("textDocument/hover", at.clone())), 100));
    }
    let middle = lines / 2;
    let range = json!({ "start": { "line": middle, "character": 0 }, "end": { "line": middle + 60, "character": 0 } });
    let visible = json!({ "textDocument": { "uri": uri }, "range": range });
    show("inlay hints of 60 lines", timed(|| drop(c.request("textDocument/inlayHint", visible.clone())), 50));
    show("tokens of 60 lines", timed(|| drop(c.request("textDocument/semanticTokens/range", visible.clone())), 50));
    show("symbols", timed(|| drop(c.request("textDocument/documentSymbol", document.clone())), 20));
    show("folding", timed(|| drop(c.request("textDocument/foldingRange", document.clone())), 20));
    let at = json!({ "textDocument": { "uri": uri }, "position": { "line": middle, "character": 0 } });
    show("completion", timed(|| drop(c.request("textDocument/completion", at.clone())), 20));
    let (now, _) = c.memory();
    println!("{:<44} {now:12} MiB", "resident memory");
    if lines <= 200_000 {
        let mut n = 0;
        let before = c.processor();
        let times = timed(
            || {
                n = (n + 1) % 10;
                c.edit(uri, middle, 4, 1, &n.to_string());
                drop(c.request("gccRobot/preview", document.clone()));
            },
            10,
        );
        show("edit → tool path", times);
        println!("{:<44} processor {:.0} ms each", "", ms(c.processor() - before) / 10.0);
        show("lenses", timed(|| drop(c.request("textDocument/codeLens", document.clone())), 10));
    }
    let (now, most) = c.memory();
    println!("{:<44} {now:12} MiB   at most {most} MiB", "resident memory at the end");
}

fn exchange(megabytes: usize) {
    println!("exchange file, {megabytes} MB");
    let mut text = String::from("ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'1');\nFILE_NAME('','2026-01-01',(''),(''),'','','');\nFILE_SCHEMA(('MACHINING_SCHEMA'));\nENDSEC;\nDATA;\n");
    let mut id = 1;
    while text.len() < megabytes << 20 {
        text.push_str(&format!("#{id}=CARTESIAN_POINT('P{id}',({}.5,{}.25,0.));\n#{}=AXIS2_PLACEMENT_3D('A',#{id},$,$);\n", id % 1000, id % 777, id + 1));
        id += 2;
    }
    text.push_str("ENDSEC;\nEND-ISO-10303-21;\n");
    let uri = "file:///big.p21";
    let line = text.lines().position(|l| l.starts_with(&format!("#{}=", id - 1))).unwrap_or(8);
    let column = text.lines().nth(line).and_then(|l| l.find(",#")).unwrap_or(0) + 2;
    let mut c = Client::start();
    let at = json!({ "textDocument": { "uri": uri }, "position": { "line": line, "character": column } });
    let began = c.open(uri, "p21", &text);
    let found = c.request("textDocument/definition", at.clone());
    println!("{:<44} {:15.2} ms, processor {:.0} ms", "open → definition", ms(began.elapsed()), ms(c.processor()));
    assert_eq!(found[0]["range"]["start"]["line"], line - 1, "{found}");
    let times = timed(
        || {
            c.edit(uri, line / 2 * 2 + 1, 1, 0, "");
            drop(c.request("textDocument/definition", at.clone()));
        },
        50,
    );
    show("edit → definition", times);
    // Where the file was looked at since the edit before: its tables have to be put away some time.
    let mut idle = Vec::new();
    for _ in 0..10 {
        c.diagnostics();
        let began = Instant::now();
        c.edit(uri, line / 2 * 2 + 1, 1, 0, "");
        drop(c.request("textDocument/definition", at.clone()));
        idle.push(began.elapsed());
    }
    show("diagnostics, edit → definition", idle);
}

fn main() {
    if std::env::args().any(|a| a == "--serve") {
        let _ = gr_lsp::run(Arc::new(gr_lsp::host::Plain));
        return;
    }
    let lines = std::env::args().skip(1).find_map(|a| a.parse().ok());
    for n in lines.map_or(vec![100_000, 1_000_000], |n| vec![n]) {
        gcode(n);
    }
    exchange(100);
}
