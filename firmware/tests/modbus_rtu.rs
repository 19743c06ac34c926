//! The serial line: bytes with their times, and what a station makes of them.

use embassy_time::{Duration, Instant};
use firmware::link::modbus::pdu::{Open, Pdu, respond};
use firmware::link::modbus::rtu::{Broken, Counters, FRAME_MAX, Framer, Gaps, Station, checksum};
use model_core::image::{Commands, Feedback, Image};
use proptest::collection::vec;
use proptest::prelude::*;

const GAPS: Gaps = Gaps::of_baud(115_200);
const START: Instant = Instant::from_secs(1);
/// A character of 11 bits at 115 200 Bd.
const CHARACTER: Duration = Duration::from_micros(95);
const STATION: u8 = 17;

fn image() -> Image {
    Image {
        commands: Commands::default(),
        feedback: Feedback::default(),
    }
}

/// A line with one station, and its clock.
struct Line {
    framer: Framer,
    station: Station,
    image: Image,
    now: Instant,
}

impl Line {
    fn new() -> Self {
        Self {
            framer: Framer::new(GAPS),
            station: Station::new(STATION),
            image: image(),
            now: START,
        }
    }

    /// Time passes; what the station sends meanwhile.
    fn wait(&mut self, time: Duration) -> Option<Vec<u8>> {
        self.now += time;
        match self.framer.silence(self.now)? {
            Ok(frame) => {
                let Self { station, image, .. } = self;
                let reply = station.receive(&frame, |pdu, reply: &mut Pdu| {
                    respond(pdu, image, &mut Open, reply)
                });
                reply.map(|frame| frame.to_vec())
            }
            Err(broken) => {
                self.station.broken(broken);
                None
            }
        }
    }

    fn send(&mut self, bytes: &[u8]) {
        for byte in bytes {
            assert_eq!(self.wait(CHARACTER), None);
            self.framer.byte(self.now, *byte);
        }
    }

    /// A frame on a quiet line; the reply's PDU, once its frame is found to be sound.
    fn ask(&mut self, address: u8, pdu: &[u8]) -> Option<Vec<u8>> {
        self.send(&frame(address, pdu));
        let mut reply = self.wait(GAPS.between)?;
        let sum = reply.split_off(reply.len() - 2);
        assert_eq!((reply[0], &sum[..]), (address, &checksum(&reply)[..]));
        Some(reply.split_off(1))
    }
}

fn frame(address: u8, pdu: &[u8]) -> Vec<u8> {
    let bytes = [&[address], pdu].concat();
    let sum = checksum(&bytes);
    [&bytes[..], &sum].concat()
}

const READ: [u8; 5] = [3, 0, 0, 0, 1];
const WRITE: [u8; 5] = [6, 0, 0, 0xbe, 0xef];

/// The checksum as the guide computes it, bit by bit.
fn naive_checksum(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0xffff, |sum, byte| {
        (0..8).fold(sum ^ u16::from(*byte), |sum, _| {
            if sum & 1 == 1 {
                sum >> 1 ^ 0xa001
            } else {
                sum >> 1
            }
        })
    })
}

#[test]
fn the_checksum_is_that_of_the_guide() {
    // the guide's own example: 02 07 has the checksum 41 12
    assert_eq!(checksum(&[2, 7]), [0x41, 0x12]);
    let bytes: Vec<u8> = (0..=255).collect();
    assert_eq!(checksum(&bytes), naive_checksum(&bytes).to_le_bytes());
}

#[test]
fn gaps_follow_the_speed_and_are_fixed_above_19200_baud() {
    let of = |baud| {
        let gaps = Gaps::of_baud(baud);
        (gaps.within.as_micros(), gaps.between.as_micros())
    };
    assert_eq!(of(9_600), (1718, 4010));
    assert_eq!(of(19_200), (859, 2005));
    assert_eq!(of(38_400), (750, 1750));
    assert_eq!(of(115_200), (750, 1750));
}

#[test]
fn a_station_answers_its_address_and_no_other() {
    let mut line = Line::new();
    assert_eq!(line.ask(STATION, &WRITE), Some(WRITE.to_vec()));
    assert_eq!(line.ask(STATION, &READ), Some(vec![3, 2, 0xbe, 0xef]));
    assert_eq!(line.ask(STATION, &[99]), Some(vec![0x80 | 99, 1]));
    for other in [1, STATION + 1, 247, 255] {
        assert_eq!(line.ask(other, &[6, 0, 0, 0, 0]), None, "{other}");
    }
    assert_eq!(line.image.commands.words[0], 0xbeef);
    assert_eq!(
        (
            line.station.counters.bus_messages,
            line.station.counters.messages
        ),
        (7, 3)
    );
}

