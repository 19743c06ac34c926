//! Who may write, who controls the winder, and who has been here: of every link, whatever it speaks.
//!
//! Not here: what travels, and what a command does. A link asks before it writes and tells what it has written; the
//! operator panel does the same.
//!
//! | Word of the commands | who may write it |
//! |---|---|
//! | of the winder | one PLC at a time, or the panel |
//! | of the simulator: faults and the like | everybody who may write at all |
//!
//! The first PLC that writes a word of the winder controls it, until it has not written for [`Control::HOLD`]. A
//! PLC is an address: its connections may be several, and may come and go. It takes precedence over the panel, which
//! gets the winder only while no PLC has it.

use core::net::Ipv4Addr;
use core::ops::Range;

use embassy_time::{Duration, Instant};
use heapless::Vec;
use model_core::image::{self, COMMAND_WORDS, Direction, Feedback, SIGNALS, Section, Signal};
use model_core::link_words::link_status;

/// What a client may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Right {
    /// Nothing: it is not even answered.
    None,
    /// Read.
    Read,
    /// Read and write.
    ReadWrite,
}

/// Where a client is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Peer {
    /// At an address of the network.
    Ip(Ipv4Addr),
    /// At the other end of the serial line.
    Serial,
}

/// What a client speaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Protocol {
    /// Modbus TCP.
    ModbusTcp,
    /// Modbus RTU.
    ModbusRtu,
}

impl Protocol {
    /// For people.
    pub const fn name(self) -> &'static str {
        match self {
            Self::ModbusTcp => "Modbus TCP",
            Self::ModbusRtu => "Modbus RTU",
        }
    }
}

/// The access table: rights by address.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Access {
    entries: Vec<(Ipv4Addr, Right), { Self::ENTRIES }>,
    /// Of every address that is not in the table.
    pub others: Right,
    /// Of the serial line, which is a wire to one machine.
    pub serial: Right,
}

impl Default for Access {
    /// Everybody may do everything.
    fn default() -> Self {
        Self {
            entries: Vec::new(),
            others: Right::ReadWrite,
            serial: Right::ReadWrite,
        }
    }
}

impl Access {
    /// Places in the table.
    pub const ENTRIES: usize = 10;

    /// Gives an address its right; false when it is a new one and the table is full.
    pub fn set(&mut self, address: Ipv4Addr, right: Right) -> bool {
        match self.entries.iter_mut().find(|(a, _)| *a == address) {
            Some(entry) => {
                entry.1 = right;
                true
            }
            None => self.entries.push((address, right)).is_ok(),
        }
    }

    /// Takes an address out of the table.
    pub fn remove(&mut self, address: Ipv4Addr) {
        self.entries.retain(|(a, _)| *a != address);
    }

    /// The table.
    pub fn entries(&self) -> &[(Ipv4Addr, Right)] {
        &self.entries
    }

    /// What a client may do.
    pub fn of(&self, peer: Peer) -> Right {
        match peer {
            Peer::Serial => self.serial,
            Peer::Ip(address) => {
                let entry = self.entries.iter().find(|(a, _)| *a == address);
                entry.map_or(self.others, |(_, right)| *right)
            }
        }
    }
}

/// Who commands the winder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Controller {
    /// Nobody does, or has not for long.
    Nobody,
    /// A winder PLC.
    Plc(Peer),
    /// The operator panel.
    Panel,
}

/// Why a write is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Denied {
    /// This client may only read.
    ReadOnly,
    /// Somebody else controls the winder.
    Occupied(Controller),
}

/// A client's ticket.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClientId {
    place: usize,
    arrival: u32,
}

/// The upper ends of the classes of poll intervals, ms; one more class is for what is longer.
pub const POLL_EDGES_MS: [u64; 7] = [5, 10, 20, 50, 100, 200, 500];
/// How many polls came in which interval.
pub type Polls = [u32; POLL_EDGES_MS.len() + 1];

