//! Machine files: a machine as TOML.
//!
//! Not here: what a machine may be. Names, units, limits and descriptions are the core's table of parameters.
//!
//! A file names the preset that it starts from, and of the parameters those that differ. Tables are parts, keys are
//! the parameters' names in them:
//!
//! ```toml
//! preset = "NEWS-8000"
//! last_span_m = 2.8
//!
//! [web]
//! width_m = 6.5
//! ```
//!
//! A list (`[[idle]]`, `[[nips.rider_load]]`) replaces the preset's whole list, so that its elements name all they
//! have. Whatever is wrong is told with file, line and parameter.

use std::io::{self, Write};
use std::path::Path;

use anyhow::{Context, Result, anyhow, bail, ensure};
use model_core::machine::{Machine, MachineError, PRESETS, Parameter, Preset, Value, parameters};
use toml::Spanned;
use toml::de::{DeArray, DeInteger, DeTable, DeValue};

/// The key that names the preset.
const PRESET: &str = "preset";
/// Where a parameter's description begins in a file.
const COMMENT_COLUMN: usize = 34;
/// Digits of a limit in a description.
const LIMIT_DIGITS: usize = 6;
/// Characters of a file that an error repeats.
const EXCERPT: usize = 40;

/// A machine, and the preset that it was made from.
#[derive(Clone, Debug, PartialEq)]
pub struct Description {
    /// The machine.
    pub machine: Machine,
    /// The preset's name.
    pub preset: &'static str,
}

impl Description {
    /// A preset as it ships.
    pub fn of(&(preset, machine): &Preset) -> Self {
        Self {
            machine: machine(),
            preset,
        }
    }

    /// A preset by its name, or else what a file describes.
    pub fn find(name_or_file: &str) -> Result<Self> {
        if let Some(preset) = preset(name_or_file) {
            return Ok(Self::of(preset));
        }
        ensure!(
            Path::new(name_or_file).exists(),
            "{name_or_file:?} is neither a machine nor a file; the machines are {}",
            preset_names()
        );
        let text = std::fs::read_to_string(name_or_file)
            .with_context(|| format!("cannot read {name_or_file}"))?;
        Self::read(name_or_file, &text)
    }

    /// Reads the text of a file; an error gives the file's name, the line and the reason.
    pub fn read(file: &str, text: &str) -> Result<Self> {
        let line = |at: usize| 1 + text.get(..at).unwrap_or(text).matches('\n').count();
        let fault = |(at, reason): Fault| match at {
            Some(at) => anyhow!("{file}:{}: {reason}", line(at)),
            None => anyhow!("{file}: {reason}"),
        };
        let table = DeTable::parse(text).map_err(|error| {
            // the parser's message is a line each for what it found and what it expected
            let reason = error.message().trim().replace('\n', "; ");
            fault((error.span().map(|span| span.start), anyhow!(reason)))
        })?;
        let mut reader = Reader::new(table.get_ref(), text).map_err(fault)?;
        reader.table("", table.get_ref()).map_err(fault)?;
        reader.finish().map_err(fault)
    }

