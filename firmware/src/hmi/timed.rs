//! Faults that end by themselves, after a time of the simulator's own.
//!
//! Not here: what a fault does. Whether anybody looks on makes no difference: the simulator counts, not the page.

use heapless::Vec;
use model_core::drive::DRIVE_PERIOD_MS;
use model_core::image::{self, Commands, Kind, Signal};

use super::answer::{Detail, Refusal};
use super::desk::Setting;

/// Most at once.
const MOST: usize = 32;
/// Shortest and longest time of a fault, s.
const TIMES_S: (f64, f64) = (0.01, 3600.0);

/// A fault that has been put in for a time.
#[derive(Clone, Copy, Debug)]
pub struct Fault {
    setting: Setting,
    /// What takes its place.
    sound: u16,
    /// The drive cycle in which it is out.
    out: u32,
}

impl Fault {
    /// The word's name, and that of the bit where it is one.
    pub fn name(&self) -> (&'static str, Option<&'static str>) {
        let Setting { signal, mask, .. } = self.setting;
        let bit = match signal.kind {
            Kind::Bits(bits) => bits.iter().find(|bit| 1 << bit.number == mask),
            _ => None,
        };
        (signal.name, bit.map(|bit| bit.name))
    }

    /// Drive cycles until it is out.
    pub fn left(&self, cycle: u32) -> u32 {
        self.out.wrapping_sub(cycle)
    }
}

/// All of them.
#[derive(Clone, Debug, Default)]
pub struct Timed {
    faults: Vec<Fault, MOST>,
}

/// The words that can be put in for a time: the faults, which stand in a row, and the bus's delay after them.
fn is_fault(signal: &Signal) -> bool {
    (image::FAULT_MACHINE.word..=image::BUS_DELAY.word).contains(&signal.word)
}

impl Timed {
    /// A time of a request, in drive cycles.
    ///
    /// # Errors
    /// With the time that cannot be, or what cannot be put in for a time.
    pub fn cycles(&self, for_s: f64, settings: &[Setting]) -> Result<u32, Refusal> {
        let mut refusal = Refusal::new(422, format_args!("this cannot be put in for a time"));
        let (low, high) = TIMES_S;
        if !(low..=high).contains(&for_s) {
            refusal.add(Detail {
                limits: Some(TIMES_S),
                unit: "s",
                ..Detail::number("for_s", for_s, "outside its limits")
            });
        }
        for setting in settings.iter().filter(|s| !is_fault(s.signal)) {
            refusal.add(Detail::new(setting.signal.name, setting.word, "no fault"));
        }
        let others = self
            .faults
            .iter()
            .filter(|f| !settings.iter().any(|s| same(&f.setting, s)));
        if others.count() + settings.len() > MOST {
            refusal.add(Detail::new(
                "for_s",
                settings.len(),
                "too many faults for a time",
            ));
        }
        match refusal.details.is_empty() {
            true => Ok((for_s * 1e3 / f64::from(DRIVE_PERIOD_MS) + 0.5) as u32),
            false => Err(refusal),
        }
    }

    /// Something is commanded: until further notice, or until a drive cycle, in which what is sound takes its place.
    pub fn put(&mut self, setting: Setting, sound: &Commands, out: Option<u32>) {
        self.faults.retain(|fault| !same(&fault.setting, &setting));
        let Some(out) = out else {
            return;
        };
        let sound = sound.word(setting.signal) & setting.mask;
        // There is room: it has been looked for.
        let _ = self.faults.push(Fault {
            setting,
            sound,
            out,
        });
    }

    /// Before a drive cycle: takes out what is due, but for what somebody has changed meanwhile.
    pub fn before(&mut self, cycle: u32, commands: &mut Commands, mut taken: impl FnMut(&Fault)) {
        self.faults.retain(|fault| {
            let Setting { signal, mask, word } = fault.setting;
            let now = commands.word(signal);
            let stands = now & mask == word & mask;
            let due = fault.left(cycle) == 0;
            if due && stands {
                commands.set_word(signal, now & !mask | fault.sound);
                taken(fault);
            }
            stands && !due
        });
    }

    /// The simulator goes on from a state that is so many drive cycles old.
    pub fn shift(&mut self, cycles: u32) {
        for fault in &mut self.faults {
            fault.out = fault.out.wrapping_add(cycles);
        }
    }

    /// What there is.
    pub fn iter(&self) -> impl Iterator<Item = &Fault> {
        self.faults.iter()
    }
}

/// They set the same, or parts of it.
fn same(a: &Setting, b: &Setting) -> bool {
    a.signal.word == b.signal.word && a.mask & b.mask != 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use model_core::machine::Machine;

    const TRIP: Setting = Setting {
        signal: &image::FAULT_DRIVES,
        mask: 1,
        word: 1,
    };

    #[test]
    fn a_fault_is_out_after_its_time_and_nothing_else_is() {
        let sound = Commands::of(&Machine::news_8000());
        let (mut timed, mut commands) = (Timed::default(), sound);
        let delay = Setting {
            signal: &image::BUS_DELAY,
            mask: u16::MAX,
            word: 7,
        };
        let cycles = timed.cycles(1.5, &[TRIP, delay]).expect("faults");
        assert_eq!(cycles, 150);
        commands.set_word(&image::FAULT_DRIVES, 0b11);
        commands.set_word(&image::BUS_DELAY, 7);
        // Over the counter's wrap.
        let now = u32::MAX - 10;
        for setting in [TRIP, delay] {
            timed.put(setting, &sound, Some(now.wrapping_add(cycles)));
        }
        for i in 1..cycles {
            timed.before(now.wrapping_add(i), &mut commands, |_| panic!("cycle {i}"));
        }
        let mut taken = 0;
        timed.before(now.wrapping_add(cycles), &mut commands, |_| taken += 1);
        assert_eq!((taken, timed.iter().count()), (2, 0));
        assert_eq!(commands.word(&image::FAULT_DRIVES), 0b10);
        assert_eq!(
            commands.word(&image::BUS_DELAY),
            sound.word(&image::BUS_DELAY)
        );
    }

    #[test]
    fn what_was_changed_meanwhile_stays() {
        let sound = Commands::of(&Machine::news_8000());
        let (mut timed, mut commands) = (Timed::default(), sound);
        commands.set_word(&image::FAULT_DRIVES, 1);
        timed.put(TRIP, &sound, Some(5));
        timed.put(TRIP, &sound, None);
        timed.before(5, &mut commands, |_| panic!("it is there for good"));
        timed.put(TRIP, &sound, Some(9));
        commands.set_word(&image::FAULT_DRIVES, 0);
        timed.before(6, &mut commands, |_| panic!("somebody else took it out"));
        commands.set_word(&image::FAULT_DRIVES, 1);
        timed.before(9, &mut commands, |_| panic!("and put it in again"));
        assert_eq!(commands.word(&image::FAULT_DRIVES), 1);
    }

    #[test]
    fn only_faults_have_a_time() {
        let timed = Timed::default();
        let run = Setting {
            signal: &image::V_SET,
            mask: u16::MAX,
            word: 1,
        };
        let refused = timed.cycles(0.0, &[TRIP, run]).expect_err("both");
        let names: std::vec::Vec<_> = refused
            .details
            .iter()
            .map(|d| d.parameter.as_str())
            .collect();
        assert_eq!(names, ["for_s", "v_set"]);
        assert!(timed.cycles(f64::NAN, &[TRIP]).is_err());
    }
}
