//! PLCs that run on the simulator's clock.
//!
//! Not here: PLCs that are wired to it. Those have clocks of their own.

use std::sync::Arc;

use anyhow::{Context, Result, bail};
use model_core::drive::DRIVE_PERIOD_MS;
use model_core::image::{Commands, Direction, Image, Kind, SIGNALS, Signal};

use crate::plc::{CYCLE_S, Plc, Step};
use crate::st::parse::Block;
use crate::st::{Program, Runner, Type, Value, Variable};

/// The reference program, as it ships.
pub const REFERENCE: &str = include_str!("../../plc/winder.st");

/// A winder PLC.
pub trait Controller {
    /// Its cycle, in drive cycles.
    fn period(&self) -> u64;
    /// One cycle: what stands in the image, and the commands that it writes.
    fn cycle(&mut self, image: &Image, commands: &mut Commands);
    /// Why it has stopped, if it has.
    fn stopped(&self) -> Option<String> {
        None
    }
}

/// Cycle of a program in Structured Text, drive cycles.
const ST_PERIOD: u64 = 2;

/// A program in Structured Text. Its inputs are feedback and the desk's words, its outputs are commands, each by its
/// name in the signal list.
#[derive(Clone)]
pub struct StPlc {
    runner: Runner,
    inputs: Arc<Vec<(Variable, &'static Signal)>>,
    outputs: Arc<Vec<(Variable, &'static Signal)>>,
    stopped: Option<String>,
}

impl StPlc {
    /// Compiles a text and binds its variables; the error says line and reason.
    pub fn new(text: &str) -> Result<Self> {
        let program = Arc::new(Program::new(text)?);
        let (mut inputs, mut outputs) = (Vec::new(), Vec::new());
        for variable in program.variables() {
            let (list, written) = match variable.block {
                Block::Input => (&mut inputs, false),
                Block::Output => (&mut outputs, true),
                Block::Local | Block::Constant => continue,
            };
            let signal = SIGNALS.iter().find(|s| s.name == variable.name);
            let signal = signal.with_context(|| {
                let name = &variable.name;
                format!("{name} is no signal: inputs and outputs have the names of `cargo winder signals`")
            })?;
            if written && signal.direction == Direction::Feedback {
                bail!(
                    "{} is feedback, and the program has it as an output",
                    signal.name
                );
            }
            if !fits(variable.of, signal.kind) {
                let (name, of) = (signal.name, variable.of.name());
                bail!("{name} is {:?} and does not fit a {of}", signal.kind);
            }
            list.push((variable.clone(), signal));
        }
        Ok(Self {
            runner: Runner::new(program),
            inputs: Arc::new(inputs),
            outputs: Arc::new(outputs),
            stopped: None,
        })
    }
}

fn fits(of: Type, kind: Kind) -> bool {
    match kind {
        Kind::I16 => of == Type::Int,
        Kind::U32 => matches!(of, Type::Udint | Type::Dword),
        Kind::Bits(_) => of == Type::Word,
        Kind::U16 | Kind::Code(_) => matches!(of, Type::Uint | Type::Word),
    }
}

impl Controller for StPlc {
    fn period(&self) -> u64 {
        ST_PERIOD
    }

    fn cycle(&mut self, image: &Image, commands: &mut Commands) {
        if self.stopped.is_some() {
            return;
        }
        for (variable, signal) in self.inputs.iter() {
            let raw = match (signal.direction, signal.kind) {
                (Direction::Feedback, Kind::U32) => i64::from(image.feedback.double(signal)),
                (Direction::Command, Kind::U32) => i64::from(image.commands.double(signal)),
                // its bits: the runner cuts them to the width and the sign
                (Direction::Feedback, _) => i64::from(image.feedback.word(signal)),
                (Direction::Command, _) => i64::from(image.commands.word(signal)),
            };
            self.runner.set(variable, Value::Int(raw));
        }
        if let Err(error) = self.runner.cycle(ST_PERIOD as u32 * DRIVE_PERIOD_MS) {
            self.stopped = Some(error.to_string());
            return;
        }
        for (variable, signal) in self.outputs.iter() {
            let raw = self.runner.get(variable).integer();
            match signal.kind {
                Kind::U32 => commands.set_double(signal, raw as u32),
                _ => commands.set_word(signal, raw as u16),
            }
        }
    }

    fn stopped(&self) -> Option<String> {
        self.stopped.clone()
    }
}

/// The demo's PLC, which winds one set by itself and asks no operator.
#[derive(Clone)]
pub struct DemoPlc {
    plc: Plc,
    stopped: Option<String>,
}

impl DemoPlc {
    /// With a set to wind.
    pub fn new(plc: Plc) -> Self {
        Self { plc, stopped: None }
    }
}

impl Controller for DemoPlc {
    fn period(&self) -> u64 {
        (CYCLE_S * 1e3) as u64 / u64::from(DRIVE_PERIOD_MS)
    }

    fn cycle(&mut self, image: &Image, commands: &mut Commands) {
        if self.stopped.is_some() {
            return;
        }
        if let Err(trouble) = self.plc.cycle(&image.feedback) {
            self.stopped = Some(trouble.to_string());
        } else if self.plc.step() == Step::Done {
            self.stopped = Some("its set is wound".into());
        }
        *commands = *self.plc.commands();
    }

    fn stopped(&self) -> Option<String> {
        self.stopped.clone()
    }
}

/// A PLC that writes nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Controller for Silent {
    fn period(&self) -> u64 {
        ST_PERIOD
    }

    fn cycle(&mut self, _image: &Image, _commands: &mut Commands) {}
}

/// A PLC that writes whatever comes to it.
#[derive(Clone, Copy, Debug)]
pub struct Garbage(pub u64);

impl Controller for Garbage {
    fn period(&self) -> u64 {
        ST_PERIOD
    }

    fn cycle(&mut self, _image: &Image, commands: &mut Commands) {
        for word in &mut commands.words {
            // Source: D. Knuth, MMIX's linear congruential generator
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005);
            self.0 = self.0.wrapping_add(1_442_695_040_888_963_407);
            *word = (self.0 >> 48) as u16;
        }
    }
}

/// A PLC that stops after so many of its cycles.
#[derive(Clone)]
pub struct Stopping<C> {
    /// What it is until then.
    pub plc: C,
    /// Cycles that are left.
    pub left: u64,
}

impl<C: Controller> Controller for Stopping<C> {
    fn period(&self) -> u64 {
        self.plc.period()
    }

    fn cycle(&mut self, image: &Image, commands: &mut Commands) {
        if self.left > 0 {
            self.left -= 1;
            self.plc.cycle(image, commands);
        }
    }

    fn stopped(&self) -> Option<String> {
        let own = (self.left == 0).then(|| "it has been stopped".to_owned());
        self.plc.stopped().or(own)
    }
}
