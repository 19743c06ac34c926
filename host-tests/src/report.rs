//! What came of a set: figures, limits, verdicts.
//!
//! Not here: how the figures are drawn (that is [`crate::plot`]'s). Everything is computed from what the PLC
//! has seen, not from what the simulator knows.

use std::fmt;
use std::ops::Range;

use model_core::image::{self, Signal};
use model_core::logic::Mode;

use crate::plc::{Recipe, Sample};

/// Permitted deviation of the tension in acceleration and deceleration, of its reference.
pub const TENSION_BAND: f64 = 0.10;
/// Permitted error of the roll's diameter, mm.
pub const DIAMETER_TOLERANCE_MM: f64 = 1.0;
/// The reference ramps where its acceleration is above this, m/s².
const RAMPING_M_S2: f64 = 0.005;
/// At thread speed and above, the last count of the feedback aside.
const AT_THREAD_SPEED: f64 = 0.99;

/// A line of the report.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Row {
    /// What.
    pub name: &'static str,
    /// How much, with its unit.
    pub value: String,
    /// The limit, where there is one, and whether it was kept.
    pub limit: Option<(String, bool)>,
}

impl Row {
    fn plain(name: &'static str, value: String) -> Self {
        Self {
            name,
            value,
            limit: None,
        }
    }
}

/// The report of a set.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Report {
    /// Its lines.
    pub rows: Vec<Row>,
}

/// Which part of the run a sample belongs to, where the tension is judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// The speed rises.
    Acceleration,
    /// The speed stands.
    Steady,
    /// The speed falls.
    Deceleration,
}

impl Phase {
    /// The phase of a sample; none below thread speed and in other modes than run and stop.
    pub fn of(sample: &Sample, thread_speed_m_s: f64) -> Option<Self> {
        if sample.value(&image::V_WEB) < AT_THREAD_SPEED * thread_speed_m_s * 60.0 {
            return None;
        }
        let a_ref = sample.value(&image::A_REF);
        match sample.mode()? {
            Mode::NormalStop => Some(Self::Deceleration),
            Mode::Run if a_ref > RAMPING_M_S2 => Some(Self::Acceleration),
            Mode::Run if a_ref < -RAMPING_M_S2 => Some(Self::Deceleration),
            Mode::Run => Some(Self::Steady),
            _ => None,
        }
    }
}

/// Smallest and largest deviation of the tension from its reference, of the reference.
pub fn tension_deviation(
    samples: &[Sample],
    thread_speed_m_s: f64,
    phase: Phase,
) -> Option<Range<f64>> {
    samples
        .iter()
        .filter(|sample| Phase::of(sample, thread_speed_m_s) == Some(phase))
        .map(|sample| {
            (
                sample.value(&image::TENSION),
                sample.value(&image::TENSION_REF),
            )
        })
        .filter(|&(_, reference)| reference > 0.0)
        .map(|(tension, reference)| tension / reference - 1.0)
        .fold(None, |range: Option<Range<f64>>, x| {
            let range = range.unwrap_or(x..x);
            Some(range.start.min(x)..range.end.max(x))
        })
}

impl Report {
    /// The report of the samples of a set.
    pub fn of(recipe: &Recipe, samples: &[Sample]) -> Self {
        let Some(last) = samples.last() else {
            return Self { rows: Vec::new() };
        };
        let mut rows = vec![
            Row::plain(
                "set length",
                format!("{:.1} m", last.value(&image::LENGTH_WU)),
            ),
            Row::plain("time", minutes(last.t_s)),
        ];

        for (name, phase, judged) in [
            ("tension in acceleration", Phase::Acceleration, true),
            ("tension at constant speed", Phase::Steady, false),
            ("tension in deceleration", Phase::Deceleration, true),
        ] {
            let thread_speed_m_s = recipe.machine.operation.thread_speed_m_s;
            let deviation = tension_deviation(samples, thread_speed_m_s, phase);
            let value = deviation.as_ref().map_or("not seen".to_owned(), |d| {
                format!(
                    "{:+.1} … {:+.1} % of reference",
                    100.0 * d.start,
                    100.0 * d.end
                )
            });
            let kept = deviation.is_some_and(|d| d.start >= -TENSION_BAND && d.end <= TENSION_BAND);
            let limit = judged.then(|| (format!("±{:.0} %", 100.0 * TENSION_BAND), kept));
            rows.push(Row { name, value, limit });
        }

        let diameter = last.value(&image::D_WU);
        let error = diameter - 1e3 * recipe.diameter_m;
        rows.push(Row {
            name: "diameter of the roll",
            value: format!("{diameter:.1} mm, error {error:+.1} mm"),
            limit: Some((
                format!("±{DIAMETER_TOLERANCE_MM:.0} mm"),
                error.abs() <= DIAMETER_TOLERANCE_MM,
            )),
        });
        let drums = |s: &Sample| s.value(&image::POWER_RD) + s.value(&image::POWER_FD);
        let peak = |power: &dyn Fn(&Sample) -> f64| samples.iter().map(power).fold(0.0, f64::max);
        rows.push(Row::plain(
            "peak power",
            format!(
                "drums {:.0} kW, unwind gives back {:.0} kW",
                peak(&drums),
                peak(&|s| -s.value(&image::POWER_UW))
            ),
        ));

        let count = |signal: &Signal| last.value(signal);
        for (name, period_us, overruns, time, jitter) in [
            (
                "plant task",
                4_000,
                image::PLANT_OVERRUNS,
                image::PLANT_TIME_MAX,
                image::PLANT_JITTER_MAX,
            ),
            (
                "drive task",
                10_000,
                image::DRIVE_OVERRUNS,
                image::DRIVE_TIME_MAX,
                image::DRIVE_JITTER_MAX,
            ),
        ] {
            rows.push(Row {
                name,
                value: format!(
                    "{} overruns; longest {} of {period_us} µs, latest start {} µs",
                    count(&overruns),
                    count(&time),
                    count(&jitter)
                ),
                limit: Some(("no overrun".to_owned(), count(&overruns) == 0.0)),
            });
        }
        rows.push(Row {
            name: "drive logic",
            value: format!(
                "{} drive cycles without a turn",
                count(&image::LOGIC_OVERRUNS)
            ),
            limit: Some((
                "no overrun".to_owned(),
                count(&image::LOGIC_OVERRUNS) == 0.0,
            )),
        });
        Self { rows }
    }

