//! The HMI's interface, by foreign clients: what it says, what it refuses, and that a refusal changes nothing.

// The helpers are of tests, too.
#![allow(clippy::unwrap_used)]

mod settings;

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::thread::sleep;
use std::time::{Duration, Instant};

use board_host::{Board, CONNECTIONS, Options};
use firmware::hmi::BODY_BYTES;
use firmware::hmi::routes::{Method, ROUTES};
use firmware::lockstep::Lockstep;
use model_core::image::{self, Image, SIGNALS};
use model_core::machine::Machine;
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use serde_json::{Value, json};
use tungstenite::Message;

const PASSWORD: &str = "correct horse";
/// Whatever is waited for is there in milliseconds, on a quiet machine.
const PATIENCE: Duration = Duration::from_secs(20);

/// A browser, as far as we need one.
struct Browser {
    agent: ureq::Agent,
    at: SocketAddr,
    cookie: String,
}

impl Browser {
    fn new(board: &Board) -> Self {
        let config = ureq::Agent::config_builder()
            .http_status_as_error(false)
            .timeout_global(Some(PATIENCE))
            .build();
        Self {
            agent: config.into(),
            at: board.http,
            cookie: String::new(),
        }
    }

    /// One with a session.
    fn logged_in(board: &Board) -> Self {
        let mut browser = Self::new(board);
        let (status, _) = browser.ask("POST", "password", Some(json!({"password": PASSWORD})));
        assert_eq!(status, 200);
        browser
    }

    fn send(&mut self, method: &str, path: &str, body: &[u8]) -> (u16, String) {
        let uri = format!("http://{}/api/v1/{path}", self.at);
        let mut request = ureq::http::Request::builder()
            .method(method)
            .uri(uri)
            .header("Cookie", &self.cookie)
            .header("Origin", format!("http://{}", self.at));
        if method != "GET" {
            request = request.header("Content-Type", "application/json");
        }
        let request = request.body(body.to_vec()).unwrap();
        let mut response = self.agent.run(request).unwrap();
        if let Some(cookie) = response.headers().get("set-cookie") {
            let cookie = cookie.to_str().unwrap();
            assert!(cookie.contains("HttpOnly") && cookie.contains("SameSite=Strict"));
            self.cookie = cookie.split(';').next().unwrap().to_owned();
        }
        let text = response.body_mut().read_to_string().unwrap();
        (response.status().as_u16(), text)
    }

    fn ask(&mut self, method: &str, path: &str, body: Option<Value>) -> (u16, Value) {
        let body = body.map_or(Vec::new(), |body| body.to_string().into_bytes());
        let (status, text) = self.send(method, path, &body);
        let value = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{path}: {e}: {text}"));
        (status, value)
    }

    fn get(&mut self, path: &str) -> Value {
        let (status, value) = self.ask("GET", path, None);
        assert_eq!(status, 200, "{path}: {value}");
        value
    }

    fn post(&mut self, path: &str, body: Value) {
        let (status, value) = self.ask("POST", path, Some(body));
        assert_eq!(status, 200, "{path}: {value}");
    }

    /// Asks again until it is so.
    fn wait(&mut self, path: &str, is: impl Fn(&Value) -> bool) -> Value {
        let deadline = Instant::now() + PATIENCE;
        loop {
            let value = self.get(path);
            if is(&value) {
                return value;
            }
            assert!(Instant::now() < deadline, "{path}: {value}");
            sleep(Duration::from_millis(20));
        }
    }
}

fn still(_: &mut Image) {}

fn simulator(pace: f64) -> Board {
    let options = Options {
        pace,
        ..Options::default()
    };
    Board::simulate(options, ()).unwrap()
}

/// A request as somebody writes it who is no browser; gives the status.
fn raw(board: &Board, request: &str) -> u16 {
    let mut stream = TcpStream::connect(board.http).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    stream.write_all(request.as_bytes()).unwrap();
    let mut answer = [0; 12];
    stream.read_exact(&mut answer).unwrap();
    let answer = std::str::from_utf8(&answer).unwrap();
    answer.strip_prefix("HTTP/1.1 ").unwrap().parse().unwrap()
}

