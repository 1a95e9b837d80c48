//! Takes messages that are none out of the client's stream: the server behind ends at the first one it can't read.
//! After nonsense, reading goes on at the next `Content-Length`. Text that is no Unicode is mended, not dropped: an
//! edit that is lost would leave the server with another text than the client.
//!
//! The text of a big document is put aside here, and the handler of the message fetches it: on its way through the
//! protocol library it would be copied and parsed several times more.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use tokio::io::{AsyncRead, AsyncReadExt as _, AsyncWrite, AsyncWriteExt as _};

/// A header longer than this is none.
const MOST_HEADER: usize = 4096;
/// A longer message is none.
const MOST_BODY: usize = 1 << 31;
const MARK: &[u8] = b"Content-Length:";

/// Messages of this length are big.
const BIG: usize = 1 << 16;
/// The method stands among the first bytes of a message.
const HEAD: usize = 1024;
const OPENS: &str = "textDocument/didOpen";
/// No text of a document begins like this.
const TICKET: &str = "\0big text ";

/// Texts of big documents on their way, in order.
#[derive(Default)]
pub struct BigTexts(Mutex<(u64, BTreeMap<u64, String>)>);

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Opening {
    jsonrpc: String,
    method: String,
    params: tower_lsp::ls_types::DidOpenTextDocumentParams,
}

impl BigTexts {
    /// The text that `ticket` stands for; none: it stands for itself.
    pub fn take(&self, ticket: &str) -> Option<String> {
        let number = ticket.strip_prefix(TICKET)?.parse().ok()?;
        let mut held = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let text = held.1.remove(&number)?;
        // What came before and was never fetched never will be.
        held.1 = held.1.split_off(&number);
        Some(text)
    }
    /// A message that opens a big document, with a ticket in place of the text. None: another message, or one that has
    /// to be mended.
    fn put_aside(&self, body: &[u8]) -> Option<Vec<u8>> {
        memchr::memmem::find(body.get(..HEAD.min(body.len()))?, OPENS.as_bytes())?;
        let mut message: Opening = serde_json::from_slice(body).ok().filter(|m: &Opening| m.method == OPENS && m.jsonrpc == "2.0")?;
        let mut held = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let number = held.0 + 1;
        let text = std::mem::replace(&mut message.params.text_document.text, format!("{TICKET}{number}"));
        let small = serde_json::to_vec(&message).ok()?;
        held.0 = number;
        held.1.insert(number, text);
        Some(small)
    }
}

/// Passes good messages on until one side is gone.
pub async fn filter(mut from: impl AsyncRead + Unpin, mut to: impl AsyncWrite + Unpin, texts: Arc<BigTexts>) {
    let mut held: Vec<u8> = Vec::new();
    let mut buffer = vec![0; 1 << 18];
    loop {
        loop {
            match next(&held) {
                Next::More => break,
                Next::Drop(count) => {
                    held.drain(..count);
                }
                Next::Message(header, length) => {
                    let body = &held[header..header + length];
                    let small = if length > BIG { texts.put_aside(body) } else { None };
                    let message = small.map(Cow::Owned).or_else(|| readable(body));
                    if let Some(body) = &message {
                        let head = format!("Content-Length: {}\r\n\r\n", body.len());
                        if to.write_all(head.as_bytes()).await.is_err() || to.write_all(body).await.is_err() {
                            return;
                        }
                    }
                    // A wrong length may have swallowed the head of the next message.
                    let swallowed = if message.is_some() { None } else { memchr::memmem::find(&held[header..header + length], MARK) };
                    held.drain(..swallowed.map_or(header + length, |at| header + at));
                    if length > BIG {
                        held.shrink_to(BIG);
                    }
                }
            }
        }
        match from.read(&mut buffer).await {
            Ok(0) | Err(_) => return,
            Ok(n) => held.extend_from_slice(&buffer[..n]),
        }
    }
}

