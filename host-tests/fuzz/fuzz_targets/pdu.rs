//! One request PDU of any bytes: the reply is one or an exception, and an exception has changed nothing.
//!
//! A second implementation, written from the specification over single bits, must come to the same for every
//! request on words and bits.
#![no_main]

use firmware::link::modbus::pdu::{Open, PDU_MAX, Pdu, respond};
use firmware::link::registers::FLOATS;
use libfuzzer_sys::fuzz_target;
use model_core::image::{COMMAND_WORDS, Commands, FEEDBACK_WORDS, Feedback, Image};

fn image() -> Image {
    Image {
        commands: Commands {
            words: std::array::from_fn(|i| (i as u16).wrapping_mul(0x9e37)),
        },
        feedback: Feedback {
            words: std::array::from_fn(|i| (i as u16).wrapping_mul(0x79b9)),
        },
    }
}

fuzz_target!(|request: &[u8]| {
    let (mut image, mut reply) = (image(), Pdu::new());
    let before = image;
    respond(request, &mut image, &mut Open, &mut reply);
    assert!(reply.len() <= PDU_MAX);
    assert_eq!(image.feedback, before.feedback);
    let Some(&function) = request.first() else {
        assert!(reply.is_empty());
        return;
    };
    let refused = reply[0] != function || function >= 0x80;
    if refused {
        assert_eq!(reply.len(), 2);
        assert_eq!(reply[0], function | 0x80);
        assert!((1..=3).contains(&reply[1]));
        assert_eq!(image, before);
    }
    if let Some(wanted) = naive(request, &before) {
        match wanted {
            Ok((bits, answer)) => {
                assert_eq!(reply[..], answer);
                assert_eq!(bits_of(&image.commands.words), bits);
            }
            Err(code) => assert_eq!(reply[..], [function | 0x80, code]),
        }
    }
});

type Bits = Vec<bool>;

fn bits_of(words: &[u16]) -> Bits {
    (0..16 * words.len()).map(|i| words[i / 16] >> (i % 16) & 1 == 1).collect()
}

/// Bits after the request and the reply, or the exception's code. `None`: floats and identification are not its.
fn naive(request: &[u8], image: &Image) -> Option<Result<(Bits, Vec<u8>), u8>> {
    let function = request[0];
    let word = |at: usize| Some(u16::from(*request.get(at)?) << 8 | u16::from(*request.get(at + 1)?));
    let mut bits = bits_of(&image.commands.words);
    let inputs = bits_of(&image.feedback.words);
    let n = request.len();
    // function, length, quantity and value first
    let legal = match function {
        1 | 2 => n == 5 && (1..=2000).contains(&word(3)?),
        3 | 4 => n == 5 && (1..=125).contains(&word(3)?),
        5 => n == 5 && matches!(word(3)?, 0 | 0xff00),
        6 => n == 5,
        15 => {
            n >= 6 && (1..=1968).contains(&word(3)?) && {
                let bytes = (usize::from(word(3)?) + 7) / 8;
                usize::from(request[5]) == bytes && n == 6 + bytes
            }
        }
        16 => {
            n >= 6 && (1..=123).contains(&word(3)?) && {
                let bytes = 2 * usize::from(word(3)?);
                usize::from(request[5]) == bytes && n == 6 + bytes
            }
        }
        22 => n == 7,
        23 => {
            n >= 10 && (1..=125).contains(&word(3)?) && (1..=121).contains(&word(7)?) && {
                let bytes = 2 * usize::from(word(7)?);
                usize::from(request[9]) == bytes && n == 10 + bytes
            }
        }
        43 => return None,
        _ => return Some(Err(1)),
    };
    if !legal {
        return Some(Err(3));
    }
    let start = usize::from(word(1)?);
    let count = match function {
        5 | 6 | 22 => 1,
        _ => usize::from(word(3)?),
    };
    let floats = usize::from(FLOATS);
    let in_floats = |start: usize| matches!(function, 3 | 4 | 6 | 16 | 22 | 23) && start >= floats;
    if in_floats(start) || function == 23 && usize::from(word(5)?) >= floats {
        return None;
    }
    let end = match function {
        1 | 5 | 15 => 16 * COMMAND_WORDS,
        2 => 16 * FEEDBACK_WORDS,
        4 => FEEDBACK_WORDS,
        _ => COMMAND_WORDS,
    };
    if start + count > end {
        return Some(Err(2));
    }
    let packed = |bits: &[bool]| -> Vec<u8> {
        let byte = |bits: &[bool]| bits.iter().rev().fold(0, |b, bit| b << 1 | u8::from(*bit));
        bits.chunks(8).map(byte).collect()
    };
    // a word travels with its high byte first
    let swapped = |bytes: Vec<u8>| -> Vec<u8> { bytes.chunks(2).flat_map(|p| [p[1], p[0]]).collect() };
    let read = |bits: &Bits, start: usize, count: usize| swapped(packed(&bits[16 * start..16 * (start + count)]));
    let with_count = |data: Vec<u8>| [vec![function, data.len() as u8], data].concat();
    let set = |bits: &mut Bits, at: usize, value: u16| {
        for b in 0..16 {
            bits[16 * at + b] = value >> b & 1 == 1;
        }
    };
    let reply = match function {
        1 => with_count(packed(&bits[start..start + count])),
        2 => with_count(packed(&inputs[start..start + count])),
        3 => with_count(read(&bits, start, count)),
        4 => with_count(read(&inputs, start, count)),
        5 => {
            bits[start] = word(3)? != 0;
            request.to_vec()
        }
        6 => {
            set(&mut bits, start, word(3)?);
            request.to_vec()
        }
        15 => {
            for i in 0..count {
                bits[start + i] = request[6 + i / 8] >> (i % 8) & 1 == 1;
            }
            request[..5].to_vec()
        }
        16 => {
            for i in 0..count {
                set(&mut bits, start + i, word(6 + 2 * i)?);
            }
            request[..5].to_vec()
        }
        22 => {
            let old = image.commands.words[start];
            set(&mut bits, start, old & word(3)? | word(5)? & !word(3)?);
            request.to_vec()
        }
        _ => {
            let (to, many) = (usize::from(word(5)?), usize::from(word(7)?));
            if to + many > COMMAND_WORDS {
                return Some(Err(2));
            }
            for i in 0..many {
                set(&mut bits, to + i, word(10 + 2 * i)?);
            }
            with_count(read(&bits, start, count))
        }
    };
    Some(Ok((bits, reply)))
}
