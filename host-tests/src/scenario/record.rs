//! Recordings: every command with the drive cycle in which it counted, and what the simulator then said.
//!
//! Not here: the scenario that gave the commands. A recording reproduces a run without it, to the bit.
//!
//! A recording is CSV with the columns `cycle,signal,counts`. First stands the machine: its preset, and each
//! parameter that differs from it as `machine.NAME`. A command's row says what it is set to before that drive
//! cycle, in counts as they travel; `up` counts it up by one in every cycle until its next row, as a heartbeat
//! does. A feedback's row says what stood in the image after so many cycles; [`replay`] compares it. The last
//! row's cycle is the run's end.

use std::io::{Read, Write};

use anyhow::{Context, Result, anyhow, bail, ensure};
use model_core::image::{self, Commands, Direction, Image, Kind, SIGNALS};
use model_core::machine::{Machine, PRESETS, Parameter, Value};

use super::lockstep::Bench;
use super::place::Place;
use super::{CYCLES_PER_S, seconds};
use crate::machine_file::Description;

/// The columns.
const HEADER: [&str; 3] = ["cycle", "signal", "counts"];
/// The row of the machine, and with a point after it those of its parameters.
const MACHINE: &str = "machine";
/// A command that counts up in every cycle.
const UP: &str = "up";
/// From check to check, drive cycles.
const CHECK: u64 = 10 * CYCLES_PER_S;
/// Longest recording, drive cycles: eleven days.
const LONGEST: u64 = 1_000_000 * CYCLES_PER_S;

/// What is checked: the plant's steps and the hash over all of its states.
const CHECKED: [Place; 2] = [whole(&image::PLANT_TICKS), whole(&image::TRAJECTORY)];

const fn whole(signal: &'static image::Signal) -> Place {
    Place { signal, bit: None }
}

fn commands() -> impl Iterator<Item = Place> {
    SIGNALS
        .iter()
        .filter(|signal| signal.direction == Direction::Command)
        .map(whole)
}

/// Writes a recording while it runs.
pub struct Recorder<W: Write> {
    csv: csv::Writer<W>,
    /// What a player of the recording would command now.
    known: Commands,
    counting: bool,
    /// The image that has not been checked yet, with its cycle.
    unchecked: Option<(u64, Image)>,
}

impl<W: Write> Recorder<W> {
    /// Begins the recording of a machine at power-up.
    pub fn new(out: W, machine: &Description) -> Result<Self> {
        let mut csv = csv::Writer::from_writer(out);
        csv.write_record(HEADER)?;
        csv.write_record(["0", MACHINE, machine.preset])?;
        for parameter in machine.machine.differences(&preset(machine.preset)?) {
            let value = parameter.get(&machine.machine);
            let value = value.map_or(String::new(), |value| value.to_string());
            csv.write_record(["0", &format!("{MACHINE}.{}", parameter.name), &value])?;
        }
        Ok(Self {
            csv,
            known: Commands::default(),
            counting: false,
            unchecked: None,
        })
    }

    /// Takes a drive cycle that has been done.
    pub fn look(&mut self, bench: &Bench) -> Result<()> {
        let cycle = bench.cycle - 1;
        let now = &bench.image.commands;
        let beat = &image::HEARTBEAT_PLC;
        let next = self.known.word(beat).wrapping_add(1);
        let counts = now.word(beat) == next;
        if counts != self.counting {
            self.counting = counts;
            let value = if counts {
                UP.to_owned()
            } else {
                now.word(beat).to_string()
            };
            self.row(cycle, beat.name, &value)?;
        } else if !counts && now.word(beat) != self.known.word(beat) {
            self.row(cycle, beat.name, &now.word(beat).to_string())?;
        }
        self.known.set_word(beat, now.word(beat));
        if self.known != *now {
            let mut before = bench.image;
            before.commands = self.known;
            for place in commands() {
                let counts = place.counts(&bench.image);
                if counts != place.counts(&before) {
                    self.row(cycle, place.signal.name, &counts.to_string())?;
                }
            }
            self.known = *now;
        }
        self.unchecked = Some((bench.cycle, bench.image));
        if bench.cycle.is_multiple_of(CHECK) {
            self.check()?;
        }
        Ok(())
    }

