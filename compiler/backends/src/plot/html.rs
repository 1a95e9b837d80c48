//! The page around the preview component (`editors/preview`, whose bundle is committed). Path and program are data in
//! the page; it loads nothing.

use serde_json::{Map, Value};

const PAGE: &str = include_str!("page.html");
/// Built by `npm run build` in `editors/`; a test there proves that it is what its sources give.
const SCRIPT: &str = include_str!("../../../../editors/preview/dist/preview.js");

/// The page. Without a path it asks the server it came from (`gcc-robot preview --serve`).
pub fn page(title: &str, path: Option<Value>, text: Option<&str>) -> String {
    let mut data = Map::new();
    data.insert("title".into(), title.into());
    match path {
        Some(path) => data.insert("path".into(), path),
        None => data.insert("served".into(), true.into()),
    };
    if let Some(text) = text {
        data.insert("text".into(), text.into());
    }
    // In an element of data only `<` could end the element.
    let data = Value::Object(data).to_string().replace('<', "\\u003c");
    let mut out = String::with_capacity(data.len() + SCRIPT.len() + 1024);
    for part in PAGE.split_inclusive("@@") {
        match part.strip_suffix("@@") {
            Some("TITLE") => out.push_str(&escape(title)),
            Some("DATA") => out.push_str(&data),
            Some("SCRIPT") => out.push_str(SCRIPT.trim_end()),
            Some(text) => out.push_str(text),
            None => out.push_str(part),
        }
    }
    out
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
