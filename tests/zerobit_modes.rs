//! Voxel, plane and cell mode give the same bits and cost what the paper's Fig. 8 says; both counters of bits, both streams.

mod support;
mod zerobit_coding;

use support::{ball, hash};
use vug::codec::zerobit::bits::{BitCount, CountTable, Popcount};
use vug::codec::zerobit::{Book, Case, Coefficients, Context, Counts, Stream, Tally, Threshold, Word, unit};
use vug::{Extent, Grid, SampleType};
use zerobit_coding::{Coded, How, cell_of, cells, code};

fn at(k: usize) -> [u32; 3] {
    [k as u32 & 3, k as u32 >> 2 & 3, k as u32 >> 4]
}

/// Counts of a closure.
fn counted<R>(f: impl FnOnce(&mut Counts) -> R) -> (R, Counts) {
    let mut counts = Counts::default();
    let result = f(&mut counts);
    (result, counts)
}

/// Null nodes of a cell by level.
fn null_nodes(cell: &impl Coefficients) -> [u64; 2] {
    [u64::from(cell.is_null(0)), (1..9).filter(|&i| cell.is_null(i)).count() as u64]
}

/// Decodes a cell in every mode, compares all of them, and returns the voxels and what each mode cost: voxels one by one,
/// planes across x, y, z, the cell.
fn every_mode<C: BitCount>(decoder: Context<'_, C>, cell: &impl Coefficients) -> ([Word; 64], [Counts; 5]) {
    let (all, of_cell) = counted(|t| decoder.cell(cell, t));
    let mut costs = [Counts::default(), Counts::default(), Counts::default(), Counts::default(), of_cell];
    for (k, &value) in all.iter().enumerate() {
        assert_eq!(decoder.voxel(cell, at(k), &mut costs[0]), value, "voxel {:?}", at(k));
    }
    for axis in 0..3 {
        let [u, v] = [[1, 2], [0, 2], [0, 1]][axis];
        for plane in 0..4 {
            let found = decoder.plane(cell, axis, plane, &mut costs[1 + axis]);
            for (k, value) in found.into_iter().enumerate() {
                let mut c = [plane; 3];
                (c[u], c[v]) = (k as u32 & 3, k as u32 >> 2);
                assert_eq!(value, all[(c[0] + 4 * c[1] + 16 * c[2]) as usize], "axis {axis}, plane {plane}, {k}");
            }
        }
    }
    // Half resolution, in three modes as well, and quarter resolution.
    let means = decoder.means(cell, &mut ());
    for (k, &mean) in means.iter().enumerate() {
        let c = [k as u32 & 1, k as u32 >> 1 & 1, k as u32 >> 2];
        assert_eq!(decoder.mean(cell, c, &mut ()), mean);
        for axis in 0..3 {
            let [u, v] = [[1, 2], [0, 2], [0, 1]][axis];
            assert_eq!(decoder.mean_plane(cell, axis, c[axis], &mut ())[(c[u] + 2 * c[v]) as usize], mean);
        }
    }
    let average = cell.average(&mut ()).map_or([0; 3], |i| decoder.book.average(i));
    assert_eq!(decoder.mean_of_all(cell, &mut ()), average);
    (all, costs)
}

/// A cell all of whose nodes have details, or none.
fn worst_and_best() -> Coded {
    let grid = cells(Extent::new(8, 4, 4), |[x, ..]| {
        cell_of(&std::array::from_fn(|p| if p == 0 { 99 } else { (1 - i64::from(x)) * (1 + p as i64 % 3) }))
            .map(|v| v as u8)
    });
    code(&grid, How::all())
}

