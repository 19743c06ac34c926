//! The framing and the session: dialogues over a stream that is scripted.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::future::pending;

use embassy_futures::{block_on, yield_now};
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_time::{Duration, Instant, Timer};
use embedded_io_async::{ErrorKind, ErrorType, Read, Write};
use firmware::link::control::{Control, Peer, Protocol};
use firmware::link::modbus::pdu::{Open, Pdu, respond};
use firmware::link::modbus::tcp::{ADU_MAX, End, Malformed, Reassembler, Timeouts, session};
use firmware::link::{ControlCell, ImageCell, Service};
use model_core::image::{Commands, Feedback, Image, LINK_STATUS, RESPONSE_DELAY};
use proptest::collection::vec;
use proptest::prelude::*;

/// What the client does next.
#[derive(Clone, Debug)]
enum Act {
    Send(Vec<u8>),
    Wait(Duration),
    /// Stays connected and silent.
    Hang,
    Reset,
}

/// A client; it closes when it has nothing more to do.
struct Client {
    acts: VecDeque<Act>,
    replies: Vec<u8>,
    /// Bytes of replies that it takes before it stops reading.
    room: usize,
}

impl ErrorType for Client {
    type Error = ErrorKind;
}

impl Read for Client {
    async fn read(&mut self, buf: &mut [u8]) -> Result<usize, ErrorKind> {
        yield_now().await;
        loop {
            match self.acts.pop_front() {
                None => return Ok(0),
                Some(Act::Wait(time)) => Timer::after(time).await,
                Some(Act::Hang) => pending().await,
                Some(Act::Reset) => return Err(ErrorKind::ConnectionReset),
                Some(Act::Send(bytes)) if bytes.is_empty() => {}
                Some(Act::Send(mut bytes)) => {
                    let n = bytes.len().min(buf.len());
                    buf[..n].copy_from_slice(&bytes[..n]);
                    self.acts.push_front(Act::Send(bytes.split_off(n)));
                    return Ok(n);
                }
            }
        }
    }
}

impl Write for Client {
    async fn write(&mut self, buf: &[u8]) -> Result<usize, ErrorKind> {
        let n = buf.len().min(self.room);
        if n == 0 {
            pending::<()>().await;
        }
        self.room -= n;
        self.replies.extend(&buf[..n]);
        Ok(n)
    }

    async fn flush(&mut self) -> Result<(), ErrorKind> {
        Ok(())
    }
}

fn image() -> Image {
    let mut commands = Commands {
        words: core::array::from_fn(|i| 0x1000 + i as u16),
    };
    commands.set_word(&RESPONSE_DELAY, 0);
    Image {
        commands,
        feedback: Feedback {
            words: core::array::from_fn(|i| 0x2000 + i as u16),
        },
    }
}

const SHORT: Timeouts = Timeouts {
    idle: Duration::from_millis(400),
    half_request: Duration::from_millis(50),
    write: Duration::from_millis(50),
};

struct Outcome {
    end: End,
    replies: Vec<u8>,
    answered: usize,
    image: Image,
    took: Duration,
}

fn play_with(timeouts: &Timeouts, acts: impl IntoIterator<Item = Act>, room: usize) -> Outcome {
    play_on(image(), timeouts, acts, room)
}

fn play_on(
    image: Image,
    timeouts: &Timeouts,
    acts: impl IntoIterator<Item = Act>,
    room: usize,
) -> Outcome {
    let cell = ImageCell::<NoopRawMutex>::new(RefCell::new(image));
    let control = ControlCell::new(RefCell::new(Control::default()));
    let service = Service {
        image: &cell,
        control: &control,
    };
    let peer = Peer::Ip([10, 0, 0, 1].into());
    let place = service.enter(peer, Protocol::ModbusTcp).expect("a place");
    let mut client = Client {
        acts: acts.into_iter().collect(),
        replies: Vec::new(),
        room,
    };
    let mut answered = 0;
    let start = Instant::now();
    let end = block_on(session(&mut client, &place, timeouts, || answered += 1));
    drop(place);
    Outcome {
        end,
        replies: client.replies,
        answered,
        image: cell.into_inner().into_inner(),
        took: start.elapsed(),
    }
}

