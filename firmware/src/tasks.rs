//! The three tasks of the simulator: plant every 4 ms, regulators every 10 ms, logic in the background.
//!
//! Not here: executors, priorities, interrupts: those are the board's. It runs [`plant`] above [`drive`] above
//! [`logic`], each in an executor of its own, from one common start.
//!
//! What one task hands to another goes through a [`Mailbox`], and nothing here keeps an interrupt off. The logic gets
//! all it needs of a drive cycle in one piece and answers before the next; so it does not matter when in between it
//! gets its turn, and the same commands in the same cycles give the same bits as
//! [`model_core::simulator::Simulator`].

use core::future::poll_fn;
use core::marker::PhantomData;
use core::mem;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use core::task::Poll;

use atomic_refcell::AtomicRefCell;
use atomic_waker::AtomicWaker;
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Instant, Timer};
use model_core::drive::{DRIVE_PERIOD_MS, Drive};
use model_core::exchange::{Actuators, DriveCommand, DriveStatus, Measurements};
use model_core::image::{self, Feedback, Image};
use model_core::logic::{Logic, command};
use model_core::plant::PLANT_PERIOD_MS;
use model_core::real::Scalar;
use model_core::simulator::{Plant, Record, logic_tick};

use crate::SPANS;
use crate::attendant::{Attendant, Done, Order};
use crate::journal::{Journal, Observer};
use crate::life::{Life, Started, Task};
use crate::link::ImageCell;
use crate::mailbox::Mailbox;
use crate::state::State;
use crate::wired::{Inputs, Outputs};

/// What a board measures times with: cycles of the core, or a timer as fast as there is.
pub trait Stopwatch {
    /// Its counts in a microsecond.
    const PER_US: u32;

    /// Its count, which wraps.
    fn count() -> u32;
}

/// Where a task's part of the state changes hands, at the beginning of one of its activations.
///
/// Whoever gives and takes is below the task and does it in another of its activations, so that neither meets the other
/// half-way.
struct Hatch<T> {
    /// The task has something to do here.
    open: AtomicBool,
    handing: AtomicRefCell<Handing<T>>,
}

/// What is to be done in which activation, or has been done.
enum Handing<T> {
    Nothing,
    Take { at: u32 },
    Taken { at: u32, part: T },
    Put { at: u32, part: T },
}

impl<T> Default for Hatch<T> {
    fn default() -> Self {
        Self {
            open: AtomicBool::new(false),
            handing: AtomicRefCell::new(Handing::Nothing),
        }
    }
}

impl<T> Hatch<T> {
    fn set(&self, handing: Handing<T>) {
        if let Ok(mut place) = self.handing.try_borrow_mut() {
            *place = handing;
            self.open.store(true, Ordering::Release);
        }
    }

    /// What the task has left, in exactly this activation.
    fn taken(&self, at: u32) -> Option<T> {
        let mut place = self.handing.try_borrow_mut().ok()?;
        match mem::replace(&mut *place, Handing::Nothing) {
            Handing::Taken { at: then, part } if then == at => Some(part),
            _ => None,
        }
    }
}

impl<P: Clone, O: Copy> Hatch<(P, O)> {
    /// The task comes by, in this activation: leaves its part with what goes with it, or goes on with others.
    fn pass(&self, activation: u32, own: &mut P, with: &Mailbox<O>) {
        if self.open.load(Ordering::Acquire) {
            self.hand(activation, own, with);
        }
    }

    /// Apart from the task, whose stack would have room for all of it at all times.
    #[cold]
    #[inline(never)]
    fn hand(&self, activation: u32, own: &mut P, with: &Mailbox<O>) {
        let Ok(mut place) = self.handing.try_borrow_mut() else {
            return;
        };
        let due = |at: u32| activation.wrapping_sub(at).cast_signed() >= 0;
        match *place {
            Handing::Take { at } if due(at) => {
                *place = Handing::Taken {
                    at: activation,
                    part: (own.clone(), with.get()),
                };
            }
            Handing::Put {
                at,
                part: (ref other, value),
            } if due(at) => {
                own.clone_from(other);
                with.set(value);
                *place = Handing::Nothing;
            }
            _ => return,
        }
        self.open.store(false, Ordering::Relaxed);
    }
}

/// All that a drive cycle gives the logic.
#[derive(Clone, Copy)]
struct Cycle<R> {
    number: u32,
    /// When it was due.
    due: Instant,
    measurements: Measurements<R>,
    status: DriveStatus<R>,
    record: Record,
}

