//! Hard cases of the s3dc codec: small bricks whose bytes and samples are known.

mod s3dc_support;

use s3dc_support::{codec, decode, encode, line, params, round_trip};
use vug::codec::Codec;
use vug::codec::s3dc::{Endpoints, Layout, Params, Scalar, integer_error_bound};
use vug::error::Code;
use vug::geometry::{Extent, Region};
use vug::grid::{Grid, View};
use vug::voxel::{SampleType, SampleValue};

#[test] // K-01; spec: S3D-12, S3D-16, S3D-20
fn constant_blocks_are_exact_and_their_indices_zero() {
    let e = Extent::new(9, 5, 6);
    let n = e.voxels() as usize;
    for i in [1, 2, 4, 8] {
        assert_eq!(round_trip(i, [4, 4, 4], e, &vec![7u8; n]), vec![7; n]);
        assert_eq!(round_trip(i, [4, 4, 4], e, &vec![65_535u16; n]), vec![65_535; n]);
        assert_eq!(round_trip(i, [4, 4, 4], e, &vec![-32_768i16; n]), vec![-32_768; n]);
        // The constant π: other libraries divide by max − min here.
        assert_eq!(round_trip(i, [4, 4, 4], e, &vec![std::f32::consts::PI; n]), vec![std::f32::consts::PI; n]);
        let bytes = encode(&codec(i, [4, 4, 4]), e, &vec![std::f32::consts::PI; n]);
        let iv = Layout::new(&params(i, [4, 4, 4]), SampleType::F32, e).iv_start();
        assert!(bytes[iv..].iter().all(|&b| b == 0));
    }
}

#[test] // K-02; spec: S3D-12, S3D-16
fn constant_block_with_indices_decodes_to_min_and_is_rejected_by_the_strict_check() {
    let e = Extent::cube(4);
    let c = codec(4, [4, 4, 4]);
    let mut bytes = encode(&c, e, &[9.5f32; 64]);
    bytes[256 + 7] = 0x50;
    assert_eq!(decode::<f32>(&c, e, &bytes), vec![9.5; 64]);
    let error = c.check(&bytes, SampleType::F32, e, 1000).unwrap_err();
    assert_eq!((error.code(), error.offset(), error.field()), (Code::Canon, Some(1256 + 6), "s3dc.iv"));
}

#[test] // K-03, V3
fn eight_bit_samples_with_eight_bit_indices_are_lossless() {
    let all: Vec<u8> = (0..=255).collect();
    assert_eq!(round_trip(8, [8, 8, 4], Extent::new(8, 8, 4), &all), all);
}

#[test] // K-04, V3; spec: S3D-10, S3D-20
fn a_range_of_at_most_q_is_lossless() {
    for q in [1u32, 3, 15, 255] {
        for r in 0..=q {
            for min in [0u16, 1, 77, (65_535 - r) as u16] {
                let max = min + r as u16;
                for v in min..=max {
                    assert_eq!(u16::reconstruct(min, max, v.index(min, max, q), q), v);
                }
                if let (Ok(lo), Ok(hi)) = (u8::try_from(min), u8::try_from(max)) {
                    for v in lo..=hi {
                        assert_eq!(u8::reconstruct(lo, hi, v.index(lo, hi, q), q), v);
                    }
                }
            }
        }
    }
}

