//! Reads a scenario's file and those that it includes.
//!
//! Not here: playing it. What can be found out before is refused here, with file, line and reason.

use std::fmt::Display;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, bail, ensure};
use model_core::machine::PRESETS;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::place::{Assignment, Condition, Given, Operator, Place, Reference, Term, value_of};
use super::player::{PRESS, Timing};
use super::{
    Act, At, CYCLES_PER_S, During, Ends, Expectation, Scenario, Step, Time, files, library, seconds,
};
use crate::machine_file::{Description, excerpt, integer, number};

/// Longest time that a file may name, s: a day.
const LONGEST_S: f64 = 86_400.0;
/// A time is this near to a whole drive cycle, of a cycle: what writing it in decimals may be off by.
const WHOLE: f64 = 1e-6;
/// Where the preludes are, in the library.
const PRELUDE: &str = "prelude";

/// The key of what is played before a file.
const START: &str = "start";

const TOP: &[&str] = &["title", "about", START, "machine", "set", "always", "step"];
const STEP: &[&str] = &[
    "say",
    "at",
    "set",
    "press",
    "heartbeat",
    "for",
    "until",
    "within",
    "expect",
    "include",
];
const EXPECT: &[&str] = &["signal", "is", "min", "max", "of", "during"];

type Value<'a> = Spanned<DeValue<'a>>;

/// Reads a file and all that it includes.
pub fn open(path: &Path) -> Result<Scenario> {
    let mut script = Script::default();
    script.file(path)?;
    let machine = script
        .machine
        .unwrap_or_else(|| Description::of(&PRESETS[0]));
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    Ok(Scenario {
        title: script.title.unwrap_or_else(|| name.clone().into_owned()),
        name: name.into_owned(),
        machine,
        set: script.set,
        acts: script.acts,
    })
}

/// All files of a scenario, as they are read.
#[derive(Default)]
struct Script {
    /// The files being read, the innermost last.
    open: Vec<PathBuf>,
    title: Option<String>,
    machine: Option<Description>,
    set: Vec<Assignment>,
    acts: Vec<Act>,
    clocks: usize,
    always: usize,
    /// The file being read is not the start of another, or it is the start of one that is not.
    included: bool,
    /// The earliest time that the next step can begin, drive cycles.
    earliest: u64,
}

/// A file being read.
struct File<'a> {
    path: &'a Path,
    name: String,
    text: &'a str,
}

