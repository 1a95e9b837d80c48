//! Requests of our own, beside those of the Language Server Protocol. `docs/editor-features.md` describes them for
//! those who write clients. Long lists travel as base64 of little-endian numbers: a client views them without
//! parsing.

use serde::{Deserialize, Serialize};
use tower_lsp::ls_types as lsp;

/// Names a document.
#[derive(Deserialize, Serialize, Clone, Debug)]
#[serde(rename_all = "camelCase")]
pub struct DocumentParams {
    /// Which.
    pub text_document: lsp::TextDocumentIdentifier,
}

/// `gccRobot/preview`: the tool path of a document.
#[derive(Deserialize, Serialize, Clone, Debug)]
#[serde(rename_all = "camelCase")]
pub struct PreviewParams {
    /// Which.
    pub text_document: lsp::TextDocumentIdentifier,
    /// `key` of the path that the client has: when nothing moved since, the answer holds no arrays.
    #[serde(default)]
    pub have: Option<String>,
    /// Greatest distance of the drawn points from curves, mm; none = by the size of the part.
    #[serde(default)]
    pub tolerance: Option<f64>,
    /// Most points that are sent; none = 4 000 000.
    #[serde(default)]
    pub most_points: Option<u32>,
}

/// `gccRobot/output`: what a target makes of the document as it is in the editor.
#[derive(Deserialize, Serialize, Clone, Debug)]
#[serde(rename_all = "camelCase")]
pub struct OutputParams {
    /// Which.
    pub text_document: lsp::TextDocumentIdentifier,
    /// Target id, as `gcc-robot target list` shows it.
    pub target: String,
    /// Options of `gcc-robot build` for this target, without the dashes: `{"decimals": 3, "interval": 0.008}`.
    #[serde(default)]
    pub options: serde_json::Map<String, serde_json::Value>,
    /// Machine; none = as configured.
    #[serde(default)]
    pub machine: Option<String>,
}

/// The output.
#[derive(Serialize, Clone, Debug, Default, PartialEq)]
#[serde(rename_all = "camelCase")]
pub struct Output {
    /// The document.
    pub uri: String,
    /// Its version.
    pub version: i32,
    /// Target.
    pub target: String,
    /// Files; the first is the main one. Empty when there are errors.
    pub files: Vec<OutputFile>,
    /// What was found on the way: errors keep the output from being made.
    pub diagnostics: Vec<lsp::Diagnostic>,
    /// The request itself can't be met: unknown target or option, missing machine.
    pub error: Option<String>,
}

/// One file of an output.
#[derive(Serialize, Clone, Debug, Default, PartialEq)]
#[serde(rename_all = "camelCase")]
pub struct OutputFile {
    /// Suggested name.
    pub name: String,
    /// Its text; binary files (pictures) come as `base64`.
    pub text: String,
    /// Contents of a binary file.
    pub base64: Option<String>,
    /// u32 per line of `text`: line of the document (from 0) that it comes from; 4294967295 = none.
    pub lines: String,
}

/// `gccRobot/buildOptions`: what `gcc-robot build` must be told to make of the document, as it is saved, what is shown.
#[derive(Serialize, Clone, Debug, Default, PartialEq)]
#[serde(rename_all = "camelCase")]
pub struct BuildOptions {
    /// Words for the command line: the settings; the project file is found from the program's folder.
    pub options: Vec<String>,
}

/// `gccRobot/state`: everything about a block.
#[derive(Deserialize, Serialize, Clone, Debug)]
#[serde(rename_all = "camelCase")]
pub struct StateParams {
    /// Which.
    pub text_document: lsp::TextDocumentIdentifier,
    /// Where; the line counts.
    pub position: lsp::Position,
}

/// The block and the state around it, when execution comes to it for the first time.
#[derive(Serialize, Clone, Debug, Default, PartialEq)]
#[serde(rename_all = "camelCase")]
pub struct State {
    /// Line, from 0.
    pub line: u32,
    /// Execution comes there.
    pub reached: bool,
    /// State before the block.
    pub before: Option<Modes>,
    /// … after it.
    pub after: Option<Modes>,
    /// What it does.
    pub block: Option<BlockFacts>,
}

