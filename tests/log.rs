//! Logs of real codecs: the same voxels as in the head file they were made of, at the costs of chapter 9, whole or torn.

mod support;

use support::{ball, encode, explicit, open, verify};
use vug::container::{BrickSink, FinishOptions, LogWriter, NodeKind, Recovery, recover};
use vug::limits::Limits;
use vug::source::{ByteSource, MemorySource};
use vug::time::{TimeUnit, Times};
use vug::volume::{At, CodecChoice, EncodeOptions, Quality, Volume};
use vug::{Code, Extent, Region};

fn recovered(file: &[u8]) -> Recovery {
    let mut read = |offset: u64, len: usize| {
        let mut out = vec![0; len];
        MemorySource(file).read_at(offset, &mut out).map(|()| out)
    };
    recover(file.len() as u64, &Limits::default(), &mut read).unwrap()
}

/// The bricks of a file, coarsest level last, as a log with a commit every `every` bricks.
fn log_of(file: &[u8], every: usize) -> (Vec<u8>, Vec<u64>) {
    let found = recovered(file);
    let d = &found.head.descriptor;
    let options = FinishOptions { times: Some(Times::regular(TimeUnit::Second, 0.0, 1.0, 1)), ..found.options.clone() };
    let mut log = LogWriter::create(Vec::new(), d, &options).unwrap();
    let mut commits = vec![log.len()];
    for (i, b) in found.bricks.iter().enumerate() {
        let (tree, level, brick) = b.place;
        if b.node.kind == NodeKind::Stored {
            let start = b.node.offset as usize;
            let payload = &file[start..start + b.node.stored_len as usize];
            log.put_stored(tree, level, brick, &b.node, payload).unwrap();
        } else {
            log.put_constant(tree, level, brick, &b.node).unwrap();
        }
        if i % every == every - 1 {
            log.checkpoint(d, &options).unwrap();
            commits.push(log.len());
        }
    }
    (log.finish(d, options).unwrap().0, commits)
}

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

fn files() -> Vec<Vec<u8>> {
    let mut grid = ball(Extent::new(70, 50, 40));
    let small = |options: EncodeOptions| EncodeOptions { brick: Some(16), ..options };
    let zerobit =
        EncodeOptions { codec: CodecChoice::Zerobit, quality: Quality::Keep(100_000), ..EncodeOptions::default() };
    [explicit(4, 4), EncodeOptions { zstd: false, ..explicit(8, 4) }, EncodeOptions::default(), zerobit]
        .map(|options| encode(&mut grid, &small(options)).0)
        .to_vec()
}

#[test] // spec: LOG-2, LOG-3, LOG-7, VAL-12
fn a_log_has_the_voxels_of_the_file_it_was_made_of() {
    for file in files() {
        let (log, commits) = log_of(&file, 5);
        assert!(commits.len() > 2, "{}", commits.len());
        let errors = verify(&log);
        assert!(errors.is_empty(), "{errors:?}");
        let (a, b) = (open(file), open(log));
        assert_eq!(a.info(), b.info());
        assert_eq!(b.times().unwrap(), Some(Times::regular(TimeUnit::Second, 0.0, 1.0, 1)));
        assert_eq!((a.times().unwrap(), a.meta().unwrap()), (None, b.meta().unwrap()));
        for lod in 0..a.info().lod_count {
            let at = At { lod, ..At::default() };
            assert!(a.read(at).unwrap().bytes() == b.read(at).unwrap().bytes());
            let region = Region::whole(a.levels().nth(usize::from(lod)).unwrap());
            assert_eq!(a.bounds(at, region).unwrap(), b.bounds(at, region).unwrap());
        }
    }
}

#[test] // spec: VAL-7, LOG-9
fn a_log_costs_one_read_more() {
    let mut grid = support::noise(Extent::new(200, 190, 210), |h| (h >> 24) as u8);
    let file = encode(&mut grid, &EncodeOptions { zstd: false, ..explicit(8, 4) }).0;
    let (log, _) = log_of(&file, usize::MAX);
    let volume = Volume::open(Remote(log.clone()), Limits::default()).unwrap();
    assert_eq!((volume.cost().reads, volume.cost().bytes), (2, 2 * 16384));
    // Index and last commit came with the last 16 KiB.
    volume.voxel(At::default(), [100, 100, 100]).unwrap();
    assert_eq!(volume.cost().reads, 3);
    // Torn behind the commit of generation 0, which the head holds: one window of 1 MiB after the other.
    let cut = log[..log.len() - 100].to_vec();
    let windows = (cut.len() as u64 - 16384).div_ceil((1 << 20) - 16) + 2;
    let torn = Volume::open(Remote(cut), Limits::default()).unwrap();
    assert_eq!(torn.head().commit.unwrap().generation, 0);
    assert!(torn.cost().reads <= windows, "{:?}, {windows} windows", torn.cost());
}

#[test] // spec: LOG-9, VAL-13; C-14
fn a_torn_log_reads_as_of_its_last_commit() {
    let file = files().remove(0);
    let (log, commits) = log_of(&file, 17);
    let whole = open(file);
    let null = whole.info().null_sample();
    for (generation, pair) in commits.windows(2).enumerate() {
        let len = (pair[0] + pair[1]) / 2;
        let torn = open(log[..len as usize].to_vec());
        assert_eq!(torn.head().commit.unwrap().generation, generation as u64);
        let errors = verify(&log[..len as usize]);
        assert!(errors.iter().any(|e| e.code() == Code::Commit && e.offset() == Some(pair[0])), "{errors:?}");
        // A brick is as it was, or not there yet.
        let (mut there, mut missing) = (0, 0);
        for z in 0..40 {
            let c = [35, 25, z];
            let (a, b) = (whole.voxel(At::default(), c).unwrap(), torn.voxel(At::default(), c).unwrap());
            assert!(a == b || b == null);
            there += u32::from(a == b && a != null);
            missing += u32::from(a != b);
        }
        assert!(there + missing > 20, "the ball is in the middle");
        assert!(generation > 0 || there == 0);
    }
}

#[test] // spec: BRK-5, LOG-3
fn salvage_finds_constant_bricks_of_a_log_by_their_leaders() {
    let mut grid = ball(Extent::new(70, 50, 40));
    for v in grid.samples_mut::<u8>().iter_mut().take(70 * 50 * 16) {
        *v = 9;
    }
    let encoded = encode(&mut grid, &EncodeOptions { brick: Some(16), ..explicit(4, 4) }).0;
    let (log, _) = log_of(&encoded, usize::MAX);
    let volume = open(log.clone());
    let whole = volume.read(At::default()).unwrap();
    let page = volume.head().section_range(*b"PAGE");
    // The first page record.
    let at = (page.start as usize..).step_by(16).find(|&i| log[i..].starts_with(b"VREC\x01")).unwrap();
    let mut bad = log;
    bad[at + 40] ^= 1;
    let volume = Volume::open_salvage(MemorySource(bad), Limits::default()).unwrap();
    let saved = volume.salvage(At::default(), Region::whole(Extent::new(70, 50, 40))).unwrap();
    // EMPTY bricks have no leaders: they are given up, and are the null value all the same.
    assert!(saved.grid.bytes() == whole.bytes());
    let stored_or_constant = recovered(&encoded).bricks.iter().filter(|b| b.place.1 == 0).count();
    assert_eq!(saved.found_by_leader as usize, stored_or_constant);
    assert!(stored_or_constant > 20, "{stored_or_constant}");
}
