//! A source on a web server, read by range requests (RFC 9110, §14).

mod reply;
mod retry;

use super::url::shown;
use super::{ByteSource, check_range, fill_from};
use crate::error::{Code, Error, Result};
use crate::limits::HEAD_BYTES;
use reply::{Identity, content_range, status_failure, transport_failure, unsatisfied_len};
use retry::{Attempts, Failure, stopped};
use std::io::Read;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;
use ureq::http::{Response, StatusCode, header};
use ureq::{Agent, Body};

/// Bytes read from a connection before it is looked whether the source was stopped.
const PIECE: usize = 256 << 10;

/// How to ask a web server.
#[derive(Clone, Debug)]
pub struct HttpOptions {
    /// Requests under way at the same time, at most; 6 as in browsers.
    pub connections: usize,
    /// Further attempts after one that failed in a way that may pass: no connection, no answer in time, an answer cut
    /// short, status 408, 425, 429 and 5xx.
    pub retries: u32,
    /// Wait before the second attempt; twice as long before each further one. A server's `Retry-After` comes first.
    pub backoff: Duration,
    /// Longest wait before an attempt, whatever the server asks for.
    pub backoff_max: Duration,
    /// Longest wait for a connection, for the answer's headers, and for each further piece of it.
    pub timeout: Duration,
    /// A server that knows no ranges sends files whole: up to this length they are kept in memory, in bytes.
    pub whole: u64,
    /// Headers sent along with every request, such as `Authorization`; not to where the server redirects to, if that is
    /// another host.
    pub headers: Vec<(String, String)>,
}

impl Default for HttpOptions {
    fn default() -> Self {
        HttpOptions {
            connections: 6,
            retries: 5,
            backoff: Duration::from_millis(200),
            backoff_max: Duration::from_secs(10),
            timeout: Duration::from_secs(30),
            whole: 4 << 20,
            headers: Vec::new(),
        }
    }
}

/// A file on a web server.
///
/// Opening asks for the first 16 KiB, which say how long the file is, and keeps them; every other read is one request for
/// exactly its bytes, over connections that are kept open. Each answer is held against the question: status, range, total
/// length, entity tag or date. Another version of the file is `E_REPLACED`, as far as the server tells versions apart; where it
/// gives neither tag nor date, and the lengths are the same, the checksums of the file find out (spec: VAL-6).
///
/// Proxies are taken from `ALL_PROXY`, `HTTPS_PROXY`, `HTTP_PROXY` and `NO_PROXY`. A user and password in the address are
/// sent as basic authentication and never shown.
pub struct HttpSource {
    agent: Agent,
    url: String,
    /// The address without what could be a secret.
    shown: String,
    options: HttpOptions,
    identity: Identity,
    /// The first bytes, or all of them.
    head: Vec<u8>,
    stop: Arc<AtomicBool>,
    requests: AtomicU64,
}

/// Stops an [`HttpSource`] from another thread: reads under way and all later ones end with an error.
#[derive(Clone)]
pub struct Stopper {
    stop: Arc<AtomicBool>,
    agent: Agent,
}

impl Stopper {
    /// Stops the source. Connections are closed, whatever is under way.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
        self.agent.clone().shutdown();
    }
}

impl HttpSource {
    /// Opens the file at `url` with one request.
    ///
    /// # Errors
    /// `E_SOURCE` where the server cannot be reached, refuses, or neither serves ranges nor has a file short enough to be
    /// kept whole.
    pub fn open(url: &str, options: HttpOptions) -> Result<Self> {
        let timeout = Some(options.timeout);
        let agent = Agent::config_builder()
            .http_status_as_error(false)
            .https_only(url.get(..6).is_some_and(|s| s.eq_ignore_ascii_case("https:")))
            .user_agent(concat!("vug/", env!("CARGO_PKG_VERSION")))
            .accept_encoding("identity")
            .max_idle_connections(options.connections)
            .max_idle_connections_per_host(options.connections)
            .timeout_resolve(timeout)
            .timeout_connect(timeout)
            .timeout_recv_response(timeout)
            .timeout_per_read(timeout)
            .build()
            .new_agent();
        let mut source = HttpSource {
            agent,
            url: url.to_owned(),
            shown: shown(url),
            options,
            identity: Identity { len: 0, etag: None, modified: None },
            head: Vec::new(),
            stop: Arc::new(AtomicBool::new(false)),
            requests: AtomicU64::new(0),
        };
        let stop = source.stop.clone();
        let options = source.options.clone();
        let mut attempts = Attempts::new(&options, &stop, 0);
        loop {
            match source.ask_first() {
                Ok(()) => return Ok(source),
                Err(failure) => attempts.after(failure, 0)?,
            }
        }
    }

    /// A handle that stops this source from another thread.
    #[must_use]
    pub fn stopper(&self) -> Stopper {
        Stopper { stop: self.stop.clone(), agent: self.agent.clone() }
    }

