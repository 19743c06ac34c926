//! Lessons: an operator at the desk of the reference PLC, with a goal, hints, and a score.
//!
//! Not here: the winder, the PLC, a picture. A lesson is played on the simulator's clock; whoever shows it (the command
//! line, or a page) gives presses and set-points of the desk and reads the image.
//!
//! A lesson is a TOML file:
//!
//! ```toml
//! title = "Reaction to a web break"
//! goal = "Bring the winder back to a tight web"
//! hints = ["The alarm stays until you acknowledge it at standstill"]
//! set = { operator_v_set = 300 }            # desk and faults as they are found
//! time = 300                                # s
//! solution = ["press drives_on", "until winder_status.drives_on"]
//!
//! [[event]]                                 # what happens, once, so long after a condition has come true
//! when = "winder_status.at_speed"
//! after = 5
//! set = { fault_web_break = 2 }
//!
//! [[score]]
//! points = 40
//! what = "The web is tight again"
//! at_end = "winder_status.tension_detected"  # or `once`, or `never`
//! ```
//!
//! Conditions and names are those of scenarios ([`crate::scenario`]). A line of a solution is `press BUTTON`, `hold BUTTON`,
//! `release BUTTON`, `set NAME VALUE`, `wait SECONDS` or `until CONDITION`, and so is what an operator types.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use model_core::desk::REQUEST_BITS;
use model_core::image::{self, Commands, Image, Section};
use model_core::machine::Machine;
use serde::Deserialize;

use crate::accept::controller::{Controller, REFERENCE, StPlc};
use crate::accept::world::{LOOK, Lockstep, World};
use crate::scenario::place::{Condition, Place};
use crate::scenario::{CYCLES_PER_S, seconds};

/// A push-button is pressed for so long, s.
const PRESS_S: f64 = 0.3;
/// A solution waits at most so long for a condition, s.
const PATIENCE_S: f64 = 120.0;

/// A value in a file: a number in the signal's unit, or a switch.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(untagged)]
enum Number {
    Switch(bool),
    Number(f64),
}

type Settings = std::collections::BTreeMap<String, Number>;

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    title: String,
    goal: String,
    hints: Vec<String>,
    #[serde(default)]
    set: Settings,
    time: f64,
    solution: Vec<String>,
    #[serde(default)]
    event: Vec<EventFile>,
    score: Vec<ScoreFile>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct EventFile {
    when: String,
    #[serde(default)]
    after: f64,
    set: Settings,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ScoreFile {
    points: u32,
    what: String,
    once: Option<String>,
    never: Option<String>,
    at_end: Option<String>,
}

/// A value of the simulator's own words.
#[derive(Clone, Copy, Debug)]
struct Setting {
    place: Place,
    counts: i64,
}

/// When a score is earned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum When {
    Once,
    Never,
    AtEnd,
}

/// A part of the score.
#[derive(Clone, Debug)]
pub struct Score {
    /// Points.
    pub points: u32,
    /// For what.
    pub what: String,
    when: When,
    condition: Condition,
}

#[derive(Clone, Debug)]
struct Event {
    when: Condition,
    after: u64,
    set: Vec<Setting>,
}

/// What an operator does.
#[derive(Clone, Debug)]
pub enum Act {
    /// Presses a push-button.
    Press(u16),
    /// Holds one down.
    Hold(u16),
    /// Lets one go.
    Release(u16),
    /// Sets a value of the desk.
    Set(SettingOfDesk),
    /// Waits, s.
    Wait(f64),
    /// Waits for a condition.
    Until(Condition),
}

/// A value of the desk.
#[derive(Clone, Copy, Debug)]
pub struct SettingOfDesk(Setting);

/// A lesson.
#[derive(Clone, Debug)]
pub struct Lesson {
    /// The file's name without its ending.
    pub name: String,
    /// What it is about.
    pub title: String,
    /// What to reach.
    pub goal: String,
    /// Help, the least telling first.
    pub hints: Vec<String>,
    /// Time that there is, s.
    pub time_s: f64,
    /// What is scored.
    pub scores: Vec<Score>,
    /// What reaches the goal.
    pub solution: Vec<Act>,
    set: Vec<Setting>,
    events: Vec<Event>,
}

fn settings(of: &Settings) -> Result<Vec<Setting>> {
    of.iter()
        .map(|(name, value)| setting(name, *value))
        .collect()
}

