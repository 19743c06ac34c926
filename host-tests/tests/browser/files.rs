//! What goes out of the page as a file and comes in again: pictures, machines, recordings; and what waits for a moment.
//!
//! Not here: the table of the trends, which stands beside the run that it is of.

use host_tests::machine_file::Description;
use host_tests::scenario::record::Recording;
use model_core::desk::request;
use model_core::image;
use model_core::logic::status;
use model_core::machine::parameters;
use serde_json::{Value, json};

use crate::bench::Bench;

/// Something of the API, from the page, as the page's own scripts ask.
fn ask(bench: &mut Bench, method: &str, path: &str, body: &Value) -> Value {
    let answer = bench.page.eval(&format!(
        "fetch('/api/v1/{path}', {{ method: '{method}', headers: {{ 'Content-Type': 'application/json' }}, \
         body: '{body}' }}).then(async (a) => [a.status, await a.text()])"
    ));
    assert_eq!(answer[0], 200, "{path}: {answer}");
    answer[1].clone()
}

#[test]
fn a_picture_of_the_curves_has_curves() {
    let mut bench = Bench::start();
    bench.thread();
    bench.run(300, 400);
    bench.show("trends");
    bench.page.press("PNG");
    let png = bench.page.download_bytes("trends.png");
    assert!(png.starts_with(b"\x89PNG\r\n\x1a\n"));
    let data = data_encoding::BASE64.encode(&png);
    // as many colours as ground, text, grid and three pens have at least, each in more than some points
    let colours = bench.page.eval(&format!(
        "(async () => {{ const image = new Image(); image.src = 'data:image/png;base64,{data}'; await image.decode(); \
         const canvas = new OffscreenCanvas(image.width, image.height); const c = canvas.getContext('2d'); \
         c.drawImage(image, 0, 0); const {{ data }} = c.getImageData(0, 0, image.width, image.height); \
         const found = new Map(); for (let i = 0; i < data.length; i += 4) {{ \
         const k = data[i] << 16 | data[i + 1] << 8 | data[i + 2]; found.set(k, (found.get(k) ?? 0) + 1); }} \
         return [...found.values()].filter((n) => n > 30).length; }})()"
    ));
    assert!(colours.as_u64() >= Some(6), "{colours} colours");
}

#[test]
fn a_trigger_holds_what_was_before_it() {
    const LEVEL: f64 = 60.0;
    let mut bench = Bench::start();
    bench.thread();
    bench.show("trends");
    // where it is drawn, nothing moves any more under the mouse
    bench
        .page
        .until("document.querySelector('.u-wrap') !== null");
    bench.page.press("10 s");
    bench.page.press("Speed");
    bench
        .page
        .until("document.querySelector('.presets [aria-pressed=true]')?.textContent === 'Speed'");
    bench.page.choose("Signal", "v_web");
    bench.page.choose("Edge", "rises");
    bench.page.fill("Level", &LEVEL.to_string());
    bench.page.fill("History before", "3");
    bench.page.press("Arm");
    // it waits while somebody sees to the winder
    bench.show("machine");
    bench.run(200, 400);
    bench.until("it is at speed", |feedback| {
        feedback.get::<f64>(&image::V_WEB) > 190.0
    });
    bench.show("trends");
    bench.page.until_text("Fired; arm again");
    bench.page.press("CSV");
    let csv = bench.page.download("trends.csv");
    let mut table = csv::Reader::from_reader(csv.as_bytes());
    let column = table
        .headers()
        .expect("a head")
        .iter()
        .position(|name| name.starts_with("v_web"))
        .expect("the pen");
    let rows: Vec<(f64, f64)> = table
        .records()
        .map(|row| {
            let row = row.expect("a row");
            let number = |i: usize| row[i].parse().expect("a number");
            (number(1), number(column))
        })
        .collect();
    let crossed = rows.iter().find(|(_, v)| *v >= LEVEL).expect("it rose").0;
    // to a sample of the stream, which is each of four cycles
    let (first, last) = (rows[0].0, rows[rows.len() - 1].0);
    assert!(
        (crossed - first - 3.0).abs() <= 0.05,
        "{first} to {crossed}"
    );
    assert!((last - crossed - 7.0).abs() <= 0.05, "{crossed} to {last}");
}

#[test]
fn a_machine_goes_out_as_a_file_and_comes_in_again() {
    let mut bench = Bench::start();
    bench.show("parameters");
    bench.page.fill("web.caliper_m", "0.00006");
    bench.page.key("Enter");
    bench.choose_password();
    bench.page.until_text("1 change in the draft");
    bench.page.press("Export");
    let text = bench.page.download("NEWS-8000.toml");
    // as the command line tool reads it
    let description = Description::read("NEWS-8000.toml", &text).expect("a machine file");
    assert_eq!(description.machine.web.caliper_m, 60e-6);

    bench.page.press("Discard");
    bench.page.until("!document.querySelector('.draft')");
    let mut other = description;
    other.machine.web.width_m = 7.5;
    let mut file = Vec::new();
    other.write(&mut file).expect("text");
    bench.page.upload("Machine file", "other.toml", &file);
    bench.page.until_text("2 changes in the draft");
    bench.page.press("Review and apply");
    bench.page.until_text("Apply as one");
    bench.page.press("Apply");
    bench.page.until("!document.querySelector('.draft')");
    let answer = bench
        .page
        .eval("fetch('/api/v1/parameters').then((a) => a.json())");
    let parts = answer["parts"].as_array().expect("parts").iter();
    let listed = parts.flat_map(|part| part["parameters"].as_array().expect("a list"));
    let mut compared = 0;
    for listed in listed {
        let name = listed["name"].as_str().expect("a name");
        let wanted = parameters().find(|p| p.name == name);
        let wanted = wanted.and_then(|p| p.get(&other.machine));
        let wanted = wanted.map_or(Value::Null, |value| {
            serde_json::from_str(&value.to_string()).expect("a number or a switch")
        });
        let listed = &listed["value"];
        // 1 is 1.0, and a switch no number
        assert_eq!(listed.as_f64(), wanted.as_f64(), "{name}");
        assert_eq!(listed.as_bool(), wanted.as_bool(), "{name}");
        compared += 1;
    }
    assert!(compared > 50, "{compared} parameters");
}

