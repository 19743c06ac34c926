//! Who may ask: the checks that every request passes before anything is looked at.
//!
//! Not here: passwords and sessions.
//!
//! A browser lends its user's rights to any page it shows. So the host that it believes to talk to must be this
//! device, or a name that resolves to it later (DNS rebinding) would read everything; and a page that sends something
//! must be this device's own, or a link in a mail could stop the winder (request forgery). What is no browser sends
//! no origin and may ask.

use core::net::{Ipv4Addr, Ipv6Addr};

use picoserve::request::{Headers, RequestParts};

use super::answer::Refusal;

/// Host names beside addresses.
const NAMES: [&str; 2] = ["localhost", "winder.local"];

/// The value of a header.
pub fn header<'r>(headers: &Headers<'r>, name: &str) -> Option<&'r str> {
    headers.get(name)?.as_str().ok().map(str::trim)
}

/// Refuses a request that came by a name which is not this device's, or from a page which is not.
pub fn check(parts: &RequestParts<'_>) -> Result<(), Refusal> {
    let headers = parts.headers();
    let host = header(&headers, "host").unwrap_or_default();
    if !is_own(host) {
        return Err(Refusal::new(
            403,
            format_args!("the host must be an address, localhost or winder.local"),
        ));
    }
    let foreign = match headers.get("origin").map(|origin| origin.as_str()) {
        None => false,
        Some(Ok(origin)) => !is_origin(origin.trim(), host),
        Some(Err(_)) => true,
    };
    let site = header(&headers, "sec-fetch-site");
    let elsewhere = site.is_some_and(|site| !matches!(site, "same-origin" | "none"));
    // A link to this device may be followed from anywhere, as long as nothing comes of it but the page.
    let followed = parts.method() == "GET" && !parts.path().encoded().starts_with("/api/");
    if foreign || (elsewhere && !followed) {
        return Err(Refusal::new(
            403,
            format_args!("only this device's own page may ask this"),
        ));
    }
    Ok(())
}

/// The host, with or without a port, is a literal address or a name of this device.
fn is_own(host: &str) -> bool {
    let name = match host.strip_prefix('[') {
        Some(rest) => match rest.split_once(']') {
            Some((address, port)) if is_port(port) => {
                return address.parse::<Ipv6Addr>().is_ok();
            }
            _ => return false,
        },
        None => match host.find(':') {
            Some(colon) if is_port(&host[colon..]) => &host[..colon],
            Some(_) => return false,
            None => host,
        },
    };
    name.parse::<Ipv4Addr>().is_ok() || NAMES.iter().any(|own| own.eq_ignore_ascii_case(name))
}

/// Nothing, or a colon and a number.
fn is_port(text: &str) -> bool {
    text.is_empty()
        || text
            .strip_prefix(':')
            .is_some_and(|port| port.parse::<u16>().is_ok())
}

/// The origin is the page that this host serves.
fn is_origin(origin: &str, host: &str) -> bool {
    origin.split_once("://").is_some_and(|(scheme, of)| {
        scheme.eq_ignore_ascii_case("http") && of.eq_ignore_ascii_case(host)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_host_is_an_address_or_a_name_of_ours() {
        for own in [
            "127.0.0.1",
            "10.0.2.15:8080",
            "localhost:80",
            "LOCALHOST",
            "[::1]",
            "[fe80::1]:80",
            "winder.local",
        ] {
            assert!(is_own(own), "{own}");
        }
        for other in [
            "",
            ":80",
            "example.com",
            "127.0.0.1.example.com",
            "localhost.example.com:80",
            "10.0.2.15:80:80",
            "10.0.2.15:x",
            "[::1",
            "[::1]x",
            "[10.0.2.15]",
            "::1",
        ] {
            assert!(!is_own(other), "{other}");
        }
    }

    #[test]
    fn an_origin_is_of_the_same_host_and_port() {
        assert!(is_origin("http://10.0.2.15", "10.0.2.15"));
        assert!(is_origin("http://localhost:80", "LOCALHOST:80"));
        for other in [
            "null",
            "",
            "10.0.2.15",
            "https://10.0.2.15",
            "http://10.0.2.15:81",
            "http://10.0.2.15.example.com",
        ] {
            assert!(!is_origin(other, "10.0.2.15"), "{other}");
        }
    }
}
