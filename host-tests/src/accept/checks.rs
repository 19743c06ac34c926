//! What an acceptance run looks at: one row for each check.
//!
//! Not here: what happens in a run ([`super::course`]). A row has an id, an area, the requirement, the episode whose
//! trend is shown, what the trend shows, likely causes, and a judge. A new check is a new row.

use model_core::desk::{alarm, request};
use model_core::image::{
    self, Direction, Kind, OPERATOR_REQUEST, PLC_ALARMS, SIGNALS, Section, Signal, WINDER_COMMAND,
    WINDER_COMMAND_2, WINDER_STATUS,
};
use model_core::logic::{Mode, command, command_2, status};
use model_core::profidrive::{stw1, zsw1};

use super::course::{DIAMETER, FORCE, LENGTH, PARENTS, RIDER, SPEEDS, TAPER, TENSION, TOO_FAST};
use super::run::{Course, Sample};

/// What a check is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Area {
    /// Heartbeat, link, limits of words.
    Link,
    /// Switching on and off.
    Start,
    /// Rolls and their diameter.
    Preset,
    /// Thread and tension.
    Thread,
    /// Unwind maneuver.
    Maneuver,
    /// Set-points and stops.
    Run,
    /// Length, diameter, count, tables, set change.
    Set,
    /// What the PLC does when something breaks.
    Faults,
}

impl Area {
    /// For people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Link => "link",
            Self::Start => "start sequence",
            Self::Preset => "diameter preset",
            Self::Thread => "thread and tension",
            Self::Maneuver => "unwind maneuver",
            Self::Run => "run and stop",
            Self::Set => "the set",
            Self::Faults => "faults",
        }
    }
}

/// Why a check is not passed.
#[derive(Clone, Debug, PartialEq)]
pub enum Miss {
    /// It is not so: what was seen, and when, s.
    Failed(String, Option<f64>),
    /// The course did not come so far.
    NotSeen(String),
}

/// What was seen where it is so.
pub type Verdict = Result<String, Miss>;

/// A check.
pub struct Check {
    /// Its id.
    pub id: &'static str,
    /// What it is about.
    pub area: Area,
    /// What must be so.
    pub requirement: &'static str,
    /// The episode whose trend is shown.
    pub episode: &'static str,
    /// Curves of the trend.
    pub trend: &'static [&'static Signal],
    /// What it may come from, where it is not so.
    pub causes: &'static str,
    /// Looks at the course.
    pub judge: fn(&Course) -> Verdict,
}

/// What a PLC may take to see and to act, s: two polls and two cycles of a slow one.
const REACTION_S: f64 = 0.5;
/// The same for an emergency stop.
const EMERGENCY_S: f64 = 0.25;
/// Slower than this the web stands, m/min.
const STANDS: f64 = 1.0;
/// Without a new count for this long a heartbeat has stood, s.
const BEAT_S: f64 = 0.25;

const SPEED: &[&Signal] = &[&image::V_REF, &image::V_WEB];
const PULL: &[&Signal] = &[&image::V_WEB, &image::TENSION, &image::TENSION_REF];
const COMMANDED: &[&Signal] = &[&image::V_WEB, &image::WINDER_COMMAND, &image::STW1_UW];
const ROLLS: &[&Signal] = &[&image::V_WEB, &image::D_WU, &image::LENGTH_WU];

impl Course {
    fn failed(&self, what: String, sample: Option<&Sample>) -> Miss {
        Miss::Failed(what, sample.map(Sample::t_s))
    }

    /// Where a moment is.
    fn mark(&self, name: &str) -> Result<usize, Miss> {
        if let Some((_, at)) = self.marks.iter().find(|(n, _)| *n == name) {
            return Ok(*at);
        }
        let why = self.episodes.iter().find_map(|e| e.stuck.as_deref());
        let why = self.ended.as_deref().or(why).unwrap_or("nothing told why");
        Err(Miss::NotSeen(format!(
            "the course did not come to \"{name}\": {why}"
        )))
    }

    /// The samples between two moments.
    fn between(&self, from: &str, to: &str) -> Result<&[Sample], Miss> {
        let (from, to) = (self.mark(from)?, self.mark(to)?);
        Ok(&self.samples[from.min(to)..to.min(self.samples.len())])
    }

    /// The same, with the sample before: what an edge rises from.
    fn edges_between(&self, from: &str, to: &str) -> Result<&[Sample], Miss> {
        let (from, to) = (self.mark(from)?.saturating_sub(1), self.mark(to)?);
        Ok(&self.samples[from.min(to)..to.min(self.samples.len())])
    }

    /// The samples between two moments, the second of which the PLC must bring about.
    fn reached(&self, from: &str, to: &str) -> Result<&[Sample], Miss> {
        self.between(from, to)
            .map_err(|miss| match (miss, self.mark(from)) {
                (Miss::NotSeen(why), Ok(at)) => self.failed(why, self.samples.get(at)),
                (miss, _) => miss,
            })
    }

    /// The samples from a moment on, for so long, s.
    fn after(&self, from: &str, s: f64) -> Result<&[Sample], Miss> {
        let rest = self.samples.get(self.mark(from)?..).unwrap_or_default();
        let Some(first) = rest.first() else {
            return Err(Miss::NotSeen(format!("nothing was seen after \"{from}\"")));
        };
        let until = first.t_s() + s;
        Ok(&rest[..rest.partition_point(|sample| sample.t_s() <= until)])
    }

    /// The sample at a moment.
    fn at(&self, name: &str) -> Result<&Sample, Miss> {
        let at = self.mark(name)?;
        let last = self.samples.len().saturating_sub(1);
        let gone = || Miss::NotSeen(format!("nothing was seen at \"{name}\""));
        self.samples.get(at.min(last)).ok_or_else(gone)
    }

    /// No sample is so.
    fn never(&self, samples: &[Sample], what: &str, is: impl Fn(&Sample) -> bool) -> Verdict {
        match samples.iter().find(|s| is(s)) {
            Some(s) => Err(self.failed(what.to_owned(), Some(s))),
            None => Ok(format!("not once in {:.1} s", span(samples))),
        }
    }

    /// From some sample on, within so long, s, all are so.
    fn soon(
        &self,
        samples: &[Sample],
        within: f64,
        what: &str,
        is: impl Fn(&Sample) -> bool,
    ) -> Verdict {
        let Some(first) = samples.first() else {
            return Err(Miss::NotSeen("nothing was seen".into()));
        };
        let found = samples.iter().find(|s| is(s));
        match found {
            Some(s) if s.t_s() - first.t_s() <= within => {
                Ok(format!("{what} after {:.2} s", s.t_s() - first.t_s()))
            }
            Some(s) => {
                let late = s.t_s() - first.t_s();
                let text = format!("{what} only after {late:.2} s: {within} s are allowed");
                Err(self.failed(text, Some(first)))
            }
            None => {
                let text = format!("not within {:.1} s: {what}", span(samples));
                Err(self.failed(text, Some(first)))
            }
        }
    }

