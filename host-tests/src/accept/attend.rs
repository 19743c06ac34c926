//! Acceptance runs that are asked for on the simulator's page.
//!
//! Not here: the page, and the run. This asks the page's interface for requests (docs/api.md, "Acceptance"), runs each
//! and tells there how far it is and what it has found.

use std::net::SocketAddr;
use std::sync::Mutex;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::Duration;

use anyhow::{Context, Result, anyhow, bail};
use serde::{Deserialize, Serialize};

use super::checks::Miss;
use super::world::{Live, Look, World};
use super::{Outcome, accept};
use crate::interrupt;
use model_core::image::Commands;

/// The page hears of us this often; it waits three times as long before it takes us for gone.
const BEAT: Duration = Duration::from_secs(3);
/// From look to look for a request.
const POLL: Duration = Duration::from_secs(1);
/// An answer takes milliseconds.
const TIMEOUT: Duration = Duration::from_secs(5);
/// Checks in one report (docs/api.md).
const CHECKS_AT_ONCE: usize = 8;

/// The page's interface, as somebody who has logged in.
pub struct Page {
    agent: ureq::Agent,
    base: String,
    cookie: String,
    name: String,
}

/// What there is to do.
#[derive(Clone, Debug, Deserialize)]
struct Request {
    request: u32,
    state: String,
}

/// Where we are.
#[derive(Clone, Debug, Default, Serialize)]
struct Report<'a> {
    runner: &'a str,
    state: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    request: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    share: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    text: Option<&'a str>,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    checks: &'a [Check<'a>],
}

/// What became of a check.
#[derive(Clone, Debug, Serialize)]
struct Check<'a> {
    id: &'a str,
    state: &'static str,
    text: &'a str,
}

impl Page {
    /// Logs in at the page, `http://HOST:PORT`.
    pub fn log_in(base: &str, password: &str) -> Result<Self> {
        let config = ureq::Agent::config_builder()
            .timeout_global(Some(TIMEOUT))
            .http_status_as_error(false)
            .build();
        let mut page = Self {
            agent: config.into(),
            base: base.trim_end_matches('/').to_owned(),
            cookie: String::new(),
            name: name(),
        };
        let body = serde_json::json!({ "password": password }).to_string();
        let answer = page.post("login", &body)?;
        let cookie = answer.headers().get("set-cookie");
        let cookie = cookie.and_then(|value| value.to_str().ok());
        let cookie = cookie.and_then(|value| value.split(';').next());
        page.cookie = cookie
            .with_context(|| format!("{} gives no session", page.base))?
            .to_owned();
        Ok(page)
    }

    fn post(&self, path: &str, body: &str) -> Result<ureq::http::Response<ureq::Body>> {
        let url = format!("{}/api/v1/{path}", self.base);
        let answer = self
            .agent
            .post(&url)
            .header("Content-Type", "application/json")
            .header("Cookie", &self.cookie)
            .send(body);
        let mut answer = answer.with_context(|| format!("cannot reach {url}"))?;
        if answer.status().is_success() {
            return Ok(answer);
        }
        let why = answer.body_mut().read_to_string().unwrap_or_default();
        Err(anyhow!("{url}: {}: {}", answer.status(), why.trim()))
    }

    fn request(&self) -> Result<Request> {
        let url = format!("{}/api/v1/acceptance", self.base);
        let answer = self.agent.get(&url).call();
        let mut answer = answer.with_context(|| format!("cannot reach {url}"))?;
        let text = answer.body_mut().read_to_string()?;
        serde_json::from_str(&text).with_context(|| format!("{url} answers {text:?}"))
    }

    fn report(&self, report: &Report<'_>) -> Result<()> {
        let report = Report {
            runner: &self.name,
            ..report.clone()
        };
        let body = serde_json::to_string(&report)?;
        self.post("acceptance/report", &body).map(drop)
    }

    /// Waits for a request.
    fn wait(&self) -> Result<u32> {
        loop {
            interrupt::check()?;
            self.report(&Report {
                state: "waiting",
                ..Report::default()
            })?;
            let request = self.request()?;
            if request.state == "asked" {
                return Ok(request.request);
            }
            thread::sleep(POLL);
        }
    }

    /// Waits for a request and runs it on the simulator at `address`; gives its number with what came of it.
    pub fn attend(&self, address: SocketAddr) -> Result<(u32, Outcome)> {
        let request = self.wait()?;
        let live = Live::connect(address, None)?;
        let unwanted = Mutex::new(None);
        let unwanted = &unwanted;
        let outcome = thread::scope(|scope| {
            let (tell, told) = mpsc::channel();
            scope.spawn(move || self.keep_telling(request, told, unwanted));
            let mut world = Attended {
                live,
                tell,
                unwanted,
            };
            accept(&mut world)
        });
        self.tell_outcome(request, &outcome)?;
        Ok((request, outcome))
    }

    /// Tells how far the run is whenever it has changed, and from time to time, until nobody has anything to tell.
    fn keep_telling(
        &self,
        request: u32,
        told: mpsc::Receiver<(&'static str, f64)>,
        unwanted: &Mutex<Option<String>>,
    ) {
        let mut last = ("", 0.0);
        loop {
            match told.recv_timeout(BEAT) {
                Ok(now) => last = now,
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
            let done = self.report(&Report {
                state: "running",
                request: Some(request),
                share: Some(last.1),
                text: Some(last.0),
                ..Report::default()
            });
            if let Err(error) = done
                && let Ok(mut unwanted) = unwanted.lock()
            {
                *unwanted = Some(format!("{error:#}"));
            }
        }
    }

    fn tell_outcome(&self, request: u32, outcome: &Outcome) -> Result<()> {
        let checks: Vec<_> = outcome
            .verdicts
            .iter()
            .map(|(check, verdict)| {
                let (state, text) = match verdict {
                    Ok(what) => ("passed", what.as_str()),
                    Err(Miss::Failed(what, _)) => ("failed", what.as_str()),
                    Err(Miss::NotSeen(why)) => ("not_seen", why.as_str()),
                };
                Check {
                    id: check.id,
                    state,
                    text,
                }
            })
            .collect();
        for checks in checks.chunks(CHECKS_AT_ONCE) {
            self.report(&Report {
                state: "running",
                request: Some(request),
                share: Some(1.0),
                checks,
                ..Report::default()
            })?;
        }
        let (state, text) = match &outcome.course.ended {
            Some(why) => ("stopped", why.clone()),
            None if outcome.passed() => ("passed", outcome.summary()),
            None => ("failed", outcome.summary()),
        };
        self.report(&Report {
            state,
            request: Some(request),
            text: Some(&text),
            ..Report::default()
        })
    }
}

/// This PC's name, by which the page knows the runner.
fn name() -> String {
    let name = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    match name.trim() {
        "" => "a PC".to_owned(),
        name => name.to_owned(),
    }
}

/// A simulator whose page hears how far the run is, and can end it.
struct Attended<'a> {
    live: Live,
    tell: mpsc::Sender<(&'static str, f64)>,
    unwanted: &'a Mutex<Option<String>>,
}

impl World for Attended<'_> {
    fn look(&mut self, own: &Commands) -> Result<Look> {
        if let Ok(unwanted) = self.unwanted.lock()
            && let Some(why) = &*unwanted
        {
            bail!("the page does not want the run any more: {why}");
        }
        self.live.look(own)
    }

    fn begins(&mut self, episode: &'static str, share: f64) {
        // who no longer hears it has said why
        let _ = self.tell.send((episode, share));
    }
}
