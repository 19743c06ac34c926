//! Device identification: function 43, MEI type 14.
//!
//! Not here: CANopen (MEI type 13), which is refused, and extended objects, of which there are none.
//!
//! Source: MODBUS Application Protocol Specification V1.1b3, section 6.21.

use super::pdu::{Exception, Pdu};

/// The function code.
pub(super) const FUNCTION: u8 = 43;
/// The only MEI type that is served.
const MEI: u8 = 14;

/// Basic and regular objects, by stream or one by one.
const CONFORMITY: u8 = 0x82;

/// The objects, by their number.
const OBJECTS: [(u8, &str); 5] = [
    (0, "Paper winder simulator"),
    (1, "paper-winder-simulator"),
    (2, env!("CARGO_PKG_VERSION")),
    (4, "Simulated two-drum winder with its drives"),
    (5, "SIMULATED"),
];

/// All of them go into one reply.
const LENGTH: usize = {
    let (mut bytes, mut i) = (7, 0);
    while i < OBJECTS.len() {
        bytes += 2 + OBJECTS[i].1.len();
        i += 1;
    }
    bytes
};
const _: () = assert!(LENGTH <= super::pdu::PDU_MAX);

/// What is read.
mod read {
    /// The basic objects, in a stream.
    pub const BASIC: u8 = 1;
    /// Basic and regular objects, in a stream.
    pub const REGULAR: u8 = 2;
    /// All there are, in a stream.
    pub const EXTENDED: u8 = 3;
    /// One object.
    pub const ONE: u8 = 4;
}

/// The last of the basic objects.
const LAST_BASIC: u8 = 2;

/// Answers a request behind its function code.
pub(super) fn answer(body: &[u8], reply: &mut Pdu) -> Result<(), Exception> {
    let (code, object) = match *body {
        [MEI, code, object] => (code, object),
        [MEI, ..] | [] => return Err(Exception::IllegalDataValue),
        _ => return Err(Exception::IllegalFunction),
    };
    let known = |object| OBJECTS.iter().position(|(number, _)| *number == object);
    let objects = match code {
        read::BASIC | read::REGULAR | read::EXTENDED => {
            let last = if code == read::BASIC {
                LAST_BASIC
            } else {
                u8::MAX
            };
            let end = OBJECTS.partition_point(|(number, _)| *number <= last);
            // a stream begins anew where there is no such object
            let start = known(object).filter(|start| *start < end);
            &OBJECTS[start.unwrap_or(0)..end]
        }
        read::ONE => {
            let at = known(object).ok_or(Exception::IllegalDataAddress)?;
            &OBJECTS[at..=at]
        }
        _ => return Err(Exception::IllegalDataValue),
    };
    let (more_follows, next) = (0, 0);
    let count = objects.len() as u8;
    reply.extend([FUNCTION, MEI, code, CONFORMITY, more_follows, next, count]);
    for (number, text) in objects {
        reply.extend([*number, text.len() as u8]);
        reply.extend(text.bytes());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ask(body: &[u8]) -> Result<Pdu, Exception> {
        let mut reply = Pdu::new();
        answer(body, &mut reply).map(|()| reply)
    }

    /// The numbers of the objects of a reply, read as the specification lays it out.
    fn objects(reply: &[u8]) -> heapless::Vec<u8, 8> {
        let (count, mut rest) = (reply[6], &reply[7..]);
        let mut numbers = heapless::Vec::new();
        while let [number, length, tail @ ..] = rest {
            numbers.push(*number).unwrap();
            rest = &tail[usize::from(*length)..];
        }
        assert_eq!(usize::from(count), numbers.len());
        numbers
    }

    #[test]
    fn streams_and_single_objects_are_told() {
        for (body, numbers) in [
            ([14, 1, 0], &[0, 1, 2][..]),
            ([14, 1, 1], &[1, 2]),
            ([14, 1, 4], &[0, 1, 2]),
            ([14, 1, 99], &[0, 1, 2]),
            ([14, 2, 0], &[0, 1, 2, 4, 5]),
            ([14, 2, 3], &[0, 1, 2, 4, 5]),
            ([14, 3, 5], &[5]),
            ([14, 4, 2], &[2]),
        ] {
            let reply = ask(&body).unwrap();
            assert_eq!(reply[..6], [43, 14, body[1], 0x82, 0, 0], "{body:?}");
            assert_eq!(objects(&reply), numbers, "{body:?}");
        }
        let version = ask(&[14, 4, 2]).unwrap();
        assert_eq!(&version[9..], env!("CARGO_PKG_VERSION").as_bytes());
    }

    #[test]
    fn what_is_not_there_is_refused() {
        use Exception::{IllegalDataAddress, IllegalDataValue, IllegalFunction};
        for (body, exception) in [
            (&[14, 4, 3][..], IllegalDataAddress),
            (&[14, 4, 0x80], IllegalDataAddress),
            (&[14, 0, 0], IllegalDataValue),
            (&[14, 5, 0], IllegalDataValue),
            (&[14, 1], IllegalDataValue),
            (&[14, 1, 0, 0], IllegalDataValue),
            (&[], IllegalDataValue),
            (&[13, 0, 0], IllegalFunction),
            (&[0], IllegalFunction),
        ] {
            assert_eq!(ask(body), Err(exception), "{body:?}");
        }
    }
}