/// What the tasks hand to each other.
pub struct Exchange<R: Scalar> {
    actuators: Mailbox<Actuators<R::Si>>,
    measurements: Mailbox<(Measurements<R::Si>, Record)>,
    command: Mailbox<DriveCommand<R::Si>>,
    cycle: Mailbox<Cycle<R::Si>>,
    plant_hatch: Hatch<(Plant<R, SPANS>, Actuators<R::Si>)>,
    #[allow(clippy::type_complexity, reason = "a pair, like the one above")]
    drive_hatch: Hatch<(Drive<R::Si>, DriveCommand<R::Si>)>,
    /// Drive cycles so far; wraps.
    cycles: AtomicU32,
    next_cycle: AtomicWaker,
    inputs: Mailbox<Inputs>,
    outputs: Mailbox<Outputs>,
    plant_times: Times,
    drive_times: Times,
    logic_times: Times,
    life: &'static Life,
    started: Started,
}

impl<R: Scalar> Exchange<R> {
    /// Between tasks that show `life`, of a firmware that has `started`.
    pub fn new(life: &'static Life, started: Started) -> Self {
        Self {
            actuators: Mailbox::new(Actuators::default()),
            measurements: Mailbox::new((Measurements::default(), Record::default())),
            command: Mailbox::new(DriveCommand::default()),
            cycle: Mailbox::new(Cycle {
                number: 0,
                due: Instant::MIN,
                measurements: Measurements::default(),
                status: DriveStatus::default(),
                record: Record::default(),
            }),
            plant_hatch: Hatch::default(),
            drive_hatch: Hatch::default(),
            cycles: AtomicU32::new(0),
            next_cycle: AtomicWaker::new(),
            inputs: Mailbox::new(Inputs::default()),
            outputs: Mailbox::new(Outputs::default()),
            plant_times: Times::default(),
            drive_times: Times::default(),
            logic_times: Times::default(),
            life,
            started,
        }
    }
}

/// The times of a task: the last activation, and the worst since they were last forgotten.
///
/// The task writes them, and whoever forgets them is below it, so that nothing is counted half.
#[derive(Debug, Default)]
struct Times {
    /// Activations not done before the next was due.
    overruns: AtomicU32,
    /// Last activation, in counts of the stopwatch, with what interrupted it.
    last: AtomicU32,
    /// Longest activation, likewise.
    longest: AtomicU32,
    /// Latest start, µs after it was due.
    latest_us: AtomicU32,
}

impl Times {
    fn activation(&self, counts: u32, late: Duration) {
        let late_us = u32::try_from(late.as_micros()).unwrap_or(u32::MAX);
        self.last.store(counts, Ordering::Relaxed);
        raise(&self.longest, counts);
        raise(&self.latest_us, late_us);
    }

    fn overrun(&self, times: u32) {
        let overruns = self.overruns.load(Ordering::Relaxed);
        self.overruns
            .store(overruns.saturating_add(times), Ordering::Relaxed);
    }

    fn forget(&self) {
        for worst in [&self.overruns, &self.longest, &self.latest_us] {
            worst.store(0, Ordering::Relaxed);
        }
    }
}

/// What only one task writes can be compared and written in two steps.
fn raise(worst: &AtomicU32, value: u32) {
    if value > worst.load(Ordering::Relaxed) {
        worst.store(value, Ordering::Relaxed);
    }
}

/// The releases of a timed task: exact multiples of its period from the start, none skipped.
struct Rate<'a, W> {
    due: Instant,
    period: Duration,
    late: Duration,
    began: u32,
    task: Task,
    life: &'static Life,
    times: &'a Times,
    stopwatch: PhantomData<W>,
}

impl<'a, W: Stopwatch> Rate<'a, W> {
    fn new(
        start: Instant,
        period_ms: u32,
        task: Task,
        life: &'static Life,
        times: &'a Times,
    ) -> Self {
        Self {
            due: start,
            period: Duration::from_millis(u64::from(period_ms)),
            late: Duration::MIN,
            began: 0,
            task,
            life,
            times,
            stopwatch: PhantomData,
        }
    }

    /// The next release. Not awaited here: a future within the task's would cost as much as the timer itself.
    fn next(&mut self) -> Timer {
        self.due += self.period;
        Timer::at(self.due)
    }

