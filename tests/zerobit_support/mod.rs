//! Zerobit payloads, codebooks and files made by hand, without the encoder: tests then judge what the format says.
#![allow(dead_code, reason = "every test binary uses its own part")]

use std::collections::BTreeMap;
use std::io::Cursor;
use std::sync::Arc;
use vug::codec::Codec;
use vug::codec::zerobit::bits::Popcount;
use vug::codec::zerobit::{Book, Coefficients, Layout, Params, Stream, Word, Zerobit, unit};
use vug::container::{BrickSink, CodecEntry, FileWriter, FinishOptions, Node, NodeFlags, VolumeDescriptor};
use vug::geometry::{Extent, Region};
use vug::grid::{Grid, ViewMut};
use vug::metrics::value_range;
use vug::voxel::{SampleType, SampleValue};

pub const TYPES: [SampleType; 4] = [SampleType::U8, SampleType::U16, SampleType::I16, SampleType::Rgb8];

/// A small generator, the same everywhere.
pub struct Random(pub u64);

impl Random {
    pub fn word(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ z >> 31
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.word() % n as u64) as usize
    }

    pub fn bytes(&mut self, len: usize) -> Vec<u8> {
        (0..len).map(|_| self.word() as u8).collect()
    }
}

/// A stored cell: index of its average (only the old stream can do without), and those of details by (node, detail): node 0 is level 0, 1 to 8 are level 1.
#[derive(Clone, Debug, Default)]
pub struct CellSpec {
    pub average: Option<u8>,
    pub details: BTreeMap<(u8, u8), u8>,
}

impl CellSpec {
    pub fn new(average: u8, details: &[((u8, u8), u8)]) -> CellSpec {
        CellSpec { average: Some(average), details: details.iter().copied().collect() }
    }

    fn node(&self, i: u8) -> Vec<u8> {
        self.details.keys().filter(|k| k.0 == i).map(|k| k.1).collect()
    }
}

/// Cells of a unit block by number; the others are null.
pub type UnitSpec = BTreeMap<u8, CellSpec>;

/// The bytes of a unit block of the new stream, padded.
pub fn new_unit(cells: &UnitSpec) -> Vec<u8> {
    let cbft = cells.keys().fold(0u64, |all, n| all | 1 << n);
    let (mut offsets, mut averages, mut zsms, mut dis) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for cell in cells.values() {
        let nodes: Vec<u8> = (1..=8).filter(|&i| !cell.node(i).is_empty()).collect();
        let level_0 = u32::from(!cell.node(0).is_empty());
        offsets.extend((dis.len() as u32 | (zsms.len() as u32 | level_0 << 15) << 16).to_le_bytes());
        averages.push(cell.average.expect("the new stream has one for every cell"));
        zsms.push(nodes.iter().fold(0u8, |byte, i| byte | 1 << (8 - i)));
        for i in (0..=8).filter(|&i| !cell.node(i).is_empty()) {
            let flag = if i == 0 { 0x80 } else { 0 };
            zsms.push(cell.node(i).iter().fold(flag, |map, j| map | 1 << (7 - j)));
        }
        dis.extend(cell.details.values());
    }
    let mut bytes = cbft.to_le_bytes().to_vec();
    [offsets, averages, zsms, dis].iter().for_each(|part| bytes.extend(part));
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    bytes
}

/// The bytes of a unit block of the old stream, padded.
pub fn old_unit(cells: &UnitSpec) -> Vec<u8> {
    let cbft = cells.keys().fold(0u64, |all, n| all | 1 << n);
    let (mut flags, mut offsets, mut indices) = (Vec::new(), Vec::new(), Vec::new());
    for cell in cells.values() {
        let word = cell.details.keys().fold(u64::from(cell.average.is_some()), |all, (i, j)| all | 1 << (7 * i + j));
        flags.extend(word.to_le_bytes());
        offsets.extend((indices.len() as u16).to_le_bytes());
        indices.extend(cell.average);
        indices.extend(cell.details.values());
    }
    let mut bytes = cbft.to_le_bytes().to_vec();
    [flags, offsets, indices].iter().for_each(|part| bytes.extend(part));
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    bytes
}

/// Linear numbers of the stored cells of Fig. 6; the paper's "cell 8" is the ninth.
pub const FIGURE_CELLS: [u8; 9] = [0, 1, 5, 6, 20, 21, 22, 40, 41];

/// The unit block of Fig. 6 from its description: indices of details count up from 0.
pub fn figure() -> UnitSpec {
    let mut next = 0;
    let mut cells = UnitSpec::new();
    for (rank, n) in (0u8..).zip(FIGURE_CELLS) {
        let mut places: Vec<(u8, u8)> = Vec::new();
        let mut node = |i: u8, details: &[u8]| places.extend(details.iter().map(|&j| (i, j)));
        match rank {
            0 => {
                node(0, &[1, 2, 4]);
                node(1, &[3, 6, 7]);
            }
            8 => {
                node(0, &[1, 4, 6]);
                node(3, &[1, 7]);
                node(5, &[2, 3, 5, 7]);
            }
            _ => {
                node(0, &[1, 2, 4]);
                node(rank + 1, &[3, 6]);
            }
        }
        let details: BTreeMap<(u8, u8), u8> = places.into_iter().zip(next..).collect();
        next += details.len() as u8;
        cells.insert(n, CellSpec { average: Some(10 + rank), details });
    }
    cells
}

