//! The settings and their form in flash.
//!
//! All parameters that the machine has are stored, each under a hash of its name, and not only what differs from a
//! preset: a preset that a later version corrects does not change a machine that somebody has set up.

use core::fmt;
use core::ops::RangeInclusive;

use heapless::Vec;
use model_core::machine::{Machine, MachineError, Value, parameters};
use serde::{Deserialize, Serialize};

use crate::hash::fnv1a;

/// The most parameters that a machine can have, with room for some more.
const PARAMETERS_MAX: usize = 256;
/// The longest encoded settings, in bytes: a hash of up to 5 and a number of 8 for each parameter, and the rest.
pub const SETTINGS_MAX: usize = PARAMETERS_MAX * 13 + 64;

/// What a simulator remembers.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// The machine.
    pub machine: Machine,
    /// The Ethernet.
    pub network: Network,
    /// The serial port.
    pub serial: Serial,
}

/// Where the address comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Network {
    /// A DHCP server; without one the address of [`Network::FALLBACK`] is used.
    Dhcp,
    /// The settings.
    Static {
        /// IPv4 address.
        address: [u8; 4],
        /// Bits of the network's part.
        prefix: u8,
        /// The way out, if there is one.
        gateway: Option<[u8; 4]>,
    },
}

impl Network {
    /// Of the range for private networks, RFC 1918, in a corner where few machines are.
    pub const FALLBACK: Self = Self::Static {
        address: [192, 168, 0, 250],
        prefix: 24,
        gateway: None,
    };

    /// Refuses what cannot be.
    pub fn validate(&self) -> Result<(), Invalid> {
        let Self::Static {
            address,
            prefix,
            gateway,
        } = *self
        else {
            return Ok(());
        };
        if !PREFIXES.contains(&prefix) {
            return Err(Invalid::Prefix(prefix));
        }
        let hosts = u32::MAX >> prefix;
        let is_host = |address: [u8; 4]| {
            let host = u32::from_be_bytes(address) & hosts;
            // this network, loopback, multicast and what is reserved (RFC 6890)
            !matches!(address[0], 0 | 127 | 224..) && host != 0 && host != hosts
        };
        if !is_host(address) {
            return Err(Invalid::Host(address));
        }
        let network = |address: [u8; 4]| u32::from_be_bytes(address) & !hosts;
        let is_gateway = |gateway: &[u8; 4]| {
            is_host(*gateway) && *gateway != address && network(*gateway) == network(address)
        };
        match gateway.filter(|gateway| !is_gateway(gateway)) {
            Some(gateway) => Err(Invalid::Gateway(gateway)),
            None => Ok(()),
        }
    }
}

/// Bits of the network's part.
pub const PREFIXES: RangeInclusive<u8> = 1..=30;
/// Speeds of the serial line, Bd.
pub const BAUDS: RangeInclusive<u32> = 1200..=115_200;
/// Addresses of a station. Source: MODBUS over Serial Line V1.02, section 2.2.
pub const ADDRESSES: RangeInclusive<u8> = 1..=247;

/// Parity of the serial line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Parity {
    /// None; two stop bits.
    None,
    /// Even, as the specification has it by default.
    Even,
    /// Odd.
    Odd,
}

/// The serial port.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Serial {
    /// Bits a second.
    pub baud: u32,
    /// Parity.
    pub parity: Parity,
    /// Modbus address of this station.
    pub address: u8,
}

impl Serial {
    /// Refuses what cannot be.
    pub fn validate(&self) -> Result<(), Invalid> {
        if !BAUDS.contains(&self.baud) {
            return Err(Invalid::Baud(self.baud));
        }
        if !ADDRESSES.contains(&self.address) {
            return Err(Invalid::Address(self.address));
        }
        Ok(())
    }
}

impl Default for Serial {
    /// As the specification recommends. Source: MODBUS over Serial Line V1.02, section 3.3.
    fn default() -> Self {
        Self {
            baud: 19_200,
            parity: Parity::Even,
            address: 1,
        }
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            machine: Machine::news_8000(),
            network: Network::Dhcp,
            serial: Serial::default(),
        }
    }
}

/// Settings that cannot be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Invalid {
    /// A parameter of the machine is outside its limits.
    Machine(MachineError),
    /// A parameter that this firmware does not know, by the hash of its name.
    Unknown(u32),
    /// Bits of the network's part outside 1 to 30.
    Prefix(u8),
    /// An address that no single machine of a network can have.
    Host([u8; 4]),
    /// A gateway that is not another machine of the same network.
    Gateway([u8; 4]),
    /// Speed of the serial line outside 1 200 to 115 200.
    Baud(u32),
    /// Modbus address outside 1 to 247.
    Address(u8),
    /// Not settings at all.
    Form,
}

impl fmt::Display for Invalid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Machine(error) => error.fmt(f),
            Self::Unknown(hash) => write!(f, "there is no parameter {hash:#010x}"),
            Self::Prefix(n) => write!(f, "network prefix = {n} is outside 1 to 30"),
            Self::Host([a, b, c, d]) => {
                write!(f, "{a}.{b}.{c}.{d} is not the address of a machine")
            }
            Self::Gateway([a, b, c, d]) => {
                write!(
                    f,
                    "gateway = {a}.{b}.{c}.{d} is no other machine of the network"
                )
            }
            Self::Baud(n) => write!(f, "baud rate = {n} is outside 1200 to 115200"),
            Self::Address(n) => write!(f, "Modbus address = {n} is outside 1 to 247"),
            Self::Form => f.write_str("not settings"),
        }
    }
}