    /// It has come.
    fn begin(&mut self) {
        self.began = W::count();
        let now = Instant::now();
        self.late = now - self.due;
        self.life.see(self.task, now);
    }

    fn done(&self) {
        let counts = W::count().wrapping_sub(self.began);
        self.times.activation(counts, self.late);
        // Started late by a whole period or done that late: the next is due already.
        let took = Duration::from_micros(u64::from(counts / W::PER_US));
        if self.late + took >= self.period {
            self.times.overrun(1);
        }
    }
}

/// The plant's task: the winder moves by 4 ms.
pub async fn plant<W: Stopwatch, R: Scalar>(
    start: Instant,
    plant: &mut Plant<R, SPANS>,
    exchange: &Exchange<R>,
) -> ! {
    let Exchange {
        life,
        plant_times: times,
        ..
    } = exchange;
    let mut rate = Rate::<W>::new(start, PLANT_PERIOD_MS, Task::Plant, life, times);
    let mut number = 0_u32;
    loop {
        rate.next().await;
        rate.begin();
        let hatch = &exchange.plant_hatch;
        hatch.pass(number, plant, &exchange.actuators);
        number = number.wrapping_add(1);
        let seen = exchange.actuators.look(|actuators| plant.tick(actuators));
        exchange.measurements.set(seen);
        rate.done();
    }
}

/// The regulators' task: torques from what can be measured.
pub async fn drive<W: Stopwatch, R: Scalar>(
    start: Instant,
    drive: &mut Drive<R::Si>,
    exchange: &Exchange<R>,
) -> ! {
    let Exchange {
        life,
        drive_times: times,
        ..
    } = exchange;
    let mut rate = Rate::<W>::new(start, DRIVE_PERIOD_MS, Task::Drive, life, times);
    let mut number = 0_u32;
    loop {
        rate.next().await;
        rate.begin();
        let hatch = &exchange.drive_hatch;
        hatch.pass(number, drive, &exchange.command);
        let Exchange {
            measurements,
            command,
            actuators,
            cycle,
            ..
        } = exchange;
        // what comes of it goes straight to where it is looked at
        measurements.look(|(measurements, record)| {
            command.look(|command| {
                actuators.fill(|actuators| {
                    cycle.fill(|cycle| {
                        drive.step(command, measurements, actuators, &mut cycle.status);
                        (cycle.number, cycle.due) = (number, rate.due);
                        (cycle.measurements, cycle.record) = (*measurements, *record);
                    });
                });
            });
        });
        number = number.wrapping_add(1);
        exchange.cycles.store(number, Ordering::Release);
        exchange.next_cycle.wake();
        rate.done();
    }
}

/// Drive cycles from an order to its boundary: one of them may be half over, and the logic is the last in it.
const AHEAD: u32 = 2;

/// The activation of the plant that is the first after a drive cycle. At a common tick the plant comes before the
/// regulators, and both start counting together.
const fn plant_after(cycle: u32) -> u32 {
    let ms = (cycle as u64 + 1) * DRIVE_PERIOD_MS as u64;
    (ms / PLANT_PERIOD_MS as u64) as u32
}

/// The drive cycle is the first of two, of which the second has a common tick.
const fn is_odd(cycle: u32) -> bool {
    cycle.is_multiple_of(2)
}

/// A change of hands that is under way: `cycle` is the last before the boundary.
enum Change<R: Scalar> {
    Take {
        cycle: u32,
        rest: Option<(Logic<R::Si>, Image)>,
    },
    Put {
        cycle: u32,
        logic: Logic<R::Si>,
        image: Image,
    },
}

/// What changes hands at an attendant's order, and what is kept of it. As large as the simulator: a board whose attendant
/// orders nothing has none.
pub struct Hands<R: Scalar> {
    change: Option<Change<R>>,
    kept: Option<State<R>>,
}

impl<R: Scalar> Default for Hands<R> {
    /// Nothing is under way.
    fn default() -> Self {
        Self {
            change: None,
            kept: None,
        }
    }
}