/// A payload of unit blocks; an empty one is void.
pub fn payload(stream: Stream, book: u32, units: &[UnitSpec]) -> Vec<u8> {
    let mut bytes = book.to_le_bytes().to_vec();
    bytes.extend((units.len() as u32).to_le_bytes());
    bytes.extend([0; 8]);
    let (mut directory, mut blocks) = (Vec::new(), Vec::new());
    for unit in units {
        let at = bytes.len() + 4 * units.len() + blocks.len();
        let entry = if unit.is_empty() { 0 } else { unit.len() as u32 | (at as u32 / 4) << 8 };
        directory.extend(entry.to_le_bytes());
        if !unit.is_empty() {
            blocks.extend(if stream == Stream::New { new_unit(unit) } else { old_unit(unit) });
        }
    }
    bytes.extend(directory);
    bytes.extend(blocks);
    bytes
}

/// The unit blocks of a payload, as the plain decoder finds them.
pub fn parse(stream: Stream, payload: &[u8], brick: Extent) -> Vec<UnitSpec> {
    let spec = |cell: &dyn Fn(u8, u8) -> Option<u8>, average| CellSpec {
        average,
        details: (0..9)
            .flat_map(|i| (1..8).map(move |j| (i, j)))
            .filter_map(|(i, j)| cell(i, j).map(|index| ((i, j), index)))
            .collect(),
    };
    let count = Popcount;
    let parse_unit = |index: usize| {
        let Some(unit) = unit(payload, index) else { return UnitSpec::new() };
        let cell = |n: u32| match stream {
            Stream::New => unit
                .cell(n, count)
                .map(|c| spec(&|i, j| c.detail(i.into(), j.into(), count, &mut ()), c.average(&mut ()))),
            Stream::Old => unit
                .old_cell(n, count)
                .map(|c| spec(&|i, j| c.detail(i.into(), j.into(), count, &mut ()), c.average(&mut ()))),
        };
        (0..64u8).filter_map(|n| cell(n.into()).map(|cell| (n, cell))).collect()
    };
    (0..Layout::new(brick).units.voxels() as usize).map(parse_unit).collect()
}

/// A word of a type, from one number.
pub fn word(t: SampleType, v: i32) -> Word {
    if t == SampleType::Rgb8 { [v, v / 2, v / 3] } else { [v, 0, 0] }
}

/// A codebook with `averages` and `details` words that differ.
pub fn book(t: SampleType, averages: usize, details: usize) -> Book {
    let (scale, shift) = match t {
        SampleType::U8 | SampleType::Rgb8 => (1, 0),
        SampleType::I16 => (200, -25_000),
        _ => (250, 0),
    };
    let wide = if scale == 1 { 1 } else { 100 };
    Book::new(
        t,
        (0..averages as i32).map(|i| word(t, i * scale + shift)).collect(),
        (0..details as i32).map(|i| word(t, (i % 256 - 128) * wide)).collect(),
    )
    .unwrap()
}

/// A codec with null value 7 and these codebooks.
pub fn codec(stream: Stream, t: SampleType, books: Vec<Book>) -> Codec {
    Codec::Zerobit(Zerobit::new(stream, Params::new(30_000).unwrap(), null(t))).with_books(&Arc::from(books))
}

pub fn null(t: SampleType) -> SampleValue {
    match t {
        SampleType::U8 => SampleValue::U8(7),
        SampleType::U16 => SampleValue::U16(7),
        SampleType::I16 => SampleValue::I16(7),
        SampleType::F32 => SampleValue::F32(7.0),
        SampleType::Rgb8 => SampleValue::Rgb8([7; 3]),
    }
}

/// Random unit blocks of a brick: null cells, cells with few and with many details; none outside the brick.
pub fn units(random: &mut Random, brick: Extent, words: [usize; 2]) -> Vec<UnitSpec> {
    let layout = Layout::new(brick);
    let mut units = vec![UnitSpec::new(); layout.units.voxels() as usize];
    let dense = [1, 3, 20][random.below(3)];
    for z in (0..brick.z).step_by(4) {
        for y in (0..brick.y).step_by(4) {
            for x in (0..brick.x).step_by(4) {
                let (unit, n) = layout.locate([x, y, z]);
                if unit % 3 == 2 || random.below(3) == 0 {
                    continue; // void unit blocks, null cells
                }
                let mut cell = CellSpec { average: Some(random.below(words[0]) as u8), ..CellSpec::default() };
                for i in 0..9 {
                    for j in 1..8 {
                        if random.below(dense + 1) == 0 && i % 2 == 0 {
                            cell.details.insert((i, j), random.below(words[1]) as u8);
                        }
                    }
                }
                units[unit].insert(n as u8, cell);
            }
        }
    }
    units
}