#[test] // K-05, K-06, V4; spec: S3D-10
fn full_range_sixteen_bit_blocks_do_not_wrap() {
    let u: Vec<u16> = (0..=65_535).collect();
    let worst = |a: &[i64], b: &[i64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).max().unwrap();
    for (i, expected) in [(1u8, 32_767), (2, 10_922), (4, 2184), (8, 128)] {
        let back = round_trip(i, [64, 64, 16], Extent::new(64, 64, 16), &u);
        let wide = |s: &[u16]| s.iter().map(|&v| i64::from(v)).collect::<Vec<_>>();
        assert_eq!(worst(&wide(&u), &wide(&back)), expected); // V2
        let s: Vec<i16> = u.iter().map(|&v| (i32::from(v) - 32_768) as i16).collect();
        let signed = round_trip(i, [64, 64, 16], Extent::new(64, 64, 16), &s);
        // The signed volume decodes to the unsigned one, shifted.
        assert!(back.iter().zip(&signed).all(|(&u, &s)| i32::from(u) - 32_768 == i32::from(s)));
        assert_eq!((signed[0], signed[65_535]), (-32_768, 32_767));
    }
    let (r, q) = (65_535u32, 255u32);
    assert!(2 * r * q + r <= 33_488_385 && 2 * r * q + q <= 33_423_105 && r * q < 1 << 24);
}

#[test] // K-07; spec: S3D-20
fn ties_round_up() {
    assert_eq!(line(1, &[0u8, 5, 10]), [0, 10, 10]);
    assert_eq!(line(1, &[0u8, 4, 10]), [0, 0, 10]);
    assert_eq!(line(1, &[-5i16, 0, 5]), [-5, 5, 5]);
    assert_eq!(line(1, &[0f32, 5.0, 10.0]), [0.0, 10.0, 10.0]);
    assert_eq!(50u8.index(0, 100, 1), 1);
    assert_eq!(49u8.index(0, 100, 1), 0);
    // Decoded values: R·idx/q halfway between two integers goes up. R = 5, q = 2 does not exist; odd q never ties.
}

#[test] // K-08; spec: S3D-20, S3D-21
fn the_maximum_has_index_q_and_the_minimum_index_0() {
    for q in [1, 3, 15, 255] {
        for (lo, hi) in [(0.1f32, 0.3), (1e-31, 3e-31), (-3e38, 3e38), (16_777_216.0, 16_777_218.0), (-0.7, 1e30)] {
            assert_eq!((lo.index(lo, hi, q), hi.index(lo, hi, q)), (0, q));
            assert_eq!((f32::reconstruct(lo, hi, 0, q), f32::reconstruct(lo, hi, q, q)), (lo, hi));
        }
        for (lo, hi) in [(0u8, 255), (3, 4), (254, 255)] {
            assert_eq!((lo.index(lo, hi, q), hi.index(lo, hi, q)), (0, q));
            assert_eq!((u8::reconstruct(lo, hi, 0, q), u8::reconstruct(lo, hi, q, q)), (lo, hi));
        }
    }
}

#[test] // K-09; spec: S3D-11
fn floats_whose_range_overflows_f32() {
    let samples: Vec<f32> = (0..64).map(|k| (-3e38 + 6e38 * f64::from(k) / 63.0) as f32).collect();
    for i in [1, 2, 4, 8] {
        let back = round_trip(i, [4, 4, 4], Extent::cube(4), &samples);
        assert!(back.iter().all(|v| v.is_finite()));
        assert!(back.windows(2).all(|w| w[0] <= w[1]), "not monotone");
        assert_eq!((back[0], back[63]), (samples[0], samples[63]));
        let q = params(i, [4, 4, 4]).q();
        let bound = f32::error_bound(samples[0], samples[63], q);
        assert!(samples.iter().zip(&back).all(|(a, b)| (f64::from(*a) - f64::from(*b)).abs() <= bound));
    }
}

#[test] // K-10
fn neighbouring_floats_decode_to_themselves() {
    let next = f32::from_bits(1f32.to_bits() + 1);
    assert_eq!(line(4, &[1.0, next, 1.0, next]), [1.0, next, 1.0, next]);
    for idx in 0..=15 {
        let v = f32::reconstruct(1.0, next, idx, 15);
        assert!(v == 1.0 || v == next);
    }
}

