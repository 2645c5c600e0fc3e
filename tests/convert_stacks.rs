//! Stacks of images: folders of PNG, TIFF and JPEG slices, and pages of a TIFF, in and out.
#![cfg(feature = "convert")]

use png::{BitDepth, ColorType};
use proptest::prelude::*;
use std::fs;
use std::path::Path;
use std::sync::OnceLock;
use vug::affine::{Placement, ValueMap};
use vug::convert::{ExportInfo, Format, Import, ImportOptions, export, import};
use vug::error::Code;
use vug::voxel::Sample;
use vug::{Extent, Grid, SampleType};

fn open(path: &Path) -> vug::Result<Import> {
    import(path, &ImportOptions::default())
}

fn read(path: &Path, options: &ImportOptions) -> vug::Result<Grid> {
    let mut found = import(path, options)?;
    let mut grid = Grid::zeros(found.reader.extent(), found.reader.sample_type())?;
    let depth = grid.extent().z;
    found.reader.read_slab(0..depth, grid.bytes_mut())?;
    Ok(grid)
}

fn write(path: &Path, grid: &Grid) -> vug::Result<()> {
    let info =
        ExportInfo { placement: &Placement::default(), value_map: ValueMap::default(), times: None, header: None };
    export(path, grid, &info)
}

fn refused(path: &Path) -> vug::Error {
    read(path, &ImportOptions::default()).map(|_| ()).unwrap_err()
}

/// A volume of smooth ramps with all values of its type at hand.
fn ramp<T: Sample>(extent: Extent, f: impl Fn(u32) -> T) -> Grid {
    Grid::from_fn(extent, |[x, y, z]| f(x * 7 + y * 13 + z * 29)).unwrap()
}

fn volumes(e: Extent) -> [Grid; 5] {
    [
        ramp(e, |v| v as u8),
        ramp(e, |v| (v * 257) as u16),
        ramp(e, |v| [v as u8, (v * 3) as u8, (255 - v % 256) as u8]),
        ramp(e, |v| (v * 31) as i16),
        ramp(e, |v| v as f32 / 7.0 - 3.0),
    ]
}

/// One PNG, as its bytes are given.
fn png(path: &Path, size: (u32, u32), color: ColorType, depth: BitDepth, extra: &[(&str, &[u8])], pixels: &[u8]) {
    let mut encoder = png::Encoder::new(fs::File::create(path).unwrap(), size.0, size.1);
    encoder.set_color(color);
    encoder.set_depth(depth);
    for (name, bytes) in extra {
        match *name {
            "PLTE" => encoder.set_palette(bytes.to_vec()),
            _ => encoder.set_trns(bytes.to_vec()),
        }
    }
    encoder.write_header().unwrap().write_image_data(pixels).unwrap();
}

#[test]
fn what_a_format_holds_comes_back_exactly() {
    let temp = tempfile::tempdir().unwrap();
    let extents = [Extent::new(9, 7, 12), Extent::cube(1), Extent::new(1, 5, 3), Extent::new(300, 2, 1)];
    for (n, e) in extents.into_iter().enumerate() {
        for grid in volumes(e) {
            let t = grid.sample_type();
            // A folder, numbered files, and pages of one file.
            for (i, pattern) in ["", "a_##.png", "a_#.tiff", "all.tif"].into_iter().enumerate() {
                let dir = temp.path().join(format!("{n}-{t}-{i}"));
                let target = dir.join(pattern);
                if i < 2 && matches!(t, SampleType::I16 | SampleType::F32) {
                    let e = write(&target, &grid).unwrap_err();
                    assert!(e.code() == Code::Unsupported && e.message().contains("TIFF does"), "{e}");
                    assert!(!dir.exists(), "refused before anything is made");
                    continue;
                }
                write(&target, &grid).unwrap();
                for source in [dir.clone(), target].iter().filter(|source| source.exists()) {
                    if source == &dir && i == 3 && e.z > 1 {
                        continue; // a file of several pages is no slice
                    }
                    let found = open(source).unwrap();
                    assert_eq!((found.format, found.streamed), (Format::Stack, true));
                    assert!(found.placement.spacing_unknown && found.header["slices"] == e.z, "{}", found.header);
                    let back = read(source, &ImportOptions::default()).unwrap();
                    assert_eq!((back.extent(), back.sample_type()), (e, t), "{pattern}");
                    assert!(back.bytes() == grid.bytes(), "{pattern} {e} {t}");
                }
            }
        }
    }
}

