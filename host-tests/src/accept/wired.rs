//! A controller wired to a simulator that runs somewhere, in real time: a winder PLC of its own.
//!
//! Not here: what it does. It reads both blocks, runs one cycle and writes all words that are a PLC's, once in its
//! period; a connection that is lost is made again, and the program goes on meanwhile, as a PLC's does.

use std::net::SocketAddr;
use std::thread;
use std::time::{Duration, Instant};

use anyhow::Result;
use model_core::drive::DRIVE_PERIOD_MS;
use model_core::image::{Commands, Direction, Feedback, Image, Section};
use model_core::machine::Machine;

use super::controller::Controller;
use super::world::{put_own, stretches};
use crate::interrupt;
use crate::link::Link;

/// Between attempts to connect.
const RETRY: Duration = Duration::from_millis(500);

/// What is told of a wired PLC.
#[derive(Debug)]
pub enum Event<'a> {
    /// It is connected.
    Connected,
    /// It is not any more, and why.
    Lost(&'a anyhow::Error),
    /// It has run a cycle, on this image.
    Cycle(&'a Image),
}

/// Runs a controller at the simulator's address until it stops or Ctrl-C comes; `tell` hears what happens. The first
/// connection must succeed.
pub fn run(
    address: SocketAddr,
    mut plc: impl Controller,
    mut tell: impl FnMut(Event<'_>),
) -> Result<String> {
    let period = Duration::from_millis(plc.period() * u64::from(DRIVE_PERIOD_MS));
    let theirs =
        stretches(|s| s.direction == Direction::Command && s.section != Section::Simulator);
    let mut image = Image {
        commands: Commands::of(&Machine::news_8000()),
        feedback: Feedback::default(),
    };
    let mut link = Some(Link::connect(address)?);
    tell(Event::Connected);
    let (mut next, mut tried) = (Instant::now(), Instant::now());
    loop {
        interrupt::check()?;
        if link.is_none() && tried.elapsed() > RETRY {
            tried = Instant::now();
            link = Link::connect(address).ok();
            if link.is_some() {
                tell(Event::Connected);
            }
        }
        let mut commands = image.commands;
        let done = match &mut link {
            Some(link) => exchange(link, &mut image, &mut plc, &mut commands, &theirs),
            None => {
                plc.cycle(&image, &mut commands);
                Ok(())
            }
        };
        image.commands = commands;
        match done {
            Ok(()) => tell(Event::Cycle(&image)),
            Err(error) => {
                tell(Event::Lost(&error));
                link = None;
            }
        }
        if let Some(why) = plc.stopped() {
            return Ok(why);
        }
        next = (next + period).max(Instant::now());
        thread::sleep(next.saturating_duration_since(Instant::now()));
    }
}

/// One cycle over the link.
fn exchange(
    link: &mut Link,
    image: &mut Image,
    plc: &mut impl Controller,
    commands: &mut Commands,
    theirs: &[(usize, usize)],
) -> Result<()> {
    image.feedback = link.read()?;
    // the desk's words, which others write
    put_own(&link.read_commands()?, commands);
    image.commands = *commands;
    plc.cycle(image, commands);
    for &(from, words) in theirs {
        link.write_at(from, &commands.words[from..from + words])?;
    }
    Ok(())
}
