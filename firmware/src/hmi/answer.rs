//! Answers: files, documents written piece by piece, and refusals.
//!
//! Not here: what the documents say.

use core::fmt::{self, Write as _};

use heapless::{String, Vec};
use picoserve::ResponseSent;
use picoserve::io::{Read, Write};
use picoserve::request::RequestBodyConnection;
use picoserve::response::chunked::{ChunkWriter, ChunkedResponse, Chunks, ChunksWritten};
use picoserve::response::{Content, IntoResponse, NoContent, Response, ResponseWriter, StatusCode};

use super::assets::Asset;

/// Of every answer. Nothing but what this device itself serves is shown or run, and nobody frames it.
const HEADERS: [(&str, &str); 4] = [
    (
        "Content-Security-Policy",
        "default-src 'self'; img-src 'self' data: blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    ),
    ("X-Content-Type-Options", "nosniff"),
    ("Referrer-Policy", "no-referrer"),
    ("Cross-Origin-Resource-Policy", "same-origin"),
];
/// What the simulator says holds for this moment.
const NOT_STORED: (&str, &str) = ("Cache-Control", "no-store");
/// A file is asked for again each time, by its tag.
const REVALIDATED: (&str, &str) = ("Cache-Control", "no-cache");

/// Text of any content, as JSON has it.
pub struct Text<'a>(pub &'a str);

impl fmt::Display for Text<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_char('"')?;
        for c in self.0.chars() {
            match c {
                '"' | '\\' => write!(f, "\\{c}")?,
                c if c.is_control() => write!(f, "\\u{:04x}", u32::from(c))?,
                c => f.write_char(c)?,
            }
        }
        f.write_char('"')
    }
}

/// A value, or null.
pub struct OrNull<T>(pub Option<T>);

impl<T: fmt::Display> fmt::Display for OrNull<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.0 {
            Some(value) => value.fmt(f),
            None => f.write_str("null"),
        }
    }
}

/// Items with commas between them.
pub struct List<I>(pub I);

impl<I> fmt::Display for List<I>
where
    I: Iterator<Item: fmt::Display> + Clone,
{
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_char('[')?;
        for (i, item) in self.0.clone().enumerate() {
            if i > 0 {
                f.write_char(',')?;
            }
            item.fmt(f)?;
        }
        f.write_char(']')
    }
}

/// What is wrong with one value.
#[derive(Clone, Debug, PartialEq)]
pub struct Detail {
    /// The parameter's or the signal's name.
    pub parameter: String<48>,
    /// What was given, as JSON; nothing where it was no value at all.
    pub value: String<32>,
    /// Smallest and largest permitted value, where there are such.
    pub limits: Option<(f64, f64)>,
    /// Unit of the value and its limits.
    pub unit: &'static str,
    /// In a few words.
    pub reason: &'static str,
}

impl Detail {
    /// A value that cannot be.
    pub fn new(parameter: &str, value: impl fmt::Display, reason: &'static str) -> Self {
        let mut detail = Self {
            parameter: cut(parameter),
            value: String::new(),
            limits: None,
            unit: "",
            reason,
        };
        if write!(detail.value, "{value}").is_err() {
            detail.value.clear();
        }
        detail
    }
}

impl Detail {
    /// A number that cannot be; one that JSON does not have is left out.
    pub fn number(parameter: &str, value: f64, reason: &'static str) -> Self {
        match value.is_finite() {
            true => Self::new(parameter, value, reason),
            false => Self::new(parameter, "", reason),
        }
    }
}

/// As much of a text as there is room for.
pub fn cut<const N: usize>(text: &str) -> String<N> {
    let mut out = String::new();
    // What no longer fits is left out.
    let _ = text.chars().try_for_each(|c| out.push(c));
    out
}

impl fmt::Display for Detail {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let value = match self.value.as_str() {
            "" => "null",
            value => value,
        };
        write!(
            f,
            "{{\"parameter\":{},\"value\":{value}",
            Text(&self.parameter)
        )?;
        if let Some((low, high)) = self.limits {
            write!(
                f,
                ",\"low\":{low},\"high\":{high},\"limit\":\"{low} to {high}\""
            )?;
        }
        write!(
            f,
            ",\"unit\":{},\"reason\":{}}}",
            Text(self.unit),
            Text(self.reason)
        )
    }
}

/// Most details that a refusal tells; one for each field of a form that is wrong at once.
const DETAILS: usize = 8;

/// Why a request was not done. Nothing has changed by it.
#[derive(Clone, Debug, PartialEq)]
pub struct Refusal {
    /// As HTTP has it.
    pub status: u16,
    /// A sentence.
    pub error: String<160>,
    /// The values that are wrong.
    pub details: Vec<Detail, DETAILS>,
}

impl Refusal {
    /// Without details.
    pub fn new(status: u16, error: fmt::Arguments) -> Self {
        let mut text = String::new();
        // A sentence that is too long ends early.
        let _ = text.write_fmt(error);
        Self {
            status,
            error: text,
            details: Vec::new(),
        }
    }

