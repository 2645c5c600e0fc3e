use super::*;
use crate::grid::Grid;
use crate::haar;
use crate::voxel::Sample;

fn noise([x, y, z]: Coord, c: u32) -> u32 {
    let h = (x + 31 * y + 997 * z + 7919 * c).wrapping_mul(0x9E37_79B1);
    (h ^ h >> 15).wrapping_mul(0x85EB_CA77) >> 16
}

/// Every coefficient of every unit block against [`haar::forward_components`] of the cell's samples.
fn check<T: Sample, S: Component, const C: usize>(
    extent: Extent,
    null: [i32; C],
    sample: impl Fn(Coord) -> T,
    of: impl Fn(T) -> [i32; C],
) {
    let grid = Grid::from_fn(extent, &sample).unwrap();
    let mut unit = UnitCoefficients::<S, C>::new(null);
    let units = extent.div_ceil(Extent::cube(16));
    for u in 0..units.voxels() as u32 {
        let at = [u % units.x, u / units.x % units.y, u / (units.x * units.y)];
        unit.load(&grid.view(), at);
        unit.weigh(Norm::Energy);
        let (mut nonzero, mut seen) = (0, 0);
        for n in 0..64 {
            let origin: Coord = std::array::from_fn(|a| 16 * at[a] + 4 * [n & 3, n >> 2 & 3, n >> 4][a]);
            if !extent.contains(origin) {
                assert_eq!(unit.present >> n & 1, 0, "outside");
                continue;
            }
            let last = extent.to_array().map(|e| e - 1);
            let cell: [[i32; C]; 64] = std::array::from_fn(|i| {
                let i = [i as u32 & 3, i as u32 >> 2 & 3, i as u32 >> 4];
                let v = of(sample(std::array::from_fn(|a| (origin[a] + i[a]).min(last[a]))));
                std::array::from_fn(|c| v[c] - null[c])
            });
            let wanted = haar::forward_components(&cell);
            let some = wanted.iter().filter(|v| **v != [0; C]).count() as u64;
            assert_eq!(unit.present >> n & 1 == 1, some > 0);
            nonzero += some;
            if some > 0 {
                let found: [[i32; C]; 64] = std::array::from_fn(|p| unit.cell(n).numerator(p));
                assert_eq!(found, wanted, "cell {n} of unit block {at:?}");
                let norm = |p: usize| {
                    let square: i64 = wanted[p].iter().map(|&v| i64::from(v) * i64::from(v)).sum();
                    square as u64 * if p < 8 { 1 } else { 8 }
                };
                let least = norm(9).max(1);
                let mut places = Vec::new();
                unit.each_at_least(S::Key::try_from(least).ok().unwrap(), |cell, p| {
                    if cell == n as usize {
                        places.push(p);
                    }
                });
                places.sort_unstable();
                assert_eq!(places, (0..64).filter(|&p| norm(p) >= least).collect::<Vec<_>>());
            }
        }
        unit.each_key(|key| {
            assert_ne!(key.into(), 0);
            seen += 1;
        });
        assert_eq!((unit.nonzero, seen), (nonzero, nonzero));
    }
}

#[test]
fn rows_of_cells_are_transformed_as_cells_are() {
    let flat = |c: Coord| c[2] % 8 < 3 || c[0] > 20;
    let extent = Extent::new(39, 18, 13);
    let byte = |c: Coord, k: u32| if flat(c) { 9 + k as u8 } else { noise(c, k) as u8 };
    let colour = |c: Coord| [0, 1, 2].map(|k| byte(c, k));
    check::<[u8; 3], u8, 3>(extent, [9, 10, 11], colour, |v| v.map(i32::from));
    check::<u8, u8, 1>(extent, [9], |c| byte(c, 0), |v| [v.into()]);
    let wide = |c: Coord| if flat(c) { 65_535 } else { noise(c, 0) as u16 };
    check::<u16, u16, 1>(extent, [65_535], wide, |v| [v.into()]);
    check::<i16, i16, 1>(extent, [-7], |c| if flat(c) { -7 } else { noise(c, 0) as i16 }, |v| [v.into()]);
}

#[test]
fn extremes_fit_the_numbers() {
    let edge = |[x, y, z]: Coord| if (x + y + z) % 2 == 0 || z == 0 { 0u8 } else { 255 };
    check::<[u8; 3], u8, 3>(Extent::cube(16), [0; 3], |c| [edge(c); 3], |v| v.map(i32::from));
    check::<u8, u8, 1>(Extent::cube(16), [0], |c| if c[2] < 4 { 0 } else { 255 }, |v| [v.into()]);
    check::<u8, u8, 1>(Extent::cube(16), [255], |c| if c[2] < 4 { 255 } else { 0 }, |v| [v.into()]);
    let wide = |c: Coord| if c[2] < 4 { 0u16 } else { 65_535 };
    check::<u16, u16, 1>(Extent::cube(16), [0], wide, |v| [v.into()]);
}
