use super::*;
use crate::geometry::{Coord, Region};
use crate::grid::Grid;
use crate::voxel::{Sample, SampleType};

/// All levels of a grid by the walk that encoders take: rows of bricks of 16, slab after slab.
fn levels(grid: &Grid, downsample: Downsample, coarsest: u8) -> Vec<Grid> {
    let (fine, t) = (grid.extent(), grid.sample_type());
    let null = SampleValue::from_raw(t, 0).unwrap();
    let p = Pyramid { fine, downsample, null, brick_log2: 4, coarsest };
    let mut out: Vec<Grid> = (1..=coarsest).map(|l| Grid::zeros(p.extent(l), t).unwrap()).collect();
    let mut seen: Vec<u64> = vec![0; out.len()];
    let mut put = |rows: Rows| {
        let e = p.extent(rows.level);
        let row = e.x as usize * t.bytes();
        for (i, bytes) in (0u32..).zip(rows.bytes.chunks_exact(row)) {
            let (y, z) = (rows.y + i % rows.rows, rows.z + i / rows.rows);
            let at = e.index([0, y, z]) as usize * t.bytes();
            out[usize::from(rows.level) - 1].bytes_mut()[at..at + row].copy_from_slice(bytes);
            seen[usize::from(rows.level) - 1] += 1;
        }
    };
    let mut tower = p.tower();
    for (bz, z) in (0..fine.z).step_by(16).enumerate() {
        let mut plane = Vec::new();
        for y in (0..fine.y).step_by(16) {
            let region = Region { start: [0, y, z], end: [fine.x, (y + 16).min(fine.y), (z + 16).min(fine.z)] };
            let block = p.block(&grid.view().sub(&region), y, z);
            block.rows.into_iter().for_each(&mut put);
            plane.extend(block.top);
        }
        if let Some(tower) = &mut tower {
            tower.take(plane, bz as u32).into_iter().for_each(&mut put);
        }
    }
    for (grid, seen) in out.iter().zip(seen) {
        assert_eq!(seen, u64::from(grid.extent().y) * u64::from(grid.extent().z), "every row came once");
    }
    out
}

/// The plain twin: one coarse voxel from the voxels of level 0 that it covers, in 128-bit integers, or, for floats, by the
/// spec's recursion.
fn plain(grid: &Grid, downsample: Downsample, level: u8, c: Coord) -> SampleValue {
    let e = grid.extent().to_array();
    let cube = |a: usize| (c[a] << level)..((c[a] + 1) << level).min(e[a]);
    if downsample == Downsample::Nearest {
        return grid.value(std::array::from_fn(|a| ((c[a] << level) + (1 << (level - 1))).min(e[a] - 1))).unwrap();
    }
    let mut values = Vec::new();
    for z in cube(2) {
        for y in cube(1) {
            for x in cube(0) {
                values.push(grid.value([x, y, z]).unwrap());
            }
        }
    }
    let component = |i: usize| -> f64 {
        let all = values.iter().map(|v| v.component(i));
        match downsample {
            Downsample::Min => all.fold(f64::INFINITY, f64::min),
            Downsample::Max => all.fold(f64::NEG_INFINITY, f64::max),
            _ if grid.sample_type() == SampleType::F32 => recursive(grid, level, c) / values.len() as f64,
            _ => {
                let sum: i128 = all.map(|v| v as i128).sum();
                let n = values.len() as i128;
                (2 * sum + n).div_euclid(2 * n) as f64
            }
        }
    };
    match grid.sample_type() {
        SampleType::U8 => SampleValue::U8(component(0) as u8),
        SampleType::U16 => SampleValue::U16(component(0) as u16),
        SampleType::I16 => SampleValue::I16(component(0) as i16),
        SampleType::F32 => SampleValue::F32(component(0) as f32),
        SampleType::Rgb8 => SampleValue::Rgb8([component(0) as u8, component(1) as u8, component(2) as u8]),
    }
}

/// The sum that the spec defines for floats: children joined in pairs along x, then y, then z.
fn recursive(grid: &Grid, level: u8, c: Coord) -> f64 {
    if level == 0 {
        return grid.value(c).unwrap().component(0);
    }
    let e = grid.extent().at_lod(level - 1);
    let child = |dx: u32, dy: u32, dz: u32| {
        let at = [2 * c[0] + dx, 2 * c[1] + dy, 2 * c[2] + dz];
        e.contains(at).then(|| recursive(grid, level - 1, at))
    };
    let join = |a: Option<f64>, b: Option<f64>| match (a, b) {
        (Some(a), Some(b)) => Some(a + b),
        (a, b) => a.or(b),
    };
    let x = |dy, dz| join(child(0, dy, dz), child(1, dy, dz));
    let y = |dz| join(x(0, dz), x(1, dz));
    join(y(0), y(1)).unwrap()
}

