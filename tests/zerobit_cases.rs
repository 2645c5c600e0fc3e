//! Hard cases of codec zerobit on single unit blocks: streams, extremes of coefficients, samples and null values.

mod support;
mod zerobit_coding;

use support::noise;
use vug::codec::Codec;
use vug::codec::zerobit::{Book, Context, Stream, Word, bits::Popcount, unit};
use vug::{Code, Extent, Grid, SampleType};
use zerobit_coding::{How, cell_of, cells, code, sample, unit_bytes};

const UNIT: Extent = Extent::cube(16);
const CELL: Extent = Extent::cube(4);

/// A cell with these coefficients besides 0: (p, value).
fn coefficients(some: &[(usize, i64)]) -> [i64; 64] {
    let mut all = [0; 64];
    some.iter().for_each(|&(p, v)| all[p] = v);
    all
}

fn u8s(cell: [i64; 64]) -> [u8; 64] {
    cell.map(|v| u8::try_from(v).unwrap())
}

#[test] // K-31; spec: ZBT-8, ZBT-13, ZBT-15, ZBT-16, ZBT-28: nothing is null, and the payload is as long as it can be
fn everything_is_stored() {
    let grid = cells(UNIT, |c| {
        let seed = (c[0] + 4 * c[1] + 16 * c[2]) as i64;
        u8s(cell_of(&std::array::from_fn(|p| if p == 0 { 100 + seed } else { 1 + (p as i64 * 7 + seed) % 5 })))
    });
    let coded = code(&grid, How::all());
    let payload = coded.payload();
    assert_eq!(payload.len(), 16 + 5004);
    assert_eq!(payload.len() as u64, *coded.codec.payload_lens(SampleType::U8, UNIT).end());
    let (nnnc, cbft, bytes) = unit_bytes(payload, 0).unwrap();
    assert_eq!((nnnc, cbft), (64, u64::MAX));
    // 8 of CBFT, 320 of CIA, 640 of ZSMS, 4032 of DIS.
    assert_eq!(bytes.len(), 8 + 320 + 640 + 4032);
    for rank in 0..64u32 {
        let offsets = u32::from_le_bytes(bytes[8 + 4 * rank as usize..][..4].try_into().unwrap());
        assert_eq!(
            offsets,
            (63 * rank) | ((10 * rank) << 16) | (1 << 31),
            "12 and 10 bits, and the zerobit of level 0"
        );
    }
    for cell in bytes[8 + 320..][..640].chunks(10) {
        assert_eq!(cell, [0xFF, 0xFF, 0x7F, 0x7F, 0x7F, 0x7F, 0x7F, 0x7F, 0x7F, 0x7F]);
    }
    assert_eq!(coded.decode().bytes(), grid.bytes());
    let old = code(&grid, How { stream: Stream::Old, ..How::all() });
    assert_eq!(old.payload().len(), 16 + 4748, "the longest of the old stream");
    assert_eq!(old.decode().bytes(), grid.bytes());
}

#[test] // K-30, K-42; spec: ZBT-11, ZBT-26: nothing at all: a directory and no codeword
fn nothing_is_stored() {
    for (t, null) in [(SampleType::U8, 0), (SampleType::Rgb8, 7), (SampleType::I16, -300), (SampleType::U16, 1024)] {
        for threshold in [Default::default(), vug::codec::zerobit::Threshold::Global] {
            let e = Extent::new(33, 16, 5);
            let mut grid = Grid::zeros(e, t).unwrap();
            match t {
                SampleType::U8 => {}
                SampleType::Rgb8 => grid.view_mut().fill([7u8; 3]),
                SampleType::I16 => grid.view_mut().fill(-300i16),
                _ => grid.view_mut().fill(1024u16),
            }
            let coded = code(&grid, How { null, threshold, ..How::all() });
            assert_eq!(coded.survey.nonzero, 0, "no share is divided by it");
            assert_eq!(coded.payload().len(), 16 + 3 * 4);
            assert!(coded.payload()[16..].iter().all(|&b| b == 0));
            assert!(coded.book().averages().is_empty() && coded.book().details().is_empty());
            assert_eq!(coded.decode().bytes(), grid.bytes());
            assert_eq!(coded.codec.voxel(coded.payload(), t, e, [32, 15, 4]).unwrap(), sample(t, [null; 3]));
        }
    }
}

