//! A winder that glides: nothing but its motion moves it.
//!
//! Not here: the motion of several winders side by side, which whoever has the processor for it arranges.
//!
//! Most winders glide most of the time: brakes open, rolls round and sticking to each other, layers of one thickness.
//! A step is then the same for all of them:
//!
//! - [`Motion::advance`](super::motion::Motion::advance) under the motors' torques, [`Winder::substeps`] times;
//! - each time the web of the new state, and whether its [`Limits`](super::Limits) still hold and all is finite.
//!
//! So that several winders can be moved at once, each gives away its [`Winder::sums`], and takes them back with
//! [`Winder::resume`] where one of them comes to a limit. That step it does by itself, from the sums before it.

use super::Winder;
use super::friction::Delay;
use super::rk4::State;
use crate::exchange::{Actuators, Brakes, Faults, Handling, Rider};
use crate::real::{Ring, Scalar};

impl<R: Scalar, const SPANS: usize> Winder<R, SPANS> {
    /// Nothing but its motion moves the winder in a step under these actuators.
    pub fn glides(&self, actuators: &Actuators<R::Si>) -> bool {
        let open = |delay: &Delay, on: bool| !on && delay.rests();
        let brakes = &actuators.brakes;
        let asked = actuators.rider != Rider::default()
            || actuators.handling != Handling::default()
            || actuators.faults != Faults::default();
        let apart = self.holders.winds() || self.eccentricity.present() || self.tail > R::Si::ZERO;
        !asked
            && !apart
            && open(&self.delay.uw, brakes.uw)
            && open(&self.delay.rd, brakes.rd)
            && open(&self.delay.fd, brakes.fd)
    }

    /// The state variables as they are summed up.
    pub fn sums(&self) -> &State<R::Sum, SPANS, 0> {
        &self.state
    }

    /// Goes on from where the winder has glided to, its web as whole or broken as before. Its sensors have not seen
    /// the way there.
    pub fn resume(&mut self, sums: &State<R::Sum, SPANS, 0>) {
        self.state = *sums;
        self.closed = Brakes::default();
        if self.threaded {
            self.look_at_web(None);
        }
    }
}
