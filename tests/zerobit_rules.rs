//! Rules of zerobit that neither files nor hostile bytes show: parameters, ranges of words, null nodes, the one clamp.

mod zerobit_support;

use vug::Code;
use vug::SampleType;
use vug::codec::Codec;
use vug::codec::zerobit::bits::Popcount;
use vug::codec::zerobit::{Book, Case, Context, Counts, Params, Stream, unit};
use vug::geometry::Extent;
use vug::voxel::SampleValue;
use zerobit_support::*;

#[test] // spec: ZBT-2, ZBT-3, ZBT-1
fn parameters_have_their_sets_and_reserved_bytes_are_zero() {
    let good = Params::new(1_000_000).unwrap().to_wire();
    assert_eq!(Params::from_wire(&good).unwrap().to_wire(), good);
    let with = |at: usize, v: u8| {
        let mut bytes = good;
        bytes[at] = v;
        Params::from_wire(&bytes).map_err(|e| e.code()).map(|p| p.to_wire() == bytes)
    };
    assert_eq!(Params::new(1_000_001).unwrap_err().code(), Code::Param);
    assert_eq!(with(0, good[0] + 1), Err(Code::Param));
    for at in 4..7 {
        assert_eq!((with(at, 1), with(at, 2), with(at, 255)), (Ok(true), Err(Code::Param), Err(Code::Param)));
    }
    (8..16).for_each(|at| assert_eq!(with(at, 200), Ok(true), "selected voxels"));
    [7].into_iter().chain(16..28).for_each(|at| assert_eq!(with(at, 1), Err(Code::Reserved), "byte {at}"));
    for (version, known) in [(0, false), (1, true), (2, true), (3, false)] {
        let codec = Codec::from_wire(3, version, &good, SampleValue::U8(0));
        assert_eq!(codec.map_err(|e| e.code()).err(), (!known).then_some(Code::Codec));
    }
    let codec = codec(Stream::New, SampleType::U8, vec![]);
    assert_eq!(codec.supports(SampleType::F32).unwrap_err().code(), Code::Param);
    assert!(TYPES.into_iter().all(|t| codec.supports(t).is_ok()));
}

#[test] // spec: ZBT-5
fn words_lie_in_their_ranges() {
    for (t, averages, details) in [
        (SampleType::U8, [0, 255], [-128, 127]),
        (SampleType::Rgb8, [0, 255], [-128, 127]),
        (SampleType::U16, [0, 65535], [-32768, 32767]),
        (SampleType::I16, [-32768, 32767], [-32768, 32767]),
    ] {
        let make = |v: i32| if t == SampleType::Rgb8 { [v; 3] } else { [v, 0, 0] };
        let book = Book::new(t, averages.map(make).to_vec(), details.map(make).to_vec()).unwrap();
        let mut bytes = Vec::new();
        book.write_to(t, &mut bytes);
        assert_eq!(Book::read_all(&bytes, 1, t, 0).unwrap(), [book], "{t}");
        for wrong in [averages[0] - 1, averages[1] + 1] {
            assert_eq!(Book::new(t, vec![make(wrong)], vec![]).unwrap_err().code(), Code::Param);
        }
        for wrong in [details[0] - 1, details[1] + 1] {
            assert_eq!(Book::new(t, vec![], vec![make(wrong)]).unwrap_err().code(), Code::Param);
        }
    }
    assert_eq!(Book::new(SampleType::U8, vec![[0; 3]; 257], vec![]).unwrap_err().code(), Code::Limit);
}

#[test] // spec: ZBT-23
fn the_children_of_a_null_node_are_its_mean_for_nothing() {
    let book = book(SampleType::U8, 100, 200);
    let context = Context { book: &book, sample_type: SampleType::U8, count: Popcount };
    let count = |details: &[((u8, u8), u8)]| {
        let payload = payload(Stream::New, 0, &[[(0, CellSpec::new(90, details))].into_iter().collect()]);
        let cell = unit(&payload, 0).unwrap().cell(0, Popcount).unwrap();
        let mut counts = Counts::default();
        (context.cell(&cell, &mut counts), counts)
    };
    let (voxels, counts) = count(&[]);
    assert_eq!((voxels, counts.vector_ops, counts.of(Case::NullNode)), ([[90, 0, 0]; 64], 0, 63));
    // Node 8 has details, the other seven are null: their voxels are the mean of level 0.
    let (voxels, counts) = count(&[((8, 1), 138)]);
    assert_eq!((counts.vector_ops, counts.decodes(), voxels[0], voxels[21]), (24, 64, [90, 0, 0], [90, 0, 0]));
    assert!(voxels.iter().filter(|v| v[0] != 90).count() == 8 && voxels[42][0] == 100 && voxels[63][0] == 80);
    assert_eq!(count(&[((0, 1), 138), ((3, 7), 1)]).1.vector_ops, 48);
}

#[test] // K-36, K-37; spec: ZBT-24
fn only_results_are_clamped() {
    for (t, least, most) in
        [(SampleType::U8, -128, 127), (SampleType::I16, -32768, 32767), (SampleType::U16, -32768, 32767)]
    {
        let average = if t == SampleType::I16 {
            32767
        } else {
            i32::from(u16::MAX) & if t == SampleType::U8 { 255 } else { 65535 }
        };
        let book = Book::new(t, vec![[average, 0, 0]], vec![[most, 0, 0], [least, 0, 0]]).unwrap();
        // Up by all of level 0, which is over the range, and down again by all of level 1: exact, not clamped in between.
        let details: Vec<((u8, u8), u8)> = (1..8).map(|j| ((0, j), 0)).chain((1..8).map(|j| ((1, j), 1))).collect();
        let bytes = payload(Stream::New, 0, &[[(0, CellSpec::new(0, &details))].into_iter().collect()]);
        let codec = codec(Stream::New, t, vec![book]);
        let brick = Extent::cube(4);
        let first = codec.voxel(&bytes, t, brick, [0; 3]).unwrap();
        assert_eq!(first.component(0), f64::from(average + 7 * most + 7 * least), "{t}");
        // All of level 1 the other way: the largest value there can be, clamped once.
        let up: Vec<((u8, u8), u8)> = (1..8).flat_map(|j| [((0, j), 0), ((1, j), 0)]).collect();
        let bytes = payload(Stream::New, 0, &[[(0, CellSpec::new(0, &up))].into_iter().collect()]);
        assert_eq!(codec.voxel(&bytes, t, brick, [0; 3]).unwrap().component(0), f64::from(average));
        let half = reduced(&codec, &bytes, brick, t, 1);
        assert_eq!(half.value([0; 3]).unwrap().component(0), f64::from(average), "half resolution clamps a copy");
    }
}
