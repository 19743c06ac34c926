//! What people do with the page, from power-up to a wound roll, and what they do wrong.
//!
//! Not here: every rule of the drives. The image is the witness, not the page.

use std::collections::BTreeMap;

use host_tests::setup;
use model_core::image::{self, SIGNALS};
use model_core::logic::{Fault, Mode, status};
use model_core::machine::Machine;
use serde_json::Value;

use crate::bench::{Bench, mode};
use crate::chromium::{button, field};

/// A short roll, mm, and a speed for it, m/min.
const ROLL: (u32, u32) = (140, 400);

fn is(bench: &mut Bench, bits: u16) -> bool {
    bench.feedback().word(&image::WINDER_STATUS) & bits == bits
}

/// The machine's parameter as the API has it.
fn parameter(bench: &mut Bench, name: &str, of: &str) -> Value {
    bench.page.eval(&format!(
        "fetch('/api/v1/parameters').then((a) => a.json()).then((a) => a.parts.flatMap((p) => p.parameters).find((p) => p.name === '{name}').{of})"
    ))
}

#[test]
fn a_newcomer_winds_a_short_roll_and_what_is_exported_is_what_came() {
    let mut bench = Bench::start();
    bench.thread();
    bench.run(ROLL.1, ROLL.0);
    bench.until("it stands", |feedback| mode(feedback) == Some(Mode::Stall));
    let d_wu = bench.value(&image::D_WU);
    assert!((d_wu - f64::from(ROLL.0)).abs() < 1.0, "{d_wu} mm");
    assert!(is(&mut bench, status::TENSION_DETECTED));

    // what the page shows is what a PLC reads
    bench.page.until_text("Stall tension at standstill");
    let shown = bench.page.eval("[...document.querySelectorAll('.tile')].find((t) => t.innerText.startsWith('Shipping roll')).querySelector('b').textContent");
    assert_eq!(shown, format!("{d_wu:.0}"));

    bench.show("trends");
    bench.page.press("10 min");
    bench.page.press("Diameters");
    bench.page.press("Pause");
    bench.page.press("CSV");
    exported_is_what_came(&bench.page.download("trends.csv"), &bench.page.frames());
}

/// Every row of the table is a message of the stream, to the last digit, and none between is missing.
fn exported_is_what_came(csv: &str, frames: &[String]) {
    let mut names: Vec<String> = Vec::new();
    let mut came: BTreeMap<u64, BTreeMap<String, f64>> = BTreeMap::new();
    for frame in frames {
        match serde_json::from_str(frame).expect("JSON") {
            Value::Array(row) => {
                let values = row[1..].iter().map(|raw| raw.as_f64().expect("counts"));
                let named = names.iter().cloned().zip(values);
                came.insert(row[0].as_u64().expect("a cycle"), named.collect());
            }
            answer => {
                if let Some(list) = answer["signals"].as_array() {
                    names = list
                        .iter()
                        .map(|name| name.as_str().expect("a name").to_owned())
                        .collect();
                }
            }
        }
    }
    let mut table = csv::Reader::from_reader(csv.as_bytes());
    let head = table.headers().expect("a head").clone();
    assert_eq!(
        head.iter().collect::<Vec<_>>(),
        ["cycle", "t_s", "d_uw [mm]", "d_wu [mm]"]
    );
    let mut rows = 0;
    let mut span = (u64::MAX, 0);
    for row in table.records() {
        let row = row.expect("a row");
        let cycle: u64 = row[0].parse().expect("a cycle");
        let message = came
            .get(&cycle)
            .unwrap_or_else(|| panic!("cycle {cycle} never came"));
        assert_eq!(row[1].parse::<f64>().expect("a time"), cycle as f64 / 100.0);
        for (column, name) in [(2, "d_uw"), (3, "d_wu")] {
            let signal = SIGNALS.iter().find(|s| s.name == name).expect("a signal");
            let counts = row[column].parse::<f64>().expect("a value") * f64::from(signal.counts);
            assert_eq!(counts.round(), message[name], "{name} at {cycle}");
            assert!(
                (counts - counts.round()).abs() < 1e-6,
                "{name} at {cycle}: {}",
                &row[column]
            );
        }
        span = (span.0.min(cycle), span.1.max(cycle));
        rows += 1;
    }
    assert!(rows > 100, "{rows} rows");
    assert_eq!(
        rows,
        came.range(span.0..=span.1).count(),
        "rows between {span:?}"
    );
}

