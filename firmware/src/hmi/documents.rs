//! What the documents say.
//!
//! Not here: how they travel.

use core::fmt;

use embassy_sync::blocking_mutex::raw::RawMutex;
use model_core::drive::DRIVE_PERIOD_MS;
use model_core::image::{Direction, Kind, SIGNALS, Signal};
use model_core::signal::Bit;
use picoserve::io::Write;

use super::Hmi;
use super::answer::{Document, List, Out, Text};

/// The name in lists.
const fn direction(direction: Direction) -> &'static str {
    match direction {
        Direction::Command => "command",
        Direction::Feedback => "feedback",
    }
}

/// A document that can be asked for.
#[derive(Clone, Copy, Debug)]
pub enum What {
    Info,
    Signals,
    Image,
}

/// A document, and what it is about.
pub struct Page<'a, M: RawMutex> {
    pub hmi: Hmi<'a, M>,
    pub what: What,
}

impl<M: RawMutex> Document for Page<'_, M> {
    async fn write<W: Write>(&self, out: &mut Out<W>) -> Result<(), W::Error> {
        match self.what {
            What::Info => self.info(out).await,
            What::Signals => signals(out).await,
            What::Image => self.image(out).await,
        }
    }
}

impl<M: RawMutex> Page<'_, M> {
    async fn info<W: Write>(&self, out: &mut Out<W>) -> Result<(), W::Error> {
        let (cycle, _) = self.hmi.moment();
        let board = self.hmi.desk.board;
        out.put(format_args!(
            "{{\"product\":\"paper winder simulator\",\"simulated\":true,\"version\":{},\"board\":{},\
             \"cycle\":{cycle},\"uptime_s\":{}}}",
            Text(board.version),
            Text(board.name),
            seconds(cycle),
        ))
        .await
    }

    async fn image<W: Write>(&self, out: &mut Out<W>) -> Result<(), W::Error> {
        let (cycle, image) = self.hmi.moment();
        let (commands, feedback) = (image.commands.words, image.feedback.words);
        out.put(format_args!("{{\"cycle\":{cycle},\"commands\":"))
            .await?;
        out.put(format_args!("{},", List(commands.iter()))).await?;
        out.put(format_args!("\"feedback\":{}}}", List(feedback.iter())))
            .await
    }
}

/// Simulated time, s.
fn seconds(cycle: u32) -> f64 {
    f64::from(cycle) * f64::from(DRIVE_PERIOD_MS) / 1e3
}

async fn signals<W: Write>(out: &mut Out<W>) -> Result<(), W::Error> {
    for (i, s) in SIGNALS.iter().enumerate() {
        out.put(format_args!("{}", if i == 0 { "[" } else { "," }))
            .await?;
        out.put(format_args!("{}", Listed(s))).await?;
        let bits: &[Bit] = match s.kind {
            Kind::Bits(bits) => bits,
            _ => &[],
        };
        let bits = bits.iter().map(|bit| {
            fmt::from_fn(move |f| {
                write!(
                    f,
                    "{{\"number\":{},\"name\":{},\"description\":{}}}",
                    bit.number,
                    Text(bit.name),
                    Text(bit.description)
                )
            })
        });
        out.put(format_args!("\"bits\":{},", List(bits))).await?;
        let codes: &[&str] = match s.kind {
            Kind::Code(codes) => codes,
            _ => &[],
        };
        let codes = codes.iter().map(|code| Text(code));
        out.put(format_args!("\"codes\":{}}}", List(codes))).await?;
    }
    out.put(format_args!("]")).await
}

/// A signal in its list, as far as bits and codes.
struct Listed<'a>(&'a Signal);

impl fmt::Display for Listed<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let s = self.0;
        let (low, high) = s.limits;
        write!(
            f,
            "{{\"name\":{},\"direction\":\"{}\",\"section\":\"{}\",\"kind\":\"{}\",\"unit\":{},\"counts\":{},\
             \"low\":{low},\"high\":{high},\"word\":{},\"description\":{},",
            Text(s.name),
            direction(s.direction),
            s.section.name(),
            s.kind.name(),
            Text(s.unit),
            s.counts,
            s.word,
            Text(s.description),
        )
    }
}
