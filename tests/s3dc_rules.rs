//! The worked examples of spec chapters 7 and 8, byte by byte, and rules of theirs that no other test holds.

mod s3dc_support;

use s3dc_support::{codec, decode, encode, line, params};
use vug::codec::Codec;
use vug::codec::s3dc::{Layout, Scalar, formula_ratio};
use vug::error::Code;
use vug::geometry::Extent;
use vug::voxel::SampleType;

#[test] // spec 7.1; spec: RAW-3, RAW-6
fn worked_example_of_raw() {
    let e = Extent::new(3, 2, 1);
    let samples = [1i16, -2, 256, 0, -32_768, 32_767];
    let bytes = encode(&Codec::Raw, e, &samples);
    assert_eq!(bytes, [1, 0, 0xFE, 0xFF, 0, 1, 0, 0, 0, 0x80, 0xFF, 0x7F]);
    assert_eq!(decode::<i16>(&Codec::Raw, e, &bytes), samples);
    // Every bit of a float survives, the sign of zero included.
    let floats = [-0.0f32, 0.0, f32::from_bits(1), f32::MAX, f32::MIN_POSITIVE, -1.5];
    let back = decode::<f32>(&Codec::Raw, e, &encode(&Codec::Raw, e, &floats));
    assert_eq!(back.map_bits(), floats.to_vec().map_bits());
}

trait Bits {
    fn map_bits(&self) -> Vec<u32>;
}

impl Bits for Vec<f32> {
    fn map_bits(&self) -> Vec<u32> {
        self.iter().map(|v| v.to_bits()).collect()
    }
}

const EXTENT: Extent = Extent::new(5, 2, 1);
const SAMPLES: [u8; 10] = [10, 20, 30, 40, 50, 10, 13, 25, 40, 90];

#[test] // spec 8.8; spec: S3D-5, S3D-7, S3D-8, S3D-9, S3D-10, S3D-17, S3D-18, S3D-20
fn worked_example_of_s3dc() {
    let c = codec(4, [4, 4, 4]);
    let mut entry = [0; 28];
    entry[..7].copy_from_slice(&[4, 0, 0, 0, 4, 4, 4]);
    assert_eq!(c.to_wire(), (2, 1, entry));
    let mut expected = vec![0; 264];
    expected[..4].copy_from_slice(&[0x0A, 0x28, 0x32, 0x5A]);
    expected[256..].copy_from_slice(&[0x50, 0xFA, 0, 0, 0x20, 0xF8, 0x0F, 0]);
    let bytes = encode(&c, EXTENT, &SAMPLES);
    assert_eq!(bytes, expected);
    assert_eq!(decode::<u8>(&c, EXTENT, &bytes), [10, 20, 30, 40, 50, 10, 14, 26, 40, 90]);
}

#[test] // spec 8.8; spec: S3D-10, S3D-11, S3D-12
fn single_samples_of_the_chapter() {
    assert_eq!(u8::reconstruct(0, 255, 7, 15), 119);
    assert_eq!(u8::reconstruct(0, 5, 1, 3), 2);
    assert_eq!(u16::reconstruct(0, 65_535, 128, 255), 32_896);
    assert_eq!(i16::reconstruct(-32_768, 32_767, 1, 3), -10_923);
    assert_eq!(i16::reconstruct(-5, 5, 7, 15), 0);
    assert_eq!(u8::reconstruct(9, 3, 7, 15), 9);
    let bits = |lo, hi, idx, q| format!("{:#010X}", f32::reconstruct(lo, hi, idx, q).to_bits());
    assert_eq!(bits(-1.0, 2.0, 1, 3), "0xA5000000"); // −2^-53: every operation is rounded by itself
    assert_eq!(f32::reconstruct(1.0, f32::INFINITY, 7, 15), 1.0);
    assert_eq!([bits(0.1, 0.3, 7, 15), bits(-3e38, 3e38, 7, 15)], ["0x3E460A42", "0xFD70B1F3"]);
}

