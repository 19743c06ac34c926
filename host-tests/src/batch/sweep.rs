//! Sweep files: which parameters of a machine take which values.
//!
//! Not here: running them; what values a parameter may have, which is the core's table of parameters.
//!
//! ```toml
//! machine = "NEWS-8000"        # a preset, or a machine file beside this one
//!
//! [vary]
//! web.stiffness_n_m = [220e3, 260e3, 300e3]
//! parent_roll.full_radius_m = { from = 1.0, to = 1.5, steps = 6 }
//! nips.slip = [false, true]
//! "idle[1].friction_n_s_m" = [3.6, 7.2]
//! ```
//!
//! There is a run for each combination of values, the last parameter's changing fastest. `{ from, to, steps }` stands
//! for so many values, equally far from each other, both ends among them. Every combination is held against the
//! parameters' limits before the first one runs; whatever is wrong is told with file, line and parameter.

use std::path::Path;

use anyhow::{Context, Result, anyhow, bail, ensure};
use model_core::machine::{Machine, PRESETS, Parameter, Value, parameters};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::machine_file::{Description, excerpt, integer, number};

/// The most runs of a sweep: on the slowest PC that is still worth it, an hour of short ones.
pub const MOST_RUNS: usize = 1_000_000;

/// The keys of a file.
const MACHINE: &str = "machine";
const VARY: &str = "vary";
/// The keys of equally spaced values.
const SPACED: [&str; 3] = ["from", "to", "steps"];
/// Decimals of a value that was computed between two others: those that its rounding does not reach.
const DECIMALS: usize = 12;

/// Runs of one machine in many variations.
#[derive(Clone, Debug)]
pub struct Sweep {
    /// What is varied.
    machine: Machine,
    axes: Vec<Axis>,
    runs: usize,
}

/// A parameter and its values.
#[derive(Clone, Debug)]
pub struct Axis {
    /// The parameter.
    pub parameter: &'static Parameter,
    /// Its values, at least one.
    pub values: Vec<Value>,
    /// Where the file names it.
    at: usize,
}

/// Where in the text something is wrong, if it can be said, and what.
type Fault = (Option<usize>, anyhow::Error);

impl Sweep {
    /// Reads a file; `machine`, a preset or a machine file, takes the place of the one that the file names.
    pub fn open(path: &Path, machine: Option<&str>) -> Result<Self> {
        let file = path.display().to_string();
        let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {file}"))?;
        let folder = path.parent().unwrap_or(Path::new(""));
        Self::read(&file, &text, folder, machine)
    }

    /// Reads the text of a file in a folder; an error gives the file's name, the line and the reason.
    pub fn read(file: &str, text: &str, folder: &Path, machine: Option<&str>) -> Result<Self> {
        let line = |at: usize| 1 + text.get(..at).unwrap_or(text).matches('\n').count();
        let fault = |(at, reason): Fault| match at {
            Some(at) => anyhow!("{file}:{}: {reason:#}", line(at)),
            None => anyhow!("{file}: {reason:#}"),
        };
        let table = DeTable::parse(text).map_err(|error| {
            let reason = error.message().trim().replace('\n', "; ");
            fault((error.span().map(|span| span.start), anyhow!(reason)))
        })?;
        Self::of(text, table.get_ref(), folder, machine).map_err(fault)
    }

    fn of(text: &str, root: &DeTable, folder: &Path, machine: Option<&str>) -> Result<Self, Fault> {
        let (mut named, mut vary) = (None, None);
        for (key, value) in root {
            let at = Some(key.span().start);
            match key.get_ref().as_ref() {
                MACHINE => named = Some((at, value)),
                VARY => vary = Some((at, value)),
                other => {
                    let reason = anyhow!("{other} is neither {MACHINE} nor {VARY}");
                    return Err((at, reason));
                }
            }
        }
        let machine = match (machine, named) {
            (Some(machine), _) => Description::find(machine).map_err(|error| (None, error))?,
            (None, Some((at, value))) => {
                machine_of(text, value, folder).map_err(|error| (at, error))?
            }
            (None, None) => Description::of(&PRESETS[0]),
        };
        let mut reader = Reader {
            text,
            machine: &machine.machine,
            axes: Vec::new(),
        };
        let nothing = || anyhow!("nothing is varied: {VARY}.<parameter> = [values]");
        let (at, vary) = vary.ok_or_else(|| (None, nothing()))?;
        let Some(table) = vary.get_ref().as_table() else {
            let given = excerpt(text, vary);
            return Err((at, anyhow!("{VARY} = {given} is not a table")));
        };
        reader.table("", table)?;
        let axes = reader.axes;
        if axes.is_empty() {
            return Err((at, nothing()));
        }
        let product = |runs: usize, axis: &Axis| runs.checked_mul(axis.values.len());
        let runs = axes.iter().try_fold(1, product);
        let Some(runs) = runs.filter(|runs| *runs <= MOST_RUNS) else {
            let each: Vec<_> = axes
                .iter()
                .map(|axis| axis.values.len().to_string())
                .collect();
            let each = each.join("·");
            return Err((at, anyhow!("{each} runs are more than {MOST_RUNS}")));
        };
        let sweep = Self {
            machine: machine.machine,
            axes,
            runs,
        };
        (0..runs).try_for_each(|run| sweep.check(run))?;
        Ok(sweep)
    }

