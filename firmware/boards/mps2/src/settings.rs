//! The settings, in memory that behaves like flash and that a start does not clear.
//!
//! Does not keep them without power: QEMU's board has no flash to write to.

// Such memory lies where no Rust code initializes it.
#![allow(unsafe_code)]

use core::mem::MaybeUninit;

use board_cortex_m::net::LocalDesk;
use board_cortex_m::settings::open;
use embassy_futures::block_on;
use firmware::hmi;
use firmware::life::Started;
use firmware::store::{Keeper, Ram, Store};
use model_core::restart::Restart;

/// The memory.
pub type Flash = Ram<&'static mut [u8]>;

/// As much as a log needs: two pages.
const BYTES: usize = Flash::bytes(2);

#[unsafe(link_section = ".uninit.SETTINGS")]
static mut CELLS: MaybeUninit<[u8; BYTES]> = MaybeUninit::uninit();

/// The store, and what the simulator starts with; called once.
pub fn at_start(started: Started) -> (Option<Store<Flash>>, Keeper) {
    // SAFETY: only this function names it, once; any bits are bytes.
    let cells: &mut [u8] = unsafe { &mut *(&raw mut CELLS).cast::<[u8; BYTES]>() };
    let mut flash = Ram(cells);
    if started.why == Restart::PowerOn {
        flash.clear();
    }
    let (store, mut keeper) = block_on(open(flash, 0..BYTES as u32, false));
    keeper.note =
        Some("in QEMU the address is 10.0.2.15, and the serial line has neither speed nor parity");
    (store, keeper)
}

/// Keeps the settings, in the background.
#[embassy_executor::task]
pub async fn keep(mut store: Store<Flash>, desk: &'static LocalDesk) {
    hmi::keep(&mut store, desk).await;
}