#[test] // spec: S3D-17, S3D-18
fn pairs_are_the_extremes_of_their_block_in_block_order() {
    // 2×2×2 blocks of 2³, the second partial along each axis.
    let e = Extent::cube(3);
    let samples: Vec<i16> = (0..27).map(|k| (k * 11 % 27) * 1000 - 13_000).collect();
    let bytes = encode(&codec(2, [2, 2, 2]), e, &samples);
    let mut expected = Vec::new();
    for block in 0..8 {
        let at = [block & 1, block >> 1 & 1, block >> 2].map(|b| 2 * b);
        let inside = |k: usize| [k % 3, k / 3 % 3, k / 9].iter().zip(at).all(|(&c, from)| c >= from && c < from + 2);
        let own = || (0..27).filter(|&k| inside(k)).map(|k| samples[k]);
        expected.extend(own().min().unwrap().to_le_bytes());
        expected.extend(own().max().unwrap().to_le_bytes());
    }
    assert_eq!(bytes[..32], expected);
}

#[test] // spec: S3D-19
fn strict_errors_come_in_the_order_of_the_chapter() {
    // Two blocks along x, the second constant; 12 spare bits at the end of each row.
    let e = Extent::new(5, 1, 1);
    let c = codec(4, [4, 4, 4]);
    let put = |bytes: &mut Vec<u8>, at: usize, v: f32| bytes[at..at + 4].copy_from_slice(&v.to_le_bytes());
    let mut bytes = encode(&c, e, &[1.0f32, 2.0, 3.0, 4.0, 5.0]);
    bytes[258] = 0x10; // spare bit
    let mut seen = Vec::new();
    let mut see = |bytes: &[u8]| {
        let error = c.check(bytes, SampleType::F32, e, 0).unwrap_err();
        seen.push((error.code(), error.offset()));
    };
    see(&bytes);
    bytes[258] |= 1; // index of the constant block
    see(&bytes);
    put(&mut bytes, 0, -0.0); // first block: −0.0, then order, then finite
    see(&bytes);
    put(&mut bytes, 4, -1.0);
    see(&bytes);
    put(&mut bytes, 4, f32::NAN);
    see(&bytes);
    bytes[100] = 1; // padding
    see(&bytes);
    see(&bytes[1..]); // length
    let expected = [
        (Code::Padding, Some(258)),
        (Code::Canon, Some(258)),
        (Code::Canon, Some(0)),
        (Code::MinmaxOrder, Some(0)),
        (Code::NonFinite, Some(0)),
        (Code::Padding, Some(100)),
        (Code::Size, Some(0)),
    ];
    assert_eq!(seen, expected);
}

#[test] // spec: S3D-13, S3D-14
fn zeros_of_both_signs_give_the_same_bytes_and_nan_in_any_place_is_refused() {
    let c = codec(2, [4, 1, 1]);
    let e = Extent::new(4, 1, 1);
    assert_eq!(encode(&c, e, &[0.0f32, -0.0, 1.0, -0.0]), encode(&c, e, &[-0.0f32, 0.0, 1.0, 0.0]));
    assert_eq!(line(2, &[-1.0f32, -0.0, 2.0]).map_bits()[0], (-1.0f32).to_bits());
}

#[test] // spec: S3D-5, S3D-25
fn stored_length_and_formula_ratio() {
    // 64³ of u16 in blocks of 4³ at 4 bits: 16³ pairs of 4 bytes, then half a byte per voxel.
    let (p, e) = (params(4, [4, 4, 4]), Extent::cube(64));
    let layout = Layout::new(&p, SampleType::U16, e);
    assert_eq!((layout.iv_start(), layout.payload_len()), (16_384, 16_384 + 131_072));
    let stored = 524_288.0 / layout.payload_len() as f64;
    assert!((formula_ratio(e, 16, &p) - stored).abs() < 1e-12);
}
