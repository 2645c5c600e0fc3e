//! A web server on this machine that counts what it is asked for, and misbehaves as told.
#![allow(dead_code, reason = "every test binary uses its own part")]

use std::collections::VecDeque;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// What is served.
pub trait Content: Send + Sync {
    fn len(&self) -> u64;
    /// Writes bytes `offset..offset + len`.
    fn send(&self, offset: u64, len: u64, out: &mut TcpStream) -> io::Result<()>;
}

impl Content for Vec<u8> {
    fn len(&self) -> u64 {
        self.as_slice().len() as u64
    }
    fn send(&self, offset: u64, len: u64, out: &mut TcpStream) -> io::Result<()> {
        out.write_all(&self[offset as usize..(offset + len) as usize])
    }
}

/// A file that the operating system sends by itself where it can.
pub struct OnDisk(pub PathBuf);

impl Content for OnDisk {
    fn len(&self) -> u64 {
        std::fs::metadata(&self.0).unwrap().len()
    }
    fn send(&self, offset: u64, len: u64, out: &mut TcpStream) -> io::Result<()> {
        let mut file = File::open(&self.0)?;
        file.seek(SeekFrom::Start(offset))?;
        io::copy(&mut file.take(len), out).map(|_| ())
    }
}

/// How the server answers. The queues are used up one request after another.
#[derive(Clone)]
pub struct Mode {
    pub content: Arc<dyn Content>,
    pub etag: Option<String>,
    pub modified: Option<String>,
    /// Whether ranges are heeded at all.
    pub ranges: bool,
    /// Status codes to answer with instead, each with the value of `Retry-After`.
    pub fail: VecDeque<(u16, Option<String>)>,
    /// The body ends, and the connection with it, after so many bytes.
    pub cut: VecDeque<usize>,
    /// Connections that are closed without an answer.
    pub drop: u32,
    /// Ranges are answered with so many bytes at most, and say so.
    pub most: Option<u64>,
    /// The bytes sent, and the range named, begin so much later.
    pub shift: u64,
    /// The total length that `Content-Range` names.
    pub total: Option<String>,
    /// Bodies come in chunks, without their length.
    pub chunked: bool,
    /// Goes to this address.
    pub redirect: Option<String>,
    pub encoding: Option<String>,
    /// Wait before each answer, and before each KiB of it while `slow`.
    pub delay: Duration,
    pub slow: bool,
    /// What happens once so many requests have been answered.
    pub then: Option<(u64, Box<Mode>)>,
}

impl Mode {
    pub fn new(content: impl Content + 'static) -> Self {
        Mode {
            content: Arc::new(content),
            etag: Some("\"one\"".into()),
            modified: Some("Sun, 01 Mar 2026 10:00:00 GMT".into()),
            ranges: true,
            fail: VecDeque::new(),
            cut: VecDeque::new(),
            drop: 0,
            most: None,
            shift: 0,
            total: None,
            chunked: false,
            redirect: None,
            encoding: None,
            delay: Duration::ZERO,
            slow: false,
            then: None,
        }
    }
}

/// A request that was answered.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Seen {
    pub path: String,
    pub range: Option<(u64, u64)>,
    pub status: u16,
    /// Bytes of the body, as far as they were sent.
    pub bytes: u64,
    /// All header lines of the request, names in lower case.
    pub headers: Vec<(String, String)>,
}

struct State {
    mode: Mutex<Mode>,
    seen: Mutex<Vec<Seen>>,
    connections: AtomicUsize,
    stop: AtomicBool,
}

pub struct Server {
    address: SocketAddr,
    state: Arc<State>,
}

impl Server {
    pub fn start(mode: Mode) -> Server {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let state = Arc::new(State {
            mode: Mutex::new(mode),
            seen: Mutex::default(),
            connections: AtomicUsize::new(0),
            stop: AtomicBool::new(false),
        });
        let shared = state.clone();
        std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                if shared.stop.load(Ordering::SeqCst) {
                    return;
                }
                shared.connections.fetch_add(1, Ordering::SeqCst);
                let shared = shared.clone();
                std::thread::spawn(move || {
                    let _ = serve(&shared, stream);
                });
            }
        });
        Server { address, state }
    }

    pub fn of(content: impl Content + 'static) -> Server {
        Server::start(Mode::new(content))
    }

    pub fn url(&self, name: &str) -> String {
        format!("http://{}/{name}", self.address)
    }

    pub fn address(&self) -> SocketAddr {
        self.address
    }

    pub fn change(&self, f: impl FnOnce(&mut Mode)) {
        f(&mut self.state.mode.lock().unwrap());
    }

    /// All requests since the last call.
    pub fn take(&self) -> Vec<Seen> {
        std::mem::take(&mut self.state.seen.lock().unwrap())
    }

    /// Requests and bytes of bodies since the last call.
    pub fn cost(&self) -> (u64, u64) {
        let seen = self.take();
        (seen.len() as u64, seen.iter().map(|s| s.bytes).sum())
    }

    /// Connections made so far.
    pub fn connections(&self) -> usize {
        self.state.connections.load(Ordering::SeqCst)
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.state.stop.store(true, Ordering::SeqCst);
        let _ = TcpStream::connect(self.address); // wakes the listener
    }
}

