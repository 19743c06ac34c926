//! Modbus servers of others, and how they do in the cases: for who wants to compare.
//!
//! Not here: what is asked; and no tuning: each server is made as its documentation shows, with 100 registers and bits of
//! each kind. Two are programs of `peers/`, one is a task of this process.

use std::future::{Ready, ready};
use std::io::{BufRead, BufReader};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use tokio::runtime::Runtime;
use tokio_modbus::server::Service;
use tokio_modbus::{ExceptionCode, Request, Response};

use super::{Map, Outcome, Server, run};
use crate::setup;

/// Registers and bits of each kind.
const SIZE: u16 = 100;

/// A peer's bits may be those of its registers.
const BITS: u16 = 16 * SIZE;

/// Connections that may wait for libmodbus to accept them.
const WAITING: &str = "64";

/// How a server did.
#[derive(Debug)]
pub struct Column {
    /// Its name.
    pub name: String,
    /// Case by case.
    pub outcomes: Vec<Outcome>,
}

/// Runs the cases on every peer; `tell` gets each name before it is its turn.
///
/// # Errors
/// One cannot be installed or does not start.
pub fn measure(mut tell: impl FnMut(&str)) -> Result<Vec<Column>> {
    let python = setup::pymodbus()?;
    let system = setup::python()?;
    setup::mbpoll()?; // brings libmodbus
    let mut columns = Vec::new();
    let mut keep = |name: String, address, coils| {
        tell(&name);
        let map = Map {
            holding: SIZE,
            inputs: SIZE,
            coils,
            discretes: coils,
            scratch: 0,
        };
        let outcomes = run(Server { address, map }, |_| ());
        columns.push(Column { name, outcomes });
    };
    for (script, python, arguments, bits) in [
        ("pymodbus_server.py", &python, &[][..], BITS),
        ("libmodbus_server.py", &system, &[WAITING][..], SIZE),
    ] {
        let program = Program::start(script, python, arguments)?;
        keep(program.name.clone(), program.address, bits);
    }
    let (_runtime, address) = tokio_modbus_server()?;
    keep("tokio-modbus".to_owned(), address, SIZE);
    Ok(columns)
}

/// A table with a row for each case that somebody fails, and what came instead.
pub fn table(columns: &[Column]) -> String {
    let names: Vec<_> = columns.iter().map(|c| c.name.as_str()).collect();
    let mut text = format!("| Case | Sent | Wanted | {} |\n", names.join(" | "));
    text += &format!("|---|---|---|{}\n", "---|".repeat(names.len()));
    let cases = columns.first().map_or(&[][..], |c| &c.outcomes);
    for (i, case) in cases.iter().enumerate() {
        let cells = columns.iter().map(|c| c.outcomes[i].failed.as_deref());
        let cells: Vec<_> = cells.collect();
        if cells.iter().any(Option::is_some) {
            let cells: Vec<_> = cells.iter().map(|cell| cell.unwrap_or("ok")).collect();
            let (sent, cells) = (&case.sent, cells.join(" | "));
            text += &format!("| {} | {sent} | {} | {cells} |\n", case.id, case.wanted);
        }
    }
    let failed = |c: &Column| c.outcomes.iter().filter(|o| o.failed.is_some()).count();
    let failed: Vec<_> = columns.iter().map(|c| failed(c).to_string()).collect();
    text + &format!(
        "| **failed, of {}** | | | {} |\n",
        cases.len(),
        failed.join(" | ")
    )
}

/// A server that is a program; it ends when dropped.
struct Program {
    child: Child,
    /// What it calls itself.
    name: String,
    address: SocketAddr,
}