    /// Writes the whole machine as a file, each parameter with unit, limits and description.
    pub fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        let present = || parameters().filter(|p| p.get(&self.machine).is_some());
        writeln!(out, "{PRESET} = \"{}\"", self.preset)?;
        // keys outside of tables stand before the first table
        for parameter in present().filter(|p| split(p).0.is_empty()) {
            self.write_line(out, parameter)?;
        }
        let mut open = "";
        for parameter in present().filter(|p| !split(p).0.is_empty()) {
            let (table, _) = split(parameter);
            if parameter.length_of().is_some() {
                write!(out, "\n# {}", self.about(parameter))?;
                continue;
            }
            if table != open {
                match table.split_once('[') {
                    Some((list, _)) => writeln!(out, "\n[[{list}]]")?,
                    None => writeln!(out, "\n[{table}]")?,
                }
                open = table;
            }
            self.write_line(out, parameter)?;
        }
        Ok(())
    }

    fn write_line(&self, out: &mut dyn Write, parameter: &Parameter) -> io::Result<()> {
        let (_, key) = split(parameter);
        let value = parameter.get(&self.machine);
        let value = value.map_or(String::new(), |value| value.to_string());
        let assignment = format!("{key} = {value}");
        let about = self.about(parameter);
        writeln!(out, "{assignment:<COMMENT_COLUMN$}# {about}")
    }

    /// A parameter in words: unit, limits, what it is, what the preset has instead.
    fn about(&self, parameter: &Parameter) -> String {
        let value = parameter.get(&self.machine);
        let limits = parameter.limits(&self.machine).unwrap_or(0.0..=0.0);
        let [low, high] = [limits.start(), limits.end()].map(|limit| rounded(*limit));
        let mut about = match (value, parameter.unit) {
            (Some(Value::Switch(_)), _) => String::new(),
            (_, "") => format!("{low} to {high}: "),
            (_, unit) => format!("{low} to {high} {unit}: "),
        };
        if parameter.length_of().is_some() {
            about.insert_str(0, ": ");
            about.insert_str(0, parameter.name);
        }
        about += parameter.about;
        let base = preset(self.preset).map(|(_, machine)| machine());
        match base.map(|base| parameter.get(&base)) {
            Some(Some(other)) if Some(other) != value => {
                format!("{about} ({}: {other})", self.preset)
            }
            _ => about,
        }
    }
}

/// The preset of a name.
fn preset(name: &str) -> Option<&'static Preset> {
    PRESETS.iter().find(|(n, _)| n.eq_ignore_ascii_case(name))
}

fn preset_names() -> String {
    let names: Vec<_> = PRESETS.iter().map(|(name, _)| *name).collect();
    names.join(", ")
}

/// The table that a parameter stands in, and its key there: `idle[2].span_m` is `span_m` in `idle[2]`.
fn split(parameter: &Parameter) -> (&'static str, &'static str) {
    match parameter.length_of() {
        Some(list) => (list, list),
        None => parameter
            .name
            .rsplit_once('.')
            .unwrap_or(("", parameter.name)),
    }
}

/// A limit that was computed, without the last digits of the computation.
fn rounded(limit: f64) -> f64 {
    let digits = LIMIT_DIGITS - 1;
    format!("{limit:.digits$e}").parse().unwrap_or(limit)
}

/// Where in the text something is wrong, if it can be said, and what.
type Fault = (Option<usize>, anyhow::Error);

/// A file as it is read.
struct Reader<'a> {
    text: &'a str,
    preset: &'static str,
    base: Machine,
    machine: Machine,
    /// What the file gives, and where.
    given: Vec<(&'static Parameter, usize)>,
}

impl<'a> Reader<'a> {
    fn new(root: &DeTable, text: &'a str) -> Result<Self, Fault> {
        let names = preset_names();
        let (_, value) = root
            .iter()
            .find(|(key, _)| key.get_ref() == PRESET)
            .ok_or_else(|| {
                let reason = "the preset is missing that the machine starts from";
                (None, anyhow!("{reason}: {PRESET} = one of {names}"))
            })?;
        let named = value.get_ref().as_str().and_then(preset);
        let &(preset, machine) = named.ok_or_else(|| {
            let given = excerpt(text, value);
            let reason = anyhow!("{PRESET} = {given} is not one of {names}");
            (Some(value.span().start), reason)
        })?;
        Ok(Self {
            text,
            preset,
            base: machine(),
            machine: machine(),
            given: Vec::new(),
        })
    }

    /// Takes what a table gives.
    fn table(&mut self, part: &str, table: &DeTable) -> Result<(), Fault> {
        for (key, value) in table {
            let at = key.span().start;
            let key = key.get_ref();
            let name = match part {
                "" if key == PRESET => continue,
                "" => key.to_string(),
                part => format!("{part}.{key}"),
            };
            let plain = key.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
            if !plain || !names().any(|known| known == name) {
                let nearest = nearest(&name);
                let reason = anyhow!("there is no parameter {name}; the nearest is {nearest}");
                return Err((Some(at), reason));
            }
            self.value(&name, at, value)?;
        }
        Ok(())
    }