    /// A value within its band at every sample.
    fn near(
        &self,
        samples: &[Sample],
        value: impl Fn(&Sample) -> f64,
        wanted: impl Fn(&Sample) -> f64,
        band: f64,
        unit: &str,
    ) -> Verdict {
        let off = |s: &Sample| (value(s) - wanted(s)).abs();
        let worst = samples.iter().max_by(|a, b| off(a).total_cmp(&off(b)));
        let Some(worst) = worst else {
            return Err(Miss::NotSeen("nothing was seen".into()));
        };
        let (got, want) = (value(worst), wanted(worst));
        let text = format!("{got:.1} {unit} where {want:.1} {unit} is wanted (±{band} {unit})");
        if off(worst) <= band {
            Ok(text)
        } else {
            Err(self.failed(text, Some(worst)))
        }
    }
}

fn span(samples: &[Sample]) -> f64 {
    match (samples.first(), samples.last()) {
        (Some(first), Some(last)) => last.t_s() - first.t_s(),
        _ => 0.0,
    }
}

fn moves(s: &Sample) -> bool {
    s.value(&image::V_WEB).abs() > STANDS
}

fn mode(s: &Sample, mode: Mode) -> bool {
    s.word(&image::MODE) == mode as u16
}

fn asks_to_move(s: &Sample) -> bool {
    !s.lacks(
        &WINDER_COMMAND,
        command::THREAD | command::RUN | command::STALL,
    )
}

fn on(s: &Sample) -> bool {
    image::STW1.iter().any(|word| s.has(word, stw1::ON))
}

fn off(s: &Sample) -> bool {
    !on(s)
}

/// Samples with a rising edge of a bit.
fn edges<'a>(
    samples: &'a [Sample],
    signal: &'a Signal,
    bit: u16,
) -> impl Iterator<Item = (&'a Sample, &'a Sample)> {
    samples
        .windows(2)
        .filter(move |pair| pair[0].lacks(signal, bit) && pair[1].has(signal, bit))
        .map(|pair| (&pair[0], &pair[1]))
}

/// The diameter's share of the way from the core to the second set's diameter.
fn growth(s: &Sample) -> f64 {
    const CORE: f64 = 100.0;
    ((s.value(&image::D_WU) - CORE) / (DIAMETER - CORE)).clamp(0.0, 1.0)
}

/// The second set as it runs, where its set-points have arrived.
fn second_set(c: &Course) -> Result<Vec<Sample>, Miss> {
    let samples = c.between("second set", "second set stands")?;
    let runs: Vec<Sample> = samples
        .iter()
        .filter(|s| mode(s, Mode::Run))
        .copied()
        .collect();
    if runs.is_empty() {
        return Err(Miss::NotSeen("the second set did not run".into()));
    }
    Ok(runs)
}

/// An alarm is shown within a second of a moment.
fn alarmed(c: &Course, from: &str, bit: u16, what: &str) -> Verdict {
    let samples = c.after(from, 15.0)?;
    c.soon(samples, 15.0, what, |s| s.has(&PLC_ALARMS, bit))
}

fn heartbeat(c: &Course) -> Verdict {
    let mut worst = (0.0, None);
    let mut last: Option<&Sample> = None;
    let beat = |s: &Sample| s.word(&image::HEARTBEAT_PLC);
    for s in &c.samples {
        match last {
            Some(l) if beat(l) == beat(s) => {
                let still = s.t_s() - l.t_s();
                if still > worst.0 {
                    worst = (still, Some(l));
                }
            }
            _ => last = Some(s),
        }
    }
    let text = format!(
        "it stood for at most {:.2} s ({BEAT_S} s are allowed)",
        worst.0
    );
    match worst.1 {
        Some(at) if worst.0 > BEAT_S => Err(c.failed(text, Some(at))),
        _ => Ok(text),
    }
}

/// Every word of the PLC within its limits and without bits that have no meaning, from its first heartbeat on.
fn words(c: &Course) -> Verdict {
    let alive = c
        .samples
        .iter()
        .position(|s| s.word(&image::HEARTBEAT_PLC) != 0);
    let alive = alive.ok_or_else(|| Miss::NotSeen("the PLC has not begun".into()))?;
    let own = |s: &&Signal| s.direction == Direction::Command && s.section != Section::Simulator;
    for signal in SIGNALS.iter().filter(own) {
        let (low, high) = (f64::from(signal.limits.0), f64::from(signal.limits.1));
        let tolerance = 0.5 / f64::from(signal.counts);
        let meant = match signal.kind {
            Kind::Bits(bits) => bits.iter().map(|bit| 1 << bit.number).sum(),
            _ => u16::MAX,
        };
        let wrong = |s: &&Sample| {
            let value = s.value(signal);
            value < low - tolerance || value > high + tolerance || s.word(signal) & !meant != 0
        };
        if let Some(s) = c.samples[alive..].iter().find(wrong) {
            let (name, unit) = (signal.name, signal.unit);
            let text = match signal.kind {
                Kind::Bits(_) => format!(
                    "{name} is {:04X} hex, with bits that have no meaning",
                    s.word(signal)
                ),
                _ => format!(
                    "{name} is {} {unit}, outside {low} to {high} {unit}",
                    s.value(signal)
                ),
            };
            return Err(c.failed(text, Some(s)));
        }
    }
    Ok("all words, all the time".into())
}

/// Where the course does not even come to standstill with drives off, a PLC that moves the winder does so unasked.
fn unasked(c: &Course) -> Verdict {
    match stays(c, "idle", "asked without drives", true) {
        Err(Miss::NotSeen(why)) => match c.samples.iter().find(|s| on(s) || asks_to_move(s)) {
            Some(s) => Err(c.failed(
                format!("ON, thread or run stands, and no stop ends it: {why}"),
                Some(s),
            )),
            None => Err(Miss::NotSeen(why)),
        },
        other => other,
    }
}

/// 047E stands before 047F, in each drive.
fn start_sequence(c: &Course) -> Verdict {
    let samples = c.edges_between("drives on", "in operation")?;
    let mut told = Vec::new();
    for (stw, zsw) in image::STW1.into_iter().zip(image::ZSW1) {
        let first = samples.iter().position(|s| s.has(stw, stw1::ON));
        let Some(first) = first else {
            return Err(c.failed(format!("{}: ON is not given", stw.name), samples.first()));
        };
        let before = &samples[..first];
        let ready =
            |s: &&Sample| s.word(stw) == stw1::READY && s.has(zsw, zsw1::READY_TO_SWITCH_ON);
        if !before.iter().any(|s| ready(&s)) {
            let text = format!(
                "{}: ON without 047E hex and \"ready to switch on\" before it",
                stw.name
            );
            return Err(c.failed(text, samples.get(first)));
        }
        let word = samples[first].word(stw);
        if word != stw1::RUN {
            let text = format!("{} is {word:04X} hex, not 047F", stw.name);
            return Err(c.failed(text, samples.get(first)));
        }
        told.push(stw.name);
    }
    Ok(format!("047E, then 047F: {}", told.join(", ")))
}