    /// What is varied, in the file's order.
    pub fn axes(&self) -> &[Axis] {
        &self.axes
    }

    /// How many runs there are.
    pub fn runs(&self) -> usize {
        self.runs
    }

    /// Web spans of every machine.
    pub fn spans(&self) -> usize {
        self.machine.idle.len() + 1
    }

    /// The values of a run, in the order of the axes.
    pub fn values(&self, run: usize) -> impl Iterator<Item = Value> {
        let mut below = self.runs;
        self.axes.iter().map(move |axis| {
            below /= axis.values.len();
            axis.values[run / below % axis.values.len()]
        })
    }

    /// The machine of a run.
    pub fn machine(&self, run: usize) -> Machine {
        let mut machine = self.machine.clone();
        for (axis, value) in self.axes.iter().zip(self.values(run)) {
            // the kind of every value has been looked at
            let set = axis.parameter.set(&mut machine, value);
            debug_assert_eq!(set, Some(()));
        }
        machine
    }

    /// A run in words: what is varied.
    pub fn describe(&self, run: usize) -> String {
        let pairs = self.axes.iter().zip(self.values(run));
        let pairs: Vec<_> = pairs
            .map(|(axis, value)| format!("{} = {value}", axis.parameter.name))
            .collect();
        pairs.join(", ")
    }

    /// Refuses a run whose machine cannot be, at the line of the parameter that is wrong or, if that is the machine's
    /// own, of the first one that is varied.
    fn check(&self, run: usize) -> Result<(), Fault> {
        let Err(error) = self.machine(run).validate() else {
            return Ok(());
        };
        let blamed = |axis: &&Axis| axis.parameter.name == error.parameter;
        match self.axes.iter().find(blamed) {
            Some(axis) if self.axes.len() == 1 => Err((Some(axis.at), error.into())),
            axis => {
                let at = axis.or(self.axes.first()).map(|axis| axis.at);
                Err((at, anyhow!("{error}: with {}", self.describe(run))))
            }
        }
    }
}

/// The machine that a file names.
fn machine_of(text: &str, value: &Spanned<DeValue>, folder: &Path) -> Result<Description> {
    let Some(name) = value.get_ref().as_str() else {
        bail!("{MACHINE} = {} is not a name", excerpt(text, value));
    };
    let beside = folder.join(name);
    match beside.to_str() {
        Some(beside) if Path::new(beside).is_file() => Description::find(beside),
        _ => Description::find(name),
    }
}

/// The part of a file that says what is varied.
struct Reader<'a> {
    text: &'a str,
    machine: &'a Machine,
    axes: Vec<Axis>,
}

