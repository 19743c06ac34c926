//! What survives without power: the settings, in flash.
//!
//! Not here: the flash itself, which is a board's, and what the settings do. A set of settings is written as one
//! item, so that whenever the power fails there is either the old set or the new one. What cannot be read as
//! settings of this firmware is left alone until a person decides: the simulator runs with its defaults meanwhile
//! and says why.
//!
//! Below is the log of the crate `sequential-storage`, which spreads the wear over all pages and gives each item a
//! check sum. [`Budget`] bounds how often it is written.

mod budget;
mod settings;

use core::ops::Range;

use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use sequential_storage::cache::{Cache, CacheImpl};
use sequential_storage::map::{MapConfig, MapStorage};

pub use budget::Budget;
pub use settings::{Invalid, Network, Parity, SETTINGS_MAX, Serial, Settings};

/// The key of the one item, with the version of its form: settings of another form are not found. It is long enough
/// to tell by it that a flash is this firmware's.
type Key = [u8; 16];
const KEY: Key = *b"winder settings1";

/// Room to encode key and settings in, rounded up to a flash word.
const BUFFER: usize = KEY.len() + SETTINGS_MAX + 64;

/// What stands in the flash.
#[derive(Clone, Debug, PartialEq)]
#[expect(
    clippy::large_enum_variant,
    reason = "without a heap it has to be somewhere"
)]
pub enum Content {
    /// Nothing was ever stored.
    Blank,
    /// Settings.
    Settings(Settings),
    /// Something else.
    Unusable(Unusable),
}

/// Why the content of the flash is of no use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unusable {
    /// Not written by this firmware, or damaged.
    Foreign,
    /// Settings that this firmware cannot have: written by another version of it.
    Invalid(Invalid),
    /// The flash does not answer.
    Flash,
}

/// Settings were not stored; what stood in the flash still does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SaveError {
    /// The flash has a content that is not this firmware's, and [`Store::discard`] was not called.
    Unusable,
    /// The flash does not take it.
    Flash,
}

/// The settings in a range of a board's flash, of two erasable pages at least.
pub struct Store<F> {
    flash: F,
    range: Range<u32>,
    /// There is something that must not be overwritten.
    kept: bool,
}

impl<F: NorFlash> Store<F> {
    /// The store in `range`; none if the range does not consist of two or more whole pages.
    pub fn new(flash: F, range: Range<u32>) -> Option<Self> {
        MapConfig::<F>::try_new(range.clone()).ok()?;
        Some(Self {
            flash,
            range,
            // until it has been looked at
            kept: true,
        })
    }

    /// Reads the settings. What is not this firmware's is not written to.
    pub async fn load(&mut self) -> Content {
        let content = self.read().await;
        self.kept = matches!(content, Content::Unusable(_));
        content
    }

    async fn read(&mut self) -> Content {
        match self
            .holds(|bytes| bytes.iter().any(|byte| *byte != ERASED))
            .await
        {
            Ok(true) => (),
            Ok(false) => return Content::Blank,
            Err(()) => return Content::Unusable(Unusable::Flash),
        }
        match fetch(ReadOnly(&mut self.flash), &self.range).await {
            // The log repairs itself where the power has failed; it may do so with what is its own.
            Err(Refused::ReadOnly) => match self.holds(|bytes| bytes == KEY).await {
                Ok(true) => match fetch(&mut self.flash, &self.range).await {
                    Ok(content) => content,
                    Err(_) => Content::Unusable(Unusable::Flash),
                },
                Ok(false) => Content::Unusable(Unusable::Foreign),
                Err(()) => Content::Unusable(Unusable::Flash),
            },
            Err(Refused::Flash(_)) => Content::Unusable(Unusable::Flash),
            Ok(content) => content,
        }
    }