#[test]
fn the_image_is_that_which_modbus_shows() {
    let mut options = Options::default();
    for (i, word) in (0..).zip(&mut options.image.feedback.words) {
        *word = 1000 + i;
    }
    let board = Board::start(options, still).unwrap();
    let mut browser = Browser::new(&board);
    let image = browser.get("image");

    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .unwrap();
    let words = runtime.block_on(async {
        use tokio_modbus::prelude::*;
        let mut plc = tcp::connect(board.address).await.unwrap();
        let count = image::FEEDBACK_WORDS as u16;
        plc.read_input_registers(0, count).await.unwrap().unwrap()
    });
    // Those of the link count what is being asked.
    let steady = usize::from(image::LINK_STATUS.word);
    let shown = &image["feedback"].as_array().unwrap()[..steady];
    assert_eq!(json!(shown), json!(&words[..steady]));

    let signals = browser.get("signals");
    let names: Vec<_> = signals
        .as_array()
        .unwrap()
        .iter()
        .map(|s| &s["name"])
        .collect();
    let expected: Vec<_> = SIGNALS.iter().map(|signal| signal.name).collect();
    assert_eq!(json!(names), json!(expected));
}

#[test]
fn a_foreign_host_or_origin_is_refused() {
    let board = Board::start(Options::default(), still).unwrap();
    let at = board.http;
    let get = |head: &str| {
        raw(
            &board,
            &format!("GET /api/v1/info HTTP/1.1\r\n{head}\r\n\r\n"),
        )
    };
    assert_eq!(get(&format!("Host: {at}")), 200);
    assert_eq!(get(&format!("Host: localhost:{}", at.port())), 200);
    assert_eq!(get(&format!("Host: {at}\r\nOrigin: http://{at}")), 200);
    for head in [
        "Host: winder.example".to_owned(),
        "Accept: */*".to_owned(),
        format!("Host: {at}\r\nOrigin: http://winder.example"),
        format!("Host: {at}\r\nOrigin: null"),
        format!("Host: {at}\r\nOrigin: https://{at}"),
        format!("Host: {at}\r\nSec-Fetch-Site: cross-site"),
    ] {
        assert_eq!(get(&head), 403, "{head}");
    }
    // so is a stream
    let upgrade = "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n\
                   Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n";
    let live = |origin: &str| {
        let head = format!("GET /api/v1/live HTTP/1.1\r\nHost: {at}\r\nOrigin: {origin}\r\n");
        raw(&board, &(head + upgrade))
    };
    assert_eq!(live(&format!("http://{at}")), 101);
    assert_eq!(live("http://winder.example"), 403);
}

#[test]
fn what_changes_something_needs_a_session_and_json() {
    let board = Board::start(Options::default(), still).unwrap();
    let mut stranger = Browser::new(&board);
    for route in ROUTES.iter().filter(|route| route.login) {
        assert_ne!(route.method, Method::Get);
        let path = route.path.strip_prefix("/api/v1/").unwrap();
        let (status, answer) = stranger.ask(route.method.name(), path, Some(json!({})));
        assert_eq!(status, 401, "{path}: {answer}");
    }
    let mut browser = Browser::logged_in(&board);
    assert_eq!(
        stranger
            .ask("POST", "password", Some(json!({"password": "another one"})))
            .0,
        401
    );
    let form = format!(
        "POST /api/v1/snapshot HTTP/1.1\r\nHost: {}\r\nCookie: {}\r\nContent-Type: text/plain\r\n\
         Content-Length: 2\r\n\r\n{{}}",
        board.http, browser.cookie
    );
    assert_eq!(raw(&board, &form), 415);
    assert_eq!(browser.ask("GET", "restore", None).0, 405);
    assert_eq!(browser.ask("GET", "nothing", None).0, 404);
    let long = vec![b' '; BODY_BYTES + 1];
    assert_eq!(browser.send("POST", "commands", &long).0, 413);

    assert_eq!(
        stranger
            .ask("POST", "login", Some(json!({"password": PASSWORD})))
            .0,
        200
    );
    browser.post("logout", json!({}));
    assert_eq!(browser.ask("POST", "snapshot", None).0, 401);
    let wrong = json!({"password": "wrong horse"});
    let tries: Vec<_> = (0..6)
        .map(|_| browser.ask("POST", "login", Some(wrong.clone())).0)
        .collect();
    assert_eq!((tries[0], tries[5]), (401, 429));
}

