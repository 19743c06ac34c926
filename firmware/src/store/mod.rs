//! What survives without power: the settings, in flash.
//!
//! Not here: the flash itself, which is a board's, and what the settings do. A set of settings is written as one
//! item, so that whenever the power fails there is either the old set or the new one. What cannot be read as
//! settings of this firmware is left alone until a person decides: the simulator runs with its defaults meanwhile
//! and says why.
//!
//! Below is the log of the crate `sequential-storage`, which spreads the wear over all pages and gives each item a
//! check sum. [`Budget`] bounds how often it is written. [`Keeper`] knows what shall stand there, and whether it does.

mod budget;
mod keeper;
mod ram;
mod settings;

use core::ops::Range;

use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use sequential_storage::cache::{Cache, CacheImpl};
use sequential_storage::map::{MapConfig, MapStorage};

pub use budget::Budget;
pub use keeper::{Job, Keeper, State};
pub use ram::Ram;
pub use settings::{
    ADDRESSES, BAUDS, Invalid, Network, PREFIXES, Parity, SETTINGS_MAX, Serial, Settings,
};

/// The key of the one item, with the version of its form: settings of another form are not found. It is long enough
/// to tell by it that a flash is this firmware's.
type Key = [u8; 16];
const KEY: Key = *b"winder settings1";
/// The key of an empty item that is stored once settings have been. Without it the power has failed while the first
/// settings were written, and there is nothing to lose; with it settings that cannot be found are damaged.
const SEAL: Key = *b"winder has once1";

/// Room to encode key and settings in, rounded up to a flash word.
const BUFFER: usize = KEY.len() + SETTINGS_MAX + 64;

/// What stands in the flash.
#[derive(Clone, Debug, PartialEq)]
#[expect(
    clippy::large_enum_variant,
    reason = "without a heap it has to be somewhere"
)]
pub enum Content {
    /// Nothing was ever stored as a whole.
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
    /// Settings have been stored since the flash was empty.
    sealed: bool,
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
            sealed: false,
        })
    }

    /// Reads the settings. What is not this firmware's is not written to.
    pub async fn load(&mut self) -> Content {
        let content = self.read().await;
        self.kept = matches!(content, Content::Unusable(_));
        content
    }

    async fn read(&mut self) -> Content {
        self.sealed = false;
        self.look()
            .await
            .unwrap_or(Content::Unusable(Unusable::Flash))
    }

    async fn look(&mut self) -> Result<Content, ()> {
        /// Words of the first write until the key stands there: the page's mark, the item's head, the key.
        const BEGINNING: u32 = 3;
        let all = self.range.clone();
        let beginning = BEGINNING * F::WRITE_SIZE as u32;
        let rest = (all.start + beginning).min(all.end)..all.end;
        if !self.is_written(all.clone()).await? {
            return Ok(Content::Blank);
        }
        let begun = !self.is_written(rest).await?;
        let own = begun || self.holds(&KEY).await?;
        // Wherever it stands: what leads to it may be damaged.
        self.sealed = self.holds(&SEAL).await?;
        let settings = match fetch(ReadOnly(&mut self.flash), &self.range).await {
            // The log repairs itself where the power has failed; it may do so with what is its own.
            Err(Refused::ReadOnly) if own => {
                fetch(&mut self.flash, &self.range).await.map_err(|_| ())?
            }
            Err(Refused::ReadOnly) => None,
            Err(Refused::Flash(_)) => return Err(()),
            Ok(settings) => settings,
        };
        Ok(match settings {
            Some(Ok(settings)) => Content::Settings(settings),
            Some(Err(invalid)) => Content::Unusable(Unusable::Invalid(invalid)),
            None if own && !self.sealed => Content::Blank,
            None => Content::Unusable(Unusable::Foreign),
        })
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
            .map_err(|_| SaveError::Flash)?;
        if !self.sealed {
            let nothing: &[u8] = &[];
            map.store_item(&mut buffer, &SEAL, &nothing)
                .await
                .map_err(|_| SaveError::Flash)?;
            self.sealed = true;
        }
        Ok(())
    }

    /// Empties the flash, whatever is in it: a person has decided.
    pub async fn discard(&mut self) -> Result<(), SaveError> {
        let Range { start, end } = self.range;
        self.flash
            .erase(start, end)
            .await
            .map_err(|_| SaveError::Flash)?;
        (self.kept, self.sealed) = (false, false);
        Ok(())
    }

    /// Whether anything in a range is not erased.
    async fn is_written(&mut self, range: Range<u32>) -> Result<bool, ()> {
        let mut piece = [ERASED; PIECE];
        for at in range.clone().step_by(PIECE) {
            let piece = &mut piece[..PIECE.min((range.end - at) as usize)];
            self.flash.read(at, piece).await.map_err(|_| ())?;
            if piece.iter().any(|byte| *byte != ERASED) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Whether a key stands anywhere.
    async fn holds(&mut self, key: &Key) -> Result<bool, ()> {
        const OLD: usize = size_of::<Key>() - 1;
        // The end of one piece stands before the next.
        let mut window = [ERASED; OLD + PIECE];
        for at in self.range.clone().step_by(PIECE) {
            let length = PIECE.min((self.range.end - at) as usize);
            let piece = &mut window[OLD..OLD + length];
            self.flash.read(at, piece).await.map_err(|_| ())?;
            let mut places = window[..OLD + length].windows(key.len());
            if places.any(|bytes| bytes == key) {
                return Ok(true);
            }
            window.copy_within(length..length + OLD, 0);
        }
        Ok(false)
    }
}

/// Bytes that are looked at together.
const PIECE: usize = 64;
/// A byte of erased flash.
const ERASED: u8 = 0xff;

/// The settings of the log, if there are any; fails where the flash does.
async fn fetch<F: NorFlash>(
    flash: F,
    range: &Range<u32>,
) -> Result<Option<Result<Settings, Invalid>>, F::Error> {
    let mut buffer = [0; BUFFER];
    let Some(mut map) = map(flash, range) else {
        return Ok(None);
    };
    match map.fetch_item::<&[u8]>(&mut buffer, &KEY).await {
        Ok(bytes) => Ok(bytes.map(Settings::decode)),
        Err(sequential_storage::Error::Storage { value, .. }) => Err(value),
        Err(_) => Ok(None),
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
