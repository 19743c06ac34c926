//! Signals by name: what a scenario sets and looks at.
//!
//! Not here: the signals themselves. They stand in [`SIGNALS`]; a name that the table has is known here.

use std::fmt;

use anyhow::{Result, bail, ensure};
use model_core::image::{Bit, Commands, Direction, Image, Kind, SIGNALS, Section, Signal};

/// A signal of the image, or one bit of it.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// The signal.
    pub signal: &'static Signal,
    /// The bit, where one is meant.
    pub bit: Option<&'static Bit>,
}

/// A value as it was written.
#[derive(Clone, Debug, PartialEq)]
pub enum Given {
    /// A number, in the signal's unit.
    Number(f64),
    /// true or false.
    Switch(bool),
    /// The text of a code, or its beginning.
    Text(String),
}

impl fmt::Display for Given {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(number) => number.fmt(f),
            Self::Switch(on) => on.fmt(f),
            Self::Text(text) => write!(f, "'{text}'"),
        }
    }
}

/// What a `*` in a name stands for.
const DRIVES: [Section; 4] = [
    Section::Unwind,
    Section::RearDrum,
    Section::FrontDrum,
    Section::RiderRoll,
];

/// Every name: signals, each with its bits after it.
fn all() -> impl Iterator<Item = Place> {
    SIGNALS.iter().flat_map(|signal| {
        let bits = match signal.kind {
            Kind::Bits(bits) => bits,
            _ => &[],
        };
        let bits = bits.iter().map(Some);
        std::iter::once(None)
            .chain(bits)
            .map(move |bit| Place { signal, bit })
    })
}

/// Does `name` fit `pattern`, in which one `*` stands for any drive's section?
fn fits(pattern: &str, name: &str) -> bool {
    let Some((head, tail)) = pattern.split_once('*') else {
        return pattern == name;
    };
    let middle = name
        .strip_prefix(head)
        .and_then(|rest| rest.strip_suffix(tail));
    middle.is_some_and(|middle| DRIVES.iter().any(|section| section.name() == middle))
}

impl Place {
    /// All places of a name, in which one `*` stands for all drives' sections: `stw1_*.on` is four bits.
    pub fn find(name: &str) -> Result<Vec<Self>> {
        let found: Vec<_> = all()
            .filter(|place| fits(name, &place.to_string()))
            .collect();
        if found.is_empty() {
            let distance = |place: &Self| strsim::damerau_levenshtein(&place.to_string(), name);
            let nearest = all().min_by_key(distance);
            let nearest = nearest.map_or(String::new(), |place| place.to_string());
            bail!("there is no signal {name}; the nearest is {nearest}");
        }
        Ok(found)
    }

    /// The one place of a name.
    pub fn find_one(name: &str) -> Result<Self> {
        match Self::find(name)?[..] {
            [place] => Ok(place),
            _ => bail!("{name} is more than one signal"),
        }
    }

    /// What stands in the image, in counts.
    pub fn counts(&self, image: &Image) -> i64 {
        let signal = self.signal;
        let words: &[u16] = match signal.direction {
            Direction::Command => &image.commands.words,
            Direction::Feedback => &image.feedback.words,
        };
        let word = |i: u16| words.get(usize::from(signal.word + i)).copied();
        let first = word(0).unwrap_or(0);
        match (self.bit, signal.kind) {
            (Some(bit), _) => i64::from(first >> bit.number & 1),
            (None, Kind::I16) => i64::from(first as i16),
            (None, Kind::U32) => i64::from(first) << 16 | i64::from(word(1).unwrap_or(0)),
            (None, _) => i64::from(first),
        }
    }

    /// Counts for one unit.
    pub fn scale(&self) -> f64 {
        f64::from(self.signal.counts)
    }

