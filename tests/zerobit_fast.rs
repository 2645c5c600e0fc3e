//! The fast decoders of zerobit against the plain ones, which judge them (spec chapter 14).

use proptest::prelude::*;
use std::sync::Arc;
use vug::codec::Codec;
use vug::codec::zerobit::{Book, Coder, Cut, Params, Plan, Stream, Trainer, Training, Word, Zerobit};
use vug::geometry::{Extent, Region};
use vug::grid::Grid;
use vug::voxel::{SampleType, SampleValue};

/// A pseudo-random number per place and seed.
fn noise(seed: u64, i: u64) -> u64 {
    let mut v = (seed ^ i.wrapping_mul(0x9E37_79B9_7F4A_7C15)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    v ^= v >> 29;
    v.wrapping_mul(0x94D0_49BB_1331_11EB) >> 32
}

fn null_of(t: SampleType) -> SampleValue {
    match t {
        SampleType::U8 => SampleValue::U8(7),
        SampleType::U16 => SampleValue::U16(900),
        SampleType::I16 => SampleValue::I16(-1000),
        SampleType::F32 => SampleValue::F32(0.0),
        SampleType::Rgb8 => SampleValue::Rgb8([1, 2, 3]),
    }
}

/// A brick of soft bands with some noise, as bytes of type `t`.
fn brick(extent: Extent, t: SampleType, seed: u64) -> Grid {
    let mut grid = Grid::zeros(extent, t).unwrap();
    let bytes = grid.bytes_mut();
    for (i, b) in bytes.iter_mut().enumerate() {
        let soft = ((i / t.bytes() / 9) as u64 * 5) & 127;
        *b = (soft + noise(seed, i as u64) % 60) as u8;
    }
    grid
}

/// An encoded brick and the codec that decodes it.
fn encoded(grid: &Grid, stream: Stream, keep: u32) -> (Codec, Vec<u8>) {
    let t = grid.sample_type();
    let codec = Zerobit::new(stream, Params::new(keep).unwrap(), null_of(t));
    let survey = codec.survey(grid.view());
    let cut = Cut::Share { budget: survey.budget(keep), nonzero: survey.nonzero };
    let mut trainer = Trainer::default();
    trainer.take(&codec.survivors(grid.view(), cut));
    let book = trainer.train(Training::MedianCut, t).unwrap();
    let coder = Arc::new(Coder::new(&book));
    let codec = Codec::Zerobit(codec.with_books([book].into()).planned(Plan { book: 0, coder, cut }));
    let mut payload = Vec::new();
    codec.encode(grid.view(), &mut payload).unwrap();
    codec.check(&payload, t, grid.extent(), 0).unwrap();
    (codec, payload)
}

fn decoded(codec: &Codec, payload: &[u8], extent: Extent, t: SampleType, region: &Region, plain: bool) -> Grid {
    let mut out = Grid::zeros(region.extent(), t).unwrap();
    out.bytes_mut().fill(0xA5);
    if plain {
        codec.decode_plain(payload, extent, region, out.view_mut()).unwrap();
    } else {
        codec.decode(payload, extent, region, out.view_mut()).unwrap();
    }
    out
}

/// Fast and plain decoders agree on a region, and single voxels with both.
fn agree(codec: &Codec, payload: &[u8], extent: Extent, t: SampleType, region: &Region) {
    let fast = decoded(codec, payload, extent, t, region, false);
    let plain = decoded(codec, payload, extent, t, region, true);
    assert!(fast.bytes() == plain.bytes(), "{t}, brick {extent}, region {region}");
    let size = region.extent();
    for (i, z) in (0..size.z).enumerate() {
        for y in 0..size.y {
            for x in (0..size.x).step_by(1 + i % 3) {
                let c = [region.start[0] + x, region.start[1] + y, region.start[2] + z];
                assert_eq!(codec.voxel(payload, t, extent, c).unwrap(), plain.value([x, y, z]).unwrap(), "{c:?}");
            }
        }
    }
}

const TYPES: [SampleType; 4] = [SampleType::U8, SampleType::U16, SampleType::I16, SampleType::Rgb8];

#[test] // spec: ZBT-12, ZBT-26; K-38, K-57
fn fast_is_plain_for_every_type_stream_and_ratio() {
    for (i, t) in TYPES.into_iter().enumerate() {
        for keep in [0, 5_000, 30_000, 200_000, 1_000_000] {
            for extent in [Extent::cube(32), Extent::new(17, 20, 33)] {
                let grid = brick(extent, t, i as u64);
                let whole = Region::whole(extent);
                let both = [Stream::New, Stream::Old].map(|stream| {
                    let (codec, payload) = encoded(&grid, stream, keep);
                    agree(&codec, &payload, extent, t, &whole);
                    decoded(&codec, &payload, extent, t, &whole, false)
                });
                assert!(both[0].bytes() == both[1].bytes(), "both streams decode to the same voxels");
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn fast_is_plain_on_any_region(
        (t, old, seed, keep) in (0..4usize, any::<bool>(), any::<u64>(), 0..400_000u32),
        dims in [1..40u32, 1..40u32, 1..40u32],
        corners in [[0.0..1.0f64, 0.0..1.0], [0.0..1.0f64, 0.0..1.0], [0.0..1.0f64, 0.0..1.0]],
    ) {
        let (t, extent) = (TYPES[t], Extent::from(dims));
        let stream = if old { Stream::Old } else { Stream::New };
        let (codec, payload) = encoded(&brick(extent, t, seed), stream, keep);
        let mut region = Region::whole(extent);
        for a in 0..3 {
            let [p, q] = corners[a].map(|f| (f * f64::from(dims[a])) as u32);
            (region.start[a], region.end[a]) = (p.min(q), p.max(q) + 1);
        }
        agree(&codec, &payload, extent, t, &region);
    }

    #[test] // spec: ZBT-7, ZBT-12
    fn fast_is_plain_on_garbage(
        (t, old, seed, words) in (0..4usize, any::<bool>(), any::<u64>(), 0..257usize),
        dims in [1..34u32, 1..34u32, 1..34u32],
    ) {
        let (t, extent) = (TYPES[t], Extent::from(dims));
        let c = t.components();
        let word = |i: usize, lo: i32, hi: i32| -> Word {
            std::array::from_fn(|k| if k < c { lo + (noise(seed, (3 * i + k) as u64) % (hi - lo + 1) as u64) as i32 } else { 0 })
        };
        let (average, detail) = match t {
            SampleType::U16 => ([0, 65535], [-32768, 32767]),
            SampleType::I16 => ([-32768, 32767], [-32768, 32767]),
            _ => ([0, 255], [-128, 127]),
        };
        let words = |range: [i32; 2]| (0..words).map(|i| word(i, range[0], range[1])).collect();
        let book = Book::new(t, words(average), words(detail)).unwrap();
        let stream = if old { Stream::Old } else { Stream::New };
        let codec = Codec::Zerobit(Zerobit::new(stream, Params::default(), null_of(t)).with_books([book].into()));
        let lens = codec.payload_lens(t, extent);
        let len = *lens.start() + noise(seed, 1) % (lens.end() - lens.start() + 1).min(6000);
        let mut payload: Vec<u8> = (0..len).map(|i| noise(seed, i + 9) as u8).collect();
        payload[..4].fill(0);
        // Starts inside the payload now and then, and far outside.
        let units = (*lens.start() as usize - 16) / 4;
        for i in 0..units {
            let base = (noise(seed, i as u64 + 77) % (len / 4 + 3)) as u32;
            payload[16 + 4 * i..20 + 4 * i].copy_from_slice(&(base << 8 | (noise(seed, i as u64) as u32 & 0xFF)).to_le_bytes());
        }
        agree(&codec, &payload, extent, t, &Region::whole(extent));
    }
}

#[test]
fn parts_wider_than_bricks_of_files_decode_too() {
    let extent = Extent::new(1100, 5, 6);
    for t in TYPES {
        let (codec, payload) = encoded(&brick(extent, t, 3), Stream::New, 100_000);
        agree(&codec, &payload, extent, t, &Region::whole(extent));
        agree(&codec, &payload, extent, t, &Region { start: [3, 1, 0], end: [900, 4, 6] });
    }
}
