//! The Modbus application layer: one request PDU in, one reply PDU out.
//!
//! Not here: framing, addresses of stations, timing, and function codes other than 1–6, 15, 16, 22, 23 and 43/14,
//! which are refused as the specification wants; function 8 is the serial line's. The codec is our own: modbus-core
//! 0.2 accepts wrong quantities, lengths and byte counts, panics when such a request is unpacked, and cuts the reply
//! to function 5 short.
//!
//! | Modbus | image |
//! |---|---|
//! | holding register `w` | word `w` of the commands |
//! | input register `w` | word `w` of the feedback |
//! | registers from [`FLOATS`](crate::link::registers::FLOATS) | the same signals as floats |
//! | coil `16·w + b` | bit `b` of word `w` of the commands |
//! | discrete input `16·w + b` | bit `b` of word `w` of the feedback |
//!
//! Addresses count from 0 as they travel. A block has no holes: it can be read and written as a whole.
//!
//! Source: MODBUS Application Protocol Specification V1.1b3, sections 4, 6 and 7.

use core::ops::Range;

use model_core::image::{COMMAND_WORDS, Image};

use super::identity;
use crate::link::control::WordSet;
use crate::link::registers::{self, Place, Registers, Unfit};

/// Longest PDU, in bytes.
pub const PDU_MAX: usize = 253;

/// A reply in the making.
pub type Pdu = heapless::Vec<u8, PDU_MAX>;

/// Why a request is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Exception {
    /// The function code is not served.
    IllegalFunction = 1,
    /// Some of the addresses are not in the image.
    IllegalDataAddress = 2,
    /// The request is malformed: its length, a quantity, a byte count or the value of a coil; or a float is no
    /// number.
    IllegalDataValue = 3,
    /// Not now: somebody else controls the winder.
    ServerDeviceBusy = 6,
}

/// Who asks, as far as writing goes.
pub trait Gate {
    /// These words of the commands may be written now, by whoever asks.
    ///
    /// # Errors
    /// They may not.
    fn permit(&mut self, words: &Range<usize>) -> Result<(), Exception>;

    /// They have been, some of them outside their limits.
    fn written(&mut self, words: Range<usize>, outside: WordSet);
}

/// The gate that stands open.
#[derive(Clone, Copy, Debug)]
pub struct Open;

impl Gate for Open {
    fn permit(&mut self, _: &Range<usize>) -> Result<(), Exception> {
        Ok(())
    }

    fn written(&mut self, _: Range<usize>, _: WordSet) {}
}

/// Added to the function code of a refused request.
pub(super) const REFUSED: u8 = 0x80;

// What a PDU holds, as the specification limits it; in coils or registers.
const READ_BITS_MAX: u16 = 2000;
const READ_WORDS_MAX: u16 = 125;
const WRITE_BITS_MAX: u16 = 1968;
const WRITE_WORDS_MAX: u16 = 123;
/// Written by function 23, whose request tells two spans.
const EXCHANGE_WORDS_MAX: u16 = 121;

const COIL_ON: u16 = 0xff00;
const COIL_OFF: u16 = 0x0000;
const WORD_BITS: usize = u16::BITS as usize;
const COILS: usize = WORD_BITS * COMMAND_WORDS;

/// Answers one request, whatever its bytes.
///
/// `reply` is overwritten: with the answer, or with an exception and then the image is as it was. Only a request
/// without even a function code gets no reply (an empty one). The whole takes effect at once for everybody who
/// reaches the image through the lock that the caller holds.
pub fn respond(request: &[u8], image: &mut Image, gate: &mut impl Gate, reply: &mut Pdu) {
    reply.clear();
    let Some((&function, body)) = request.split_first() else {
        return;
    };
    if let Err(exception) = answer(function, body, image, gate, reply) {
        refuse(function, exception, reply);
    }
}

/// The reply to a request that is refused.
pub(super) fn refuse(function: u8, exception: Exception, reply: &mut Pdu) {
    reply.clear();
    reply.extend([function | REFUSED, exception as u8]);
}

