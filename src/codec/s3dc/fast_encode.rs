//! Fast encoding: the plain encoder's bytes, a row of blocks at a time. Its scalar twin is `encode::encode_plain`.
//!
//! Per row of blocks: minimum and maximum of every column of voxels, down the rows; then of every block, by sliding
//! windows over the columns; then what turns a sample into its index is spread over the columns, and every row of voxels
//! is arithmetic on neighbours, which the compiler turns into vectors. The same code is compiled for the machine's baseline,
//! for AVX2 and for AVX-512.
#![allow(unsafe_code, reason = "calls of functions that need AVX2 or AVX-512")]

use super::encode::push_end_points;
use super::fast_encode_index::Kernel;
use super::{Endpoints, Layout, Params, with_scalar};
use crate::codec::non_finite;
use crate::codec::prefetch::prefetch;
use crate::error::Result;
use crate::grid::View;
use std::borrow::Cow;
use std::ops::Range;

/// Appends the payload of a brick. The view has been checked.
///
/// # Errors
/// `E_NONFINITE`.
pub fn encode(params: &Params, src: View<'_>, out: &mut Vec<u8>) -> Result<()> {
    let layout = Layout::new(params, src.sample_type, src.extent);
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx512f")
        && std::arch::is_x86_feature_detected!("avx512bw")
        && std::arch::is_x86_feature_detected!("avx512dq")
        && std::arch::is_x86_feature_detected!("avx512vl")
    {
        // SAFETY: this machine has the four parts of AVX-512 that the function needs.
        return with_scalar!(src.sample_type, T => unsafe { on_avx512::<T>(&layout, src, out) }, else Ok(()));
    }
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: this machine has AVX2, which is all the function needs.
        return with_scalar!(src.sample_type, T => unsafe { on_avx2::<T>(&layout, src, out) }, else Ok(()));
    }
    with_scalar!(src.sample_type, T => whole::<T>(&layout, src, out), else Ok(()))
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
fn on_avx512<T: Kernel>(layout: &Layout, src: View<'_>, out: &mut Vec<u8>) -> Result<()> {
    whole::<T>(layout, src, out)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn on_avx2<T: Kernel>(layout: &Layout, src: View<'_>, out: &mut Vec<u8>) -> Result<()> {
    whole::<T>(layout, src, out)
}

/// What a row of blocks needs, by column; columns are padded to whole blocks and one more.
struct Columns<T> {
    min: Vec<T>,
    max: Vec<T>,
    /// Windows in the making.
    spare: Vec<T>,
}

#[inline(always)]
fn whole<T: Kernel>(layout: &Layout, src: View<'_>, out: &mut Vec<u8>) -> Result<()> {
    let base = out.len();
    let params = layout.params();
    let fitted = params.endpoints() == Endpoints::Fitted;
    if fitted {
        push_end_points::<T>(layout, src, out)?;
    }
    out.resize(base + layout.payload_len(), 0); // spec: S3D-8
    let (mmv, indices) = out[base..].split_at_mut(layout.iv_start());
    let (blocks, block) = (layout.blocks(), params.block());
    let edge = block.x as usize;
    let padded = (blocks.x as usize + 1) * edge;
    let mut columns =
        Columns { min: vec![T::HIGHEST; padded], max: vec![T::LOWEST; padded], spare: vec![T::LOWEST; padded] };
    let mut table = T::table(padded);
    let mut row = vec![0u8; layout.row_words() << layout.n_log2];
    let (bricks_x, row_bytes) = (src.extent.x as usize, layout.row_words() * 2);
    for bz in 0..blocks.z {
        for by in 0..blocks.y {
            let z = bz * block.z..((bz + 1) * block.z).min(src.extent.z);
            let y = by * block.y..((by + 1) * block.y).min(src.extent.y);
            if by + 1 < blocks.y {
                ask_ahead(&src, y.end..(y.end + block.y).min(src.extent.y), z.clone());
            } else if bz + 1 < blocks.z {
                ask_ahead(&src, 0..block.y.min(src.extent.y), z.end..(z.end + block.z).min(src.extent.z));
            }
            let pairs = layout.mmv_at([0, by, bz])..;
            let pairs = &mut mmv[pairs][..blocks.x as usize * 2 * T::BYTES];
            if !fitted {
                columns.min.fill(T::HIGHEST);
                columns.max.fill(T::LOWEST);
                let mut finite = true;
                for z in z.clone() {
                    for y in y.clone() {
                        finite &= widen(&mut columns, &samples::<T>(&src, y, z));
                    }
                }
                if !finite {
                    return Err(non_finite()); // spec: S3D-13
                }
                slide(&mut columns.min, &mut columns.spare, edge, |a, b| if b < a { b } else { a });
                slide(&mut columns.max, &mut columns.spare, edge, |a, b| if b > a { b } else { a });
                for (k, pair) in pairs.chunks_exact_mut(2 * T::BYTES).enumerate() {
                    let (lo, hi) = pair.split_at_mut(T::BYTES);
                    columns.min[k * edge].stored().write_le(lo);
                    columns.max[k * edge].stored().write_le(hi);
                }
            }
            for (k, pair) in pairs.chunks_exact(2 * T::BYTES).enumerate() {
                T::spread(&mut table, k * edge, edge, (T::from_le(pair), T::from_le(&pair[T::BYTES..])), params.q());
            }
            for z in z {
                for y in y.clone() {
                    let at = layout.row_at(y, z) - layout.iv_start();
                    T::indices(&table, &samples::<T>(&src, y, z), &mut row[..bricks_x], params.q());
                    pack(params.i_bits(), &row, &mut indices[at..at + row_bytes]);
                }
            }
        }
    }
    Ok(())
}

/// Asks memory for the next row of blocks: rows of a brick lie far apart in a volume, where no machine guesses them.
#[inline(always)]
fn ask_ahead(src: &View<'_>, y: Range<u32>, z: Range<u32>) {
    const LINE: usize = 64;
    if (y.len() as u64) * (z.len() as u64) > 256 {
        return; // more than a first cache holds until it is used
    }
    for z in z {
        for y in y.clone() {
            let start = y as usize * src.row_pitch + z as usize * src.slice_pitch;
            for at in (start..start + src.extent.x as usize * src.sample_type.bytes()).step_by(LINE) {
                prefetch(src.bytes, at);
            }
        }
    }
}

/// Row (y, z), copied where it is not aligned.
#[inline(always)]
fn samples<'a, T: Kernel>(src: &View<'a>, y: u32, z: u32) -> Cow<'a, [T]> {
    let start = y as usize * src.row_pitch + z as usize * src.slice_pitch;
    let bytes = &src.bytes[start..start + src.extent.x as usize * T::BYTES];
    match bytemuck::try_cast_slice(bytes) {
        Ok(samples) => Cow::Borrowed(samples),
        Err(_) => Cow::Owned(bytes.chunks_exact(T::BYTES).map(bytemuck::pod_read_unaligned).collect()),
    }
}

