//! What opening and encoding take of the heap, measured: every allocation of this test binary is counted.

#[path = "support/heap.rs"]
mod heap;
mod support;

use heap::{ALONE, peak};

use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::path::Path;
use vug::codec::Codec;
use vug::codec::s3dc::{Endpoints, Params};
use vug::container::{BrickSink, CodecEntry, FileWriter, FinishOptions, Node, NodeFlags, VolumeDescriptor};
use vug::limits::Limits;
use vug::source::FileSource;
use vug::volume::{At, Cost, Volume};
use vug::{Extent, Grid, SampleType};

#[test]
fn the_counter_counts() {
    let _alone = ALONE.lock().unwrap_or_else(|e| e.into_inner());
    let (kept, bytes) = peak(|| {
        drop(vec![1u8; 5 << 20]);
        vec![2u8; 1 << 20]
    });
    assert!((5 << 20..(5 << 20) + 100_000).contains(&bytes), "{bytes}");
    drop(kept);
}

const EDGE: u32 = 64;
/// 90³ bricks, as large as S3Dc with 4 bits and 4³ blocks makes them: 729,000 times 136 KiB.
const BRICKS: u32 = 90;
const PAYLOAD: usize = 64 * 64 * 64 / 2 + 16 * 16 * 16 * 2;
/// Payload of every brick but the first.
static NOTHING: [u8; PAYLOAD] = [0; PAYLOAD];

/// Writes a sparse file: the payload [`NOTHING`] and everything else that is zero becomes a hole. So do the leaders beyond
/// the first MiB, which would cost a block of the disk each and which no reader of a whole index looks at.
struct Sparse {
    file: File,
    at: u64,
}

impl Write for Sparse {
    fn write(&mut self, buf: &[u8]) -> io::Result<usize> {
        let nothing = std::ptr::eq(buf.as_ptr(), NOTHING.as_ptr());
        let leader = buf.len() == 32 && buf.starts_with(b"VBRK") && self.at > 1 << 20;
        if !nothing && !leader && buf.iter().any(|b| *b != 0) {
            self.file.seek(SeekFrom::Start(self.at))?;
            self.file.write_all(buf)?;
        }
        self.at += buf.len() as u64;
        Ok(buf.len())
    }
    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Seek for Sparse {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let SeekFrom::Start(at) = to else { return Err(io::ErrorKind::Unsupported.into()) };
        self.at = at;
        Ok(at)
    }
}

fn ramp([x, y, z]: [u32; 3]) -> u8 {
    (x + y + z) as u8 / 2 + 10
}

/// The file, and its length.
fn write_100_gb(path: &Path) -> u64 {
    let codec = Codec::S3dc(Params::new(4, Extent::cube(4), Endpoints::MinMax).unwrap());
    let (id, stream_version, params) = codec.to_wire();
    let descriptor = VolumeDescriptor {
        dims: Extent::cube(EDGE * BRICKS),
        time_steps: 1,
        channels: 1,
        sample_type: SampleType::U8,
        lod_count: 1,
        brick_log2: 6,
        downsample: Default::default(),
        codecs: vec![CodecEntry { id, stream_version, params }],
        placement: Default::default(),
        null_value: [0; 4],
        value_map: Default::default(),
        source_range: (0.0, 255.0),
        achieved: None,
        payload_bytes: u64::from(BRICKS).pow(3) * PAYLOAD as u64,
        replaced: 0,
    };
    let mut first = Vec::new();
    codec.encode(Grid::from_fn(Extent::cube(EDGE), ramp).unwrap().view(), &mut first).unwrap();
    assert_eq!(first.len(), PAYLOAD);
    let out = Sparse { file: File::create(path).unwrap(), at: 0 };
    let mut writer = FileWriter::new(out, &descriptor).unwrap();
    let node = Node::new_stored(0, NodeFlags::default(), (0.0, 255.0), None);
    for z in 0..BRICKS {
        for y in 0..BRICKS {
            for x in 0..BRICKS {
                let payload = if [x, y, z] == [0; 3] { &first[..] } else { &NOTHING };
                writer.put_stored(0, 0, [x, y, z], &node, payload).unwrap();
            }
        }
    }
    let (out, summary) = writer.finish(&descriptor, FinishOptions::default()).unwrap();
    out.file.set_len(summary.len).unwrap();
    summary.len
}

