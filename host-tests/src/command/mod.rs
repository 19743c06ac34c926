//! The subcommands of `winder`, a module each.

pub mod bench;
pub mod demo;
pub mod machine;
pub mod run;
pub mod signals;
pub mod test;