    /// Ends the recording.
    pub fn finish(mut self) -> Result<()> {
        self.check()?;
        Ok(self.csv.flush()?)
    }

    fn check(&mut self) -> Result<()> {
        let Some((cycle, image)) = self.unchecked.take() else {
            return Ok(());
        };
        CHECKED.iter().try_for_each(|place| {
            let counts = place.counts(&image).to_string();
            self.row(cycle, place.signal.name, &counts)
        })
    }

    fn row(&mut self, cycle: u64, name: &str, counts: &str) -> Result<()> {
        Ok(self.csv.write_record([&cycle.to_string(), name, counts])?)
    }
}

/// A run, as it was recorded.
#[derive(Clone, Debug)]
pub struct Recording {
    /// The machine it was recorded on.
    pub machine: Machine,
    rows: Vec<Row>,
}

#[derive(Clone, Debug)]
struct Row {
    cycle: u64,
    place: Place,
    what: What,
}

#[derive(Clone, Copy, Debug)]
enum What {
    Set(i64),
    CountUp,
    Was(i64),
}

impl Recording {
    /// Reads a recording; an error gives the source's `name`, the line and the reason.
    pub fn read(name: &str, source: impl Read) -> Result<Self> {
        let mut csv = csv::ReaderBuilder::new().from_reader(source);
        let header = csv.headers().with_context(|| name.to_owned())?;
        ensure!(
            header == HEADER.as_slice(),
            "{name}:1: this is no recording: its columns are not {}",
            HEADER.join(",")
        );
        let (mut machine, mut rows) = (None, Vec::<Row>::new());
        for record in csv.records() {
            let record = record.with_context(|| name.to_owned())?;
            let line = record.position().map_or(0, csv::Position::line);
            let at = || format!("{name}:{line}");
            let fields = (&record[0], &record[1], &record[2]);
            if fields.1.starts_with(MACHINE) {
                describe(&mut machine, fields.1, fields.2).with_context(at)?;
                continue;
            }
            let row = Row::read(fields).with_context(at)?;
            let before = rows.last().map_or(0, |row| row.cycle);
            ensure!(
                row.cycle >= before && row.cycle <= LONGEST,
                "{name}:{line}: cycle = {} is outside {before}, that of the row before, to {LONGEST}",
                row.cycle
            );
            rows.push(row);
        }
        let machine =
            machine.ok_or_else(|| anyhow!("{name}: the row of the machine is missing"))?;
        machine.validate().with_context(|| name.to_owned())?;
        Ok(Self { machine, rows })
    }

    /// Plays it again on the same machine.
    pub fn replay(&self) -> Result<Replay> {
        let mut bench = Bench::new(&self.machine)?;
        let mut commands = Commands::default();
        let mut counting: Vec<Place> = Vec::new();
        let mut rows = self.rows.iter().peekable();
        let (mut compared, mut difference) = (0, None);
        while let Some(next) = rows.peek() {
            while bench.cycle < next.cycle {
                for place in &counting {
                    let counts = place.counts(&bench.image) + 1;
                    place.set(&mut commands, counts);
                }
                bench.step(&commands);
            }
            // what was seen in this cycle and what is set in it; then the cycle that counts with it
            let cycle = next.cycle;
            let mut counts_from_here = Vec::new();
            while let Some(row) = rows.next_if(|row| row.cycle == cycle) {
                match row.what {
                    What::Was(recorded) => {
                        compared += 1;
                        let replayed = row.place.counts(&bench.image);
                        if replayed != recorded && difference.is_none() {
                            difference = Some(Difference {
                                cycle,
                                place: row.place,
                                recorded,
                                replayed,
                            });
                        }
                    }
                    What::Set(counts) => {
                        counting.retain(|place| place.signal.word != row.place.signal.word);
                        row.place.set(&mut commands, counts);
                    }
                    What::CountUp => counts_from_here.push(row.place),
                }
            }
            counting.append(&mut counts_from_here);
        }
        ensure!(compared > 0, "the recording has nothing to compare with");
        Ok(Replay {
            cycles: bench.cycle,
            trajectory: bench.trajectory(),
            compared,
            difference,
        })
    }
}

