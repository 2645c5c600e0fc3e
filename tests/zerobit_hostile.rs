//! Zerobit payloads that no encoder wrote: readers give defined values, the strict validator gives the right code.

mod zerobit_support;

use proptest::prelude::*;
use vug::Code;
use vug::codec::Codec;
use vug::codec::zerobit::bits::Popcount;
use vug::codec::zerobit::{Context, Layout, Stream, unit};
use vug::geometry::{Extent, Region};
use vug::grid::Grid;
use vug::voxel::SampleType;
use zerobit_support::*;

/// All codes that a payload can have.
const CODES: [Code; 8] =
    [Code::Nnnc, Code::Offset, Code::CodebookIndex, Code::Canon, Code::Padding, Code::Size, Code::Reserved, Code::Ref];

fn edge() -> impl Strategy<Value = u32> {
    prop_oneof![Just(1u32), Just(4), Just(15), Just(16), Just(17), 1u32..40]
}

/// A brick, and bytes of a possible length; mostly with a codebook that exists and places that lie inside.
fn payloads() -> impl Strategy<Value = (SampleType, Stream, Extent, Vec<u8>)> {
    let stream = prop_oneof![Just(Stream::New), Just(Stream::Old)];
    (prop::sample::select(TYPES.to_vec()), stream, [edge(), edge(), edge()], any::<u64>(), 0..4u8).prop_map(
        |(t, stream, [x, y, z], seed, how)| {
            let brick = Extent::new(x, y, z);
            let layout = Layout::new(brick);
            let (least, most) = (layout.min_len() as usize, layout.max_len(stream) as usize);
            let mut random = Random(seed);
            let len = least + random.below((most - least + 1).min(if how == 0 { 40 } else { 6000 }));
            let mut bytes = random.bytes(len);
            if how < 3 {
                bytes[..4].fill(0);
                for entry in bytes[16..least].chunks_exact_mut(4) {
                    let place = random.below(len / 4 + 2) as u32;
                    entry.copy_from_slice(&(random.word() as u32 & 0x7F | place << 8).to_le_bytes());
                }
            }
            (t, stream, brick, bytes)
        },
    )
}

