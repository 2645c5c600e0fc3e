//! Brick codecs: a closed set, chosen by the codec table of a volume (spec chapters 7, 8 and 14).
//!
//! A codec turns one brick of samples into a payload of a known length and back. Payloads are little-endian; samples in
//! memory are in the machine's byte order. Every fast path has a plain scalar twin, [`Codec::decode_plain`], that is
//! always compiled and defines the result.

mod prefetch;
pub mod raw;
pub mod s3dc;
pub mod zerobit;

use crate::error::{Code, Error, Result};
use crate::geometry::{Coord, Extent, Region};
use crate::grid::{View, ViewMut};
use crate::voxel::{SampleType, SampleValue};
use s3dc::Params;
use std::ops::RangeInclusive;
use std::sync::Arc;
use zerobit::Zerobit;

/// Bytes of the parameter field of a codec table entry.
pub const PARAM_BYTES: usize = 28;

/// How a decoder should write a large result.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Stores {
    /// Through the caches: right where the result is read again soon.
    #[default]
    Cached,
    /// Around the caches, where the machine can and rows lie on 64-byte lines: right for results larger than the cache.
    Streaming,
}

/// A part of a brick to be decoded.
#[derive(Clone, Copy, Debug)]
pub struct BrickPart<'a> {
    /// The brick's payload.
    pub payload: &'a [u8],
    /// Voxels of the brick, per axis.
    pub brick: Extent,
    /// The voxels wanted.
    pub region: Region,
}

/// How the samples of a brick are stored.
#[derive(Clone, Debug, PartialEq)]
pub enum Codec {
    /// Every sample as it is; lossless.
    Raw,
    /// Two end points per block, and an index of a few bits per voxel (Yela et al. 2008).
    S3dc(Params),
    /// Haar wavelets, vector-quantised, for colour and grey volumes (Bajaj et al. 2001).
    Zerobit(Zerobit),
}

impl Codec {
    /// The codec of an entry of the codec table; `null` is the volume's null value.
    ///
    /// A codec with codebooks does not have them yet: see [`Codec::with_books`].
    ///
    /// # Errors
    /// `E_CODEC` for an id or stream version this reader does not know, `E_RESERVED` for reserved bytes that are not 0,
    /// `E_PARAM` for a parameter outside its set.
    pub fn from_wire(id: u16, stream_version: u16, params: &[u8; PARAM_BYTES], null: SampleValue) -> Result<Codec> {
        // spec: RAW-1, S3D-1, ZBT-1
        match (id, stream_version) {
            (raw::ID, raw::STREAM_VERSION) => {
                // spec: RAW-2
                if params.iter().any(|&b| b != 0) {
                    let message = "codec raw has no parameters: all bytes are 0";
                    return Err(Error::new(Code::Reserved, "codec.params", message));
                }
                Ok(Codec::Raw)
            }
            (s3dc::ID, s3dc::STREAM_VERSION) => Params::from_wire(params).map(Codec::S3dc),
            (zerobit::ID, version) if let Some(stream) = zerobit::Stream::from_wire(version) => {
                let params = zerobit::Params::from_wire(params)?;
                Ok(Codec::Zerobit(Zerobit::new(stream, params, null)))
            }
            _ => Err(Error::new(
                Code::Codec,
                "codec.id",
                format!("codec {id} with stream version {stream_version} is not known; a newer reader may know it"),
            )),
        }
    }

    /// The same codec with the volume's codebooks, where it uses any.
    #[must_use]
    pub fn with_books(&self, books: &Arc<[zerobit::Book]>) -> Codec {
        match self {
            Codec::Zerobit(z) => Codec::Zerobit(z.with_books(books.clone())),
            other => other.clone(),
        }
    }

    /// Whether payloads refer to codebooks of the volume.
    #[must_use]
    pub const fn uses_books(&self) -> bool {
        matches!(self, Codec::Zerobit(_))
    }

