//! (in work)
mod store;
