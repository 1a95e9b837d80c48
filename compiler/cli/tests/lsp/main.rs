//! The language server as an editor sees it: `gcc-robot lsp` on standard input and output, every request, with the
//! contents of its answers.

mod client;
mod config;
mod custom;
mod gcode;
mod p21;
mod server;
mod table;
