//! Which schema a file says it follows, and who wrote it.

use crate::model::{Model, Val};

/// The schema a file follows.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Dialect {
    /// `MACHINING_SCHEMA` (with `MILLING_SCHEMA`, `TURNING_SCHEMA` …): the standard's own.
    Iso14649,
    /// `COMBINED_SCHEMA`: all parts in one.
    Combined,
    /// `COMBINED_SCHEMA` written by STEP Modeler / GRIMA (ST-GENERATOR): its own units and spellings.
    StepModeler,
    /// AP238: `INTEGRATED_CNC_SCHEMA`, `MODEL_BASED_INTEGRATED_MANUFACTURING_SCHEMA`.
    Ap238,
    /// AP242, AP203, AP214, IFC: products without a process; with its name.
    Product(&'static str),
    /// No `FILE_SCHEMA`.
    Missing,
    /// Another schema.
    Unknown,
}

impl Dialect {
    /// Whether its instances are those of ISO 14649.
    pub fn is_14649(self) -> bool {
        matches!(self, Dialect::Iso14649 | Dialect::Combined | Dialect::StepModeler | Dialect::Missing | Dialect::Unknown)
    }
}

/// Schema names of products, and what they are.
static PRODUCTS: &[(&str, &str)] = &[
    ("AP242", "an AP242 product model"),
    ("AP203", "an AP203 product model"),
    ("CONFIG_CONTROL_DESIGN", "an AP203 product model"),
    ("AUTOMOTIVE_DESIGN", "an AP214 product model"),
    ("AP214", "an AP214 product model"),
    ("IFC", "an IFC building model"),
    ("AP209", "an AP209 analysis model"),
    ("STRUCTURAL_ANALYSIS_DESIGN", "an AP209 analysis model"),
];

/// Recognizes a file by its header.
pub fn dialect(model: &Model<'_>) -> Dialect {
    let names = schema_names(model);
    if names.is_empty() {
        return Dialect::Missing;
    }
    let has = |wanted: &str| names.iter().any(|n| n.starts_with(wanted));
    if has("MACHINING_SCHEMA") || has("MILLING_SCHEMA") || has("TURNING_SCHEMA") {
        Dialect::Iso14649
    } else if has("COMBINED_SCHEMA") {
        if generator(model).contains("ST-GENERATOR") { Dialect::StepModeler } else { Dialect::Combined }
    } else if has("INTEGRATED_CNC_SCHEMA") || has("MODEL_BASED_INTEGRATED_MANUFACTURING") || has("AP238") {
        Dialect::Ap238
    } else {
        PRODUCTS.iter().find(|(name, _)| has(name)).map_or(Dialect::Unknown, |(_, what)| Dialect::Product(what))
    }
}

/// Names in `FILE_SCHEMA`: capitals, without the object identifier behind them.
pub(crate) fn schema_names(model: &Model<'_>) -> Vec<String> {
    let Some(header) = model.header("FILE_SCHEMA") else { return Vec::new() };
    let Some(list) = header.parameters().next() else { return Vec::new() };
    let clean = |s: &str| s.split(['{', ' ']).next().unwrap_or("").to_ascii_uppercase();
    list.items().filter_map(Val::string).map(|s| clean(s.trim())).filter(|s| !s.is_empty()).collect()
}

/// The program that wrote the file.
fn generator(model: &Model<'_>) -> String {
    let name = model.header("FILE_NAME").and_then(|h| h.parameters().nth(4));
    name.and_then(|v| v.string().map(|s| s.into_owned())).unwrap_or_default()
}