#[test]
fn parameters_are_staged_and_applied_as_one() {
    let board = simulator(1.0);
    let mut browser = Browser::logged_in(&board);
    browser.wait("info", |info| info["cycle"].as_u64() > Some(9));
    let value = |page: &Value, name: &str, of: &str| {
        let parts = page["parts"].as_array().unwrap();
        let all = parts
            .iter()
            .flat_map(|part| part["parameters"].as_array().unwrap());
        all.filter(|p| p["name"] == name)
            .map(|p| p[of].clone())
            .next()
            .unwrap()
    };
    let stage =
        |revision: u32, values: Value| Some(json!({"revision": revision, "values": values}));
    let bad = json!({"web.width_m": 6.0, "operation.run_speed_m_s": 1e4});
    let (status, refusal) = browser.ask("PUT", "parameters/staged", stage(1, bad));
    assert_eq!(status, 422);
    let detail = &refusal["details"][0];
    assert_eq!(detail["parameter"], "operation.run_speed_m_s");
    assert_eq!(
        (&detail["value"], &detail["unit"]),
        (&json!(10_000), &json!("m/s"))
    );
    assert!(detail["low"].is_number() && detail["high"].is_number());
    let page = browser.get("parameters");
    assert_eq!(value(&page, "web.width_m", "staged"), Value::Null);

    let good = json!({"web.width_m": 6.0, "nips.slip": true});
    assert_eq!(
        browser.ask("PUT", "parameters/staged", stage(1, good)).0,
        200
    );
    let page = browser.get("parameters");
    assert_eq!(value(&page, "web.width_m", "staged"), 6.0);
    assert_eq!(value(&page, "web.width_m", "value"), 8.0);
    assert_eq!(
        browser
            .ask("POST", "parameters/apply", Some(json!({"revision": 9})))
            .0,
        409
    );
    browser.post("parameters/apply", json!({"revision": 1}));
    let page = browser.get("parameters");
    assert_eq!(page["revision"], 2);
    assert_eq!(value(&page, "web.width_m", "value"), 6.0);

    // the simulator is that of the other machine, from power-up
    let words = |image: &Value, signal: &image::Signal| {
        let word = |i: u16| {
            image["feedback"][usize::from(signal.word + i)]
                .as_u64()
                .unwrap() as u32
        };
        word(0) << 16 | word(1)
    };
    // Its steps began anew, and the drive cycles did not.
    let image = browser.wait("image", |image| {
        let ticks = words(image, &image::PLANT_TICKS);
        let cycles_ms = 10 * image["cycle"].as_u64().unwrap();
        ticks > 20 && u64::from(ticks) * 4 + 40 < cycles_ms
    });
    let mut machine = Machine::news_8000();
    machine.web.width_m = 6.0;
    machine.nips.slip = true;
    let mut expected = Options::default().image;
    let mut lockstep = Lockstep::new(&machine, &expected, ()).unwrap();
    while expected.feedback.double(&image::PLANT_TICKS) < words(&image, &image::PLANT_TICKS) {
        lockstep.cycle(&mut expected);
    }
    let trajectory = expected.feedback.double(&image::TRAJECTORY);
    assert_eq!(words(&image, &image::TRAJECTORY), trajectory);

    // somebody else has not seen it yet
    assert_eq!(
        browser
            .ask("PUT", "parameters/staged", stage(1, json!({})))
            .0,
        409
    );
    let preset = json!({"name": "NEWS-8000-UNLUMPED", "revision": 2});
    assert_eq!(
        browser.ask("POST", "parameters/preset", Some(preset)).0,
        422
    );
}

#[test]
fn a_stream_is_the_run_cycle_by_cycle() {
    let board = simulator(1.0);
    let mut stream = tungstenite::connect(format!("ws://{}/api/v1/live", board.http))
        .unwrap()
        .0;
    let wish = r#"{"signals":["plant_ticks","trajectory"],"hz":50}"#;
    stream.send(Message::text(wish)).unwrap();
    let mut text = || stream.read().unwrap().into_text().unwrap().to_string();
    let said: Value = serde_json::from_str(&text()).unwrap();
    assert_eq!(said, serde_json::from_str::<Value>(wish).unwrap());

    let mut image = Options::default().image;
    let mut lockstep = Lockstep::new(&Machine::news_8000(), &image, ()).unwrap();
    let mut last = None;
    for _ in 0..50 {
        let sample: Vec<u32> = serde_json::from_str(&text()).unwrap();
        let [cycle, ticks, trajectory] = sample[..] else {
            panic!("{sample:?}")
        };
        assert!(last.replace(cycle) < Some(cycle));
        while image.feedback.double(&image::PLANT_TICKS) < ticks {
            lockstep.cycle(&mut image);
        }
        assert_eq!(image.feedback.double(&image::TRAJECTORY), trajectory);
    }
}

