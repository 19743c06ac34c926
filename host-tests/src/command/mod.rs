//! The subcommands of `winder`, a module each.

pub mod accept;
pub mod bench;
pub mod conformance;
pub mod demo;
pub mod figures;
pub mod flash;
pub mod fuzz;
pub mod lesson;
mod link_bench;
pub mod machine;
pub mod plc;
pub mod replay;
pub mod run;
pub mod scenario;
pub mod signals;
pub mod size;
pub mod test;
pub mod timing;
