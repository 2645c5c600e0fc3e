//! Chapter 5.

use super::support::*;
use crate::container::*;
use crate::error::Code;
use crate::geometry::{Coord, Extent, morton8};
use crate::voxel::{SampleType, SampleValue};

#[test] // spec: IDX-1, IDX-2, IDX-3, IDX-4, GEN-3
fn arithmetic_of_the_octree() {
    let d = |dims, lods| VolumeDescriptor { time_steps: 3, channels: 2, ..descriptor(dims, lods) };
    let o = Octree::new(&d([300, 17, 140], 6)).unwrap();
    let bricks: Vec<Extent> = o.levels.iter().map(|l| l.bricks).collect();
    assert_eq!(bricks[..3], [Extent::new(19, 2, 9), Extent::new(10, 1, 5), Extent::new(5, 1, 3)]);
    for pair in bricks.windows(2) {
        assert_eq!(pair[0].div_ceil(Extent::cube(2)), pair[1], "every child has its parent");
    }
    // Ordinals count pages one by one, x fastest, then y, z, levels, trees.
    let mut next = 0;
    for tree in 0..6 {
        for level in 0..6u8 {
            let pages = o.levels[usize::from(level)].pages;
            for z in 0..pages.z {
                for y in 0..pages.y {
                    for x in 0..pages.x {
                        assert_eq!(o.page_ordinal(tree, level, [x, y, z]), next);
                        assert_eq!(o.page_position(next), (tree, level, [x, y, z]));
                        next += 1;
                    }
                }
            }
        }
    }
    assert_eq!((o.page_count(), o.trees()), (next, 6));
    let brick: Coord = [13, 1, 8];
    let (ordinal, slot) = o.locate(5, 0, brick);
    assert_eq!((o.page_position(ordinal), slot), ((5, 0, [1, 0, 1]), morton8([5, 1, 0])));
    // The example of the format's design: 4096³ in bricks of 64³ has 588 pages.
    let big = VolumeDescriptor { brick_log2: 6, ..descriptor([4096; 3], 7) };
    assert_eq!(Octree::new(&big).unwrap().page_count(), 588);
}

#[test] // spec: BRK-1; D-52
fn bricks_are_cropped() {
    let o = Octree::new(&descriptor([40, 20, 17], 3)).unwrap();
    assert_eq!(o.brick_extent(0, [0, 0, 0]), Extent::cube(16));
    assert_eq!(o.brick_extent(0, [2, 1, 1]), Extent::new(8, 4, 1));
    assert_eq!(o.brick_extent(2, [0, 0, 0]), Extent::new(10, 5, 5));
    assert_eq!(o.brick_region(0, [2, 1, 1]).start, [32, 16, 16]);
}

#[test] // spec: IDX-1, GEN-2, VAL-8; D-60, D-61
fn hostile_dims_cost_nothing() {
    let mut d = descriptor([1 << 21, 1 << 21, 1 << 6], 22);
    (d.time_steps, d.channels) = (1 << 12, 1 << 12);
    let o = Octree::new(&d).unwrap();
    assert_eq!(o.levels.len(), 22);
    let last = o.page_count() - 1;
    assert_eq!(o.page_position(last), ((1 << 24) - 1, 21, [0; 3]));
    assert!(o.brick_count() > 1 << 50);
    d.dims = Extent::cube(u32::MAX);
    assert_eq!(Octree::new(&d).unwrap_err().code(), Code::Limit);
}

/// A change that opening does not see, but whoever reads the index does.
fn touched(bytes: &[u8], code: Code, offset: u64) {
    open(bytes).unwrap();
    let e = read_index(bytes).unwrap_err();
    assert_eq!(told(&e), (code, Some(offset)), "{e}");
    strictly_refused(bytes, code, offset);
}