impl core::error::Error for Invalid {}

/// The form in flash.
#[derive(Serialize, Deserialize)]
struct Stored {
    network: Network,
    serial: Serial,
    machine: Vec<(u32, f64), PARAMETERS_MAX>,
}

impl Settings {
    /// Refuses what cannot be.
    pub fn validate(&self) -> Result<(), Invalid> {
        self.machine.validate().map_err(Invalid::Machine)?;
        self.network.validate()?;
        self.serial.validate()
    }

    /// The settings as bytes, at the front of `buffer`.
    pub(super) fn encode<'a>(&self, buffer: &'a mut [u8; SETTINGS_MAX]) -> Option<&'a [u8]> {
        let mut machine = Vec::new();
        for parameter in parameters() {
            if let Some(value) = parameter.get(&self.machine) {
                machine.push((hash(parameter.name), value.number())).ok()?;
            }
        }
        let stored = Stored {
            network: self.network,
            serial: self.serial,
            machine,
        };
        postcard::to_slice(&stored, buffer)
            .ok()
            .map(|bytes| &*bytes)
    }

    /// Settings out of bytes.
    pub(super) fn decode(bytes: &[u8]) -> Result<Self, Invalid> {
        let stored: Stored = postcard::from_bytes(bytes).map_err(|_| Invalid::Form)?;
        let mut settings = Self {
            network: stored.network,
            serial: stored.serial,
            ..Self::default()
        };
        let machine = &mut settings.machine;
        for (name, number) in stored.machine {
            let parameter = parameters()
                .find(|parameter| hash(parameter.name) == name)
                .ok_or(Invalid::Unknown(name))?;
            // In the order of the table a list's length comes before its elements.
            let value = match parameter.get(machine).ok_or(Invalid::Form)? {
                Value::Number(_) => Value::Number(number),
                // the cast saturates
                Value::Count(_) => Value::Count(number as usize),
                Value::Switch(_) => Value::Switch(number != 0.0),
            };
            parameter.set(machine, value).ok_or(Invalid::Form)?;
        }
        settings.validate()?;
        Ok(settings)
    }
}

fn hash(name: &str) -> u32 {
    fnv1a(name.bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_parameters_have_the_same_hash() {
        for (i, a) in parameters().enumerate() {
            assert!(parameters().take(i).all(|b| hash(a.name) != hash(b.name)));
        }
        assert!(parameters().count() <= PARAMETERS_MAX);
    }

    #[test]
    fn settings_come_back_as_they_were() {
        let mut machines = [
            Machine::news_8000(),
            Machine::lwc_8000(),
            Machine::lab_300(),
        ];
        machines[0].nips.slip = true;
        for machine in machines {
            let settings = Settings {
                machine,
                network: Network::FALLBACK,
                serial: Serial {
                    baud: 115_200,
                    parity: Parity::Odd,
                    address: 247,
                },
            };
            let mut buffer = [0; SETTINGS_MAX];
            let bytes = settings.encode(&mut buffer).unwrap();
            assert_eq!(Settings::decode(bytes), Ok(settings));
        }
    }

    #[test]
    fn what_cannot_be_is_refused_by_name() {
        let refused = |change: fn(&mut Settings)| {
            let mut settings = Settings::default();
            change(&mut settings);
            let mut buffer = [0; SETTINGS_MAX];
            let bytes = settings.encode(&mut buffer).unwrap();
            Settings::decode(bytes).unwrap_err()
        };
        assert!(matches!(
            refused(|s| s.machine.web.width_m = f64::NAN),
            Invalid::Machine(error) if error.parameter == "web.width_m"
        ));
        assert_eq!(refused(|s| s.serial.baud = 0), Invalid::Baud(0));
        assert_eq!(refused(|s| s.serial.address = 248), Invalid::Address(248));
        let prefix = |s: &mut Settings| {
            s.network = Network::Static {
                address: [10, 0, 0, 1],
                prefix: 33,
                gateway: None,
            };
        };
        assert_eq!(refused(prefix), Invalid::Prefix(33));
        for (address, prefix, gateway, wrong) in [
            ([10, 0, 0, 0], 24, None, Invalid::Host([10, 0, 0, 0])),
            ([10, 0, 0, 255], 24, None, Invalid::Host([10, 0, 0, 255])),
            ([127, 0, 0, 1], 8, None, Invalid::Host([127, 0, 0, 1])),
            ([239, 1, 1, 1], 24, None, Invalid::Host([239, 1, 1, 1])),
            (
                [10, 0, 0, 1],
                24,
                Some([10, 0, 1, 2]),
                Invalid::Gateway([10, 0, 1, 2]),
            ),
            (
                [10, 0, 0, 1],
                24,
                Some([10, 0, 0, 1]),
                Invalid::Gateway([10, 0, 0, 1]),
            ),
        ] {
            let network = Network::Static {
                address,
                prefix,
                gateway,
            };
            assert_eq!(network.validate(), Err(wrong));
        }
        let right = Network::Static {
            address: [10, 0, 1, 255],
            prefix: 16,
            gateway: Some([10, 0, 0, 1]),
        };
        assert_eq!(right.validate(), Ok(()));
        for bytes in [&[][..], &[0; 40], &[0xff; 300]] {
            assert!(Settings::decode(bytes).is_err());
        }
    }
}