#[test]
fn jpeg_is_near() {
    let temp = tempfile::tempdir().unwrap();
    let e = Extent::new(40, 24, 3);
    let grey = Grid::from_fn(e, |[x, y, z]| (x * 4 + y * 2 + z * 10) as u8).unwrap();
    let color = Grid::from_fn(e, |[x, y, z]| [(x * 6) as u8, (y * 10) as u8, (z * 80) as u8]).unwrap();
    for grid in [grey, color] {
        let dir = temp.path().join(grid.sample_type().name());
        write(&dir.join("s####.jpg"), &grid).unwrap();
        let back = read(&dir, &ImportOptions::default()).unwrap();
        assert_eq!((back.extent(), back.sample_type()), (e, grid.sample_type()));
        let worst = back.bytes().iter().zip(grid.bytes()).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
        assert!(worst <= 12, "{worst} {}", grid.sample_type());
    }
    for grid in volumes(Extent::cube(2)).iter().filter(|g| g.sample_type() == SampleType::U16) {
        let e = write(&temp.path().join("x/#.jpg"), grid).unwrap_err();
        assert!(e.code() == Code::Unsupported && e.message().contains("PNG and TIFF do"), "{e}");
    }
}

#[test]
fn slices_are_read_in_natural_order_and_any_slab_alone() {
    let temp = tempfile::tempdir().unwrap();
    let d = temp.path();
    // Written out of order, with names that sort wrongly as text.
    for v in [10u8, 2, 1, 33, 100, 9] {
        png(&d.join(format!("slice{v}.png")), (3, 2), ColorType::Grayscale, BitDepth::Eight, &[], &[v; 6]);
    }
    fs::write(d.join(".hidden.png"), "no image").unwrap();
    fs::write(d.join("notes.txt"), "no image").unwrap();
    fs::create_dir(d.join("folder.png")).unwrap();
    let grid = read(d, &ImportOptions::default()).unwrap();
    assert_eq!(grid.samples::<u8>().chunks(6).map(|s| s[0]).collect::<Vec<_>>(), [1, 2, 9, 10, 33, 100]);
    let mut found = open(d).unwrap();
    for (z, v) in [(3..5, [10, 33]), (0..2, [1, 2])] {
        let mut slab = [0; 12];
        found.reader.read_slab(z, &mut slab).unwrap();
        assert_eq!((slab[0], slab[11]), (v[0], v[1]));
    }
    assert!(found.reader.read_slab(5..7, &mut [0; 12]).is_err());
    // Only the slices asked for are decoded: a damaged one harms nobody else.
    fs::write(d.join("slice9.png"), &fs::read(d.join("slice9.png")).unwrap()[..50]).unwrap();
    found.reader.read_slab(3..5, &mut [0; 12]).unwrap();
    let e = found.reader.read_slab(1..4, &mut [0; 18]).unwrap_err();
    assert!(e.code() == Code::Foreign && e.message().contains("slice9.png"), "{e}");
}

