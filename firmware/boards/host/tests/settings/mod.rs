//! Settings by the interface: what is applied is there after the next start, whenever the power fails.

use board_host::{Board, Flash, Options};
use serde_json::{Value, json};

use super::Browser;

/// A start with this flash.
fn power_up(flash: &Flash) -> Board {
    let options = Options {
        flash: Some(flash.clone()),
        ..Options::default()
    };
    Board::simulate(options, ()).unwrap()
}

/// Of the web, mm.
fn width(browser: &mut Browser) -> u32 {
    let page = browser.get("parameters");
    let parts = page["parts"].as_array().unwrap();
    let mut all = parts
        .iter()
        .flat_map(|part| part["parameters"].as_array().unwrap());
    let width = all.find(|p| p["name"] == "web.width_m").unwrap();
    (1e3 * width["value"].as_f64().unwrap()).round() as u32
}

/// Another machine, in use from now on.
fn apply(browser: &mut Browser, width_mm: u32) {
    browser.wait("parameters", |page| page["locked"] == false);
    let revision = browser.get("parameters")["revision"].clone();
    let values =
        json!({"revision": revision, "values": {"web.width_m": 1e-3 * f64::from(width_mm)}});
    let (status, answer) = browser.ask("PUT", "parameters/staged", Some(values));
    assert_eq!(status, 200, "{answer}");
    browser.wait("info", |info| info["cycle"].as_u64() > Some(2));
    browser.post("parameters/apply", json!({"revision": revision}));
}

fn put(browser: &mut Browser, settings: Value) -> (u16, Value) {
    browser.ask("PUT", "settings", Some(settings))
}

#[test]
fn what_is_applied_is_there_after_the_next_start() {
    let flash = Flash::default();
    let board = power_up(&flash);
    let mut browser = Browser::logged_in(&board);
    let settings = browser.get("settings");
    assert_eq!(
        (&settings["state"], &settings["restart"]),
        (&json!("empty"), &json!(false))
    );
    apply(&mut browser, 6000);
    let wanted = json!({
        "network": {"dhcp": false, "address": "192.168.7.9/24", "gateway": "192.168.7.1"},
        "serial": {"baud": 38400, "parity": "odd", "address": 17},
    });
    assert_eq!(put(&mut browser, wanted.clone()).0, 200);
    let settings = browser.wait("settings", |s| s["state"] == "stored");
    assert_eq!(settings["restart"], true);
    assert_eq!(settings["network"]["now"]["dhcp"], true);
    assert_eq!(settings["network"]["next"], wanted["network"]);
    board.stop();

    let board = power_up(&flash);
    let mut browser = Browser::logged_in(&board);
    assert_eq!(width(&mut browser), 6000);
    let settings = browser.get("settings");
    for part in ["network", "serial"] {
        assert_eq!(settings[part]["now"], wanted[part]);
        assert_eq!(settings[part]["next"], wanted[part]);
    }
    assert_eq!(
        (&settings["state"], &settings["restart"]),
        (&json!("stored"), &json!(false))
    );

    // emptied, the next start has the defaults
    assert_eq!(browser.ask("DELETE", "settings", None).0, 200);
    let settings = browser.wait("settings", |s| s["state"] == "empty");
    assert_eq!(settings["restart"], true);
    assert!(flash.bytes().iter().all(|byte| *byte == 0xff));
    board.stop();
    let board = power_up(&flash);
    let mut browser = Browser::new(&board);
    assert_eq!(width(&mut browser), 8000);
    assert_eq!(browser.get("settings")["network"]["now"]["dhcp"], true);
}

#[test]
fn whenever_the_power_fails_the_next_start_has_the_old_settings_or_the_new() {
    let flash = Flash::default();
    let (mut old, mut seen) = (8000, [0; 2]);
    // as far as the first set is long and one that follows
    for (n, steps) in (0..).zip([0, 1, 2, 3, 20, 40, 60, 0, 1, 20, 40, 60]) {
        let board = power_up(&flash);
        let mut browser = Browser::logged_in(&board);
        let new = 5000 + 100 * n;
        flash.fail_after(Some(steps));
        apply(&mut browser, new);
        let ended = |s: &Value| s["state"] == "failed" || s["state"] == "stored";
        browser.wait("settings", ended);
        board.stop();

        flash.fail_after(None);
        let board = power_up(&flash);
        let mut browser = Browser::new(&board);
        assert_ne!(browser.get("settings")["state"], "undecided", "{steps}");
        let found = width(&mut browser);
        assert!(
            found == old || found == new,
            "{steps} steps: {found} is neither {old} nor {new}"
        );
        seen[usize::from(found == new)] += 1;
        old = found;
    }
    assert!(seen[0] > 0 && seen[1] > 0, "{seen:?}");
}

