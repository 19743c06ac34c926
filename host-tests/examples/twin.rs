//! The model's twin on this PC: prints what the firmware of the twin prints in QEMU for the same words.

use std::env;

use anyhow::Result;
use host_tests::twin;

fn main() -> Result<()> {
    let words: Vec<String> = env::args().skip(1).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    for mark in twin::here(&words)? {
        println!("{mark}");
    }
    Ok(())
}
