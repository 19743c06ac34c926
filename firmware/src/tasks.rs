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
use core::sync::atomic::{AtomicU32, Ordering};
use core::task::Poll;

use atomic_waker::AtomicWaker;
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Instant, Timer};
use model_core::drive::{DRIVE_PERIOD_MS, Drive};
use model_core::exchange::{Actuators, DriveCommand, DriveStatus, Measurements};
use model_core::image::{self, Feedback, Image};
use model_core::logic::{Logic, command};
use model_core::plant::PLANT_PERIOD_MS;
use model_core::real::{Real, Scalar};
use model_core::simulator::{Plant, Record, logic_tick};

use crate::journal::{Journal, Observer};
use crate::life::{Life, Started, Task};
use crate::link::ImageCell;
use crate::mailbox::Mailbox;
use crate::wired::{Inputs, Outputs};

/// What a board measures times with: cycles of the core, or a timer as fast as there is.
pub trait Stopwatch {
    /// Its counts in a microsecond.
    const PER_US: u32;

    /// Its count, which wraps.
    fn count() -> u32;
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
pub struct Exchange<R> {
    actuators: Mailbox<Actuators<R>>,
    measurements: Mailbox<(Measurements<R>, Record)>,
    command: Mailbox<DriveCommand<R>>,
    cycle: Mailbox<Cycle<R>>,
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

impl<R: Real> Exchange<R> {
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

    async fn release(&mut self) {
        self.due += self.period;
        Timer::at(self.due).await;
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
pub async fn plant<W: Stopwatch, R: Scalar, const SPANS: usize>(
    start: Instant,
    plant: &mut Plant<R, SPANS>,
    exchange: &Exchange<R::Si>,
) -> ! {
    let Exchange {
        life,
        plant_times: times,
        ..
    } = exchange;
    let mut rate = Rate::<W>::new(start, PLANT_PERIOD_MS, Task::Plant, life, times);
    loop {
        rate.release().await;
        let seen = exchange.actuators.look(|actuators| plant.tick(actuators));
        exchange.measurements.set(seen);
        rate.done();
    }
}

/// The regulators' task: torques from what can be measured.
pub async fn drive<W: Stopwatch, R: Real>(
    start: Instant,
    drive: &mut Drive<R>,
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
        rate.release().await;
        let (measurements, record) = exchange.measurements.get();
        let command = &exchange.command;
        let (actuators, status) = command.look(|command| drive.step(command, &measurements));
        exchange.actuators.set(actuators);
        exchange.cycle.set(Cycle {
            number,
            due: rate.due,
            measurements,
            status,
            record,
        });
        number = number.wrapping_add(1);
        exchange.cycles.store(number, Ordering::Release);
        exchange.next_cycle.wake();
        rate.done();
    }
}

/// The logic's task: modes, interlocks and the process image, once a drive cycle.
pub async fn logic<W: Stopwatch, R: Real, M: RawMutex>(
    logic: &mut Logic<R>,
    exchange: &Exchange<R>,
    image: &ImageCell<M>,
    journal: &mut impl Journal,
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
            Image { commands, ..*image }
        });
        observer.look(cycle.number, &snapshot, journal);
        times.activation(W::count().wrapping_sub(began), late);
        let word = snapshot.commands.word(&image::WINDER_COMMAND);
        if reset.rises(word & command::RESET_TIMES != 0) {
            exchange.forget_times();
        }
    }
}

impl<R: Real> Exchange<R> {
    /// What can be measured since the plant's last activation.
    pub fn measurements(&self) -> Measurements<R> {
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
