//! What can be asked: one table, and one way in.
//!
//! Not here: what comes of it. Whether a request is read, needs a session or changes anything stands in [`ROUTES`],
//! and the way in keeps to it: nothing can be added that forgets a check.

use core::fmt::Write as _;

use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::Instant;
use picoserve::ResponseSent;
use picoserve::extract::FromRequest as _;
use picoserve::io::Read;
use picoserve::request::{Headers, Path, Request, RequestParts};
use picoserve::response::{IntoResponse, ResponseWriter, WebSocketUpgrade};
use picoserve::routing::PathRouterService;

use super::answer::{Answer, Cookie, Detail, Refusal};
use super::auth::{PASSWORD_BYTES, Secret};
use super::desk::Papers;
use super::documents::{Page, What};
use super::live::Live;
use super::setup::Values;
use super::{BODY_BYTES, Hmi, assets, body, guard, panel};

/// Methods that are served.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Reads.
    Get,
    /// Does something.
    Post,
    /// Sets something.
    Put,
    /// Takes something away.
    Delete,
}

impl Method {
    /// As it travels.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Get => "GET",
            Self::Post => "POST",
            Self::Put => "PUT",
            Self::Delete => "DELETE",
        }
    }
}

/// What comes of a request.
#[derive(Clone, Copy, Debug)]
enum Action {
    Info,
    Events,
    Show(What),
    Stream,
    Command,
    Panel,
    Stage,
    Unstage,
    Preset,
    Apply,
    Connect,
    Overwrite,
    ResetSettings,
    Keep,
    Restore { replay: bool },
    ForgetTimes,
    AskAcceptance,
    ReportAcceptance,
    SetPassword,
    LogIn,
    LogOut,
}

/// One thing that can be asked.
#[derive(Debug)]
pub struct Route {
    /// How.
    pub method: Method,
    /// Where.
    pub path: &'static str,
    /// Whether only who has logged in may.
    pub login: bool,
    /// What it is, in a sentence.
    pub about: &'static str,
    action: Action,
}

/// Writes the table.
macro_rules! routes {
    ($($method:ident $path:literal $login:ident $action:expr, $about:literal;)*) => {
        &[$(Route {
            method: Method::$method,
            path: concat!("/api/v1/", $path),
            login: routes!(@$login),
            about: $about,
            action: $action,
        }),*]
    };
    (@anybody) => { false };
    (@session) => { true };
}

/// Everything that can be asked, but for the files of the page.
#[rustfmt::skip]
pub static ROUTES: &[Route] = routes! {
    Get    "info"              anybody Action::Info, "what this is, who controls the winder, whether a password is set";
    Get    "signals"           anybody Action::Show(What::Signals), "the signals of the process image";
    Get    "image"             anybody Action::Show(What::Image), "the process image of one drive cycle, word by word";
    Get    "live"              anybody Action::Stream, "a WebSocket: signals as a stream";
    Post   "commands"          session Action::Command, "sets commands by name, in counts; those of the winder while the panel controls it";
    Get    "faults"            anybody Action::Show(What::Faults), "the faults that end by themselves, and when";
    Get    "panel"             anybody Action::Show(What::Panel), "what the operator panel does";
    Post   "panel"             session Action::Panel, "asks the operator panel for something";
    Get    "parameters"        anybody Action::Show(What::Parameters), "the machine's parameters, in use and staged";
    Put    "parameters/staged" session Action::Stage, "stages values, all of them or none";
    Delete "parameters/staged" session Action::Unstage, "forgets what is staged";
    Post   "parameters/preset" session Action::Preset, "stages a preset";
    Post   "parameters/apply"  session Action::Apply, "what is staged goes into use, at standstill: the machine is at power-up then";
    Get    "presets"           anybody Action::Show(What::Presets), "the machines that ship, and which of them can run here";
    Get    "settings"          anybody Action::Show(What::Settings), "what the board remembers, and whether it is stored";
    Put    "settings"          session Action::Connect, "network and serial line for the next start";
    Post   "settings/overwrite" session Action::Overwrite, "what is in use takes the place of what is of no use in the flash";
    Delete "settings"          session Action::ResetSettings, "empties the flash: the next start has the defaults";
    Get    "gains"             anybody Action::Show(What::Gains), "the gains of all loops at the present diameters, and whether auto-tune has set them";
    Get    "link"              anybody Action::Show(What::Link), "the links' clients, and who wrote which command last";
    Get    "events"            anybody Action::Events, "what has happened, after the event of the number `after`";
    Get    "snapshot"          anybody Action::Show(What::Snapshot), "whether there is a snapshot, and of what the recording is";
    Post   "snapshot"          session Action::Keep, "keeps the state of the simulator; the recording begins anew";
    Post   "restore"           session Action::Restore { replay: false }, "goes on from the snapshot";
    Post   "replay"            session Action::Restore { replay: true }, "goes on from the snapshot with what was commanded since";
    Get    "journal"           anybody Action::Show(What::Journal), "the recording as CSV; from power-up, the command line tool can replay it";
    Get    "health"            anybody Action::Show(What::Health), "the times of the tasks, memory and places in use, why the board has started";
    Post   "health/reset"      session Action::ForgetTimes, "forgets the worst times and the overruns";
    Get    "acceptance"        anybody Action::Show(What::Acceptance), "the acceptance run that was asked for, and what it has found";
    Post   "acceptance"        session Action::AskAcceptance, "asks for an acceptance run, or takes it back";
    Post   "acceptance/report" session Action::ReportAcceptance, "its runner tells where it is";
    Post   "password"          anybody Action::SetPassword, "sets the password: the first anybody, another who has logged in";
    Post   "login"             anybody Action::LogIn, "begins a session";
    Post   "logout"            anybody Action::LogOut, "ends the session";
};