/// Picks between what is known and the row, column by column. In chunks: rows of bricks are too short for the compiler's
/// own unrolling, whose remainder would take them in small steps.
#[inline(always)]
fn merge<T: Kernel>(known: &mut [T], row: &[T], pick: impl Fn(T, T) -> T) {
    let (chunks, rest) = row.as_chunks::<32>();
    let (known_chunks, _) = known.as_chunks_mut::<32>();
    for (known, row) in known_chunks.iter_mut().zip(chunks) {
        // By value: in place, stores could alias loads, and the compiler would go one by one.
        *known = std::array::from_fn(|i| pick(known[i], row[i]));
    }
    for (m, &v) in known[chunks.len() * 32..].iter_mut().zip(rest) {
        *m = pick(*m, v);
    }
}

/// Takes a row into the columns' ranges; whether all its samples may be stored.
#[inline(always)]
fn widen<T: Kernel>(columns: &mut Columns<T>, row: &[T]) -> bool {
    merge(&mut columns.min, row, |m, v| if v < m { v } else { m });
    merge(&mut columns.max, row, |m, v| if v > m { v } else { m });
    T::all_storable(row)
}

/// Makes every entry that of the window of `edge` entries that starts there, as far as windows are whole.
#[inline(always)]
fn slide<T: Kernel>(values: &mut Vec<T>, spare: &mut Vec<T>, edge: usize, pick: impl Fn(T, T) -> T + Copy) {
    let mut have = 1;
    while have < edge {
        let step = have.min(edge - have);
        let pairs = values.iter().zip(&values[step..]);
        for (to, (&a, &b)) in spare.iter_mut().zip(pairs) {
            *to = pick(a, b);
        }
        std::mem::swap(values, spare);
        have += step;
    }
}

