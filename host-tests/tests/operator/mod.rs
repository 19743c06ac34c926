//! An operator with a small PLC, in lockstep with the simulator: sets commands, runs cycles, looks.
//!
//! Not here: a link, a clock, a program. A test says what to do and for how long.
// every test program uses its part of it
#![allow(dead_code)]

use model_core::drive::DRIVE_PERIOD_MS;
use model_core::image::{self, Commands, Feedback, Image, Signal};
use model_core::logic::{Fault, Mode, Refusal, command, status};
use model_core::machine::Machine;
use model_core::plant::rk4::State;
use model_core::profidrive::stw1;
use model_core::real::Float;
use model_core::simulator::Simulator;

/// A drive cycle, s.
pub const CYCLE: f64 = 1e-3 * DRIVE_PERIOD_MS as f64;

/// The operator at the simulator.
#[derive(Clone)]
pub struct Operator<R: Float> {
    pub simulator: Simulator<R, 3>,
    pub image: Image,
    pub machine: Machine,
    /// The PLC's heartbeat stands still.
    pub silent: bool,
    /// Drive cycles since power-up.
    pub cycles: u32,
    /// The commands of every cycle, where they are kept.
    pub log: Option<Vec<Commands>>,
}

impl<R: Float> Operator<R> {
    /// At power-up.
    pub fn new() -> Self {
        Self::at(Machine::news_8000())
    }

    /// At power-up of a machine.
    pub fn at(machine: Machine) -> Self {
        Self {
            simulator: Simulator::new(&machine).unwrap(),
            image: Image {
                commands: Commands::of(&machine),
                feedback: Feedback::default(),
            },
            machine,
            silent: false,
            cycles: 0,
            log: None,
        }
    }

    /// One drive cycle.
    pub fn cycle(&mut self) {
        if !self.silent {
            let beat = self.image.commands.word(&image::HEARTBEAT_PLC);
            self.image
                .commands
                .set_word(&image::HEARTBEAT_PLC, beat.wrapping_add(1));
        }
        if let Some(log) = &mut self.log {
            log.push(self.image.commands);
        }
        self.simulator.drive_cycle(&mut self.image);
        self.cycles += 1;
    }

    /// Waits, s.
    pub fn wait(&mut self, seconds: f64) {
        self.wait_with(seconds, |_| ());
    }

    /// Waits, s, with an eye on something in every cycle.
    pub fn wait_with(&mut self, seconds: f64, mut look: impl FnMut(&Self)) {
        for _ in 0..(seconds / CYCLE).round() as u32 {
            self.cycle();
            look(self);
        }
    }

    /// Waits until something is so; gives the time it took, s. Fails after `limit` seconds.
    #[track_caller]
    pub fn until(&mut self, limit: f64, mut done: impl FnMut(&Self) -> bool) -> f64 {
        let start = self.cycles;
        loop {
            self.cycle();
            let time = CYCLE * f64::from(self.cycles - start);
            if done(self) {
                return time;
            }
            assert!(time < limit, "still {:?} after {time} s", self.mode());
        }
    }

    /// Sets the winder's command word.
    pub fn command(&mut self, bits: u16) {
        self.image.commands.set_word(&image::WINDER_COMMAND, bits);
    }

    /// Sets a command for a moment, as a push-button does.
    pub fn press(&mut self, bits: u16) {
        self.command(bits);
        self.wait(0.1);
        self.command(0);
        self.wait(0.1);
    }

    /// Sets control word 1 of all drives.
    pub fn drives(&mut self, word: u16) {
        for signal in image::STW1 {
            self.image.commands.set_word(signal, word);
        }
    }

    /// Sets a set-point in its unit.
    pub fn set(&mut self, signal: &Signal, value: f64) {
        self.image.commands.set(signal, value);
    }

    /// Preset, web, drives on: what comes before thread.
    pub fn prepare(&mut self) {
        self.press(command::PRESET_ACCEPT);
        self.press(command::WEB_THREADED);
        self.switch_on();
    }

    /// The start sequence, 047E and 047F hex.
    pub fn switch_on(&mut self) {
        self.drives(stw1::READY);
        self.wait(0.1);
        self.drives(stw1::RUN);
        self.until(1.0, |o| o.mode() == Mode::Ready);
    }

    /// From power-up to a tight web at thread speed.
    pub fn thread(&mut self) {
        self.prepare();
        self.command(command::THREAD);
        self.until(60.0, |o| o.is(status::TENSION_DETECTED));
    }

    /// From thread to run speed.
    pub fn run_up(&mut self) {
        self.command(command::RUN);
        self.until(200.0, |o| o.is(status::AT_SPEED));
    }

    /// The value of a feedback signal in its unit.
    pub fn value(&self, signal: &Signal) -> f64 {
        self.image.feedback.get(signal)
    }

    pub fn is(&self, bits: u16) -> bool {
        self.image.feedback.word(&image::WINDER_STATUS) & bits == bits
    }

    pub fn mode(&self) -> Mode {
        Mode::ALL[usize::from(self.image.feedback.word(&image::MODE))]
    }

    pub fn refusal(&self) -> Refusal {
        Refusal::ALL[usize::from(self.image.feedback.word(&image::REFUSAL))]
    }

    pub fn fault(&self) -> Fault {
        Fault::ALL[usize::from(self.image.feedback.word(&image::FAULT))]
    }

    /// Ground truth: the plant's state.
    pub fn x(&self) -> State<f64, 3> {
        self.simulator.plant.winder().state().map(R::to_f64)
    }

    /// Ground truth: tensions, N.
    pub fn t(&self) -> [f64; 3] {
        self.simulator.plant.winder().tension().map(R::to_f64)
    }
}
