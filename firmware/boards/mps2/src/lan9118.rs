//! Driver of the Ethernet controller SMSC LAN9118 for embassy-net.
//!
//! Does not watch the cable (QEMU's is never pulled), does not compute checksums (the chip cannot),
//! does not wait for room to send (QEMU sends a frame within the store that completes it), and
//! does not queue: what the network sends faster than the background reads is dropped by the
//! chip's receive FIFO.
//!
//! An interrupt means no more than «look». It masks itself; the driver unmasks it when it has
//! found the FIFO empty, so a flood of frames costs one interrupt, not one each.
//!
//! The network has a budget, [`BURST`] frames in a [`WINDOW`]: a client that asks as fast as it is
//! answered takes from the drive logic no more than that. It also keeps QEMU able to follow real
//! time: a frame costs some 5000 instructions, and QEMU runs 100 to 200 in a microsecond.
//!
//! Register names: SMSC LAN9118 data sheet, revision 1.5.

use core::task::Context;

use embassy_net_driver::{Capabilities, HardwareAddress, LinkState};
use embassy_sync::waitqueue::AtomicWaker;
use embassy_time::{Duration, Instant};

use crate::interrupts::{self, Interrupt};

/// Locally administered; there is one simulator on QEMU's private network.
const ADDRESS: [u8; 6] = [0x02, 0x00, 0x00, 0x00, 0x05, 0x00];
/// Frames received in a [`WINDOW`].
const BURST: u8 = 8;
/// The time in which [`BURST`] frames are received at most.
const WINDOW: Duration = Duration::from_millis(1);
/// Ethernet's longest frame without its checksum, in bytes.
const FRAME_BYTES: usize = 1514;
/// The checksum that the chip leaves at the end of a received frame, in bytes.
const FCS_BYTES: usize = 4;
/// The FIFOs carry whole words.
const BUFFER_BYTES: usize = (FRAME_BYTES + FCS_BYTES).next_multiple_of(4);

/// Where the chip is, and its registers.
mod chip {
    #![allow(unsafe_code)] // The addresses are those of the data sheet.
    use crate::register::Register;

    /// Arm AN500; on AN385 and AN386 it is 0x4020_0000.
    const BASE: usize = 0xa000_0000;

    // SAFETY (all): registers of the LAN9118, which is no bus master.
    pub const RX_DATA_FIFO: Register = unsafe { Register::at(BASE) };
    pub const TX_DATA_FIFO: Register = unsafe { Register::at(BASE + 0x20) };
    pub const RX_STATUS_FIFO: Register = unsafe { Register::at(BASE + 0x40) };
    pub const TX_STATUS_FIFO: Register = unsafe { Register::at(BASE + 0x48) };
    pub const IRQ_CFG: Register = unsafe { Register::at(BASE + 0x54) };
    pub const INT_STS: Register = unsafe { Register::at(BASE + 0x58) };
    pub const INT_EN: Register = unsafe { Register::at(BASE + 0x5c) };
    pub const BYTE_TEST: Register = unsafe { Register::at(BASE + 0x64) };
    pub const FIFO_INT: Register = unsafe { Register::at(BASE + 0x68) };
    pub const TX_CFG: Register = unsafe { Register::at(BASE + 0x70) };
    pub const HW_CFG: Register = unsafe { Register::at(BASE + 0x74) };
    pub const RX_FIFO_INF: Register = unsafe { Register::at(BASE + 0x7c) };
    pub const TX_FIFO_INF: Register = unsafe { Register::at(BASE + 0x80) };
    const MAC_CSR_CMD: Register = unsafe { Register::at(BASE + 0xa4) };
    const MAC_CSR_DATA: Register = unsafe { Register::at(BASE + 0xa8) };

    /// What BYTE_TEST reads, for any chip of the family.
    pub const BYTE_ORDER: u32 = 0x8765_4321;
    /// IRQ_CFG: IRQ_EN, and the pin driven actively and high, as the NVIC needs it.
    pub const IRQ_ACTIVE_HIGH: u32 = 1 << 8 | 1 << 4 | 1 << 0;
    /// INT_STS, INT_EN: RX status FIFO above the level of FIFO_INT, which is zero.
    pub const RSFL: u32 = 1 << 3;
    /// HW_CFG: soft reset.
    pub const SRST: u32 = 1 << 0;
    /// HW_CFG: store and forward (must be one), and 5 KiB for sending, the rest for receiving.
    pub const SF_TX_FIF_SZ: u32 = 1 << 20 | 5 << 16;
    /// TX_CFG: transmitter on.
    pub const TX_ON: u32 = 1 << 1;
    /// TX command A: the buffer holds a frame from its first to its last byte.
    pub const WHOLE_FRAME: u32 = 1 << 13 | 1 << 12;
    /// RX status: error summary.
    pub const RX_ERROR: u32 = 1 << 15;

    /// Registers of the MAC, behind the command register.
    pub const MAC_CR: u32 = 1;
    pub const ADDRH: u32 = 2;
    pub const ADDRL: u32 = 3;
    /// MAC_CR: full duplex, transmitter and receiver on.
    pub const FDPX_TXEN_RXEN: u32 = 1 << 20 | 1 << 3 | 1 << 2;

    pub fn write_mac(register: u32, value: u32) {
        const BUSY: u32 = 1 << 31;
        MAC_CSR_DATA.write(value);
        MAC_CSR_CMD.write(BUSY | register);
        while MAC_CSR_CMD.read() & BUSY != 0 {}
    }

    /// Frames waiting in the receive FIFO.
    pub fn received() -> u32 {
        RX_FIFO_INF.read() >> 16 & 0xff
    }
}

