//! The command line tool as its users meet it: output, exit status, signals.

mod support;

use host_tests::link::Link;
use support::{Running, winder};

#[test]
fn run_says_where_it_answers_and_ends_with_a_signal() {
    for signal in ["INT", "TERM"] {
        let mut running = Running::start(&["--board", "host"]);
        Link::connect(running.address).unwrap().read().unwrap();
        running.signal(signal);
        assert!(running.end().success(), "SIG{signal}");
        assert!(Link::connect(running.address).is_err(), "SIG{signal}");
    }
}

#[test]
fn a_demo_leaves_picture_and_data() {
    let out = tempfile::tempdir().unwrap();
    let out_arg = out.path().to_str().unwrap();
    let demo = winder(&["demo", "--board", "host", "--pace", "5", "--out", out_arg])
        .args(["--diameter", "125", "--speed", "200"])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&demo.stdout);
    assert!(
        demo.status.success(),
        "{said}\n{}",
        String::from_utf8_lossy(&demo.stderr)
    );
    assert!(said.contains("tension in acceleration"), "{said}");

    let file = |name| std::fs::read(out.path().join(name)).unwrap();
    assert!(file("demo.png").starts_with(b"\x89PNG"));
    assert!(file("demo.svg").starts_with(b"<svg"));
    let data = file("demo.csv");
    let mut data = csv::Reader::from_reader(data.as_slice());
    assert_eq!(&data.headers().unwrap()[0], "t_s");
    let rows = data.records().map(Result::unwrap).count();
    assert!(rows > 100, "{rows} rows");
}

#[test]
fn a_demo_that_fails_says_so_with_its_exit_status() {
    let none = winder(&["demo", "--board", "host", "--diameter", "3000"])
        .output()
        .unwrap();
    assert_eq!(none.status.code(), Some(1));
    let said = String::from_utf8_lossy(&none.stderr).into_owned();
    assert_eq!(
        said,
        "error: --diameter 3000 mm is outside 120 to 1250 mm, which this machine can wind\n"
    );
}

#[test]
fn a_taken_port_is_named() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port().to_string();
    let run = winder(&["run", "--board", "host", "--port", &port])
        .output()
        .unwrap();
    assert_eq!(run.status.code(), Some(1));
    let said = String::from_utf8_lossy(&run.stderr);
    assert!(said.contains(&port), "{said}");
}

#[test]
fn signals_are_a_csv_table() {
    let list = winder(&["signals"]).output().unwrap();
    assert!(list.status.success());
    let header =
        b"name,direction,section,type,unit,scale,modbus_table,modbus_address,description\n";
    assert!(list.stdout.starts_with(header));
}