    /// Sets a command, in counts that [`Self::counts_of`] gave.
    pub fn set(&self, commands: &mut Commands, counts: i64) {
        let signal = self.signal;
        match (self.bit, signal.kind) {
            (Some(bit), _) => {
                let mask = 1 << bit.number;
                let others = commands.word(signal) & !mask;
                let word = if counts == 0 { others } else { others | mask };
                commands.set_word(signal, word);
            }
            (None, Kind::U32) => commands.set_double(signal, counts as u32),
            // a negative one in two's complement
            (None, _) => commands.set_word(signal, counts as u16),
        }
    }

    /// The counts of a value, or why this place cannot have it.
    pub fn counts_of(&self, given: &Given) -> Result<i64> {
        match (self.bit, self.signal.kind, given) {
            (Some(_), _, Given::Switch(on)) => Ok(i64::from(*on)),
            (Some(_), ..) => bail!("{self} = {given} is neither true nor false"),
            (None, Kind::Code(texts), Given::Text(text)) => self.code(texts, text),
            (None, Kind::Code(texts), Given::Number(number)) => {
                let last = texts.len() - 1;
                ensure!(
                    number.fract() == 0.0 && (0.0..=last as f64).contains(number),
                    "{self} = {given} is not a code from 0 to {last}"
                );
                Ok(*number as i64)
            }
            (None, _, Given::Number(number)) => {
                let (low, high) = self.limits();
                ensure!(
                    (low..=high).contains(number),
                    "{self} = {given} is outside {low} to {high}{}",
                    self.unit()
                );
                Ok((number * self.scale()).round() as i64)
            }
            (None, ..) => bail!("{self} = {given} is not a number"),
        }
    }

    /// The code of a text, or of its beginning where it is the only one that begins so.
    fn code(&self, texts: &[&str], text: &str) -> Result<i64> {
        let wanted = text.to_lowercase();
        if let Some(code) = texts.iter().position(|t| t.to_lowercase() == wanted) {
            return Ok(code as i64);
        }
        let begin: Vec<_> = (0..texts.len())
            .filter(|code| texts[*code].to_lowercase().starts_with(&wanted))
            .collect();
        match begin[..] {
            [code] => Ok(code as i64),
            [] => {
                let distance = |t: &&&str| strsim::damerau_levenshtein(&t.to_lowercase(), &wanted);
                let nearest = texts.iter().min_by_key(distance);
                let nearest = nearest.copied().unwrap_or("");
                bail!("{self} is never '{text}'; the nearest is '{nearest}'")
            }
            _ => {
                let texts: Vec<_> = begin
                    .iter()
                    .map(|code| format!("'{}'", texts[*code]))
                    .collect();
                bail!("{self} = '{text}' may be {}", texts.join(" or "))
            }
        }
    }

    /// Smallest and largest value, in the unit.
    fn limits(&self) -> (f64, f64) {
        // the decimal number that was meant, not the nearest f32
        let (low, high) = self.signal.limits;
        let decimal = |limit: f32| limit.to_string().parse().unwrap_or(f64::from(limit));
        (decimal(low), decimal(high))
    }

    /// The unit with a blank before it.
    pub fn unit(&self) -> String {
        match self.signal.unit {
            "" => String::new(),
            unit => format!(" {unit}"),
        }
    }

    /// Counts for people: with unit, or as the text of the code.
    pub fn show(&self, counts: i64) -> String {
        match (self.bit, self.signal.kind) {
            (Some(_), _) => (counts != 0).to_string(),
            (None, Kind::Code(texts)) => {
                let text = usize::try_from(counts)
                    .ok()
                    .and_then(|code| texts.get(code));
                format!("{counts} ({})", text.unwrap_or(&"unknown code"))
            }
            (None, Kind::Bits(_)) => format!("{counts:04X} hex"),
            (None, _) => format!("{}{}", counts as f64 / self.scale(), self.unit()),
        }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.signal.name)?;
        match self.bit {
            Some(bit) => write!(f, ".{}", bit.name),
            None => Ok(()),
        }
    }
}

/// What a command is set to.
#[derive(Clone, Copy, Debug)]
pub struct Assignment {
    /// The command.
    pub place: Place,
    /// Its new value, in counts.
    pub counts: i64,
}

