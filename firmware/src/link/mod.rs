//! What connects the process image to a bus.
//!
//! Not here: sockets, serial ports and accept loops, which are a board's, and what a signal means, which is the
//! drive logic's. A link sees the image and nothing else of the simulator.

use core::cell::RefCell;

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::Instant;
use model_core::image::{Commands, Feedback, Image};
use model_core::machine::Machine;

use self::control::{ClientId, Control, Peer, Protocol};

pub mod control;
pub mod modbus;
pub mod registers;
pub mod seats;

/// The process image as tasks share it. Whatever is done under one lock is one event to everybody else.
///
/// The lock may keep interrupts off: copy, do not compute, while it is held.
pub type ImageCell<M> = Mutex<M, RefCell<Image>>;

/// Control of the winder as the links share it. Who needs both locks takes the image's first.
pub type ControlCell<M> = Mutex<M, RefCell<Control>>;

/// What a board keeps for its links.
pub struct Served<M: RawMutex> {
    /// The process image.
    pub image: ImageCell<M>,
    /// Who may write it.
    pub control: ControlCell<M>,
}

impl<M: RawMutex> Served<M> {
    /// A machine's at power-up.
    pub fn new(machine: &Machine) -> Self {
        Self {
            image: Mutex::new(RefCell::new(Image {
                commands: Commands::of(machine),
                feedback: Feedback::default(),
            })),
            control: Mutex::new(RefCell::new(Control::default())),
        }
    }

    /// What a link serves of it.
    pub fn service(&self) -> Service<'_, M> {
        Service {
            image: &self.image,
            control: &self.control,
        }
    }
}

/// What a link serves.
pub struct Service<'a, M: RawMutex> {
    /// The process image.
    pub image: &'a ImageCell<M>,
    /// Who may write it.
    pub control: &'a ControlCell<M>,
}

impl<M: RawMutex> Clone for Service<'_, M> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<M: RawMutex> Copy for Service<'_, M> {}

impl<'a, M: RawMutex> Service<'a, M> {
    /// A client comes. `None`: it may not.
    pub fn enter(self, peer: Peer, protocol: Protocol) -> Option<Client<'a, M>> {
        let now = Instant::now();
        let enter = |control: &RefCell<Control>| control.borrow_mut().enter(peer, protocol, now);
        let id = self.control.lock(enter)?;
        Some(Client { service: self, id })
    }
}

/// A client of a link, connected until it is dropped.
pub struct Client<'a, M: RawMutex> {
    service: Service<'a, M>,
    id: ClientId,
}

impl<'a, M: RawMutex> Client<'a, M> {
    /// What it is a client of.
    pub fn service(&self) -> Service<'a, M> {
        self.service
    }

    /// What came over its line was no frame.
    pub fn line_error(&self) {
        self.visit(|_, _, control| control.line_error());
    }

    /// One event on image and control.
    fn visit<R>(&self, f: impl FnOnce(ClientId, &mut Image, &mut Control) -> R) -> R {
        let Service { image, control } = self.service;
        image.lock(|image| {
            control.lock(|control| f(self.id, &mut image.borrow_mut(), &mut control.borrow_mut()))
        })
    }
}

impl<M: RawMutex> Drop for Client<'_, M> {
    fn drop(&mut self) {
        let leave = |control: &RefCell<Control>| control.borrow_mut().leave(self.id);
        self.service.control.lock(leave);
    }
}