#[test]
fn a_broadcast_is_done_and_not_answered() {
    let mut line = Line::new();
    assert_eq!(line.ask(0, &WRITE), None);
    assert_eq!(line.image.commands.words[0], 0xbeef);
    assert_eq!(line.ask(0, &READ), None);
    assert_eq!(line.station.counters.unanswered, 2);
}

#[test]
fn a_wrong_checksum_is_silence_and_counted() {
    let mut line = Line::new();
    let whole = frame(STATION, &WRITE);
    for bit in 0..8 * whole.len() {
        let mut bytes = whole.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        line.send(&bytes);
        assert_eq!(line.wait(GAPS.between), None, "{bit}");
    }
    assert_eq!(line.image, image());
    assert_eq!(
        usize::from(line.station.counters.bus_errors),
        8 * whole.len()
    );
    assert_eq!(line.ask(STATION, &WRITE), Some(WRITE.to_vec()));
}

#[test]
fn a_gap_discards_and_a_silence_separates() {
    let mut line = Line::new();
    let whole = frame(STATION, &WRITE);
    let tick = Duration::from_ticks(1);
    for at in 1..whole.len() {
        // up to t1.5 it is one frame
        line.send(&whole[..at]);
        assert_eq!(line.wait(GAPS.within - CHARACTER), None);
        line.send(&whole[at..]);
        assert!(line.wait(GAPS.between).is_some(), "{at}");
        // above it is none
        line.send(&whole[..at]);
        assert_eq!(line.wait(GAPS.within - CHARACTER + tick), None);
        line.send(&whole[at..]);
        assert_eq!(line.wait(GAPS.between), None, "{at}");
        // from t3.5 on the rest is a frame of its own, which is broken like the first
        line.send(&whole[..at]);
        assert_eq!(line.wait(GAPS.between), None);
        line.send(&whole[at..]);
        assert_eq!(line.wait(GAPS.between), None, "{at}");
    }
    assert_eq!(
        usize::from(line.station.counters.bus_errors),
        3 * (whole.len() - 1)
    );
    // not a tick before t3.5
    line.send(&whole);
    assert_eq!(line.wait(GAPS.between - tick), None);
    assert!(line.wait(tick).is_some());
}

#[test]
fn noise_before_a_frame_is_no_part_of_it() {
    let mut line = Line::new();
    line.send(&[0xff, 0x00, 0x55]);
    assert_eq!(line.wait(GAPS.between), None);
    assert_eq!(line.ask(STATION, &WRITE), Some(WRITE.to_vec()));
    // without a silence between them it spoils the frame, and only that one
    line.send(&[0xff]);
    assert_eq!(line.ask(STATION, &WRITE), None);
    assert_eq!(line.ask(STATION, &WRITE), Some(WRITE.to_vec()));
}

#[test]
fn frames_have_4_to_256_bytes() {
    let mut line = Line::new();
    let longest = vec![0x41; FRAME_MAX - 3];
    assert_eq!(frame(STATION, &longest).len(), 256);
    assert_eq!(line.ask(STATION, &longest), Some(vec![0xc1, 1]));
    line.send(&frame(STATION, &[&longest[..], &[0]].concat()));
    assert_eq!(line.wait(GAPS.between), None);
    assert_eq!(line.station.counters.overruns, 1);
    for length in 0..4 {
        // a checksum that fits does not make it a frame
        let bytes = &frame(STATION, &[])[..length.min(3)];
        line.send(bytes);
        assert_eq!(line.wait(GAPS.between), None);
    }
    assert_eq!(line.ask(STATION, &[7]), Some(vec![0x87, 1]));
}

