//! Finds what the simulator in QEMU needs, and installs and builds what is missing.
//!
//! Not here: installing Rust itself, or QEMU on a system without apt. There it says what to do.
//!
//! Every step that takes time says so on stderr before it begins; a step with nothing to do is silent.

use std::env;
use std::io::{self, BufRead, BufReader, IsTerminal};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail, ensure};

use crate::interrupt;

/// The emulator.
pub const QEMU: &str = "qemu-system-arm";
/// Names that the same browser goes by; the first is its Debian package.
const BROWSERS: [&str; 4] = [
    "chromium",
    "chromium-browser",
    "google-chrome-stable",
    "google-chrome",
];
/// The microcontroller's target: a core with a floating-point unit.
pub const TARGET: &str = "thumbv7em-none-eabihf";
/// The target of a core without.
pub const TARGET_SOFT: &str = "thumbv7m-none-eabi";

/// What QEMU needs to run the simulator.
#[derive(Clone, Debug)]
pub struct Mps2 {
    /// The emulator.
    pub qemu: PathBuf,
    /// The firmware, an ELF file.
    pub firmware: PathBuf,
    /// The plugin that holds its clock to real time.
    pub plugin: PathBuf,
}

/// Everything for the board `mps2`, installed and built where it is missing.
pub fn mps2() -> Result<Mps2> {
    mps2_with(Warnings::Shown)
}

/// What becomes of the compiler's warnings about the firmware.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Warnings {
    /// They are shown.
    Shown,
    /// They are errors.
    Denied,
}

/// As [`mps2`].
pub fn mps2_with(warnings: Warnings) -> Result<Mps2> {
    let qemu = qemu()?;
    target(TARGET)?;
    let firmware = firmware("board-mps2", "the firmware", TARGET, warnings)?;
    let plugin = ["build", "--release", "-p", "qemu-pace"];
    build("the QEMU plugin that keeps time", &plugin, warnings)?;
    Ok(Mps2 {
        qemu,
        firmware,
        plugin: built(&["release", "libqemu_pace.so"])?,
    })
}

/// The firmware of the board `mps2` for a target: an ELF file, built where it is not up to date.
pub fn mps2_for(target: &str, warnings: Warnings) -> Result<PathBuf> {
    self::target(target)?;
    firmware(
        "board-mps2",
        &format!("the firmware for {target}"),
        target,
        warnings,
    )
}

/// The model alone for a target: an ELF file, built where it is not up to date.
pub fn twin(target: &str, warnings: Warnings) -> Result<PathBuf> {
    self::target(target)?;
    let what = format!("the model alone for {target}");
    firmware("board-mps2-twin", &what, target, warnings)
}

/// The firmware for the dev board: an ELF file, built where it is not up to date.
pub fn nucleo_h743zi2(warnings: Warnings) -> Result<PathBuf> {
    target(TARGET)?;
    let what = "the firmware for the NUCLEO-H743ZI2";
    firmware("board-nucleo-h743zi2", what, TARGET, warnings)
}

/// The firmware for the dev board without floating-point unit, likewise.
pub fn nucleo_f207zg(warnings: Warnings) -> Result<PathBuf> {
    target(TARGET_SOFT)?;
    let what = "the firmware for the NUCLEO-F207ZG";
    firmware("board-nucleo-f207zg", what, TARGET_SOFT, warnings)
}

/// A board's package for its target: an ELF file, built where it is not up to date.
fn firmware(package: &str, what: &str, target: &str, warnings: Warnings) -> Result<PathBuf> {
    const PROFILE: &str = "firmware";
    let cargo = [
        "build",
        "--profile",
        PROFILE,
        "-p",
        package,
        "--target",
        target,
    ];
    build(what, &cargo, warnings)?;
    built(&[target, PROFILE, package])
}

/// The QEMU plugin that counts instructions, built where it is not up to date.
pub fn counter(warnings: Warnings) -> Result<PathBuf> {
    let package = ["build", "--release", "-p", "qemu-count"];
    build(
        "the QEMU plugin that counts instructions",
        &package,
        warnings,
    )?;
    built(&["release", "libqemu_count.so"])
}

/// The QEMU plugin that sees which task runs, built where it is not up to date.
pub fn tracer(warnings: Warnings) -> Result<PathBuf> {
    let package = ["build", "--release", "-p", "qemu-trace"];
    build(
        "the QEMU plugin that sees which task runs",
        &package,
        warnings,
    )?;
    built(&["release", "libqemu_trace.so"])
}

