//! What each access costs, as counts: reads and bytes, from memory, files and maps alike (spec chapter 9).

mod support;

use support::{ball, encode, explicit, open};
use vug::limits::Limits;
use vug::source::{ByteSource, FileSource, MemorySource, MmapSource};
use vug::volume::{At, Axis, Cost, EncodeOptions, Volume};
use vug::{Code, Extent, Grid, Region};

/// A source that cannot lend its bytes, as a network cannot.
struct Remote(Vec<u8>);

impl ByteSource for Remote {
    fn len(&self) -> u64 {
        self.0.len() as u64
    }
    fn read_at(&self, offset: u64, out: &mut [u8]) -> vug::Result<()> {
        MemorySource(&self.0[..]).read_at(offset, out)
    }
}

fn remote(bytes: &[u8]) -> Volume {
    Volume::open(Remote(bytes.to_vec()), Limits::default()).unwrap()
}

/// Large enough for 16 KiB of reserved head, with all tables in it.
fn large() -> (Grid, Vec<u8>) {
    let mut grid = support::noise(Extent::new(200, 190, 210), |h| (h >> 24) as u8);
    let bytes = encode(&mut grid, &EncodeOptions { zstd: false, ..explicit(8, 4) }).0;
    (grid, bytes)
}

/// So many bricks that the pages do not fit in the head: 20×20×20 of 16³.
fn many_bricks() -> Vec<u8> {
    let mut grid = support::noise(Extent::cube(320), |h| (h >> 24) as u8);
    let options = EncodeOptions { zstd: false, brick: Some(16), ..explicit(4, 4) };
    encode(&mut grid, &options).0
}

#[test] // spec: VAL-7
fn open_is_one_read_and_the_first_voxel_one_or_two_more() {
    let (_, small) = large();
    let volume = remote(&small);
    assert_eq!(volume.cost(), Cost { reads: 1, bytes: 16384 });
    volume.voxel(At::default(), [100, 100, 100]).unwrap();
    assert_eq!(volume.cost().reads, 2, "the page lies in the head");

    let many = many_bricks();
    let volume = remote(&many);
    assert_eq!(volume.cost().reads, 1);
    volume.voxel(At::default(), [10, 10, 10]).unwrap();
    assert_eq!(volume.cost().reads, 3, "open, page, payload");
    volume.voxel(At::default(), [11, 12, 13]).unwrap();
    assert_eq!(volume.cost().reads, 3, "the brick is kept");
    volume.voxel(At::default(), [20, 10, 10]).unwrap();
    assert_eq!(volume.cost().reads, 4, "the next brick of the same page costs one");
}

#[test]
fn one_more_where_the_directory_does_not_fit_the_head() {
    // 2,000 pages: more entries than 16 KiB hold. The volume is nearly empty, so that it is small all the same.
    let extent = Extent::new(16 * 8 * 2000, 16, 16);
    let mut grid = Grid::zeros(extent, vug::SampleType::U8).unwrap();
    for brick in 0..2000 * 8 {
        grid.samples_mut::<u8>()[brick * 16] = 1;
        grid.samples_mut::<u8>()[brick * 16 + 1] = 2;
    }
    let options = EncodeOptions { zstd: false, brick: Some(16), ..explicit(1, 16) };
    let volume = remote(&encode(&mut grid, &options).0);
    assert_eq!(volume.cost().reads, 1);
    assert_eq!(volume.voxel(At::default(), [1, 0, 0]).unwrap().component(0), 2.0);
    assert_eq!(volume.cost().reads, 4, "open, directory chunk, page, payload");
}

