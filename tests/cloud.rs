//! The source in an object store, against a local server that speaks as much of S3 as reading needs.
#![cfg(feature = "cloud")]

#[path = "support/server.rs"]
mod server;
mod support;

use server::Server;
use std::sync::Arc;
use std::time::Duration;
use support::{ball, encode};
use vug::limits::Limits;
use vug::source::{ByteSource, CloudOptions, CloudSource, open_url};
use vug::volume::{At, EncodeOptions, Volume};
use vug::{Code, Error, Extent};

fn bytes(len: usize) -> Vec<u8> {
    (0..len).map(|i| (i as u32).wrapping_mul(0x9E37_79B1).to_le_bytes()[3]).collect()
}

fn open() -> Result<CloudSource, Error> {
    let quick = CloudOptions { retries: 3, backoff: Duration::from_millis(1), ..CloudOptions::default() };
    CloudSource::open("s3://bucket/folder/a.vug", quick)
}

fn read(source: &dyn ByteSource, offset: u64, len: usize) -> Result<Vec<u8>, Error> {
    let mut out = vec![0xEE; len];
    source.read_at(offset, &mut out).map(|()| out)
}

/// One test, since the environment that says where the store is belongs to the whole process.
#[test]
#[allow(unsafe_code, reason = "sets environment variables before there is a second thread that reads them")]
fn objects_are_read_as_files_are() {
    let data = bytes(100_000);
    let server = Server::of(data.clone());
    let variables = [
        ("AWS_ENDPOINT", format!("http://{}", server.address())),
        ("AWS_ALLOW_HTTP", "true".into()),
        ("AWS_REGION", "nowhere-1".into()),
        ("AWS_ACCESS_KEY_ID", "AKIDSECRET".into()),
        ("AWS_SECRET_ACCESS_KEY", "hidden".into()),
    ];
    for (name, value) in variables {
        // SAFETY: the only test of this program; the server's thread reads no environment.
        unsafe { std::env::set_var(name, value) };
    }

    let source = open().unwrap();
    assert_eq!((source.len(), server.cost()), (100_000, (1, 16_384)));
    assert_eq!(read(&source, 16_000, 384).unwrap(), data[16_000..16_384]);
    assert_eq!(server.cost(), (0, 0), "the head is kept");
    assert_eq!(read(&source, 60_000, 10_000).unwrap(), data[60_000..70_000]);
    let seen = server.take();
    assert_eq!((seen.len(), seen[0].path.as_str(), seen[0].bytes), (1, "/bucket/folder/a.vug", 10_000));
    let header = |name: &str| seen[0].headers.iter().find(|(n, _)| n == name).map(|(_, v)| v.as_str());
    assert_eq!((header("range"), header("if-match")), (Some("bytes=60000-69999"), Some("\"one\"")));
    assert!(header("authorization").unwrap().starts_with("AWS4-HMAC-SHA256 Credential=AKIDSECRET/"));
    assert_eq!(read(&source, 99_999, 2).unwrap_err().code(), Code::Truncated);

    // Ranges side by side, also from within somebody else's runtime.
    let mut buffers: Vec<(u64, Vec<u8>)> = (1..20).map(|i| (i * 5000, vec![0; 1000])).collect();
    let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
    runtime.block_on(async {
        let mut parts: Vec<(u64, &mut [u8])> = buffers.iter_mut().map(|(at, b)| (*at, b.as_mut_slice())).collect();
        source.read_many(&mut parts).unwrap();
        drop(open().unwrap());
    });
    for (at, found) in &buffers {
        assert_eq!(found[..], data[*at as usize..][..1000]);
    }

    // Failures that pass, and such that do not.
    server.take();
    server.change(|mode| mode.fail = [(503, None), (500, None)].into());
    assert_eq!(read(&source, 60_000, 10).unwrap(), data[60_000..60_010]);
    assert_eq!(server.take().iter().map(|s| s.status).collect::<Vec<_>>(), [503, 500, 206]);
    server.change(|mode| mode.fail = vec![(503, None); 4].into());
    let mut errors = vec![read(&source, 60_000, 10).unwrap_err()];
    assert_eq!(server.cost().0, 4);
    for (status, advice) in [(404, "no such object"), (403, "credentials"), (400, "fails")] {
        server.change(|mode| mode.fail = [(status, None)].into());
        let error = open().err().unwrap();
        assert!(error.message().contains(advice), "{error}");
        errors.push(error);
        server.change(|mode| mode.fail.clear());
    }
    for error in errors {
        assert_eq!(error.code(), Code::Source, "{error}");
        let text = format!("{error} {error:?}");
        assert!(!text.contains("SECRET") && !text.contains("hidden"), "{text}");
    }
    server.change(|mode| mode.shift = 1);
    assert_eq!(read(&source, 60_000, 10).unwrap_err().code(), Code::Source);
    server.change(|mode| mode.shift = 0);
    for url in ["s3://bucket", "s3://bucket/", "s3:///key"] {
        assert_eq!(open_url(url).err().unwrap().code(), Code::Param, "{url}");
    }

    // Another version, which the server hands out in spite of `If-Match`.
    server.change(|mode| mode.etag = Some("\"two\"".into()));
    let mut out = [0; 10];
    for error in [source.read_at(60_000, &mut out).unwrap_err(), source.read_fresh(0, &mut out).unwrap_err()] {
        assert_eq!(error.code(), Code::Replaced, "{error}");
    }
    assert_eq!(read(&source, 0, 10).unwrap(), data[..10], "the head is of the version that was opened");
    server.change(|mode| (mode.etag, mode.content) = (Some("\"one\"".into()), Arc::new(bytes(99_999))));
    assert_eq!(read(&source, 60_000, 10).unwrap_err().code(), Code::Replaced);
    server.change(|mode| mode.fail = [(412, None)].into());
    assert_eq!(read(&source, 60_000, 10).unwrap_err().code(), Code::Replaced);

    // Short and empty objects.
    for len in [0, 1, 16_384] {
        let data = bytes(len);
        server.change(|mode| mode.content = Arc::new(data.clone()));
        let source = open().unwrap();
        assert_eq!((source.len(), read(&source, 0, len).unwrap()), (len as u64, data));
    }

    // A volume.
    let mut grid = ball(Extent::new(130, 90, 70));
    let file = encode(&mut grid, &EncodeOptions::default()).0;
    server.change(|mode| mode.content = Arc::new(file.clone()));
    let volume = Volume::open(open_url("s3://bucket/ball.vug").unwrap(), Limits::default()).unwrap();
    let expected = support::open(file).read(At::default()).unwrap();
    assert_eq!(volume.read(At::default()).unwrap().bytes(), expected.bytes());
    let program =
        assert_cmd::Command::cargo_bin("vug").unwrap().args(["verify", "s3://bucket/ball.vug"]).output().unwrap();
    assert!(program.status.success(), "{program:?}");
}
