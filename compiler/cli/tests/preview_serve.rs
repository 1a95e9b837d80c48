//! `gcc-robot preview --serve` over its standard streams and its socket.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpStream;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use serde_json::Value;

/// Longest wait for anything.
const LIMIT: Duration = Duration::from_secs(60);

const PROGRAM: &str = "G21 G90 F600\nG0 X0 Y0\nG1 X40\nM2\n";

struct Served {
    child: Child,
    /// Until the editor goes.
    input: Option<ChildStdin>,
    output: Receiver<String>,
    port: u16,
    path: String,
}

impl Served {
    fn start(folder: &std::path::Path) -> Served {
        let file = folder.join("part.ngc");
        std::fs::write(&file, PROGRAM).unwrap();
        let mut child = Command::new(env!("CARGO_BIN_EXE_gcc-robot"))
            .args(["preview", file.to_str().unwrap(), "--serve", "--editor"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let input = child.stdin.take();
        let lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let (send, output) = channel();
        std::thread::spawn(move || lines.map_while(Result::ok).try_for_each(|line| send.send(line)));
        let mut served = Served { child, input, output, port: 0, path: String::new() };
        let url = served.hear()["url"].as_str().unwrap().to_string();
        let rest = url.strip_prefix("http://127.0.0.1:").expect("this computer only");
        let (port, path) = rest.split_once('/').unwrap();
        served.port = port.parse().unwrap();
        served.path = format!("/{path}");
        served
    }

    fn hear(&self) -> Value {
        serde_json::from_str(&self.output.recv_timeout(LIMIT).expect("a line in time")).unwrap()
    }

    fn say(&mut self, message: &Value) {
        writeln!(self.input.as_mut().unwrap(), "{message}").unwrap();
    }

    fn raw(&self, text: &str) -> String {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        stream.set_read_timeout(Some(LIMIT)).unwrap();
        stream.write_all(text.as_bytes()).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    }

    fn ask(&self, method: &str, path: &str, more: &str, body: &str) -> String {
        let length = body.len();
        let host = format!("127.0.0.1:{}", self.port);
        self.raw(&format!("{method} {path} HTTP/1.1\r\nHost: {host}\r\nContent-Length: {length}\r\n{more}\r\n{body}"))
    }

    fn get(&self, path: &str) -> String {
        self.ask("GET", &format!("{}{path}", self.path), "", "")
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn status(answer: &str) -> &str {
    answer.split(' ').nth(1).unwrap_or("")
}

#[test]
fn page_path_and_choice() {
    let folder = tempfile::tempdir().unwrap();
    let mut served = Served::start(folder.path());
    let page = served.get("");
    assert!(status(&page) == "200" && page.contains("<gcc-robot-preview>") && page.contains("frame-ancestors 'none'"));
    let path = served.get("path");
    let body: Value = serde_json::from_str(path.split_once("\r\n\r\n").unwrap().1).unwrap();
    // Where it begins, the rapid there, the feed move.
    assert_eq!(body["path"]["count"], 3);
    assert_eq!(body["problem"], "");
    let choose = format!("{}choose", served.path);
    assert_eq!(status(&served.ask("POST", &choose, "", "2")), "204");
    assert_eq!(served.hear()["line"], 3);
    served.say(&serde_json::json!({ "text": "G21 G90\nG1 X40 Q\n" }));
    let wrong = (0..3000).any(|_| {
        std::thread::sleep(std::time::Duration::from_millis(20));
        served.get("path").contains("\"problem\":\"line 2: ")
    });
    assert!(wrong, "the first error is told with its line");
    drop(served.input.take());
    let ended = (0..3000).find_map(|_| {
        std::thread::sleep(Duration::from_millis(20));
        served.child.try_wait().unwrap()
    });
    assert!(ended.expect("it ends with its editor").success());
}

#[test]
fn only_what_belongs_to_it() {
    let folder = tempfile::tempdir().unwrap();
    let served = Served::start(folder.path());
    let token = served.path.trim_matches('/').to_string();
    assert!(token.len() == 32 && token.bytes().all(|b| b.is_ascii_hexdigit()));
    for path in ["/", "/path", "/0/path", &format!("/{token}"), &format!("/{token}/part.ngc"), &format!("/{token}/../../etc/passwd")] {
        assert_eq!(status(&served.ask("GET", path, "", "")), "404", "{path}");
    }
    let own = served.path.clone();
    let origin = "Origin: http://evil.example\r\n";
    assert_eq!(status(&served.ask("POST", &format!("{own}choose"), origin, "2")), "403");
    assert_eq!(status(&served.raw(&format!("GET {own} HTTP/1.1\r\nHost: evil.example\r\n\r\n"))), "403");
    assert_eq!(status(&served.raw(&format!("GET {own} HTTP/1.1\r\n\r\n"))), "403");
    assert_eq!(status(&served.ask("POST", &format!("{own}choose"), "", "no number")), "400");
    assert_eq!(status(&served.ask("DELETE", &own, "", "")), "405");
    assert_eq!(status(&served.raw("\r\n\r\n")), "400");
    // Bytes that are no text, and a head that never ends.
    let _ = TcpStream::connect(("127.0.0.1", served.port)).unwrap().write_all(&[0xff; 64]);
    let _ = TcpStream::connect(("127.0.0.1", served.port)).unwrap().write_all(&[b'a'; 100_000]);
    assert_eq!(status(&served.get("")), "200");
}
