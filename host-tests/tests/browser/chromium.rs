//! Chromium as a test drives it: pages, clicks, keys, what it logs and asks for, pictures.
//!
//! Not here: what a page should be. The driver speaks the browser's own debugging protocol (CDP) over one WebSocket
//! for each page; the libraries that wrap it compile for longer than all of these tests run.
//!
//! A click is a click at a place of the screen, a text comes by the keyboard: what a person could not reach, a test
//! cannot either.

use std::fs;
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use data_encoding::BASE64;
use serde_json::{Value, json};
use tungstenite::{Message, WebSocket};

/// The browser itself says that it is ready within this time, on a busy PC as well.
const START: Duration = Duration::from_secs(60);
/// An answer of the browser, and what a page should come to.
const PATIENCE: Duration = Duration::from_secs(60);
/// Between two looks.
const PAUSE: Duration = Duration::from_millis(50);
/// What is where it was so long ago keeps still.
const STILL: Duration = Duration::from_millis(20);

/// A running browser without a window; it ends when dropped.
pub struct Chromium {
    child: Child,
    profile: tempfile::TempDir,
    port: u16,
    control: Socket,
}

impl Chromium {
    /// Starts it with a profile of its own.
    pub fn start(program: &Path) -> Self {
        let profile = tempfile::tempdir().expect("a directory");
        let mut command = Command::new(program);
        command
            .arg("--headless=new")
            .arg("--remote-debugging-port=0")
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .args(["--no-first-run", "--no-default-browser-check"])
            .args(["--disable-gpu", "--hide-scrollbars", "--mute-audio"])
            // it would ask its maker for updates and lists
            .args([
                "--disable-background-networking",
                "--disable-component-update",
            ])
            .args(["--disable-sync", "--disable-extensions"])
            // containers have little shared memory, and root has no sandbox; it shows our own page only
            .args(["--disable-dev-shm-usage", "--no-sandbox"])
            .arg("about:blank")
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null());
        let mut child = command.spawn().expect("chromium starts");
        let file = profile.path().join("DevToolsActivePort");
        let began = Instant::now();
        let (port, path) = loop {
            let text = fs::read_to_string(&file).unwrap_or_default();
            if let [port, path, ..] = text.lines().collect::<Vec<_>>()[..]
                && let Ok(port) = port.parse::<u16>()
            {
                break (port, path.to_owned());
            }
            let ended = child.try_wait().expect("a child");
            assert!(ended.is_none(), "chromium has ended: {ended:?}");
            assert!(began.elapsed() < START, "chromium does not start");
            thread::sleep(PAUSE);
        };
        Self {
            child,
            profile,
            port,
            control: Socket::connect(port, &path),
        }
    }

    /// A new page, at an address.
    pub fn open(&mut self, url: &str) -> Page {
        let made = self
            .control
            .call("Target.createTarget", json!({ "url": "about:blank" }));
        let id = made["targetId"].as_str().expect("an id").to_owned();
        let downloads = self.profile.path().join("downloads");
        fs::create_dir_all(&downloads).expect("a directory");
        self.control.call(
            "Browser.setDownloadBehavior",
            json!({ "behavior": "allow", "downloadPath": downloads }),
        );
        let mut page = Page {
            socket: Socket::connect(self.port, &format!("/devtools/page/{id}")),
            downloads,
        };
        for domain in ["Page", "Runtime", "Log", "Network", "Accessibility"] {
            page.call(&format!("{domain}.enable"), json!({}));
        }
        page.go(url);
        page
    }
}

