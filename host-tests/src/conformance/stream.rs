//! Frames on a connection, and connections.
//!
//! Not here: what is asked. Every request reads the scratch registers.

use std::io::Write;
use std::net::{Shutdown, TcpStream};
use std::thread;
use std::time::{Duration, Instant};

use socket2::SockRef;

use super::{Client, Outcome, PATIENCE, Reaction, Server, frame};

/// A case: what is done, what must come of it, and the doing.
type Case = (
    &'static str,
    &'static str,
    &'static str,
    &'static str,
    fn(Server) -> Result<(), String>,
);

/// Clients that are served at once.
const CLIENTS: usize = 8;
/// Requests in one segment.
const DEPTH: u16 = 40;
/// Connections of a storm.
const STORM: usize = 1000;
/// A stalled request is given up after a second; on a busy PC a little later.
const STALLED: Duration = Duration::from_secs(4);

const CASES: &[Case] = &[
    (
        "transaction and unit are echoed",
        "TCP 3.1.3",
        "transactions 0, 1234, ffff; units 0, 1, 17, 255",
        "the same, with a reply",
        echo,
    ),
    (
        "protocol id 1",
        "TCP 3.1.3",
        "a header with protocol 1",
        "closed",
        |s| closes(s, &[0, 1, 0, 1, 0, 6, 1, 3, 0, 0, 0, 1]),
    ),
    (
        "length 0",
        "TCP 3.1.3",
        "a header with length 0",
        "closed",
        |s| closes(s, &[0, 1, 0, 0, 0, 0]),
    ),
    (
        "length 1",
        "TCP 3.1.3",
        "a header with length 1",
        "closed",
        |s| closes(s, &[0, 1, 0, 0, 0, 1, 1]),
    ),
    (
        "length 255",
        "TCP 4.2",
        "a header with length 255",
        "closed",
        |s| closes(s, &[0, 1, 0, 0, 0, 255, 1, 3]),
    ),
    (
        "length 65535",
        "TCP 4.2",
        "a header with length 65535",
        "closed",
        |s| closes(s, &[0, 1, 0, 0, 255, 255, 1, 3]),
    ),
    (
        "single bytes",
        "TCP 4.3",
        "a request byte by byte",
        "one reply",
        single_bytes,
    ),
    (
        "two in one segment",
        "TCP 4.3",
        "two requests at once",
        "two replies in order",
        |s| pipeline(s, 2),
    ),
    (
        "forty in one segment",
        "TCP 4.3",
        "40 requests at once",
        "40 replies in order",
        |s| pipeline(s, DEPTH),
    ),
    (
        "a request and a half",
        "TCP 4.3",
        "1.5 requests, the rest later",
        "two replies",
        one_and_a_half,
    ),
    (
        "eight clients",
        "TCP 4.2",
        "8 connections, all asking in turn",
        "all served",
        eight,
    ),
    (
        "the ninth client",
        "TCP 4.2.1",
        "8 connections and one more",
        "all served but the longest idle",
        ninth,
    ),
    (
        "half a header blocks nobody",
        "TCP 4.2",
        "7 half headers, and a client",
        "the client served at once",
        stalled,
    ),
    (
        "half a header ends",
        "TCP 4.2",
        "half a header",
        "closed after 1 s",
        stalled_ends,
    ),
    (
        "FIN in mid-request",
        "TCP 4.3",
        "half a request and a FIN, 20 times",
        "others served",
        |s| cut(s, false),
    ),
    (
        "RST in mid-request",
        "TCP 4.3",
        "half a request and a RST, 20 times",
        "others served",
        |s| cut(s, true),
    ),
    (
        "a client that never reads",
        "TCP 4.3",
        "requests until the server blocks",
        "others served",
        never_reads,
    ),
    (
        "a reconnect storm",
        "TCP 4.2",
        "1000 connects, none asks, all stay or are reset",
        "a client served",
        storm,
    ),
];

/// Runs the cases.
pub fn run(server: Server, keep: &mut impl FnMut(Outcome)) {
    for (id, source, sent, wanted, case) in CASES {
        // whatever a case does to a server, the next one finds out, not we
        let failed = case(server).err();
        keep(Outcome {
            id,
            source,
            sent: (*sent).into(),
            wanted: (*wanted).into(),
            failed,
        });
    }
}

fn connect(server: Server) -> Result<Client, String> {
    Client::connect(server.address).map_err(|error| format!("no connection: {error}"))
}

fn read(server: Server) -> Vec<u8> {
    let [a, b] = server.map.scratch.to_be_bytes();
    vec![3, a, b, 0, 1]
}

/// The reply to a read of one register.
fn is_reply(reaction: &Reaction) -> Result<(), String> {
    match reaction {
        Reaction::Reply(pdu) if pdu.len() == 4 && pdu[..2] == [3, 2] => Ok(()),
        other => Err(other.to_string()),
    }
}

fn served(client: &mut Client, server: Server) -> Result<(), String> {
    is_reply(&client.ask(&read(server)))
}

fn echo(server: Server) -> Result<(), String> {
    let mut client = connect(server)?;
    for (transaction, unit) in [(0, 1), (0x1234, 1), (0xffff, 1), (1, 0), (2, 17), (3, 255)] {
        client.send(&frame(transaction, unit, &read(server)));
        is_reply(&client.reply(transaction, unit))
            .map_err(|error| format!("unit {unit}: {error}"))?;
    }
    Ok(())
}