#[test]
fn who_does_not_read_keeps_nobody_waiting() {
    let board = simulator(20.0);
    let names: Vec<_> = SIGNALS.iter().take(60).map(|signal| signal.name).collect();
    let wish = json!({"signals": names, "hz": 50}).to_string();
    let mut deaf: Vec<_> = (0..3)
        .map(|_| {
            tungstenite::connect(format!("ws://{}/api/v1/live", board.http))
                .unwrap()
                .0
        })
        .collect();
    for stream in &mut deaf {
        stream.send(Message::text(wish.clone())).unwrap();
    }
    let mut browser = Browser::new(&board);
    let before = browser.get("info")["cycle"].as_u64();
    browser.wait("info", |info| {
        info["cycle"].as_u64() > before.map(|cycle| cycle + 2000)
    });
}

#[test]
fn a_newcomer_gets_a_place_when_all_are_taken() {
    let board = Board::start(Options::default(), still).unwrap();
    let _idle: Vec<_> = (0..3 * CONNECTIONS)
        .map(|_| TcpStream::connect(board.http).unwrap())
        .collect();
    for _ in 0..4 {
        assert_eq!(Browser::new(&board).get("info")["simulated"], true);
    }
}

#[test]
fn a_replay_from_the_snapshot_is_the_run_to_the_bit() {
    let board = simulator(20.0);
    let mut browser = Browser::logged_in(&board);
    browser.post("panel", json!({"action": "take"}));
    browser.post("panel", json!({"action": "prepare"}));
    browser.wait("panel", |panel| panel["state"] == "ready");
    browser.post("snapshot", json!({}));
    let taken = browser.wait("snapshot", |s| s["taken_cycle"].is_u64())["taken_cycle"].clone();
    browser.post("panel", json!({"action": "thread"}));
    browser.wait("panel", |panel| panel["state"] == "threaded");
    browser.post("commands", json!({"fault_web_break": 1}));
    browser.wait("events", |events| events.to_string().contains("web"));
    browser.post("replay", json!({}));
    let ends = |s: &Value| s["recording"]["playing"] == false;
    browser.wait("events", |events| events.to_string().contains("to the bit"));
    assert!(ends(&browser.get("snapshot")));
    assert_eq!(browser.get("snapshot")["taken_cycle"], taken);
    let controlled = browser.get("info");
    assert_eq!(controlled["control"]["by"], "nobody");
}

