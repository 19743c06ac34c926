//! The hard-wired signals: two encoders, the load cells' amplifier, relays and switches.
//!
//! Not here: what they show, which is the library's; which timers and pins they are, which is the board's.

use embassy_stm32::dac::{DacChannel, Value};
use embassy_stm32::gpio::{Input, Output};
use embassy_stm32::mode::Blocking;
use embassy_time::{Duration, Instant, Timer};
use firmware::tasks::Exchange;
use firmware::wired::{Analog, Angle, Encoder, Inputs, Outputs, Seen, Setting};
use model_core::exchange::Measurements;
use model_core::machine::Machine;
use model_core::plant::PLANT_PERIOD_MS;
use model_core::real::Scalar;

/// Largest code of the converter, 12 bits.
const DAC_FULL: u16 = 4095;

/// What makes the pulses of an encoder.
pub trait Pulses {
    /// How it stands.
    fn seen(&self) -> Seen;
    /// What it does from the next period on.
    fn set(&self, setting: Setting);
}

/// What the wires take of a board.
pub struct Ends<RD: Pulses, UW: Pulses> {
    /// Encoder of the rear drum.
    pub rd: RD,
    /// Encoder of the unwind.
    pub uw: UW,
    /// Clock of both, Hz.
    pub pulses_hz: f32,
    /// Load cells.
    pub dac: DacChannel<'static, Blocking>,
    /// Low: the switches are wired.
    pub wired: Input<'static>,
    /// Emergency-stop circuit, run permit, drum brakes.
    pub switches: [Input<'static>; 3],
    /// High: faults are acknowledged.
    pub button: Input<'static>,
    /// Web whole, brakes of unwind, rear and front drum, fault.
    pub relays: [Output<'static>; 5],
}

/// All wires of the winder.
pub struct Wires<RD: Pulses, UW: Pulses> {
    ends: Ends<RD, UW>,
    encoders: [Encoder; 2],
    angle: Angle,
    load_cells: Analog,
}

impl<RD: Pulses, UW: Pulses> Wires<RD, UW> {
    /// Of a machine whose rolls stand still.
    pub fn new(machine: &Machine, ends: Ends<RD, UW>) -> Self {
        let interval = 1e-3 * PLANT_PERIOD_MS as f32;
        let [pulses_rd, pulses_uw] =
            [machine.encoder_pulses, machine.encoder_pulses_uw].map(|pulses| pulses as f32);
        Self {
            encoders: [pulses_rd, pulses_uw]
                .map(|pulses| Encoder::new(pulses, ends.pulses_hz, interval)),
            angle: Angle::new(pulses_uw, interval),
            load_cells: Analog::new(machine.load_cells.full_scale_n as f32, DAC_FULL),
            ends,
        }
    }

    /// Shows what was measured.
    fn show(&mut self, measurements: &Measurements<f32>) {
        let omega = &measurements.omega;
        let [rd, uw] = &mut self.encoders;
        let ends = &mut self.ends;
        ends.rd
            .set(rd.set(measurements.pulses_rd, omega.rd, ends.rd.seen()));
        let angle = self.angle.count(omega.uw);
        ends.uw.set(uw.set(angle, omega.uw, ends.uw.seen()));
        let code = self.load_cells.code(measurements.tension);
        ends.dac.set(Value::Bit12Right(code));
    }

    /// Shows what the drive system tells.
    fn relays(&mut self, outputs: &Outputs) {
        let brakes = &outputs.brakes;
        let levels = [
            outputs.web_whole,
            brakes.uw,
            brakes.rd,
            brakes.fd,
            outputs.fault,
        ];
        for (relay, level) in self.ends.relays.iter_mut().zip(levels) {
            relay.set_level(level.into());
        }
    }

    /// What stands at the switches.
    fn inputs(&self) -> Inputs {
        let bare = Inputs {
            acknowledge: self.ends.button.is_high(),
            ..Inputs::default()
        };
        if self.ends.wired.is_high() {
            return bare;
        }
        let [emergency_stop_closed, run_permit, drum_brakes] =
            self.ends.switches.each_ref().map(Input::is_high);
        Inputs {
            emergency_stop_closed,
            run_permit,
            drum_brakes,
            ..bare
        }
    }

    /// Every 4 ms, after the plant.
    pub async fn run<R>(mut self, start: Instant, exchange: &Exchange<R>) -> !
    where
        R: Scalar<Si = f32>,
    {
        let period = Duration::from_millis(PLANT_PERIOD_MS.into());
        let mut due = start;
        loop {
            due += period;
            Timer::at(due).await;
            self.show(&exchange.measurements());
            self.relays(&exchange.outputs());
            exchange.set_inputs(self.inputs());
        }
    }
}