#[test] // K-11; spec: S3D-11
fn subnormal_and_tiny_floats_are_exact() {
    let (lo, hi) = (f32::from_bits(1), 1e-40f32);
    assert_eq!(line(4, &[lo, hi, lo]), [lo, hi, lo]);
    let steps: Vec<f32> = (1..=16).map(f32::from_bits).collect();
    assert_eq!(line(4, &steps), steps);
    // Normal numbers around 1e-31, where zfp loses even the sign.
    let tiny: Vec<f32> = (0..16).map(|k| (k as f32 - 7.5) * 1e-31).collect();
    let back = line(4, &tiny);
    assert!(tiny.iter().zip(&back).all(|(a, b)| (a - b).abs() <= 1e-31 * 0.5 && a.signum() == b.signum()));
}

#[test] // K-12; spec: S3D-13
fn negative_zero_is_stored_as_positive_zero() {
    let e = Extent::new(2, 1, 1);
    let c = codec(4, [2, 1, 1]);
    let bytes = encode(&c, e, &[-0.0f32, 0.0]);
    assert!(bytes.iter().all(|&b| b == 0));
    assert!(decode::<f32>(&c, e, &bytes).iter().all(|v| v.to_bits() == 0));
    // A file that stores it all the same: decoded as +0.0, rejected by the strict check.
    for (at, max) in [(3, [0u8, 0, 0x80, 0x3f]), (7, [0; 4])] {
        let mut bytes = bytes.clone();
        bytes[4..8].copy_from_slice(&max);
        bytes[at] = 0x80;
        assert!(decode::<f32>(&c, e, &bytes).iter().all(|v| v.to_bits() == 0));
        assert_eq!(c.check(&bytes, SampleType::F32, e, 0).unwrap_err().code(), Code::Canon);
    }
}

#[test] // K-13; spec: S3D-14
fn samples_that_are_not_finite_are_refused() {
    for bad in [f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for at in [0, 1, 37, 63] {
            let mut samples = [1.0f32; 64];
            samples[at] = bad;
            let grid = Grid::from_samples(Extent::cube(4), &samples).unwrap();
            for c in [codec(4, [4, 4, 4]), codec(4, [3, 3, 3]), Codec::Raw] {
                let mut out = vec![1, 2, 3];
                assert_eq!(c.encode(grid.view(), &mut out).unwrap_err().code(), Code::NonFinite);
                assert_eq!(out, [1, 2, 3]);
            }
            let place = vug::codec::first_non_finite(&grid.view()).unwrap();
            assert_eq!(Extent::cube(4).index(place), at as u64);
        }
    }
}

#[test] // K-14; spec: S3D-12, S3D-15
fn end_points_out_of_order_decode_to_min() {
    let e = Extent::new(40, 5, 3);
    let c = codec(4, [4, 4, 4]);
    for t in [SampleType::U8, SampleType::U16, SampleType::I16, SampleType::F32] {
        let n = e.voxels() as usize;
        let mut grid = Grid::zeros(e, t).unwrap();
        for (k, b) in grid.bytes_mut().iter_mut().enumerate() {
            *b = (k * 37 % 100) as u8;
        }
        let mut bytes = Vec::new();
        c.encode(grid.view(), &mut bytes).unwrap();
        let s = t.bytes();
        let (mut min, mut max) = (vec![0; s], vec![0; s]);
        (min[s - 1], max[s - 1]) = (0x41, 0x40);
        bytes[..s].copy_from_slice(&min);
        bytes[s..2 * s].copy_from_slice(&max);
        let mut back = Grid::zeros(e, t).unwrap();
        c.decode(&bytes, e, &Region::whole(e), back.view_mut()).unwrap();
        assert_eq!(&back.bytes()[..s], &min[..], "{t} of {n}");
        let error = c.check(&bytes, t, e, 64).unwrap_err();
        assert_eq!((error.code(), error.offset(), error.field()), (Code::MinmaxOrder, Some(64), "s3dc.mmv"));
    }
}

