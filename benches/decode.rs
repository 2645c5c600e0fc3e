//! Decoding bricks of 64³ voxels into a whole raster, against memcpy of that raster.
//!
//! `cargo bench --bench decode [-- WORD...]`: only rows whose name holds one of the words, e.g. `u8 256`.

mod support;

use support::{Contestant, Timing, copy, header, interleave, rounds, synthetic, volume, wanted};
use vug::codec::s3dc::{Endpoints, Isa, Params, decode_on};
use vug::codec::{BrickPart, Codec, Stores};
use vug::geometry::{Extent, Region};
use vug::grid::{Grid, ViewMut};
use vug::voxel::SampleType;

const BRICK: u32 = 64;

/// Payloads of all bricks, x fastest, in one buffer as they lie in a file, and where each starts.
struct Bricks {
    bytes: Vec<u8>,
    at: Vec<usize>,
    per_axis: u32,
}

fn encode(codec: &Codec, grid: &Grid) -> Bricks {
    let per_axis = grid.extent().x / BRICK;
    let mut bricks = Bricks { bytes: Vec::new(), at: Vec::new(), per_axis };
    for z in 0..per_axis {
        for y in 0..per_axis {
            for x in 0..per_axis {
                let region = Region::at([x * BRICK, y * BRICK, z * BRICK], Extent::cube(BRICK));
                bricks.bytes.resize(bricks.bytes.len().next_multiple_of(256) + 256, 0); // leader and guard of a file
                bricks.at.push(bricks.bytes.len());
                codec.encode(grid.view().sub(&region), &mut bricks.bytes).expect("synthetic samples are finite");
            }
        }
    }
    bricks
}

/// Decodes slabs of bricks into the raster, as a reader of whole volumes does.
fn decode(
    params: &Params,
    bricks: &Bricks,
    (isa, stores, run): (Isa, Stores, usize),
    t: SampleType,
    dst: &mut [u8],
    threads: usize,
) {
    let n = bricks.per_axis;
    let (brick, whole) = (Extent::cube(BRICK), Region::whole(Extent::cube(BRICK)));
    let len = (*Codec::S3dc(*params).payload_lens(t, brick).end()) as usize;
    let slab_bytes = dst.len() / n as usize;
    let slab_extent = Extent::new(n * BRICK, n * BRICK, BRICK);
    let slabs = |first: usize, dst: &mut [u8]| {
        for (z, slab) in dst.chunks_mut(slab_bytes).enumerate() {
            let mut slab = ViewMut::dense(slab, slab_extent, t);
            for y in 0..n {
                for x in (0..n).step_by(run) {
                    let part = |x| {
                        let at = bricks.at[(x + n * (y + n * (first + z) as u32)) as usize];
                        BrickPart { payload: &bricks.bytes[at..at + len], brick, region: whole }
                    };
                    let count = n.min(x + run as u32) - x;
                    let parts: Vec<_> = (x..x + count).map(part).collect();
                    let extent = Extent { x: count * BRICK, ..brick };
                    let dst = slab.sub(&Region::at([x * BRICK, y * BRICK, 0], extent));
                    assert!(decode_on(isa, params, &parts, dst, stores).expect("valid payloads"));
                }
            }
        }
    };
    if threads == 1 {
        return slabs(0, dst);
    }
    let per_thread = (n as usize).div_ceil(threads);
    std::thread::scope(|s| {
        for (t, dst) in dst.chunks_mut(per_thread * slab_bytes).enumerate() {
            let slabs = &slabs;
            s.spawn(move || slabs(t * per_thread, dst));
        }
    });
}

fn row(name: &str, times: &[Timing], voxels: f64) {
    for t in &times[1..] {
        let (median, best) = t.ratio_to(&times[0]);
        let speed = voxels / t.median.as_secs_f64() / 1e9;
        println!("{name:<28} {:<22} {median:>6.2} {best:>6.2} {speed:>8.2} Gvoxel/s", t.name);
    }
}

fn size(edge: u32, t: SampleType) {
    let bytes = (edge as usize).pow(3) * t.bytes();
    let mut grid = None;
    for threads in [1, 2] {
        for block in [4, 8, 16] {
            let name = format!("{t} {edge} i4 b{block} {threads}T");
            if !wanted(&name) {
                continue;
            }
            let grid = grid.get_or_insert_with(|| match t {
                SampleType::U8 => volume(edge, |v| (v * 255.0) as u8),
                SampleType::U16 => volume(edge, |v| (v * 65_535.0) as u16),
                _ => volume(edge, |v| v),
            });
            let params = Params::new(4, Extent::cube(block), Endpoints::MinMax).expect("legal parameters");
            let bricks = encode(&Codec::S3dc(params), grid);
            let mut dst = Grid::zeros(Extent::cube(edge), t).expect("memory for the result");
            let dst = std::cell::RefCell::new(dst.bytes_mut());
            let mut contestants: Vec<Contestant<'_>> =
                vec![("memcpy".into(), Box::new(|| copy(grid.bytes(), &mut dst.borrow_mut(), threads)))];
            for &isa in Isa::available() {
                for stores in [Stores::Cached, Stores::Streaming] {
                    for run in [1, 4] {
                        let (params, bricks, dst) = (&params, &bricks, &dst);
                        contestants.push((
                            format!("{isa:?} {stores:?} by {run}"),
                            Box::new(move || {
                                decode(params, bricks, (isa, stores, run), t, &mut dst.borrow_mut(), threads);
                            }),
                        ));
                    }
                }
            }
            let times = interleave(rounds(bytes), &mut contestants);
            row(&name, &times, f64::from(edge).powi(3));
        }
    }
}

fn main() {
    header("decode of s3dc bricks of 64³ into a raster");
    println!("{:<28} {:<22} {:>6} {:>6}", "row", "path", "median", "best");
    let _ = synthetic;
    for edge in [256, 512] {
        for t in [SampleType::U8, SampleType::U16, SampleType::F32] {
            size(edge, t);
        }
    }
}
