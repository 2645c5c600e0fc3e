//! The portable fast decoders against the plain one: machines with special instructions would never run them otherwise.

use super::fast::{BrickReader, Portable};
use super::fast_cell::{PortableColour, PortableGrey};
use super::fast_region::decode_with;
use super::*;
use crate::geometry::Region;
use crate::grid::Grid;
use crate::voxel::Sample;

fn noise(seed: u64, i: u64) -> u64 {
    let mut v = (seed ^ i.wrapping_mul(0x9E37_79B9_7F4A_7C15)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    v ^= v >> 29;
    v.wrapping_mul(0x94D0_49BB_1331_11EB) >> 32
}

/// A codec with a full codebook, and a payload of any bytes that starts unit blocks inside itself.
fn any_payload(t: SampleType, stream: Stream, extent: Extent, seed: u64) -> (Zerobit, Vec<u8>) {
    let (averages, details) = book::ranges(t);
    let words = |[lo, hi]: [i32; 2]| -> Vec<Word> {
        let word = |i: u64| {
            let v = |k: u64| lo + (noise(seed, 3 * i + k) % (hi - lo + 1) as u64) as i32;
            std::array::from_fn(|c| if c < t.components() { v(c as u64) } else { 0 })
        };
        (0..256).map(word).collect()
    };
    let book = Book::new(t, words(averages), words(details)).unwrap();
    let null = SampleValue::from_raw(t, if t == SampleType::U8 { 9 } else { 300 }).unwrap();
    let codec = Zerobit::new(stream, Params::default(), null).with_books([book].into());
    let units = Layout::new(extent).units.voxels() as usize;
    let mut payload: Vec<u8> = (0..4000).map(|i| (noise(seed, i + 5) >> 3) as u8).collect();
    payload[..4].fill(0);
    for i in 0..units {
        let base = (noise(seed, i as u64 + 999) % 900) as u32;
        let cells = [0, 1, 30, 64, 200][i % 5];
        payload[16 + 4 * i..20 + 4 * i].copy_from_slice(&(base << 8 | cells).to_le_bytes());
    }
    (codec, payload)
}

fn agree<T: Sample>(stream: Stream, seed: u64) {
    let extent = Extent::new(37, 18, 21);
    let (codec, payload) = any_payload(T::TYPE, stream, extent, seed);
    let part = BrickPart { payload: &payload, brick: extent, region: Region { start: [1, 2, 3], end: [37, 17, 20] } };
    let mut plain = Grid::zeros(part.region.extent(), T::TYPE).unwrap();
    codec.decode_plain(&part, plain.view_mut()).unwrap();
    let mut fast = Grid::zeros(part.region.extent(), T::TYPE).unwrap();
    let copy = |to: &mut [u8], from: &[u8]| to.copy_from_slice(from);
    let parts = [part];
    match T::TYPE {
        SampleType::Rgb8 => decode_with(&codec, PortableColour, &parts, fast.view_mut(), copy).unwrap(),
        t => decode_with(&codec, |tables| PortableGrey(tables, t), &parts, fast.view_mut(), copy).unwrap(),
    }
    assert!(plain.bytes() == fast.bytes(), "{} {stream:?} {seed}", T::TYPE);
    // Single voxels, planes and cells.
    let whole = BrickPart { region: Region::whole(extent), ..part };
    let mut plain = Grid::zeros(extent, T::TYPE).unwrap();
    codec.decode_plain(&whole, plain.view_mut()).unwrap();
    let at = |c: Coord| plain.samples::<T>()[extent.index(c) as usize];
    let frame = codec.frame(&payload, extent).unwrap();
    let reader = frame.reader(&payload);
    for i in 0..300 {
        let c = [noise(seed, i) as u32 % 37, noise(seed, i + 1) as u32 % 18, noise(seed, i + 2) as u32 % 21];
        assert_eq!(reader.single_with::<T>(c, &Portable), at(c), "{c:?}");
        let mut out = [at([0; 3])];
        BrickReader::voxels_with(&[reader], &[c], &mut out, &Portable);
        assert_eq!(out[0], at(c));
        // The same by whatever this machine has.
        assert_eq!(reader.voxel::<T>(c), at(c), "{c:?}");
        BrickReader::voxels(&[reader], &[c], &mut out);
        assert_eq!(out[0], at(c));
        let (mut fast_cell, mut fast_plane) = ([at([0; 3]); 64], [at([0; 3]); 16]);
        reader.cell(c, &mut fast_cell);
        let first = c.map(|v| v & !3);
        let inside = |c: Coord| extent.contains(c);
        let mut cell = [at([0; 3]); 64];
        reader.cell_portable(c, &mut cell);
        assert_eq!(fast_cell, cell);
        for (k, &v) in (0u32..).zip(&cell) {
            let c = [first[0] + (k & 3), first[1] + (k >> 2 & 3), first[2] + (k >> 4)];
            assert!(!inside(c) || v == at(c), "cell at {c:?}");
        }
        for axis in 0..3 {
            let mut plane = [at([0; 3]); 16];
            reader.plane_portable(axis, c, &mut plane);
            reader.plane(axis, c, &mut fast_plane);
            assert_eq!(fast_plane, plane);
            for (k, &v) in (0u32..).zip(&plane) {
                let mut at_k = c;
                for (a, step) in (0..3).filter(|&a| a != axis).zip([k & 3, k >> 2]) {
                    at_k[a] = first[a] + step;
                }
                assert!(!inside(at_k) || v == at(at_k), "plane across {axis} at {at_k:?}");
            }
        }
    }
}

#[test] // spec: ZBT-12, ZBT-26; K-38, K-52
fn portable_is_plain() {
    for stream in [Stream::New, Stream::Old] {
        for seed in 1..5 {
            agree::<u8>(stream, seed);
            agree::<u16>(stream, seed);
            agree::<i16>(stream, seed);
            agree::<[u8; 3]>(stream, seed);
        }
    }
}