#[test] // K-15; spec: S3D-12, S3D-14
fn end_points_that_are_not_finite_decode_to_min_and_are_rejected() {
    let e = Extent::new(20, 4, 4);
    let c = codec(4, [4, 4, 4]);
    let good = encode(&c, e, &(0..320).map(|k| k as f32).collect::<Vec<_>>());
    for (lo, hi) in [
        (f32::NAN, 1.0),
        (1.0, f32::NAN),
        (f32::NEG_INFINITY, 1.0),
        (0.0, f32::INFINITY),
        (-f32::INFINITY, f32::INFINITY),
    ] {
        let mut bytes = good.clone();
        bytes[8..12].copy_from_slice(&lo.to_le_bytes());
        bytes[12..16].copy_from_slice(&hi.to_le_bytes());
        let back = decode::<f32>(&c, e, &bytes);
        assert!((4..8).all(|x| back[x].to_bits() == lo.to_bits()));
        let error = c.check(&bytes, SampleType::F32, e, 0).unwrap_err();
        assert_eq!((error.code(), error.offset()), (Code::NonFinite, Some(8)));
    }
}

#[test] // K-16; spec: S3D-5, S3D-7, S3D-9
fn partial_blocks_use_their_own_samples_only_and_spare_bits_are_zero() {
    for i in [1, 2, 4, 8] {
        for e in [[1, 1, 1], [3, 2, 1], [5, 5, 5], [17, 3, 9], [7, 1, 130]].map(Extent::from) {
            for block in [[4, 4, 4], [8, 8, 8], [16, 2, 128]] {
                // Large values everywhere: a block that saw a voxel outside would have min 0.
                let samples: Vec<u8> = (0..e.voxels()).map(|k| 200 + (k * 7 % 50) as u8).collect();
                let c = codec(i, block);
                let bytes = encode(&c, e, &samples);
                let l = Layout::new(&params(i, block), SampleType::U8, e);
                assert_eq!(l.blocks_overlapping::<u8>(&bytes, 0.0, 199.0, |_, _, _| ()), 0);
                let q = l.params().q();
                for (a, b) in samples.iter().zip(decode::<u8>(&c, e, &bytes)) {
                    assert!(a.abs_diff(b) <= integer_error_bound(49, q) as u8);
                }
                let used = e.x % l.indices_per_word() * u32::from(i);
                if used != 0 {
                    let mut bad = bytes.clone();
                    *bad.last_mut().unwrap() |= 0x80;
                    assert_eq!(decode::<u8>(&c, e, &bad), decode::<u8>(&c, e, &bytes));
                    let error = c.check(&bad, SampleType::U8, e, 0).unwrap_err();
                    assert_eq!(error.code(), Code::Padding);
                    assert_eq!(error.offset(), Some(bytes.len() as u64 - 2));
                }
            }
        }
    }
}

#[test] // spec: S3D-8
fn the_padding_before_the_indices_is_zero() {
    let e = Extent::cube(8);
    let c = codec(2, [4, 4, 4]);
    let mut bytes = encode(&c, e, &(0..512).map(|k| k as u16).collect::<Vec<_>>());
    assert_eq!(bytes.len(), 256 + 8 * 8 * 2);
    bytes[200] = 1;
    let error = c.check(&bytes, SampleType::U16, e, 4096).unwrap_err();
    assert_eq!((error.code(), error.offset(), error.field()), (Code::Padding, Some(4296), "s3dc.padding"));
}

#[test] // K-17; spec: S3D-4
fn unusual_blocks() {
    let e = Extent::new(6, 5, 9);
    let samples: Vec<i16> = (0..e.voxels() as i32).map(|k| (k * 7919 % 65_536 - 32_768) as i16).collect();
    // One voxel per block: lossless, larger than raw, and says so.
    assert_eq!(round_trip(1, [1, 1, 1], e, &samples), samples);
    assert!(vug::codec::s3dc::formula_ratio(e, 16, &params(1, [1, 1, 1])) < 1.0);
    for block in [[1, 1, 7], [128, 128, 128], [4, 8, 2], [5, 3, 7]] {
        let back = round_trip(8, block, e, &samples);
        let bound = integer_error_bound(65_535, 255);
        assert!(samples.iter().zip(back).all(|(a, b)| u32::from(a.abs_diff(b)) <= bound));
    }
}

