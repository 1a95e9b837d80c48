//! The product structure of AP203, AP214, AP238 and AP242 files: which products there are and what they consist of.
//! Shapes are not looked at.

use std::collections::BTreeMap;

use crate::model::{Model, Node};

/// Lines that are shown; the rest is counted.
const SHOWN: usize = 12;

/// One line per product that is no part of another's line, in file order.
pub(crate) fn structure(model: &Model<'_>) -> Vec<String> {
    let products: Vec<Node<'_>> = model.instances().filter(|n| n.keyword() == "PRODUCT" && !n.complex()).collect();
    // Of each assembly, its components and how often each is used.
    let mut assemblies: BTreeMap<u32, Vec<(u32, usize)>> = BTreeMap::new();
    let mut used = std::collections::BTreeSet::new();
    for use_of in model.instances().filter(|n| n.keyword() == "NEXT_ASSEMBLY_USAGE_OCCURRENCE" && !n.complex()) {
        let (Some(whole), Some(part)) = (product(use_of, 3), product(use_of, 4)) else { continue };
        used.insert(part.index());
        let parts = assemblies.entry(whole.index()).or_default();
        match parts.iter_mut().find(|p| p.0 == part.index()) {
            Some(p) => p.1 += 1,
            None => parts.push((part.index(), 1)),
        }
    }
    let mut lines = Vec::new();
    for p in products {
        match assemblies.get(&p.index()) {
            Some(parts) => lines.push(format!("assembly {} of {}", name(p), listed(model, parts))),
            None if !used.contains(&p.index()) => lines.push(format!("product {}", name(p))),
            None => {}
        }
    }
    let more = lines.len().saturating_sub(SHOWN);
    lines.truncate(SHOWN);
    if more > 0 {
        lines.push(format!("and {more} more products"));
    }
    lines
}

fn listed(model: &Model<'_>, parts: &[(u32, usize)]) -> String {
    let one = |(n, count): &(u32, usize)| {
        let name = model.at(*n).map(name)?;
        Some(if *count > 1 { format!("{count} × {name}") } else { name })
    };
    let mut all: Vec<String> = parts.iter().take(SHOWN).filter_map(one).collect();
    if parts.len() > SHOWN {
        all.push(format!("{} more", parts.len() - SHOWN));
    }
    all.join(", ")
}

/// The product behind a product definition: definition → version → product.
fn product(use_of: Node<'_>, place: usize) -> Option<Node<'_>> {
    let definition = use_of.parameters().nth(place)?.node()?;
    let version = definition.parameters().nth(2)?.node()?;
    version.parameters().nth(2)?.node().filter(|p| p.keyword() == "PRODUCT")
}

/// Its name and id, or its number where it has neither.
fn name(product: Node<'_>) -> String {
    let text = |n: usize| product.parameters().nth(n).and_then(|v| v.string()).filter(|s| !s.trim().is_empty());
    match (text(1), text(0)) {
        (Some(name), Some(id)) if name != id => format!("'{name}' ({id})"),
        (Some(one), _) | (None, Some(one)) => format!("'{one}'"),
        (None, None) => format!("#{}", product.id()),
    }
}
