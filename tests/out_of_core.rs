//! Volumes larger than memory, and larger than anything: what they take of the heap, and what they cost to look at.

#[path = "support/heap.rs"]
mod heap;
mod support;

use heap::{ALONE, peak};
use std::ops::Range;
use support::hash;
use vug::codec::Codec;
use vug::grid::SlabReader;
use vug::limits::Limits;
use vug::source::FileSource;
use vug::volume::{
    At, Axis, CodecChoice, CopyOptions, EncodeOptions, Shape, Volume, VolumeWriter, ZstdPolicy, encode, verify,
};
use vug::{Extent, Grid, Region, SampleType};

const MIB: usize = 1 << 20;

/// Synthetic bytes that are made when they are asked for, once and in order, as from a pipe.
struct Pipe {
    extent: Extent,
    next: u64,
    noise: Vec<u8>,
}

impl Pipe {
    fn new(extent: Extent) -> Self {
        Pipe { extent, next: 0, noise: (0..1 << 16).map(|i| (hash([i, 7, 7]) >> 26) as u8).collect() }
    }
}

impl SlabReader for Pipe {
    fn extent(&self) -> Extent {
        self.extent
    }
    fn sample_type(&self) -> SampleType {
        SampleType::U8
    }
    fn read_slab(&mut self, z: Range<u32>, out: &mut [u8]) -> vug::Result<()> {
        self.read_rows(z, 0..self.extent.y, out)
    }
    fn read_rows(&mut self, z: Range<u32>, y: Range<u32>, out: &mut [u8]) -> vug::Result<()> {
        let mut rows = out.chunks_exact_mut(self.extent.x as usize);
        for z in z {
            for y in y.clone() {
                assert_eq!(self.next, self.extent.index([0, y, z]), "once, and in order");
                self.next += u64::from(self.extent.x);
                for (i, piece) in rows.next().unwrap().chunks_mut(4096).enumerate() {
                    let from = hash([y, z, i as u32]) as usize % (self.noise.len() - 4096);
                    piece.copy_from_slice(&self.noise[from..from + piece.len()]);
                }
            }
        }
        Ok(())
    }
    fn is_sequential(&self) -> bool {
        true
    }
}

