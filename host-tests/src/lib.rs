//! The simulator on the host.
