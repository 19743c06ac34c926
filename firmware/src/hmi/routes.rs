//! What can be asked: one table, and one way in.
//!
//! Not here: what comes of it. Whether a request is read, needs a session or changes anything stands in [`ROUTES`],
//! and the way in keeps to it: nothing can be added that forgets a check.

use embassy_sync::blocking_mutex::raw::RawMutex;
use picoserve::ResponseSent;
use picoserve::extract::FromRequest as _;
use picoserve::io::Read;
use picoserve::request::{Path, Request, RequestParts};
use picoserve::response::{IntoResponse, ResponseWriter, WebSocketUpgrade};
use picoserve::routing::PathRouterService;

use super::answer::{Answer, Refusal};
use super::documents::{Page, What};
use super::live::Live;
use super::{BODY_BYTES, Hmi, assets, guard};

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
    Show(What),
    Stream,
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

const fn get(path: &'static str, action: Action, about: &'static str) -> Route {
    Route {
        method: Method::Get,
        path,
        login: false,
        about,
        action,
    }
}

/// Everything that can be asked, but for the files of the page.
pub static ROUTES: &[Route] = &[
    get(
        "/api/v1/info",
        Action::Show(What::Info),
        "what this is, and who controls the winder",
    ),
    get(
        "/api/v1/signals",
        Action::Show(What::Signals),
        "the signals of the process image",
    ),
    get(
        "/api/v1/image",
        Action::Show(What::Image),
        "the process image of one drive cycle, word by word",
    ),
    get(
        "/api/v1/live",
        Action::Stream,
        "a WebSocket: signals as a stream",
    ),
];

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
        if length > BODY_BYTES {
            return Err(Refusal::new(
                413,
                format_args!("{length} bytes are more than {BODY_BYTES}"),
            ));
        }
        Ok(Found::Route(route))
    }

    async fn answer(
        &self,
        route: &Route,
        _parts: &RequestParts<'_>,
        _body: &mut [u8],
    ) -> Result<Reply<'a, M>, Refusal> {
        match route.action {
            Action::Show(what) => Ok(Answer::Document(Page {
                hmi: self.hmi,
                what,
            })),
            Action::Stream => Err(Refusal::new(426, format_args!("this is a WebSocket"))),
        }
    }
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
