//! A serial line of any bytes with any pauses: the frames are those of the guide, read naively; what the station
//! sends is a frame, and a silent station has changed nothing unless it was a broadcast.
//!
//! Each pair of bytes is a pause, in units of 20 µs, and a byte; every eighth frame's checksum is made to fit.
#![no_main]

use embassy_time::{Duration, Instant};
use firmware::link::modbus::pdu::{Open, Pdu, respond};
use firmware::link::modbus::rtu::{FRAME_MAX, Framer, Gaps, Station};
use libfuzzer_sys::fuzz_target;
use model_core::image::{Commands, Feedback, Image};

const WITHIN: u64 = 750;
const BETWEEN: u64 = 1750;
const UNIT: u64 = 20;

fn checksum(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0xffff, |sum, byte| {
        (0..8).fold(sum ^ u16::from(*byte), |sum, _| {
            if sum & 1 == 1 { sum >> 1 ^ 0xa001 } else { sum >> 1 }
        })
    })
}

fuzz_target!(|data: &[u8]| {
    // whole frames, each spaced within itself as the fuzzer likes
    let mut line: Vec<Vec<(u64, u8)>> = Vec::new();
    for (i, pair) in data.chunks_exact(2).enumerate() {
        let pause = UNIT * u64::from(pair[0]);
        match line.last_mut() {
            Some(frame) if pause < BETWEEN => frame.push((pause, pair[1])),
            _ => {
                if i % 8 != 0 {
                    seal(line.last_mut());
                }
                line.push(vec![(pause, pair[1])]);
            }
        }
    }
    seal(line.last_mut());

    let (mut framer, mut station) = (Framer::new(Gaps::of_baud(115_200)), Station::new(1));
    let mut image = Image {
        commands: Commands::default(),
        feedback: Feedback::default(),
    };
    let mut now = Instant::from_secs(1);
    for frame in &line {
        now += Duration::from_micros(BETWEEN);
        for (i, (pause, byte)) in frame.iter().enumerate() {
            let pause = if i == 0 { 0 } else { *pause };
            now += Duration::from_micros(pause);
            assert!(framer.silence(now).is_none());
            framer.byte(now, *byte);
        }
        let heard = framer.silence(now + Duration::from_micros(BETWEEN)).expect("a frame has ended");
        let bytes: Vec<u8> = frame.iter().map(|(_, byte)| *byte).collect();
        let whole = frame[1..].iter().all(|(pause, _)| *pause <= WITHIN)
            && (4..=FRAME_MAX).contains(&bytes.len())
            && checksum(&bytes) == 0;
        assert_eq!(heard.is_ok(), whole);
        let Ok(heard) = heard else { continue };
        assert_eq!(heard[..], bytes[..bytes.len() - 2]);
        let before = image;
        let reply = station.receive(&heard, |pdu, reply: &mut Pdu| respond(pdu, &mut image, &mut Open, reply));
        match reply {
            Some(reply) => {
                assert_eq!(reply[0], 1);
                assert!((4..=FRAME_MAX).contains(&reply.len()));
                assert_eq!(checksum(&reply), 0);
                if reply[1] >= 0x80 {
                    assert_eq!(image, before);
                }
            }
            None => assert!(image == before || bytes[0] == 0),
        }
    }
});

fn seal(frame: Option<&mut Vec<(u64, u8)>>) {
    if let Some(frame) = frame {
        let bytes: Vec<u8> = frame.iter().map(|(_, byte)| *byte).collect();
        frame.extend(checksum(&bytes).to_le_bytes().map(|byte| (95, byte)));
    }
}
