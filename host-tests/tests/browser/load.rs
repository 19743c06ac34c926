//! Three browsers that watch at 50 Hz, and a PLC that polls: every stream is steady, and no timed task is late.
//!
//! Not here: a browser. A stream's other end is what counts, and three of Chromium would be a test of the PC. Time is
//! the simulator's own: what a sample's number says, not when it came.

use std::net::{SocketAddr, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use host_tests::link::Link;
use host_tests::simulator::{Board, Options, Simulator};
use model_core::image::{self, Commands, SIGNALS};
use model_core::machine::Machine;
use serde_json::{Value, json};
use tungstenite::Message;

/// Samples of each stream: so many fiftieths of a second.
const SAMPLES: usize = 500;
/// Drive cycles from sample to sample.
const EVERY: u64 = 2;
/// As many signals as a page shows at once.
const SHOWN: usize = 48;
/// A PLC's usual interval.
const POLL: Duration = Duration::from_millis(20);

/// The drive cycles of the samples that one watcher gets.
fn watch(http: SocketAddr) -> Vec<u64> {
    let stream = TcpStream::connect(http).expect("a place");
    stream
        .set_read_timeout(Some(Duration::from_secs(60)))
        .expect("a socket");
    stream.set_nodelay(true).expect("a socket");
    let url = format!("ws://{http}/api/v1/live");
    let (mut socket, _) = tungstenite::client(url, stream).expect("a stream");
    let names: Vec<_> = SIGNALS.iter().rev().take(SHOWN).map(|s| s.name).collect();
    let wish = json!({"signals": names, "hz": 50}).to_string();
    socket.send(Message::text(wish)).expect("sent");
    let mut cycles = Vec::new();
    while cycles.len() < SAMPLES {
        let message = socket.read().expect("a message");
        let Message::Text(text) = message else {
            continue;
        };
        if let Value::Array(row) = serde_json::from_str(&text).expect("JSON") {
            assert_eq!(row.len(), 1 + SHOWN);
            cycles.push(row[0].as_u64().expect("a cycle"));
        }
    }
    cycles
}

#[test]
fn streams_of_three_browsers_are_steady_beside_a_plc_and_no_task_is_late() {
    let simulator = Simulator::start(Board::Mps2, Options::default()).expect("QEMU starts");
    let (http, modbus) = (simulator.http(), simulator.address());
    let watched = AtomicBool::new(false);
    let streams = thread::scope(|scope| {
        let plc = scope.spawn(|| {
            let mut link = Link::connect(modbus).expect("it listens");
            let mut commands = Commands::of(&Machine::news_8000());
            let mut polls = 0_u16;
            while !watched.load(Ordering::Relaxed) {
                polls = polls.wrapping_add(1);
                commands.set_word(&image::HEARTBEAT_PLC, polls);
                link.write(&commands).expect("a write");
                link.read().expect("a read");
                thread::sleep(POLL);
            }
            polls
        });
        // what a page asks beside its stream, of each of three
        let asks = scope.spawn(|| {
            let mut rounds = 0;
            while !watched.load(Ordering::Relaxed) {
                for path in ["info", "panel", "link", "health"] {
                    let answer = crate::chromium::get(http, &format!("/api/v1/{path}"));
                    assert!(answer.starts_with("HTTP/1.1 200"), "{path}: {answer}");
                }
                rounds += 1;
                thread::sleep(Duration::from_millis(300));
            }
            rounds
        });
        let watchers: Vec<_> = (0..3).map(|_| scope.spawn(|| watch(http))).collect();
        let streams: Vec<_> = watchers.into_iter().map(|w| w.join()).collect();
        watched.store(true, Ordering::Relaxed);
        assert!(plc.join().expect("it polls") > 100);
        assert!(asks.join().expect("it asks") > 3);
        streams
    });
    for (number, cycles) in streams.into_iter().enumerate() {
        let cycles = cycles.expect("it watched");
        // The first sample comes at once, the others each in their turn.
        let uneven: Vec<_> = cycles[1..]
            .windows(2)
            .filter(|pair| pair[1] - pair[0] != EVERY)
            .map(|pair| (pair[0], pair[1]))
            .collect();
        assert!(uneven.is_empty(), "stream {number}: {uneven:?}");
    }
    let mut link = Link::connect(modbus).expect("it listens");
    let feedback = link.read().expect("a read");
    for late in [
        &image::PLANT_OVERRUNS,
        &image::DRIVE_OVERRUNS,
        &image::LOGIC_OVERRUNS,
    ] {
        assert_eq!(feedback.word(late), 0, "{}", late.name);
    }
}