#[test] // spec: IDX-5; C-04
fn root_entries() {
    let file = small();
    let pdir = Places::of(&file).section(*b"PDIR");
    let count = u16::from_le_bytes([file[pdir as usize + 20], file[pdir as usize + 21]]);
    refused(&changed(&file, pdir, &1u64.to_le_bytes()), Code::Ref, pdir);
    refused(&changed(&file, pdir, &u64::MAX.to_le_bytes()), Code::Ref, pdir);
    refused(&changed(&file, pdir + 20, &(count + 1).to_le_bytes()), Code::Ref, pdir);
    refused(&changed(&file, pdir + 20, &0u16.to_le_bytes()), Code::Param, pdir + 20);
    refused(&changed(&file, pdir + 20, &1025u16.to_le_bytes()), Code::Param, pdir + 20);
    refused(&changed(&file, pdir + 22, &[1]), Code::Reserved, pdir + 22);
    refused(&changed(&file, pdir + 8, &[1]), Code::Align, pdir + 8);
    refused(&changed(&file, pdir + 8, &(u64::MAX - 15).to_le_bytes()), Code::SectionRange, pdir + 8);
    // Two chunks: order and uniqueness.
    let file = spread();
    let pdir = Places::of(&file).section(*b"PDIR");
    let second = pdir + 24;
    let (a, b) = (&file[pdir as usize..][..24], &file[second as usize..][..24]);
    refused(&changed(&file, pdir, &[b, a].concat()), Code::Order, second);
    refused(&changed(&file, pdir, &[a, a].concat()), Code::Dup, second);
}

/// Two bricks so far apart that their pages lie in different chunks.
fn spread() -> Vec<u8> {
    let mut d = descriptor([16 * 8 * 1030, 16, 16], 1);
    let mut w = FileWriter::new(std::io::Cursor::new(Vec::new()), &d).unwrap();
    put(&mut w, &mut d, (0, 0, [1, 0, 0]), 0, NodeFlags::default(), &payload(1, 50));
    put(&mut w, &mut d, (0, 0, [8 * 1028, 0, 0]), 0, NodeFlags::default(), &payload(2, 50));
    w.finish(&d, FinishOptions::default()).unwrap().0.into_inner()
}

#[test] // spec: IDX-5, IDX-6; C-10
fn what_is_not_stored_is_empty() {
    let file = spread();
    assert!(strict(&file).is_empty(), "{:?}", strict(&file));
    let head = open(&file).unwrap();
    let counts: Vec<_> = head.directory.iter().map(|c| (c.ordinal, c.count)).collect();
    assert_eq!(counts, [(0, 1), (1, 5)]);
    assert!(head.chunk(1).is_some() && head.chunk(2).is_none());
    let chunk = head.chunk(1).unwrap();
    let entries = parse_chunk(&reader(&file)(chunk.offset, chunk.byte_len()).unwrap(), chunk, &head).unwrap();
    assert_eq!(entries.iter().map(|e| e.count).collect::<Vec<_>>(), [0, 0, 0, 0, 1]);
    assert_eq!(read_index(&file).unwrap().len(), 3);
}

#[test] // spec: IDX-6, IDX-16; C-04, C-09, C-10
fn page_entries() {
    let file = small();
    let p = Places::of(&file);
    let c = p.chunk;
    touched(&changed(&file, c, &(p.pages[0] + 4).to_le_bytes()), Code::Align, c);
    touched(&changed(&file, c, &p.section(*b"VOLD").to_le_bytes()), Code::SectionRange, c);
    touched(&changed(&file, c, &(u64::MAX - 15).to_le_bytes()), Code::SectionRange, c);
    touched(&changed(&file, c + 12, &513u16.to_le_bytes()), Code::Param, c + 12);
    touched(&changed(&file, c + 12, &512u16.to_le_bytes()), Code::SectionRange, c);
    touched(&changed(&file, c + 12, &0u16.to_le_bytes()), Code::Canon, c);
    touched(&changed(&file, c + 14, &[1]), Code::Reserved, c + 14);
    // CRCs, without sealing the file again.
    let mut bad = file.clone();
    bad[c as usize + 12] ^= 1;
    touched(&bad, Code::DirCrc, c);
    let mut bad = file.clone();
    bad[p.pages[1] as usize + 20] ^= 1;
    touched(&bad, Code::PageCrc, p.pages[1]);
    let head = open(&bad).unwrap();
    let chunk = head.directory[0];
    let entries = parse_chunk(&reader(&bad)(chunk.offset, chunk.byte_len()).unwrap(), &chunk, &head).unwrap();
    let first = reader(&bad)(entries[0].offset, entries[0].byte_len()).unwrap();
    assert_eq!(parse_page(&first, &entries[0], 0, &head).unwrap().len(), 15, "the other page is whole");
}

