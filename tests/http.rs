//! The source on a web server: exactly the bytes asked for, whatever the server does, or an error that says why.
#![cfg(feature = "http")]

#[path = "support/server.rs"]
mod server;
mod support;

use server::{Content, Mode, Server};
use std::io::Write;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use vug::source::{ByteSource, HttpOptions, HttpSource, is_url, open_url};
use vug::{Code, Error};

/// Bytes that tell where they are from.
fn bytes(len: usize) -> Vec<u8> {
    (0..len).map(|i| (i as u32).wrapping_mul(0x9E37_79B1).to_le_bytes()[3]).collect()
}

type Change<'a> = &'a dyn Fn(&mut Mode);

/// Quick to try again.
fn quick() -> HttpOptions {
    HttpOptions { backoff: Duration::from_millis(1), timeout: Duration::from_secs(5), ..HttpOptions::default() }
}

fn open(server: &Server) -> Result<HttpSource, Error> {
    HttpSource::open(&server.url("a.vug"), quick())
}

fn read(source: &dyn ByteSource, offset: u64, len: usize) -> Result<Vec<u8>, Error> {
    let mut out = vec![0xEE; len];
    source.read_at(offset, &mut out).map(|()| out)
}

#[test] // spec: VAL-7
fn opening_is_one_request_and_its_bytes_are_not_asked_for_again() {
    let data = bytes(100_000);
    let server = Server::of(data.clone());
    let source = open(&server).unwrap();
    assert_eq!(source.len(), 100_000);
    assert_eq!(read(&source, 0, 256).unwrap(), data[..256]);
    assert_eq!(read(&source, 16_000, 384).unwrap(), data[16_000..16_384]);
    assert_eq!((server.cost(), source.requests()), ((1, 16_384), 1));
    assert_eq!(read(&source, 16_000, 385).unwrap(), data[16_000..16_385]);
    assert_eq!(read(&source, 99_999, 1).unwrap(), data[99_999..]);
    assert_eq!(server.cost(), (2, 386), "exactly what was asked for");
    assert_eq!(server.connections(), 1, "the connection is kept open");
    assert_eq!(read(&source, 99_999, 2).unwrap_err().code(), Code::Truncated);
    assert_eq!(read(&source, u64::MAX, 2).unwrap_err().code(), Code::Truncated);
    assert!(read(&source, 100_000, 0).unwrap().is_empty());
    assert_eq!(server.cost(), (0, 0));
    let mut fresh = [0; 8];
    source.read_fresh(0, &mut fresh).unwrap();
    assert_eq!((fresh[..].to_vec(), server.cost()), (data[..8].to_vec(), (1, 8)), "that one goes to the server");
}

#[test]
fn small_and_empty_files() {
    for len in [0, 1, 16_383, 16_384, 16_385] {
        let data = bytes(len);
        let server = Server::of(data.clone());
        let source = open(&server).unwrap();
        assert_eq!((source.len(), read(&source, 0, len).unwrap()), (len as u64, data));
        assert_eq!(source.requests(), if len > 16_384 { 2 } else { 1 });
    }
}

#[test]
fn what_is_asked_for() {
    let server = Server::of(bytes(50_000));
    let url = server.url("folder/a.vug").replace("http://", "http://user:secret@") + "?key=hidden#part";
    let headers = vec![("X-Extra".into(), "yes".into())];
    let source = HttpSource::open(&url, HttpOptions { headers, ..quick() }).unwrap();
    read(&source, 20_000, 10).unwrap();
    let seen = server.take();
    for (request, range) in seen.iter().zip(["bytes=0-16383", "bytes=20000-20009"]) {
        let header = |name: &str| request.headers.iter().find(|(n, _)| n == name).map(|(_, v)| v.as_str());
        assert_eq!(header("range"), Some(range));
        assert_eq!(header("accept-encoding"), Some("identity"));
        assert_eq!(header("authorization"), Some("Basic dXNlcjpzZWNyZXQ="));
        assert_eq!(header("x-extra"), Some("yes"));
        assert!(header("user-agent").unwrap().starts_with("vug/"));
        assert_eq!(request.path, "/folder/a.vug?key=hidden");
    }
}

