//! The acceptance run that the page asks for: the request, who takes it, how far it is, what it has found.
//!
//! Not here: the run itself. A program on a PC, the runner, plays the operator over Modbus and reports here; it looks
//! for requests as anybody can, and says from time to time that it is there.

use core::fmt;

use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Instant};
use heapless::{Deque, String, Vec};
use picoserve::io::Write;
use serde::Deserialize;
use serde::de::{Deserializer, Error, Visitor};

use super::Hmi;
use super::answer::{Detail, OrNull, Out, Refusal, Text, cut};
use super::body;
use super::desk::Papers;

/// A runner that has said nothing for this long is gone.
pub const SILENCE: Duration = Duration::from_secs(10);
/// Checks that are kept; the run has fewer.
const CHECKS: usize = 72;
/// Checks in one report.
const AT_ONCE: usize = 8;

/// Text of at most so many bytes; what no longer fits is left out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Brief<const N: usize>(String<N>);

impl<'de, const N: usize> Deserialize<'de> for Brief<N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Cut<const N: usize>;
        impl<const N: usize> Visitor<'_> for Cut<N> {
            type Value = Brief<N>;
            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a text")
            }
            fn visit_str<E: Error>(self, text: &str) -> Result<Brief<N>, E> {
                Ok(Brief(cut(text)))
            }
        }
        deserializer.deserialize_str(Cut)
    }
}

/// What became of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Verdict {
    Passed,
    Failed,
    NotSeen,
}

impl Verdict {
    const fn name(self) -> &'static str {
        match self {
            Self::Passed => "passed",
            Self::Failed => "failed",
            Self::NotSeen => "not_seen",
        }
    }
}

/// A check that has been looked at.
#[derive(Clone, Debug, PartialEq, Deserialize)]
struct Check {
    id: Brief<8>,
    state: Verdict,
    #[serde(default)]
    text: Brief<64>,
}

/// Where a run is, as its runner tells it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Told {
    /// There is a runner, and it has nothing to do.
    Waiting,
    Running,
    /// At its end: all checks have passed.
    Passed,
    /// At its end: some have not.
    Failed,
    /// It could not be brought to its end.
    Stopped,
}

#[derive(Deserialize)]
struct Report {
    runner: Brief<32>,
    state: Told,
    #[serde(default)]
    request: Option<u32>,
    #[serde(default)]
    share: Option<f32>,
    #[serde(default)]
    text: Option<Brief<96>>,
    #[serde(default)]
    checks: Vec<Check, AT_ONCE>,
}

#[derive(Deserialize)]
struct Wish {
    run: bool,
}

/// Where the run is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum State {
    /// Nobody has asked for one.
    #[default]
    None,
    /// Asked for; no runner has begun.
    Asked,
    Running,
    Passed,
    Failed,
    /// By its runner, with the reason, or by who asked for it.
    Stopped,
}

impl State {
    const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Asked => "asked",
            Self::Running => "running",
            Self::Passed => "passed",
            Self::Failed => "failed",
            Self::Stopped => "stopped",
        }
    }

    const fn is_under_way(self) -> bool {
        matches!(self, Self::Asked | Self::Running)
    }
}

/// The run that was asked for last.
#[derive(Debug, Default)]
pub struct Acceptance {
    /// Counts up with every request.
    request: u32,
    state: State,
    /// 0 at the beginning, 1 at the end.
    share: f32,
    text: Brief<96>,
    checks: Deque<Check, CHECKS>,
    /// The runner, and when it was heard last.
    runner: Option<(Brief<32>, Instant)>,
}

impl Acceptance {
    /// The runner that is there.
    fn connected(&self, now: Instant) -> Option<&Brief<32>> {
        let (runner, heard) = self.runner.as_ref()?;
        (now.saturating_duration_since(*heard) < SILENCE).then_some(runner)
    }