fn closes(server: Server, bytes: &[u8]) -> Result<(), String> {
    let mut client = connect(server)?;
    client.send(bytes);
    match client.reply(0, 0) {
        Reaction::Close => served(&mut connect(server)?, server),
        other => Err(other.to_string()),
    }
}

fn single_bytes(server: Server) -> Result<(), String> {
    let mut client = connect(server)?;
    for byte in frame(7, 1, &read(server)) {
        client.send(&[byte]);
        thread::sleep(Duration::from_millis(2));
    }
    is_reply(&client.reply(7, 1))
}

fn pipeline(server: Server, depth: u16) -> Result<(), String> {
    let mut client = connect(server)?;
    let requests: Vec<u8> = (0..depth)
        .flat_map(|i| frame(i, 1, &read(server)))
        .collect();
    client.send(&requests);
    for i in 0..depth {
        is_reply(&client.reply(i, 1)).map_err(|error| format!("reply {i}: {error}"))?;
    }
    Ok(())
}

fn one_and_a_half(server: Server) -> Result<(), String> {
    let mut client = connect(server)?;
    let bytes = [frame(1, 1, &read(server)), frame(2, 1, &read(server))].concat();
    let (most, rest) = bytes.split_at(bytes.len() * 3 / 4);
    client.send(most);
    is_reply(&client.reply(1, 1))?;
    client.send(rest);
    is_reply(&client.reply(2, 1))
}

/// So many clients, each of which has been served.
fn clients(server: Server, count: usize) -> Result<Vec<Client>, String> {
    let mut clients = Vec::new();
    for i in 0..count {
        let mut client = connect(server)?;
        served(&mut client, server).map_err(|error| format!("client {}: {error}", i + 1))?;
        clients.push(client);
    }
    Ok(clients)
}

fn eight(server: Server) -> Result<(), String> {
    let mut clients = clients(server, CLIENTS)?;
    for _ in 0..10 {
        for (i, client) in clients.iter_mut().enumerate() {
            served(client, server).map_err(|error| format!("client {}: {error}", i + 1))?;
        }
    }
    Ok(())
}

fn ninth(server: Server) -> Result<(), String> {
    let mut all = clients(server, CLIENTS)?;
    // the second one is idle for longest
    for i in [0, 2, 3, 4, 5, 6, 7] {
        served(&mut all[i], server)?;
    }
    let mut newcomer = connect(server)?;
    served(&mut newcomer, server).map_err(|error| format!("the newcomer: {error}"))?;
    for i in [0, 2, 3, 4, 5, 6, 7] {
        served(&mut all[i], server).map_err(|error| format!("client {}: {error}", i + 1))?;
    }
    Ok(())
}

/// Half a header.
const HALF: &[u8] = &[0, 1, 0, 0];

fn stalled(server: Server) -> Result<(), String> {
    let mut stalled = Vec::new();
    for _ in 1..CLIENTS {
        let mut client = connect(server)?;
        client.send(HALF);
        stalled.push(client);
    }
    let began = Instant::now();
    served(&mut connect(server)?, server)?;
    let took = began.elapsed();
    if took < PATIENCE / 2 {
        Ok(())
    } else {
        Err(format!("served after {} ms", took.as_millis()))
    }
}

fn stalled_ends(server: Server) -> Result<(), String> {
    let mut client = connect(server)?;
    client.send(HALF);
    let waiting = client.stream.set_read_timeout(Some(STALLED));
    waiting.map_err(|error| error.to_string())?;
    match client.reply(0, 0) {
        Reaction::Close => Ok(()),
        other => Err(other.to_string()),
    }
}

fn cut(server: Server, reset: bool) -> Result<(), String> {
    let mut other = connect(server)?;
    for i in 0..20 {
        let mut client = connect(server)?;
        let bytes = frame(1, 1, &read(server));
        client.send(&bytes[..1 + i % (bytes.len() - 1)]);
        end(&client.stream, reset);
        drop(client);
        served(&mut other, server)?;
    }
    served(&mut connect(server)?, server)
}

fn end(stream: &TcpStream, reset: bool) {
    // a connection that has ended already need not be ended
    let _ = if reset {
        SockRef::from(stream).set_linger(Some(Duration::ZERO))
    } else {
        stream.shutdown(Shutdown::Both)
    };
}

fn never_reads(server: Server) -> Result<(), String> {
    let mut greedy = connect(server)?;
    let _ = greedy
        .stream
        .set_write_timeout(Some(Duration::from_millis(300)));
    let requests: Vec<u8> = (0..DEPTH)
        .flat_map(|i| frame(i, 1, &read(server)))
        .collect();
    // bounded: a server with endless patience buffers some megabytes at most
    for _ in 0..5000 {
        if greedy.stream.write_all(&requests).is_err() {
            break;
        }
    }
    served(&mut connect(server)?, server)
}

fn storm(server: Server) -> Result<(), String> {
    let mut held = std::collections::VecDeque::new();
    for i in 0..STORM {
        // a server that refuses some does not fail yet
        let Ok(client) = Client::connect(server.address) else {
            continue;
        };
        if i % 2 == 0 {
            end(&client.stream, true);
        } else {
            held.push_back(client);
        }
        if held.len() > 2 * CLIENTS {
            held.pop_front();
        }
    }
    served(&mut connect(server)?, server)?;
    drop(held);
    served(&mut connect(server)?, server)
}