#[test]
fn small_grey_palettes_and_opaque_alpha_are_expanded() {
    let temp = tempfile::tempdir().unwrap();
    let p = temp.path().join("a.png");
    let one = |color, depth, extra: &[(&str, &[u8])], pixels: &[u8]| {
        png(&p, (2, 1), color, depth, extra, pixels);
        read(&p, &ImportOptions::default())
    };
    let bytes = |r: vug::Result<Grid>| r.map(|g| (g.sample_type(), g.bytes().to_vec())).unwrap();
    use SampleType::{Rgb8, U8, U16};
    assert_eq!(bytes(one(ColorType::Grayscale, BitDepth::One, &[], &[0b0100_0000])), (U8, vec![0, 255]));
    assert_eq!(bytes(one(ColorType::Grayscale, BitDepth::Four, &[], &[0x1F])), (U8, vec![17, 255]));
    let palette: (&str, &[u8]) = ("PLTE", &[1, 2, 3, 250, 251, 252]);
    let indexed = one(ColorType::Indexed, BitDepth::One, &[palette], &[0b0100_0000]);
    assert_eq!(bytes(indexed), (Rgb8, vec![1, 2, 3, 250, 251, 252]));
    let opaque = one(ColorType::Rgba, BitDepth::Eight, &[], &[1, 2, 3, 255, 4, 5, 6, 255]);
    assert_eq!(bytes(opaque), (Rgb8, vec![1, 2, 3, 4, 5, 6]));
    let wide = one(ColorType::GrayscaleAlpha, BitDepth::Sixteen, &[], &[1, 2, 255, 255, 3, 4, 255, 255]);
    assert_eq!(bytes(wide), (U16, [0x0102u16.to_ne_bytes(), 0x0304u16.to_ne_bytes()].concat()));
    let e = one(ColorType::Rgba, BitDepth::Eight, &[], &[1, 2, 3, 255, 4, 5, 6, 254]).unwrap_err();
    assert!(e.code() == Code::Unsupported && e.message().contains("(1, 0)") && e.message().contains("a.png"), "{e}");
    let e = one(ColorType::Indexed, BitDepth::One, &[palette, ("tRNS", &[0])], &[0]).unwrap_err();
    assert!(e.code() == Code::Unsupported && e.field() == "alpha", "{e}");
    let e = one(ColorType::Rgb, BitDepth::Sixteen, &[], &[0; 12]).unwrap_err();
    assert!(e.code() == Code::Unsupported && e.message().contains("16-bit colours"), "{e}");
    // Other types are narrowed as those of any file.
    png(&p, (2, 1), ColorType::Grayscale, BitDepth::Sixteen, &[], &[0, 7, 0, 255]);
    let to = |t| read(&p, &ImportOptions { dtype: Some(t), ..ImportOptions::default() });
    assert_eq!(to(U8).unwrap().bytes(), [7, 255]);
    assert_eq!(to(SampleType::F32).unwrap().samples::<f32>(), [7.0, 255.0]);
    assert_eq!(to(Rgb8).unwrap_err().code(), Code::Param);
    png(&p, (2, 1), ColorType::Grayscale, BitDepth::Sixteen, &[], &[0, 7, 1, 0]);
    let e = to(U8).unwrap_err();
    assert!(e.message().contains("256") && e.message().contains("(1, 0, 0)"), "{e}");
}

#[test]
fn stacks_that_are_none() {
    let temp = tempfile::tempdir().unwrap();
    let d = temp.path();
    let e = refused(d);
    assert!(e.code() == Code::Unsupported && e.message().contains("no images"), "{e}");
    let grey = |name: &str, size: (u32, u32)| {
        let pixels = vec![0; (size.0 * size.1) as usize];
        png(&d.join(name), size, ColorType::Grayscale, BitDepth::Eight, &[], &pixels);
    };
    grey("a1.png", (4, 3));
    grey("a2.png", (4, 3));
    grey("a10.png", (5, 3));
    let e = refused(d);
    for part in ["a10.png", "5×3", "4×3", "a1.png"] {
        assert!(e.code() == Code::Foreign && e.message().contains(part), "{part} in {e}");
    }
    png(&d.join("a10.png"), (4, 3), ColorType::Grayscale, BitDepth::Sixteen, &[], &[0; 24]);
    let e = refused(d);
    assert!(e.message().contains("u16") && e.message().contains("u8") && e.message().contains("a10.png"), "{e}");
    fs::write(d.join("a10.png"), "no image").unwrap();
    let e = refused(d);
    assert!(e.code() == Code::Foreign && e.message().contains("a10.png"), "{e}");
    fs::remove_file(d.join("a10.png")).unwrap();
    fs::write(d.join("b.tif"), "").unwrap();
    let e = refused(d);
    assert!(e.code() == Code::Foreign && e.message().contains("b.tif") && e.message().contains("one format"), "{e}");
    fs::remove_file(d.join("b.tif")).unwrap();
    read(d, &ImportOptions::default()).unwrap();
    // A file of several pages is no slice.
    let e = temp.path().join("e");
    fs::create_dir(&e).unwrap();
    write(&e.join("x.tif"), &volumes(Extent::cube(3))[0]).unwrap();
    let e = refused(&e);
    assert!(e.code() == Code::Unsupported && e.message().contains("pages") && e.message().contains("x.tif"), "{e}");
    assert_eq!(refused(Path::new("no/such/file.png")).code(), Code::Source);
}