#[test]
fn a_bad_value_is_refused_beside_its_field_and_a_good_one_is_applied_with_the_others() {
    const CALIPER: &str = "web.caliper_m";
    let mut bench = Bench::start();
    bench.show("parameters");
    bench.page.fill(CALIPER, "0.1");
    bench.page.key("Enter");
    bench.page.until_text("0.1 m is above the highest, 0.005 m");
    let described = bench.page.eval(&format!(
        "document.getElementById({}.getAttribute('aria-describedby')).innerText",
        field(CALIPER)
    ));
    assert!(
        described.as_str().unwrap_or_default().contains("0.005"),
        "{described}"
    );
    assert!(parameter(&mut bench, CALIPER, "staged").is_null());

    bench.page.fill(CALIPER, "0.00006");
    bench.page.key("Enter");
    bench.choose_password();
    bench.page.until_text("1 change in the draft");
    // what has been staged is not what runs
    assert_eq!(parameter(&mut bench, CALIPER, "value"), 65e-6);
    assert_eq!(parameter(&mut bench, CALIPER, "staged"), 60e-6);
    // a switch and another part, then all at once
    bench.page.click("document.querySelector('[role=switch]')");
    bench.page.until_text("2 changes in the draft");
    bench.page.press("Review and apply");
    bench.page.until_text("Apply as one");
    bench.page.press("Apply");
    bench.page.until("!document.querySelector('.draft')");
    assert_eq!(parameter(&mut bench, CALIPER, "value"), 60e-6);
    assert_eq!(parameter(&mut bench, "web.tail", "value"), true);

    // a change of somebody else between draft and apply
    bench.page.fill(CALIPER, "0.00007");
    bench.page.key("Enter");
    bench.page.until_text("1 change in the draft");
    bench.page.press("Review and apply");
    let others = bench.page.eval(
        "(async () => { const to = (path, method, body) => fetch('/api/v1/' + path, { method, body: JSON.stringify(body), headers: { 'Content-Type': 'application/json' } }); \
         const { revision } = await (await fetch('/api/v1/info')).json(); \
         await to('parameters/staged', 'PUT', { revision, values: { 'web.caliper_m': 0.00008 } }); \
         return (await to('parameters/apply', 'POST', { revision })).status; })()",
    );
    assert_eq!(others, 200);
    bench.page.press("Apply");
    bench.page.until_text("Somebody else has applied a change");
    assert_eq!(parameter(&mut bench, CALIPER, "value"), 80e-6);
}

#[test]
fn auto_tune_runs_to_its_end_and_finds_the_drums_inertia() {
    let mut bench = Bench::start();
    bench.take_control();
    bench.show("autotune");
    bench.page.press("Start auto-tune");
    bench
        .page
        .until_text("Drum speed: the new gains are in use.");
    let found = bench.value(&image::AUTOTUNE_INERTIA);
    // all rolls of the windup, referred to the rear drum's shaft
    let machine = Machine::news_8000();
    let radius = machine.rear_drum.radius_m;
    let inertia = machine.windup_mass_kg(machine.shipping_roll.core_radius_m) * radius * radius;
    assert!(
        (found / inertia - 1.0).abs() < 0.02,
        "{found} of {inertia} kg·m²"
    );
    let shown = bench.page.eval("[...document.querySelectorAll('tr')].find((r) => r.innerText.startsWith('Inertia')).querySelector('b').textContent.replace(/\\s/g, '')");
    assert_eq!(shown, format!("{found:.1}"));
}

