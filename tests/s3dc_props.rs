//! Properties of the codecs over random shapes, parameters, samples and payloads: fast equals plain, a voxel equals its
//! place in the brick, and no payload of the right length makes a decoder panic.

mod s3dc_support;

use proptest::prelude::*;
use s3dc_support::params;
use vug::codec::s3dc::{Isa, Layout, Params, Scalar, decode_on};
use vug::codec::{BrickPart, Codec, Stores};
use vug::geometry::{Extent, Region};
use vug::grid::{View, ViewMut};
use vug::voxel::{SampleType, SampleValue};

const TYPES: [SampleType; 4] = [SampleType::U8, SampleType::U16, SampleType::I16, SampleType::F32];

/// A deterministic stream of bytes (xorshift).
fn noise(mut seed: u64, len: usize) -> Vec<u8> {
    let mut next = || {
        seed = seed.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (seed ^ seed >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        (z ^ z >> 27) as u8
    };
    (0..len).map(|_| next()).collect()
}

/// Samples of a type with small differences between neighbours, as bytes; floats are finite.
fn samples(t: SampleType, n: usize, seed: u64) -> Vec<u8> {
    let noise = noise(seed, n);
    let mut out = Vec::new();
    for (k, b) in noise.iter().enumerate() {
        let wide = i32::from(*b) * (1 + (k / 7 % 5) as i32 * 60) - if t == SampleType::I16 { 32_000 } else { 0 };
        match t {
            SampleType::F32 => out.extend((wide as f32 * 1.7e-3 - 5.0).to_ne_bytes()),
            SampleType::I16 => out.extend((wide.clamp(-32_768, 32_767) as i16).to_ne_bytes()),
            SampleType::U16 => out.extend((wide as u16).to_ne_bytes()),
            _ => out.push(*b),
        }
    }
    out
}

#[derive(Debug, Clone)]
struct Case {
    t: SampleType,
    params: Params,
    brick: Extent,
    region: Region,
    /// Bytes before the destination, and extra bytes per row and slice.
    offset: usize,
    extra: [usize; 2],
    seed: u64,
}

fn edges() -> impl Strategy<Value = u32> {
    prop_oneof![Just(1u32), Just(2), Just(3), Just(4), Just(5), Just(8), Just(12), Just(16), Just(64), 1u32..=128]
}

fn cases() -> impl Strategy<Value = Case> {
    (
        prop::sample::select(TYPES.to_vec()),
        prop::sample::select(vec![1u8, 2, 4, 8]),
        [edges(), edges(), edges()],
        prop_oneof![1u32..40, 60u32..70, 250u32..300],
        [1u32..11, 1u32..9],
        any::<[u32; 6]>(),
        (0usize..70, [0usize..70, 0usize..70], any::<u64>()),
    )
        .prop_map(|(t, i, block, x, [y, z], cut, (offset, extra, seed))| {
            let brick = Extent::new(x, y, z);
            let e = brick.to_array();
            let start: [u32; 3] = std::array::from_fn(|a| if cut[a] % 3 == 0 { 0 } else { cut[a] % e[a] });
            let end = std::array::from_fn(|a| {
                if cut[3 + a] % 3 == 0 { e[a] } else { start[a] + 1 + cut[3 + a] % (e[a] - start[a]) }
            });
            Case { t, params: params(i, block), brick, region: Region { start, end }, offset, extra, seed }
        })
}

/// A destination with pitches, filled with a pattern that shows writes outside the rows.
fn destination(case: &Case) -> (Vec<u8>, usize, usize, usize) {
    let e = case.region.extent();
    let row = e.x as usize * case.t.bytes() + case.extra[0];
    let slice = row * e.y as usize + case.extra[1];
    (vec![0xAB; case.offset + slice * e.z as usize + 64], case.offset, row, slice)
}

fn into(case: &Case, decode: impl FnOnce(ViewMut<'_>)) -> Vec<u8> {
    let (mut bytes, offset, row_pitch, slice_pitch) = destination(case);
    let (extent, sample_type) = (case.region.extent(), case.t);
    decode(ViewMut { bytes: &mut bytes[offset..], extent, sample_type, row_pitch, slice_pitch });
    bytes
}

/// Every path of this machine gives the plain decoder's bytes, and touches no byte outside the rows.
fn all_paths_agree(case: &Case, payload: &[u8]) {
    let codec = Codec::S3dc(case.params);
    let plain = into(case, |dst| codec.decode_plain(payload, case.brick, &case.region, dst).unwrap());
    let part = BrickPart { payload, brick: case.brick, region: case.region };
    for stores in [Stores::Cached, Stores::Streaming] {
        let chosen = into(case, |d| codec.decode_hinted(payload, case.brick, &case.region, d, stores).unwrap());
        assert!(chosen == plain, "the chosen path differs ({stores:?})");
        for &isa in Isa::available() {
            let fast = into(case, |dst| {
                assert!(decode_on(isa, &case.params, &[part], dst, stores).unwrap());
            });
            assert!(fast == plain, "{isa:?} differs ({stores:?})");
        }
    }
}

fn bits(v: SampleValue) -> u32 {
    v.to_raw()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(if cfg!(miri) { 4 } else { 600 }))]

    #[test] // spec: S3D-10, S3D-11
    fn fast_decoders_equal_the_plain_one(case in cases()) {
        let codec = Codec::S3dc(case.params);
        let source = samples(case.t, case.brick.voxels() as usize, case.seed);
        let source = View::dense(&source, case.brick, case.t);
        let (mut payload, mut plain) = (Vec::new(), Vec::new());
        codec.encode(source, &mut payload).unwrap();
        codec.encode_plain(source, &mut plain).unwrap();
        prop_assert!(payload == plain, "fast and plain encoders differ");
        codec.check(&payload, case.t, case.brick, 0).unwrap();
        all_paths_agree(&case, &payload);
    }

    #[test] // K-02, K-14, K-15; spec: S3D-12
    fn hostile_payloads_never_panic_and_decode_alike(case in cases(), zeros in 0u8..4) {
        let codec = Codec::S3dc(case.params);
        let len = (*codec.payload_lens(case.t, case.brick).end()) as usize;
        let mut payload = noise(case.seed, len);
        if zeros > 0 {
            // Also payloads with many equal and zero end points.
            payload.iter_mut().step_by(usize::from(zeros)).for_each(|b| *b = 0);
        }
        all_paths_agree(&case, &payload);
        let _ = codec.check(&payload, case.t, case.brick, 0);
    }

    #[test]
    fn a_voxel_is_its_place_in_the_brick(case in cases()) {
        let codec = Codec::S3dc(case.params);
        let payload = noise(case.seed, (*codec.payload_lens(case.t, case.brick).end()) as usize);
        let region = case.region;
        let bytes = into(&case, |dst| codec.decode(&payload, case.brick, &region, dst).unwrap());
        let (_, offset, row, slice) = destination(&case);
        let layout = Layout::new(&case.params, case.t, case.brick);
        let e = region.extent();
        for c in [[0; 3], [e.x - 1, e.y - 1, e.z - 1], [e.x / 2, e.y / 3, e.z / 2]] {
            let at = offset + c[0] as usize * case.t.bytes() + c[1] as usize * row + c[2] as usize * slice;
            let mut raw = [0; 4];
            raw[..case.t.bytes()].copy_from_slice(&bytes[at..at + case.t.bytes()]);
            let expected = u32::from_ne_bytes(raw);
            let c = std::array::from_fn(|a| c[a] + region.start[a]);
            let point = layout.point(c, 0);
            point.prefetch(&payload);
            prop_assert_eq!(bits(layout.value(&payload, c)), expected);
            prop_assert_eq!(bits(codec.voxel(&payload, case.t, case.brick, c).unwrap()), expected);
        }
    }

    #[test] // K-24; spec: S3D-20, S3D-21, S3D-22
    fn errors_stay_within_the_bound_of_their_block(case in cases()) {
        fn within<T: Scalar>(case: &Case, source: &[u8], payload: &[u8]) {
            let layout = Layout::new(&case.params, case.t, case.brick);
            for z in 0..case.brick.z {
                for y in 0..case.brick.y {
                    for x in 0..case.brick.x {
                        let at = case.brick.index([x, y, z]) as usize * T::BYTES;
                        let v: T = bytemuck::pod_read_unaligned(&source[at..at + T::BYTES]);
                        let (min, max) = layout.mmv_pair::<T>(payload, layout.block_of([x, y, z]));
                        assert!(min <= v && v <= max);
                        let back: T = layout.voxel(payload, [x, y, z]);
                        let error = (back.component(0) - v.component(0)).abs();
                        assert!(error <= T::error_bound(min, max, case.params.q()), "{v:?} became {back:?}");
                    }
                }
            }
        }
        let source = samples(case.t, case.brick.voxels() as usize, case.seed);
        let mut payload = Vec::new();
        Codec::S3dc(case.params).encode(View::dense(&source, case.brick, case.t), &mut payload).unwrap();
        match case.t {
            SampleType::U8 => within::<u8>(&case, &source, &payload),
            SampleType::U16 => within::<u16>(&case, &source, &payload),
            SampleType::I16 => within::<i16>(&case, &source, &payload),
            _ => within::<f32>(&case, &source, &payload),
        }
    }
}
