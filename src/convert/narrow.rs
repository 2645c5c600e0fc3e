//! Narrowing: which of Vug's sample types holds every stored value, and the conversion to it.
//!
//! Left alone, a value is never changed: a type is chosen only if *every* value is exactly representable in it. A forced
//! type rounds floats half up and refuses values outside its range, naming the first one and where it lies.

use super::fault;
use super::layout::Layout;
use super::payload::Bytes;
use super::stored::{Kind, Scalar, Stored, with_scalar};
use crate::error::{Error, Result};
use crate::voxel::SampleType;
use std::path::Path;

/// Bytes of samples that are looked at in one go.
const CHUNK_BYTES: usize = 256 << 10;

/// Types that a kind may be narrowed to, the first one that holds every value being taken.
const fn candidates(kind: Kind) -> &'static [SampleType] {
    match kind {
        Kind::U8 => &[SampleType::U8],
        Kind::U16 => &[SampleType::U16],
        Kind::I16 | Kind::I8 => &[SampleType::I16],
        Kind::U32 | Kind::U64 => &[SampleType::U16, SampleType::F32],
        Kind::I32 | Kind::I64 => &[SampleType::U16, SampleType::I16, SampleType::F32],
        Kind::F32 | Kind::F64 => &[SampleType::F32],
        Kind::Rgb8 => &[SampleType::Rgb8],
    }
}

/// Nearest integer, halves towards +infinity. (`(v + 0.5).floor()` is wrong for the f64 just below 0.5.)
fn round_half_up(v: f64) -> f64 {
    let floor = v.floor();
    if v - floor >= 0.5 { floor + 1.0 } else { floor }
}

/// Whether `v` may be stored as `target`: unchanged (`exact`), or after rounding.
fn fits<S: Scalar>(v: S, target: SampleType, exact: bool) -> bool {
    let within = |lo: f64, hi: f64| {
        let f = v.to_f64();
        let rounded = round_half_up(f);
        // False for NaN, too.
        rounded >= lo && rounded <= hi && (!exact || rounded == f)
    };
    match target {
        SampleType::U8 => within(0.0, f64::from(u8::MAX)),
        SampleType::U16 => within(0.0, f64::from(u16::MAX)),
        SampleType::I16 => within(f64::from(i16::MIN), f64::from(i16::MAX)),
        SampleType::F32 if exact => v.is_f32(),
        SampleType::F32 => v.to_f32().is_finite() || !v.to_f64().is_finite(),
        SampleType::Rgb8 => false,
    }
}

/// The first value that does not fit: its index in the file, and its text.
struct Misfit {
    index: u64,
    value: String,
}

/// For each candidate type, the first value that it cannot hold. One pass over the source.
fn misfits<S: Scalar>(
    bytes: &mut Bytes,
    stored: Stored,
    samples: u64,
    targets: &[SampleType],
    exact: bool,
) -> Result<Vec<Option<Misfit>>> {
    let mut found: Vec<Option<Misfit>> = targets.iter().map(|_| None).collect();
    let (size, swapped) = (size_of::<S>(), stored.swapped());
    let mut buffer = vec![0; CHUNK_BYTES];
    let mut done = 0;
    while done < samples && found.iter().any(Option::is_none) {
        let n = (samples - done).min((CHUNK_BYTES / size) as u64);
        let chunk = &mut buffer[..n as usize * size];
        bytes.read_at(done * size as u64, chunk)?;
        for (slot, target) in found.iter_mut().zip(targets).filter(|(slot, _)| slot.is_none()) {
            let mut values = chunk.chunks_exact(size).map(|b| S::read(b, swapped));
            if let Some(i) = values.position(|v| !fits(v, *target, exact)) {
                let value = S::read(&chunk[i * size..][..size], swapped).to_string();
                *slot = Some(Misfit { index: done + i as u64, value });
            }
        }
        done += n;
    }
    Ok(found)
}

