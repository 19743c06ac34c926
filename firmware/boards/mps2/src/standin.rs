//! Stand-ins for the timed tasks, and a report of how punctually they start.
//!
//! They compute nothing. They start at absolute instants counted from one common start, so their
//! periods cannot drift.

use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

use embassy_time::{Duration, Instant, Timer};

/// How late a task starts, in µs, since the last report.
struct Punctuality {
    starts: AtomicU32,
    overruns: AtomicU32,
    earliest: AtomicU32,
    latest: AtomicU32,
}

impl Punctuality {
    const fn new() -> Self {
        Self {
            starts: AtomicU32::new(0),
            overruns: AtomicU32::new(0),
            earliest: AtomicU32::new(u32::MAX),
            latest: AtomicU32::new(0),
        }
    }

    fn note(&self, late: Duration, period: Duration) {
        let micros = late.as_micros() as u32;
        self.starts.fetch_add(1, Relaxed);
        self.overruns.fetch_add((late >= period).into(), Relaxed);
        self.earliest.fetch_min(micros, Relaxed);
        self.latest.fetch_max(micros, Relaxed);
    }

    fn report(&self, task: &str) {
        defmt::info!(
            "{=str}: {=u32} starts, {=u32} overruns, {=u32} to {=u32} us late",
            task,
            self.starts.swap(0, Relaxed),
            self.overruns.load(Relaxed),
            self.earliest.swap(u32::MAX, Relaxed),
            self.latest.swap(0, Relaxed)
        );
    }
}

static PLANT: Punctuality = Punctuality::new();
static DRIVE: Punctuality = Punctuality::new();

async fn repeat(start: Instant, period: Duration, punctuality: &Punctuality, cycles: u32) -> ! {
    let mut due = start;
    loop {
        Timer::at(due).await;
        punctuality.note(due.elapsed(), period);
        cortex_m::asm::delay(cycles);
        due += period;
    }
}

/// The plant's rate: 4 ms.
#[embassy_executor::task]
pub async fn plant(start: Instant) -> ! {
    repeat(start, Duration::from_millis(4), &PLANT, 3000).await
}

/// The drive's rate: 10 ms.
#[embassy_executor::task]
pub async fn drive(start: Instant) -> ! {
    repeat(start, Duration::from_millis(10), &DRIVE, 3000).await
}

/// Says every 5 s how punctual the tasks were.
#[embassy_executor::task]
pub async fn report() -> ! {
    loop {
        Timer::after_secs(5).await;
        PLANT.report("plant");
        DRIVE.report("drive");
    }
}
