//! The page in a real browser, on the firmware in QEMU. `cargo winder test` runs it.
//!
//! Not here: the HTTP API by itself. What the page claims is held against the image that a PLC reads over Modbus TCP.

// counts are equal, or they are not
#![allow(clippy::float_cmp)]

mod bench;
mod chromium;
mod files;
mod load;
mod looks;
mod settings;
mod work;
