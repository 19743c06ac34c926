//! Modbus RTU on an RS-485 line.
//!
//! Not here: frames and answers, which are the library's. The driver is enabled by the chip itself while it sends. Bytes
//! come out of an interrupt in pieces, so one gap stands for both silences of the line.

use embassy_executor::Spawner;
use embassy_stm32::peripherals::{PD4, PD5, PD6, USART2};
use embassy_stm32::usart::{self, BufferedUart, Config, DataBits, StopBits};
use embassy_stm32::{Peri, bind_interrupts};
use firmware::link::control::{Peer, Protocol};
use firmware::link::modbus::rtu::{Gaps, Station, session};
use firmware::store::{Parity, Serial};
use static_cell::StaticCell;

use crate::net::LocalService;

bind_interrupts!(struct Irqs {
    USART2 => usart::BufferedInterruptHandler<USART2>;
});

/// More than the longest frame, 256 bytes.
const BUFFER_BYTES: usize = 512;

/// What the line takes of the chip.
pub struct Resources {
    /// The device.
    pub usart: Peri<'static, USART2>,
    /// Receiver output, driver input, driver enable of the transceiver.
    pub pins: (Peri<'static, PD6>, Peri<'static, PD5>, Peri<'static, PD4>),
}

/// Starts the line. Runs in the background.
pub fn start(spawner: Spawner, r: Resources, settings: Serial, service: LocalService) {
    static BUFFERS: StaticCell<[[u8; BUFFER_BYTES]; 2]> = StaticCell::new();
    let [tx, rx] = BUFFERS.init([[0; BUFFER_BYTES]; 2]);
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
    let (receive, send, enable) = r.pins;
    match BufferedUart::new_with_de(r.usart, receive, send, enable, Irqs, tx, rx, config) {
        Ok(uart) => spawner.spawn(serve(uart, settings, service).expect("one line")),
        Err(error) => defmt::error!("no serial line: {}", defmt::Debug2Format(&error)),
    }
}

#[embassy_executor::task]
async fn serve(mut uart: BufferedUart<'static>, settings: Serial, service: LocalService) {
    let gaps = Gaps::tolerant(Gaps::of_baud(settings.baud).between);
    let mut station = Station::new(settings.address);
    if let Some(client) = service.enter(Peer::Serial, Protocol::ModbusRtu) {
        // A line that the driver reports as broken, by noise or overrun, goes on.
        while session(&mut uart, &client, &mut station, gaps)
            .await
            .is_err()
        {}
    }
}
