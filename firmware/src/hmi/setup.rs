//! The machine's parameters: in use, staged, applied as one.
//!
//! Not here: what they do. A machine is valid when its description says so and this firmware can compute it; until
//! then it is not even staged.

use heapless::Vec;
use model_core::machine::{
    MAX_FRONT_SHARES, MAX_RIDER_LOADS, MAX_SPANS, Machine, PRESETS, Parameter, Value, parameters,
};
use serde::de::{DeserializeSeed, Deserializer, IgnoredAny, MapAccess, Visitor};

use super::answer::{Detail, Refusal, cut};
use crate::SPANS;

/// Why a machine of another number of rolls cannot run.
pub const OTHER_SPANS: &str = "this firmware computes two idle rolls";

/// The parameters.
#[derive(Debug)]
pub struct Setup {
    /// What the simulator runs.
    pub in_use: Machine,
    /// What it shall run next.
    pub staged: Option<Machine>,
    /// Counts up with every machine that is applied.
    pub revision: u32,
    /// The preset that it came from, with changes or not.
    pub preset: &'static str,
    staged_preset: Option<&'static str>,
}

impl Setup {
    /// The machine at power-up.
    pub fn new(machine: &Machine) -> Self {
        let (preset, _) = PRESETS
            .iter()
            .find(|(_, preset)| preset() == *machine)
            .unwrap_or(&PRESETS[0]);
        Self {
            in_use: machine.clone(),
            staged: None,
            revision: 1,
            preset,
            staged_preset: None,
        }
    }

    /// Refuses who has seen another machine than the one in use.
    fn is_fresh(&self, revision: u32) -> Result<(), Refusal> {
        if revision == self.revision {
            return Ok(());
        }
        let now = self.revision;
        Err(Refusal::new(
            409,
            format_args!(
                "somebody has applied parameters meanwhile: revision {revision} is stale, it is {now} now"
            ),
        ))
    }

    /// Stages some values beside those that are staged already: all of them or none.
    ///
    /// # Errors
    /// Stale, or with each value that cannot be.
    pub fn stage(&mut self, revision: u32, values: &Values) -> Result<(), Refusal> {
        self.is_fresh(revision)?;
        let mut machine = self.staged.as_ref().unwrap_or(&self.in_use).clone();
        let mut refusal = Refusal::new(422, format_args!("some values cannot be"));
        // In the table's order, in which a list has its length before its elements are looked at.
        for parameter in parameters() {
            let of = |(p, _): &&(&Parameter, Value)| p.name == parameter.name;
            if let Some((_, value)) = values.list.iter().find(of)
                && parameter.set(&mut machine, *value).is_none()
            {
                refusal.add(Detail {
                    unit: parameter.unit,
                    ..Detail::new(parameter.name, value, "the machine has no such element")
                });
            }
        }
        if refusal.details.is_empty() {
            check(&machine, &mut refusal);
        }
        if !refusal.details.is_empty() {
            return Err(refusal);
        }
        self.staged = Some(machine);
        Ok(())
    }

    /// Stages a preset.
    ///
    /// # Errors
    /// Stale, unknown, or one that this firmware cannot compute.
    pub fn stage_preset(&mut self, revision: u32, name: &str) -> Result<(), Refusal> {
        self.is_fresh(revision)?;
        let Some((preset, machine)) = PRESETS.iter().find(|(preset, _)| *preset == name) else {
            let mut refusal = Refusal::new(422, format_args!("there is no preset {name}"));
            refusal.add(Detail::new("name", "", "no such preset"));
            return Err(refusal);
        };
        let machine = machine();
        let mut refusal = Refusal::new(422, format_args!("{preset} cannot run here"));
        check(&machine, &mut refusal);
        if !refusal.details.is_empty() {
            return Err(refusal);
        }
        (self.staged, self.staged_preset) = (Some(machine), Some(*preset));
        Ok(())
    }

    /// Forgets what is staged.
    pub fn unstage(&mut self) {
        (self.staged, self.staged_preset) = (None, None);
    }

    /// What is staged is in use from now on.
    ///
    /// # Errors
    /// Stale, or nothing is staged.
    pub fn apply(&mut self, revision: u32) -> Result<Machine, Refusal> {
        self.is_fresh(revision)?;
        let machine = self
            .staged
            .take()
            .ok_or_else(|| Refusal::new(409, format_args!("nothing is staged")))?;
        self.preset = self.staged_preset.take().unwrap_or(self.preset);
        self.is_in_use(machine.clone());
        Ok(machine)
    }