#[test]
fn other_images_in_the_folder_are_not_mixed_with_new_ones() {
    let temp = tempfile::tempdir().unwrap();
    let d = temp.path();
    let grid = &volumes(Extent::cube(3))[0];
    write(&d.join("s/"), grid).unwrap();
    write(&d.join("s/"), grid).unwrap();
    let e = write(&d.join("s/"), &volumes(Extent::cube(2))[0]).unwrap_err();
    assert!(e.code() == Code::Param && e.message().contains("0002.png"), "{e}");
    fs::write(d.join("notes.txt"), "").unwrap();
    write(d, grid).unwrap();
    assert_eq!(read(d, &ImportOptions::default()).unwrap().bytes(), grid.bytes());
}

/// A PNG that declares far more than it has.
fn png_bomb(width: u32, height: u32) -> Vec<u8> {
    let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
    let mut chunk = |name: &[u8], data: &[u8]| {
        bytes.extend((data.len() as u32).to_be_bytes());
        let body = [name, data].concat();
        bytes.extend(&body);
        bytes.extend(crc32fast::hash(&body).to_be_bytes());
    };
    let header = [&width.to_be_bytes()[..], &height.to_be_bytes(), &[8, 0, 0, 0, 0]].concat();
    chunk(b"IHDR", &header);
    chunk(b"IDAT", &[0x78, 0x9c, 0x63, 0, 0, 0, 1, 0, 1]);
    chunk(b"IEND", &[]);
    bytes
}

/// A TIFF with one strip at byte 8 and these entries: (tag, type, value).
fn tiff_of(entries: &[(u16, u16, u32)]) -> Vec<u8> {
    let mut bytes = b"II\x2a\0\x10\0\0\0\x01\x02\x03\x04\x05\x06\x07\x08".to_vec();
    bytes.extend((entries.len() as u16).to_le_bytes());
    for (tag, kind, value) in entries {
        bytes.extend([&tag.to_le_bytes()[..], &kind.to_le_bytes(), &1u32.to_le_bytes(), &value.to_le_bytes()].concat());
    }
    bytes.extend([0; 4]);
    bytes
}

#[test] // D-60, D-61
fn declared_sizes_cost_nothing() {
    let temp = tempfile::tempdir().unwrap();
    let p = temp.path().join("a.png");
    for (w, h) in [(100_000, 100_000), (1 << 21, 1 << 21), (1 << 22, 1), (0x7FFF_FFFF, 0x7FFF_FFFF)] {
        fs::write(&p, png_bomb(w, h)).unwrap();
        let e = open(&p).err().unwrap();
        assert!(e.code() == Code::Limit && e.message().contains("a.png"), "{w} {h}: {e}");
    }
    let t = temp.path().join("a.tif");
    let tiff = |w, h, strips| {
        let entries = [
            (256, 4, w),
            (257, 4, h),
            (258, 3, 8),
            (259, 3, 1),
            (262, 3, 1),
            (273, 4, 8),
            (277, 3, 1),
            (278, 4, h),
            (279, 4, strips),
        ];
        fs::write(&t, tiff_of(&entries)).unwrap();
    };
    tiff(4, 2, 8);
    assert_eq!(read(&t, &ImportOptions::default()).unwrap().bytes(), [1, 2, 3, 4, 5, 6, 7, 8]);
    for (w, h) in [(60_000, 60_000), (1 << 21, 1 << 21), (0xFFFF_FFFF, 0xFFFF_FFFF)] {
        tiff(w, h, 8);
        assert_eq!(refused(&t).code(), Code::Limit, "{w} {h}");
    }
    tiff(0, 2, 8);
    assert_eq!(refused(&t).code(), Code::Foreign);
    let small = ImportOptions { max_bytes: 7, ..ImportOptions::default() };
    tiff(4, 2, 8);
    assert_eq!(read(&t, &small).map(|_| ()).unwrap_err().code(), Code::Limit);
}