/// What the server behind reads a message as: what it can't read it does not survive.
#[derive(Deserialize)]
#[serde(untagged)]
#[expect(dead_code, reason = "only whether it can be read counts")]
enum Message {
    Response(tower_lsp::jsonrpc::Response),
    Request(tower_lsp::jsonrpc::Request),
}

/// A message that the server behind can read: as it came, mended, or of a request that is none its name and number
/// alone, so that it is answered by an error. None: there is nothing to be made of it.
fn readable(body: &[u8]) -> Option<Cow<'_, [u8]>> {
    let good = |body: &[u8]| std::str::from_utf8(body).is_ok_and(|b| serde_json::from_str::<Message>(b).is_ok());
    if good(body) {
        return Some(Cow::Borrowed(body));
    }
    let mut mended = body.to_vec();
    mend(&mut mended);
    if good(&mended) {
        return Some(Cow::Owned(mended));
    }
    let message: Value = serde_json::from_slice(&mended).ok()?;
    let id = message.get("id").filter(|id| id.is_i64() || id.is_string())?;
    let bare = json!({ "jsonrpc": "2.0", "id": id, "method": message.get("method")?.as_str()? }).to_string().into_bytes();
    good(&bare).then_some(Cow::Owned(bare))
}

/// Bytes that are no UTF-8, and halves of surrogate pairs, are replaced; nothing else moves.
fn mend(body: &mut [u8]) {
    let mut at = 0;
    while let Err(e) = std::str::from_utf8(&body[at..]) {
        at += e.valid_up_to();
        body[at] = b'?';
    }
    let unit = |body: &[u8], at: usize| {
        let digits = body.get(at..at + 6)?.strip_prefix(b"\\u")?;
        u32::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok()
    };
    let mut at = 0;
    while let Some(next) = memchr::memchr(b'\\', &body[at..]) {
        at += next;
        let pair = matches!(unit(body, at), Some(0xD800..=0xDBFF)) && matches!(unit(body, at + 6), Some(0xDC00..=0xDFFF));
        let lone = !pair && matches!(unit(body, at), Some(0xD800..=0xDFFF));
        if lone {
            body[at..at + 6].copy_from_slice(b"\\ufffd");
        }
        // Past the escape: a backslash behind a backslash begins none.
        at = (at + if pair { 12 } else { 2 }).min(body.len());
    }
}

enum Next {
    /// More has to be read.
    More,
    /// So many bytes are nonsense.
    Drop(usize),
    /// A message: bytes of its header and of its body.
    Message(usize, usize),
}

