//! End to end: the firmware in QEMU, its Modbus TCP, the PLC's program. `cargo winder test` runs it.

mod support;

use std::collections::{BTreeMap, HashMap};
use std::thread;
use std::time::Duration;

use firmware::lockstep::Lockstep;
use host_tests::link::Link;
use host_tests::log::{Line, Log};
use host_tests::plc::{self, Recipe, Sample};
use host_tests::report::Report;
use host_tests::setup;
use host_tests::simulator::{Board, Options, Simulator};
use model_core::image::{self, Commands, Feedback, Image};
use model_core::machine::Machine;
use support::Running;

/// Several times real time, with room for the PLC's heartbeat on a busy PC.
const PACE: f64 = 5.0;

/// Winds a short set in QEMU; gives the samples and the log.
fn wind() -> (Recipe, Vec<Sample>, Vec<Line>) {
    let recipe = Recipe {
        machine: Machine::news_8000(),
        diameter_m: 0.15,
        speed_m_s: 400.0 / 60.0,
    };
    let log = Log::default();
    let options = Options {
        pace: PACE,
        log: log.clone(),
        ..Options::default()
    };
    let mut samples = Vec::new();
    let simulator = Simulator::start(Board::Mps2, options).expect("QEMU starts");
    plc::wind(simulator.address(), &recipe, PACE, |sample| {
        samples.push(*sample)
    })
    .unwrap_or_else(|error| panic!("{error:#}\n{}", log.last(20)));
    (recipe, samples, log.lines())
}

#[test]
fn a_set_is_wound_in_its_limits_and_a_pc_repeats_it_to_the_bit() {
    let (recipe, samples, lines) = wind();
    let report = Report::of(&recipe, &samples);
    assert!(report.missed().is_empty(), "\n{report}");

    let last = samples.last().unwrap().feedback.double(&image::PLANT_TICKS);
    let played = play(&commands(&lines), last);
    for sample in &samples {
        let tick = sample.feedback.double(&image::PLANT_TICKS);
        let pc = &played[&tick];
        assert_eq!(simulated(pc), simulated(&sample.feedback), "tick {tick}");
    }
    assert!(samples.len() > 500, "{} samples compared", samples.len());
}

/// Commands by the drive cycle from which on they count, as (word, value).
type Journal = BTreeMap<u32, Vec<(usize, u16)>>;

fn commands(lines: &[Line]) -> Journal {
    let mut journal = Journal::new();
    for line in lines {
        let Some(entry) = line.text.strip_prefix("command ") else {
            continue;
        };
        let numbers: Vec<u32> = entry.split(' ').flat_map(str::parse).collect();
        let [cycle, word, value] = numbers[..] else {
            panic!("{entry:?}")
        };
        journal
            .entry(cycle)
            .or_default()
            .push((word as usize, value as u16));
    }
    journal
}

/// Gives the commands to the simulator in this process until a plant tick; the feedback by plant tick.
fn play(journal: &Journal, last: u32) -> HashMap<u32, Feedback> {
    let machine = Machine::news_8000();
    let mut image = Image {
        commands: Commands::of(&machine),
        feedback: Feedback::default(),
    };
    let mut simulator = Lockstep::new(&machine, &image, ()).expect("a preset is valid");
    let mut played = HashMap::new();
    for cycle in 0.. {
        for &(word, value) in journal.get(&cycle).into_iter().flatten() {
            image.commands.words[word] = value;
        }
        simulator.cycle(&mut image);
        let tick = image.feedback.double(&image::PLANT_TICKS);
        played.insert(tick, image.feedback);
        if tick >= last {
            break;
        }
    }
    played
}

/// The feedback without the times of the tasks, which are the board's own.
fn simulated(feedback: &Feedback) -> &[u16] {
    &feedback.words[..usize::from(image::PLANT_OVERRUNS.word)]
}

#[test]
fn qemu_ends_with_the_tool_however_that_ends() {
    for (signal, clean) in [("INT", true), ("TERM", true), ("KILL", false)] {
        if !clean && setup::on_path("setpriv").is_none() {
            continue;
        }
        let mut running = Running::start(&[]);
        Link::connect(running.address).unwrap().read().unwrap();
        running.signal(signal);
        assert_eq!(running.end().success(), clean, "SIG{signal}");
        // the port is QEMU's: when nobody listens there, it has gone
        thread::sleep(Duration::from_millis(500));
        assert!(Link::connect(running.address).is_err(), "SIG{signal}");
    }
}