impl File<'_> {
    fn at(&self, at: usize) -> At {
        let before = self.text.get(..at).unwrap_or(self.text);
        At {
            file: self.name.clone(),
            line: 1 + before.matches('\n').count(),
        }
    }

    fn fault(&self, at: usize, reason: impl Display) -> anyhow::Error {
        anyhow!("{}: {reason}", self.at(at))
    }

    /// An error's place, where it has none yet.
    fn place<T>(&self, value: &Value, result: Result<T>) -> Result<T> {
        result.map_err(|error| self.fault(value.span().start, format!("{error:#}")))
    }

    fn wrong<T>(&self, key: &str, value: &Value, wanted: &str) -> Result<T> {
        let given = excerpt(self.text, value);
        Err(self.fault(
            value.span().start,
            format!("{key} = {given} is not {wanted}"),
        ))
    }

    fn known(&self, table: &DeTable, keys: &[&str]) -> Result<()> {
        for (key, _) in table {
            let name = key.get_ref();
            if !keys.contains(&name.as_ref()) {
                let nearest = keys
                    .iter()
                    .min_by_key(|known| strsim::damerau_levenshtein(known, name));
                let nearest = nearest.copied().unwrap_or_default();
                let reason = format!("there is no key {name} here; the nearest is {nearest}");
                return Err(self.fault(key.span().start, reason));
            }
        }
        Ok(())
    }

    fn table<'v, 'a>(&self, key: &str, value: &'v Value<'a>) -> Result<&'v DeTable<'a>> {
        match value.get_ref() {
            DeValue::Table(table) => Ok(table),
            _ => self.wrong(key, value, "a table"),
        }
    }

    fn list<'v, 'a>(&self, key: &str, value: &'v Value<'a>) -> Result<&'v [Value<'a>]> {
        match value.get_ref() {
            DeValue::Array(array) => Ok(array),
            _ => self.wrong(key, value, "a list"),
        }
    }

    fn text<'v>(&self, key: &str, value: &'v Value) -> Result<&'v str> {
        match value.get_ref().as_str() {
            Some(text) => Ok(text),
            None => self.wrong(key, value, "a text"),
        }
    }

    /// A time in drive cycles.
    fn time(&self, key: &str, value: &Value) -> Result<u64> {
        let Some(time) = number(value.get_ref()) else {
            return self.wrong(key, value, "a time in s");
        };
        let given = excerpt(self.text, value);
        let here = |reason: String| Err(self.fault(value.span().start, reason));
        if !(0.0..=LONGEST_S).contains(&time) {
            return here(format!("{key} = {given} is outside 0 to {LONGEST_S} s"));
        }
        let cycles = time * CYCLES_PER_S as f64;
        if (cycles - cycles.round()).abs() > WHOLE {
            let period = 1.0 / CYCLES_PER_S as f64;
            return here(format!(
                "{key} = {given} is not a whole number of drive cycles of {period} s"
            ));
        }
        Ok(cycles.round() as u64)
    }

    fn given(&self, key: &str, value: &Value) -> Result<Given> {
        Ok(match value.get_ref() {
            DeValue::Boolean(on) => Given::Switch(*on),
            DeValue::String(text) => Given::Text(text.to_string()),
            DeValue::Integer(whole) if integer(whole).is_some() => {
                Given::Number(integer(whole).unwrap_or_default() as f64)
            }
            other => match number(other) {
                Some(number) => Given::Number(number),
                None => return self.wrong(key, value, "a number, true, false or a text"),
            },
        })
    }

    fn assignments(&self, key: &str, value: &Value) -> Result<Vec<Assignment>> {
        let mut all = Vec::new();
        for (name, value) in self.table(key, value)? {
            let given = self.given(name.get_ref(), value)?;
            let assigned = Assignment::of(name.get_ref(), &given);
            all.extend(assigned.map_err(|error| self.fault(name.span().start, error))?);
        }
        Ok(all)
    }

    fn pressed(&self, value: &Value) -> Result<Vec<Place>> {
        let mut all = Vec::new();
        for name in self.list("press", value)? {
            let text = self.text("press", name)?;
            let bits = Assignment::of(text, &Given::Switch(true));
            all.extend(self.place(name, bits)?.into_iter().map(|bit| bit.place));
        }
        Ok(all)
    }

    fn expectations(&self, key: &str, value: &Value) -> Result<Vec<Expectation>> {
        let read = |value| self.expectation(key, value);
        self.list(key, value)?.iter().map(read).collect()
    }

    fn expectation(&self, key: &str, value: &Value) -> Result<Expectation> {
        let at = self.at(value.span().start);
        if let Some(text) = value.get_ref().as_str() {
            return Ok(Expectation {
                at,
                condition: self.place(value, Condition::read(text))?,
                during: During::End,
            });
        }
        let table = match value.get_ref() {
            DeValue::Table(table) => table,
            _ => return self.wrong(key, value, "a condition or a table"),
        };
        self.known(table, EXPECT)?;
        let during = match table.get("during") {
            None => During::End,
            Some(during) => self.during(during)?,
        };
        Ok(Expectation {
            at,
            condition: self.bounds(value, table)?,
            during,
        })
    }

    fn during(&self, value: &Value) -> Result<During> {
        let wanted = "\"end\", \"step\" or [from, to] in s";
        match value.get_ref() {
            DeValue::String(text) if text == "end" => Ok(During::End),
            DeValue::String(text) if text == "step" => Ok(During::Step),
            DeValue::Array(array) => match &array[..] {
                [from, to] => {
                    let (from, to) = (self.time("during", from)?, self.time("during", to)?);
                    if to < from {
                        let reason = format!(
                            "during ends at {} s before it begins at {} s",
                            seconds(to),
                            seconds(from)
                        );
                        return Err(self.fault(value.span().start, reason));
                    }
                    Ok(During::Window(from, to))
                }
                _ => self.wrong("during", value, wanted),
            },
            _ => self.wrong("during", value, wanted),
        }
    }

    /// `signal` with `is`, or with `min`, `max` and perhaps `of`.
    fn bounds(&self, whole: &Value, table: &DeTable) -> Result<Condition> {
        let here = |reason: &str| self.fault(whole.span().start, reason);
        let name = table
            .get("signal")
            .ok_or_else(|| here("the signal is missing"))?;
        let text = self.text("signal", name)?;
        let places = self.place(name, Place::find(text))?;
        let of = match table.get("of") {
            None => None,
            Some(of) => {
                let name = self.text("of", of)?;
                let place = self.place(of, Place::find_one(name))?;
                Some((name, place))
            }
        };
        let mut terms = Vec::new();
        let mut bound = |key: &str, operator: Operator| -> Result<Option<Given>> {
            let Some(value) = table.get(key) else {
                return Ok(None);
            };
            let given = self.given(key, value)?;
            let reference = match (of, &given) {
                (None, _) => Reference::Value(self.place(value, value_of(&places, &given))?),
                (Some((_, of)), Given::Number(share)) if share.is_finite() => {
                    Reference::Times(*share, of)
                }
                _ => return self.wrong(key, value, "a number"),
            };
            terms.push(Term {
                places: places.clone(),
                operator,
                reference,
            });
            Ok(Some(given))
        };
        let is = bound("is", Operator::Is)?;
        let low = bound("min", Operator::AtLeast)?;
        let high = bound("max", Operator::AtMost)?;
        let unit = match of {
            Some((name, _)) => format!(" of {name}"),
            None => places.first().map_or(String::new(), Place::unit),
        };
        let bounds = match (is, low, high) {
            (Some(is), None, None) => format!("= {is}{unit}"),
            (None, Some(low), None) => format!("at least {low}{unit}"),
            (None, None, Some(high)) => format!("at most {high}{unit}"),
            (None, Some(Given::Number(low)), Some(Given::Number(high))) => {
                if low > high {
                    return Err(here(&format!("min = {low} is above max = {high}")));
                }
                format!("{low} to {high}{unit}")
            }
            _ => {
                return Err(here(
                    "an expectation has either 'is', or 'min' or 'max' or both",
                ));
            }
        };
        Ok(Condition {
            terms,
            text: format!("{text} {bounds}"),
        })
    }
}

