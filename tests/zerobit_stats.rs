//! Statistics of zerobit: what they count in payloads made by hand, and that they account for every byte.

mod support;
mod zerobit_support;

use support::open;
use vug::codec::Codec;
use vug::codec::zerobit::{Stats, Stream};
use vug::geometry::Extent;
use vug::{SampleType, volume::Volume};
use zerobit_support::*;

fn stats(stream: Stream, payload: &[u8], brick: Extent) -> Stats {
    let t = SampleType::Rgb8;
    let Codec::Zerobit(z) = codec(stream, t, vec![book(t, 9, 4)]) else { unreachable!() };
    z.stats(payload, brick)
}

#[test] // B-83: both denominators
fn the_figure_is_counted() {
    let brick = Extent::new(32, 16, 16);
    let payload = payload(Stream::New, 0, &[figure(), UnitSpec::new()]);
    let s = stats(Stream::New, &payload, brick);
    assert_eq!((s.payloads, s.unit_blocks, s.void_unit_blocks, s.stored_cells), (1, 2, 1, 9));
    assert_eq!((s.nodes_0, s.nodes_1, s.averages, s.details, s.coefficients()), (9, 10, 9, 50, 59));
    assert_eq!((s.gamma_0(9), s.gamma_1(9)), (Some(0.0), Some(1.0 - 10.0 / 72.0)));
    assert_eq!(
        (s.gamma_0(128), s.gamma_1(128), s.gamma_0(0)),
        (Some(1.0 - 9.0 / 128.0), Some(1.0 - 10.0 / 1024.0), None)
    );
    let n = s.new;
    assert_eq!((n.prefix, n.directory, n.cbft, n.records), (16, 8, 8, 45));
    assert_eq!((n.significance, n.indices, n.padding, n.total()), (28, 50, 1, payload.len() as u64));
    // The paper's 132 bytes, and one for the void unit block.
    assert_eq!(n.as_in_the_paper(2), 132 + 1);
    let o = s.old;
    assert_eq!((o.records, o.significance, o.indices, o.padding), (18, 72, 59, 3));
    assert_eq!(o.as_in_the_paper(2), 2 + 8 + 10 * 9 + 59);
}

#[test]
fn every_byte_has_a_place_in_both_streams() {
    let mut random = Random(3);
    for brick in [[16, 16, 16], [1, 1, 1], [40, 17, 33], [64, 64, 64]].map(Extent::from) {
        let units = units(&mut random, brick, [9, 4]);
        let payloads = [Stream::New, Stream::Old].map(|stream| payload(stream, 0, &units));
        let [new, old] = [stats(Stream::New, &payloads[0], brick), stats(Stream::Old, &payloads[1], brick)];
        assert_eq!([new.new.total(), new.old.total()], [0, 1].map(|i| payloads[i].len() as u64));
        assert_eq!(Stats { payload_bytes: 0, ..new }, Stats { payload_bytes: 0, ..old }, "either stream tells both");
    }
    // An old stream may leave out averages: the new one cannot.
    let mut cell = CellSpec::new(1, &[((0, 1), 2)]);
    cell.average = None;
    let units = [[(3, cell)].into_iter().collect()];
    let bytes = payload(Stream::Old, 0, &units);
    let s = stats(Stream::Old, &bytes, Extent::cube(16));
    assert_eq!((s.old.total(), s.averages, s.coefficients()), (bytes.len() as u64, 0, 1));
    assert_eq!(s.new.total(), 16 + 4 + (8u64 + 5 + 2 + 1));
}

#[test] // spec: ZBT-12
fn random_bytes_have_statistics() {
    let mut random = Random(8);
    for len in [0, 3, 16, 24, 100, 5000] {
        let bytes = random.bytes(len);
        for stream in [Stream::New, Stream::Old] {
            let s = stats(stream, &bytes, Extent::new(33, 16, 40));
            assert_eq!((s.unit_blocks, s), (9, stats(stream, &bytes, Extent::new(33, 16, 40))));
        }
    }
}