/// Whether files in `folder` can have holes: 1 GiB of nothing takes no room.
#[cfg(unix)]
fn holes(folder: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let probe = File::create(folder.join("probe")).unwrap();
    probe.set_len(1 << 30).is_ok() && probe.metadata().unwrap().blocks() < 1 << 10
}

#[cfg(not(unix))]
fn holes(_: &Path) -> bool {
    false
}

#[test] // S-38; spec: VAL-9
fn a_file_of_100_gb_opens_with_less_than_1_mb() {
    let _alone = ALONE.lock().unwrap_or_else(|e| e.into_inner());
    let folder = tempfile::tempdir().unwrap();
    if !holes(folder.path()) {
        println!("skipped: no sparse files in {}", folder.path().display());
        return;
    }
    let path = folder.path().join("large.vug");
    let len = write_100_gb(&path);
    assert!(len >= 100_000_000_000, "{len}");
    assert_eq!(std::fs::metadata(&path).unwrap().len(), len);

    let (volume, heap) = peak(|| {
        let volume = Volume::open(FileSource::open(&path).unwrap(), Limits::default()).unwrap();
        assert_eq!(volume.cost(), Cost { reads: 1, bytes: 16_384 });
        let c = [1, 2, 3];
        let value = volume.get::<u8>(At::default(), c).unwrap();
        assert!(value.abs_diff(ramp(c)) <= 1, "{value}");
        volume
    });
    println!("{len} bytes, first voxel: {:?}, {heap} bytes of heap at most", volume.cost());
    assert_eq!(volume.cost().reads, 4, "head, directory chunk (1,728 pages do not fit the head), page, payload");
    assert!(heap < 1_000_000, "{heap} bytes");
    // The far end costs its own chunk, page and payload, and no more.
    volume.reset_cost();
    let far = [EDGE * BRICKS - 1; 3];
    assert_eq!(volume.get::<u8>(At::default(), far).unwrap(), 0);
    assert_eq!(volume.cost().reads, 3);
    assert!(volume.cost().bytes < 200_000, "{:?}", volume.cost());
}

mod zerobit {
    use super::*;
    use std::ops::Range;
    use std::time::Instant;
    use vug::grid::SlabReader;
    use vug::volume::{CodecChoice, EncodeOptions, EncodeReport, Quality};

    const MIB: usize = 1 << 20;

    /// Soft colours with a little grain in a cylinder, black around it; made when they are asked for.
    struct Synthetic {
        extent: Extent,
        soft: Vec<u8>,
        grain: Vec<u8>,
    }

    impl Synthetic {
        fn new(edge: u32) -> Self {
            let soft = (0..8 * edge).map(|i| (127.0 + 100.0 * (f64::from(i) * 12.0 / f64::from(edge)).sin()) as u8);
            let grain = (0..1024).map(|i| (support::hash([i, 0, 0]) % 9) as u8);
            Synthetic { extent: Extent::cube(edge), soft: soft.collect(), grain: grain.collect() }
        }
    }

    impl SlabReader for Synthetic {
        fn extent(&self) -> Extent {
            self.extent
        }
        fn sample_type(&self) -> SampleType {
            SampleType::Rgb8
        }
        fn read_slab(&mut self, planes: Range<u32>, out: &mut [u8]) -> vug::Result<()> {
            let edge = self.extent.x as usize;
            for (z, plane) in (planes.start as usize..).zip(out.chunks_exact_mut(3 * edge * edge)) {
                for (y, row) in plane.chunks_exact_mut(3 * edge).enumerate() {
                    let from_axis = y.abs_diff(edge / 2);
                    let half =
                        ((edge * edge / 5 - (from_axis * from_axis).min(edge * edge / 5)) as f64).sqrt() as usize;
                    row.fill(0);
                    let body = edge / 2 - half..edge / 2 + half;
                    for (x, v) in row.chunks_exact_mut(3).enumerate().take(body.end).skip(body.start) {
                        let grain = self.grain[(7 * x + 13 * y * y + 31 * z * z) & 1023];
                        v[0] = self.soft[x + y + z] + grain;
                        v[1] = self.soft[2 * y + 3 * z] + grain;
                        v[2] = self.soft[4 * x + z] / 2 + grain;
                    }
                }
            }
            Ok(())
        }
    }