    /// The names of the lines whose limit was missed.
    pub fn missed(&self) -> Vec<&'static str> {
        let missed = |row: &&Row| matches!(row.limit, Some((_, false)));
        self.rows
            .iter()
            .filter(missed)
            .map(|row| row.name)
            .collect()
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = |text: fn(&Row) -> &str| {
            self.rows
                .iter()
                .map(|row| text(row).chars().count())
                .max()
                .unwrap_or(0)
        };
        let (names, values) = (width(|row| row.name), width(|row| &row.value));
        for row in &self.rows {
            write!(f, "  {:names$}  ", row.name)?;
            match &row.limit {
                None => writeln!(f, "{}", row.value)?,
                Some((limit, kept)) => {
                    let verdict = if *kept { "ok" } else { "MISSED" };
                    writeln!(f, "{:values$}  {limit:10}  {verdict}", row.value)?;
                }
            }
        }
        Ok(())
    }
}

/// A time for people.
pub fn minutes(t_s: f64) -> String {
    let t_s = t_s.round() as u64;
    format!("{}:{:02} min", t_s / 60, t_s % 60)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plc::Step;
    use model_core::image::Feedback;
    use model_core::machine::Machine;

    /// Samples of one mode: acceleration, tension over reference, diameter.
    fn report(seen: &[(Mode, f64, f64, f64)]) -> Report {
        let recipe = Recipe {
            machine: Machine::news_8000(),
            diameter_m: 0.40,
            speed_m_s: 20.0,
        };
        let sample = |&(mode, a_ref, tension, diameter): &(Mode, f64, f64, f64)| {
            let mut feedback = Feedback::default();
            feedback.set_word(&image::MODE, mode as u16);
            feedback.set(&image::V_WEB, 600.0);
            feedback.set(&image::A_REF, a_ref);
            feedback.set(&image::TENSION_REF, 300.0);
            feedback.set(&image::TENSION, 300.0 * tension);
            feedback.set(&image::D_WU, diameter);
            Sample {
                t_s: 0.0,
                step: Step::Run,
                feedback,
            }
        };
        Report::of(&recipe, &seen.iter().map(sample).collect::<Vec<_>>())
    }

    #[test]
    fn a_limit_is_missed_by_what_lies_beyond_it() {
        use Mode::{NormalStop, Run};
        let good = [(Run, 0.45, 0.91, 300.0), (NormalStop, -0.45, 1.09, 400.9)];
        assert!(report(&good).missed().is_empty());
        for (i, bad, missed) in [
            (0, (Run, 0.45, 0.89, 300.0), "tension in acceleration"),
            (
                1,
                (NormalStop, -0.45, 1.11, 400.9),
                "tension in deceleration",
            ),
            (1, (NormalStop, -0.45, 1.09, 401.1), "diameter of the roll"),
            // what has not been seen has not been kept
            (0, (Run, 0.0, 1.0, 300.0), "tension in acceleration"),
        ] {
            let mut seen = good;
            seen[i] = bad;
            assert_eq!(report(&seen).missed(), [missed]);
        }
    }

    #[test]
    fn times_are_for_people() {
        assert_eq!(minutes(59.6), "1:00 min");
        assert_eq!(minutes(614.0), "10:14 min");
    }
}