impl Reader<'_> {
    fn table(&mut self, part: &str, table: &DeTable) -> Result<(), Fault> {
        for (key, value) in table {
            let at = key.span().start;
            let name = match part {
                "" => key.get_ref().to_string(),
                part => format!("{part}.{}", key.get_ref()),
            };
            if let Some(parameter) = self.parameter(&name) {
                let values = self
                    .values(parameter, value)
                    .map_err(|error| (Some(at), error))?;
                if self.axes.iter().any(|a| a.parameter.name == name) {
                    return Err((Some(at), anyhow!("{name} stands twice")));
                }
                self.axes.push(Axis {
                    parameter,
                    values,
                    at,
                });
                continue;
            }
            let part = format!("{name}.");
            match value.get_ref() {
                DeValue::Table(table)
                    if varied(self.machine).any(|p| p.name.starts_with(&part)) =>
                {
                    self.table(&name, table)?;
                }
                _ => {
                    let nearest = self.nearest(&name);
                    let reason =
                        anyhow!("there is no parameter {name} to vary; the nearest is {nearest}");
                    return Err((Some(at), reason));
                }
            }
        }
        Ok(())
    }

    fn parameter(&self, name: &str) -> Option<&'static Parameter> {
        varied(self.machine).find(|parameter| parameter.name == name)
    }

    fn nearest(&self, name: &str) -> &'static str {
        varied(self.machine)
            .map(|parameter| parameter.name)
            .min_by_key(|known| strsim::damerau_levenshtein(known, name))
            .unwrap_or("")
    }

    /// The values that a parameter is given.
    fn values(&self, parameter: &Parameter, value: &Spanned<DeValue>) -> Result<Vec<Value>> {
        let name = parameter.name;
        match value.get_ref() {
            DeValue::Array(array) => {
                ensure!(array.iter().len() > 0, "{name} is given no value");
                let of = |value: &Spanned<DeValue>| self.value(parameter, value);
                array.iter().map(of).collect()
            }
            DeValue::Table(spaced) => self.spaced(parameter, spaced),
            _ => bail!(
                "{name} = {} is neither a list of values nor {{ from, to, steps }}",
                excerpt(self.text, value)
            ),
        }
    }

    /// A value of the parameter's kind.
    fn value(&self, parameter: &Parameter, value: &Spanned<DeValue>) -> Result<Value> {
        let given = value.get_ref();
        let (value_of, wanted) = match parameter.get(self.machine) {
            Some(Value::Number(_)) => (number(given).map(Value::Number), "a number"),
            Some(Value::Switch(_)) => (given.as_bool().map(Value::Switch), "true or false"),
            _ => {
                let whole = given.as_integer().and_then(integer);
                let count = whole.and_then(|whole| usize::try_from(whole).ok());
                (count.map(Value::Count), "a whole number from 0")
            }
        };
        value_of.ok_or_else(|| {
            let given = excerpt(self.text, value);
            anyhow!("{} = {given} is not {wanted}", parameter.name)
        })
    }

    fn spaced(&self, parameter: &Parameter, table: &DeTable) -> Result<Vec<Value>> {
        let name = parameter.name;
        for (key, _) in table {
            ensure!(
                SPACED.contains(&key.get_ref().as_ref()),
                "{name}.{} is none of {}",
                key.get_ref(),
                SPACED.join(", ")
            );
        }
        let find = |wanted: &str| {
            let found = table.iter().find(|(key, _)| key.get_ref() == wanted);
            found
                .map(|(_, value)| value)
                .ok_or_else(|| anyhow!("{name}.{wanted} is missing"))
        };
        let end = |wanted: &str| match self.value(parameter, find(wanted)?)? {
            Value::Number(number) if number.is_finite() => Ok(number),
            other => bail!("{name}.{wanted} = {other}: only numbers have others between them"),
        };
        let [from, to, steps] = SPACED;
        let (from, to, steps) = (end(from)?, end(to)?, find(steps)?);
        let count = steps.get_ref().as_integer().and_then(integer);
        let limits = 2..=MOST_RUNS as i128;
        let count = count
            .filter(|count| limits.contains(count))
            .ok_or_else(|| {
                anyhow!(
                    "{name}.steps = {} is not a whole number from 2 to {MOST_RUNS}",
                    excerpt(self.text, steps)
                )
            })?;
        let last = (count - 1) as f64;
        let between = |i: i128| match i as f64 / last {
            0.0 => from,
            1.0 => to,
            // as a person would write it
            share => rounded(from + (to - from) * share),
        };
        Ok((0..count).map(between).map(Value::Number).collect())
    }
}

/// The parameters of a machine that can be varied: all but the lengths of its lists.
fn varied(machine: &Machine) -> impl Iterator<Item = &'static Parameter> {
    parameters().filter(|p| p.length_of().is_none() && p.get(machine).is_some())
}