/// Bodies that are nearly right, and others.
fn body() -> impl Strategy<Value = Vec<u8>> {
    let right = prop_oneof![
        Just(r#"{"fault_web_break":1,"winder_command.run":1}"#),
        Just(r#"{"revision":1,"values":{"web.width_m":7.5,"nips.slip":true}}"#),
        Just(r#"{"name":"LAB-300","revision":1}"#),
        Just(r#"{"action":"run","v_set_m_min":1e3,"length_m":200.0,"loop":1}"#),
        Just(r#"{"password":"correct \"horse\""}"#),
    ];
    let edits = prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0..3_u8), 0..6);
    prop_oneof![
        (right, edits).prop_map(|(right, edits)| {
            let mut bytes = right.as_bytes().to_vec();
            for (at, byte, how) in edits {
                let at = at.index(bytes.len().max(1)).min(bytes.len());
                match how {
                    0 => bytes.insert(at, byte),
                    1 if at < bytes.len() => bytes[at] = byte,
                    _ => bytes.truncate(at),
                }
            }
            bytes
        }),
        prop::collection::vec(any::<u8>(), 0..300),
    ]
}

#[test]
fn no_body_does_harm_and_a_refused_one_does_nothing() {
    let board = Board::start(Options::default(), still).unwrap();
    let mut browser = Browser::logged_in(&board);
    let routes: Vec<_> = ROUTES.iter().filter(|route| route.login).collect();
    let mut runner = proptest::test_runner::TestRunner::deterministic();
    for _ in 0..400 {
        let (route, body) = (prop::sample::select(routes.clone()), body())
            .new_tree(&mut runner)
            .unwrap()
            .current();
        let path = route.path.strip_prefix("/api/v1/").unwrap();
        let state = |browser: &mut Browser| {
            let commands = board.image.lock(|image| image.borrow().commands);
            let pages = ["parameters", "panel", "events"].map(|page| browser.get(page));
            (
                commands,
                pages,
                browser.get("snapshot")["taken_cycle"].clone(),
            )
        };
        let before = state(&mut browser);
        let (status, answer) = browser.send(route.method.name(), path, &body);
        assert!(
            [200, 400, 409, 413, 422].contains(&status),
            "{status} {answer}"
        );
        if status != 200 {
            let refusal: Value = serde_json::from_str(&answer).unwrap();
            assert!(refusal["error"].is_string() && refusal["details"].is_array());
            assert!(before == state(&mut browser), "{path} {body:?}");
        }
    }
}

#[test]
fn a_fault_ends_by_itself_after_its_time() {
    let board = simulator(20.0);
    let mut browser = Browser::logged_in(&board);
    let word = usize::from(image::FAULT_DRIVES.word);
    let stands = |browser: &mut Browser| browser.get("image")["commands"][word].clone();
    let cycle = |value: &Value| value["cycle"].as_u64().unwrap();

    let before = cycle(&browser.get("image"));
    browser.post(
        "commands",
        json!({"fault_drives.trip_uw": 1, "for_s": 20.0}),
    );
    let timed = browser.get("faults")["timed"][0].clone();
    assert_eq!(timed["name"], "fault_drives.trip_uw");
    let left = timed["left_s"].as_f64().unwrap();
    assert!(0.0 < left && left <= 20.0, "{left}");
    // Nobody looks on, and it goes.
    drop(browser);
    let mut browser = Browser::new(&board);
    browser.wait("faults", |faults| faults["timed"] == json!([]));
    assert_eq!(stands(&mut browser), 0);
    let events = browser.get("events");
    let over = events["events"].as_array().unwrap().iter();
    let over = over.filter(|e| e["text"] == "fault_drives.trip_uw is over");
    let over: Vec<_> = over.collect();
    assert_eq!(over.len(), 1);
    assert!(cycle(over[0]) > before + 2000, "{} after {before}", over[0]);
}

#[test]
fn a_time_is_for_faults_and_within_its_limits() {
    let board = simulator(1.0);
    let mut browser = Browser::logged_in(&board);
    for (body, parameter) in [
        (json!({"fault_web_break": 1, "for_s": 0}), "for_s"),
        (json!({"fault_web_break": 1, "for_s": 4000}), "for_s"),
        (json!({"operator_v_set": 1, "for_s": 1}), "operator_v_set"),
    ] {
        let (status, value) = browser.ask("POST", "commands", Some(body));
        assert_eq!(status, 422, "{value}");
        assert_eq!(value["details"][0]["parameter"], parameter);
    }
    let word = usize::from(image::FAULT_WEB_BREAK.word);
    assert_eq!(browser.get("image")["commands"][word], 0);
}

/// A fault that ends by itself ends in the same cycle of a replay, and after a restore it has as long to go as then.
#[test]
fn a_fault_for_a_time_is_part_of_snapshot_and_replay() {
    let board = simulator(20.0);
    let mut browser = Browser::logged_in(&board);
    browser.post("commands", json!({"fault_sensors": 1, "for_s": 100.0}));
    browser.post("snapshot", json!({}));
    browser.wait("snapshot", |s| s["taken_cycle"].is_u64());
    let left = |browser: &mut Browser| browser.get("faults")["timed"][0]["left_s"].as_f64();
    let then = left(&mut browser).unwrap();
    browser.wait("faults", |faults| {
        faults["timed"][0]["left_s"].as_f64().unwrap() < then - 10.0
    });
    browser.post("restore", json!({}));
    browser.wait("faults", |f| {
        f["timed"][0]["left_s"].as_f64() > Some(then - 10.0)
    });
    browser.post("commands", json!({"fault_sensors": 1, "for_s": 2.0}));
    browser.wait("faults", |faults| faults["timed"] == json!([]));
    browser.post("replay", json!({}));
    let said = |kind: &'static str| {
        move |events: &Value| {
            let mut events = events["events"].as_array().unwrap().iter();
            events.any(|e| e["kind"] == kind)
        }
    };
    let events = browser.wait("events", said("replay"));
    let mut events = events["events"].as_array().unwrap().iter();
    let replay = events.find(|e| e["kind"] == "replay").unwrap();
    assert_eq!(replay["text"], "the replay is the recorded run to the bit");
}

/// As a page asks, a runner without a browser reports, and the page reads.
#[test]
fn an_acceptance_run_is_asked_for_reported_and_read() {
    let board = simulator(1.0);
    let mut page = Browser::logged_in(&board);
    let nothing = page.get("acceptance");
    assert_eq!(nothing["state"], "none");
    assert_eq!(nothing["runner"], Value::Null);
    page.post("acceptance", json!({"run": true}));
    let asked = page.get("acceptance");
    assert_eq!(
        (&asked["state"], &asked["request"]),
        (&json!("asked"), &json!(1))
    );

    let mut runner = Browser::new(&board);
    let waiting = json!({"runner": "pc 7", "state": "waiting"});
    let (status, _) = runner.ask("POST", "acceptance/report", Some(waiting.clone()));
    assert_eq!(status, 401);
    runner.post("login", json!({"password": PASSWORD}));
    runner.post("acceptance/report", waiting);
    assert_eq!(page.get("acceptance")["runner"], "pc 7");
    let mut report = json!({"runner": "pc 7", "request": 1, "state": "running", "share": 0.25,
        "text": "thread", "checks": [{"id": "L01", "state": "failed", "text": "0.4 s without"}]});
    runner.post("acceptance/report", report.clone());
    let running = page.get("acceptance");
    assert_eq!(
        running,
        json!({"request": 1, "state": "running", "runner": "pc 7", "share": 0.25, "text": "thread",
            "checks": [{"id": "L01", "state": "failed", "text": "0.4 s without"}]})
    );
    report["state"] = json!("maybe");
    let (status, _) = runner.ask("POST", "acceptance/report", Some(report.clone()));
    assert_eq!(status, 422);
    assert_eq!(page.get("acceptance"), running);
    page.post("acceptance", json!({"run": false}));
    report["state"] = json!("running");
    let (status, value) = runner.ask("POST", "acceptance/report", Some(report));
    assert_eq!(
        (status, &value["details"][0]["parameter"]),
        (409, &json!("request"))
    );
}

/// What auto-tune tells of its loop is what the list of all loops has of it, before and after.
#[test]
fn the_gains_of_all_loops_are_those_that_the_drive_reports() {
    let board = simulator(20.0);
    let mut browser = Browser::logged_in(&board);
    let near = |listed: &Value, word: &image::Signal, image: &Value| {
        let words = &image["feedback"];
        let at = |i: u16| words[usize::from(word.word + i)].as_u64().unwrap() as f64;
        let counts = match word.kind {
            image::Kind::U32 => 65536.0 * at(0) + at(1),
            _ => at(0),
        };
        let (reported, listed) = (counts / f64::from(word.counts), listed.as_f64().unwrap());
        let resolution = 1.0 / f64::from(word.counts);
        assert!(
            (listed - reported).abs() < 1e-3 * reported + resolution,
            "{}: {listed}, reported {reported}",
            word.name
        );
    };
    browser.post("panel", json!({"action": "take"}));
    browser.post("panel", json!({"action": "prepare"}));
    browser.wait("panel", |panel| panel["state"] == "ready");
    for number in 0..3 {
        let before = browser.get("gains")["loops"][number].clone();
        assert_eq!(before["source"], "machine");
        browser.post("panel", json!({"action": "autotune", "loop": number}));
        let tuned = browser.wait("gains", |g| g["loops"][number]["source"] == "auto-tune");
        let after = &tuned["loops"][number];
        let image = browser.get("image");
        near(&before["gain"], &image::AUTOTUNE_GAIN_OLD, &image);
        near(&after["gain"], &image::AUTOTUNE_GAIN_NEW, &image);
        near(&after["time_s"], &image::AUTOTUNE_TIME_NEW, &image);
        browser.wait("panel", |panel| panel["state"] != "tuning");
        let state = browser.get("panel")["state"].clone();
        if state != "off" && state != "ready" {
            browser.post("panel", json!({"action": "stop"}));
            browser.wait("panel", |panel| panel["message"] == "the machine stands");
        }
    }
}

#[test]
fn health_tells_what_is_in_use() {
    let board = simulator(1.0);
    let mut browser = Browser::new(&board);
    let health = browser.get("health");
    // A process on a PC has no memory of its own to tell of.
    assert_eq!(health["memory"], Value::Null);
    let places = health["places"].as_array().unwrap();
    let of = |name| places.iter().find(|place| place["name"] == name).unwrap();
    assert_eq!(of("browsers")["used"], 1);
    assert_eq!(of("browsers")["of"], CONNECTIONS);
    let mut other = Browser::new(&board);
    other.get("info");
    let places = browser.get("health")["places"].clone();
    assert_eq!(places[0]["used"], 2, "{places}");
}