#[test]
fn a_web_break_is_put_in_by_a_click_seen_and_acknowledged() {
    let mut bench = Bench::start();
    bench.thread();
    bench.run(ROLL.1, 600);
    bench.show("faults");
    bench.page.press("Web break");
    bench.until("the drives see it", |feedback| {
        feedback.word(&image::FAULT) == Fault::WebBreak as u16
    });
    bench.page.until_text("Fault 2");
    assert_eq!(bench.value(&image::BROKEN_SPAN), 1.0);
    bench.show("machine");
    bench
        .page
        .until("document.querySelector('.scene .torn')?.getAttribute('visibility') === 'visible'");
    bench.page.until(
        "[...document.querySelectorAll('.scene text')].some((t) => t.textContent === 'Web break')",
    );
    bench.page.screen(1440, 900, false);
    bench
        .page
        .picture(&setup::scratch("hmi-break.png").expect("a place"));
    bench.show("faults");
    bench.page.press("All sound");
    bench.page.until_text("The machine is sound.");
    bench.until("all of it stands", |feedback| {
        mode(feedback) == Some(Mode::Ready)
    });
    bench.page.press("Acknowledge");
    bench.until("no fault", |feedback| feedback.word(&image::FAULT) == 0);
    bench.page.until("!document.querySelector('.alarm.bad')");
}

#[test]
fn a_snapshot_is_taken_and_restored() {
    let mut bench = Bench::start();
    bench.thread();
    bench.run(ROLL.1, 600);
    bench.show("session");
    bench.page.press("Take a snapshot");
    bench.page.until_text("Taken at");
    let taken = bench.value(&image::LENGTH_WU);
    bench.until("more paper", |feedback| {
        feedback.get::<f64>(&image::LENGTH_WU) > taken + 100.0
    });
    bench.page.press("Restore");
    bench.until("less paper", |feedback| {
        feedback.get::<f64>(&image::LENGTH_WU) < taken + 50.0
    });
    // and it goes on from there
    bench.until("more paper again", |feedback| {
        feedback.get::<f64>(&image::LENGTH_WU) > taken + 60.0
    });
    assert_eq!(mode(&bench.feedback()), Some(Mode::Run));
}

#[test]
fn a_trainee_sees_no_faults_and_leaves_with_the_password_only() {
    let mut bench = Bench::start();
    bench.take_control();
    bench.page.press("Access");
    bench.page.press("Trainee view");
    bench
        .page
        .until("!document.querySelector('nav a[href=\"#/faults\"]')");
    bench.page.eval("location.hash = '#/faults'; 0");
    bench
        .page
        .until("!!document.querySelector('main.page-machine')");
    bench.page.press("Access");
    bench.page.press("Leave the trainee view");
    bench
        .page
        .until("document.querySelector('dialog[open] input') !== null");
    bench.page.key("Escape");
    bench.page.until("!document.querySelector('dialog input')");
    assert_eq!(
        bench
            .page
            .eval("document.querySelector('nav a[href=\"#/faults\"]')"),
        Value::Null
    );
    bench.page.press("Leave the trainee view");
    bench.enter_password();
    bench
        .page
        .until("!!document.querySelector('nav a[href=\"#/faults\"]')");
}

#[test]
fn a_plc_that_writes_takes_over_and_the_page_says_so() {
    let mut bench = Bench::start();
    bench.take_control();
    let mut plc = host_tests::link::Link::connect(bench.modbus()).expect("it listens");
    let mut commands = image::Commands::of(&Machine::news_8000());
    for beat in 1..20 {
        commands.set_word(&image::HEARTBEAT_PLC, beat);
        plc.write(&commands).expect("a write");
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    bench.page.until_text("The PLC commands.");
    assert_eq!(
        bench.page.eval(&format!("{}.disabled", button("Prepare"))),
        true
    );
}