/// Reads a payload in every way; `None` where it names no codebook.
fn read_all(codec: &Codec, payload: &[u8], brick: Extent, t: SampleType) -> Option<Vec<u8>> {
    let whole = Region::whole(brick);
    let mut plain = Grid::zeros(brick, t).unwrap();
    let mut fast = Grid::zeros(brick, t).unwrap();
    if let Err(e) = codec.decode_plain(payload, brick, &whole, plain.view_mut()) {
        assert_eq!(e.code(), Code::Ref, "{e}");
        assert_eq!(codec.decode(payload, brick, &whole, fast.view_mut()).unwrap_err().code(), Code::Ref);
        assert_eq!(codec.voxel(payload, t, brick, [0; 3]).unwrap_err().code(), Code::Ref);
        return None;
    }
    codec.decode(payload, brick, &whole, fast.view_mut()).unwrap();
    assert!(plain.bytes() == fast.bytes(), "plain and fast differ");
    codec.decode(payload, brick, &whole, fast.view_mut()).unwrap();
    assert!(plain.bytes() == fast.bytes(), "another result the second time");
    let mut random = Random(payload.len() as u64);
    for _ in 0..40 {
        let c = brick.to_array().map(|n| random.below(n as usize) as u32);
        assert_eq!(codec.voxel(payload, t, brick, c).unwrap(), plain.value(c).unwrap(), "{c:?}");
    }
    // Parts, from a payload at any address, into a place with pitches.
    let mut shifted = vec![0xAA; random.below(16)];
    let shift = shifted.len();
    shifted.extend(payload);
    let start: [u32; 3] = brick.to_array().map(|n| random.below(n as usize) as u32);
    let end = std::array::from_fn(|a| start[a] + 1 + random.below((brick.to_array()[a] - start[a]) as usize) as u32);
    let part = Region { start, end };
    let mut fast = Grid::zeros(brick, t).unwrap();
    codec.decode(&shifted[shift..], brick, &part, fast.view_mut().sub(&part)).unwrap();
    for c in [start, end.map(|v| v - 1), std::array::from_fn(|a| (start[a] + end[a]) / 2)] {
        assert_eq!(fast.value(c).unwrap(), plain.value(c).unwrap(), "{part}, {c:?}");
    }
    let mut expected = Grid::zeros(brick, t).unwrap();
    codec.decode_plain(payload, brick, &part, expected.view_mut().sub(&part)).unwrap();
    assert!(expected.bytes() == fast.bytes(), "{part}: another part, or voxels outside it were written");
    let mut all = plain.bytes().to_vec();
    for steps in 1..=2 {
        let small = reduced(codec, payload, brick, t, steps);
        assert!(small.bytes() == reduced(codec, payload, brick, t, steps).bytes());
        all.extend(small.bytes());
    }
    Some(all)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test] // spec: ZBT-12, ZBT-10, ZBT-7
    fn any_bytes_decode_to_defined_values((t, stream, brick, payload) in payloads()) {
        let words = payload.len() % 200;
        let codec = codec(stream, t, vec![book(t, words + 1, words)]);
        let first = read_all(&codec, &payload, brick, t);
        prop_assert_eq!(&first, &read_all(&codec, &payload, brick, t));
        prop_assert_eq!(first.is_none(), payload[..4] != [0; 4]);
        match codec.check(&payload, t, brick, 1000) {
            Ok(()) => prop_assert!(rebuilt(stream, &payload, brick) == payload),
            Err(e) => prop_assert!(CODES.contains(&e.code()) && e.offset() >= Some(1000), "{}", e),
        }
    }

    #[test] // K-38; spec: ZBT-12: voxel, plane and cell modes agree whatever the bytes say
    fn modes_agree_on_any_bytes((t, stream, brick, payload) in payloads(), n in 0..64u32) {
        let book = book(t, 100, 100);
        let context = Context { book: &book, sample_type: t, count: Popcount };
        for index in 0..Layout::new(brick).units.voxels() as usize {
            let Some(unit) = unit(&payload, index) else { continue };
            macro_rules! modes {
                ($cell:expr) => {
                    let Some(cell) = $cell else { continue };
                    let all = context.cell(&cell, &mut ());
                    let means = context.means(&cell, &mut ());
                    for k in 0..64u32 {
                        let at = [k & 3, k >> 2 & 3, k >> 4];
                        prop_assert_eq!(context.voxel(&cell, at, &mut ()), all[k as usize]);
                        let plane = context.plane(&cell, 1, at[1], &mut ());
                        prop_assert_eq!(plane[(at[0] + 4 * at[2]) as usize], all[k as usize]);
                        let half = at.map(|v| v >> 1);
                        let mean = means[(half[0] + 2 * half[1] + 4 * half[2]) as usize];
                        prop_assert_eq!(context.mean(&cell, half, &mut ()), mean);
                        let plane = context.mean_plane(&cell, 2, half[2], &mut ());
                        prop_assert_eq!(plane[(half[0] + 2 * half[1]) as usize], mean);
                    }
                };
            }
            match stream {
                Stream::New => { modes!(unit.cell(n, Popcount)); }
                Stream::Old => { modes!(unit.old_cell(n, Popcount)); }
            }
        }
    }

    #[test] // spec: ZBT-33, ZBT-28: what the validator takes is the one encoding of what it decodes to
    fn changed_streams_are_refused_or_other_valid_ones(seed in any::<u64>(), old in any::<bool>(), changes in 1..4usize) {
        let (t, brick) = (SampleType::U8, Extent::new(20, 16, 9));
        let stream = if old { Stream::Old } else { Stream::New };
        let mut random = Random(seed);
        let codec = codec(stream, t, vec![book(t, 9, 4)]);
        let mut payload = payload(stream, 0, &units(&mut random, brick, [9, 4]));
        for _ in 0..changes {
            let at = random.below(payload.len());
            payload[at] = if random.below(2) == 0 { random.word() as u8 } else { payload[at] ^ 1 << random.below(8) };
        }
        match codec.check(&payload, t, brick, 0) {
            Ok(()) => prop_assert!(rebuilt(stream, &payload, brick) == payload),
            Err(e) => prop_assert!(CODES.contains(&e.code()), "{}", e),
        }
        read_all(&codec, &payload, brick, t);
    }
}