/// Their signals.
const POLL_SIGNALS: [&Signal; POLL_EDGES_MS.len() + 1] = [
    &image::POLLS_5_MS,
    &image::POLLS_10_MS,
    &image::POLLS_20_MS,
    &image::POLLS_50_MS,
    &image::POLLS_100_MS,
    &image::POLLS_200_MS,
    &image::POLLS_500_MS,
    &image::POLLS_LONGER,
];

/// One client, as long as it is connected.
#[derive(Clone, Copy, Debug)]
pub struct Client {
    /// Where it is.
    pub peer: Peer,
    /// What it speaks.
    pub protocol: Protocol,
    /// When it came.
    pub since: Instant,
    /// When it last asked, or came.
    pub asked: Instant,
    /// What it has asked; wraps.
    pub requests: u32,
    /// What of it was refused with an exception; wraps.
    pub exceptions: u32,
    /// The intervals of its polls; each wraps.
    pub polls: Polls,
    arrival: u32,
    /// The request by which its polls are told apart, and when it last came: a PLC that reads three blocks and
    /// writes one polls once and not four times.
    mark: Option<(u32, Instant)>,
}

/// When a mark has not come again for this long, the client asks for other things now.
const MARK_LOST: Duration = Duration::from_secs(10);

impl Client {
    /// The class of the interval that the request ends, if it ends one.
    fn poll(&mut self, key: u32, now: Instant) -> Option<usize> {
        let class = match self.mark {
            Some((mark, at)) if mark == key => {
                let ms = (now - at).as_millis();
                let class = POLL_EDGES_MS.iter().position(|edge| ms <= *edge);
                Some(class.unwrap_or(POLL_EDGES_MS.len()))
            }
            Some((_, at)) if now - at <= MARK_LOST => return None,
            _ => None,
        };
        self.mark = Some((key, now));
        class
    }
}

/// Which words are the winder's, and not the simulator's.
const OF_WINDER: [bool; COMMAND_WORDS] = {
    let (mut words, mut i) = ([false; COMMAND_WORDS], 0);
    while i < SIGNALS.len() {
        let s = &SIGNALS[i];
        if matches!(s.direction, Direction::Command) && !matches!(s.section, Section::Simulator) {
            words[s.word as usize] = true;
        }
        i += 1;
    }
    words
};

/// A bit for each word of the commands.
pub type WordSet = u64;
const _: () = assert!(COMMAND_WORDS <= WordSet::BITS as usize);

/// The bits of some words.
fn set_of(words: &Range<usize>) -> WordSet {
    words.clone().fold(0, |set, word| set | 1 << word)
}

/// Who wrote a word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Writer {
    /// A client of a link.
    Client(Peer),
    /// The operator panel.
    Panel,
}

/// Control of the winder, and the visitors' book.
#[derive(Clone, Debug)]
pub struct Control {
    /// Who may do what.
    pub access: Access,
    controller: Controller,
    /// When the winder's words were last written.
    wrote: Option<Instant>,
    writers: [Option<(Writer, Instant)>; COMMAND_WORDS],
    limited: WordSet,
    refused: bool,
    clients: [Option<Client>; Self::CLIENTS],
    arrivals: u32,
    requests: u32,
    exceptions: u32,
    polls: Polls,
    line_errors: u16,
}

impl Default for Control {
    fn default() -> Self {
        Self::new(Access::default())
    }
}

impl Control {
    /// Clients at once, of all links together: eight of Modbus TCP, three that are just coming, the serial line.
    pub const CLIENTS: usize = 12;
    /// A PLC that has not written for this long no longer controls the winder. Longer than it takes to reconnect.
    pub const HOLD: Duration = Duration::from_secs(5);

