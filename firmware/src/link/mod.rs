//! What connects the process image to a bus.
//!
//! Not here: sockets, serial ports and accept loops, which are a board's, and what a signal means, which is the
//! drive logic's. A link sees the image and nothing else of the simulator.

use core::cell::RefCell;

use embassy_sync::blocking_mutex::Mutex;
use model_core::image::Image;

pub mod modbus;
pub mod seats;

/// The process image as tasks share it. Whatever is done under one lock is one event to everybody else.
///
/// The lock may keep interrupts off: copy, do not compute, while it is held.
pub type ImageCell<M> = Mutex<M, RefCell<Image>>;
