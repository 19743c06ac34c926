//! Who is there in every drive cycle.
//!
//! Not here: what they do. The image is locked meanwhile, so that an attendant's acts and what it sees are one event
//! to everybody else; it must be brief.

use model_core::image::Image;
use model_core::machine::Machine;

/// What an attendant wants of the simulator beyond the image. Where plant and regulators run in tasks of their own, it
/// takes some drive cycles until it is done.
// There is no heap to put the machine on, and an order is rare.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Debug)]
pub enum Order {
    /// Keep the state as it is between two drive cycles.
    Keep,
    /// Go on from the state that was kept; nothing where there is none.
    Restore,
    /// Go on with this machine, which is valid, from its power-up.
    Rebuild(Machine),
}

/// What has been done of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Done {
    /// The state before this drive cycle is kept.
    Kept,
    /// This drive cycle is the first that goes on from another state.
    GoesOn,
}

/// Acts before a drive cycle of the logic, sees what came of it, and may want something.
pub trait Attendant {
    /// Before: it may command, as a PLC does.
    fn before(&mut self, cycle: u32, image: &mut Image);
    /// After. What it changes of the commands counts from the next cycle on.
    fn after(&mut self, cycle: u32, image: &mut Image);
    /// What it wants; asked after each cycle, when nothing is under way.
    fn order(&mut self) -> Option<Order>;
    /// Something has been done; `cycle` is the first after it, and the image that before it.
    fn done(&mut self, cycle: u32, what: Done, image: &Image);
}

/// Nobody.
impl Attendant for () {
    fn before(&mut self, _: u32, _: &mut Image) {}
    fn after(&mut self, _: u32, _: &mut Image) {}
    fn order(&mut self) -> Option<Order> {
        None
    }
    fn done(&mut self, _: u32, _: Done, _: &Image) {}
}
