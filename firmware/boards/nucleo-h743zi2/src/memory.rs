//! The chip's memories: what is cached, and what the Ethernet's DMA shares with the core.
//!
//! The timed path runs from the flash through the instruction cache, which holds all of it, with its stack in DTCM:
//! neither waits for a bus. Copying code to ITCM would save the first activation's misses only.

use core::mem::MaybeUninit;

use cortex_m::Peripherals;
use embassy_stm32::eth::PacketQueue;
use embassy_stm32::pac;

/// Frames that wait, each way.
pub type Queue = PacketQueue<4, 8>;

#[unsafe(link_section = ".sram_d2")]
static mut QUEUE: MaybeUninit<Queue> = MaybeUninit::uninit();

/// Switches the caches on, and SRAM1 to SRAM3, which stay out of them.
pub fn prepare(core: &mut Peripherals) {
    // Armv7-M architecture reference manual, B3.5: protected memory system.
    const SRAM_D2: u32 = 0x3000_0000;
    const REGION_VALID: u32 = 1 << 4;
    const NEVER_EXECUTE: u32 = 1 << 28;
    const FULL_ACCESS: u32 = 0b011 << 24;
    // normal memory, shared, not cached
    const NOT_CACHED: u32 = 0b001 << 19 | 1 << 18;
    const SIZE_LOG2: u32 = 19;
    const REGION_ENABLE: u32 = 1;
    const DEFAULT_MAP_AND_ENABLE: u32 = 1 << 2 | 1;

    pac::RCC.ahb2enr().modify(|w| {
        w.set_sram1en(true);
        w.set_sram2en(true);
        w.set_sram3en(true);
    });
    // SAFETY: nothing is in this memory yet, and all other memory keeps its default.
    unsafe {
        core.MPU.rbar.write(SRAM_D2 | REGION_VALID);
        core.MPU
            .rasr
            .write(NEVER_EXECUTE | FULL_ACCESS | NOT_CACHED | (SIZE_LOG2 - 1) << 1 | REGION_ENABLE);
        core.MPU.ctrl.write(DEFAULT_MAP_AND_ENABLE);
    }
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
    core.SCB.enable_icache();
    core.SCB.enable_dcache(&mut core.CPUID);
    board_stm32::count_cycles(&mut core.DCB, &mut core.DWT);
}

/// The Ethernet's frames; called once, after [`prepare`].
pub fn queue() -> &'static mut Queue {
    // SAFETY: only this function names it, and `static_cell` makes sure that it is called once.
    let queue = unsafe { &mut *core::ptr::addr_of_mut!(QUEUE) };
    PacketQueue::init(queue);
    // SAFETY: the line above has initialized all of it.
    unsafe { queue.assume_init_mut() }
}
