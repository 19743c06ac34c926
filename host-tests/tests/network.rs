//! The board in QEMU on a cable of its own, a TAP in a network namespace: conformance with no network of QEMU's between,
//! and storms. Not here: storms in virtual time, where every frame is at its instant; `cargo winder timing` has them.
//!
//! Where no namespace is permitted, these tests say so: there is no storm then, and conformance goes through QEMU's user
//! network.

use std::net::{SocketAddr, TcpStream};
use std::os::fd::AsRawFd;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use board_host::STATION;
use etherparse::err::packet::BuildWriteError;
use etherparse::{
    ArpHardwareId, ArpOperation, ArpPacket, EtherType, IpFragOffset, IpHeaders, IpNumber,
    Ipv4Extensions, Ipv4Header, PacketBuilder, PacketBuilderStep,
};
use host_tests::conformance::{self, Map, Outcome, Server, serial};
use host_tests::link::Link;
use host_tests::log::Log;
use host_tests::namespace::{self, GUEST, Side, TAP};
use host_tests::setup;
use host_tests::simulator::{Board, Network, Options, Simulator};
use model_core::image::{self, Feedback};
use model_core::logic::Fault;
use nix::ifaddrs::getifaddrs;
use nix::sys::socket::{AddressFamily, MsgFlags, SockFlag, SockType, bind, send, socket};

/// Where a test finds itself.
enum Place {
    /// With the board on its cable.
    Cable(Simulator, Log),
    /// Outside; the test has passed inside.
    Done,
    /// Where no cable is permitted.
    Nowhere,
}

fn on_a_cable(test: &str) -> Place {
    // before the namespace, which has no network to fetch anything from
    setup::mps2().expect("QEMU and the firmware");
    let arguments = ["--exact", test, "--nocapture"].map(str::to_owned);
    match namespace::enter(&arguments) {
        Ok(Side::Inside) => {
            let log = Log::default();
            let options = Options {
                network: Network::Tap,
                log: log.clone(),
                ..Options::default()
            };
            let simulator = Simulator::start(Board::Mps2, options).expect("QEMU starts");
            Place::Cable(simulator, log)
        }
        Ok(Side::Outside(status)) => {
            assert!(status.success(), "inside the namespace: {status}");
            Place::Done
        }
        Err(error) => {
            eprintln!("{test}: no cable: {error:#}");
            Place::Nowhere
        }
    }
}

/// What QEMU's user network decides, not the board: it takes a client's connection before it has asked the guest, and
/// asks a second time no sooner than a second later.
const OF_THE_USER_NETWORK: [&str; 2] = ["half a header blocks nobody", "a reconnect storm"];

/// The same cases as the native board's.
#[test]
fn the_board_in_qemu_passes_every_conformance_case() {
    let (simulator, log, excused) =
        match on_a_cable("the_board_in_qemu_passes_every_conformance_case") {
            Place::Cable(simulator, log) => (simulator, log, &[][..]),
            Place::Done => return,
            Place::Nowhere => {
                let options = Options::default();
                let log = options.log.clone();
                let simulator = Simulator::start(Board::Mps2, options).expect("QEMU starts");
                (simulator, log, &OF_THE_USER_NETWORK[..])
            }
        };
    let server = Server {
        address: simulator.address(),
        map: Map::default(),
    };
    let mut outcomes = conformance::run(server, |_| ());
    let line = simulator.serial().expect("a pseudoterminal");
    serial::run(&line, 19_200, STATION, &server.map, |o| outcomes.push(o)).unwrap();
    let passed = |o: &Outcome| o.failed.is_none() || excused.contains(&o.id);
    let table = conformance::table(&outcomes);
    assert!(outcomes.iter().all(passed), "\n{table}{}", log.last(20));
}

/// The guest's hardware address.
const GUEST_MAC: [u8; 6] = [0x02, 0, 0, 0, 0x05, 0];
/// Modbus TCP.
const MODBUS: u16 = 502;
/// A port that nobody serves.
const CLOSED: u16 = 9;

