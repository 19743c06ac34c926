//! Three lamps: green blinks while the firmware lives, yellow is lit while a client asks, red while a fault is latched;
//! it blinks while the settings wait for a decision.

use embassy_stm32::Peri;
use embassy_stm32::gpio::{AnyPin, Level, Output, Speed};
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::Timer;
use firmware::link::Service;
use firmware::tasks::Exchange;
use model_core::image;
use model_core::real::Scalar;

/// Period of a look, ms: as quick as an eye.
const PERIOD_MS: u64 = 50;
/// Periods for which the green lamp is lit, and dark.
const BLINK: u32 = 10;

/// The lamps.
pub struct Lamps {
    green: Output<'static>,
    yellow: Output<'static>,
    red: Output<'static>,
}

impl Lamps {
    /// On these pins, lit by a high level: green at once.
    pub fn new([green, yellow, red]: [Peri<'static, AnyPin>; 3]) -> Self {
        Self {
            green: Output::new(green, Level::High, Speed::Low),
            yellow: Output::new(yellow, Level::Low, Speed::Low),
            red: Output::new(red, Level::Low, Speed::Low),
        }
    }

    /// Shows, as long as the firmware lives.
    pub async fn run<R: Scalar, M: RawMutex>(
        mut self,
        exchange: &Exchange<R>,
        service: Service<'_, M>,
        undecided: impl Fn() -> bool,
    ) -> ! {
        let (mut beat, mut asked) = (0_u32, 0);
        loop {
            Timer::after_millis(PERIOD_MS).await;
            beat = beat.wrapping_add(1);
            let lit = (beat / BLINK).is_multiple_of(2);
            self.green.set_level(lit.into());
            let red = exchange.outputs().fault || (lit && undecided());
            self.red.set_level(red.into());
            let requests = service
                .image
                .lock(|image| image.borrow().feedback.double(&image::LINK_REQUESTS));
            self.yellow.set_level((requests != asked).into());
            asked = requests;
        }
    }
}
