//! What the documents say.
//!
//! Not here: how they travel. A document takes what it tells out of the locks once, at its beginning.

use core::fmt;

use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::Instant;
use model_core::drive::DRIVE_PERIOD_MS;
use model_core::image::{self, COMMAND_WORDS, Direction, Kind, SIGNALS, Signal};
use model_core::logic::LOOPS;
use model_core::machine::{PRESETS, Value, parameters};
use model_core::plant::PLANT_PERIOD_MS;
use model_core::signal::Bit;
use picoserve::io::Write;

use super::Hmi;
use super::answer::{Document, List, OrNull, Out, Text};
use super::desk::{Memory, locked};
use super::recorder::Beginning;
use super::{acceptance, settings, setup};
use crate::link::control::{Client, Controller, POLL_EDGES_MS, Peer, Writer};

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
    Info { logged_in: bool },
    Signals,
    Image,
    Faults,
    Panel,
    Parameters,
    Presets,
    Settings,
    Gains,
    Link,
    Events { after: u32 },
    Snapshot,
    Journal,
    Health,
    Acceptance,
}

/// A document, and what it is about.
pub struct Page<'a, M: RawMutex> {
    pub hmi: Hmi<'a, M>,
    pub what: What,
}

impl<M: RawMutex> Document for Page<'_, M> {
    fn content_type(&self) -> &'static str {
        match self.what {
            What::Journal => "text/csv; charset=utf-8",
            _ => "application/json",
        }
    }

    async fn write<W: Write>(&self, out: &mut Out<W>) -> Result<(), W::Error> {
        match self.what {
            What::Info { logged_in } => self.info(out, logged_in).await,
            What::Signals => signals(out).await,
            What::Image => self.image(out).await,
            What::Faults => self.faults(out).await,
            What::Panel => self.panel(out).await,
            What::Parameters => self.parameters(out).await,
            What::Presets => presets(out).await,
            What::Settings => settings::write(self.hmi, out).await,
            What::Gains => self.gains(out).await,
            What::Link => self.link(out).await,
            What::Events { after } => self.events(out, after).await,
            What::Snapshot => self.snapshot(out).await,
            What::Journal => self.journal(out).await,
            What::Health => self.health(out).await,
            What::Acceptance => acceptance::write(self.hmi, out).await,
        }
    }
}

/// A PLC, for people.
fn peer(peer: Peer) -> impl fmt::Display {
    fmt::from_fn(move |f| match peer {
        Peer::Ip(address) => write!(f, "\"{address}\""),
        Peer::Serial => f.write_str("\"serial line\""),
    })
}

