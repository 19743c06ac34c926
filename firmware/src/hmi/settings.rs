//! The board's settings: where they stand, what the next start has, and the task that brings them to the flash.
//!
//! Not here: the machine's parameters, which are staged and applied by themselves and stored with these.

use core::fmt;
use core::net::Ipv4Addr;

use embassy_futures::select::select;
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Instant, Timer};
use embedded_storage_async::nor_flash::NorFlash;
use picoserve::io::Write;
use serde::Deserialize;

use super::Hmi;
use super::answer::{Detail, OrNull, Out, Refusal, Text};
use super::body;
use super::desk::{Desk, Papers};
use crate::store::{
    ADDRESSES, BAUDS, Invalid, Job, Network, PREFIXES, Parity, SaveError, Serial, State, Store,
};

/// How often a write that has to wait is tried again.
const AGAIN: Duration = Duration::from_secs(60);

/// Brings the settings to the flash, whenever they are changed: a task of the background.
pub async fn keep<F: NorFlash, M: RawMutex>(store: &mut Store<F>, desk: &Desk<M>) -> ! {
    loop {
        match desk.with(|papers| papers.keeper.state()) {
            State::Waiting | State::Failed => {
                select(desk.settle.wait(), Timer::after(AGAIN)).await;
            }
            _ => desk.settle.wait().await,
        }
        loop {
            let now_s = u32::try_from(Instant::now().as_secs()).unwrap_or(u32::MAX);
            let Some(job) = desk.with(|papers| papers.keeper.next(now_s)) else {
                break;
            };
            let result = match &job {
                Job::Save(settings) => store.save(settings).await,
                Job::Empty => store.discard().await,
            };
            desk.with(|papers| papers.kept(&job, result));
            if result.is_err() {
                break;
            }
        }
    }
}

impl<M: RawMutex> Desk<M> {
    /// Something stands in the flash that somebody has to decide about.
    pub fn is_undecided(&self) -> bool {
        self.with(|papers| papers.keeper.state() == State::Undecided)
    }
}

impl Papers {
    /// Something has become of the settings.
    fn kept(&mut self, job: &Job, result: Result<(), SaveError>) {
        self.keeper.done(job, result);
        let text = match (job, result) {
            (Job::Save(_), Ok(())) => "stored",
            (Job::Empty, Ok(())) => "the flash is empty",
            (_, Err(_)) => "not stored: the flash did not take them",
        };
        self.events
            .add(self.cycle, "settings", format_args!("{text}"));
    }
}

/// What is wanted of the settings; what is left out stays.
#[derive(Deserialize)]
pub struct Wish<'a> {
    #[serde(borrow, default)]
    network: Option<NetworkWish<'a>>,
    #[serde(borrow, default)]
    serial: Option<SerialWish<'a>>,
}

#[derive(Deserialize)]
struct NetworkWish<'a> {
    dhcp: bool,
    #[serde(default)]
    address: Option<&'a str>,
    #[serde(default)]
    gateway: Option<&'a str>,
}

#[derive(Deserialize)]
struct SerialWish<'a> {
    #[serde(default)]
    baud: Option<f64>,
    #[serde(default)]
    parity: Option<&'a str>,
    #[serde(default)]
    address: Option<f64>,
}

const PARITIES: [(&str, Parity); 3] = [
    ("none", Parity::None),
    ("even", Parity::Even),
    ("odd", Parity::Odd),
];

/// An address of four numbers.
fn address(parameter: &str, text: &str) -> Result<[u8; 4], Detail> {
    let parsed: Result<Ipv4Addr, _> = text.parse();
    parsed.map(|address| address.octets()).map_err(|_| {
        Detail::new(
            parameter,
            Text(text),
            "not an address such as 192.168.0.250",
        )
    })
}

impl NetworkWish<'_> {
    fn network(&self) -> Result<Network, Detail> {
        if self.dhcp {
            return Ok(Network::Dhcp);
        }
        let text = self.address.unwrap_or_default();
        let whole = text
            .split_once('/')
            .and_then(|(host, prefix)| Some((host, prefix.parse().ok()?)));
        let (host, prefix) = whole.ok_or_else(|| {
            Detail::new(
                "network.address",
                Text(text),
                "not an address with its network's bits, such as 192.168.0.250/24",
            )
        })?;
        let gateway = self.gateway.filter(|gateway| !gateway.is_empty());
        Ok(Network::Static {
            address: address("network.address", host)?,
            prefix,
            gateway: gateway
                .map(|gateway| address("network.gateway", gateway))
                .transpose()?,
        })
    }
}

impl SerialWish<'_> {
    fn serial(&self, now: Serial) -> Result<Serial, Detail> {
        let whole = |parameter, wish: Option<f64>, (low, high): (u32, u32), now: u32| {
            let Some(number) = wish else {
                return Ok(now);
            };
            let counts = number as u32;
            if number - f64::from(counts) == 0.0 && (low..=high).contains(&counts) {
                return Ok(counts);
            }
            Err(Detail {
                limits: Some((low.into(), high.into())),
                ..Detail::number(parameter, number, "outside its limits")
            })
        };
        let parity = match self.parity {
            None => now.parity,
            Some(name) => {
                let known = PARITIES.iter().find(|(known, _)| *known == name);
                let unknown = || Detail::new("serial.parity", Text(name), "none, even or odd");
                known.ok_or_else(unknown)?.1
            }
        };
        let bauds = (*BAUDS.start(), *BAUDS.end());
        let addresses = (u32::from(*ADDRESSES.start()), u32::from(*ADDRESSES.end()));
        let address = whole(
            "serial.address",
            self.address,
            addresses,
            now.address.into(),
        )?;
        Ok(Serial {
            baud: whole("serial.baud", self.baud, bauds, now.baud)?,
            parity,
            // within its limits
            address: address as u8,
        })
    }
}