/// The compiler, as it tells its version.
pub fn compiler() -> Result<String> {
    let output = Command::new("rustc")
        .arg("-V")
        .current_dir(root())
        .output()
        .context("cannot start rustc")?;
    Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

/// The model alone on this PC as a development build makes it: a program, built where it is not up to date.
pub fn development_twin() -> Result<PathBuf> {
    let package = ["build", "-p", "host-tests", "--example", "twin"];
    build(
        "the development build of the model for this PC",
        &package,
        Warnings::Shown,
    )?;
    built(&["debug", "examples", "twin"])
}

/// A file for what a tool has to say, beside what cargo has built.
pub fn scratch(name: &str) -> Result<PathBuf> {
    let dir = target_dir().join("winder");
    std::fs::create_dir_all(&dir)
        .with_context(|| format!("cannot make the directory {}", dir.display()))?;
    Ok(dir.join(name))
}

/// The emulator, installed with apt where it is missing.
pub fn qemu() -> Result<PathBuf> {
    installed(
        &[QEMU],
        "QEMU",
        "QEMU's system emulator for Arm (7.0 or later)",
    )
}

/// A browser for the tests of the simulator's page, installed with apt where there is none.
pub fn chromium() -> Result<PathBuf> {
    installed(&BROWSERS, "Chromium", "Chromium (120 or later)")
}

/// A Modbus client of others, which asks by libmodbus; installed with apt where it is missing.
pub fn mbpoll() -> Result<PathBuf> {
    installed(&["mbpoll"], "mbpoll", "mbpoll")
}

/// What sets a network namespace up, installed with apt where it is missing.
pub fn ip() -> Result<PathBuf> {
    installed(&["iproute2", "ip"], "iproute2", "iproute2")
}

/// A soft PLC of others: LinuxCNC's ladder and its Modbus client, by the program that runs them; installed with apt where
/// they are missing.
pub fn soft_plc() -> Result<PathBuf> {
    installed(
        &["linuxcnc-uspace", "halrun"],
        "ClassicLadder and mb2hal",
        "LinuxCNC (2.9), for uspace",
    )
}

/// Python, for what runs in it.
pub fn python() -> Result<PathBuf> {
    installed(&["python3"], "Python", "Python (3.10 or later)")
}

/// The version of pymodbus that the tests know.
const PYMODBUS: &str = "pymodbus==3.16.1";

/// A Python that has pymodbus: an environment of its own, made where it is missing.
pub fn pymodbus() -> Result<PathBuf> {
    let environment = scratch("pymodbus")?;
    let python = environment.join("bin").join("python");
    let has = || {
        let mut import = Command::new(&python);
        import.args(["-c", "import pymodbus"]).stderr(Stdio::null());
        python.is_file() && succeeds(&mut import)
    };
    if has() {
        return Ok(python);
    }
    let make = || {
        let mut make = Command::new(self::python()?);
        run(make.args(["-m", "venv", "--clear"]).arg(&environment))
    };
    step("installing pymodbus (pip)");
    // Debian has what it takes in a package of its own
    if make().is_err() {
        debian("python3-venv", "Python's environments", "Python's venv")?;
        make()?;
    }
    run(Command::new(&python).args(["-m", "pip", "install", "--quiet", PYMODBUS]))?;
    ensure!(
        has(),
        "pip has installed {PYMODBUS}, but it cannot be imported"
    );
    Ok(python)
}

/// A program by any of its names; where there is none, the Debian package of the first name is installed.
fn installed(names: &[&str], what: &str, by_hand: &str) -> Result<PathBuf> {
    let present = || names.iter().find_map(|name| on_path(name));
    if let Some(path) = present() {
        return Ok(path);
    }
    let package = names[0];
    debian(package, what, by_hand)?;
    present().with_context(|| format!("apt-get has installed {package}, but it is not on the PATH"))
}

/// Installs a Debian package; `by_hand` says what else would do.
pub fn debian(package: &str, what: &str, by_hand: &str) -> Result<()> {
    let install = ["install", "-y", "--no-install-recommends", package];
    ensure!(
        on_path("apt-get").is_some(),
        "{package} is not installed, and there is no apt-get to install it with: install {by_hand} with this system's \
         package manager, then run this again"
    );
    let prefix: &[&str] = if is_root() {
        &[]
    } else if succeeds(Command::new("sudo").args(["-n", "true"])) {
        &["sudo", "-n"]
    } else {
        bail!(
            "{package} is not installed, and this user may not install it: run `sudo apt-get update && sudo apt-get \
             {}`, then run this again",
            install.join(" ")
        );
    };
    step(&format!("installing {what} (apt-get)"));
    let apt_get = |arguments: &[&str]| {
        let line = [
            prefix,
            &["env", "DEBIAN_FRONTEND=noninteractive", "apt-get"],
            arguments,
        ]
        .concat();
        let mut command = Command::new(line[0]);
        command.args(&line[1..]);
        run(&mut command)
    };
    // a list that cannot be renewed may still do
    if let Err(error) = apt_get(&["update"]) {
        eprintln!("winder: {error:#}; trying to install all the same");
    }
    apt_get(&install)
}

/// A Rust target of the microcontrollers, installed with rustup where it is missing.
pub fn target(target: &str) -> Result<()> {
    if has_target(target) {
        return Ok(());
    }
    step(&format!("installing the Rust target {target} (rustup)"));
    let added = run(Command::new("rustup").args(["target", "add", target]));
    interrupt::check()?;
    added
        .and_then(|()| {
            ensure!(has_target(target), "rustup has installed it for another toolchain than `rustc`'s");
            Ok(())
        })
        .with_context(|| {
            format!(
                "the Rust target {target} is missing: `rustup target add {target}` brings it where there is rustup \
                 and a network; elsewhere, name a toolchain that has it in the environment variable \
                 RUSTUP_TOOLCHAIN; then run this again"
            )
        })?;
    Ok(())
}

fn has_target(target: &str) -> bool {
    let output = Command::new("rustc")
        .args(["--print", "target-libdir", "--target", target])
        .current_dir(root())
        .stderr(Stdio::null())
        .output();
    // rustc names the directory whether or not it is there
    output.is_ok_and(|o| Path::new(String::from_utf8_lossy(&o.stdout).trim()).is_dir())
}

/// Runs cargo; shows what it says, but is silent when all was there.
pub fn build(what: &str, arguments: &[&str], warnings: Warnings) -> Result<()> {
    let mut child = cargo();
    child
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(io::stderr())
        .stderr(Stdio::piped());
    if io::stderr().is_terminal() && warnings == Warnings::Shown {
        child.env("CARGO_TERM_COLOR", "always");
    }
    let mut child = child.spawn().context("cannot start cargo")?;
    let messages = child.stderr.take().context("cargo has no stderr")?;
    let (mut announced, mut warned) = (false, false);
    for line in BufReader::new(messages).lines() {
        let line = line.context("cannot read what cargo says")?;
        if line.contains("Finished") || line.trim().is_empty() {
            continue;
        }
        if !announced {
            step(&format!("building {what}"));
            announced = true;
        }
        warned |= line.starts_with("warning");
        eprintln!("{line}");
    }
    let status = interrupt::wait(&mut child)?;
    ensure!(
        status.success(),
        "cannot build {what} ({status}): see cargo's messages above"
    );
    ensure!(
        !(warned && warnings == Warnings::Denied),
        "{what} compiles with warnings: see cargo's messages above"
    );
    Ok(())
}

/// Runs a program to its end; what it says goes to stderr, since stdout is for what we say to programs.
pub fn run(command: &mut Command) -> Result<()> {
    command.stdin(Stdio::null()).stdout(io::stderr());
    let line = format!("{command:?}").replace('"', "");
    let mut child = command
        .spawn()
        .with_context(|| format!("cannot start `{line}`"))?;
    let status = interrupt::wait(&mut child)?;
    ensure!(
        status.success(),
        "`{line}` failed ({status}): see its messages above"
    );
    Ok(())
}

/// Cargo, in the workspace.
pub fn cargo() -> Command {
    let mut command = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(root());
    command
}

/// The minor version that a tool of the toolchain tells: 95 of `rustc 1.95.0 (…)` as of `clippy 0.1.95 (…)`.
pub fn minor_version(program: &str, arguments: &[&str]) -> Result<u32> {
    let output = Command::new(program)
        .args(arguments)
        .current_dir(root())
        .output()
        .with_context(|| format!("cannot start {program}"))?;
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    let version = told.split_whitespace().nth(1).unwrap_or_default();
    let numbers: Vec<_> = version.split('.').collect();
    let minor = match numbers[..] {
        ["0", "1", minor] | ["1", minor, _] => minor.parse().ok(),
        _ => None,
    };
    minor.with_context(|| {
        format!(
            "`{program} {}` told no version: {told:?}",
            arguments.join(" ")
        )
    })
}

/// The workspace.
fn root() -> &'static Path {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    package.parent().unwrap_or(package)
}

/// Where cargo builds.
fn target_dir() -> PathBuf {
    let target = env::var_os("CARGO_TARGET_DIR").unwrap_or_else(|| "target".into());
    root().join(target)
}

fn built(parts: &[&str]) -> Result<PathBuf> {
    let path = target_dir().join(parts.iter().collect::<PathBuf>());
    ensure!(
        path.is_file(),
        "cargo has built, but there is no {}",
        path.display()
    );
    Ok(path)
}

/// The path of a program.
pub fn on_path(program: &str) -> Option<PathBuf> {
    env::split_paths(&env::var_os("PATH")?)
        .map(|dir| dir.join(program))
        .find(|path| path.is_file())
}

/// This process may do everything.
pub fn is_root() -> bool {
    // the owner of our own entry is our effective user
    std::fs::metadata("/proc/self").is_ok_and(|own| own.uid() == 0)
}

fn succeeds(command: &mut Command) -> bool {
    command.status().is_ok_and(|status| status.success())
}

fn step(what: &str) {
    eprintln!("winder: {what} …");
}