fn play(acts: impl IntoIterator<Item = Act>) -> Outcome {
    play_with(&SHORT, acts, usize::MAX)
}

fn frame(transaction: u16, unit: u8, pdu: &[u8]) -> Vec<u8> {
    let length = (pdu.len() as u16 + 1).to_be_bytes();
    [
        &transaction.to_be_bytes()[..],
        &[0, 0],
        &length,
        &[unit],
        pdu,
    ]
    .concat()
}

/// What the framing makes of PDUs, in order, on one device.
fn replies(pdus: &[Vec<u8>]) -> Vec<u8> {
    let (mut image, mut reply) = (image(), Pdu::new());
    let answer = |(i, pdu): (usize, &Vec<u8>)| {
        respond(pdu, &mut image, &mut Open, &mut reply);
        frame(i as u16, i as u8, &reply)
    };
    pdus.iter().enumerate().flat_map(answer).collect()
}

fn frames(pdus: &[Vec<u8>]) -> Vec<u8> {
    let request = |(i, pdu): (usize, &Vec<u8>)| frame(i as u16, i as u8, pdu);
    pdus.iter().enumerate().flat_map(request).collect()
}

/// Write a register, read it back, and so on: the replies tell the order.
fn forty() -> Vec<Vec<u8>> {
    (0..20)
        .flat_map(|i| [vec![6, 0, 0, 0, i], vec![3, 0, 0, 0, 1]])
        .collect()
}

const READ: [u8; 5] = [3, 0, 0, 0, 1];

#[test]
fn transaction_and_unit_are_echoed_whatever_they_are() {
    for (transaction, unit) in [(0, 0), (1, 1), (0x1234, 255), (0xffff, 17)] {
        let o = play([Act::Send(frame(transaction, unit, &READ))]);
        assert_eq!(o.replies, frame(transaction, unit, &[3, 2, 0x10, 0]));
        assert_eq!((o.end, o.answered), (End::Closed, 1));
    }
}

#[test]
fn single_bytes_make_requests() {
    let o = play(
        frames(&forty())
            .into_iter()
            .map(|byte| Act::Send(vec![byte])),
    );
    assert_eq!((o.end, o.replies), (End::Closed, replies(&forty())));
}

#[test]
fn forty_requests_at_once_are_answered_in_order() {
    let o = play([Act::Send(frames(&forty()))]);
    assert_eq!(
        (o.end, o.replies, o.answered),
        (End::Closed, replies(&forty()), 40)
    );
}

#[test]
fn what_is_not_modbus_ends_the_session_after_the_replies_it_owes() {
    for header in [
        [0, 9, 0, 1, 0, 6],
        [0, 9, 1, 0, 0, 6],
        [0, 9, 0, 0, 0, 0],
        [0, 9, 0, 0, 0, 1],
        [0, 9, 0, 0, 0, 255],
        [0, 9, 0, 0, 1, 0],
        [0, 9, 0, 0, 0xff, 0xff],
        *b"GET / ",
    ] {
        let bytes = [frame(7, 1, &READ), header.to_vec(), frame(8, 1, &READ)].concat();
        let o = play([Act::Send(bytes), Act::Hang]);
        assert_eq!(o.end, End::Malformed, "{header:x?}");
        assert_eq!(o.replies, frame(7, 1, &[3, 2, 0x10, 0]));
    }
}

#[test]
fn the_longest_frames_are_taken() {
    // 123 registers are more than the image has, and more than 253 bytes no PDU has: refused, but understood
    let longest_write = [&[16, 0, 0, 0, 123, 246][..], &[0; 246]].concat();
    let longest_frame = [&[16][..], &[0; 252]].concat();
    assert_eq!(frame(0, 0, &longest_write).len(), 259);
    assert_eq!(frame(0, 0, &longest_frame).len(), ADU_MAX);
    let pdus = [longest_write, longest_frame, READ.to_vec()];
    let o = play([Act::Send(frames(&pdus))]);
    let expected: [&[u8]; 3] = [&[0x90, 2], &[0x90, 3], &[3, 2, 0x10, 0]];
    assert_eq!(o.replies, replies(&pdus));
    assert_eq!(replies(&pdus), frames(&expected.map(<[u8]>::to_vec)));
    assert_eq!(o.end, End::Closed);
}

