//! The settings at power-up.
//!
//! Not here: the flash, which is the board's, and keeping them later, which is the library's `hmi::keep`.

use core::ops::Range;

use embedded_storage_async::nor_flash::NorFlash;
use firmware::store::{Content, Keeper, Store};
use model_core::machine::Machine;

/// Reads the settings, and says in the log what came of it; a `reset` empties the flash first. Without a place for
/// settings there are the defaults.
pub async fn open<F: NorFlash>(
    flash: F,
    range: Range<u32>,
    reset: bool,
) -> (Option<Store<F>>, Keeper) {
    let Some(mut store) = Store::new(flash, range) else {
        defmt::error!("no place for settings");
        return (None, Keeper::nowhere(&Machine::news_8000()));
    };
    if reset {
        match store.discard().await {
            Ok(()) => defmt::warn!("settings emptied by the button"),
            Err(_) => defmt::error!("settings cannot be emptied"),
        }
    }
    let content = store.load().await;
    if let Content::Unusable(why) = &content {
        defmt::error!("defaults: {}", defmt::Display2Format(why));
    }
    (Some(store), Keeper::of(content))
}