/// The payload of what a payload decodes to.
fn rebuilt(stream: Stream, bytes: &[u8], brick: Extent) -> Vec<u8> {
    payload(stream, u32::from_le_bytes(bytes[..4].try_into().unwrap()), &parse(stream, bytes, brick))
}

#[test] // spec: ZBT-33, ZBT-8
fn every_flip_and_every_truncation_of_a_valid_payload() {
    let (t, brick) = (SampleType::U8, Extent::new(17, 16, 8));
    for stream in [Stream::New, Stream::Old] {
        let codec = codec(stream, t, vec![book(t, 9, 4)]);
        let mut random = Random(11);
        let good = payload(stream, 0, &units(&mut random, brick, [9, 4]));
        codec.check(&good, t, brick, 0).unwrap();
        assert!(rebuilt(stream, &good, brick) == good);
        let mut seen = std::collections::BTreeMap::new();
        for at in 0..good.len() {
            for flip in [1, 2, 4, 8, 16, 32, 64, 128, 255] {
                let mut bad = good.clone();
                bad[at] ^= flip;
                match codec.check(&bad, t, brick, 0) {
                    Ok(()) => assert!(rebuilt(stream, &bad, brick) == bad, "byte {at} ^ {flip:#x}"),
                    Err(e) => *seen.entry(e.code()).or_insert(0) += 1,
                }
                read_all(&codec, &bad, brick, t);
            }
        }
        assert!(CODES.iter().all(|code| seen.contains_key(code)), "{stream:?}: {seen:?}");
        for len in 0..good.len() {
            let e = codec.check(&good[..len], t, brick, 0).unwrap_err();
            assert!(CODES.contains(&e.code()), "{len}: {e}");
            if len < 24 {
                assert_eq!(e.code(), Code::Size);
            } else {
                read_all(&codec, &good[..len], brick, t);
            }
        }
    }
}

/// The unit block of Fig. 6 in a brick of its own. New: flags at 20, offsets 28, averages 64, ZSMS 73, DIS 101, padding 151.
/// Old: flags of cells at 20, of coefficients 28, offsets 100, indices 118, padding 177.
fn figure_payload(stream: Stream) -> Vec<u8> {
    payload(stream, 0, &[figure()])
}

/// Expects a change of the figure's payload to be refused with this code and place, and readers to bear it.
fn refused(stream: Stream, change: impl Fn(&mut Vec<u8>), code: Code, at: u64) {
    let (t, brick) = (SampleType::U8, Extent::cube(16));
    let codec = codec(stream, t, vec![book(t, 32, 64)]);
    let mut bad = figure_payload(stream);
    codec.check(&bad, t, brick, 0).unwrap();
    change(&mut bad);
    let e = codec.check(&bad, t, brick, 4096).unwrap_err();
    assert_eq!((e.code(), e.offset()), (code, Some(4096 + at)), "{stream:?}: {e}");
    assert!(!e.field().is_empty() && !e.message().is_empty());
    if codec.payload_lens(t, brick).contains(&(bad.len() as u64)) {
        let read = read_all(&codec, &bad, brick, t);
        assert_eq!(read.is_none(), code == Code::Ref);
    }
}

/// As [`refused`], with one byte set.
fn byte_refused(stream: Stream, at: usize, value: u8, code: Code, place: u64) {
    refused(stream, |bytes| bytes[at] = value, code, place);
}

