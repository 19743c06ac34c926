//! The three tasks of the simulator: plant every 4 ms, regulators every 10 ms, logic in the background.
//!
//! Not here: executors, priorities, interrupts: those are the board's. It runs [`plant`] above [`drive`] above
//! [`logic`], each in an executor of its own, from one common start.
//!
//! What one task hands to another goes through a [`Mailbox`]. The logic gets all it needs of a drive cycle in
//! one piece and answers before the next; so it does not matter when in between it gets its turn, and the same
//! commands in the same cycles give the same bits as [`model_core::simulator::Simulator`].

use core::cell::Cell;

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::{CriticalSectionRawMutex, RawMutex};
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Instant, Timer};
use model_core::drive::{DRIVE_PERIOD_MS, Drive};
use model_core::exchange::{Actuators, DriveCommand, DriveStatus, Measurements};
use model_core::image::{self, Feedback, Image};
use model_core::logic::{Logic, command};
use model_core::plant::PLANT_PERIOD_MS;
use model_core::simulator::{Plant, Record, logic_tick};

use crate::journal::{Journal, Observer};
use crate::link::ImageCell;
use crate::wired::{Inputs, Outputs};
use crate::{SPANS, Scalar};

/// A value that one task leaves for another; the latest counts.
struct Mailbox<T>(Mutex<CriticalSectionRawMutex, Cell<T>>);

impl<T: Copy> Mailbox<T> {
    fn new(value: T) -> Self {
        Self(Mutex::new(Cell::new(value)))
    }
    fn get(&self) -> T {
        self.0.lock(Cell::get)
    }
    fn set(&self, value: T) {
        self.0.lock(|cell| cell.set(value));
    }
}

/// All that a drive cycle gives the logic.
struct Cycle {
    number: u32,
    measurements: Measurements<Scalar>,
    status: DriveStatus<Scalar>,
    record: Record,
}

/// What the tasks hand to each other.
pub struct Exchange {
    actuators: Mailbox<Actuators<Scalar>>,
    measurements: Mailbox<(Measurements<Scalar>, Record)>,
    command: Mailbox<DriveCommand<Scalar>>,
    cycle: Signal<CriticalSectionRawMutex, Cycle>,
    inputs: Mailbox<Inputs>,
    outputs: Mailbox<Outputs>,
    plant_times: Mailbox<Times>,
    drive_times: Mailbox<Times>,
}

impl Default for Exchange {
    fn default() -> Self {
        Self {
            actuators: Mailbox::new(Actuators::default()),
            measurements: Mailbox::new((Measurements::default(), Record::default())),
            command: Mailbox::new(DriveCommand::default()),
            cycle: Signal::new(),
            inputs: Mailbox::new(Inputs::default()),
            outputs: Mailbox::new(Outputs::default()),
            plant_times: Mailbox::new(Times::default()),
            drive_times: Mailbox::new(Times::default()),
        }
    }
}

/// The worst of a timed task since it was last forgotten.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Times {
    /// Activations not done before the next was due.
    overruns: u16,
    /// Longest activation, µs, with what interrupted it.
    longest_us: u16,
    /// Latest start, µs after it was due.
    latest_us: u16,
}

/// The releases of a timed task: exact multiples of its period from the start, none skipped.
struct Rate<'a> {
    due: Instant,
    period: Duration,
    started: Instant,
    times: &'a Mailbox<Times>,
}

impl<'a> Rate<'a> {
    fn new(start: Instant, period_ms: u32, times: &'a Mailbox<Times>) -> Self {
        Self {
            due: start,
            period: Duration::from_millis(u64::from(period_ms)),
            started: start,
            times,
        }
    }

    async fn release(&mut self) {
        self.due += self.period;
        Timer::at(self.due).await;
        self.started = Instant::now();
    }

    fn done(&self) {
        let now = Instant::now();
        let us = |d: Duration| u16::try_from(d.as_micros()).unwrap_or(u16::MAX);
        let mut times = self.times.get();
        times.longest_us = times.longest_us.max(us(now - self.started));
        times.latest_us = times.latest_us.max(us(self.started - self.due));
        if now >= self.due + self.period {
            times.overruns = times.overruns.saturating_add(1);
        }
        self.times.set(times);
    }
}

/// The plant's task: the winder moves by 4 ms.
pub async fn plant(start: Instant, plant: &mut Plant<Scalar, SPANS>, exchange: &Exchange) -> ! {
    let mut rate = Rate::new(start, PLANT_PERIOD_MS, &exchange.plant_times);
    loop {
        rate.release().await;
        let seen = plant.tick(&exchange.actuators.get());
        exchange.measurements.set(seen);
        rate.done();
    }
}

/// The regulators' task: torques from what can be measured.
pub async fn drive(start: Instant, drive: &mut Drive<Scalar>, exchange: &Exchange) -> ! {
    let mut rate = Rate::new(start, DRIVE_PERIOD_MS, &exchange.drive_times);
    let mut number = 0;
    loop {
        rate.release().await;
        let (measurements, record) = exchange.measurements.get();
        let (actuators, status) = drive.step(&exchange.command.get(), &measurements);
        exchange.actuators.set(actuators);
        exchange.cycle.signal(Cycle {
            number,
            measurements,
            status,
            record,
        });
        number = number.wrapping_add(1);
        rate.done();
    }
}

/// The logic's task: modes, interlocks and the process image, once a drive cycle.
pub async fn logic<M: RawMutex>(
    logic: &mut Logic<Scalar>,
    exchange: &Exchange,
    image: &ImageCell<M>,
    journal: &mut impl Journal,
) -> ! {
    let mut observer = Observer::new(image.lock(|image| image.borrow().commands));
    let (mut next, mut missed) = (0, 0_u16);
    let mut reset = Edge::default();
    loop {
        let cycle = exchange.cycle.wait().await;
        let behind = cycle.number.wrapping_sub(next);
        missed = missed.saturating_add(u16::try_from(behind).unwrap_or(u16::MAX));
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
            exchange.report_times(missed, &mut image.feedback);
            exchange.outputs.set(Outputs::of(&image.feedback));
            Image { commands, ..*image }
        });
        observer.look(cycle.number, &snapshot, journal);
        let word = snapshot.commands.word(&image::WINDER_COMMAND);
        if reset.rises(word & command::RESET_TIMES != 0) {
            missed = 0;
            exchange.plant_times.set(Times::default());
            exchange.drive_times.set(Times::default());
        }
    }
}

impl Exchange {
    /// What can be measured since the plant's last activation.
    pub fn measurements(&self) -> Measurements<Scalar> {
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

    fn report_times(&self, logic_overruns: u16, feedback: &mut Feedback) {
        let (plant, drive) = (self.plant_times.get(), self.drive_times.get());
        for (signal, value) in [
            (&image::PLANT_OVERRUNS, plant.overruns),
            (&image::PLANT_TIME_MAX, plant.longest_us),
            (&image::PLANT_JITTER_MAX, plant.latest_us),
            (&image::DRIVE_OVERRUNS, drive.overruns),
            (&image::DRIVE_TIME_MAX, drive.longest_us),
            (&image::DRIVE_JITTER_MAX, drive.latest_us),
            (&image::LOGIC_OVERRUNS, logic_overruns),
        ] {
            feedback.set_word(signal, value);
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
