//! What came of an acceptance run, for people (HTML) and for machines (JUnit).
//!
//! Not here: judging. The HTML is one file that needs nothing else; its plots are drawn as all others are.

use std::fmt::Write;

use model_core::image::{Kind, SIGNALS, Signal};

use super::Outcome;
use super::checks::{Check, Miss, Verdict};
use super::run::Sample;
use crate::plot::{Curve, Figure, Ink, Panel};
use crate::report::minutes;

/// A trend reaches so far to both sides of what was found, s.
const AROUND_S: f64 = 10.0;
/// A curve has about so many points.
const POINTS: usize = 240;
/// Height of a panel.
const HEIGHT: f64 = 90.0;

const STYLE: &str = "body{font:15px/1.5 system-ui,sans-serif;max-width:62rem;margin:2rem auto;padding:0 1rem;color:#1a1f24;\
background:#fff}h1{font-size:1.5rem;margin-bottom:.2rem}h2{font-size:1.1rem;margin-top:2rem;border-bottom:1px solid #d5d9dd}\
table{border-collapse:collapse;width:100%}td,th{text-align:left;padding:.25rem .6rem .25rem 0;vertical-align:top;\
border-bottom:1px solid #eceef0}.found{color:#b3261e;font-weight:600}.ok{color:#3b6e3b}.unseen{color:#8a6100}\
details{margin:.4rem 0}summary{cursor:pointer}svg{max-width:100%;height:auto}dt{font-weight:600}dd{margin:0 0 .4rem 0}";

/// Text as HTML and XML have it.
fn escaped(text: &str) -> String {
    let mut out = String::new();
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            c if c.is_control() => out.push(' '),
            c => out.push(c),
        }
    }
    out
}

/// A class of the page, a word, and what was seen.
fn told(verdict: &Verdict) -> (&'static str, &'static str, &str) {
    match verdict {
        Ok(seen) => ("ok", "passed", seen),
        Err(Miss::Failed(seen, _)) => ("found", "FINDING", seen),
        Err(Miss::NotSeen(why)) => ("unseen", "not seen", why),
    }
}

impl Outcome {
    /// Simulated time, s.
    pub fn duration_s(&self) -> f64 {
        self.course.samples.last().map_or(0.0, Sample::t_s)
    }

    /// In a line: how many checks have found what.
    pub fn summary(&self) -> String {
        let (found, unseen) = (self.findings().count(), self.not_seen().count());
        let all = self.verdicts.len();
        let time = minutes(self.duration_s());
        let passed = all - found - unseen;
        format!(
            "{all} checks: {passed} passed, {found} findings, {unseen} not seen; {time} of the winder's time"
        )
    }

    /// The samples of a check's trend.
    fn trend(&self, check: &Check, verdict: &Verdict) -> &[Sample] {
        let samples = &self.course.samples;
        if let Err(Miss::Failed(_, Some(t))) = verdict {
            let from = samples.partition_point(|s| s.t_s() < t - AROUND_S);
            let to = samples.partition_point(|s| s.t_s() <= t + AROUND_S);
            return &samples[from..to];
        }
        let episode = self
            .course
            .episodes
            .iter()
            .find(|e| e.name == check.episode);
        episode.map_or(&samples[..], |e| &samples[e.from..e.to])
    }

