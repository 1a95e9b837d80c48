//! Just enough XML to read what robot controllers exchange: elements, attributes, text.

use super::Fault;

/// One thing in a document, in order.
#[derive(Clone, PartialEq, Debug)]
pub(crate) enum Node {
    /// `<name a="b">`; true = closed at once.
    Open(String, Vec<(String, String)>, bool),
    /// `</name>`
    Close(String),
    /// Text between, trimmed, not empty.
    Text(String),
}

/// Reads a document.
pub(crate) fn nodes(text: &str) -> Result<Vec<Node>, Fault> {
    let mut out = Vec::new();
    let mut rest = text;
    let mut depth: Vec<String> = Vec::new();
    while let Some(at) = rest.find('<') {
        let between = rest[..at].trim();
        if !between.is_empty() {
            out.push(Node::Text(plain(between)));
        }
        rest = &rest[at..];
        let end = if rest.starts_with("<!--") { "-->" } else if rest.starts_with("<![CDATA[") { "]]>" } else { ">" };
        let close = rest.find(end).ok_or("a tag does not end")?;
        let inside = &rest[1..close];
        rest = &rest[close + end.len()..];
        if inside.starts_with("!--") || inside.starts_with('?') {
            continue;
        }
        if let Some(data) = inside.strip_prefix("![CDATA[") {
            out.push(Node::Text(data.to_string()));
        } else if let Some(name) = inside.strip_prefix('/') {
            if depth.pop().as_deref() != Some(name.trim()) {
                return Err(format!("</{name}> closes nothing"));
            }
            out.push(Node::Close(name.trim().to_string()));
        } else {
            let closed = inside.ends_with('/');
            let (name, attributes) = tag(inside.trim_end_matches('/'))?;
            if !closed {
                depth.push(name.clone());
            }
            out.push(Node::Open(name, attributes, closed));
        }
    }
    if depth.is_empty() { Ok(out) } else { Err(format!("<{}> is not closed", depth.join("><"))) }
}

fn tag(text: &str) -> Result<(String, Vec<(String, String)>), Fault> {
    let text = text.trim();
    let (name, mut rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
    let mut out = Vec::new();
    while let Some((key, tail)) = rest.split_once('=') {
        let tail = tail.trim_start().strip_prefix('"').ok_or("an attribute without quotes")?;
        let (value, tail) = tail.split_once('"').ok_or("an attribute does not end")?;
        out.push((key.trim().to_string(), plain(value)));
        rest = tail;
    }
    Ok((name.to_string(), out))
}

fn plain(text: &str) -> String {
    text.replace("&lt;", "<").replace("&gt;", ">").replace("&quot;", "\"").replace("&amp;", "&")
}

/// An attribute.
pub(crate) fn get<'a>(attributes: &'a [(String, String)], name: &str) -> Option<&'a str> {
    attributes.iter().find(|a| a.0 == name).map(|a| a.1.as_str())
}

/// An attribute as a number.
pub(crate) fn value(attributes: &[(String, String)], name: &str) -> Option<f64> {
    get(attributes, name)?.parse().ok()
}