impl Program {
    fn start(script: &str, python: &Path, arguments: &[&str]) -> Result<Self> {
        const PATIENCE: Duration = Duration::from_secs(20);
        let port = free_port()?;
        let mut child = Command::new(python)
            .arg(
                Path::new(env!("CARGO_MANIFEST_DIR"))
                    .join("peers")
                    .join(script),
            )
            .arg(port.to_string())
            .args(arguments)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .with_context(|| format!("cannot start {}", python.display()))?;
        let mut name = String::new();
        if let Some(out) = child.stdout.take() {
            BufReader::new(out).read_line(&mut name)?;
        }
        let program = Self {
            child,
            name: name.trim().to_owned(),
            address: SocketAddr::from((Ipv4Addr::LOCALHOST, port)),
        };
        let began = Instant::now();
        while TcpStream::connect(program.address).is_err() {
            if began.elapsed() > PATIENCE {
                bail!("{script} does not listen");
            }
            thread::sleep(Duration::from_millis(50));
        }
        Ok(program)
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        // it may have ended by itself
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn free_port() -> Result<u16> {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).context("no port is free")?;
    Ok(listener.local_addr()?.port())
}

/// Serves until the runtime is dropped.
fn tokio_modbus_server() -> Result<(Runtime, SocketAddr)> {
    use tokio_modbus::server::tcp::{Server, accept_tcp_connection};
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .enable_all()
        .build()?;
    let listener = tokio::net::TcpListener::bind((Ipv4Addr::LOCALHOST, 0));
    let listener = runtime.block_on(listener)?;
    let address = listener.local_addr()?;
    runtime.spawn(async move {
        let store: &'static Store = Box::leak(Box::default());
        let connected = |stream, from| async move {
            accept_tcp_connection(stream, from, move |_| Ok(Some(store)))
        };
        Server::new(listener).serve(&connected, |_| ()).await
    });
    Ok((runtime, address))
}

/// What that server serves: its author has to write this much.
struct Store {
    coils: Mutex<[bool; SIZE as usize]>,
    registers: Mutex<[u16; SIZE as usize]>,
}

impl Default for Store {
    fn default() -> Self {
        Self {
            coils: Mutex::new([false; _]),
            registers: Mutex::new([0; _]),
        }
    }
}

/// A part of it, where all of it is there.
fn part<T>(all: &mut [T], first: u16, count: usize) -> Result<&mut [T], ExceptionCode> {
    let first = usize::from(first);
    all.get_mut(first..first + count)
        .ok_or(ExceptionCode::IllegalDataAddress)
}

impl Service for Store {
    type Request = Request<'static>;
    type Response = Response;
    type Exception = ExceptionCode;
    type Future = Ready<Result<Response, ExceptionCode>>;

    fn call(&self, request: Request<'static>) -> Self::Future {
        let coils = &mut *self.coils.lock().unwrap_or_else(PoisonError::into_inner);
        let words = &mut *self
            .registers
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        let mut serve = || {
            Ok(match request {
                Request::ReadCoils(at, n) => {
                    Response::ReadCoils(part(coils, at, n.into())?.to_vec())
                }
                Request::ReadDiscreteInputs(at, n) => {
                    Response::ReadDiscreteInputs(part(coils, at, n.into())?.to_vec())
                }
                Request::ReadHoldingRegisters(at, n) => {
                    Response::ReadHoldingRegisters(part(words, at, n.into())?.to_vec())
                }
                Request::ReadInputRegisters(at, n) => {
                    Response::ReadInputRegisters(part(words, at, n.into())?.to_vec())
                }
                Request::WriteSingleCoil(at, coil) => {
                    part(coils, at, 1)?[0] = coil;
                    Response::WriteSingleCoil(at, coil)
                }
                Request::WriteSingleRegister(at, word) => {
                    part(words, at, 1)?[0] = word;
                    Response::WriteSingleRegister(at, word)
                }
                Request::WriteMultipleCoils(at, ref new) => {
                    part(coils, at, new.len())?.copy_from_slice(new);
                    Response::WriteMultipleCoils(at, new.len() as u16)
                }
                Request::WriteMultipleRegisters(at, ref new) => {
                    part(words, at, new.len())?.copy_from_slice(new);
                    Response::WriteMultipleRegisters(at, new.len() as u16)
                }
                Request::MaskWriteRegister(at, and, or) => {
                    let word = &mut part(words, at, 1)?[0];
                    *word = *word & and | or & !and;
                    Response::MaskWriteRegister(at, and, or)
                }
                Request::ReadWriteMultipleRegisters(from, n, at, ref new) => {
                    part(words, from, n.into())?;
                    part(words, at, new.len())?.copy_from_slice(new);
                    let read = part(words, from, n.into())?.to_vec();
                    Response::ReadWriteMultipleRegisters(read)
                }
                _ => return Err(ExceptionCode::IllegalFunction),
            })
        };
        ready(serve())
    }
}
