use gr_spec::Dialect;

/// A proposal.
#[derive(Clone, Debug, PartialEq)]
pub struct Completion {
    /// What is inserted.
    pub label: String,
    /// Short name.
    pub detail: String,
    /// Markdown.
    pub documentation: String,
}

/// What can be written behind `before`, the line's text up to the cursor.
pub fn complete(before: &str, dialect: &'static Dialect) -> Vec<Completion> {
    let hash = before.rfind('#').filter(|h| before[*h..].bytes().all(|b| b.is_ascii_alphanumeric() || b"#<_".contains(&b)));
    if hash.is_some() {
        let named = gr_spec::parameters().iter().filter(|p| p.name.starts_with('_'));
        return named
            .map(|p| Completion { label: format!("#<{}>", p.name), detail: p.unit.into(), documentation: p.what.into() })
            .collect();
    }
    let start = before.rfind(|c: char| !c.is_ascii_alphanumeric() && c != '.').map_or(0, |p| p + 1);
    let typed = before[start..].to_ascii_uppercase();
    dialect
        .codes
        .iter()
        .filter(|c| c.code.starts_with(&typed))
        .map(|c| Completion { label: c.code.into(), detail: c.title.into(), documentation: c.what.into() })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::complete;
    use gr_spec::Dialect;

    #[test]
    fn codes_and_parameters() {
        let labels = |b: &str| complete(b, Dialect::linuxcnc()).into_iter().map(|c| c.label).collect::<Vec<_>>();
        assert!(labels("G90 g8").contains(&"G83".to_string()));
        assert!(!labels("G90 g8").contains(&"G1".to_string()));
        assert!(labels("G1 X#<_x").contains(&"#<_x>".to_string()));
        assert!(labels("").len() > 50);
    }
}