    /// Nobody controls, nobody is there.
    pub const fn new(access: Access) -> Self {
        Self {
            access,
            controller: Controller::Nobody,
            wrote: None,
            writers: [None; COMMAND_WORDS],
            limited: 0,
            refused: false,
            clients: [None; Self::CLIENTS],
            arrivals: 0,
            requests: 0,
            exceptions: 0,
            polls: [0; POLL_EDGES_MS.len() + 1],
            line_errors: 0,
        }
    }

    /// Who controls the winder.
    pub fn controller(&self, now: Instant) -> Controller {
        match self.controller {
            Controller::Plc(_) if !self.holds(now) => Controller::Nobody,
            controller => controller,
        }
    }

    fn holds(&self, now: Instant) -> bool {
        self.wrote.is_some_and(|at| now < at + Self::HOLD)
    }

    /// Time since the winder's words were last written.
    pub fn write_age(&self, now: Instant) -> Option<Duration> {
        self.wrote.map(|at| now - at)
    }

    /// The operator panel takes the winder.
    ///
    /// # Errors
    /// A PLC has it.
    pub fn take_by_panel(&mut self, now: Instant) -> Result<(), Denied> {
        match self.controller(now) {
            plc @ Controller::Plc(_) => Err(Denied::Occupied(plc)),
            Controller::Nobody | Controller::Panel => {
                self.controller = Controller::Panel;
                Ok(())
            }
        }
    }

    /// The operator panel gives the winder back, if it has it.
    pub fn release_by_panel(&mut self) {
        if self.controller == Controller::Panel {
            self.controller = Controller::Nobody;
        }
    }

    /// The panel may write these words now.
    ///
    /// # Errors
    /// Some are the winder's, and the panel does not have it.
    pub fn may_panel_write(&self, words: &Range<usize>, now: Instant) -> Result<(), Denied> {
        match self.controller(now) {
            Controller::Panel => Ok(()),
            _ if !of_winder(words) => Ok(()),
            other => Err(Denied::Occupied(other)),
        }
    }

    /// The panel has written.
    pub fn panel_wrote(&mut self, words: Range<usize>, now: Instant) {
        if of_winder(&words) {
            self.wrote = Some(now);
        }
        self.limited &= !set_of(&words);
        self.sign(words, Writer::Panel, now);
    }

    /// A client may write these words now.
    ///
    /// # Errors
    /// It may only read, or some are the winder's and another PLC has it.
    pub fn may_write(
        &mut self,
        id: ClientId,
        words: &Range<usize>,
        now: Instant,
    ) -> Result<(), Denied> {
        let may = self
            .peer(id)
            .map_or(Err(Denied::ReadOnly), |peer| match self.controller(now) {
                _ if self.access.of(peer) != Right::ReadWrite => Err(Denied::ReadOnly),
                other @ Controller::Plc(plc) if plc != peer && of_winder(words) => {
                    Err(Denied::Occupied(other))
                }
                _ => Ok(()),
            });
        self.refused = may.is_err();
        may
    }

    /// A client has written, some words outside their signals' limits.
    pub fn wrote(&mut self, id: ClientId, words: Range<usize>, outside: WordSet, now: Instant) {
        let Some(peer) = self.peer(id) else { return };
        if of_winder(&words) {
            self.controller = Controller::Plc(peer);
            self.wrote = Some(now);
        }
        self.limited = self.limited & !set_of(&words) | outside;
        self.sign(words, Writer::Client(peer), now);
    }

    fn sign(&mut self, words: Range<usize>, writer: Writer, now: Instant) {
        for last in self.writers.iter_mut().take(words.end).skip(words.start) {
            *last = Some((writer, now));
        }
    }

    /// Who wrote a word of the commands last, and when.
    pub fn last_writer(&self, word: usize) -> Option<(Writer, Instant)> {
        self.writers.get(word).copied().flatten()
    }

    /// The words of the commands that were written outside their limits.
    pub fn limited(&self) -> WordSet {
        self.limited
    }

