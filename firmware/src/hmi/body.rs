//! Bodies of requests: JSON, read without a heap.
//!
//! Not here: what is done with them. A body that cannot be read is refused before anything is.

use heapless::{String, Vec};
use model_core::image::{Direction, Kind, SIGNALS};
use serde::Deserialize;
use serde::de::{DeserializeSeed, Deserializer, IgnoredAny, MapAccess, Visitor};
use serde_json_core::de::Deserializer as Json;

use super::answer::{Detail, Refusal, cut};
use super::desk::Setting;
use super::setup::{ReadValues, Values, not_read};

/// Deepest nesting of a body: an object in an object, and one more for what is ignored. Reading takes some stack for
/// each level.
const DEPTH: usize = 4;

/// Refuses a body that is nested deeper than any of ours.
pub fn is_shallow(body: &[u8]) -> bool {
    let (mut depth, mut in_text, mut escaped) = (0_usize, false, false);
    for byte in body {
        match byte {
            _ if escaped => escaped = false,
            b'\\' if in_text => escaped = true,
            b'"' => in_text = !in_text,
            _ if in_text => {}
            b'[' | b'{' => depth += 1,
            b']' | b'}' => depth = depth.saturating_sub(1),
            _ => {}
        }
        if depth > DEPTH {
            return false;
        }
    }
    true
}

fn unread() -> Refusal {
    Refusal::new(
        422,
        format_args!("the body is not the JSON that is wanted here"),
    )
}

/// Reads a body of fixed fields.
pub fn read<'a, T: Deserialize<'a>>(body: &'a [u8]) -> Result<T, Refusal> {
    let (value, _) = serde_json_core::from_slice(body).map_err(|_| unread())?;
    Ok(value)
}

/// Reads one whose texts may have escaped characters.
pub fn read_escaped<'a, T: Deserialize<'a>>(body: &'a [u8]) -> Result<T, Refusal> {
    let mut text = [0; 256];
    let (value, _) = serde_json_core::from_slice_escaped(body, &mut text).map_err(|_| unread())?;
    Ok(value)
}

/// The machine that the client has seen.
#[derive(Deserialize)]
pub struct Seen {
    pub revision: u32,
}

/// A preset.
#[derive(Deserialize)]
pub struct Preset<'a> {
    pub name: &'a str,
    pub revision: u32,
}

/// A password.
#[derive(Deserialize)]
pub struct Password {
    pub password: String<{ *super::auth::PASSWORD_BYTES.end() }>,
}

impl Password {
    /// Its characters may be escaped.
    pub fn read(body: &[u8]) -> Result<Self, Refusal> {
        read_escaped(body)
    }
}

/// What the panel is asked for.
#[derive(Deserialize)]
pub struct Panel<'a> {
    pub action: &'a str,
    #[serde(default)]
    pub v_set_m_min: Option<f32>,
    #[serde(default)]
    pub length_m: Option<f32>,
    #[serde(default)]
    pub diameter_mm: Option<f32>,
    #[serde(default, rename = "loop")]
    pub tuned: Option<u16>,
}

/// Values to be staged, and the machine that the client has seen.
pub fn staged(body: &[u8], values: &mut Values) -> Result<u32, Refusal> {
    let mut wrong = None;
    let mut json = Json::new(body, None);
    let read = Staged {
        values,
        wrong: &mut wrong,
    };
    let revision = read.deserialize(&mut json);
    match (revision, json.end(), &wrong) {
        (Ok(Some(revision)), Ok(_), None) => Ok(revision),
        (Ok(None), Ok(_), None) => Err(unread()),
        _ => Err(not_read(wrong)),
    }
}

struct Staged<'a> {
    values: &'a mut Values,
    wrong: &'a mut Option<Detail>,
}

impl<'de> DeserializeSeed<'de> for Staged<'_> {
    type Value = Option<u32>;
    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Self::Value, D::Error> {
        deserializer.deserialize_map(self)
    }
}

