//! What does the web cost? A whole volume read over HTTP, against one plain GET of the same bytes from the same server.
//!
//! The server is another process on this machine that lets the operating system send the file. Every round opens the
//! volume anew. Ratio: the GET's time / the row's; 1 = as fast as fetching the bytes and doing nothing with them.

#[path = "../tests/support/server.rs"]
mod server;
mod support;

use server::{OnDisk, Server};
use std::hint::black_box;
use std::io::{BufRead, BufReader, Cursor, Read};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use vug::limits::Limits;
use vug::source::{HttpOptions, HttpSource};
use vug::volume::{self, At, CodecChoice, EncodeOptions, Quality, Volume};
use vug::{Extent, Grid, Region};

const SERVE: &str = "VUG_BENCH_SERVE";

fn main() {
    if let Some(path) = std::env::var_os(SERVE) {
        let server = Server::of(OnDisk(path.into()));
        println!("{}", server.url("a.vug"));
        // Until the bench is done with it.
        let _ = std::io::stdin().read(&mut [0]);
        return;
    }
    println!("Whole volumes over HTTP from a process of this machine; rounds interleaved; ratio 1 = one plain GET");
    println!("threads of this machine: {}", std::thread::available_parallelism().map_or(1, usize::from));
    let folder = tempfile::tempdir().expect("a temporary folder");
    let explicit = Quality::Explicit { index_bits: 4, block: Extent::cube(4) };
    let rows = [
        ("raw u8 640³", CodecChoice::Raw, EncodeOptions::default().quality, false),
        ("s3dc u8 640³", CodecChoice::S3dc, explicit, false),
        ("s3dc u8 640³, zstd", CodecChoice::S3dc, explicit, true),
    ];
    let mut grid: Option<Grid> = None;
    for (name, codec, quality, zstd) in rows.into_iter().filter(|row| support::wanted(row.0)) {
        let grid = grid.get_or_insert_with(|| support::volume::<u8>(640, |v| (v * 255.0) as u8));
        let mut file = Cursor::new(Vec::new());
        let options = EncodeOptions { codec, quality, zstd, ..EncodeOptions::default() };
        volume::encode(grid, &mut file, &options, &mut |_, _| {}).expect("encodes");
        let path = folder.path().join("a.vug");
        std::fs::write(&path, file.into_inner()).expect("room for the file");
        row(name, &path);
    }
}

fn row(name: &str, path: &Path) {
    let (url, mut server) = serve(path);
    let volume = over_http(&url);
    let bricks = volume.head().section(*b"BRIK").expect("a file with bricks");
    let range = (bricks.offset, bricks.offset + bricks.stored_len);
    let extent = volume.levels().next().expect("level 0");
    let mut out = [(); 2].map(|()| Grid::zeros(extent, volume.info().sample_type).expect("memory"));
    let [over_web, from_file] = &mut out;
    let agent = ureq::Agent::new_with_defaults();
    let mut bytes = vec![0; (range.1 - range.0) as usize];
    let len = bytes.len();
    let mut contestants: Vec<support::Contestant<'_>> = vec![
        (
            "one plain GET".into(),
            Box::new(|| {
                let request = agent.get(&url).header("Range", format!("bytes={}-{}", range.0, range.1 - 1));
                let mut body = request.call().expect("an answer").into_body().into_reader();
                body.read_exact(&mut bytes).expect("all bytes");
                black_box(&bytes);
            }),
        ),
        (
            "region over HTTP".into(),
            Box::new(|| {
                let volume = over_http(&url);
                volume.read_region_into(At::default(), Region::whole(extent), over_web.view_mut()).expect("decodes");
            }),
        ),
        (
            "region from the file".into(),
            Box::new(|| {
                let volume = Volume::open_path(path).expect("opens");
                volume.read_region_into(At::default(), Region::whole(extent), from_file.view_mut()).expect("decodes");
            }),
        ),
    ];
    let timings = support::interleave(support::rounds(2 * len), &mut contestants);
    drop(contestants);
    assert!(out[0].bytes() == out[1].bytes(), "the same voxels");
    let rate = len as f64 / timings[0].median.as_secs_f64() / 1e9;
    println!("\n{name}: {:.0} MB stored; GET {rate:.2} GB/s", len as f64 / 1e6);
    for t in &timings[1..] {
        let (median, best) = t.ratio_to(&timings[0]);
        println!("  {:<22} {median:>6.2} × GET (best rounds {best:.2})", t.name);
    }
    drop(server.stdin.take());
    let _ = server.wait();
}

fn over_http(url: &str) -> Volume {
    let source = HttpSource::open(url, HttpOptions::default()).expect("the server answers");
    Volume::open(source, Limits::default()).expect("opens")
}

/// A process that serves the file, and its address.
fn serve(path: &Path) -> (String, Child) {
    let program = std::env::current_exe().expect("this program");
    let mut child = Command::new(program)
        .env(SERVE, path)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("a second process");
    let mut line = String::new();
    BufReader::new(child.stdout.take().expect("a pipe")).read_line(&mut line).expect("an address");
    (line.trim().to_owned(), child)
}
