//! The language server: a protocol shell. Features are functions of `gr-ide`, diagnostics come from `gr-driver`,
//! project files and targets from the command it is part of ([`host`]).
//!
//! | module | job |
//! |---|---|
//! | `server` | handlers: a message on the queue, then the answer |
//! | `analysis` | the thread that owns the database, and its workers |
//! | `closed` | programs of the folders that are not open |
//! | `documents` | open documents and the views that requests work on |
//! | `features` | from requests to features and back |
//! | `protocol` | shapes of the protocol, and of our own requests |
//! | `machine` | joint values of the chosen machine |
//! | `text` | text, positions, edits |
//! | `frames` | takes messages that are none out of the stream |

mod analysis;
mod closed;
mod documents;
mod features;
mod frames;
pub mod host;
pub mod machine;
pub mod protocol;
mod server;
mod settings;
mod text;
mod workspace;

use std::sync::Arc;

/// Serves one client on standard input and output until it says `exit`. Whether it said `shutdown` before.
pub fn run(host: Arc<dyn host::Host>) -> std::io::Result<bool> {
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_time().build()?;
    let goodbye = runtime.block_on(server::serve(tokio::io::stdin(), tokio::io::stdout(), host));
    // A worker may still be running a program nobody waits for.
    runtime.shutdown_background();
    Ok(goodbye)
}

pub use server::serve;
pub use settings::{Hints, Lints, Read, Settings};
