//! The player: feedback in, commands out, once a drive cycle or as often as a link allows.
//!
//! Not here: a clock, a link, a simulator. Time is what the caller says, in drive cycles.

use std::fmt;

use model_core::image::{self, Commands, Feedback, Image};

use super::place::Place;
use super::{Act, At, During, Ends, Expectation, Scenario, Step, seconds};

/// A pressed bit stands so long, drive cycles; and is back as long before the step ends.
pub const PRESS: u64 = 10;

/// How a player keeps time.
#[derive(Clone, Copy, Debug)]
pub struct Timing {
    /// Drive cycles until what is commanded has its effect in the feedback.
    pub answer: u64,
    /// A step may begin so many drive cycles late.
    pub lateness: u64,
}

impl Timing {
    /// In lockstep with the simulator: the command counts in the next cycle, and a drive's bus may hold the
    /// answer back for another.
    pub const LOCKSTEP: Self = Self {
        answer: 3,
        lateness: 0,
    };
    /// Over a network, at any pace.
    pub const LIVE: Self = Self {
        answer: 30,
        lateness: 100,
    };
}

/// Something expected that was not so.
#[derive(Clone, Debug)]
pub struct Failure {
    /// Where it was expected.
    pub at: At,
    /// When it was first not so, drive cycles since the scenario began …
    pub cycle: u64,
    /// … and since its step did.
    pub in_step: u64,
    /// What was wanted.
    pub wanted: String,
    /// What was there.
    pub got: String,
    /// For so many drive cycles in all.
    pub lasted: u64,
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (t, in_step) = (seconds(self.cycle), seconds(self.in_step));
        let (at, wanted, got) = (&self.at, &self.wanted, &self.got);
        write!(
            f,
            "{at}: at {t:.2} s ({in_step:.2} s into the step): wanted {wanted}, got {got}"
        )?;
        if self.lasted > 1 {
            write!(f, ", for {:.2} s in all", seconds(self.lasted))?;
        }
        Ok(())
    }
}

/// An expectation whose time has come.
#[derive(Clone, Debug)]
struct Watch<'a> {
    expectation: &'a Expectation,
    began: u64,
    from: u64,
    /// Open as long as its step lasts, or as the always that has this number.
    to: Until,
    seen: Option<u64>,
    failure: Option<Failure>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Until {
    Cycle(u64),
    EndOfStep,
    Release(usize),
}

impl Watch<'_> {
    /// Looks, if its time has come. A window that falls between two looks is seen at the second.
    fn look(&mut self, now: u64, image: &Image) {
        let over = matches!(self.to, Until::Cycle(to) if now > to) && self.seen.is_some();
        if now < self.from || over {
            return;
        }
        let before = self.seen.replace(now).unwrap_or(now.saturating_sub(1));
        let Some(got) = self.expectation.condition.fails(image) else {
            return;
        };
        let failure = self.failure.get_or_insert_with(|| Failure {
            at: self.expectation.at.clone(),
            cycle: now,
            in_step: now - self.began,
            wanted: self.expectation.condition.text.clone(),
            got,
            lasted: 0,
        });
        failure.lasted += now - before;
    }

    fn is_over(&self, now: u64) -> bool {
        matches!(self.to, Until::Cycle(to) if now >= to && self.seen.is_some())
    }
}

/// A scenario that is being played.
pub struct Player<'a> {
    scenario: &'a Scenario,
    timing: Timing,
    commands: Commands,
    /// The next act, or the step that lasts.
    act: usize,
    /// When the present step began.
    began: Option<u64>,
    /// When the clocks began.
    clocks: Vec<u64>,
    beats: bool,
    pressed: Vec<(u64, Place)>,
    watches: Vec<Watch<'a>>,
    failures: Vec<Failure>,
    now: u64,
    done: bool,
}

impl<'a> Player<'a> {
    /// Before the first step.
    pub fn new(scenario: &'a Scenario, timing: Timing) -> Self {
        let mut commands = Commands::of(&scenario.machine.machine);
        for assignment in &scenario.set {
            assignment.place.set(&mut commands, assignment.counts);
        }
        let clocks = scenario.acts.iter().map(|act| match act {
            Act::Begin(clock) => clock + 1,
            _ => 0,
        });
        Self {
            scenario,
            timing,
            commands,
            act: 0,
            began: None,
            clocks: vec![0; clocks.max().unwrap_or(0)],
            beats: true,
            pressed: Vec::new(),
            watches: Vec::new(),
            failures: Vec::new(),
            now: 0,
            done: false,
        }
    }

    /// What is commanded.
    pub fn commands(&self) -> &Commands {
        &self.commands
    }

    /// Nothing is left to do or to look at.
    pub fn is_done(&self) -> bool {
        self.done
    }

