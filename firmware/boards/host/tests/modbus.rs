//! The native board as its clients see it: tokio-modbus where a decent client does, a raw socket where none would.
//!
//! Loopback only, and every dialogue has to end in time.

use std::io::ErrorKind;
use std::net::SocketAddr;
use std::time::{Duration, Instant};

use board_host::{Board, CLIENTS, Options};
use embassy_time::Duration as Ticks;
use firmware::link::control::{Access, Right};
use firmware::link::modbus::tcp::Timeouts;
use model_core::image::{COMMAND_WORDS, Image, LINK_STATUS, RESPONSE_DELAY, TENSION_SET, V_SET};
use model_core::link_words::link_status;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpSocket, TcpStream};
use tokio::time::{sleep, timeout};
use tokio_modbus::client::{Context, tcp};
use tokio_modbus::prelude::{ExceptionCode, Reader, Writer};

const LONG_ENOUGH: Duration = Duration::from_secs(20);

/// Half a header: no request is shorter.
const HALF: &[u8] = &[0, 1, 0, 0];
/// Reads command 0.
const READ: &[u8] = &[0, 1, 0, 0, 0, 6, 1, 3, 0, 0, 0, 1];
const READ_REPLY: usize = 11;

fn still(_: &mut Image) {}

fn board(timeouts: Timeouts) -> Board {
    let mut options = Options {
        timeouts,
        ..Options::default()
    };
    for (w, word) in options.image.feedback.words.iter_mut().enumerate() {
        *word = 0x0100 + w as u16;
    }
    Board::start(options, still).expect("a free port")
}

async fn client(board: &Board) -> Context {
    tcp::connect(board.address).await.expect("a listener")
}

async fn raw(board: &Board) -> TcpStream {
    TcpStream::connect(board.address).await.expect("a listener")
}

async fn in_time<T>(dialogue: impl Future<Output = T>) -> T {
    timeout(LONG_ENOUGH, dialogue).await.expect("in time")
}

/// The board has closed or reset the connection, with no byte before.
async fn is_dropped(stream: &mut TcpStream) -> bool {
    match in_time(stream.read(&mut [0])).await {
        Ok(n) => n == 0,
        Err(error) => error.kind() == ErrorKind::ConnectionReset,
    }
}

/// Writes the register and reads it back.
async fn is_served(client: &mut Context, value: u16) {
    let values = [value];
    let exchange = client.read_write_multiple_registers(0, 1, 0, &values);
    let read = in_time(exchange).await.expect("connected");
    assert_eq!(read, Ok(values.to_vec()));
}

#[tokio::test]
async fn every_function_makes_the_round_trip() {
    let board = board(Timeouts::default());
    let mut c = client(&board).await;
    in_time(async {
        // 5 and 1
        c.write_single_coil(16, true).await.unwrap().unwrap();
        c.write_single_coil(18, true).await.unwrap().unwrap();
        c.write_single_coil(16, false).await.unwrap().unwrap();
        let coils = c.read_coils(16, 4).await.unwrap().unwrap();
        assert_eq!(coils, [false, false, true, false]);
        // 15: thirteen of them, over a word's end
        let pattern = [1, 1, 0, 1, 0, 0, 1, 1, 1, 0, 0, 0, 1].map(|bit| bit == 1);
        c.write_multiple_coils(10, &pattern).await.unwrap().unwrap();
        assert_eq!(c.read_coils(10, 13).await.unwrap().unwrap(), pattern);
        // 6 and 3
        c.write_single_register(6, 0xbeef).await.unwrap().unwrap();
        assert_eq!(
            c.read_holding_registers(6, 1).await.unwrap().unwrap(),
            [0xbeef]
        );
        // 16: the whole block, as PLCs do
        let mut all: [u16; COMMAND_WORDS] = std::array::from_fn(|w| 0x8000 + w as u16);
        all[usize::from(RESPONSE_DELAY.word)] = 0;
        c.write_multiple_registers(0, &all).await.unwrap().unwrap();
        let read = c.read_holding_registers(0, COMMAND_WORDS as u16);
        assert_eq!(read.await.unwrap().unwrap(), all);
        // 23
        let exchanged = c.read_write_multiple_registers(0, 3, 1, &[7, 8]).await;
        assert_eq!(exchanged.unwrap().unwrap(), [0x8000, 7, 8]);
        // 4 and 2
        let inputs = c.read_input_registers(0, 3).await.unwrap().unwrap();
        assert_eq!(inputs, [0x0100, 0x0101, 0x0102]);
        let discretes = c.read_discrete_inputs(24, 3).await.unwrap().unwrap();
        assert_eq!(discretes, [true, false, false]);
        assert_eq!(
            board.image.lock(|image| image.borrow().commands.words[1]),
            7
        );
    })
    .await;
}