/// Packs indices, the first one into the lowest bits. // spec: S3D-9
#[inline(always)]
fn pack(i_bits: u8, row: &[u8], out: &mut [u8]) {
    match i_bits {
        1 => {
            for (to, from) in out.iter_mut().zip(row.as_chunks::<8>().0) {
                // Bit 8k moves to bit 56 + k: every other product falls elsewhere.
                *to = (u64::from_le_bytes(*from).wrapping_mul(0x0102_0408_1020_4080) >> 56) as u8;
            }
        }
        2 => {
            for (to, from) in out.iter_mut().zip(row.as_chunks::<4>().0) {
                let w = u32::from_le_bytes(*from);
                *to = (w | w >> 6 | w >> 12 | w >> 18) as u8;
            }
        }
        4 => {
            for (to, from) in out.iter_mut().zip(row.as_chunks::<2>().0) {
                let w = u16::from_le_bytes(*from);
                *to = (w | w >> 4) as u8;
            }
        }
        _ => out.copy_from_slice(row),
    }
}

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use super::*;
    use crate::geometry::Extent;
    use crate::grid::Grid;
    use crate::voxel::Sample;

    fn all_sets_agree<T: Kernel + Sample>(convert: impl Fn(u32) -> T) {
        let extent = Extent::new(67, 9, 10);
        let hash = |[x, y, z]: [u32; 3]| (x * 73 + y * 179 + z * 283).wrapping_mul(0x9E37_79B1) >> 16;
        let grid = Grid::from_fn(extent, |c| convert(hash(c))).unwrap();
        for (bits, endpoints) in
            [(1, Endpoints::MinMax), (4, Endpoints::MinMax), (4, Endpoints::Fitted), (8, Endpoints::MinMax)]
        {
            let params = Params::new(bits, Extent::new(4, 3, 5), endpoints).unwrap();
            let layout = Layout::new(&params, T::TYPE, extent);
            let mut plain = Vec::new();
            super::super::encode_plain(&params, grid.view(), &mut plain).unwrap();
            let mut found = Vec::new();
            whole::<T>(&layout, grid.view(), &mut found).unwrap();
            assert!(found == plain, "baseline");
            if std::arch::is_x86_feature_detected!("avx2") {
                found.clear();
                // SAFETY: this machine has AVX2.
                unsafe { on_avx2::<T>(&layout, grid.view(), &mut found) }.unwrap();
                assert!(found == plain, "AVX2");
            }
        }
    }

    #[test] // The best set is judged by tests/s3dc_encode.rs; here are those that this machine would not take.
    fn lesser_instruction_sets_give_the_same_bytes() {
        all_sets_agree(|h| h as u8);
        all_sets_agree(|h| h as u16);
        all_sets_agree(|h| h as i16);
        all_sets_agree(|h| h as f32 * 0.37 - 300.0);
    }
}