/// The logic's task: modes, interlocks and the process image, once a drive cycle. Without hands nothing is ordered.
pub async fn logic<W: Stopwatch, R: Scalar, M: RawMutex>(
    logic: &mut Logic<R::Si>,
    exchange: &Exchange<R>,
    image: &ImageCell<M>,
    journal: &mut impl Journal,
    attendant: &mut impl Attendant,
    mut hands: Option<&mut Hands<R>>,
) -> ! {
    if exchange.started.why.is_by_itself() {
        logic.restarted();
    }
    let mut observer = Observer::new(image.lock(|image| image.borrow().commands));
    let times = &exchange.logic_times;
    let mut next = 0;
    let mut reset = Edge::default();
    loop {
        exchange.cycle_from(next).await;
        let began = W::count();
        let cycle = exchange.cycle.get();
        let now = Instant::now();
        let late = now - cycle.due;
        exchange.life.see(Task::Logic, now);
        times.overrun(cycle.number.wrapping_sub(next));
        next = cycle.number.wrapping_add(1);

        let snapshot = image.lock(|image| {
            let image = &mut *image.borrow_mut();
            if let Some(hands) = hands.as_deref_mut().filter(|hands| hands.is_busy()) {
                hands.before(cycle.number, logic, image, attendant);
            }
            attendant.before(cycle.number, image);
            let commands = exchange.inputs.get().act_on(&image.commands);
            let command = logic_tick(
                logic,
                &commands,
                &cycle.measurements,
                &cycle.status,
                &cycle.record,
                &mut image.feedback,
            );
            exchange.command.set(command);
            exchange.report_times::<W>(&mut image.feedback);
            exchange.outputs.set(Outputs::of(&image.feedback));
            attendant.after(cycle.number, image);
            if let Some(hands) = hands.as_deref_mut().filter(|hands| hands.is_busy()) {
                hands.after(cycle.number, logic, image);
            }
            Image { commands, ..*image }
        });
        observer.look(cycle.number, &snapshot, journal);
        if let Some(hands) = hands.as_deref_mut() {
            hands.go_on(exchange, cycle.number, attendant);
        }
        times.activation(W::count().wrapping_sub(began), late);
        let word = snapshot.commands.word(&image::WINDER_COMMAND);
        if reset.rises(word & command::RESET_TIMES != 0) {
            exchange.forget_times();
        }
    }
}

/// One cycle comes after another, as they wrap.
const fn is_after(cycle: u32, other: u32) -> bool {
    cycle.wrapping_sub(other).cast_signed() > 0
}

// Apart from the logic's task, whose stack would have room for all of it at all times.
impl<R: Scalar> Hands<R> {
    fn is_busy(&self) -> bool {
        self.change.is_some()
    }

    /// Before a drive cycle of the logic: it may go on from another state.
    #[cold]
    #[inline(never)]
    fn before(
        &mut self,
        now: u32,
        logic: &mut Logic<R::Si>,
        image: &mut Image,
        attendant: &mut impl Attendant,
    ) {
        match &self.change {
            Some(Change::Take {
                cycle,
                rest: Some((_, then)),
            }) if is_after(now, *cycle) => {
                // Told already, though plant and regulators may have been late: then once more.
                attendant.done(now, Done::Kept, then);
            }
            Some(Change::Put {
                cycle,
                logic: other,
                image: then,
            }) if is_after(now, *cycle) => {
                logic.clone_from(other);
                *image = *then;
                attendant.done(now, Done::GoesOn, image);
                self.change = None;
            }
            _ => {}
        }
    }

    /// After it: its state may be the one to keep.
    #[cold]
    #[inline(never)]
    fn after(&mut self, now: u32, logic: &Logic<R::Si>, image: &Image) {
        if let Some(Change::Take { cycle, rest }) = &mut self.change
            && *cycle == now
        {
            *rest = Some((logic.clone(), *image));
        }
    }

    /// Moves a change of hands on after a drive cycle, or begins one.
    #[inline(never)]
    fn go_on(&mut self, exchange: &Exchange<R>, now: u32, attendant: &mut impl Attendant) {
        match &mut self.change {
            Some(Change::Take { cycle, rest }) if is_after(now, *cycle) => {
                let first = cycle.wrapping_add(1);
                let plant = exchange.plant_hatch.taken(plant_after(*cycle));
                let drive = exchange.drive_hatch.taken(first);
                let odd = is_odd(*cycle);
                self.change = match (plant, drive, rest.take()) {
                    (Some((plant, actuators)), Some((drive, command)), Some((logic, image))) => {
                        self.kept = Some(State {
                            plant,
                            drive,
                            logic,
                            actuators,
                            command,
                            image,
                            odd,
                        });
                        None
                    }
                    // Somebody was late, and the parts are not of one moment: once more.
                    _ => Some(exchange.take(now)),
                };
            }
            Some(_) => {}
            None => {
                self.change = match attendant.order() {
                    None => None,
                    Some(Order::Keep) => Some(exchange.take(now)),
                    Some(Order::Restore) => self.kept.clone().map(|state| exchange.put(now, state)),
                    Some(Order::Rebuild(machine)) => State::fresh(&machine)
                        .ok()
                        .map(|state| exchange.put(now, state)),
                };
            }
        }
    }
}

