//! The fast encoder gives the plain encoder's bytes: all types, bit counts, blocks, odd extents, pitches, alignments.

use proptest::prelude::*;
use vug::codec::Codec;
use vug::codec::s3dc::{Endpoints, Params};
use vug::geometry::Extent;
use vug::grid::View;
use vug::voxel::SampleType;

/// Bytes that are finite in every type, with runs of equal samples, zeros of both signs, and wide jumps.
fn noise(t: SampleType, len: usize, mut seed: u64, flat: u64) -> Vec<u8> {
    let mut next = || {
        seed = seed.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (seed ^ seed >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB) >> 16
    };
    let mut out = Vec::with_capacity(len + 8);
    while out.len() < len {
        let v = next();
        let v = if v % 11 < flat { 7 } else { v / 11 };
        match t {
            SampleType::F32 if v % 13 == 0 => out.extend((-0.0f32).to_ne_bytes()),
            SampleType::F32 if v % 13 == 1 => out.extend((((v % 4000) as f32 - 2000.0) * 1e35).to_ne_bytes()),
            SampleType::F32 => out.extend(((v % 4000) as f32 * 0.37 - 300.0).to_ne_bytes()),
            _ => out.extend((v as u16).to_ne_bytes()),
        }
    }
    out
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test] // spec: S3D-20, S3D-21
    fn fast_and_plain_bytes_are_equal(
        t in prop::sample::select(vec![SampleType::U8, SampleType::U16, SampleType::I16, SampleType::F32]),
        i_bits in prop::sample::select(vec![1u8, 2, 4, 8]), fitted in any::<bool>(),
        block in [1u32..20, 1u32..9, 1u32..9], wide in prop::sample::select(vec![1u32, 4, 8, 16, 128]), narrow in any::<bool>(),
        e in [1u32..70, 1u32..12, 1u32..12],
        offset in 0usize..9, extra in [0usize..9, 0usize..9], seed in any::<u64>(), flat in 0u64..12,
    ) {
        let block = if narrow { block } else { [wide; 3] };
        let endpoints = if fitted { Endpoints::Fitted } else { Endpoints::MinMax };
        let codec = Codec::S3dc(Params::new(i_bits, Extent::from(block), endpoints).unwrap());
        let extent = Extent::from(e);
        // Pitches and offsets that are a multiple of 4 keep floats finite; alignment is broken by one leading byte.
        let (offset, lead) = (offset / 4 * 4, offset % 2);
        let row_pitch = e[0] as usize * t.bytes() + extra[0] * 4;
        let row_pitch = row_pitch.next_multiple_of(4);
        let slice_pitch = row_pitch * e[1] as usize + extra[1] * 4;
        let mut bytes = vec![0; lead];
        bytes.extend(noise(t, offset + slice_pitch * e[2] as usize, seed, flat));
        let view = View { bytes: &bytes[lead + offset..], extent, sample_type: t, row_pitch, slice_pitch };
        let (mut fast, mut plain) = (vec![1, 2, 3], vec![1, 2, 3]);
        codec.encode(view, &mut fast).unwrap();
        codec.encode_plain(view, &mut plain).unwrap();
        prop_assert!(fast == plain, "fast and plain bytes differ");
        codec.check(&fast[3..], t, extent, 0).unwrap();
    }
}

#[test] // K-13; spec: S3D-13
fn non_finite_samples_are_refused_wherever_they_are() {
    for extent in [Extent::new(1, 1, 1), Extent::new(67, 5, 3)] {
        for endpoints in [Endpoints::MinMax, Endpoints::Fitted] {
            let codec = Codec::S3dc(Params::new(4, Extent::cube(4), endpoints).unwrap());
            for bad in [f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
                for at in [0, extent.voxels() as usize / 2, extent.voxels() as usize - 1] {
                    let mut samples = vec![1.5f32; extent.voxels() as usize];
                    samples[at] = bad;
                    let mut out = vec![9];
                    let view = View::dense(bytemuck::cast_slice(&samples), extent, SampleType::F32);
                    let code = codec.encode(view, &mut out).unwrap_err().code();
                    assert_eq!((code, out), (vug::error::Code::NonFinite, vec![9]));
                }
            }
        }
    }
}
