//! The image as a field bus with registers sees it: scaled words, and the same signals as floats.
//!
//! Not here: how requests travel, and who may write.
//!
//! | registers | what |
//! |---|---|
//! | from 0 | the words of a block |
//! | from [`FLOATS`] | the float of the signal at word `w` in registers `FLOATS + 2·w` and the next, high word first |
//!
//! A float is an IEEE 754 single in the signal's unit; that of bits or a code is their number. Where a word has no
//! signal of its own, being the low word of a pair, its float is 0. Floats hold 24 bits: a long counter is read
//! exactly as a pair of words. Registers are read as they come; floats are written whole.

use core::ops::Range;

use model_core::image::{
    COMMAND_WORDS, Commands, Direction, FEEDBACK_WORDS, Image, Kind, PLC_COMMAND_WORDS, SIGNALS,
    Signal,
};

use crate::link::control::WordSet;

/// First register of the floats, of commands as of feedback.
pub const FLOATS: u16 = 1000;
const _: () = assert!(COMMAND_WORDS <= FLOATS as usize);
const _: () = assert!(FEEDBACK_WORDS <= FLOATS as usize);

/// Registers of a float.
const HALVES: usize = 2;

/// The signals by their first words.
type Signals<const N: usize> = [Option<&'static Signal>; N];

const COMMAND_SIGNALS: Signals<COMMAND_WORDS> = by_word(Direction::Command);
const FEEDBACK_SIGNALS: Signals<FEEDBACK_WORDS> = by_word(Direction::Feedback);

const fn by_word<const N: usize>(direction: Direction) -> Signals<N> {
    let (mut words, mut i) = ([None; N], 0);
    while i < SIGNALS.len() {
        let s = &SIGNALS[i];
        if s.direction as u8 == direction as u8 {
            words[s.word as usize] = Some(s);
        }
        i += 1;
    }
    words
}

/// A block as registers.
#[derive(Clone, Copy)]
pub struct Registers<'a> {
    words: &'a [u16],
    signals: &'a [Option<&'static Signal>],
}

/// Where some registers are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// These words.
    Words(Range<usize>),
    /// These halves of floats.
    Halves(Range<usize>),
}

impl<'a> Registers<'a> {
    /// The commands: holding registers.
    pub fn commands(image: &'a Image) -> Self {
        Self {
            words: &image.commands.words,
            signals: &COMMAND_SIGNALS,
        }
    }

    /// The feedback: input registers.
    pub fn feedback(image: &'a Image) -> Self {
        Self {
            words: &image.feedback.words,
            signals: &FEEDBACK_SIGNALS,
        }
    }

    /// Where consecutive registers are; all in one window or nowhere.
    pub fn place(self, start: u16, count: u16) -> Option<Place> {
        let within = |start: usize, len| {
            let end = start + usize::from(count);
            (end <= len).then_some(start..end)
        };
        let words = within(start.into(), self.words.len()).map(Place::Words);
        words.or_else(|| {
            let start = start.checked_sub(FLOATS)?;
            within(start.into(), HALVES * self.words.len()).map(Place::Halves)
        })
    }

    /// What stands there.
    pub fn read(self, place: Place) -> impl Iterator<Item = u16> + use<'a> {
        let (range, halves) = match place {
            Place::Words(range) => (range, false),
            Place::Halves(range) => (range, true),
        };
        range.map(move |i| {
            if halves {
                let bits = self.float(i / HALVES).to_bits();
                (if i % HALVES == 0 { bits >> 16 } else { bits }) as u16
            } else {
                self.word(i)
            }
        })
    }

    fn word(self, word: usize) -> u16 {
        self.words.get(word).copied().unwrap_or_default()
    }

    fn float(self, word: usize) -> f32 {
        let Some(signal) = self.signals.get(word).copied().flatten() else {
            return 0.0;
        };
        let low = u32::from(self.word(word + 1));
        value(signal, self.word(word), low)
    }
}

/// A signal's value as it stands in its words, in its unit, limited by nothing.
fn value(signal: &Signal, word: u16, low: u32) -> f32 {
    let raw = match signal.kind {
        Kind::I16 => f32::from(word as i16),
        Kind::U32 => (u32::from(word) << 16 | low) as f32,
        Kind::U16 | Kind::Bits(_) | Kind::Code(_) => f32::from(word),
    };
    raw / signal.counts
}

/// What cannot be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unfit {
    /// Half a float.
    Half,
    /// No number, or none of a bit word or a code.
    Value,
}

