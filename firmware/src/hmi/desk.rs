//! What the HMI has beside the process image, and where it meets the simulator.
//!
//! Not here: anything that takes time. The simulator comes by in every drive cycle, with the image locked.

use core::cell::RefCell;

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_sync::watch::{Receiver, Watch};
use model_core::image::Image;

use super::Hmi;
use crate::attendant::{Attendant, Done, Order};
use crate::link::ControlCell;

/// Streams of signals at once; each has a connection of its own.
pub const STREAMS: usize = 12;

/// What a board tells about itself.
#[derive(Clone, Copy, Debug)]
pub struct Board {
    /// What it is, for people.
    pub name: &'static str,
    /// The firmware's version.
    pub version: &'static str,
}

/// The desk.
pub struct Desk<M: RawMutex> {
    /// The board.
    pub board: Board,
    cycles: Watch<M, u32, STREAMS>,
    papers: Mutex<M, RefCell<Papers>>,
}

/// What lies on it.
struct Papers {
    /// Drive cycles since power-up.
    cycle: u32,
}

impl<M: RawMutex> Desk<M> {
    /// The desk of a board at power-up.
    pub const fn new(board: Board) -> Self {
        Self {
            board,
            cycles: Watch::new(),
            papers: Mutex::new(RefCell::new(Papers { cycle: 0 })),
        }
    }

    /// Tells of every drive cycle; none when as many as there can be are told already.
    pub fn cycles(&self) -> Option<Receiver<'_, M, u32, STREAMS>> {
        self.cycles.receiver()
    }

    fn with<R>(&self, f: impl FnOnce(&mut Papers) -> R) -> R {
        self.papers.lock(|papers| f(&mut papers.borrow_mut()))
    }
}

/// Who sits at the desk and comes to the simulator in every drive cycle.
pub struct AtDesk<'a, M: RawMutex> {
    /// Who controls the winder.
    pub control: &'a ControlCell<M>,
    /// The desk.
    pub desk: &'a Desk<M>,
}

impl<M: RawMutex> Attendant for AtDesk<'_, M> {
    fn before(&mut self, _cycle: u32, _image: &mut Image) {}

    fn after(&mut self, cycle: u32, _image: &Image) {
        self.desk.with(|papers| papers.cycle = cycle);
        self.desk.cycles.sender().send(cycle);
    }

    fn order(&mut self) -> Option<Order> {
        None
    }

    fn done(&mut self, _cycle: u32, _what: Done) {}
}

impl<M: RawMutex> Hmi<'_, M> {
    /// The image, and the drive cycle that made it.
    pub fn moment(&self) -> (u32, Image) {
        self.service.image.lock(|image| {
            let cycle = self.desk.with(|papers| papers.cycle);
            (cycle, *image.borrow())
        })
    }
}
