//! Settings in flash: the power fails at every step of every write, and what stands there is always whole.

use embassy_futures::block_on;
use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use firmware::store::{Budget, Content, Invalid, Network, SaveError, Settings, Store, Unusable};
use model_core::machine::Machine;
use proptest::prelude::*;

/// A flash word of the STM32H7, in bytes. Written once, it can only be made all zeros.
const WORD: usize = 32;
/// Small pages, so that the log turns over often.
const PAGE: usize = 8192;
const PAGES: usize = 2;
const SIZE: usize = PAGE * PAGES;

/// How far the step gets in which the power fails.
#[derive(Clone, Copy, Debug)]
enum Torn {
    /// Nothing of it is done.
    Not,
    /// A word is half written, a page half erased.
    Half,
    /// All of it is done, and nothing after it.
    Done,
}

#[derive(Clone)]
struct Flash {
    bytes: Vec<u8>,
    erased: usize,
    /// Steps since the last count: a word written, a page erased.
    steps: usize,
    /// The step in which the power fails.
    cut: Option<(usize, Torn)>,
}

#[derive(Debug)]
enum Failed {
    Power,
    /// A word is written twice, and not with zeros.
    Overwritten,
}

impl NorFlashError for Failed {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl Flash {
    fn new() -> Self {
        Self {
            bytes: vec![0xff; SIZE],
            erased: 0,
            steps: 0,
            cut: None,
        }
    }

