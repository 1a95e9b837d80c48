//! The language server: a protocol shell. Features are functions of `gr-ide`, diagnostics come from `gr-driver`.
//!
//! Notifications reach a handler in order only until its first `await`, so handlers never wait before they have
//! put their message on a queue. One thread owns the session, applies edits in the order they arrived, answers
//! requests between them, and publishes diagnostics when its queue is empty.

mod analysis;
mod protocol;
mod server;

/// Serves one client on standard input and output until it says `exit`.
pub fn run() -> std::io::Result<()> {
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).build()?;
    runtime.block_on(server::serve(tokio::io::stdin(), tokio::io::stdout()));
    Ok(())
}

pub use server::serve;