#[test] // K-32; spec: ZBT-17: average 0 with details, average without details, and both beside a null cell
fn averages_and_details_without_each_other() {
    let grid = cells(UNIT, |c| match c {
        [1, 0, 0] => cell_of(&coefficients(&[(4, 10), (7 * 3 + 2, -5)])).map(|v| v as i16),
        [0, 2, 1] => [-77; 64],
        _ => [0; 64],
    });
    let coded = code(&grid, How::all());
    let (nnnc, cbft, bytes) = unit_bytes(coded.payload(), 0).unwrap();
    assert_eq!((nnnc, cbft), (2, 1 << 1 | 1 << (2 * 4 + 16)));
    let averages = &bytes[16..18];
    let word = |i: usize| coded.book().average(averages[i])[0];
    assert_eq!([word(0), word(1)], [0, -77]);
    // Cell 1: zerobit of node 3, maps of nodes 0 and 3; cell 24: zerobits of none, and none of node 0 either.
    assert_eq!(bytes[18..][..4], [0x20, 0x80 | 0x08, 0x20, 0x00]);
    assert_eq!(u32::from_le_bytes(bytes[12..16].try_into().unwrap()), 2 | 3 << 16, "bit 31 is clear");
    assert_eq!(coded.decode().bytes(), grid.bytes());
}

#[test] // K-33: the average is below the threshold, a detail above: it is stored whatever its size
fn an_average_below_the_threshold() {
    let grid = Grid::from_fn(CELL, |[x, ..]| if x < 2 { 90u8 } else { 112 }).unwrap();
    // Less the null value: average 1, d_04 −11. Of 64 coefficients one is to stay.
    let coded = code(&grid, How { null: 100, ..How::keep(1_000_000 / 64 + 1) });
    assert_eq!((coded.survey.nonzero, coded.survey.budget(15_626)), (2, 1));
    let (nnnc, _, bytes) = unit_bytes(coded.payload(), 0).unwrap();
    assert_eq!((nnnc, bytes.len()), (1, 8 + 5 + 2 + 1));
    assert_eq!(coded.book().averages(), [[101, 0, 0]]);
    assert_eq!(coded.decode().bytes(), grid.bytes());
}

/// Rounded coefficients that are not 0, and what a cell decodes to.
fn stored<T: vug::voxel::Sample>(t: SampleType, null: i32, cell: [T; 64]) -> (Vec<(u32, i32)>, Vec<T>) {
    let grid = Grid::from_samples(CELL, &cell).unwrap();
    let coded = code(&grid, How { null, ..How::all() });
    let decoded = coded.decode().samples::<T>().to_vec();
    let Some(unit) = unit(coded.payload(), 0) else { return (Vec::new(), decoded) };
    let cell = unit.cell(0, Popcount).unwrap();
    let mut found = vec![(0, coded.book().average(cell.average)[0])];
    use vug::codec::zerobit::Coefficients;
    for p in 1..64 {
        if let Some(index) = cell.detail((p - 1) / 7, (p - 1) % 7 + 1, Popcount, &mut ()) {
            found.push((p, coded.book().detail(index)[0]));
        }
    }
    assert_eq!(t, coded.sample_type);
    (found, decoded)
}

fn at(k: usize) -> [usize; 3] {
    [k & 3, k >> 2 & 3, k >> 4]
}

#[test] // K-34, K-35, K-48, K-49; spec: ZBT-5, ZBT-13, ZBT-22, ZBT-24: the cells of the chapter's table
fn cells_of_the_chapter() {
    let u8_cell = |f: fn([usize; 3]) -> u8| stored(SampleType::U8, 0, std::array::from_fn(|k| f(at(k))));
    let same = |f: fn([usize; 3]) -> u8| (0..64).map(|k| f(at(k))).collect::<Vec<u8>>();
    // The letters: a step along x is the first one's, p = 4; along y 2; along z 1.
    for (p, f) in [
        (4, (|[x, ..]| if x < 2 { 10 } else { 30 }) as fn([usize; 3]) -> u8),
        (2, |[_, y, _]| if y < 2 { 10 } else { 30 }),
        (1, |[.., z]| if z < 2 { 10 } else { 30 }),
    ] {
        assert_eq!(u8_cell(f), (vec![(0, 20), (p, -10)], same(f)));
    }
    let ramp = |[x, ..]: [usize; 3]| 10 * x as u8;
    let of_ramp: Vec<(u32, i32)> = [(0, 15), (4, -10)].into_iter().chain((1..=8).map(|i| (7 * i + 4, -5))).collect();
    assert_eq!(u8_cell(ramp), (of_ramp, same(ramp)));
    // Checkerboards: only xyz of level 1, ±127.5, of which 128 does not fit.
    let hhh = |v| [(0, 128)].into_iter().chain((1..=8).map(move |i| (7 * i + 7, v))).collect::<Vec<(u32, i32)>>();
    let (found, decoded) = u8_cell(|[x, y, z]| if (x + y + z) % 2 == 0 { 255 } else { 0 });
    assert_eq!((found, decoded), (hhh(127), same(|[x, y, z]| if (x + y + z) % 2 == 0 { 255 } else { 1 })));
    let (found, decoded) = u8_cell(|[x, y, z]| if (x + y + z) % 2 == 0 { 0 } else { 255 });
    assert_eq!((found, decoded), (hhh(-127), same(|[x, y, z]| if (x + y + z) % 2 == 0 { 1 } else { 255 })));
    // The whole range of 16 bits: sums to 64 · 65,535, squares in 64 bits, details clamped.
    let half = |low: i64, high: i64| -> [i64; 64] { std::array::from_fn(|k| if at(k)[0] < 2 { low } else { high }) };
    let (found, decoded) = stored(SampleType::U16, 0, half(65_535, 0).map(|v| v as u16));
    assert_eq!((found, decoded), (vec![(0, 32_768), (4, 32_767)], half(65_535, 1).map(|v| v as u16).to_vec()));
    let (found, decoded) = stored(SampleType::I16, 0, half(32_767, -32_768).map(|v| v as i16));
    assert_eq!((found, decoded), (vec![(0, 0), (4, 32_767)], half(32_767, -32_767).map(|v| v as i16).to_vec()));
    for null in [-1024i16, 1024] {
        assert_eq!(stored(SampleType::I16, null.into(), [null; 64]), (vec![], vec![null; 64]));
        assert_eq!(
            stored(SampleType::I16, null.into(), [0i16; 64]),
            (vec![(0, 0)], vec![0; 64]),
            "0 is a value like others"
        );
    }
}

