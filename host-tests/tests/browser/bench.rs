//! A simulator, a browser at its page, and a look at the image over Modbus TCP.
//!
//! Not here: what a test does with them.

use std::net::SocketAddr;

use host_tests::link::Link;
use host_tests::log::Log;
use host_tests::setup;
use host_tests::simulator::{Board, Options, Simulator};
use model_core::image::{Commands, Feedback, Signal};
use model_core::logic::Mode;

use crate::chromium::{Chromium, Page, button};

/// Several times real time, with room for a browser beside it.
pub const PACE: f64 = 5.0;
/// Values are coming.
pub const LIVE: &str = "document.querySelector('.stream.live') !== null";
/// Nobody's password but a test's.
const PASSWORD: &str = "reel and core";

/// All of it; it ends when dropped.
pub struct Bench {
    pub page: Page,
    link: Link,
    url: String,
    log: Log,
    // the page's, and what it is served by
    _browser: Chromium,
    simulator: Simulator,
}

impl Bench {
    /// The simulator at power-up, the browser at its page.
    pub fn start() -> Self {
        let program = setup::chromium().expect("chromium is there");
        let log = Log::default();
        let options = Options {
            pace: PACE,
            log: log.clone(),
            ..Options::default()
        };
        let simulator = Simulator::start(Board::Mps2, options).expect("QEMU starts");
        let link = Link::connect(simulator.address()).expect("it listens");
        let mut browser = Chromium::start(&program);
        let url = format!("http://{}/", simulator.http());
        let mut page = browser.open(&url);
        page.screen(1440, 900, false);
        page.until(LIVE);
        Self {
            page,
            link,
            url,
            log,
            _browser: browser,
            simulator,
        }
    }

    /// Where it answers Modbus TCP.
    pub fn modbus(&self) -> SocketAddr {
        self.simulator.address()
    }

    /// Where the page is.
    pub fn http(&self) -> SocketAddr {
        self.simulator.http()
    }

    /// Its address as the browser writes it.
    pub fn url(&self) -> &str {
        &self.url
    }

    /// Shows a page.
    #[track_caller]
    pub fn show(&mut self, page: &str) {
        self.page.click(&format!(
            "document.querySelector('nav a[href=\"#/{page}\"]')"
        ));
        self.page
            .until(&format!("!!document.querySelector('main.page-{page} h1')"));
    }

    /// The first password, in the dialog that a first change brings up.
    pub fn choose_password(&mut self) {
        self.page.until_text("Choose a password");
        self.page.fill("Password", PASSWORD);
        self.page.fill("Once more", PASSWORD);
        self.page.press("Set password");
        self.page.until("!document.querySelector('dialog')");
    }

    /// The password, in the dialog that asks for it.
    pub fn enter_password(&mut self) {
        self.page
            .until("document.querySelector('dialog input[name=password]') !== null");
        self.page.fill("Password", PASSWORD);
        self.page.key("Enter");
        self.page.until("!document.querySelector('dialog')");
    }

    /// Control of the winder, from its page.
    pub fn take_control(&mut self) {
        self.page.press("Take control");
        self.choose_password();
        self.page.until_text("This page commands.");
    }

    /// A web under tension at thread speed.
    pub fn thread(&mut self) {
        self.take_control();
        self.page.press("Prepare");
        self.page.press("Thread");
        self.page.until(&format!("!{}.disabled", button("Run")));
    }

    /// Begins a set at a speed, m/min, that stops at a diameter, mm.
    pub fn run(&mut self, speed: u32, diameter: u32) {
        self.page.fill("Web speed", &speed.to_string());
        self.page.fill("Diameter", &diameter.to_string());
        self.page.press("Run");
        self.until("it runs", |feedback| mode(feedback) == Some(Mode::Run));
    }

    /// What a PLC would read.
    pub fn feedback(&mut self) -> Feedback {
        self.link
            .read()
            .unwrap_or_else(|error| panic!("{error:#}\n{}", self.log.last(20)))
    }

    /// What stands in the command block; asked on a connection of its own, since one that is idle is closed.
    pub fn commands(&self) -> Commands {
        Link::connect(self.modbus())
            .and_then(|mut link| link.read_commands())
            .unwrap_or_else(|error| panic!("{error:#}\n{}", self.log.last(20)))
    }

    /// The value of a signal in its unit, as a PLC would read it.
    pub fn value(&mut self, signal: &Signal) -> f64 {
        self.feedback().get(signal)
    }

    /// Waits until a PLC would see it; says what did not come.
    #[track_caller]
    pub fn until(&mut self, what: &str, mut so: impl FnMut(&Feedback) -> bool) {
        // a PLC's usual interval, for at most a minute
        for _ in 0..1200 {
            if so(&self.feedback()) {
                return;
            }
            std::thread::sleep(std::time::Duration::from_millis(50));
        }
        panic!("not so: {what}\n{}", self.log.last(20));
    }
}

/// The winder's mode.
pub fn mode(feedback: &Feedback) -> Option<Mode> {
    let code = feedback.word(&model_core::image::MODE);
    Mode::ALL.get(usize::from(code)).copied()
}
