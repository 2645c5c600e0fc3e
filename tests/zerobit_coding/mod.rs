//! Helpers of the zerobit tests: encoding bricks without a file, cells made of coefficients, and slow twins of what the
//! codec does.
#![allow(dead_code, reason = "each test binary uses its own part")]

use std::sync::Arc;
use vug::codec::Codec;
use vug::codec::zerobit::{
    Book, CELL_EDGE, Coder, Cut, KEEP_ALL, Layout, Norm, Params, Plan, RankSearch, Stream, Survey, Threshold, Trainer,
    Training, UNIT_EDGE, Word, Zerobit,
};
use vug::haar;
use vug::voxel::{Sample, SampleValue};
use vug::{Extent, Grid, Region, SampleType};

/// Voxels of a brick along each axis.
pub const BRICK: u32 = 64;

/// How to encode.
#[derive(Clone, Copy, Debug)]
pub struct How {
    pub keep: u32,
    pub stream: Stream,
    pub threshold: Threshold,
    pub norm: Norm,
    pub training: Training,
    /// Null value, of all components.
    pub null: i32,
}

impl How {
    /// This many millionths of the coefficients, all else as usual.
    pub fn keep(keep: u32) -> How {
        How {
            keep,
            stream: Stream::default(),
            threshold: Threshold::default(),
            norm: Norm::default(),
            training: Training::default(),
            null: 0,
        }
    }

    pub fn all() -> How {
        How::keep(KEEP_ALL)
    }

    pub fn codec(self, t: SampleType) -> Zerobit {
        let mut params = Params::new(self.keep).unwrap();
        (params.threshold, params.norm, params.training) = (self.threshold, self.norm, self.training);
        Zerobit::new(self.stream, params, sample(t, [self.null; 3]))
    }
}

/// A value of type `t`.
pub fn sample(t: SampleType, v: [i32; 3]) -> SampleValue {
    match t {
        SampleType::U8 => SampleValue::U8(v[0] as u8),
        SampleType::U16 => SampleValue::U16(v[0] as u16),
        SampleType::I16 => SampleValue::I16(v[0] as i16),
        SampleType::F32 => SampleValue::F32(v[0] as f32),
        SampleType::Rgb8 => SampleValue::Rgb8(v.map(|v| v as u8)),
    }
}

/// Bricks of a level that share thresholds and codebook.
pub struct Coded {
    pub zerobit: Zerobit,
    pub codec: Codec,
    pub survey: Survey,
    pub cut: Cut,
    pub sample_type: SampleType,
    pub extent: Extent,
    pub bricks: Vec<(Region, Vec<u8>)>,
}

/// Encodes a grid as one level of bricks, all of them, even constant ones; every payload is checked strictly.
pub fn code(grid: &Grid, how: How) -> Coded {
    let (t, extent) = (grid.sample_type(), grid.extent());
    let bare = how.codec(t);
    let n = extent.div_ceil(Extent::cube(BRICK));
    let place = |i: u64| [i % u64::from(n.x), i / u64::from(n.x) % u64::from(n.y), i / u64::from(n.x) / u64::from(n.y)];
    let regions: Vec<Region> = (0..n.voxels())
        .map(|i| Region::at(place(i).map(|v| v as u32 * BRICK), Extent::cube(BRICK)).intersect(&Region::whole(extent)))
        .collect();
    let view = |region: &Region| grid.view().sub(region);
    let mut survey = Survey::default();
    regions.iter().for_each(|r| survey.merge(bare.survey(view(r))));
    let budget = survey.budget(how.keep);
    let cut = match how.threshold {
        Threshold::Adaptive => Cut::Share { budget, nonzero: survey.nonzero },
        Threshold::Global => {
            let mut search = RankSearch::new(budget, !matches!(t, SampleType::U8 | SampleType::Rgb8));
            while !search.is_done() {
                let mut total = search.digits();
                for region in &regions {
                    let digits = bare.count_norms(view(region), &search);
                    total.iter_mut().zip(digits).for_each(|(a, b)| *a += b);
                }
                search.take(&total);
            }
            search.cut()
        }
    };
    let mut trainer = Trainer::default();
    regions.iter().for_each(|r| trainer.take(&bare.survivors(view(r), cut)));
    let book = trainer.train(how.training, t).unwrap();
    let coder = Arc::new(Coder::new(&book));
    let zerobit = bare.with_books([book].into()).planned(Plan { book: 0, coder, cut });
    let codec = Codec::Zerobit(zerobit.clone());
    let encode = |region: Region| {
        let mut payload = Vec::new();
        codec.encode(view(&region), &mut payload).unwrap();
        codec.check(&payload, t, region.extent(), 0).unwrap();
        (region, payload)
    };
    let bricks = regions.into_iter().map(encode).collect();
    Coded { zerobit, codec, survey, cut, sample_type: t, extent, bricks }
}

