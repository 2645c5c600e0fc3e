//! Tests of the phantom: it must be the same everywhere, or published figures could not be compared.

use super::*;

#[test]
fn the_same_on_every_machine_and_with_any_number_of_threads() {
    let extent = Extent::new(48, 40, 36);
    let make = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| phantom(extent, SampleType::U16).unwrap())
    };
    let (one, three) = (make(1), make(3));
    assert_eq!(one.bytes(), three.bytes());
    let little_endian: Vec<u8> = one.samples::<u16>().iter().flat_map(|v| v.to_le_bytes()).collect();
    assert_eq!(crc32fast::hash(&little_endian), PINNED, "a changed phantom changes the figures of the demo");
}

const PINNED: u32 = 491_037_169;

#[test]
fn it_has_what_the_codecs_find_hard() {
    let g = phantom(Extent::new(96, 96, 80), SampleType::U16).unwrap();
    let samples = g.samples::<u16>();
    let share = |f: &dyn Fn(u16) -> bool| samples.iter().filter(|&&v| f(v)).count() as f64 / samples.len() as f64;
    assert!(share(&|v| v == 0) > 0.5, "background");
    assert!(share(&|v| v > 2000) > 0.02, "bone");
    assert!(share(&|v| (800..1600).contains(&v)) > 0.1, "soft tissue");
    assert_eq!(g.range(), Some((0.0, 4095.0)));
    // The finest line pairs change with every voxel.
    let edge = |w: &[u16]| w[0].abs_diff(w[1]) > 2000 && w[1].abs_diff(w[2]) > 2000;
    assert!(samples.windows(3).any(edge));
}

#[test]
fn all_types_show_the_same_head() {
    let e = Extent::new(40, 40, 32);
    let of = |t| phantom(e, t).unwrap();
    let (narrow, wide, signed, float, colour) =
        (of(SampleType::U8), of(SampleType::U16), of(SampleType::I16), of(SampleType::F32), of(SampleType::Rgb8));
    let mut differ = 0;
    for (i, &v) in wide.samples::<u16>().iter().enumerate() {
        assert_eq!(u16::from(narrow.samples::<u8>()[i]), v / 16);
        assert_eq!(i32::from(signed.samples::<i16>()[i]), i32::from(v) - 1000);
        assert_eq!(float.samples::<f32>()[i], (f64::from(v) / 4095.0) as f32);
        // Above the plate, black is where there is air; grain makes a difference at surfaces.
        if i / 40 % 40 < 30 {
            differ += usize::from((v < 60) != (colour.samples::<[u8; 3]>()[i] == [0; 3]));
        }
    }
    assert!(differ < 40 * 30 * 32 / 100, "{differ} voxels are air for one phantom only");
}

#[test]
fn the_colour_head_is_the_same_everywhere_and_looks_like_one() {
    let g = phantom(Extent::new(96, 96, 80), SampleType::Rgb8).unwrap();
    assert_eq!(crc32fast::hash(g.bytes()), PINNED_COLOUR, "a changed phantom changes the figures of the demo");
    let samples = g.samples::<[u8; 3]>();
    let share = |f: &dyn Fn([i32; 3]) -> bool| {
        samples.iter().filter(|v| f(v.map(i32::from))).count() as f64 / samples.len() as f64
    };
    assert!(share(&|v| v == [0; 3]) > 0.5, "background");
    assert!(share(&|[r, g, b]| r > 100 && r > 2 * g && r > 2 * b) > 0.01, "flesh");
    assert!(share(&|[r, g, b]| r > 200 && g > 180 && b > 150) > 0.02, "white matter and bone");
    assert!(share(&|[r, g, b]| r > 180 && g > 130 && b < 140 && g > b + 40) > 0.01, "fat");
}

const PINNED_COLOUR: u32 = 1_866_943_656;

#[test]
fn any_size_works() {
    for e in [Extent::cube(1), Extent::new(1, 7, 2), Extent::new(5, 3, 64)] {
        assert_eq!(phantom(e, SampleType::U8).unwrap().extent(), e);
    }
    assert!(phantom(Extent::new(0, 1, 1), SampleType::U8).is_err());
    placement().check().unwrap();
}