#[test]
fn a_reply_waits_as_long_as_the_test_wants() {
    let mut slow = image();
    slow.commands.set_word(&RESPONSE_DELAY, 60);
    let send = || [Act::Send(frames(&[READ.to_vec(), READ.to_vec()]))];
    let o = play_on(slow, &Timeouts::default(), send(), usize::MAX);
    assert_eq!((o.end, o.answered), (End::Closed, 2));
    assert!(o.took >= Duration::from_millis(120));
}

#[test]
fn a_silent_client_is_idle() {
    let o = play([Act::Hang]);
    assert_eq!(o.end, End::Idle);
    assert!(o.took >= SHORT.idle);
    // each request starts the time again
    let pause = Act::Wait(SHORT.idle * 2 / 3);
    let request = || Act::Send(frame(0, 0, &READ));
    let o = play([
        request(),
        pause.clone(),
        request(),
        pause,
        request(),
        Act::Hang,
    ]);
    assert_eq!((o.end, o.answered), (End::Idle, 3));
    assert!(o.took >= SHORT.idle * 7 / 3);
}

#[test]
fn half_a_request_stalls_however_it_drips() {
    for half in 1..12 {
        let o = play([Act::Send(frame(0, 0, &READ)[..half].to_vec()), Act::Hang]);
        assert_eq!((o.end, o.answered), (End::Stalled, 0), "{half}");
        assert!(
            SHORT.half_request <= o.took && o.took < SHORT.idle,
            "{half}"
        );
    }
    let drip = |byte| [Act::Send(vec![byte]), Act::Wait(SHORT.half_request / 4)];
    let o = play(frame(0, 0, &READ).into_iter().flat_map(drip));
    assert_eq!((o.end, o.answered), (End::Stalled, 0));
    // behind a whole request too
    let bytes = [frame(0, 0, &READ), vec![0, 1, 0]].concat();
    let o = play([Act::Send(bytes), Act::Hang]);
    assert_eq!((o.end, o.answered), (End::Stalled, 1));
    assert!(o.took < SHORT.idle);
}

#[test]
fn each_request_has_its_own_time() {
    let timeouts = Timeouts {
        half_request: Duration::from_millis(400),
        ..Timeouts::default()
    };
    let pause = || Act::Wait(Duration::from_millis(250));
    let bytes = frames(&[READ.to_vec(), READ.to_vec()]);
    let (half, rest) = bytes.split_at(5);
    let (rest, other_half) = rest.split_at(bytes.len() / 2);
    let pieces = [half, rest, other_half].map(|piece| Act::Send(piece.to_vec()));
    let [half, rest, other_half] = pieces;
    let o = play_with(
        &timeouts,
        [half, pause(), rest, pause(), other_half],
        usize::MAX,
    );
    assert_eq!((o.end, o.answered), (End::Closed, 2));
}

#[test]
fn who_does_not_read_is_dropped() {
    let one = frame(0, 0, &[3, 2, 0x10, 0]).len();
    let o = play_with(
        &SHORT,
        [Act::Send(frames(&vec![READ.to_vec(); 5])), Act::Hang],
        2 * one + 3,
    );
    assert_eq!((o.end, o.answered), (End::NotReading, 2));
    assert!(SHORT.write <= o.took && o.took < SHORT.idle);
}

#[test]
fn closing_or_breaking_in_mid_request_changes_nothing() {
    let write = frame(0, 0, &[6, 0, 0, 0xbe, 0xef]);
    for cut in 0..write.len() {
        let half = || Act::Send(write[..cut].to_vec());
        let o = play([half()]);
        assert_eq!((o.end, o.image), (End::Closed, image()), "{cut}");
        let o = play([half(), Act::Reset]);
        assert_eq!(
            (o.end, o.image),
            (End::Broken(ErrorKind::ConnectionReset), image()),
            "{cut}"
        );
    }
}