#[test] // K-18
fn thin_volumes() {
    for e in [[1, 1, 1], [1, 37, 1], [37, 1, 1], [1, 1, 37]].map(Extent::from) {
        let samples: Vec<u8> = (0..e.voxels()).map(|k| (k * 5) as u8).collect();
        for i in [1, 2, 4, 8] {
            let back = round_trip(i, [4, 4, 4], e, &samples);
            let bound = integer_error_bound(15, params(i, [4, 4, 4]).q());
            assert!(samples.iter().zip(back).all(|(a, b)| u32::from(a.abs_diff(b)) <= bound));
        }
    }
}

#[test] // K-19; spec: S3D-9
fn a_word_that_covers_eight_blocks() {
    let samples: Vec<u8> = (0..64u8).map(|x| x / 2 * 8 + x % 2 * 3).collect();
    let e = Extent::new(64, 1, 1);
    let c = codec(1, [2, 2, 2]);
    let bytes = encode(&c, e, &samples);
    assert_eq!(decode::<u8>(&c, e, &bytes), samples);
    let l = Layout::new(&params(1, [2, 2, 2]), SampleType::U8, e);
    assert_eq!(u16::from_le_bytes([bytes[l.iv_start()], bytes[l.iv_start() + 1]]), 0xAAAA);
}

#[test] // K-24; spec: S3D-22
fn no_sample_is_off_by_more_than_its_block_allows() {
    let e = Extent::new(23, 18, 11);
    let samples: Vec<u16> = (0..e.voxels()).map(|k| (k.wrapping_mul(2_654_435_761) >> 8) as u16 >> (k % 9)).collect();
    for i in [1, 2, 4, 8] {
        for block in [[2, 2, 2], [4, 4, 4], [8, 8, 8], [16, 16, 16], [5, 3, 7], [128, 128, 128]] {
            let c = codec(i, block);
            let bytes = encode(&c, e, &samples);
            let back = decode::<u16>(&c, e, &bytes);
            let l = Layout::new(&params(i, block), SampleType::U16, e);
            for z in 0..e.z {
                for y in 0..e.y {
                    for x in 0..e.x {
                        let at = e.index([x, y, z]) as usize;
                        let (min, max) = l.mmv_pair::<u16>(&bytes, l.block_of([x, y, z]));
                        let bound = u16::error_bound(min, max, l.params().q());
                        assert!(f64::from(samples[at].abs_diff(back[at])) <= bound);
                        assert_eq!(l.voxel::<u16>(&bytes, [x, y, z]), back[at]);
                    }
                }
            }
        }
    }
}

#[test] // K-25: one outlier costs its whole block half a step of the outlier, and no other block anything
fn an_outlier_of_1e30_spoils_its_own_block_only() {
    let e = Extent::cube(8);
    let mut samples: Vec<f32> = (0..512).map(|k| k as f32 / 512.0).collect();
    samples[0] = 1e30;
    let back = round_trip(4, [4, 4, 4], e, &samples);
    for (at, (a, b)) in samples.iter().zip(&back).enumerate() {
        let in_block = at % 8 < 4 && at / 8 % 8 < 4 && at / 64 < 4;
        let error = (f64::from(*a) - f64::from(*b)).abs();
        assert!(error <= if in_block { 1e30 / 30.0 * (1.0 + 1e-6) } else { 0.5 / 15.0 }, "{at}: {error}");
    }
    assert_eq!(back[0], 1e30);
}

#[test] // K-26
fn two_levels_at_one_bit_are_exact() {
    let samples: Vec<f32> = (0..64).map(|k| if k % 3 == 0 { -1.25 } else { 1e-3 }).collect();
    assert_eq!(round_trip(1, [4, 4, 4], Extent::cube(4), &samples), samples);
}