fn preset_accept(c: &Course) -> Verdict {
    c.reached("new parent roll", "preset")?;
    let samples = c.edges_between("new parent roll", "preset")?;
    let edges: Vec<_> = edges(samples, &WINDER_COMMAND, command::PRESET_ACCEPT).collect();
    match edges[..] {
        [] => Err(c.failed("no edge of preset_accept".into(), samples.first())),
        [(before, at)] => {
            let (old, new) = (
                before.value(&image::D_PRESET_UW),
                at.value(&image::D_PRESET_UW),
            );
            if (old - new).abs() > 0.05 {
                let text = format!("d_preset_uw changes from {old} to {new} mm with the edge");
                return Err(c.failed(text, Some(at)));
            }
            Ok(format!("one edge, with {new} mm standing before it"))
        }
        [_, (_, at), ..] => {
            Err(c.failed(format!("{} edges of preset_accept", edges.len()), Some(at)))
        }
    }
}

fn jog(c: &Course, from: &str, to: &str, sign: f64) -> Verdict {
    let samples = c.between(from, to)?;
    let n = |s: &Sample| sign * s.value(&image::N_UW);
    if let Some(s) = samples.iter().find(|s| s.value(&image::N_RD).abs() > 0.5) {
        return Err(c.failed("the drums turn".into(), Some(s)));
    }
    if let Some(s) = samples.iter().find(|s| n(s) < -0.1) {
        return Err(c.failed("the parent roll turns the other way".into(), Some(s)));
    }
    let most = samples.iter().map(n).fold(0.0, f64::max);
    if most < 0.5 {
        return Err(c.failed(
            format!("the parent roll turns at {most:.1} 1/min at most"),
            samples.first(),
        ));
    }
    Ok(format!("{most:.1} 1/min, the drums stand"))
}

/// Thread, run and ON after a fault, up to a moment: none of them may come.
fn stays(c: &Course, from: &str, to: &str, drives: bool) -> Verdict {
    let samples = c.between(from, to)?;
    c.never(samples, "thread, run or ON is commanded", |s| {
        asks_to_move(s) || (drives && on(s))
    })
}

/// Without the operator's push-button, and before it, there is no edge of acknowledge.
fn acknowledge(c: &Course) -> Verdict {
    let parts = [
        ("web breaks", "web break acknowledged"),
        ("front drum trips", "front drum acknowledged"),
        ("encoder is silent", "encoder acknowledged"),
    ];
    let mut seen = Err(Miss::NotSeen("no fault was reached".into()));
    for (from, to) in parts {
        let samples = match c.between(from, to) {
            Ok(samples) => samples,
            Err(_) if seen.is_ok() => continue,
            Err(miss) => {
                seen = Err(miss);
                continue;
            }
        };
        let words = image::STW1.iter().map(|word| (*word, stw1::ACKNOWLEDGE));
        for (signal, bit) in words.chain([(&WINDER_COMMAND, command::ACKNOWLEDGE)]) {
            if let Some((_, at)) = edges(samples, signal, bit).next() {
                let text = format!(
                    "an edge of acknowledge in {}, which nobody has asked for",
                    signal.name
                );
                return Err(c.failed(text, Some(at)));
            }
        }
        seen = Ok("only when asked".to_owned());
    }
    seen
}

/// Alarms without a reason.
fn false_alarms(c: &Course) -> Verdict {
    c.never(&c.samples, "an alarm is shown, and nothing is wrong", |s| {
        s.word(&PLC_ALARMS) & !s.reasons != 0
    })
    .map_err(|miss| match miss {
        Miss::Failed(what, Some(t)) => {
            let at = c.samples.iter().find(|s| s.t_s() >= t);
            let word = at.map_or(0, |s| s.word(&PLC_ALARMS) & !s.reasons);
            let names = model_core::desk::ALARM_BITS
                .iter()
                .filter(|bit| word >> bit.number & 1 == 1);
            let names: Vec<_> = names.map(|bit| bit.name).collect();
            Miss::Failed(format!("{what}: {}", names.join(", ")), Some(t))
        }
        other => other,
    })
}

/// ON is given only to a drive that is ready for it.
fn only_when_ready(c: &Course) -> Verdict {
    for (stw, zsw) in image::STW1.into_iter().zip(image::ZSW1) {
        for (before, at) in edges(&c.samples, stw, stw1::ON) {
            let silent = at.value(&image::FAULT_DRIVES) as u16 >> 10 & 1 == 1;
            if !silent && !before.has(zsw, zsw1::READY_TO_SWITCH_ON) {
                let text = format!(
                    "{}: ON, and {} says {:04X} hex",
                    stw.name,
                    zsw.name,
                    before.word(zsw)
                );
                return Err(c.failed(text, Some(at)));
            }
        }
    }
    let given: usize = image::STW1
        .iter()
        .map(|w| edges(&c.samples, w, stw1::ON).count())
        .sum();
    if given == 0 {
        return Err(Miss::NotSeen("ON was never given".into()));
    }
    Ok(format!("{given} times"))
}

fn acceleration(c: &Course) -> Verdict {
    const LIMITS: (f64, f64) = (0.3, 0.5);
    let samples = c.between("run", "at speed")?;
    let most = samples
        .iter()
        .map(|s| s.value(&image::A_REF))
        .fold(0.0, f64::max);
    let jerk = samples
        .iter()
        .map(|s| s.value(&image::JERK_SET))
        .fold(0.0, f64::max);
    let text =
        format!("{most:.2} m/s² with a jerk of {jerk:.2} m/s³ (0.3 to 0.5 m/s², at most 0.3 m/s³)");
    if most < LIMITS.0 || most > LIMITS.1 || jerk > 0.3 {
        return Err(c.failed(text, samples.first()));
    }
    Ok(text)
}

fn limits_of_torque(c: &Course) -> Verdict {
    let samples = c.between("run", "at speed")?;
    for signal in [&image::TORQUE_LIMIT_UW, &image::TORQUE_LIMIT_DRUMS] {
        if let Some(s) = samples.iter().find(|s| s.value(signal) < 100.0) {
            let text = format!("{} is {} %", signal.name, s.value(signal));
            return Err(c.failed(text, Some(s)));
        }
    }
    Ok("100 % or more".into())
}