    /// Takes what a name is given: a parameter's value, a part or a list.
    fn value(&mut self, name: &str, at: usize, value: &Spanned<DeValue>) -> Result<(), Fault> {
        let begins = |with: char| {
            let rest = |p: &'static Parameter| p.name.strip_prefix(name);
            parameters()
                .filter_map(rest)
                .any(|rest| rest.starts_with(with))
        };
        let given = excerpt(self.text, value);
        match (Machine::parameter(name), value.get_ref()) {
            (Some(parameter), value) => {
                self.set(parameter, value, given)
                    .map_err(|reason| (Some(at), reason))?;
                self.given.push((parameter, at));
                Ok(())
            }
            (None, DeValue::Array(array)) if begins('[') => self.list(name, at, array),
            (None, DeValue::Table(table)) if begins('.') => self.table(name, table),
            _ => {
                let kind = if begins('[') { "list" } else { "table" };
                Err((Some(at), anyhow!("{name} = {given} is not a {kind}")))
            }
        }
    }

    /// Replaces a list.
    fn list(&mut self, name: &str, at: usize, array: &DeArray) -> Result<(), Fault> {
        let here = |reason| (Some(at), reason);
        if let Some(length) = parameters().find(|p| p.length_of() == Some(name)) {
            let count = Value::Count(array.len());
            if length.set(&mut self.machine, count).is_none() || array.is_empty() {
                return Err(here(self.outside(length, count.number())));
            }
            self.given.push((length, at));
        }
        let elements = |machine: &Machine, prefix: &str| {
            let of_list = |p: &&Parameter| p.name.starts_with(prefix) && p.get(machine).is_some();
            parameters().filter(of_list).collect::<Vec<_>>()
        };
        for (i, element) in array.iter().enumerate() {
            let name_i = format!("{name}[{i}]");
            let at = element.span().start;
            let fields = elements(&self.machine, &name_i);
            self.value(&name_i, at, element)?;
            self.complete(&fields)
                .map_err(|reason| (Some(at), reason))?;
        }
        self.complete(&elements(&self.machine, &format!("{name}[")))
            .map_err(here)
    }

    /// Refuses a list, or an element of one, that leaves something out.
    fn complete(&self, needed: &[&'static Parameter]) -> Result<()> {
        let given = |p: &&Parameter| self.given.iter().any(|(given, _)| given.name == p.name);
        match needed.iter().find(|p| !given(p)) {
            None => Ok(()),
            Some(missing) => bail!(
                "{} is missing: a list replaces the whole list",
                missing.name
            ),
        }
    }

    /// Gives a parameter the value that was written as `given`.
    fn set(&mut self, parameter: &'static Parameter, value: &DeValue, given: &str) -> Result<()> {
        let kind = parameter.get(&self.machine);
        let (value, wanted) = match kind {
            Some(Value::Number(_)) => (number(value).map(Value::Number), "a number"),
            Some(Value::Switch(_)) => (value.as_bool().map(Value::Switch), "true or false"),
            _ => match value.as_integer().and_then(integer) {
                Some(whole) => match usize::try_from(whole) {
                    Ok(count) => (Some(Value::Count(count)), ""),
                    Err(_) => return Err(self.outside(parameter, whole as f64)),
                },
                None => (None, "a whole number"),
            },
        };
        value
            .and_then(|value| parameter.set(&mut self.machine, value))
            .ok_or_else(|| anyhow!("{} = {given} is not {wanted}", parameter.name))
    }

    fn outside(&self, parameter: &'static Parameter, value: f64) -> anyhow::Error {
        let limits = parameter.limits(&self.machine).unwrap_or(0.0..=0.0);
        MachineError {
            parameter: parameter.name,
            value,
            low: *limits.start(),
            high: *limits.end(),
        }
        .into()
    }

    /// The machine, if it is one.
    fn finish(self) -> Result<Description, Fault> {
        if let Err(error) = self.machine.validate() {
            return Err(self.explain(error));
        }
        Ok(Description {
            machine: self.machine,
            preset: self.preset,
        })
    }

    /// Which of the file's lines is to blame: the one that gives the value or, if the value is the preset's, the one
    /// that moved its limit.
    fn explain(&self, error: MachineError) -> Fault {
        let given = self.given.iter().find(|(p, _)| p.name == error.parameter);
        if let Some((_, at)) = given {
            return (Some(*at), error.into());
        }
        let limits = |m: &Machine| Machine::parameter(error.parameter)?.limits(m);
        let wrong = limits(&self.machine);
        for (parameter, at) in &self.given {
            let mut without = self.machine.clone();
            let before = parameter.get(&self.base);
            let undone = before.and_then(|value| parameter.set(&mut without, value));
            if undone.is_some() && limits(&without) != wrong {
                let (preset, name) = (self.preset, parameter.name);
                let reason = anyhow!("{error}: {preset}'s value does not go with {name}");
                return (Some(*at), reason);
            }
        }
        (None, error.into())
    }
}

/// All names that a file may give something: parameters, parts, lists and their elements.
fn names() -> impl Iterator<Item = &'static str> {
    let plain = parameters()
        .filter(|p| p.length_of().is_none())
        .map(|p| p.name);
    plain.flat_map(|name| {
        let ends = name.match_indices(['.', '[']).map(|(end, _)| end);
        ends.chain([name.len()]).map(move |end| &name[..end])
    })
}