/// The words that a write of registers concerns.
///
/// # Errors
/// Floats are written whole.
pub fn concerned(place: &Place) -> Result<Range<usize>, Unfit> {
    match place {
        Place::Words(range) => Ok(range.clone()),
        Place::Halves(range) if range.start % HALVES == 0 && range.end % HALVES == 0 => {
            let (start, end) = (range.start / HALVES, range.end / HALVES);
            if is_second(start) {
                return Err(Unfit::Half);
            }
            // the low word of a number of two goes with its high word
            Ok(start..end + usize::from(is_second(end)))
        }
        Place::Halves(_) => Err(Unfit::Half),
    }
}

/// The second word of a command that has two; its number stands at the first.
fn is_second(word: usize) -> bool {
    let before = word.checked_sub(1).and_then(|i| *COMMAND_SIGNALS.get(i)?);
    before.is_some_and(|signal| signal.kind.words() == 2)
}

/// Registers as words: those of floats become the nearest counts within the limits.
///
/// Gives a word for each that [`concerned`] names, and which of them were outside their limits.
///
/// # Errors
/// Nonsense is among them; what else there is does not count then.
pub fn decode(
    place: &Place,
    registers: impl Iterator<Item = u16>,
) -> Result<(heapless::Vec<u16, COMMAND_WORDS>, WordSet), Unfit> {
    let range = concerned(place)?;
    let mut words = heapless::Vec::new();
    let mut outside = 0;
    let mut registers = registers.take(COMMAND_WORDS * HALVES);
    // of the number whose high word was last
    let mut low_word = 0;
    for word in range {
        let signal = COMMAND_SIGNALS.get(word).copied().flatten();
        let (raw, limited) = match place {
            Place::Words(_) => {
                let raw = registers.next().ok_or(Unfit::Half)?;
                (raw, signal.is_some_and(|s| is_outside(s, raw)))
            }
            Place::Halves(_) if is_second(word) => {
                // what stands at its own place is nothing
                let _ = registers.next().zip(registers.next());
                (low_word, false)
            }
            Place::Halves(_) => {
                let (high, low) = registers.next().zip(registers.next()).ok_or(Unfit::Half)?;
                let bits = u32::from(high) << 16 | u32::from(low);
                let ([raw, low], limited) =
                    signal.map_or(Ok(([0; 2], false)), |s| counts(s, f32::from_bits(bits)))?;
                low_word = low;
                (raw, limited)
            }
        };
        outside |= WordSet::from(limited) << word;
        // as many as the range has, which is within the block
        let _ = words.push(raw);
    }
    Ok((words, outside))
}

/// A word that stands outside its signal's limits. Beyond a winder PLC's first words, 0 is as if it were not there.
pub fn is_outside(signal: &Signal, word: u16) -> bool {
    let none = word == 0 && usize::from(signal.word) >= PLC_COMMAND_WORDS;
    let (low, high) = signal.limits;
    !none && !(low..=high).contains(&value(signal, word, 0))
}

/// Which of these words of the commands stand outside their limits.
pub fn outside(commands: &Commands, words: Range<usize>) -> WordSet {
    words.fold(0, |set, word| {
        let signal = COMMAND_SIGNALS.get(word).copied().flatten();
        let outside = signal.is_some_and(|s| is_outside(s, commands.word(s)));
        set | WordSet::from(outside) << word
    })
}

/// The words for a float, the first one first, and whether the float was outside the limits.
fn counts(signal: &Signal, value: f32) -> Result<([u16; 2], bool), Unfit> {
    if !value.is_finite() {
        return Err(Unfit::Value);
    }
    if matches!(signal.kind, Kind::Bits(_) | Kind::Code(_)) {
        // exact: the casts of a whole number within the range
        let word = value as u16;
        return if f32::from(word).to_bits() == value.to_bits() {
            Ok(([word, 0], is_outside(signal, word)))
        } else {
            Err(Unfit::Value)
        };
    }
    let none = value == 0.0 && usize::from(signal.word) >= PLC_COMMAND_WORDS;
    if none {
        return Ok(([0; 2], false));
    }
    let (low, high) = signal.limits;
    let mut block = Commands::default();
    block.set(signal, value);
    let second = if signal.kind.words() == 2 {
        block.double(signal) as u16
    } else {
        0
    };
    Ok(([block.word(signal), second], !(low..=high).contains(&value)))
}

#[cfg(test)]
mod tests {
    use model_core::image::{self, Feedback};

    use super::*;

    fn image() -> Image {
        Image {
            commands: Commands::default(),
            feedback: Feedback::default(),
        }
    }

    fn halves(values: &[f32]) -> impl Iterator<Item = u16> {
        values.iter().flat_map(|v| {
            let bits = v.to_bits();
            [(bits >> 16) as u16, bits as u16]
        })
    }

