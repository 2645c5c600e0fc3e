//! The unit block of Fig. 6 (Bajaj et al. 2001): nine stored cells, and the way to detail 5 of node 5 of cell 8.

mod zerobit_support;

use vug::checksum::crc32;
use vug::codec::zerobit::bits::{self, BitCount, CountTable, Popcount};
use vug::codec::zerobit::{Case, Coefficients, Context, Counts, Stream, unit};
use vug::geometry::Extent;
use vug::voxel::{SampleType, SampleValue};
use zerobit_support::*;

#[test] // K-55, V9; spec: ZBT-15, ZBT-16, ZBT-20, ZBT-21
fn the_unit_block_has_the_bytes_of_the_figure() {
    let bytes = new_unit(&figure());
    assert_eq!((bytes.len(), crc32(&bytes)), (132, 0xF473_E3AF));
    // As the paper orders them: NNNC first, records of five bytes, no padding. The same length.
    let mut paper = vec![9];
    paper.extend(&bytes[..8]);
    for rank in 0..9 {
        paper.push(bytes[8 + 36 + rank]);
        paper.extend(&bytes[8 + 4 * rank..12 + 4 * rank]);
    }
    paper.extend(&bytes[53..131]);
    assert_eq!((paper.len(), crc32(&paper)), (132, 0xEC3B_6E3E));
    // The place of the record and its way: 27 = 24 + 1 + 2, displacement 7, address 48.
    let record = u32::from_le_bytes(bytes[40..44].try_into().unwrap());
    let (detail_offset, zerobit_offset) = (record as usize & 0xFFFF, (record >> 16) as usize & 0x7FFF);
    assert_eq!((detail_offset, zerobit_offset, record >> 31), (41, 24, 1));
    let zsms = &bytes[8 + 9 * 5..];
    assert_eq!(zsms[24..28], [0x28, 0xCA, 0x41, 0x35]);
    let zerobits = zsms[zerobit_offset];
    assert!(bits::has_node(zerobits, 5));
    let nodes_before = 1 + bits::nodes_before(zerobits, 5).count_ones() as usize;
    let place = zerobit_offset + 1 + nodes_before;
    assert_eq!((nodes_before, place), (2, 27));
    assert!(bits::has_detail(zsms[place], 5));
    let displacement = bits::details(zsms[25]).count_ones()
        + bits::details(zsms[26]).count_ones()
        + bits::details_before(zsms[27], 5).count_ones();
    assert_eq!(displacement, 3 + 2 + 2);
    let dis = &zsms[28..];
    let address = detail_offset + displacement as usize;
    assert_eq!((address, dis[address]), (48, 48));
    assert_eq!(dis[..50], (0..50).collect::<Vec<u8>>());
}

#[test] // K-55; spec: ZBT-14, ZBT-17, ZBT-18
fn the_decoder_finds_it_and_meets_every_case() {
    let payload = payload(Stream::New, 0, &[figure(), UnitSpec::new()]);
    let entries = CountTable::entries();
    decodes(&payload, Popcount);
    decodes(&payload, CountTable::new(&entries));
    assert!(unit(&payload, 1).is_none(), "case 1: void");
}

fn decodes(payload: &[u8], count: impl BitCount) {
    let unit = unit(payload, 0).unwrap();
    let mut counts = Counts::default();
    let eighth = unit.cell(41, count).unwrap();
    assert_eq!(eighth.detail(5, 5, count, &mut counts), Some(48));
    assert_eq!((eighth.average, eighth.average(&mut counts)), (18, Some(18)));
    // The query set: 3d, 2, 3b, 3c, 3a.
    assert_eq!(unit.cell(0, count).unwrap().detail(0, 1, count, &mut counts), Some(0));
    assert!(unit.cell(2, count).is_none());
    assert_eq!(eighth.detail(1, 1, count, &mut counts), None);
    assert_eq!(eighth.detail(5, 1, count, &mut counts), None);
    let of = [Case::Average, Case::NullNode, Case::NullDetail, Case::Detail].map(|case| counts.of(case));
    assert_eq!((of, counts.decodes(), counts.vector_ops), ([1, 1, 1, 2], 5, 0));
    // All coefficients of all cells.
    let figure = figure();
    for n in 0..64u8 {
        assert_eq!(unit.cell(u32::from(n), count).is_some(), figure.contains_key(&n), "cell {n}");
        let Some(spec) = figure.get(&n) else { continue };
        let cell = unit.cell(u32::from(n), count).unwrap();
        for (i, j) in (0..9).flat_map(|i| (1..8).map(move |j| (i, j))) {
            let found = cell.detail(u32::from(i), u32::from(j), count, &mut ());
            assert_eq!(found, spec.details.get(&(i, j)).copied(), "cell {n}, detail {i} {j}");
        }
    }
}

