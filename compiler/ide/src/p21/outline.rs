//! Outline as the process is planned: project, workplan, workingstep, and its feature, operation and tool. Folding
//! and tokens.

use gr_p21::Kind;
use gr_step::Node;
use gr_text::Span;

use super::{Doc, name_of, words};
use crate::{Fold, Item, ItemKind, Token, TokenKind};

/// Entries and folds: more would be of no use.
const MOST: usize = 5_000;

/// Projects with everything below, as they are planned; a file without one shows its workplans. What a statement refers to
/// stands anywhere in the file, so that the places of this tree do not lie in each other. Editors that look for the entry
/// around the cursor find it in the sections of the file: there the same statements are listed where they stand.
pub fn outline(doc: Doc<'_>) -> Vec<Item> {
    let model = super::model(doc);
    let mut left = MOST;
    let mut items: Vec<Item> = Vec::new();
    for project in model.all("project") {
        let mut item = entry(doc, project, ItemKind::Project);
        item.children.extend(project.node("main_workplan").map(|w| element(doc, w, 0, &mut left)));
        items.push(item);
    }
    if items.is_empty() {
        let used: Vec<u64> = model.all("workplan").flat_map(|w| w.nodes("its_elements")).map(|n| n.id()).collect();
        let roots = model.all("workplan").filter(|w| !used.contains(&w.id()));
        items.extend(roots.map(|w| element(doc, w, 0, &mut left)));
    }
    let stand = in_order(&model);
    let sections = doc.file.sections.iter().map(|section| {
        let span = Span::new(section.span.start, section.span.start + section.name.len() as u32);
        let detail = format!("{} entities", section.instances.len());
        let inside = stand.iter().filter(|(node, _)| section.instances.contains(&node.index()));
        let children = inside.map(|(node, kind)| entry(doc, *node, *kind)).collect();
        Item { kind: ItemKind::Section, name: section.name.into(), detail, range: section.span, span, children }
    });
    // The plan stands between the header and the data, where its first statement is.
    let at = items.first().map_or(u32::MAX, |i| i.range.start);
    let (before, behind): (Vec<Item>, Vec<Item>) = sections.partition(|s| s.range.end <= at);
    items.splice(0..0, before);
    items.extend(behind);
    items
}