    /// The step that lasts.
    pub fn step(&self) -> Option<&'a Step> {
        match self.scenario.acts.get(self.act) {
            Some(Act::Step(step)) if self.began.is_some() => Some(step),
            _ => None,
        }
    }

    /// Drive cycles since the scenario began.
    pub fn now(&self) -> u64 {
        self.now
    }

    /// What was not as expected, so far.
    pub fn failures(&self) -> &[Failure] {
        &self.failures
    }

    /// The feedback after `now` drive cycles; afterwards [`Self::commands`] has what counts from then on.
    pub fn look(&mut self, now: u64, feedback: &Feedback) {
        if self.done {
            return;
        }
        self.now = now;
        let image = Image {
            commands: self.commands,
            feedback: *feedback,
        };
        for watch in &mut self.watches {
            watch.look(now, &image);
        }
        self.close(|watch| watch.is_over(now));
        self.release(now);
        while !self.done && self.go_on(now, &image) {}
        if self.beats {
            let beat = self.commands.word(&image::HEARTBEAT_PLC).wrapping_add(1);
            self.commands.set_word(&image::HEARTBEAT_PLC, beat);
        }
    }

    /// Takes what is over out of sight, and keeps its failure.
    fn close(&mut self, over: impl Fn(&Watch) -> bool) {
        let (closed, open) = self.watches.drain(..).partition(|watch| over(watch));
        self.watches = open;
        let closed: Vec<Watch> = closed;
        self.failures
            .extend(closed.into_iter().filter_map(|watch| watch.failure));
    }

    fn release(&mut self, now: u64) {
        let (due, held) = self.pressed.drain(..).partition(|(at, _)| *at <= now);
        self.pressed = held;
        let due: Vec<(u64, Place)> = due;
        for (_, place) in due {
            place.set(&mut self.commands, 0);
        }
    }

    /// Does the next thing, if its time has come.
    fn go_on(&mut self, now: u64, image: &Image) -> bool {
        match self.scenario.acts.get(self.act) {
            None => {
                let ends = |watch: &Watch| !matches!(watch.to, Until::Cycle(_));
                if self.watches.iter().all(ends) {
                    self.end();
                }
                return false;
            }
            Some(Act::Begin(clock)) => self.clocks[*clock] = now,
            Some(Act::Always(number, expectation)) => {
                let from = now + self.timing.answer;
                self.watch(expectation, now, from, Until::Release(*number));
            }
            Some(Act::Release(number)) => self.close(|watch| watch.to == Until::Release(*number)),
            Some(Act::Step(step)) => {
                return match self.began {
                    None => self.begin(step, now),
                    Some(began) => self.last(step, began, now, image),
                };
            }
        }
        self.act += 1;
        true
    }

    fn end(&mut self) {
        self.close(|_| true);
        self.failures.sort_by_key(|failure| failure.cycle);
        self.done = true;
    }

    fn fail(&mut self, step: &Step, now: u64, in_step: u64, wanted: String, got: String) {
        self.failures.push(Failure {
            at: step.at.clone(),
            cycle: now,
            in_step,
            wanted,
            got,
            lasted: 1,
        });
        self.end();
    }

    fn watch(&mut self, expectation: &'a Expectation, began: u64, from: u64, to: Until) {
        self.watches.push(Watch {
            expectation,
            began,
            from,
            to,
            seen: None,
            failure: None,
        });
    }

    /// Begins a step; false while it is not time to.
    fn begin(&mut self, step: &'a Step, now: u64) -> bool {
        if let Some(time) = step.begins {
            let due = self.clocks[time.clock] + time.cycles;
            if now < due {
                return false;
            }
            if now > due + self.timing.lateness {
                let wanted = format!("to begin this step at {} s", seconds(time.cycles));
                let late = seconds(now - due);
                let got = format!("the step before ending {late:.2} s later than that");
                self.fail(step, now, 0, wanted, got);
                return false;
            }
        }
        for assignment in &step.set {
            assignment.place.set(&mut self.commands, assignment.counts);
        }
        for place in &step.press {
            place.set(&mut self.commands, 1);
            self.pressed.push((now + PRESS, *place));
        }
        self.beats = step.heartbeat.unwrap_or(self.beats);
        let answer = now + self.timing.answer;
        for expectation in &step.expect {
            match expectation.during {
                During::Window(from, to) => {
                    self.watch(expectation, now, now + from, Until::Cycle(now + to));
                }
                During::Step => self.watch(expectation, now, answer, Until::EndOfStep),
                During::End => {}
            }
        }
        self.began = Some(now);
        false
    }

    /// Ends a step; false while it lasts.
    fn last(&mut self, step: &'a Step, began: u64, now: u64, image: &Image) -> bool {
        let in_step = now - began;
        match &step.ends {
            Ends::After(cycles) if in_step < *cycles => return false,
            // what is expected of a step is in the feedback only then
            _ if in_step < self.timing.answer && step.is_judged() => return false,
            Ends::After(_) => self.judge(step, began, now, image),
            Ends::When(condition, within) => match condition.fails(image) {
                None => self.judge(step, began, now, image),
                Some(got) if in_step >= *within => {
                    let wanted = format!("{} within {} s", condition.text, seconds(*within));
                    self.fail(step, now, in_step, wanted, got);
                    return false;
                }
                Some(_) => return false,
            },
        }
        self.close(|watch| watch.to == Until::EndOfStep);
        self.began = None;
        self.act += 1;
        true
    }

    /// Looks at what is expected at a step's end.
    fn judge(&mut self, step: &'a Step, began: u64, now: u64, image: &Image) {
        let at_end = |e: &&Expectation| e.during == During::End;
        for expectation in step.expect.iter().filter(at_end) {
            self.watch(expectation, began, now, Until::Cycle(now));
        }
        for watch in self.watches.iter_mut().filter(|watch| watch.from == now) {
            if watch.seen.is_none() {
                watch.look(now, image);
            }
        }
        self.close(|watch| watch.is_over(now));
    }
}