/// A refusal of settings that cannot be.
fn detail(invalid: Invalid) -> Detail {
    let reason = "not possible";
    match invalid {
        Invalid::Prefix(prefix) => Detail {
            limits: Some(((*PREFIXES.start()).into(), (*PREFIXES.end()).into())),
            ..Detail::new(
                "network.address",
                prefix,
                "bits of the network outside their limits",
            )
        },
        Invalid::Host(address) => Detail::new(
            "network.address",
            format_args!("\"{}\"", Ipv4Addr::from(address)),
            "not the address of a machine in its network",
        ),
        Invalid::Gateway(address) => Detail::new(
            "network.gateway",
            format_args!("\"{}\"", Ipv4Addr::from(address)),
            "not another machine of the same network",
        ),
        Invalid::Baud(baud) => Detail::new("serial.baud", baud, reason),
        Invalid::Address(address) => Detail::new("serial.address", address, reason),
        Invalid::Machine(_) | Invalid::Unknown(_) | Invalid::Form => {
            Detail::new("settings", "", reason)
        }
    }
}

fn refused(detail: Detail) -> Refusal {
    let mut refusal = Refusal::new(422, format_args!("a setting cannot be"));
    refusal.add(detail);
    refusal
}

impl<M: RawMutex> Hmi<'_, M> {
    /// What the next start shall have.
    ///
    /// # Errors
    /// With the value that cannot be.
    pub(super) fn connect(&self, body: &[u8]) -> Result<(), Refusal> {
        let wish: Wish = body::read(body)?;
        self.settle(|papers| {
            let wanted = papers.keeper.settings();
            let (mut network, mut serial) = (wanted.network, wanted.serial);
            if let Some(wish) = &wish.network {
                network = wish.network().map_err(refused)?;
            }
            if let Some(wish) = &wish.serial {
                serial = wish.serial(serial).map_err(refused)?;
            }
            network.validate().map_err(|e| refused(detail(e)))?;
            serial.validate().map_err(|e| refused(detail(e)))?;
            papers.keeper.connect(network, serial);
            papers.audit(format_args!("network and serial line for the next start"));
            Ok(())
        })
    }

    /// What is in use takes the place of what is of no use.
    ///
    /// # Errors
    /// Nothing waits for that.
    pub(super) fn overwrite(&self) -> Result<(), Refusal> {
        self.settle(|papers| match papers.keeper.overwrite() {
            true => {
                papers.audit(format_args!("the flash is overwritten"));
                Ok(())
            }
            false => Err(Refusal::new(
                409,
                format_args!("nothing in the flash waits to be overwritten"),
            )),
        })
    }

    /// The next start has the defaults.
    ///
    /// # Errors
    /// This board keeps nothing.
    pub(super) fn reset_settings(&self) -> Result<(), Refusal> {
        self.settle(|papers| match papers.keeper.reset() {
            true => {
                papers.audit(format_args!("the flash is emptied"));
                Ok(())
            }
            false => Err(Refusal::new(
                409,
                format_args!("this board keeps no settings"),
            )),
        })
    }

    fn settle(&self, f: impl FnOnce(&mut Papers) -> Result<(), Refusal>) -> Result<(), Refusal> {
        self.desk.with(f)?;
        self.desk.settle.signal(());
        Ok(())
    }
}

/// Where an address comes from, as JSON has it.
fn network(network: Network) -> impl fmt::Display {
    fmt::from_fn(move |f| match network {
        Network::Dhcp => f.write_str("{\"dhcp\":true,\"address\":null,\"gateway\":null}"),
        Network::Static {
            address,
            prefix,
            gateway,
        } => {
            let address = Ipv4Addr::from(address);
            let gateway = gateway.map(|gateway| {
                let gateway = Ipv4Addr::from(gateway);
                fmt::from_fn(move |f| write!(f, "\"{gateway}\""))
            });
            write!(
                f,
                "{{\"dhcp\":false,\"address\":\"{address}/{prefix}\",\"gateway\":{}}}",
                OrNull(gateway)
            )
        }
    })
}

/// The serial line, likewise.
fn serial(serial: Serial) -> impl fmt::Display {
    let parity = PARITIES.iter().find(|(_, parity)| *parity == serial.parity);
    let parity = parity.map_or("", |(name, _)| name);
    fmt::from_fn(move |f| {
        write!(
            f,
            "{{\"baud\":{},\"parity\":\"{parity}\",\"address\":{}}}",
            serial.baud, serial.address
        )
    })
}

/// The document.
pub async fn write<M: RawMutex, W: Write>(
    hmi: Hmi<'_, M>,
    out: &mut Out<W>,
) -> Result<(), W::Error> {
    let (state, unusable, writes, note, now, next) = hmi.desk.with(|papers| {
        let keeper = &papers.keeper;
        let wanted = keeper.settings();
        (
            keeper.state(),
            keeper.unusable(),
            keeper.writes_left(),
            keeper.note,
            keeper.in_use(),
            (wanted.network, wanted.serial),
        )
    });
    let why = unusable.map(|why| fmt::from_fn(move |f| write!(f, "\"{why}\"")));
    out.put(format_args!(
        "{{\"state\":\"{}\",\"why\":{},\"writes_left\":{writes},\"note\":{},\"restart\":{},",
        state.name(),
        OrNull(why),
        OrNull(note.map(Text)),
        now != next,
    ))
    .await?;
    out.put(format_args!(
        "\"network\":{{\"now\":{},\"next\":{}}},\"serial\":{{\"now\":{},\"next\":{}}}}}",
        network(now.0),
        network(next.0),
        serial(now.1),
        serial(next.1)
    ))
    .await
}