#[test]
fn regions_read_neighbouring_bricks_together() {
    let bytes = many_bricks();
    let volume = remote(&bytes);
    volume.voxel(At::default(), [0, 0, 0]).unwrap();
    volume.reset_cost();
    // Eight bricks in a row along x, all of one page, one of them kept: their payloads lie side by side.
    volume.read_region(At::default(), Region { start: [0, 0, 0], end: [128, 16, 16] }).unwrap();
    assert_eq!(volume.cost().reads, 1);
    volume.reset_cost();
    volume.read_region(At::default(), Region { start: [0, 0, 0], end: [128, 16, 16] }).unwrap();
    assert_eq!(volume.cost().reads, 0, "a second time nothing is read");
}

#[test] // S-38: O(1) reads for any access
fn planes_blocks_and_bricks_cost_what_they_touch() {
    let (grid, bytes) = large();
    for (axis, bricks) in [(Axis::X, 3 * 4), (Axis::Y, 4 * 4), (Axis::Z, 4 * 3)] {
        let volume = remote(&bytes);
        let plane = volume.plane(At::default(), axis, 77).unwrap();
        assert_eq!(plane.extent().to_array()[axis as usize], 1);
        let cost = volume.cost();
        assert!(cost.reads <= 1 + bricks, "{axis:?}: {cost:?}");
        let mut region = Region::whole(grid.extent());
        (region.start[axis as usize], region.end[axis as usize]) = (77, 78);
        assert_eq!(plane.bytes(), volume.read_region(At::default(), region).unwrap().bytes());
    }
    let volume = remote(&bytes);
    let (region, block) = volume.block(At::default(), [70, 69, 130]).unwrap();
    assert_eq!((region.start, block.extent()), ([68, 68, 128], Extent::cube(4)));
    assert_eq!(volume.cost().reads, 2);
    let brick = volume.read_brick(At::default(), [3, 2, 3]).unwrap();
    assert_eq!(brick.extent(), Extent::new(200 - 192, 190 - 128, 210 - 192), "cropped to the volume");
    assert_eq!(volume.cost().reads, 3);
}

#[test]
fn bounds_read_pages_only() {
    let bytes = many_bricks();
    let volume = remote(&bytes);
    let bounds = volume.bounds(At::default(), Region { start: [0; 3], end: [128; 3] }).unwrap();
    assert_eq!(volume.cost().reads, 2, "open and one page");
    let decoded = volume.read_region(At::default(), Region { start: [0; 3], end: [128; 3] }).unwrap();
    let (min, max) = decoded.range().unwrap();
    assert_eq!((f64::from(bounds.min), f64::from(bounds.max)), (min, max));
    assert!(bounds.max_error.is_some());
}

#[test] // S-37, K-27: closed interval, no voxel is missed, and blocks are skipped
fn blocks_overlapping_misses_no_voxel() {
    let extent = Extent::new(70, 66, 67);
    let mut grid = ball(extent);
    let volume = open(encode(&mut grid, &explicit(4, 4)).0);
    let decoded = volume.read(At::default()).unwrap();
    for (lo, hi) in [(100.0, 120.0), (0.0, 0.0), (60.0, 60.0), (250.0, 255.0), (99.0, 99.0)] {
        let regions = volume.blocks_overlapping(At::default(), lo, hi).unwrap();
        let mut covered = vec![false; decoded.samples::<u8>().len()];
        let mut voxels = 0u64;
        for r in &regions {
            voxels += r.extent().voxels();
            for z in r.start[2]..r.end[2] {
                for y in r.start[1]..r.end[1] {
                    for x in r.start[0]..r.end[0] {
                        covered[extent.index([x, y, z]) as usize] = true;
                    }
                }
            }
        }
        for (v, covered) in decoded.samples::<u8>().iter().zip(covered) {
            assert!(covered || f64::from(*v) < lo || f64::from(*v) > hi, "{v} in [{lo}, {hi}] was skipped");
        }
        assert!(voxels < extent.voxels(), "[{lo}, {hi}] skips something");
    }
}

