//! `winder bench --link`

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::Barrier;
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, anyhow, ensure};

use super::conformance::{Cable, cable};
use crate::conformance::frame;
use crate::interrupt;
use crate::simulator::{Board, Options, Simulator};

/// Registers of a request.
const REGISTERS: u16 = 40;
/// MBAP header, function, byte count, registers.
const REPLY_BYTES: usize = 7 + 2 + 2 * REGISTERS as usize;
/// How long each row is measured.
const ROUND: Duration = Duration::from_secs(3);
/// Without a reply for this long there is none.
const PATIENCE: Duration = Duration::from_secs(2);
/// Requests under way at once, of a client that does not wait.
const DEPTH: usize = 8;
/// As many as are served at once.
const CLIENTS: usize = 8;
/// Connections a second …
const CONNECTS: u32 = 1000;
/// … of so many clients, …
const CALLERS: u32 = 4;
/// … for so long.
const CONNECTING: Duration = Duration::from_secs(60);

/// Measures both boards and prints a table; with `long`, a minute of connections too.
pub fn main(long: bool) -> Result<std::process::ExitCode> {
    let options = match cable()? {
        Cable::Here(options) => options,
        Cable::Done(code) => return Ok(code),
    };
    println!(
        "# The link on this PC\n\n\
         Requests of function 3 for {REGISTERS} registers, {} s each; bars: 5000 in a second, and half of them within \
         150 µs. Fair: the fewest replies that a client got, of the most.\n\n\
         | Board | Clients | In a second | p50, µs | p99, µs | Fair |\n|---|---|---:|---:|---:|---:|",
        ROUND.as_secs()
    );
    let boards = [(Board::Host, Options::default()), (Board::Mps2, options)];
    let mut simulators = Vec::new();
    for (board, options) in boards {
        let simulator = Simulator::start(board, options)?;
        for (what, clients, depth) in [
            ("1".to_owned(), 1, 1),
            (format!("1, {DEPTH} requests under way"), 1, DEPTH),
            (CLIENTS.to_string(), CLIENTS, 1),
        ] {
            interrupt::check()?;
            let counts = polls(simulator.address(), clients, depth)?;
            println!("| {} | {what} | {counts} |", board.name());
        }
        simulators.push((board, simulator));
    }
    if long {
        println!(
            "\nUp to {CONNECTS} connections a second, {CALLERS} at once, each asks once; {} s.\n\n\
             | Board | Connections | Not answered | Served afterwards |\n|---|---:|---:|---|",
            CONNECTING.as_secs()
        );
        for (board, simulator) in &simulators {
            let (made, failed) = connects(simulator.address())?;
            let served = Client::connect(simulator.address()).and_then(|mut c| c.ask(1));
            let served = served.map_or("no", |_| "yes");
            println!("| {} | {made} | {failed} | {served} |", board.name());
        }
    }
    Ok(std::process::ExitCode::SUCCESS)
}

/// A client that does as little as it can.
struct Client {
    stream: TcpStream,
    request: Vec<u8>,
}

impl Client {
    fn connect(address: SocketAddr) -> Result<Self> {
        let stream = TcpStream::connect_timeout(&address, PATIENCE)
            .with_context(|| format!("cannot connect to {address}"))?;
        stream.set_nodelay(true)?;
        stream.set_read_timeout(Some(PATIENCE))?;
        let [high, low] = REGISTERS.to_be_bytes();
        Ok(Self {
            stream,
            request: frame(1, 1, &[3, 0, 0, high, low]),
        })
    }

    fn send(&mut self, requests: usize) -> Result<()> {
        Ok(self.stream.write_all(&self.request.repeat(requests))?)
    }

    fn receive(&mut self) -> Result<()> {
        let mut reply = [0; REPLY_BYTES];
        self.stream.read_exact(&mut reply).context("no reply")?;
        ensure!(reply[7] == 3, "the reply is an exception");
        Ok(())
    }

    fn ask(&mut self, requests: usize) -> Result<()> {
        self.send(requests)?;
        (0..requests).try_for_each(|_| self.receive())
    }
}

/// What a row tells.
struct Counts {
    rate: f64,
    p50: Duration,
    p99: Duration,
    fair: f64,
}

impl std::fmt::Display for Counts {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (p50, p99) = (self.p50.as_micros(), self.p99.as_micros());
        write!(f, "{:.0} | {p50} | {p99} | {:.2}", self.rate, self.fair)
    }
}

/// So many clients at once, each with so many requests under way, for a [`ROUND`].
fn polls(address: SocketAddr, clients: usize, depth: usize) -> Result<Counts> {
    let start = Barrier::new(clients);
    let each: Vec<Result<Vec<Duration>>> = thread::scope(|scope| {
        let runs: Vec<_> = (0..clients)
            .map(|_| scope.spawn(|| poll(address, depth, &start)))
            .collect();
        let ended = |run: thread::ScopedJoinHandle<'_, _>| {
            run.join()
                .unwrap_or_else(|_| Err(anyhow!("a client has panicked")))
        };
        runs.into_iter().map(ended).collect()
    });
    let each = each.into_iter().collect::<Result<Vec<_>>>()?;
    let most = each.iter().map(Vec::len).max().unwrap_or(0);
    let fewest = each.iter().map(Vec::len).min().unwrap_or(0);
    let mut times = each.concat();
    ensure!(!times.is_empty(), "no replies");
    times.sort_unstable();
    Ok(Counts {
        rate: times.len() as f64 / ROUND.as_secs_f64(),
        p50: times[times.len() / 2],
        p99: times[times.len() * 99 / 100],
        fair: fewest as f64 / most as f64,
    })
}

/// The times of one client's replies, each since its request.
fn poll(address: SocketAddr, depth: usize, start: &Barrier) -> Result<Vec<Duration>> {
    let client = Client::connect(address);
    // whoever has no connection must not keep the others waiting
    start.wait();
    let mut client = client?;
    let began = Instant::now();
    let mut sent = std::collections::VecDeque::from(vec![Instant::now(); depth]);
    client.send(depth)?;
    let mut times = Vec::new();
    while began.elapsed() < ROUND {
        client.receive()?;
        times.extend(sent.pop_front().map(|at| at.elapsed()));
        sent.push_back(Instant::now());
        client.send(1)?;
    }
    Ok(times)
}

/// Connects at a steady rate, as PLCs that have lost their link do, [`CALLERS`] at once; how often, and how often in vain.
fn connects(address: SocketAddr) -> Result<(u32, u32)> {
    let counts: Vec<_> = thread::scope(|scope| {
        let callers: Vec<_> = (0..CALLERS)
            .map(|_| scope.spawn(|| call(address)))
            .collect();
        callers.into_iter().map(|caller| caller.join()).collect()
    });
    interrupt::check()?;
    counts
        .into_iter()
        .try_fold((0, 0), |(made, failed), count| {
            let (more_made, more_failed) = count.map_err(|_| anyhow!("a client has panicked"))?;
            Ok((made + more_made, failed + more_failed))
        })
}

fn call(address: SocketAddr) -> (u32, u32) {
    let began = Instant::now();
    let (mut made, mut failed) = (0, 0);
    while began.elapsed() < CONNECTING && interrupt::check().is_ok() {
        let answered = Client::connect(address).and_then(|mut client| client.ask(1));
        made += 1;
        failed += u32::from(answered.is_err());
        let due = began + Duration::from_secs(1) / CONNECTS * CALLERS * made;
        thread::sleep(due.saturating_duration_since(Instant::now()));
    }
    (made, failed)
}