    /// Encodes into a file with `jobs` threads: what was written, and the most heap in use meanwhile.
    fn encode(edge: u32, jobs: usize, zstd: bool) -> (EncodeReport, usize) {
        let out = tempfile::tempfile().unwrap();
        let options = EncodeOptions {
            codec: CodecChoice::Zerobit,
            quality: Quality::Keep(30_000),
            zstd,
            ..EncodeOptions::default()
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(jobs).build().unwrap();
        let mut source = Synthetic::new(edge);
        peak(|| pool.install(|| vug::volume::encode(&mut source, out, &options, &mut |_, _| {}).unwrap()))
    }

    /// One slab of bricks of 64³, and for histograms, search trees, the index and the bricks in work 24 MiB and as much as
    /// 8 MiB per thread.
    fn bound(edge: u32, jobs: usize) -> usize {
        3 * 64 * (edge * edge) as usize + (24 + 8 * jobs) * MIB
    }

    /// What 2 Gvoxel of colours may take besides. Histograms follow the number of distinct coefficients, 24 bytes each and
    /// twice while they are merged; how much of what was measured (618 MiB in all) they are was not taken apart.
    const LARGE_HISTOGRAMS: usize = 320 * MIB;

    #[test] // S-05
    fn encoding_holds_one_slab_of_bricks_and_histograms() {
        let _alone = ALONE.lock().unwrap_or_else(|e| e.into_inner());
        for (jobs, zstd) in [(1, true), (2, true), (2, false)] {
            let (report, heap) = encode(320, jobs, zstd);
            let allowed = bound(320, jobs);
            println!(
                "{jobs} jobs, zstd {zstd}: {:.1} MiB of heap, {:.1} allowed",
                heap as f64 / MIB as f64,
                allowed as f64 / MIB as f64
            );
            assert_eq!((report.codec, report.codebooks), ("zerobit", 1));
            assert!(heap > 3 * 64 * 320 * 320, "the slab itself: the counter works");
            assert!(heap <= allowed, "{heap} > {allowed}");
        }
    }

    #[test] // S-05
    #[ignore = "2.1 Gvoxel (6.3 GB of colours) take minutes; by hand: cargo test --release --test memory -- --ignored --nocapture"]
    fn two_gigavoxels_hold_one_slab_of_bricks_too() {
        let _alone = ALONE.lock().unwrap_or_else(|e| e.into_inner());
        let start = Instant::now();
        let (report, heap) = encode(1280, 2, false);
        let seconds = start.elapsed().as_secs_f64();
        let allowed = bound(1280, 2) + LARGE_HISTOGRAMS;
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        let resident = status.lines().find(|l| l.starts_with("VmHWM:")).unwrap_or("VmHWM: unknown");
        println!(
            "1280³ rgb8: {seconds:.0} s, {:.1} Mvoxel/s, {:.0} MiB of heap, {:.0} allowed, {resident}, {:.1} dB, {} bytes",
            1280f64.powi(3) / seconds / 1e6,
            heap as f64 / MIB as f64,
            allowed as f64 / MIB as f64,
            report.psnr.unwrap_or(f64::INFINITY),
            report.bytes
        );
        assert!(heap <= allowed, "{heap} > {allowed}");
    }
}

#[cfg(feature = "convert")]
mod encoding {
    use super::*;
    use crate::support::{explicit, hash};
    use vug::convert::ImportOptions;
    use vug::volume::{CodecChoice, EncodeOptions};