fn noise<T: Sample>(extent: Extent, f: impl Fn(u32) -> T) -> Grid {
    Grid::from_fn(extent, |[x, y, z]| {
        f((x.wrapping_mul(0x9E37_79B1) ^ y.wrapping_mul(0x85EB_CA77) ^ z.wrapping_mul(0xC2B2_AE3D)).rotate_left(13))
    })
    .unwrap()
}

#[test] // spec: VOL-12; D-52, D-53: every operator, type and odd extent agrees with the definition, to the last bit
fn every_level_is_what_the_spec_says() {
    for e in [[1, 1, 1], [2, 3, 5], [33, 17, 40], [70, 1, 19], [16, 32, 64], [1, 130, 2]].map(Extent::from) {
        let grids = [
            noise(e, |h| h as u8),
            noise(e, |h| h as u16),
            noise(e, |h| h as i16),
            noise(e, |h| (h as i32) as f32 * if h & 1 == 0 { 1e-9 } else { 1e3 }),
            noise(e, |h| [h as u8, (h >> 8) as u8, (h >> 16) as u8]),
        ];
        for grid in &grids {
            for downsample in Downsample::ALL {
                let made = levels(grid, downsample, 6);
                for (level, made) in (1u8..).zip(&made) {
                    let e = made.extent();
                    for z in 0..e.z {
                        for y in 0..e.y {
                            for x in 0..e.x {
                                let wanted = plain(grid, downsample, level, [x, y, z]);
                                let found = made.value([x, y, z]).unwrap();
                                assert_eq!(
                                    found.to_raw(),
                                    wanted.to_raw(),
                                    "{e} level {level} {downsample:?} {x},{y},{z}"
                                );
                            }
                        }
                    }
                }
            }
        }
    }
}

fn first_level<T: Sample>(grid: &Grid, downsample: Downsample, level: u8) -> Vec<T> {
    levels(grid, downsample, level).pop().unwrap().samples::<T>().to_vec()
}

#[test] // spec: VOL-12; D-50
fn sums_do_not_overflow() {
    let e = Extent::cube(64);
    let all = |v: u16| Grid::from_fn(e, |_| v).unwrap();
    assert_eq!(first_level::<u16>(&all(65535), Downsample::Mean, 6), [65535]);
    assert_eq!(first_level::<i16>(&Grid::from_fn(e, |_| -32768i16).unwrap(), Downsample::Mean, 6), [-32768]);
}

#[test] // D-51
fn float_means_stay_finite() {
    let big = [3e38f32, 3e38, 3e38, 3e38, 3e38, 3e38, 3e38, -3e38];
    let grid = Grid::from_samples(Extent::cube(2), &big).unwrap();
    assert_eq!(first_level::<f32>(&grid, Downsample::Mean, 1), [2.25e38]);
}

#[test] // halves round up, also below zero; level 2 is the mean of level 0, not of the rounded level 1
fn ties_and_no_drift() {
    let grid = Grid::from_samples(Extent::new(3, 1, 1), &[-2i16, -1, 7]).unwrap();
    assert_eq!(first_level::<i16>(&grid, Downsample::Mean, 1), [-1, 7]);
    assert_eq!(first_level::<i16>(&grid, Downsample::Mean, 2), [1]);
    let grid = Grid::from_samples(Extent::new(4, 1, 1), &[0u8, 1, 0, 0]).unwrap();
    assert_eq!(first_level::<u8>(&grid, Downsample::Mean, 2), [0]);
}

#[test] // NaN would spoil every level above it; both zeros are kept apart
fn floats_that_are_special() {
    let grid = Grid::from_samples(Extent::new(4, 1, 1), &[1.0f32, f32::NAN, 0.0, -0.0]).unwrap();
    assert_eq!(first_level::<f32>(&grid, Downsample::Mean, 1), [0.5, 0.0]);
    assert_eq!(first_level::<f32>(&grid, Downsample::Max, 1)[0], 1.0);
    let zeros = |d| first_level::<f32>(&grid, d, 1)[1].to_bits();
    assert_eq!((zeros(Downsample::Min), zeros(Downsample::Max)), ((-0.0f32).to_bits(), 0.0f32.to_bits()));
}
