//! TOML as a tree in which every key and every value knows its place, and the laying of one tree over another.

use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A value and its place.
#[derive(Clone, Debug)]
pub(crate) struct Node {
    pub span: Range<usize>,
    pub value: Value,
}

#[derive(Clone, Debug)]
pub(crate) enum Value {
    Text(String),
    Number(f64),
    Flag(bool),
    List(Vec<Node>),
    Table(Vec<Entry>),
    /// A date.
    Other,
}

#[derive(Clone, Debug)]
pub(crate) struct Entry {
    pub key: String,
    pub key_span: Range<usize>,
    pub node: Node,
}

/// Reads a file; the error has its place.
pub(crate) fn read(text: &str) -> Result<Node, toml::de::Error> {
    let table = DeTable::parse(text)?;
    Ok(Node { span: 0..0, value: Value::Table(entries(table.get_ref())) })
}

fn entries(table: &DeTable<'_>) -> Vec<Entry> {
    let mut out: Vec<Entry> = table
        .iter()
        .map(|(k, v)| Entry { key: k.get_ref().to_string(), key_span: k.span(), node: node(v) })
        .collect();
    out.sort_by_key(|e| e.key_span.start);
    out
}

fn node(value: &Spanned<DeValue<'_>>) -> Node {
    let number = |text: &str| text.replace('_', "").parse::<f64>().unwrap_or(f64::NAN);
    let inner = match value.get_ref() {
        DeValue::String(s) => Value::Text(s.to_string()),
        DeValue::Integer(i) if i.radix() == 10 => Value::Number(number(i.as_str())),
        DeValue::Integer(i) => Value::Number(i64::from_str_radix(i.as_str(), i.radix()).map_or(f64::NAN, |v| v as f64)),
        DeValue::Float(f) => Value::Number(number(f.as_str())),
        DeValue::Boolean(b) => Value::Flag(*b),
        DeValue::Array(a) => Value::List(a.iter().map(node).collect()),
        DeValue::Table(t) => Value::Table(entries(t)),
        DeValue::Datetime(_) => Value::Other,
    };
    Node { span: value.span(), value: inner }
}

impl Node {
    pub fn get(&self, key: &str) -> Option<&Node> {
        self.entries().iter().find(|e| e.key == key).map(|e| &e.node)
    }
    pub fn entries(&self) -> &[Entry] {
        if let Value::Table(t) = &self.value { t } else { &[] }
    }
    pub fn list(&self) -> &[Node] {
        if let Value::List(l) = &self.value { l } else { &[] }
    }
    pub fn text(&self) -> Option<&str> {
        if let Value::Text(t) = &self.value { Some(t) } else { None }
    }
    pub fn number(&self) -> Option<f64> {
        if let Value::Number(n) = &self.value { Some(*n) } else { None }
    }
    pub fn flag(&self) -> Option<bool> {
        if let Value::Flag(f) = &self.value { Some(*f) } else { None }
    }
    pub fn numbers(&self) -> Vec<f64> {
        self.list().iter().filter_map(Node::number).collect()
    }
    pub fn string(&self, key: &str) -> Option<String> {
        self.get(key)?.text().map(str::to_string)
    }
    pub fn value_of(&self, key: &str) -> Option<f64> {
        self.get(key)?.number()
    }
    /// A list of exactly `N` numbers.
    pub fn array<const N: usize>(&self, key: &str) -> Option<[f64; N]> {
        self.get(key)?.numbers().try_into().ok()
    }

    /// Gives everything in here one place: that of the word that brought it in.
    pub fn moved_to(&mut self, place: &Range<usize>) {
        self.span = place.clone();
        match &mut self.value {
            Value::List(l) => l.iter_mut().for_each(|n| n.moved_to(place)),
            Value::Table(t) => t.iter_mut().for_each(|e| {
                e.key_span = place.clone();
                e.node.moved_to(place);
            }),
            _ => {}
        }
    }

    pub fn remove(&mut self, key: &str) -> Option<Node> {
        let Value::Table(t) = &mut self.value else { return None };
        let i = t.iter().position(|e| e.key == key)?;
        Some(t.remove(i).node)
    }

    /// Lays another tree over this one. Tables are merged key by key, lists of tables by their `name` or `number`,
    /// everything else is replaced; a `kinematics` of another kind replaces the old one whole.
    pub fn overlay(&mut self, over: Node) {
        let Value::Table(new) = over.value else {
            *self = over;
            return;
        };
        let Value::Table(old) = &mut self.value else {
            self.value = Value::Table(new);
            return;
        };
        self.span = over.span;
        for e in new {
            match old.iter_mut().find(|o| o.key == e.key) {
                None => old.push(e),
                Some(o) => {
                    o.key_span = e.key_span;
                    lay(&e.key, &mut o.node, e.node);
                }
            }
        }
    }
}

fn lay(key: &str, old: &mut Node, new: Node) {
    let kind = |n: &Node| n.string("kind");
    let tables = matches!((&old.value, &new.value), (Value::Table(_), Value::Table(_)));
    let same_kind = key != "kinematics" || kind(&new).is_none_or(|k| kind(old) == Some(k));
    let listed = new.list().iter().any(|i| matches!(i.value, Value::Table(_))) && key != "rotary";
    if tables && same_kind {
        old.overlay(new);
    } else if listed && matches!(old.value, Value::List(_)) {
        lay_list(old, new);
    } else {
        *old = new;
    }
}

fn lay_list(old: &mut Node, new: Node) {
    let (Value::List(list), Value::List(items)) = (&mut old.value, new.value) else { return };
    let same = |a: &Node, b: &Node| {
        let named = a.string("name").is_some() && a.string("name") == b.string("name");
        named || (a.value_of("number").is_some() && a.value_of("number") == b.value_of("number"))
    };
    for item in items {
        match list.iter_mut().find(|o| same(o, &item)) {
            Some(o) => o.overlay(item),
            None => list.push(item),
        }
    }
}