#[test]
fn nodes_read_what_they_write() {
    for node in read_index(&small()).unwrap() {
        let bytes = node.write_to();
        assert_eq!(bytes.len(), 32);
        assert_eq!(Node::read_from(&bytes, 0, SampleType::U8).unwrap(), node);
    }
    assert_eq!(Node::EMPTY.write_to(), [0; 32]);
}

#[test] // spec: IDX-7, IDX-8, IDX-9, IDX-10, GEN-6; C-04, C-09, C-11
fn nodes() {
    let file = small();
    let p = Places::of(&file);
    // Slots of level 0: 0 stored, 1 compressed, 2 constant, 3 EMPTY, 14 stored; level 2 has an EMPTY root with children.
    let (stored, constant, empty, root) = (p.pages[0], p.pages[0] + 64, p.pages[0] + 96, p.pages[2]);
    let f = |v: f32| v.to_le_bytes();
    for (at, value, code, error_at) in [
        (stored + 16, &[3u8][..], Code::Param, stored + 16),
        (stored + 19, &[16], Code::Reserved, stored + 19),
        (stored + 17, &[2], Code::Ref, stored + 17),
        (stored + 18, &[1], Code::Canon, stored + 18),
        (stored + 8, &[0; 4], Code::Size, stored + 8),
        (stored + 8, &((64u32 << 20) + 1).to_le_bytes(), Code::Limit, stored + 8),
        (stored, &[1], Code::Align, stored),
        (stored, &(file.len() as u64).next_multiple_of(16).to_le_bytes(), Code::SectionRange, stored),
        (stored, &(u64::MAX - 15).to_le_bytes(), Code::SectionRange, stored),
        (stored, &0u64.to_le_bytes(), Code::SectionRange, stored),
        (stored + 20, &f(f32::NAN), Code::NonFinite, stored + 20),
        (stored + 24, &f(f32::INFINITY), Code::NonFinite, stored + 20),
        (stored + 20, &f(1e9), Code::MinmaxOrder, stored + 20),
        (stored + 28, &f(-1.0), Code::Param, stored + 28),
        (stored + 19, &[0], Code::Canon, stored + 28),
        (constant + 8, &[1], Code::Canon, constant + 8),
        (constant + 12, &[1], Code::Canon, constant + 8),
        (constant + 17, &[1], Code::Canon, constant + 8),
        (constant + 19, &[11], Code::Canon, constant + 8),
        (constant + 1, &[1], Code::Canon, constant),
        (constant + 7, &[1], Code::Canon, constant),
        (root, &[16], Code::Canon, root),
        (root + 8, &[1], Code::Canon, root),
        (root + 12, &[1], Code::Canon, root),
        (root + 17, &[1], Code::Canon, root),
        (root + 19, &[10], Code::Canon, root),
    ] {
        touched(&changed(&file, at, value), code, error_at);
    }
    for i in (0..32).filter(|i| *i != 16) {
        touched(&changed(&file, empty + i, &[4]), Code::Canon, if i == 18 { empty + 18 } else { empty });
    }
}

#[test] // spec: IDX-8
fn constants() {
    for value in [
        SampleValue::U8(255),
        SampleValue::U16(65535),
        SampleValue::I16(-32768),
        SampleValue::F32(-0.25),
        SampleValue::Rgb8([1, 255, 3]),
    ] {
        let node = Node::new_constant(value, NodeFlags::default(), None);
        assert_eq!(Node::read_from(&node.write_to(), 0, value.sample_type()).unwrap(), node);
        assert_eq!(node.constant(value.sample_type()).unwrap(), value);
        let wide = Node { offset: node.offset | 1 << 32, ..node };
        assert_eq!(wide.constant(value.sample_type()).unwrap_err().code(), Code::Canon);
    }
    let rgb = Node::new_constant(SampleValue::Rgb8([1, 255, 3]), NodeFlags::default(), None);
    assert_eq!((rgb.min, rgb.max), (1.0, 255.0));
    let nan = Node {
        offset: u64::from(f32::NAN.to_bits()),
        ..Node::new_constant(SampleValue::F32(1.0), NodeFlags::default(), None)
    };
    assert_eq!(
        Node::read_from(&nan.write_to(), 7, SampleType::F32).map_err(|e| told(&e)),
        Err((Code::NonFinite, Some(7)))
    );
}

