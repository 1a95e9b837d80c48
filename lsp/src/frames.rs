//! Takes messages that are none out of the client's stream: the server behind ends at the first one it can't read.
//! After nonsense, reading goes on at the next `Content-Length`.

use tokio::io::{AsyncRead, AsyncReadExt as _, AsyncWrite, AsyncWriteExt as _};

/// A header longer than this is none.
const MOST_HEADER: usize = 4096;
/// A longer message is none.
const MOST_BODY: usize = 1 << 31;
const MARK: &[u8] = b"Content-Length:";

/// Passes good messages on until one side is gone.
pub async fn filter(mut from: impl AsyncRead + Unpin, mut to: impl AsyncWrite + Unpin) {
    let mut held: Vec<u8> = Vec::new();
    let mut buffer = vec![0; 1 << 16];
    loop {
        loop {
            match next(&held) {
                Next::More => break,
                Next::Drop(count) => {
                    held.drain(..count);
                }
                Next::Message(header, length) => {
                    let body = &held[header..header + length];
                    let good = serde_json::from_slice::<serde::de::IgnoredAny>(body).is_ok();
                    if good && to.write_all(&held[..header + length]).await.is_err() {
                        return;
                    }
                    // A wrong length may have swallowed the head of the next message.
                    let swallowed = if good { None } else { memchr::memmem::find(body, MARK) };
                    held.drain(..swallowed.map_or(header + length, |at| header + at));
                }
            }
        }
        match from.read(&mut buffer).await {
            Ok(0) | Err(_) => return,
            Ok(n) => held.extend_from_slice(&buffer[..n]),
        }
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
    use super::filter;

    fn through(bytes: &[u8]) -> String {
        let runtime = tokio::runtime::Builder::new_current_thread().build().expect("a runtime");
        let mut out = Vec::new();
        runtime.block_on(filter(bytes, &mut out));
        String::from_utf8(out).expect("text")
    }

    #[test]
    fn nonsense_is_taken_out() {
        let good = "Content-Length: 2\r\n\r\n{}";
        assert_eq!(through(good.as_bytes()), good);
        assert_eq!(through(format!("noise{good}Content-Length: 3\r\n\r\n{{a}}{good}").as_bytes()), format!("{good}{good}"));
        // The length is too great: at the latest the message after the next is found.
        assert_eq!(through(format!("Content-Length: 9\r\n\r\n{{{good}{good}").as_bytes()), good);
        assert_eq!(through(format!("Content-Length: 20\r\n\r\n{{{good}{good}").as_bytes()), format!("{good}{good}"));
        assert_eq!(through(format!("Content-Length: x\r\n\r\n{good}").as_bytes()), good);
        let both = "Content-Type: a\r\nContent-Length: 2\r\n\r\n[]";
        assert_eq!(through(both.as_bytes()), both);
    }
}