/// Decodes a whole brick.
pub fn decode(codec: &Codec, payload: &[u8], brick: Extent, t: SampleType) -> Grid {
    let mut grid = Grid::zeros(brick, t).unwrap();
    codec.decode(payload, brick, &Region::whole(brick), grid.view_mut()).unwrap();
    grid
}

/// Decodes a whole brick at half or quarter resolution.
pub fn reduced(codec: &Codec, payload: &[u8], brick: Extent, t: SampleType, steps: u8) -> Grid {
    let extent = brick.div_ceil(Extent::cube(1 << steps));
    let mut bytes = vec![0; extent.voxels() as usize * t.bytes()];
    codec.decode_reduced(payload, brick, steps, &Region::whole(extent), ViewMut::dense(&mut bytes, extent, t)).unwrap();
    let mut grid = Grid::zeros(extent, t).unwrap();
    grid.bytes_mut().copy_from_slice(&bytes);
    grid
}

/// Descriptor of a volume of one level.
pub fn descriptor(dims: Extent, brick_log2: u8, t: SampleType, codec: &Codec) -> VolumeDescriptor {
    let (id, stream_version, params) = codec.to_wire();
    VolumeDescriptor {
        dims,
        time_steps: 1,
        channels: 1,
        sample_type: t,
        lod_count: 1,
        brick_log2,
        downsample: Default::default(),
        codecs: vec![CodecEntry { id, stream_version, params }],
        placement: vug::affine::Placement::from_spacing([1.0; 3], [0.0; 3]),
        null_value: VolumeDescriptor::null_field(null(t)),
        value_map: vug::affine::ValueMap::default(),
        source_range: (0.0, 255.0),
        achieved: None,
        payload_bytes: 0,
        replaced: 0,
    }
}

/// The stored bytes of codebooks.
pub fn stored(books: &[Book], t: SampleType) -> Vec<u8> {
    let mut bytes = Vec::new();
    books.iter().for_each(|b| b.write_to(t, &mut bytes));
    bytes
}

/// The codebooks of [`file`].
pub fn two_books(t: SampleType) -> Vec<Book> {
    vec![book(t, 9, 4), book(t, 256, 256)]
}

/// A file of random bricks; `kind` says which ones are EMPTY (0), CONSTANT (1) or stored (2). Also its payloads.
pub fn file(
    dims: Extent,
    brick_log2: u8,
    t: SampleType,
    stream: Stream,
    kind: impl Fn([u32; 3]) -> u8,
) -> (Vec<u8>, Vec<Vec<u8>>) {
    file_with(dims, brick_log2, t, stream, kind, Some((stored(&two_books(t), t), 2)))
}

/// A file as [`file`] makes it, with other bytes for section `CBOK`.
pub fn file_with(
    dims: Extent,
    brick_log2: u8,
    t: SampleType,
    stream: Stream,
    kind: impl Fn([u32; 3]) -> u8,
    codebooks: Option<(Vec<u8>, u64)>,
) -> (Vec<u8>, Vec<Vec<u8>>) {
    let books = two_books(t);
    let codec = codec(stream, t, books.clone());
    let mut d = descriptor(dims, brick_log2, t, &codec);
    let mut w = FileWriter::new(Cursor::new(Vec::new()), &d).unwrap();
    let octree = w.octree().clone();
    let mut random = Random(dims.voxels());
    let mut payloads = Vec::new();
    let [bx, by, bz] = octree.levels[0].bricks.to_array();
    for brick in (0..bz).flat_map(|z| (0..by).flat_map(move |y| (0..bx).map(move |x| [x, y, z]))) {
        let extent = octree.brick_extent(0, brick);
        match kind(brick) {
            0 => {}
            1 => w
                .put_constant(
                    0,
                    0,
                    brick,
                    &Node::new_constant(SampleValue::from_raw(t, 33).unwrap(), NodeFlags::default(), None),
                )
                .unwrap(),
            _ => {
                let which = payloads.len() % 2;
                let words = [[9, 4], [256, 256]][which];
                let payload = payload(stream, which as u32, &units(&mut random, extent, words));
                let range = value_range(&decode(&codec, &payload, extent, t).view()).unwrap();
                let node = Node::new_stored(0, NodeFlags::default(), range, None);
                d.payload_bytes += payload.len() as u64;
                w.put_stored(0, 0, brick, &node, &payload).unwrap();
                payloads.push(payload);
            }
        }
    }
    let options = FinishOptions { codebooks, ..FinishOptions::default() };
    (w.finish(&d, options).unwrap().0.into_inner(), payloads)
}