fn rounded(x: f64) -> f64 {
    format!("{x:.DECIMALS$e}").parse().unwrap_or(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Sweep> {
        Sweep::read("s.toml", text, Path::new(""), None)
    }

    #[test]
    fn there_is_a_run_for_each_combination_the_last_parameter_fastest() {
        let sweep = read(
            "machine = 'LAB-300'\n[vary]\n'idle[1].friction_n_s_m' = [1, 2.5]\nnips = { slip = [true, false] }\n\
             load_cells.roll = [1, 0]\nweb.stiffness_n_m = { from = 1e5, to = 2e5, steps = 11 }\n",
        )
        .unwrap();
        assert_eq!((sweep.runs(), sweep.spans()), (88, 3));
        let runs: Vec<_> = (0..88).map(|run| sweep.describe(run)).collect();
        let about = |friction, slip, roll, k: &str| {
            format!(
                "idle[1].friction_n_s_m = {friction}, nips.slip = {slip}, load_cells.roll = {roll}, \
                 web.stiffness_n_m = {k}"
            )
        };
        assert_eq!(runs[0], about("1.0", true, 1, "100000.0"));
        assert_eq!(runs[1], about("1.0", true, 1, "110000.0"));
        assert_eq!(runs[10], about("1.0", true, 1, "200000.0"));
        assert_eq!(runs[11], about("1.0", true, 0, "100000.0"));
        assert_eq!(runs[87], about("2.5", false, 0, "200000.0"));
        let lab = Description::find("LAB-300").unwrap().machine;
        let mut last = lab.clone();
        last.idle[1].friction_n_s_m = 2.5;
        last.web.stiffness_n_m = 2e5;
        last.nips.slip = false;
        last.load_cells.roll = 0;
        assert_eq!(sweep.machine(87), last);
    }

    #[test]
    fn the_command_line_names_another_machine() {
        let text = "machine = 'NEWS-8000'\n[vary]\nweb.width_m = [1, 2]";
        let sweep = Sweep::read("s.toml", text, Path::new(""), Some("NEWS-8000-UNLUMPED"));
        assert_eq!(sweep.unwrap().spans(), 8);
    }

    #[test]
    fn bad_files_are_refused_with_file_line_and_reason() {
        for (text, reason) in [
            ("", "s.toml: nothing is varied: vary.<parameter> = "),
            ("[vary]", "s.toml:1: nothing is varied"),
            ("vary = 3", "s.toml:1: vary = 3 is not a table"),
            ("[vary]\nweb.width_m = ", "s.toml:2: "),
            ("very = 3", "s.toml:1: very is neither machine nor vary"),
            ("machine = 3\n[vary]", "s.toml:1: machine = 3 is not a name"),
            (
                "machine = 'NEWS-9'\n[vary]",
                "s.toml:1: \"NEWS-9\" is neither a machine nor a file; the machines are NEWS-8000, ",
            ),
            (
                "[vary]\n'web.widht_m' = [1]",
                "s.toml:2: there is no parameter web.widht_m to vary; the nearest is web.width_m",
            ),
            (
                "[vary]\nwep.width_m = [1]",
                "s.toml:2: there is no parameter wep to vary; ",
            ),
            (
                "[vary]\n[vary.web]\nwidht_m = [1]",
                "s.toml:3: there is no parameter web.widht_m to vary; the nearest is web.width_m",
            ),
            (
                "[vary]\n'idle[2].span_m' = [1]",
                "s.toml:2: there is no parameter idle[2].span_m to vary; the nearest is idle[0].span_m",
            ),
            (
                "[vary]\n'idle (number of rolls)' = [2]",
                "s.toml:2: there is no parameter idle (number of rolls) to vary; ",
            ),
            (
                "[vary]\nweb = [1]",
                "s.toml:2: there is no parameter web to vary; ",
            ),
            (
                "[vary]\nweb.width_m = 6",
                "s.toml:2: web.width_m = 6 is neither a list of values nor { from, to, steps }",
            ),
            (
                "[vary]\nweb.width_m = []",
                "s.toml:2: web.width_m is given no value",
            ),
            (
                "[vary]\nweb.width_m = [1, true]",
                "s.toml:2: web.width_m = true is not a number",
            ),
            (
                "[vary]\nnips.slip = [0]",
                "s.toml:2: nips.slip = 0 is not true or false",
            ),
            (
                "[vary]\nload_cells.roll = [-1]",
                "s.toml:2: load_cells.roll = -1 is not a whole number from 0",
            ),
            (
                "[vary]\nload_cells.roll = {from=0, to=1, steps=2}",
                "s.toml:2: load_cells.roll.from = 0: only numbers have others between them",
            ),
            (
                "[vary]\nweb.width_m = {from=1, to=2}",
                "s.toml:2: web.width_m.steps is missing",
            ),
            (
                "[vary]\nweb.width_m = {from=1, to=2, step=2}",
                "s.toml:2: web.width_m.step is none of from, to, steps",
            ),
            (
                "[vary]\nweb.width_m = {from=1, to=2, steps=1}",
                "s.toml:2: web.width_m.steps = 1 is not a whole number from 2 to 1000000",
            ),
            (
                "[vary]\nweb.width_m = {from=1, to=inf, steps=3}",
                "s.toml:2: web.width_m.to = inf: ",
            ),
            (
                "[vary]\n'web.width_m' = [1]\nweb.width_m = [2]",
                "s.toml:3: web.width_m stands twice",
            ),
            (
                "[vary]\nweb.width_m = [6, 16]",
                "s.toml:2: web.width_m = 16 is outside 0.05 to 15",
            ),
            (
                "[vary]\nweb.width_m = [nan]",
                "s.toml:2: web.width_m = NaN is outside 0.05 to 15",
            ),
            (
                "[vary]\nweb.width_m = [6, 7]\nweb.strength_n_m = [2000, 500]",
                "s.toml:2: operation.tension_n_m = 350 is outside 1 to 250: with web.width_m = 6.0, web.strength_n_m = 500.0",
            ),
            (
                "\n[vary]\nweb.width_m = {from=1, to=2, steps=1000}\nlast_span_m = {from=1, to=2, steps=1001}",
                "s.toml:2: 1000·1001 runs are more than 1000000",
            ),
        ] {
            let error = format!("{:#}", read(text).expect_err(text));
            assert!(error.starts_with(reason), "{text:?}: {error}");
        }
    }
}
