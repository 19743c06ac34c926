//! Memory that behaves like flash, for boards that have none to write to.
//!
//! Not here: keeping it without power.

use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};

/// A flash word, in bytes: that of an STM32H7.
const WORD: usize = 32;
/// What is erased at once, in bytes.
const PAGE: usize = 8192;
/// A byte of erased flash.
const ERASED: u8 = 0xff;

/// Flash in memory: as strict as flash, so that what works here works there.
#[derive(Debug)]
pub struct Ram<B>(pub B);

/// What flash does not do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refused {
    /// There is no such place.
    Outside,
    /// Not a whole word or page.
    Unaligned,
    /// A word is written that is not erased; only zeros may be.
    Written,
}

impl NorFlashError for Refused {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::Outside => NorFlashErrorKind::OutOfBounds,
            Self::Unaligned => NorFlashErrorKind::NotAligned,
            Self::Written => NorFlashErrorKind::Other,
        }
    }
}

impl<B> ErrorType for Ram<B> {
    type Error = Refused;
}

impl<B: AsMut<[u8]>> Ram<B> {
    /// Pages that a flash of so many has, in bytes.
    pub const fn bytes(pages: usize) -> usize {
        pages * PAGE
    }

    /// Empties all of it.
    pub fn clear(&mut self) {
        self.0.as_mut().fill(ERASED);
    }

    fn place(&mut self, at: u32, length: usize, unit: usize) -> Result<&mut [u8], Refused> {
        let at = at as usize;
        if !at.is_multiple_of(unit) || !length.is_multiple_of(unit) {
            return Err(Refused::Unaligned);
        }
        let bytes = self.0.as_mut();
        bytes.get_mut(at..at + length).ok_or(Refused::Outside)
    }
}

impl<B: AsMut<[u8]> + AsRef<[u8]>> ReadNorFlash for Ram<B> {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Refused> {
        bytes.copy_from_slice(self.place(offset, bytes.len(), 1)?);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.0.as_ref().len()
    }
}

impl<B: AsMut<[u8]> + AsRef<[u8]>> NorFlash for Ram<B> {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = PAGE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Refused> {
        let length = to.checked_sub(from).ok_or(Refused::Outside)? as usize;
        self.place(from, length, PAGE)?.fill(ERASED);
        Ok(())
    }

    async fn write(&mut self, offset: u32, data: &[u8]) -> Result<(), Refused> {
        let place = self.place(offset, data.len(), WORD)?;
        for (old, new) in place.chunks_mut(WORD).zip(data.chunks(WORD)) {
            let erased = old.iter().all(|byte| *byte == ERASED);
            if !erased && new.iter().any(|byte| *byte != 0) {
                return Err(Refused::Written);
            }
            old.copy_from_slice(new);
        }
        Ok(())
    }
}
