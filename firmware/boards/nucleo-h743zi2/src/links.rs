//! The board's links: Modbus TCP and the HMI on the Ethernet, Modbus RTU on an RS-485 line.
//!
//! Not here: what they serve. The line's driver is enabled by the chip itself while it sends.

use board_cortex_m::net::{LocalDesk, LocalService, start_modbus};
use board_stm32::{ethernet, serial};
use embassy_executor::Spawner;
use embassy_net::StackResources;
use embassy_stm32::peripherals::{PD4, PD5, PD6, USART2};
use embassy_stm32::usart::{BufferedInterruptHandler, BufferedUart};
use embassy_stm32::{Peri, bind_interrupts};
use firmware::hmi::Hmi;
use firmware::net::MODBUS_SOCKETS;
use firmware::store::{Network, Serial};
use static_cell::StaticCell;

use crate::memory;

bind_interrupts!(struct Irqs {
    USART2 => BufferedInterruptHandler<USART2>;
});

// As many as half of the chip's memory holds, which is one browser with its stream.
board_cortex_m::serve_http!(4);

const SOCKETS: usize = MODBUS_SOCKETS + HTTP_SOCKETS + ethernet::OTHER_SOCKETS;

/// Starts what is on the network.
pub fn start_network(
    spawner: Spawner,
    pins: ethernet::Pins,
    network: Network,
    service: LocalService,
    desk: &'static LocalDesk,
) {
    static RESOURCES: StaticCell<StackResources<SOCKETS>> = StaticCell::new();
    let resources = RESOURCES.init(StackResources::new());
    let stack = ethernet::start(spawner, pins, memory::queue(), resources, network);
    start_modbus(spawner, stack, service);
    start_http(spawner, stack, Hmi { service, desk });
}

/// What the line takes of the chip.
pub struct Line {
    /// The device.
    pub usart: Peri<'static, USART2>,
    /// Receiver output, driver input, driver enable of the transceiver.
    pub pins: (Peri<'static, PD6>, Peri<'static, PD5>, Peri<'static, PD4>),
}

/// Starts the line.
pub fn start_line(spawner: Spawner, line: Line, settings: Serial, service: LocalService) {
    static BUFFERS: StaticCell<[[u8; serial::BUFFER_BYTES]; 2]> = StaticCell::new();
    let [tx, rx] = BUFFERS.init([[0; serial::BUFFER_BYTES]; 2]);
    let (receive, send, enable) = line.pins;
    let config = serial::config(settings);
    match BufferedUart::new_with_de(line.usart, receive, send, enable, Irqs, tx, rx, config) {
        Ok(uart) => spawner.spawn(serve_line(uart, settings, service).expect("one line")),
        Err(error) => defmt::error!("no serial line: {}", defmt::Debug2Format(&error)),
    }
}

#[embassy_executor::task]
async fn serve_line(uart: BufferedUart<'static>, settings: Serial, service: LocalService) {
    serial::serve(uart, settings, service).await;
}
