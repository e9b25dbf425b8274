//! The server of `hgm live`: who gets in, what reaches the body, what is left when it ends.

use crate::job::program;
use crate::live::{Dice, SCENARIO, TOP, block, body, resectable, wall};
use hgm::live::{Command, Recording, Server, serve};
use hgm::mesh::format::vtu;
use hgm::workflow::Scan;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Command as Process, Stdio};
use std::time::{Duration, Instant};
use tungstenite::protocol::Role;
use tungstenite::{Message, WebSocket};

/// Port and token of an address.
fn parts(address: &str) -> (u16, String) {
    let rest = address.strip_prefix("http://127.0.0.1:").unwrap();
    let (port, token) = rest.trim_end_matches('/').split_once('/').unwrap();
    (port.parse().unwrap(), token.to_owned())
}

/// Sends a request and returns the stream with the head of the answer.
fn ask(port: u16, path: &str, headers: &str) -> (TcpStream, String) {
    let mut stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
    write!(stream, "GET {path} HTTP/1.1\r\n{headers}\r\n\r\n").unwrap();
    let mut head = Vec::new();
    let mut byte = [0];
    while !head.ends_with(b"\r\n\r\n") && stream.read(&mut byte).unwrap_or(0) == 1 {
        head.push(byte[0]);
    }
    (stream, String::from_utf8(head).unwrap())
}

fn knock(address: &str, origin: &str, token: &str) -> (TcpStream, String) {
    let (port, _) = parts(address);
    let headers = format!(
        "Host: 127.0.0.1:{port}\r\nOrigin: {origin}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
         Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ=="
    );
    ask(port, &format!("/{token}/socket"), &headers)
}