#[test]
fn many_ranges_come_side_by_side() {
    let data = bytes(1 << 20);
    let server = Server::of(data.clone());
    let source = open(&server).unwrap();
    server.take();
    server.change(|mode| mode.delay = Duration::from_millis(20));
    let mut buffers: Vec<(u64, Vec<u8>)> = (0..40).map(|i| (i * 26_000, vec![0; 1000 + i as usize])).collect();
    let mut parts: Vec<(u64, &mut [u8])> = buffers.iter_mut().map(|(at, b)| (*at, b.as_mut_slice())).collect();
    source.read_many(&mut parts).unwrap();
    for (at, found) in &buffers {
        assert_eq!(found[..], data[*at as usize..][..found.len()]);
    }
    assert_eq!(server.cost().0, 39, "the first lies in the head");
    let used = server.connections();
    assert!((2..=6).contains(&used), "{used} connections");
}

#[test]
fn what_passes_is_tried_again() {
    let data = bytes(300_000);
    let server = Server::of(data.clone());
    server.change(|mode| mode.fail = [(503, None), (429, Some("0".into())), (500, None)].into());
    let source = open(&server).unwrap();
    assert_eq!(server.take().iter().map(|s| s.status).collect::<Vec<_>>(), [503, 429, 500, 206]);
    server.change(|mode| (mode.fail, mode.drop) = ([(502, None), (408, None)].into(), 1));
    assert_eq!(read(&source, 20_000, 200_000).unwrap(), data[20_000..220_000]);
    assert_eq!(server.take().iter().map(|s| s.status).collect::<Vec<_>>(), [0, 502, 408, 206]);
    // Bodies that end early go on where they ended: 64 KiB and more are progress, so that six of them are no failure.
    server.change(|mode| mode.cut = [0, 70_000, 1, 100_000, 7].into());
    assert_eq!(read(&source, 20_000, 200_000).unwrap(), data[20_000..220_000]);
    let ranges: Vec<_> = server.take().iter().map(|s| s.range.unwrap()).collect();
    assert_eq!(
        ranges,
        [20_000, 20_000, 90_000, 90_001, 190_001, 190_008].map(|first| (first, 219_999)),
        "what is there already is not asked for again"
    );
    // The same while opening.
    server.change(|mode| (mode.drop, mode.cut) = (1, [0, 5000].into()));
    let source = open(&server).unwrap();
    assert_eq!(read(&source, 0, 16_384).unwrap(), data[..16_384]);
    assert_eq!(server.cost().0, 4);
}

#[test]
fn it_is_given_up_after_the_last_attempt() {
    let server = Server::of(bytes(100_000));
    let source = open(&server).unwrap();
    server.take();
    server.change(|mode| mode.fail = vec![(503, None); 100].into());
    let error = read(&source, 50_000, 10).unwrap_err();
    assert_eq!((error.code(), error.field()), (Code::Source, "url"));
    assert!(error.message().contains("503") && error.message().contains("6 attempts"), "{error}");
    assert_eq!(server.cost().0, 6);
    // A server that sends a byte at a time, however willingly, is given up as well.
    server.change(|mode| (mode.fail, mode.most) = ([].into(), Some(1)));
    let error = read(&source, 50_000, 10).unwrap_err();
    assert!(error.code() == Code::Source && error.message().contains("less than it was asked for"), "{error}");
    assert_eq!(server.cost().0, 6);
    server.change(|mode| mode.most = Some(4));
    assert_eq!(read(&source, 50_000, 10).unwrap(), bytes(100_000)[50_000..50_010]);
}

#[test]
fn the_server_says_how_long_to_wait_within_reason() {
    let server = Server::of(bytes(1000));
    let options = HttpOptions { backoff_max: Duration::from_millis(60), ..quick() };
    // A minute would hang the test; what the options say caps it.
    server.change(|mode| mode.fail = [(429, Some("60".into()))].into());
    let start = Instant::now();
    HttpSource::open(&server.url("a"), options).unwrap();
    assert!(start.elapsed() >= Duration::from_millis(60));
}

#[test]
fn what_does_not_pass_fails_at_once() {
    let server = Server::of(bytes(100_000));
    for (status, advice) in
        [(404, "address"), (410, "address"), (403, "credentials"), (401, "credentials"), (400, "ask")]
    {
        server.change(|mode| mode.fail = [(status, None)].into());
        let error = open(&server).err().unwrap();
        assert_eq!(error.code(), Code::Source);
        assert!(error.message().contains(&status.to_string()) && error.message().contains(advice), "{error}");
        assert_eq!(server.cost().0, 1);
    }
    let error = HttpSource::open("http://name.invalid/a.vug", quick()).err().unwrap();
    assert_eq!(error.code(), Code::Source, "{error}");
    for url in ["http://", "http:///a", "http://[::1/a", "nothing at all"] {
        assert_eq!(HttpSource::open(url, quick()).err().unwrap().code(), Code::Source, "{url}");
    }
}

