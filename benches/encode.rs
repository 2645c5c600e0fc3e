//! Encoding a volume in bricks of 64³ voxels on one thread, against memcpy of that volume.
//!
//! `cargo bench --bench encode [-- WORD...]`: only rows whose name holds one of the words, e.g. `u8 minmax`.

mod support;

use support::{Contestant, copy, header, interleave, rounds, volume, wanted};
use vug::codec::Codec;
use vug::codec::s3dc::{Endpoints, Params};
use vug::geometry::{Extent, Region};
use vug::grid::Grid;
use vug::voxel::SampleType;

const BRICK: u32 = 64;
const EDGE: u32 = 256;

/// Encodes every brick into the same buffer, as a writer that hands payloads on does.
fn encode(codec: &Codec, grid: &Grid, edge: u32, out: &mut Vec<u8>) {
    for z in (0..edge).step_by(BRICK as usize) {
        for y in (0..edge).step_by(BRICK as usize) {
            for x in (0..edge).step_by(BRICK as usize) {
                out.clear();
                let region = Region::at([x, y, z], Extent::cube(BRICK));
                codec.encode(grid.view().sub(&region), out).expect("synthetic samples are finite");
                std::hint::black_box(&out);
            }
        }
    }
}

fn rows(t: SampleType, endpoints: Endpoints, edge: u32, choices: &[(u8, u32)]) {
    let mut grid = None;
    for &(i_bits, block) in choices {
        let name = format!("{t} {} {edge} i{i_bits} b{block}", endpoints.name());
        if !wanted(&name) {
            continue;
        }
        let grid = &*grid.get_or_insert_with(|| match t {
            SampleType::U8 => volume(edge, |v| (v * 255.0) as u8),
            SampleType::U16 => volume(edge, |v| (v * 65_535.0) as u16),
            _ => volume(edge, |v| v),
        });
        let codec = Codec::S3dc(Params::new(i_bits, Extent::cube(block), endpoints).expect("legal parameters"));
        let mut copied = vec![0; grid.bytes().len()];
        let mut out = Vec::new();
        let mut contestants: Vec<Contestant<'_>> = vec![
            ("memcpy".into(), Box::new(|| copy(grid.bytes(), &mut copied, 1))),
            ("encode".into(), Box::new(|| encode(&codec, grid, edge, &mut out))),
        ];
        let n = if endpoints == Endpoints::Fitted { 5 } else { rounds(grid.bytes().len()).min(31) };
        let times = interleave(n, &mut contestants);
        let (median, best) = times[1].ratio_to(&times[0]);
        let speed = f64::from(edge).powi(3) / times[1].median.as_secs_f64() / 1e6;
        println!("{name:<28} {median:>6.3} {best:>6.3} {speed:>9.1} Mvoxel/s");
    }
}

fn main() {
    header("encode of a volume into s3dc bricks of 64³, 1 thread");
    println!("{:<28} {:>6} {:>6}", "row", "median", "best");
    for t in [SampleType::U8, SampleType::U16, SampleType::F32] {
        rows(t, Endpoints::MinMax, EDGE, &[(4, 4), (4, 8), (4, 16), (1, 4), (2, 4), (8, 4)]);
    }
    for t in [SampleType::U8, SampleType::U16, SampleType::F32] {
        rows(t, Endpoints::Fitted, EDGE / 2, &[(4, 4), (4, 8), (1, 4), (2, 4)]);
    }
}