#[test] // K-38, V8; spec: ZBT-22, ZBT-23, ZBT-25: the figures of Fig. 8 to the operation
fn costs_of_figure_8() {
    let coded = worst_and_best();
    let decoder = Context { book: coded.book(), sample_type: SampleType::U8, count: Popcount };
    let unit = unit(coded.payload(), 0).unwrap();
    let (full, flat) = (unit.cell(0, Popcount).unwrap(), unit.cell(1, Popcount).unwrap());
    let cost = |f: &dyn Fn(&mut Counts)| {
        let counts = counted(|t| f(t)).1;
        (counts.decodes(), counts.vector_ops)
    };
    for k in 0..64 {
        assert_eq!(cost(&|t| _ = decoder.voxel(&full, at(k), t)), (15, 14));
        assert_eq!(cost(&|t| _ = decoder.voxel(&flat, at(k), t)), (15, 0), "null nodes cost no arithmetic");
    }
    for (axis, ops, half) in [(0, 100, 20), (1, 80, 16), (2, 60, 12)] {
        for plane in 0..4 {
            assert_eq!(cost(&|t| _ = decoder.plane(&full, axis, plane, t)), (36, ops));
            assert_eq!(cost(&|t| _ = decoder.plane(&flat, axis, plane, t)), (36, 0));
        }
        for plane in 0..2 {
            assert_eq!(cost(&|t| _ = decoder.mean_plane(&full, axis, plane, t)), (8, half));
            assert_eq!(cost(&|t| _ = decoder.mean_plane(&flat, axis, plane, t)), (8, 0));
        }
    }
    assert_eq!(cost(&|t| _ = decoder.cell(&full, t)), (64, 216));
    assert_eq!(cost(&|t| _ = decoder.cell(&flat, t)), (64, 0));
    assert_eq!(cost(&|t| _ = decoder.mean(&full, [1, 0, 1], t)), (8, 7));
    assert_eq!(cost(&|t| _ = decoder.means(&full, t)), (8, 24));
    assert_eq!(cost(&|t| _ = decoder.means(&flat, t)), (8, 0));
    assert_eq!(cost(&|t| _ = decoder.mean_of_all(&full, t)), (1, 0));
    // Per voxel: 14; 6.25, 5, 3.75; 3.375. And 15; 2.25; 1 coefficients.
    assert_eq!([100, 80, 60].map(|n| f64::from(n) / 16.0), [6.25, 5.0, 3.75]);
    // One node of level 1 alone: only what it takes, and only where it is.
    let grid = cells(Extent::cube(4), |_| {
        cell_of(&std::array::from_fn(|p| i64::from(p == 0) * 9 + i64::from(p == 7 * 4 + 2))).map(|v| v as i16)
    });
    let coded = code(&grid, How::all());
    let decoder = Context { book: coded.book(), sample_type: SampleType::I16, count: Popcount };
    let one = vug::codec::zerobit::unit(coded.payload(), 0).unwrap().cell(0, Popcount).unwrap();
    assert_eq!(cost(&|t| _ = decoder.cell(&one, t)), (64, 24));
    let voxels: Vec<u64> = (0..64).map(|k| cost(&|t| _ = decoder.voxel(&one, at(k), t)).1).collect();
    assert_eq!(voxels.iter().filter(|&&n| n == 7).count(), 8);
    assert_eq!(voxels.iter().sum::<u64>(), 56);
}

/// All voxels of an encoded grid in every mode, with the average case of Fig. 8 as an identity of integers.
fn check_all(name: &str, coded: &Coded, old: &Coded) {
    let entries = CountTable::entries();
    let table = CountTable::new(&entries);
    let t = coded.sample_type;
    let (decoder, counting) = (
        Context { book: coded.book(), sample_type: t, count: Popcount },
        Context { book: coded.book(), sample_type: t, count: table },
    );
    assert_eq!(coded.book(), old.book());
    let grid = coded.decode();
    let (mut all, mut met) = ([Counts::default(); 5], Counts::default());
    let (mut stored, mut void, mut null_cells, mut null) = (0u64, 0u64, 0u64, [0u64; 2]);
    let mut at_old = old.bricks.iter();
    let mut brick: (&[u8], &[u8]) = (&[], &[]);
    coded.each_cell(|payload, index, n, origin| {
        if brick.0.as_ptr() != payload.as_ptr() {
            brick = (payload, &at_old.next().unwrap().1[..]);
        }
        let inside = |k: usize| {
            let c = std::array::from_fn(|a| origin[a] + at(k)[a]);
            grid.extent().contains(c).then(|| grid.value(c).unwrap())
        };
        let (new_unit, old_unit) = (unit(payload, index), unit(brick.1, index));
        assert_eq!(new_unit.is_some(), old_unit.is_some());
        let Some(new_unit) = new_unit else {
            met.case(Case::Void);
            void += 1;
            return;
        };
        let cell = new_unit.cell(n, Popcount);
        assert_eq!(cell.is_some(), new_unit.cell(n, table).is_some());
        let old_cell = old_unit.unwrap().old_cell(n, Popcount);
        assert_eq!(cell.is_some(), old_cell.is_some());
        let (Some(cell), Some(old_cell)) = (cell, old_cell) else {
            met.case(Case::NullCell);
            null_cells += 1;
            assert!((0..64).filter_map(inside).all(|v| v == coded.zerobit.null()));
            return;
        };
        stored += 1;
        let (voxels, costs) = every_mode(decoder, &cell);
        for (k, word) in voxels.iter().enumerate() {
            let Some(value) = inside(k) else { continue };
            assert!((0..t.components()).all(|c| f64::from(word[c]) == value.component(c)), "{name}: {origin:?}");
        }
        // The table of the paper; the old stream, which knows no null nodes. K-57
        let by_table = new_unit.cell(n, table).unwrap();
        assert_eq!(counted(|t| counting.cell(&by_table, t)), (voxels, costs[4]));
        assert_eq!(counting.voxel(&by_table, [3, 2, 1], &mut ()), voxels[3 + 4 * 2 + 16]);
        let (of_old, old_cost) = counted(|t| decoder.cell(&old_cell, t));
        assert_eq!((of_old, old_cost.vector_ops), (voxels, 216));
        assert_eq!(counting.cell(&old_unit.unwrap().old_cell(n, table).unwrap(), &mut ()), voxels);
        assert_eq!(decoder.voxel(&old_cell, [1, 2, 3], &mut ()), voxels[1 + 8 + 48]);
        let nodes = null_nodes(&cell);
        null = [null[0] + nodes[0], null[1] + nodes[1]];
        for (all, cost) in all.iter_mut().zip(costs) {
            all.vector_ops += cost.vector_ops;
            all.cases.iter_mut().zip(cost.cases).for_each(|(a, b)| *a += b);
        }
    });
    // Fig. 8, average case: (1 − γ0) · a + (1 − γ1) · b operations, γ0 = null[0] / stored, γ1 = null[1] / (8 · stored).
    // All voxels of a cell together, N = 64 · stored; a: 7, 1.25, 1, 0.75, 0.375; b: 7, 5, 4, 3, 3.
    for (counts, a, b) in
        [(all[0], 64 * 7, 8 * 7), (all[1], 80, 40), (all[2], 64, 32), (all[3], 48, 24), (all[4], 24, 24)]
    {
        assert_eq!(counts.vector_ops, (stored - null[0]) * a + (8 * stored - null[1]) * b, "{name}");
    }
    // Every look-up ends in one of the cases 3a to 3d, and in no other.
    for (counts, decodes) in [(all[0], 64 * 15), (all[1], 4 * 36), (all[2], 4 * 36), (all[3], 4 * 36), (all[4], 64)] {
        assert_eq!(counts.decodes(), stored * decodes, "{name}");
        assert_eq!([counts.of(Case::Void), counts.of(Case::NullCell)], [0, 0]);
    }
    assert_eq!((all[4].of(Case::Average), all[4].of(Case::NullNode)), (stored, 7 * (null[0] + null[1])));
    assert_eq!((met.of(Case::Void), met.of(Case::NullCell)), (void, null_cells));
    assert!(old.decode().bytes() == grid.bytes(), "{name}: old and new decode to the same voxels");
    let share = |n: u64, of: u64| n as f64 / of.max(1) as f64;
    let size = |c: &Coded| c.bricks.iter().map(|(_, p)| p.len()).sum::<usize>();
    println!(
        "{name} {} {t}: {stored} cells stored, {null_cells} null, {void} in void unit blocks; γ0 {:.4}, γ1 {:.4}; {} bytes, old {}",
        grid.extent(),
        share(null[0], stored),
        share(null[1], 8 * stored),
        size(coded),
        size(old)
    );
}