#[test]
fn small_and_signed_tiffs() {
    let temp = tempfile::tempdir().unwrap();
    let t = temp.path().join("a.tif");
    let one = |bits: u32, white_is_zero: bool, format: u32, w: u32, h: u32| {
        let entries = [
            (256, 4, w),
            (257, 4, h),
            (258, 3, bits),
            (259, 3, 1),
            (262, 3, u32::from(!white_is_zero)),
            (273, 4, 8),
            (277, 3, 1),
            (278, 4, h),
            (279, 4, 8),
            (339, 3, format),
        ];
        fs::write(&t, tiff_of(&entries)).unwrap();
        read(&t, &ImportOptions::default())
    };
    assert_eq!(one(1, false, 1, 3, 2).unwrap().bytes(), [0, 0, 0, 0, 0, 0]);
    assert_eq!(one(4, false, 1, 3, 2).unwrap().bytes(), [0, 17, 0, 0, 51, 0]);
    assert_eq!(one(2, true, 1, 4, 1).unwrap().bytes(), [255, 255, 255, 170]);
    assert_eq!(one(8, false, 2, 2, 2).unwrap().samples::<i16>(), [1, 2, 3, 4]);
    assert_eq!(one(16, false, 2, 2, 2).unwrap().samples::<i16>(), [0x201, 0x403, 0x605, 0x807]);
    assert_eq!(one(32, false, 1, 2, 1).unwrap_err().code(), Code::Unsupported, "0x04030201 has more bits than f32");
    for bits in [12, 24, 3] {
        let e = one(bits, false, 1, 2, 1).unwrap_err();
        assert!(matches!(e.code(), Code::Unsupported | Code::Foreign), "{bits}: {e}");
    }
}

#[test]
fn pages_that_are_no_slices() {
    let temp = tempfile::tempdir().unwrap();
    let t = temp.path().join("a.tif");
    let grid = &volumes(Extent::new(4, 3, 6))[1];
    let write = |text: &str, sizes: &[u32]| {
        let mut encoder = tiff::encoder::TiffEncoder::new(fs::File::create(&t).unwrap()).unwrap();
        for &w in sizes {
            let mut page = encoder.new_image::<tiff::encoder::colortype::Gray16>(w, 3).unwrap();
            page.encoder().write_tag(tiff::tags::Tag::ImageDescription, text).unwrap();
            page.write_data(&grid.samples::<u16>()[..w as usize * 3]).unwrap();
        }
    };
    write("ImageJ=1.53\nimages=6\nslices=6\n", &[4; 6]);
    assert_eq!(open(&t).unwrap().reader.extent(), Extent::new(4, 3, 6));
    for (text, word) in [
        ("ImageJ=1.53\nimages=6\nchannels=2\nslices=3\n", "2 channels"),
        ("ImageJ=1.53\nimages=6\nframes=3\n", "3 time steps"),
        ("ImageJ=1.53\nimages=900\nslices=900\n", "900 slices"),
        ("<?xml?><OME><Pixels SizeX=\"4\" SizeC=\"1\" SizeT=\"6\"/></OME>", "6 time steps"),
    ] {
        write(text, &[4; 6]);
        let e = refused(&t);
        assert!(e.code() == Code::Unsupported && e.message().contains(word), "{e}");
    }
    write("", &[4, 4, 2]);
    let e = refused(&t);
    assert!(e.code() == Code::Foreign && e.message().contains("page 3") && e.message().contains("2×3"), "{e}");
}