fn setting(name: &str, value: Number) -> Result<Setting> {
    let place = Place::find_one(name)?;
    ensure!(
        place.signal.section == Section::Simulator
            && place.signal.direction == image::Direction::Command,
        "{name} is neither the desk's nor a fault"
    );
    let counts = match value {
        Number::Switch(on) => i64::from(on),
        Number::Number(number) => {
            let (low, high) = place.signal.limits;
            let fits = place.bit.is_some() || (f64::from(low)..=f64::from(high)).contains(&number);
            ensure!(
                fits,
                "{name} = {number} is outside {low} to {high} {}",
                place.signal.unit
            );
            (number * place.scale()).round() as i64
        }
    };
    Ok(Setting { place, counts })
}

impl Act {
    /// Reads a line; the error names what is wrong.
    pub fn read(line: &str) -> Result<Self> {
        let (verb, rest) = line.trim().split_once(' ').unwrap_or((line.trim(), ""));
        let rest = rest.trim();
        let button = || {
            let found = REQUEST_BITS.iter().find(|bit| bit.name == rest);
            found.map(|bit| 1 << bit.number).with_context(|| {
                let names: Vec<_> = REQUEST_BITS.iter().map(|bit| bit.name).collect();
                format!("`{rest}` is no push-button: {}", names.join(", "))
            })
        };
        Ok(match verb {
            "press" => Self::Press(button()?),
            "hold" => Self::Hold(button()?),
            "release" => Self::Release(button()?),
            "wait" => {
                let s: f64 = rest
                    .parse()
                    .with_context(|| format!("`{rest}` is no time, s"))?;
                ensure!(
                    (0.0..=3600.0).contains(&s),
                    "wait {s} is outside 0 to 3600 s"
                );
                Self::Wait(s)
            }
            "until" => Self::Until(Condition::read(rest)?),
            "set" => {
                let (name, value) = rest
                    .split_once(' ')
                    .context("set takes a name and a value")?;
                let value: f64 = value
                    .trim()
                    .parse()
                    .with_context(|| format!("`{value}` is no number"))?;
                ensure!(
                    name.starts_with("operator_") && !name.contains('.'),
                    "{name} is no set-point of the desk: they begin with operator_"
                );
                Self::Set(SettingOfDesk(setting(name, Number::Number(value))?))
            }
            _ => bail!("`{verb}` is not known: press, hold, release, set, wait or until"),
        })
    }
}

impl Lesson {
    /// Reads a file; the error names it.
    pub fn open(path: &Path) -> Result<Self> {
        let wrong = || format!("{}", path.display());
        let text = std::fs::read_to_string(path).with_context(wrong)?;
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        Self::read(&name, &text).with_context(wrong)
    }

    /// Reads a lesson's text.
    pub fn read(name: &str, text: &str) -> Result<Self> {
        let file: File = toml::from_str(text)?;
        let score = |s: &ScoreFile| {
            let (when, text) = match (&s.once, &s.never, &s.at_end) {
                (Some(text), None, None) => (When::Once, text),
                (None, Some(text), None) => (When::Never, text),
                (None, None, Some(text)) => (When::AtEnd, text),
                _ => bail!("\"{}\" wants one of once, never and at_end", s.what),
            };
            Ok(Score {
                points: s.points,
                what: s.what.clone(),
                when,
                condition: Condition::read(text)?,
            })
        };
        let event = |e: &EventFile| {
            Ok(Event {
                when: Condition::read(&e.when)?,
                after: (e.after * CYCLES_PER_S as f64) as u64,
                set: settings(&e.set)?,
            })
        };
        let scores: Vec<Score> = file.score.iter().map(score).collect::<Result<_>>()?;
        let points: u32 = scores.iter().map(|s| s.points).sum();
        ensure!(
            points == 100,
            "the points of a lesson are 100 in all, not {points}"
        );
        ensure!(
            (1.0..=3600.0).contains(&file.time),
            "time = {} is outside 1 to 3600 s",
            file.time
        );
        Ok(Self {
            name: name.to_owned(),
            title: file.title,
            goal: file.goal,
            hints: file.hints,
            time_s: file.time,
            scores,
            solution: file
                .solution
                .iter()
                .map(|line| Act::read(line))
                .collect::<Result<_>>()?,
            set: settings(&file.set)?,
            events: file.event.iter().map(event).collect::<Result<_>>()?,
        })
    }
}

/// The lessons that ship, by name.
pub fn shipped() -> Result<Vec<Lesson>> {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("lessons");
    let mut files: Vec<PathBuf> = Vec::new();
    for entry in std::fs::read_dir(&directory)
        .with_context(|| format!("cannot read {}", directory.display()))?
    {
        files.push(entry?.path());
    }
    files.sort();
    files.iter().map(|file| Lesson::open(file)).collect()
}