/// In the order of the specification: function, quantity or value, address, then execution. Nothing is refused
/// after the first change, and nothing is read before the last one.
fn answer(
    function: u8,
    body: &[u8],
    image: &mut Image,
    gate: &mut impl Gate,
    reply: &mut Pdu,
) -> Result<(), Exception> {
    match function {
        1 | 2 => {
            let span = alone(span(body, READ_BITS_MAX)?)?;
            let words = match function {
                1 => &image.commands.words[..],
                _ => &image.feedback.words[..],
            };
            let bits = span.within(WORD_BITS * words.len())?;
            put(function, pack(words, bits), reply);
        }
        3 | 4 => {
            let span = alone(span(body, READ_WORDS_MAX)?)?;
            let registers = match function {
                3 => Registers::commands(image),
                _ => Registers::feedback(image),
            };
            let place = span.place(registers)?;
            put(function, to_bytes(registers.read(place)), reply);
        }
        5 => {
            let (start, value) = alone(pair(body)?)?;
            let on = match value {
                COIL_ON => true,
                COIL_OFF => false,
                _ => return Err(Exception::IllegalDataValue),
            };
            let bits = Span { start, count: 1 }.within(COILS)?;
            write_bits(bits, &[u8::from(on)], image, gate)?;
            acknowledge(function, body, reply);
        }
        6 => {
            let (start, _) = alone(pair(body)?)?;
            let place = Span { start, count: 1 }.place(Registers::commands(image))?;
            write(&place, &body[2..], image, gate)?;
            acknowledge(function, body, reply);
        }
        15 => {
            let (span, rest) = span(body, WRITE_BITS_MAX)?;
            let packed = counted(rest, usize::from(span.count).div_ceil(8))?;
            let bits = span.within(COILS)?;
            write_bits(bits, packed, image, gate)?;
            acknowledge(function, body, reply);
        }
        16 => {
            let (span, rest) = span(body, WRITE_WORDS_MAX)?;
            let bytes = counted(rest, 2 * usize::from(span.count))?;
            let place = span.place(Registers::commands(image))?;
            write(&place, bytes, image, gate)?;
            acknowledge(function, body, reply);
        }
        22 => {
            let ((start, and), rest) = pair(body)?;
            let &[high, low] = rest else {
                return Err(Exception::IllegalDataValue);
            };
            let or = u16::from_be_bytes([high, low]);
            let registers = Registers::commands(image);
            let place = Span { start, count: 1 }.place(registers)?;
            let old = registers.read(place.clone()).next().unwrap_or_default();
            let new = old & and | or & !and;
            write(&place, &new.to_be_bytes(), image, gate)?;
            reply.extend([function]);
            reply.extend(body.iter().copied());
        }
        23 => {
            let (read, rest) = span(body, READ_WORDS_MAX)?;
            let (write_to, rest) = span(rest, EXCHANGE_WORDS_MAX)?;
            let bytes = counted(rest, 2 * usize::from(write_to.count))?;
            let read = read.place(Registers::commands(image))?;
            let write_to = write_to.place(Registers::commands(image))?;
            write(&write_to, bytes, image, gate)?;
            put(
                function,
                to_bytes(Registers::commands(image).read(read)),
                reply,
            );
        }
        identity::FUNCTION => identity::answer(body, reply)?,
        _ => return Err(Exception::IllegalFunction),
    }
    Ok(())
}

/// Writes registers, all or none.
fn write(
    place: &Place,
    bytes: &[u8],
    image: &mut Image,
    gate: &mut impl Gate,
) -> Result<(), Exception> {
    // half a float is no register of its own: its address is wrong, whatever the value
    let range = registers::concerned(place).map_err(exception_of)?;
    let (words, outside) = registers::decode(place, from_bytes(bytes)).map_err(exception_of)?;
    gate.permit(&range)?;
    for (word, new) in image.commands.words[range.clone()].iter_mut().zip(words) {
        *word = new;
    }
    gate.written(range, outside);
    Ok(())
}

fn exception_of(unfit: Unfit) -> Exception {
    match unfit {
        Unfit::Half => Exception::IllegalDataAddress,
        Unfit::Value => Exception::IllegalDataValue,
    }
}

