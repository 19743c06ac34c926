//! What the firmware has to do while it is measured.
//!
//! Not here: how it gets there. A load sees the guest's frames once a virtual millisecond and answers with its own; it
//! has no clock but that, and no randomness, so that it does the same in every run.

mod host;
mod page;
mod plc;
mod storm;

use std::net::Ipv4Addr;

use anyhow::Result;
use model_core::image::Feedback;

use super::bench::{Frame, Traffic};

/// Something to do for the firmware.
pub trait Load {
    /// A virtual millisecond has passed: takes what the guest has sent, gives what it gets.
    fn beat(&mut self, millisecond: u64, heard: Traffic) -> Result<Traffic>;

    /// At the end: what was done, or that it was not.
    fn done(&self) -> Result<String>;

    /// What the firmware last told of itself, where it was asked.
    fn feedback(&self) -> Option<&Feedback> {
        None
    }
}

/// A kind of load.
pub struct Kind {
    /// Its name.
    pub name: &'static str,
    /// How long it is measured, ms.
    pub milliseconds: u64,
    /// Milliseconds from one beat to the next.
    pub every: u64,
    /// Makes one.
    pub load: fn() -> Box<dyn Load>,
}

/// Every load: one row each.
pub const LOADS: &[Kind] = &[
    Kind {
        name: "idle",
        milliseconds: 10_000,
        every: 100,
        load: || Box::new(Idle),
    },
    Kind {
        name: "polling PLC",
        milliseconds: 25_000,
        every: 1,
        load: || Box::new(plc::Alone::new()),
    },
    Kind {
        name: "PLC on the serial line",
        milliseconds: 25_000,
        every: 1,
        load: || Box::new(plc::Serial::new()),
    },
    Kind {
        name: "three browsers and a PLC",
        milliseconds: 20_000,
        every: 1,
        load: || Box::new(page::Page::new()),
    },
    Kind {
        name: "packet storm",
        milliseconds: 4_000,
        every: 1,
        load: || Box::new(storm::Storm::new()),
    },
];

/// The place of the polling PLC among them.
pub const POLLING: usize = 1;

/// The guest, on the board's own network.
const GUEST: Ipv4Addr = Ipv4Addr::new(10, 0, 2, 15);
const GUEST_MAC: [u8; 6] = [0x02, 0, 0, 0, 0x05, 0];

/// Nothing is connected, and the winder stands still.
struct Idle;

impl Load for Idle {
    fn beat(&mut self, _: u64, _: Traffic) -> Result<Traffic> {
        Ok(Traffic::default())
    }

    fn done(&self) -> Result<String> {
        Ok("nothing connected, drives off".to_owned())
    }
}
