//! Modbus, server side.
//!
//! Not here: a client, and function codes beyond the data access that PLCs use. One [`pdu::respond`] serves
//! every transport.

pub mod identity;
pub mod pdu;
pub mod rtu;
pub mod tcp;

use core::ops::Range;

use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Instant};
use model_core::image::{self, Image};

use self::pdu::{Exception, Gate, Pdu, respond};
use crate::link::control::{ClientId, Control, Denied, WordSet};
use crate::link::{Client, Service};

/// The gate of one client, at one moment.
struct Visit<'a> {
    control: &'a mut Control,
    id: ClientId,
    now: Instant,
}

impl Gate for Visit<'_> {
    fn permit(&mut self, words: &Range<usize>) -> Result<(), Exception> {
        let may = self.control.may_write(self.id, words, self.now);
        may.map_err(|denied| match denied {
            Denied::ReadOnly => Exception::IllegalFunction,
            Denied::Occupied(_) => Exception::ServerDeviceBusy,
        })
    }

    fn written(&mut self, words: Range<usize>, outside: WordSet) {
        self.control.wrote(self.id, words, outside, self.now);
    }
}

/// Does what a client asks, and keeps the link's own words: one event to everybody else.
pub fn serve<M: RawMutex>(client: &Client<'_, M>, request: &[u8], reply: &mut Pdu) {
    client.visit(|id, image, control| answer(request, id, Instant::now(), image, control, reply));
}

/// As [`serve`], on what it serves.
fn answer(
    request: &[u8],
    id: ClientId,
    now: Instant,
    image: &mut Image,
    control: &mut Control,
    reply: &mut Pdu,
) {
    control.asks(id, key(request), now);
    control.report(now, &mut image.feedback);
    let mut visit = Visit { control, id, now };
    respond(request, image, &mut visit, reply);
    if is_exception(reply) {
        control.is_refused(id);
    }
}

/// The reply is an exception.
fn is_exception(reply: &[u8]) -> bool {
    matches!(reply, [function, _] if function & pdu::REFUSED != 0)
}

/// What tells one question of a client from another: function and first address.
fn key(request: &[u8]) -> u32 {
    request
        .iter()
        .take(3)
        .fold(0, |key, byte| key << 8 | u32::from(*byte))
}

/// How long a request waits before it is done: what the test asks for.
pub fn response_delay<M: RawMutex>(service: &Service<'_, M>) -> Duration {
    let ms: f32 = service
        .image
        .lock(|image| image.borrow().commands.get(&image::RESPONSE_DELAY));
    Duration::from_millis(ms as u64)
}
