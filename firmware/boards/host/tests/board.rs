//! The native board's own life: its steps, its end, and the program around it.

use std::io::{BufRead, BufReader};
use std::net::{SocketAddr, TcpStream};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};
use std::thread::sleep;
use std::time::{Duration, Instant};

use board_host::{Board, Options, STEP};
use model_core::image::{HEARTBEAT, Image};

fn beat(image: &mut Image) {
    let feedback = &mut image.feedback;
    feedback.set_word(&HEARTBEAT, feedback.word(&HEARTBEAT).wrapping_add(1));
}

/// Steps so far, and what they may be by the clock: between those due before and after the look.
fn beats(board: &Board, start: Instant) -> (u128, u128) {
    let due = start.elapsed().as_millis() / STEP.as_millis();
    let done = board
        .image
        .lock(|image| image.borrow().feedback.word(&HEARTBEAT));
    (u128::from(done), due)
}

#[test]
fn steps_follow_the_clock_even_after_a_long_one() {
    let before = Instant::now();
    let stumbled = AtomicBool::new(false);
    let step = move |image: &mut Image| {
        beat(image);
        if !stumbled.swap(true, Ordering::Relaxed) {
            sleep(STEP * 12);
        }
    };
    let board = Board::start(Options::default(), step).unwrap();
    let started = Instant::now();
    sleep(STEP * 50);
    // However late this thread and the steps' are, the count catches up with the clock and never passes it.
    let deadline = started + Duration::from_secs(10);
    loop {
        let (done, due) = beats(&board, started);
        assert!(done <= before.elapsed().as_millis() / STEP.as_millis());
        if done + 1 >= due {
            break;
        }
        assert!(Instant::now() < deadline, "{done} of {due}");
        sleep(STEP / 10);
    }
}

#[test]
fn after_the_end_nothing_runs_and_the_port_is_free() {
    let (steps, stepped) = mpsc::channel();
    let step = move |_: &mut Image| steps.send(()).unwrap_or_default();
    let board = Board::start(Options::default(), step).unwrap();
    let address = board.address;
    stepped.recv_timeout(Duration::from_secs(10)).unwrap();
    let _client = TcpStream::connect(address).unwrap();
    let image = Arc::downgrade(&board.image);
    board.stop();
    // comes to its end only because the step, which has the sender, is gone
    stepped.iter().for_each(drop);
    assert!(image.upgrade().is_none());
    assert!(TcpStream::connect(address).is_err());
    let options = Options {
        port: address.port(),
        ..Options::default()
    };
    assert_eq!(Board::start(options, beat).unwrap().address, address);
}

#[test]
fn a_port_that_is_taken_is_an_error() {
    let board = Board::start(Options::default(), beat).unwrap();
    let options = Options {
        port: board.address.port(),
        ..Options::default()
    };
    assert!(Board::start(options, beat).is_err());
}

#[test]
fn the_program_says_where_it_is_and_ends_on_a_signal() {
    for signal in ["-INT", "-TERM"] {
        let mut program = Command::new(env!("CARGO_BIN_EXE_board_host"))
            .args(["--port", "0", "--http-port", "0"])
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(program.stdout.take().unwrap())
            .read_line(&mut line)
            .unwrap();
        let (modbus, http) = line
            .trim_end()
            .strip_prefix("ready modbus=")
            .and_then(|rest| rest.split_once(" http=http://"))
            .unwrap();
        let _clients = [modbus, http].map(|address| {
            let address: SocketAddr = address.parse().unwrap();
            assert!(address.ip().is_loopback());
            TcpStream::connect(address).unwrap()
        });
        let id = program.id().to_string();
        assert!(
            Command::new("kill")
                .args([signal, &id])
                .status()
                .unwrap()
                .success()
        );
        assert!(program.wait().unwrap().success());
    }
}
