//! Motion IR: what a program makes the machine do, in mm, rad and s, one operation after another.
//!
//! It is lowered from the canonical stream ([`Lowering`]), kept in columns ([`Program`]), read through a
//! [`Cursor`] without allocation, and written as text ([`text`]) for people and snapshot tests. Positions
//! are in the work frame of the moment; [`State::machine`] takes them to the machine frame. The reference
//! of operations and text form is `spec/ir/motion.md`.

pub mod diff;
pub mod geometry;
mod lower;
pub mod measure;
mod op;
mod sources;
mod state;
mod store;
pub mod text;
pub mod timing;

pub use gr_canon::{Axes, FrameId, Plane, Units};
pub use gr_text::FileId;
pub use lower::Lowering;
pub use op::{Arc, ArcPlane, FeedMode, Marker, Note, Op, Override, PathMode, Pose, Source, Stop, Turn};
pub use sources::{NoSources, Sources, Texts};
pub use state::{Spindle, State, Sync, plane_axes};
pub use store::{Builder, Cursor, Frame, Frames, Program, Step, View};