impl<'de> Visitor<'de> for Staged<'_> {
    type Value = Option<u32>;

    fn expecting(&self, f: &mut core::fmt::Formatter) -> core::fmt::Result {
        f.write_str("an object of revision and values")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
        let mut revision = None;
        while let Some(key) = map.next_key::<&str>()? {
            match key {
                "revision" => revision = Some(map.next_value()?),
                "values" => map.next_value_seed(ReadValues {
                    values: self.values,
                    wrong: self.wrong,
                })?,
                _ => {
                    map.next_value::<IgnoredAny>()?;
                }
            }
        }
        Ok(revision)
    }
}

/// Commands at once.
const COMMANDS: usize = 64;

/// What is to be commanded.
#[derive(Debug, Default)]
pub struct Wanted {
    pub settings: Vec<Setting, COMMANDS>,
    /// For this time, s; for good where there is none.
    pub for_s: Option<f64>,
}

/// The time's name.
const FOR: &str = "for_s";

/// Commands by name, a bit by its word's name, a point and its own, in counts; and how long they stand.
pub fn commands(body: &[u8]) -> Result<Wanted, Refusal> {
    let mut wrong = None;
    let mut wanted = Wanted::default();
    let mut json = Json::new(body, None);
    let read = Commands {
        wanted: &mut wanted,
        wrong: &mut wrong,
    };
    match (read.deserialize(&mut json), json.end(), wrong) {
        (Ok(()), Ok(_), None) => Ok(wanted),
        (_, _, Some(detail)) => {
            let mut refusal = Refusal::new(422, format_args!("a command cannot be"));
            refusal.error = cut("a command cannot be");
            refusal.add(detail);
            Err(refusal)
        }
        _ => Err(unread()),
    }
}

struct Commands<'a> {
    wanted: &'a mut Wanted,
    wrong: &'a mut Option<Detail>,
}

impl<'de> DeserializeSeed<'de> for Commands<'_> {
    type Value = ();
    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_map(self)
    }
}

impl<'de> Visitor<'de> for Commands<'_> {
    type Value = ();

    fn expecting(&self, f: &mut core::fmt::Formatter) -> core::fmt::Result {
        f.write_str("an object of commands and their counts")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        while let Some(name) = map.next_key::<&str>()? {
            // Until the value has been read, it is the one that is wrong.
            let before = self
                .wrong
                .replace(Detail::new(name, "", not_a_number(name)));
            let number: f64 = map.next_value()?;
            if name == FOR {
                (self.wanted.for_s, *self.wrong) = (Some(number), before);
                continue;
            }
            let counts = number as i32;
            if number - f64::from(counts) != 0.0 {
                continue;
            }
            *self.wrong = before;
            match setting(name, counts) {
                Ok(setting) => {
                    if self.wanted.settings.push(setting).is_err() {
                        self.wrong.get_or_insert(Detail::new(
                            name,
                            counts,
                            "too many commands at once",
                        ));
                    }
                }
                Err(detail) => {
                    self.wrong.get_or_insert(detail);
                }
            }
        }
        Ok(())
    }
}

/// Why what stands for a value is none.
fn not_a_number(name: &str) -> &'static str {
    match name {
        FOR => "not a number",
        _ => "not a whole number",
    }
}

/// A command by its name.
fn setting(name: &str, counts: i32) -> Result<Setting, Detail> {
    let (word, bit) = match name.split_once('.') {
        Some((word, bit)) => (word, Some(bit)),
        None => (name, None),
    };
    let mut commands = SIGNALS.iter().filter(|s| s.direction == Direction::Command);
    let Some(signal) = commands.find(|s| s.name == word) else {
        return Err(Detail::new(name, counts, "no such command"));
    };
    let (mask, low, high) = match (signal.kind, bit) {
        (Kind::Bits(bits), Some(bit)) => match bits.iter().find(|b| b.name == bit) {
            Some(bit) => (1 << bit.number, 0.0, 1.0),
            None => return Err(Detail::new(name, counts, "no such bit")),
        },
        (_, Some(_)) => return Err(Detail::new(name, counts, "no such bit")),
        (_, None) => (u16::MAX, signal.limits.0, signal.limits.1),
    };
    let scale = if bit.is_some() { 1.0 } else { signal.counts };
    let value = counts as f32 / scale;
    // In all words but the first of the PLC, 0 is how nothing is set.
    if !(low..=high).contains(&value) && counts != 0 {
        return Err(Detail {
            limits: Some((f64::from(low), f64::from(high))),
            unit: signal.unit,
            ..Detail::new(name, value, "outside its limits")
        });
    }
    let word = match bit {
        Some(_) if counts != 0 => mask,
        Some(_) => 0,
        None => counts as u16,
    };
    Ok(Setting { signal, mask, word })
}

