//! The board that is a Linux process: the firmware's links on loopback, and a thread for its timed task.
//!
//! Not here: priorities, since the simulator runs in lockstep, see [`Board::simulate`]; hard real time, since a thread of an
//! ordinary process is late now and then, though no step is ever lost; addresses other than loopback.

mod access;
mod flash;
mod http;
mod serial;

use std::cell::RefCell;
use std::io;
use std::net::{Ipv4Addr, SocketAddr};
use std::sync::Arc;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use embassy_futures::block_on;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embedded_io_adapters::tokio_1::FromTokio;
use firmware::attendant::Attendant;
use firmware::hmi::desk::{self, AtDesk};
use firmware::hmi::keep;
use firmware::journal::Journal;
use firmware::link::control::{Access, Control, Peer, Protocol};
use firmware::link::modbus::tcp::{End, Timeouts, session};
use firmware::link::seats::Seats;
use firmware::link::{self, Service};
use firmware::lockstep::Lockstep;
use firmware::store::{Keeper, Store};
use model_core::image::{Commands, Feedback, Image};
use model_core::machine::Machine;
use serial::Port;
use tokio::net::TcpListener;
use tokio::sync::oneshot;
use tokio::task::LocalSet;

pub use access::{Rule, access};
pub use flash::Flash;
pub use http::{CONNECTIONS, Desk};
pub use serial::{Line, STATION};

/// Period of [`Board::start`]'s `step`: the drive cycle.
pub const STEP: Duration = Duration::from_millis(10);

/// Modbus clients at once.
pub const CLIENTS: usize = 8;

/// What this board tells about itself.
const BOARD: desk::Board = desk::Board {
    name: "a process on a PC",
    version: env!("CARGO_PKG_VERSION"),
    reset: "started",
    connections: CONNECTIONS as u16,
    memory: || None,
};

/// Before the next try, when a connection cannot be accepted for want of a file descriptor.
const ACCEPT_AGAIN: Duration = Duration::from_millis(10);

/// The process image, shared by the threads of this process.
pub type ImageCell = link::ImageCell<CriticalSectionRawMutex>;

/// Control of the winder, likewise.
pub type ControlCell = link::ControlCell<CriticalSectionRawMutex>;

/// What a board starts with.
#[derive(Clone, Debug)]
pub struct Options {
    /// Modbus port on loopback; 0 for any that is free.
    pub port: u16,
    /// The HMI's port on loopback; 0 for any that is free.
    pub http_port: u16,
    /// The serial line of Modbus RTU, if there is to be one.
    pub serial: Option<Line>,
    /// How long a client may keep a place without using it.
    pub timeouts: Timeouts,
    /// Which client may do what.
    pub access: Access,
    /// The image at power-up.
    pub image: Image,
    /// How many times real time the steps run; 1 is real time.
    pub pace: f64,
    /// Where the settings are kept, if they are. The machine that is found there goes before the image's.
    pub flash: Option<Flash>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            port: 0,
            http_port: 0,
            serial: None,
            timeouts: Timeouts::default(),
            access: Access::default(),
            image: Image {
                commands: Commands::of(&Machine::news_8000()),
                feedback: Feedback::default(),
            },
            pace: 1.0,
            flash: None,
        }
    }
}

/// A running board; it stops when dropped.
pub struct Board {
    /// Where Modbus TCP is served.
    pub address: SocketAddr,
    /// Where the HMI is served.
    pub http: SocketAddr,
    /// Where the other end of the serial line is.
    pub serial: Option<String>,
    /// What the clients see.
    pub image: Arc<ImageCell>,
    /// Who controls the winder, and who is connected.
    pub control: Arc<ControlCell>,
    running: Option<Running>,
}

/// The threads, and what tells each of them to end by being dropped.
struct Running {
    links: (oneshot::Sender<()>, JoinHandle<()>),
    steps: (mpsc::Sender<()>, JoinHandle<()>),
}

impl Board {
    /// Starts serving, and calls `step` every [`STEP`] with the image locked, so that a step is one event to the
    /// clients, which wait meanwhile.
    ///
    /// # Errors
    /// The port is taken, or the process may have no more sockets or threads.
    pub fn start(
        options: Options,
        mut step: impl FnMut(&mut Image) + Send + 'static,
    ) -> io::Result<Self> {
        let mut cycle = 0_u32;
        Self::run(options, None, move |image, mut at_desk| {
            at_desk.before(cycle, image);
            step(image);
            at_desk.after(cycle, image);
            cycle = cycle.wrapping_add(1);
        })
    }

    /// Starts serving, and simulates from power-up on, with a journal: the machine of the settings, or that of
    /// [`Options::default`].
    ///
    /// # Errors
    /// As of [`Board::start`].
    pub fn simulate(
        mut options: Options,
        journal: impl Journal + Send + 'static,
    ) -> io::Result<Self> {
        let kept = options.flash.take().and_then(Kept::open);
        let machine = match &kept {
            Some(kept) => kept.keeper.settings().machine.clone(),
            None => Machine::news_8000(),
        };
        if kept.is_some() {
            options.image.commands = Commands::of(&machine);
        }
        let mut lockstep = Lockstep::new(&machine, &options.image, journal)
            .map_err(|error| io::Error::other(error.to_string()))?;
        Self::run(options, kept, move |image, mut at_desk| {
            lockstep.attended_cycle(image, &mut at_desk);
        })
    }