/// Writes coils, all or none.
fn write_bits(
    bits: Range<usize>,
    packed: &[u8],
    image: &mut Image,
    gate: &mut impl Gate,
) -> Result<(), Exception> {
    let range = bits.start / WORD_BITS..bits.end.div_ceil(WORD_BITS);
    gate.permit(&range)?;
    unpack(&mut image.commands.words, bits, packed);
    let outside = registers::outside(&image.commands, range.clone());
    gate.written(range, outside);
    Ok(())
}

/// Consecutive addresses.
struct Span {
    start: u16,
    count: u16,
}

impl Span {
    /// The addresses, all of which must be below `len`.
    fn within(&self, len: usize) -> Result<Range<usize>, Exception> {
        let start = usize::from(self.start);
        let end = start + usize::from(self.count);
        if end <= len {
            Ok(start..end)
        } else {
            Err(Exception::IllegalDataAddress)
        }
    }

    /// The registers, all of which must be there.
    fn place(&self, registers: Registers<'_>) -> Result<Place, Exception> {
        let place = registers.place(self.start, self.count);
        place.ok_or(Exception::IllegalDataAddress)
    }
}

/// Two words, and what follows them.
fn pair(bytes: &[u8]) -> Result<((u16, u16), &[u8]), Exception> {
    match *bytes {
        [a, b, c, d, ref rest @ ..] => {
            let words = (u16::from_be_bytes([a, b]), u16::from_be_bytes([c, d]));
            Ok((words, rest))
        }
        _ => Err(Exception::IllegalDataValue),
    }
}

/// Start and quantity, and what follows them.
fn span(bytes: &[u8], max: u16) -> Result<(Span, &[u8]), Exception> {
    let ((start, count), rest) = pair(bytes)?;
    if (1..=max).contains(&count) {
        Ok((Span { start, count }, rest))
    } else {
        Err(Exception::IllegalDataValue)
    }
}

/// What must be followed by nothing.
fn alone<T>((parsed, rest): (T, &[u8])) -> Result<T, Exception> {
    if rest.is_empty() {
        Ok(parsed)
    } else {
        Err(Exception::IllegalDataValue)
    }
}

/// Exactly `len` bytes of data behind their count.
fn counted(bytes: &[u8], len: usize) -> Result<&[u8], Exception> {
    match bytes {
        [count, data @ ..] if usize::from(*count) == len && data.len() == len => Ok(data),
        _ => Err(Exception::IllegalDataValue),
    }
}

/// The reply to a read. It fits: the quantity has been checked against what a PDU holds.
fn put(function: u8, bytes: impl Iterator<Item = u8>, reply: &mut Pdu) {
    reply.extend([function, 0]);
    reply.extend(bytes);
    reply[1] = (reply.len() - 2) as u8;
}

/// The reply to a write: the request's own head, up to its value or quantity.
fn acknowledge(function: u8, body: &[u8], reply: &mut Pdu) {
    reply.extend([function]);
    reply.extend(body.iter().take(4).copied());
}

fn to_bytes(words: impl Iterator<Item = u16>) -> impl Iterator<Item = u8> {
    words.flat_map(u16::to_be_bytes)
}

fn from_bytes(bytes: &[u8]) -> impl Iterator<Item = u16> {
    let (pairs, _) = bytes.as_chunks();
    pairs.iter().copied().map(u16::from_be_bytes)
}

/// Bits as they travel: the first address lowest, zeros after the last one.
///
/// By bytes and not by bits, because somebody may wait for the image.
fn pack(words: &[u16], bits: Range<usize>) -> impl Iterator<Item = u8> {
    let end = bits.end;
    bits.step_by(8).map(move |bit| {
        let word = |i: usize| u32::from(words.get(i).copied().unwrap_or(0));
        let i = bit / WORD_BITS;
        let byte = (word(i) | word(i + 1) << WORD_BITS) >> (bit % WORD_BITS);
        let used = (end - bit).min(8);
        byte as u8 & (0xff >> (8 - used))
    })
}

fn unpack(words: &mut [u16], bits: Range<usize>, packed: &[u8]) {
    for (i, bit) in bits.enumerate() {
        let (word, mask) = (&mut words[bit / WORD_BITS], 1 << (bit % WORD_BITS));
        if packed[i / 8] >> (i % 8) & 1 != 0 {
            *word |= mask;
        } else {
            *word &= !mask;
        }
    }
}

