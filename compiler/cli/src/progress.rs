//! A line on the terminal for work that takes more than a second.

use std::io::{IsTerminal as _, Write as _};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Shows what is being done and for how long; silent for the first second and when nobody watches.
pub struct Progress {
    teller: Option<(Sender<Option<String>>, JoinHandle<()>)>,
}

impl Progress {
    /// Work begins.
    pub fn new(quiet: bool, what: impl Into<String>) -> Progress {
        if quiet || !std::io::stderr().is_terminal() {
            return Progress { teller: None };
        }
        let (sender, receiver) = channel::<Option<String>>();
        let mut text = what.into();
        let thread = std::thread::spawn(move || {
            let start = Instant::now();
            // Drawn by the clock: news may come more often than anybody reads.
            let mut next = start + Duration::from_secs(1);
            let mut drawn = false;
            loop {
                match receiver.recv_timeout(next.saturating_duration_since(Instant::now())) {
                    Ok(Some(new)) => text = new,
                    Err(RecvTimeoutError::Timeout) => {}
                    Ok(None) | Err(RecvTimeoutError::Disconnected) => break,
                }
                if Instant::now() >= next {
                    next = Instant::now() + Duration::from_millis(200);
                    drawn = true;
                    // A terminal that takes nothing is no reason to stop.
                    let _ = write!(std::io::stderr(), "\r\x1b[K{text} ({} s)", start.elapsed().as_secs());
                }
            }
            if drawn {
                let _ = write!(std::io::stderr(), "\r\x1b[K");
            }
        });
        Progress { teller: Some((sender, thread)) }
    }
    /// Says where the work is.
    pub fn tell(&self, text: impl FnOnce() -> String) {
        if let Some((sender, _)) = &self.teller {
            // The teller only ends after this.
            let _ = sender.send(Some(text()));
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some((sender, thread)) = self.teller.take() {
            let _ = sender.send(None);
            let _ = thread.join();
        }
    }
}