impl Coded {
    pub fn book(&self) -> &Book {
        &self.zerobit.books()[0]
    }

    /// The payload of the only brick.
    pub fn payload(&self) -> &[u8] {
        assert_eq!(self.bricks.len(), 1);
        &self.bricks[0].1
    }

    /// All voxels, by the fast and by the plain decoder, which must agree.
    pub fn decode(&self) -> Grid {
        let mut out = Grid::zeros(self.extent, self.sample_type).unwrap();
        let mut plain = Grid::zeros(self.extent, self.sample_type).unwrap();
        for (region, payload) in &self.bricks {
            let brick = region.extent();
            let whole = Region::whole(brick);
            self.codec.decode(payload, brick, &whole, out.view_mut().sub(region)).unwrap();
            self.codec.decode_plain(payload, brick, &whole, plain.view_mut().sub(region)).unwrap();
        }
        assert!(out.bytes() == plain.bytes(), "fast and plain decoders differ");
        out
    }

    /// Visits every cell of every brick: payload, number of the unit block, number of the cell, first voxel in the volume.
    pub fn each_cell<'a>(&'a self, mut visit: impl FnMut(&'a [u8], usize, u32, [u32; 3])) {
        for (region, payload) in &self.bricks {
            let layout = Layout::new(region.extent());
            let cells = region.extent().div_ceil(Extent::cube(CELL_EDGE));
            for z in 0..cells.z {
                for y in 0..cells.y {
                    for x in 0..cells.x {
                        let at = [x, y, z].map(|v| v * CELL_EDGE);
                        let (unit, n) = layout.locate(at);
                        visit(payload, unit, n, std::array::from_fn(|a| region.start[a] + at[a]));
                    }
                }
            }
        }
    }
}

/// The directory entry, flags (CBFT) and bytes of unit block `index` up to the end of the payload.
pub fn unit_bytes(payload: &[u8], index: usize) -> Option<(usize, u64, &[u8])> {
    let entry = u32::from_le_bytes(payload[16 + 4 * index..][..4].try_into().unwrap());
    let base = (entry >> 8) as usize * 4;
    let bytes = payload.get(base..).filter(|_| entry != 0)?;
    Some(((entry & 0xFF) as usize, u64::from_le_bytes(bytes[..8].try_into().unwrap()), bytes))
}

/// A cell out of average (p = 0) and details (p = 7·i + j), by the table of signs alone: nothing shared, nothing rounded.
pub fn cell_of(coefficients: &[i64; 64]) -> [i64; 64] {
    std::array::from_fn(|k| {
        let at = [k & 3, k >> 2 & 3, k >> 4];
        let place = |f: fn(usize) -> usize| f(at[0]) + 2 * f(at[1]) + 4 * f(at[2]);
        let (node, sub) = (place(|v| v >> 1), place(|v| v & 1));
        let term = |p: usize, j, at| i64::from(haar::sign(j, at)) * coefficients[p];
        (0..8).map(|j| term(j, j, node)).sum::<i64>() + (1..8).map(|j| term(7 * node + 7 + j, j, sub)).sum::<i64>()
    })
}