#[test] // K-55: the other bit order must fail
fn the_other_bit_order_reads_something_else() {
    let t = SampleType::U8;
    let unit_bytes = new_unit(&figure());
    let as_figure = payload(Stream::New, 0, &[figure()]);
    assert_eq!(as_figure[20..], unit_bytes);
    let codec = codec(Stream::New, t, vec![book(t, 32, 64)]);
    let brick = Extent::cube(16);
    codec.check(&as_figure, t, brick, 0).unwrap();
    let right = decode(&codec, &as_figure, brick, t);
    // The zerobits byte of cell 8 with its bits in the other order: nodes 4 and 6 instead of 3 and 5.
    let place = 20 + 8 + 45 + 24;
    assert_eq!(as_figure[place], 0x28);
    let mut zerobits = as_figure.clone();
    zerobits[place] = 0x28u8.reverse_bits();
    let cell = unit(&zerobits, 0).unwrap().cell(41, Popcount).unwrap();
    let mut counts = Counts::default();
    assert_eq!(cell.detail(5, 5, Popcount, &mut counts), None);
    assert_eq!(counts.of(Case::NullNode), 1, "case 3b");
    assert!(decode(&codec, &zerobits, brick, t).bytes() != right.bytes());
    // The map of node 5 in the other order.
    let mut map = as_figure.clone();
    map[place + 3] = (0x35u8 << 1).reverse_bits();
    assert!(decode(&codec, &map, brick, t).bytes() != right.bytes());
    assert!(codec.check(&zerobits, t, brick, 0).is_ok(), "a valid stream, but of another cell");
    // Flags of cells in the other order: cell 63 instead of cell 0.
    let mut cbft = as_figure.clone();
    let flags = u64::from_le_bytes(cbft[20..28].try_into().unwrap());
    cbft[20..28].copy_from_slice(&flags.reverse_bits().to_le_bytes());
    assert!(
        unit(&cbft, 0).unwrap().cell(63, Popcount).is_some() && unit(&cbft, 0).unwrap().cell(0, Popcount).is_none()
    );
}

#[test] // K-38, K-55: voxel, plane and cell modes agree on the figure; the old stream decodes to the same voxels
fn modes_and_streams_agree_on_the_figure() {
    let t = SampleType::U8;
    let book = book(t, 32, 64);
    let context = Context { book: &book, sample_type: t, count: Popcount };
    let payload_new = payload(Stream::New, 0, &[figure()]);
    for n in FIGURE_CELLS {
        let cell = unit(&payload_new, 0).unwrap().cell(u32::from(n), Popcount).unwrap();
        let all = context.cell(&cell, &mut ());
        for k in 0..64u32 {
            let at = [k & 3, k >> 2 & 3, k >> 4];
            assert_eq!(context.voxel(&cell, at, &mut ()), all[k as usize], "cell {n}, {at:?}");
            for axis in 0..3 {
                let plane = context.plane(&cell, axis, at[axis], &mut ());
                let rest: Vec<u32> = (0..3).filter(|&a| a != axis).map(|a| at[a]).collect();
                assert_eq!(plane[(rest[0] + 4 * rest[1]) as usize], all[k as usize]);
            }
        }
    }
    let brick = Extent::cube(16);
    let [new, old] = [Stream::New, Stream::Old].map(|stream| {
        let codec = codec(stream, t, vec![book.clone()]);
        let payload = payload(stream, 0, &[figure()]);
        codec.check(&payload, t, brick, 0).unwrap();
        let voxel = codec.voxel(&payload, t, brick, [6, 9, 10]).unwrap();
        let grid = decode(&codec, &payload, brick, t);
        assert_eq!(grid.value([6, 9, 10]).unwrap(), voxel);
        assert_eq!(grid.value([8, 0, 0]).unwrap(), SampleValue::U8(7), "a null cell");
        (grid.bytes().to_vec(), voxel)
    });
    assert_eq!(new, old);
}
