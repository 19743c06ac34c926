//! A stream of any bytes, cut anywhere: the frames are those of the whole, read naively.
//!
//! The first byte tells how many cuts there are, the next ones where.
#![no_main]

use firmware::link::modbus::tcp::{ADU_MAX, Malformed, Reassembler};
use libfuzzer_sys::fuzz_target;

type Request = ([u8; 2], u8, Vec<u8>);

fuzz_target!(|data: &[u8]| {
    let Some((&count, rest)) = data.split_first() else {
        return;
    };
    let (cuts, bytes) = rest.split_at(rest.len().min(count.into()));
    let (mut frames, mut requests) = (Reassembler::default(), Vec::new());
    let mut malformed = false;
    let mut left = bytes;
    let mut lengths = cuts.iter().map(|cut| usize::from(*cut));
    'stream: while !left.is_empty() {
        let length = lengths.next().unwrap_or(left.len()).min(left.len());
        let (mut piece, after) = left.split_at(length);
        left = after;
        loop {
            match frames.push(&mut piece) {
                Ok(Some(request)) => {
                    assert!(request.pdu.len() < ADU_MAX && !request.pdu.is_empty());
                    requests.push((request.transaction, request.unit, request.pdu.to_vec()));
                }
                Ok(None) => break,
                Err(Malformed) => {
                    malformed = true;
                    break 'stream;
                }
            }
        }
        assert!(piece.is_empty());
    }
    assert_eq!((requests, malformed), naive(bytes));
});

fn naive(mut bytes: &[u8]) -> (Vec<Request>, bool) {
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
