use crate::{Machine, parse};
use gr_text::FileId;

/// Id and text of the machine files that come with the program.
const FILES: &[(&str, &str)] = &[
    ("generic/mill3", include_str!("../../../spec/machines/generic/mill3.toml")),
    ("ufmg/plano-3r", include_str!("../../../spec/machines/ufmg/plano-3r.toml")),
];

/// Ids of the built-in machines, in order.
pub fn list() -> impl Iterator<Item = &'static str> {
    FILES.iter().map(|(id, _)| *id)
}

/// The file of a built-in machine.
pub fn source(id: &str) -> Option<&'static str> {
    FILES.iter().find(|(i, _)| *i == id).map(|(_, text)| *text)
}

/// A built-in machine.
pub fn builtin(id: &str) -> Option<Machine> {
    source(id).and_then(|text| parse(FileId(0), text).ok())
}

/// Whether what `--machine` was given is a path rather than an id. An id is `maker/model` of a built-in machine;
/// everything else is looked up as a file.
pub fn is_path(name: &str) -> bool {
    source(name).is_none() && (name.ends_with(".toml") || name.contains(['/', '\\', '.']))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_is_good_and_named_as_it_says() {
        for id in list() {
            let machine = parse(FileId(0), source(id).unwrap()).unwrap_or_else(|e| panic!("{id}: {e:?}"));
            assert_eq!(machine.id, id);
            insta::assert_snapshot!(id.replace('/', "_"), machine.describe());
        }
    }

    #[test]
    fn ids_and_paths() {
        assert!(!is_path("ufmg/plano-3r"));
        assert!(is_path("./my-mill.toml"));
        assert!(is_path("shop/mill"));
        assert!(!is_path("nothing"));
    }
}
