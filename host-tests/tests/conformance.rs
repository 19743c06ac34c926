//! The native board passes every conformance case; over TCP and on its serial line. The board in QEMU is another test's.

use board_host::STATION;
use host_tests::conformance::{Map, Server, run, serial, table};
use host_tests::simulator::{Board, Options, Simulator};

#[test]
fn the_native_board_passes_every_case() {
    let simulator = Simulator::start(Board::Host, Options::default()).unwrap();
    let server = Server {
        address: simulator.address(),
        map: Map::default(),
    };
    let mut outcomes = run(server, |_| ());
    let line = simulator.serial().expect("a pseudoterminal");
    serial::run(&line, 19_200, STATION, &server.map, |o| outcomes.push(o)).unwrap();
    assert!(outcomes.len() > 120, "{} cases", outcomes.len());
    assert!(
        outcomes.iter().all(|o| o.failed.is_none()),
        "\n{}",
        table(&outcomes)
    );
}
