//! What `--target` takes.

/// One row of the table of targets.
pub type Target = gr_spec::TargetDef;

/// All targets, in the order of the table.
pub fn targets() -> &'static [Target] {
    Target::all()
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_table_is_whole() {
        let mut seen = std::collections::BTreeSet::new();
        for t in super::targets() {
            assert!(seen.insert(t.id), "{} twice", t.id);
            assert!(matches!(t.status, "stable" | "experimental" | "planned"), "{}", t.id);
            assert!(!t.extension.is_empty() && !t.title.is_empty() && !t.what.is_empty(), "{}", t.id);
        }
        assert!(gr_spec::TargetDef::find("joint-gcode").is_some());
    }
}