#[tokio::test]
async fn a_decent_client_understands_the_refusals() {
    let board = board(Timeouts::default());
    let mut c = client(&board).await;
    in_time(async {
        let end = COMMAND_WORDS as u16;
        let refused = [
            c.read_holding_registers(end, 1).await.unwrap().unwrap_err(),
            c.read_input_registers(0, 0).await.unwrap().unwrap_err(),
            c.write_multiple_registers(end - 1, &[1, 2])
                .await
                .unwrap()
                .unwrap_err(),
            c.masked_write_register(end, 0, 0)
                .await
                .unwrap()
                .unwrap_err(),
        ];
        let codes = [
            ExceptionCode::IllegalDataAddress,
            ExceptionCode::IllegalDataValue,
            ExceptionCode::IllegalDataAddress,
            ExceptionCode::IllegalDataAddress,
        ];
        assert_eq!(refused, codes);
    })
    .await;
    is_served(&mut c, 1).await;
}

#[tokio::test]
async fn eight_clients_are_served_at_once() {
    let board = board(Timeouts::default());
    let mut polls = Vec::new();
    for register in 0..CLIENTS as u16 {
        let mut c = client(&board).await;
        polls.push(tokio::spawn(async move {
            for value in 0..200 {
                c.write_single_register(register, value)
                    .await
                    .unwrap()
                    .unwrap();
                let read = c.read_holding_registers(register, 1).await;
                assert_eq!(read.unwrap().unwrap(), [value]);
            }
        }));
    }
    for poll in polls {
        in_time(poll).await.unwrap();
    }
}

#[tokio::test]
async fn the_ninth_client_displaces_the_longest_idle() {
    let board = board(Timeouts::default());
    let mut first = client(&board).await;
    is_served(&mut first, 1).await;
    let mut second = raw(&board).await;
    second.write_all(READ).await.unwrap();
    in_time(second.read_exact(&mut [0; READ_REPLY]))
        .await
        .unwrap();
    let mut others = Vec::new();
    for i in 2..CLIENTS as u16 {
        let mut c = client(&board).await;
        is_served(&mut c, i).await;
        others.push(c);
    }
    is_served(&mut first, 100).await;
    let mut ninth = client(&board).await;
    assert!(is_dropped(&mut second).await);
    others.extend([first]);
    for c in &mut others {
        is_served(c, 200).await;
    }
    is_served(&mut ninth, 300).await;
}

#[tokio::test]
async fn writes_are_whole_and_reads_are_not_torn() {
    let board = board(Timeouts::default());
    let all = COMMAND_WORDS as u16;
    let (mut writer, mut reader) = (client(&board).await, client(&board).await);
    let written = writer.write_multiple_registers(0, &[0; COMMAND_WORDS]);
    assert_eq!(in_time(written).await.expect("connected"), Ok(()));
    let write = async {
        for value in 0..1000u16 {
            let mut words = [value; COMMAND_WORDS];
            words[usize::from(RESPONSE_DELAY.word)] = 0;
            writer
                .write_multiple_registers(0, &words)
                .await
                .unwrap()
                .unwrap();
        }
    };
    let read = async {
        let mut last = 0;
        while last < 999 {
            let words = reader
                .read_holding_registers(0, all)
                .await
                .unwrap()
                .unwrap();
            if words[1] == words[2] {
                let written = &words[..usize::from(RESPONSE_DELAY.word)];
                assert!(written.iter().all(|word| *word == words[1]), "{words:?}");
                last = words[1];
            }
        }
    };
    in_time(async { tokio::join!(write, read) }).await;
}

