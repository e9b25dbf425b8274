//! The solver's thread: takes up what the page says, steps as fast as the clock wants it, and leaves the latest frame.

use super::body::LiveBody;
use super::colours::Colours;
use super::command::{Colour, Command, Message, View};
use super::desk::{Desk, Order};
use super::export::Export;
use super::frame::{Pace, frame_bytes};
use super::hello::hello;
use super::recording::{Recording, Timed};
use super::session::Session;
use crate::fem::live::Readout;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

/// A body that rests, or is paused, looks at the desk this often.
const NAP: Duration = Duration::from_millis(20);
/// Steps between two looks at whether the time step still follows the clock.
const LOOK_EVERY: u64 = 30;
/// Shortest and longest step in time, s: a hundred a second is more than a screen shows; of a body that the solver cannot keep
/// up with, one that moves slowly is better than one that jumps, and longer steps take longer to solve (docs/evidence/choices.md,
/// "Live view").
const TIME_STEPS_S: [f64; 2] = [0.01, 0.05];
/// A time step that is off by less than this part stays: another one makes the preconditioner anew.
const TIME_STEP_SLACK: f64 = 0.15;
/// Steps a second are counted over this time.
const COUNT_OVER: Duration = Duration::from_millis(500);
/// Energy and cells are read out this often: it takes a good part of a step.
const READ_OUT_EVERY: Duration = Duration::from_millis(500);

/// What was measured of a session.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Measured {
    /// Steps taken.
    pub steps: u64,
    /// Seconds spent in them.
    pub stepping_s: f64,
    /// Frames that the page has fetched.
    pub frames: u64,
}

/// A session that has ended.
pub struct Driven {
    /// What was done.
    pub recording: Recording,
    /// How fast.
    pub measured: Measured,
}

/// The thread's own things.
#[allow(clippy::struct_excessive_bools, reason = "each is a switch of its own")]
pub(super) struct Driver<'a> {
    body: &'a LiveBody,
    session: Session,
    desk: &'a Desk,
    recording: Recording,
    /// Commands are kept only where they are asked for: a long session stays small.
    recorded: bool,
    colours: Colours,
    colour: Colour,
    paused: bool,
    single: bool,
    /// What is shown is not what is.
    dirty: bool,
    taken: u32,
    readout: (Readout, Option<Instant>),
    /// Seconds of a step, averaged.
    cost_s: f64,
    measured: Measured,
    /// Steps a second, and since when and from which step they are counted.
    hz: f64,
    counted: (Instant, u64),
}

impl<'a> Driver<'a> {
    pub fn new(body: &'a LiveBody, session: Session, desk: &'a Desk, recorded: bool) -> Self {
        Self {
            body,
            colours: Colours::of(body, session.mesh()),
            session,
            desk,
            recording: Recording::new(body),
            recorded,
            colour: Colour::default(),
            paused: false,
            single: false,
            dirty: true,
            taken: 0,
            readout: (Readout::default(), None),
            cost_s: 0.0,
            measured: Measured::default(),
            hz: 0.0,
            counted: (Instant::now(), 0),
        }
    }

    /// Until the desk is stopped.
    pub fn run(mut self, orders: &Receiver<Order>) -> Driven {
        let mut due = Instant::now();
        while !self.desk.is_stopped() {
            while let Ok(order) = orders.try_recv() {
                self.take_up(&order);
            }
            let still = (self.paused && !self.single) || self.session.is_at_rest();
            if still {
                self.publish();
                match orders.recv_timeout(NAP) {
                    Ok(order) => self.take_up(&order),
                    Err(RecvTimeoutError::Timeout) => {}
                    Err(RecvTimeoutError::Disconnected) => break,
                }
                due = Instant::now();
                self.counted = (due, self.session.steps());
                continue;
            }
            self.step();
            self.publish();
            // The body's time is the clock's, as far as the solver keeps up; what was lost is not caught up with.
            due += Duration::from_secs_f64(self.session.time_step_s());
            match due.checked_duration_since(Instant::now()) {
                Some(early) => self.wait(orders, early),
                None => due = Instant::now(),
            }
        }
        self.recording.steps = self.session.steps();
        self.measured.steps = self.session.steps();
        self.measured.frames = self.desk.frames.load(std::sync::atomic::Ordering::Relaxed);
        Driven { recording: self.recording, measured: self.measured }
    }

    /// Waits until the next step is due; what comes meanwhile is taken up.
    fn wait(&mut self, orders: &Receiver<Order>, early: Duration) {
        let end = Instant::now() + early;
        while let Some(left) = end.checked_duration_since(Instant::now()) {
            match orders.recv_timeout(left) {
                Ok(order) => self.take_up(&order),
                Err(_) => return,
            }
        }
    }

