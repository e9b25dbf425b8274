//! The little of HTTP that a page and the opening of a WebSocket need (RFC 9112, RFC 6455): the head of a request, who may
//! ask, and what is answered.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use sha1::{Digest, Sha1};
use std::io::{ErrorKind, Read};
use std::time::{Duration, Instant};

/// Longest head of a request.
const MOST_BYTES: usize = 8192;
/// Who has not asked by then never will.
const PATIENCE: Duration = Duration::from_secs(5);
/// RFC 6455, section 1.3.
const WEBSOCKET_GUID: &str = "258EAFA5-E914-47DA-95CA-C5AB0DC85B11";

/// The head of a request, as far as it matters.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Request {
    pub method: String,
    pub path: String,
    pub host: Option<String>,
    pub origin: Option<String>,
    /// `Sec-WebSocket-Key` of a request to switch to a WebSocket of version 13.
    pub websocket_key: Option<String>,
}

/// What a request gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    /// The page.
    Page,
    /// The WebSocket.
    Socket,
    /// Nothing, with a status and why.
    Refused(u16, &'static str),
}

/// Reads the head of a request; `None` for what is none, is too long or takes too long.
pub(super) fn read_head(stream: &mut impl Read) -> Option<String> {
    let begin = Instant::now();
    let mut head = Vec::new();
    let mut byte = [0];
    // Byte by byte: what follows the head belongs to the WebSocket.
    while head.len() < MOST_BYTES && begin.elapsed() < PATIENCE {
        match stream.read(&mut byte) {
            Ok(0) => return None,
            Ok(_) => head.push(byte[0]),
            Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted) => {}
            Err(_) => return None,
        }
        if head.ends_with(b"\r\n\r\n") {
            return String::from_utf8(head).ok();
        }
    }
    None
}

impl Request {
    /// The parts of a head.
    pub fn parse(head: &str) -> Option<Self> {
        let mut lines = head.split("\r\n");
        let mut first = lines.next()?.split(' ');
        let (method, path, version) = (first.next()?, first.next()?, first.next()?);
        if !version.starts_with("HTTP/1.1") {
            return None;
        }
        let mut request = Self { method: method.to_owned(), path: path.to_owned(), ..Self::default() };
        let (mut upgrades, mut version_13, mut key) = (false, false, None);
        for line in lines.take_while(|line| !line.is_empty()) {
            let (name, value) = line.split_once(':')?;
            let value = value.trim();
            match name.to_ascii_lowercase().as_str() {
                // Two of them would be two answers to who asks.
                "host" if request.host.is_some() => return None,
                "origin" if request.origin.is_some() => return None,
                "host" => request.host = Some(value.to_owned()),
                "origin" => request.origin = Some(value.to_owned()),
                "upgrade" => upgrades = value.eq_ignore_ascii_case("websocket"),
                "sec-websocket-version" => version_13 = value == "13",
                "sec-websocket-key" => key = Some(value.to_owned()),
                _ => {}
            }
        }
        request.websocket_key = key.filter(|_| upgrades && version_13);
        Some(request)
    }

    /// Whether it may be answered. A page of another origin can send anything here, but not our `Host`, where it came by a
    /// name of its own (DNS rebinding), nor our `Origin`; a program of another user knows no token.
    pub fn verdict(&self, token: &str, port: u16) -> Verdict {
        let hosts = [format!("127.0.0.1:{port}"), format!("localhost:{port}")];
        let Some(host) = self.host.as_ref().filter(|host| hosts.contains(host)) else {
            return Verdict::Refused(403, "another host");
        };
        let own = format!("http://{host}");
        if self.origin.as_ref().is_some_and(|origin| *origin != own) {
            return Verdict::Refused(403, "another origin");
        }
        let Some(rest) = self.path.strip_prefix('/').and_then(|path| below(path, token)) else {
            return Verdict::Refused(403, "the token is wrong");
        };
        match (self.method.as_str(), rest) {
            ("GET", "/") => Verdict::Page,
            ("GET", "/socket") if self.websocket_key.is_none() => {
                Verdict::Refused(426, "a WebSocket is asked for here")
            }
            // Every browser says where a WebSocket comes from.
            ("GET", "/socket") if self.origin.is_none() => Verdict::Refused(403, "no origin"),
            ("GET", "/socket") => Verdict::Socket,
            ("GET", _) => Verdict::Refused(404, "there is nothing here"),
            _ => Verdict::Refused(405, "only GET"),
        }
    }
}