#[cfg(test)]
mod tests {
    use model_core::image::{Commands, FEEDBACK_WORDS, Feedback};

    use super::*;
    use crate::link::registers::FLOATS;

    fn image() -> Image {
        Image {
            commands: Commands {
                words: core::array::from_fn(|i| 0x0101u16.wrapping_mul(i as u16 + 1)),
            },
            feedback: Feedback {
                words: [0xa5c3; FEEDBACK_WORDS],
            },
        }
    }

    fn ask(image: &mut Image, request: &[u8]) -> Pdu {
        let mut reply = Pdu::new();
        respond(request, image, &mut Open, &mut reply);
        reply
    }

    /// A request of `head` and `len` bytes of data.
    fn long(head: &[u8], len: usize) -> heapless::Vec<u8, 600> {
        let mut request = heapless::Vec::from_slice(head).unwrap();
        request.resize(head.len() + len, 0x5a).unwrap();
        request
    }

    #[test]
    fn requests_of_the_specification_are_answered() {
        let d = &mut image();
        for (request, reply) in [
            // commands 0 and 1 are 0101 and 0202 hex
            (&[1, 0, 0, 0, 10][..], &[1, 2, 0x01, 0x01][..]),
            (&[1, 0, 7, 0, 12], &[1, 2, 0x02, 0x04]),
            (&[2, 0, 0, 0, 1], &[2, 1, 0x01]),
            (&[2, 0, 14, 0, 4], &[2, 1, 0x0e]),
            (&[3, 0, 0, 0, 2], &[3, 4, 1, 1, 2, 2]),
            (&[4, 0, 43, 0, 1], &[4, 2, 0xa5, 0xc3]),
            (&[5, 0, 1, 0xff, 0], &[5, 0, 1, 0xff, 0]),
            (&[3, 0, 0, 0, 1], &[3, 2, 1, 3]),
            (&[5, 0, 0, 0, 0], &[5, 0, 0, 0, 0]),
            (&[3, 0, 0, 0, 1], &[3, 2, 1, 2]),
            (&[6, 0, 9, 0xab, 0xcd], &[6, 0, 9, 0xab, 0xcd]),
            (&[3, 0, 9, 0, 1], &[3, 2, 0xab, 0xcd]),
            (&[15, 0, 30, 0, 4, 1, 0xf9], &[15, 0, 30, 0, 4]),
            (&[3, 0, 1, 0, 2], &[3, 4, 0x42, 2, 3, 2]),
            (&[16, 0, 5, 0, 2, 4, 1, 2, 3, 4], &[16, 0, 5, 0, 2]),
            (&[3, 0, 5, 0, 2], &[3, 4, 1, 2, 3, 4]),
            // the write comes before the read
            (&[23, 0, 5, 0, 2, 0, 6, 0, 1, 2, 7, 8], &[23, 4, 1, 2, 7, 8]),
            // the example of the specification: 12 hex, masks F2 and 25 hex, gives 17 hex
            (&[6, 0, 4, 0, 0x12], &[6, 0, 4, 0, 0x12]),
            (&[22, 0, 4, 0, 0xf2, 0, 0x25], &[22, 0, 4, 0, 0xf2, 0, 0x25]),
            (&[3, 0, 4, 0, 1], &[3, 2, 0, 0x17]),
        ] {
            assert_eq!(ask(d, request), reply, "{request:x?}");
        }
    }