#[test] // S-05: whatever the size of a slab, memory stays below what is allowed
fn memory_is_kept_within() {
    let _alone = ALONE.lock().unwrap_or_else(|e| e.into_inner());
    // A slab of bricks of 64 planes is 96 MiB, of all levels 128.
    let extent = Extent::new(2048, 768, 96);
    let mut files = Vec::new();
    for (memory, jobs, codec) in [
        (256 * MIB, 2, CodecChoice::S3dc),
        (48 * MIB, 2, CodecChoice::S3dc),
        (40 * MIB, 1, CodecChoice::S3dc),
        (48 * MIB, 2, CodecChoice::Raw),
    ] {
        let temp_dir = tempfile::tempdir().unwrap();
        let options = EncodeOptions {
            codec,
            levels: 0,
            memory: memory as u64,
            temp_dir: Some(temp_dir.path().to_owned()),
            ..EncodeOptions::default()
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(jobs).build().unwrap();
        let mut out = tempfile::tempfile().unwrap();
        let mut source = Pipe::new(extent);
        let (report, heap) = peak(|| pool.install(|| encode(&mut source, &mut out, &options, &mut |_, _| {}).unwrap()));
        let mib = |b: usize| b as f64 / MIB as f64;
        println!("{codec:?}, {jobs} threads: {:.1} MiB of heap, {:.1} allowed", mib(heap), mib(memory));
        assert!(heap <= memory, "{heap} > {memory}");
        assert_eq!(report.notes.iter().any(|n| n.contains("temporary")), memory < 200 * MIB, "{:?}", report.notes);
        assert_eq!(std::fs::read_dir(temp_dir.path()).unwrap().count(), 0, "no debris");
        if codec == CodecChoice::S3dc {
            use std::io::{Read, Seek};
            let mut bytes = Vec::new();
            out.rewind().unwrap();
            out.read_to_end(&mut bytes).unwrap();
            files.push(bytes);
        }
    }
    assert!(files.windows(2).all(|pair| pair[0] == pair[1]), "memory and threads do not show");
}

#[test] // S-05: bricks that inflate much are not all inflated at once
fn inflating_keeps_memory_within() {
    let _alone = ALONE.lock().unwrap_or_else(|e| e.into_inner());
    // 10 bricks of 256³ bytes, one voxel of which is another than all others.
    let shape = Shape::single(Extent::new(2560, 256, 256), SampleType::U8);
    let options = EncodeOptions::default();
    let mut file = std::io::Cursor::new(Vec::new());
    let mut writer = VolumeWriter::create(&mut file, shape, Codec::Raw, 8, &options).unwrap();
    let mut brick = Grid::zeros(Extent::cube(256), SampleType::U8).unwrap();
    brick.samples_mut::<u8>()[12345] = 1;
    for x in 0..10 {
        writer.write_brick(At::default(), [x, 0, 0], brick.view()).unwrap();
    }
    drop(writer.finish().unwrap());
    assert!(file.get_ref().len() < 1 << 20, "{}", file.get_ref().len());
    let volume = support::open(file.into_inner());
    let excerpt = volume.excerpt(&CopyOptions { zstd: ZstdPolicy::Inflate, ..CopyOptions::default() }).unwrap();
    let out = tempfile::tempfile().unwrap();
    let ((out, report), heap) = peak(|| excerpt.write_head(out, &mut |_, _| {}).unwrap());
    println!("{} bricks of 16 MiB inflated: {:.1} MiB of heap", report.converted, heap as f64 / MIB as f64);
    assert_eq!((report.converted, report.file.stored), (10, 10));
    assert!(out.metadata().unwrap().len() > 160 << 20);
    assert!(heap < 72 * MIB, "{heap} bytes");
}

/// 2^48 voxels; the largest there can be.
const LOGICAL: Extent = Extent::new(1 << 20, 1 << 20, 1 << 8);

#[test] // D-40, D-59, D-60
fn a_volume_of_2_to_the_48_voxels_costs_kilobytes() {
    let _alone = ALONE.lock().unwrap_or_else(|e| e.into_inner());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("logical.vug");
    let options = EncodeOptions { levels: 0, ..EncodeOptions::default() };
    let out = std::fs::File::create(&path).unwrap();
    let shape = Shape::single(LOGICAL, SampleType::U8);
    let mut writer = VolumeWriter::create(out, shape, Codec::Raw, 6, &options).unwrap();
    let brick = Grid::from_fn(Extent::cube(64), |c| (hash(c) % 200) as u8).unwrap();
    let corners = [[0, 0, 0], [16_383, 16_383, 3], [12_345, 777, 2]];
    for corner in corners {
        writer.write_brick(At::default(), corner, brick.view()).unwrap();
    }
    let (_, report) = writer.finish().unwrap();
    assert_eq!(report.bricks[0], 3);

    let (volume, heap) = peak(|| Volume::open(FileSource::open(&path).unwrap(), Limits::default()).unwrap());
    assert_eq!(volume.levels().len(), 15, "down to one brick");
    assert!(heap < 256 << 10, "{heap} bytes to open");
    let len = volume.file_len();
    assert!(len < 2 << 20, "{len} bytes for three bricks and what leads to them");
    let (_, heap) = peak(|| {
        for corner in corners {
            let c = corner.map(|v| v * 64 + 5);
            assert_eq!(volume.voxel(At::default(), c).unwrap(), brick.value([5; 3]).unwrap());
        }
        assert_eq!(volume.voxel(At::default(), [500_000, 500_000, 100]).unwrap().component(0), 0.0);
        let nothing = Region { start: [400_000, 400_000, 0], end: [400_100, 400_100, 256] };
        assert_eq!(volume.read_region(At::default(), nothing).unwrap().range(), Some((0.0, 0.0)));
        let bounds = volume.bounds(At::lod(14), Region { start: [0; 3], end: [64, 64, 1] }).unwrap();
        assert_eq!((bounds.min, bounds.max), (0.0, 199.0), "the root knows of the bricks below it");
        let counts = volume.brick_counts().unwrap();
        assert_eq!((counts.stored, counts.constant), (3, 0));
        assert!(counts.empty > 1 << 30);
    });
    println!("{LOGICAL}: {len} bytes of file, {heap} bytes of heap for queries, {:?}", volume.cost());
    // Three bricks of 256 KiB, a result of 2.6 MB, and a page (24 KiB in memory) for each level of each of them.
    assert!(heap < 6 * MIB, "{heap} bytes");
    assert!(volume.cost().reads < 120, "{:?}", volume.cost());
    let (checked, heap) = peak(|| verify(&FileSource::open(&path).unwrap(), &Limits::default(), &mut |_, _| {}));
    assert!(checked.is_ok(), "{:?}", checked.errors);
    assert!(heap < 6 * MIB, "{heap} bytes to verify");
}

#[test] // a plane may touch bricks whose payloads inflate to a thousand times what is stored
fn planes_are_read_within_bounds() {
    let _alone = ALONE.lock().unwrap_or_else(|e| e.into_inner());
    /// Stripes: nothing is constant, and zstd leaves next to nothing of it.
    struct Stripes(Extent);
    impl SlabReader for Stripes {
        fn extent(&self) -> Extent {
            self.0
        }
        fn sample_type(&self) -> SampleType {
            SampleType::U8
        }
        fn read_slab(&mut self, _: Range<u32>, out: &mut [u8]) -> vug::Result<()> {
            out.iter_mut().enumerate().for_each(|(i, v)| *v = (i & 1) as u8);
            Ok(())
        }
    }
    let extent = Extent::new(64, 4096, 2048);
    let mut out = std::io::Cursor::new(Vec::new());
    let options = EncodeOptions { codec: CodecChoice::Raw, ..EncodeOptions::default() };
    encode(&mut Stripes(extent), &mut out, &options, &mut |_, _| {}).unwrap();
    let bytes = out.into_inner();
    assert!(bytes.len() < 2 * MIB, "{}", bytes.len());
    let limits = Limits { cache_bytes: 8 << 20, ..Limits::default() };
    let volume = Volume::open(vug::source::MemorySource(bytes), limits).unwrap();
    // Across x: 64 layers of 64 bricks. Across z: one layer of 64, decoded at once.
    for (axis, bound) in [(Axis::X, 260 * MIB), (Axis::Z, 40 * MIB)] {
        let (plane, heap) = peak(|| volume.plane(At::default(), axis, 1).unwrap());
        println!("{axis:?}: {:.0} MiB of heap, {} allowed", heap as f64 / MIB as f64, bound / MIB);
        assert_eq!(plane.range(), Some(if axis == Axis::X { (1.0, 1.0) } else { (0.0, 1.0) }));
        assert!(heap < bound, "{axis:?}: {heap}, of {} MiB in all", extent.voxels() as usize / MIB);
    }
}
