//! The course of an acceptance run: what the operator does, what breaks, and all that is seen meanwhile.
//!
//! Not here: whether it is right. A course goes on whatever the PLC does; what it could not reach is said in its
//! episode, and the checks ([`super::checks`]) judge the trace afterwards.

use anyhow::Error;
use model_core::desk::{REQUEST_BITS, request};
use model_core::image::{self, Commands, Image, Kind, Signal};
use model_core::machine::Machine;

use super::course::EPISODES;
use super::world::{LOOK, Look, World};
use crate::scenario::place::Condition;
use crate::scenario::{CYCLES_PER_S, seconds};

/// A push-button is pressed for so long, s.
const PRESS_S: f64 = 0.3;
/// Without a heartbeat for this long the PLC is gone, s.
const DEAD_S: f64 = 10.0;

/// What was seen at a time, and which alarms have a reason.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Drive cycles since the course began.
    pub cycle: u64,
    /// Both blocks.
    pub image: Image,
    /// Alarms that a PLC may show.
    pub reasons: u16,
}

impl Sample {
    /// Time since the course began, s.
    pub fn t_s(&self) -> f64 {
        seconds(self.cycle)
    }

    /// The value of a signal in its unit.
    pub fn value(&self, signal: &Signal) -> f64 {
        use model_core::image::Direction::{Command, Feedback};
        let raw = match (signal.direction, signal.kind) {
            (Command, Kind::U32) => f64::from(self.image.commands.double(signal)),
            (Feedback, Kind::U32) => f64::from(self.image.feedback.double(signal)),
            (_, Kind::I16) => f64::from(self.word(signal) as i16),
            _ => f64::from(self.word(signal)),
        };
        raw / f64::from(signal.counts)
    }

    /// The word of a signal as it travels.
    pub fn word(&self, signal: &Signal) -> u16 {
        match signal.direction {
            image::Direction::Command => self.image.commands.word(signal),
            image::Direction::Feedback => self.image.feedback.word(signal),
        }
    }

    /// All of these bits stand.
    pub fn has(&self, signal: &Signal, bits: u16) -> bool {
        self.word(signal) & bits == bits
    }

    /// None of these bits stands.
    pub fn lacks(&self, signal: &Signal, bits: u16) -> bool {
        self.word(signal) & bits == 0
    }
}

/// A part of the course.
#[derive(Clone, Debug)]
pub struct Episode {
    /// Its name.
    pub name: &'static str,
    /// Its samples.
    pub from: usize,
    /// Behind its last sample.
    pub to: usize,
    /// Why it did not come to its end.
    pub stuck: Option<String>,
}

/// A course that has been run.
#[derive(Clone, Debug, Default)]
pub struct Course {
    /// All that was seen.
    pub samples: Vec<Sample>,
    /// The parts, in order; those that the course did not come to are missing.
    pub episodes: Vec<Episode>,
    /// Moments by name, with their sample.
    pub marks: Vec<(&'static str, usize)>,
    /// Why the course ended before its end.
    pub ended: Option<String>,
}

/// Why an episode does not go on.
#[derive(Debug)]
pub enum Stuck {
    /// Something did not come; the next episode may go.
    Waited(String),
    /// The course is over.
    Over(String),
}

impl From<Error> for Stuck {
    fn from(error: Error) -> Self {
        Self::Over(format!("{error:#}"))
    }
}

/// What an episode came to.
pub type Done = Result<(), Stuck>;

/// A course at work.
pub struct Run<'a> {
    world: &'a mut dyn World,
    own: Commands,
    reasons: u16,
    /// Those that an acknowledge does not take away.
    standing: u16,
    course: Course,
    beat: Option<(u16, u64)>,
}

