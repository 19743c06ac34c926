//! Modbus RTU on a line.
//!
//! Not here: frames and answers, which are the library's; the device and its pins, which are the board's. Bytes come out
//! of an interrupt in pieces, so one gap stands for both silences of the line.

use embassy_stm32::usart::{self, BufferedUart, Config, DataBits, StopBits};
use embassy_sync::blocking_mutex::raw::RawMutex;
use firmware::link::Service;
use firmware::link::modbus::rtu::{Gaps, serve_line};
use firmware::store::{Parity, Serial};

/// For each direction: more than the longest frame, 256 bytes.
pub const BUFFER_BYTES: usize = 512;

/// How the device is set up.
pub fn config(settings: Serial) -> Config {
    let mut config = Config::default();
    config.baudrate = settings.baud;
    // The parity is one of the chip's data bits. Without it a second stop bit takes its place.
    (config.data_bits, config.parity, config.stop_bits) = match settings.parity {
        Parity::None => (
            DataBits::DataBits8,
            usart::Parity::ParityNone,
            StopBits::STOP2,
        ),
        Parity::Even => (
            DataBits::DataBits9,
            usart::Parity::ParityEven,
            StopBits::STOP1,
        ),
        Parity::Odd => (
            DataBits::DataBits9,
            usart::Parity::ParityOdd,
            StopBits::STOP1,
        ),
    };
    config
}

/// Serves the line: a task of the background.
pub async fn serve<M: RawMutex>(
    uart: BufferedUart<'static>,
    settings: Serial,
    service: Service<'_, M>,
) {
    let gaps = Gaps::tolerant(Gaps::of_baud(settings.baud).between);
    serve_line(uart, service, settings.address, gaps).await;
}
