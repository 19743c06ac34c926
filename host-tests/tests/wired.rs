//! The hard-wired signals against a timer as the reference manual has it, over a whole set.

use firmware::wired::{Analog, Angle, Encoder, Inputs, Leads, Outputs, Seen, Setting};
use firmware::{SPANS, Scalar};
use host_tests::scenario::Scenario;
use host_tests::scenario::player::{Player, Timing};
use model_core::exchange::Measurements;
use model_core::image::{self, Commands, Feedback, Image};
use model_core::logic::{Mode, command, status};
use model_core::machine::Machine;
use model_core::plant::PLANT_PERIOD_MS;
use model_core::simulator::Simulator;
use proptest::prelude::*;

/// Clock of the timers, Hz: that of the STM32H743 at 400 MHz.
const CLOCK_HZ: f32 = 200e6;
const INTERVAL_S: f32 = 1e-3 * PLANT_PERIOD_MS as f32;
/// Ticks in an interval.
const INTERVAL: u64 = (CLOCK_HZ * INTERVAL_S) as u64;

/// A timer with two toggling channels and preloaded registers, and the decoder of a counter card on its outputs.
struct Timer {
    now: u64,
    /// When the running period began, its ticks, and which channel leads; none at rest.
    period: Option<(u64, u32, Leads)>,
    preloaded: Setting,
    periods: u16,
    outputs: [bool; 2],
    /// Edges of both channels, signed by direction: four for each pulse.
    count: i64,
    /// Time of the last rising edge of A, and the pulse's length before it.
    rose: u64,
    pulse: u64,
}

impl Timer {
    fn new() -> Self {
        Self {
            now: 0,
            period: None,
            preloaded: Setting::Hold,
            periods: 0,
            outputs: [false; 2],
            count: 0,
            rose: 0,
            pulse: 0,
        }
    }

    fn seen(&self) -> Seen {
        Seen {
            periods: self.periods,
            running: self.period.is_some(),
        }
    }

    fn set(&mut self, setting: Setting) {
        self.preloaded = setting;
        if self.period.is_none() {
            self.reload(self.now);
        }
    }

    fn reload(&mut self, at: u64) {
        self.period = match self.preloaded {
            Setting::Hold => None,
            Setting::Turn { ticks, leads } => Some((at, ticks, leads)),
        };
    }

    /// Runs up to a time.
    fn run(&mut self, until: u64) {
        while let Some((began, ticks, leads)) = self.period {
            let end = began + u64::from(ticks);
            let (first, second) = match leads {
                Leads::A => (0, 1),
                Leads::B => (1, 0),
            };
            for (channel, at) in [
                (first, began + u64::from(ticks / 4)),
                (second, began + u64::from(ticks / 4 * 3)),
            ] {
                if (self.now..until).contains(&at) {
                    self.toggle(channel, at);
                }
            }
            if end > until {
                break;
            }
            self.now = end;
            self.periods = self.periods.wrapping_add(1);
            self.reload(end);
        }
        self.now = until;
    }

    /// As a counter card decodes it: A ahead of B is up.
    fn toggle(&mut self, channel: usize, at: u64) {
        let [a, b] = self.outputs;
        let up = if channel == 0 { a == b } else { a != b };
        self.count += if up { 1 } else { -1 };
        self.outputs[channel] = !self.outputs[channel];
        if channel == 0 && self.outputs[0] {
            (self.pulse, self.rose) = (at - self.rose, at);
        }
    }
}

/// The two encoders of a winder and their timers.
struct Wires {
    rd: (Encoder, Timer),
    uw: (Encoder, Timer),
    angle: Angle,
    ticks: u64,
    pulses: f32,
}

impl Wires {
    fn new(machine: &Machine) -> Self {
        let pulses = machine.encoder_pulses as f32;
        let encoder = || (Encoder::new(pulses, CLOCK_HZ, INTERVAL_S), Timer::new());
        Self {
            rd: encoder(),
            uw: encoder(),
            angle: Angle::new(pulses, INTERVAL_S),
            ticks: 0,
            pulses,
        }
    }

    /// After a tick of the plant; the processor is late by up to 50 µs, as its other work has it.
    fn tick(&mut self, measurements: &Measurements<f32>) {
        let late = self.ticks.wrapping_mul(0x9e37_79b9) % (INTERVAL / 80);
        let now = self.ticks * INTERVAL + late;
        self.ticks += 1;
        let omega = measurements.omega;
        let count_uw = self.angle.count(omega.uw);
        for ((encoder, timer), count, omega) in [
            (&mut self.rd, measurements.pulses_rd, omega.rd),
            (&mut self.uw, count_uw, omega.uw),
        ] {
            timer.run(now);
            let setting = encoder.set(count, omega, timer.seen());
            timer.set(setting);
        }
    }
}

