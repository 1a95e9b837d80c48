//! What can be done to an exchange file at a place, beyond the fixes of its diagnostics.

use gr_p21::Kind;
use gr_step::{Type, schema};
use gr_text::Span;

use super::complete::placeholder;
use super::{Doc, attribute};
use crate::{Action, ActionKind, Edit};

/// Files above this are not rewritten as a whole.
const MOST_BYTES: usize = 8_000_000;

/// Actions at a byte.
pub fn actions(doc: Doc<'_>, at: Span) -> Vec<Action> {
    missing(doc, at).into_iter().collect()
}

/// Rewritings of the whole file.
pub fn of_file(doc: Doc<'_>) -> Vec<Action> {
    if doc.text.len() > MOST_BYTES {
        return Vec::new();
    }
    renumber(doc).into_iter().chain(drop_unreferenced(doc)).collect()
}

/// Names of [`of_file`], for files in which it takes a while to know what is to be done.
pub const OF_FILE: [&str; 2] = [NUMBER, DROP];

const NUMBER: &str = "Number instances 1, 2, 3 … in file order";
const DROP: &str = "Remove instances that no project leads to";

/// Creates the instance that a reference names and the file does not have.
fn missing(doc: Doc<'_>, at: Span) -> Option<Action> {
    let n = doc.instance_at(at.start)?;
    let (place, value) = doc.value_at(n, at.start)?;
    let id = doc.file.reference(doc.text, value)?;
    if doc.file.find(id).is_some() {
        return None;
    }
    let model = super::model(doc);
    let a = attribute(model.at(n)?, place)?;
    let keyword = wanted(&a.ty)?;
    let row = schema().entity(*schema().find(&keyword).first()?);
    let values: Vec<&str> = row.attributes().iter().map(|a| placeholder(a).trim_start_matches('\\')).collect();
    let end = doc.file.instances[n as usize].end;
    let text = format!("\n#{id}={keyword}({});", values.join(","));
    Some(Action {
        title: format!("Create #{id} as {keyword}"),
        kind: ActionKind::Fix,
        edits: vec![Edit { span: Span::new(end, end), text }],
    })
}

/// The first entity that can stand where this type is wanted and has instances of its own.
fn wanted(ty: &Type) -> Option<String> {
    let names = match ty {
        Type::Instance(names) => names,
        Type::Select { instances, .. } => instances,
        Type::Aggregate { of, .. } => return wanted(of),
        _ => return None,
    };
    let exact = names.iter().map(|n| schema().text_of(*n).to_uppercase()).find(|k| {
        schema().find(k).iter().any(|e| !schema().entity(*e).is_abstract)
    });
    exact.or_else(|| {
        let fits = |e: &&gr_step::Entity| !e.is_abstract && names.iter().any(|n| e.is_a().contains(n));
        schema().entities.iter().find(fits).map(|e| e.keyword.to_string())
    })
}

fn renumber(doc: Doc<'_>) -> Option<Action> {
    let new = gr_p21::renumber(doc.text).ok()?;
    if new == doc.text {
        return None;
    }
    let text = String::from_utf8(new).ok()?;
    let span = Span::new(0, doc.text.len() as u32);
    Some(Action { title: NUMBER.into(), kind: ActionKind::Source, edits: vec![Edit { span, text }] })
}

/// Removes what no project leads to.
fn drop_unreferenced(doc: Doc<'_>) -> Option<Action> {
    let unused = unreferenced(doc)?;
    if unused.is_empty() {
        return None;
    }
    let edits = unused
        .iter()
        .map(|n| {
            let i = &doc.file.instances[*n as usize];
            let rest = &doc.text[i.end as usize..];
            let line_end = rest.iter().take_while(|b| matches!(b, b' ' | b'\t')).count();
            let line_end = match &rest[line_end..] {
                [b'\r', b'\n', ..] => line_end + 2,
                [b'\n' | b'\r', ..] => line_end + 1,
                _ => 0,
            };
            Edit { span: Span::new(i.start, i.end + line_end as u32), text: String::new() }
        })
        .collect();
    Some(Action { title: DROP.into(), kind: ActionKind::Source, edits })
}

/// Statements that cannot be reached from a project; none when the file has no project or is damaged.
pub fn unreferenced(doc: Doc<'_>) -> Option<Vec<u32>> {
    let model = super::model(doc);
    if !doc.file.faults.is_empty() {
        return None;
    }
    let mut reached = vec![false; doc.file.instances.len()];
    let mut open: Vec<u32> = model.all("project").map(|p| p.index()).collect();
    if open.is_empty() {
        return None;
    }
    while let Some(n) = open.pop() {
        if std::mem::replace(&mut reached[n as usize], true) {
            continue;
        }
        let refs = doc.file.values_of(n).iter().filter(|v| v.kind() == Kind::Reference);
        open.extend(refs.filter_map(|v| doc.file.find(doc.file.reference(doc.text, *v)?)));
    }
    let data = |n: &u32| !reached[*n as usize] && doc.id_span(*n).is_some();
    Some((0..doc.file.instances.len() as u32).filter(data).collect())
}
