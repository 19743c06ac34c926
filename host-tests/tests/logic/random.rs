//! Whatever is commanded: no transition beside the table, no set-point beside its limits.
//!
//! Two machines answer: a caricature that does what it is asked within a cycle or so, fast enough for millions of
//! cycles, and the simulator itself. `WINDER_LOGIC_CYCLES` sets the number of cycles of the first (10 000 000 take a
//! quarter of a minute).

use crate::operator::Operator;
use model_core::exchange::{
    Brakes, BySection, DriveCommand, DriveStatus, Measurements, UnwindControl,
};
use model_core::image::{self, Commands, Direction, Feedback, Kind, SIGNALS};
use model_core::logic::table::{Cause, Outcome};
use model_core::logic::{Fault, Logic, Mode, Refusal, command, inject};
use model_core::machine::Machine;
use model_core::profidrive::stw1;

/// Cycles of the quick test.
const CYCLES: u64 = 1_500_000;

/// Xorshift, Marsaglia, J. Stat. Softw. 8 (2003) 14: the triple 13, 7, 17.
struct Chance(u64);

impl Chance {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }
    /// Below `n`.
    fn below(&mut self, n: u64) -> u64 {
        (self.next() >> 16) % n
    }
    /// Once in `n` times.
    fn once_in(&mut self, n: u64) -> bool {
        self.below(n) == 0
    }
    /// From −1 to 1.
    fn noise(&mut self) -> f32 {
        self.below(2001) as f32 / 1000.0 - 1.0
    }
}

/// Somebody who takes the winder a step further.
fn lead_on(commands: &mut Commands, mode: Mode, chance: &mut Chance) {
    let next = match mode {
        Mode::Off => [command::ACKNOWLEDGE, command::PRESET_ACCEPT],
        Mode::Ready => [command::WEB_THREADED, command::THREAD],
        Mode::Thread => [command::RUN, command::THREAD | command::AUTOTUNE],
        Mode::Stall => [command::RUN, command::THREAD],
        _ => return,
    };
    let tuned = if mode == Mode::Thread { 2 } else { 0 };
    commands.set_word(&image::AUTOTUNE_LOOP, tuned);
    let word = next[chance.below(2) as usize];
    commands.set_word(&image::WINDER_COMMAND, word);
}

/// Somebody at the PLC who mostly does something sensible, and often enough anything.
fn meddle(commands: &mut Commands, chance: &mut Chance, beats: bool) {
    if beats {
        let beat = commands.word(&image::HEARTBEAT_PLC);
        commands.set_word(&image::HEARTBEAT_PLC, beat.wrapping_add(1));
    }
    let words = image::STW1;
    match chance.below(60) {
        0 | 1 => words
            .iter()
            .for_each(|word| commands.set_word(word, stw1::READY)),
        2..=6 => words
            .iter()
            .for_each(|word| commands.set_word(word, stw1::RUN)),
        7 => {
            let word = words[chance.below(4) as usize];
            commands.set_word(word, stw1::RUN ^ 1 << chance.below(11));
        }
        8 => {
            let word = words[chance.below(4) as usize];
            commands.set_word(word, chance.next() as u16);
        }
        9..=20 => {
            let bits = [
                command::THREAD,
                command::THREAD,
                command::STALL,
                command::RUN,
                command::RUN,
                command::PRESET_ACCEPT,
                command::PRESET_ACCEPT,
                command::WEB_THREADED,
                command::WEB_THREADED,
                command::JOG_FORWARD,
                command::JOG_BACKWARD,
                command::AUTOTUNE,
                command::ACKNOWLEDGE,
                command::WEB_REMOVED,
                command::NEW_PARENT_ROLL,
                0,
            ];
            let bits = bits[chance.below(16) as usize];
            commands.set_word(&image::WINDER_COMMAND, bits);
        }
        21 => commands.set_word(&image::WINDER_COMMAND, chance.next() as u16),
        22..=24 => {
            // any word at all, of those that only set something
            let settings = SIGNALS.iter().filter(|s| s.direction == Direction::Command);
            let settings: Vec<_> = settings
                .filter(|s| matches!(s.kind, Kind::U16 | Kind::I16 | Kind::Code(_)))
                .collect();
            let signal = settings[chance.below(settings.len() as u64) as usize];
            commands.set_word(signal, chance.next() as u16);
        }
        25 => {
            let signal = [
                &image::FAULT_MACHINE,
                &image::FAULT_SENSORS,
                &image::FAULT_DRIVES,
                &image::WINDER_COMMAND_2,
            ][chance.below(4) as usize];
            commands.set_word(signal, chance.next() as u16 & chance.next() as u16);
        }
        26..=40 => {
            for signal in [
                &image::FAULT_MACHINE,
                &image::FAULT_SENSORS,
                &image::FAULT_DRIVES,
                &image::FAULT_WEB_BREAK,
            ] {
                commands.set_word(signal, 0);
            }
        }
        _ => (),
    }
}