    /// Resident bytes of this process now, and their peak since [`reset_resident_peak`]: what C libraries take is in there.
    fn resident() -> Option<(usize, usize)> {
        let status = std::fs::read_to_string("/proc/self/status").ok()?;
        let field = |name: &str| {
            let line = status.lines().find(|l| l.starts_with(name))?;
            line.split_whitespace().nth(1)?.parse::<usize>().ok().map(|kib| kib << 10)
        };
        Some((field("VmRSS:")?, field("VmHWM:")?))
    }

    fn reset_resident_peak() -> Option<()> {
        std::fs::write("/proc/self/clear_refs", "5").ok()
    }

    const MIB: usize = 1 << 20;

    /// Encodes noise from a raw file with `jobs` threads: heap, and where it can be known resident memory, stay within one
    /// slab of bricks and 64 MiB per thread.
    fn check(path: &Path, extent: Extent, t: SampleType, jobs: usize, options: &EncodeOptions) {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(jobs).build().unwrap();
        let import = ImportOptions { shape: Some(extent), dtype: Some(t), ..ImportOptions::default() };
        let out = File::create(path.with_extension("vug")).unwrap();
        let before = reset_resident_peak().and_then(|()| resident());
        let (report, heap) = peak(|| {
            pool.install(|| {
                let mut source = vug::convert::import(path, &import).unwrap();
                assert!(source.streamed, "nothing is held that has not been asked for");
                vug::volume::encode(&mut *source.reader, out, options, &mut |_, _| {}).unwrap()
            })
        });
        let resident = before.and_then(|(rss, _)| Some(resident()?.1.saturating_sub(rss)));
        let edge = options.brick.unwrap_or(64);
        assert_eq!(report.bricks[0], extent.div_ceil(Extent::cube(edge)).voxels(), "noise is stored");
        let slab = extent.x as usize * extent.y as usize * edge as usize * t.bytes();
        let bound = slab + 64 * MIB * jobs;
        let in_mib = |b: usize| b as f64 / MIB as f64;
        println!(
            "{jobs} jobs, {extent} {t}, bricks of {edge}, {}, zstd {}: {:.1} MiB of heap, {:?} MiB resident; allowed {:.1}",
            report.codec,
            options.zstd,
            in_mib(heap),
            resident.map(in_mib),
            in_mib(bound)
        );
        assert!(heap > slab, "the slab itself: the counter works");
        assert!(heap <= bound, "{heap} > {bound}");
        // The system's allocator keeps some of what is freed.
        assert!(resident.is_none_or(|r| r <= bound + 16 * MIB), "{resident:?} > {bound}");
    }

    #[test] // S-05
    fn encoding_holds_one_slab_of_bricks() {
        let _alone = ALONE.lock().unwrap_or_else(|e| e.into_inner());
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("noise.raw");
        let mut file = std::io::BufWriter::new(File::create(&path).unwrap());
        for z in 0..256 {
            // Finite as f32 too: the second of the four highest bits of every fourth byte is clear.
            let plane: Vec<u8> = (0..512 * 512u32).map(|i| (hash([i, z, 0]) >> 24) as u8 & 0xBF).collect();
            file.write_all(&plane).unwrap();
        }
        file.into_inner().unwrap().sync_all().unwrap();
        let bytes = Extent::new(512, 512, 256);
        let plain = EncodeOptions { zstd: false, ..explicit(4, 4) };
        for (jobs, options) in [(1, explicit(4, 4)), (2, explicit(4, 4)), (1, plain)] {
            check(&path, bytes, SampleType::U8, jobs, &options);
        }
        // Large bricks: fewer of them wait at a time.
        let raw = EncodeOptions { codec: CodecChoice::Raw, brick: Some(128), ..EncodeOptions::default() };
        check(&path, Extent::new(512, 256, 128), SampleType::F32, 1, &raw);
        check(&path, Extent::new(512, 256, 128), SampleType::F32, 2, &raw);
        check(&path, bytes, SampleType::U8, 1, &EncodeOptions { brick: Some(256), ..raw });
    }
}
