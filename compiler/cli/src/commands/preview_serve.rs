//! `gcc-robot preview part.ngc --serve`: the preview as a page that follows the file, or the editor that started it.
//!
//! The page is served on this computer only, under an address that cannot be guessed, to requests that name this
//! computer. Nothing else can be had there: addresses name no files. With `--editor`, lines go both ways over
//! standard input and output, one JSON object each: `{"line": 12}` marks a line, `{"text": "…"}` is the program as
//! it is now; `{"url": "…"}` says where the page is, `{"line": 7}` that a segment of line 7 was clicked.

use std::io::{BufRead as _, BufReader, Read, Write};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard};
use std::time::{Duration, SystemTime};

use gr_backends::plot::preview_page;
use gr_text::{Encoding, Severity};
use serde_json::{Value, json};

use super::check::Checked;
use crate::exit::Exit;
use crate::options::{Global, LintArgs, PreviewArgs};
use crate::pipeline::{Unit, load, motion};
use crate::setup::{Station, beside, station};
use crate::sources::{Positions, Sources};

/// How often the file is looked at.
const POLL: Duration = Duration::from_millis(250);
/// How long a client may take to ask or to read.
const PATIENCE: Duration = Duration::from_secs(10);
/// How often a silent page is told that the server lives.
const BEAT: Duration = Duration::from_secs(15);
/// Longest head of a request, bytes.
const LONGEST_HEAD: u64 = 16 * 1024;
/// Pages that are served at the same time.
const MOST_CLIENTS: usize = 32;

/// What the thread that draws is told.
enum News {
    Text(String),
    Line(i64),
    Changed,
    End,
}

/// What pages are shown.
#[derive(Default)]
struct State {
    /// Rises with every drawing.
    version: u64,
    body: Arc<[u8]>,
    /// Marked line, from 0; -1: none. Its number rises with every change.
    line: (u64, i64),
}

struct Shared {
    state: Mutex<State>,
    changed: Condvar,
    title: String,
    token: String,
    port: u16,
    editor: bool,
    clients: AtomicUsize,
}

impl Shared {
    /// A thread that panicked leaves whole values behind: each is replaced in one assignment.
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}

pub fn run(global: &Global, args: &PreviewArgs) -> Exit {
    let mut renderer = global.renderer(true);
    let mut sources = Sources::default();
    let Some(station) = station(&args.setup, &LintArgs::default(), beside(&args.file), &mut sources, &mut renderer) else {
        renderer.finish(false);
        return renderer.failed();
    };
    let listener = match TcpListener::bind((Ipv4Addr::LOCALHOST, 0)) {
        Ok(listener) => listener,
        Err(e) => {
            eprintln!("the preview can't be served: {e}");
            return Exit::Io;
        }
    };
    let port = listener.local_addr().map_or(0, |a| a.port());
    let title = args.file.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    let shared = Arc::new(Shared {
        state: Mutex::default(),
        changed: Condvar::new(),
        title,
        token: token(),
        port,
        editor: args.editor,
        clients: AtomicUsize::new(0),
    });
    let (tell, news) = channel();
    let mut drawing = Drawing { shared: shared.clone(), station, file: args.file.clone(), path: None, files: vec![args.file.clone()] };
    if !drawing.read() {
        eprintln!("{} can't be read", args.file.display());
        return Exit::Io;
    }
    let url = format!("http://127.0.0.1:{port}/{}/", shared.token);
    if args.editor {
        say(&json!({ "url": url }));
        std::thread::spawn(move || listen_to_editor(&tell));
    } else {
        println!("{url}");
        if !global.quiet {
            eprintln!("open this address in a browser; Ctrl-C ends");
        }
    }
    std::thread::spawn(move || serve(&listener, &shared));
    drawing.follow(&news, args.editor);
    Exit::Ok
}

/// 128 bits from the operating system's random numbers: keys of the hasher are drawn from them, and its output does
/// not tell them.
fn token() -> String {
    use std::hash::{BuildHasher as _, Hasher as _};
    let part = || std::collections::hash_map::RandomState::new().build_hasher().finish();
    format!("{:016x}{:016x}", part(), part())
}

fn say(message: &Value) {
    let mut out = std::io::stdout().lock();
    // When the editor is gone its end of standard input closes too, which ends us.
    let _ = writeln!(out, "{message}").and_then(|()| out.flush());
}

fn listen_to_editor(tell: &Sender<News>) {
    // A line that is no text is none of ours, as every other that is no message.
    for line in std::io::stdin().lock().split(b'\n') {
        let Ok(line) = line else { break };
        let Ok(message) = serde_json::from_slice::<Value>(&line) else { continue };
        if let Some(text) = message["text"].as_str() {
            let _ = tell.send(News::Text(text.to_string()));
        } else if let Some(line) = message["line"].as_i64() {
            let _ = tell.send(News::Line(line - 1));
        }
    }
    let _ = tell.send(News::End);
}