    fn figure(&self, check: &Check, verdict: &Verdict) -> Option<String> {
        let samples = self.trend(check, verdict);
        let first = samples.first()?.t_s();
        let every = samples.len().div_ceil(POINTS);
        let panel = |signal: &&'static Signal| {
            let unit = match (signal.kind, signal.unit) {
                (Kind::Bits(_) | Kind::Code(_), _) => "word",
                (_, "") => "count",
                (_, unit) => unit,
            };
            let point = |s: &Sample| (s.t_s() - first, s.value(signal));
            Panel {
                title: format!("{}, {unit}", signal.name),
                height: HEIGHT,
                curves: vec![Curve::new(
                    signal.name,
                    Ink::Blue,
                    samples.iter().step_by(every).map(point).collect(),
                )],
                band: None,
            }
        };
        let figure = Figure {
            title: check.id.to_owned(),
            subtitle: format!("from {first:.1} s of the run on"),
            panels: check.trend.iter().map(panel).collect(),
            axis: "time, s".to_owned(),
            caption: String::new(),
        };
        Some(figure.svg())
    }

    /// The report as one HTML file.
    pub fn html(&self, what: &str) -> String {
        let mut page = format!(
            "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><meta name=\"viewport\" \
             content=\"width=device-width\"><title>Acceptance: {what}</title><style>{STYLE}</style>\n\
             <h1>Acceptance run: {what}</h1><p>{}</p>\n",
            escaped(&self.summary()),
            what = escaped(what),
        );
        if let Some(ended) = &self.course.ended {
            let _ = writeln!(
                page,
                "<p class=\"found\">The run ended before its end: {}</p>",
                escaped(ended)
            );
        }
        page += "<h2>Checks</h2><table><tr><th>Check<th>Area<th>Requirement<th>Outcome</tr>\n";
        for (check, verdict) in &self.verdicts {
            let (class, word, _) = told(verdict);
            let (id, area) = (check.id, check.area.name());
            let requirement = escaped(check.requirement);
            let _ = writeln!(
                page,
                "<tr><td><a href=\"#{id}\">{id}</a><td>{area}<td>{requirement}<td class=\"{class}\">{word}</tr>"
            );
        }
        page += "</table>\n<h2>Episodes</h2><table><tr><th>From, s<th>Episode<th>Came to its end</tr>\n";
        for episode in &self.course.episodes {
            let from = self
                .course
                .samples
                .get(episode.from)
                .map_or(0.0, Sample::t_s);
            let end = match &episode.stuck {
                None => "<td class=\"ok\">yes".to_owned(),
                Some(why) => format!("<td class=\"unseen\">{}", escaped(why)),
            };
            let _ = writeln!(
                page,
                "<tr><td>{from:.1}<td>{}{end}</tr>",
                escaped(episode.name)
            );
        }
        page += "</table>\n<h2>What was seen</h2>\n";
        for (check, verdict) in &self.verdicts {
            let (class, word, seen) = told(verdict);
            let open = if class == "found" { " open" } else { "" };
            let id = check.id;
            let _ = write!(
                page,
                "<details id=\"{id}\"{open}><summary>{id} {} <span class=\"{class}\">{word}</span></summary><dl>\
                 <dt>Seen<dd>{}",
                escaped(check.requirement),
                escaped(seen)
            );
            if class != "ok" {
                let _ = write!(page, "<dt>Likely causes<dd>{}", escaped(check.causes));
            }
            page += "</dl>";
            if let Some(figure) = self.figure(check, verdict) {
                page += &figure;
            }
            page += "</details>\n";
        }
        page + "</html>\n"
    }

    /// All that was seen, as CSV: a row for each look, a column for each signal, in its unit.
    pub fn csv(&self) -> String {
        let mut text = String::from("t_s");
        for signal in SIGNALS {
            let _ = write!(text, ",{}", signal.name);
        }
        for s in &self.course.samples {
            let _ = write!(text, "\n{:.2}", s.t_s());
            for signal in SIGNALS {
                let _ = write!(text, ",{}", s.value(signal));
            }
        }
        text + "\n"
    }

    /// The report as JUnit XML.
    pub fn junit(&self, what: &str) -> String {
        let mut xml = format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuite name=\"{}\" tests=\"{}\" failures=\"{}\" \
             skipped=\"{}\" time=\"{:.2}\">\n",
            escaped(what),
            self.verdicts.len(),
            self.findings().count(),
            self.not_seen().count(),
            self.duration_s()
        );
        for (check, verdict) in &self.verdicts {
            let (id, area) = (check.id, escaped(check.area.name()));
            let requirement = escaped(check.requirement);
            let (_, _, seen) = told(verdict);
            let (seen, causes) = (escaped(seen), escaped(check.causes));
            let _ = write!(
                xml,
                "  <testcase classname=\"{area}\" name=\"{id} {requirement}\">"
            );
            let _ = match verdict {
                Ok(_) => write!(xml, "<system-out>{seen}</system-out>"),
                Err(Miss::Failed(..)) => {
                    write!(
                        xml,
                        "<failure message=\"{seen}\">Likely causes: {causes}</failure>"
                    )
                }
                Err(Miss::NotSeen(_)) => write!(xml, "<skipped message=\"{seen}\"/>"),
            };
            xml += "</testcase>\n";
        }
        xml + "</testsuite>\n"
    }
}