#[test] // spec: ZBT-8, ZBT-10, ZBT-11, ZBT-14, ZBT-28; K-51
fn prefix_directory_and_flags() {
    for stream in [Stream::New, Stream::Old] {
        let end = figure_payload(stream).len();
        byte_refused(stream, 0, 1, Code::Ref, 0);
        byte_refused(stream, 3, 0xFF, Code::Ref, 0);
        byte_refused(stream, 4, 2, Code::Size, 4);
        byte_refused(stream, 7, 2, Code::Size, 4);
        (8..16).for_each(|at| byte_refused(stream, at, 1, Code::Reserved, 8));
        byte_refused(stream, 16, 0, Code::Canon, 16);
        byte_refused(stream, 16, 65, Code::Nnnc, 16);
        byte_refused(stream, 16, 255, Code::Nnnc, 16);
        byte_refused(stream, 16, 8, Code::Nnnc, 20);
        byte_refused(stream, 16, 10, Code::Nnnc, 20);
        byte_refused(stream, 20, 0x61, Code::Nnnc, 20);
        byte_refused(stream, 20, 0x6F, Code::Nnnc, 20);
        byte_refused(stream, 17, 4, Code::Offset, 16);
        byte_refused(stream, 17, 6, Code::Offset, 16);
        byte_refused(stream, 19, 0xFF, Code::Offset, 16);
        refused(stream, |b| b.truncate(19), Code::Size, 0);
        refused(stream, |b| b.resize(16 + 5005, 0), Code::Size, 0);
        refused(stream, |b| b.extend([0; 4]), Code::Canon, end as u64);
        refused(stream, |b| b.truncate(end - 1), Code::Padding, end as u64 - 1);
    }
}

#[test] // spec: ZBT-27
fn cells_outside_the_brick_are_null() {
    let t = SampleType::U8;
    for stream in [Stream::New, Stream::Old] {
        let codec = codec(stream, t, vec![book(t, 32, 64)]);
        // Cells 40 and 41 of the figure start at z = 8; cell 6 at x = 8, cells 20 to 22 at y = 4.
        for (brick, valid) in [([16, 16, 9], true), ([16, 16, 8], false), ([8, 16, 16], false), ([16, 4, 16], false)] {
            let result = codec.check(&figure_payload(stream), t, Extent::from(brick), 0);
            let told = result.as_ref().err().map(|e| (e.code(), e.offset()));
            assert_eq!(told, (!valid).then_some((Code::Canon, Some(20))), "{brick:?}");
        }
    }
}

#[test] // spec: ZBT-16, ZBT-15, ZBT-12; K-52, K-54
fn offsets_of_the_new_stream() {
    // Of cell 8, the last one, whose zerobits say where DIS starts, and of cell 3.
    for rank in [8, 3] {
        let at = 28 + 4 * rank;
        let place = at as u64;
        let set = |offsets: u32| {
            refused(Stream::New, |b| b[at..at + 4].copy_from_slice(&offsets.to_le_bytes()), Code::Offset, place);
        };
        let right = u32::from_le_bytes(figure_payload(Stream::New)[at..at + 4].try_into().unwrap());
        set(right | 0xFFFF); // detail offset 0xFFFF
        set(right | 0x7FFF_0000); // zerobit offset past the stream
        set(right & 0x8000_FFFF | 78 << 16); // at the payload's last byte
        set(right & 0x8000_FFFF | 3 << 16); // shared with cell 1
        set(right & 0xFFFF_0000); // details shared with cell 0
        set(0);
        set(u32::MAX);
    }
    // The flag of level 0 alone: the maps no longer fit their nodes.
    byte_refused(Stream::New, 28 + 4 * 8 + 3, 0x00, Code::Canon, 73 + 25);
    // Shared ZSMS and DIS: two equal cells whose second offset is the first's. Readable, and not canonical.
    let cell = CellSpec::new(3, &[((0, 1), 1), ((4, 2), 2)]);
    let twin = [(0, cell.clone()), (1, cell)].into_iter().collect::<UnitSpec>();
    let (t, brick) = (SampleType::U8, Extent::cube(16));
    let codec = codec(Stream::New, t, vec![book(t, 32, 64)]);
    let good = payload(Stream::New, 0, &[twin]);
    let mut shared = good.clone();
    shared.copy_within(28..32, 32);
    let dis = 20 + 8 + 10 + 6;
    shared[41..44].copy_from_slice(&good[dis..dis + 2].iter().copied().chain([0]).collect::<Vec<_>>());
    let e = codec.check(&shared, t, brick, 0).unwrap_err();
    assert_eq!((e.code(), e.offset()), (Code::Offset, Some(32)));
    assert!(decode(&codec, &shared, brick, t).bytes() == decode(&codec, &good, brick, t).bytes());
}