/// The thread that reads, runs and draws the program.
struct Drawing {
    shared: Arc<Shared>,
    station: Station,
    file: PathBuf,
    /// The last path without errors, as JSON.
    path: Option<String>,
    /// Files to look at.
    files: Vec<PathBuf>,
}

impl Drawing {
    fn follow(&mut self, news: &Receiver<News>, editor: bool) {
        let mut seen = self.stamps();
        // Once the editor has sent a text, the file no longer counts.
        let mut own = false;
        loop {
            let first = if editor { news.recv().unwrap_or(News::End) } else { news.recv_timeout(POLL).unwrap_or(News::Changed) };
            let mut text = None;
            let mut queue = vec![first];
            queue.extend(news.try_iter());
            for n in queue {
                match n {
                    News::End => return,
                    News::Text(t) => text = Some(t),
                    News::Line(line) => self.mark(line),
                    News::Changed => {}
                }
            }
            if let Some(text) = text {
                own = true;
                self.draw(text.into(), Encoding::Utf8);
            } else if !own {
                let now = self.stamps();
                if now != seen {
                    seen = now;
                    self.read();
                }
            }
        }
    }

    fn stamps(&self) -> Vec<Option<SystemTime>> {
        self.files.iter().map(|f| std::fs::metadata(f).and_then(|m| m.modified()).ok()).collect()
    }

    fn mark(&self, line: i64) {
        let mut state = self.shared.state();
        if state.line.1 != line {
            state.line = (state.line.0 + 1, line);
            self.shared.changed.notify_all();
        }
    }

    /// Draws the file as it is on disk. False: it can't be read.
    fn read(&mut self) -> bool {
        match load(&self.file, &self.station) {
            Ok(unit) => self.draw(unit.text.clone(), unit.encoding),
            Err(checked) if checked.unreadable => return false,
            Err(checked) => self.publish("", &problem(&checked)),
        }
        true
    }

    fn draw(&mut self, text: gr_text::Text, encoding: Encoding) {
        let unit = Unit::new(&self.file, text.clone(), encoding, &self.station);
        let said = match motion(&unit, self.station.machine.as_ref()) {
            Ok((motion, checked)) => {
                let trace = crate::emit::traced(&motion, &unit, self.station.machine.as_ref());
                self.path = Some(trace.json(&self.shared.title, &trace.key(), false).to_string());
                self.files = std::iter::once(self.file.clone()).chain(motion.subs).chain(motion.missing).collect();
                let bad = motion.found.iter().any(|d| d.severity == Severity::Error);
                problem(&if bad { Checked { sources: motion.sources, found: motion.found, ..Checked::nothing() } } else { checked })
            }
            Err(checked) => {
                self.files.extend(checked.sought.iter().filter(|f| !self.files.contains(f)).cloned().collect::<Vec<_>>());
                problem(&checked)
            }
        };
        self.publish(&text, &said);
    }

    /// Gives pages what there is. An editor has the text already.
    fn publish(&self, text: &str, problem: &str) {
        let text = if self.shared.editor { Value::Null } else { text.into() };
        let path = self.path.as_deref().unwrap_or("null");
        let mut body = format!("{{\"title\":{},\"problem\":{}", json!(self.shared.title), json!(problem));
        if !text.is_null() {
            body.push_str(&format!(",\"text\":{text}"));
        }
        body.push_str(&format!(",\"path\":{path}}}"));
        let mut state = self.shared.state();
        state.version += 1;
        state.body = body.into_bytes().into();
        self.shared.changed.notify_all();
    }
}

/// The first error in words, with its line; empty when there is none.
fn problem(checked: &Checked) -> String {
    let mut errors = checked.found.iter().filter(|d| d.severity == Severity::Error);
    let Some(first) = errors.next() else { return String::new() };
    let (file, span) = first.primary();
    let (line, _) = Positions::default().of(&checked.sources, file, span.start);
    let more = errors.count() + checked.more.errors;
    let rest = if more > 0 { format!(" (and {more} more)") } else { String::new() };
    format!("line {line}: {}{rest}", first.message)
}

fn serve(listener: &TcpListener, shared: &Arc<Shared>) {
    for stream in listener.incoming().flatten() {
        if shared.clients.fetch_add(1, Ordering::Relaxed) >= MOST_CLIENTS {
            shared.clients.fetch_sub(1, Ordering::Relaxed);
            continue;
        }
        let shared = shared.clone();
        std::thread::spawn(move || {
            // A client that went away is no concern of ours.
            let _ = answer(stream, &shared);
            shared.clients.fetch_sub(1, Ordering::Relaxed);
        });
    }
}

/// A request, as far as it matters.
struct Request {
    method: String,
    path: String,
    host: String,
    origin: Option<String>,
    length: usize,
}