fn drum_brakes(c: &Course) -> Verdict {
    let closes = |s: &Sample| s.has(&WINDER_COMMAND, command::DRUM_BRAKES);
    let wrong = |s: &Sample| closes(s) && (moves(s) || asks_to_move(s));
    c.never(
        &c.samples,
        "drum_brakes stands while the web moves or is to move",
        wrong,
    )?;
    let samples = c.between("first set stands", "first set rests")?;
    c.soon(samples, 3.0, "drum_brakes closes", closes)
}

fn rider(c: &Course) -> Verdict {
    let lifts = |s: &Sample| s.has(&WINDER_COMMAND_2, command_2::RIDER_UP);
    c.never(
        &c.samples,
        "rider_up stands while the web moves or is to move",
        |s| lifts(s) && (moves(s) || asks_to_move(s)),
    )
}

fn stop(c: &Course) -> Verdict {
    let samples = c.between("stop", "stopped")?;
    let other =
        |s: &Sample| !(mode(s, Mode::Run) || mode(s, Mode::NormalStop) || mode(s, Mode::Stall));
    if let Some(s) = samples.iter().find(|s| other(s)) {
        let text = format!("mode {} on the way", s.word(&image::MODE));
        return Err(c.failed(text, Some(s)));
    }
    let last = c.at("stopped")?;
    if !last.has(&WINDER_STATUS, status::TENSION_DETECTED) {
        return Err(c.failed("the web is slack at the end".into(), Some(last)));
    }
    Ok("run, normal stop, stall tension".into())
}

fn emergency(c: &Course) -> Verdict {
    let samples = c.after("emergency stop", 2.0)?;
    let quick = |s: &Sample| {
        image::STW1
            .iter()
            .all(|word| s.lacks(word, stw1::NO_QUICK_STOP))
    };
    c.soon(samples, EMERGENCY_S, "OFF3 in all four words", quick)
}

fn emergency_mode(c: &Course) -> Verdict {
    let samples = c.between("emergency stop", "emergency stop is released")?;
    let wrong = |s: &Sample| mode(s, Mode::CoastStop) || mode(s, Mode::NormalStop);
    c.never(samples, "another stop than the emergency stop", wrong)?;
    c.soon(samples, 1.0, "mode emergency stop", |s| {
        mode(s, Mode::EmergencyStop)
    })
}

fn parent_roll(c: &Course) -> Verdict {
    const ABOVE: f64 = 2.0;
    c.never(
        c.reached("last layers", "used up")?,
        "the web has run off the roll",
        |s| s.value(&image::BROKEN_SPAN) > 0.0 || s.has(&WINDER_STATUS, status::WEB_BREAK),
    )?;
    let at = c.at("used up")?;
    let (d, end) = (at.value(&image::D_UW), PARENTS[2]);
    let text = format!("it stands at {d:.1} mm, {end} mm is the end (0 to {ABOVE} mm above it)");
    if d < end - 0.05 || d > end + ABOVE {
        return Err(c.failed(text, Some(at)));
    }
    Ok(text)
}

fn hot(c: &Course) -> Verdict {
    let samples = c.between("motor is warm", "motor, over")?;
    c.never(samples, "the drive has tripped", |s| {
        s.word(&image::FAULT) != 0
    })?;
    let last = samples.last();
    if last.is_some_and(moves) {
        return Err(c.failed("the winder has not been stopped".into(), samples.first()));
    }
    Ok(format!("it stands after {:.1} s", span(samples)))
}

fn cells(c: &Course) -> Verdict {
    let samples = c.between("load cells stick", "load cells, over")?;
    c.soon(samples, 10.0, "run is taken back", |s| {
        s.lacks(&WINDER_COMMAND, command::RUN)
    })?;
    c.soon(samples, 10.0, "the alarm is shown", |s| {
        s.has(&PLC_ALARMS, alarm::LOAD_CELL)
    })
}

fn sets(c: &Course) -> Verdict {
    let count = |at: &str| c.at(at).map(|s| s.word(&image::PLC_SETS));
    let (first, second) = (count("first set rests")?, count("second set rests"));
    let text = match &second {
        Ok(second) => format!("{first} after the first set, {second} after the second"),
        Err(_) => format!("{first} after the first set"),
    };
    if first != 1 || second.is_ok_and(|second| second != 2) {
        return Err(c.failed(text, c.at("first set rests").ok()));
    }
    Ok(text)
}

fn new_core(c: &Course) -> Verdict {
    /// What thread winds up until the set begins, m, at most.
    const THREADED: f64 = 15.0;
    let samples = c.edges_between("core of the first set", "first set")?;
    let Some((_, at)) = edges(samples, &WINDER_COMMAND, command::NEW_CORE).next() else {
        return Err(c.failed("no edge of new_core".into(), samples.first()));
    };
    let last = samples.last().unwrap_or(at);
    let length = last.value(&image::PLC_LENGTH);
    if length > THREADED {
        return Err(c.failed(
            format!("the PLC's length is {length:.2} m with a new core"),
            Some(last),
        ));
    }
    Ok(format!(
        "one edge; the PLC's length is {length:.2} m when the set begins"
    ))
}