/// What the microcontroller has recorded is the same run on a PC, to the bit.
#[test]
fn a_recording_of_the_page_is_replayed_by_the_command_line_tool() {
    let mut bench = Bench::start();
    bench.thread();
    bench.run(250, 400);
    bench.until("it is wound at speed", |feedback| {
        feedback.get::<f64>(&image::LENGTH_WU) > 30.0
    });
    let fault = json!({"fault_drives.trip_rr": 1, "for_s": 2.0});
    ask(&mut bench, "POST", "commands", &fault);
    bench.until("it stops", |feedback| feedback.word(&image::FAULT) != 0);
    bench.show("session");
    bench.page.press("Save the recording");
    let csv = bench.page.download("run.csv");
    let recording = Recording::read("run.csv", csv.as_bytes()).expect("a recording");
    let replay = recording.replay().expect("it plays");
    let difference = replay.difference.map(|difference| difference.to_string());
    assert_eq!(difference, None);
    assert!(replay.cycles > 1000 && replay.compared > 0);
}

#[test]
fn a_fault_for_a_time_counts_down_and_goes() {
    let mut bench = Bench::start();
    bench.take_control();
    bench.show("faults");
    bench.page.choose("A click puts in", "60");
    bench.page.press("The unwind's encoder gives no pulses");
    bench
        .page
        .until("document.querySelector('.put.in em') !== null");
    // another page, and even none, makes no difference
    bench.show("machine");
    bench.show("faults");
    bench.page.until_text("The machine is sound.");
    assert_eq!(bench.commands().word(&image::FAULT_SENSORS), 0);
}

/// Presses a button of the desk, and waits until it has been let go and what it asks for is done.
fn push(bench: &mut Bench, name: &str, button: u16) {
    bench.page.press(name);
    bench.page.until(&format!(
        "Promise.all(['events?after=0', 'panel'].map((p) => fetch('/api/v1/' + p).then((a) => a.json()))).then(([e, p]) => \
         e.events.some((e) => e.text === 'operator_request = 0 (was {button})') && p.message === '')"
    ));
}

#[test]
fn a_lesson_is_played_at_the_desk_to_its_full_score() {
    let mut bench = Bench::start();
    bench.take_control();
    bench.show("training");
    bench.page.press("Start: Thread and run");
    bench.page.until_text("0 of 100 points");
    for (name, value) in [
        ("Parent roll", "3000"),
        ("Web speed", "300"),
        ("Tension", "350"),
    ] {
        bench.page.fill(name, value);
        bench.page.key("Tab");
    }
    let until = |bench: &mut Bench, bits: u16| {
        bench.until("the step is done", |feedback| {
            feedback.word(&image::WINDER_STATUS) & bits == bits
        });
    };
    push(&mut bench, "New core", request::NEW_CORE);
    push(&mut bench, "New parent roll", request::NEW_PARENT_ROLL);
    until(&mut bench, status::PRESET_TAKEN);
    assert_eq!(bench.commands().word(&image::OPERATOR_PARENT), 30_000);
    push(&mut bench, "Drives on", request::DRIVES_ON);
    until(&mut bench, status::DRIVES_ON);
    push(&mut bench, "Web led", request::WEB_LED);
    until(&mut bench, status::WEB_THREADED);
    bench.page.press("A hint");
    bench.page.until_text("Rolls first");
    bench.page.press("Thread");
    bench.page.until_text("The web is under tension");
    bench.page.press("Run");
    bench.page.until_text("100 of 100 points");
    bench.page.press("Finish");
    bench.page.press("All lessons");
    bench.page.until_text("100 of 100");
}

/// The page asks, and a runner does it: here a script that knows no more than the interface's document.
#[test]
fn an_acceptance_run_is_asked_for_and_shown() {
    let mut bench = Bench::start();
    bench.take_control();
    bench.show("acceptance");
    bench.page.press("Ask for a run");
    bench.page.until_text("No runner is connected.");
    bench
        .page
        .until_text("cargo winder accept --attend http://");
    let report = json!({"runner": "a script", "request": 1, "state": "running", "share": 0.5, "text": "thread",
        "checks": [{"id": "L01", "state": "passed"}, {"id": "T02", "state": "failed", "text": "no tension within 30 s"}]});
    ask(&mut bench, "POST", "acceptance/report", &report);
    bench.page.until_text("no tension within 30 s");
    bench.page.until_text("runner a script");
    let end = json!({"runner": "a script", "request": 1, "state": "failed", "share": 1});
    ask(&mut bench, "POST", "acceptance/report", &end);
    bench.page.until_text("Not passed");
    bench.page.press("Ask for a run");
    bench.page.until_text("Run 2");
}