/// Answers requests of one connection until it ends.
fn serve(state: &State, stream: TcpStream) -> io::Result<()> {
    stream.set_nodelay(true)?;
    let mut input = BufReader::new(stream.try_clone()?);
    let mut output = stream;
    while let Some((path, headers)) = read_request(&mut input)? {
        if !answer(state, path, headers, &mut output)? {
            return Ok(());
        }
    }
    Ok(())
}

type Headers = Vec<(String, String)>;

fn read_request(input: &mut impl BufRead) -> io::Result<Option<(String, Headers)>> {
    let mut line = String::new();
    if input.read_line(&mut line)? == 0 {
        return Ok(None);
    }
    let path = line.split_whitespace().nth(1).unwrap_or_default().to_owned();
    let mut headers = Vec::new();
    loop {
        line.clear();
        input.read_line(&mut line)?;
        let Some((name, value)) = line.trim_end().split_once(':') else { return Ok(Some((path, headers))) };
        headers.push((name.to_lowercase(), value.trim().to_owned()));
    }
}

/// One answer; whether the connection goes on.
fn answer(state: &State, path: String, headers: Headers, out: &mut TcpStream) -> io::Result<bool> {
    let (mode, dropped, fail, cut) = {
        let mut mode = state.mode.lock().unwrap();
        let dropped = mode.drop > 0;
        mode.drop -= u32::from(dropped);
        let fail = if dropped { None } else { mode.fail.pop_front() };
        let cut = if dropped || fail.is_some() { None } else { mode.cut.pop_front() };
        let current = mode.clone();
        if let Some((left, _)) = &mut mode.then {
            *left -= 1;
            if *left == 0 {
                *mode = *mode.then.take().unwrap().1;
            }
        }
        (current, dropped, fail, cut)
    };
    std::thread::sleep(mode.delay);
    let range = headers.iter().find(|(name, _)| name == "range").and_then(|(_, value)| parse_range(value));
    let log = |status, bytes| {
        let seen = Seen { path: path.clone(), range, status, bytes, headers: headers.clone() };
        state.seen.lock().unwrap().push(seen);
    };
    if dropped {
        log(0, 0);
        return Ok(false);
    }
    if let Some((status, retry)) = fail {
        log(status, 0);
        let retry = retry.map_or(String::new(), |r| format!("Retry-After: {r}\r\n"));
        write!(out, "HTTP/1.1 {status} No\r\n{retry}Content-Length: 0\r\n\r\n")?;
        return Ok(true);
    }
    if let Some(to) = &mode.redirect {
        log(302, 0);
        write!(out, "HTTP/1.1 302 Found\r\nLocation: {to}\r\nContent-Length: 0\r\n\r\n")?;
        return Ok(true);
    }
    let len = mode.content.len();
    let mut head = String::new();
    head.extend(mode.etag.iter().map(|tag| format!("ETag: {tag}\r\n")));
    head.extend(mode.modified.iter().map(|date| format!("Last-Modified: {date}\r\n")));
    head.extend(mode.encoding.iter().map(|name| format!("Content-Encoding: {name}\r\n")));
    let total = mode.total.clone().unwrap_or_else(|| len.to_string());
    let (status, first, count) = match range.filter(|_| mode.ranges) {
        Some((first, last)) if first < len && first <= last => {
            let end = len.min(last.saturating_add(1));
            let first = (first + mode.shift).min(end - 1);
            let count = mode.most.map_or(end - first, |most| most.min(end - first));
            head.push_str(&format!("Content-Range: bytes {first}-{}/{total}\r\n", first + count - 1));
            (206, first, count)
        }
        Some(_) => {
            log(416, 0);
            write!(out, "HTTP/1.1 416 No\r\nContent-Range: bytes */{total}\r\n{head}Content-Length: 0\r\n\r\n")?;
            return Ok(true);
        }
        None => (200, 0, len),
    };
    let sent = cut.map_or(count, |cut| count.min(cut as u64));
    // Before the bytes: who has them all must find them counted.
    log(status, sent);
    if mode.chunked {
        write!(out, "HTTP/1.1 {status} Yes\r\n{head}Transfer-Encoding: chunked\r\n\r\n{count:x}\r\n")?;
    } else {
        write!(out, "HTTP/1.1 {status} Yes\r\n{head}Content-Length: {count}\r\n\r\n")?;
    }
    if mode.slow {
        for at in (0..sent).step_by(1024) {
            std::thread::sleep(mode.delay);
            mode.content.send(first + at, (sent - at).min(1024), out)?;
        }
    } else {
        mode.content.send(first, sent, out)?;
    }
    if sent < count {
        return Ok(false);
    }
    if mode.chunked {
        write!(out, "\r\n0\r\n\r\n")?;
    }
    Ok(true)
}

/// `bytes=FIRST-LAST`.
fn parse_range(value: &str) -> Option<(u64, u64)> {
    let (first, last) = value.strip_prefix("bytes=")?.split_once('-')?;
    Some((first.parse().ok()?, last.parse().ok()?))
}
