//! The file that spec chapter 13 prints is the file that this crate writes, byte for byte, and says what it is said to.
//!
//! `VUG_BLESS=1 cargo test --test worked_example` writes the bytes of a changed file into the chapter. Its lines stay:
//! whoever moves a field edits the chapter first.

mod support;

use std::fs;
use std::path::PathBuf;
use support::{encode, explicit, open, verify};
use vug::volume::{At, EncodeOptions};
use vug::voxel::SampleValue;
use vug::{Extent, Grid};

const EXTENT: Extent = Extent::new(5, 4, 3);

fn path() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("spec/13-worked-example.md")
}

fn chapter() -> String {
    fs::read_to_string(path()).unwrap().replace("\r\n", "\n")
}

/// Lines of all fenced blocks of this kind.
fn fenced<'a>(text: &'a str, kind: &str) -> Vec<&'a str> {
    let open = format!("```{kind}\n");
    text.split(&open).skip(1).flat_map(|t| t.split("```").next().unwrap().lines()).collect()
}

/// The volume that the chapter prints: slices of rows of voxels.
fn volume(text: &str) -> Grid {
    let voxels: Vec<u8> =
        fenced(text, "voxels").iter().flat_map(|l| l.split_whitespace()).map(|v| v.parse().unwrap()).collect();
    assert_eq!(voxels.len() as u64, EXTENT.voxels());
    Grid::from_fn(EXTENT, |[x, y, z]| voxels[(x + 5 * (y + 4 * z)) as usize]).unwrap()
}

fn file(text: &str) -> Vec<u8> {
    let options = EncodeOptions { brick: Some(16), zstd: false, ..explicit(4, 4) };
    encode(&mut volume(text), &options).0
}

/// A line of the dump: `OFFSET  BYTES | name = value` or `OFFSET  zeros × N | name`.
struct Line<'a> {
    offset: usize,
    /// `None`: that many zeros.
    bytes: Option<Vec<u8>>,
    len: usize,
    name: &'a str,
}

fn parse(line: &str) -> Line<'_> {
    let (left, name) = line.split_once('|').unwrap_or((line, ""));
    let (offset, rest) = left.trim_end().split_once("  ").unwrap_or_else(|| panic!("no bytes in {line:?}"));
    let offset = usize::from_str_radix(offset, 16).unwrap();
    if let Some(n) = rest.strip_prefix("zeros × ") {
        return Line { offset, bytes: None, len: n.trim().parse().unwrap(), name: name.trim() };
    }
    let bytes: Vec<u8> = rest.split_whitespace().map(|b| u8::from_str_radix(b, 16).unwrap()).collect();
    Line { offset, len: bytes.len(), bytes: Some(bytes), name: name.trim() }
}

/// The number behind `name = ` must be what the bytes are: an integer, or a float if it has a point.
fn check_value(line: &Line<'_>, bytes: &[u8]) {
    let Some((_, value)) = line.name.split_once(" = ") else { return };
    let value = value.split([',', ':', ' ']).next().unwrap();
    if value.contains('.') {
        let found = match bytes {
            b if b.len() == 4 => f64::from(f32::from_le_bytes(b.try_into().unwrap())),
            b => f64::from_le_bytes(b.try_into().unwrap()),
        };
        assert_eq!(found, value.parse::<f64>().unwrap(), "{} at {:04X}", line.name, line.offset);
    } else {
        let found = bytes.iter().rev().fold(0u64, |n, &b| n << 8 | u64::from(b));
        assert_eq!(found, value.parse::<u64>().unwrap(), "{} at {:04X}", line.name, line.offset);
    }
}

/// Puts the bytes of `file` into the lines of the dump.
fn bless(text: &str, file: &[u8]) -> String {
    let mut inside = false;
    let lines = text.lines().map(|line| {
        if line.starts_with("```") {
            inside = line == "```hex";
            return line.to_owned();
        }
        if !inside {
            return line.to_owned();
        }
        let at = parse(line);
        if at.bytes.is_none() {
            return line.to_owned();
        }
        let hex = file[at.offset..][..at.len].iter().map(|b| format!("{b:02X}")).collect::<Vec<_>>().join(" ");
        let left = format!("{:04X}  {hex}", at.offset);
        let start = line.split_once('|').map_or(line, |(left, _)| left).trim_end().len();
        left + &line[start..]
    });
    lines.map(|l| l + "\n").collect()
}

#[test]
fn the_dump_is_the_file() {
    let mut text = chapter();
    let file = file(&text);
    if std::env::var_os("VUG_BLESS").is_some() {
        text = bless(&text, &file);
        fs::write(path(), &text).unwrap();
    }
    let mut printed = Vec::new();
    for line in fenced(&text, "hex") {
        let line = parse(line);
        assert_eq!(line.offset, printed.len(), "the dump has a hole or an overlap before {:04X}", line.offset);
        let bytes = line.bytes.clone().unwrap_or_else(|| vec![0; line.len]);
        printed.extend(&bytes);
        check_value(&line, &bytes);
    }
    assert_eq!(printed.len(), file.len(), "length of the dump and of the file");
    if let Some(i) = (0..file.len()).find(|&i| printed[i] != file[i]) {
        panic!("byte {i:04X} is {:02X} in the chapter, {:02X} in the file; VUG_BLESS=1 writes it", printed[i], file[i]);
    }
    let errors = verify(&printed);
    assert!(errors.is_empty(), "{errors:?}");
}

/// What the chapter does by hand, by hand, and by the library.
#[test] // spec: GEN-3, BRK-1, S3D-9, S3D-10
fn the_voxel_decoded_by_hand_is_right() {
    let text = chapter();
    let claim = text.split("**voxel (").nth(1).expect("the chapter decodes a voxel");
    let (place, rest) = claim.split_once(") = ").unwrap();
    let c: Vec<u32> = place.split(", ").map(|v| v.parse().unwrap()).collect();
    let claimed: u8 = rest.split("**").next().unwrap().parse().unwrap();

    let file = file(&text);
    let [x, y, z] = c.iter().map(|&v| v as usize).collect::<Vec<_>>()[..] else { panic!("three coordinates") };
    let payload = &file[0x400..];
    let block = x / 4;
    let (min, max) = (u32::from(payload[2 * block]), u32::from(payload[2 * block + 1]));
    let row = 256 + 4 * (y + 4 * z);
    let word = u16::from_le_bytes([payload[row + 2 * (x / 4)], payload[row + 2 * (x / 4) + 1]]);
    let index = u32::from(word) >> (4 * (x % 4)) & 15;
    let by_hand = min + (2 * (max - min) * index + 15) / 30;
    assert_eq!(by_hand, u32::from(claimed));
    for number in [format!("{word:04X}"), format!("index {index}"), format!("R = {}", max - min)] {
        assert!(text.contains(&number), "the chapter should mention {number}");
    }

    let source = volume(&text);
    let volume = open(file);
    assert_eq!(volume.voxel(At::default(), [c[0], c[1], c[2]]).unwrap(), SampleValue::U8(claimed));
    // And all others: no further from the source than the file says.
    let decoded = volume.read(At::default()).unwrap();
    let worst = vug::metrics::error_stats(&source.view(), &decoded.view()).unwrap().max_abs;
    assert_eq!(Some(worst), volume.info().achieved.map(|a| a.max_error));
}