#[test]
fn what_is_foreign_stays_until_somebody_decides() {
    let flash = Flash::default();
    flash.fill(|i| (i * 31 % 251) as u8);
    let before = flash.bytes();
    let board = power_up(&flash);
    let mut browser = Browser::logged_in(&board);
    let settings = browser.get("settings");
    assert_eq!(settings["state"], "undecided");
    assert!(settings["why"].as_str().unwrap().contains("damaged"));
    assert!(browser.get("events").to_string().contains("defaults: "));
    assert_eq!(browser.get("info")["settings"], "undecided");
    apply(&mut browser, 6000);
    assert_eq!(put(&mut browser, json!({"serial": {"address": 9}})).0, 200);
    let settings = browser.get("settings");
    assert_eq!(settings["state"], "undecided");
    assert_eq!(settings["serial"]["next"]["address"], 9);
    board.stop();
    assert_eq!(flash.bytes(), before);

    let board = power_up(&flash);
    let mut browser = Browser::logged_in(&board);
    apply(&mut browser, 7000);
    browser.post("settings/overwrite", json!({}));
    let settings = browser.wait("settings", |s| s["state"] == "stored");
    assert_eq!(settings["why"], Value::Null);
    // there is nothing more to decide
    assert_eq!(
        browser.ask("POST", "settings/overwrite", Some(json!({}))).0,
        409
    );
    board.stop();
    assert_eq!(width(&mut Browser::new(&power_up(&flash))), 7000);
}

#[test]
fn settings_that_cannot_be_are_named_and_change_nothing() {
    let flash = Flash::default();
    let board = power_up(&flash);
    let mut browser = Browser::logged_in(&board);
    let before = browser.get("settings");
    let at = |address: &str| json!({"network": {"dhcp": false, "address": address}});
    for (wish, parameter) in [
        (at("192.168.7.9"), "network.address"),
        (at("192.168.7.9/33"), "network.address"),
        (at("192.168.7.255/24"), "network.address"),
        (at("192.168.7/24"), "network.address"),
        (
            json!({"network": {"dhcp": false, "address": "10.0.0.1/8", "gateway": "11.0.0.1"}}),
            "network.gateway",
        ),
        (json!({"serial": {"baud": 300}}), "serial.baud"),
        (json!({"serial": {"baud": 9600.5}}), "serial.baud"),
        (json!({"serial": {"parity": "mark"}}), "serial.parity"),
        (json!({"serial": {"address": 248}}), "serial.address"),
        (
            json!({"network": {"dhcp": true}, "serial": {"address": -1}}),
            "serial.address",
        ),
    ] {
        let (status, refusal) = put(&mut browser, wish.clone());
        assert_eq!(status, 422, "{wish}");
        assert_eq!(
            refusal["details"][0]["parameter"], parameter,
            "{wish}: {refusal}"
        );
    }
    assert_eq!(browser.get("settings"), before);
    assert!(flash.bytes().iter().all(|byte| *byte == 0xff));
}

/// The flash is not worn out by who writes without end; the last of it is stored later.
#[test]
fn who_changes_settings_again_and_again_waits() {
    let flash = Flash::default();
    let board = power_up(&flash);
    let mut browser = Browser::logged_in(&board);
    let first = browser.get("settings")["writes_left"].as_u64().unwrap();
    for address in 2..2 + first {
        assert_eq!(
            put(&mut browser, json!({"serial": {"address": address}})).0,
            200
        );
        browser.wait("settings", |s| s["state"] == "stored");
    }
    assert_eq!(put(&mut browser, json!({"serial": {"address": 99}})).0, 200);
    let settings = browser.get("settings");
    assert_eq!(
        (&settings["state"], &settings["writes_left"]),
        (&json!("waiting"), &json!(0))
    );
    assert_eq!(settings["serial"]["next"]["address"], 99);
}

#[test]
fn a_board_without_a_place_for_settings_says_so() {
    let board = Board::simulate(Options::default(), ()).unwrap();
    let mut browser = Browser::logged_in(&board);
    assert_eq!(put(&mut browser, json!({"serial": {"address": 9}})).0, 200);
    assert_eq!(browser.get("settings")["state"], "nowhere");
    assert_eq!(browser.ask("DELETE", "settings", None).0, 409);
}