fn answer(stream: TcpStream, shared: &Shared) -> std::io::Result<()> {
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let mut input = BufReader::new(stream.try_clone()?);
    let Some(request) = head(&mut input)? else { return reply(&stream, "400 Bad Request", "text/plain", b"") };
    let here = [format!("127.0.0.1:{}", shared.port), format!("localhost:{}", shared.port)];
    let foreign = |origin: &String| !here.iter().any(|h| *origin == format!("http://{h}"));
    // Another site's page can reach this port, under its own name or by a name that leads here.
    if !here.contains(&request.host) || request.origin.as_ref().is_some_and(foreign) {
        return reply(&stream, "403 Forbidden", "text/plain", b"");
    }
    let Some(what) = request.path.strip_prefix('/').and_then(|p| p.split_once('/')).filter(|(t, _)| same(t, &shared.token)) else {
        return reply(&stream, "404 Not Found", "text/plain", b"");
    };
    match (request.method.as_str(), what.1) {
        ("GET", "") => reply(&stream, "200 OK", "text/html; charset=utf-8", preview_page(&shared.title, None, None).as_bytes()),
        ("GET", "path") => {
            let body = shared.state().body.clone();
            reply(&stream, "200 OK", "application/json", &body)
        }
        ("GET", "events") => events(&stream, shared),
        ("POST", "choose") => {
            let mut body = vec![0; request.length.min(32)];
            input.read_exact(&mut body)?;
            let line = std::str::from_utf8(&body).ok().and_then(|t| t.trim().parse::<u32>().ok());
            let Some(line) = line else { return reply(&stream, "400 Bad Request", "text/plain", b"") };
            if shared.editor {
                say(&json!({ "line": u64::from(line) + 1 }));
            }
            reply(&stream, "204 No Content", "text/plain", b"")
        }
        (_, "" | "path" | "events" | "choose") => reply(&stream, "405 Method Not Allowed", "text/plain", b""),
        _ => reply(&stream, "404 Not Found", "text/plain", b""),
    }
}

/// Compares in the same time wherever they differ.
fn same(a: &str, b: &str) -> bool {
    a.len() == b.len() && a.bytes().zip(b.bytes()).fold(0, |d, (x, y)| d | (x ^ y)) == 0
}

fn head(input: &mut impl std::io::BufRead) -> std::io::Result<Option<Request>> {
    let mut input = input.take(LONGEST_HEAD);
    let mut line = String::new();
    input.read_line(&mut line)?;
    let mut words = line.split_ascii_whitespace();
    let (Some(method), Some(path)) = (words.next(), words.next()) else { return Ok(None) };
    let mut request =
        Request { method: method.into(), path: path.into(), host: String::new(), origin: None, length: 0 };
    loop {
        let mut line = String::new();
        if input.read_line(&mut line)? == 0 {
            return Ok(None);
        }
        let line = line.trim_end();
        if line.is_empty() {
            return Ok(Some(request));
        }
        let Some((name, value)) = line.split_once(':') else { return Ok(None) };
        let value = value.trim();
        match name.to_ascii_lowercase().as_str() {
            "host" => request.host = value.to_ascii_lowercase(),
            "origin" => request.origin = Some(value.to_ascii_lowercase()),
            "content-length" => request.length = value.parse().unwrap_or(0),
            _ => {}
        }
    }
}

fn headers(status: &str, kind: &str) -> String {
    format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nCache-Control: no-store\r\nX-Content-Type-Options: nosniff\r\n\
         Referrer-Policy: no-referrer\r\nContent-Security-Policy: default-src 'none'; script-src 'unsafe-inline'; \
         style-src 'unsafe-inline'; connect-src 'self'; frame-ancestors 'none'\r\nConnection: close\r\n"
    )
}

fn reply(mut stream: &TcpStream, status: &str, kind: &str, body: &[u8]) -> std::io::Result<()> {
    let head = format!("{}Content-Length: {}\r\n\r\n", headers(status, kind), body.len());
    stream.write_all(head.as_bytes())?;
    stream.write_all(body)?;
    stream.flush()
}

/// Tells a page, as long as it listens, of new drawings and of the marked line.
fn events(mut stream: &TcpStream, shared: &Shared) -> std::io::Result<()> {
    stream.write_all(format!("{}\r\n", headers("200 OK", "text/event-stream")).as_bytes())?;
    // The page asks for the path itself when it has connected.
    let (mut version, mut line) = (shared.state().version, 0);
    loop {
        let message = {
            let mut state = shared.state();
            if state.version == version && state.line.0 == line {
                state = match shared.changed.wait_timeout(state, BEAT) {
                    Ok((state, _)) => state,
                    Err(broken) => broken.into_inner().0,
                };
            }
            let mut news = serde_json::Map::new();
            if state.version != version {
                news.insert("changed".into(), true.into());
            }
            if state.line.0 != line {
                news.insert("line".into(), state.line.1.into());
            }
            (version, line) = (state.version, state.line.0);
            if news.is_empty() { ": still here\n\n".to_string() } else { format!("data: {}\n\n", Value::Object(news)) }
        };
        stream.write_all(message.as_bytes())?;
        stream.flush()?;
    }
}