/// Everything, for one connection.
pub struct Routes<'a, M: RawMutex> {
    pub(super) hmi: Hmi<'a, M>,
    pub(super) answered: &'a dyn Fn(),
}

type Reply<'a, M> = Answer<Page<'a, M>>;

impl<'a, M: RawMutex> Routes<'a, M> {
    /// Finds what is asked for, and who may; nothing has been done then.
    fn find(&self, parts: &RequestParts<'_>, length: usize) -> Result<Found, Refusal> {
        guard::check(parts)?;
        let path = parts.path().encoded();
        if let Some(asset) = assets::find(path) {
            return match parts.method() {
                "GET" => Ok(Found::File(asset)),
                _ => Err(Refusal::new(405, format_args!("a file can only be read"))),
            };
        }
        let mut here = ROUTES.iter().filter(|route| route.path == path).peekable();
        if here.peek().is_none() {
            return Err(Refusal::new(404, format_args!("there is nothing here")));
        }
        let route = here
            .find(|route| route.method.name() == parts.method())
            .ok_or_else(|| Refusal::new(405, format_args!("this cannot be asked so")))?;
        let headers = parts.headers();
        let json = guard::header(&headers, "content-type").is_some_and(|kind| {
            let (kind, _) = kind.split_once(';').unwrap_or((kind, ""));
            kind.trim().eq_ignore_ascii_case("application/json")
        });
        if !json && (length > 0 || route.method != Method::Get && route.method != Method::Delete) {
            return Err(Refusal::new(
                415,
                format_args!("what is sent must be application/json"),
            ));
        }
        if length > BODY_BYTES {
            return Err(Refusal::new(
                413,
                format_args!("{length} bytes are more than {BODY_BYTES}"),
            ));
        }
        Ok(Found::Route(route))
    }

