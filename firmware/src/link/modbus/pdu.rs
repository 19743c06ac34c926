//! The Modbus application layer: one request PDU in, one reply PDU out.
//!
//! Not here: framing, addresses of stations, timing, and function codes other than 1–6, 15, 16 and 23, which
//! are refused as the specification wants. The codec is our own: modbus-core 0.2 accepts wrong quantities,
//! lengths and byte counts, panics when such a request is unpacked, and cuts the reply to function 5 short.
//!
//! | Modbus | image |
//! |---|---|
//! | holding register `w` | word `w` of the commands |
//! | input register `w` | word `w` of the feedback |
//! | coil `16·w + b` | bit `b` of word `w` of the commands |
//! | discrete input `16·w + b` | bit `b` of word `w` of the feedback |
//!
//! Addresses count from 0 as they travel. A block has no holes: it can be read and written as a whole.
//!
//! Source: MODBUS Application Protocol Specification V1.1b3, sections 4, 6 and 7.

use core::ops::Range;

use model_core::image::Image;

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
    /// The request is malformed: its length, a quantity, a byte count or the value of a coil.
    IllegalDataValue = 3,
}

/// Added to the function code of a refused request.
const REFUSED: u8 = 0x80;

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

/// Answers one request, whatever its bytes.
///
/// `reply` is overwritten: with the answer, or with an exception and then the image is as it was. Only a request
/// without even a function code gets no reply (an empty one). The whole takes effect at once for everybody who
/// reaches the image through the lock that the caller holds.
pub fn respond(request: &[u8], image: &mut Image, reply: &mut Pdu) {
    respond_from(
        request,
        &mut image.commands.words,
        &image.feedback.words,
        reply,
    );
}

/// [`respond`] over blocks of any size.
fn respond_from(request: &[u8], commands: &mut [u16], feedback: &[u16], reply: &mut Pdu) {
    reply.clear();
    let Some((&function, body)) = request.split_first() else {
        return;
    };
    if let Err(exception) = answer(function, body, commands, feedback, reply) {
        reply.clear();
        reply.extend([function | REFUSED, exception as u8]);
    }
}