#[test] // spec: ZBT-19, ZBT-29; K-53
fn maps_of_the_new_stream() {
    let zsms = 73;
    for (at, value) in [(25, 0x80), (25, 0x00), (25, 0x4A), (26, 0x00), (26, 0x80), (26, 0xC1), (1, 0x00), (2, 0x92)] {
        byte_refused(Stream::New, zsms + at, value, Code::Canon, (zsms + at) as u64);
    }
    // Readers ignore the flag of the level.
    let (t, brick) = (SampleType::U8, Extent::cube(16));
    let codec = codec(Stream::New, t, vec![book(t, 32, 64)]);
    let mut flagged = figure_payload(Stream::New);
    flagged[zsms + 25] ^= 0x80;
    flagged[zsms + 26] ^= 0x80;
    let right = decode(&codec, &figure_payload(Stream::New), brick, t);
    assert!(decode(&codec, &flagged, brick, t).bytes() == right.bytes());
    // A zerobit more: the zerobits of the next cell pass for its map, so that its offsets are wrong.
    byte_refused(Stream::New, zsms, 0xC0, Code::Offset, 32);
}

#[test] // spec: ZBT-7, ZBT-28
fn indices_and_padding() {
    let new = Stream::New;
    byte_refused(new, 64, 32, Code::CodebookIndex, 64);
    byte_refused(new, 72, 255, Code::CodebookIndex, 72);
    byte_refused(new, 101, 64, Code::CodebookIndex, 101);
    byte_refused(new, 150, 64, Code::CodebookIndex, 150);
    byte_refused(new, 151, 1, Code::Padding, 151);
    refused(new, |b| b.truncate(150), Code::Offset, 101);
    // A reader takes the word 0 for an index without one.
    let (t, brick) = (SampleType::U8, Extent::cube(16));
    let codec = codec(new, t, vec![book(t, 32, 64)]);
    let mut bad = payload(new, 0, &[[(0, CellSpec::new(9, &[]))].into_iter().collect()]);
    assert_eq!(codec.voxel(&bad, t, brick, [0; 3]).unwrap(), vug::voxel::SampleValue::U8(9));
    bad[32] = 32;
    assert_eq!(codec.voxel(&bad, t, brick, [0; 3]).unwrap(), vug::voxel::SampleValue::U8(0));
}

#[test] // spec: ZBT-30, ZBT-31, ZBT-32; K-52
fn flags_offsets_and_indices_of_the_old_stream() {
    let old = Stream::Old;
    refused(old, |b| b[28..36].fill(0), Code::Canon, 28);
    byte_refused(old, 28, figure_payload(old)[28] ^ 2, Code::Offset, 102);
    byte_refused(old, 101, 1, Code::Offset, 100);
    byte_refused(old, 102, 6, Code::Offset, 102);
    refused(old, |b| b[116..118].fill(0xFF), Code::Offset, 116);
    byte_refused(old, 118, 32, Code::CodebookIndex, 118);
    byte_refused(old, 119, 64, Code::CodebookIndex, 119);
    byte_refused(old, 177, 1, Code::Padding, 177);
    refused(old, |b| b.truncate(176), Code::Offset, 168);
    // An average may be absent: then it is 0, and the cell is not null.
    let (t, brick) = (SampleType::U8, Extent::cube(16));
    let codec = codec(old, t, vec![book(t, 32, 64)]);
    let mut cell = CellSpec::new(9, &[((0, 7), 1), ((1, 1), 63)]);
    cell.average = None;
    let bytes = payload(old, 0, &[[(5, cell)].into_iter().collect()]);
    codec.check(&bytes, t, brick, 0).unwrap();
    assert!(rebuilt(old, &bytes, brick) == bytes);
    let book = book(t, 32, 64);
    let sum = book.detail(1)[0] + book.detail(63)[0];
    assert!(sum < 0);
    assert_eq!(codec.voxel(&bytes, t, brick, [4, 4, 0]).unwrap(), vug::voxel::SampleValue::U8(0));
    assert_eq!(codec.voxel(&bytes, t, brick, [0, 4, 0]).unwrap(), null(t));
}