#[test]
#[allow(unsafe_code, reason = "maps a file of this test's own")]
fn every_transport_gives_the_same_voxels_at_the_same_cost() {
    let (_, bytes) = large();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.vug");
    std::fs::write(&path, &bytes).unwrap();
    let volumes = [
        open(bytes.clone()),
        remote(&bytes),
        Volume::open(FileSource::open(&path).unwrap(), Limits::default()).unwrap(),
        // SAFETY: nobody else touches the file.
        Volume::open(unsafe { MmapSource::open(&path) }.unwrap(), Limits::default()).unwrap(),
    ];
    let region = Region { start: [60, 1, 62], end: [140, 66, 130] };
    let first = volumes[0].read_region(At::default(), region).unwrap();
    let coords: Vec<_> = (0..1000).map(|i| [i * 7 % 200, i * 13 % 190, i * 29 % 210]).collect();
    let mut values = vec![0u8; coords.len()];
    volumes[0].voxels(At::default(), &coords, &mut values).unwrap();
    for volume in &volumes[1..] {
        assert_eq!(volume.read_region(At::default(), region).unwrap().bytes(), first.bytes());
        let mut again = vec![0u8; coords.len()];
        volume.voxels(At::default(), &coords, &mut again).unwrap();
        assert_eq!(again, values);
        for (&c, &v) in coords.iter().zip(&values).step_by(17) {
            assert_eq!(volume.get::<u8>(At::default(), c).unwrap(), v);
        }
    }
    assert_eq!(volumes[1].cost(), volumes[2].cost());
}

#[test] // B-04: outside is an error, not a clamp
fn outside_is_an_error() {
    let (_, bytes) = large();
    let volume = open(bytes);
    for c in [[200, 0, 0], [0, 190, 0], [0, 0, 210], [u32::MAX; 3]] {
        assert_eq!(volume.voxel(At::default(), c).unwrap_err().code(), Code::Range);
        assert_eq!(volume.block(At::default(), c).unwrap_err().code(), Code::Range);
        assert_eq!(volume.voxels(At::default(), &[c], &mut [0u8]).unwrap_err().code(), Code::Range);
    }
    for at in [At { time: 1, ..At::default() }, At { channel: 1, ..At::default() }, At::lod(1), At::lod(255)] {
        assert_eq!(volume.voxel(at, [0; 3]).unwrap_err().code(), Code::Range);
    }
    assert_eq!(volume.get::<u16>(At::default(), [0; 3]).unwrap_err().code(), Code::Param);
    assert_eq!(volume.plane(At::default(), Axis::Y, 190).unwrap_err().code(), Code::Range);
    assert_eq!(volume.read_brick(At::default(), [4, 0, 0]).unwrap_err().code(), Code::Range);
    let empty = Region { start: [5; 3], end: [5; 3] };
    assert_eq!(volume.read_region(At::default(), empty).unwrap_err().code(), Code::Range);
}

#[test]
fn many_threads_may_read_one_volume() {
    /// A source slow enough that all threads want the same page at once.
    struct Slow(Vec<u8>);
    impl ByteSource for Slow {
        fn len(&self) -> u64 {
            self.0.len() as u64
        }
        fn read_at(&self, offset: u64, out: &mut [u8]) -> vug::Result<()> {
            std::thread::sleep(std::time::Duration::from_millis(2));
            MemorySource(&self.0[..]).read_at(offset, out)
        }
    }
    let bytes = many_bricks();
    let whole = open(bytes.clone());
    for round in 0..8 {
        let volume = Volume::open(Slow(bytes.clone()), Limits::default()).unwrap();
        std::thread::scope(|scope| {
            for thread in 0..4u32 {
                let (volume, whole) = (&volume, &whole);
                scope.spawn(move || {
                    for i in 0..20u32 {
                        let c = [(i * 37 + round) % 320, (i * 11 + thread) % 320, i * 5 % 320];
                        assert_eq!(volume.voxel(At::default(), c).unwrap(), whole.voxel(At::default(), c).unwrap());
                    }
                });
            }
        });
        let counts = volume.brick_counts().unwrap();
        assert_eq!(counts, whole.brick_counts().unwrap());
    }
}