#[test] // spec: IDX-11; D-55
fn bounds_are_rounded_outward() {
    for v in [0.1, -0.1, 16_777_217.0, -16_777_217.0, 1e-60, -1e-60, f64::from(u32::MAX), 3.4e38, 1.0 / 3.0] {
        let (lo, hi) = (round_down_f32(v), round_up_f32(v));
        assert!(f64::from(lo) <= v && v <= f64::from(hi), "{v}");
        assert!(f64::from(lo.next_up()) > v && f64::from(hi.next_down()) < v, "{v}: not the nearest");
    }
    for exact in [0.0, -0.0, 1.0, -2.5, 65535.0, f64::from(f32::MAX)] {
        assert_eq!((round_down_f32(exact), round_up_f32(exact)), (exact as f32, exact as f32));
        assert!(round_down_f32(-0.0).is_sign_positive() && round_up_f32(-0.0).is_sign_positive());
    }
    let node = Node::new_stored(0, NodeFlags::default(), (-0.1, 0.1), Some(1e-50));
    assert!(f64::from(node.min) < -0.1 && f64::from(node.max) > 0.1 && node.max_error > 0.0);
    assert!(node.flags.contains(NodeFlags::ERROR_KNOWN));
    assert!(!Node::new_stored(0, NodeFlags::ERROR_KNOWN, (0.0, 1.0), None).flags.contains(NodeFlags::ERROR_KNOWN));
}

#[test] // spec: IDX-12, IDX-13; D-54
fn parents_know_their_children() {
    let nodes = |level: usize| {
        let file = small();
        let p = Places::of(&file);
        let at = p.pages[level] as usize;
        Node::read_from(&file[at..at + 32], 0, SampleType::U8).unwrap()
    };
    let (min1, max1) = range_of(&payload(3, 64));
    let bricks = [payload(1, 77), vec![42; 10]];
    let ranges = bricks.iter().map(|b| range_of(b));
    // Children of (1, 0, 0, 0): stored, compressed, constant 200, five EMPTY ones of value 7.
    let (min, max) = ranges.fold((7f64.min(min1), 200f64.max(max1)), |a, b| (a.0.min(b.0), a.1.max(b.1)));
    let below = nodes(1);
    assert_eq!((below.child_mask, f64::from(below.min), f64::from(below.max)), (0b0000_0111, min, max));
    let root = nodes(2);
    assert_eq!((root.kind, root.child_mask), (NodeKind::Empty, 0b11));
    assert_eq!((f64::from(root.min), f64::from(root.max), root.max_error), (7.0, 200.0, 0.5));
    // An error that is not known somewhere below is not known above.
    let mut d = descriptor([32, 16, 16], 2);
    let mut w = FileWriter::new(std::io::Cursor::new(Vec::new()), &d).unwrap();
    let node = |error| Node::new_stored(0, NodeFlags::default(), range_of(&[50]), error);
    w.put_stored(0, 0, [0, 0, 0], &node(None), &[50]).unwrap();
    w.put_stored(0, 0, [1, 0, 0], &node(Some(2.0)), &[50]).unwrap();
    w.put_stored(0, 1, [0, 0, 0], &node(Some(1.0)), &[50]).unwrap();
    d.payload_bytes = 3;
    let file = w.finish(&d, FinishOptions::default()).unwrap().0.into_inner();
    let parent = read_index(&file).unwrap().pop().unwrap();
    assert_eq!((parent.flags, parent.max_error, parent.child_mask), (NodeFlags(0), 0.0, 3));
    assert!(strict(&file).is_empty(), "{:?}", strict(&file));
}