    /// One more detail, while there is room.
    pub fn add(&mut self, detail: Detail) {
        let _ = self.details.push(detail);
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{{\"error\":{},\"details\":{}}}",
            Text(&self.error),
            List(self.details.iter())
        )
    }
}

/// Bytes of a document that travel together.
const PIECE: usize = 1024;

/// A document on its way out.
pub struct Out<W: Write> {
    chunks: ChunkWriter<W>,
    piece: String<PIECE>,
}

impl<W: Write> Out<W> {
    /// Adds to the document; what is added at once is not longer than a piece.
    pub async fn put(&mut self, text: fmt::Arguments<'_>) -> Result<(), W::Error> {
        let filled = self.piece.len();
        if self.piece.write_fmt(text).is_ok() {
            return Ok(());
        }
        self.piece.truncate(filled);
        self.send().await?;
        if self.piece.write_fmt(text).is_ok() {
            return Ok(());
        }
        self.piece.clear();
        self.chunks.write_fmt(text).await
    }

    async fn send(&mut self) -> Result<(), W::Error> {
        self.chunks.write_chunk(self.piece.as_bytes()).await?;
        self.piece.clear();
        Ok(())
    }
}

/// What can be written piece by piece.
pub trait Document {
    /// Its media type.
    fn content_type(&self) -> &'static str {
        "application/json"
    }
    /// Writes it.
    async fn write<W: Write>(&self, out: &mut Out<W>) -> Result<(), W::Error>;
}

struct Pieces<D>(D);

impl<D: Document> Chunks for Pieces<D> {
    fn content_type(&self) -> &'static str {
        self.0.content_type()
    }

    async fn write_chunks<W: Write>(
        self,
        chunks: ChunkWriter<W>,
    ) -> Result<ChunksWritten, W::Error> {
        let mut out = Out {
            chunks,
            piece: String::new(),
        };
        self.0.write(&mut out).await?;
        out.send().await?;
        out.chunks.finalize().await
    }
}

/// Something short, as JSON.
struct Json<T>(T);

impl<T: fmt::Display> Content for Json<T> {
    fn content_type(&self) -> &'static str {
        "application/json"
    }
    fn content_length(&self) -> usize {
        struct Length(usize);
        impl fmt::Write for Length {
            fn write_str(&mut self, s: &str) -> fmt::Result {
                self.0 += s.len();
                Ok(())
            }
        }
        let mut length = Length(0);
        // It has no reason to fail.
        let _ = write!(length, "{}", self.0);
        length.0
    }
    async fn write_content<W: Write>(self, mut writer: W) -> Result<(), W::Error> {
        write!(writer, "{}", self.0).await
    }
}

/// A file.
struct Stored(&'static Asset);

impl Content for Stored {
    fn content_type(&self) -> &'static str {
        self.0.content_type
    }
    fn content_length(&self) -> usize {
        self.0.gzip.len()
    }
    async fn write_content<W: Write>(self, mut writer: W) -> Result<(), W::Error> {
        writer.write_all(self.0.gzip).await
    }
}

/// An answer.
pub enum Answer<D> {
    /// A file of the page.
    File(&'static Asset),
    /// The client has the file already.
    Unchanged(&'static Asset),
    /// A document.
    Document(D),
    /// Done; a session begins or ends with it, if there is a cookie.
    Done(Option<Cookie>),
    /// Not done.
    Refused(Refusal),
}

/// The value of a `Set-Cookie` header.
pub type Cookie = String<128>;

impl<D: Document> Answer<D> {
    /// Sends it.
    pub async fn send<R: Read, W: ResponseWriter<Error = R::Error>>(
        self,
        body: RequestBodyConnection<'_, R>,
        writer: W,
    ) -> Result<ResponseSent, W::Error> {
        let connection = body.finalize().await?;
        match self {
            Self::File(asset) => {
                let headers = [
                    ("Content-Encoding", "gzip"),
                    ("ETag", asset.etag),
                    REVALIDATED,
                ];
                (HEADERS, headers, Stored(asset))
                    .write_to(connection, writer)
                    .await
            }
            Self::Unchanged(asset) => {
                let status = StatusCode::new(304);
                (
                    status,
                    HEADERS,
                    [("ETag", asset.etag), REVALIDATED],
                    NoContent,
                )
                    .write_to(connection, writer)
                    .await
            }
            Self::Document(document) => {
                let response = ChunkedResponse::new(Pieces(document)).into_response();
                let response = response.with_headers(HEADERS).with_headers(NOT_STORED);
                response.write_to(connection, writer).await
            }
            Self::Done(cookie) => {
                let cookie = cookie.map(|cookie| ("Set-Cookie", cookie));
                (HEADERS, NOT_STORED, cookie, Json("{}"))
                    .write_to(connection, writer)
                    .await
            }
            Self::Refused(refusal) => {
                let status = StatusCode::new(refusal.status);
                Response::new(status, Json(refusal))
                    .with_headers(HEADERS)
                    .with_headers(NOT_STORED)
                    .write_to(connection, writer)
                    .await
            }
        }
    }
}
