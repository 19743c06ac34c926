//! The pulses of an encoder, true in frequency, direction and number.
//!
//! Not here: what they shall be, which is the library's [`firmware::wired::Encoder`].
//!
//! A 32-bit timer, two channels of which toggle once a period, and a timer of 16 bits that counts its periods. Source:
//! RM0433 rev. 8, sections 40 (general-purpose timers) and 39.3.29 (internal triggers).

use embassy_stm32::Peri;
use embassy_stm32::timer::low_level::{
    MasterMode, OutputCompareMode, SlaveMode, Timer, TriggerSource,
};
use embassy_stm32::timer::{Channel, GeneralInstance4Channel};
use firmware::wired::{Leads, Seen, Setting};

use crate::wires::Pulses;

/// A timer that makes pulses, and the one that counts its periods.
pub struct Train<T: GeneralInstance4Channel<Word = u32>, C: GeneralInstance4Channel<Word = u16>> {
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
    /// Standing still. The counter's internal trigger is the timer's update; the channels are A's and B's.
    pub fn new(
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

impl<T, C> Pulses for Train<T, C>
where
    T: GeneralInstance4Channel<Word = u32>,
    C: GeneralInstance4Channel<Word = u16>,
{
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
}