#[tokio::test]
async fn forty_pipelined_requests_are_answered_in_order() {
    let board = board(Timeouts::default());
    let mut stream = raw(&board).await;
    let requests: Vec<u8> = (0..40)
        .flat_map(|i| [0x12, i, 0, 0, 0, 6, i, 3, 0, i % 16, 0, 1])
        .collect();
    in_time(async {
        for _ in 0..10 {
            stream.write_all(&requests).await.unwrap();
            let mut replies = vec![0; 40 * READ_REPLY];
            stream.read_exact(&mut replies).await.unwrap();
            for (i, reply) in (0..).zip(replies.chunks(READ_REPLY)) {
                assert_eq!(reply[..9], [0x12, i, 0, 0, 0, 5, i, 3, 2]);
            }
        }
    })
    .await;
}

#[tokio::test]
async fn a_client_may_send_byte_by_byte() {
    let board = board(Timeouts::default());
    let mut stream = raw(&board).await;
    stream.set_nodelay(true).unwrap();
    in_time(async {
        for byte in READ {
            stream.write_all(&[*byte]).await.unwrap();
            tokio::task::yield_now().await;
        }
        stream.read_exact(&mut [0; READ_REPLY]).await.unwrap();
    })
    .await;
}

#[tokio::test]
async fn what_is_not_modbus_is_disconnected() {
    let board = board(Timeouts::default());
    for bytes in [
        &b"GET / HTTP/1.1\r\n\r\n"[..],
        &[0, 1, 0, 0, 0, 1, 1, 3],
        &[0, 1, 0, 7, 0, 6],
    ] {
        let mut stream = raw(&board).await;
        stream.write_all(bytes).await.unwrap();
        assert!(is_dropped(&mut stream).await);
    }
}

#[tokio::test]
async fn resets_in_mid_request_hurt_nobody() {
    let board = board(Timeouts::default());
    let mut plc = client(&board).await;
    for cut in 0..READ.len() {
        let mut stream = raw(&board).await;
        stream.write_all(&READ[..cut]).await.unwrap();
        stream.set_zero_linger().unwrap();
        drop(stream);
        is_served(&mut plc, cut as u16).await;
    }
}

#[tokio::test]
async fn a_storm_of_connections_does_not_displace_the_plc() {
    let board = board(Timeouts::default());
    let mut plc = client(&board).await;
    is_served(&mut plc, 0).await;
    let mut held = std::collections::VecDeque::new();
    for i in 0..500u16 {
        let mut stream = raw(&board).await;
        // some ask for something, some for half of it, some go at once with a reset, some stay
        match i % 4 {
            0 => {
                in_time(stream.write_all(READ)).await.unwrap();
                in_time(stream.read_exact(&mut [0; READ_REPLY]))
                    .await
                    .unwrap();
            }
            1 => in_time(stream.write_all(HALF)).await.unwrap(),
            2 => stream.set_zero_linger().unwrap(),
            _ => held.push_back(stream),
        }
        if held.len() > 2 * CLIENTS {
            held.pop_front();
        }
        if i % 10 == 0 {
            is_served(&mut plc, i).await;
        }
    }
    is_served(&mut plc, 500).await;
    is_served(&mut client(&board).await, 501).await;
}

#[tokio::test]
async fn half_a_header_blocks_nobody_and_ends() {
    let board = board(Timeouts::default());
    let mut plc = client(&board).await;
    let mut stalled = Vec::new();
    let start = Instant::now();
    for _ in 1..CLIENTS {
        let mut stream = raw(&board).await;
        stream.write_all(HALF).await.unwrap();
        stalled.push(stream);
    }
    while start.elapsed() < Duration::from_millis(500) {
        let asked = Instant::now();
        is_served(&mut plc, 1).await;
        assert!(asked.elapsed() < Duration::from_millis(500));
        sleep(Duration::from_millis(5)).await;
    }
    for stream in &mut stalled {
        assert!(is_dropped(stream).await);
    }
    let took = start.elapsed();
    assert!(took >= Duration::from_millis(900), "{took:?}");
    assert!(took < Duration::from_secs(5), "{took:?}");
    is_served(&mut plc, 2).await;
}

#[tokio::test]
async fn silent_clients_are_dropped() {
    let board = board(Timeouts {
        idle: Ticks::from_millis(200),
        ..Timeouts::default()
    });
    let (mut silent, mut served) = (raw(&board).await, raw(&board).await);
    served.write_all(READ).await.unwrap();
    in_time(served.read_exact(&mut [0; READ_REPLY]))
        .await
        .unwrap();
    assert!(is_dropped(&mut silent).await);
    assert!(is_dropped(&mut served).await);
}