    fn step(&mut self) {
        let begin = Instant::now();
        // On a thread of the pool: each of a step's many small tasks would else be handed over.
        rayon::scope(|_| self.session.step());
        let spent = begin.elapsed().as_secs_f64();
        self.measured.stepping_s += spent;
        self.cost_s = if self.cost_s == 0.0 { spent } else { 0.9 * self.cost_s + 0.1 * spent };
        (self.single, self.dirty) = (false, true);
        let (since, from) = self.counted;
        if since.elapsed() >= COUNT_OVER {
            self.hz = (self.session.steps() - from) as f64 / since.elapsed().as_secs_f64();
            self.counted = (Instant::now(), self.session.steps());
        }
        if self.session.steps().is_multiple_of(LOOK_EVERY) && !self.session.is_quasi_static() {
            let s = (1.1e3 * self.cost_s).ceil() / 1e3;
            let s = s.clamp(TIME_STEPS_S[0], TIME_STEPS_S[1]);
            if (s / self.session.time_step_s() - 1.0).abs() > TIME_STEP_SLACK {
                self.apply(Command::TimeStep { s }).ok();
            }
        }
    }

    fn apply(&mut self, command: Command) -> Result<(), String> {
        self.session.apply(&command)?;
        self.dirty = true;
        // The page knows what it has asked for, but not what is taken back.
        if matches!(command, Command::Undo {} | Command::Reset {}) {
            self.desk.answer(self.hello().to_string());
        }
        if self.recorded {
            self.keep(command);
        }
        Ok(())
    }

    /// Of hands that move between two steps only the last place counts.
    fn keep(&mut self, command: Command) {
        let step = self.session.steps();
        let commands = &mut self.recording.commands;
        let same_hand = |last: &Timed| match (&last.command, &command) {
            (Command::Drag { node: a, .. }, Command::Drag { node: b, .. }) => a == b,
            (Command::Ball { .. }, Command::Ball { .. }) => true,
            _ => false,
        };
        if commands.last().is_some_and(|last| last.step == step && same_hand(last)) {
            commands.pop();
        }
        commands.push(Timed { step, command });
    }

    fn hello(&self) -> serde_json::Value {
        hello(self.body, &self.session, &self.colours)
    }

    fn take_up(&mut self, order: &Order) {
        let mut of_hand = false;
        let done = match order {
            Order::Message(text) => {
                self.taken = self.taken.wrapping_add(1);
                let message = Message::read(text);
                of_hand = matches!(&message, Ok(Message::Command(Command::Drag { .. } | Command::Ball { .. })));
                message.and_then(|message| match message {
                    Message::Command(command) => self.apply(command),
                    Message::View(view) => self.view(&view),
                })
            }
            Order::Joined => {
                (self.dirty, self.taken) = (true, 0);
                self.desk.answer(self.hello().to_string());
                Ok(())
            }
            Order::Left => {
                self.paused = false;
                self.apply(Command::Release {}).and_then(|()| self.apply(Command::Lift {}))
            }
        };
        if let Err(reason) = done {
            let mut answer = serde_json::json!({ "refused": reason });
            if !of_hand {
                // The page's switch stands where it was put: how the body stands, it has to be told. A hand has no switch, and
                // asks eighty times a second.
                answer["stands"] = self.hello();
            }
            self.desk.answer(answer.to_string());
        }
    }

    fn view(&mut self, view: &View) -> Result<(), String> {
        self.dirty = true;
        match view {
            View::Ack {} => {}
            View::Pause { paused } => self.paused = *paused,
            View::Step {} => self.single = true,
            View::Colour { by } => {
                self.colours.choose(*by, self.body)?;
                self.colour = *by;
            }
            View::ExportScenario {} => {
                let text = Export::of(&self.session)?.scenario_toml()?;
                self.desk.answer(serde_json::json!({ "file": "scenario.toml", "text": text }).to_string());
            }
            View::ExportVtu {} => {
                let bytes = Export::of(&self.session)?.coloured(&self.session, &self.colours).vtu()?;
                let text = String::from_utf8(bytes).map_err(|e| e.to_string())?;
                self.desk.answer(serde_json::json!({ "file": "state.vtu", "text": text }).to_string());
            }
        }
        Ok(())
    }

    fn publish(&mut self) {
        if !self.dirty || !self.desk.is_frame_wanted() {
            return;
        }
        let old = self.readout.1.is_none_or(|at| at.elapsed() >= READ_OUT_EVERY);
        let still = self.paused || self.session.is_at_rest();
        if old || still {
            self.readout = (self.session.stepper().readout(), Some(Instant::now()));
        }
        let hz = if still { 0.0 } else { self.hz };
        let colour = self.colours.place(self.colour);
        let pace = Pace { hz: hz as f32, taken: self.taken, paused: self.paused, colour };
        let numbers = self.colours.numbers(&self.session, self.colour);
        self.desk.put_frame(frame_bytes(&self.session, &self.readout.0, &pace, &numbers));
        self.dirty = false;
    }
}