impl<R: Scalar> Exchange<R> {
    fn take(&self, now: u32) -> Change<R> {
        let cycle = now.wrapping_add(AHEAD);
        let at = plant_after(cycle);
        self.plant_hatch.set(Handing::Take { at });
        let at = cycle.wrapping_add(1);
        self.drive_hatch.set(Handing::Take { at });
        Change::Take { cycle, rest: None }
    }

    /// Where plant and regulators next stand to each other as they did in the state.
    fn put(&self, now: u32, state: State<R>) -> Change<R> {
        let ahead = now.wrapping_add(AHEAD);
        let cycle = match is_odd(ahead) == state.odd {
            true => ahead,
            false => ahead.wrapping_add(1),
        };
        self.plant_hatch.set(Handing::Put {
            at: plant_after(cycle),
            part: (state.plant, state.actuators),
        });
        self.drive_hatch.set(Handing::Put {
            at: cycle.wrapping_add(1),
            part: (state.drive, state.command),
        });
        Change::Put {
            cycle,
            logic: state.logic,
            image: state.image,
        }
    }

    /// What can be measured since the plant's last activation.
    pub fn measurements(&self) -> Measurements<R::Si> {
        self.measurements.get().0
    }

    /// What the hard-wired outputs show.
    pub fn outputs(&self) -> Outputs {
        self.outputs.get()
    }

    /// What stands at the hard-wired inputs from now on.
    pub fn set_inputs(&self, inputs: Inputs) {
        self.inputs.set(inputs);
    }

    /// Waits for a drive cycle of this number or a later one.
    async fn cycle_from(&self, number: u32) {
        poll_fn(|context| {
            self.next_cycle.register(context.waker());
            if self.cycles.load(Ordering::Acquire) == number {
                Poll::Pending
            } else {
                Poll::Ready(())
            }
        })
        .await;
    }

    fn forget_times(&self) {
        for times in [&self.plant_times, &self.drive_times, &self.logic_times] {
            times.forget();
        }
    }

    fn report_times<W: Stopwatch>(&self, feedback: &mut Feedback) {
        let (plant, drive, logic) = (&self.plant_times, &self.drive_times, &self.logic_times);
        let us = |counts: &AtomicU32| counts.load(Ordering::Relaxed) / W::PER_US;
        let tenths = |counts: &AtomicU32| {
            let counts = counts.load(Ordering::Relaxed);
            counts.saturating_mul(10) / W::PER_US
        };
        let plain = |number: &AtomicU32| number.load(Ordering::Relaxed);
        for (signal, value) in [
            (&image::PLANT_OVERRUNS, plain(&plant.overruns)),
            (&image::PLANT_TIME_MAX, us(&plant.longest)),
            (&image::PLANT_JITTER_MAX, plain(&plant.latest_us)),
            (&image::DRIVE_OVERRUNS, plain(&drive.overruns)),
            (&image::DRIVE_TIME_MAX, us(&drive.longest)),
            (&image::DRIVE_JITTER_MAX, plain(&drive.latest_us)),
            (&image::LOGIC_OVERRUNS, plain(&logic.overruns)),
            (&image::LOGIC_TIME_MAX, us(&logic.longest)),
            (&image::LOGIC_JITTER_MAX, plain(&logic.latest_us)),
            (&image::PLANT_TIME, tenths(&plant.last)),
            (&image::DRIVE_TIME, tenths(&drive.last)),
            (&image::LOGIC_TIME, tenths(&logic.last)),
            (&image::RESTART, self.started.why.number().into()),
            (&image::RESTARTS, self.started.times.into()),
        ] {
            feedback.set_word(signal, u16::try_from(value).unwrap_or(u16::MAX));
        }
    }
}

/// A rising edge.
#[derive(Default)]
struct Edge(bool);

impl Edge {
    fn rises(&mut self, now: bool) -> bool {
        let rises = now && !self.0;
        self.0 = now;
        rises
    }
}