#[test] // K-36, K-37; spec: ZBT-24, ZBT-25: sums far outside the range, clamped once, at the end
fn extreme_words() {
    let all: [i64; 64] = std::array::from_fn(|p| if p == 0 { 100 } else { 1 + p as i64 % 2 });
    let coded = code(&Grid::from_samples(CELL, &u8s(cell_of(&all))).unwrap(), How::all());
    let (average, details) = (coded.book().averages().len(), coded.book().details());
    assert_eq!((average, details), (1, &[[1, 0, 0], [2, 0, 0]][..]));
    let cell = unit(coded.payload(), 0).unwrap().cell(0, Popcount).unwrap();
    for t in [SampleType::U8, SampleType::U16, SampleType::I16] {
        let (lo, hi, least, most) = match t {
            SampleType::U8 => (0, 255, -128, 127),
            SampleType::U16 => (0, 65_535, -32_768, 32_767),
            _ => (-32_768, 32_767, -32_768, 32_767),
        };
        let mut widest = [0, 0];
        for words in [[lo, least, least], [lo, most, least], [hi, most, most], [hi, least, most], [hi, most, least]] {
            let [mean, one, two] = words.map(i64::from);
            let book = Book::new(t, vec![[words[0], 0, 0]], vec![[words[1], 0, 0], [words[2], 0, 0]]).unwrap();
            let decoder = Context { book: &book, sample_type: t, count: Popcount };
            let exact = cell_of(&std::array::from_fn(|p| if p == 0 { mean } else { [one, two][p % 2] }));
            widest = [widest[0].min(*exact.iter().min().unwrap()), widest[1].max(*exact.iter().max().unwrap())];
            let clamped = |v: i64| v.clamp(lo.into(), hi.into()) as i32;
            assert_eq!(decoder.cell(&cell, &mut ()).map(|w| w[0]), exact.map(clamped), "{t} {words:?}");
            // Half resolution is clamped by itself; finer values come from the sum that was not.
            let group =
                cell_of(&std::array::from_fn(|p| if p == 0 { mean } else { [one, two][p % 2] * i64::from(p < 8) }));
            let means: [i64; 8] = std::array::from_fn(|i| group[2 * (i & 1) + 8 * (i >> 1 & 1) + 32 * (i >> 2)]);
            assert_eq!(decoder.means(&cell, &mut ()).map(|w| w[0]), means.map(clamped));
        }
        let bits8 = t == SampleType::U8;
        let [low, high] = if bits8 { [-1_792, 2_047] } else { [-491_520, 524_287] };
        assert!(widest[0] >= low && widest[1] <= high, "{widest:?}");
        assert!(
            widest[0] < i64::from(lo) - i64::from(most) && widest[1] > i64::from(hi) + i64::from(most),
            "{widest:?}"
        );
    }
    // 250 and 20 are clamped to 255 where they are shown, but the voxel is 270 − 30 = 240.
    let grid = cells(CELL, |_| u8s(cell_of(&coefficients(&[(0, 100), (1, 20), (7 + 1, -30)]))));
    let coded = code(&grid, How::all());
    let words: Vec<Word> = coded.book().details().to_vec();
    let book = Book::new(SampleType::U8, vec![[250, 0, 0]], words).unwrap();
    let cell = unit(coded.payload(), 0).unwrap().cell(0, Popcount).unwrap();
    let decoder = Context { book: &book, sample_type: SampleType::U8, count: Popcount };
    assert_eq!(decoder.mean(&cell, [0; 3], &mut ())[0], 255);
    assert_eq!([decoder.voxel(&cell, [0; 3], &mut ())[0], decoder.voxel(&cell, [0, 0, 1], &mut ())[0]], [240, 255]);
}