    /// Stores settings in place of the old ones.
    pub async fn save(&mut self, settings: &Settings) -> Result<(), SaveError> {
        if self.kept {
            return Err(SaveError::Unusable);
        }
        let (mut buffer, mut encoded) = ([0; BUFFER], [0; SETTINGS_MAX]);
        let bytes: &[u8] = settings.encode(&mut encoded).ok_or(SaveError::Flash)?;
        let mut map = map(&mut self.flash, &self.range).ok_or(SaveError::Flash)?;
        map.store_item(&mut buffer, &KEY, &bytes)
            .await
            .map_err(|_| SaveError::Flash)
    }

    /// Empties the flash, whatever is in it: a person has decided.
    pub async fn discard(&mut self) -> Result<(), SaveError> {
        let Range { start, end } = self.range;
        self.flash
            .erase(start, end)
            .await
            .map_err(|_| SaveError::Flash)?;
        self.kept = false;
        Ok(())
    }

    /// Whether `is` holds for any bytes in a row that are as long as a key.
    async fn holds(&mut self, is: impl Fn(&[u8]) -> bool) -> Result<bool, ()> {
        const NEW: usize = 64;
        const OLD: usize = KEY.len() - 1;
        // The end of one piece stands before the next.
        let mut window = [ERASED; OLD + NEW];
        for at in self.range.clone().step_by(NEW) {
            let length = NEW.min((self.range.end - at) as usize);
            let piece = &mut window[OLD..OLD + length];
            self.flash.read(at, piece).await.map_err(|_| ())?;
            if window[..OLD + length].windows(KEY.len()).any(&is) {
                return Ok(true);
            }
            window.copy_within(length..length + OLD, 0);
        }
        Ok(false)
    }
}

/// A byte of erased flash.
const ERASED: u8 = 0xff;

/// What the log holds; fails where the flash does.
async fn fetch<F: NorFlash>(flash: F, range: &Range<u32>) -> Result<Content, F::Error> {
    let foreign = Ok(Content::Unusable(Unusable::Foreign));
    let mut buffer = [0; BUFFER];
    let Some(mut map) = map(flash, range) else {
        return foreign;
    };
    match map.fetch_item::<&[u8]>(&mut buffer, &KEY).await {
        Ok(Some(bytes)) => Ok(match Settings::decode(bytes) {
            Ok(settings) => Content::Settings(settings),
            Err(invalid) => Content::Unusable(Unusable::Invalid(invalid)),
        }),
        Err(sequential_storage::Error::Storage { value, .. }) => Err(value),
        _ => foreign,
    }
}

fn map<F: NorFlash>(
    flash: F,
    range: &Range<u32>,
) -> Option<MapStorage<Key, F, impl CacheImpl<Key>>> {
    let config = MapConfig::try_new(range.clone()).ok()?;
    Some(MapStorage::new(flash, config, Cache::new_uncached()))
}

/// A flash that is only looked at: what looks damaged may be somebody else's.
struct ReadOnly<'a, F>(&'a mut F);

#[derive(Debug)]
enum Refused<E> {
    /// To write to it.
    ReadOnly,
    /// By the flash itself.
    Flash(E),
}

impl<E: NorFlashError> NorFlashError for Refused<E> {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::ReadOnly => NorFlashErrorKind::Other,
            Self::Flash(error) => error.kind(),
        }
    }
}

impl<F: ErrorType> ErrorType for ReadOnly<'_, F> {
    type Error = Refused<F::Error>;
}

impl<F: ReadNorFlash> ReadNorFlash for ReadOnly<'_, F> {
    const READ_SIZE: usize = F::READ_SIZE;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Self::Error> {
        self.0.read(offset, bytes).await.map_err(Refused::Flash)
    }

    fn capacity(&self) -> usize {
        self.0.capacity()
    }
}

impl<F: NorFlash> NorFlash for ReadOnly<'_, F> {
    const WRITE_SIZE: usize = F::WRITE_SIZE;
    const ERASE_SIZE: usize = F::ERASE_SIZE;

    async fn erase(&mut self, _: u32, _: u32) -> Result<(), Self::Error> {
        Err(Refused::ReadOnly)
    }

    async fn write(&mut self, _: u32, _: &[u8]) -> Result<(), Self::Error> {
        Err(Refused::ReadOnly)
    }
}
