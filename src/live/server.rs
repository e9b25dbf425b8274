//! The server: loopback only, one page, one WebSocket, one client at a time.

use super::body::LiveBody;
use super::desk::{Desk, Order};
use super::frame::{mesh_bytes, scan_bytes, target_bytes};
use super::http::{Request, Verdict, answer, read_head, switch};
use super::pace::{Driven, Driver};
use super::page::page;
use super::session::Session;
use crate::fem::FemError;
use crate::workflow;
use std::fmt::Write as _;
use std::io::{ErrorKind, Write as _};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};
use thiserror::Error;
use tungstenite::protocol::{Role, WebSocketConfig};
use tungstenite::{Error as SocketError, Message, WebSocket};

/// Connections at a time that have not shown who they are.
const MOST_CONNECTIONS: usize = 8;
/// Longest message of a page: a command is a hundred bytes.
const LONGEST_MESSAGE: usize = 16 * 1024;
/// Frames under way: one that is drawn and one that comes.
const FRAMES_UNDER_WAY: u32 = 2;
/// How long a read, or a write that is stuck, may hold up the client's thread.
const TURN: Duration = Duration::from_millis(4);
/// A client that is silent for so long, also to pings, has gone.
const SILENCE: Duration = Duration::from_secs(30);
const PING_EVERY: Duration = Duration::from_secs(10);

/// Why there is no server.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum ServeError {
    #[error("port {port} of this machine cannot be had ({source}): name another one, or 0 for any that is free")]
    Port { port: u16, source: std::io::Error },
    #[error("the system gives no random numbers for the address: {0}")]
    Random(getrandom::Error),
    #[error("{body}: {source}")]
    Body { body: String, source: FemError },
}

impl ServeError {
    /// Who is to do something about it.
    pub fn kind(&self) -> workflow::ErrorKind {
        match self {
            Self::Port { .. } | Self::Body { .. } => workflow::ErrorKind::Rejected,
            Self::Random(_) => workflow::ErrorKind::Failed,
        }
    }
}

/// A server that runs until it is stopped.
pub struct Server {
    desk: Arc<Desk>,
    address: SocketAddr,
    token: String,
    threads: [std::thread::JoinHandle<Option<Driven>>; 2],
}

/// What the threads of connections share.
struct Shared {
    desk: Arc<Desk>,
    port: u16,
    token: String,
    /// What a page gets before its first frame, last first.
    scene: Vec<Vec<u8>>,
    taken: AtomicBool,
    connections: AtomicUsize,
}

/// Opens a session on a body and serves it on this port of the loopback address (0: any that is free); `recorded` keeps what is
/// done.
///
/// # Errors
/// [`ServeError`].
pub fn serve(body: &LiveBody, port: u16, recorded: bool) -> Result<Server, ServeError> {
    let (desk, orders) = Desk::new();
    let desk = Arc::new(desk);
    let taken = |source| ServeError::Port { port, source };
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(taken)?;
    let address = listener.local_addr().map_err(taken)?;
    listener.set_nonblocking(true).map_err(taken)?;
    let token = random_word().map_err(ServeError::Random)?;
    // The session is opened here: what is wrong with it is said before there is an address.
    let session = Session::open(body).map_err(|source| ServeError::Body { body: body.name.clone(), source })?;
    let sights = &body.sights;
    let mut scene: Vec<Vec<u8>> = sights.scan.iter().map(scan_bytes).collect();
    scene.extend(sights.targets.iter().rev().map(|(name, surface)| target_bytes(name, surface)));
    scene.push(mesh_bytes(&session));
    let shared = Arc::new(Shared {
        desk: Arc::clone(&desk),
        port: address.port(),
        token: token.clone(),
        scene,
        taken: AtomicBool::new(false),
        connections: AtomicUsize::new(0),
    });
    let solving = {
        let (desk, body) = (Arc::clone(&desk), body.clone());
        std::thread::spawn(move || {
            // However the solver ends, no page is left before a body that nobody steps.
            let _ends = Ends(&desk);
            let driver = Driver::new(&body, session, &desk, recorded);
            Some(driver.run(&orders))
        })
    };
    let accepting = std::thread::spawn(move || {
        accept(&listener, &shared);
        None
    });
    Ok(Server { desk, address, token, threads: [solving, accepting] })
}

/// Stops the desk when it goes.
struct Ends<'a>(&'a Desk);

impl Drop for Ends<'_> {
    fn drop(&mut self) {
        self.0.stop();
    }
}

impl Server {
    /// Where the page is.
    pub fn address(&self) -> String {
        format!("http://{}/{}/", self.address, self.token)
    }

    /// A word that ends the session from any thread.
    pub fn stopper(&self) -> impl Fn() + Send + Sync + 'static {
        let desk = Arc::clone(&self.desk);
        move || desk.stop()
    }

    /// Waits until the session has ended.
    pub fn wait(self) -> Option<Driven> {
        let [solving, accepting] = self.threads;
        accepting.join().ok();
        solving.join().ok().flatten()
    }
}

/// 128 random bits of the operating system, as a word.
fn random_word() -> Result<String, getrandom::Error> {
    let mut bytes = [0u8; 16];
    getrandom::fill(&mut bytes)?;
    Ok(bytes.iter().fold(String::new(), |mut word, byte| {
        write!(word, "{byte:02x}").ok();
        word
    }))
}