    /// Whether the request is of a session.
    fn token<'r>(&self, headers: &Headers<'r>) -> Option<&'r str> {
        let cookies = guard::header(headers, "cookie")?.split(';');
        let token = cookies
            .filter_map(|cookie| cookie.trim().strip_prefix("session="))
            .next()?;
        let known = self.hmi.desk.with(|papers| papers.auth.knows(token));
        known.then_some(token)
    }

    async fn answer(
        &self,
        route: &Route,
        parts: &RequestParts<'_>,
        body: &[u8],
    ) -> Result<Reply<'a, M>, Refusal> {
        let token = self.token(&parts.headers());
        let may = token.is_some();
        if route.login && !may {
            return Err(Refusal::new(401, format_args!("log in first")));
        }
        if !body::is_shallow(body) {
            return Err(Refusal::new(
                400,
                format_args!("the body is nested too deep"),
            ));
        }
        let hmi = self.hmi;
        let show = |what| Ok(Answer::Document(Page { hmi, what }));
        match route.action {
            Action::Info => return show(What::Info { logged_in: may }),
            Action::Events => {
                let query = parts.query().map_or("", |query| query.0);
                let after = query
                    .split('&')
                    .find_map(|pair| pair.strip_prefix("after="));
                let after = after.map_or(Ok(0), str::parse);
                let after = after.map_err(|_| {
                    Refusal::new(400, format_args!("after is the number of an event"))
                })?;
                return show(What::Events { after });
            }
            Action::Show(what) => return show(what),
            Action::Stream => return Err(Refusal::new(426, format_args!("this is a WebSocket"))),
            Action::Command => {
                let wanted = body::commands(body)?;
                hmi.command(&wanted.settings, wanted.for_s)?;
            }
            Action::Panel => self.panel(&body::read(body)?)?,
            Action::Stage => {
                let mut values = Values::default();
                let revision = body::staged(body, &mut values)?;
                hmi.desk
                    .with(|papers| papers.setup.stage(revision, &values))?;
            }
            Action::Unstage => hmi.desk.with(|papers| papers.setup.unstage()),
            Action::Preset => {
                let body::Preset { name, revision } = body::read(body)?;
                hmi.desk
                    .with(|papers| papers.setup.stage_preset(revision, name))?;
            }
            Action::Apply => hmi.apply(body::read::<body::Seen>(body)?.revision)?,
            Action::Connect => hmi.connect(body)?,
            Action::Overwrite => hmi.overwrite()?,
            Action::ResetSettings => hmi.reset_settings()?,
            Action::Keep => hmi.keep()?,
            Action::Restore { replay } => hmi.restore(replay)?,
            Action::ForgetTimes => hmi.desk.with(|papers| papers.forget_times = true),
            Action::AskAcceptance => hmi.ask_acceptance(body)?,
            Action::ReportAcceptance => hmi.report_acceptance(body)?,
            Action::SetPassword => return self.set_password(body, may).await,
            Action::LogIn => return self.log_in(body).await,
            Action::LogOut => {
                if let Some(token) = token {
                    hmi.desk.with(|papers| papers.auth.end(token));
                }
                return Ok(Answer::Done(Some(cookie("", "; Max-Age=0"))));
            }
        }
        Ok(Answer::Done(None))
    }

    fn panel(&self, wish: &body::Panel) -> Result<(), Refusal> {
        let action = match wish.action {
            "take" => return self.hmi.take(true),
            "release" => return self.hmi.take(false),
            "prepare" => panel::Action::Prepare,
            "thread" => panel::Action::Thread,
            "run" => panel::Action::Run(panel::Order {
                v_set_m_min: wish.v_set_m_min,
                goal: panel::Goal {
                    length_m: wish.length_m,
                    diameter_mm: wish.diameter_mm,
                },
            }),
            "stop" => panel::Action::Stop,
            "emergency_stop" => panel::Action::EmergencyStop,
            "acknowledge" => panel::Action::Acknowledge,
            "new_set" => panel::Action::NewSet,
            "switch_off" => panel::Action::SwitchOff,
            "autotune" => panel::Action::Autotune(wish.tuned.unwrap_or_default()),
            other => {
                return Err(Refusal::new(
                    422,
                    format_args!("there is no action {other}"),
                ));
            }
        };
        self.hmi.act(action)
    }

    /// Begins to look at a password.
    fn try_password(&self) -> Result<(), Refusal> {
        let now = Instant::now();
        self.hmi.desk.with(|papers| match papers.auth.pause_s(now) {
            0 => {
                papers.auth.try_once(now);
                Ok(())
            }
            pause => Err(Refusal::new(
                429,
                format_args!("too many passwords: try again in {pause} s"),
            )),
        })
    }

    async fn set_password(&self, body: &[u8], may: bool) -> Result<Reply<'a, M>, Refusal> {
        let body::Password { password } = body::Password::read(body)?;
        let is_set = |papers: &mut Papers| papers.auth.secret().is_some();
        let not_yours = || Refusal::new(401, format_args!("a password is set: log in first"));
        if !may && self.hmi.desk.with(is_set) {
            return Err(not_yours());
        }
        if !PASSWORD_BYTES.contains(&password.len()) {
            let (low, high) = (PASSWORD_BYTES.start(), PASSWORD_BYTES.end());
            let mut refusal = Refusal::new(
                422,
                format_args!("a password has {low} to {high} characters"),
            );
            refusal.add(Detail {
                limits: Some((*low as f64, *high as f64)),
                ..Detail::new("password", "", "its length is outside its limits")
            });
            return Err(refusal);
        }
        self.try_password()?;
        let secret = Secret::new(&password, Instant::now().as_ticks()).await;
        self.hmi.desk.with(|papers| {
            // Somebody else may have been first.
            if !may && is_set(papers) {
                return Err(not_yours());
            }
            papers.auth.set(secret);
            Ok(())
        })?;
        Ok(self.session())
    }

    async fn log_in(&self, body: &[u8]) -> Result<Reply<'a, M>, Refusal> {
        let body::Password { password } = body::Password::read(body)?;
        let secret = self.hmi.desk.with(|papers| papers.auth.secret());
        let secret = secret
            .ok_or_else(|| Refusal::new(409, format_args!("no password is set: set one first")))?;
        self.try_password()?;
        if !secret.is(&password).await {
            return Err(Refusal::new(401, format_args!("this is not the password")));
        }
        Ok(self.session())
    }

    fn session(&self) -> Reply<'a, M> {
        let now = Instant::now();
        let token = self.hmi.desk.with(|papers| papers.auth.begin(now));
        Answer::Done(token.map(|token| cookie(&token, "")))
    }
}