/// A machine that does what it is asked, now and then something else.
#[derive(Default)]
struct Caricature {
    m: Measurements<f32>,
    status: DriveStatus<f32>,
    /// Cycles for which the web is gone.
    gone: u64,
    /// Cycles for which the unwind turns as no roll on the web does.
    astray: u64,
}

impl Caricature {
    fn obey(&mut self, command: &DriveCommand<f32>, chance: &mut Chance) {
        let s = &mut self.status;
        let step = command.acceleration * 0.1;
        s.a_ref = (command.v_target - s.v_ref).clamp(-step, step);
        s.v_ref += s.a_ref;
        s.v = if command.drums { s.v_ref } else { 0.7 * s.v };
        s.v_uw = match command.unwind {
            UnwindControl::Off => 0.7 * s.v_uw,
            UnwindControl::Speed => s.v_ref,
            _ => s.v,
        };
        if chance.once_in(3000) {
            self.astray = 20;
        }
        if self.astray > 0 {
            self.astray -= 1;
            s.v_uw *= 0.5;
        }
        if s.v.abs() < 1e-3 {
            s.v = 0.0;
        }
        if s.v_uw.abs() < 1e-3 {
            s.v_uw = 0.0;
        }
        let pulls = matches!(
            command.unwind,
            UnwindControl::TakeUp | UnwindControl::Tension
        );
        s.tension_ref = command.tension;
        let tension = if pulls { command.tension } else { 0.0 };
        self.m.tension = tension * (1.0 + 0.05 * chance.noise());
        if chance.once_in(600) {
            self.gone = chance.below(150);
        }
        if self.gone > 0 {
            self.gone -= 1;
            self.m.tension = 0.0;
        }
        s.tension_at_once = self.m.tension;
        self.m.omega = BySection {
            uw: s.v_uw / 1.2,
            rd: s.v / 0.425,
            fd: s.v / 0.425,
            rr: s.v / 0.15,
        };
        let faults = &command.faults;
        if faults.sensors.encoder_rd {
            self.m.omega.rd = 0.0;
        }
        if faults.sensors.encoder_uw {
            self.m.omega.uw = 0.0;
        }
        let stuck = faults.machine.brakes;
        self.m.brakes = Brakes {
            uw: stuck.uw.acts_on(command.brakes.uw),
            rd: stuck.rd.acts_on(command.brakes.rd),
            fd: stuck.fd.acts_on(command.brakes.fd),
        };
    }
}

/// What is asked of the regulators never leaves the limits of its signals and of the machine.
fn check_limits(machine: &Machine, mode: Mode, c: &DriveCommand<f32>) {
    let width = machine.web.width_m as f32;
    let within = |x: f32, low: f32, high: f32| x >= low && x <= high;
    let top = machine.operation.max_speed_m_s as f32;
    assert!(within(c.v_target, -25.01 / 60.0, top), "{mode:?} {c:?}");
    assert!(within(c.acceleration, 0.05, 1.0), "{mode:?} {c:?}");
    assert!(within(c.jerk, 0.05, 2.0), "{mode:?} {c:?}");
    assert!(
        within(c.tension, 0.0, 2800.0_f32.max(1000.0 * width)),
        "{mode:?} {c:?}"
    );
    for limit in c.torque_limit.into_array() {
        assert!(within(limit, 0.0, 1.5), "{mode:?} {c:?}");
    }
    assert!(within(c.front_share_trim, -1.0, 1.0), "{mode:?} {c:?}");
    if let Some(r) = c.preset {
        let roll = &machine.parent_roll;
        let (low, high) = (0.9 * roll.spool_radius_m, 1.1 * roll.full_radius_m);
        assert!(within(r, low as f32 - 1e-4, high as f32 + 1e-4), "{c:?}");
    }
    // only a winder that is on turns, and only the maneuver turns back
    if matches!(mode, Mode::Off | Mode::CoastStop) {
        assert!(!c.drums && c.unwind == UnwindControl::Off, "{mode:?} {c:?}");
    }
    if mode == Mode::Off {
        assert_eq!(c.brakes, Brakes::all(true));
    }
    if mode == Mode::UnwindManeuver {
        assert!(!c.drums && c.brakes.rd && c.brakes.fd, "{c:?}");
    } else {
        assert!(c.v_target >= 0.0, "{mode:?} {c:?}");
    }
    if !matches!(
        mode,
        Mode::Thread | Mode::Run | Mode::UnwindManeuver | Mode::AutoTune
    ) {
        assert_eq!(c.v_target, 0.0, "{mode:?}");
    }
}

fn leads(from: Mode, to: Mode) -> bool {
    Cause::ALL
        .iter()
        .any(|cause| cause.outcome(from) == Outcome::Go(to))
}

