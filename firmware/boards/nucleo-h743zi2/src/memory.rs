//! The chip's memories: what is cached, and what the Ethernet's DMA shares with the core.
//!
//! The timed path runs from the flash through the instruction cache, which holds all of it, with its stack in DTCM:
//! neither waits for a bus. Copying code to ITCM would save the first activation's misses only.

use core::mem::MaybeUninit;
use core::ops::Range;

use board_cortex_m::memory::keep_uncached;
use board_stm32::ethernet;
use cortex_m::Peripherals;
use embassy_stm32::eth::PacketQueue;
use embassy_stm32::flash::FLASH_BASE;
use embassy_stm32::pac;

use crate::settings::RANGE;

/// Frames that wait, each way.
pub type Queue = PacketQueue<4, 8>;

#[unsafe(link_section = ".sram_d2")]
static mut QUEUE: MaybeUninit<Queue> = MaybeUninit::uninit();

/// Switches the caches on, and SRAM1 to SRAM3, which stay out of them, as the settings' flash does.
pub fn prepare(core: &mut Peripherals) {
    const SRAM_D2: Range<u32> = 0x3000_0000..0x3008_0000;
    const SETTINGS: Range<u32> = FLASH_BASE as u32 + RANGE.start..FLASH_BASE as u32 + RANGE.end;

    pac::RCC.ahb2enr().modify(|w| {
        w.set_sram1en(true);
        w.set_sram2en(true);
        w.set_sram3en(true);
    });
    // SAFETY: the caches are off, and the program is in other memories.
    unsafe { keep_uncached(&core.MPU, &[SRAM_D2, SETTINGS]) };
    core.SCB.enable_icache();
    core.SCB.enable_dcache(&mut core.CPUID);
    board_stm32::count_cycles(&mut core.DCB, &mut core.DWT);
}

/// The Ethernet's frames; called once, after [`prepare`].
pub fn queue() -> &'static mut Queue {
    // SAFETY: only this function names it, and `static_cell` makes sure that it is called once.
    ethernet::frames(unsafe { &mut *core::ptr::addr_of_mut!(QUEUE) })
}