    fn step(&mut self, act: impl Fn(&mut [u8], Torn)) -> Result<(), Failed> {
        let step = self.steps;
        self.steps += 1;
        match self.cut {
            Some((at, torn)) if at == step => act(&mut self.bytes, torn),
            Some((at, _)) if at < step => return Err(Failed::Power),
            _ => {
                act(&mut self.bytes, Torn::Done);
                return Ok(());
            }
        }
        Err(Failed::Power)
    }
}

impl ErrorType for Flash {
    type Error = Failed;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Failed> {
        let at = offset as usize;
        bytes.copy_from_slice(&self.bytes[at..at + bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        SIZE
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = PAGE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Failed> {
        for page in (from as usize..to as usize).step_by(PAGE) {
            self.erased += 1;
            self.step(|bytes, torn| match torn {
                Torn::Not => (),
                Torn::Half => bytes[page..page + PAGE / 2].fill(0xff),
                Torn::Done => bytes[page..page + PAGE].fill(0xff),
            })?;
        }
        Ok(())
    }

    async fn write(&mut self, offset: u32, data: &[u8]) -> Result<(), Failed> {
        assert_eq!((offset as usize % WORD, data.len() % WORD), (0, 0));
        for (i, word) in data.chunks(WORD).enumerate() {
            let at = offset as usize + i * WORD;
            let erased = self.bytes[at..at + WORD].iter().all(|byte| *byte == 0xff);
            if !erased && word.iter().any(|byte| *byte != 0) {
                return Err(Failed::Overwritten);
            }
            self.step(|bytes, torn| match torn {
                Torn::Not => (),
                Torn::Half => bytes[at..at + WORD / 2].copy_from_slice(&word[..WORD / 2]),
                Torn::Done => bytes[at..at + WORD].copy_from_slice(word),
            })?;
        }
        Ok(())
    }
}

fn load(flash: &mut Flash) -> Content {
    let mut store = Store::new(flash, 0..SIZE as u32).expect("two pages");
    block_on(store.load())
}

/// Saves as a simulator does: after having looked.
fn save(flash: &mut Flash, settings: &Settings) -> Result<(), SaveError> {
    flash.steps = 0;
    let mut store = Store::new(flash, 0..SIZE as u32).expect("two pages");
    block_on(store.load());
    block_on(store.save(settings))
}

fn numbered(n: usize) -> Settings {
    let mut machine = if n.is_multiple_of(2) {
        Machine::news_8000()
    } else {
        Machine::lwc_8000()
    };
    machine.web.tail = false;
    machine.encoder_pulses = 1.0 + n as f64;
    Settings {
        machine,
        ..Settings::default()
    }
}

#[test]
fn whenever_the_power_fails_there_is_the_old_set_or_the_new_one() {
    let mut flash = Flash::new();
    let mut erased = 0;
    let mut cuts = 0;
    // as many sets as turn the log over several times
    for n in 0..16 {
        let (old, new) = (load(&mut flash), numbered(n));
        let mut whole = flash.clone();
        save(&mut whole, &new).unwrap();
        for step in 0..whole.steps {
            for torn in [Torn::Not, Torn::Half, Torn::Done] {
                let mut cut = Flash {
                    cut: Some((step, torn)),
                    ..flash.clone()
                };
                save(&mut cut, &new).unwrap_err();
                cut.cut = None;
                let found = load(&mut cut);
                let is_new = found == Content::Settings(new.clone());
                let is_old = found == old;
                assert!(
                    is_new || is_old,
                    "set {n}, step {step}, {torn:?}: {found:?}"
                );
                // and life goes on
                let next = numbered(n + 100);
                save(&mut cut, &next)
                    .unwrap_or_else(|e| panic!("set {n}, step {step}, {torn:?}: {e:?}"));
                assert_eq!(load(&mut cut), Content::Settings(next));
                cuts += 1;
            }
        }
        flash = whole;
        flash.steps = 0;
        erased = flash.erased;
        assert_eq!(load(&mut flash), Content::Settings(new));
    }
    assert!(
        erased >= 3 && cuts > 1000,
        "{erased} pages erased, {cuts} cuts"
    );
}

#[test]
fn what_is_not_ours_is_kept_until_a_person_decides() {
    let mut foreign = Flash::new();
    for (i, byte) in foreign.bytes.iter_mut().enumerate() {
        *byte = (i * 31 % 251) as u8;
    }
    let before = foreign.bytes.clone();
    assert_eq!(load(&mut foreign), Content::Unusable(Unusable::Foreign));
    let mut store = Store::new(&mut foreign, 0..SIZE as u32).unwrap();
    // not before it was looked at, and not after
    assert_eq!(block_on(store.save(&numbered(1))), Err(SaveError::Unusable));
    block_on(store.load());
    assert_eq!(block_on(store.save(&numbered(1))), Err(SaveError::Unusable));
    assert_eq!(foreign.bytes, before);

    let mut store = Store::new(&mut foreign, 0..SIZE as u32).unwrap();
    block_on(store.load());
    block_on(store.discard()).unwrap();
    assert_eq!(block_on(store.load()), Content::Blank);
    block_on(store.save(&numbered(1))).unwrap();
    assert_eq!(block_on(store.load()), Content::Settings(numbered(1)));
}

/// Settings that were once whole are somebody's: damaged, they are not taken for a first write that was cut.
#[test]
fn damaged_settings_are_kept_until_a_person_decides() {
    let mut whole = Flash::new();
    save(&mut whole, &numbered(1)).unwrap();
    let written = whole.bytes.iter().rposition(|byte| *byte != 0xff).unwrap();
    let mut kept = 0;
    for word in 1..written / WORD {
        let mut flash = whole.clone();
        for byte in &mut flash.bytes[word * WORD..(word + 1) * WORD] {
            *byte = !*byte;
        }
        match load(&mut flash) {
            Content::Unusable(Unusable::Foreign) => kept += 1,
            // the seal's head: the settings are whole
            found => assert_eq!(found, Content::Settings(numbered(1)), "word {word}"),
        }
        let saved = save(&mut flash, &numbered(2));
        assert_eq!(
            saved,
            match load(&mut flash) {
                Content::Settings(_) => Ok(()),
                _ => Err(SaveError::Unusable),
            }
        );
    }
    assert!(kept > 40, "{kept}");
}

/// Emptied on purpose, whenever the power fails: the old set, or nothing of it.
#[test]
fn a_reset_that_is_cut_can_be_asked_for_again() {
    let mut whole = Flash::new();
    for n in 0..5 {
        save(&mut whole, &numbered(n)).unwrap();
    }
    for step in 0..PAGES {
        for torn in [Torn::Not, Torn::Half, Torn::Done] {
            let mut cut = whole.clone();
            (cut.cut, cut.steps) = (Some((step, torn)), 0);
            let mut store = Store::new(&mut cut, 0..SIZE as u32).unwrap();
            assert_eq!(block_on(store.discard()), Err(SaveError::Flash));
            cut.cut = None;
            match load(&mut cut) {
                Content::Settings(settings) => assert_eq!(settings, numbered(4)),
                Content::Blank | Content::Unusable(Unusable::Foreign) => (),
                other => panic!("page {step}, {torn:?}: {other:?}"),
            }
            let mut store = Store::new(&mut cut, 0..SIZE as u32).unwrap();
            block_on(store.discard()).unwrap();
            assert_eq!(block_on(store.load()), Content::Blank);
        }
    }
}

#[test]
fn a_store_of_less_than_two_pages_is_none() {
    for range in [0..PAGE as u32, 5..SIZE as u32, 0..0] {
        assert!(
            Store::new(Flash::new(), range.clone()).is_none(),
            "{range:?}"
        );
    }
}

/// The settings of an STM32H743: two sectors of 128 KiB, 10 000 erasures (DS12110, flash memory endurance).
#[test]
fn the_flash_outlives_the_winder() {
    const ENDURANCE: u64 = 10_000;
    const SECTOR: u64 = 128 * 1024;
    const YEARS: u64 = 20;
    const YEAR_S: u64 = 365 * 24 * 3600;

    // the longest log entry that a machine of the presets makes, measured
    let mut flash = Flash::new();
    let mut saves = 0_u64;
    while flash.erased < 40 {
        save(&mut flash, &numbered(saves as usize)).unwrap();
        saves += 1;
    }
    let per_erasure = saves / flash.erased as u64 * SECTOR / PAGE as u64;
    assert!(per_erasure > 30, "{per_erasure}");

    // somebody who wants to write every second
    let mut budget = Budget::default();
    let day = 24 * 3600;
    let a_day = (1..=day).filter(|now| budget.take(*now)).count() as u64;
    let writes = a_day * YEARS * YEAR_S / u64::from(day);
    let erasures = writes / per_erasure / PAGES as u64;
    assert!(
        erasures < ENDURANCE,
        "{erasures} erasures of each sector in {YEARS} years"
    );
}

#[test]
fn ten_writes_at_once_and_then_one_in_a_quarter_of_an_hour() {
    let mut budget = Budget::default();
    let taken = |budget: &mut Budget, times: std::ops::Range<u32>| {
        times.filter(|now| budget.take(*now)).count()
    };
    assert_eq!(taken(&mut budget, 0..60), 10);
    assert_eq!(taken(&mut budget, 60..900), 0);
    assert_eq!(taken(&mut budget, 900..1800), 1);
    // a clock that stands or goes back gives nothing
    assert!(!budget.take(5));
    assert_eq!(taken(&mut budget, 1_000_000..1_000_020), 10);
}

proptest! {
    /// Whatever stands in the flash: it is settings, or it is refused; what is foreign stays.
    #[test]
    fn no_content_panics_or_is_overwritten(
        whole in any::<bool>(),
        changes in prop::collection::vec((0..SIZE, any::<u8>()), 0..40),
    ) {
        let mut flash = Flash::new();
        if whole {
            save(&mut flash, &numbered(3)).unwrap();
            save(&mut flash, &numbered(4)).unwrap();
        }
        for (at, byte) in changes {
            flash.bytes[at] = byte;
        }
        let before = flash.bytes.clone();
        match load(&mut flash) {
            Content::Settings(settings) => prop_assert!(settings == numbered(3) || settings == numbered(4)),
            Content::Unusable(Unusable::Flash | Unusable::Invalid(Invalid::Form)) => prop_assert!(false),
            Content::Blank | Content::Unusable(_) => (),
        }
        // its own log may repair itself
        prop_assert!(whole || before == flash.bytes);
    }
}

/// A network without server has an address all the same.
#[test]
fn the_fallback_address_is_valid() {
    let settings = Settings {
        network: Network::FALLBACK,
        ..Settings::default()
    };
    settings.validate().unwrap();
}
