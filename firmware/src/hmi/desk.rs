//! What the HMI has beside the process image, and where it meets the simulator.
//!
//! Not here: anything that takes time. The simulator comes by in every drive cycle, with the image locked: [`AtDesk`]
//! then commands what the panel or a replay wants, writes down what has happened, and hands on what somebody has
//! ordered. Whoever needs several locks takes the image's first, then control's, then the desk's.

use core::cell::RefCell;
use core::fmt;
use core::sync::atomic::{AtomicU16, Ordering};

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_sync::signal::Signal as Wake;
use embassy_sync::watch::{Receiver, Watch};
use embassy_time::Instant;
use model_core::image::{self, Commands, Feedback, Image, Signal};
use model_core::logic::{Mode, command, status};
use model_core::machine::Machine;

use super::Hmi;
use super::acceptance::Acceptance;
use super::answer::{Detail, Refusal};
use super::auth::Auth;
use super::events::Events;
use super::gains::Known;
use super::panel::{self, Panel};
use super::recorder::{Beginning, Recorder, Replayed};
use super::setup::Setup;
use super::timed::Timed;
use crate::attendant::{Attendant, Done, Order};
use crate::link::ControlCell;
use crate::link::control::{Control, Controller};
use crate::store::Keeper;

/// Streams of signals at once; each has a connection of its own.
pub const STREAMS: usize = 12;

/// What a board tells about itself.
#[derive(Clone, Copy, Debug)]
pub struct Board {
    /// What it is, for people.
    pub name: &'static str,
    /// The firmware's version.
    pub version: &'static str,
    /// Why it has started.
    pub reset: &'static str,
    /// Connections of browsers that there is room for.
    pub connections: u16,
    /// What it knows of its memory.
    pub memory: fn() -> Option<Memory>,
}

/// Memory of a board, in bytes.
#[derive(Clone, Copy, Debug)]
pub struct Memory {
    /// Variables.
    pub statics: u32,
    /// Kept for the stack.
    pub stack: u32,
    /// Of it, what has ever been used, as far as it can be seen.
    pub stack_used: u32,
}

/// What is written down at the desk. It is too large for a stack: a board keeps it where it has room.
pub struct Books {
    events: Events,
    recorder: Recorder,
}

impl Books {
    /// Empty.
    pub const fn new() -> Self {
        let commands = Commands {
            words: [0; image::COMMAND_WORDS],
        };
        Self {
            events: Events::new(),
            recorder: Recorder::new(commands),
        }
    }
}

impl Default for Books {
    fn default() -> Self {
        Self::new()
    }
}

/// The desk.
pub struct Desk<M: RawMutex> {
    /// The board.
    pub board: Board,
    cycles: Watch<M, u32, STREAMS>,
    /// The settings shall be brought to the flash.
    pub(super) settle: Wake<M, ()>,
    connected: AtomicU16,
    papers: Mutex<M, RefCell<Papers>>,
}

/// A connection of a browser, while there is one.
pub(super) struct Connected<'a>(&'a AtomicU16);

impl Drop for Connected<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

/// What lies on it.
pub(super) struct Papers {
    /// The last drive cycle.
    pub cycle: u32,
    pub auth: Auth,
    pub setup: Setup,
    pub keeper: Keeper,
    pub events: &'static mut Events,
    pub recorder: &'static mut Recorder,
    pub panel: Panel,
    pub timed: Timed,
    pub gains: Known,
    pub acceptance: Acceptance,
    pub snapshot: Option<Snapshot>,
    pub forget_times: bool,
    /// The panel gives the winder back once the drives are off.
    leaving: bool,
    order: Option<(Order, Then)>,
    under_way: Option<Then>,
}

/// What is known of the state that is kept.
pub(super) struct Snapshot {
    /// Its first drive cycle.
    pub cycle: u32,
    machine: Machine,
    panel: Panel,
    timed: Timed,
    gains: Known,
}

/// What is to be done once an order is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Then {
    Keep,
    Restore,
    Replay,
    Rebuild,
}

impl<M: RawMutex> Desk<M> {
    /// The desk of a board at power-up, with the settings that it keeps.
    pub fn new(board: Board, keeper: Keeper, books: &'static mut Books) -> Self {
        let machine = &keeper.settings().machine;
        let setup = Setup::new(machine);
        let gains = Known::new(machine);
        let Books { events, recorder } = books;
        if let Some(why) = keeper.unusable() {
            events.add(0, "settings", format_args!("defaults: {why}"));
        }
        recorder.begin(0, Beginning::PowerUp, Commands::of(machine));
        Self {
            board,
            cycles: Watch::new(),
            settle: Wake::new(),
            connected: AtomicU16::new(0),
            papers: Mutex::new(RefCell::new(Papers {
                cycle: 0,
                auth: Auth::new(),
                setup,
                events,
                recorder,
                panel: Panel::new(machine),
                timed: Timed::default(),
                gains,
                acceptance: Acceptance::default(),
                keeper,
                snapshot: None,
                forget_times: false,
                leaving: false,
                order: None,
                under_way: None,
            })),
        }
    }

