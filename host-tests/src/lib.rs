//! The simulator on the host.

pub mod plant;
