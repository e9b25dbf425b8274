//! Where the solver's thread and the client's meet: orders in, answers and the latest frame out. Neither waits for the other,
//! and nothing grows: a frame that was not fetched is replaced, answers that nobody reads are dropped.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Messages of a page that wait for the solver.
const WAITING: usize = 1024;
/// Answers that wait for the page.
const ANSWERS: usize = 32;

/// What the page, or the server, tells the solver's thread.
#[derive(Debug)]
pub(super) enum Order {
    /// A message of the page.
    Message(String),
    /// A page has come: it needs a first frame.
    Joined,
    /// The page has gone: hands let go.
    Left,
}

/// The desk between two threads.
#[derive(Debug)]
pub(super) struct Desk {
    orders: SyncSender<Order>,
    frame: Mutex<Option<Vec<u8>>>,
    answers: Mutex<VecDeque<String>>,
    wanted: AtomicBool,
    stopped: AtomicBool,
    /// Frames handed out.
    pub frames: AtomicU64,
}

fn held<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // What is behind these locks is whole at every moment.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Desk {
    /// A desk, and where its orders come out.
    pub fn new() -> (Self, Receiver<Order>) {
        let (orders, come_out) = sync_channel(WAITING);
        let desk = Self {
            orders,
            frame: Mutex::new(None),
            answers: Mutex::new(VecDeque::new()),
            wanted: AtomicBool::new(false),
            stopped: AtomicBool::new(false),
            frames: AtomicU64::new(0),
        };
        (desk, come_out)
    }

    /// Puts an order there; `false` when too many wait.
    pub fn order(&self, order: Order) -> bool {
        !matches!(self.orders.try_send(order), Err(TrySendError::Full(_)))
    }

    /// Asks for the next frame.
    pub fn want_frame(&self) {
        self.wanted.store(true, Ordering::Release);
    }

    /// Whether a frame is asked for.
    pub fn is_frame_wanted(&self) -> bool {
        self.wanted.load(Ordering::Acquire)
    }

    /// Puts a frame there, in the place of one that nobody fetched.
    pub fn put_frame(&self, bytes: Vec<u8>) {
        *held(&self.frame) = Some(bytes);
        self.wanted.store(false, Ordering::Release);
    }

    /// Fetches the frame.
    pub fn take_frame(&self) -> Option<Vec<u8>> {
        let frame = held(&self.frame).take();
        self.frames.fetch_add(u64::from(frame.is_some()), Ordering::Relaxed);
        frame
    }

    /// Says something to the page.
    pub fn answer(&self, text: String) {
        let mut answers = held(&self.answers);
        if answers.len() < ANSWERS {
            answers.push_back(text);
        }
    }

    /// The next answer.
    pub fn take_answer(&self) -> Option<String> {
        held(&self.answers).pop_front()
    }

    /// Forgets what was meant for a page that has gone.
    pub fn clear(&self) {
        *held(&self.frame) = None;
        held(&self.answers).clear();
        self.wanted.store(false, Ordering::Release);
    }

    /// Ends the session.
    pub fn stop(&self) {
        self.stopped.store(true, Ordering::Release);
    }

    /// Whether the session ends.
    pub fn is_stopped(&self) -> bool {
        self.stopped.load(Ordering::Acquire)
    }
}
