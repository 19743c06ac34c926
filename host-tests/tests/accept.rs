//! The acceptance run: the reference program passes, every seeded error is found, and whatever a PLC does, it ends.
#![allow(clippy::unwrap_used)]

use firmware::hmi::panel::Panel;
use host_tests::accept::attend::Page;
use host_tests::accept::checks::{Miss, markdown};
mod support;

use std::io::Write;
use std::process::Stdio;
use std::thread;

use host_tests::accept::controller::{
    Controller, DemoPlc, Garbage, REFERENCE, Silent, StPlc, Stopping,
};
use host_tests::accept::matrix::{golden, rows, table};
use host_tests::accept::seeds::SEEDS;
use host_tests::accept::world::{LIMIT_S, Lockstep};
use host_tests::accept::{Outcome, accept, wired};
use host_tests::lesson::{Lesson, Play, shipped};
use host_tests::plc::{Plc, Recipe};
use model_core::image::{Commands, Image};
use model_core::machine::Machine;
use support::{Running, winder};

fn run(plc: impl Controller) -> Outcome {
    accept(&mut Lockstep::new(&Machine::news_8000(), plc).unwrap())
}

fn found(outcome: &Outcome) -> Vec<&'static str> {
    outcome.findings().map(|(check, ..)| check.id).collect()
}

/// Each error by a check of its own area, the program without an error by none; and as the table has it.
#[test]
fn every_seeded_error_is_found_in_its_area() {
    let rows = rows().unwrap();
    assert!(
        rows[0].marks.chars().all(|mark| mark == '.'),
        "{}",
        table(&rows[..1])
    );
    for row in &rows[1..] {
        let area = row.area.unwrap();
        assert!(
            row.found.contains(&area),
            "{}: {:?}, not {area:?}",
            row.name,
            row.found
        );
    }
    let kept = std::fs::read_to_string(golden()).unwrap();
    assert_eq!(
        kept,
        table(&rows),
        "renew it: cargo winder accept --matrix --bless"
    );
}

#[test]
fn an_error_that_does_not_fit_the_program_is_refused() {
    for seed in SEEDS {
        let program = seed.sow(REFERENCE).unwrap();
        assert_ne!(program, REFERENCE);
        let twice = format!("{REFERENCE}{}", seed.search);
        assert!(
            seed.sow(&twice)
                .unwrap_err()
                .to_string()
                .contains("2 times")
        );
    }
}

#[test]
fn a_silent_plc_is_found_out() {
    let outcome = run(Silent);
    assert!(found(&outcome).contains(&"L01"));
    assert!(
        outcome
            .course
            .ended
            .as_ref()
            .unwrap()
            .contains("heartbeat has stood")
    );
    // the report is written all the same, and says so
    assert!(outcome.html("nothing").contains("heartbeat has stood"));
    assert!(outcome.junit("nothing").contains("skipped message"));
}

#[test]
fn a_plc_that_writes_garbage_is_found_out() {
    for seed in [1, 2] {
        let outcome = run(Garbage(seed));
        assert!(found(&outcome).contains(&"L07"), "{:?}", found(&outcome));
        assert!(outcome.duration_s() <= LIMIT_S + 1.0);
    }
}

#[test]
fn a_plc_that_stops_in_the_middle_is_found_out() {
    let plc = StPlc::new(REFERENCE).unwrap();
    // 100 s of cycles of 20 ms
    let outcome = run(Stopping { plc, left: 5000 });
    assert!(found(&outcome).contains(&"L01"));
    assert!(outcome.course.ended.is_some());
    let unseen = |id| outcome.not_seen().any(|(check, _)| check.id == id);
    assert!(unseen("F13") && !unseen("S03"));
}

/// Over Modbus, in real time, with a PLC that stops after a few seconds. The person at its desk types ahead.
#[test]
fn a_run_over_the_link_asks_for_the_desk_and_ends_with_its_plc() {
    let running = Running::start(&["--board", "host"]);
    let address = running.address;
    let plc = StPlc::new(REFERENCE).unwrap();
    // 6 s of cycles of 20 ms
    let plc = thread::spawn(move || wired::run(address, Stopping { plc, left: 300 }, |_| ()));
    let out = tempfile::tempdir().unwrap();
    let mut accept = winder(&["accept", "--ask", &address.to_string()])
        .arg("--out")
        .arg(out.path())
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let lines = "\n".repeat(1000);
    accept
        .stdin
        .take()
        .unwrap()
        .write_all(lines.as_bytes())
        .unwrap();
    let done = accept.wait_with_output().unwrap();
    let (said, asked) = (text(&done.stdout), text(&done.stderr));
    assert_eq!(done.status.code(), Some(1), "{said}{asked}");
    assert!(asked.contains("at the PLC's desk: press "), "{asked}");
    assert!(
        said.contains("\nL01  ") || said.starts_with("L01  "),
        "{said}"
    );
    assert!(said.contains("heartbeat has stood"), "{said}");
    for check in ["S01  ", "S03  ", "L07  "] {
        assert!(!said.contains(check), "{check}: {said}");
    }
    let report = std::fs::read_to_string(out.path().join("accept.html")).unwrap();
    assert!(report.contains("heartbeat has stood"));
    assert_eq!(plc.join().unwrap().unwrap(), "it has been stopped");
}