    /// Id, stream version and parameters, as the codec table holds them.
    #[must_use]
    pub fn to_wire(&self) -> (u16, u16, [u8; PARAM_BYTES]) {
        match self {
            Codec::Raw => (raw::ID, raw::STREAM_VERSION, [0; PARAM_BYTES]),
            Codec::S3dc(p) => (s3dc::ID, s3dc::STREAM_VERSION, p.to_wire()),
            Codec::Zerobit(z) => (zerobit::ID, z.stream() as u16, z.params().to_wire()),
        }
    }

    /// The name used on the command line and in JSON.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Codec::Raw => "raw",
            Codec::S3dc(_) => "s3dc",
            Codec::Zerobit(_) => "zerobit",
        }
    }

    /// Checks that this codec can hold samples of type `t`.
    ///
    /// # Errors
    /// `E_PARAM`.
    pub fn supports(&self, t: SampleType) -> Result<()> {
        match self {
            Codec::Raw => Ok(()),
            // spec: S3D-2
            Codec::S3dc(_) if t == SampleType::Rgb8 => {
                Err(Error::param("codec", "s3dc stores scalars (u8, u16, i16, f32); use zerobit or raw for rgb8"))
            }
            // spec: ZBT-1
            Codec::Zerobit(_) if t == SampleType::F32 => {
                Err(Error::param("codec", "zerobit stores integers (rgb8, u8, u16, i16); use s3dc or raw for f32"))
            }
            Codec::S3dc(_) | Codec::Zerobit(_) => Ok(()),
        }
    }

    /// Lengths that the payload of a brick may have, in bytes, before any supercompression: one, where the length follows
    /// from the extent.
    #[must_use]
    pub fn payload_lens(&self, t: SampleType, brick: Extent) -> RangeInclusive<u64> {
        let exact = |len| len..=len;
        match self {
            Codec::Raw => exact(raw::payload_len(t, brick)),
            Codec::S3dc(p) => exact(s3dc::Layout::new(p, t, brick).payload_len() as u64),
            // spec: ZBT-8
            Codec::Zerobit(z) => {
                let layout = zerobit::Layout::new(brick);
                layout.min_len()..=layout.max_len(z.stream())
            }
        }
    }

    /// Alignment of an uncompressed payload in the file, as log2 of bytes.
    #[must_use]
    pub const fn align_log2(&self) -> u8 {
        match self {
            Codec::Raw | Codec::Zerobit(_) => 4,
            Codec::S3dc(_) => 8,
        }
    }

    /// Appends the payload of a brick to `out`.
    ///
    /// `src` is the brick (any pitch, any alignment). The same brick always gives the same bytes.
    ///
    /// # Errors
    /// `E_NONFINITE` where a sample is NaN or infinite ([`first_non_finite`] says where); `E_PARAM` where the codec does
    /// not hold this sample type or the view is shorter than its extent. `out` is unchanged then.
    pub fn encode(&self, src: View<'_>, out: &mut Vec<u8>) -> Result<()> {
        self.supports(src.sample_type)?;
        check_view(src.bytes.len(), src.extent, src.sample_type, src.row_pitch, src.slice_pitch)?;
        let start = out.len();
        let done = match self {
            Codec::Raw => raw::encode(src, out),
            Codec::S3dc(p) => s3dc::encode(p, src, out),
            Codec::Zerobit(z) => z.encode(src, out),
        };
        if done.is_err() {
            out.truncate(start);
        }
        done
    }

    /// As [`Codec::encode`], by the plain scalar code that defines the result.
    ///
    /// # Errors
    /// As [`Codec::encode`].
    pub fn encode_plain(&self, src: View<'_>, out: &mut Vec<u8>) -> Result<()> {
        let Codec::S3dc(params) = self else { return self.encode(src, out) };
        self.supports(src.sample_type)?;
        check_view(src.bytes.len(), src.extent, src.sample_type, src.row_pitch, src.slice_pitch)?;
        let start = out.len();
        let done = s3dc::encode_plain(params, src, out);
        if done.is_err() {
            out.truncate(start);
        }
        done
    }

    /// Decodes the part `region` of a brick into `dst`, by the fastest path this machine has.
    ///
    /// Damaged payloads of the right length decode to defined values, never to a panic.
    ///
    /// # Errors
    /// `E_SIZE` where the payload cannot be that long ([`Codec::payload_lens`]), `E_RANGE` where the region is not inside the
    /// brick, `E_PARAM` where `dst` does not have the region's extent or the codec does not hold its sample type.
    pub fn decode(&self, payload: &[u8], brick: Extent, region: &Region, dst: ViewMut<'_>) -> Result<()> {
        self.decode_hinted(payload, brick, region, dst, Stores::Cached)
    }

    /// As [`Codec::decode`], with a hint how to write the result. The hint never changes the result.
    ///
    /// # Errors
    /// As [`Codec::decode`].
    pub fn decode_hinted(
        &self,
        payload: &[u8],
        brick: Extent,
        region: &Region,
        dst: ViewMut<'_>,
        stores: Stores,
    ) -> Result<()> {
        self.decode_run(&[BrickPart { payload, brick, region: *region }], dst, stores)
    }

    /// Decodes parts of bricks that lie side by side along x into one destination, in order from its x = 0.
    ///
    /// The regions have the same y and z, the destination is as wide as they are together. The result is that of
    /// decoding one after the other; the time is less, since memory takes long stretches of a row faster than the 64
    /// bytes that one brick of `u8` may have. Four bricks at a time are enough.
    ///
    /// # Errors
    /// As [`Codec::decode`]; `E_PARAM` also where the regions do not fit together.
    pub fn decode_run(&self, bricks: &[BrickPart<'_>], mut dst: ViewMut<'_>, stores: Stores) -> Result<()> {
        self.check_run(bricks, &dst)?;
        match self {
            Codec::Raw => {
                let mut x = 0;
                for b in bricks {
                    let extent = b.region.extent();
                    raw::decode(b.payload, b.brick, &b.region, dst.sub(&Region::at([x, 0, 0], extent)));
                    x += extent.x;
                }
            }
            Codec::S3dc(p) => s3dc::decode(&s3dc::pieces(p, bricks, dst.sample_type), dst, stores),
            Codec::Zerobit(z) => z.decode(bricks, dst, stores)?,
        }
        Ok(())
    }

    /// As [`Codec::decode`], by the plain scalar code that defines the result.
    ///
    /// # Errors
    /// As [`Codec::decode`].
    pub fn decode_plain(&self, payload: &[u8], brick: Extent, region: &Region, dst: ViewMut<'_>) -> Result<()> {
        let part = BrickPart { payload, brick, region: *region };
        self.check_run(&[part], &dst)?;
        match self {
            Codec::Zerobit(z) => z.decode_plain(&part, dst)?,
            Codec::Raw => raw::decode(payload, brick, region, dst),
            Codec::S3dc(p) => s3dc::decode_plain(&s3dc::Layout::new(p, dst.sample_type, brick), payload, region, dst),
        }
        Ok(())
    }

    /// One voxel of a brick.
    ///
    /// # Errors
    /// `E_SIZE`, `E_RANGE`, `E_PARAM` as [`Codec::decode`].
    pub fn voxel(&self, payload: &[u8], t: SampleType, brick: Extent, c: Coord) -> Result<SampleValue> {
        self.supports(t)?;
        self.check_len(payload, t, brick)?;
        Region::at(c, Extent::cube(1)).check(brick)?;
        Ok(match self {
            Codec::Raw => raw::voxel(payload, t, brick, c),
            Codec::S3dc(p) => s3dc::Layout::new(p, t, brick).value(payload, c),
            Codec::Zerobit(z) => z.voxel(payload, t, brick, c)?,
        })
    }

    /// Strict validation of a payload that lies at `file_offset`: everything a writer must have done.
    ///
    /// # Errors
    /// `E_SIZE`, `E_MINMAX_ORDER`, `E_NONFINITE`, `E_CANON`, `E_PADDING`, with the absolute offset and the field.
    pub fn check(&self, payload: &[u8], t: SampleType, brick: Extent, file_offset: u64) -> Result<()> {
        self.supports(t)?;
        self.check_len(payload, t, brick).map_err(|e| Error::at(e.code(), file_offset, "payload", e.message()))?;
        match self {
            Codec::Raw => raw::check(payload, t),
            Codec::S3dc(p) => s3dc::check(&s3dc::Layout::new(p, t, brick), payload),
            Codec::Zerobit(z) => z.check(payload, brick),
        }
        .map_err(|e| e.shifted(file_offset))
    }

    fn check_len(&self, payload: &[u8], t: SampleType, brick: Extent) -> Result<()> {
        let allowed = self.payload_lens(t, brick);
        let len = payload.len();
        if allowed.contains(&(len as u64)) {
            return Ok(());
        }
        // spec: RAW-4, S3D-5, ZBT-8
        let (name, least, most) = (self.name(), allowed.start(), allowed.end());
        let due = if least == most { least.to_string() } else { format!("{least} to {most}") };
        Err(Error::new(
            Code::Size,
            "payload",
            format!("{len} bytes found; a {name} brick of {brick} {t} voxels has {due}"),
        ))
    }

    fn check_run(&self, bricks: &[BrickPart<'_>], dst: &ViewMut<'_>) -> Result<()> {
        self.supports(dst.sample_type)?;
        let mut x = 0u32;
        for BrickPart { payload, brick, region } in bricks {
            self.check_len(payload, dst.sample_type, *brick)?;
            region.check(*brick)?;
            x = x.saturating_add(region.extent().x);
            let first = bricks[0].region;
            if region.start[1..] != first.start[1..] || region.end[1..] != first.end[1..] {
                return Err(Error::param("region", format!("{region} does not lie beside {first}")));
            }
        }
        let covered = bricks.first().map(|b| Extent { x, ..b.region.extent() });
        if covered != Some(dst.extent) {
            let found = covered.map_or("nothing".to_string(), |e| e.to_string());
            return Err(Error::param("dst", format!("the destination holds {}, the region {found}", dst.extent)));
        }
        let row = dst.extent.x as usize * dst.sample_type.bytes();
        let slice = (dst.extent.y as usize - 1).saturating_mul(dst.row_pitch).saturating_add(row);
        if dst.extent.y > 1 && dst.row_pitch < row || dst.extent.z > 1 && dst.slice_pitch < slice {
            return Err(Error::param("dst", "rows of the destination overlap: a pitch is too small"));
        }
        check_view(dst.bytes.len(), dst.extent, dst.sample_type, dst.row_pitch, dst.slice_pitch)
    }
}

/// Checks that a view's last sample lies inside its bytes. The unsafe fast paths rely on it.
fn check_view(len: usize, extent: Extent, t: SampleType, row_pitch: usize, slice_pitch: usize) -> Result<()> {
    let needed = || -> Option<usize> {
        let [x, y, z] = extent.to_array().map(|v| v as usize);
        (z.checked_sub(1)?.checked_mul(slice_pitch)?)
            .checked_add(y.checked_sub(1)?.checked_mul(row_pitch)?)?
            .checked_add(x.checked_mul(t.bytes())?)
    };
    match needed() {
        Some(n) if n <= len && extent.x > 0 => Ok(()),
        _ => Err(Error::param("view", format!("{len} bytes do not hold {extent} voxels of {t} at these pitches"))),
    }
}

/// Where the first NaN or infinite sample of a volume lies, in x-fastest order; `None` for integer types.
#[must_use]
pub fn first_non_finite(src: &View<'_>) -> Option<Coord> {
    if src.sample_type != SampleType::F32 {
        return None;
    }
    for z in 0..src.extent.z {
        for y in 0..src.extent.y {
            let start = y as usize * src.row_pitch + z as usize * src.slice_pitch;
            let row = &src.bytes[start..start + src.extent.x as usize * 4];
            let finite = |b: &[u8]| bytemuck::pod_read_unaligned::<f32>(b).is_finite();
            if let Some(x) = row.chunks_exact(4).position(|b| !finite(b)) {
                return Some([u32::try_from(x).expect("x is below the extent"), y, z]);
            }
        }
    }
    None
}

/// The error for a sample that is NaN or infinite. Callers that know the coordinate name it (K-13).
fn non_finite() -> Error {
    Error::new(
        Code::NonFinite,
        "samples",
        "a sample is NaN or infinite; clean the data or ask for NaN to be replaced by the null value",
    )
}
