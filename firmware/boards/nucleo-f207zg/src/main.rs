//! The paper winder simulator on the dev board NUCLEO-F207ZG: a Cortex-M3 without floating-point unit.
//!
//! It computes in fixed point and speaks Modbus TCP; hard-wired signals, the serial line and settings in flash are the
//! NUCLEO-H743ZI2's. Nothing of it has been run on hardware.
//!
//! # Who may preempt whom
//!
//! | Priority | Interrupt | Does |
//! |---|---|---|
//! | 0x10 | `TIM5`, the time driver | wakes the tasks that are due |
//! | 0x10 | `UART4`, no device's | plant |
//! | 0x20 | `UART5`, no device's | regulators |
//! | 0x30 | `ETH`, `RNG` | wakes the network's tasks; `RNG` never comes |
//! | 0x30 | `CAN1_TX`, no device's | everything else |

#![no_std]
#![no_main]
// Interrupt handlers call into their executors.
#![allow(unsafe_code)]

mod simulator;

use board_stm32::ethernet_pins;
use board_stm32::watchdog::{self, Reset};
// The log: its way out.
use defmt_rtt as _;
use embassy_executor::InterruptExecutor;
use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_stm32::peripherals::IWDG;
use embassy_stm32::rcc::{
    AHBPrescaler, APBPrescaler, Hse, HseMode, Pll, PllMul, PllPDiv, PllPreDiv, PllQDiv, PllSource,
    Sysclk,
};
use embassy_stm32::time::Hertz;
use embassy_stm32::{Peri, interrupt, pac};
use embassy_time::{Duration, Instant};

static PLANT: InterruptExecutor = InterruptExecutor::new();
static DRIVE: InterruptExecutor = InterruptExecutor::new();
static BACKGROUND: InterruptExecutor = InterruptExecutor::new();

/// Clock of the core, MHz.
pub const CORE_MHZ: u32 = 120;

/// From switching on to the first activation of the timed tasks.
const SETTLING: Duration = Duration::from_millis(10);

#[interrupt]
fn UART4() {
    // SAFETY: this is the executor's interrupt, which only its `start` enables.
    unsafe { PLANT.on_interrupt() }
}

#[interrupt]
fn UART5() {
    // SAFETY: as for the plant.
    unsafe { DRIVE.on_interrupt() }
}

#[interrupt]
fn CAN1_TX() {
    // SAFETY: as for the plant.
    unsafe { BACKGROUND.on_interrupt() }
}

/// 120 MHz from the 8 MHz that the debugger's processor gives.
///
/// Source: RM0033 rev. 9, section 5; UM1974, section 6.8.
fn clocks() -> embassy_stm32::Config {
    let mut config = embassy_stm32::Config::default();
    let rcc = &mut config.rcc;
    rcc.hse = Some(Hse {
        freq: Hertz::mhz(8),
        mode: HseMode::Bypass,
    });
    rcc.pll_src = PllSource::HSE;
    rcc.pll = Some(Pll {
        prediv: PllPreDiv::DIV8,
        mul: PllMul::MUL240,
        divp: Some(PllPDiv::DIV2),
        // 48 MHz, of which the random numbers are made
        divq: Some(PllQDiv::DIV5),
        divr: None,
    });
    rcc.sys = Sysclk::PLL1_P;
    rcc.ahb_pre = AHBPrescaler::DIV1;
    rcc.apb1_pre = APBPrescaler::DIV4;
    rcc.apb2_pre = APBPrescaler::DIV2;
    config
}

#[cortex_m_rt::entry]
fn main() -> ! {
    let Some(mut core) = cortex_m::Peripherals::take() else {
        unreachable!("the entry point runs once")
    };
    let p = embassy_stm32::init(clocks());
    board_stm32::count_cycles(&mut core.DCB, &mut core.DWT);
    defmt::info!(
        "paper winder simulator {=str} on NUCLEO-F207ZG",
        env!("CARGO_PKG_VERSION")
    );
    for (interrupt, priority) in [
        (interrupt::TIM5, Priority::P1),
        (interrupt::UART4, Priority::P1),
        (interrupt::UART5, Priority::P2),
        (interrupt::ETH, Priority::P3),
        (interrupt::RNG, Priority::P3),
        (interrupt::CAN1_TX, Priority::P3),
    ] {
        interrupt.set_priority(priority);
    }

    let start = Instant::now() + SETTLING;
    let exchange = simulator::exchange(watchdog::started(reset()));
    let plant = PLANT.start(interrupt::UART4);
    plant.spawn(simulator::plant(start, exchange).expect("first"));
    plant.spawn(watch(p.IWDG).expect("first"));
    let drive = DRIVE.start(interrupt::UART5);
    drive.spawn(simulator::drive(start, exchange).expect("first"));
    let background = BACKGROUND.start(interrupt::CAN1_TX);
    background.spawn(simulator::background(exchange, ethernet_pins!(p)).expect("first"));

    loop {
        cortex_m::asm::wfi();
    }
}

/// What the chip knows of its reset. Source: RM0033 rev. 9, section 5.3.21 (RCC_CSR).
fn reset() -> Reset {
    let flags = pac::RCC.csr().read();
    pac::RCC.csr().modify(|w| w.set_rmvf(true));
    Reset::of(
        flags.porrstf() || flags.borrstf(),
        flags.wdgrstf(),
        flags.sftrstf(),
    )
}

#[embassy_executor::task]
async fn watch(device: Peri<'static, IWDG>) {
    watchdog::run(device).await
}