fn enter(address: &str) -> WebSocket<TcpStream> {
    let (port, token) = parts(address);
    let begin = Instant::now();
    loop {
        let (stream, head) = knock(address, &format!("http://127.0.0.1:{port}"), &token);
        if head.starts_with("HTTP/1.1 101") {
            return WebSocket::from_raw_socket(stream, Role::Client, None);
        }
        // The one before may still be leaving.
        assert!(begin.elapsed() < Duration::from_secs(10), "{head}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// The next text message; frames in between are acknowledged.
fn next_text(socket: &mut WebSocket<TcpStream>) -> serde_json::Value {
    let begin = Instant::now();
    while begin.elapsed() < Duration::from_secs(20) {
        match socket.read().unwrap() {
            Message::Text(text) => return serde_json::from_str(text.as_str()).unwrap(),
            Message::Binary(_) => socket.send(Message::text(r#"{"do":"ack"}"#)).unwrap(),
            _ => {}
        }
    }
    panic!("no text came")
}

/// The next frame as words of its header.
fn next_frame(socket: &mut WebSocket<TcpStream>) -> Vec<u32> {
    loop {
        if let Message::Binary(bytes) = socket.read().unwrap() {
            let words: Vec<u32> = bytes[..80].as_chunks::<4>().0.iter().map(|w| u32::from_le_bytes(*w)).collect();
            assert_eq!(words[0], u32::from_le_bytes(*b"HGML"));
            if words[1] == 2 {
                socket.send(Message::text(r#"{"do":"ack"}"#)).unwrap();
                return words;
            }
        }
    }
}

#[test]
fn a_page_gets_mesh_targets_and_scan_before_its_first_frame() {
    let mut body = resectable();
    body.sights.targets = vec![("side".to_owned(), wall(-3.0))];
    let values = (0..24).collect();
    body.sights.scan = Some(Scan { dims: [2, 3, 4], origin_mm: [-1.0, 2.0, 0.5], voxel_mm: 1.5, values });
    let server = serve(&body, 0, false).unwrap();
    let mut socket = enter(&server.address());
    let mut got = Vec::new();
    while got.len() < 4 {
        if let Message::Binary(bytes) = socket.read().unwrap() {
            got.push(bytes.to_vec());
        }
    }
    let word = |bytes: &[u8], n: usize| u32::from_le_bytes(bytes[4 * n..4 * n + 4].try_into().unwrap());
    let real = |bytes: &[u8], n: usize| f32::from_bits(word(bytes, n));
    assert_eq!(got.iter().map(|bytes| word(bytes, 1)).collect::<Vec<_>>(), [1, 3, 4, 2]);
    let left = body.mesh.restricted(|l| l != 5).unwrap().0.boundary_facets(|_| true).len() as u32;
    let facets = body.mesh.boundary_facets(|_| true).len() as u32;
    let head: Vec<u32> = (2..7).map(|n| word(&got[0], n)).collect();
    assert_eq!(head, [150, 480, facets, left, 5]);
    assert_eq!(got[0].len() as u32, 28 + 12 * 150 + 12 * (facets + left) + 16 * 480 + 480);
    assert_eq!((word(&got[1], 2), word(&got[1], 3), real(&got[1], 5)), (4, 2, -3.0));
    assert!(got[1].ends_with(b"side"));
    assert_eq!([2, 3, 4].map(|n| word(&got[2], n)), [2, 3, 4]);
    assert_eq!([5, 6, 7, 8].map(|n| real(&got[2], n)), [-1.0, 2.0, 0.5, 1.5]);
    assert_eq!(got[2][36..], (0..24).collect::<Vec<u8>>());
    assert_eq!(word(&got[3], 5) & 8, 0, "the tissue is in place");
    socket.send(Message::text(r#"{"do":"resection","removed":true}"#)).unwrap();
    let begin = Instant::now();
    while next_frame(&mut socket)[5] & 8 == 0 {
        assert!(begin.elapsed() < Duration::from_secs(20));
    }
    server.stopper()();
    server.wait().unwrap();
}

fn served() -> (Server, String) {
    let server = serve(&body(), 0, true).unwrap();
    let address = server.address();
    (server, address)
}

#[test]
fn only_the_right_token_and_origin_get_in_and_only_one_at_a_time() {
    let (server, address) = served();
    let (port, token) = parts(&address);
    let own = format!("http://127.0.0.1:{port}");
    let (mut page, head) = ask(port, &format!("/{token}/"), &format!("Host: 127.0.0.1:{port}"));
    assert!(head.starts_with("HTTP/1.1 200") && head.contains("Content-Security-Policy: default-src 'none'"), "{head}");
    let mut text = String::new();
    page.read_to_string(&mut text).unwrap();
    assert!(text.contains("<canvas"));
    let wrong = "0".repeat(token.len());
    for (origin, token) in [
        (own.as_str(), wrong.as_str()),
        ("http://evil.example", token.as_str()),
        ("null", token.as_str()),
        (own.as_str(), ""),
    ] {
        let (_, head) = knock(&address, origin, token);
        assert!(head.starts_with("HTTP/1.1 403"), "{origin} {token}: {head}");
    }
    assert!(ask(port, &format!("/{token}/"), "Host: evil.example").1.starts_with("HTTP/1.1 403"));
    assert!(
        ask(port, &format!("/{token}/../../etc/passwd"), &format!("Host: 127.0.0.1:{port}"))
            .1
            .starts_with("HTTP/1.1 404")
    );

    let mut first = enter(&address);
    assert!(knock(&address, &own, &token).1.starts_with("HTTP/1.1 409"));
    let begun = next_frame(&mut first);
    assert!(next_frame(&mut first)[3] > begun[3], "the body steps");
    first.close(None).unwrap();
    drop(first);
    let mut second = enter(&address);
    assert!(next_frame(&mut second)[3] > begun[3]);
    server.stopper()();
    let driven = server.wait().unwrap();
    assert_eq!(driven.recording.steps, driven.measured.steps);
}

#[test]
fn malformed_messages_are_refused_with_a_reason_and_change_nothing() {
    let (server, address) = served();
    let mut socket = enter(&address);
    let mut refused = 0;
    assert!(next_text(&mut socket)["laws"].as_array().unwrap().len() > 3);
    let mut rng = Dice::new(3);
    for n in 0..1000 {
        let text = match n % 5 {
            0 => "{".to_owned(),
            1 => format!(r#"{{"do":"modulus","tissue":"../{n}","pa":500}}"#),
            2 => format!(r#"{{"do":"drag","node":{},"to_mm":[0,0,0]}}"#, 1_000_000 + n),
            3 => r#"{"do":"export_vtu","path":"out.vtu"}"#.to_owned(),
            _ => (0..40).map(|_| char::from(32 + (90.0 * rng.uniform()) as u8)).collect(),
        };
        socket.send(Message::text(text)).unwrap();
        if n % 10 == 9 {
            for _ in 0..10 {
                let said = next_text(&mut socket);
                assert!(!said["refused"].as_str().unwrap().is_empty(), "{said}");
                refused += 1;
            }
        }
    }
    assert_eq!(refused, 1000);
    // One that is too long ends the connection, not the session.
    socket.send(Message::text("x".repeat(20_000))).ok();
    drop(socket);
    let mut again = enter(&address);
    assert!(next_text(&mut again)["name"] == "block");
    server.stopper()();
    let driven = server.wait().unwrap();
    let done: Vec<&Command> = driven.recording.commands.iter().map(|timed| &timed.command).collect();
    assert!(
        done.iter().all(|c| matches!(c, Command::Release {} | Command::Lift {} | Command::TimeStep { .. })),
        "{done:?}"
    );
}

#[test]
fn a_refusal_says_how_the_body_stands_and_a_page_that_comes_later_what_is_shown() {
    let (server, address) = served();
    let mut socket = enter(&address);
    let first = next_text(&mut socket);
    let said = |socket: &mut WebSocket<TcpStream>, text: &str| {
        socket.send(Message::text(text)).unwrap();
        next_text(socket)
    };
    // Nothing would hold the body any more.
    let said_of_base = said(&mut socket, r#"{"do":"support","set":"base","held":false}"#);
    assert!(said_of_base["refused"].is_string(), "{said_of_base}");
    assert_eq!(said_of_base["stands"]["held"], serde_json::json!(["base"]));
    let of_hand = said(&mut socket, r#"{"do":"drag","node":1000000,"to_mm":[0,0,0]}"#);
    assert!(of_hand["refused"].is_string() && of_hand["stands"].is_null(), "{of_hand}");

    let shown = |socket: &mut WebSocket<TcpStream>| f32::from_bits(next_frame(socket)[19]) as usize;
    let name = |hello: &serde_json::Value, place: usize| hello["colours"][place].as_str().unwrap().to_owned();
    let begin = Instant::now();
    socket.send(Message::text(r#"{"do":"gravity","m_per_s2":[0,9.81,0]}"#)).unwrap();
    socket.send(Message::text(r#"{"do":"colour","by":"energy"}"#)).unwrap();
    while name(&first, shown(&mut socket)) != "energy" {
        assert!(begin.elapsed() < Duration::from_secs(20));
    }
    // What the body has not got leaves the colour as it is.
    assert!(said(&mut socket, r#"{"do":"colour","by":"estimate_sd"}"#)["refused"].is_string());
    socket.close(None).unwrap();
    drop(socket);
    let mut again = enter(&address);
    let hello = next_text(&mut again);
    // A body at rest may have shown its only frame already.
    again.send(Message::text(r#"{"do":"step"}"#)).unwrap();
    assert_eq!(hello["gravity_m_per_s2"], serde_json::json!([0.0, 9.81, 0.0]));
    assert_eq!(hello["scenario_gravity_m_per_s2"], first["gravity_m_per_s2"]);
    assert_eq!(name(&hello, shown(&mut again)), "energy");
    server.stopper()();
    server.wait().unwrap();
}

#[test]
fn a_client_that_never_reads_holds_up_nobody() {
    let (server, address) = served();
    let (port, token) = parts(&address);
    let (mut silent, head) = knock(&address, &format!("http://127.0.0.1:{port}"), &token);
    assert!(head.starts_with("HTTP/1.1 101"));
    // Half a request beside it, too.
    let mut half = TcpStream::connect(("127.0.0.1", port)).unwrap();
    half.write_all(b"GET /").unwrap();
    std::thread::sleep(Duration::from_millis(700));
    silent.write_all(&[0x81, 0xfe]).unwrap();
    server.stopper()();
    let begin = Instant::now();
    let driven = server.wait().unwrap();
    assert!(begin.elapsed() < Duration::from_secs(5));
    assert!(driven.measured.steps > 10, "{:?}", driven.measured);
    assert!(driven.measured.frames <= 2, "a client that acknowledges nothing gets no more: {:?}", driven.measured);
}

#[test]
fn what_a_page_does_is_recorded_and_replays_to_the_same_end() {
    let (server, address) = served();
    let mut socket = enter(&address);
    next_frame(&mut socket);
    for text in [
        r#"{"do":"modulus","tissue":"grey_matter","pa":2740}"#,
        r#"{"do":"drag","node":137,"to_mm":[25,20,60]}"#,
        r#"{"do":"export_scenario"}"#,
    ] {
        socket.send(Message::text(text)).unwrap();
    }
    let file = loop {
        let said = next_text(&mut socket);
        assert!(said["refused"].is_null(), "{said}");
        if said["file"].is_string() {
            break said;
        }
    };
    assert!(file["text"].as_str().unwrap().contains("shear_modulus_pa = 2740.0"), "{file}");
    server.stopper()();
    let recording = server.wait().unwrap().recording;
    assert!(recording.commands.iter().any(|timed| matches!(timed.command, Command::Drag { node: TOP, .. })));
    let read = Recording::from_text(&recording.to_text()).unwrap();
    assert_eq!(read, recording);
    assert!(read.replay(&body(), &mut |_| ()).unwrap().steps() == recording.steps);
}

#[test]
fn ctrl_c_ends_the_server_and_leaves_the_recording_whole() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("block.vtu"), vtu::encode(&block(), &[], &[]).unwrap()).unwrap();
    std::fs::write(at("s.toml"), SCENARIO).unwrap();
    let words = ["live", "block.vtu", "s.toml", "--no-browser", "--json", "--record", "session.jsonl"];
    let mut running =
        Process::new(program()).current_dir(folder.path()).args(words).stdout(Stdio::piped()).spawn().unwrap();
    let mut printed = String::new();
    let mut out = running.stdout.take().unwrap();
    let mut byte = [0];
    while !printed.ends_with('}') && out.read(&mut byte).unwrap() == 1 {
        printed.push(char::from(byte[0]));
    }
    let address = serde_json::from_str::<serde_json::Value>(&printed).unwrap()["address"].as_str().unwrap().to_owned();
    let mut socket = enter(&address);
    socket.send(Message::text(r#"{"do":"density","kg_per_m3":600}"#)).unwrap();
    next_frame(&mut socket);
    std::thread::sleep(Duration::from_millis(200));
    assert!(Process::new("kill").args(["-INT", &running.id().to_string()]).status().unwrap().success());
    assert_eq!(running.wait().unwrap().code(), Some(0));
    let recording = Recording::from_text(&std::fs::read_to_string(at("session.jsonl")).unwrap()).unwrap();
    assert!(recording.commands.iter().any(|t| t.command == Command::Density { kg_per_m3: 600.0 }), "{recording:?}");
}

#[test]
fn bodies_that_cannot_be_opened_are_refused_by_file() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &[u8]| std::fs::write(folder.path().join(name), text).unwrap();
    write("block.vtu", &vtu::encode(&block(), &[], &[]).unwrap());
    write("set.toml", SCENARIO.replace("'base'", "'skull'").as_bytes());
    write("loose.toml", SCENARIO.replace("['base']", "[]").as_bytes());
    write("bad.toml", b"fixed = 3");
    for (words, word) in [
        (&["block.vtu", "set.toml"][..], "skull"),
        (&["block.vtu", "loose.toml"], "fixed"),
        (&["block.vtu", "bad.toml"], "bad.toml"),
        (&["none.vtu"], "none.vtu"),
        (&["."], "hgm prep"),
    ] {
        let ended =
            Process::new(program()).current_dir(folder.path()).arg("live").args(words).arg("--no-browser").output();
        let ended = ended.unwrap();
        let said = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert_eq!(ended.status.code(), Some(3), "{words:?}: {said}");
        assert!(said.contains(word), "{words:?}: {said}");
    }
    assert!(Path::new(folder.path()).read_dir().unwrap().count() == 4);
}
