//! The access table as text, for command lines.
//!
//! Not here: what a right permits.

use std::net::Ipv4Addr;
use std::str::FromStr;

use firmware::link::control::{Access, Right};

/// One row: who may do what.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rule {
    /// An address, or everybody that has no row.
    address: Option<Ipv4Addr>,
    right: Right,
}

impl FromStr for Rule {
    type Err = String;

    /// `192.168.0.5=write`, `others=read`, `10.0.0.7=none`.
    fn from_str(text: &str) -> Result<Self, String> {
        let Some((who, right)) = text.split_once('=') else {
            return Err(format!("{text} is not ADDRESS=RIGHT"));
        };
        let address = match who {
            "others" => None,
            who => {
                let address = who.parse();
                Some(
                    address
                        .map_err(|_| format!("{who} is neither an IPv4 address nor `others`"))?,
                )
            }
        };
        let right = match right {
            "none" => Right::None,
            "read" => Right::Read,
            "write" => Right::ReadWrite,
            other => return Err(format!("{other} is none of the rights none, read, write")),
        };
        Ok(Self { address, right })
    }
}

/// The table of these rows; everybody else may do everything.
///
/// # Errors
/// There are more rows than the table has places.
pub fn access(rules: &[Rule]) -> Result<Access, String> {
    let mut access = Access::default();
    for rule in rules {
        match rule.address {
            None => access.others = rule.right,
            Some(address) if access.set(address, rule.right) => {}
            Some(_) => {
                let places = Access::ENTRIES;
                return Err(format!(
                    "the access table has {places} places, not {}",
                    rules.len()
                ));
            }
        }
    }
    Ok(access)
}

#[cfg(test)]
mod tests {
    use firmware::link::control::Peer;

    use super::*;

    fn rules(texts: &[&str]) -> Result<Vec<Rule>, String> {
        texts.iter().map(|text| text.parse()).collect()
    }

    #[test]
    fn rows_are_rights_of_addresses() {
        let rules = rules(&["others=read", "127.0.0.1=write", "10.0.0.7=none"]).unwrap();
        let access = access(&rules).unwrap();
        let of = |a, b, c, d| access.of(Peer::Ip(Ipv4Addr::new(a, b, c, d)));
        assert_eq!(of(127, 0, 0, 1), Right::ReadWrite);
        assert_eq!(of(10, 0, 0, 7), Right::None);
        assert_eq!(of(10, 0, 0, 8), Right::Read);
    }

    #[test]
    fn what_is_no_row_is_named() {
        for (text, part) in [
            ("read", "ADDRESS=RIGHT"),
            ("plc=read", "plc is neither"),
            ("1.2.3.4=all", "all is none of"),
        ] {
            let error = rules(&[text]).unwrap_err();
            assert!(error.contains(part), "{error}");
        }
        let many: Vec<_> = (0..11).map(|i| format!("10.0.0.{i}=read")).collect();
        let many: Vec<_> = many.iter().map(String::as_str).collect();
        let error = access(&rules(&many).unwrap()).unwrap_err();
        assert!(error.contains("10 places, not 11"), "{error}");
    }
}
