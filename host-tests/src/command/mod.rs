//! The subcommands of `winder`, a module each.

pub mod accept;
pub mod bench;
pub mod demo;
pub mod figures;
pub mod lesson;
pub mod machine;
pub mod replay;
pub mod run;
pub mod scenario;
pub mod signals;
pub mod test;
