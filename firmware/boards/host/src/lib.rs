//! The board that is a Linux process: the firmware's links on loopback, and a thread for its timed task.
//!
//! Not here: priorities, since the simulator runs in lockstep, see [`simulator`]; hard real time, since a thread of an
//! ordinary process is late now and then, though no step is ever lost; addresses other than loopback.

use std::cell::RefCell;
use std::io;
use std::net::{Ipv4Addr, SocketAddr};
use std::sync::Arc;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embedded_io_adapters::tokio_1::FromTokio;
use firmware::journal::Journal;
use firmware::link::control::{Access, Control, Peer, Protocol};
use firmware::link::modbus::tcp::{End, Timeouts, session};
use firmware::link::seats::Seats;
use firmware::link::{self, Service};
use firmware::lockstep::Lockstep;
use model_core::image::{Commands, Feedback, Image};
use model_core::machine::Machine;
use tokio::net::TcpListener;
use tokio::sync::oneshot;

/// Period of [`Board::start`]'s `step`: the drive cycle.
pub const STEP: Duration = Duration::from_millis(10);

/// Modbus clients at once.
pub const CLIENTS: usize = 8;

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
    /// How long a client may keep a place without using it.
    pub timeouts: Timeouts,
    /// Which client may do what.
    pub access: Access,
    /// The image at power-up.
    pub image: Image,
    /// How many times real time the steps run; 1 is real time.
    pub pace: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            port: 0,
            timeouts: Timeouts::default(),
            access: Access::default(),
            image: Image {
                commands: Commands::of(&Machine::news_8000()),
                feedback: Feedback::default(),
            },
            pace: 1.0,
        }
    }
}

/// A running board; it stops when dropped.
pub struct Board {
    /// Where Modbus TCP is served.
    pub address: SocketAddr,
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
        step: impl FnMut(&mut Image) + Send + 'static,
    ) -> io::Result<Self> {
        let listener = std::net::TcpListener::bind((Ipv4Addr::LOCALHOST, options.port))?;
        listener.set_nonblocking(true)?;
        let address = listener.local_addr()?;
        let image = Arc::new(ImageCell::new(RefCell::new(options.image)));
        let control = Control::new(options.access);
        let control = Arc::new(ControlCell::new(RefCell::new(control)));

        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()?;
        let listener = {
            let _context = runtime.enter();
            TcpListener::from_std(listener)?
        };
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
        let (stop_links, stopped) = oneshot::channel();
        let links = thread::Builder::new().name("links".into()).spawn(move || {
            // What was spawned ends with the runtime.
            let _ = runtime.block_on(stopped);
        })?;
        let (stop_steps, stopped) = mpsc::channel();
        let steps = thread::Builder::new().name("steps".into()).spawn({
            let image = image.clone();
            move || pace(&stopped, STEP.div_f64(options.pace), &image, step)
        })?;
        Ok(Self {
            address,
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

/// The step that simulates the machine of [`Options::default`] at power-up, and keeps a journal.
pub fn simulator(journal: impl Journal + Send + 'static) -> impl FnMut(&mut Image) + Send {
    let mut lockstep = Lockstep::new(&Machine::news_8000(), &Options::default().image, journal)
        .expect("a preset is valid");
    move |image| lockstep.cycle(image)
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
    /// A client, where it may come in.
    fn enter(&self, from: SocketAddr) -> Option<link::Client<'_, CriticalSectionRawMutex>> {
        let SocketAddr::V4(from) = from else {
            return None;
        };
        let service = Service {
            image: &self.image,
            control: &self.control,
        };
        service.enter(Peer::Ip(*from.ip()), Protocol::ModbusTcp)
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