/// Winds a library scenario in lockstep; `see` is called after each tick of the plant.
fn wind(text: &str, mut see: impl FnMut(&Measurements<f32>, &mut Wires)) -> (Wires, Image) {
    let path = format!("{}/scenarios/{text}.toml", env!("CARGO_MANIFEST_DIR"));
    let scenario = Scenario::open(path.as_ref()).expect("of the library");
    let machine = &scenario.machine.machine;
    let mut simulator = Simulator::<Scalar, SPANS>::new(machine).expect("of the library");
    let mut image = Image {
        commands: Commands::of(machine),
        feedback: Feedback::default(),
    };
    let mut wires = Wires::new(machine);
    let mut player = Player::new(&scenario, Timing::LOCKSTEP);
    for cycle in 0.. {
        player.look(cycle, &image.feedback);
        if player.is_done() {
            break;
        }
        image.commands = *player.commands();
        simulator.drive_cycle_seen(&mut image, |measurements| {
            wires.tick(measurements);
            see(measurements, &mut wires);
        });
    }
    assert!(player.failures().is_empty(), "{:?}", player.failures());
    (wires, image)
}

#[test]
fn the_count_over_a_whole_set_is_exact_and_the_frequency_true() {
    let machine = Machine::news_8000();
    let circumference = std::f64::consts::TAU * machine.rear_drum.radius_m;
    let (mut worst, mut looked, mut turned) = (0.0_f32, 0, 0.0_f64);
    let mut before = Measurements::<f32>::default();
    let (wires, image) = wind("full_set", |now, wires| {
        turned += 0.5 * f64::from(before.omega.uw + now.omega.uw) * f64::from(INTERVAL_S);
        // the frequency, where the speed stands: thread, run
        let steady = (now.omega.rd - before.omega.rd).abs() < 1e-4 * now.omega.rd;
        if steady && now.omega.rd > 1.0 {
            let hertz = now.omega.rd * wires.pulses / std::f32::consts::TAU;
            let shown = CLOCK_HZ / wires.rd.1.pulse as f32;
            worst = worst.max((shown / hertz - 1.0).abs());
            looked += 1;
        }
        before = *now;
    });
    let pulses = |timer: &Timer| timer.count as f64 / 4.0;

    // the simulated counter, and the length by the drive system with the machine's pulses per metre
    let shown = pulses(&wires.rd.1);
    let counted = f64::from(image.feedback.double(&image::PULSES_RD));
    assert!((shown - counted).abs() <= 1.0, "{shown} for {counted}");
    let length = f64::from(image.feedback.get::<f32>(&image::LENGTH_WU));
    let per_metre = machine.encoder_pulses / circumference;
    // the length is given in steps of 1 cm, and starts with the new core
    assert!(
        shown > 1e7 && (shown / per_metre - length).abs() < 0.1,
        "{shown}, {length} m"
    );

    let angle = turned / std::f64::consts::TAU * f64::from(wires.pulses);
    assert!((pulses(&wires.uw.1) - angle).abs() <= 1.5, "{angle}");

    assert!(looked > 100_000, "{looked}");
    assert!(worst < 5e-3, "{worst}");
}

/// Forward and back: the direction is in the order of the edges.
#[test]
fn a_roll_that_turns_back_counts_back() {
    let mut wires = Wires::new(&Machine::news_8000());
    let mut pulses = 0.0_f64;
    for tick in 0..5000 {
        let omega = 40.0 * (f64::from(tick) * 0.004).sin();
        // ends at rest, after three times there and back
        let omega = if tick > 4712 { 0.0 } else { omega };
        pulses += omega * 0.004 / std::f64::consts::TAU * f64::from(wires.pulses);
        let mut measurements = Measurements::<f32>::default();
        measurements.omega.rd = omega as f32;
        measurements.pulses_rd = (pulses.floor() as i64) as u32;
        wires.tick(&measurements);
        let shown = wires.rd.1.count as f64 / 4.0;
        // what turns in two intervals, and the slow correction
        let behind = omega.abs() * 0.004 * 651.9 * 3.0 + 30.0;
        assert!(
            (shown - pulses).abs() < behind,
            "tick {tick}: {shown}, {pulses}"
        );
    }
    let shown = wires.rd.1.count as f64 / 4.0;
    assert!(
        (shown - pulses.floor()).abs() <= 1.0,
        "{shown} for {pulses}"
    );
}

