//! A flash that outlives the board, as a flash does, and whose power can be made to fail.
//!
//! Not here: a file. What is stored is gone with the process.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use firmware::store::Ram;

type Cells = Ram<Vec<u8>>;

/// Pages of it.
const PAGES: usize = 2;

/// The flash; its clones are the same one.
#[derive(Clone, Debug)]
pub struct Flash(Arc<Mutex<Powered>>);

#[derive(Debug)]
struct Powered {
    cells: Cells,
    /// Words that are still written, and pages erased, before the power fails.
    steps: Option<usize>,
}

/// Why the flash did not do something.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failed {
    /// It cannot.
    Refused,
    /// Its power has failed.
    Power,
}

impl NorFlashError for Failed {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl Default for Flash {
    /// Erased.
    fn default() -> Self {
        let mut cells = Ram(vec![0; Cells::bytes(PAGES)]);
        cells.clear();
        Self(Arc::new(Mutex::new(Powered { cells, steps: None })))
    }
}

impl Flash {
    fn lock(&self) -> MutexGuard<'_, Powered> {
        // What a panicking thread has left is whole words.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Its power fails after so many words written or pages erased, or comes back.
    pub fn fail_after(&self, steps: Option<usize>) {
        self.lock().steps = steps;
    }

    /// Everything in it.
    pub fn bytes(&self) -> Vec<u8> {
        self.lock().cells.0.clone()
    }

    /// Something else stands in it.
    pub fn fill(&self, with: impl Fn(usize) -> u8) {
        let mut powered = self.lock();
        let bytes = powered.cells.0.iter_mut().enumerate();
        bytes.for_each(|(i, byte)| *byte = with(i));
    }

    /// How many bytes it has.
    pub fn size(&self) -> u32 {
        self.lock().cells.0.len() as u32
    }
}

impl Powered {
    fn step(&mut self) -> Result<(), Failed> {
        match &mut self.steps {
            Some(0) => Err(Failed::Power),
            Some(steps) => {
                *steps -= 1;
                Ok(())
            }
            None => Ok(()),
        }
    }
}

impl ErrorType for Flash {
    type Error = Failed;
}

// A lock is never held while something is waited for: the cells do all at once.
#[allow(clippy::await_holding_lock)]
impl ReadNorFlash for Flash {
    const READ_SIZE: usize = Cells::READ_SIZE;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Failed> {
        let read = self.lock().cells.read(offset, bytes).await;
        read.map_err(|_| Failed::Refused)
    }

    fn capacity(&self) -> usize {
        self.lock().cells.capacity()
    }
}

#[allow(clippy::await_holding_lock)]
impl NorFlash for Flash {
    const WRITE_SIZE: usize = Cells::WRITE_SIZE;
    const ERASE_SIZE: usize = Cells::ERASE_SIZE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Failed> {
        let mut powered = self.lock();
        for page in (from..to).step_by(Self::ERASE_SIZE) {
            powered.step()?;
            let end = page + Self::ERASE_SIZE as u32;
            let erased = powered.cells.erase(page, end).await;
            erased.map_err(|_| Failed::Refused)?;
        }
        Ok(())
    }

    async fn write(&mut self, offset: u32, data: &[u8]) -> Result<(), Failed> {
        let mut powered = self.lock();
        for (at, word) in (offset..)
            .step_by(Self::WRITE_SIZE)
            .zip(data.chunks(Self::WRITE_SIZE))
        {
            powered.step()?;
            let written = powered.cells.write(at, word).await;
            written.map_err(|_| Failed::Refused)?;
        }
        Ok(())
    }
}