    /// Requests sent so far, the opening one and repeated ones included.
    #[must_use]
    pub fn requests(&self) -> u64 {
        self.requests.load(Ordering::Relaxed)
    }

    /// One request for bytes `first..end`; the answer is one of 200, 206 and 416.
    fn ask(&self, first: u64, end: u64) -> Result<Response<Body>, Failure> {
        if self.stop.load(Ordering::Relaxed) {
            return Err(Failure::Final(stopped()));
        }
        self.requests.fetch_add(1, Ordering::Relaxed);
        let mut request = self.agent.get(&self.url).header(header::RANGE, format!("bytes={first}-{}", end - 1));
        for (name, value) in &self.options.headers {
            request = request.header(name, value);
        }
        let response = request.call().map_err(|e| transport_failure(e, &self.shown))?;
        match response.status() {
            StatusCode::OK | StatusCode::PARTIAL_CONTENT => {
                let encoding = response.headers().get(header::CONTENT_ENCODING);
                match encoding.filter(|e| !e.as_bytes().eq_ignore_ascii_case(b"identity")) {
                    None => Ok(response),
                    Some(_) => Err(self.refuse("the server compresses what must be sent as it is; switch that off")),
                }
            }
            StatusCode::RANGE_NOT_SATISFIABLE => Ok(response),
            _ => Err(status_failure(&response, &self.shown)),
        }
    }

    /// The first request: length, identity and the head.
    fn ask_first(&mut self) -> Result<(), Failure> {
        let response = self.ask(0, HEAD_BYTES)?;
        let (parts, mut body) = response.into_parts();
        self.head.clear();
        let (end, len) = match (parts.status, content_range(&parts.headers)) {
            (StatusCode::PARTIAL_CONTENT, Some((0, end, len))) if end <= HEAD_BYTES => (end, len),
            (StatusCode::PARTIAL_CONTENT, _) => return Err(self.wrong_range(0)),
            (StatusCode::RANGE_NOT_SATISFIABLE, _) => match unsatisfied_len(&parts.headers) {
                Some(0) => (0, 0), // an empty file has no first byte
                _ => return Err(self.wrong_range(0)),
            },
            _ => return self.keep_whole(&parts.headers, body),
        };
        self.identity = Identity::new(len, &parts.headers);
        let mut head = vec![0; usize::try_from(end).unwrap_or_default()];
        let (done, result) = self.receive(0, &mut body, &mut head);
        match result {
            Ok(()) => {}
            // What came in is a start; the rest is asked for as in any other read.
            Err(Failure::Passing(..)) if done > 0 => {}
            Err(failure) => return Err(failure),
        }
        head.truncate(done);
        // A server may send less than it was asked for.
        let wanted = usize::try_from(len.min(HEAD_BYTES)).unwrap_or(head.len());
        head.resize(wanted.max(done), 0);
        if done < wanted {
            self.fetch(done as u64, &mut head[done..]).map_err(Failure::Final)?;
        }
        self.head = head;
        Ok(())
    }

    /// A server without ranges has begun to send the whole file.
    fn keep_whole(&mut self, headers: &ureq::http::HeaderMap, body: Body) -> Result<(), Failure> {
        let said = body.content_length();
        let most = self.options.whole;
        let too_long = |this: &Self| {
            this.refuse(&format!(
                "the server does not serve ranges of bytes, and the file is longer than {most} bytes; \
                 fetch it as a whole, or use another server"
            ))
        };
        if said.is_some_and(|len| len > most) {
            return Err(too_long(self));
        }
        let mut all = Vec::new();
        let mut body = body.into_reader().take(most.saturating_add(1));
        let mut piece = vec![0; 64 << 10];
        loop {
            if self.stop.load(Ordering::Relaxed) {
                return Err(Failure::Final(stopped()));
            }
            match body.read(&mut piece) {
                Ok(0) => break,
                Ok(n) => all.extend_from_slice(&piece[..n]),
                Err(e) => return Err(self.cut(0, &e)),
            }
        }
        if all.len() as u64 > most {
            return Err(too_long(self));
        }
        self.identity = Identity::new(all.len() as u64, headers);
        self.head = all;
        Ok(())
    }

    /// Bytes `offset..offset + out.len()` from the server, in as many attempts as it takes.
    fn fetch(&self, offset: u64, out: &mut [u8]) -> Result<()> {
        let mut attempts = Attempts::new(&self.options, &self.stop, offset);
        let mut done = 0;
        while done < out.len() {
            let (progress, result) = self.fetch_once(offset + done as u64, &mut out[done..]);
            done += progress;
            match result {
                Err(failure) => attempts.after(failure, progress)?,
                Ok(()) if done == out.len() => {}
                // Less than was asked for is allowed, if it leads to the end.
                Ok(()) => {
                    let short = self.error(offset, "the server sends less than it was asked for");
                    attempts.after(Failure::Passing(short, Some(Duration::ZERO)), progress)?;
                }
            }
        }
        Ok(())
    }

