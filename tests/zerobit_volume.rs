//! Zerobit in files, made by hand: verified, rewritten, read by voxel, cell, unit block, region and at lower resolution.

mod support;
mod zerobit_support;

use std::io::Cursor;
use support::{open, verify};
use vug::codec::zerobit::{Book, Stream};
use vug::container::rewrite;
use vug::geometry::{Extent, Region};
use vug::limits::Limits;
use vug::volume::{Appender, At, CopyOptions};
use vug::{Code, SampleType};
use zerobit_support::*;

const STREAMS: [Stream; 2] = [Stream::New, Stream::Old];

/// 3 × 2 × 1 bricks of 32³, partly outside; one EMPTY, one CONSTANT.
fn kind(brick: [u32; 3]) -> u8 {
    match brick {
        [0, 1, 0] => 0,
        [1, 0, 0] => 1,
        _ => 2,
    }
}
const DIMS: Extent = Extent::new(75, 50, 23);

#[test] // spec: ZBT-34, VAL-11, ZBT-1
fn files_are_strictly_valid_and_written_the_same() {
    for t in TYPES {
        for stream in STREAMS {
            let (bytes, payloads) = file(DIMS, 5, t, stream, kind);
            assert_eq!(payloads.len(), 4);
            assert!(verify(&bytes).is_empty(), "{t} {stream:?}: {:?}", verify(&bytes));
            let mut read = |at: u64, len: usize| Ok(bytes[at as usize..at as usize + len].to_vec());
            let copy = rewrite(bytes.len() as u64, &Limits::default(), &mut read, Cursor::new(Vec::new())).unwrap();
            assert!(copy.0.into_inner() == bytes, "{t} {stream:?}");
            let volume = open(bytes);
            assert_eq!(volume.codebooks().unwrap()[..], two_books(t));
        }
    }
}

#[test] // spec: ZBT-9, ZBT-13
fn voxels_cells_and_unit_blocks_are_parts_of_the_whole() {
    for t in TYPES {
        for stream in STREAMS {
            let (bytes, _) = file(DIMS, 5, t, stream, kind);
            let volume = open(bytes);
            let whole = volume.read(At::default()).unwrap();
            let mut random = Random(5);
            for _ in 0..60 {
                let c = DIMS.to_array().map(|n| random.below(n as usize) as u32);
                assert_eq!(volume.voxel(At::default(), c).unwrap(), whole.value(c).unwrap(), "{c:?}");
                let stored = kind(c.map(|v| v / 32)) == 2;
                for (edge, (region, grid)) in [
                    (4, volume.cell(At::default(), c).unwrap()),
                    (if stored { 16 } else { 32 }, volume.block(At::default(), c).unwrap()),
                ] {
                    let start = c.map(|v| v / edge * edge);
                    let expected = Region::at(start, Extent::cube(edge)).intersect(&Region::whole(DIMS));
                    assert_eq!((region, grid.extent()), (expected, expected.extent()), "{c:?}");
                    let local = std::array::from_fn(|a| c[a] - start[a]);
                    assert_eq!(grid.value(local).unwrap(), whole.value(c).unwrap());
                }
            }
            let outside = volume.cell(At::default(), [75, 0, 0]).unwrap_err();
            assert_eq!(outside.code(), Code::Range);
        }
    }
    // A file of another codec has cells too.
    let (bytes, _) = support::encode(&mut support::ball(Extent::new(20, 9, 6)), &support::explicit(4, 4));
    let (region, grid) = open(bytes).cell(At::default(), [18, 8, 5]).unwrap();
    assert_eq!((region.to_string(), grid.extent()), ("16:20,8:9,4:6".into(), Extent::new(4, 1, 2)));
}