impl Script {
    fn file(&mut self, path: &Path) -> Result<()> {
        let name = path.display().to_string();
        let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {name}"))?;
        let real = path
            .canonicalize()
            .with_context(|| format!("cannot find {name}"))?;
        if let Some(first) = self.open.iter().position(|open| *open == real) {
            let files = &self.open[first..];
            let chain: Vec<_> = files
                .iter()
                .map(|file| file.display().to_string())
                .collect();
            bail!("{name} includes itself: {}", chain.join(" → "));
        }
        self.open.push(real);
        let file = File {
            path,
            name,
            text: &text,
        };
        let parsed = DeTable::parse(&text).map_err(|error| {
            let reason = error.message().trim().replace('\n', "; ");
            file.fault(error.span().map_or(0, |span| span.start), reason)
        })?;
        self.top(&file, parsed.get_ref())?;
        self.open.pop();
        Ok(())
    }

    fn top(&mut self, file: &File, table: &DeTable) -> Result<()> {
        file.known(table, TOP)?;
        if let Some(title) = table.get("title") {
            let title = file.text("title", title)?.to_owned();
            self.title.get_or_insert(title);
        }
        if let Some(about) = table.get("about") {
            file.text("about", about)?;
        }
        if let Some(machine) = table.get("machine") {
            let named = file.text("machine", machine)?;
            let found = beside(file.path, named);
            let found = if found.exists() {
                &found
            } else {
                Path::new(named)
            };
            let found = Description::find(&found.display().to_string());
            // the outermost file that names one has been read first
            let found = file.place(machine, found)?;
            self.machine.get_or_insert(found);
        }
        if let Some(start) = table.get("start") {
            self.include(file, START, start)?;
        }
        if let Some(set) = table.get("set") {
            if self.included {
                let reason = "an included file has no 'set': it begins long after power-up";
                return Err(file.fault(set.span().start, reason));
            }
            self.set.extend(file.assignments("set", set)?);
        }
        let clock = self.clocks;
        self.clocks += 1;
        self.acts.push(Act::Begin(clock));
        let began = self.earliest;
        let always = self.always;
        self.always += 1;
        if let Some(value) = table.get("always") {
            for expectation in file.expectations("always", value)? {
                if expectation.during != During::End {
                    let reason = "what is always expected has no 'during'";
                    return Err(file.fault(value.span().start, reason));
                }
                self.acts.push(Act::Always(always, expectation));
            }
        }
        if let Some(steps) = table.get("step") {
            for step in file.list("step", steps)? {
                self.step(file, step, clock, began)?;
            }
        }
        self.acts.push(Act::Release(always));
        Ok(())
    }

