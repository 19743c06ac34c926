//! The hard-wired signals: two encoders, the load cells' amplifier, relays and switches.
//!
//! Not here: what they show, which is the library's. Pins are in `docs/board.md`.
//!
//! An encoder is a 32-bit timer whose two channels toggle once a period, and a timer of 16 bits that counts its
//! periods. Source: RM0433 rev. 8, sections 40 (general-purpose timers) and 39.3.29 (internal triggers).

use embassy_stm32::Peri;
use embassy_stm32::dac::{DacChannel, Value};
use embassy_stm32::gpio::{AnyPin, Input, Level, Output, OutputType, Pull, Speed};
use embassy_stm32::mode::Blocking;
use embassy_stm32::peripherals::{DAC1, PA0, PA3, PA4, PB10, PB11, TIM1, TIM2, TIM5, TIM8};
use embassy_stm32::timer::low_level::{
    MasterMode, OutputCompareMode, SlaveMode, Timer, TriggerSource,
};
use embassy_stm32::timer::simple_pwm::PwmPin;
use embassy_stm32::timer::{Ch1, Ch3, Ch4, Channel, GeneralInstance4Channel};
use embassy_time::{Duration, Instant, Timer as Delay};
use firmware::wired::{Analog, Angle, Encoder, Inputs, Leads, Outputs, Seen, Setting};
use model_core::exchange::Measurements;
use model_core::machine::Machine;
use model_core::plant::PLANT_PERIOD_MS;

use crate::clock::TIMERS_HZ;
use crate::simulator::Exchange;

/// Largest code of the converter, 12 bits.
const DAC_FULL: u16 = 4095;

/// A timer that makes pulses, and the one that counts its periods.
struct Train<T: GeneralInstance4Channel<Word = u32>, C: GeneralInstance4Channel<Word = u16>> {
    timer: Timer<'static, T>,
    counter: Timer<'static, C>,
    a: Channel,
    b: Channel,
}

impl<T, C> Train<T, C>
where
    T: GeneralInstance4Channel<Word = u32>,
    C: GeneralInstance4Channel<Word = u16>,
{
    fn new(
        timer: Peri<'static, T>,
        counter: Peri<'static, C>,
        source: TriggerSource,
        [a, b]: [Channel; 2],
    ) -> Self {
        let (timer, counter) = (Timer::new(timer), Timer::new(counter));
        counter.set_trigger_source(source);
        counter.set_slave_mode(SlaveMode::EXT_CLOCK_MODE);
        counter.start();
        timer.set_master_mode(MasterMode::UPDATE);
        for channel in [a, b] {
            timer.set_output_compare_mode(channel, OutputCompareMode::Toggle);
            timer.enable_channel(channel, true);
        }
        Self {
            timer,
            counter,
            a,
            b,
        }
    }

    fn seen(&self) -> Seen {
        Seen {
            periods: self.counter.regs_core().cnt().read().cnt(),
            running: self.timer.regs_core().cr1().read().cen(),
        }
    }

    fn set(&self, setting: Setting) {
        let control = self.timer.regs_core().cr1();
        let Setting::Turn { ticks, leads } = setting else {
            // ends with the running period
            control.modify(|r| r.set_opm(true));
            return;
        };
        self.load(ticks, leads, true);
        control.modify(|r| r.set_opm(false));
        if !control.read().cen() {
            // An update event would load the registers, but count as a period.
            self.load(ticks, leads, false);
            self.timer.reset();
            control.modify(|r| r.set_cen(true));
        }
    }

    /// Sets period and edges; preloaded, they count from the next period on.
    fn load(&self, ticks: u32, leads: Leads, preload: bool) {
        let (first, second) = match leads {
            Leads::A => (self.a, self.b),
            Leads::B => (self.b, self.a),
        };
        let timer = &self.timer;
        timer.set_autoreload_preload(preload);
        for (channel, at) in [(first, ticks / 4), (second, ticks / 4 * 3)] {
            timer.set_output_compare_preload(channel, preload);
            timer.set_compare_value(channel, at);
        }
        timer.set_max_compare_value(ticks - 1);
    }
}