/// Asked for on the page, which sees it begin and hears why it has ended. A wrong password is said to be one.
#[test]
fn the_page_asks_for_a_run_and_hears_what_came_of_it() {
    let running = Running::start(&["--board", "host"]);
    let (address, page) = (running.address, running.page.clone());
    let agent = ureq::agent();
    let post = |path: &str, cookie: &str, body: &str| {
        agent
            .post(format!("{page}/api/v1/{path}"))
            .header("Content-Type", "application/json")
            .header("Cookie", cookie)
            .send(body)
            .unwrap()
    };
    let password = r#"{"password":"a long password"}"#;
    post("password", "", password);
    let login = post("login", "", password);
    let cookie = login.headers()["set-cookie"].to_str().unwrap().to_owned();
    let seen = || -> serde_json::Value {
        let mut answer = agent
            .get(format!("{page}/api/v1/acceptance"))
            .call()
            .unwrap();
        serde_json::from_str(&answer.body_mut().read_to_string().unwrap()).unwrap()
    };

    let wrong = Page::log_in(&page, "another password").err().unwrap();
    assert!(format!("{wrong:#}").contains("401"), "{wrong:#}");
    let runner = Page::log_in(&page, "a long password").unwrap();
    let plc = StPlc::new(REFERENCE).unwrap();
    let plc = thread::spawn(move || wired::run(address, Stopping { plc, left: 150 }, |_| ()));
    let run = thread::spawn(move || runner.attend(address).unwrap());
    post("acceptance", &cookie, r#"{"run":true}"#);
    let (request, outcome) = run.join().unwrap();
    assert_eq!(request, 1);
    assert!(outcome.course.ended.is_some());
    let told = seen();
    assert_eq!(told["state"], "stopped", "{told}");
    assert!(
        told["text"]
            .as_str()
            .unwrap()
            .contains("heartbeat has stood")
    );
    let checks = told["checks"].as_array().unwrap();
    assert_eq!(checks.len(), outcome.verdicts.len());
    assert!(
        checks
            .iter()
            .any(|check| check["id"] == "L01" && check["state"] == "failed")
    );
    assert_eq!(plc.join().unwrap().unwrap(), "it has been stopped");
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// A program that winds one set by itself and has no operator.
#[test]
fn the_demo_s_plc_has_what_it_has() {
    let recipe = Recipe {
        machine: Machine::news_8000(),
        diameter_m: 0.15,
        speed_m_s: 5.0,
    };
    let outcome = run(DemoPlc::new(Plc::new(recipe)));
    let id = |id: &str| {
        &outcome
            .verdicts
            .iter()
            .find(|(check, _)| check.id == id)
            .unwrap()
            .1
    };
    // it switches on without being asked, and does not hear the operator
    assert!(
        matches!(id("S01"), Err(Miss::Failed(..))),
        "{:?}",
        id("S01")
    );
    // what it writes is sound
    assert!(id("L07").is_ok(), "{:?}", id("L07"));
    assert!(!outcome.passed());
}

#[test]
fn a_report_is_well_formed_whatever_it_says() {
    let outcome = run(Silent);
    let xml = outcome.junit("a \"name\" with <marks> & more");
    let document = resvg::usvg::roxmltree::Document::parse(&xml).unwrap();
    let cases = document
        .descendants()
        .filter(|node| node.has_tag_name("testcase"));
    assert_eq!(cases.count(), outcome.verdicts.len());
    let html = outcome.html("a \"name\" with <marks> & more");
    assert!(html.contains("a &quot;name&quot; with &lt;marks&gt; &amp; more"));
    // nothing is loaded from elsewhere
    assert!(!html.contains("src=") && !html.contains("@import"));
}

/// A lesson's own solution gets all points.
#[track_caller]
fn solves<C: Controller>(lesson: &Lesson, mut play: Play<C>) {
    for act in &lesson.solution {
        play.act(act).unwrap();
    }
    let told: Vec<_> = play
        .scores()
        .map(|(s, earned)| (s.what.clone(), earned))
        .collect();
    assert_eq!(play.points(), 100, "{}: {told:?}", lesson.name);
}

#[test]
fn lessons_are_solved_by_their_solutions_and_not_by_waiting() {
    for lesson in shipped().unwrap() {
        solves(&lesson, Play::new(&lesson).unwrap());
        let mut idle = Play::new(&lesson).unwrap();
        while !idle.is_over() {
            idle.tick().unwrap();
        }
        assert!(
            idle.points() < 60,
            "{}: {} points for nothing",
            lesson.name,
            idle.points()
        );
    }
}

/// The simulator's own panel at the desk.
struct AtDesk(Panel);

impl Controller for AtDesk {
    fn period(&self) -> u64 {
        1
    }

    fn cycle(&mut self, image: &Image, commands: &mut Commands) {
        self.0.cycle(&image.feedback, commands);
    }
}

/// On the page, where no PLC need be, the operator panel follows the same desk.
#[test]
fn lessons_are_solved_at_the_panel_as_at_a_plc() {
    for lesson in shipped().unwrap() {
        let panel = AtDesk(Panel::new(&Machine::news_8000()));
        solves(&lesson, Play::at_desk_of(panel, &lesson).unwrap());
    }
}

/// The table of the page is that of the program.
#[test]
fn the_page_has_the_checks() {
    let page = include_str!("../../docs/acceptance.md");
    let (_, rest) = page.split_once("<!-- checks -->\n").unwrap();
    let (kept, _) = rest.split_once("<!-- end -->").unwrap();
    assert_eq!(kept, markdown(), "docs/acceptance.md");
}
