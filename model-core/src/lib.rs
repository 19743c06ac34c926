//! The winder, its web and its electric drive system.
//!
//! Not here: a clock, a bus, a board, anything asynchronous. Everything that computes is here and knows time
//! only as ticks that somebody calls.
//!
//! The names are those of the winder literature: `uw` unwind or parent roll, `gr` guide rolls, `sr` spreader
//! rolls, `rd`/`fd` rear and front drum, `rr` rider roll, `wu` windup or shipping roll; `t` web tension, `v`
//! surface velocity, `omega` angular velocity, `r` radius. SI units throughout.
#![no_std]
#![forbid(unsafe_code)]

pub mod desk;
pub mod drive;
pub mod exchange;
pub mod fixed;
pub mod image;
pub mod link_words;
pub mod logic;
pub mod machine;
pub mod plant;
pub mod profidrive;
pub mod real;
pub mod restart;
pub mod signal;
pub mod simulator;
pub mod twin;
