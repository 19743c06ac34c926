//! Where an acceptance run takes place: a simulator, and the PLC that is wired to it.
//!
//! Not here: what is asked of them. [`Lockstep`] has both in this process, on one clock; [`Live`] watches over Modbus
//! TCP a simulator that runs somewhere, with a PLC of which nothing is known.

use std::net::SocketAddr;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Result, bail};
use model_core::drive::DRIVE_PERIOD_MS;
use model_core::image::{self, Commands, Direction, Image, SIGNALS, Section};
use model_core::machine::{Machine, MachineError};
use model_core::plant::PLANT_PERIOD_MS;

use super::controller::Controller;
use crate::interrupt;
use crate::link::Link;
use crate::scenario::lockstep::Bench;

/// From look to look, drive cycles; a winder PLC's own cycle is as long.
pub const LOOK: u64 = 2;
/// From look to look on a running simulator.
const PERIOD: Duration = Duration::from_millis(LOOK * DRIVE_PERIOD_MS as u64);
/// A course may take so long, s of the simulator's time …
pub const LIMIT_S: f64 = 900.0;
/// … and where a person is asked for every press.
const ASKED_LIMIT_S: f64 = 5400.0;
/// A person has so long for it.
const PERSON: Duration = Duration::from_secs(60);
/// Without a tick for this long the simulator hangs.
const STANDSTILL_OF_TICKS: Duration = Duration::from_secs(5);

/// What was seen at a time.
#[derive(Clone, Copy, Debug)]
pub struct Look {
    /// Drive cycles since the run began.
    pub cycle: u64,
    /// Both blocks.
    pub image: Image,
}

/// A simulator with a PLC.
pub trait World {
    /// Lets a little time go on, with these words of the simulator's own: desk and faults.
    fn look(&mut self, own: &Commands) -> Result<Look>;

    /// An episode of the course begins, when so much of the course is over, 0 to 1.
    fn begins(&mut self, _episode: &'static str, _share: f64) {}

    /// Asks a person at the PLC's own desk to do something, where there is one.
    fn prompt(&mut self, _what: &str) -> Result<()> {
        Ok(())
    }

    /// A course may take so long, s of the simulator's time.
    fn limit_s(&self) -> f64 {
        LIMIT_S
    }
}

/// The words of the commands that are the simulator's own, as stretches of the block.
pub fn own_words() -> Vec<(usize, usize)> {
    stretches(|s| s.direction == Direction::Command && s.section == Section::Simulator)
}

/// The words of some signals of a block, as stretches: first word and number of words.
pub fn stretches(of: impl Fn(&image::Signal) -> bool) -> Vec<(usize, usize)> {
    let mut stretches: Vec<(usize, usize)> = Vec::new();
    for signal in SIGNALS.iter().filter(|signal| of(signal)) {
        let (from, words) = (usize::from(signal.word), usize::from(signal.kind.words()));
        match stretches.last_mut() {
            Some((first, many)) if *first + *many == from => *many += words,
            _ => stretches.push((from, words)),
        }
    }
    stretches
}

/// Puts the simulator's own words of one block into another.
pub fn put_own(own: &Commands, into: &mut Commands) {
    for (from, words) in own_words() {
        let stretch = from..from + words;
        into.words[stretch.clone()].copy_from_slice(&own.words[stretch]);
    }
}

/// Simulator and PLC in this process, on one clock; a clone goes on to the same bits.
#[derive(Clone)]
pub struct Lockstep<C> {
    bench: Bench,
    commands: Commands,
    /// The PLC.
    pub plc: C,
}

impl<C: Controller> Lockstep<C> {
    /// Both at power-up; fails with the first parameter of the machine outside its limits.
    pub fn new(machine: &Machine, plc: C) -> Result<Self, MachineError> {
        Ok(Self {
            bench: Bench::new(machine)?,
            commands: Commands::of(machine),
            plc,
        })
    }
}

impl<C: Controller> World for Lockstep<C> {
    fn look(&mut self, own: &Commands) -> Result<Look> {
        put_own(own, &mut self.commands);
        for _ in 0..LOOK {
            self.bench.step(&self.commands);
            if self.bench.cycle.is_multiple_of(self.plc.period()) {
                self.plc.cycle(&self.bench.image, &mut self.commands);
                // whatever a PLC writes there
                put_own(own, &mut self.commands);
            }
        }
        Ok(Look {
            cycle: self.bench.cycle,
            image: Image {
                commands: self.commands,
                feedback: self.bench.image.feedback,
            },
        })
    }
}

/// A simulator that runs somewhere, with a PLC wired to it.
pub struct Live {
    link: Link,
    stretches: Vec<(usize, usize)>,
    written: Option<Commands>,
    first: Option<u32>,
    last: (u32, Instant),
    /// Lines that a person types, where one is asked.
    typed: Option<Receiver<String>>,
}

impl Live {
    /// Connects; where lines are typed, a person is asked for what the desk's words would say.
    pub fn connect(address: SocketAddr, typed: Option<Receiver<String>>) -> Result<Self> {
        Ok(Self {
            link: Link::connect(address)?,
            stretches: own_words(),
            written: None,
            first: None,
            last: (0, Instant::now()),
            typed,
        })
    }
}

impl World for Live {
    fn look(&mut self, own: &Commands) -> Result<Look> {
        interrupt::check()?;
        let began = Instant::now();
        for &(from, words) in &self.stretches {
            let stretch = from..from + words;
            let same = |w: &Commands| w.words[stretch.clone()] == own.words[stretch.clone()];
            if !self.written.as_ref().is_some_and(same) {
                self.link.write_at(from, &own.words[stretch])?;
            }
        }
        self.written = Some(*own);
        thread::sleep(PERIOD.saturating_sub(began.elapsed()));
        let image = Image {
            commands: self.link.read_commands()?,
            feedback: self.link.read()?,
        };
        let tick = image.feedback.double(&image::PLANT_TICKS);
        if tick != self.last.0 {
            self.last = (tick, Instant::now());
        } else if self.last.1.elapsed() > STANDSTILL_OF_TICKS {
            bail!(
                "the simulator answers, but its plant has stood at tick {tick} for {} s",
                STANDSTILL_OF_TICKS.as_secs()
            );
        }
        let ticks = tick.wrapping_sub(*self.first.get_or_insert(tick));
        Ok(Look {
            cycle: u64::from(ticks) * u64::from(PLANT_PERIOD_MS) / u64::from(DRIVE_PERIOD_MS),
            image,
        })
    }

    fn prompt(&mut self, what: &str) -> Result<()> {
        let Some(typed) = &self.typed else {
            return Ok(());
        };
        eprintln!("at the PLC's desk: {what}; and Enter as you do it");
        let began = Instant::now();
        while began.elapsed() < PERSON {
            interrupt::check()?;
            match typed.recv_timeout(PERIOD) {
                Ok(_) | Err(RecvTimeoutError::Disconnected) => return Ok(()),
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
        eprintln!("nobody did within {} s: going on", PERSON.as_secs());
        Ok(())
    }

    fn limit_s(&self) -> f64 {
        self.typed.as_ref().map_or(LIMIT_S, |_| ASKED_LIMIT_S)
    }
}

/// Lines from the keyboard, read beside.
pub fn typed() -> Receiver<String> {
    let (send, receive) = mpsc::channel();
    thread::spawn(move || {
        for line in std::io::stdin().lines().map_while(std::io::Result::ok) {
            if send.send(line).is_err() {
                return;
            }
        }
    });
    receive
}