    /// Another machine is in use from now on.
    pub fn is_in_use(&mut self, machine: Machine) {
        self.in_use = machine;
        self.revision += 1;
    }
}

/// Adds what is wrong with a machine.
fn check(machine: &Machine, refusal: &mut Refusal) {
    if !fits(machine) {
        refusal.add(Detail::new(
            "idle (number of rolls)",
            machine.idle.len(),
            OTHER_SPANS,
        ));
    }
    for parameter in parameters() {
        if let Err(error) = parameter.check(machine) {
            refusal.add(Detail {
                limits: Some((error.low, error.high)),
                unit: parameter.unit,
                ..Detail::number(parameter.name, error.value, "outside its limits")
            });
        }
    }
}

/// Whether this firmware can compute the machine.
pub fn fits(machine: &Machine) -> bool {
    machine.idle.len() + 1 == SPANS
}

/// The part of the machine that a parameter belongs to.
pub fn part(parameter: &Parameter) -> &'static str {
    match parameter.name.split_once(['.', '[', ' ']) {
        Some((part, _)) => part,
        None => "machine",
    }
}

/// A machine with the longest lists, which has every parameter.
fn longest() -> Machine {
    let mut machine = Machine::news_8000();
    for (parameter, most) in [
        ("idle (number of rolls)", MAX_SPANS - 1),
        ("nips.rider_load (number of points)", MAX_RIDER_LOADS),
        ("operation.front_share (number of points)", MAX_FRONT_SHARES),
    ] {
        // Their names are checked by a test.
        let _ = Machine::parameter(parameter).map(|p| p.set(&mut machine, Value::Count(most)));
    }
    machine
}

/// As many as a machine can have, and some.
const VALUES: usize = 192;

/// Values of parameters, as they come in.
#[derive(Debug, Default)]
pub struct Values {
    list: Vec<(&'static Parameter, Value), VALUES>,
}

/// Reads values, each of its parameter's kind; tells what it could not read.
pub struct ReadValues<'a> {
    /// Where they go.
    pub values: &'a mut Values,
    /// What is wrong.
    pub wrong: &'a mut Option<Detail>,
}

impl<'de> DeserializeSeed<'de> for ReadValues<'_> {
    type Value = ();
    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_map(self)
    }
}

impl<'de> Visitor<'de> for ReadValues<'_> {
    type Value = ();

    fn expecting(&self, f: &mut core::fmt::Formatter) -> core::fmt::Result {
        f.write_str("an object of parameters and their values")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        let longest = longest();
        while let Some(name) = map.next_key::<&str>()? {
            let Some(parameter) = Machine::parameter(name) else {
                self.wrong
                    .get_or_insert(Detail::new(name, "", "no such parameter"));
                map.next_value::<IgnoredAny>()?;
                continue;
            };
            // Until the value has been read, it is the one that is wrong.
            let mut detail = Detail::new(name, "", "of another kind");
            detail.unit = parameter.unit;
            let before = self.wrong.replace(detail);
            let value = match parameter.get(&longest) {
                Some(Value::Switch(_)) => Value::Switch(map.next_value()?),
                Some(Value::Count(_)) => Value::Count(map.next_value::<u16>()?.into()),
                _ => Value::Number(map.next_value()?),
            };
            *self.wrong = before;
            if self.values.list.push((parameter, value)).is_err() {
                self.wrong
                    .get_or_insert(Detail::new(name, "", "too many values at once"));
            }
        }
        Ok(())
    }
}

/// A refusal of values that could not be read.
pub fn not_read(wrong: Option<Detail>) -> Refusal {
    let mut refusal = Refusal::new(422, format_args!("the values cannot be read"));
    if let Some(detail) = wrong {
        refusal.error = cut("a value cannot be read");
        refusal.add(detail);
    }
    refusal
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_machine_has_every_parameter() {
        let longest = longest();
        assert!(parameters().all(|parameter| parameter.get(&longest).is_some()));
    }

    #[test]
    fn some_presets_fit_and_others_say_why_not() {
        let mut setup = Setup::new(&Machine::news_8000());
        for (name, machine) in PRESETS {
            let staged = setup.stage_preset(1, name);
            match fits(&machine()) {
                true => assert_eq!(staged, Ok(()), "{name}"),
                false => {
                    let refusal = staged.expect_err(name);
                    assert_eq!(refusal.details[0].reason, OTHER_SPANS);
                }
            }
        }
        assert!(setup.stage_preset(2, "NEWS-8000").is_err());
    }
}
