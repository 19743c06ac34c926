//! The signals that a winder has as wires, beside the bus: encoders, load cells, relays, switches.
//!
//! Not here: pins and timers, which are a board's. This module turns what the simulator measures into what a timer,
//! a converter or an output is set to, and what stands at the inputs into commands; all of it is pure, and a board
//! only carries it out, every 4 ms after the plant.

mod analog;
mod digital;
mod encoder;

pub use analog::Analog;
pub use digital::{Inputs, Outputs};
pub use encoder::{Angle, Encoder, Leads, Seen, Setting};