    /// 1 234.5 is 449A5000 hex as a single, and 12345 counts.
    #[test]
    fn floats_are_read_and_written_high_word_first() {
        let d = &mut image();
        let [high, low] = (FLOATS + 12).to_be_bytes();
        let write = [16, high, low, 0, 2, 4, 0x44, 0x9a, 0x50, 0];
        assert_eq!(ask(d, &write), [16, high, low, 0, 2]);
        assert_eq!(ask(d, &[3, 0, 6, 0, 1]), [3, 2, 0x30, 0x39]);
        assert_eq!(ask(d, &[3, high, low, 0, 2]), [3, 4, 0x44, 0x9a, 0x50, 0]);
        // half of it can be read, and not be written
        assert_eq!(ask(d, &[3, high, low + 1, 0, 1]), [3, 2, 0x50, 0]);
        let before = *d;
        for request in [
            &[6, high, low, 0, 0][..],
            &[22, high, low, 0, 0, 0, 0],
            &[16, high, low + 1, 0, 2, 4, 0, 0, 0, 0],
            &[16, high, low, 0, 1, 2, 0, 0],
        ] {
            assert_eq!(ask(d, request), [request[0] | 0x80, 2], "{request:x?}");
        }
        // one is no number: the other is not written either
        let nan = [16, high, low, 0, 4, 8, 0, 0, 0, 0, 0x7f, 0xc0, 0, 0];
        assert_eq!(ask(d, &nan), [0x90, 3]);
        assert_eq!(*d, before);
    }

    #[test]
    fn longest_requests_and_replies_fit() {
        let d = &mut image();
        let [f1, f0] = FLOATS.to_be_bytes();
        // whatever is beyond the image is refused for its address: the codec has understood it
        for (request, reply) in [
            (long(&[1, 0, 0, 0x07, 0xd0], 0), &[0x81, 2][..]),
            (long(&[15, 0, 0, 0x07, 0xb0, 246], 246), &[0x8f, 2]),
            (long(&[16, 0, 0, 0, 123, 246], 246), &[0x90, 2]),
            (
                long(&[23, 0, 0, 0, 125, 0, 0, 0, 121, 242], 242),
                &[0x97, 2],
            ),
        ] {
            assert_eq!(ask(d, &request), reply);
        }
        assert_eq!(ask(d, &[4, f1, f0, 0, 125]).len(), 252);
    }