    /// One request for the bytes from `offset` on; says how many came.
    fn fetch_once(&self, offset: u64, out: &mut [u8]) -> (usize, Result<(), Failure>) {
        let end = offset + out.len() as u64;
        let response = match self.ask(offset, end) {
            Ok(response) => response,
            Err(failure) => return (0, Err(failure)),
        };
        let (parts, mut body) = response.into_parts();
        let found = match (parts.status, content_range(&parts.headers)) {
            (StatusCode::PARTIAL_CONTENT, Some(range)) => range,
            (StatusCode::PARTIAL_CONTENT, None) => return (0, Err(self.wrong_range(offset))),
            (StatusCode::RANGE_NOT_SATISFIABLE, _) => {
                let len = unsatisfied_len(&parts.headers).unwrap_or(self.identity.len);
                let failure = self.is_same(len, &parts.headers).err();
                return (0, Err(failure.unwrap_or_else(|| self.wrong_range(offset))));
            }
            _ => {
                let len = body.content_length().unwrap_or(self.identity.len);
                let failure = self.is_same(len, &parts.headers).err();
                let why = "the server sends the whole file where it was asked for a part";
                return (0, Err(failure.unwrap_or_else(|| Failure::Passing(self.error(offset, why), None))));
            }
        };
        let (first, last, len) = found;
        if let Err(failure) = self.is_same(len, &parts.headers) {
            return (0, Err(failure));
        }
        if first != offset || last > end {
            return (0, Err(self.wrong_range(offset)));
        }
        let len = usize::try_from(last - first).map_or(out.len(), |len| len.min(out.len()));
        self.receive(offset, &mut body, &mut out[..len])
    }

    /// Reads a body of `out.len()` bytes; says how many came.
    fn receive(&self, offset: u64, body: &mut Body, out: &mut [u8]) -> (usize, Result<(), Failure>) {
        let mut body = body.as_reader();
        let mut done = 0;
        while done < out.len() {
            if self.stop.load(Ordering::Relaxed) {
                return (done, Err(Failure::Final(stopped())));
            }
            let end = out.len().min(done + PIECE);
            match body.read(&mut out[done..end]) {
                Ok(0) => return (done, Err(self.cut(offset, &std::io::ErrorKind::UnexpectedEof.into()))),
                Ok(n) => done += n,
                Err(e) => return (done, Err(self.cut(offset, &e))),
            }
        }
        // The end of the body must be seen before the connection can serve the next request.
        match body.read(&mut [0]) {
            Ok(0) => (done, Ok(())),
            Ok(_) => (0, Err(Failure::Passing(self.error(offset, "the server sends more than it says"), None))),
            // All that was asked for is there: how the connection ended does not matter.
            Err(_) => (done, Ok(())),
        }
    }

    fn is_same(&self, len: u64, headers: &ureq::http::HeaderMap) -> Result<(), Failure> {
        match self.identity.difference(&Identity::new(len, headers)) {
            None => Ok(()),
            Some(how) => Err(Failure::Final(Error::new(
                Code::Replaced,
                "url",
                format!("{} was replaced while it was open: {how}; open it again", self.shown),
            ))),
        }
    }

    fn error(&self, offset: u64, why: &str) -> Error {
        Error::at(Code::Source, offset, "url", format!("{}: {why}", self.shown))
    }

    fn cut(&self, offset: u64, e: &std::io::Error) -> Failure {
        if self.stop.load(Ordering::Relaxed) {
            return Failure::Final(stopped());
        }
        Failure::Passing(self.error(offset, &format!("the answer was cut short ({e})")), None)
    }

    fn wrong_range(&self, offset: u64) -> Failure {
        let why =
            "the server answers with another range of bytes than it was asked for; it cannot be trusted with ranges";
        Failure::Final(self.error(offset, why))
    }

    fn refuse(&self, why: &str) -> Failure {
        Failure::Final(Error::new(Code::Source, "url", format!("{}: {why}", self.shown)))
    }
}

impl ByteSource for HttpSource {
    fn len(&self) -> u64 {
        self.identity.len
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> Result<()> {
        check_range(offset, out.len(), self.identity.len)?;
        if fill_from(&self.head, offset, out) { Ok(()) } else { self.fetch(offset, out) }
    }

    fn read_fresh(&self, offset: u64, out: &mut [u8]) -> Result<()> {
        check_range(offset, out.len(), self.identity.len)?;
        // What came in one answer is of one version of the file, whatever the server has by now.
        if self.head.len() as u64 == self.identity.len {
            return self.read_at(offset, out);
        }
        self.fetch(offset, out)
    }

    fn connections(&self) -> usize {
        self.options.connections.max(1)
    }
}

impl Drop for HttpSource {
    fn drop(&mut self) {
        self.stopper().stop();
    }
}