/// Small valid images of every format and kind.
fn seeds() -> &'static [(&'static str, Vec<u8>)] {
    static SEEDS: OnceLock<Vec<(&'static str, Vec<u8>)>> = OnceLock::new();
    SEEDS.get_or_init(|| {
        let temp = tempfile::tempdir().unwrap();
        let mut seeds = Vec::new();
        for (i, grid) in volumes(Extent::new(19, 11, 1)).iter().enumerate() {
            for ending in ["png", "tif", "jpg"] {
                let path = temp.path().join(format!("{i}.{ending}"));
                if write(&path, grid).is_ok() {
                    seeds.push((ending, fs::read(&path).unwrap()));
                }
            }
        }
        let path = temp.path().join("pages.tif");
        write(&path, &volumes(Extent::new(5, 4, 3))[0]).unwrap();
        seeds.push(("tif", fs::read(&path).unwrap()));
        for compression in [tiff::encoder::Compression::Lzw, tiff::encoder::Compression::Packbits] {
            let file = fs::File::create(&path).unwrap();
            let mut encoder = tiff::encoder::TiffEncoder::new(file).unwrap().with_compression(compression);
            encoder.write_image::<tiff::encoder::colortype::RGB8>(7, 5, &[9; 105]).unwrap();
            drop(encoder);
            seeds.push(("tif", fs::read(&path).unwrap()));
        }
        let path = temp.path().join("palette.png");
        png(&path, (9, 2), ColorType::Indexed, BitDepth::Four, &[("PLTE", &[7; 48]), ("tRNS", &[255; 9])], &[0x12; 10]);
        seeds.push(("png", fs::read(&path).unwrap()));
        seeds
    })
}

/// Reads a file that lies; what comes out does not matter, but it must be small.
fn swallow(path: &Path) -> vug::Result<()> {
    let mut found = import(path, &ImportOptions { max_bytes: 1 << 22, ..ImportOptions::default() })?;
    let extent = found.reader.extent();
    assert!(extent.voxels() <= 1 << 24, "{extent} of a file of some hundred bytes");
    let mut slab = vec![0; extent.voxels() as usize * found.reader.sample_type().bytes()];
    found.reader.read_slab(0..extent.z, &mut slab)
}

#[test]
fn images_that_end_early_are_errors() {
    let temp = tempfile::tempdir().unwrap();
    for (i, (ending, bytes)) in seeds().iter().enumerate() {
        let path = temp.path().join(format!("{i}.{ending}"));
        fs::write(&path, bytes).unwrap();
        swallow(&path).unwrap();
        // The end mark of a PNG (12 bytes) or a JPEG (2 bytes) holds nothing.
        let needed = bytes.len() - if *ending == "png" { 12 } else { 2 };
        for cut in (0..needed).step_by(if needed > 600 { 7 } else { 1 }) {
            fs::write(&path, &bytes[..cut]).unwrap();
            let e = swallow(&path).expect_err(&format!("{ending} {i} of {} cut at {cut}", bytes.len()));
            assert!(e.message().contains(&format!("{i}.{ending}")), "{e}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1500))]

    #[test]
    fn mutated_images_never_panic(
        seed in any::<prop::sample::Index>(),
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0u8..4), 1..6),
    ) {
        let temp = tempfile::tempdir().unwrap();
        let (ending, mut bytes) = seeds()[seed.index(seeds().len())].clone();
        for (at, value, how) in edits {
            let at = at.index(bytes.len());
            match how {
                0 => bytes[at] = value,
                1 => bytes[at] ^= 1 << (value % 8),
                2 => bytes.insert(at, value),
                _ => bytes.truncate((at + 1).max(4)),
            }
        }
        let path = temp.path().join(format!("a.{ending}"));
        fs::write(&path, bytes).unwrap();
        let _ = swallow(&path);
    }
}
