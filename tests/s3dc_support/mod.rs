//! Helpers of the codec tests.
#![allow(dead_code, reason = "each test binary uses its own part")]

use vug::codec::Codec;
use vug::codec::s3dc::{Endpoints, Params};
use vug::geometry::{Extent, Region};
use vug::grid::Grid;
use vug::voxel::Sample;

/// Parameters with end points at minimum and maximum.
pub fn params(i_bits: u8, block: [u32; 3]) -> Params {
    Params::new(i_bits, block.into(), Endpoints::MinMax).unwrap()
}

/// The codec of [`params`].
pub fn codec(i_bits: u8, block: [u32; 3]) -> Codec {
    Codec::S3dc(params(i_bits, block))
}

/// Encodes a brick, and checks length and strict rules.
pub fn encode<T: Sample>(codec: &Codec, extent: Extent, samples: &[T]) -> Vec<u8> {
    let grid = Grid::from_samples(extent, samples).unwrap();
    let mut out = Vec::new();
    codec.encode(grid.view(), &mut out).unwrap();
    assert_eq!(out.len() as u64, (*codec.payload_lens(T::TYPE, extent).end()));
    codec.check(&out, T::TYPE, extent, 0).unwrap();
    out
}

/// Decodes a brick by both decoders, which must agree to the bit.
pub fn decode<T: Sample>(codec: &Codec, extent: Extent, payload: &[u8]) -> Vec<T> {
    let mut fast = Grid::zeros(extent, T::TYPE).unwrap();
    codec.decode(payload, extent, &Region::whole(extent), fast.view_mut()).unwrap();
    let mut plain = Grid::zeros(extent, T::TYPE).unwrap();
    codec.decode_plain(payload, extent, &Region::whole(extent), plain.view_mut()).unwrap();
    assert!(fast.bytes() == plain.bytes(), "fast and plain decoders differ");
    plain.samples::<T>().to_vec()
}

/// Encodes and decodes a brick.
pub fn round_trip<T: Sample>(i_bits: u8, block: [u32; 3], extent: Extent, samples: &[T]) -> Vec<T> {
    let codec = codec(i_bits, block);
    decode(&codec, extent, &encode(&codec, extent, samples))
}

/// Round trip of a single block along x.
pub fn line<T: Sample>(i_bits: u8, samples: &[T]) -> Vec<T> {
    let n = u32::try_from(samples.len()).unwrap();
    round_trip(i_bits, [n, 1, 1], Extent::new(n, 1, 1), samples)
}