impl Assignment {
    /// What a name, or all that fit its `*`, is set to; refuses what only the simulator may write.
    pub fn of(name: &str, given: &Given) -> Result<Vec<Self>> {
        let assign = |place: Place| {
            ensure!(
                place.signal.direction == Direction::Command,
                "{place} is feedback: only the simulator writes it"
            );
            let counts = place.counts_of(given)?;
            Ok(Self { place, counts })
        };
        Place::find(name)?.into_iter().map(assign).collect()
    }
}

/// What a comparison asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operator {
    /// =
    Is,
    /// !=
    IsNot,
    /// <
    Below,
    /// <=
    AtMost,
    /// >
    Above,
    /// >=
    AtLeast,
}

/// The operators as they are written; those of two letters first.
const OPERATORS: [(&str, Operator); 6] = [
    ("!=", Operator::IsNot),
    ("<=", Operator::AtMost),
    (">=", Operator::AtLeast),
    ("<", Operator::Below),
    (">", Operator::Above),
    ("=", Operator::Is),
];

/// What a signal is compared with.
#[derive(Clone, Copy, Debug)]
pub enum Reference {
    /// A value in its unit; of a bit 0 or 1, of a code its number.
    Value(f64),
    /// So many times another signal's value.
    Times(f64, Place),
}

/// A comparison of signals with a reference; several signals must all fulfil it.
#[derive(Clone, Debug)]
pub struct Term {
    /// The signals.
    pub places: Vec<Place>,
    /// How.
    pub operator: Operator,
    /// With what.
    pub reference: Reference,
}

/// Relative rounding of a bound that was computed.
const ROUNDING: f64 = 1e-9;

impl Term {
    /// The first signal that does not fulfil the comparison.
    pub fn fails(&self, image: &Image) -> Option<Place> {
        let holds = |place: &Place| {
            let counts = place.counts(image) as f64;
            let wanted = place.scale()
                * match self.reference {
                    Reference::Value(value) => value,
                    Reference::Times(factor, of) => factor * of.counts(image) as f64 / of.scale(),
                };
            let near = (counts - wanted).abs() <= ROUNDING * wanted.abs().max(1.0);
            match self.operator {
                Operator::Is => near,
                Operator::IsNot => !near,
                Operator::Below => counts < wanted && !near,
                Operator::AtMost => counts < wanted || near,
                Operator::Above => counts > wanted && !near,
                Operator::AtLeast => counts > wanted || near,
            }
        };
        self.places.iter().find(|place| !holds(place)).copied()
    }
}

/// Terms that must all hold.
#[derive(Clone, Debug)]
pub struct Condition {
    /// The terms.
    pub terms: Vec<Term>,
    /// As it is told to people.
    pub text: String,
}

impl Condition {
    /// Reads `winder_status.at_speed and not winder_status.fault and v_web > 1200 and mode = run`.
    pub fn read(text: &str) -> Result<Self> {
        let terms: Result<_> = conjunction(text).map(Self::term).collect();
        Ok(Self {
            terms: terms?,
            text: text.trim().to_owned(),
        })
    }

    fn term(text: &str) -> Result<Term> {
        let found = OPERATORS
            .iter()
            .filter_map(|(sign, operator)| Some((text.find(sign)?, *sign, *operator)))
            // the first, and of two at one place the longer one, which stands first in the table
            .min_by_key(|(at, ..)| *at);
        let Some((at, sign, operator)) = found else {
            let (name, wanted) = match text.trim().strip_prefix("not ") {
                Some(name) => (name.trim(), false),
                None => (text.trim(), true),
            };
            ensure!(
                !name.is_empty(),
                "there is nothing to wait for or to compare"
            );
            let places = Place::find(name)?;
            if let Some(place) = places.iter().find(|place| place.bit.is_none()) {
                bail!("{place} is no bit: compare it, as in '{place} = …'");
            }
            return Ok(Term {
                places,
                operator: Operator::Is,
                reference: Reference::Value(f64::from(u8::from(wanted))),
            });
        };
        let right = text[at + sign.len()..].trim();
        let places = Place::find(text[..at].trim())?;
        let share = right.split_once('*').and_then(|(share, of)| {
            let share = share.trim().parse::<f64>().ok();
            Some((share.filter(|share| share.is_finite())?, of.trim()))
        });
        let reference = match share {
            Some((share, of)) => Reference::Times(share, Place::find_one(of)?),
            None => Reference::Value(value_of(&places, &written(right))?),
        };
        Ok(Term {
            reference,
            places,
            operator,
        })
    }