    /// Asks for a run, or takes it back.
    fn wish(&mut self, run: bool, now: Instant) -> Result<&'static str, Refusal> {
        let lost = self.state == State::Running && self.connected(now).is_none();
        match (run, self.state.is_under_way()) {
            (true, true) if !lost => Err(Refusal::new(
                409,
                format_args!("request {} is not done yet", self.request),
            )),
            (true, _) => {
                self.request = self.request.wrapping_add(1);
                (self.state, self.share) = (State::Asked, 0.0);
                self.text = Brief::default();
                self.checks.clear();
                Ok("acceptance run asked for")
            }
            (false, true) => {
                self.state = State::Stopped;
                self.text = Brief(cut("taken back"));
                Ok("acceptance run taken back")
            }
            (false, false) => Err(Refusal::new(409, format_args!("no run is asked for"))),
        }
    }

    /// A runner reports; gives what is worth an event.
    fn report(&mut self, report: Report, now: Instant) -> Result<Option<&'static str>, Refusal> {
        let other = self.connected(now).filter(|other| **other != report.runner);
        if let Some(other) = other {
            let Brief(other) = other;
            let mut refusal = Refusal::new(409, format_args!("another runner is at it: {other}"));
            refusal.add(Detail::new(
                "runner",
                Text(&report.runner.0),
                "is not the one",
            ));
            return Err(refusal);
        }
        let to = match report.state {
            Told::Waiting => {
                self.runner = Some((report.runner, now));
                return Ok(None);
            }
            Told::Running => State::Running,
            Told::Passed => State::Passed,
            Told::Failed => State::Failed,
            Told::Stopped => State::Stopped,
        };
        let wanted = self.request;
        if report.request != Some(wanted) || !self.state.is_under_way() {
            let mut refusal = Refusal::new(409, format_args!("this run is not wanted any more"));
            let given = OrNull(report.request);
            refusal.add(Detail::new("request", given, "is not the one under way"));
            return Err(refusal);
        }
        self.runner = Some((report.runner, now));
        if let Some(share) = report.share.filter(|share| share.is_finite()) {
            self.share = share.clamp(0.0, 1.0);
        }
        if let Some(text) = report.text {
            self.text = text;
        }
        for check in report.checks {
            if let Some(known) = self.checks.iter_mut().find(|known| known.id == check.id) {
                *known = check;
                continue;
            }
            if self.checks.is_full() {
                self.checks.pop_front();
            }
            // There is room now.
            let _ = self.checks.push_back(check);
        }
        let news = self.state != to;
        self.state = to;
        Ok(news.then_some(match to {
            State::Running => "acceptance run begins",
            State::Passed => "acceptance run passed",
            State::Failed => "acceptance run has findings",
            _ => "acceptance run stopped",
        }))
    }
}

impl<M: RawMutex> Hmi<'_, M> {
    /// Somebody asks for a run, or takes it back.
    ///
    /// # Errors
    /// One is under way; there is none.
    pub(super) fn ask_acceptance(&self, body: &[u8]) -> Result<(), Refusal> {
        let Wish { run } = body::read(body)?;
        let now = Instant::now();
        self.desk.with(|papers| {
            let text = papers.acceptance.wish(run, now)?;
            papers.audit(format_args!("{text}"));
            Ok(())
        })
    }

    /// The runner tells where it is.
    ///
    /// # Errors
    /// Another runner is there; the run is not wanted any more.
    pub(super) fn report_acceptance(&self, body: &[u8]) -> Result<(), Refusal> {
        let report: Report = body::read_escaped(body)?;
        let now = Instant::now();
        self.desk.with(|papers: &mut Papers| {
            if let Some(text) = papers.acceptance.report(report, now)? {
                papers.audit(format_args!("{text}"));
            }
            Ok(())
        })
    }
}

