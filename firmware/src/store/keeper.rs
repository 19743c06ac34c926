//! What shall stand in the flash, and whether it does.
//!
//! Not here: writing, which takes a board's task some time: it takes a [`Job`] and tells what came of it. So nobody who
//! changes something waits for the flash.

use core::fmt;

use model_core::machine::Machine;

use super::{Budget, Content, Network, SaveError, Serial, Settings, Unusable};

/// Where the settings stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// In the flash.
    Stored,
    /// Nowhere, and nobody has changed anything: these are the defaults.
    Empty,
    /// Not yet in the flash: that is being written, or too much has been written lately.
    Waiting,
    /// The flash did not take them; there will be another try.
    Failed,
    /// Something else stands in the flash, and a person has to decide.
    Undecided,
    /// This board keeps nothing.
    Nowhere,
}

impl State {
    /// The name in lists.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Stored => "stored",
            Self::Empty => "empty",
            Self::Waiting => "waiting",
            Self::Failed => "failed",
            Self::Undecided => "undecided",
            Self::Nowhere => "nowhere",
        }
    }
}

/// What the flash is to do.
#[derive(Clone, Debug, PartialEq)]
#[expect(
    clippy::large_enum_variant,
    reason = "without a heap it has to be somewhere"
)]
pub enum Job {
    /// Take these.
    Save(Settings),
    /// Be empty.
    Empty,
}

/// What is wanted of the flash beyond settings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Order {
    /// Empty it, whatever stands there; then store what is wanted.
    Overwrite,
    /// Empty it.
    Reset,
}

/// Keeps the settings.
#[derive(Clone, Debug)]
pub struct Keeper {
    state: State,
    /// What was found in the flash at power-up, and still stands there.
    unusable: Option<Unusable>,
    /// What the board has started with.
    in_use: (Network, Serial),
    /// What shall stand in the flash.
    wanted: Settings,
    /// It does not yet.
    changed: bool,
    order: Option<Order>,
    budget: Budget,
    /// What of the settings this board cannot follow.
    pub note: Option<&'static str>,
}

impl Keeper {
    /// Of a board that keeps nothing.
    pub fn nowhere(machine: &Machine) -> Self {
        let settings = Settings {
            machine: machine.clone(),
            ..Settings::default()
        };
        Self::with(State::Nowhere, None, settings)
    }

    /// Of a board's flash, with what it holds at power-up.
    pub fn of(content: Content) -> Self {
        match content {
            Content::Blank => Self::with(State::Empty, None, Settings::default()),
            Content::Settings(settings) => Self::with(State::Stored, None, settings),
            Content::Unusable(why) => Self::with(State::Undecided, Some(why), Settings::default()),
        }
    }

    fn with(state: State, unusable: Option<Unusable>, settings: Settings) -> Self {
        Self {
            state,
            unusable,
            in_use: (settings.network, settings.serial),
            wanted: settings,
            changed: false,
            order: None,
            budget: Budget::default(),
            note: None,
        }
    }

    /// What shall stand in the flash; at power-up, what the board starts with.
    pub fn settings(&self) -> &Settings {
        &self.wanted
    }

    /// What the board has started with.
    pub fn in_use(&self) -> (Network, Serial) {
        self.in_use
    }

    /// Where the settings stand.
    pub fn state(&self) -> State {
        self.state
    }

    /// Why what stands in the flash is of no use.
    pub fn unusable(&self) -> Option<Unusable> {
        self.unusable
    }

    /// Writes that would not have to wait.
    pub fn writes_left(&self) -> u32 {
        self.budget.left()
    }

    /// The simulator runs this machine from now on.
    pub fn runs(&mut self, machine: &Machine) {
        if self.wanted.machine != *machine {
            self.wanted.machine = machine.clone();
            self.want();
        }
    }

    /// The next start shall have these.
    pub fn connect(&mut self, network: Network, serial: Serial) {
        if (self.wanted.network, self.wanted.serial) != (network, serial) {
            (self.wanted.network, self.wanted.serial) = (network, serial);
            self.want();
        }
    }

    fn want(&mut self) {
        self.changed = true;
        if !matches!(self.state, State::Nowhere | State::Undecided) {
            self.state = State::Waiting;
        }
    }

    /// A person decides: what is in use takes the place of what is of no use. False: nothing waits for that.
    pub fn overwrite(&mut self) -> bool {
        let undecided = self.state == State::Undecided;
        if undecided {
            (self.order, self.changed) = (Some(Order::Overwrite), true);
            self.state = State::Waiting;
        }
        undecided
    }

    /// A person wants the defaults at the next start, whatever stands in the flash. False: this board keeps nothing.
    pub fn reset(&mut self) -> bool {
        let keeps = self.state != State::Nowhere;
        if keeps {
            (self.order, self.changed) = (Some(Order::Reset), false);
            let defaults = Settings::default();
            (self.wanted.network, self.wanted.serial) = (defaults.network, defaults.serial);
            self.state = State::Waiting;
        }
        keeps
    }

    /// What the flash has to do now, at a time since power-up; nothing also when it has been written too often lately.
    pub fn next(&mut self, now_s: u32) -> Option<Job> {
        // A person's decision does not wait, and comes rarely.
        if self.order.is_some() {
            return Some(Job::Empty);
        }
        let waits = self.changed && matches!(self.state, State::Waiting | State::Failed);
        let job = waits && self.budget.take(now_s);
        if job {
            // Whatever is changed from now on needs another write.
            self.changed = false;
        }
        job.then(|| Job::Save(self.wanted.clone()))
    }

    /// What came of a job.
    pub fn done(&mut self, job: &Job, result: Result<(), SaveError>) {
        match (job, result) {
            (Job::Empty, Ok(())) => {
                (self.unusable, self.order) = (None, None);
                self.state = match self.changed {
                    true => State::Waiting,
                    false => State::Empty,
                };
            }
            (Job::Empty, Err(_)) => {
                self.order = None;
                self.state = match self.unusable {
                    Some(_) => State::Undecided,
                    None => State::Failed,
                };
            }
            (Job::Save(_), Ok(())) if !self.changed => self.state = State::Stored,
            (Job::Save(_), Ok(())) => self.state = State::Waiting,
            (Job::Save(_), Err(_)) => (self.changed, self.state) = (true, State::Failed),
        }
    }
}

impl fmt::Display for Unusable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Foreign => {
                f.write_str("what stands in the flash is damaged or another program's")
            }
            Self::Invalid(invalid) => write!(f, "the settings in the flash cannot be: {invalid}"),
            Self::Flash => f.write_str("the flash does not answer"),
        }
    }
}