    /// Tells of every drive cycle; none when as many as there can be are told already.
    pub fn cycles(&self) -> Option<Receiver<'_, M, u32, STREAMS>> {
        self.cycles.receiver()
    }

    /// One more connection, until it is dropped.
    pub(super) fn connect(&self) -> Connected<'_> {
        self.connected.fetch_add(1, Ordering::Relaxed);
        Connected(&self.connected)
    }

    /// How many connections there are.
    pub(super) fn connected(&self) -> u16 {
        self.connected.load(Ordering::Relaxed)
    }

    pub(super) fn with<R>(&self, f: impl FnOnce(&mut Papers) -> R) -> R {
        self.papers.lock(|papers| f(&mut papers.borrow_mut()))
    }
}

impl Papers {
    /// Somebody did something to the simulator.
    pub fn audit(&mut self, text: fmt::Arguments) {
        self.events.add(self.cycle, "audit", text);
    }

    fn end_faults(&mut self, cycle: u32, commands: &mut Commands) {
        let Self { timed, events, .. } = self;
        timed.before(cycle, commands, |fault| {
            let (word, bit) = fault.name();
            let (dot, bit) = bit.map_or(("", ""), |bit| (".", bit));
            events.add(cycle, "audit", format_args!("{word}{dot}{bit} is over"));
        });
    }

    fn order(&mut self, order: Order, then: Then) -> Result<(), Refusal> {
        if self.order.is_some() || self.under_way.is_some() {
            return Err(Refusal::new(
                409,
                format_args!("the one before is not done yet"),
            ));
        }
        self.order = Some((order, then));
        Ok(())
    }
}

/// Who sits at the desk and comes to the simulator in every drive cycle.
pub struct AtDesk<'a, M: RawMutex> {
    /// Who controls the winder.
    pub control: &'a ControlCell<M>,
    /// The desk.
    pub desk: &'a Desk<M>,
}

impl<M: RawMutex> Attendant for AtDesk<'_, M> {
    fn before(&mut self, cycle: u32, image: &mut Image) {
        let controller = |control: &RefCell<Control>| control.borrow().controller(Instant::now());
        let by_panel = self.control.lock(controller) == Controller::Panel;
        let leaves = self.desk.with(|papers| {
            if papers.recorder.is_playing() {
                papers.recorder.before(cycle, &mut image.commands);
            } else if by_panel {
                papers.panel.cycle(&image.feedback, &mut image.commands);
            }
            // A replay has every end of a fault among its commands.
            if !papers.recorder.is_playing() {
                papers.end_faults(cycle, &mut image.commands);
            }
            if papers.forget_times {
                set_bits(image, command::RESET_TIMES, true);
            }
            let off = papers.panel.state(&image.feedback) == panel::State::Off;
            papers.leaving && (off || !by_panel) && core::mem::take(&mut papers.leaving)
        });
        if leaves {
            let release = |control: &RefCell<Control>| control.borrow_mut().release_by_panel();
            self.control.lock(release);
        }
    }

    fn after(&mut self, cycle: u32, image: &mut Image) {
        let now = Instant::now();
        self.control
            .lock(|control| control.borrow().report(now, &mut image.feedback));
        self.desk.with(|papers| {
            papers.cycle = cycle;
            // It has seen the rising edge, and a recording need not.
            if core::mem::take(&mut papers.forget_times) {
                set_bits(image, command::RESET_TIMES, false);
            }
            papers.events.look(cycle, image);
            papers.gains.look(image);
            let replayed = papers
                .recorder
                .after(cycle, image)
                .map(|replayed| match replayed {
                    Replayed::Same => "the replay is the recorded run to the bit",
                    Replayed::Other => "the replay is another run than the recorded one",
                });
            if let Some(text) = replayed {
                papers.events.add(cycle, "replay", format_args!("{text}"));
            }
        });
        self.desk.cycles.sender().send(cycle);
    }

    fn order(&mut self) -> Option<Order> {
        self.desk.with(|papers| {
            let (order, then) = papers.order.take()?;
            papers.under_way = Some(then);
            Some(order)
        })
    }

    fn done(&mut self, cycle: u32, _what: Done, image: &Image) {
        self.desk.with(|papers| {
            let commands = image.commands;
            match papers.under_way.take() {
                Some(Then::Keep) => {
                    papers.snapshot = Some(Snapshot {
                        cycle,
                        machine: papers.setup.in_use.clone(),
                        panel: papers.panel.clone(),
                        timed: papers.timed.clone(),
                        gains: papers.gains.clone(),
                    });
                    papers.recorder.begin(cycle, Beginning::Snapshot, commands);
                }
                Some(then @ (Then::Restore | Then::Replay)) => {
                    let Some(snapshot) = &papers.snapshot else {
                        return;
                    };
                    if papers.setup.in_use != snapshot.machine {
                        papers.setup.is_in_use(snapshot.machine.clone());
                        papers.keeper.runs(&snapshot.machine);
                        self.desk.settle.signal(());
                    }
                    papers.panel = snapshot.panel.clone();
                    papers.gains = snapshot.gains.clone();
                    papers.timed = snapshot.timed.clone();
                    papers.timed.shift(cycle.wrapping_sub(snapshot.cycle));
                    match then {
                        Then::Replay => {
                            papers.timed = Timed::default();
                            papers.recorder.play(cycle);
                        }
                        _ => papers.recorder.begin(cycle, Beginning::Snapshot, commands),
                    }
                }
                Some(Then::Rebuild) => {
                    papers.panel = Panel::new(&papers.setup.in_use);
                    papers.gains = Known::new(&papers.setup.in_use);
                    papers.recorder.begin(cycle, Beginning::PowerUp, commands);
                }
                None => {}
            }
        });
    }
}