/// Every check.
pub const CHECKS: &[Check] = &[
    Check {
        id: "L01",
        area: Area::Link,
        requirement: "The PLC's heartbeat counts all the time, also in faults",
        episode: "",
        trend: &[&image::HEARTBEAT_PLC, &image::V_WEB],
        causes: "the counter stands in a part of the program that is not always called; the PLC's cycle or poll is too slow; the PLC has stopped",
        judge: heartbeat,
    },
    Check {
        id: "L02",
        area: Area::Link,
        requirement: "The drives wait for a heartbeat for 0.2 to 1 s, not longer",
        episode: "run",
        trend: COMMANDED,
        causes: "heartbeat_time in another unit; left at its default of another machine",
        judge: |c| {
            let s = c.between("run", "at speed")?;
            c.near(
                s,
                |s| s.value(&image::HEARTBEAT_TIME),
                |_| 600.0,
                400.0,
                "ms",
            )
        },
    },
    Check {
        id: "L03",
        area: Area::Link,
        requirement: "When the drives cannot be heard, run, thread and ON are taken back within 1.5 s",
        episode: "link is lost",
        trend: COMMANDED,
        causes: "the drives' heartbeat is not watched; a watch that waits too long; frozen inputs are believed",
        judge: |c| {
            c.soon(c.after("link is lost", 10.0)?, 1.5, "all taken back", |s| {
                !asks_to_move(s) && off(s)
            })
        },
    },
    Check {
        id: "L04",
        area: Area::Link,
        requirement: "A lost link is shown to the operator",
        episode: "link is lost",
        trend: &[&image::HEARTBEAT, &PLC_ALARMS],
        causes: "the drives' heartbeat is not watched; the alarm is not mapped",
        judge: |c| alarmed(c, "link is lost", alarm::LINK, "the alarm is shown"),
    },
    Check {
        id: "L05",
        area: Area::Link,
        requirement: "Nothing starts by itself when the link is back",
        episode: "link is lost",
        trend: COMMANDED,
        causes: "commands are levels of the sequence, which was not reset; the alarm is not latched",
        judge: |c| stays(c, "link is back", "link, over", true),
    },
    Check {
        id: "L06",
        area: Area::Link,
        requirement: "No alarm without a reason, also when the drives' heartbeat wraps",
        episode: "",
        trend: &[&image::HEARTBEAT, &PLC_ALARMS],
        causes: "a counter compared with < where it wraps; alarms not reset by the acknowledge; swapped alarms",
        judge: false_alarms,
    },
    Check {
        id: "L07",
        area: Area::Link,
        requirement: "Every word that the PLC writes is within its limits, and no bit without meaning stands",
        episode: "",
        trend: &[&image::V_SET, &image::TENSION_SET, &image::ACCEL_SET],
        causes: "wrong scale or unit; registers shifted by one; bytes swapped; a value that wraps",
        judge: words,
    },
    Check {
        id: "S01",
        area: Area::Start,
        requirement: "Before the operator asks for it no drive is switched on and nothing is commanded",
        episode: "before the start",
        trend: COMMANDED,
        causes: "outputs with a wrong initial value; a sequence that begins by itself",
        judge: unasked,
    },
    Check {
        id: "S02",
        area: Area::Start,
        requirement: "Thread and run are not commanded while the drives are off",
        episode: "before the start",
        trend: COMMANDED,
        causes: "push-buttons are passed on without interlock",
        judge: |c| {
            stays(
                c,
                "asked without drives",
                "asked without drives, over",
                false,
            )
        },
    },
    Check {
        id: "S03",
        area: Area::Start,
        requirement: "Each drive gets 047E hex, and 047F when it is ready to switch on",
        episode: "maneuver",
        trend: &[
            &image::STW1_UW,
            &image::ZSW1_UW,
            &image::STW1_FD,
            &image::ZSW1_FD,
        ],
        causes: "ON stands from power-up; a wrong control word; a drive's words are not mapped",
        judge: start_sequence,
    },
    Check {
        id: "S04",
        area: Area::Start,
        requirement: "ON is only given to a drive that says it is ready to switch on",
        episode: "",
        trend: &[&image::STW1_RD, &image::ZSW1_RD],
        causes: "the status word is not looked at, or another section's; bits swapped",
        judge: only_when_ready,
    },
    Check {
        id: "S05",
        area: Area::Start,
        requirement: "All drives are in operation within 5 s when the operator asks for it",
        episode: "maneuver",
        trend: &[&image::STW1_UW, &image::ZSW1_UW, &WINDER_STATUS],
        causes: "a control word that is not 047F; an inhibited drive whose ON was not taken back",
        judge: |c| {
            c.reached("drives on", "in operation")
                .map(|s| format!("after {:.2} s", span(s)))
        },
    },
    Check {
        id: "P01",
        area: Area::Preset,
        requirement: "The preset is the diameter that the operator has measured",
        episode: "new rolls",
        trend: &[&image::D_PRESET_UW, &image::D_UW],
        causes: "a radius instead of a diameter; a wrong unit (0.1 mm); an old value",
        judge: |c| {
            let s = c.after("new parent roll", 10.0)?;
            let edge = edges(s, &WINDER_COMMAND, command::PRESET_ACCEPT).next();
            let Some((_, at)) = edge else {
                return Err(c.failed("no preset is taken over".into(), s.first()));
            };
            c.near(
                std::slice::from_ref(at),
                |s| s.value(&image::D_PRESET_UW),
                |_| PARENTS[0],
                3.0,
                "mm",
            )
        },
    },
    Check {
        id: "P02",
        area: Area::Preset,
        requirement: "A preset is taken over by one edge, with its value standing before it",
        episode: "new rolls",
        trend: &[&image::D_PRESET_UW, &WINDER_COMMAND],
        causes: "value and edge written together; an edge that is repeated every cycle",
        judge: preset_accept,
    },
    Check {
        id: "P03",
        area: Area::Preset,
        requirement: "The drives have the roll's diameter afterwards",
        episode: "new rolls",
        trend: &[&image::D_PRESET_UW, &image::D_UW],
        causes: "as P01; the edge comes before the new roll is told, which drops it",
        judge: |c| {
            c.near(
                c.after("preset", 0.5)?,
                |s| s.value(&image::D_UW),
                |_| PARENTS[0],
                15.0,
                "mm",
            )
        },
    },
    Check {
        id: "P04",
        area: Area::Preset,
        requirement: "A second parent roll is preset with its own diameter",
        episode: "end of the parent roll",
        trend: &[&image::D_PRESET_UW, &image::D_UW],
        causes: "a stale value: the preset is copied once only; edge and value change places",
        judge: |c| {
            c.near(
                c.after("nearly used up", 0.2)?,
                |s| s.value(&image::D_UW),
                |_| PARENTS[1],
                5.0,
                "mm",
            )
        },
    },
    Check {
        id: "M01",
        area: Area::Maneuver,
        requirement: "Jog forward turns the parent roll forward and nothing else",
        episode: "maneuver",
        trend: &[&image::N_UW, &image::N_RD],
        causes: "directions or sections swapped",
        judge: |c| jog(c, "forward", "forward, over", 1.0),
    },
    Check {
        id: "M02",
        area: Area::Maneuver,
        requirement: "Jog backward turns the parent roll backward and nothing else",
        episode: "maneuver",
        trend: &[&image::N_UW, &image::N_RD],
        causes: "directions or sections swapped",
        judge: |c| jog(c, "backward", "backward, over", -1.0),
    },
    Check {
        id: "M03",
        area: Area::Maneuver,
        requirement: "The maneuver ends when the push-button is let go",
        episode: "maneuver",
        trend: &[&image::N_UW, &WINDER_COMMAND],
        causes: "the push-button is latched",
        judge: |c| {
            let jogs = command::JOG_FORWARD | command::JOG_BACKWARD;
            let s = c.after("forward, over", 3.0)?;
            c.soon(s, REACTION_S, "jog is taken back", |s| {
                s.lacks(&WINDER_COMMAND, jogs)
            })
        },
    },
    Check {
        id: "T01",
        area: Area::Thread,
        requirement: "Thread is not commanded before the web is led through",
        episode: "thread",
        trend: COMMANDED,
        causes: "winder_status.web_threaded is not looked at",
        judge: |c| {
            c.never(
                c.between("no web", "web is led")?,
                "thread is commanded",
                asks_to_move,
            )
        },
    },
    Check {
        id: "T02",
        area: Area::Thread,
        requirement: "Thread brings the web under tension within 30 s",
        episode: "thread",
        trend: PULL,
        causes: "thread is not passed on; a wrong preset; stall tension too low",
        judge: |c| {
            c.reached("thread", "tight")
                .map(|s| format!("after {:.1} s", span(s)))
        },
    },
    Check {
        id: "T03",
        area: Area::Thread,
        requirement: "Thread is slow: 10 to 40 m/min",
        episode: "thread",
        trend: SPEED,
        causes: "v_thread_set in another unit, or that of run",
        judge: |c| {
            c.near(
                c.between("tight", "threaded")?,
                |s| s.value(&image::V_WEB),
                |_| 25.0,
                15.0,
                "m/min",
            )
        },
    },
    Check {
        id: "T04",
        area: Area::Thread,
        requirement: "Stall tension is a fifth to a half of the tension of run",
        episode: "thread",
        trend: PULL,
        causes: "stall_set and tension_set swapped; a share in percent taken for one",
        judge: |c| {
            c.near(
                c.between("tight", "threaded")?,
                |s| s.value(&image::STALL_SET) / TENSION * 100.0,
                |_| 35.0,
                15.0,
                "%",
            )
        },
    },
    Check {
        id: "T05",
        area: Area::Thread,
        requirement: "Run is not commanded before tension is detected",
        episode: "thread",
        trend: &[&image::TENSION, &WINDER_COMMAND, &WINDER_STATUS],
        causes: "winder_status.tension_detected is not looked at; a push-button is remembered",
        judge: |c| {
            c.never(
                c.between("thread", "tight")?,
                "run is commanded on a slack web",
                |s| s.has(&WINDER_COMMAND, command::RUN),
            )
        },
    },
    Check {
        id: "R01",
        area: Area::Run,
        requirement: "The web runs at the speed that the operator asks for",
        episode: "run",
        trend: SPEED,
        causes: "v_set in another unit (0.1 m/min); run is an edge where a level is wanted",
        judge: |c| {
            let s = match c.after("at speed", 1.0) {
                Err(Miss::NotSeen(why)) if c.mark("run").is_ok() => {
                    return Err(c.failed(why, c.at("run").ok()));
                }
                other => other?,
            };
            c.near(s, |s| s.value(&image::V_WEB), |_| SPEEDS[0], 3.0, "m/min")
        },
    },
    Check {
        id: "R02",
        area: Area::Run,
        requirement: "The tension reference is what the operator asks for",
        episode: "run",
        trend: PULL,
        causes: "N instead of N/m; a taper that is not off at 0",
        judge: |c| {
            c.near(
                c.after("at speed", 0.5)?,
                |s| s.value(&image::TENSION_SET),
                |_| TENSION,
                1.0,
                "N/m",
            )
        },
    },
    Check {
        id: "R03",
        area: Area::Run,
        requirement: "Acceleration is that of the machine, 0.45 m/s², with a limited jerk",
        episode: "run",
        trend: &[&image::V_REF, &image::A_REF],
        causes: "accel_set in another unit; the emergency stop's",
        judge: acceleration,
    },
    Check {
        id: "R04",
        area: Area::Run,
        requirement: "Other set-points in run are followed",
        episode: "run",
        trend: &[&image::V_SET, &image::V_WEB, &image::TENSION_SET],
        causes: "set-points are only read when run begins",
        judge: |c| {
            let s = c.after("followed", 0.02)?;
            c.near(
                s,
                |s| s.value(&image::TENSION_SET),
                |_| TENSION + 50.0,
                1.0,
                "N/m",
            )?;
            c.near(s, |s| s.value(&image::V_WEB), |_| SPEEDS[1], 3.0, "m/min")
        },
    },
    Check {
        id: "R05",
        area: Area::Run,
        requirement: "The stop button takes run back at once",
        episode: "run",
        trend: COMMANDED,
        causes: "the push-button is not read in every state; run is latched elsewhere",
        judge: |c| {
            c.soon(
                c.after("stop", 5.0)?,
                REACTION_S,
                "run is taken back",
                |s| s.lacks(&WINDER_COMMAND, command::RUN),
            )
        },
    },
    Check {
        id: "R06",
        area: Area::Run,
        requirement: "A stop is a normal stop and leaves the web under stall tension",
        episode: "run",
        trend: PULL,
        causes: "OFF1, OFF2 or OFF3 instead of run = 0; drives switched off at once",
        judge: stop,
    },
    Check {
        id: "R07",
        area: Area::Run,
        requirement: "A speed that the machine does not have is limited to its largest",
        episode: "before the start",
        trend: &[&image::OPERATOR_V_SET, &image::V_SET],
        causes: "no limit; a word that wraps",
        judge: |c| {
            let s = c.after("too fast", 0.4)?;
            if s.iter().all(|s| s.word(&image::HEARTBEAT_PLC) == 0) {
                return Err(Miss::NotSeen(format!(
                    "the PLC did not see {TOO_FAST} m/min"
                )));
            }
            c.near(s, |s| s.value(&image::V_SET), |_| 2350.0, 150.0, "m/min")
        },
    },
    Check {
        id: "R08",
        area: Area::Run,
        requirement: "The torque limits leave every motor its rated torque",
        episode: "run",
        trend: &[
            &image::TORQUE_LIMIT_UW,
            &image::TORQUE_LIMIT_DRUMS,
            &image::TORQUE_UW,
        ],
        causes: "limits swapped or in another unit (0.1 %)",
        judge: limits_of_torque,
    },
    Check {
        id: "R09",
        area: Area::Run,
        requirement: "In run the tension loop is closed and the rider roll lies on the roll",
        episode: "run",
        trend: &[&WINDER_STATUS, &WINDER_COMMAND_2],
        causes: "winder_command_2 shifted or not cleared",
        judge: |c| {
            let wanted = status::RIDER_DOWN | status::TENSION_CONTROL;
            c.never(
                c.between("at speed", "stop")?,
                "loop open or roll up",
                |s| !s.has(&WINDER_STATUS, wanted),
            )
        },
    },
    Check {
        id: "R10",
        area: Area::Run,
        requirement: "A new core or parent roll is not passed on while the web runs",
        episode: "run",
        trend: COMMANDED,
        causes: "push-buttons are passed on without interlock",
        judge: |c| {
            let bits = command::NEW_CORE | command::NEW_PARENT_ROLL | command::PRESET_ACCEPT;
            let s = c.between("core and parent roll in run", "other set-points")?;
            c.never(s, "it is passed on", |s| !s.lacks(&WINDER_COMMAND, bits))
        },
    },
    Check {
        id: "Q01",
        area: Area::Set,
        requirement: "A set to a length stands at that length, within 1 m",
        episode: "set to a length",
        trend: ROLLS,
        causes: "stopping distance without jerk or delay; length in another unit; counter not reset, or wrapped",
        judge: |c| {
            c.near(
                std::slice::from_ref(c.at("first set stands")?),
                |s| s.value(&image::LENGTH_WU),
                |_| LENGTH,
                1.0,
                "m",
            )
        },
    },
    Check {
        id: "Q02",
        area: Area::Set,
        requirement: "A set to a diameter stands at that diameter, within 1 mm",
        episode: "set to a diameter",
        trend: ROLLS,
        causes: "radius for diameter; wrong caliper; stopping distance without jerk",
        judge: |c| {
            c.near(
                std::slice::from_ref(c.at("second set stands")?),
                |s| s.value(&image::D_WU),
                |_| DIAMETER,
                1.0,
                "mm",
            )
        },
    },
    Check {
        id: "Q03",
        area: Area::Set,
        requirement: "The PLC's own length is right over a wrap of the encoder's counter, within 0.5 m",
        episode: "set to a length",
        trend: &[&image::PULSES_RD, &image::PLC_LENGTH, &image::LENGTH_WU],
        causes: "the counter's difference is not taken in its width; wrong pulses per metre; not reset with the core",
        judge: |c| {
            let s = std::slice::from_ref(c.at("first set stands")?);
            c.near(
                s,
                |s| s.value(&image::PLC_LENGTH),
                |s| s.value(&image::LENGTH_WU),
                0.5,
                "m",
            )
        },
    },
    Check {
        id: "Q04",
        area: Area::Set,
        requirement: "Each wound set is counted once",
        episode: "set to a length",
        trend: &[&image::V_WEB, &image::PLC_SETS],
        causes: "off by one; counted by a level; counted by every stop",
        judge: sets,
    },
    Check {
        id: "Q05",
        area: Area::Set,
        requirement: "The taper takes the tension down in proportion to the diameter",
        episode: "set to a diameter",
        trend: &[&image::D_WU, &image::TENSION_SET, &image::TENSION],
        causes: "sign; percent and its tenths; radius for diameter; diameter of the last set",
        judge: |c| {
            c.near(
                &second_set(c)?,
                |s| s.value(&image::TENSION_SET),
                |s| TENSION * (1.0 - TAPER * growth(s)),
                2.0,
                "N/m",
            )
        },
    },
    Check {
        id: "Q06",
        area: Area::Set,
        requirement: "The winding force follows its table over the diameter",
        episode: "set to a diameter",
        trend: &[&image::D_WU, &image::FRONT_SHARE_TRIM],
        causes: "sign; not scaled with the diameter; unit (0.1 %)",
        judge: |c| {
            c.near(
                &second_set(c)?,
                |s| s.value(&image::FRONT_SHARE_TRIM),
                |s| FORCE * growth(s),
                0.2,
                "%",
            )
        },
    },
    Check {
        id: "Q07",
        area: Area::Set,
        requirement: "The rider load follows its table over the diameter",
        episode: "set to a diameter",
        trend: &[&image::D_WU, &image::RIDER_LOAD_SET, &image::RIDER_LOAD],
        causes: "sign; N/m instead of percent of the table; not scaled with the diameter",
        judge: |c| {
            c.near(
                &second_set(c)?,
                |s| s.value(&image::RIDER_LOAD_SET),
                |s| 100.0 + (RIDER - 100.0) * growth(s),
                1.0,
                "%",
            )
        },
    },
    Check {
        id: "Q08",
        area: Area::Set,
        requirement: "The rider roll is lifted only when the web stands and is to stand",
        episode: "set to a length",
        trend: &[&image::V_WEB, &WINDER_COMMAND_2],
        causes: "lifted when the stop begins; not lowered before thread",
        judge: rider,
    },
    Check {
        id: "Q09",
        area: Area::Set,
        requirement: "The drum brakes are closed when the set stands, never before, and opened before it moves",
        episode: "set to a length",
        trend: &[&image::V_WEB, &WINDER_COMMAND, &WINDER_STATUS],
        causes: "closed when the stop begins; not opened; standstill is not looked at",
        judge: drum_brakes,
    },
    Check {
        id: "Q10",
        area: Area::Set,
        requirement: "With a full roll in, neither thread nor run is commanded",
        episode: "set to a length",
        trend: COMMANDED,
        causes: "the end of the set is not remembered",
        judge: |c| {
            c.never(
                c.between("first set rests", "first set over")?,
                "it is commanded",
                asks_to_move,
            )
        },
    },
    Check {
        id: "Q11",
        area: Area::Set,
        requirement: "A new core is passed on by an edge and begins the PLC's length",
        episode: "set to a length",
        trend: &[&image::PLC_LENGTH, &WINDER_COMMAND],
        causes: "the counter has another reset; no interlock with standstill, or one too many",
        judge: new_core,
    },
    Check {
        id: "Q12",
        area: Area::Set,
        requirement: "The winder stands before the parent roll is used up, and not long before",
        episode: "end of the parent roll",
        trend: &[&image::V_WEB, &image::D_UW],
        causes: "radius for diameter; no stopping distance; the end is not looked at",
        judge: parent_roll,
    },
    Check {
        id: "Q13",
        area: Area::Set,
        requirement: "A used-up parent roll is shown, and is not wound on",
        episode: "end of the parent roll",
        trend: &[&image::V_WEB, &PLC_ALARMS],
        causes: "the end is not remembered",
        judge: |c| {
            let s = c.between("used up", "used up, over")?;
            c.never(s, "run is commanded again", |s| {
                s.has(&WINDER_COMMAND, command::RUN) && !mode(s, Mode::Run)
            })?;
            c.soon(s, 1.0, "the alarm is shown", |s| {
                s.has(&PLC_ALARMS, alarm::PARENT_ROLL_END)
            })
        },
    },
    Check {
        id: "F01",
        area: Area::Faults,
        requirement: "After a web break run and thread are taken back",
        episode: "web break",
        trend: PULL,
        causes: "winder_status.web_break and fault are not looked at",
        judge: |c| {
            c.soon(
                c.after("web break is told", 5.0)?,
                REACTION_S,
                "taken back",
                |s| !asks_to_move(s),
            )
        },
    },
    Check {
        id: "F02",
        area: Area::Faults,
        requirement: "A web break is shown to the operator",
        episode: "web break",
        trend: &[&image::TENSION, &PLC_ALARMS],
        causes: "the fault's code is not mapped",
        judge: |c| {
            alarmed(
                c,
                "web break is told",
                alarm::WEB_BREAK,
                "the alarm is shown",
            )
        },
    },
    Check {
        id: "F03",
        area: Area::Faults,
        requirement: "With a fault that is not acknowledged nothing is started",
        episode: "web break",
        trend: COMMANDED,
        causes: "push-buttons are not locked by a fault",
        judge: |c| {
            c.never(
                c.between("web break stands", "web break acknowledged")?,
                "thread or run is commanded",
                asks_to_move,
            )
        },
    },
    Check {
        id: "F04",
        area: Area::Faults,
        requirement: "The PLC acknowledges only when the operator does",
        episode: "web break",
        trend: &[&OPERATOR_REQUEST, &WINDER_COMMAND],
        causes: "acknowledge stands all the time, or follows the fault",
        judge: acknowledge,
    },
    Check {
        id: "F05",
        area: Area::Faults,
        requirement: "After the acknowledge nothing restarts by itself",
        episode: "web break",
        trend: COMMANDED,
        causes: "the sequence goes on where it was; requests are levels",
        judge: |c| {
            let seen = stays(c, "web break acknowledged", "web break over", false)?;
            match stays(c, "front drum acknowledged", "front drum over", true) {
                Err(Miss::NotSeen(_)) => Ok(seen),
                other => other,
            }
        },
    },
    Check {
        id: "F06",
        area: Area::Faults,
        requirement: "When a drive trips, ON is taken back in all of them",
        episode: "front drum's drive trips",
        trend: &[&image::V_WEB, &image::STW1_RD, &image::STW1_FD],
        causes: "only the tripped drive is looked at; the fault's code is not mapped",
        judge: |c| {
            c.soon(
                c.after("front drum trips", 5.0)?,
                REACTION_S,
                "ON is taken back",
                off,
            )
        },
    },
    Check {
        id: "F07",
        area: Area::Faults,
        requirement: "A trip is shown as that of its section",
        episode: "unwind's drive trips",
        trend: &[&image::FAULT, &PLC_ALARMS],
        causes: "sections swapped, in status words or in alarms",
        judge: |c| {
            let only = |from: &str, bit: u16| {
                let others = alarm::TRIP_UW | alarm::TRIP_RD | alarm::TRIP_FD | alarm::TRIP_RR;
                let s = c.after(from, 3.0)?;
                c.never(s, "another section is shown", |s| {
                    !s.lacks(&PLC_ALARMS, others & !bit)
                })?;
                c.soon(s, 1.0, "shown", |s| s.has(&PLC_ALARMS, bit))
            };
            only("front drum trips", alarm::TRIP_FD)?;
            only("unwind trips", alarm::TRIP_UW)
        },
    },
    Check {
        id: "F08",
        area: Area::Faults,
        requirement: "The emergency stop gives OFF3 to all drives at once",
        episode: "emergency stop",
        trend: &[&image::V_WEB, &image::STW1_UW, &image::STW1_RR],
        causes: "bits of OFF2 and OFF3 swapped; one section is missing",
        judge: emergency,
    },
    Check {
        id: "F09",
        area: Area::Faults,
        requirement: "The winder makes the emergency stop and no other",
        episode: "emergency stop",
        trend: &[&image::V_REF, &image::V_WEB, &image::A_REF],
        causes: "OFF2 instead of OFF3; run taken back long before OFF3",
        judge: emergency_mode,
    },
    Check {
        id: "F10",
        area: Area::Faults,
        requirement: "A released emergency stop starts nothing",
        episode: "emergency stop",
        trend: COMMANDED,
        causes: "the emergency stop is not latched",
        judge: |c| stays(c, "emergency stop is released", "emergency stop over", true),
    },
    Check {
        id: "F11",
        area: Area::Faults,
        requirement: "Load cells that do not follow are noticed: alarm, and run taken back, within 10 s",
        episode: "load cells are stuck",
        trend: PULL,
        causes: "tension and reference are not compared; a band or time that is too wide",
        judge: cells,
    },
    Check {
        id: "F12",
        area: Area::Faults,
        requirement: "A silent encoder is shown to the operator",
        episode: "unwind's encoder is silent",
        trend: &[&image::N_UW, &image::FAULT, &PLC_ALARMS],
        causes: "the fault's code is not mapped",
        judge: |c| alarmed(c, "encoder is silent", alarm::ENCODER, "the alarm is shown"),
    },
    Check {
        id: "F13",
        area: Area::Faults,
        requirement: "A brake that does not follow is shown to the operator",
        episode: "front drum's brake does not close",
        trend: &[&image::V_WEB, &image::FAULT, &PLC_ALARMS],
        causes: "the fault's code is not mapped, or not that of each brake",
        judge: |c| {
            alarmed(
                c,
                "brake does not close",
                alarm::BRAKE,
                "the alarm is shown",
            )
        },
    },
    Check {
        id: "F14",
        area: Area::Faults,
        requirement: "A motor that is too warm stops the winder normally, before its drive trips",
        episode: "rider roll's motor is warm",
        trend: &[&image::V_WEB, &image::WARNINGS, &image::FAULT],
        causes: "warnings are not looked at",
        judge: hot,
    },
    Check {
        id: "F15",
        area: Area::Faults,
        requirement: "A motor that is too warm is shown to the operator",
        episode: "rider roll's motor is warm",
        trend: &[&image::WARNINGS, &PLC_ALARMS],
        causes: "warnings are not looked at",
        judge: |c| alarmed(c, "motor is warm", alarm::MOTOR_HOT, "the alarm is shown"),
    },
    Check {
        id: "F16",
        area: Area::Faults,
        requirement: "An emergency stop is shown until it is acknowledged",
        episode: "emergency stop",
        trend: &[&OPERATOR_REQUEST, &PLC_ALARMS],
        causes: "the alarm goes with the push-button",
        judge: |c| {
            let s = c.between("emergency stop is obeyed", "emergency stop over")?;
            let pressed = |s: &Sample| s.has(&OPERATOR_REQUEST, request::EMERGENCY_STOP);
            c.soon(s, 1.0, "shown", |s| {
                s.has(&PLC_ALARMS, alarm::EMERGENCY_STOP)
            })?;
            c.never(&s[s.len() / 2..], "not shown", |s| {
                !pressed(s) && s.lacks(&PLC_ALARMS, alarm::EMERGENCY_STOP)
            })
        },
    },
];

/// The checks as a table of Markdown, for the page about them.
pub fn markdown() -> String {
    let mut text =
        String::from("| Id | Area | Requirement | Likely causes |\n| --- | --- | --- | --- |\n");
    for check in CHECKS {
        let (id, area) = (check.id, check.area.name());
        text += &format!(
            "| {id} | {area} | {} | {} |\n",
            check.requirement, check.causes
        );
    }
    text
}