    /// A client comes. `None`: it may not, or there are too many.
    pub fn enter(&mut self, peer: Peer, protocol: Protocol, now: Instant) -> Option<ClientId> {
        if self.access.of(peer) == Right::None {
            return None;
        }
        let (place, free) = (0..).zip(&mut self.clients).find(|(_, c)| c.is_none())?;
        self.arrivals = self.arrivals.wrapping_add(1);
        *free = Some(Client {
            peer,
            protocol,
            since: now,
            asked: now,
            requests: 0,
            exceptions: 0,
            polls: Polls::default(),
            arrival: self.arrivals,
            mark: None,
        });
        Some(ClientId {
            place,
            arrival: self.arrivals,
        })
    }

    /// A client goes.
    pub fn leave(&mut self, id: ClientId) {
        if self.client(id).is_some() {
            self.clients[id.place] = None;
        }
    }

    /// A client asks for something; equal keys are equal questions.
    pub fn asks(&mut self, id: ClientId, key: u32, now: Instant) {
        self.requests = self.requests.wrapping_add(1);
        let Some(client) = self.client(id) else {
            return;
        };
        client.requests = client.requests.wrapping_add(1);
        client.asked = now;
        if let Some(class) = client.poll(key, now) {
            client.polls[class] = client.polls[class].wrapping_add(1);
            self.polls[class] = self.polls[class].wrapping_add(1);
        }
    }

    /// What it asked for was refused with an exception.
    pub fn is_refused(&mut self, id: ClientId) {
        self.exceptions = self.exceptions.wrapping_add(1);
        if let Some(client) = self.client(id) {
            client.exceptions = client.exceptions.wrapping_add(1);
        }
    }

    /// A frame of the serial line was not whole.
    pub fn line_error(&mut self) {
        self.line_errors = self.line_errors.saturating_add(1);
    }

    /// Who is connected.
    pub fn clients(&self) -> impl Iterator<Item = &Client> {
        self.clients.iter().flatten()
    }

    fn client(&mut self, id: ClientId) -> Option<&mut Client> {
        let client = self.clients.get_mut(id.place)?.as_mut()?;
        (client.arrival == id.arrival).then_some(client)
    }

    fn peer(&self, id: ClientId) -> Option<Peer> {
        let client = self.clients.get(id.place)?.as_ref()?;
        (client.arrival == id.arrival).then_some(client.peer)
    }

    /// Fills the link's own words of the feedback.
    pub fn report(&self, now: Instant, feedback: &mut Feedback) {
        let controller = self.controller(now);
        let status = [
            (self.limited != 0, link_status::LIMITED),
            (
                matches!(controller, Controller::Plc(_)),
                link_status::PLC_CONTROLS,
            ),
            (controller == Controller::Panel, link_status::PANEL_CONTROLS),
            (self.refused, link_status::WRITE_REFUSED),
        ]
        .into_iter()
        .filter_map(|(on, bit)| on.then_some(bit))
        .sum();
        let register = match self.limited {
            0 => 0,
            set => set.trailing_zeros() as u16 + 1,
        };
        let age = self.write_age(now).map(|age| age.as_millis());
        let age = age.and_then(|ms| u16::try_from(ms).ok());
        for (signal, value) in [
            (&image::LINK_STATUS, status),
            (&image::LIMITED_REGISTER, register),
            (&image::LINK_CLIENTS, self.clients().count() as u16),
            (&image::LINK_WRITE_AGE, age.unwrap_or(u16::MAX)),
            (&image::LINE_ERRORS, self.line_errors),
        ] {
            feedback.set_word(signal, value);
        }
        feedback.set_double(&image::LINK_REQUESTS, self.requests);
        feedback.set_double(&image::LINK_EXCEPTIONS, self.exceptions);
        for (signal, count) in POLL_SIGNALS.iter().zip(self.polls) {
            feedback.set_double(signal, count);
        }
    }
}

/// Some of the words are the winder's.
fn of_winder(words: &Range<usize>) -> bool {
    words.clone().any(|word| OF_WINDER.get(word) == Some(&true))
}