    fn floats_at(signal: &Signal) -> Place {
        let start = HALVES * usize::from(signal.word);
        Place::Halves(start..start + HALVES)
    }

    #[test]
    fn windows_end_where_their_blocks_do() {
        let image = image();
        let r = Registers::commands(&image);
        let n = COMMAND_WORDS as u16;
        assert_eq!(r.place(0, n), Some(Place::Words(0..COMMAND_WORDS)));
        assert_eq!(
            r.place(FLOATS, 2 * n),
            Some(Place::Halves(0..2 * COMMAND_WORDS))
        );
        for (start, count) in [
            (0, n + 1),
            (n, 1),
            (FLOATS - 1, 2),
            (FLOATS, 2 * n + 1),
            (FLOATS + 2 * n, 1),
            (u16::MAX, 125),
        ] {
            assert_eq!(r.place(start, count), None, "{start} {count}");
        }
    }

    #[test]
    fn every_float_is_its_words_in_their_unit() {
        let mut image = image();
        for (i, word) in image.feedback.words.iter_mut().enumerate() {
            *word = 0x8123_u16.wrapping_mul(i as u16 + 1);
        }
        for s in SIGNALS
            .iter()
            .filter(|s| s.direction == Direction::Feedback)
        {
            let bits = Registers::feedback(&image).read(floats_at(s));
            let bits = bits.fold(0, |bits, half| bits << 16 | u32::from(half));
            let float = f64::from(f32::from_bits(bits));
            let raw = match s.kind {
                Kind::U32 => f64::from(image.feedback.double(s)),
                Kind::I16 => f64::from(image.feedback.word(s) as i16),
                _ => f64::from(image.feedback.word(s)),
            };
            let exact = raw / f64::from(s.counts);
            assert!((float - exact).abs() <= exact.abs() * 2e-7, "{}", s.name);
        }
    }

    #[test]
    fn what_was_read_as_floats_can_be_written_back() {
        let mut image = image();
        for s in SIGNALS.iter().filter(|s| s.direction == Direction::Command) {
            for word in [0, 1, 2, 0x7fff, 0x8000, 0xffff] {
                let both = [0, word];
                let mut raw = both.as_slice();
                if matches!(s.kind, Kind::U32) {
                    // counts of this size stand exactly in a float
                    image.commands.set_double(s, word.into());
                } else {
                    image.commands.set_word(s, word);
                    raw = &raw[1..];
                }
                let r = Registers::commands(&image);
                let written = decode(&floats_at(s), r.read(floats_at(s)));
                let (words, outside) = written.expect("a number");
                let out = s.kind.words() == 1 && is_outside(s, word);
                assert_eq!(outside != 0, out, "{} {word}", s.name);
                if outside == 0 {
                    assert_eq!(words[..], *raw, "{}", s.name);
                }
            }
        }
    }

    #[test]
    fn set_points_are_limited_and_say_so() {
        let place = floats_at(&image::V_SET);
        for (value, word, limited) in [
            (1200.04, 12_000, false),
            (2500.0, 25_000, false),
            (2500.1, 25_000, true),
            (1e30, 25_000, true),
            (-0.1, 0, true),
            (-1e30, 0, true),
        ] {
            let (words, outside) = decode(&place, halves(&[value])).expect("a number");
            assert_eq!(
                (words[0], outside),
                (word, u64::from(limited) << 6),
                "{value}"
            );
        }
        // as words they stay as they were written; whoever uses them limits them
        let place = Place::Words(6..7);
        let (words, outside) = decode(&place, [25_001].into_iter()).expect("a word");
        assert_eq!((words[0], outside), (25_001, 1 << 6));
    }

    #[test]
    fn nonsense_is_refused() {
        for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let decoded = decode(&floats_at(&image::V_SET), halves(&[value]));
            assert_eq!(decoded, Err(Unfit::Value));
        }
        for value in [-1.0, 0.5, 65_536.0, 1e-40] {
            let decoded = decode(&floats_at(&image::STW1_UW), halves(&[value]));
            assert_eq!(decoded, Err(Unfit::Value), "{value}");
        }
        for halves in [0..1, 1..2, 1..3, 2..5] {
            assert_eq!(concerned(&Place::Halves(halves)), Err(Unfit::Half));
        }
    }

    #[test]
    fn zero_beyond_the_first_words_is_none() {
        assert!(!is_outside(&image::BUS_DELAY, 0));
        assert!(is_outside(&image::BUS_DELAY, 11));
        assert!(is_outside(&image::V_THREAD_SET, 0));
        let decoded = decode(&floats_at(&image::BUS_DELAY), halves(&[0.0]));
        assert_eq!(
            decoded.map(|(words, outside)| (words[0], outside)),
            Ok((0, 0))
        );
    }
}
