//! The stream of signals over a WebSocket: raw counts, as often as the client wishes and the line allows.
//!
//! Not here: scaling and averaging. A sample is what the image holds after a drive cycle. A client that reads slowly
//! misses samples; it never makes anybody wait, and what it gets is always the latest.

use core::fmt::Write as _;

use embassy_sync::blocking_mutex::raw::RawMutex;
use heapless::{String, Vec};
use model_core::drive::DRIVE_PERIOD_MS;
use model_core::image::{Direction, Image, Kind, SIGNALS, Signal};
use picoserve::futures::Either;
use picoserve::io::{Read, Write};
use picoserve::response::ws::{Message, SocketRx, SocketTx, WebSocketCallback};
use serde::Deserialize;

use super::Hmi;
use super::answer::{Detail, List, Refusal, Text};
use super::body::is_shallow;

/// Signals in one stream.
const SIGNALS_MAX: usize = 96;
/// Samples a second.
const HZ_MAX: u32 = 50;
/// Unless the client says otherwise.
const HZ: u32 = 25;
/// Drive cycles a second.
const CYCLES_HZ: u32 = 1000 / DRIVE_PERIOD_MS;
/// Longest message of a client, in bytes.
const MESSAGE_BYTES: usize = 2048;
/// Longest sample, in characters: brackets, a cycle, and each signal with its comma.
const SAMPLE: usize = 16 + 11 * SIGNALS_MAX;

/// Status codes of a close. Source: RFC 6455, section 7.4.1.
const GOING_AWAY: u16 = 1001;
const UNSUPPORTED: u16 = 1003;

/// What a client wants to see.
#[derive(Deserialize)]
struct Wish<'a> {
    #[serde(borrow)]
    signals: Vec<&'a str, SIGNALS_MAX>,
    #[serde(default)]
    hz: Option<u32>,
}

/// What it gets.
#[derive(Clone, Debug, Default)]
struct Subscription {
    signals: Vec<&'static Signal, SIGNALS_MAX>,
    /// Drive cycles from sample to sample.
    every: u32,
}

impl Subscription {
    /// Understands a client's message.
    fn read(text: &str) -> Result<(Self, u32), Refusal> {
        let (wish, _) = serde_json_core::from_str::<Wish>(text).map_err(|_| {
            Refusal::new(
                422,
                format_args!(
                    "send {{\"signals\":[…],\"hz\":…}} with at most {SIGNALS_MAX} names of signals"
                ),
            )
        })?;
        let hz = wish.hz.unwrap_or(HZ);
        if !(1..=HZ_MAX).contains(&hz) {
            let mut refusal = Refusal::new(422, format_args!("hz = {hz} is outside 1 to {HZ_MAX}"));
            refusal.add(Detail {
                limits: Some((1.0, f64::from(HZ_MAX))),
                unit: "Hz",
                ..Detail::new("hz", hz, "outside its limits")
            });
            return Err(refusal);
        }
        let mut signals = Vec::new();
        for name in wish.signals {
            let Some(signal) = SIGNALS.iter().find(|signal| signal.name == name) else {
                let mut refusal = Refusal::new(422, format_args!("there is no signal {name}"));
                refusal.add(Detail::new("signals", Text(name), "no such signal"));
                return Err(refusal);
            };
            // As many as there are wishes.
            let _ = signals.push(signal);
        }
        let every = CYCLES_HZ.div_ceil(hz);
        Ok((Self { signals, every }, hz))
    }

    /// The sample of a moment.
    fn sample(&self, cycle: u32, image: &Image) -> String<SAMPLE> {
        let mut sample = String::new();
        // Fits: see `SAMPLE`.
        let _ = write!(sample, "[{cycle}");
        for signal in &self.signals {
            let _ = write!(sample, ",{}", raw(image, signal));
        }
        let _ = sample.push(']');
        sample
    }
}

/// The counts of a signal.
pub fn raw(image: &Image, signal: &Signal) -> i64 {
    let words: &[u16] = match signal.direction {
        Direction::Command => &image.commands.words,
        Direction::Feedback => &image.feedback.words,
    };
    let first = usize::from(signal.word);
    match (signal.kind, &words[first..]) {
        (Kind::I16, [word, ..]) => i64::from(*word as i16),
        (Kind::U32, [high, low, ..]) => i64::from(*high) << 16 | i64::from(*low),
        (_, [word, ..]) => i64::from(*word),
        (_, []) => 0,
    }
}