#[cfg(test)]
mod tests {
    use super::*;

    const A: Peer = Peer::Ip(Ipv4Addr::new(10, 0, 0, 1));
    const B: Peer = Peer::Ip(Ipv4Addr::new(10, 0, 0, 2));
    const START: Instant = Instant::from_secs(100);
    const PLC_WORDS: Range<usize> = 0..image::PLC_COMMAND_WORDS;
    const TEST_WORDS: Range<usize> =
        image::FAULT_MACHINE.word as usize..image::BUS_DELAY.word as usize + 1;

    fn enter(control: &mut Control, peer: Peer) -> ClientId {
        control
            .enter(peer, Protocol::ModbusTcp, START)
            .expect("a place")
    }

    /// Writes, where it may.
    fn write(
        c: &mut Control,
        id: ClientId,
        words: Range<usize>,
        now: Instant,
    ) -> Result<(), Denied> {
        c.may_write(id, &words, now)?;
        c.wrote(id, words, 0, now);
        Ok(())
    }

    #[test]
    fn the_first_plc_that_writes_controls_and_the_others_read_until_it_is_silent() {
        let mut c = Control::default();
        let (a, again, b) = (enter(&mut c, A), enter(&mut c, A), enter(&mut c, B));
        assert_eq!(c.controller(START), Controller::Nobody);
        assert_eq!(write(&mut c, a, PLC_WORDS, START), Ok(()));
        let occupied = Err(Denied::Occupied(Controller::Plc(A)));
        assert_eq!(write(&mut c, b, PLC_WORDS, START), occupied);
        // another connection of the same PLC
        assert_eq!(write(&mut c, again, 3..4, START), Ok(()));
        // a reconnect does not lose it
        c.leave(a);
        c.leave(again);
        let last = START + Control::HOLD - Duration::from_ticks(1);
        assert_eq!(write(&mut c, b, 31..32, last), occupied);
        assert_eq!(write(&mut c, b, 31..32, START + Control::HOLD), Ok(()));
        assert_eq!(c.controller(START + Control::HOLD), Controller::Plc(B));
    }

    #[test]
    fn faults_may_be_put_in_beside_the_plc_and_are_no_control() {
        let mut c = Control::default();
        let (a, b) = (enter(&mut c, A), enter(&mut c, B));
        assert_eq!(write(&mut c, b, TEST_WORDS, START), Ok(()));
        assert_eq!(c.controller(START), Controller::Nobody);
        assert_eq!(write(&mut c, a, PLC_WORDS, START), Ok(()));
        assert_eq!(write(&mut c, b, TEST_WORDS, START), Ok(()));
        let both = PLC_WORDS.start..TEST_WORDS.end;
        assert!(write(&mut c, b, both, START).is_err());
        assert_eq!(c.controller(START), Controller::Plc(A));
        assert_eq!(c.last_writer(20), Some((Writer::Client(B), START)));
    }

    #[test]
    fn a_plc_takes_precedence_over_the_panel() {
        let mut c = Control::default();
        let a = enter(&mut c, A);
        assert_eq!(c.take_by_panel(START), Ok(()));
        assert_eq!(c.may_panel_write(&PLC_WORDS, START), Ok(()));
        c.panel_wrote(PLC_WORDS, START);
        // the panel keeps it without writing
        let later = START + Control::HOLD * 2;
        assert_eq!(c.controller(later), Controller::Panel);
        assert_eq!(write(&mut c, a, PLC_WORDS, later), Ok(()));
        assert!(c.may_panel_write(&PLC_WORDS, later).is_err());
        assert_eq!(c.may_panel_write(&TEST_WORDS, later), Ok(()));
        assert!(c.take_by_panel(later).is_err());
        c.release_by_panel();
        assert_eq!(c.controller(later), Controller::Plc(A));
        assert_eq!(c.take_by_panel(later + Control::HOLD), Ok(()));
        c.release_by_panel();
        assert_eq!(c.controller(later), Controller::Nobody);
    }