#[test] // K-27, S-37
fn rejection_by_end_points_is_closed_at_both_ends() {
    let e = Extent::new(8, 4, 4);
    let samples: Vec<u8> = (0..128).map(|k| if k % 8 < 4 { 10 + k as u8 % 3 } else { 100 + k as u8 % 4 }).collect();
    let c = codec(4, [4, 4, 4]);
    let bytes = encode(&c, e, &samples);
    let l = Layout::new(&params(4, [4, 4, 4]), SampleType::U8, e);
    let found = |lo: u8, hi: u8| {
        let mut v = Vec::new();
        l.blocks_overlapping::<u8>(&bytes, f64::from(lo), f64::from(hi), |b, _, _| v.push(b[0]));
        v
    };
    assert_eq!(found(0, 9), [0u32; 0]);
    assert_eq!(found(0, 10), [0]);
    assert_eq!(found(12, 99), [0]);
    assert_eq!(found(13, 99), [0u32; 0]);
    assert_eq!(found(13, 100), [1]);
    assert_eq!(found(103, 255), [1]);
    assert_eq!(found(104, 255), [0u32; 0]);
    assert_eq!(found(0, 255), [0, 1]);
}

#[test] // spec: S3D-5, RAW-4
fn a_wrong_length_or_region_is_an_error() {
    let e = Extent::new(10, 4, 4);
    for c in [codec(4, [4, 4, 4]), Codec::Raw] {
        let bytes = encode(&c, e, &[3u16; 160]);
        let mut grid = Grid::zeros(e, SampleType::U16).unwrap();
        for wrong in [&bytes[..bytes.len() - 1], &[], &[bytes.clone(), vec![0]].concat()] {
            for result in [
                c.decode(wrong, e, &Region::whole(e), grid.view_mut()),
                c.decode_plain(wrong, e, &Region::whole(e), grid.view_mut()),
                c.check(wrong, SampleType::U16, e, 9),
                c.voxel(wrong, SampleType::U16, e, [0; 3]).map(|_| ()),
            ] {
                assert_eq!(result.unwrap_err().code(), Code::Size);
            }
        }
        let outside = Region::at([1, 0, 0], e);
        assert_eq!(c.decode(&bytes, e, &outside, grid.view_mut()).unwrap_err().code(), Code::Range);
        let part = Region::at([1, 0, 0], Extent::new(4, 4, 4));
        assert_eq!(c.decode(&bytes, e, &part, grid.view_mut()).unwrap_err().code(), Code::Param);
        assert_eq!(c.voxel(&bytes, SampleType::U16, e, [10, 0, 0]).unwrap_err().code(), Code::Range);
        assert_eq!(c.voxel(&bytes, SampleType::U16, e, [9, 3, 3]).unwrap(), SampleValue::U16(3));
        let mut short = vec![0u8; 319];
        let view = View { bytes: &short, extent: e, sample_type: SampleType::U16, row_pitch: 20, slice_pitch: 80 };
        assert_eq!(c.encode(view, &mut Vec::new()).unwrap_err().code(), Code::Param);
        let view = vug::grid::ViewMut {
            bytes: &mut short,
            extent: e,
            sample_type: SampleType::U16,
            row_pitch: 20,
            slice_pitch: 80,
        };
        assert_eq!(c.decode(&bytes, e, &Region::whole(e), view).unwrap_err().code(), Code::Param);
    }
}

