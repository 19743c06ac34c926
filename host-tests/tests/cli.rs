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

/// What `machine` prints is what `plant --machine` takes; the rolls' columns are numbered unless they are lumped.
#[test]
fn a_machine_is_printed_changed_and_run() {
    let directory = tempfile::tempdir().unwrap();
    let path = |name| directory.path().join(name).to_str().unwrap().to_owned();
    let (schedule, machine) = (path("torques.csv"), path("mine.toml"));
    std::fs::write(
        &schedule,
        "t_s,T_uw,T_rd,T_fd,T_rr\n0,-2,3,3,0\n1,0,0,0,0\n",
    )
    .unwrap();
    let run = |machine: &str| {
        let arguments = [
            "plant",
            "--schedule",
            &schedule,
            "--out",
            "-",
            "--machine",
            machine,
        ];
        winder(&arguments).output().unwrap()
    };
    for (preset, header) in [
        (
            "LAB-300",
            "t_s,v_uw,v_gr,v_sr,v_rd,t_uw,t_gr,t_sr,r_uw,r_wu",
        ),
        (
            "NEWS-8000-UNLUMPED",
            "t_s,v_uw,v_1,v_2,v_3,v_4,v_5,v_6,v_7,v_rd,t_uw,t_1,t_2,t_3,t_4,t_5,t_6,t_7,r_uw,r_wu",
        ),
    ] {
        let printed = winder(&["machine", preset]).output().unwrap().stdout;
        std::fs::write(&machine, &printed).unwrap();
        let by_file = run(&machine);
        assert!(by_file.stdout.starts_with(header.as_bytes()), "{by_file:?}");
        assert_eq!(by_file.stdout, run(preset).stdout, "{preset}");

        let printed = String::from_utf8(printed).unwrap();
        std::fs::write(
            &machine,
            printed.replacen("last_span_m = ", "last_span_m = -", 1),
        )
        .unwrap();
        let refused = run(&machine);
        assert_eq!(refused.status.code(), Some(1));
        let said = String::from_utf8_lossy(&refused.stderr);
        assert!(said.contains("mine.toml:2: last_span_m = -"), "{said}");
        assert!(said.contains(" is outside 0.05 to 50"), "{said}");
    }
}

#[test]
fn the_list_of_machines_names_every_preset() {
    let list = winder(&["machine", "--list"]).output().unwrap();
    let list = String::from_utf8(list.stdout).unwrap();
    let names = list.lines().filter_map(|line| line.split(' ').next());
    assert!(names.eq(model_core::machine::PRESETS.iter().map(|(name, _)| *name)));
}

/// Without a toolchain there are no instructions to count: that is said, and this PC is measured all the same.
#[test]
fn bench_measures_what_it_can_and_names_the_rest() {
    let arguments = ["bench", "--machine", "NEWS-8000", "--scalar", "f32"];
    let output = winder(&arguments).env("PATH", "").output().unwrap();
    assert!(output.status.success(), "{output:?}");
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(said.contains("\nNot measured: instructions: "), "{said}");
    let row = |begin: &str| said.lines().find(|line| line.starts_with(begin));
    let step = row("| plant step |").expect("the operations need no QEMU");
    assert!(step.ends_with("| – | – | – |"), "{step}");
    let speed = row("| NEWS-8000 | f32 |").expect("a speed");
    let speeds = speed
        .split('|')
        .filter_map(|cell| cell.trim().parse::<f64>().ok());
    assert_eq!(speeds.filter(|speed| *speed > 0.0).count(), 2, "{speed}");
}

#[test]
fn bench_refuses_what_it_does_not_know_by_name() {
    for (arguments, said) in [
        (["bench", "--machine", "NEWS-9000"], "\"NEWS-9000\""),
        (["bench", "--scalar", "f16"], "there are f32, f64, fixed"),
    ] {
        let output = winder(&arguments).output().unwrap();
        assert!(!output.status.success());
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(error.contains(said), "{error}");
    }
}