/// Modes as people name them.
#[derive(Serialize, Clone, Debug, Default, PartialEq)]
#[serde(rename_all = "camelCase")]
pub struct Modes {
    /// Program position X Y Z A B C U V W in program units and degrees.
    pub position: [f64; 9],
    /// `mm` or `inch`.
    pub units: String,
    /// Active codes, one per modal group: `G1`, `G17`, `G90`, `G21`, `G54`, `G94` …
    pub codes: Vec<String>,
    /// Feed as programmed.
    pub feed: f64,
    /// Spindle speed as programmed.
    pub speed: f64,
    /// Tool in the spindle; 0 = none.
    pub tool: i32,
    /// Tool selected by T; 0 = none.
    pub selected_tool: i32,
}

/// What a block does.
#[derive(Serialize, Clone, Debug, Default, PartialEq)]
#[serde(rename_all = "camelCase")]
pub struct BlockFacts {
    /// Number of moves.
    pub moves: u32,
    /// Way, mm.
    pub length: f64,
    /// Time, s; none when the feed is unknown.
    pub seconds: Option<f64>,
    /// Centre of the arc, in program units.
    pub center: Option<[f64; 3]>,
    /// Radius of the arc, in program units.
    pub radius: Option<f64>,
    /// Angle of the arc, degrees, positive counter-clockwise.
    pub sweep: Option<f64>,
}

/// `gccRobot/targets`: what can be chosen.
#[derive(Serialize, Clone, Debug, Default, PartialEq)]
#[serde(rename_all = "camelCase")]
pub struct Choices {
    /// Targets of `gccRobot/output`.
    pub targets: Vec<Choice>,
    /// Machines and robots.
    pub machines: Vec<Choice>,
    /// Dialects.
    pub dialects: Vec<Choice>,
}

/// One of them.
#[derive(Serialize, Clone, Debug, Default, PartialEq)]
#[serde(rename_all = "camelCase")]
pub struct Choice {
    /// What is put into settings.
    pub id: String,
    /// For people.
    pub title: String,
    /// More (Markdown).
    pub detail: String,
    /// Of a target: usual extension, `stable`, `experimental` or `planned`, and its options.
    pub extension: String,
    #[allow(missing_docs, reason = "see extension")]
    pub status: String,
    #[allow(missing_docs, reason = "see extension")]
    pub options: Vec<String>,
}

/// `gccRobot/explain`: the long text of a diagnostic or a code.
#[derive(Deserialize, Serialize, Clone, Debug)]
#[serde(rename_all = "camelCase")]
pub struct ExplainParams {
    /// `E0203`, `arc/radius-mismatch` or `G83`.
    pub code: String,
    /// Dialect of a code; none = LinuxCNC.
    #[serde(default)]
    pub dialect: Option<String>,
}

/// The text.
#[derive(Serialize, Clone, Debug, Default, PartialEq)]
#[serde(rename_all = "camelCase")]
pub struct Explanation {
    /// Markdown; none when there is no such code.
    pub markdown: Option<String>,
}

/// `gccRobot/analysed`, a notification to the client: diagnostics of this version are out; a preview or output that
/// is shown can be asked for again.
#[derive(Serialize, Deserialize, Clone, Debug)]
#[serde(rename_all = "camelCase")]
pub struct Analysed {
    /// The document.
    pub uri: String,
    /// Its version.
    pub version: i32,
}

/// See [`Analysed`].
#[derive(Debug)]
pub enum AnalysedNotification {}

impl lsp::notification::Notification for AnalysedNotification {
    type Params = Analysed;
    const METHOD: &'static str = "gccRobot/analysed";
}

pub use gr_backends::plot::trace::base64;

/// u32 numbers as base64.
pub fn integers(values: impl IntoIterator<Item = u32>) -> String {
    let bytes: Vec<u8> = values.into_iter().flat_map(u32::to_le_bytes).collect();
    base64(&bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_are_little_endian() {
        assert_eq!(integers([1, u32::MAX]), "AQAAAP////8=");
    }
}