/// A lesson that is being played.
pub struct Play<'a, C = StPlc> {
    lesson: &'a Lesson,
    world: Lockstep<C>,
    own: Commands,
    /// When each event's condition came true.
    since: Vec<Option<u64>>,
    happened: Vec<bool>,
    earned: Vec<bool>,
    now: u64,
    image: Option<Image>,
}

impl<'a> Play<'a> {
    /// At power-up, at the desk of the reference PLC.
    pub fn new(lesson: &'a Lesson) -> Result<Self> {
        Self::at_desk_of(StPlc::new(REFERENCE)?, lesson)
    }
}

impl<'a, C: Controller> Play<'a, C> {
    /// At power-up, at the desk of another PLC.
    pub fn at_desk_of(plc: C, lesson: &'a Lesson) -> Result<Self> {
        let machine = Machine::news_8000();
        let mut own = Commands::of(&machine);
        for s in &lesson.set {
            s.place.set(&mut own, s.counts);
        }
        let world = Lockstep::new(&machine, plc);
        Ok(Self {
            lesson,
            world: world.context("the machine cannot be simulated")?,
            own,
            since: vec![None; lesson.events.len()],
            happened: vec![false; lesson.events.len()],
            earned: lesson
                .scores
                .iter()
                .map(|s| s.when == When::Never)
                .collect(),
            now: 0,
            image: None,
        })
    }

    /// Time since power-up, s.
    pub fn t_s(&self) -> f64 {
        seconds(self.now)
    }

    /// The time is over.
    pub fn is_over(&self) -> bool {
        self.t_s() >= self.lesson.time_s
    }

    /// What is seen.
    pub fn image(&self) -> Option<&Image> {
        self.image.as_ref()
    }

    /// A little time goes on: two drive cycles.
    pub fn tick(&mut self) -> Result<()> {
        let look = self.world.look(&self.own)?;
        (self.now, self.image) = (look.cycle, Some(look.image));
        let holds = |condition: &Condition| condition.fails(&look.image).is_none();
        for (i, event) in self.lesson.events.iter().enumerate() {
            if self.since[i].is_none() && holds(&event.when) {
                self.since[i] = Some(self.now);
            }
            let due = self.since[i].is_some_and(|since| self.now >= since + event.after);
            if due && !self.happened[i] {
                self.happened[i] = true;
                for s in &event.set {
                    s.place.set(&mut self.own, s.counts);
                }
            }
        }
        for (i, score) in self.lesson.scores.iter().enumerate() {
            let holds = holds(&score.condition);
            match score.when {
                When::Once => self.earned[i] |= holds,
                When::Never => self.earned[i] &= !holds,
                When::AtEnd => self.earned[i] = holds,
            }
        }
        Ok(())
    }

    fn wait(&mut self, s: f64) -> Result<()> {
        let until = self.now + (s * CYCLES_PER_S as f64) as u64;
        while self.now < until && !self.is_over() {
            self.tick()?;
        }
        Ok(())
    }

    fn buttons(&mut self, change: impl Fn(u16) -> u16) {
        let word = self.own.word(&image::OPERATOR_REQUEST);
        self.own.set_word(&image::OPERATOR_REQUEST, change(word));
    }

    /// Does what an operator does, as long as it takes.
    pub fn act(&mut self, act: &Act) -> Result<()> {
        match act {
            Act::Press(button) => {
                self.buttons(|word| word | button);
                self.wait(PRESS_S)?;
                self.buttons(|word| word & !button);
                self.wait(PRESS_S)?;
            }
            Act::Hold(button) => self.buttons(|word| word | button),
            Act::Release(button) => self.buttons(|word| word & !button),
            Act::Set(SettingOfDesk(s)) => s.place.set(&mut self.own, s.counts),
            Act::Wait(s) => self.wait(*s)?,
            Act::Until(condition) => {
                let until = self.now + (PATIENCE_S * CYCLES_PER_S as f64) as u64;
                while self.now < until && !self.is_over() {
                    self.tick()?;
                    if self
                        .image
                        .as_ref()
                        .is_some_and(|image| condition.fails(image).is_none())
                    {
                        break;
                    }
                }
            }
        }
        Ok(())
    }

    /// The points so far, and for what.
    pub fn scores(&self) -> impl Iterator<Item = (&'a Score, bool)> {
        self.lesson.scores.iter().zip(self.earned.clone())
    }

    /// All points so far.
    pub fn points(&self) -> u32 {
        self.scores()
            .filter(|(_, earned)| *earned)
            .map(|(score, _)| score.points)
            .sum()
    }
}

/// Time from tick to tick, s.
pub const TICK_S: f64 = LOOK as f64 / CYCLES_PER_S as f64;