fn next(held: &[u8]) -> Next {
    let Some(start) = memchr::memmem::find(held, MARK) else {
        // The mark may have begun.
        let keep = held.len().min(MARK.len() - 1).min(MOST_HEADER);
        let other_header = held.starts_with(b"Content-") && held.len() < MOST_HEADER;
        return if held.len() > keep && !other_header { Next::Drop(held.len() - keep) } else { Next::More };
    };
    let first = held.starts_with(b"Content-") && memchr::memmem::find(&held[..start], b"\r\n\r\n").is_none();
    if start > 0 && !first {
        return Next::Drop(start);
    }
    let Some(end) = memchr::memmem::find(held, b"\r\n\r\n") else {
        return if held.len() > MOST_HEADER { Next::Drop(MARK.len()) } else { Next::More };
    };
    let header = &held[start + MARK.len()..end];
    let digits = header.split(|b| *b == b'\r').next().and_then(|l| std::str::from_utf8(l).ok()).map(str::trim);
    match digits.and_then(|d| d.parse::<usize>().ok()).filter(|n| *n <= MOST_BODY) {
        Some(length) if held.len() >= end + 4 + length => Next::Message(end + 4, length),
        Some(_) => Next::More,
        None => Next::Drop(end + 4),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn through(bytes: &[u8]) -> String {
        filtered(bytes, Arc::default())
    }

    fn filtered(bytes: &[u8], texts: Arc<BigTexts>) -> String {
        let runtime = tokio::runtime::Builder::new_current_thread().build().expect("a runtime");
        let mut out = Vec::new();
        runtime.block_on(filter(bytes, &mut out, texts));
        String::from_utf8(out).expect("text")
    }

    fn framed(body: &str) -> String {
        format!("Content-Length: {}\r\n\r\n{body}", body.len())
    }

    #[test]
    fn big_texts_take_a_way_of_their_own() {
        let texts: Arc<BigTexts> = Arc::default();
        let message = |method: &str, text: &str| {
            let document = json!({ "uri": "file:///a.ngc", "languageId": "gcode", "version": 1, "text": text });
            framed(&json!({ "jsonrpc": "2.0", "method": method, "params": { "textDocument": document } }).to_string())
        };
        let (small, big) = ("G1 X1\n".to_string(), "G1 X\"é\n".repeat(BIG));
        let other = message("textDocument/other", &big);
        let all = [message(OPENS, &small), message(OPENS, &big), message(OPENS, &big), other.clone()].concat();
        let passed = filtered(all.as_bytes(), texts.clone());
        assert!(passed.starts_with(&message(OPENS, &small)) && passed.ends_with(&other));
        assert!(passed.len() < other.len() + 2000);
        assert_eq!((texts.take("G1 X1\n"), texts.take(&format!("{TICKET}9"))), (None, None));
        // The first one was never asked for.
        assert_eq!(texts.take(&format!("{TICKET}2")), Some(big));
        assert_eq!(texts.take(&format!("{TICKET}1")), None);
    }

    #[test]
    fn nonsense_is_taken_out() {
        let good = framed(r#"{"jsonrpc":"2.0","method":"a"}"#);
        assert_eq!(through(good.as_bytes()), good);
        assert_eq!(through(format!("noise{good}Content-Length: 3\r\n\r\n{{a}}{good}").as_bytes()), format!("{good}{good}"));
        // The length is too great: at the latest the message after the next is found.
        assert_eq!(through(format!("Content-Length: 9\r\n\r\n{{{good}{good}").as_bytes()), good);
        assert_eq!(through(format!("Content-Length: 60\r\n\r\n{{{good}{good}").as_bytes()), format!("{good}{good}"));
        assert_eq!(through(format!("Content-Length: x\r\n\r\n{good}").as_bytes()), good);
        assert_eq!(through(format!("Content-Type: a\r\n{good}").as_bytes()), good);
    }

    #[test]
    fn json_that_is_no_message_is_taken_out() {
        let good = framed(r#"{"jsonrpc":"2.0","id":1,"result":null}"#);
        let deep = format!("{}{}", "[".repeat(200), "]".repeat(200));
        let deep = format!(r#"{{"jsonrpc":"2.0","method":"a","params":{deep}}}"#);
        for bad in ["[]", "null", "3", "{}", r#"{"jsonrpc":"1.0","method":"a"}"#, r#"{"jsonrpc":"2.0","id":{},"method":"a"}"#, r#"{"jsonrpc":"2.0","method":3}"#, &deep] {
            assert_eq!(through(format!("{}{good}", framed(bad)).as_bytes()), good, "{bad}");
        }
        // A request is answered, if only by an error.
        let dup = r#"{"jsonrpc":"2.0","id":7,"id":7,"method":"a","params":{"x":1}}"#;
        assert_eq!(through(framed(dup).as_bytes()), framed(r#"{"id":7,"jsonrpc":"2.0","method":"a"}"#));
    }

    #[test]
    fn text_that_is_no_unicode_is_mended() {
        let message = |text: &str| format!(r#"{{"jsonrpc":"2.0","method":"a","params":["{text}"]}}"#);
        for (text, mended) in [(r"\ud83d\ude00", r"\ud83d\ude00"), (r"a\ud83d", r"a\ufffd"), (r"\ude00\\ud83d\n", r"\ufffd\\ud83d\n")] {
            assert_eq!(through(framed(&message(text)).as_bytes()), framed(&message(mended)), "{text}");
        }
        let latin = framed(&message("#")).into_bytes().into_iter().map(|b| if b == b'#' { 0xE9 } else { b }).collect::<Vec<u8>>();
        assert_eq!(through(&latin), framed(&message("?")));
    }
}
