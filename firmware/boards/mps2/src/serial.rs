//! Modbus RTU on UART1.
//!
//! Does not model the baud rate: QEMU takes and gives bytes at once, and its other end is a pseudoterminal whose
//! writer has no sense of a character's time. So one gap, longer than any pause within a frame, stands for both
//! silences of the line.
//!
//! An interrupt means no more than «look»: the UART holds the next byte until the last one has been read.

use core::convert::Infallible;
use core::future::poll_fn;
use core::task::Poll;

use atomic_waker::AtomicWaker;
use board_cortex_m::net::LocalService;
use embassy_executor::Spawner;
use embassy_time::Duration;
use embedded_io_async::{ErrorType, Read, Write};
use firmware::link::modbus::rtu::{Gaps, serve_line};

use crate::interrupts::{self, Interrupt};
use crate::trace;

/// Longer than a pseudoterminal's writer pauses within a frame.
const GAP: Duration = Duration::from_millis(10);

mod chip {
    #![allow(unsafe_code)] // The addresses are those of the manual.
    use crate::register::Register;

    // SAFETY (all): registers of UART1 (Arm AN500; CMSDK UART, Arm DDI 0479), which access no memory.
    pub const DATA: Register = unsafe { Register::at(0x4000_5000) };
    pub const STATE: Register = unsafe { Register::at(0x4000_5004) };
    pub const CTRL: Register = unsafe { Register::at(0x4000_5008) };
    pub const INTCLEAR: Register = unsafe { Register::at(0x4000_500c) };
    pub const BAUDDIV: Register = unsafe { Register::at(0x4000_5010) };

    pub const STATE_TX_FULL: u32 = 1 << 0;
    pub const STATE_RX_FULL: u32 = 1 << 1;
    pub const CTRL_TX: u32 = 1 << 0;
    pub const CTRL_RX: u32 = 1 << 1;
    pub const CTRL_RX_INTERRUPT: u32 = 1 << 3;
    pub const RX_INTERRUPT: u32 = 1 << 1;
    /// The smallest that the UART accepts.
    pub const BAUDDIV_MIN: u32 = 16;
}

static BYTE_RECEIVED: AtomicWaker = AtomicWaker::new();

/// A byte has come.
pub extern "C" fn on_interrupt() {
    trace::handler(on_interrupt, || {
        chip::INTCLEAR.write(chip::RX_INTERRUPT);
        BYTE_RECEIVED.wake();
    });
}

/// The UART, set up. There is only one; it answers to one task.
struct Uart;

impl Uart {
    fn start() -> Self {
        chip::BAUDDIV.write(chip::BAUDDIV_MIN);
        chip::CTRL.write(chip::CTRL_TX | chip::CTRL_RX | chip::CTRL_RX_INTERRUPT);
        interrupts::enable(Interrupt::Serial);
        Self
    }

    fn received() -> Option<u8> {
        let full = chip::STATE.read() & chip::STATE_RX_FULL != 0;
        full.then(|| chip::DATA.read() as u8)
    }
}

impl ErrorType for Uart {
    type Error = Infallible;
}

impl Read for Uart {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        let Some((first, _)) = buffer.split_first_mut() else {
            return Ok(0);
        };
        *first = poll_fn(|cx| {
            BYTE_RECEIVED.register(cx.waker());
            Self::received().map_or(Poll::Pending, Poll::Ready)
        })
        .await;
        Ok(1)
    }
}

impl Write for Uart {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        for &byte in bytes {
            while chip::STATE.read() & chip::STATE_TX_FULL != 0 {}
            chip::DATA.write(byte.into());
        }
        Ok(bytes.len())
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

/// Starts the line, of which this is a station. Runs in the background.
pub fn start(spawner: Spawner, service: LocalService, station: u8) {
    spawner.spawn(serve(service, station).expect("one line"));
}

#[embassy_executor::task]
async fn serve(service: LocalService, station: u8) {
    serve_line(Uart::start(), service, station, Gaps::tolerant(GAP)).await;
}
