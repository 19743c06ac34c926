//! A scenario on a simulator that runs somewhere, over Modbus TCP.
//!
//! Not here: starting it. What it did before, it goes on from: a scenario that starts with a prelude acknowledges
//! faults and puts in new rolls first.

use std::net::SocketAddr;
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Result, bail, ensure};
use model_core::drive::DRIVE_PERIOD_MS;
use model_core::image;
use model_core::plant::PLANT_PERIOD_MS;

use super::Scenario;
use super::lockstep::Outcome;
use super::player::{Player, Timing};
use crate::interrupt;
use crate::link::Link;

/// From look to look.
const PERIOD: Duration = Duration::from_millis(DRIVE_PERIOD_MS as u64);
/// Without a tick for this long the simulator hangs.
const STANDSTILL_OF_TICKS: Duration = Duration::from_secs(5);

/// Plays a scenario; time is that of the simulator's ticks, at whatever pace it runs.
pub fn play<'a>(
    scenario: &'a Scenario,
    address: SocketAddr,
    mut look: impl FnMut(&Player<'a>),
) -> Result<Outcome> {
    let shipped = scenario.machine.machine == model_core::machine::Machine::news_8000();
    ensure!(
        shipped,
        "{}: the simulator at {address} is a NEWS-8000, and this scenario has another machine",
        scenario.name
    );
    let mut link = Link::connect(address)?;
    let mut player = Player::new(scenario, Timing::LIVE);
    let first = link.read()?.double(&image::PLANT_TICKS);
    let (mut last, mut ticked) = (None, Instant::now());
    loop {
        interrupt::check()?;
        let began = Instant::now();
        let feedback = link.read()?;
        let ticks = feedback.double(&image::PLANT_TICKS).wrapping_sub(first);
        if last != Some(ticks) {
            (last, ticked) = (Some(ticks), Instant::now());
        } else if ticked.elapsed() > STANDSTILL_OF_TICKS {
            bail!(
                "the simulator answers, but its plant has stood at tick {ticks} for {} s",
                STANDSTILL_OF_TICKS.as_secs()
            );
        }
        let cycle = u64::from(ticks) * u64::from(PLANT_PERIOD_MS) / u64::from(DRIVE_PERIOD_MS);
        player.look(cycle, &feedback);
        look(&player);
        if player.is_done() {
            return Ok(Outcome {
                failures: player.failures().to_vec(),
                cycles: cycle,
                trajectory: feedback.double(&image::TRAJECTORY),
            });
        }
        link.write_all(player.commands())?;
        thread::sleep(PERIOD.saturating_sub(began.elapsed()));
    }
}