/// What follows the token; the time taken does not tell how much of it was right.
fn below<'a>(path: &'a str, token: &str) -> Option<&'a str> {
    let given = path.as_bytes().get(..token.len())?;
    let differs = given.iter().zip(token.as_bytes()).fold(0, |sum, (a, b)| sum | (a ^ b));
    if differs == 0 { path.get(token.len()..) } else { None }
}

/// A whole answer. The page may load nothing and speak to nobody but its own socket.
pub(super) fn answer(status: u16, kind: &str, body: &[u8], nonce: &str, port: u16) -> Vec<u8> {
    let reason = match status {
        200 => "OK",
        404 => "Not Found",
        405 => "Method Not Allowed",
        409 => "Conflict",
        426 => "Upgrade Required",
        503 => "Service Unavailable",
        _ => "Forbidden",
    };
    let head = format!(
        "HTTP/1.1 {status} {reason}\r\nContent-Type: {kind}; charset=utf-8\r\nContent-Length: {}\r\n\
         Content-Security-Policy: default-src 'none'; script-src 'nonce-{nonce}'; style-src 'nonce-{nonce}'; \
         connect-src ws://127.0.0.1:{port} ws://localhost:{port}; img-src data: blob:; base-uri 'none'; \
         form-action 'none'; frame-ancestors 'none'\r\nX-Content-Type-Options: nosniff\r\nReferrer-Policy: no-referrer\r\n\
         Cross-Origin-Opener-Policy: same-origin\r\nCross-Origin-Resource-Policy: same-origin\r\nCache-Control: no-store\r\n\
         Connection: close\r\n\r\n",
        body.len()
    );
    [head.as_bytes(), body].concat()
}

/// The answer that opens a WebSocket.
pub(super) fn switch(key: &str) -> Vec<u8> {
    let accept = STANDARD.encode(Sha1::digest(format!("{key}{WEBSOCKET_GUID}")));
    format!(
        "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
         Sec-WebSocket-Accept: {accept}\r\n\r\n"
    )
    .into_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(path: &str, more: &str) -> Verdict {
        let head = format!("GET {path} HTTP/1.1\r\n{more}\r\n\r\n");
        Request::parse(&head).unwrap().verdict("secret", 8000)
    }

    #[test]
    fn only_this_host_this_origin_and_this_token_are_answered() {
        let host = "Host: 127.0.0.1:8000";
        let socket = format!("{host}\r\nUpgrade: WebSocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: x");
        assert_eq!(asked("/secret/", host), Verdict::Page);
        assert_eq!(asked("/secret/socket", &format!("{socket}\r\nOrigin: http://127.0.0.1:8000")), Verdict::Socket);
        let refused = |verdict| matches!(verdict, Verdict::Refused(..));
        for path in ["/", "/secre/", "/Secret/", "/secretx/", "/secret", "/secret/../", "/etc/passwd"] {
            assert!(refused(asked(path, host)), "{path}");
        }
        for more in ["X: y", "Host: evil.org:8000", "Host: 127.0.0.1:8001", "Host: 127.0.0.1:8000\r\nOrigin: null"] {
            assert!(refused(asked("/secret/", more)), "{more}");
        }
        for origin in ["http://localhost:8000", "https://127.0.0.1:8000", "http://evil.org", "null"] {
            assert!(refused(asked("/secret/socket", &format!("{socket}\r\nOrigin: {origin}"))), "{origin}");
        }
        assert!(refused(asked("/secret/socket", &socket)), "no origin at all");
        assert!(Request::parse("GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n").is_none());
        assert!(Request::parse("nonsense").is_none());
    }

    #[test]
    fn the_key_is_answered_as_in_the_standard() {
        // RFC 6455, section 1.3.
        let answer = String::from_utf8(switch("dGhlIHNhbXBsZSBub25jZQ==")).unwrap();
        assert!(answer.contains("s3pPLMBiTxaQ9kYGzzhZRbK+xOo="), "{answer}");
    }

    #[test]
    fn a_head_without_end_is_given_up() {
        let long = vec![b'a'; MOST_BYTES + 10];
        assert_eq!(read_head(&mut long.as_slice()), None);
        assert_eq!(read_head(&mut &b"GET / HTTP/1.1\r\n"[..]), None);
    }
}