/// Statements that the tree may lead to, in the order of the file.
fn in_order<'m>(model: &'m gr_step::Model<'m>) -> Vec<(Node<'m>, ItemKind)> {
    let kinds = [
        ("project", ItemKind::Project),
        ("workingstep", ItemKind::Workingstep),
        ("executable", ItemKind::Workplan),
        ("manufacturing_feature", ItemKind::Feature),
        ("operation", ItemKind::MachiningOperation),
        ("machining_tool", ItemKind::CuttingTool),
    ];
    // Some keywords are a tool in one edition of the standard, and part of one in another.
    let schema = gr_step::schema();
    let fits = |node: &Node<'m>, name: &str| node.entity().is_none_or(|e| e.is_a().iter().any(|n| schema.text_of(*n) == name));
    let of = |(name, kind): (&'static str, ItemKind)| model.all(name).filter(move |n| fits(n, name)).map(move |n| (n, kind));
    let mut found: Vec<(Node<'m>, ItemKind)> = kinds.into_iter().flat_map(of).collect();
    // A workingstep is an executable too: what it is first counts.
    found.sort_by_key(|(node, _)| node.index());
    found.dedup_by_key(|(node, _)| node.index());
    found.truncate(MOST);
    found
}

fn entry(doc: Doc<'_>, node: Node<'_>, kind: ItemKind) -> Item {
    let name = name_of(node);
    let (name, detail) = if name.is_empty() {
        (words(node.keyword()), format!("#{}", node.id()))
    } else {
        (name, format!("#{} {}", node.id(), words(node.keyword())))
    };
    let span = doc.id_span(node.index()).unwrap_or(node.keyword_span());
    Item { kind, name, detail, range: node.span(), span, children: Vec::new() }
}

/// A workplan, a workingstep, or a program structure that holds some.
fn element(doc: Doc<'_>, node: Node<'_>, depth: u32, left: &mut usize) -> Item {
    let step = node.is_a("workingstep");
    let mut item = entry(doc, node, if step { ItemKind::Workingstep } else { ItemKind::Workplan });
    *left = left.saturating_sub(1);
    if depth > 30 || *left == 0 {
        return item;
    }
    if step {
        item.children.extend(node.node("its_feature").map(|f| entry(doc, f, ItemKind::Feature)));
        if let Some(operation) = node.node("its_operation") {
            item.children.push(entry(doc, operation, ItemKind::MachiningOperation));
            item.children.extend(operation.node("its_tool").map(|t| entry(doc, t, ItemKind::CuttingTool)));
        }
        return item;
    }
    let below = ["its_elements", "main_branch", "branches", "true_branch", "false_branch", "body", "its_content", "otherwise_branch"];
    for name in below {
        let Some(value) = node.attr(name) else { continue };
        let nodes: Vec<Node<'_>> = value.node().into_iter().chain(value.items().filter_map(|v| v.node())).collect();
        for n in nodes.into_iter().filter(|n| n.is_a("executable")) {
            item.children.push(element(doc, n, depth + 1, left));
        }
    }
    item
}

/// Sections, statements of several lines, runs of geometry.
pub fn folds(doc: Doc<'_>, lines: &gr_text::LineIndex) -> Vec<Fold> {
    let line = |at: u32| lines.position(at).0;
    let mut found: Vec<Fold> = Vec::new();
    let mut push = |first: u32, last: u32| {
        if last > first && found.len() < MOST {
            found.push(Fold { first, last, comment: false });
        }
    };
    for s in &doc.file.sections {
        push(line(s.span.start), line(s.span.end.saturating_sub(1)));
    }
    let mut run: Option<(u32, u32, u32)> = None;
    for (n, i) in doc.file.instances.iter().enumerate() {
        let (first, last) = (line(i.start), line(i.end.saturating_sub(1)));
        push(first, last);
        let geometry = gr_step::schema().is_a(doc.file.keyword(n as u32), "geometric_representation_item") || is_geometry(doc.file.keyword(n as u32));
        match (&mut run, geometry) {
            (Some((_, end, count)), true) => (*end, *count) = (last, *count + 1),
            (None, true) => run = Some((first, last, 1)),
            (Some((start, end, count)), false) => {
                if *count >= 6 {
                    push(*start, *end);
                }
                run = None;
            }
            (None, false) => {}
        }
    }
    if let Some((start, end, count)) = run.filter(|r| r.2 >= 6) {
        let _ = count;
        push(start, end);
    }
    found.sort_by_key(|f| (f.first, std::cmp::Reverse(f.last)));
    found.dedup_by_key(|f| (f.first, f.last));
    found
}

fn is_geometry(keyword: &str) -> bool {
    matches!(keyword, "CARTESIAN_POINT" | "DIRECTION" | "AXIS2_PLACEMENT_3D" | "VECTOR" | "POLYLINE" | "LINE" | "CIRCLE" | "PLANE")
}

/// Tokens of the statements in a stretch of text.
pub fn tokens(doc: Doc<'_>, span: Span) -> Vec<Token> {
    let mut found = Vec::new();
    let first = doc.file.instances.partition_point(|i| i.end <= span.start);
    for (n, i) in doc.file.instances.iter().enumerate().skip(first).take_while(|(_, i)| i.start < span.end) {
        let mut push = |span: Span, kind: TokenKind, modifiers: u8| {
            if span.end > span.start {
                found.push(Token { span, kind, modifiers });
            }
        };
        if let Some(id) = doc.id_span(n as u32) {
            push(id, TokenKind::Reference, 1);
        }
        let model_span = keyword_span(doc, n as u32);
        push(model_span, TokenKind::Entity, 0);
        let _ = i;
        for v in doc.file.values_of(n as u32) {
            let kind = match v.kind() {
                Kind::Reference => TokenKind::Reference,
                Kind::String | Kind::Binary => TokenKind::String,
                Kind::Enumeration => TokenKind::Enumeration,
                Kind::Integer | Kind::Real => TokenKind::Number,
                Kind::Unset | Kind::Derived => TokenKind::Operator,
                _ => continue,
            };
            push(Span::new(v.start, v.start + v.len()), kind, 0);
        }
    }
    found.sort_by_key(|t| t.span);
    found.dedup_by_key(|t| t.span.start);
    found
}

fn keyword_span(doc: Doc<'_>, n: u32) -> Span {
    let i = &doc.file.instances[n as usize];
    let text = &doc.text[i.start as usize..i.end as usize];
    let from = if text.first() == Some(&b'#') { text.iter().position(|b| *b == b'=').map_or(0, |p| p + 1) } else { 0 };
    let from = from + text[from..].iter().take_while(|b| **b <= b' ').count();
    let len = text[from..].iter().take_while(|b| b.is_ascii_alphanumeric() || **b == b'_').count();
    Span::new(i.start + from as u32, i.start + (from + len) as u32)
}
