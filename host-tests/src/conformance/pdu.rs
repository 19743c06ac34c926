//! One request and the reply to it.
//!
//! Not here: framing.

use super::{Client, Map, Outcome, Reaction, Server, hex};

/// What must come of a request.
#[derive(Clone, Debug)]
enum Wanted {
    /// An exception of one of these codes.
    Exception(&'static [u8]),
    /// Exactly this.
    Reply(Vec<u8>),
    /// A reply to a read, of so many bytes.
    Bytes(usize),
    /// This beginning.
    Begins(Vec<u8>),
    /// An exception for the function, or nothing; never anything else.
    FunctionOrSilence,
    /// The connection goes on: the length of the PDU was legal, and a reply or an address exception came.
    Understood,
}

struct Case {
    id: &'static str,
    source: &'static str,
    request: Vec<u8>,
    wanted: Wanted,
}

const FUNCTION: &[u8] = &[1];
const ADDRESS: &[u8] = &[2];
const VALUE: &[u8] = &[3];

/// A request of a function, words and bytes behind them.
fn request(function: u8, words: &[u16], tail: &[u8]) -> Vec<u8> {
    let words = words.iter().flat_map(|w| w.to_be_bytes());
    [function]
        .into_iter()
        .chain(words)
        .chain(tail.iter().copied())
        .collect()
}

/// Data behind their count.
fn counted(count: usize, len: usize) -> Vec<u8> {
    [vec![count as u8], vec![0; len]].concat()
}

/// Every case. What is written is `held`, which is there already.
fn cases(map: &Map, held: [u16; 2]) -> Vec<Case> {
    let mut cases = Vec::new();
    let mut case = |id, source, request, wanted| {
        cases.push(Case {
            id,
            source,
            request,
            wanted,
        });
    };
    use Wanted::{Begins, Bytes, Exception, FunctionOrSilence, Reply, Understood};
    let [a, b] = held;
    let at = map.scratch;
    let words = |words: &[u16]| {
        words
            .iter()
            .flat_map(|w| w.to_be_bytes())
            .collect::<Vec<u8>>()
    };

    // what is served
    case("read coils", "PDU 6.1", request(1, &[0, 10], &[]), Bytes(2));
    case(
        "read discrete inputs",
        "PDU 6.2",
        request(2, &[0, 9], &[]),
        Bytes(2),
    );
    case(
        "read holding registers",
        "PDU 6.3",
        request(3, &[at, 2], &[]),
        Reply(request(3, &[], &[&[4][..], &words(&held)].concat())),
    );
    case(
        "read input registers",
        "PDU 6.4",
        request(4, &[0, 1], &[]),
        Bytes(2),
    );
    let bit = a & 1 != 0;
    let coil = request(5, &[16 * at, if bit { 0xff00 } else { 0 }], &[]);
    case("write single coil", "PDU 6.5", coil.clone(), Reply(coil));
    let register = request(6, &[at, a], &[]);
    case(
        "write single register",
        "PDU 6.6",
        register.clone(),
        Reply(register),
    );
    let low = a.to_le_bytes();
    case(
        "write multiple coils",
        "PDU 6.11",
        request(15, &[16 * at, 16], &[2, low[0], low[1]]),
        Reply(request(15, &[16 * at, 16], &[])),
    );
    case(
        "write multiple registers",
        "PDU 6.12",
        request(16, &[at, 2], &[&[4][..], &words(&held)].concat()),
        Reply(request(16, &[at, 2], &[])),
    );
    let mask = request(22, &[at, 0xffff, 0], &[]);
    case("mask write register", "PDU 6.16", mask.clone(), Reply(mask));
    case(
        "read and write registers",
        "PDU 6.17",
        request(23, &[at, 2, at, 1], &[&[2][..], &words(&[a])].concat()),
        Reply(request(23, &[], &[&[4][..], &words(&[a, b])].concat())),
    );
    case(
        "identification, basic",
        "PDU 6.21",
        vec![43, 14, 1, 0],
        Begins(vec![43, 14, 1]),
    );
    case(
        "identification, one object",
        "PDU 6.21",
        vec![43, 14, 4, 0],
        Begins(vec![43, 14, 4]),
    );
    case(
        "everything that is written is there",
        "PDU 6.3",
        request(3, &[at, 2], &[]),
        Reply(request(3, &[], &[&[4][..], &words(&held)].concat())),
    );

    // functions
    case(
        "function 0",
        "PDU 4.1",
        vec![0, 0, 0, 0, 1],
        FunctionOrSilence,
    );
    for (id, f) in [
        ("function 9", 9),
        ("function 65", 65),
        ("function 127", 127),
    ] {
        case(id, "PDU 7", vec![f, 0, 0, 0, 1], Exception(FUNCTION));
    }
    for (id, f) in [
        ("function 128", 128u8),
        ("function 131", 131),
        ("function 255", 255),
    ] {
        case(id, "PDU 4.1", vec![f, 0, 0, 0, 1], FunctionOrSilence);
    }
    case(
        "identification, bad code 0",
        "PDU 6.21",
        vec![43, 14, 0, 0],
        Exception(VALUE),
    );
    case(
        "identification, bad code 5",
        "PDU 6.21",
        vec![43, 14, 5, 0],
        Exception(VALUE),
    );
    case(
        "identification, no such object",
        "PDU 6.21",
        vec![43, 14, 4, 0x7f],
        Exception(ADDRESS),
    );
    case(
        "encapsulated, bad type",
        "PDU 6.19",
        vec![43, 99, 1, 0],
        Exception(FUNCTION),
    );

    // quantities
    for (id, f, quantity) in [
        ("read 0 coils", 1, 0),
        ("read 2001 coils", 1, 2001),
        ("read 65535 coils", 1, 65535),
        ("read 0 discrete inputs", 2, 0),
        ("read 2001 discrete inputs", 2, 2001),
        ("read 0 holding registers", 3, 0),
        ("read 126 holding registers", 3, 126),
        ("read 65535 holding registers", 3, 65535),
        ("read 0 input registers", 4, 0),
        ("read 126 input registers", 4, 126),
    ] {
        case(
            id,
            "PDU 6.1-6.4",
            request(f, &[0, quantity], &[]),
            Exception(VALUE),
        );
    }
    case(
        "write 0 coils",
        "PDU 6.11",
        request(15, &[0, 0], &[0]),
        Exception(VALUE),
    );
    case(
        "write 1969 coils",
        "PDU 6.11",
        request(15, &[0, 1969], &counted(247, 247)),
        Exception(VALUE),
    );
    case(
        "write 0 registers",
        "PDU 6.12",
        request(16, &[at, 0], &[0]),
        Exception(VALUE),
    );
    case(
        "write 124 registers",
        "PDU 6.12",
        request(16, &[at, 124], &counted(248, 246)),
        Exception(VALUE),
    );
    case(
        "exchange, read 0",
        "PDU 6.17",
        request(23, &[at, 0, at, 1], &counted(2, 2)),
        Exception(VALUE),
    );
    case(
        "exchange, read 126",
        "PDU 6.17",
        request(23, &[at, 126, at, 1], &counted(2, 2)),
        Exception(VALUE),
    );
    case(
        "exchange, write 0",
        "PDU 6.17",
        request(23, &[at, 1, at, 0], &[0]),
        Exception(VALUE),
    );
    case(
        "exchange, write 122",
        "PDU 6.17",
        request(23, &[at, 1, at, 122], &counted(244, 242)),
        Exception(VALUE),
    );

    // byte counts and values
    case(
        "coils, byte count too small",
        "PDU 6.11",
        request(15, &[16 * at, 9], &counted(1, 2)),
        Exception(VALUE),
    );
    case(
        "coils, byte count too large",
        "PDU 6.11",
        request(15, &[16 * at, 8], &counted(2, 2)),
        Exception(VALUE),
    );
    case(
        "registers, byte count too small",
        "PDU 6.12",
        request(16, &[at, 2], &counted(2, 4)),
        Exception(VALUE),
    );
    case(
        "registers, byte count too large",
        "PDU 6.12",
        request(16, &[at, 1], &counted(4, 4)),
        Exception(VALUE),
    );
    case(
        "registers, byte count odd",
        "PDU 6.12",
        request(16, &[at, 1], &counted(3, 3)),
        Exception(VALUE),
    );
    case(
        "exchange, byte count wrong",
        "PDU 6.17",
        request(23, &[at, 1, at, 2], &counted(2, 4)),
        Exception(VALUE),
    );
    for (id, value) in [
        ("coil value 1", 1),
        ("coil value ff01", 0xff01),
        ("coil value 0100", 0x0100),
    ] {
        case(
            id,
            "PDU 6.5",
            request(5, &[16 * at, value], &[]),
            Exception(VALUE),
        );
    }

    // lengths
    for (id, f) in [
        ("function 1 alone", 1),
        ("function 3 alone", 3),
        ("function 5 alone", 5),
        ("function 6 alone", 6),
        ("function 15 alone", 15),
        ("function 16 alone", 16),
        ("function 22 alone", 22),
        ("function 23 alone", 23),
        ("function 43 alone", 43),
    ] {
        case(id, "PDU 7", vec![f], Exception(VALUE));
    }
    case(
        "read, a byte short",
        "PDU 6.3",
        vec![3, 0, 0, 0],
        Exception(VALUE),
    );
    case(
        "read, a byte long",
        "PDU 6.3",
        vec![3, 0, 0, 0, 1, 0],
        Exception(VALUE),
    );
    case(
        "write register, a byte short",
        "PDU 6.6",
        vec![6, 0, 0, 0],
        Exception(VALUE),
    );
    case(
        "write register, a byte long",
        "PDU 6.6",
        request(6, &[at, a], &[0]),
        Exception(VALUE),
    );
    case(
        "write coil, a byte long",
        "PDU 6.5",
        request(5, &[16 * at, 0], &[0]),
        Exception(VALUE),
    );
    case(
        "write registers, data short",
        "PDU 6.12",
        request(16, &[at, 2], &counted(4, 3)),
        Exception(VALUE),
    );
    case(
        "write registers, data long",
        "PDU 6.12",
        request(16, &[at, 1], &counted(2, 3)),
        Exception(VALUE),
    );
    case(
        "write coils, data short",
        "PDU 6.11",
        request(15, &[16 * at, 16], &counted(2, 1)),
        Exception(VALUE),
    );
    case(
        "mask write, a word short",
        "PDU 6.16",
        request(22, &[at, 0xffff], &[]),
        Exception(VALUE),
    );
    case(
        "longest write fits",
        "PDU 6.12",
        request(16, &[at, 123], &counted(246, 246)),
        Understood,
    );
    case(
        "longest exchange fits",
        "PDU 6.17",
        request(23, &[at, 125, at, 121], &counted(242, 242)),
        Understood,
    );

    // addresses
    for (f, end) in [
        (1, map.coils),
        (2, map.discretes),
        (3, map.holding),
        (4, map.inputs),
    ] {
        case(
            "read beyond the map",
            "PDU 7",
            request(f, &[end, 1], &[]),
            Exception(ADDRESS),
        );
        case(
            "read over the end",
            "PDU 7",
            request(f, &[end - 1, 2], &[]),
            Exception(ADDRESS),
        );
        case(
            "read past 65535",
            "PDU 7",
            request(f, &[65535, 2], &[]),
            Exception(ADDRESS),
        );
    }
    case(
        "write coil beyond",
        "PDU 7",
        request(5, &[map.coils, 0], &[]),
        Exception(ADDRESS),
    );
    case(
        "write register beyond",
        "PDU 7",
        request(6, &[map.holding, 0], &[]),
        Exception(ADDRESS),
    );
    case(
        "mask write beyond",
        "PDU 7",
        request(22, &[map.holding, 0, 0], &[]),
        Exception(ADDRESS),
    );
    case(
        "write coils over the end",
        "PDU 7",
        request(15, &[map.coils - 1, 2], &[1, 0]),
        Exception(ADDRESS),
    );
    case(
        "write registers past 65535",
        "PDU 7",
        request(16, &[65535, 2], &counted(4, 4)),
        Exception(ADDRESS),
    );
    case(
        "exchange, read beyond",
        "PDU 7",
        request(
            23,
            &[map.holding, 1, at, 1],
            &[&[2][..], &words(&[!a])].concat(),
        ),
        Exception(ADDRESS),
    );
    case(
        "exchange, write over the end",
        "PDU 7",
        request(23, &[at, 1, map.holding - 1, 2], &counted(4, 4)),
        Exception(ADDRESS),
    );
    case(
        "value before address",
        "PDU 7",
        request(3, &[65535, 0], &[]),
        Exception(VALUE),
    );
    case(
        "what was refused has changed nothing",
        "PDU 7",
        request(3, &[at, 2], &[]),
        Reply(request(3, &[], &[&[4][..], &words(&held)].concat())),
    );
    cases
}

impl Wanted {
    /// For people, with the request's function.
    fn text(&self) -> String {
        match self {
            Self::Exception(codes) => format!("exception {}", codes[0]),
            Self::Reply(pdu) => hex(pdu),
            Self::Bytes(n) => format!("{n} bytes"),
            Self::Begins(bytes) => format!("{} …", hex(bytes)),
            Self::FunctionOrSilence => "exception 1, or silence".into(),
            Self::Understood => "the write, or exception 2".into(),
        }
    }