impl<M: RawMutex> Page<'_, M> {
    async fn info<W: Write>(&self, out: &mut Out<W>, logged_in: bool) -> Result<(), W::Error> {
        let now = Instant::now();
        let (controller, age, cycle, preset, revision, password_set, settings) =
            self.hmi.visit(|_, control, papers| {
                (
                    control.controller(now),
                    control.write_age(now),
                    papers.cycle,
                    papers.setup.preset,
                    papers.setup.revision,
                    papers.auth.secret().is_some(),
                    papers.keeper.state().name(),
                )
            });
        let board = self.hmi.desk.board;
        out.put(format_args!(
            "{{\"product\":\"paper winder simulator\",\"simulated\":true,\"version\":{},\"board\":{},\
             \"machine\":{},\"revision\":{revision},\"settings\":\"{settings}\",\"cycle\":{cycle},\"uptime_s\":{},",
            Text(board.version),
            Text(board.name),
            Text(preset),
            seconds(cycle),
        ))
        .await?;
        let (by, plc) = match controller {
            Controller::Nobody => ("nobody", None),
            Controller::Plc(plc) => ("plc", Some(peer(plc))),
            Controller::Panel => ("panel", None),
        };
        let age = OrNull(age.map(|age| age.as_millis()));
        out.put(format_args!(
            "\"control\":{{\"by\":\"{by}\",\"plc\":{},\"age_ms\":{age}}},\
             \"auth\":{{\"password_set\":{password_set},\"logged_in\":{logged_in}}}}}",
            OrNull(plc)
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

    async fn faults<W: Write>(&self, out: &mut Out<W>) -> Result<(), W::Error> {
        let (cycle, timed) = self
            .hmi
            .desk
            .with(|papers| (papers.cycle, papers.timed.clone()));
        let timed = timed.iter().map(|fault| {
            fmt::from_fn(move |f| {
                let (word, bit) = fault.name();
                let (dot, bit) = bit.map_or(("", ""), |bit| (".", bit));
                // The cycle that is told is over.
                let left = seconds(fault.left(cycle.wrapping_add(1)));
                write!(f, "{{\"name\":\"{word}{dot}{bit}\",\"left_s\":{left}}}")
            })
        });
        out.put(format_args!("{{\"timed\":[")).await?;
        for (i, fault) in timed.enumerate() {
            let comma = if i == 0 { "" } else { "," };
            out.put(format_args!("{comma}{fault}")).await?;
        }
        out.put(format_args!("]}}")).await
    }

    async fn panel<W: Write>(&self, out: &mut Out<W>) -> Result<(), W::Error> {
        let now = Instant::now();
        let (state, message, goal, mine) = self.hmi.visit(|image, control, papers| {
            let panel = &papers.panel;
            let mine = control.controller(now) == Controller::Panel;
            (
                panel.state(&image.feedback),
                panel.message(),
                panel.goal(),
                mine,
            )
        });
        out.put(format_args!(
            "{{\"state\":\"{}\",\"message\":{},\"goal\":{{\"length_m\":{},\"diameter_mm\":{}}},\"control\":{mine}}}",
            state.name(),
            Text(message),
            OrNull(goal.length_m),
            OrNull(goal.diameter_mm)
        ))
        .await
    }

    async fn parameters<W: Write>(&self, out: &mut Out<W>) -> Result<(), W::Error> {
        let (in_use, staged, revision, preset, why) = self.hmi.visit(|image, _, papers| {
            let setup = &papers.setup;
            (
                setup.in_use.clone(),
                setup.staged.clone(),
                setup.revision,
                setup.preset,
                locked(&image.feedback),
            )
        });
        out.put(format_args!(
            "{{\"revision\":{revision},\"machine\":{},\"locked\":{},\"locked_why\":{},\"parts\":[",
            Text(preset),
            why.is_some(),
            OrNull(why.map(Text))
        ))
        .await?;
        let (limiting, default) = (
            staged.as_ref().unwrap_or(&in_use),
            PRESETS.iter().find(|(name, _)| *name == preset),
        );
        let default = default.map(|(_, machine)| machine());
        let mut last = None;
        for parameter in parameters() {
            let Some(value) = parameter.get(&in_use).or_else(|| parameter.get(limiting)) else {
                continue;
            };
            let part = setup::part(parameter);
            match last.replace(part) {
                Some(last) if last == part => out.put(format_args!(",")).await?,
                before => {
                    let end = if before.is_some() { "]}," } else { "" };
                    out.put(format_args!(
                        "{end}{{\"part\":{},\"parameters\":[",
                        Text(part)
                    ))
                    .await?;
                }
            }
            let kind = match value {
                Value::Number(_) => "number",
                Value::Count(_) => "count",
                Value::Switch(_) => "switch",
            };
            let limits = parameter.limits(limiting);
            let default = default.as_ref().and_then(|machine| parameter.get(machine));
            let change = staged.as_ref().and_then(|machine| parameter.get(machine));
            let change = change.filter(|change| Some(*change) != parameter.get(&in_use));
            out.put(format_args!(
                "{{\"name\":{},\"kind\":\"{kind}\",\"unit\":{},\"low\":{},\"high\":{},\"default\":{},\
                 \"value\":{},\"staged\":{},\"description\":{}}}",
                Text(parameter.name),
                Text(parameter.unit),
                OrNull(limits.as_ref().map(|limits| *limits.start())),
                OrNull(limits.as_ref().map(|limits| *limits.end())),
                OrNull(default.map(Json)),
                OrNull(parameter.get(&in_use).map(Json)),
                OrNull(change.map(Json)),
                Text(parameter.about)
            ))
            .await?;
        }
        out.put(format_args!("]}}]}}")).await
    }

    async fn gains<W: Write>(&self, out: &mut Out<W>) -> Result<(), W::Error> {
        let all = self
            .hmi
            .visit(|image, _, papers| papers.gains.settings(&image.feedback));
        out.put(format_args!("{{\"loops\":[")).await?;
        for (i, (name, (setting, tuned))) in LOOPS.iter().zip(all).enumerate() {
            let unit = match i {
                2 => "N/N",
                _ => "N·m·s/rad",
            };
            out.put(format_args!(
                "{}{{\"name\":{},\"gain\":{},\"time_s\":{},\"unit\":\"{unit}\",\"source\":\"{}\"}}",
                if i == 0 { "" } else { "," },
                Text(name),
                finite(setting.gain),
                finite(setting.time),
                if tuned { "auto-tune" } else { "machine" }
            ))
            .await?;
        }
        out.put(format_args!("]}}")).await
    }

    async fn link<W: Write>(&self, out: &mut Out<W>) -> Result<(), W::Error> {
        let now = Instant::now();
        let (clients, controller) = self.hmi.visit(|_, control, _| {
            let clients: heapless::Vec<Client, { crate::link::control::Control::CLIENTS }> =
                control.clients().copied().collect();
            (clients, control.controller(now))
        });
        out.put(format_args!(
            "{{\"poll_edges_ms\":{},\"clients\":[",
            List(POLL_EDGES_MS.iter())
        ))
        .await?;
        for (i, client) in clients.iter().enumerate() {
            out.put(format_args!(
                "{}{{\"address\":{},\"protocol\":\"{}\",\"idle_ms\":{},\"requests\":{},\"exceptions\":{},\
                 \"poll_ms_histogram\":{},\"controls\":{}}}",
                if i == 0 { "" } else { "," },
                peer(client.peer),
                client.protocol.name(),
                (now - client.asked).as_millis(),
                client.requests,
                client.exceptions,
                List(client.polls.iter()),
                controller == Controller::Plc(client.peer)
            ))
            .await?;
        }
        out.put(format_args!("],\"registers\":[")).await?;
        let mut first = true;
        for word in 0..COMMAND_WORDS {
            let Some((writer, at)) = self.hmi.visit(|_, control, _| control.last_writer(word))
            else {
                continue;
            };
            let comma = if core::mem::take(&mut first) { "" } else { "," };
            let age = now.saturating_duration_since(at).as_millis();
            out.put(format_args!("{comma}{{\"word\":{word},\"last_writer\":"))
                .await?;
            match writer {
                Writer::Client(client) => out.put(format_args!("{}", peer(client))).await?,
                Writer::Panel => out.put(format_args!("\"panel\"")).await?,
            }
            out.put(format_args!(",\"age_ms\":{age}}}")).await?;
        }
        out.put(format_args!("]}}")).await
    }

    async fn events<W: Write>(&self, out: &mut Out<W>, after: u32) -> Result<(), W::Error> {
        let (mut last, mut first) = (after, true);
        out.put(format_args!("{{\"events\":[")).await?;
        while let Some(event) = self
            .hmi
            .desk
            .with(|papers| papers.events.after(last).cloned())
        {
            last = event.number;
            out.put(format_args!(
                "{}{{\"n\":{},\"cycle\":{},\"kind\":\"{}\",\"text\":{}}}",
                if core::mem::take(&mut first) { "" } else { "," },
                event.number,
                event.cycle,
                event.kind,
                Text(&event.text)
            ))
            .await?;
        }
        out.put(format_args!("]}}")).await
    }

    async fn snapshot<W: Write>(&self, out: &mut Out<W>) -> Result<(), W::Error> {
        let (taken, beginning, end, full, playing) = self.hmi.desk.with(|papers| {
            let recorder = &papers.recorder;
            (
                papers.snapshot.as_ref().map(|snapshot| snapshot.cycle),
                recorder.beginning,
                recorder.end(),
                recorder.is_full(),
                recorder.is_playing(),
            )
        });
        let from = match beginning {
            Beginning::PowerUp => "power-up",
            Beginning::Snapshot => "snapshot",
        };
        out.put(format_args!(
            "{{\"taken_cycle\":{},\"recording\":{{\"from\":\"{from}\",\"cycles\":{},\"full\":{full},\
             \"playing\":{playing}}}}}",
            OrNull(taken),
            end.after
        ))
        .await
    }

    /// In the form of the command line tool's recordings, so that it can play one from power-up on.
    async fn journal<W: Write>(&self, out: &mut Out<W>) -> Result<(), W::Error> {
        let (beginning, commands, in_use, preset, end) = self.hmi.desk.with(|papers| {
            let recorder = &papers.recorder;
            (
                recorder.beginning,
                recorder.first,
                papers.setup.in_use.clone(),
                papers.setup.preset,
                recorder.end(),
            )
        });
        out.put(format_args!("cycle,signal,counts\n")).await?;
        match beginning {
            Beginning::Snapshot => out.put(format_args!("0,snapshot,\n")).await?,
            Beginning::PowerUp => {
                out.put(format_args!("0,machine,{preset}\n")).await?;
                let default = PRESETS.iter().find(|(name, _)| *name == preset);
                let default = default.map_or_else(|| in_use.clone(), |(_, machine)| machine());
                for parameter in in_use.differences(&default) {
                    let value = OrNull(parameter.get(&in_use));
                    out.put(format_args!("0,machine.{},{value}\n", parameter.name))
                        .await?;
                }
            }
        }
        let of = |word: usize| {
            let is = |s: &&Signal| s.direction == Direction::Command && usize::from(s.word) == word;
            SIGNALS.iter().find(is)
        };
        let counts = |signal: &Signal, word: u16| match signal.kind {
            Kind::I16 => i32::from(word as i16),
            _ => i32::from(word),
        };
        for (word, value) in commands.words.into_iter().enumerate() {
            if let Some(signal) = of(word).filter(|_| value != 0) {
                let counts = counts(signal, value);
                out.put(format_args!("0,{},{counts}\n", signal.name))
                    .await?;
            }
        }
        let mut number = 0;
        while let Some(entry) = self.hmi.desk.with(|papers| papers.recorder.entry(number)) {
            number += 1;
            if entry.after >= end.after {
                break;
            }
            if let Some(signal) = of(usize::from(entry.word)) {
                let after = entry.after;
                let counts = entry.value.map(|value| counts(signal, value));
                let counts = fmt::from_fn(|f| match counts {
                    Some(counts) => write!(f, "{counts}"),
                    None => f.write_str("up"),
                });
                out.put(format_args!("{after},{},{counts}\n", signal.name))
                    .await?;
            }
        }
        for (signal, value) in [
            (&image::PLANT_TICKS, end.ticks),
            (&image::TRAJECTORY, end.trajectory),
        ] {
            out.put(format_args!("{},{},{value}\n", end.after, signal.name))
                .await?;
        }
        Ok(())
    }

    async fn health<W: Write>(&self, out: &mut Out<W>) -> Result<(), W::Error> {
        let (cycle, image) = self.hmi.moment();
        let (board, f) = (self.hmi.desk.board, &image.feedback);
        out.put(format_args!("{{\"tasks\":[")).await?;
        let timed = [
            (
                "plant",
                PLANT_PERIOD_MS,
                &image::PLANT_TIME_MAX,
                &image::PLANT_JITTER_MAX,
                &image::PLANT_OVERRUNS,
            ),
            (
                "regulators",
                DRIVE_PERIOD_MS,
                &image::DRIVE_TIME_MAX,
                &image::DRIVE_JITTER_MAX,
                &image::DRIVE_OVERRUNS,
            ),
        ];
        for (name, period_ms, longest, jitter, overruns) in timed {
            out.put(format_args!(
                "{{\"name\":\"{name}\",\"period_us\":{},\"longest_us\":{},\"jitter_us\":{},\"overruns\":{}}},",
                1000 * period_ms,
                f.word(longest),
                f.word(jitter),
                f.word(overruns)
            ))
            .await?;
        }
        out.put(format_args!(
            "{{\"name\":\"logic\",\"period_us\":{},\"longest_us\":null,\"jitter_us\":null,\"overruns\":{}}}],\
             \"reset_reason\":{},\"version\":{},\"board\":{},\"uptime_s\":{},",
            1000 * DRIVE_PERIOD_MS,
            f.word(&image::LOGIC_OVERRUNS),
            Text(board.reset),
            Text(board.version),
            Text(board.name),
            seconds(cycle)
        ))
        .await?;
        let memory = (board.memory)().map(|memory| {
            fmt::from_fn(move |f| {
                let Memory {
                    statics,
                    stack,
                    stack_used,
                } = memory;
                write!(
                    f,
                    "{{\"static_ram\":{statics},\"stack\":{stack},\"stack_used_at_most\":{stack_used},\"heap\":0}}"
                )
            })
        });
        let (clients, recorded) = self
            .hmi
            .visit(|_, control, papers| (control.clients().count(), papers.recorder.len()));
        let places = [
            (
                "browsers",
                usize::from(self.hmi.desk.connected()),
                usize::from(board.connections),
            ),
            ("modbus", clients, crate::link::control::Control::CLIENTS),
            ("recording", recorded, super::recorder::ENTRIES),
        ];
        let places = places.map(|(name, used, of)| {
            fmt::from_fn(move |f| write!(f, "{{\"name\":\"{name}\",\"used\":{used},\"of\":{of}}}"))
        });
        out.put(format_args!(
            "\"memory\":{},\"places\":{}}}",
            OrNull(memory),
            List(places.iter())
        ))
        .await
    }
}

/// A number, or null: JSON has no other.
fn finite(value: f32) -> OrNull<f32> {
    OrNull(value.is_finite().then_some(value))
}

/// Simulated time, s.
fn seconds(cycle: u32) -> f64 {
    f64::from(cycle) * f64::from(DRIVE_PERIOD_MS) / 1e3
}

/// A parameter's value, as JSON has it.
struct Json(Value);

impl fmt::Display for Json {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

async fn presets<W: Write>(out: &mut Out<W>) -> Result<(), W::Error> {
    for (i, (name, machine)) in PRESETS.iter().enumerate() {
        let fits = setup::fits(&machine());
        out.put(format_args!(
            "{}{{\"name\":{},\"fits\":{fits},\"why\":{}}}",
            if i == 0 { "[" } else { "," },
            Text(name),
            OrNull((!fits).then_some(Text(setup::OTHER_SPANS)))
        ))
        .await?;
    }
    out.put(format_args!("]")).await
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
