//! `respond` against arbitrary bytes, and against a naive model of a Modbus device.

use std::collections::HashMap;

use firmware::link::modbus::pdu::{Open, PDU_MAX, Pdu, respond};
use model_core::image::{Block, COMMAND_WORDS, FEEDBACK_WORDS, Image};
use proptest::collection::vec;
use proptest::prelude::*;

/// A request as its author means it.
#[derive(Clone, Debug)]
enum Ask {
    Coils(u16, u16),
    Discretes(u16, u16),
    Holding(u16, u16),
    Inputs(u16, u16),
    SetCoil(u16, bool),
    SetRegister(u16, u16),
    SetCoils(u16, Vec<bool>),
    SetRegisters(u16, Vec<u16>),
    Mask(u16, u16, u16),
    Exchange(u16, u16, u16, Vec<u16>),
}

fn bytes(words: &[u16]) -> Vec<u8> {
    words.iter().flat_map(|w| w.to_be_bytes()).collect()
}

fn packed(bits: &[bool]) -> Vec<u8> {
    let byte = |bits: &[bool]| {
        bits.iter()
            .rev()
            .fold(0, |byte, bit| byte << 1 | u8::from(*bit))
    };
    bits.chunks(8).map(byte).collect()
}

/// `head`, then `data` with its byte count in front.
fn counted(function: u8, head: &[u16], data: &[u8]) -> Vec<u8> {
    [&[function][..], &bytes(head), &[data.len() as u8], data].concat()
}

impl Ask {
    fn encode(&self) -> Vec<u8> {
        let plain = |function: u8, words: [u16; 2]| [vec![function], bytes(&words)].concat();
        match self {
            Ask::Coils(start, count) => plain(1, [*start, *count]),
            Ask::Discretes(start, count) => plain(2, [*start, *count]),
            Ask::Holding(start, count) => plain(3, [*start, *count]),
            Ask::Inputs(start, count) => plain(4, [*start, *count]),
            Ask::SetCoil(at, on) => plain(5, [*at, if *on { 0xff00 } else { 0 }]),
            Ask::SetRegister(at, value) => plain(6, [*at, *value]),
            Ask::SetCoils(start, bits) => counted(15, &[*start, bits.len() as u16], &packed(bits)),
            Ask::SetRegisters(start, words) => {
                counted(16, &[*start, words.len() as u16], &bytes(words))
            }
            Ask::Mask(at, and, or) => [vec![22], bytes(&[*at, *and, *or])].concat(),
            Ask::Exchange(read, count, write, words) => counted(
                23,
                &[*read, *count, *write, words.len() as u16],
                &bytes(words),
            ),
        }
    }
}

/// A span of a block of `len`, at most `max` long.
fn span(len: usize, max: usize) -> impl Strategy<Value = (u16, u16)> {
    (0..len as u16).prop_flat_map(move |start| {
        let most = (len - usize::from(start)).min(max) as u16;
        (Just(start), 1..=most)
    })
}

/// Where to write, and what.
fn data<T: Strategy + Clone>(
    len: usize,
    max: usize,
    item: T,
) -> impl Strategy<Value = (u16, Vec<T::Value>)> {
    span(len, max)
        .prop_flat_map(move |(start, count)| (Just(start), vec(item.clone(), usize::from(count))))
}

fn legal() -> impl Strategy<Value = Ask> {
    const COMMAND_BITS: usize = 16 * COMMAND_WORDS;
    const FEEDBACK_BITS: usize = 16 * FEEDBACK_WORDS;
    prop_oneof![
        span(COMMAND_BITS, 2000).prop_map(|(s, n)| Ask::Coils(s, n)),
        span(FEEDBACK_BITS, 2000).prop_map(|(s, n)| Ask::Discretes(s, n)),
        span(COMMAND_WORDS, 125).prop_map(|(s, n)| Ask::Holding(s, n)),
        span(FEEDBACK_WORDS, 125).prop_map(|(s, n)| Ask::Inputs(s, n)),
        (0..COMMAND_BITS as u16, any::<bool>()).prop_map(|(a, on)| Ask::SetCoil(a, on)),
        (0..COMMAND_WORDS as u16, any::<u16>()).prop_map(|(a, v)| Ask::SetRegister(a, v)),
        data(COMMAND_BITS, 1968, any::<bool>()).prop_map(|(s, bits)| Ask::SetCoils(s, bits)),
        data(COMMAND_WORDS, 123, any::<u16>()).prop_map(|(s, words)| Ask::SetRegisters(s, words)),
        (0..COMMAND_WORDS as u16, any::<u16>(), any::<u16>())
            .prop_map(|(a, and, or)| Ask::Mask(a, and, or)),
        (
            span(COMMAND_WORDS, 125),
            data(COMMAND_WORDS, 121, any::<u16>())
        )
            .prop_map(|((r, n), (w, words))| Ask::Exchange(r, n, w, words)),
    ]
}

fn block<const N: usize>(words: &[u16]) -> Block<N> {
    let mut block = Block::default();
    block.words.copy_from_slice(words);
    block
}

/// A device that knows single bits by kind and address, and no words at all.
#[derive(Default)]
struct Model {
    /// Coils, which are also the bits of the holding registers; what is absent is 0.
    coils: HashMap<u32, bool>,
    /// Discrete inputs, likewise of the input registers.
    discretes: HashMap<u32, bool>,
}

fn read_bits(map: &HashMap<u32, bool>, start: u16, count: u16) -> Vec<bool> {
    let start = u32::from(start);
    (start..start + u32::from(count))
        .map(|a| map.get(&a).copied().unwrap_or(false))
        .collect()
}

