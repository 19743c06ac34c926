//! Modbus clients that are not ours, against the firmware in QEMU: mbpoll (libmodbus) over TCP and over the serial
//! line, and pymodbus. `cargo winder test` installs mbpoll and runs it; pymodbus is asked only where it is installed.

use std::path::Path;
use std::process::Command;

use host_tests::log::Log;
use host_tests::qemu::SERIAL;
use host_tests::setup::on_path;
use host_tests::simulator::{Board, Options, Simulator};

/// The simulator in QEMU, and the path of its serial line.
fn simulator() -> (Simulator, String) {
    let log = Log::default();
    let options = Options {
        log: log.clone(),
        ..Options::default()
    };
    let simulator = Simulator::start(Board::Mps2, options).expect("QEMU starts");
    let lines = log.lines();
    let path = lines.iter().find_map(|line| line.text.strip_prefix(SERIAL));
    (simulator, path.expect("QEMU tells").to_owned())
}

/// What a peer prints; it must succeed.
fn said(command: &mut Command) -> String {
    let output = command.output().expect("starts");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{command:?}: {text}\n{output:?}");
    text
}

fn mbpoll(arguments: &[&str], values: &[&str]) -> String {
    let mut command = Command::new("mbpoll");
    command.args(["-0", "-1", "-q", "-a", "1"]).args(arguments);
    said(command.args(values))
}

#[test]
fn peers_read_what_they_have_written() {
    let (simulator, line) = simulator();
    let address = simulator.address();
    let (ip, port) = (address.ip().to_string(), address.port().to_string());
    let tcp = ["-m", "tcp", "-p", &port, "-t", "4", "-r", "16"];
    mbpoll(&tcp, &[&ip, "1234", "123"]);
    let read = mbpoll(&[&tcp[..], &["-c", "2"]].concat(), &[&ip]);
    assert!(read.contains("1234") && read.contains("123"), "{read}");
    // the same registers from the other side
    let rtu = [
        "-m", "rtu", "-b", "19200", "-P", "none", "-t", "4", "-r", "16",
    ];
    let read = mbpoll(&[&rtu[..], &["-c", "2"]].concat(), &[&line]);
    assert!(read.contains("1234"), "{read}");
    let python = on_path("python3");
    let has = python.filter(|python| {
        let import = Command::new(python)
            .args(["-c", "import pymodbus"])
            .status();
        import.is_ok_and(|status| status.success())
    });
    match has {
        Some(python) => pymodbus(&python, &ip, &port),
        None => eprintln!("no pymodbus: not tried"),
    }
}

/// Every function that it has, on words, bits and floats.
fn pymodbus(python: &Path, ip: &str, port: &str) {
    const SCRIPT: &str = r#"
import sys
from pymodbus.client import ModbusTcpClient as Client
plc = Client(sys.argv[1], port=int(sys.argv[2])); assert plc.connect()
good = lambda answer: answer if not answer.isError() else sys.exit(f"{answer}")
good(plc.write_registers(16, [1234, 123]))
assert good(plc.read_holding_registers(16, count=2)).registers == [1234, 123]
good(plc.write_register(17, 124))
good(plc.write_coil(16 * 17, True)); good(plc.write_coils(16 * 17, [False] * 3))
assert good(plc.read_coils(16 * 17, count=3)).bits[:3] == [False] * 3
assert len(good(plc.read_discrete_inputs(0, count=40)).bits) == 40
assert len(good(plc.read_input_registers(0, count=65)).registers) == 65
good(plc.mask_write_register(address=17, and_mask=0, or_mask=150))
assert good(plc.readwrite_registers(read_address=16, read_count=2, write_address=16, values=[1000])).registers == [1000, 150]
speed = plc.convert_to_registers(1234.5, plc.DATATYPE.FLOAT32)
good(plc.write_registers(1012, speed))
assert good(plc.read_holding_registers(6, count=1)).registers == [12345]
assert good(plc.read_device_information()).information[0]
assert plc.read_holding_registers(500, count=1).exception_code == 2
"#;
    said(Command::new(python).args(["-c", SCRIPT, ip, port]));
}