#[test]
fn no_command_leads_beside_the_table_or_its_limits() {
    let cycles = std::env::var("WINDER_LOGIC_CYCLES");
    let cycles = cycles.map_or(CYCLES, |n| n.parse().expect("a number of cycles"));
    let machine = Machine::news_8000();
    let mut chance = Chance(0x9e37_79b9_7f4a_7c15);
    let mut logic = Logic::<f32>::new(&machine);
    logic.restarted();
    let mut commands = Commands::of(&machine);
    let mut feedback = Feedback::default();
    let mut it = Caricature::default();
    let modes = Mode::ALL.len();
    let mut seen = vec![vec![0_u64; modes]; modes];
    let mut refused = vec![0_u64; Refusal::ALL.len()];
    let mut faults = vec![0_u64; Fault::ALL.len()];
    // phases: a lively PLC for a while, then one that lets things happen
    let mut beats = true;
    for cycle in 0..cycles {
        if cycle % 4096 == 0 {
            commands = Commands::of(&machine);
        }
        if chance.once_in(3000) {
            beats = !beats;
        } else if !beats && chance.once_in(150) {
            beats = true;
        }
        if chance.once_in(if cycle / 2048 % 2 == 0 { 4 } else { 100 }) {
            meddle(&mut commands, &mut chance, beats);
        } else if beats {
            let beat = commands.word(&image::HEARTBEAT_PLC);
            commands.set_word(&image::HEARTBEAT_PLC, beat.wrapping_add(1));
        }
        if cycle % 8192 < 1100 {
            // a motor that stays hot
            let hot = inject::HOT_UW << (cycle / 8192 % 4);
            let word = commands.word(&image::FAULT_DRIVES);
            commands.set_word(&image::FAULT_DRIVES, word | hot);
        }
        let before = logic.mode();
        if chance.once_in(40) {
            lead_on(&mut commands, before, &mut chance);
        }
        let asked = logic.step(&commands, &it.m, &it.status, &mut feedback);
        let now = logic.mode();
        if now != before {
            assert!(leads(before, now), "cycle {cycle}: {before:?} to {now:?}");
        }
        seen[before as usize][now as usize] += 1;
        refused[usize::from(feedback.word(&image::REFUSAL))] += 1;
        faults[usize::from(feedback.word(&image::FAULT))] += 1;
        check_limits(&machine, now, &asked);
        it.obey(&asked, &mut chance);
    }
    // the test has been everywhere
    for &from in Mode::ALL {
        assert!(
            seen[from as usize].iter().sum::<u64>() > 0,
            "never in {from:?}"
        );
    }
    let ways = |seen: &[Vec<u64>]| -> Vec<(Mode, Mode)> {
        let all = Mode::ALL.iter();
        all.flat_map(|&a| Mode::ALL.iter().map(move |&b| (a, b)))
            .filter(|&(a, b)| a != b && leads(a, b) && seen[a as usize][b as usize] == 0)
            .collect()
    };
    let missed = ways(&seen);
    assert!(missed.len() <= 6, "never gone: {missed:?}");
    let unseen: Vec<_> = Refusal::ALL
        .iter()
        .filter(|refusal| refused[**refusal as usize] == 0)
        .collect();
    assert!(unseen.is_empty(), "never refused: {unseen:?}");
    let unseen: Vec<_> = Fault::ALL
        .iter()
        .filter(|fault| faults[**fault as usize] == 0)
        .collect();
    assert!(unseen.is_empty(), "never at fault: {unseen:?}");
}

/// The simulator itself under any commands: references, torques and speeds within their limits.
#[test]
fn the_simulator_stays_within_its_limits_whatever_is_commanded() {
    let mut chance = Chance(0x2545_f491_4f6c_dd1d);
    let cases = 12;
    for case in 0..cases {
        let mut o = Operator::<f32>::new();
        let machine = o.machine.clone();
        let mut commands = o.image.commands;
        let mut last = Mode::Off;
        for cycle in 0..6000 {
            if chance.once_in(if cycle < 500 { 5 } else { 60 }) {
                meddle(&mut commands, &mut chance, false);
            }
            let beat = o.image.commands.word(&image::HEARTBEAT_PLC);
            o.image.commands = commands;
            o.image.commands.set_word(&image::HEARTBEAT_PLC, beat);
            o.cycle();
            let mode = o.simulator.logic.mode();
            assert!(mode == last || leads(last, mode), "{last:?} to {mode:?}");
            last = mode;
            let s = o.simulator.status();
            let what = || format!("case {case}, cycle {cycle}, {mode:?}: {s:?}");
            let motors = &machine.motors;
            let rated = [&motors.uw, &motors.rd, &motors.fd, &motors.rr];
            for (torque, motor) in s.torque.into_array().into_iter().zip(rated) {
                let most = 1.5 * motor.torque_n_m as f32;
                assert!(torque.abs() <= most * 1.000_001, "{}", what());
            }
            let powers = [&image::POWER_UW, &image::POWER_RD, &image::POWER_FD];
            for (power, motor) in powers.into_iter().zip(rated) {
                let most = 1.5e-3 * motor.power_w;
                assert!(o.value(power).abs() <= most * 1.001, "{}", what());
            }
            assert!(
                s.tension_ref >= -1e-3 && s.tension_ref <= 8001.0,
                "{}",
                what()
            );
            assert!(s.v_ref.is_finite() && s.v.is_finite(), "{}", what());
            if s.a_ref != 0.0 {
                assert!(s.a_ref.abs() <= 1.0 + 1e-4, "{}", what());
            }
        }
    }
}