#[test]
fn diagnostics_echo_count_and_are_told_to_be_silent() {
    let mut line = Line::new();
    let count = |line: &mut Line, sub| {
        let reply = line.ask(STATION, &[8, 0, sub, 0, 0]).expect("an answer");
        assert_eq!(reply[..3], [8, 0, sub]);
        u16::from_be_bytes([reply[3], reply[4]])
    };
    let echo = [8, 0, 0, 0xa5, 0x37, 1, 2];
    assert_eq!(line.ask(STATION, &echo), Some(echo.to_vec()));
    assert_eq!(line.ask(STATION, &[99]), Some(vec![0xe3, 1]));
    assert_eq!(line.ask(5, &READ), None);
    assert_eq!(line.ask(0, &WRITE), None);
    line.send(&[1, 2, 3, 4, 5]);
    assert_eq!(line.wait(GAPS.between), None);
    // messages on the bus, errors, exceptions, messages for us, without answer; each question is one more
    let counts = [11, 12, 13, 14, 15].map(|sub| count(&mut line, sub));
    assert_eq!(counts, [5, 1, 1, 7, 1]);
    for (request, code) in [
        (&[8, 0, 3, 0, 0][..], 1),
        (&[8, 0, 21, 0, 0], 1),
        (&[8, 1, 0, 0, 0], 1),
        (&[8, 0, 11, 0, 1], 3),
        (&[8, 0, 10, 0, 0, 0], 3),
        (&[8, 0, 0], 3),
        (&[8], 3),
    ] {
        assert_eq!(
            line.ask(STATION, request),
            Some(vec![0x88, code]),
            "{request:x?}"
        );
    }
    let clear = [8, 0, 10, 0, 0];
    assert_eq!(line.ask(STATION, &clear), Some(clear.to_vec()));
    assert_eq!(line.station.counters, Counters::default());
    // listens only: does nothing and says nothing, until it is restarted
    assert_eq!(line.ask(STATION, &[8, 0, 4, 0, 0]), None);
    for request in [
        &WRITE[..],
        &READ,
        &[8, 0, 11, 0, 0],
        &[8, 0, 99, 0, 0],
        &echo,
    ] {
        assert_eq!(line.ask(STATION, request), None, "{request:x?}");
    }
    assert_eq!(line.ask(0, &[6, 0, 0, 0, 0]), None);
    assert_eq!(line.image.commands.words[0], 0xbeef);
    let restart = [8, 0, 1, 0xff, 0];
    assert_eq!(line.ask(STATION, &restart), None);
    assert_eq!(line.ask(STATION, &restart), Some(restart.to_vec()));
    assert_eq!(line.ask(STATION, &READ), Some(vec![3, 2, 0xbe, 0xef]));
}

/// The line as the guide tells it, over all bytes and the pauses before them, in µs.
fn naive_frames(bytes: &[(u64, u8)]) -> Vec<Result<Vec<u8>, Broken>> {
    let mut frames: Vec<Vec<(u64, u8)>> = Vec::new();
    for &(pause, byte) in bytes {
        match frames.last_mut() {
            Some(frame) if pause < 1750 => frame.push((pause, byte)),
            _ => frames.push(vec![(0, byte)]),
        }
    }
    let judge = |frame: Vec<(u64, u8)>| {
        // whichever comes first
        let gap = frame.iter().position(|(pause, _)| *pause > 750);
        let long = (frame.len() > 256).then_some(256);
        let bytes: Vec<u8> = frame.iter().map(|(_, byte)| *byte).collect();
        match (gap, long) {
            (Some(gap), Some(long)) if gap > long => Err(Broken::Long),
            (Some(_), _) => Err(Broken::Gap),
            (None, Some(_)) => Err(Broken::Long),
            _ if bytes.len() < 4 => Err(Broken::Short),
            _ if naive_checksum(&bytes) != 0 => Err(Broken::Checksum),
            _ => Ok(bytes[..bytes.len() - 2].to_vec()),
        }
    };
    frames.into_iter().map(judge).collect()
}

fn heard(bytes: &[(u64, u8)]) -> Vec<Result<Vec<u8>, Broken>> {
    let (mut framer, mut now, mut frames) = (Framer::new(GAPS), START, Vec::new());
    let mut listen = |framer: &mut Framer, now| {
        let frame = framer.silence(now);
        frames.extend(frame.map(|frame| frame.map(|frame| frame.to_vec())));
    };
    for &(pause, byte) in bytes {
        now += Duration::from_micros(pause);
        listen(&mut framer, now);
        framer.byte(now, byte);
    }
    listen(&mut framer, now + GAPS.between);
    frames
}

/// Frames that are sound, noise, and pauses of all kinds.
fn line() -> impl Strategy<Value = Vec<(u64, u8)>> {
    let pause =
        || prop_oneof![12 => Just(95u64), 1 => 740..760u64, 2 => 1740..1760u64, 1 => 2000..9000u64];
    let sound =
        (any::<u8>(), vec(any::<u8>(), 1..260)).prop_map(|(address, pdu)| frame(address, &pdu));
    let part = prop_oneof![sound, vec(any::<u8>(), 0..8)];
    let spaced = (2000..3000u64, part, vec(pause(), 300)).prop_map(|(first, bytes, pauses)| {
        let pauses = std::iter::once(first).chain(pauses);
        pauses.zip(bytes).collect::<Vec<_>>()
    });
    let even =
        (2000..3000u64, any::<u8>(), vec(any::<u8>(), 1..253)).prop_map(|(first, address, pdu)| {
            let pauses = std::iter::once(first).chain(std::iter::repeat(95));
            pauses.zip(frame(address, &pdu)).collect::<Vec<_>>()
        });
    vec(prop_oneof![spaced, even], 0..6).prop_map(|parts| parts.concat())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn frames_are_those_of_the_guide(bytes in line()) {
        prop_assert_eq!(heard(&bytes), naive_frames(&bytes));
    }
}