/// The type that the samples of a file are delivered in. Reads the source once where values have to be looked at.
///
/// # Errors
/// `E_UNSUPPORTED` with the first offending value and its coordinate where no type holds every value, or the forced
/// one does not; `E_PARAM` where a colour is forced to a scalar or the other way round.
pub(super) fn choose(
    path: &Path,
    bytes: &mut Bytes,
    stored: Stored,
    layout: &Layout,
    forced: Option<SampleType>,
) -> Result<SampleType> {
    check_forced(path, stored, forced)?;
    if let Some(native) = stored.kind.native().filter(|native| forced.is_none_or(|t| t == *native)) {
        return Ok(native);
    }
    let forced = forced.as_slice();
    let targets = if forced.is_empty() { candidates(stored.kind) } else { forced };
    let exact = forced.is_empty();
    let samples = layout.samples();
    let mut found = with_scalar!(stored.kind, S => misfits::<S>(bytes, stored, samples, targets, exact)?, return Ok(SampleType::Rgb8));
    if let Some(i) = found.iter().position(Option::is_none) {
        return Ok(targets[i]);
    }
    let Some(Misfit { index, value }) = found.pop().flatten() else {
        return Err(Error::param("dtype", "no type to narrow to"));
    };
    let ([x, y, z], time, channel) = layout.place_of(index);
    let mut at = format!("at voxel ({x}, {y}, {z})");
    if !layout.is_single() {
        at += &format!(" of time step {time}, channel {channel}");
    }
    let names = targets.iter().map(|t| t.name()).collect::<Vec<_>>().join(", ");
    let message = if exact {
        format!(
            "{} value {value} {at} is not exactly representable in {names}; choose a type with --dtype to round it",
            stored.kind
        )
    } else {
        format!("{} value {value} {at} lies outside the range of {names}; choose another --dtype", stored.kind)
    };
    Err(fault::unsupported(path, "dtype", message))
}

/// Refuses to turn colours into scalars, or scalars into colours.
///
/// # Errors
/// `E_PARAM`.
pub(super) fn check_forced(path: &Path, stored: Stored, forced: Option<SampleType>) -> Result<()> {
    if forced.is_none_or(|t| (t == SampleType::Rgb8) == (stored.kind == Kind::Rgb8)) {
        return Ok(());
    }
    let message = format!("{}: holds {} samples; colours and scalars do not convert", path.display(), stored.kind);
    Err(Error::param("dtype", message))
}

/// Converts samples that [`choose`] has accepted. `out` gets `target` samples in this machine's byte order.
pub(super) fn convert(stored: Stored, src: &[u8], target: SampleType, out: &mut [u8]) {
    with_scalar!(stored.kind, S => convert_from::<S>(src, stored.swapped(), target, out), out.copy_from_slice(src));
}

