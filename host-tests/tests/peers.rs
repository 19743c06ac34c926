//! Modbus clients that are not ours, against the firmware in QEMU: mbpoll (libmodbus) over TCP and over the serial
//! line, pymodbus, and tokio-modbus. `cargo winder test` installs what is missing of them.

use std::net::SocketAddr;
use std::process::Command;

use host_tests::log::Log;
use host_tests::qemu::SERIAL;
use host_tests::setup;
use host_tests::simulator::{Board, Options, Simulator};
use tokio_modbus::ExceptionCode;
use tokio_modbus::client::sync::{self, Reader as _, Writer as _};

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
    pymodbus(&ip, &port);
    tokio_modbus(address);
}

/// Every function that it has, on words, bits and floats.
fn pymodbus(ip: &str, port: &str) {
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
    let python = setup::pymodbus().expect("pymodbus");
    said(Command::new(python).args(["-c", SCRIPT, ip, port]));
}

/// Likewise.
fn tokio_modbus(address: SocketAddr) {
    fn good<T>(answer: tokio_modbus::Result<T>) -> T {
        answer.expect("an answer").expect("no exception")
    }
    let mut plc = sync::tcp::connect(address).expect("it connects");
    let words = [1234, 123];
    good(plc.write_multiple_registers(16, &words));
    assert_eq!(good(plc.read_holding_registers(16, 2)), words);
    good(plc.write_single_register(17, 124));
    good(plc.write_single_coil(16 * 17, true));
    good(plc.write_multiple_coils(16 * 17, &[false; 3]));
    assert_eq!(good(plc.read_coils(16 * 17, 3)), [false; 3]);
    assert_eq!(good(plc.read_discrete_inputs(0, 40)).len(), 40);
    assert_eq!(good(plc.read_input_registers(0, 65)).len(), 65);
    good(plc.masked_write_register(17, 0, 150));
    let exchanged = plc.read_write_multiple_registers(16, 2, 16, &[1000]);
    assert_eq!(good(exchanged), [1000, 150]);
    let refused = plc.read_holding_registers(500, 1).expect("an answer");
    assert_eq!(refused, Err(ExceptionCode::IllegalDataAddress));
}