#[tokio::test]
async fn who_never_reads_is_dropped_and_blocks_nobody() {
    let board = board(Timeouts {
        write: Ticks::from_millis(200),
        ..Timeouts::default()
    });
    let mut plc = client(&board).await;
    let mut deaf = raw(&board).await;
    let requests = READ.repeat(1000);
    let mut flood = tokio::spawn(async move {
        // until the board has had enough of it
        while deaf.write_all(&requests).await.is_ok() {}
    });
    let mut polls = 0;
    in_time(async {
        while !flood.is_finished() {
            is_served(&mut plc, polls).await;
            polls = polls.wrapping_add(1);
            sleep(Duration::from_millis(1)).await;
        }
    })
    .await;
    assert!(polls > 10);
    (&mut flood).await.unwrap();
    is_served(&mut plc, 0).await;
}

/// A client at another address of loopback.
async fn client_from(board: &Board, last: u8) -> Context {
    let socket = TcpSocket::new_v4().expect("a socket");
    let address = SocketAddr::from(([127, 0, 0, last], 0));
    socket.bind(address).expect("an address of loopback");
    tcp::attach(socket.connect(board.address).await.expect("a listener"))
}

#[tokio::test]
async fn one_plc_controls_and_the_others_read_and_put_in_faults() {
    let board = board(Timeouts::default());
    let (mut plc, mut other) = (client_from(&board, 1).await, client_from(&board, 2).await);
    in_time(async {
        let busy = Err(ExceptionCode::ServerDeviceBusy);
        plc.write_single_register(6, 1000).await.unwrap().unwrap();
        assert_eq!(other.write_single_register(6, 2000).await.unwrap(), busy);
        // faults and commands in one request: none of it counts
        let faults = other.write_multiple_registers(19, &[500, 1]).await;
        assert_eq!(faults.unwrap(), busy);
        let read = other.read_holding_registers(6, 15).await.unwrap().unwrap();
        assert_eq!((read[0], read[14]), (1000, 0));
        let fault = other.write_single_register(20, 1).await;
        assert_eq!(fault.unwrap(), Ok(()));
        let status = plc.read_input_registers(LINK_STATUS.word, 3).await;
        let controls = link_status::PLC_CONTROLS;
        assert_eq!(status.unwrap().unwrap(), [controls, 0, 2]);
    })
    .await;
}

#[tokio::test]
async fn the_access_table_keeps_clients_out_or_from_writing() {
    let mut access = Access::default();
    assert!(access.set([127, 0, 0, 2].into(), Right::Read));
    assert!(access.set([127, 0, 0, 3].into(), Right::None));
    let options = Options {
        access,
        ..Options::default()
    };
    let board = Board::start(options, still).expect("a free port");
    let (mut reader, mut nobody) = (client_from(&board, 2).await, client_from(&board, 3).await);
    in_time(async {
        assert!(reader.read_holding_registers(0, 5).await.unwrap().is_ok());
        for register in [6, 20] {
            let write = reader.write_single_register(register, 1).await.unwrap();
            assert_eq!(write, Err(ExceptionCode::IllegalFunction), "{register}");
        }
        assert!(nobody.read_holding_registers(0, 1).await.is_err());
    })
    .await;
    is_served(&mut client(&board).await, 1).await;
}

#[tokio::test]
async fn a_set_point_outside_its_limits_is_named_and_costs_the_block_nothing() {
    let board = board(Timeouts::default());
    let mut plc = client(&board).await;
    in_time(async {
        let v_set = usize::from(V_SET.word);
        let mut block = board.image.lock(|image| image.borrow().commands.words);
        (block[v_set], block[v_set + 2]) = (30_000, 700);
        plc.write_multiple_registers(0, &block)
            .await
            .unwrap()
            .unwrap();
        let link = plc.read_input_registers(LINK_STATUS.word, 2).await;
        let link = link.unwrap().unwrap();
        let status = link_status::LIMITED | link_status::PLC_CONTROLS;
        assert_eq!(link, [status, V_SET.word + 1]);
        let commands = board.image.lock(|image| image.borrow().commands);
        assert!(commands.get::<f32>(&V_SET) <= V_SET.limits.1);
        assert_eq!(commands.word(&TENSION_SET), 700);
    })
    .await;
}