/// Runs the whole course. What fails is in it; it always ends.
pub fn run(world: &mut dyn World) -> Course {
    let mut run = Run {
        world,
        own: Commands::of(&Machine::news_8000()),
        reasons: 0,
        standing: 0,
        course: Course::default(),
        beat: None,
    };
    for (i, (name, episode)) in EPISODES.iter().enumerate() {
        let share = i as f64 / EPISODES.len() as f64;
        run.world.begins(name, share);
        let from = run.course.samples.len();
        let done = episode(&mut run);
        let (stuck, over) = match done {
            Ok(()) => (None, None),
            Err(Stuck::Waited(why)) => (Some(why), None),
            Err(Stuck::Over(why)) => (Some(why.clone()), Some(why)),
        };
        let to = run.course.samples.len();
        run.course.episodes.push(Episode {
            name,
            from,
            to,
            stuck,
        });
        if over.is_some() {
            run.course.ended = over;
            break;
        }
    }
    run.leave();
    run.course
}

impl Run<'_> {
    /// What was seen last.
    pub fn now(&self) -> Option<&Sample> {
        self.course.samples.last()
    }

    /// Lets a little time go on.
    pub fn tick(&mut self) -> Done {
        let Look { cycle, image } = self.world.look(&self.own)?;
        self.course.samples.push(Sample {
            cycle,
            image,
            reasons: self.reasons,
        });
        let beat = image.commands.word(&image::HEARTBEAT_PLC);
        match self.beat {
            Some((last, since)) if last == beat => {
                if seconds(cycle.saturating_sub(since)) > DEAD_S {
                    let t = seconds(since);
                    let what = format!("the PLC's heartbeat has stood at {beat} since {t:.1} s");
                    return Err(Stuck::Over(what));
                }
            }
            _ => self.beat = Some((beat, cycle)),
        }
        let limit_s = self.world.limit_s();
        if seconds(cycle) > limit_s {
            return Err(Stuck::Over(format!("the course has taken {limit_s} s")));
        }
        Ok(())
    }

    /// Waits, s.
    pub fn wait(&mut self, s: f64) -> Done {
        let from = self.now().map_or(0, |sample| sample.cycle);
        let cycles = (s * CYCLES_PER_S as f64) as u64;
        loop {
            self.tick()?;
            if self.now().is_some_and(|now| now.cycle >= from + cycles) {
                return Ok(());
            }
        }
    }

    /// Waits, at most so long, s, until the drives' heartbeat has wrapped once since the course began.
    pub fn wrap(&mut self, within_s: f64) -> Done {
        let beat = |sample: &Sample| sample.word(&image::HEARTBEAT);
        let wraps = |pair: &[Sample]| beat(&pair[1]) < beat(&pair[0]);
        let mut left = (within_s * CYCLES_PER_S as f64) as u64 / LOOK;
        let mut wrapped = self.course.samples.windows(2).any(wraps);
        while !wrapped && left > 0 {
            self.tick()?;
            left -= 1;
            wrapped = self
                .course
                .samples
                .last_chunk::<2>()
                .is_some_and(|pair| wraps(pair));
        }
        Ok(())
    }

    /// Waits for a condition, at most so long, s.
    pub fn until(&mut self, text: &str, within_s: f64) -> Done {
        let condition = Condition::read(text)?;
        let from = self.now().map_or(0, |sample| sample.cycle);
        loop {
            self.tick()?;
            let Some(now) = self.now() else { continue };
            let Some(got) = condition.fails(&now.image) else {
                return Ok(());
            };
            if seconds(now.cycle - from) > within_s {
                let what = format!("waited {within_s} s for {text}: {got}");
                return Err(Stuck::Waited(what));
            }
        }
    }

    /// Presses a push-button of the desk.
    pub fn press(&mut self, button: u16) -> Done {
        self.world.prompt(&format!("press {}", name(button)))?;
        self.put(button, true)?;
        self.wait(PRESS_S)?;
        self.put(button, false)
    }

    /// Holds a push-button down.
    pub fn hold(&mut self, button: u16) -> Done {
        self.world.prompt(&format!("hold {} down", name(button)))?;
        self.put(button, true)
    }

    /// Lets a push-button go.
    pub fn release(&mut self, button: u16) -> Done {
        self.world.prompt(&format!("let {} go", name(button)))?;
        self.put(button, false)
    }

    fn put(&mut self, button: u16, down: bool) -> Done {
        let word = self.own.word(&image::OPERATOR_REQUEST) & !button;
        let button = if down { button } else { 0 };
        self.own.set_word(&image::OPERATOR_REQUEST, word | button);
        self.tick()
    }

    /// Sets a value of the desk, in its unit.
    pub fn ask(&mut self, signal: &Signal, value: f64) -> Done {
        let (name, unit) = (signal.name, signal.unit);
        self.world
            .prompt(&format!("set {name} to {value} {unit}"))?;
        self.own.set(signal, value);
        Ok(())
    }

    /// Puts in a fault, by its word, and with the alarms for which it is a reason.
    pub fn inject(&mut self, signal: &Signal, word: u16, reasons: u16) {
        self.own.set_word(signal, word);
        self.reasons |= reasons;
    }

    /// Alarms may have these reasons from now on.
    pub fn excuse(&mut self, reasons: u16) {
        self.reasons |= reasons;
    }

    /// Alarms have these reasons until others are said to stand, whatever is acknowledged.
    pub fn stand(&mut self, reasons: u16) {
        self.standing = reasons;
        self.reasons |= reasons;
    }

    /// Remembers a moment.
    pub fn mark(&mut self, name: &'static str) {
        self.course.marks.push((name, self.course.samples.len()));
    }

    /// What stands in a word of the simulator's own.
    pub fn own(&self, signal: &Signal) -> u16 {
        self.own.word(signal)
    }

    /// Takes everything back that was put in, and the desk.
    fn leave(&mut self) {
        self.own = Commands::of(&Machine::news_8000());
        // what cannot be reached any more has told so already
        let _ = self.tick();
    }

    /// A sound machine again.
    pub fn sound(&mut self) {
        for word in image::FAULT_MACHINE.word..image::BUS_DELAY.word {
            self.own.words[usize::from(word)] = 0;
        }
    }

    /// Comes to standstill without faults, drives off, from wherever the last episode has ended.
    pub fn recover(&mut self) -> Done {
        self.sound();
        self.own.set_word(&image::OPERATOR_REQUEST, 0);
        self.tick()?;
        self.press(request::STOP)?;
        self.until("winder_status.zero_speed", 40.0)?;
        self.wait(0.5)?;
        self.press(request::ACKNOWLEDGE)?;
        self.until("fault = 0", 3.0)?;
        // the PLC sees that it has gone, and its alarms go
        self.wait(0.5)?;
        self.reasons = self.standing;
        self.press(request::DRIVES_OFF)?;
        self.until("mode = 0", 5.0)?;
        self.wait(0.2)
    }

    /// From drives off to a tight web at thread speed. The web is led anew: what a fault has left slack would take
    /// a minute to be taken up.
    pub fn tighten(&mut self) -> Done {
        self.press(request::WEB_REMOVED)?;
        self.until("not winder_status.web_threaded", 3.0)?;
        self.press(request::DRIVES_ON)?;
        self.until("winder_status.drives_on", 5.0)?;
        self.press(request::WEB_LED)?;
        self.until("winder_status.web_threaded", 3.0)?;
        self.wait(0.3)?;
        self.press(request::THREAD)?;
        self.until("winder_status.tension_detected", 30.0)?;
        // the last slack bounces
        self.wait(3.0)?;
        self.until("winder_status.tension_detected", 30.0)?;
        self.wait(1.0)
    }

    /// From a tight web to a speed, m/min.
    pub fn speed_up(&mut self, v_m_min: f64) -> Done {
        self.ask(&image::OPERATOR_V_SET, v_m_min)?;
        self.press(request::RUN)?;
        self.until("winder_status.at_speed and mode = run", 60.0)
    }
}

/// A push-button's name.
fn name(button: u16) -> &'static str {
    let is = |bit: &&image::Bit| button >> bit.number & 1 == 1;
    REQUEST_BITS.iter().find(is).map_or("", |bit| bit.name)
}
