//! A network of its own for one process: a namespace with loopback and a TAP, to which QEMU is wired as to a cable.
//!
//! Not here: what travels on it, and bridges to other networks: nothing leaves the namespace, and it ends with its
//! processes.
//!
//! QEMU's user network answers for the guest: it accepts a connection before the guest has heard of it. Where
//! packets matter, the kernel at one end of a TAP and the guest at the other have nothing between them.
//!
//! A process cannot move all of its threads, so it starts itself a second time, in the namespace. That needs root, or a
//! kernel that gives users namespaces of their own.

use std::env;
use std::fs;
use std::net::Ipv4Addr;
use std::process::{Command, ExitStatus, Stdio};

use anyhow::{Context, Result, ensure};

use crate::interrupt;
use crate::setup;

/// Set in the process that is inside.
const INSIDE: &str = "WINDER_NAMESPACE";
/// The TAP's name.
pub const TAP: &str = "winder0";
/// The host's own address there: the guest's gateway, as on QEMU's user network.
pub const HOST: &str = "10.0.2.2/24";
/// How many ended connections the kernel keeps in mind (TIME-WAIT), a minute each: at a thousand a second they would use
/// up the ports that connections are made from, and looking for a free one would take longer and longer.
const ENDED: &str = "/proc/sys/net/ipv4/tcp_max_tw_buckets";
const KEPT: &str = "1000";
/// The guest's address.
pub const GUEST: Ipv4Addr = Ipv4Addr::new(10, 0, 2, 15);

/// On which side of it this process is.
#[derive(Debug)]
pub enum Side {
    /// Inside, with [`TAP`] up.
    Inside,
    /// Outside; the process inside has ended so.
    Outside(ExitStatus),
}

/// Goes there: inside, sets the network up; outside, runs this program with these arguments inside, to its end.
///
/// # Errors
/// It is not permitted here, or what it needs is not installed; the error says which.
pub fn enter(arguments: &[String]) -> Result<Side> {
    if env::var_os(INSIDE).is_some() {
        for line in [
            "link set lo up".to_owned(),
            format!("tuntap add {TAP} mode tap"),
            format!("address add {HOST} dev {TAP}"),
            format!("link set {TAP} up"),
        ] {
            setup::run(Command::new("ip").args(line.split(' ')))?;
        }
        if let Err(error) = fs::write(ENDED, KEPT) {
            eprintln!("winder: {ENDED}: {error}; a minute of connections will be slow");
        }
        return Ok(Side::Inside);
    }
    setup::ip()?;
    let mut unshare = Command::new("unshare");
    if !setup::is_root() {
        unshare.args(["--user", "--map-root-user"]);
    }
    unshare.arg("--net");
    let mut try_it = Command::new(unshare.get_program());
    try_it.args(unshare.get_args());
    let tried = try_it
        .args(["ip", "tuntap", "add", TAP, "mode", "tap"])
        .stdin(Stdio::null())
        .output()
        .context("cannot start unshare (package util-linux)")?;
    ensure!(
        tried.status.success(),
        "a network namespace with a TAP is not permitted here: {}",
        String::from_utf8_lossy(&tried.stderr).trim()
    );
    let program = env::current_exe().context("this program has no path")?;
    let mut inside = unshare
        .arg(program)
        .args(arguments)
        .env(INSIDE, "1")
        .spawn()
        .context("cannot start a second time")?;
    Ok(Side::Outside(interrupt::wait(&mut inside)?))
}