    fn step(&mut self, file: &File, value: &Value, clock: usize, began: u64) -> Result<()> {
        let table = file.table("step", value)?;
        file.known(table, STEP)?;
        let here = |reason: &str| file.fault(value.span().start, reason);
        if let Some(include) = table.get("include") {
            if table.iter().count() > 1 {
                return Err(here("a step with 'include' has nothing else"));
            }
            return self.include(file, "include", include);
        }
        let time = |key: &str| {
            table
                .get(key)
                .map(|value| file.time(key, value))
                .transpose()
        };
        let begins = time("at")?;
        if let (Some(cycles), Some(at)) = (begins, table.get("at")) {
            let least = self.earliest - began;
            if cycles < least {
                let reason = format!(
                    "at = {} s is before the step before can have ended, {} s",
                    seconds(cycles),
                    seconds(least)
                );
                return Err(file.fault(at.span().start, reason));
            }
            self.earliest = began + cycles;
        }
        let set = table
            .get("set")
            .map(|set| file.assignments("set", set))
            .transpose()?;
        let press = table
            .get("press")
            .map(|press| file.pressed(press))
            .transpose()?;
        let press = press.unwrap_or_default();
        let heartbeat = match table.get("heartbeat") {
            None => None,
            Some(beats) => match beats.get_ref().as_bool() {
                Some(beats) => Some(beats),
                None => return file.wrong("heartbeat", beats, "true or false"),
            },
        };
        let least = if press.is_empty() { 1 } else { 2 * PRESS };
        let ends = match (time("for")?, table.get("until"), time("within")?) {
            (lasts, None, None) => Ends::After(lasts.unwrap_or(0).max(least)),
            (None, Some(until), Some(within)) => {
                let condition = Condition::read(file.text("until", until)?);
                Ends::When(file.place(until, condition)?, within)
            }
            (None, Some(_), None) => {
                return Err(here(
                    "'until' needs 'within', the time that it may take, in s",
                ));
            }
            (None, None, Some(_)) => return Err(here("'within' needs 'until'")),
            (Some(_), ..) => return Err(here("a step has either 'for' or 'until'")),
        };
        let expect = table
            .get("expect")
            .map(|expect| file.expectations("expect", expect))
            .transpose()?;
        let say = match table.get("say") {
            None => None,
            Some(say) => Some(file.text("say", say)?.to_owned()),
        };
        let step = Step {
            at: file.at(value.span().start),
            say,
            begins: begins.map(|cycles| Time { clock, cycles }),
            set: set.unwrap_or_default(),
            press,
            heartbeat,
            ends,
            expect: expect.unwrap_or_default(),
        };
        let lasts = match step.ends {
            Ends::After(cycles) => cycles,
            Ends::When(..) => 0,
        };
        let answer = if step.is_judged() {
            Timing::LOCKSTEP.answer
        } else {
            0
        };
        self.earliest += lasts.max(answer);
        self.acts.push(Act::Step(step));
        Ok(())
    }

    /// Reads another file: a prelude by its name, or a path from this one.
    fn include(&mut self, file: &File, key: &str, value: &Value) -> Result<()> {
        let named = file.text(key, value)?;
        let path = if named.ends_with(".toml") {
            beside(file.path, named)
        } else {
            let directory = library().join(PRELUDE);
            let path = directory.join(format!("{named}.toml"));
            file.place(value, is_prelude(&directory, &path, named))?;
            path
        };
        let (title, included) = (self.title.clone(), self.included);
        self.included |= key != START;
        let read = self.file(&path);
        (self.title, self.included) = (title, included);
        // what is wrong in the other file has its place there
        read.with_context(|| format!("{}: {key} = {named:?}", file.at(value.span().start)))
    }
}

fn beside(file: &Path, named: &str) -> PathBuf {
    file.parent().unwrap_or(Path::new("")).join(named)
}

fn is_prelude(directory: &Path, path: &Path, named: &str) -> Result<()> {
    let all = files(directory)?;
    let name = |path: &PathBuf| {
        let stem = path.file_stem().unwrap_or_default();
        stem.to_string_lossy().into_owned()
    };
    let nearest = all
        .iter()
        .map(name)
        .min_by_key(|name| strsim::damerau_levenshtein(name, named));
    ensure!(
        all.iter().any(|known| known == path),
        "there is no prelude {named}; the nearest is {}; a file's name ends in .toml",
        nearest.unwrap_or_default()
    );
    Ok(())
}
