//! Raw and npy files, the latter judged by the crate `npyz`.
#![cfg(feature = "convert")]

use npyz::WriterBuilder;
use std::path::Path;
use vug::affine::{Placement, ValueMap};
use vug::convert::{ExportInfo, Import, ImportOptions, Kind, Stored, export, import};
use vug::error::Code;
use vug::voxel::SampleValue;
use vug::{Extent, Grid, SampleType};

const EXTENT: Extent = Extent::new(5, 4, 3);

/// A grid whose every byte differs from its neighbours.
fn grid(t: SampleType) -> Grid {
    let mut grid = Grid::zeros(EXTENT, t).unwrap();
    for (i, b) in grid.bytes_mut().iter_mut().enumerate() {
        *b = (i * 37 % 251) as u8;
    }
    grid
}

fn load(path: &Path, options: &ImportOptions) -> vug::Result<(Grid, Import)> {
    let mut import = import(path, options)?;
    let mut grid = Grid::zeros(import.reader.extent(), import.reader.sample_type())?;
    for z in 0..grid.extent().z {
        let plane = grid.bytes().len() / grid.extent().z as usize;
        import.reader.read_slab(z..z + 1, &mut grid.bytes_mut()[z as usize * plane..][..plane])?;
    }
    Ok((grid, import))
}

fn options(t: SampleType) -> ImportOptions {
    ImportOptions { shape: Some(EXTENT), dtype: Some(t), ..ImportOptions::default() }
}

#[test]
fn npyz_and_this_reader_agree() {
    let temp = tempfile::tempdir().unwrap();
    let path = temp.path().join("a.npy");
    let info =
        ExportInfo { placement: &Placement::default(), value_map: ValueMap::default(), times: None, header: None };
    for t in SampleType::ALL {
        let grid = grid(t);
        export(&path, &grid, &info).unwrap();
        let npy = npyz::NpyFile::new(std::fs::File::open(&path).unwrap()).unwrap();
        let shape: &[u64] = if t == SampleType::Rgb8 { &[3, 4, 5, 3] } else { &[3, 4, 5] };
        assert_eq!((npy.shape(), npy.order()), (shape, npyz::Order::C));
        match t {
            SampleType::U8 | SampleType::Rgb8 => assert_eq!(npy.into_vec::<u8>().unwrap(), grid.bytes()),
            SampleType::U16 => assert_eq!(npy.into_vec::<u16>().unwrap(), grid.samples::<u16>()),
            SampleType::I16 => assert_eq!(npy.into_vec::<i16>().unwrap(), grid.samples::<i16>()),
            SampleType::F32 => assert_eq!(npy.into_vec::<f32>().unwrap(), grid.samples::<f32>()),
        }
        assert_eq!(std::fs::read(&path).unwrap().len() % 64, grid.bytes().len() % 64, "samples start aligned");
    }
    // The other way: C and Fortran order, all numbers of axes, big endian, wide types.
    for (shape, order, extent) in [
        (vec![], npyz::Order::C, [1, 1, 1]),
        (vec![6], npyz::Order::C, [6, 1, 1]),
        (vec![2, 3], npyz::Order::C, [3, 2, 1]),
        (vec![2, 3, 4], npyz::Order::C, [4, 3, 2]),
        (vec![2, 3, 4], npyz::Order::Fortran, [2, 3, 4]),
    ] {
        let n: u64 = shape.iter().product();
        for dtype in ["<i2", ">i2", "<i4", ">i8", ">f4", "<f8", "|i1"] {
            let mut bytes = Vec::new();
            let values: Vec<f64> = (0..n).map(|v| v as f64).collect();
            macro_rules! write {
                ($t:ty) => {{
                    let dtype = npyz::DType::new_scalar(dtype.parse().unwrap());
                    let options = npyz::WriteOptions::<$t>::new().dtype(dtype).shape(&shape).order(order);
                    let mut w = options.writer(&mut bytes).begin_nd().unwrap();
                    w.extend(values.iter().map(|v| *v as $t)).unwrap();
                    w.finish().unwrap();
                }};
            }
            match &dtype[1..] {
                "i1" => write!(i8),
                "i2" => write!(i16),
                "i4" => write!(i32),
                "i8" => write!(i64),
                "f4" => write!(f32),
                _ => write!(f64),
            }
            std::fs::write(&path, &bytes).unwrap();
            let (grid, import) = load(&path, &ImportOptions::default()).unwrap();
            assert_eq!(grid.extent().to_array(), extent, "{shape:?} {order:?}");
            assert!(import.streamed);
            for i in 0..n {
                let [x, y, _] = extent.map(u64::from);
                let at = [i % x, i / x % y, i / x / y].map(|v| v as u32);
                assert_eq!(grid.value(at).unwrap().component(0), i as f64, "{dtype} {shape:?}");
            }
        }
    }
}