fn read_words(map: &HashMap<u32, bool>, start: u16, count: u16) -> Vec<u16> {
    let word = |w: u32| {
        (0..16)
            .filter(|b| map.get(&(16 * w + b)) == Some(&true))
            .map(|b| 1 << b)
            .sum()
    };
    (u32::from(start)..u32::from(start) + u32::from(count))
        .map(word)
        .collect()
}

fn write_words(map: &mut HashMap<u32, bool>, start: u16, words: &[u16]) {
    for (w, word) in (u32::from(start)..).zip(words) {
        for b in 0..16 {
            map.insert(16 * w + b, word & 1 << b != 0);
        }
    }
}

impl Model {
    fn of(image: &Image) -> Self {
        let mut model = Self::default();
        write_words(&mut model.coils, 0, &image.commands.words);
        write_words(&mut model.discretes, 0, &image.feedback.words);
        model
    }

    fn image(&self) -> Image {
        Image {
            commands: block(&read_words(&self.coils, 0, COMMAND_WORDS as u16)),
            feedback: block(&read_words(&self.discretes, 0, FEEDBACK_WORDS as u16)),
        }
    }

    fn answer(&mut self, ask: &Ask) -> Vec<u8> {
        let data = |function, data: Vec<u8>| counted(function, &[], &data);
        match ask {
            Ask::Coils(s, n) => data(1, packed(&read_bits(&self.coils, *s, *n))),
            Ask::Discretes(s, n) => data(2, packed(&read_bits(&self.discretes, *s, *n))),
            Ask::Holding(s, n) => data(3, bytes(&read_words(&self.coils, *s, *n))),
            Ask::Inputs(s, n) => data(4, bytes(&read_words(&self.discretes, *s, *n))),
            Ask::SetCoil(at, on) => {
                self.coils.insert(u32::from(*at), *on);
                ask.encode()
            }
            Ask::SetRegister(at, value) => {
                write_words(&mut self.coils, *at, &[*value]);
                ask.encode()
            }
            Ask::SetCoils(start, bits) => {
                self.coils
                    .extend((u32::from(*start)..).zip(bits.iter().copied()));
                ask.encode()[..5].to_vec()
            }
            Ask::SetRegisters(start, words) => {
                write_words(&mut self.coils, *start, words);
                ask.encode()[..5].to_vec()
            }
            Ask::Mask(at, and, or) => {
                for b in 0..16 {
                    let bit = self.coils.entry(16 * u32::from(*at) + b).or_default();
                    // where the mask has a 1 the bit stays, elsewhere it is that of the other mask
                    if and & 1 << b == 0 {
                        *bit = or & 1 << b != 0;
                    }
                }
                ask.encode()
            }
            Ask::Exchange(read, count, write, words) => {
                write_words(&mut self.coils, *write, words);
                data(23, bytes(&read_words(&self.coils, *read, *count)))
            }
        }
    }
}

fn image() -> impl Strategy<Value = Image> {
    let words = |len| vec(any::<u16>(), len);
    (words(COMMAND_WORDS), words(FEEDBACK_WORDS)).prop_map(|(commands, feedback)| Image {
        commands: block(&commands),
        feedback: block(&feedback),
    })
}

/// Mostly not legal, but near: the interesting faults are a byte away from a good request.
fn hostile() -> impl Strategy<Value = Vec<u8>> {
    let near = (
        legal(),
        vec((any::<prop::sample::Index>(), any::<u8>()), 0..3),
        -3..4isize,
    )
        .prop_map(|(ask, faults, longer)| {
            let mut request = ask.encode();
            for (at, byte) in faults {
                let at = at.index(request.len());
                request[at] = byte;
            }
            request.resize(request.len().saturating_add_signed(longer), 0);
            request
        });
    let served = prop::sample::select(vec![1u8, 2, 3, 4, 5, 6, 15, 16, 22, 23, 43]);
    let addressed =
        (served, vec(any::<u8>(), 0..20)).prop_map(|(f, rest)| [vec![f], rest].concat());
    prop_oneof![4 => near, 1 => addressed, 1 => vec(any::<u8>(), 0..300)]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn legal_requests_do_what_a_naive_device_does(image in image(), asks in vec(legal(), 1..20)) {
        let (mut device, mut model, mut reply) = (image, Model::of(&image), Pdu::new());
        for ask in asks {
            respond(&ask.encode(), &mut device, &mut Open, &mut reply);
            prop_assert_eq!(&reply[..], model.answer(&ask), "{:?}", ask);
        }
        prop_assert_eq!(device, model.image());
    }

    #[test]
    fn whatever_comes_the_reply_is_one_or_an_exception_that_changed_nothing(
        image in image(),
        request in hostile(),
    ) {
        let (mut device, mut reply) = (image, Pdu::new());
        respond(&request, &mut device, &mut Open, &mut reply);
        prop_assert_eq!(device.feedback, image.feedback);
        let Some(function) = request.first() else {
            prop_assert!(reply.is_empty() && device == image);
            return Ok(());
        };
        prop_assert!(reply.len() <= PDU_MAX);
        if reply[0] == *function && *function < 0x80 {
            prop_assert!(reply.len() >= 3);
        } else {
            prop_assert_eq!(reply.len(), 2);
            prop_assert_eq!(reply[0], function | 0x80);
            prop_assert!((1..=3).contains(&reply[1]));
            prop_assert_eq!(device, image);
        }
    }
}