/// What came of a replay.
#[derive(Clone, Copy, Debug)]
pub struct Replay {
    /// Drive cycles that were simulated.
    pub cycles: u64,
    /// Hash over the plant's trajectory.
    pub trajectory: u32,
    /// Values that were compared.
    pub compared: usize,
    /// The first that was another.
    pub difference: Option<Difference>,
}

/// A value that was another than recorded.
#[derive(Clone, Copy, Debug)]
pub struct Difference {
    /// After so many drive cycles.
    pub cycle: u64,
    /// Where.
    pub place: Place,
    /// What was recorded, in counts.
    pub recorded: i64,
    /// What it was now.
    pub replayed: i64,
}

impl std::fmt::Display for Difference {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "after {} s {} is {}, and was recorded as {}",
            seconds(self.cycle),
            self.place,
            self.replayed,
            self.recorded
        )
    }
}

impl Row {
    fn read((cycle, name, counts): (&str, &str, &str)) -> Result<Self> {
        let cycle = cycle
            .parse()
            .map_err(|_| anyhow!("cycle = {cycle:?} is not a whole number"))?;
        let place = Place::find_one(name)?;
        ensure!(
            place.bit.is_none(),
            "{name} is a bit: a recording has whole words"
        );
        let number = counts.parse::<i64>();
        let (low, high) = match place.signal.kind {
            Kind::I16 => (i64::from(i16::MIN), i64::from(i16::MAX)),
            Kind::U32 => (0, i64::from(u32::MAX)),
            _ => (0, i64::from(u16::MAX)),
        };
        if let Ok(counts) = number {
            ensure!(
                (low..=high).contains(&counts),
                "{name} = {counts} is outside {low} to {high}"
            );
        }
        let what = match (place.signal.direction, number) {
            (Direction::Command, Ok(counts)) => What::Set(counts),
            (Direction::Command, Err(_)) if counts == UP => What::CountUp,
            (Direction::Feedback, Ok(counts)) => What::Was(counts),
            _ => bail!("{name} = {counts:?} is not a whole number"),
        };
        Ok(Self { cycle, place, what })
    }
}

fn preset(name: &str) -> Result<Machine> {
    let preset = PRESETS.iter().find(|(preset, _)| *preset == name);
    let (_, machine) = preset.ok_or_else(|| anyhow!("{MACHINE} = {name:?} is no preset"))?;
    Ok(machine())
}

/// Takes a row of the machine: its preset, or a parameter.
fn describe(machine: &mut Option<Machine>, name: &str, value: &str) -> Result<()> {
    let Some((_, parameter)) = name.split_once('.') else {
        *machine = Some(preset(value)?);
        return Ok(());
    };
    let machine = machine
        .as_mut()
        .ok_or_else(|| anyhow!("{name} stands before the row of the machine"))?;
    let unknown = || anyhow!("there is no parameter {parameter}");
    let parameter: &Parameter = Machine::parameter(parameter).ok_or_else(unknown)?;
    let wrong = || anyhow!("{name} = {value:?} is no value of it");
    let read = match parameter.get(machine).ok_or_else(unknown)? {
        Value::Number(_) => value.parse().ok().map(Value::Number),
        Value::Switch(_) => value.parse().ok().map(Value::Switch),
        Value::Count(_) => value.parse().ok().map(Value::Count),
    };
    let read = read.ok_or_else(wrong)?;
    parameter.set(machine, read).ok_or_else(wrong)
}