    fn run(
        options: Options,
        kept: Option<Kept>,
        mut step: impl FnMut(&mut Image, AtDesk<'_, CriticalSectionRawMutex>) + Send + 'static,
    ) -> io::Result<Self> {
        let listen = |port| {
            let listener = std::net::TcpListener::bind((Ipv4Addr::LOCALHOST, port))?;
            listener.set_nonblocking(true)?;
            io::Result::Ok((listener.local_addr()?, listener))
        };
        let (address, listener) = listen(options.port)?;
        let (http, http_listener) = listen(options.http_port)?;
        let (keeper, store) = match kept {
            Some(kept) => (kept.keeper, Some(kept.store)),
            None => (Keeper::nowhere(&Machine::news_8000()), None),
        };
        // For good, as on every board: a process has few of them.
        let books = Box::leak(Box::default());
        let desk = Arc::new(Desk::new(BOARD, keeper, books));
        let image = Arc::new(ImageCell::new(RefCell::new(options.image)));
        let control = Control::new(options.access);
        let control = Arc::new(ControlCell::new(RefCell::new(control)));

        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()?;
        let (listener, http_listener, port) = {
            let _context = runtime.enter();
            (
                TcpListener::from_std(listener)?,
                TcpListener::from_std(http_listener)?,
                options.serial.as_ref().map(Port::open).transpose()?,
            )
        };
        let serial = port.as_ref().map(|port| port.path.clone());
        let server = Arc::new(Server {
            listener,
            image: image.clone(),
            control: control.clone(),
            seats: Seats::new(),
            timeouts: options.timeouts,
        });
        // One more than there are seats, for the client that displaces another.
        for _ in 0..=CLIENTS {
            runtime.spawn(server.clone().serve());
        }
        if let Some(port) = port {
            runtime.spawn(port.serve(server.clone()));
        }
        let (stop_links, stopped) = oneshot::channel();
        let links = thread::Builder::new().name("links".into()).spawn({
            let (server, desk) = (server, desk.clone());
            move || {
                let local = LocalSet::new();
                if let Some(mut store) = store {
                    let desk = desk.clone();
                    local.spawn_local(async move { keep(&mut store, &desk).await });
                }
                http::start(&local, http_listener, server, desk);
                // What was spawned ends with the runtime.
                let _ = local.block_on(&runtime, stopped);
            }
        })?;
        let (stop_steps, stopped) = mpsc::channel();
        let steps = thread::Builder::new().name("steps".into()).spawn({
            let image = image.clone();
            let control = control.clone();
            let step = move |image: &mut Image| {
                let (control, desk) = (&*control, &*desk);
                step(image, AtDesk { control, desk });
            };
            move || pace(&stopped, STEP.div_f64(options.pace), &image, step)
        })?;
        Ok(Self {
            address,
            http,
            serial,
            image,
            control,
            running: Some(Running {
                links: (stop_links, links),
                steps: (stop_steps, steps),
            }),
        })
    }

    /// Stops and waits for the threads: no step runs and no client is connected afterwards.
    pub fn stop(mut self) {
        self.end();
    }

    fn end(&mut self) {
        if let Some(Running { links, steps }) = self.running.take() {
            drop((links.0, steps.0));
            // A thread that panicked has said so already.
            let _ = links.1.join();
            let _ = steps.1.join();
        }
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        self.end();
    }
}

/// The settings, and where they are kept.
struct Kept {
    keeper: Keeper,
    store: Store<Flash>,
}

impl Kept {
    /// As at power-up.
    fn open(flash: Flash) -> Option<Self> {
        let end = flash.size();
        let mut store = Store::new(flash, 0..end)?;
        let mut keeper = Keeper::of(block_on(store.load()));
        keeper.note = Some(
            "a process on a PC is on loopback and has no serial line: only the machine counts",
        );
        Some(Self { keeper, store })
    }
}

/// Steps at whole multiples of the period after the start. A late step is made up for, in its turn, and so the
/// count of steps never drifts from the clock.
fn pace(
    stopped: &mpsc::Receiver<()>,
    period: Duration,
    image: &ImageCell,
    mut step: impl FnMut(&mut Image),
) {
    let mut due = Instant::now() + period;
    let wait = |due: Instant| stopped.recv_timeout(due.saturating_duration_since(Instant::now()));
    while wait(due) == Err(RecvTimeoutError::Timeout) {
        image.lock(|image| step(&mut image.borrow_mut()));
        due += period;
    }
}

struct Server {
    listener: TcpListener,
    image: Arc<ImageCell>,
    control: Arc<ControlCell>,
    seats: Seats<CriticalSectionRawMutex, CLIENTS>,
    timeouts: Timeouts,
}

impl Server {
    fn service(&self) -> Service<'_, CriticalSectionRawMutex> {
        Service {
            image: &self.image,
            control: &self.control,
        }
    }

    /// A client, where it may come in.
    fn enter(&self, from: SocketAddr) -> Option<link::Client<'_, CriticalSectionRawMutex>> {
        let SocketAddr::V4(from) = from else {
            return None;
        };
        self.service()
            .enter(Peer::Ip(*from.ip()), Protocol::ModbusTcp)
    }

    /// One client after the other. As on the other boards this is a task of its own for good, not for one client:
    /// the queue of timers has a place for each task, and keeps that of one that is gone until it expires.
    async fn serve(self: Arc<Self>) {
        loop {
            let Ok((stream, from)) = self.listener.accept().await else {
                tokio::time::sleep(ACCEPT_AGAIN).await;
                continue;
            };
            let Some(client) = self.enter(from) else {
                continue;
            };
            let seat = self.seats.take();
            // Without it a reply may wait for the client's delayed acknowledgement.
            let _ = stream.set_nodelay(true);
            let mut stream = FromTokio::new(stream);
            let session = session(&mut stream, &client, &self.timeouts, || seat.answered());
            if seat.hold(session).await == Some(End::NotReading) {
                // Not to be kept by the system either, with replies that nobody will fetch.
                let _ = stream.inner().set_zero_linger();
            }
        }
    }
}
