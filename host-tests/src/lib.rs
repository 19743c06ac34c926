//! The simulator on the host.
//!
//! Not here: anything that computes a winder (that is `model-core`'s) or answers a PLC (that is the firmware's).
//! This library starts simulators, commands them as a winder PLC would, and shows what came of it. Its one
//! program is the command line tool `winder`: a module of [`command`] for each subcommand.

pub mod accept;
pub mod batch;
pub mod command;
pub mod conformance;
pub mod figures;
pub mod flops;
pub mod handbook;
pub mod interrupt;
pub mod lesson;
pub mod link;
pub mod log;
pub mod machine_file;
pub mod namespace;
pub mod peers;
pub mod plant;
pub mod plc;
pub mod plot;
pub mod qemu;
pub mod report;
pub mod scenario;
pub mod setup;
pub mod signals;
pub mod simulator;
pub mod st;
pub mod timing;
pub mod twin;