#[test]
fn a_server_that_is_not_there_is_tried_again_too() {
    let url = {
        let server = Server::of(bytes(10));
        server.url("a.vug")
    };
    std::thread::sleep(Duration::from_millis(50));
    let error = HttpSource::open(&url, quick()).err().unwrap();
    assert!(error.code() == Code::Source && error.message().contains("6 attempts"), "{error}");
}

#[test]
fn nothing_secret_is_shown() {
    let server = Server::of(bytes(100_000));
    let url = server.url("a.vug").replace("http://", "http://user:secret@") + "?signature=hidden";
    let source = HttpSource::open(&url, quick()).unwrap();
    let mut errors = Vec::new();
    server.change(|mode| mode.fail = [(404, None), (404, None)].into());
    errors.push(read(&source, 50_000, 1).unwrap_err());
    errors.push(HttpSource::open(&url, quick()).err().unwrap());
    server.change(|mode| mode.etag = Some("\"two\"".into()));
    errors.push(read(&source, 50_000, 1).unwrap_err());
    server.change(|mode| mode.redirect = Some("http://user:secret@[?signature=hidden".into()));
    errors.push(read(&source, 50_000, 1).unwrap_err());
    server.change(|mode| mode.redirect = Some(url.clone()));
    errors.push(read(&source, 50_000, 1).unwrap_err());
    errors.push(HttpSource::open("http://user:secret@[?signature=hidden", quick()).err().unwrap());
    errors.push(open_url("ftp://user:secret@host/a?signature=hidden").err().unwrap());
    for error in errors {
        let text = format!("{error} {error:?}");
        assert!(!text.contains("secret") && !text.contains("hidden") && !text.contains("user"), "{text}");
    }
}

