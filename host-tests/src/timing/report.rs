//! What the tracing plugin tells: numbers by address.
//!
//! Not here: names.

use anyhow::{Context, Result, bail};

/// Fewest, sum and most of something that happened several times.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Spread {
    /// How often.
    pub times: u64,
    /// The fewest.
    pub min: u64,
    /// All together.
    pub total: u64,
    /// The most.
    pub max: u64,
}

impl Spread {
    /// The mean.
    pub fn mean(&self) -> f64 {
        self.total as f64 / self.times.max(1) as f64
    }

    /// Both.
    pub fn join(&mut self, other: &Self) {
        if other.times == 0 {
            return;
        }
        self.min = if self.times == 0 {
            other.min
        } else {
            self.min.min(other.min)
        };
        self.times += other.times;
        self.total += other.total;
        self.max = self.max.max(other.max);
    }
}

/// What is known of a task, an executor or a handler.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Seen {
    /// Instructions of an activation without what preempted it.
    pub net: Spread,
    /// With it.
    pub gross: Spread,
    /// Sections with interrupts masked.
    pub masked: Spread,
    /// Its own stack, bytes.
    pub own_stack: u64,
    /// The stack in use while it ran, bytes.
    pub stack: u64,
    /// From start to start, in counts of the stopwatch.
    pub period: Spread,
    /// The earliest start against a clock of its period, in counts.
    pub early: i64,
    /// The latest.
    pub late: i64,
    /// Activations not done when the next was due.
    pub overruns: u64,
}

impl Seen {
    /// Of two instances of the same task.
    pub fn join(&mut self, other: &Self) {
        self.net.join(&other.net);
        self.gross.join(&other.gross);
        self.masked.join(&other.masked);
        self.own_stack = self.own_stack.max(other.own_stack);
        self.stack = self.stack.max(other.stack);
        self.period.join(&other.period);
        self.early = self.early.min(other.early);
        self.late = self.late.max(other.late);
        self.overruns += other.overruns;
    }
}

/// All that was counted.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Report {
    /// Instructions executed.
    pub executed: u64,
    /// Writes to mask registers whose value the plugin cannot see.
    pub unknown_masks: u64,
    /// By the address of who ran; 0 where nobody had begun.
    pub seen: Vec<(u64, Seen)>,
    /// Masked sections by the address where they begin.
    pub masked: Vec<(u64, Spread)>,
}

impl Report {
    /// Takes a line of the plugin's.
    pub fn line(&mut self, line: &str) -> Result<()> {
        self.take(line)
            .with_context(|| format!("cannot read the plugin's {line:?}"))
    }

    fn take(&mut self, line: &str) -> Result<()> {
        let mut words = line.split(' ');
        let what = words.next().unwrap_or_default();
        let address = |words: &mut std::str::Split<'_, char>| -> Result<u64> {
            let word = words.next().context("an address is missing")?;
            Ok(u64::from_str_radix(word, 16)?)
        };
        match what {
            "all" => {
                let mut numbers = Numbers(words);
                self.executed = numbers.next()?;
                self.unknown_masks = numbers.next()?;
            }
            "seen" => {
                let who = address(&mut words)?;
                let mut numbers = Numbers(words);
                let seen = Seen {
                    net: numbers.spread()?,
                    gross: numbers.spread()?,
                    masked: numbers.spread()?,
                    own_stack: numbers.next()?,
                    stack: numbers.next()?,
                    period: numbers.spread()?,
                    early: numbers.next()?,
                    late: numbers.next()?,
                    overruns: numbers.next()?,
                };
                self.seen.push((who, seen));
            }
            "masked" => {
                let place = address(&mut words)?;
                self.masked.push((place, Numbers(words).spread()?));
            }
            _ => bail!("it begins with neither all, seen nor masked"),
        }
        Ok(())
    }
}

struct Numbers<'a>(std::str::Split<'a, char>);

impl Numbers<'_> {
    fn next<N: std::str::FromStr>(&mut self) -> Result<N>
    where
        N::Err: std::error::Error + Send + Sync + 'static,
    {
        Ok(self.0.next().context("a number is missing")?.parse()?)
    }

    fn spread(&mut self) -> Result<Spread> {
        Ok(Spread {
            times: self.next()?,
            min: self.next()?,
            total: self.next()?,
            max: self.next()?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_read_or_refused() {
        let mut report = Report::default();
        report.line("all 100 0").unwrap();
        report
            .line("seen 2004a2 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 -19 20 21")
            .unwrap();
        report.line("masked 1f0 3 10 40 20").unwrap();
        let (who, seen) = report.seen[0];
        assert_eq!(
            (report.executed, who, seen.early, seen.overruns),
            (100, 0x2004a2, -19, 21)
        );
        assert_eq!(report.masked[0].1.max, 20);
        for wrong in ["", "seen", "seen xyz", "masked 1f0 3 10", "all 1 -2"] {
            let error = format!("{:#}", report.line(wrong).unwrap_err());
            assert!(error.contains(&format!("{wrong:?}")), "{error}");
        }
    }

    #[test]
    fn instances_of_a_task_are_one_row() {
        let one = Spread {
            times: 1,
            min: 5,
            total: 5,
            max: 5,
        };
        let mut two = Spread {
            times: 2,
            min: 6,
            total: 20,
            max: 14,
        };
        two.join(&one);
        two.join(&Spread::default());
        assert_eq!(
            two,
            Spread {
                times: 3,
                min: 5,
                total: 25,
                max: 14
            }
        );
    }
}
