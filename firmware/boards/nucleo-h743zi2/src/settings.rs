//! The last two sectors of the flash, where the settings are.
//!
//! They are in bank 2 and the program in bank 1, so that the core runs on while a sector is erased; they are not cached,
//! since what is written would be read as it was before. Source: RM0433 rev. 8, section 4.3.
//!
//! A word that a power cut has torn does not pass the flash's error correction, and reading it is a bus fault. So words
//! are read with such faults ignored, and one that does not pass is taken for zeros, which the log passes over.

use core::ops::Range;

use board_cortex_m::memory::read_or_zeros;
use board_cortex_m::net::LocalDesk;
use embassy_stm32::flash::{Async, Error, FLASH_BASE, Flash, InterruptHandler, WRITE_SIZE};
use embassy_stm32::peripherals::FLASH;
use embassy_stm32::{Peri, bind_interrupts};
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use firmware::hmi;
use firmware::store::Store;

bind_interrupts!(struct Irqs {
    FLASH => InterruptHandler;
});

/// From the flash's beginning; what `memory.x` leaves free.
pub const RANGE: Range<u32> = 0x1c_0000..0x20_0000;

/// The flash.
pub struct Sectors(Flash<'static, Async>);

impl Sectors {
    /// Takes it.
    pub fn new(flash: Peri<'static, FLASH>) -> Self {
        Self(Flash::new(flash, Irqs))
    }
}

impl ErrorType for Sectors {
    type Error = Error;
}

impl ReadNorFlash for Sectors {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Error> {
        if offset < RANGE.start || offset as usize + bytes.len() > RANGE.end as usize {
            return Err(Error::Size);
        }
        // SAFETY: flash, which reading does not change; a word is read within a microsecond.
        unsafe { read_or_zeros::<WRITE_SIZE>(FLASH_BASE as u32 + offset, bytes) };
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.0.capacity()
    }
}

impl NorFlash for Sectors {
    const WRITE_SIZE: usize = WRITE_SIZE;
    const ERASE_SIZE: usize = <Flash<Async> as NorFlash>::ERASE_SIZE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Error> {
        self.0.erase(from, to).await
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Error> {
        self.0.write(offset, bytes).await
    }
}

/// Keeps the settings, in the background.
#[embassy_executor::task]
pub async fn keep(mut store: Store<Sectors>, desk: &'static LocalDesk) {
    hmi::keep(&mut store, desk).await;
}