#[test] // C-12
fn a_replaced_file_is_found_out() {
    let data = bytes(100_000);
    let mut other = data.clone();
    other[60_000] ^= 1;
    let changes: [(&str, Change<'_>); 4] = [
        ("another tag", &|mode| mode.etag = Some("\"two\"".into())),
        ("no tag, another date", &|mode| {
            (mode.etag, mode.modified) = (None, Some("Mon, 02 Mar 2026 10:00:00 GMT".into()))
        }),
        ("shorter", &|mode| mode.content = Arc::new(bytes(99_999))),
        ("too short for the range", &|mode| mode.content = Arc::new(bytes(50_000))),
    ];
    for (name, change) in changes {
        let server = Server::of(data.clone());
        let source = open(&server).unwrap();
        server.change(|mode| mode.content = Arc::new(other.clone()));
        server.change(|mode| change(mode));
        let error = read(&source, 60_000, 10).unwrap_err();
        assert_eq!(error.code(), Code::Replaced, "{name}: {error}");
        assert_eq!(read(&source, 100, 10).unwrap(), data[100..110], "the head is of the version that was opened");
        let error = source.read_fresh(100, &mut [0; 10]).unwrap_err();
        assert_eq!(error.code(), Code::Replaced, "{name}: {error}");
    }
}

#[test]
fn servers_without_tags_and_dates() {
    let server = Server::of(bytes(100_000));
    server.change(|mode| (mode.etag, mode.modified) = (None, None));
    let source = open(&server).unwrap();
    assert_eq!(read(&source, 60_000, 10).unwrap(), bytes(100_000)[60_000..60_010]);
    // Some servers of a group say less than others.
    server.change(|mode| mode.etag = Some("\"one\"".into()));
    read(&source, 60_000, 10).unwrap();
}

#[test]
fn servers_without_ranges() {
    let data = bytes(100_000);
    let server = Server::of(data.clone());
    server.change(|mode| mode.ranges = false);
    for chunked in [false, true] {
        server.change(|mode| mode.chunked = chunked);
        server.take();
        let source = open(&server).unwrap();
        assert_eq!(read(&source, 10, 99_990).unwrap(), data[10..]);
        source.read_fresh(50_000, &mut [0; 10]).unwrap();
        assert_eq!(server.cost(), (1, 100_000), "short enough: kept whole");
        let error = HttpSource::open(&server.url("a"), HttpOptions { whole: 99_999, ..quick() }).err().unwrap();
        assert!(error.code() == Code::Source && error.message().contains("ranges"), "{error}");
        assert_eq!(server.cost().0, 1, "not tried again");
        // Cut short while it is kept: only its length tells.
        server.change(|mode| mode.cut = [5].into());
        assert_eq!(open(&server).unwrap().len(), 100_000);
    }
    // Ranges that stop working.
    server.change(|mode| mode.ranges = true);
    let source = open(&server).unwrap();
    server.change(|mode| mode.ranges = false);
    server.take();
    let error = read(&source, 60_000, 10).unwrap_err();
    assert!(error.code() == Code::Source && error.message().contains("whole file"), "{error}");
    assert_eq!(server.cost().0, 6);
}

#[test]
fn answers_to_other_questions_are_refused() {
    let data = bytes(100_000);
    let server = Server::of(data.clone());
    let source = open(&server).unwrap();
    let lies: [Change<'_>; 6] = [
        &|mode| mode.shift = 1,
        &|mode| mode.total = Some("*".into()),
        &|mode| mode.total = Some("-1".into()),
        &|mode| mode.total = Some("10".into()),
        &|mode| mode.total = Some("99999999999999999999999".into()),
        &|mode| mode.encoding = Some("gzip".into()),
    ];
    for (i, lie) in lies.iter().enumerate() {
        server.change(|mode| *mode = Mode::new(data.clone()));
        server.change(|mode| lie(mode));
        server.take();
        for error in [read(&source, 60_000, 10).unwrap_err(), open(&server).err().unwrap()] {
            assert_eq!(error.code(), Code::Source, "{i}: {error}");
        }
        assert_eq!(server.cost().0, 2, "{i}: not tried again");
    }
    // A length that nobody can check is believed until something is read there; nothing is allocated for it.
    server.change(|mode| *mode = Mode::new(data.clone()));
    server.change(|mode| mode.total = Some(u64::MAX.to_string()));
    let boaster = open(&server).unwrap();
    assert_eq!(boaster.len(), u64::MAX);
    assert_eq!(read(&boaster, 1 << 60, 10).unwrap_err().code(), Code::Source);
}

#[test]
fn chunked_answers_are_read() {
    let data = bytes(300_000);
    let server = Server::of(data.clone());
    server.change(|mode| mode.chunked = true);
    let source = open(&server).unwrap();
    assert_eq!(read(&source, 20_000, 200_000).unwrap(), data[20_000..220_000]);
    server.change(|mode| mode.cut = [100_000].into());
    assert_eq!(read(&source, 20_000, 200_000).unwrap(), data[20_000..220_000]);
    assert_eq!(server.connections(), 2, "only the one that was cut was given up");
}

#[test]
fn redirects_are_followed() {
    let data = bytes(100_000);
    let there = Server::of(data.clone());
    let here = Server::of(bytes(10));
    here.change(|mode| mode.redirect = Some(there.url("b.vug")));
    let headers = vec![("Authorization".into(), "Bearer token".into())];
    let source = HttpSource::open(&here.url("a.vug"), HttpOptions { headers, ..quick() }).unwrap();
    assert_eq!(read(&source, 60_000, 10).unwrap(), data[60_000..60_010]);
    assert_eq!((here.cost().0, there.state_cost()), (2, 2));
    here.change(|mode| mode.redirect = Some(here.url("a.vug")));
    let error = open(&here).err().unwrap();
    assert!(error.code() == Code::Source && error.message().contains("circles"), "{error}");
}

impl Server {
    /// Requests, none of which carried credentials for another host.
    fn state_cost(&self) -> u64 {
        let seen = self.take();
        assert!(seen.iter().all(|s| s.headers.iter().all(|(name, _)| name != "authorization")));
        seen.len() as u64
    }
}

#[test]
fn a_slow_server_is_waited_for_and_a_silent_one_is_not() {
    let data = bytes(30_000);
    let server = Server::of(data.clone());
    let source = open(&server).unwrap();
    server.change(|mode| (mode.slow, mode.delay) = (true, Duration::from_millis(2)));
    assert_eq!(read(&source, 10_000, 20_000).unwrap(), data[10_000..]);
    let options = HttpOptions { timeout: Duration::from_millis(50), retries: 1, ..quick() };
    server.change(|mode| (mode.slow, mode.delay) = (false, Duration::from_millis(400)));
    let error = HttpSource::open(&server.url("a"), options).err().unwrap();
    assert!(error.code() == Code::Source && error.message().contains("2 attempts"), "{error}");
}

#[test]
fn a_stopped_source_asks_no_more() {
    /// Does not send the end before it is let go.
    struct Endless {
        let_go: Arc<AtomicBool>,
        gave_up: Arc<AtomicBool>,
    }
    impl Content for Endless {
        fn len(&self) -> u64 {
            1 << 40
        }
        fn send(&self, offset: u64, len: u64, out: &mut std::net::TcpStream) -> std::io::Result<()> {
            out.write_all(&vec![1; len.min(16_384) as usize])?;
            let naps = if offset > 0 { 1000 } else { 0 };
            for _ in 0..naps {
                std::thread::sleep(Duration::from_millis(20));
                if self.let_go.load(Ordering::SeqCst) {
                    return Ok(());
                }
            }
            self.gave_up.store(naps > 0, Ordering::SeqCst);
            Ok(())
        }
    }
    let (let_go, gave_up) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(false)));
    let server = Server::of(Endless { let_go: let_go.clone(), gave_up: gave_up.clone() });
    let patient = HttpOptions { timeout: Duration::from_secs(60), ..quick() };
    let source = HttpSource::open(&server.url("a"), patient).unwrap();
    let stopper = source.stopper();
    std::thread::scope(|scope| {
        scope.spawn(|| {
            std::thread::sleep(Duration::from_millis(100));
            stopper.stop();
        });
        let error = read(&source, 1 << 30, 1 << 20).unwrap_err();
        assert!(error.code() == Code::Source && error.message().contains("stopped"), "{error}");
    });
    assert!(!gave_up.load(Ordering::SeqCst), "the end of the answer was not waited for");
    let_go.store(true, Ordering::SeqCst);
    let asked = server.cost().0;
    assert_eq!(read(&source, 1 << 30, 10).unwrap_err().code(), Code::Source);
    assert_eq!((server.cost().0, asked), (0, 2));
    // A source that waits to try again is woken as well.
    let server = Server::of(bytes(100_000));
    let source = HttpSource::open(&server.url("a"), HttpOptions::default()).unwrap();
    server.change(|mode| mode.fail = vec![(503, Some("1".into())); 100].into());
    let stopper = source.stopper();
    std::thread::scope(|scope| {
        scope.spawn(|| {
            std::thread::sleep(Duration::from_millis(100));
            stopper.stop();
        });
        assert!(read(&source, 50_000, 10).unwrap_err().message().contains("stopped"));
    });
    assert_eq!(server.cost().0, 2, "opened, refused, stopped before the next attempt");
}