#[test]
fn npy_colours() {
    let temp = tempfile::tempdir().unwrap();
    let path = temp.path().join("a.npy");
    let write = |shape: &str, fortran: &str, n: u8| {
        let text = format!("{{'descr': '|u1', 'fortran_order': {fortran}, 'shape': {shape}, }}");
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((text.len() as u16).to_le_bytes());
        bytes.extend(text.as_bytes());
        bytes.extend(0..n);
        std::fs::write(&path, bytes).unwrap();
    };
    write("(2, 1, 4, 3)", "False", 24);
    let (grid, _) = load(&path, &ImportOptions::default()).unwrap();
    assert_eq!((grid.extent().to_array(), grid.sample_type()), ([4, 1, 2], SampleType::Rgb8));
    assert_eq!(grid.value([1, 0, 0]).unwrap(), SampleValue::Rgb8([3, 4, 5]));
    write("(3, 4, 1, 2)", "True", 24);
    assert_eq!(load(&path, &ImportOptions::default()).unwrap().0.extent().to_array(), [4, 1, 2]);
    // Three axes are a volume, unless the caller says that they are an image.
    write("(2, 4, 3)", "False", 24);
    assert_eq!(load(&path, &ImportOptions::default()).unwrap().0.extent().to_array(), [3, 4, 2]);
    let rgb = ImportOptions { dtype: Some(SampleType::Rgb8), ..ImportOptions::default() };
    assert_eq!(load(&path, &rgb).unwrap().0.extent().to_array(), [4, 2, 1]);
    write("(2, 1, 4, 4, 1, 1)", "False", 32);
    let e = load(&path, &ImportOptions::default()).err().unwrap();
    assert!(e.code() == Code::Unsupported && e.message().contains("[2, 1, 4, 4, 1, 1]"), "{e}");
}

#[test]
fn raw_files_need_what_they_cannot_say() {
    let temp = tempfile::tempdir().unwrap();
    let path = temp.path().join("a.raw");
    std::fs::write(&path, [0u8; 120]).unwrap();
    let none = ImportOptions::default();
    let shape = ImportOptions { shape: Some(EXTENT), ..ImportOptions::default() };
    for (options, code, word) in [
        (none, Code::Param, "--shape"),
        (shape.clone(), Code::Param, "--dtype"),
        (ImportOptions { dtype: Some(SampleType::U8), ..shape.clone() }, Code::Size, "60 bytes, the file has 120"),
        (ImportOptions { shape: Some(Extent::new(0, 1, 1)), ..options(SampleType::U8) }, Code::Param, "empty"),
        (ImportOptions { shape: Some(Extent::cube(u32::MAX)), ..options(SampleType::U8) }, Code::Limit, "exceeds"),
    ] {
        let e = load(&path, &options).err().unwrap();
        assert!(e.code() == code && e.message().contains(word), "{e}");
    }
    load(&path, &options(SampleType::U16)).unwrap();
    // Stored big endian, delivered as another type.
    let bytes: Vec<u8> = (0..60i32).flat_map(|v| (v - 30).to_be_bytes()).collect();
    std::fs::write(&path, bytes).unwrap();
    let big = Stored { kind: Kind::I32, big_endian: true };
    let (grid, _) = load(&path, &ImportOptions { raw_dtype: Some(big), ..shape.clone() }).unwrap();
    assert_eq!(grid.samples::<i16>(), (-30..30).collect::<Vec<i16>>());
    let wide = ImportOptions { raw_dtype: Some(big), dtype: Some(SampleType::F32), ..shape };
    assert_eq!(load(&path, &wide).unwrap().0.samples::<f32>()[0], -30.0);
}

#[test]
fn a_slab_of_a_large_file_costs_a_slab() {
    let temp = tempfile::tempdir().unwrap();
    let path = temp.path().join("a.raw");
    let extent = Extent::new(2048, 2048, 1000);
    let file = std::fs::File::create(&path).unwrap();
    // 8 GB that take no room on file systems with holes.
    if file.set_len(extent.voxels() * 2).is_err() {
        println!("skipped: no sparse files here");
        return;
    }
    let options = ImportOptions { shape: Some(extent), dtype: Some(SampleType::U16), ..ImportOptions::default() };
    let mut import = import(&path, &options).unwrap();
    assert!(import.streamed);
    let mut slab = vec![1; 2048 * 2048 * 2];
    import.reader.read_slab(999..1000, &mut slab).unwrap();
    assert!(slab.iter().all(|b| *b == 0));
    assert_eq!(import.reader.read_slab(1000..1001, &mut slab).unwrap_err().code(), Code::Range);
    assert_eq!(import.reader.read_slab(0..2, &mut slab).unwrap_err().code(), Code::Range);
}