    /// What does not hold, for people; none if all does.
    pub fn fails(&self, image: &Image) -> Option<String> {
        let term = self
            .terms
            .iter()
            .find_map(|term| Some((term, term.fails(image)?)));
        let (term, place) = term?;
        let mut got = format!("{place} = {}", place.show(place.counts(image)));
        if let Reference::Times(_, of) = term.reference {
            got += &format!(" with {of} = {}", of.show(of.counts(image)));
        }
        Some(got)
    }
}

/// The parts between `and`s outside of quotes.
fn conjunction(text: &str) -> impl Iterator<Item = &str> {
    const AND: &str = " and ";
    let mut from = 0;
    let mut parts = Vec::new();
    for (at, _) in text.match_indices(AND) {
        if at >= from && text[from..at].matches('\'').count().is_multiple_of(2) {
            parts.push(&text[from..at]);
            from = at + AND.len();
        }
    }
    parts.push(&text[from..]);
    parts.into_iter()
}

/// A value in a condition.
fn written(text: &str) -> Given {
    let hexadecimal = |text: &str| u32::from_str_radix(text.strip_prefix("0x")?, 16).ok();
    match text {
        "true" => Given::Switch(true),
        "false" => Given::Switch(false),
        _ => match (text.parse::<f64>().ok(), hexadecimal(text)) {
            (Some(number), _) => Given::Number(number),
            (None, Some(word)) => Given::Number(f64::from(word)),
            (None, None) => Given::Text(text.trim_matches('\'').to_owned()),
        },
    }
}

/// The value that is compared with, in the unit of all `places`; refuses what one of them can never be.
pub fn value_of(places: &[Place], given: &Given) -> Result<f64> {
    let value = |place: &Place| {
        let counts = place.counts_of(given)?;
        match given {
            Given::Number(number) => Ok(*number),
            _ => Ok(counts as f64),
        }
    };
    let values: Result<Vec<_>> = places.iter().map(value).collect();
    let values = values?;
    let first = values.first().copied().unwrap_or(0.0);
    ensure!(
        values
            .iter()
            .all(|value| value.to_bits() == first.to_bits()),
        "{given} is not the same for all these signals"
    );
    Ok(first)
}

#[cfg(test)]
mod tests {
    use super::*;
    use model_core::image;
    use model_core::image::Feedback;
    use model_core::machine::Machine;

    fn image() -> Image {
        let mut image = Image {
            commands: Commands::of(&Machine::news_8000()),
            feedback: Feedback::default(),
        };
        image.feedback.set(&image::V_WEB, -12.3);
        image.feedback.set(&image::TENSION, 350.0);
        image.feedback.set(&image::TENSION_REF, 340.0);
        image.feedback.set_double(&image::LENGTH_WU, 0x0001_0203);
        image.feedback.set_word(&image::MODE, 4);
        image.feedback.set_word(&image::WINDER_STATUS, 0b1_0001);
        image
    }