#[test]
fn one_failure_ends_many_reads() {
    let server = Server::of(bytes(1 << 20));
    let source = open(&server).unwrap();
    server.take();
    server.change(|mode| mode.fail = [(404, None)].into());
    let mut buffers: Vec<(u64, Vec<u8>)> = (1..1000).map(|i| (i * 1000 + 16_384, vec![0; 10])).collect();
    let mut parts: Vec<(u64, &mut [u8])> = buffers.iter_mut().map(|(at, b)| (*at, b.as_mut_slice())).collect();
    assert_eq!(source.read_many(&mut parts).unwrap_err().code(), Code::Source);
    assert!(server.cost().0 < 100, "the rest is not asked for");
}

#[test]
fn what_is_an_address() {
    for url in ["http://a/b", "HTTPS://a", "s3://bucket/key", "gs://b/k", "az://c/k"] {
        assert!(is_url(url), "{url}");
    }
    for path in ["a.vug", "/a/b", "C:\\a", "http:/a", "://", "file:///a", "httpx://a"] {
        assert!(!is_url(path), "{path}");
    }
    assert_eq!(open_url("a.vug").err().unwrap().code(), Code::Param);
    let server = Server::of(bytes(20));
    assert_eq!(open_url(&server.url("x")).unwrap().len(), 20);
    #[cfg(not(feature = "cloud"))]
    {
        let error = open_url("s3://bucket/key").err().unwrap();
        assert!(error.code() == Code::Unsupported && error.message().contains("`cloud`"), "{error}");
    }
}
