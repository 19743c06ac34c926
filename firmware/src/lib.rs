//! The simulator as firmware, without a board: its tasks, its links, its own HMI, its wires, its journal.
//!
//! Not here: clocks, pins, network devices, executors; a board package has them and calls this library.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod attendant;
mod hash;
pub mod hmi;
pub mod journal;
pub mod life;
pub mod link;
pub mod lockstep;
pub mod mailbox;
pub mod net;
pub mod state;
pub mod store;
pub mod tasks;
pub mod wired;

/// The numbers that the simulator in one hand computes with; a board with tasks chooses its own.
pub type Scalar = f32;
/// Web spans of the machine the firmware is built for.
pub const SPANS: usize = 3;