/// All wires of the winder.
pub struct Wires {
    rd: Train<TIM2, TIM1>,
    uw: Train<TIM5, TIM8>,
    encoders: [Encoder; 2],
    angle: Angle,
    dac: DacChannel<'static, Blocking>,
    load_cells: Analog,
    wired: Input<'static>,
    switches: [Input<'static>; 3],
    button: Input<'static>,
    relays: [Output<'static>; 5],
}

/// What the wires take of the chip.
pub struct Resources {
    /// Rear drum: timer, its counter, A, B.
    pub rd: (
        Peri<'static, TIM2>,
        Peri<'static, TIM1>,
        Peri<'static, PB10>,
        Peri<'static, PB11>,
    ),
    /// Unwind, likewise.
    pub uw: (
        Peri<'static, TIM5>,
        Peri<'static, TIM8>,
        Peri<'static, PA0>,
        Peri<'static, PA3>,
    ),
    /// Load cells.
    pub dac: (Peri<'static, DAC1>, Peri<'static, PA4>),
    /// To ground: the switches are wired.
    pub wired: Peri<'static, AnyPin>,
    /// Emergency-stop circuit, run permit, drum brakes.
    pub switches: [Peri<'static, AnyPin>; 3],
    /// The board's blue button.
    pub button: Input<'static>,
    /// Web whole, brakes of unwind, rear and front drum, fault.
    pub relays: [Peri<'static, AnyPin>; 5],
}

impl Wires {
    /// Takes the pins; the rolls stand still.
    pub fn new(machine: &Machine, r: Resources) -> Self {
        let interval = 1e-3 * PLANT_PERIOD_MS as f32;
        let [pulses_rd, pulses_uw] =
            [machine.encoder_pulses, machine.encoder_pulses_uw].map(|pulses| pulses as f32);
        let (rd, rd_counter, rd_a, rd_b) = r.rd;
        let (uw, uw_counter, uw_a, uw_b) = r.uw;
        // Each pin stays its timer's for good.
        PwmPin::<TIM2, Ch3>::new(rd_a, OutputType::PushPull);
        PwmPin::<TIM2, Ch4>::new(rd_b, OutputType::PushPull);
        PwmPin::<TIM5, Ch1>::new(uw_a, OutputType::PushPull);
        PwmPin::<TIM5, Ch4>::new(uw_b, OutputType::PushPull);
        Self {
            rd: Train::new(
                rd,
                rd_counter,
                TriggerSource::ITR1,
                [Channel::Ch3, Channel::Ch4],
            ),
            uw: Train::new(
                uw,
                uw_counter,
                TriggerSource::ITR3,
                [Channel::Ch1, Channel::Ch4],
            ),
            encoders: [pulses_rd, pulses_uw]
                .map(|pulses| Encoder::new(pulses, TIMERS_HZ, interval)),
            angle: Angle::new(pulses_uw, interval),
            dac: DacChannel::new_blocking(r.dac.0, r.dac.1),
            load_cells: Analog::new(machine.load_cells.full_scale_n as f32, DAC_FULL),
            wired: Input::new(r.wired, Pull::Up),
            switches: r.switches.map(|pin| Input::new(pin, Pull::Down)),
            button: r.button,
            relays: r.relays.map(|pin| Output::new(pin, Level::Low, Speed::Low)),
        }
    }

    /// Shows what was measured.
    fn show(&mut self, measurements: &Measurements<f32>) {
        let omega = &measurements.omega;
        let [rd, uw] = &mut self.encoders;
        let setting = rd.set(measurements.pulses_rd, omega.rd, self.rd.seen());
        self.rd.set(setting);
        let setting = uw.set(self.angle.count(omega.uw), omega.uw, self.uw.seen());
        self.uw.set(setting);
        self.dac.set(Value::Bit12Right(
            self.load_cells.code(measurements.tension),
        ));
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
        for (relay, level) in self.relays.iter_mut().zip(levels) {
            relay.set_level(level.into());
        }
    }

    /// What stands at the switches.
    fn inputs(&self) -> Inputs {
        let bare = Inputs {
            acknowledge: self.button.is_high(),
            ..Inputs::default()
        };
        if self.wired.is_high() {
            return bare;
        }
        let [emergency_stop_closed, run_permit, drum_brakes] =
            self.switches.each_ref().map(Input::is_high);
        Inputs {
            emergency_stop_closed,
            run_permit,
            drum_brakes,
            ..bare
        }
    }
}

/// Every 4 ms, after the plant.
#[embassy_executor::task]
pub async fn run(start: Instant, mut wires: Wires, exchange: &'static Exchange) -> ! {
    let period = Duration::from_millis(PLANT_PERIOD_MS.into());
    let mut due = start;
    loop {
        due += period;
        Delay::at(due).await;
        wires.show(&exchange.measurements());
        wires.relays(&exchange.outputs());
        exchange.set_inputs(wires.inputs());
    }
}
