//! Three lamps: green blinks while the firmware lives, yellow is lit while a client asks, red while a fault is latched.

use embassy_stm32::Peri;
use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_stm32::peripherals::{PB0, PB14, PE1};
use embassy_time::Timer;
use model_core::image;

use crate::net::LocalService;
use crate::simulator::Exchange;

/// Period of the panel, ms: as quick as an eye.
const PERIOD_MS: u64 = 50;
/// Periods for which the green lamp is lit, and dark.
const BLINK: u32 = 10;

/// The lamps.
pub struct Panel {
    green: Output<'static>,
    yellow: Output<'static>,
    red: Output<'static>,
}

impl Panel {
    /// The board's own: LD1 to LD3.
    pub fn new(
        green: Peri<'static, PB0>,
        yellow: Peri<'static, PE1>,
        red: Peri<'static, PB14>,
    ) -> Self {
        Self {
            green: Output::new(green, Level::High, Speed::Low),
            yellow: Output::new(yellow, Level::Low, Speed::Low),
            red: Output::new(red, Level::Low, Speed::Low),
        }
    }
}

/// Shows, as long as the firmware lives.
#[embassy_executor::task]
pub async fn run(mut panel: Panel, exchange: &'static Exchange, service: LocalService) -> ! {
    let (mut beat, mut asked) = (0_u32, 0);
    loop {
        Timer::after_millis(PERIOD_MS).await;
        beat = beat.wrapping_add(1);
        panel
            .green
            .set_level((beat / BLINK).is_multiple_of(2).into());
        panel.red.set_level(exchange.outputs().fault.into());
        let requests = service
            .image
            .lock(|image| image.borrow().feedback.double(&image::LINK_REQUESTS));
        panel.yellow.set_level((requests != asked).into());
        asked = requests;
    }
}
