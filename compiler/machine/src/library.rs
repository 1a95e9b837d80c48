use crate::schema::parse_reference;
use crate::{Machine, parse};
use gr_text::FileId;

include!(concat!(env!("OUT_DIR"), "/library.rs"));

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

/// A built-in machine as its publication has it.
pub fn reference(id: &str) -> Option<Machine> {
    source(id).and_then(|text| parse_reference(FileId(0), text).ok())
}

/// A machine with the model of its publication, where its file has one, and its cell as it is.
pub fn as_published(machine: &Machine) -> Machine {
    let published = machine.published.as_deref();
    published.map_or_else(|| machine.clone(), |m| Machine { cell: machine.cell.clone(), ..m.clone() })
}

/// The id that a misspelt one most likely means.
pub fn suggestion(id: &str) -> Option<&'static str> {
    crate::keys::suggestion(id, &list().collect::<Vec<_>>())
}

/// Whether what `--machine` was given is a path rather than an id. An id is `maker/model` of a built-in machine;
/// everything else is looked up as a file.
pub fn is_path(name: &str) -> bool {
    source(name).is_none() && (name.ends_with(".toml") || name.contains(['/', '\\', '.']))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHOWN: &[&str] = &[
        "abb/irb2400",
        "comau/tricept806",
        "fanuc/lr-mate-200id",
        "generic/mill3",
        "generic/mill5-ac-table",
        "ufmg/plano-3r",
        "unb/router",
        "universal-robots/ur5",
        "usp/2ups-prp",
    ];

    #[test]
    fn the_catalogue() {
        insta::assert_snapshot!(list().map(|id| format!("{id}  {}\n", builtin(id).unwrap().title)).collect::<String>());
        assert_eq!(suggestion("abb/irb240"), Some("abb/irb2400"));
    }

    #[test]
    fn every_file_is_good_and_named_as_it_says() {
        for id in list() {
            let machine = parse(FileId(0), source(id).unwrap()).unwrap_or_else(|e| panic!("{id}: {e:?}"));
            assert_eq!(machine.id, id);
            parse_reference(FileId(0), source(id).unwrap()).unwrap_or_else(|e| panic!("{id}: {e:?}"));
            assert!(!machine.source.is_empty() && !machine.joints.is_empty(), "{id}");
            if SHOWN.contains(&id) {
                insta::assert_snapshot!(id.replace('/', "_"), machine.describe());
            }
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
