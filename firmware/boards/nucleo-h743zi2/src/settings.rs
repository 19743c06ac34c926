//! The settings in the last two sectors of the flash.
//!
//! They are in bank 2 and the program in bank 1, so that the core runs on while a sector is erased.
//! Source: RM0433 rev. 8, section 4.3 (read while write).

use core::ops::Range;

use embassy_embedded_hal::adapter::BlockingAsync;
use embassy_stm32::Peri;
use embassy_stm32::flash::{Bank2Region, Blocking, Flash};
use embassy_stm32::peripherals::FLASH;
use firmware::store::{Content, Settings, Store};

/// In bank 2; what `memory.x` leaves free.
const RANGE: Range<u32> = 0xc_0000..0x10_0000;

/// The settings' store on this chip.
pub type Settled = Store<BlockingAsync<Bank2Region<'static, Blocking>>>;

/// The store, and what was in it; a held button empties it first.
pub async fn open(flash: Peri<'static, FLASH>, reset: bool) -> (Option<Settled>, Settings) {
    let bank = Flash::new_blocking(flash)
        .into_blocking_regions()
        .bank2_region;
    let Some(mut store) = Store::new(BlockingAsync::new(bank), RANGE) else {
        defmt::error!("no place for settings");
        return (None, Settings::default());
    };
    if reset {
        match store.discard().await {
            Ok(()) => defmt::warn!("settings emptied by the button"),
            Err(_) => defmt::error!("settings cannot be emptied"),
        }
    }
    let settings = match store.load().await {
        Content::Blank => Settings::default(),
        Content::Settings(settings) => settings,
        Content::Unusable(why) => {
            defmt::error!(
                "defaults, since the settings are of no use: {}",
                defmt::Debug2Format(&why)
            );
            Settings::default()
        }
    };
    (Some(store), settings)
}
