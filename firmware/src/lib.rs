//! The simulator as firmware, without a board: its tasks, its links, its wires, its journal.
//!
//! Not here: clocks, pins, network devices, executors; a board package has them and calls this library.
#![no_std]
#![forbid(unsafe_code)]

pub mod journal;
pub mod link;
pub mod lockstep;
pub mod store;
pub mod tasks;
pub mod wired;

/// The numbers the firmware computes with.
pub type Scalar = f32;
/// Web spans of the machine the firmware is built for.
pub const SPANS: usize = 3;