static FRAME_RECEIVED: AtomicWaker = AtomicWaker::new();

/// The interrupt handler: masks the interrupt and has the driver look.
pub extern "C" fn on_interrupt() {
    chip::INT_EN.write(0);
    FRAME_RECEIVED.wake();
}

/// No chip answers at the address.
#[derive(Debug, defmt::Format)]
pub struct NotFound;

/// The chip, set up. There is only one; it answers to one task.
pub struct Lan9118 {
    rx: [u8; BUFFER_BYTES],
    tx: [u8; BUFFER_BYTES],
    /// Frames received since `window`, when the window opened.
    burst: u8,
    window: Instant,
}

impl Lan9118 {
    /// Resets the chip and starts it.
    ///
    /// # Errors
    /// [`NotFound`]: QEMU was started with another machine.
    pub fn start() -> Result<Self, NotFound> {
        if chip::BYTE_TEST.read() != chip::BYTE_ORDER {
            return Err(NotFound);
        }
        chip::HW_CFG.write(chip::SRST);
        while chip::HW_CFG.read() & chip::SRST != 0 {}
        chip::HW_CFG.write(chip::SF_TX_FIF_SZ);
        chip::FIFO_INT.write(0);

        let [a, b, c, d, e, f] = ADDRESS;
        chip::write_mac(chip::ADDRL, u32::from_le_bytes([a, b, c, d]));
        chip::write_mac(chip::ADDRH, u32::from_le_bytes([e, f, 0, 0]));
        chip::write_mac(chip::MAC_CR, chip::FDPX_TXEN_RXEN);
        chip::TX_CFG.write(chip::TX_ON);

        // The pin is low-active after reset: unmasked before this it would never rest.
        chip::IRQ_CFG.write(chip::IRQ_ACTIVE_HIGH);
        interrupts::enable(Interrupt::Ethernet);
        Ok(Self {
            rx: [0; BUFFER_BYTES],
            tx: [0; BUFFER_BYTES],
            burst: 0,
            window: Instant::MIN,
        })
    }
}

impl embassy_net_driver::Driver for Lan9118 {
    type RxToken<'a> = RxToken<'a>;
    type TxToken<'a> = TxToken<'a>;

    fn receive(&mut self, cx: &mut Context) -> Option<(RxToken<'_>, TxToken<'_>)> {
        if self.burst == BURST {
            let next = self.window + WINDOW;
            if Instant::now() < next {
                embassy_time_driver::schedule_wake(next.as_ticks(), cx.waker());
                return None;
            }
            self.burst = 0;
        }
        if chip::received() == 0 {
            FRAME_RECEIVED.register(cx.waker());
            chip::INT_STS.write(chip::RSFL);
            chip::INT_EN.write(chip::RSFL);
            // A frame that came before its interrupt was cleared would else wait for the next.
            if chip::received() == 0 {
                return None;
            }
        }
        if self.burst == 0 {
            self.window = Instant::now();
        }
        self.burst += 1;
        Some((RxToken(&mut self.rx), TxToken(&mut self.tx)))
    }

    fn transmit(&mut self, _: &mut Context) -> Option<TxToken<'_>> {
        Some(TxToken(&mut self.tx))
    }

    fn link_state(&mut self, _: &mut Context) -> LinkState {
        LinkState::Up
    }

    fn capabilities(&self) -> Capabilities {
        let mut capabilities = Capabilities::default();
        capabilities.max_transmission_unit = FRAME_BYTES;
        // One would cut the TCP window to a segment.
        capabilities.max_burst_size = Some(6);
        capabilities
    }

    fn hardware_address(&self) -> HardwareAddress {
        HardwareAddress::Ethernet(ADDRESS)
    }
}

/// A frame in the receive FIFO, and where to read it to.
pub struct RxToken<'a>(&'a mut [u8; BUFFER_BYTES]);

impl embassy_net_driver::RxToken for RxToken<'_> {
    /// Always takes the whole frame out of the FIFO; one that is damaged or too long is passed on
    /// as empty, which no protocol takes for its own.
    fn consume<R, F: FnOnce(&mut [u8]) -> R>(self, f: F) -> R {
        let status = chip::RX_STATUS_FIFO.read();
        let length = (status >> 16 & 0x3fff) as usize;
        let (words, _) = self.0.as_chunks_mut();
        let mut words = words.iter_mut();
        for _ in 0..length.div_ceil(4) {
            let word = chip::RX_DATA_FIFO.read();
            if let Some(place) = words.next() {
                *place = word.to_le_bytes();
            }
        }
        let intact = status & chip::RX_ERROR == 0 && length <= BUFFER_BYTES;
        let frame = if intact {
            length.saturating_sub(FCS_BYTES)
        } else {
            0
        };
        f(&mut self.0[..frame])
    }
}

/// Where to put a frame to be sent.
pub struct TxToken<'a>(&'a mut [u8; BUFFER_BYTES]);

impl embassy_net_driver::TxToken for TxToken<'_> {
    fn consume<R, F: FnOnce(&mut [u8]) -> R>(self, length: usize, f: F) -> R {
        let result = f(&mut self.0[..length]);
        let (words, _) = self.0.as_chunks();
        chip::TX_DATA_FIFO.write(chip::WHOLE_FRAME | length as u32);
        chip::TX_DATA_FIFO.write(length as u32);
        for &word in &words[..length.div_ceil(4)] {
            chip::TX_DATA_FIFO.write(u32::from_le_bytes(word));
        }
        // The chip stops sending when its statuses are not collected.
        while chip::TX_FIFO_INF.read() >> 16 & 0xff != 0 {
            chip::TX_STATUS_FIFO.read();
        }
        result
    }
}