    #[test]
    fn conditions_hold_or_say_what_does_not() {
        for (text, got) in [
            ("winder_status.at_speed", None),
            ("not winder_status.fault and winder_status.drives_on", None),
            ("winder_status.fault", Some("winder_status.fault = false")),
            (
                "winder_status.fault = true",
                Some("winder_status.fault = false"),
            ),
            ("v_web = -12.3", None),
            ("v_web < -12.3", Some("v_web = -12.3 m/min")),
            ("v_web <= -12.3 and v_web >= -12.3 and v_web != 12", None),
            ("v_web > -12.4", None),
            ("length_wu = 660.51", None),
            ("mode = run and tension > 349.5", None),
            (
                "tension <= 1.03 * tension_ref and tension_ref < 1 * tension",
                None,
            ),
            (
                "tension < 1.02 * tension_ref",
                Some("tension = 350 N/m with tension_ref = 340 N/m"),
            ),
            ("mode = 'Run'", None),
            ("mode = 3", Some("mode = 4 (run)")),
            ("mode != run", Some("mode = 4 (run)")),
            ("stw1_* = 0", None),
            ("stw1_*.on", Some("stw1_uw.on = false")),
            ("winder_status = 0x11", None),
            ("winder_status = 0", Some("winder_status = 0011 hex")),
        ] {
            let condition = Condition::read(text).unwrap();
            assert_eq!(condition.fails(&image()).as_deref(), got, "{text}");
        }
    }

    #[test]
    fn conditions_that_cannot_be_are_refused() {
        for (text, reason) in [
            ("", "there is nothing"),
            (
                "winder_status.at_sped",
                "there is no signal winder_status.at_sped; the nearest is winder_status.at_speed",
            ),
            ("tension", "tension is no bit: compare it"),
            (
                "tensoin > 3",
                "there is no signal tensoin; the nearest is tension",
            ),
            ("tension > much", "tension = 'much' is not a number"),
            ("tension > -1", "tension = -1 is outside 0 to 65535 N/m"),
            (
                "tension > 1.1 * tension_rev",
                "there is no signal tension_rev; the nearest is tension_ref",
            ),
            (
                "tension > x * tension_ref",
                "tension = 'x * tension_ref' is not a number",
            ),
            ("mode = 1000", "mode = 1000 is not a code from 0 to "),
            ("mode = runn", "mode is never 'runn'; the nearest is 'run'"),
            ("mode = drives", "mode = 'drives' may be 'drives off"),
            (
                "winder_status.fault = 2",
                "winder_status.fault = 2 is neither true nor false",
            ),
        ] {
            let error = Condition::read(text).expect_err(text).to_string();
            assert!(error.starts_with(reason), "{text}: {error}");
        }
    }

    #[test]
    fn commands_are_set_to_their_counts() {
        for (name, given, words) in [
            (
                "v_set",
                Given::Number(1200.04),
                vec![(&image::V_SET, 12000)],
            ),
            (
                "front_share_trim",
                Given::Number(-1.5),
                vec![(&image::FRONT_SHARE_TRIM, -15i16 as u16)],
            ),
            (
                "winder_command.run",
                Given::Switch(true),
                vec![(&image::WINDER_COMMAND, 4)],
            ),
            (
                "stw1_*.on",
                Given::Switch(true),
                vec![(&image::STW1_UW, 1), (&image::STW1_RR, 1)],
            ),
        ] {
            let mut commands = Commands::default();
            for Assignment { place, counts } in Assignment::of(name, &given).unwrap() {
                place.set(&mut commands, counts);
            }
            for (signal, word) in words {
                assert_eq!(commands.word(signal), word, "{name}");
            }
        }
        for (name, given, reason) in [
            ("v_web", Given::Number(1.0), "v_web is feedback"),
            (
                "v_set",
                Given::Number(3000.0),
                "v_set = 3000 is outside 0 to 2500 m/min",
            ),
            ("v_set", Given::Number(f64::NAN), "v_set = NaN is outside"),
            ("v_set", Given::Switch(true), "v_set = true is not a number"),
            (
                "winder_command.run",
                Given::Number(1.0),
                "winder_command.run = 1 is neither",
            ),
        ] {
            let error = Assignment::of(name, &given).expect_err(name).to_string();
            assert!(error.starts_with(reason), "{name}: {error}");
        }
    }
}
