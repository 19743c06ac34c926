//! The native board passes every conformance case; the board in QEMU is looked at by `cargo winder test`.

use host_tests::conformance::{Map, Server, run, table};
use host_tests::simulator::{Board, Options, Simulator};

#[test]
fn the_native_board_passes_every_case() {
    let simulator = Simulator::start(Board::Host, Options::default()).unwrap();
    let server = Server {
        address: simulator.address(),
        map: Map::default(),
    };
    let outcomes = run(server, |_| ());
    assert!(outcomes.len() > 100, "{} cases", outcomes.len());
    assert!(
        outcomes.iter().all(|o| o.failed.is_none()),
        "\n{}",
        table(&outcomes)
    );
}