/// The document.
pub async fn write<M: RawMutex, W: Write>(
    hmi: Hmi<'_, M>,
    out: &mut Out<W>,
) -> Result<(), W::Error> {
    let now = Instant::now();
    let (request, state, share, text, runner) = hmi.desk.with(|papers| {
        let acceptance = &papers.acceptance;
        (
            acceptance.request,
            acceptance.state,
            acceptance.share,
            acceptance.text.clone(),
            acceptance.connected(now).cloned(),
        )
    });
    let runner = runner.as_ref().map(|Brief(runner)| Text(runner.as_str()));
    out.put(format_args!(
        "{{\"request\":{request},\"state\":\"{}\",\"runner\":{},\"share\":{share},\"text\":{},\"checks\":[",
        state.name(),
        OrNull(runner),
        Text(&text.0)
    ))
    .await?;
    // One after the other: all of them would be much to carry. A new run ends the list.
    for i in 0..CHECKS {
        let check = hmi.desk.with(|papers| {
            let acceptance = &papers.acceptance;
            let same = acceptance.request == request;
            acceptance.checks.iter().nth(i).filter(|_| same).cloned()
        });
        let Some(check) = check else {
            break;
        };
        out.put(format_args!(
            "{}{{\"id\":{},\"state\":\"{}\",\"text\":{}}}",
            if i == 0 { "" } else { "," },
            Text(&check.id.0),
            check.state.name(),
            Text(&check.text.0)
        ))
        .await?;
    }
    out.put(format_args!("]}}")).await
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::format;

    fn report(text: &str) -> Report {
        body::read_escaped(text.as_bytes()).expect("a report")
    }

    #[test]
    fn a_run_is_asked_for_taken_and_done_once() {
        let (mut acceptance, now) = (Acceptance::default(), Instant::from_secs(100));
        let running = r#"{"runner":"a","request":1,"state":"running","share":0.5,
            "checks":[{"id":"L01","state":"passed"},{"id":"L02","state":"failed","text":"say \"when\""}]}"#;
        let refused = acceptance.report(report(running), now);
        assert_eq!(refused.expect_err("nobody asked").status, 409);
        acceptance.wish(true, now).expect("the first");
        assert_eq!(acceptance.wish(true, now).expect_err("twice").status, 409);
        let begins = acceptance.report(report(running), now).expect("wanted");
        assert_eq!(begins, Some("acceptance run begins"));
        // Reported once more, a check is the same check.
        acceptance.report(report(running), now).expect("still");
        assert_eq!(acceptance.checks.len(), 2);
        assert_eq!(
            acceptance.checks.back().expect("two").text.0.as_str(),
            "say \"when\""
        );
        let end = r#"{"runner":"a","request":1,"state":"failed","share":1}"#;
        acceptance.report(report(end), now).expect("its end");
        assert_eq!((acceptance.state, acceptance.share), (State::Failed, 1.0));
        assert!(
            acceptance.report(report(running), now).is_err(),
            "it is over"
        );
    }

    #[test]
    fn another_runner_has_to_wait_until_the_first_is_gone() {
        let (mut acceptance, now) = (Acceptance::default(), Instant::from_secs(100));
        let waits = |runner: char| report(&format!(r#"{{"runner":"{runner}","state":"waiting"}}"#));
        acceptance.report(waits('a'), now).expect("the first");
        assert!(acceptance.report(waits('b'), now).is_err());
        let later = now + SILENCE;
        assert!(acceptance.connected(later).is_none());
        acceptance.report(waits('b'), later).expect("the only one");
        // A run whose runner has gone can be asked for again.
        acceptance.wish(true, later).expect("asked");
        let running = r#"{"runner":"b","request":1,"state":"running"}"#;
        acceptance.report(report(running), later).expect("running");
        assert!(acceptance.wish(true, later).is_err());
        acceptance.wish(true, later + SILENCE).expect("lost");
        assert_eq!((acceptance.request, acceptance.state), (2, State::Asked));
    }

    #[test]
    fn what_is_too_long_ends_early_and_the_oldest_check_goes_first() {
        let (mut acceptance, now) = (Acceptance::default(), Instant::from_secs(100));
        acceptance.wish(true, now).expect("asked");
        let text = "x".repeat(200);
        for i in 0..=CHECKS {
            let check = format!(r#"[{{"id":"{i}","state":"not_seen","text":"{text}"}}]"#);
            let body =
                format!(r#"{{"runner":"a","request":1,"state":"running","checks":{check}}}"#);
            acceptance.report(report(&body), now).expect("running");
        }
        assert_eq!(acceptance.checks.len(), CHECKS);
        let first = acceptance.checks.front().expect("many");
        assert_eq!((first.id.0.as_str(), first.text.0.len()), ("1", 64));
    }
}