impl Drop for Chromium {
    fn drop(&mut self) {
        // its helpers end with it, and the profile can go
        let _ = self.control.send("Browser.close", json!({}));
        let began = Instant::now();
        while began.elapsed() < Duration::from_secs(5) {
            if !matches!(self.child.try_wait(), Ok(None)) {
                return;
            }
            thread::sleep(PAUSE);
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// One WebSocket of the debugging protocol.
struct Socket {
    stream: WebSocket<TcpStream>,
    last: u64,
    events: Vec<Value>,
}

impl Socket {
    fn connect(port: u16, path: &str) -> Self {
        let tcp = TcpStream::connect(("127.0.0.1", port)).expect("chromium listens");
        tcp.set_read_timeout(Some(PATIENCE)).expect("a timeout");
        let (stream, _) = tungstenite::client(format!("ws://127.0.0.1:{port}{path}"), tcp)
            .expect("chromium speaks its protocol");
        Self {
            stream,
            last: 0,
            events: Vec::new(),
        }
    }

    fn send(&mut self, method: &str, params: Value) -> tungstenite::Result<u64> {
        self.last += 1;
        let text = json!({ "id": self.last, "method": method, "params": params }).to_string();
        self.stream.send(Message::text(text))?;
        Ok(self.last)
    }

    /// A command and its answer; what happens meanwhile is kept.
    #[track_caller]
    fn call(&mut self, method: &str, params: Value) -> Value {
        let id = self.send(method, params).expect("chromium listens");
        loop {
            let message = self
                .stream
                .read()
                .unwrap_or_else(|error| panic!("{method}: {error}"));
            let Message::Text(text) = message else {
                continue;
            };
            let mut message: Value = serde_json::from_str(&text).expect("JSON");
            if message["id"] == id {
                let failed = &message["error"];
                assert!(failed.is_null(), "{method}: {failed}");
                return message["result"].take();
            }
            if message["method"].is_string() {
                self.events.push(message);
            }
        }
    }
}

/// A page of the browser.
pub struct Page {
    socket: Socket,
    downloads: std::path::PathBuf,
}

impl Page {
    /// A command of the debugging protocol.
    #[track_caller]
    pub fn call(&mut self, method: &str, params: Value) -> Value {
        self.socket.call(method, params)
    }

    /// Goes to an address, and forgets what came before.
    pub fn go(&mut self, url: &str) {
        self.call("Page.navigate", json!({ "url": url }));
        self.until("document.readyState === 'complete'");
    }

    /// The value of an expression in the page; a promise is awaited.
    #[track_caller]
    pub fn eval(&mut self, expression: &str) -> Value {
        let mut answer = self.call(
            "Runtime.evaluate",
            json!({ "expression": expression, "awaitPromise": true, "returnByValue": true }),
        );
        let thrown = &answer["exceptionDetails"];
        assert!(thrown.is_null(), "{expression}\n{thrown}");
        answer["result"]["value"].take()
    }

    /// Waits until an expression is true.
    #[track_caller]
    pub fn until(&mut self, expression: &str) {
        let began = Instant::now();
        while self.eval(expression) != true {
            if began.elapsed() > PATIENCE {
                let text = self.eval("document.body.innerText");
                panic!(
                    "not so: {expression}\nthe page:\n{}",
                    text.as_str().unwrap_or_default()
                );
            }
            thread::sleep(PAUSE);
        }
    }

    /// Waits until the page shows a text.
    #[track_caller]
    pub fn until_text(&mut self, text: &str) {
        self.until(&format!(
            "document.body.innerText.includes({})",
            json!(text)
        ));
    }

    /// Clicks the first thing that `expression` finds, as a person does: where it can be seen, once it can be used.
    #[track_caller]
    pub fn click(&mut self, expression: &str) {
        let look = format!(
            "(() => {{ const e = {expression}; if (!e || e.disabled) return null; \
             e.scrollIntoView({{ block: 'center' }}); const r = e.getBoundingClientRect(); \
             const at = document.elementFromPoint(r.x + r.width / 2, r.y + r.height / 2); \
             return e === at || e.contains(at) ? [r.x + r.width / 2, r.y + r.height / 2] : null; }})()"
        );
        self.until(&format!("{look} !== null"));
        // a page that is being laid out moves things away from under the mouse
        let mut place = self.eval(&look);
        let began = Instant::now();
        loop {
            thread::sleep(STILL);
            let again = self.eval(&look);
            if again == place && !again.is_null() {
                break;
            }
            assert!(
                began.elapsed() < PATIENCE,
                "does not keep still: {expression}"
            );
            place = again;
        }
        for kind in ["mousePressed", "mouseReleased"] {
            self.call(
                "Input.dispatchMouseEvent",
                json!({ "type": kind, "x": place[0], "y": place[1], "button": "left", "clickCount": 1 }),
            );
        }
    }

    /// Clicks the button with this name.
    #[track_caller]
    pub fn press(&mut self, name: &str) {
        self.click(&button(name));
    }

    /// Clicks into the field of this name, and writes into it in place of what is there.
    #[track_caller]
    pub fn fill(&mut self, name: &str, text: &str) {
        let field = field(name);
        self.click(&field);
        self.eval(&format!("{field}.select()"));
        self.call("Input.insertText", json!({ "text": text }));
    }

    /// Chooses in the list of this name, by the choice's value.
    #[track_caller]
    pub fn choose(&mut self, name: &str, value: &str) {
        let list = field(name);
        self.until(&format!("!!{list}"));
        self.eval(&format!(
            "(() => {{ const e = {list}; e.value = {}; \
             e.dispatchEvent(new Event('change', {{ bubbles: true }})); return e.value; }})()",
            json!(value)
        ));
    }

    /// Gives a file to the field of this name, as somebody who chooses it.
    #[track_caller]
    pub fn upload(&mut self, name: &str, file: &str, content: &[u8]) {
        let path = self.downloads.join(file);
        fs::write(&path, content).expect("a file");
        let answer = self.call("Runtime.evaluate", json!({ "expression": field(name) }));
        let object = &answer["result"]["objectId"];
        self.call(
            "DOM.setFileInputFiles",
            json!({ "files": [path], "objectId": object }),
        );
    }

    /// Presses a key.
    #[track_caller]
    pub fn key(&mut self, key: &str) {
        let code = match key {
            "Tab" => 9,
            "Enter" => 13,
            "Escape" => 27,
            _ => 0,
        };
        // a key that writes nothing is a raw one: the browser itself acts on it
        let (down, text) = match key {
            "Enter" => ("keyDown", "\r"),
            _ => ("rawKeyDown", ""),
        };
        for kind in [down, "keyUp"] {
            self.call(
                "Input.dispatchKeyEvent",
                json!({ "type": kind, "key": key, "code": key, "windowsVirtualKeyCode": code, "text": text }),
            );
        }
    }

    /// The size of the screen, and whether it is dark.
    pub fn screen(&mut self, width: u32, height: u32, dark: bool) {
        self.call(
            "Emulation.setDeviceMetricsOverride",
            json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": false }),
        );
        let scheme = if dark { "dark" } else { "light" };
        self.call(
            "Emulation.setEmulatedMedia",
            json!({ "features": [{ "name": "prefers-color-scheme", "value": scheme }] }),
        );
    }

    /// The screen as PNG.
    pub fn picture(&mut self, file: &Path) {
        let answer = self.call("Page.captureScreenshot", json!({ "format": "png" }));
        let data = answer["data"].as_str().expect("a picture");
        let png = BASE64.decode(data.as_bytes()).expect("base64");
        fs::write(file, png).expect("a file");
    }

    /// The content of the file that the page gives to its user, once it is whole.
    #[track_caller]
    pub fn download(&mut self, name: &str) -> String {
        String::from_utf8(self.download_bytes(name)).expect("text")
    }

    /// As [`Self::download`], whatever it is.
    #[track_caller]
    pub fn download_bytes(&mut self, name: &str) -> Vec<u8> {
        let file = self.downloads.join(name);
        let began = Instant::now();
        while !file.exists() {
            assert!(began.elapsed() < PATIENCE, "no {name}");
            thread::sleep(PAUSE);
        }
        fs::read(&file).expect("a file")
    }

    /// The events of a kind so far.
    pub fn events<'a>(&'a self, method: &'a str) -> impl Iterator<Item = &'a Value> {
        let of = move |event: &&Value| event["method"] == method;
        self.socket
            .events
            .iter()
            .filter(of)
            .map(|event| &event["params"])
    }

    /// What the page complained about: exceptions, errors and warnings in its console, requests that failed.
    pub fn complaints(&self) -> Vec<String> {
        let thrown = self
            .events("Runtime.exceptionThrown")
            .map(|e| e["exceptionDetails"]["exception"]["description"].to_string());
        let said = self
            .events("Runtime.consoleAPICalled")
            .filter(|e| e["type"] == "error" || e["type"] == "warning")
            .map(|e| e["args"].to_string());
        let logged = self
            .events("Log.entryAdded")
            .filter(|e| e["entry"]["level"] == "error" || e["entry"]["level"] == "warning")
            .map(|e| format!("{} {}", e["entry"]["text"], e["entry"]["url"]));
        thrown.chain(said).chain(logged).collect()
    }

    /// Every address that the page has asked for, streams included.
    pub fn requests(&self) -> Vec<String> {
        let http = self
            .events("Network.requestWillBeSent")
            .map(|e| &e["request"]["url"]);
        let streams = self.events("Network.webSocketCreated").map(|e| &e["url"]);
        http.chain(streams)
            .map(|url| url.as_str().unwrap_or_default().to_owned())
            .collect()
    }

    /// Texts that came over streams.
    pub fn frames(&self) -> Vec<String> {
        self.events("Network.webSocketFrameReceived")
            .map(|e| {
                e["response"]["payloadData"]
                    .as_str()
                    .unwrap_or_default()
                    .to_owned()
            })
            .collect()
    }

    /// Roles and names of what can be operated, as the browser tells them to a screen reader.
    pub fn controls(&mut self) -> Vec<(String, String)> {
        const OPERATED: [&str; 11] = [
            "button",
            "link",
            "textbox",
            "searchbox",
            "combobox",
            "spinbutton",
            "checkbox",
            "switch",
            "radio",
            "slider",
            "listbox",
        ];
        let tree = self.call("Accessibility.getFullAXTree", json!({}));
        let nodes = tree["nodes"].as_array().cloned().unwrap_or_default();
        let text = |value: &Value| value["value"].as_str().unwrap_or_default().to_owned();
        nodes
            .iter()
            .filter(|node| node["ignored"] == false)
            .map(|node| (text(&node["role"]), text(&node["name"])))
            .filter(|(role, _)| OPERATED.contains(&role.as_str()))
            .collect()
    }
}

/// An answer of the interface to somebody without a browser.
pub fn get(at: std::net::SocketAddr, path: &str) -> String {
    use std::io::{Read, Write};
    let mut stream = TcpStream::connect(at).expect("a place");
    stream.set_read_timeout(Some(PATIENCE)).expect("a socket");
    write!(
        stream,
        "GET {path} HTTP/1.1\r\nHost: {at}\r\nConnection: close\r\n\r\n"
    )
    .expect("sent");
    let mut answer = String::new();
    stream.read_to_string(&mut answer).expect("an answer");
    answer
}

/// The first button, link or switch whose text begins with a name.
pub fn button(name: &str) -> String {
    format!(
        "[...document.querySelectorAll('button, a, [role=switch]')].find((e) => \
         (e.getAttribute('aria-label') || e.innerText || '').trim().replace(/^\\d\\s*\\n\\s*/, '').startsWith({}))",
        json!(name)
    )
}

/// The field whose label, or whose own name, begins with a name.
pub fn field(name: &str) -> String {
    format!(
        "[...document.querySelectorAll('input, select')].find((e) => \
         (e.getAttribute('aria-label') || e.labels?.[0]?.innerText || '').trim().startsWith({}))",
        json!(name)
    )
}