#[test] // spec: S3D-1, S3D-2, S3D-3, S3D-4, S3D-6, RAW-1, RAW-2
fn parameters_survive_the_wire_and_bad_ones_are_named() {
    for i in [1, 2, 4, 8] {
        for block in [[1, 1, 1], [4, 4, 4], [5, 3, 7], [128, 1, 128]] {
            for endpoints in [Endpoints::MinMax, Endpoints::Fitted] {
                let c = Codec::S3dc(Params::new(i, block.into(), endpoints).unwrap());
                let (id, version, bytes) = c.to_wire();
                assert_eq!((id, version), (2, 1));
                assert_eq!(Codec::from_wire(id, version, &bytes, vug::voxel::SampleValue::U8(0)).unwrap(), c);
            }
        }
    }
    assert_eq!(Codec::from_wire(1, 1, &[0; 28], vug::voxel::SampleValue::U8(0)).unwrap(), Codec::Raw);
    assert_eq!(Codec::Raw.to_wire(), (1, 1, [0; 28]));
    let good = codec(4, [4, 4, 4]).to_wire().2;
    let with = |at: usize, v: u8| {
        let mut b = good;
        b[at] = v;
        Codec::from_wire(2, 1, &b, vug::voxel::SampleValue::U8(0)).unwrap_err().code()
    };
    for i in [0, 3, 5, 6, 7, 9, 16, 255] {
        assert_eq!(with(0, i), Code::Param);
    }
    assert_eq!([with(1, 1), with(2, 2), with(4, 0), with(5, 129), with(6, 255)], [Code::Param; 5]);
    assert_eq!([with(3, 1), with(7, 1), with(27, 0x80)], [Code::Reserved; 3]);
    let code = |id, version, b| Codec::from_wire(id, version, b, vug::voxel::SampleValue::U8(0)).unwrap_err().code();
    assert_eq!([code(0, 1, &good), code(4, 1, &good), code(2, 2, &good), code(2, 0, &good)], [Code::Codec; 4]);
    assert_eq!([code(1, 2, &[0; 28]), code(65_535, 65_535, &[0; 28])], [Code::Codec; 2]);
    assert_eq!(code(1, 1, &good), Code::Reserved);
    assert_eq!(codec(4, [4, 4, 4]).supports(SampleType::Rgb8).unwrap_err().code(), Code::Param);
    assert_eq!(Params::new(4, Extent::new(0, 4, 4), Endpoints::MinMax).unwrap_err().field(), "bx");
    assert_eq!(Params::new(4, Extent::new(4, 4, 300), Endpoints::MinMax).unwrap_err().field(), "bz");
}

#[test] // RAW codec; spec: RAW-3, RAW-5
fn raw_is_lossless_for_every_type() {
    let e = Extent::new(5, 3, 2);
    let floats: Vec<f32> = (0..30).map(|k| if k == 3 { -0.0 } else { k as f32 * -1e-3 }).collect();
    let bytes = encode(&Codec::Raw, e, &floats);
    assert_eq!(bytes[12..16], (-0.0f32).to_le_bytes()); // bit-exact, the sign of zero included
    assert_eq!(decode::<f32>(&Codec::Raw, e, &bytes), floats);
    let colours: Vec<[u8; 3]> = (0..30u8).map(|k| [k, 255 - k, 7]).collect();
    let bytes = encode(&Codec::Raw, e, &colours);
    assert_eq!(bytes.len(), 90);
    assert_eq!(decode::<[u8; 3]>(&Codec::Raw, e, &bytes), colours);
    assert_eq!(Codec::Raw.voxel(&bytes, SampleType::Rgb8, e, [1, 0, 0]).unwrap(), SampleValue::Rgb8([1, 254, 7]));
    let words: Vec<i16> = (0..30).map(|k| k * 1000 - 15_000).collect();
    let bytes = encode(&Codec::Raw, e, &words);
    assert_eq!(bytes[..2], (-15_000i16).to_le_bytes());
    let part = Region { start: [1, 1, 0], end: [4, 3, 2] };
    let mut grid = Grid::zeros(part.extent(), SampleType::I16).unwrap();
    Codec::Raw.decode(&bytes, e, &part, grid.view_mut()).unwrap();
    assert_eq!(grid.samples::<i16>()[..4], [words[6], words[7], words[8], words[11]]);
    let mut bad = encode(&Codec::Raw, e, &floats);
    bad[23] = 0xff;
    bad[22] = 0xc0;
    let error = Codec::Raw.check(&bad, SampleType::F32, e, 100).unwrap_err();
    assert_eq!((error.code(), error.offset()), (Code::NonFinite, Some(120)));
}
