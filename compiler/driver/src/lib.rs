//! Salsa database and the queries that every front door calls: open, edit, check, stream.
//!
//! One [`Session`] owns the database. A file is a row of chunks of whole lines; a keystroke touches one or two
//! of them. Each chunk is scanned on its own, and interpreted on its own when it has no control flow; results
//! are remembered by chunk and entry state. Whatever the chunk size and the order of edits, the answers are
//! those of a fresh session over the same text.

mod carried;
mod check;
mod db;
mod deeds;
mod disk;
mod editor;
mod engine;
mod hover;
mod layout;
mod lazy;
mod library;
mod lints;
mod rates;
mod session;
mod stats;
mod store;
mod stream;
mod timeline;
mod ufmg;

pub use check::{Check, MOST_OF_A_KIND, Unlisted};
pub use db::Executed;
pub use deeds::{Deeds, deeds};
pub use editor::Traced;
pub use hover::StateAt;
pub use lazy::Lazy;
pub use library::plain_path;
pub use lints::{Level, Rules};
pub use rates::rates;
pub use session::{Cancelled, Canceller, Once, Options, Session, Snapshot, check_once};
pub use stream::{Loaded, Motion, Overlay, Streamed, lower, scan_file, stream};