/// Frames of a burst, …
const BURST: u32 = 30;
/// … one a millisecond: some 15 Mbit/s of the shortest frames, and more than the guest has time for.
const BURSTS: u32 = 1000;
/// Without a flood the guest answers in a millisecond; a second after one it must, and on a busy PC a little later.
const BACK: Duration = Duration::from_secs(3);

/// A flood: its name, and its frame of a number.
type Flood = (&'static str, fn(u32) -> Vec<u8>);

const FLOODS: [Flood; 9] = [
    ("ARP, who has another", |n| arp(n, [10, 0, 2, 99])),
    ("ARP, who has the guest", |n| arp(n, GUEST.octets())),
    ("ICMP echo", |n| echo(n, &[0; 18])),
    ("ICMP echo, long", |n| echo(n, &[0; 1400])),
    ("UDP to a closed port", |n| datagram(n, CLOSED)),
    ("UDP to Modbus's port", |n| datagram(n, MODBUS)),
    ("SYN to a closed port", |n| syn(n, CLOSED)),
    ("SYN to Modbus's port", |n| syn(n, MODBUS)),
    ("fragments", fragment),
];

/// Somebody of the guest's own network, another for each number.
fn somebody(n: u32) -> [u8; 4] {
    [10, 0, 2, 16 + (n % 200) as u8]
}

fn mac(n: u32) -> [u8; 6] {
    let [a, b, c, d] = n.to_be_bytes();
    [0x02, 1, a, b, c, d]
}

fn port(n: u32) -> u16 {
    1024 + (n % 60_000) as u16
}

/// A packet to the guest, to be gone on with.
fn packet(n: u32) -> PacketBuilderStep<IpHeaders> {
    PacketBuilder::ethernet2(mac(n), GUEST_MAC).ipv4(somebody(n), GUEST.octets(), 64)
}

/// What has been written to it.
fn frame(write: impl FnOnce(&mut Vec<u8>) -> Result<(), BuildWriteError>) -> Vec<u8> {
    let mut frame = Vec::new();
    write(&mut frame).expect("a vector takes all");
    frame
}

fn arp(n: u32, whose: [u8; 4]) -> Vec<u8> {
    let request = ArpPacket::new(
        ArpHardwareId::ETHERNET,
        EtherType::IPV4,
        ArpOperation::REQUEST,
        &mac(n),
        &somebody(n),
        &[0; 6],
        &whose,
    );
    let request = request.expect("as long as ARP's fields are");
    let all = PacketBuilder::ethernet2(mac(n), [0xff; 6]);
    frame(|to| all.arp(request).write(to))
}

fn echo(n: u32, data: &[u8]) -> Vec<u8> {
    frame(|to| packet(n).icmpv4_echo_request(1, n as u16).write(to, data))
}

fn datagram(n: u32, to_port: u16) -> Vec<u8> {
    frame(|to| packet(n).udp(port(n), to_port).write(to, &[0; 18]))
}

fn syn(n: u32, to_port: u16) -> Vec<u8> {
    frame(|to| {
        packet(n)
            .tcp(port(n), to_port, n, 1024)
            .syn()
            .write(to, &[])
    })
}

/// The first or a later piece of a datagram, the rest of which never comes.
fn fragment(n: u32) -> Vec<u8> {
    let mut header =
        Ipv4Header::new(24, 64, IpNumber::UDP, somebody(n), GUEST.octets()).expect("short enough");
    header.identification = (n / 2) as u16;
    header.more_fragments = true;
    header.fragment_offset = IpFragOffset::try_new((n % 2 * 64) as u16).expect("within");
    let ip = IpHeaders::Ipv4(header, Ipv4Extensions::default());
    let all = PacketBuilder::ethernet2(mac(n), GUEST_MAC).ip(ip);
    frame(|to| all.udp(port(n), MODBUS).write(to, &[0; 16]))
}

/// Sends a flood of [`BURSTS`] to the guest.
fn send_flood(make: fn(u32) -> Vec<u8>) {
    let raw = socket(
        AddressFamily::Packet,
        SockType::Raw,
        SockFlag::empty(),
        None,
    );
    let raw = raw.expect("a socket for frames");
    let mut interfaces = getifaddrs().expect("interfaces");
    let tap = interfaces.find_map(|i| {
        let address = i.address.filter(|_| i.interface_name == TAP)?;
        address.as_link_addr().copied()
    });
    bind(raw.as_raw_fd(), &tap.expect("the TAP")).expect("bound");
    let began = Instant::now();
    for burst in 0..BURSTS {
        for i in 0..BURST {
            // a frame that the TAP has no room for is lost, as on a cable
            let _ = send(
                raw.as_raw_fd(),
                &make(burst * BURST + i),
                MsgFlags::MSG_DONTWAIT,
            );
        }
        let next = began + Duration::from_millis(1) * (burst + 1);
        thread::sleep(next.saturating_duration_since(Instant::now()));
    }
}

/// A PLC that polls until it is told to end, and connects again when it must.
fn poll(address: SocketAddr, end: &AtomicBool, answers: &AtomicU32) {
    let mut link = None;
    while !end.load(Ordering::Relaxed) {
        link = link.or_else(|| Link::connect(address).ok());
        match link.as_mut().map(Link::read) {
            Some(Ok(_)) => {
                answers.fetch_add(1, Ordering::Relaxed);
            }
            _ => link = None,
        }
        thread::sleep(Duration::from_millis(20));
    }
}

/// Tells it, however the test ends.
struct Told<'a>(&'a AtomicBool);

