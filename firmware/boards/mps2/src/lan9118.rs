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

use atomic_waker::AtomicWaker;
use embassy_net_driver::{Capabilities, HardwareAddress, LinkState};
use embassy_time::{Duration, Instant};
use firmware::life::Task;

use crate::interrupts::{self, Interrupt};
use crate::trace;
use crate::watchdog::LIFE;

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
    use core::sync::atomic::{AtomicUsize, Ordering};

    use crate::register::Register;

    /// A chip that is there.
    #[derive(Clone, Copy)]
    pub struct Chip {
        base: usize,
    }

    /// A register of the chip, by its offset.
    #[derive(Clone, Copy)]
    pub struct At(usize);

    pub const RX_DATA_FIFO: At = At(0);
    pub const TX_DATA_FIFO: At = At(0x20);
    pub const RX_STATUS_FIFO: At = At(0x40);
    pub const TX_STATUS_FIFO: At = At(0x48);
    pub const IRQ_CFG: At = At(0x54);
    pub const INT_STS: At = At(0x58);
    pub const INT_EN: At = At(0x5c);
    const BYTE_TEST: At = At(0x64);
    pub const FIFO_INT: At = At(0x68);
    pub const TX_CFG: At = At(0x70);
    pub const HW_CFG: At = At(0x74);
    const RX_FIFO_INF: At = At(0x7c);
    const TX_FIFO_INF: At = At(0x80);
    const MAC_CSR_CMD: At = At(0xa4);
    const MAC_CSR_DATA: At = At(0xa8);

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

    /// SCC_ID: part number of the image in the board's FPGA (Arm DUI 0546, CFG_REG for AN500, AN385, AN386).
    // SAFETY: a register of the board's configuration controller, which accesses no memory.
    const SCC_ID: Register = unsafe { Register::at(0x4002_fffc) };
    const PART: u32 = 0xfff << 4;
    const PART_AN500: u32 = 0x500 << 4;
    /// Where the image of a Cortex-M7 has the chip, and where those of Cortex-M3 and M4 have it.
    const BASE_AN500: usize = 0xa000_0000;
    const BASE: usize = 0x4020_0000;

    /// Where the chip is that was found, for the interrupt handler.
    static FOUND: AtomicUsize = AtomicUsize::new(0);

    impl Chip {
        /// The chip of this board, if one answers.
        pub fn find() -> Option<Self> {
            /// What BYTE_TEST reads, for any chip of the family.
            const BYTE_ORDER: u32 = 0x8765_4321;
            let base = match SCC_ID.read() & PART {
                PART_AN500 => BASE_AN500,
                _ => BASE,
            };
            let chip = Self { base };
            let answers = chip.read(BYTE_TEST) == BYTE_ORDER;
            answers.then(|| {
                FOUND.store(base, Ordering::Relaxed);
                chip
            })
        }

        /// The chip that was found before.
        pub fn started() -> Option<Self> {
            let base = FOUND.load(Ordering::Relaxed);
            (base != 0).then_some(Self { base })
        }

        fn register(self, at: At) -> Register {
            // SAFETY: registers of the LAN9118, which is no bus master.
            unsafe { Register::at(self.base + at.0) }
        }

        pub fn read(self, at: At) -> u32 {
            self.register(at).read()
        }

        pub fn write(self, at: At, value: u32) {
            self.register(at).write(value);
        }

        pub fn write_mac(self, register: u32, value: u32) {
            const BUSY: u32 = 1 << 31;
            self.write(MAC_CSR_DATA, value);
            self.write(MAC_CSR_CMD, BUSY | register);
            while self.read(MAC_CSR_CMD) & BUSY != 0 {}
        }

        /// Frames waiting in the receive FIFO.
        pub fn received(self) -> u32 {
            self.read(RX_FIFO_INF) >> 16 & 0xff
        }

        /// Statuses of sent frames that nobody has collected.
        pub fn sent(self) -> u32 {
            self.read(TX_FIFO_INF) >> 16 & 0xff
        }
    }
}

use chip::Chip;

static FRAME_RECEIVED: AtomicWaker = AtomicWaker::new();

/// The interrupt handler: masks the interrupt and has the driver look.
pub extern "C" fn on_interrupt() {
    trace::handler(on_interrupt, || {
        if let Some(chip) = Chip::started() {
            chip.write(chip::INT_EN, 0);
        }
        FRAME_RECEIVED.wake();
    });
}

