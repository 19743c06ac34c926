//! What the Cortex-M boards share, whoever made the chip: tasks of embassy's executor around the library's functions,
//! the way to the log, settings at power-up, memory, and what a restart leaves for the next start.
//!
//! Not here: anything that needs to know the chip.

#![no_std]

mod journal;
pub mod memory;
pub mod net;
pub mod record;
pub mod settings;

pub use journal::Log;

// How memory is copied.
use board_copy as _;

/// Of the macros.
#[doc(hidden)]
pub mod export {
    pub use {embassy_executor, embassy_net, embassy_sync, firmware, static_cell};
}