/// The name that a misspelt one is most likely meant to be.
fn nearest(name: &str) -> &'static str {
    names()
        .min_by_key(|known| strsim::damerau_levenshtein(known, name))
        .unwrap_or("")
}

pub(crate) fn number(value: &DeValue) -> Option<f64> {
    match value {
        DeValue::Float(float) => float.as_str().parse().ok(),
        DeValue::Integer(whole) => integer(whole).map(|whole| whole as f64),
        _ => None,
    }
}

pub(crate) fn integer(whole: &DeInteger) -> Option<i128> {
    i128::from_str_radix(whole.as_str(), whole.radix()).ok()
}

/// A value as the file has it, or the beginning of it.
pub(crate) fn excerpt<'a>(text: &'a str, value: &Spanned<DeValue>) -> &'a str {
    let all = text.get(value.span()).unwrap_or("");
    let line = all.lines().next().unwrap_or("");
    let end = line
        .char_indices()
        .nth(EXCERPT)
        .map_or(line.len(), |(end, _)| end);
    &line[..end]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Description> {
        Description::read("m.toml", text)
    }

    #[test]
    fn a_file_names_only_what_differs_from_its_preset() {
        let text = "preset = 'news-8000'\nlast_span_m = 3\nencoder_pulses = 0x400\n\
                    motors.uw.power_w = 6e5\n\
                    operation.front_share = [{diameter_m=0.1, share=0.5}, {diameter_m=1, share=0.4}]\n\
                    [nips]\nslip = true\n[[nips.rider_load]]\ndiameter_m = 1.0\nload_n_m = 400\n";
        let machine = read(text).unwrap().machine;
        let mut expected = Machine::news_8000();
        expected.last_span_m = 3.0;
        expected.encoder_pulses = 1024.0;
        expected.motors.uw.power_w = 600e3;
        let shares = &mut expected.operation.front_share;
        shares[0].share = 0.5;
        (shares[1].diameter_m, shares[1].share) = (1.0, 0.4);
        expected.nips.slip = true;
        expected.nips.rider_load.truncate(1);
        expected.nips.rider_load[0].diameter_m = 1.0;
        expected.nips.rider_load[0].load_n_m = 400.0;
        assert_eq!(machine, expected);
        assert_eq!(expected.differences(&Machine::news_8000()).count(), 10);
    }

    #[test]
    fn bad_files_are_refused_with_file_line_and_reason() {
        for (text, reason) in [
            ("", "m.toml: the preset is missing"),
            (
                "preset = 'NEWS-9'",
                "m.toml:1: preset = 'NEWS-9' is not one of NEWS-8000, ",
            ),
            (
                "preset = 8000",
                "m.toml:1: preset = 8000 is not one of NEWS-8000, ",
            ),
            ("\npreset = ", "m.toml:2: "),
            ("{}\npreset = 'LAB-300'", "m.toml:3: duplicate key"),
            (
                "{}\n[web]\nwidht_m = 6",
                "m.toml:4: there is no parameter web.widht_m; the nearest is web.width_m",
            ),
            (
                "{}\n[wep]\nwidth_m = 6",
                "m.toml:3: there is no parameter wep; the nearest is web",
            ),
            (
                "{}\n'web.width_m' = 6",
                "m.toml:3: there is no parameter web.width_m; ",
            ),
            (
                "{}\n'idle (number of rolls)' = 2",
                "m.toml:3: there is no parameter idle (number of rolls); ",
            ),
            (
                "{}\nweb.width_m = '6'",
                "m.toml:3: web.width_m = '6' is not a number",
            ),
            (
                "{}\nweb.width_m = [6]",
                "m.toml:3: web.width_m = [6] is not a number",
            ),
            (
                "{}\nweb.width_m = 16",
                "m.toml:3: web.width_m = 16 is outside 0.05 to 15",
            ),
            (
                "{}\nweb.width_m = nan",
                "m.toml:3: web.width_m = NaN is outside 0.05 to 15",
            ),
            (
                "{}\nweb.width_m = -inf",
                "m.toml:3: web.width_m = -inf is outside 0.05 to 15",
            ),
            ("{}\nweb = 6", "m.toml:3: web = 6 is not a table"),
            (
                "{}\nnips.slip = 1",
                "m.toml:3: nips.slip = 1 is not true or false",
            ),
            (
                "{}\nload_cells.roll = 0.5",
                "m.toml:3: load_cells.roll = 0.5 is not a whole number",
            ),
            (
                "{}\nload_cells.roll = -1",
                "m.toml:3: load_cells.roll = -1 is outside 0 to 1",
            ),
            (
                "{}\nload_cells.roll = 2",
                "m.toml:3: load_cells.roll = 2 is outside 0 to 1",
            ),
            (
                "{}\nidle = []",
                "m.toml:3: idle (number of rolls) = 0 is outside 1 to 7",
            ),
            (
                "{}\nidle = [0,0,0,0,0,0,0,0]",
                "m.toml:3: idle (number of rolls) = 8 is outside 1 to 7",
            ),
            ("{}\nidle = 2", "m.toml:3: idle = 2 is not a list"),
            ("{}\nidle = [2]", "m.toml:3: idle[0] = 2 is not a table"),
            (
                "{}\n[idle]\nspan_m = 2",
                "m.toml:3: idle = [idle] is not a list",
            ),
            (
                "{}\n[[idle]]\nspan_m = 2",
                "m.toml:3: idle[0].radius_m is missing: a list replaces",
            ),
            (
                "{}\n[[idle]]\nspam_m = 2",
                "m.toml:4: there is no parameter idle[0].spam_m; the nearest is idle[0].span_m",
            ),
            (
                "{}\noperation.front_share = [{diameter_m=1}]",
                "m.toml:3: operation.front_share[0].share is missing",
            ),
            (
                "{}\noperation.front_share = [{diameter_m=1, share=2}]",
                "m.toml:3: operation.front_share[0].share = 2 is outside 0 to 1",
            ),
            (
                "preset = 'NEWS-8000-UNLUMPED'\nidle = [{span_m=1, radius_m=1, inertia_kg_m2=1, friction_n_s_m=1, eccentricity_m=0}]",
                "m.toml:2: load_cells.roll = 4 is outside 0 to 0: NEWS-8000-UNLUMPED's value does not go with idle (number of rolls)",
            ),
            (
                "{}\n[web]\nwidth_m = 6\nstrength_n_m = 100",
                "m.toml:5: operation.tension_n_m = 350 is outside 1 to 50: NEWS-8000's value does not go with web.strength_n_m",
            ),
        ] {
            let text = text.replace("{}", "# a comment\npreset = 'NEWS-8000'");
            let error = format!("{:#}", read(&text).expect_err(&text));
            assert!(error.starts_with(reason), "{text:?}: {error}");
        }
    }

    #[test]
    fn an_unknown_machine_is_answered_with_the_names_of_the_presets() {
        let error = Description::find("WIND-9").unwrap_err().to_string();
        assert!(
            error.starts_with(
                "\"WIND-9\" is neither a machine nor a file; the machines are NEWS-8000, "
            ),
            "{error}"
        );
    }
}