fn both(name: &str, grid: &Grid, how: How) {
    check_all(name, &code(grid, how), &code(grid, How { stream: Stream::Old, ..how }));
}

#[test] // K-38, K-57; spec: ZBT-14, ZBT-17, ZBT-18, ZBT-21, ZBT-22, ZBT-30, ZBT-31
fn modes_counters_and_streams_agree() {
    let e = Extent::new(75, 34, 50);
    let colours = Grid::from_fn(e, |c| {
        let h = hash(c);
        if c[0] > 40 { [0; 3] } else { [c[0] as u8 * 3, h as u8 / 4, (c[1] * 5 + c[2]) as u8] }
    });
    let colours = colours.unwrap();
    let wide =
        Grid::from_fn(e, |c| if c[2] < 9 { 900u16 } else { (hash(c) >> 18) as u16 + 900 * c[1] as u16 }).unwrap();
    let signed = Grid::from_fn(e, |c| (hash(c) >> 16) as u16 as i16 / (1 + c[1] as i16)).unwrap();
    for keep in [1_000, 20_000, 150_000, 1_000_000] {
        both("ball", &ball(e), How::keep(keep));
        both("colours", &colours, How { threshold: Threshold::Global, ..How::keep(keep) });
        both("u16", &wide, How { null: 900, ..How::keep(keep) });
        both("i16", &signed, How { null: -5, ..How::keep(keep) });
    }
}

#[test] // K-57; spec: ZBT-31: an average that is not flagged is 0, which the encoder does not write, but a reader knows
fn an_old_cell_without_average() {
    let coded = code(&cells(Extent::cube(4), |_| [7u8; 64]), How { stream: Stream::Old, ..How::all() });
    let mut payload = coded.payload().to_vec();
    assert_eq!(payload[28..36], [1, 0, 0, 0, 0, 0, 0, 0], "flags of cell 0: its average alone");
    payload[28] = 2; // p = 1: d_01, whose index 0 has no word
    let cell = unit(&payload, 0).unwrap().old_cell(0, Popcount).unwrap();
    let book = Book::new(SampleType::U8, vec![[7, 0, 0]], vec![[5, 0, 0]]).unwrap();
    let decoder = Context { book: &book, sample_type: SampleType::U8, count: Popcount };
    let expected: [Word; 64] = std::array::from_fn(|k| [if at(k)[2] < 2 { 5 } else { 0 }, 0, 0]);
    assert_eq!(every_mode(decoder, &cell).0, expected);
    assert_eq!(decoder.mean_of_all(&cell, &mut ()), [0; 3]);
}

#[test] // K-38: real volumes; skipped where there are none
#[cfg(feature = "convert")]
fn modes_agree_on_real_volumes() {
    let Some(dir) = support::data() else { return };
    for name in zerobit_coding::REAL {
        let grid = zerobit_coding::load(&dir, name, 23);
        both(name, &grid, How::keep(30_000));
    }
}
