//! Coarser levels: every voxel of level n is the mean of the level-0 voxels it covers (spec chapter 4).

use crate::error::Result;
use crate::geometry::Extent;
use crate::grid::SlabReader;
use crate::voxel::{Sample, SampleValue};
use crate::with_sample;
use std::ops::Range;

/// Planes `z` of level `lod`, computed from level 0 (never from a rounded level in between, so that nothing drifts).
///
/// The mean is over the voxels that exist; integers are rounded half up exactly, floats are averaged in f64 and
/// rounded once (spec: VOL-12). Non-finite samples count as `null` (level 0 has rejected or replaced them). Holds one plane of level 0 and one plane of sums.
pub(super) fn read_lod_slab(
    reader: &mut dyn SlabReader,
    lod: u8,
    z: Range<u32>,
    null: SampleValue,
    out: &mut [u8],
) -> Result<()> {
    if lod == 0 {
        return reader.read_slab(z, out);
    }
    let (fine, t) = (reader.extent(), reader.sample_type());
    let coarse = fine.at_lod(lod);
    let mut plane = vec![0u8; crate::grid::dense_len(Extent { z: 1, ..fine }, t)?];
    let plane_len = crate::grid::dense_len(Extent { z: 1, ..coarse }, t)?;
    for (z, out) in z.zip(out.chunks_exact_mut(plane_len)) {
        let depth = (z << lod)..((z + 1) << lod).min(fine.z);
        with_sample!(t, T => {
            let mut sums = vec![[<T as Mean>::Sum::default(); 3]; coarse.x as usize * coarse.y as usize];
            for fz in depth.clone() {
                reader.read_slab(fz..fz + 1, &mut plane)?;
                if let SampleValue::F32(null) = null {
                    clean(&mut plane, null);
                }
                add_plane::<T>(&plane, fine, coarse, lod, &mut sums);
            }
            let covered = |c: u32, n: u32| (((c + 1) << lod).min(n) - (c << lod)) as u64;
            let mut at = out.chunks_exact_mut(size_of::<T>()).zip(&sums);
            for y in 0..coarse.y {
                for x in 0..coarse.x {
                    let (to, sum) = at.next().expect("one sum per voxel");
                    let count = covered(x, fine.x) * covered(y, fine.y) * u64::from(depth.end - depth.start);
                    to.copy_from_slice(bytemuck::bytes_of(&T::mean(sum, count)));
                }
            }
        });
    }
    Ok(())
}

/// Sums in a type that holds any number of samples exactly (integers) or in f64.
trait Mean: Sample {
    type Sum: Copy + Default;
    fn add(self, sum: &mut [Self::Sum; 3]);
    fn mean(sum: &[Self::Sum; 3], count: u64) -> Self;
}

/// `sum / count` rounded half up: floor((2·sum + count) / (2·count)).
fn rdiv(sum: i64, count: u64) -> i64 {
    let count = i64::try_from(count).expect("a level-0 volume has at most 2^48 voxels");
    (2 * sum + count).div_euclid(2 * count)
}

macro_rules! integer_mean {
    ($($t:ty),*) => {$(
        impl Mean for $t {
            type Sum = i64;
            fn add(self, sum: &mut [i64; 3]) {
                sum[0] += i64::from(self);
            }
            fn mean(sum: &[i64; 3], count: u64) -> Self {
                <$t>::try_from(rdiv(sum[0], count)).expect("a mean lies between its samples")
            }
        }
    )*};
}
integer_mean!(u8, u16, i16);

impl Mean for f32 {
    type Sum = f64;
    fn add(self, sum: &mut [f64; 3]) {
        sum[0] += f64::from(self);
    }
    fn mean(sum: &[f64; 3], count: u64) -> Self {
        (sum[0] / count as f64) as f32
    }
}

impl Mean for [u8; 3] {
    type Sum = i64;
    fn add(self, sum: &mut [i64; 3]) {
        for (s, v) in sum.iter_mut().zip(self) {
            *s += i64::from(v);
        }
    }
    fn mean(sum: &[i64; 3], count: u64) -> Self {
        sum.map(|s| u8::try_from(rdiv(s, count)).expect("a mean lies between its samples"))
    }
}

fn add_plane<T: Mean>(plane: &[u8], fine: Extent, coarse: Extent, lod: u8, sums: &mut [[T::Sum; 3]]) {
    // A plane buffer of bytes need not be aligned for T: values are read one by one.
    let row_bytes = fine.x as usize * size_of::<T>();
    for (y, row) in plane.chunks_exact(row_bytes).enumerate() {
        let sums = &mut sums[(y >> lod) * coarse.x as usize..][..coarse.x as usize];
        for (x, sample) in row.chunks_exact(size_of::<T>()).enumerate() {
            bytemuck::pod_read_unaligned::<T>(sample).add(&mut sums[x >> lod]);
        }
    }
}

/// Replaces NaN and infinities: one of them would spoil the mean of every level above it.
fn clean(plane: &mut [u8], null: f32) {
    for sample in plane.chunks_exact_mut(4) {
        if !bytemuck::pod_read_unaligned::<f32>(sample).is_finite() {
            sample.copy_from_slice(&null.to_ne_bytes());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Grid;

    fn level<T: Sample>(grid: &mut Grid, lod: u8) -> Vec<T> {
        let e = grid.extent().at_lod(lod);
        let mut out = Grid::zeros(e, T::TYPE).unwrap();
        let null = SampleValue::from_raw(T::TYPE, 0).unwrap();
        read_lod_slab(grid, lod, 0..e.z, null, out.bytes_mut()).unwrap();
        out.samples::<T>().to_vec()
    }

    #[test] // spec: VOL-12; D-50
    fn sums_do_not_overflow() {
        let e = Extent::cube(2);
        assert_eq!(level::<u16>(&mut Grid::from_samples(e, &[65535u16; 8]).unwrap(), 1), [65535]);
        assert_eq!(level::<i16>(&mut Grid::from_samples(e, &[-32768i16; 8]).unwrap(), 1), [-32768]);
    }

    #[test] // D-51
    fn float_means_stay_finite() {
        let big = [3e38f32, 3e38, 3e38, 3e38, 3e38, 3e38, 3e38, -3e38];
        assert_eq!(level::<f32>(&mut Grid::from_samples(Extent::cube(2), &big).unwrap(), 1), [2.25e38]);
    }

    #[test] // D-52: odd dims take the mean of the voxels that exist; halves round up, also below zero
    fn odd_dims_and_ties() {
        let mut grid = Grid::from_samples(Extent::new(3, 1, 1), &[-2i16, -1, 7]).unwrap();
        assert_eq!(level::<i16>(&mut grid, 1), [-1, 7]);
        assert_eq!(level::<i16>(&mut grid, 2), [1]);
    }

    #[test] // D-53: level 2 is the mean of level 0, not of the rounded level 1
    fn no_drift() {
        let mut grid = Grid::from_samples(Extent::new(4, 1, 1), &[0u8, 1, 0, 0]).unwrap();
        assert_eq!(level::<u8>(&mut grid, 1), [1, 0]);
        assert_eq!(level::<u8>(&mut grid, 2), [0]);
    }

    #[test]
    fn colours_are_averaged_by_component() {
        let mut grid = Grid::from_samples(Extent::new(2, 1, 1), &[[0u8, 10, 255], [1, 20, 255]]).unwrap();
        assert_eq!(level::<[u8; 3]>(&mut grid, 1), [[1, 15, 255]]);
    }
}