/// A grid whose cells are given by their place in cells.
pub fn cells<T: Sample>(extent: Extent, cell: impl Fn([u32; 3]) -> [T; 64]) -> Grid {
    Grid::from_fn(extent, |c| {
        let [x, y, z] = c.map(|v| v % 4);
        cell(c.map(|v| v / 4))[(x + 4 * y + 16 * z) as usize]
    })
    .unwrap()
}

/// One component of a cell of a grid: the nearest voxel inside stands for those outside.
pub fn padded_cell(grid: &Grid, origin: [u32; 3], component: usize) -> [i32; 64] {
    let e = grid.extent().to_array();
    std::array::from_fn(|k| {
        let at = [k & 3, k >> 2 & 3, k >> 4].map(|v| v as u32);
        let c = std::array::from_fn(|a| (origin[a] + at[a]).min(e[a] - 1));
        grid.value(c).unwrap().component(component) as i32
    })
}

/// Numerators of all cells of a unit block of a grid, less the null value: `[cell][component][p]`, `None` outside.
pub fn numerators(grid: &Grid, unit: [u32; 3], null: i32) -> Vec<Option<Vec<[i32; 64]>>> {
    let components = grid.sample_type().components();
    (0..64u32)
        .map(|n| {
            let at = [n & 3, n >> 2 & 3, n >> 4];
            let origin: [u32; 3] = std::array::from_fn(|a| unit[a] * UNIT_EDGE + at[a] * CELL_EDGE);
            grid.extent().contains(origin).then(|| {
                let cell = |c| padded_cell(grid, origin, c).map(|v| v - null);
                (0..components).map(|c| haar::forward(&cell(c))).collect()
            })
        })
        .collect()
}

/// Square of a coefficient, in units that compare between levels.
pub fn size(cell: &[[i32; 64]], p: usize, norm: Norm) -> u64 {
    let square: u64 = cell.iter().map(|s| i64::from(s[p]).pow(2) as u64).sum();
    match (p < 8, norm) {
        (true, _) => square,
        (false, Norm::Energy) => 8 * square,
        (false, Norm::Plain) => 64 * square,
    }
}

/// Index of the nearest word, the first of equals, by looking at all.
pub fn nearest(words: &[Word], v: Word) -> usize {
    let distance = |w: &Word| (0..3).map(|c| (i64::from(w[c]) - i64::from(v[c])).pow(2)).sum::<i64>();
    (0..words.len()).min_by_key(|&i| (distance(&words[i]), i)).unwrap()
}

/// Real volumes that zerobit can hold.
pub const REAL: [&str; 9] = [
    "rgb_stroke_t1t2flair.nrrd",
    "rgb_dti_dec.nrrd",
    "rgb24_ct_perfusion.nii.gz",
    "ct_visiblehuman_head_u8.nrrd",
    "mri_mni152_i16.nii.gz",
    "ct_chest_lidc2.nhdr",
    "mri_stroke_t1.nii.gz",
    "mr_cardiac_u16.nrrd",
    "tooth.nhdr",
];

/// At most `depth` planes, and 2 million voxels, out of the middle of a real volume.
#[cfg(feature = "convert")]
pub fn load(dir: &std::path::Path, name: &str, depth: u32) -> Grid {
    let options = vug::convert::ImportOptions::default();
    let mut source = vug::convert::import(&dir.join(name), &options).unwrap();
    let e = source.reader.extent();
    let depth = e.z.min(depth).min((2 << 20) / (e.x * e.y));
    let from = (e.z - depth) / 2;
    let mut grid = Grid::zeros(Extent { z: depth, ..e }, source.reader.sample_type()).unwrap();
    source.reader.read_slab(from..from + depth, grid.bytes_mut()).unwrap();
    grid
}