proptest! {
    /// Whatever comes, the count is made up for, and no setting is one that the timer cannot have.
    #[test]
    fn no_input_loses_the_count(
        speeds in prop::collection::vec((-200.0_f32..200.0, 1..40_usize), 1..20),
    ) {
        let mut wires = Wires::new(&Machine::news_8000());
        let mut pulses = 0.0_f64;
        let rest = [(0.0, 400)];
        for (omega, ticks) in speeds.into_iter().chain(rest) {
            for _ in 0..ticks {
                pulses += f64::from(omega) * 0.004 / std::f64::consts::TAU * f64::from(wires.pulses);
                let mut measurements = Measurements::<f32>::default();
                measurements.omega.rd = omega;
                measurements.pulses_rd = (pulses.floor() as i64) as u32;
                wires.tick(&measurements);
            }
        }
        let shown = wires.rd.1.count as f64 / 4.0;
        prop_assert!((shown - pulses.floor()).abs() <= 1.0, "{shown} for {pulses}");
    }

    #[test]
    fn a_code_is_within_one_of_the_value(tension in -100.0_f32..1500.0) {
        let analog = Analog::new(1000.0, 4095);
        let exact = f64::from(tension.clamp(0.0, 1000.0)) / 1000.0 * 4095.0;
        prop_assert!((f64::from(analog.code(tension)) - exact).abs() <= 1.0);
    }

    /// A wire can stop, never start.
    #[test]
    fn wires_only_take_away(words in prop::array::uniform32(any::<u16>()), bits in 0..16_u8) {
        let mut commands = Commands::default();
        for (word, any) in commands.words.iter_mut().zip(words) {
            *word = any;
        }
        let inputs = Inputs {
            emergency_stop_closed: bits & 1 == 0,
            run_permit: bits & 2 == 0,
            drum_brakes: bits & 4 != 0,
            acknowledge: bits & 8 != 0,
        };
        let acted = inputs.act_on(&commands);
        let bit = |on, bit| if on { bit } else { 0 };
        let may_set_bits = bit(inputs.drum_brakes, command::DRUM_BRAKES)
            | bit(inputs.acknowledge, command::ACKNOWLEDGE);
        for (w, (old, new)) in commands.words.iter().zip(acted.words).enumerate() {
            let may_set = bit(w == usize::from(image::WINDER_COMMAND.word), may_set_bits);
            prop_assert_eq!(new & !old & !may_set, 0, "word {}", w);
        }
        prop_assert_eq!(Inputs::default().act_on(&commands), commands);
    }
}

#[test]
fn a_code_stays_at_the_end_of_its_range() {
    let analog = Analog::new(1000.0, 4095);
    let codes = [0.0, 1000.0, 1e9, -5.0, f32::NAN, f32::INFINITY].map(|t| analog.code(t));
    assert_eq!(codes, [0, 4095, 4095, 0, 0, 4095]);
}

/// The open emergency-stop circuit stops the running winder as OFF3 does, and the relays show it.
#[test]
fn an_open_circuit_is_an_emergency_stop() {
    let machine = Machine::news_8000();
    let path = format!(
        "{}/scenarios/emergency_stop_run.toml",
        env!("CARGO_MANIFEST_DIR")
    );
    let scenario = Scenario::open(path.as_ref()).unwrap();
    let mut simulator = Simulator::<Scalar, SPANS>::new(&machine).unwrap();
    let mut image = Image {
        commands: Commands::of(&machine),
        feedback: Feedback::default(),
    };
    let mut player = Player::new(&scenario, Timing::LOCKSTEP);
    let mode = |image: &Image| Mode::ALL[usize::from(image.feedback.word(&image::MODE))];
    let mut cycle = 0;
    while image.feedback.get::<f32>(&image::V_WEB) < 300.0 {
        player.look(cycle, &image.feedback);
        image.commands = *player.commands();
        simulator.drive_cycle(&mut image);
        cycle += 1;
        assert!(cycle < 100_000);
    }
    let open = Inputs {
        emergency_stop_closed: false,
        ..Inputs::default()
    };
    assert!(Outputs::of(&image.feedback).web_whole);
    let bus = image.commands;
    let mut modes = Vec::new();
    for count in 0..3000 {
        image.commands = open.act_on(&bus);
        image.commands.set_word(&image::HEARTBEAT_PLC, count);
        simulator.drive_cycle(&mut image);
        if modes.last() != Some(&mode(&image)) {
            modes.push(mode(&image));
        }
    }
    assert_eq!(modes, [Mode::EmergencyStop, Mode::Off]);
    let outputs = Outputs::of(&image.feedback);
    assert!(outputs.brakes.uw && outputs.brakes.rd && outputs.brakes.fd);
    assert_eq!(
        image.feedback.word(&image::WINDER_STATUS) & status::ZERO_SPEED,
        status::ZERO_SPEED
    );
}