/// The stream of one client.
pub struct Live<'a, M: RawMutex> {
    pub hmi: Hmi<'a, M>,
    pub answered: &'a dyn Fn(),
}

impl<M: RawMutex> WebSocketCallback for Live<'_, M> {
    async fn run<R: Read, W: Write<Error = R::Error>>(
        self,
        mut rx: SocketRx<R>,
        mut tx: SocketTx<W>,
    ) -> Result<(), W::Error> {
        let Some(mut cycles) = self.hmi.desk.cycles() else {
            return tx.close((GOING_AWAY, "too many streams")).await;
        };
        let mut subscription = Subscription::default();
        let mut last = None;
        let mut received = [0; MESSAGE_BYTES];
        loop {
            let message = match rx.next_message(&mut received, cycles.changed()).await? {
                Either::First(Ok(message)) => message,
                Either::First(Err(error)) => {
                    return tx.close((error.code(), "not understood")).await;
                }
                Either::Second(_) => {
                    if subscription.signals.is_empty() {
                        continue;
                    }
                    let (cycle, image) = self.hmi.moment();
                    let turn = cycle / subscription.every;
                    if last.replace(turn) != Some(turn) {
                        tx.send_text(&subscription.sample(cycle, &image)).await?;
                        (self.answered)();
                    }
                    continue;
                }
            };
            match message {
                Message::Text(text) if !is_shallow(text.as_bytes()) => {
                    return tx.close((UNSUPPORTED, "nested too deep")).await;
                }
                Message::Text(text) => {
                    let mut reply = String::<MESSAGE_BYTES>::new();
                    // What does not fit is a list of long names, and those the client knows.
                    let _ = match Subscription::read(text) {
                        Ok((wanted, hz)) => {
                            subscription = wanted;
                            let names = subscription.signals.iter().map(|s| Text(s.name));
                            write!(reply, "{{\"signals\":{},\"hz\":{hz}}}", List(names))
                        }
                        Err(refusal) => write!(reply, "{refusal}"),
                    };
                    tx.send_text(&reply).await?;
                }
                Message::Ping(data) => tx.send_pong(data).await?,
                Message::Pong(_) => {}
                Message::Binary(_) => return tx.close((UNSUPPORTED, "send text")).await,
                Message::Close(_) => return tx.close(None).await,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use model_core::image;
    use model_core::image::{Commands, Feedback};
    use model_core::machine::Machine;

    #[test]
    fn a_sample_has_the_counts_in_the_order_of_the_wish() {
        let text = r#"{"signals":["length_wu","v_ref","v_set"],"hz":10}"#;
        let (subscription, hz) = Subscription::read(text).expect("right");
        assert_eq!((hz, subscription.every), (10, 10));
        let mut feedback = Feedback::default();
        feedback.set_double(&image::LENGTH_WU, u32::MAX);
        feedback.set(&image::V_REF, -12.5);
        let image = Image {
            commands: Commands::of(&Machine::news_8000()),
            feedback,
        };
        assert_eq!(
            subscription.sample(7, &image).as_str(),
            "[7,4294967295,-125,22000]"
        );
    }

    #[test]
    fn the_longest_sample_fits() {
        let subscription = Subscription {
            signals: [&image::LENGTH_WU; SIGNALS_MAX].into_iter().collect(),
            every: 1,
        };
        let image = Image {
            commands: Commands::default(),
            feedback: Feedback {
                words: [u16::MAX; _],
            },
        };
        assert!(
            subscription
                .sample(u32::MAX, &image)
                .ends_with(",4294967295]")
        );
    }

    #[test]
    fn what_cannot_be_is_refused() {
        for text in [
            "",
            "[]",
            "{}",
            r#"{"signals":[]"#,
            r#"{"signals":["v_webb"]}"#,
            r#"{"signals":["v_web"],"hz":0}"#,
            r#"{"signals":["v_web"],"hz":51}"#,
            r#"{"signals":["v_web"],"hz":-1}"#,
        ] {
            assert!(Subscription::read(text).is_err(), "{text}");
        }
    }
}