impl Drop for Told<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// A new client's first answer, and how long it took. It tries again at once, and does not wait for the kernel to send
/// a lost segment a second time.
fn first_answer(address: SocketAddr) -> Option<(Feedback, Duration)> {
    const TRY: Duration = Duration::from_millis(100);
    let began = Instant::now();
    while began.elapsed() < BACK {
        let seen = TcpStream::connect_timeout(&address, TRY)
            .is_ok()
            .then(|| Link::connect(address).and_then(|mut link| link.read()));
        if let Some(Ok(seen)) = seen {
            return Some((seen, began.elapsed()));
        }
        thread::sleep(TRY / 10);
    }
    None
}

#[test]
fn no_flood_makes_a_task_late_or_the_board_restart_and_service_is_back_at_once() {
    let name = "no_flood_makes_a_task_late_or_the_board_restart_and_service_is_back_at_once";
    let Place::Cable(simulator, log) = on_a_cable(name) else {
        return;
    };
    let address = simulator.address();
    let (end, answers) = (AtomicBool::new(false), AtomicU32::new(0));
    let mut ticks = 0;
    thread::scope(|scope| {
        scope.spawn(|| poll(address, &end, &answers));
        let _told = Told(&end);
        for (flood, make) in FLOODS {
            let before = answers.load(Ordering::Relaxed);
            send_flood(make);
            let during = answers.load(Ordering::Relaxed) - before;
            let back = first_answer(address);
            let (seen, took) = back.unwrap_or_else(|| {
                panic!(
                    "{flood}: no service after {} s\n{}",
                    BACK.as_secs(),
                    log.last(20)
                )
            });
            eprintln!(
                "{flood}: {during} polls answered meanwhile, back after {} ms",
                took.as_millis()
            );
            for overruns in [
                &image::PLANT_OVERRUNS,
                &image::DRIVE_OVERRUNS,
                &image::LOGIC_OVERRUNS,
            ] {
                assert_eq!(seen.word(overruns), 0, "{flood}: {}", overruns.name);
            }
            assert_eq!(seen.word(&image::RESTARTS), 0, "{flood}");
            let fault = seen.word(&image::FAULT);
            assert_eq!(fault, Fault::None as u16, "{flood}");
            let heard = answers.load(Ordering::Relaxed);
            let began = Instant::now();
            while answers.load(Ordering::Relaxed) == heard {
                assert!(began.elapsed() < BACK, "{flood}: the PLC is not answered");
                thread::sleep(Duration::from_millis(10));
            }
            let now = seen.double(&image::PLANT_TICKS);
            assert!(
                now > ticks,
                "{flood}: the plant went back from {ticks} to {now}"
            );
            ticks = now;
        }
    });
}