    #[test]
    fn refusals_have_the_code_of_the_specification_and_change_nothing() {
        const FUNCTION: u8 = 1;
        const ADDRESS: u8 = 2;
        const VALUE: u8 = 3;
        let [b1, b0] = (COILS as u16).to_be_bytes();
        let [d1, d0] = (16 * FEEDBACK_WORDS as u16).to_be_bytes();
        let [w1, w0] = (COMMAND_WORDS as u16).to_be_bytes();
        let [i1, i0] = (FEEDBACK_WORDS as u16).to_be_bytes();
        for (request, code) in [
            // functions that are not served, whatever follows
            (long(&[0], 0), FUNCTION),
            (long(&[7], 0), FUNCTION),
            (long(&[8, 0, 0, 0, 0], 0), FUNCTION),
            (long(&[43, 13, 0, 0], 0), FUNCTION),
            (long(&[0x7f], 252), FUNCTION),
            (long(&[0x80], 0), FUNCTION),
            (long(&[0x83, 0, 0, 0, 1], 0), FUNCTION),
            (long(&[0xff], 252), FUNCTION),
            // quantities, before the address is looked at
            (long(&[1, 0xff, 0xff, 0, 0], 0), VALUE),
            (long(&[1, 0, 0, 0x07, 0xd1], 0), VALUE),
            (long(&[2, 0, 0, 0, 0], 0), VALUE),
            (long(&[2, 0, 0, 0x07, 0xd1], 0), VALUE),
            (long(&[3, 0, 0, 0, 0], 0), VALUE),
            (long(&[3, 0, 0, 0, 126], 0), VALUE),
            (long(&[4, 0, 0, 0, 0], 0), VALUE),
            (long(&[4, 0xff, 0xff, 0xff, 0xff], 0), VALUE),
            (long(&[15, 0, 0, 0, 0, 0], 0), VALUE),
            (long(&[15, 0, 0, 0x07, 0xb1, 247], 247), VALUE),
            (long(&[16, 0, 0, 0, 0, 0], 0), VALUE),
            (long(&[16, 0, 0, 0, 124, 248], 248), VALUE),
            (long(&[23, 0, 0, 0, 0, 0, 0, 0, 1, 2], 2), VALUE),
            (long(&[23, 0, 0, 0, 126, 0, 0, 0, 1, 2], 2), VALUE),
            (long(&[23, 0, 0, 0, 1, 0, 0, 0, 0, 0], 0), VALUE),
            (long(&[23, 0, 0, 0, 1, 0, 0, 0, 122, 244], 244), VALUE),
            // byte counts
            (long(&[15, 0, 0, 0, 9, 1], 1), VALUE),
            (long(&[15, 0, 0, 0, 8, 2], 2), VALUE),
            (long(&[16, 0, 0, 0, 2, 2], 2), VALUE),
            (long(&[16, 0, 0, 0, 2, 2], 4), VALUE),
            (long(&[16, 0, 0, 0, 1, 4], 4), VALUE),
            (long(&[16, 0, 0, 0, 1, 3], 3), VALUE),
            (long(&[23, 0, 0, 0, 1, 0, 0, 0, 2, 2], 2), VALUE),
            (long(&[23, 0, 0, 0, 1, 0, 0, 0, 1, 4], 4), VALUE),
            // the value of a coil
            (long(&[5, 0, 0, 0, 1], 0), VALUE),
            (long(&[5, 0, 0, 0xff, 1], 0), VALUE),
            (long(&[5, 0xff, 0xff, 1, 0], 0), VALUE),
            // lengths
            (long(&[3], 0), VALUE),
            (long(&[3, 0, 0, 0], 0), VALUE),
            (long(&[3, 0, 0, 0, 1], 1), VALUE),
            (long(&[5, 0, 0, 0xff], 0), VALUE),
            (long(&[5, 0, 0, 0xff, 0], 1), VALUE),
            (long(&[6, 0, 0, 0], 0), VALUE),
            (long(&[6, 0, 0, 0, 1], 1), VALUE),
            (long(&[15, 0, 0, 0, 1], 0), VALUE),
            (long(&[15, 0, 0, 0, 1, 1], 2), VALUE),
            (long(&[16, 0, 0, 0, 2, 4], 3), VALUE),
            (long(&[16, 0, 0, 0, 2, 4], 5), VALUE),
            (long(&[23, 0, 0, 0, 1, 0, 0, 0, 1], 0), VALUE),
            (long(&[23, 0, 0, 0, 1, 0, 0, 0, 1, 2], 3), VALUE),
            (long(&[3, 0, 0, 0, 1], 500), VALUE),
            // past the end, straddling it, wrapping past 65535
            (long(&[1, b1, b0, 0, 1], 0), ADDRESS),
            (long(&[1, b1, b0 - 1, 0, 2], 0), ADDRESS),
            (long(&[2, 0xff, 0xff, 0, 2], 0), ADDRESS),
            (long(&[2, d1, d0, 0, 1], 0), ADDRESS),
            (long(&[3, w1, w0, 0, 1], 0), ADDRESS),
            (long(&[3, w1, w0 - 1, 0, 2], 0), ADDRESS),
            (long(&[4, 0xff, 0xff, 0, 2], 0), ADDRESS),
            (long(&[4, i1, i0, 0, 1], 0), ADDRESS),
            (long(&[22, w1, w0, 0, 0, 0, 0], 0), ADDRESS),
            (long(&[5, b1, b0, 0xff, 0], 0), ADDRESS),
            (long(&[6, w1, w0, 0, 1], 0), ADDRESS),
            (long(&[15, b1, b0 - 1, 0, 2, 1], 1), ADDRESS),
            (long(&[16, w1, w0 - 1, 0, 2, 4], 4), ADDRESS),
            (long(&[16, 0xff, 0xff, 0, 2, 4], 4), ADDRESS),
            (long(&[23, w1, w0, 0, 1, 0, 0, 0, 1, 2], 2), ADDRESS),
            (long(&[23, 0, 0, 0, 1, w1, w0, 0, 1, 2], 2), ADDRESS),
        ] {
            let mut d = image();
            let reply = ask(&mut d, &request);
            assert_eq!(reply, [request[0] | 0x80, code], "{request:x?}");
            assert_eq!(d, image(), "{request:x?}");
        }
    }

    #[test]
    fn without_a_function_code_there_is_no_reply() {
        assert!(ask(&mut image(), &[]).is_empty());
    }
}