/// In the order of the specification: function, quantity or value, address, then execution. Nothing is refused
/// after the first change, and nothing is read before the last one.
fn answer(
    function: u8,
    body: &[u8],
    commands: &mut [u16],
    feedback: &[u16],
    reply: &mut Pdu,
) -> Result<(), Exception> {
    match function {
        1 | 2 => {
            let words = if function == 1 { commands } else { feedback };
            let bits = alone(span(body, READ_BITS_MAX)?)?.within(WORD_BITS * words.len())?;
            put(function, pack(words, bits), reply);
        }
        3 | 4 => {
            let words = if function == 3 { commands } else { feedback };
            let range = alone(span(body, READ_WORDS_MAX)?)?.within(words.len())?;
            put(function, to_bytes(&words[range]), reply);
        }
        5 => {
            let (start, value) = alone(pair(body)?)?;
            let on = match value {
                COIL_ON => true,
                COIL_OFF => false,
                _ => return Err(Exception::IllegalDataValue),
            };
            let bits = Span { start, count: 1 }.within(WORD_BITS * commands.len())?;
            unpack(commands, bits, &[u8::from(on)]);
            acknowledge(function, body, reply);
        }
        6 => {
            let (start, _) = alone(pair(body)?)?;
            let range = Span { start, count: 1 }.within(commands.len())?;
            from_bytes(&mut commands[range], &body[2..]);
            acknowledge(function, body, reply);
        }
        15 => {
            let (span, rest) = span(body, WRITE_BITS_MAX)?;
            let packed = counted(rest, usize::from(span.count).div_ceil(8))?;
            let bits = span.within(WORD_BITS * commands.len())?;
            unpack(commands, bits, packed);
            acknowledge(function, body, reply);
        }
        16 => {
            let (span, rest) = span(body, WRITE_WORDS_MAX)?;
            let bytes = counted(rest, 2 * usize::from(span.count))?;
            let range = span.within(commands.len())?;
            from_bytes(&mut commands[range], bytes);
            acknowledge(function, body, reply);
        }
        23 => {
            let (read, rest) = span(body, READ_WORDS_MAX)?;
            let (write, rest) = span(rest, EXCHANGE_WORDS_MAX)?;
            let bytes = counted(rest, 2 * usize::from(write.count))?;
            let read = read.within(commands.len())?;
            let write = write.within(commands.len())?;
            from_bytes(&mut commands[write], bytes);
            put(function, to_bytes(&commands[read]), reply);
        }
        _ => return Err(Exception::IllegalFunction),
    }
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

fn to_bytes(words: &[u16]) -> impl Iterator<Item = u8> {
    words.iter().flat_map(|word| word.to_be_bytes())
}

fn from_bytes(words: &mut [u16], bytes: &[u8]) {
    for (word, pair) in words.iter_mut().zip(bytes.chunks_exact(2)) {
        *word = u16::from_be_bytes([pair[0], pair[1]]);
    }
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
    use super::*;

    /// Bigger than any request, so that only the codec limits.
    const LEN: usize = 300;

    struct Device {
        commands: [u16; LEN],
        feedback: [u16; LEN],
    }

    fn device() -> Device {
        Device {
            commands: core::array::from_fn(|i| 0x0101u16.wrapping_mul(i as u16 + 1)),
            feedback: [0xa5c3; LEN],
        }
    }

    impl Device {
        fn ask(&mut self, request: &[u8]) -> Pdu {
            let mut reply = Pdu::new();
            respond_from(request, &mut self.commands, &self.feedback, &mut reply);
            reply
        }
    }

    /// A request of `head` and `len` bytes of data.
    fn long(head: &[u8], len: usize) -> heapless::Vec<u8, 600> {
        let mut request = heapless::Vec::from_slice(head).unwrap();
        request.resize(head.len() + len, 0x5a).unwrap();
        request
    }

    #[test]
    fn requests_of_the_specification_are_answered() {
        let mut d = device();
        for (request, reply) in [
            // commands 0 and 1 are 0101 and 0202 hex
            (&[1, 0, 0, 0, 10][..], &[1, 2, 0x01, 0x01][..]),
            (&[1, 0, 7, 0, 12], &[1, 2, 0x02, 0x04]),
            (&[2, 0, 0, 0, 1], &[2, 1, 0x01]),
            (&[2, 0, 14, 0, 4], &[2, 1, 0x0e]),
            (&[3, 0, 0, 0, 2], &[3, 4, 1, 1, 2, 2]),
            (&[4, 1, 43, 0, 1], &[4, 2, 0xa5, 0xc3]),
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
        ] {
            assert_eq!(d.ask(request), reply, "{request:x?}");
        }
    }

    #[test]
    fn longest_requests_and_replies_fit() {
        let mut d = device();
        for (request, len) in [
            (long(&[1, 0, 0, 0x07, 0xd0], 0), 252),
            (long(&[2, 0, 0, 0x07, 0xd0], 0), 252),
            (long(&[3, 0, 0, 0, 125], 0), 252),
            (long(&[4, 0, 0, 0, 125], 0), 252),
            (long(&[15, 0, 0, 0x07, 0xb0, 246], 246), 5),
            (long(&[16, 0, 0, 0, 123, 246], 246), 5),
            (long(&[23, 0, 0, 0, 125, 0, 0, 0, 121, 242], 242), 252),
        ] {
            let reply = d.ask(&request);
            assert_eq!((reply[0], reply.len()), (request[0], len));
        }
    }

    #[test]
    fn refusals_have_the_code_of_the_specification_and_change_nothing() {
        const FUNCTION: u8 = 1;
        const ADDRESS: u8 = 2;
        const VALUE: u8 = 3;
        let bits = (16 * LEN) as u16;
        let [b1, b0] = bits.to_be_bytes();
        let [w1, w0] = (LEN as u16).to_be_bytes();
        for (request, code) in [
            // functions that are not served, whatever follows
            (long(&[0], 0), FUNCTION),
            (long(&[7], 0), FUNCTION),
            (long(&[22, 0, 0, 0, 1, 0, 1], 0), FUNCTION),
            (long(&[43, 14, 1, 0], 0), FUNCTION),
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
            (long(&[3, w1, w0, 0, 1], 0), ADDRESS),
            (long(&[3, w1, w0 - 1, 0, 2], 0), ADDRESS),
            (long(&[4, 0xff, 0xff, 0, 2], 0), ADDRESS),
            (long(&[5, b1, b0, 0xff, 0], 0), ADDRESS),
            (long(&[6, w1, w0, 0, 1], 0), ADDRESS),
            (long(&[15, b1, b0 - 1, 0, 2, 1], 1), ADDRESS),
            (long(&[16, w1, w0 - 1, 0, 2, 4], 4), ADDRESS),
            (long(&[16, 0xff, 0xff, 0, 2, 4], 4), ADDRESS),
            (long(&[23, w1, w0, 0, 1, 0, 0, 0, 1, 2], 2), ADDRESS),
            (long(&[23, 0, 0, 0, 1, w1, w0, 0, 1, 2], 2), ADDRESS),
        ] {
            let mut d = device();
            assert_eq!(d.ask(&request), [request[0] | 0x80, code], "{request:x?}");
            assert_eq!(d.commands, device().commands, "{request:x?}");
        }
    }

    #[test]
    fn without_a_function_code_there_is_no_reply() {
        assert!(device().ask(&[]).is_empty());
    }
}