/// Requests with now and then a header that is none.
fn stream() -> impl Strategy<Value = Vec<u8>> {
    let good = (any::<u16>(), any::<u8>(), vec(any::<u8>(), 1..=253))
        .prop_map(|(t, u, pdu)| frame(t, u, &pdu));
    let short = (any::<u16>(), vec(0..24u8, 5..13)).prop_map(|(t, mut pdu)| {
        // none reads what the link itself has written
        if (1..=4).contains(&pdu[0]) {
            (pdu[1], pdu[3]) = (0, 0);
        }
        frame(t, 1, &pdu)
    });
    let noise = vec(prop_oneof![3 => Just(0), 1 => any::<u8>()], 0..12);
    vec(prop_oneof![2 => good, 8 => short, 1 => noise], 0..12).prop_map(|parts| parts.concat())
}

/// The same bytes in pieces.
fn cut(bytes: &[u8], cuts: &[prop::sample::Index]) -> Vec<Vec<u8>> {
    let mut at: Vec<_> = cuts.iter().map(|c| c.index(bytes.len() + 1)).collect();
    at.extend([0, bytes.len()]);
    at.sort_unstable();
    at.windows(2).map(|w| bytes[w[0]..w[1]].to_vec()).collect()
}

/// The image without what the link tells of itself.
fn simulated(image: &Image) -> (Commands, &[u16]) {
    let own = usize::from(LINK_STATUS.word);
    (image.commands, &image.feedback.words[..own])
}

type Request = ([u8; 2], u8, Vec<u8>);

fn reassemble(pieces: &[Vec<u8>]) -> (Vec<Request>, bool) {
    let (mut frames, mut requests) = (Reassembler::default(), Vec::new());
    for piece in pieces {
        let mut input = &piece[..];
        loop {
            match frames.push(&mut input) {
                Ok(Some(r)) => requests.push((r.transaction, r.unit, r.pdu.to_vec())),
                Ok(None) => break,
                Err(Malformed) => return (requests, true),
            }
        }
        assert!(input.is_empty());
    }
    (requests, false)
}

/// The framing as the guide tells it, over the bytes as a whole.
fn reassemble_naively(mut bytes: &[u8]) -> (Vec<Request>, bool) {
    let mut requests = Vec::new();
    while let [t, u, p, q, a, b, rest @ ..] = bytes {
        let length = usize::from(*a) << 8 | usize::from(*b);
        if *p != 0 || *q != 0 || !(2..=254).contains(&length) {
            return (requests, true);
        }
        let Some((body, next)) = rest.split_at_checked(length) else {
            break;
        };
        requests.push(([*t, *u], body[0], body[1..].to_vec()));
        bytes = next;
    }
    (requests, false)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn frames_do_not_depend_on_the_cuts(bytes in stream(), cuts in vec(any::<prop::sample::Index>(), 0..40)) {
        prop_assert_eq!(reassemble(&cut(&bytes, &cuts)), reassemble_naively(&bytes));
    }

    #[test]
    fn any_bytes_are_frames_or_not_modbus(bytes in vec(any::<u8>(), 0..600), cuts in vec(any::<prop::sample::Index>(), 0..40)) {
        prop_assert_eq!(reassemble(&cut(&bytes, &cuts)), reassemble_naively(&bytes));
    }

    #[test]
    fn sessions_do_not_depend_on_the_cuts(bytes in stream(), cuts in vec(any::<prop::sample::Index>(), 0..40)) {
        let whole = play([Act::Send(bytes.clone())]);
        let pieces = play(cut(&bytes, &cuts).into_iter().map(Act::Send));
        prop_assert_eq!(whole.end, pieces.end);
        prop_assert_eq!(simulated(&whole.image), simulated(&pieces.image));
        prop_assert_eq!(&whole.replies, &pieces.replies);
        // and they are those of the requests, one for one
        let (requests, malformed) = reassemble_naively(&bytes);
        let (mut image, mut reply, mut expected) = (image(), Pdu::new(), Vec::new());
        for ([t, u], unit, pdu) in requests {
            respond(&pdu, &mut image, &mut Open, &mut reply);
            expected.extend(frame(u16::from_be_bytes([t, u]), unit, &reply));
        }
        prop_assert_eq!(whole.replies, expected);
        prop_assert_eq!(simulated(&whole.image), simulated(&image));
        prop_assert_eq!(whole.end, if malformed { End::Malformed } else { End::Closed });
    }
}
