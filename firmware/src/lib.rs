//! The simulator as firmware, without a board.
#![no_std]

pub mod link;