/// Has the network's task ask for a frame, which shows that it lives.
pub fn ask() {
    FRAME_RECEIVED.wake();
}

/// No chip answers at the address.
#[derive(Debug, defmt::Format)]
pub struct NotFound;

/// The chip, set up. There is only one; it answers to one task.
pub struct Lan9118 {
    chip: Chip,
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
        let chip = Chip::find().ok_or(NotFound)?;
        chip.write(chip::HW_CFG, chip::SRST);
        while chip.read(chip::HW_CFG) & chip::SRST != 0 {}
        chip.write(chip::HW_CFG, chip::SF_TX_FIF_SZ);
        chip.write(chip::FIFO_INT, 0);

        let [a, b, c, d, e, f] = ADDRESS;
        chip.write_mac(chip::ADDRL, u32::from_le_bytes([a, b, c, d]));
        chip.write_mac(chip::ADDRH, u32::from_le_bytes([e, f, 0, 0]));
        chip.write_mac(chip::MAC_CR, chip::FDPX_TXEN_RXEN);
        chip.write(chip::TX_CFG, chip::TX_ON);

        // The pin is low-active after reset: unmasked before this it would never rest.
        chip.write(chip::IRQ_CFG, chip::IRQ_ACTIVE_HIGH);
        interrupts::enable(Interrupt::Ethernet);
        Ok(Self {
            chip,
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
        let now = Instant::now();
        LIFE.see(Task::Network, now);
        if self.burst == BURST {
            let next = self.window + WINDOW;
            if now < next {
                embassy_time_driver::schedule_wake(next.as_ticks(), cx.waker());
                return None;
            }
            self.burst = 0;
        }
        if self.chip.received() == 0 {
            FRAME_RECEIVED.register(cx.waker());
            self.chip.write(chip::INT_STS, chip::RSFL);
            self.chip.write(chip::INT_EN, chip::RSFL);
            // A frame that came before its interrupt was cleared would else wait for the next.
            if self.chip.received() == 0 {
                return None;
            }
        }
        if self.burst == 0 {
            self.window = now;
        }
        self.burst += 1;
        Some((
            RxToken(self.chip, &mut self.rx),
            TxToken(self.chip, &mut self.tx),
        ))
    }

    fn transmit(&mut self, _: &mut Context) -> Option<TxToken<'_>> {
        Some(TxToken(self.chip, &mut self.tx))
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
pub struct RxToken<'a>(Chip, &'a mut [u8; BUFFER_BYTES]);

impl embassy_net_driver::RxToken for RxToken<'_> {
    /// Always takes the whole frame out of the FIFO; one that is damaged or too long is passed on
    /// as empty, which no protocol takes for its own.
    fn consume<R, F: FnOnce(&mut [u8]) -> R>(self, f: F) -> R {
        let Self(chip, buffer) = self;
        let status = chip.read(chip::RX_STATUS_FIFO);
        let length = (status >> 16 & 0x3fff) as usize;
        let (words, _) = buffer.as_chunks_mut();
        let mut words = words.iter_mut();
        for _ in 0..length.div_ceil(4) {
            let word = chip.read(chip::RX_DATA_FIFO);
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
        f(&mut buffer[..frame])
    }
}

/// Where to put a frame to be sent.
pub struct TxToken<'a>(Chip, &'a mut [u8; BUFFER_BYTES]);

impl embassy_net_driver::TxToken for TxToken<'_> {
    fn consume<R, F: FnOnce(&mut [u8]) -> R>(self, length: usize, f: F) -> R {
        let Self(chip, buffer) = self;
        let result = f(&mut buffer[..length]);
        let (words, _) = buffer.as_chunks();
        chip.write(chip::TX_DATA_FIFO, chip::WHOLE_FRAME | length as u32);
        chip.write(chip::TX_DATA_FIFO, length as u32);
        for &word in &words[..length.div_ceil(4)] {
            chip.write(chip::TX_DATA_FIFO, u32::from_le_bytes(word));
        }
        // The chip stops sending when its statuses are not collected.
        while chip.sent() != 0 {
            chip.read(chip::TX_STATUS_FIFO);
        }
        result
    }
}
