//! A live session: one body stepped in a thread of its own, one page of one browser on this machine that pulls at it.
//!
//! [`Session`] is the body with all that may be done to it, a [`Command`] at a time; the same commands at the same steps give
//! the same bytes, and that is what a [`Recording`] keeps. [`serve`] puts a page before it: a server on the loopback
//! address, a random token in the path, `Host` and `Origin` checked, one client at a time, frames as binary, the latest
//! only. Nothing that comes in over it reaches a file. The clock is asked for the pace alone, never for a result.

mod body;
mod colours;
mod command;
mod desk;
mod export;
mod frame;
mod hello;
mod http;
mod open;
mod pace;
mod page;
mod parts;
mod recording;
mod replay;
mod series;
mod server;
mod session;

pub use body::{LiveBody, LiveTissue, Spread};
pub use colours::Colours;
pub use command::{Colour, Command, View};
pub use export::Export;
pub use frame::{Pace, frame_bytes};
pub use pace::{Driven, Measured};
pub use recording::{Recording, RecordingError, Timed};
pub use replay::{ReplayError, Replayed, check_output, replay_to_files};
pub use series::Series;
pub use server::{ServeError, Server, serve};
pub use session::Session;