/// 75 × 50 × 23: one EMPTY brick, one CONSTANT one, four stored ones.
fn volume(t: SampleType, stream: Stream) -> (Volume, Vec<u8>, usize) {
    let kind = |brick: [u32; 3]| match brick {
        [0, 1, 0] => 0,
        [1, 0, 0] => 1,
        _ => 2,
    };
    let (bytes, payloads) = file(Extent::new(75, 50, 23), 5, t, stream, kind);
    let len = payloads.iter().map(Vec::len).sum();
    (open(bytes.clone()), bytes, len)
}

#[test]
fn volumes_add_up_their_bricks() {
    for (t, stream) in TYPES.into_iter().flat_map(|t| [(t, Stream::New), (t, Stream::Old)]) {
        let (volume, _, len) = volume(t, stream);
        let s = volume.codec_stats().unwrap().unwrap();
        assert_eq!((s.stream, s.params.keep_ppm(), s.finest), (stream, 30_000, s.all));
        let l = &s.finest;
        assert_eq!((l.voxels, l.cells, l.stats.payloads), (75 * 50 * 23, 19 * 13 * 6, 4));
        assert_eq!((l.stats.payload_bytes, l.stored_bytes), (len as u64, len as u64));
        let own = if stream == Stream::New { l.stats.new } else { l.stats.old };
        assert_eq!(own.total(), len as u64);
        assert_eq!(l.null_cells() + l.stats.stored_cells, l.cells);
        assert_eq!(s.kept(), l.stats.coefficients() as f64 / (75.0 * 50.0 * 23.0));
        let books = two_books(t);
        assert_eq!((s.codebooks, s.codebook_bytes), (2, stored(&books, t).len() as u64));
        assert_eq!(s.codebook_words, (9 + 4 + 256 + 256) * t.bytes() as u64);
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        assert_eq!(one.install(|| volume.codec_stats().unwrap().unwrap()), s);
    }
    let (bytes, _) = support::encode(&mut support::ball(Extent::cube(20)), &support::explicit(4, 4));
    assert!(open(bytes).codec_stats().unwrap().is_none());
}

#[cfg(feature = "cli")]
#[test]
fn the_command_line_tells_them() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.vug");
    let info = |args: &[&str]| {
        let out = assert_cmd::Command::cargo_bin("vug").unwrap().arg("info").arg(&path).args(args).assert().success();
        String::from_utf8(out.get_output().stdout.clone()).unwrap()
    };
    let (volume, bytes, len) = volume(SampleType::Rgb8, Stream::New);
    std::fs::write(&path, bytes).unwrap();
    let j: serde_json::Value = serde_json::from_str(&info(&["--codec-stats", "--json"])).unwrap();
    let level = &j["codec_stats"]["level_0"];
    let parts = ["prefix", "directory", "cbft", "cia", "zsms", "dis", "padding"];
    let sum: u64 = parts.iter().map(|part| level["bytes"][part].as_u64().unwrap()).sum();
    assert_eq!((sum, level["bytes"]["total"].as_u64()), (len as u64, Some(len as u64)));
    let s = volume.codec_stats().unwrap().unwrap();
    assert_eq!(level["gamma_0"]["stored_cells"].as_f64(), s.finest.stats.gamma_0(s.finest.stats.stored_cells));
    assert_eq!(level["gamma_1"]["all_cells"].as_f64(), s.finest.stats.gamma_1(s.finest.cells));
    assert_eq!((level["lambda"].as_f64(), j["codec_stats"]["lambda_asked"].as_f64()), (Some(s.kept()), Some(0.03)));
    assert!(level["other_stream"]["total"].as_u64() == Some(s.finest.stats.old.total()));
    let text = info(&["--codec-stats"]);
    assert!(["γ0", "γ1", "CIA", "ZSMS", "DIS", "codebooks: 2"].iter().all(|part| text.contains(part)), "{text}");
    assert!(!info(&[]).contains("γ0"));
    // Another codec has none, and says so.
    let (bytes, _) = support::encode(&mut support::ball(Extent::cube(20)), &support::explicit(4, 4));
    std::fs::write(&path, bytes).unwrap();
    assert!(info(&["--codec-stats"]).contains("no zerobit bricks"));
    let j: serde_json::Value = serde_json::from_str(&info(&["--codec-stats", "--json"])).unwrap();
    assert!(j["codec_stats"].is_null() && j.get("codec_stats").is_some());
}