fn set_bits(image: &mut Image, bits: u16, on: bool) {
    let word = image.commands.word(&image::WINDER_COMMAND);
    let word = if on { word | bits } else { word & !bits };
    image.commands.set_word(&image::WINDER_COMMAND, word);
}

/// Why the machine cannot be changed now.
pub fn locked(feedback: &Feedback) -> Option<&'static str> {
    let stands = feedback.word(&image::WINDER_STATUS) & status::ZERO_SPEED != 0;
    let mode = usize::from(feedback.word(&image::MODE));
    match Mode::ALL.get(mode) {
        Some(Mode::Off | Mode::Ready | Mode::Stall) if stands => None,
        _ => Some("the machine is not at standstill"),
    }
}

/// A command of a request: a signal, or bits of it, and its counts.
#[derive(Clone, Copy, Debug)]
pub struct Setting {
    /// The signal.
    pub signal: &'static Signal,
    /// The bits that are set, all of them where it is a value.
    pub mask: u16,
    /// What they are set to.
    pub word: u16,
}

impl<M: RawMutex> Hmi<'_, M> {
    /// The image, and the drive cycle that made it.
    pub fn moment(&self) -> (u32, Image) {
        self.service.image.lock(|image| {
            let cycle = self.desk.with(|papers| papers.cycle);
            (cycle, *image.borrow())
        })
    }

    /// One event on image, control and desk.
    pub(super) fn visit<R>(&self, f: impl FnOnce(&mut Image, &mut Control, &mut Papers) -> R) -> R {
        self.service.image.lock(|image| {
            self.service.control.lock(|control| {
                self.desk
                    .with(|papers| f(&mut image.borrow_mut(), &mut control.borrow_mut(), papers))
            })
        })
    }

    /// Commands several things at once: all of them or none; faults for a time, if there is one.
    ///
    /// # Errors
    /// Some are the winder's, and the panel does not control it; the time cannot be.
    pub(super) fn command(&self, settings: &[Setting], for_s: Option<f64>) -> Result<(), Refusal> {
        let now = Instant::now();
        self.visit(|image, control, papers| {
            let words = |s: &Setting| usize::from(s.signal.word)..usize::from(s.signal.word) + 1;
            for setting in settings {
                if control.may_panel_write(&words(setting), now).is_err() {
                    let name = setting.signal.name;
                    let mut refusal = Refusal::new(
                        409,
                        format_args!("{name} is commanded by who controls the winder"),
                    );
                    refusal.add(Detail::new(name, "", "take control first"));
                    return Err(refusal);
                }
            }
            let cycles = match for_s {
                Some(for_s) => Some(papers.timed.cycles(for_s, settings)?),
                None => None,
            };
            let out = cycles.map(|cycles| papers.cycle.wrapping_add(1).wrapping_add(cycles));
            let sound = Commands::of(&papers.setup.in_use);
            for setting in settings {
                papers.timed.put(*setting, &sound, out);
                let Setting { signal, mask, word } = *setting;
                let old = image.commands.word(signal);
                image.commands.set_word(signal, old & !mask | word & mask);
                control.panel_wrote(words(setting), now);
                let new = image.commands.word(signal);
                papers.audit(format_args!("{} = {new} (was {old})", signal.name));
            }
            Ok(())
        })
    }

    /// The operator panel takes the winder, or gives it back.
    ///
    /// # Errors
    /// A PLC has it.
    pub(super) fn take(&self, wanted: bool) -> Result<(), Refusal> {
        let now = Instant::now();
        self.visit(|image, control, papers| {
            if wanted {
                let had_it = control.controller(now) == Controller::Panel;
                control
                    .take_by_panel(now)
                    .map_err(|_| Refusal::new(409, format_args!("a PLC controls the winder")))?;
                papers.leaving = false;
                if !had_it {
                    papers.panel = Panel::new(&papers.setup.in_use);
                }
                papers.audit(format_args!("the panel takes control"));
            } else if control.controller(now) == Controller::Panel {
                let off = papers.panel.act(panel::Action::SwitchOff, &image.feedback);
                off.map_err(|_| {
                    Refusal::new(409, format_args!("not while the web runs: stop it first"))
                })?;
                papers.leaving = true;
                papers.audit(format_args!("the panel gives control back"));
            }
            Ok(())
        })
    }

    /// The operator panel is asked for something.
    ///
    /// # Errors
    /// The panel does not control the winder, or it does not go now.
    pub(super) fn act(&self, action: panel::Action) -> Result<(), Refusal> {
        let now = Instant::now();
        self.visit(|image, control, papers| {
            if control.controller(now) != Controller::Panel {
                return Err(Refusal::new(
                    409,
                    format_args!("the panel does not control the winder"),
                ));
            }
            let wrong = match papers.panel.act(action, &image.feedback) {
                Ok(()) => {
                    papers.audit(format_args!("panel: {action}"));
                    return Ok(());
                }
                Err(wrong) => wrong,
            };
            Err(match wrong {
                panel::Wrong::NotNow(state) => {
                    Refusal::new(409, format_args!("not while the set is {}", state.name()))
                }
                panel::Wrong::Outside {
                    parameter,
                    value,
                    low,
                    high,
                    unit,
                } => {
                    let mut refusal = Refusal::new(
                        422,
                        format_args!("{parameter} = {value} {unit} is outside {low} to {high}"),
                    );
                    refusal.add(Detail {
                        limits: Some((f64::from(low), f64::from(high))),
                        unit,
                        ..Detail::number(parameter, f64::from(value), "outside its limits")
                    });
                    refusal
                }
            })
        })
    }

    /// What is staged goes into use, at standstill.
    ///
    /// # Errors
    /// Stale, nothing staged, or the web runs.
    pub(super) fn apply(&self, revision: u32) -> Result<(), Refusal> {
        self.visit(|image, _, papers| {
            if let Some(why) = locked(&image.feedback) {
                return Err(Refusal::new(409, format_args!("{why}")));
            }
            if papers.order.is_some() || papers.under_way.is_some() {
                return Err(Refusal::new(
                    409,
                    format_args!("the one before is not done yet"),
                ));
            }
            let machine = papers.setup.apply(revision)?;
            let revision = papers.setup.revision;
            papers.audit(format_args!("parameters applied, revision {revision}"));
            papers.keeper.runs(&machine);
            self.desk.settle.signal(());
            papers.order(Order::Rebuild(machine), Then::Rebuild)
        })
    }

    /// A snapshot of the state.
    ///
    /// # Errors
    /// Another order is under way.
    pub(super) fn keep(&self) -> Result<(), Refusal> {
        self.desk.with(|papers| {
            papers.order(Order::Keep, Then::Keep)?;
            papers.audit(format_args!("snapshot"));
            Ok(())
        })
    }

    /// Back to the snapshot; with a replay of what was commanded since.
    ///
    /// # Errors
    /// There is none, or it cannot be replayed.
    pub(super) fn restore(&self, replay: bool) -> Result<(), Refusal> {
        let now = Instant::now();
        self.visit(|_, control, papers| {
            if papers.snapshot.is_none() {
                return Err(Refusal::new(409, format_args!("there is no snapshot")));
            }
            if !replay {
                papers.order(Order::Restore, Then::Restore)?;
                papers.audit(format_args!("restore"));
                return Ok(());
            }
            if papers.recorder.beginning != Beginning::Snapshot || papers.recorder.end().after == 0
            {
                return Err(Refusal::new(
                    409,
                    format_args!("the recording does not begin with the snapshot"),
                ));
            }
            if matches!(control.controller(now), Controller::Plc(_)) {
                return Err(Refusal::new(409, format_args!("a PLC controls the winder")));
            }
            control.release_by_panel();
            papers.order(Order::Restore, Then::Replay)?;
            papers.audit(format_args!("replay"));
            Ok(())
        })
    }
}
