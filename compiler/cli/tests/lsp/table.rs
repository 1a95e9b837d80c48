//! `docs/editor-features.md` and these tests say the same.

/// Capabilities that stand in the table.
pub const PROVIDERS: &[&str] = &[
    "hoverProvider",
    "completionProvider",
    "signatureHelpProvider",
    "definitionProvider",
    "referencesProvider",
    "documentHighlightProvider",
    "documentSymbolProvider",
    "workspaceSymbolProvider",
    "codeActionProvider",
    "codeLensProvider",
    "documentFormattingProvider",
    "documentRangeFormattingProvider",
    "documentOnTypeFormattingProvider",
    "renameProvider",
    "documentLinkProvider",
    "foldingRangeProvider",
    "selectionRangeProvider",
    "callHierarchyProvider",
    "linkedEditingRangeProvider",
    "inlayHintProvider",
    "diagnosticProvider",
    "semanticTokensProvider",
];

const SOURCES: &[(&str, &str)] = &[
    ("gcode", include_str!("gcode.rs")),
    ("p21", include_str!("p21.rs")),
    ("config", include_str!("config.rs")),
    ("custom", include_str!("custom.rs")),
    ("server", include_str!("server.rs")),
];

/// Every row names a test that exists, and every test is named.
#[test]
fn every_feature_has_its_test() {
    let docs = include_str!("../../../../docs/editor-features.md");
    let mut named = std::collections::BTreeSet::new();
    for row in docs.lines().filter(|l| l.starts_with('|')) {
        for name in row.split('`').skip(1).step_by(2).filter(|n| n.contains("::")) {
            let (module, test) = name.split_once("::").unwrap_or_default();
            let source = SOURCES.iter().find(|s| s.0 == module).unwrap_or_else(|| panic!("no module {module}")).1;
            assert!(source.contains(&format!("fn {test}()")), "{name} is not a test");
            named.insert(name.to_string());
        }
    }
    for (module, source) in SOURCES {
        for test in source.split("#[test]\nfn ").skip(1).filter_map(|t| t.split("()").next()) {
            assert!(named.contains(&format!("{module}::{test}")), "{module}::{test} stands in no row of docs/editor-features.md");
        }
    }
}