    #[test]
    fn the_access_table_tells_who_may_what() {
        let mut access = Access {
            others: Right::Read,
            ..Access::default()
        };
        let address = |i| Ipv4Addr::new(10, 0, 0, i);
        assert!((1..=10).all(|i| access.set(address(i), Right::ReadWrite)));
        assert!(!access.set(address(11), Right::None));
        assert!(access.set(address(2), Right::None));
        let mut c = Control::new(access);
        assert_eq!(c.enter(B, Protocol::ModbusTcp, START), None);
        let a = enter(&mut c, A);
        let stranger = enter(&mut c, Peer::Ip(address(99)));
        assert_eq!(write(&mut c, a, 0..1, START), Ok(()));
        for words in [0..1, TEST_WORDS] {
            assert_eq!(write(&mut c, stranger, words, START), Err(Denied::ReadOnly));
        }
        c.access.remove(address(2));
        assert_eq!(c.access.of(B), Right::Read);
    }

    #[test]
    fn polls_are_told_apart_by_their_first_request() {
        let mut c = Control::default();
        let a = enter(&mut c, A);
        // three requests every 20 ms, the last interval longer
        for (i, key) in [1, 2, 3, 1, 2, 3, 1, 2, 3].into_iter().enumerate() {
            let now = START + Duration::from_millis(20 * (i as u64 / 3) + i as u64 % 3);
            c.asks(a, key, now);
        }
        c.asks(a, 1, START + Duration::from_secs(2));
        assert_eq!(c.polls, [0, 0, 2, 0, 0, 0, 0, 1]);
        // from now on it asks for something else
        let other = START + Duration::from_secs(20);
        c.asks(a, 9, other);
        c.asks(a, 9, other + Duration::from_millis(5));
        assert_eq!(c.polls, [1, 0, 2, 0, 0, 0, 0, 1]);
        assert_eq!(c.clients().next().map(|client| client.requests), Some(12));
    }

    #[test]
    fn who_has_left_neither_writes_nor_counts() {
        let mut c = Control::default();
        let a = enter(&mut c, A);
        c.leave(a);
        let b = enter(&mut c, B);
        c.asks(a, 0, START);
        c.leave(a);
        assert_eq!(write(&mut c, a, 0..1, START), Err(Denied::ReadOnly));
        assert_eq!(c.clients().map(|client| client.requests).sum::<u32>(), 0);
        assert_eq!(write(&mut c, b, 0..1, START), Ok(()));
        let room = core::iter::repeat_with(|| c.enter(A, Protocol::ModbusTcp, START));
        assert_eq!(
            room.take_while(Option::is_some).count(),
            Control::CLIENTS - 1
        );
    }

    #[test]
    fn the_report_names_the_first_register_that_is_limited() {
        let (mut c, mut f) = (Control::default(), Feedback::default());
        let a = enter(&mut c, A);
        c.wrote(a, 0..20, 1 << 6 | 1 << 9, START);
        c.report(START, &mut f);
        assert_eq!(f.word(&image::LIMITED_REGISTER), 7);
        let status = link_status::LIMITED | link_status::PLC_CONTROLS;
        assert_eq!(f.word(&image::LINK_STATUS), status);
        c.wrote(a, 6..7, 0, START);
        c.report(START + Duration::from_millis(7), &mut f);
        assert_eq!(f.word(&image::LIMITED_REGISTER), 10);
        assert_eq!(f.word(&image::LINK_WRITE_AGE), 7);
        c.panel_wrote(9..10, START);
        c.report(START + Duration::from_secs(70), &mut f);
        assert_eq!(f.word(&image::LIMITED_REGISTER), 0);
        assert_eq!(f.word(&image::LINK_STATUS), 0);
        assert_eq!(f.word(&image::LINK_WRITE_AGE), u16::MAX);
    }
}