#[cfg(test)]
mod tests {
    use super::*;
    use model_core::image;

    #[test]
    fn commands_are_counts_and_bits() {
        let body = br#"{"v_set":12000,"winder_command.run":1,"fault_preset":-33}"#;
        let wanted = commands(body).expect("right");
        assert_eq!(wanted.for_s, None);
        let plain: std::vec::Vec<_> = wanted
            .settings
            .iter()
            .map(|s| (s.signal.name, s.mask, s.word as i16))
            .collect();
        assert_eq!(
            plain,
            [
                (image::V_SET.name, u16::MAX, 12000),
                (image::WINDER_COMMAND.name, 1 << 2, 1 << 2),
                (image::FAULT_PRESET.name, u16::MAX, -33),
            ]
        );
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (body, name, reason) in [
            (r#"{"v_set":30000}"#, "v_set", "outside its limits"),
            (r#"{"v_web":1}"#, "v_web", "no such command"),
            (
                r#"{"winder_command.fly":1}"#,
                "winder_command.fly",
                "no such bit",
            ),
            (r#"{"v_set.run":1}"#, "v_set.run", "no such bit"),
            (
                r#"{"winder_command.run":2}"#,
                "winder_command.run",
                "outside its limits",
            ),
            (r#"{"v_set":"fast"}"#, "v_set", "not a whole number"),
            (r#"{"v_set":1.5}"#, "v_set", "not a whole number"),
            (r#"{"for_s":"long"}"#, "for_s", "not a number"),
        ] {
            let refusal = commands(body.as_bytes()).expect_err(body);
            assert_eq!(refusal.status, 422);
            let detail = &refusal.details[0];
            assert_eq!(
                (detail.parameter.as_str(), detail.reason),
                (name, reason),
                "{body}"
            );
        }
        assert!(commands(b"").is_err() && commands(b"{} x").is_err());
        let timed = commands(br#"{"for_s":2.5,"fault_web_break":1}"#).expect("right");
        assert_eq!((timed.for_s, timed.settings.len()), (Some(2.5), 1));
    }

    #[test]
    fn values_are_of_their_parameters_kind() {
        let mut values = Values::default();
        let body =
            br#"{"values":{"web.width_m":7.5,"nips.slip":true,"load_cells.roll":1},"revision":3}"#;
        assert_eq!(staged(body, &mut values), Ok(3));
        for (body, name, reason) in [
            (
                r#"{"revision":1,"values":{"web.width":1}}"#,
                "web.width",
                "no such parameter",
            ),
            (
                r#"{"revision":1,"values":{"nips.slip":1}}"#,
                "nips.slip",
                "of another kind",
            ),
            (
                r#"{"revision":1,"values":{"web.width_m":true}}"#,
                "web.width_m",
                "of another kind",
            ),
        ] {
            let refusal = staged(body.as_bytes(), &mut Values::default()).expect_err(body);
            let detail = &refusal.details[0];
            assert_eq!(
                (detail.parameter.as_str(), detail.reason),
                (name, reason),
                "{body}"
            );
        }
        assert!(staged(br#"{"values":{}}"#, &mut Values::default()).is_err());
    }

    #[test]
    fn deep_bodies_are_not_read() {
        assert!(is_shallow(br#"{"a":{"b":[[1]]},"c":"[[[[[[\"[["}"#));
        assert!(!is_shallow(b"[[[[[1]]]]]"));
    }
}