#[test] // spec: ZBT-25, ZBT-26
fn lower_resolutions_come_from_the_same_bricks() {
    for t in TYPES {
        for stream in STREAMS {
            let (bytes, payloads) = file(DIMS, 5, t, stream, kind);
            let volume = open(bytes);
            let codec = codec(stream, t, two_books(t));
            for steps in 1..=2u8 {
                let extent = volume.reduced_extent(At::default(), steps).unwrap();
                assert_eq!(extent, DIMS.div_ceil(Extent::cube(1 << steps)));
                let whole = volume.read_reduced(At::default(), steps, Region::whole(extent)).unwrap();
                let mut stored = payloads.iter();
                for brick in [[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [1, 1, 0], [2, 1, 0]] {
                    let region = Region::at(brick.map(|b| b * 32), Extent::cube(32)).intersect(&Region::whole(DIMS));
                    let expected =
                        (kind(brick) == 2).then(|| reduced(&codec, stored.next().unwrap(), region.extent(), t, steps));
                    let e = region.extent().div_ceil(Extent::cube(1 << steps));
                    for c in (0..e.z).flat_map(|z| (0..e.y).flat_map(move |y| (0..e.x).map(move |x| [x, y, z]))) {
                        let value = whole.value(std::array::from_fn(|a| c[a] + (region.start[a] >> steps))).unwrap();
                        let constant = vug::voxel::SampleValue::from_raw(t, 33).unwrap();
                        match (&expected, kind(brick)) {
                            (Some(grid), _) => assert_eq!(value, grid.value(c).unwrap(), "{t} {brick:?} {c:?}"),
                            (None, 1) => assert_eq!(value, constant),
                            (None, _) => assert_eq!(value, null(t)),
                        }
                    }
                }
                let part = Region { start: [3, 1, 1], end: [extent.x - 1, extent.y, 3] };
                let grid = volume.read_reduced(At::default(), steps, part).unwrap();
                for c in [[0, 0, 0], [4, 6, 1], [part.extent().x - 1, part.extent().y - 1, 0]] {
                    let place = std::array::from_fn(|a| c[a] + part.start[a]);
                    assert_eq!(grid.value(c).unwrap(), whole.value(place).unwrap(), "{c:?}");
                }
            }
        }
    }
}

#[test]
fn what_cannot_be_reduced_is_refused() {
    let (bytes, _) = file(DIMS, 5, SampleType::U8, Stream::New, kind);
    let volume = open(bytes);
    let cube = |n| Region::whole(Extent::cube(n));
    for (steps, region, code) in [(0, cube(1), Code::Param), (3, cube(1), Code::Param), (1, cube(13), Code::Range)] {
        assert_eq!(volume.read_reduced(At::default(), steps, region).unwrap_err().code(), code);
    }
    assert_eq!(volume.read_reduced(At::lod(1), 1, cube(1)).unwrap_err().code(), Code::Range);
    let (bytes, _) = support::encode(&mut support::ball(Extent::cube(20)), &support::explicit(4, 4));
    let refused = open(bytes).read_reduced(At::default(), 1, cube(1)).unwrap_err();
    assert!(refused.code() == Code::Param && refused.message().contains("zerobit"), "{refused}");
}

/// What verifying and reading say of a file with these bytes for section CBOK.
fn with_codebooks(codebooks: Option<(Vec<u8>, u64)>) -> (Vec<vug::Error>, Option<Code>) {
    let (bytes, _) = file_with(Extent::cube(16), 4, SampleType::U8, Stream::New, |_| 2, codebooks);
    let errors = verify(&bytes);
    (errors, open(bytes).read(At::default()).err().map(|e| e.code()))
}

#[test] // spec: ZBT-6, ZBT-4, ZBT-10, ZBT-34
fn malformed_codebooks_are_refused_with_their_place() {
    let good = stored(&two_books(SampleType::U8), SampleType::U8);
    assert!(with_codebooks(Some((good.clone(), 2))).0.is_empty());
    let first_len = u64::from(8u8 + 9 + 4).next_multiple_of(4);
    let changed = |at: usize, v: u8| {
        let mut bytes = good.clone();
        bytes[at] = v;
        Some((bytes, 2))
    };
    let mut long = good.clone();
    long.extend([0; 4]);
    // Before the count is looked at: f32 has none.
    assert_eq!(Book::read_all(&good, 5000, SampleType::F32, 64).unwrap_err().code(), Code::Param);
    for (codebooks, code, at) in [
        (changed(0, 2), Code::Param, 0),
        (changed(1, 1), Code::Reserved, 1),
        (changed(6, 1), Code::Reserved, 1),
        (changed(3, 2), Code::Limit, 2),
        (changed(5, 2), Code::Limit, 4),
        (changed(21, 1), Code::Padding, 21),
        (Some((good[..good.len() - 4].to_vec(), 2)), Code::Truncated, first_len),
        (Some((Vec::new(), 1)), Code::Truncated, 0),
        (Some((good.clone(), 3)), Code::Truncated, good.len() as u64),
        (Some((good.clone(), 1)), Code::Size, first_len),
        (Some((long, 2)), Code::Size, good.len() as u64),
    ] {
        let (errors, read) = with_codebooks(codebooks);
        let section = errors[0].offset().unwrap() - at;
        assert_eq!((errors[0].code(), section % 16), (code, 0), "{errors:?}");
        assert_eq!(read, Some(code));
    }
    // No section at all: the payload refers to nothing. Its place is that of the brick in the file.
    let (errors, read) = with_codebooks(None);
    assert_eq!((errors.len(), errors[0].code(), read), (1, Code::Ref, Some(Code::Ref)), "{errors:?}");
    assert!(errors[0].offset().unwrap() > 256 && errors[0].offset().unwrap() % 16 == 0);
}

#[test] // C-19; spec: ZBT-10, ZBT-34
fn a_brick_without_a_codebook_is_an_error_wherever_it_is_copied_to() {
    let t = SampleType::U8;
    // Every other payload names book 1 of one book.
    let one = Some((support_books(1), 1));
    let (bad, payloads) = file_with(DIMS, 5, t, Stream::New, kind, one);
    let (good, _) = file(DIMS, 5, t, Stream::New, kind);
    assert_eq!(payloads.iter().filter(|p| p[0] == 1).count(), 2);
    let check = |bytes: &[u8]| {
        let (volume, whole) = (open(bytes.to_vec()), open(good.clone()));
        let (mut refused, mut read) = (0, 0);
        for brick in (0..2).flat_map(|y| (0..3).map(move |x| [x, y, 0])).filter(|&b| kind(b) == 2) {
            match volume.read_brick(At::default(), brick) {
                Ok(grid) => {
                    assert_eq!(grid.bytes(), whole.read_brick(At::default(), brick).unwrap().bytes());
                    read += 1;
                }
                Err(e) => {
                    assert_eq!((e.code(), e.field()), (Code::Ref, "zerobit.codebook"), "{e}");
                    assert!(e.message().contains("codebook 1 "), "{e}");
                    refused += 1;
                }
            }
        }
        assert_eq!((refused, read), (2, 2));
        let errors = verify(bytes);
        assert_eq!(errors.iter().map(|e| e.code()).collect::<Vec<_>>(), [Code::Ref; 2], "{errors:?}");
    };
    check(&bad);
    // Payloads are copied as they are, and so is what is wrong with them.
    let volume = open(bad.clone());
    let excerpt = || volume.excerpt(&CopyOptions::default()).unwrap();
    let packed = excerpt().write_head(Cursor::new(Vec::new()), &mut |_, _| {}).unwrap().0.into_inner();
    check(&packed);
    check(&excerpt().write_log(Vec::new(), &mut |_, _| {}).unwrap().0);
    // Behind a file that has two books of its own, none of which is taken for the missing one: such a step is refused.
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("log.vug");
    let whole = open(good.clone());
    let log = whole.excerpt(&CopyOptions::default()).unwrap().write_log(Vec::new(), &mut |_, _| {}).unwrap().0;
    std::fs::write(&path, &log).unwrap();
    let error = Appender::open(&path).unwrap().append(&volume, None, &mut |_, _| {}).unwrap_err();
    assert_eq!((error.code(), error.field()), (Code::Ref, "zerobit.codebook"), "{error}");
    assert!(std::fs::read(&path).unwrap() == log, "the log is what it was");
}

/// The first codebooks of [`two_books`], as section `CBOK` holds them.
fn support_books(count: usize) -> Vec<u8> {
    stored(&two_books(SampleType::U8)[..count], SampleType::U8)
}

#[cfg(feature = "cli")]
#[test] // spec: ZBT-25
fn the_command_line_reduces() {
    let dir = tempfile::tempdir().unwrap();
    let (bytes, _) = file(DIMS, 5, SampleType::U8, Stream::New, kind);
    let (source, target) = (dir.path().join("a.vug"), dir.path().join("a.raw"));
    std::fs::write(&source, &bytes).unwrap();
    let vug = |args: &[&str]| {
        let mut command = assert_cmd::Command::cargo_bin("vug").unwrap();
        command.arg("decode").arg(&source).arg(&target).args(args).args(["--force", "--json"]);
        command.assert()
    };
    let out = vug(&["--reduce", "2"]).success().get_output().stdout.clone();
    let text = String::from_utf8(out).unwrap();
    assert!(text.contains("\"reduce\": 2"), "{text}");
    let volume = open(bytes);
    let whole = Region::whole(volume.reduced_extent(At::default(), 2).unwrap());
    let expected = volume.read_reduced(At::default(), 2, whole).unwrap();
    assert_eq!(std::fs::read(&target).unwrap(), expected.bytes());
    vug(&["--reduce", "1", "--region", "1:3,0:25,2:4"]).success();
    assert_eq!(std::fs::read(&target).unwrap().len(), 2 * 25 * 2);
    vug(&["--reduce", "3"]).code(2);
    vug(&["--reduce", "1", "--salvage"]).code(2);
    vug(&["--reduce", "1", "--region", "0:76,0:1,0:1"]).code(2);
}