/// The session's cookie: no script of a page reads it, and no other page's request carries it.
fn cookie(token: &str, more: &str) -> Cookie {
    let mut cookie = Cookie::new();
    // Fits: a token has 64 characters.
    let _ = write!(
        cookie,
        "session={token}; Path=/; HttpOnly; SameSite=Strict{more}"
    );
    cookie
}

enum Found {
    File(&'static assets::Asset),
    Route(&'static Route),
}

impl<M: RawMutex> PathRouterService for Routes<'_, M> {
    async fn call_path_router_service<R: Read, W: ResponseWriter<Error = R::Error>>(
        &self,
        state: &(),
        (): (),
        _path: Path<'_>,
        mut request: Request<'_, R>,
        writer: W,
    ) -> Result<ResponseSent, W::Error> {
        (self.answered)();
        let parts = request.parts;
        let length = request.body_connection.content_length();
        let answer = match self.find(&parts, length) {
            Err(refusal) => Answer::Refused(refusal),
            Ok(Found::File(asset)) => match guard::header(&parts.headers(), "if-none-match") {
                Some(tags) if tags.contains(asset.etag) => Answer::Unchanged(asset),
                _ => Answer::File(asset),
            },
            Ok(Found::Route(Route {
                action: Action::Stream,
                ..
            })) => {
                let body = request.body_connection.body();
                match WebSocketUpgrade::from_request(state, parts, body).await {
                    Ok(upgrade) => {
                        let live = Live {
                            hmi: self.hmi,
                            answered: self.answered,
                        };
                        let connection = request.body_connection.finalize().await?;
                        return upgrade.on_upgrade(live).write_to(connection, writer).await;
                    }
                    Err(reason) => Answer::Refused(Refusal::new(426, format_args!("{reason}"))),
                }
            }
            Ok(Found::Route(route)) => match request.body_connection.body().read_all().await {
                Ok(body) => match self.answer(route, &parts, body).await {
                    Ok(answer) => answer,
                    Err(refusal) => Answer::Refused(refusal),
                },
                Err(_) => Answer::Refused(Refusal::new(
                    400,
                    format_args!("the body of the request is not whole"),
                )),
            },
        };
        answer.send(request.body_connection, writer).await
    }
}
