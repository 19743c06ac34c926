//! Timers and pins of the hard-wired signals; the wiring table is in `docs/board.md`.

use board_stm32::pulses::Train;
use board_stm32::wires::{self, Ends};
use embassy_stm32::Peri;
use embassy_stm32::dac::DacChannel;
use embassy_stm32::gpio::{AnyPin, Input, Level, Output, OutputType, Pull, Speed};
use embassy_stm32::peripherals::{DAC1, PA0, PA3, PA4, PB10, PB11, TIM1, TIM2, TIM5, TIM8};
use embassy_stm32::timer::low_level::TriggerSource;
use embassy_stm32::timer::simple_pwm::PwmPin;
use embassy_stm32::timer::{Ch1, Ch3, Ch4, Channel};
use model_core::machine::Machine;

use crate::clock::TIMERS_HZ;

/// All wires of the winder.
pub type Wires = wires::Wires<Train<TIM2, TIM1>, Train<TIM5, TIM8>>;

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

/// Takes the pins; the rolls stand still.
pub fn new(machine: &Machine, r: Resources) -> Wires {
    // RM0433 rev. 8, section 39.3.29: TIM1's internal trigger 1 is TIM2, TIM8's internal trigger 3 is TIM5.
    const RD_PERIODS: TriggerSource = TriggerSource::ITR1;
    const UW_PERIODS: TriggerSource = TriggerSource::ITR3;

    let (rd, rd_counter, rd_a, rd_b) = r.rd;
    let (uw, uw_counter, uw_a, uw_b) = r.uw;
    // Each pin stays its timer's for good.
    PwmPin::<TIM2, Ch3>::new(rd_a, OutputType::PushPull);
    PwmPin::<TIM2, Ch4>::new(rd_b, OutputType::PushPull);
    PwmPin::<TIM5, Ch1>::new(uw_a, OutputType::PushPull);
    PwmPin::<TIM5, Ch4>::new(uw_b, OutputType::PushPull);
    let ends = Ends {
        rd: Train::new(rd, rd_counter, RD_PERIODS, [Channel::Ch3, Channel::Ch4]),
        uw: Train::new(uw, uw_counter, UW_PERIODS, [Channel::Ch1, Channel::Ch4]),
        pulses_hz: TIMERS_HZ,
        dac: DacChannel::new_blocking(r.dac.0, r.dac.1),
        wired: Input::new(r.wired, Pull::Up),
        switches: r.switches.map(|pin| Input::new(pin, Pull::Down)),
        button: r.button,
        relays: r.relays.map(|pin| Output::new(pin, Level::Low, Speed::Low)),
    };
    Wires::new(machine, ends)
}