fn convert_from<S: Scalar>(src: &[u8], swapped: bool, target: SampleType, out: &mut [u8]) {
    fn each<S: Scalar, const N: usize>(src: &[u8], swapped: bool, out: &mut [u8], f: impl Fn(S) -> [u8; N]) {
        for (from, to) in src.chunks_exact(size_of::<S>()).zip(out.chunks_exact_mut(N)) {
            to.copy_from_slice(&f(S::read(from, swapped)));
        }
    }
    match target {
        SampleType::U8 => each(src, swapped, out, |v: S| [round_half_up(v.to_f64()) as u8]),
        SampleType::U16 => each(src, swapped, out, |v: S| (round_half_up(v.to_f64()) as u16).to_ne_bytes()),
        SampleType::I16 => each(src, swapped, out, |v: S| (round_half_up(v.to_f64()) as i16).to_ne_bytes()),
        SampleType::F32 => each(src, swapped, out, |v: S| v.to_f32().to_ne_bytes()),
        // `choose` never pairs a scalar with a colour.
        SampleType::Rgb8 => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Code;
    use crate::geometry::Extent;
    use crate::grid::AlignedBytes;

    fn narrow<S: bytemuck::Pod>(kind: Kind, values: &[S], forced: Option<SampleType>) -> Result<(SampleType, Vec<u8>)> {
        let raw: &[u8] = bytemuck::cast_slice(values);
        let mut memory = AlignedBytes::zeroed(raw.len())?;
        memory.as_mut_slice().copy_from_slice(raw);
        let stored = Stored { kind, big_endian: cfg!(target_endian = "big") };
        let path = Path::new("file");
        let layout = Layout::single(path, "", Extent::new(values.len() as u32, 1, 1), kind)?;
        let target = choose(path, &mut Bytes::Memory(memory), stored, &layout, forced)?;
        let mut out = vec![0; values.len() * target.bytes()];
        convert(stored, raw, target, &mut out);
        Ok((target, out))
    }

    #[test]
    fn integers_take_the_first_type_that_holds_all() {
        assert_eq!(narrow(Kind::I8, &[-1i8, 5], None).unwrap().0, SampleType::I16);
        assert_eq!(narrow(Kind::U32, &[65535u32], None).unwrap().0, SampleType::U16);
        assert_eq!(narrow(Kind::U32, &[65536u32], None).unwrap().0, SampleType::F32);
        assert_eq!(narrow(Kind::I32, &[0i32, 40000], None).unwrap().0, SampleType::U16);
        assert_eq!(narrow(Kind::I32, &[-1i32, 5], None).unwrap().0, SampleType::I16);
        assert_eq!(narrow(Kind::I64, &[-1i64, 40000], None).unwrap().0, SampleType::F32);
        assert_eq!(narrow(Kind::U64, &[1u64 << 63], None).unwrap().0, SampleType::F32);
        let (t, bytes) = narrow(Kind::I64, &[-7i64, 300], None).unwrap();
        assert_eq!((t, bytes), (SampleType::I16, [(-7i16).to_ne_bytes(), 300i16.to_ne_bytes()].concat()));
    }

    #[test]
    fn an_inexact_value_is_named_with_its_place_and_the_way_out() {
        let e = narrow(Kind::F64, &[0.5f64, 0.25, 0.1], None).unwrap_err();
        assert_eq!(e.code(), Code::Unsupported);
        for part in ["0.1", "(2, 0, 0)", "--dtype", "file"] {
            assert!(e.message().contains(part), "{part} in {e}");
        }
        let e = narrow(Kind::U64, &[1u64, (1 << 24) + 1], None).unwrap_err();
        assert!(e.message().contains("16777217") && e.message().contains("(1, 0, 0)"), "{e}");
    }

    #[test]
    fn forced_types_round_half_up_and_keep_their_range() {
        let (_, bytes) = narrow(Kind::F64, &[0.5f64, 0.499_999_999_999_999_94, 254.5], Some(SampleType::U8)).unwrap();
        assert_eq!(bytes, [1, 0, 255]);
        let (_, bytes) = narrow(Kind::F32, &[-0.5f32, -1.5], Some(SampleType::I16)).unwrap();
        assert_eq!(bytes, [0i16.to_ne_bytes(), (-1i16).to_ne_bytes()].concat());
        let (_, bytes) = narrow(Kind::F64, &[0.1f64], Some(SampleType::F32)).unwrap();
        assert_eq!(bytes, 0.1f32.to_ne_bytes());
        for bad in [255.5f64, -0.6, f64::NAN, f64::INFINITY] {
            let e = narrow(Kind::F64, &[bad], Some(SampleType::U8)).unwrap_err();
            assert_eq!(e.code(), Code::Unsupported, "{bad}");
        }
        assert!(narrow(Kind::F64, &[1e300f64], Some(SampleType::F32)).is_err());
        assert!(narrow(Kind::F64, &[f64::INFINITY], Some(SampleType::F32)).is_ok());
        assert_eq!(narrow(Kind::U16, &[255u16], Some(SampleType::U8)).unwrap().1, [255]);
        assert!(narrow(Kind::U16, &[256u16], Some(SampleType::U8)).unwrap_err().message().contains("256"));
        assert_eq!(narrow(Kind::U8, &[1u8], Some(SampleType::Rgb8)).unwrap_err().code(), Code::Param);
    }
}
