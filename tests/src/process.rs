//! Child processes with a time limit: what they wrote and how they ended. Each is the head of a process group, so that
//! what it started ends with it when the time is over.

use std::io::Read;
use std::os::unix::process::CommandExt as _;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// How a child ended.
#[derive(Clone, Debug, Default)]
pub struct Ended {
    /// Exit status; none when a signal or the time limit ended it.
    pub status: Option<i32>,
    /// The time limit ended it.
    pub timed_out: bool,
    /// Standard output.
    pub stdout: Vec<u8>,
    /// Standard error.
    pub stderr: Vec<u8>,
}

impl Ended {
    /// Standard error as text.
    pub fn errors(&self) -> String {
        String::from_utf8_lossy(&self.stderr).into_owned()
    }
    /// Standard output as text.
    pub fn output(&self) -> String {
        String::from_utf8_lossy(&self.stdout).into_owned()
    }
    /// For messages of tests.
    pub fn how(&self) -> String {
        match (self.timed_out, self.status) {
            (true, _) => "ran into the time limit".into(),
            (false, Some(s)) => format!("exit status {s}"),
            (false, None) => "was killed by a signal".into(),
        }
    }
}

fn reader(from: Option<impl Read + Send + 'static>) -> std::thread::JoinHandle<Vec<u8>> {
    std::thread::spawn(move || {
        let mut bytes = Vec::new();
        if let Some(mut from) = from {
            let _ = from.read_to_end(&mut bytes);
        }
        bytes
    })
}

/// Starts `command` as the head of a process group, for [`end`].
pub fn start(command: &mut Command) -> std::io::Result<Child> {
    command.process_group(0).spawn()
}

/// Waits for a child of [`start`]; when the time is over it is ended, with everything that it started. Exit status, and
/// whether the limit ended it.
pub fn end(child: &mut Child, limit: Duration) -> (Option<i32>, bool) {
    let start = Instant::now();
    let mut nap = Duration::from_micros(500);
    loop {
        match child.try_wait() {
            Ok(Some(status)) => return (status.code(), false),
            Ok(None) if start.elapsed() < limit => {
                std::thread::sleep(nap);
                nap = (nap * 2).min(Duration::from_millis(10));
            }
            _ => {
                // Only a shell can signal a group without unsafe code.
                let _ = Command::new("sh").args(["-c", &format!("kill -9 -{}", child.id())]).stderr(Stdio::null()).status();
                let _ = child.kill();
                let _ = child.wait();
                return (None, true);
            }
        }
    }
}

/// Runs `command` without input and gathers what it writes.
pub fn run(command: &mut Command, limit: Duration) -> std::io::Result<Ended> {
    gather(command.stdin(Stdio::null()), limit)
}

/// The same with a file as its input.
pub fn run_fed(command: &mut Command, input: std::fs::File, limit: Duration) -> std::io::Result<Ended> {
    gather(command.stdin(input), limit)
}

fn gather(command: &mut Command, limit: Duration) -> std::io::Result<Ended> {
    let mut child = start(command.stdout(Stdio::piped()).stderr(Stdio::piped()))?;
    let stdout = reader(child.stdout.take());
    let stderr = reader(child.stderr.take());
    let (status, timed_out) = end(&mut child, limit);
    if timed_out {
        // A grandchild with a group of its own may still hold the pipes; its output does not matter any more.
        return Ok(Ended { status, timed_out, ..Ended::default() });
    }
    let stdout = stdout.join().unwrap_or_default();
    let stderr = stderr.join().unwrap_or_default();
    Ok(Ended { status, timed_out, stdout, stderr })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grandchildren_end_with_the_time() {
        let folder = tempfile::tempdir().expect("a folder");
        let mark = folder.path().join("lives");
        let script = format!("(sleep 2; : >'{0}') & echo $!; wait", mark.display());
        let ended = run(Command::new("sh").args(["-c", &script]), Duration::from_millis(200)).expect("a shell");
        assert!(ended.timed_out && ended.status.is_none());
        std::thread::sleep(Duration::from_secs(3));
        assert!(!mark.exists(), "the background job went on");
    }
}