    fn is_met(&self, function: u8, reaction: &Reaction) -> bool {
        let refused = |pdu: &[u8], codes: &[u8]| matches!(pdu, [f, code] if *f == function | 0x80 && codes.contains(code));
        match (self, reaction) {
            (Self::Exception(codes), Reaction::Reply(pdu)) => refused(pdu, codes),
            (Self::Reply(wanted), Reaction::Reply(pdu)) => wanted == pdu,
            (Self::Bytes(n), Reaction::Reply(pdu)) => {
                pdu.len() == n + 2 && pdu[0] == function && usize::from(pdu[1]) == *n
            }
            (Self::Begins(bytes), Reaction::Reply(pdu)) => pdu.starts_with(bytes),
            (Self::FunctionOrSilence, Reaction::Reply(pdu)) => refused(pdu, FUNCTION),
            (Self::FunctionOrSilence, Reaction::Silence) => true,
            (Self::Understood, Reaction::Reply(pdu)) => pdu[0] == function || refused(pdu, ADDRESS),
            _ => false,
        }
    }
}

/// The registers that are written, as they are now.
fn held(server: Server) -> Result<[u16; 2], String> {
    let mut client = Client::connect(server.address).map_err(|error| error.to_string())?;
    match client.ask(&request(3, &[server.map.scratch, 2], &[])) {
        Reaction::Reply(pdu) if pdu.len() == 6 && pdu[0] == 3 => Ok([
            u16::from_be_bytes([pdu[2], pdu[3]]),
            u16::from_be_bytes([pdu[4], pdu[5]]),
        ]),
        other => Err(format!("cannot read the scratch registers: {other}")),
    }
}

/// Runs the cases, each on a connection that still stands.
pub fn run(server: Server, keep: &mut impl FnMut(Outcome)) {
    let (held, unreadable) = match held(server) {
        Ok(held) => (held, None),
        Err(error) => ([0; 2], Some(error)),
    };
    let mut client = Client::connect(server.address).ok();
    for case in cases(&server.map, held) {
        let function = case.request[0];
        let reaction = match client.as_mut() {
            _ if unreadable.is_some() => Reaction::Garbage(unreadable.clone().unwrap_or_default()),
            Some(client) => client.ask(&case.request),
            None => Reaction::Garbage("no connection".into()),
        };
        let met = case.wanted.is_met(function, &reaction);
        keep(Outcome {
            id: case.id,
            source: case.source,
            sent: hex(&case.request),
            wanted: case.wanted.text(),
            failed: (!met).then(|| reaction.to_string()),
        });
        // after anything but a reply, what comes next might be meant for the last request
        if !matches!(reaction, Reaction::Reply(_)) {
            client = Client::connect(server.address).ok();
        }
    }
}