/// Takes connections until the desk is stopped, each in a thread of its own.
fn accept(listener: &TcpListener, shared: &Arc<Shared>) {
    while !shared.desk.is_stopped() {
        match listener.accept() {
            Ok((stream, _)) => {
                if shared.connections.fetch_add(1, Ordering::AcqRel) >= MOST_CONNECTIONS {
                    shared.connections.fetch_sub(1, Ordering::AcqRel);
                    continue;
                }
                let shared = Arc::clone(shared);
                std::thread::spawn(move || {
                    connection(stream, &shared);
                    shared.connections.fetch_sub(1, Ordering::AcqRel);
                });
            }
            Err(_) => std::thread::sleep(Duration::from_millis(10)),
        }
    }
}

fn connection(mut stream: TcpStream, shared: &Shared) {
    let quick = stream.set_nonblocking(false).is_ok()
        && stream.set_read_timeout(Some(Duration::from_millis(200))).is_ok()
        && stream.set_write_timeout(Some(Duration::from_secs(2))).is_ok();
    let request = read_head(&mut stream).and_then(|head| Request::parse(&head));
    let (true, Some(request)) = (quick, request) else { return };
    let mut refuse = |status: u16, why: &str| {
        stream.write_all(&answer(status, "text/plain", format!("{why}\n").as_bytes(), "", shared.port)).ok();
    };
    match request.verdict(&shared.token, shared.port) {
        Verdict::Refused(status, why) => refuse(status, why),
        Verdict::Page => match random_word() {
            Ok(nonce) => {
                let page = answer(200, "text/html", page(&nonce).as_bytes(), &nonce, shared.port);
                stream.write_all(&page).ok();
            }
            Err(_) => refuse(503, "no random numbers"),
        },
        Verdict::Socket => {
            if shared.taken.swap(true, Ordering::AcqRel) {
                refuse(409, "another page has the session");
                return;
            }
            let key = request.websocket_key.unwrap_or_default();
            if stream.write_all(&switch(&key)).is_ok() {
                shared.desk.clear();
                shared.desk.order(Order::Joined);
                client(stream, shared);
                shared.desk.order(Order::Left);
                shared.desk.clear();
            }
            shared.taken.store(false, Ordering::Release);
        }
    }
}

/// Whether an error of the socket only says that nothing has come, or that no more goes out for now.
fn is_pause(error: &SocketError) -> bool {
    matches!(error, SocketError::Io(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted))
}

/// Speaks with a client until it goes, or the session ends.
fn client(stream: TcpStream, shared: &Shared) {
    if stream.set_read_timeout(Some(TURN)).is_err() || stream.set_write_timeout(Some(TURN)).is_err() {
        return;
    }
    stream.set_nodelay(true).ok();
    let limits =
        WebSocketConfig::default().max_message_size(Some(LONGEST_MESSAGE)).max_frame_size(Some(LONGEST_MESSAGE));
    let mut socket = WebSocket::from_raw_socket(stream, Role::Server, Some(limits));
    let mut to_go: Vec<Message> = shared.scene.iter().cloned().map(Message::binary).collect();
    // A part of what was written has not gone out yet.
    let mut stuck = false;
    let mut under_way = 0;
    let (mut heard, mut pinged) = (Instant::now(), Instant::now());
    while !shared.desk.is_stopped() && heard.elapsed() < SILENCE {
        match socket.read() {
            Ok(Message::Text(text)) => {
                heard = Instant::now();
                // The one message that is not the solver's: it only says that there is room for a frame.
                if text.as_str() == r#"{"do":"ack"}"# {
                    under_way = u32::saturating_sub(under_way, 1);
                } else if !shared.desk.order(Order::Message(text.as_str().to_owned())) {
                    shared.desk.answer(r#"{"refused":"too many messages wait; this one was dropped"}"#.to_owned());
                }
            }
            Ok(Message::Close(_)) => break,
            Ok(Message::Binary(_)) => {
                heard = Instant::now();
                shared.desk.answer(r#"{"refused":"commands are text"}"#.to_owned());
            }
            Ok(_) => heard = Instant::now(),
            Err(error) if is_pause(&error) => {}
            Err(_) => break,
        }
        if stuck {
            match socket.flush() {
                Ok(()) => stuck = false,
                Err(error) if is_pause(&error) => continue,
                Err(_) => break,
            }
        }
        if under_way < FRAMES_UNDER_WAY && !shared.desk.is_frame_wanted() && to_go.is_empty() {
            if let Some(frame) = shared.desk.take_frame() {
                under_way += 1;
                to_go.push(Message::binary(frame));
            }
            if under_way < FRAMES_UNDER_WAY {
                shared.desk.want_frame();
            }
        }
        if to_go.is_empty() {
            to_go.extend(shared.desk.take_answer().map(Message::text));
        }
        if to_go.is_empty() && pinged.elapsed() > PING_EVERY {
            pinged = Instant::now();
            to_go.push(Message::Ping(Vec::<u8>::new().into()));
        }
        if let Some(message) = to_go.pop() {
            match socket.write(message).and_then(|()| socket.flush()) {
                Ok(()) => {}
                Err(error) if is_pause(&error) => stuck = true,
                Err(_) => break,
            }
        }
    }
    socket.close(None).ok();
    socket.flush().ok();
}
