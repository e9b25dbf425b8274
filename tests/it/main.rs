//! One integration binary: laws that cross rooms, other people's tools, the command line.

mod rooms;