#[test] // K-50; spec: ZBT-9, ZBT-27: partial cells repeat the last voxels, cells outside are null, no voxel lies there
fn sizes_that_are_no_multiples() {
    // Nothing along x changes: with repeated voxels there is no detail along x anywhere.
    let column = |c: [u32; 3]| (40 + 3 * c[1] + 2 * c[2]) as u8;
    for dims in [[1, 1, 1], [17, 16, 16], [5, 5, 5], [16, 16, 33], [3, 70, 2], [20, 20, 225]] {
        let e = Extent::from(dims);
        let grid = Grid::from_fn(e, column).unwrap();
        let coded = code(&grid, How::all());
        coded.each_cell(|payload, index, n, _| {
            use vug::codec::zerobit::Coefficients;
            let cell = unit(payload, index).unwrap().cell(n, Popcount).unwrap();
            for i in 0..9 {
                assert!([4, 5, 6, 7].iter().all(|&j| cell.detail(i, j, Popcount, &mut ()).is_none()), "{e}");
            }
        });
        for (region, payload) in &coded.bricks {
            let brick = region.extent();
            for a in 0..3 {
                let mut beyond = [0; 3];
                beyond[a] = brick.to_array()[a];
                let error = coded.codec.voxel(payload, SampleType::U8, brick, beyond).unwrap_err();
                assert_eq!(error.code(), Code::Range);
            }
        }
        assert_eq!(coded.decode().extent(), e);
    }
    let one = code(&noise(Extent::cube(1), |_| 255u8), How::all());
    assert_eq!((one.payload().len(), one.decode().bytes()), (16 + 4 + 8 + 5 + 1 + 2, &[255][..]));
}

#[test] // spec: ZBT-1, ZBT-2, ZBT-3: what the codec table may say
fn codec_entries() {
    let null = sample(SampleType::U8, [0; 3]);
    let read = |version, at: usize, value: u8| {
        let mut params = [0; 28];
        params[at] = value;
        Codec::from_wire(3, version, &params, null).map_err(|e| (e.code(), e.field().to_owned()))
    };
    for version in [0, 3, 65_535] {
        assert_eq!(read(version, 0, 0).unwrap_err().0, Code::Codec);
    }
    for (at, value) in [(0, 255), (4, 1), (5, 1), (6, 1), (8, 9), (15, 255)] {
        for version in [1, 2] {
            let codec = read(version, at, value).unwrap();
            let (id, again, params) = codec.to_wire();
            assert_eq!((id, again, params[at]), (3, version, value));
            assert_eq!(codec.supports(SampleType::F32).unwrap_err().code(), Code::Param);
            for t in [SampleType::U8, SampleType::U16, SampleType::I16, SampleType::Rgb8] {
                codec.supports(t).unwrap();
            }
        }
    }
    for (at, field) in [(4, "threshold"), (5, "norm"), (6, "training")] {
        assert_eq!(read(1, at, 2).unwrap_err(), (Code::Param, field.into()));
    }
    assert_eq!(read(1, 3, 1).unwrap_err(), (Code::Param, "keep".into()));
    for at in std::iter::once(7).chain(16..28) {
        assert_eq!(read(2, at, 1).unwrap_err().0, Code::Reserved);
    }
    // Reserved bytes come first, then threshold, norm and training, then keep.
    let mut params = [255; 28];
    assert_eq!(Codec::from_wire(3, 1, &params, null).unwrap_err().code(), Code::Reserved);
    params[7] = 0;
    params[16..].fill(0);
    for (at, field) in [(4, "threshold"), (5, "norm"), (6, "training"), (0, "keep")] {
        let error = Codec::from_wire(3, 1, &params, null).unwrap_err();
        assert_eq!((error.code(), error.field()), (Code::Param, field));
        params[at] = 0;
    }
    params[1..4].fill(0);
    Codec::from_wire(3, 1, &params, null).unwrap();
    assert_eq!(Codec::from_wire(3, 1, &[0; 28], null).unwrap().to_wire().2, [0; 28]);
}
