//! What the tests of series share: a series whose every sample differs, its NRRD files, and a reader of all of it.
#![allow(dead_code, reason = "every test binary uses its own part")]

use std::io::Write;
use vug::convert::{Import, ImportOptions};
use vug::error::Code;
use vug::grid::SlabReader;
use vug::{Extent, SampleType};

pub const EXTENT: Extent = Extent::new(5, 4, 3);
pub const VOXELS: usize = 60;

/// The value of voxel `i` of a volume: every sample of a series differs.
pub fn value(time: u32, channel: u32, i: usize) -> u16 {
    (time * 1000 + channel * 100) as u16 + i as u16
}

pub fn volume(time: u32, channel: u32) -> Vec<u16> {
    (0..VOXELS).map(|i| value(time, channel, i)).collect()
}

pub fn bytes(samples: &[u16]) -> Vec<u8> {
    samples.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// All volumes of a series, the last one first: volumes may be turned to in any order.
pub fn read_all(reader: &mut dyn SlabReader) -> vug::Result<Vec<Vec<u8>>> {
    let (steps, channels) = reader.series();
    let len = reader.extent().voxels() as usize * reader.sample_type().bytes();
    let mut all = Vec::new();
    for time in (0..steps).rev() {
        for channel in (0..channels).rev() {
            reader.turn_to(time, channel)?;
            let mut out = vec![0; len];
            reader.read_slab(0..reader.extent().z, &mut out)?;
            check_parts(reader, &out)?;
            all.push(out);
        }
    }
    all.reverse();
    Ok(all)
}

/// Slabs, rows and the view hold what the whole volume holds.
pub fn check_parts(reader: &mut dyn SlabReader, whole: &[u8]) -> vug::Result<()> {
    let (e, size) = (reader.extent(), reader.sample_type().bytes());
    if let Some(view) = reader.as_view() {
        assert!(view.bytes == whole && view.extent == e);
    }
    if e.voxels() > 100_000 {
        return Ok(());
    }
    let row = e.x as usize * size;
    let plane = row * e.y as usize;
    for z in [0..1, e.z - 1..e.z, e.z / 2..e.z] {
        for y in [0..1, e.y / 2..e.y, 0..e.y] {
            let mut out = vec![0; z.len() * y.len() * row];
            reader.read_rows(z.clone(), y.clone(), &mut out)?;
            for (i, part) in z.clone().zip(out.chunks_exact(y.len() * row)) {
                assert!(part == &whole[i as usize * plane + y.start as usize * row..][..part.len()], "{z:?} {y:?}");
            }
        }
    }
    Ok(())
}

pub fn assert_series(import: &mut Import, steps: u32, channels: u32) {
    assert_eq!((import.reader.series(), import.reader.extent()), ((steps, channels), EXTENT));
    let all = read_all(&mut *import.reader).unwrap();
    for time in 0..steps {
        for channel in 0..channels {
            let wanted: Vec<u8> = volume(time, channel).iter().flat_map(|v| v.to_ne_bytes()).collect();
            assert!(all[(time * channels + channel) as usize] == wanted, "{time} {channel}");
        }
    }
    assert_eq!(import.reader.turn_to(steps, 0).unwrap_err().code(), Code::Range);
    assert_eq!(import.reader.turn_to(0, channels).unwrap_err().code(), Code::Range);
}

pub fn raw_options(steps: Option<u32>, channels: Option<u32>) -> ImportOptions {
    ImportOptions {
        shape: Some(EXTENT),
        dtype: Some(SampleType::U16),
        time_steps: steps,
        channels,
        ..ImportOptions::default()
    }
}

/// A NRRD file of 2 time steps and 3 channels with its axes in this order (x, y, z, t, c), the first one fastest.
pub fn nrrd(order: &str, encoding: &str) -> Vec<u8> {
    let size = |axis| match axis {
        'x' => 5,
        'y' => 4,
        'z' => 3,
        't' => 2,
        _ => 3,
    };
    let word = |axis| match axis {
        't' => "time",
        'c' => "list",
        _ => "domain",
    };
    let axes: Vec<char> = order.chars().collect();
    let sizes = axes.iter().map(|a| size(*a).to_string()).collect::<Vec<_>>().join(" ");
    let kinds = axes.iter().map(|a| word(*a)).collect::<Vec<_>>().join(" ");
    let spacings = axes.iter().map(|a| if *a == 't' { "0.5" } else { "1" }).collect::<Vec<_>>().join(" ");
    let total: usize = axes.iter().map(|a| size(*a)).product();
    let mut samples = Vec::new();
    for i in 0..total {
        let mut rest = i;
        let mut at = std::collections::HashMap::new();
        for a in &axes {
            at.insert(*a, rest % size(*a));
            rest /= size(*a);
        }
        let get = |a| at.get(&a).copied().unwrap_or(0);
        samples.push(value(get('t') as u32, get('c') as u32, get('x') + 5 * get('y') + 20 * get('z')));
    }
    let mut file = format!(
        "NRRD0005\ntype: ushort\ndimension: {}\nsizes: {sizes}\nkinds: {kinds}\nspacings: {spacings}\nendian: little\n\
         encoding: {encoding}\n\n",
        axes.len()
    )
    .into_bytes();
    match encoding {
        "gzip" => {
            let mut packed = flate2::write::GzEncoder::new(&mut file, flate2::Compression::fast());
            packed.write_all(&bytes(&samples)).unwrap();
        }
        "text" => file.extend(samples.iter().map(u16::to_string).collect::<Vec<_>>().join(" ").bytes()),
        _ => file.extend(bytes(&samples)),
    }
    file
}
