//! NumPy `.npy` files, versions 1 to 3 (NumPy Enhancement Proposal 1): a Python literal of three keys, then the samples.
//!
//! The header is read by a small parser of our own. The crate `npyz` multiplies the axes of the shape without checking and
//! recurses on nested brackets, so that a hostile header overflows; it judges this module in the tests instead.

use super::layout::{Layout, Role};
use super::payload::{self, Bytes, Payload};
use super::stored::{Kind, Stored};
use super::stream::{CHANNELS_THEN_TIME, write_samples};
use super::{Format, Import, ImportOptions, Probe, fault};
use crate::affine::ValueMap;
use crate::error::Result;
use crate::geometry::Extent;
use crate::grid::SlabReader;
use crate::voxel::SampleType;
use serde_json::json;
use std::fs::File;
use std::io::{Read, Write};
use std::path::Path;

const MAGIC: &[u8; 6] = b"\x93NUMPY";
/// Largest header text that is read. NumPy itself writes some hundred bytes.
const MAX_HEADER: u64 = 1 << 20;

/// What the header says.
#[derive(Debug, PartialEq)]
struct Header {
    descr: String,
    fortran_order: bool,
    shape: Vec<u64>,
}

/// Opens an array. C order is (z, y, x), (time, z, y, x) or (time, channel, z, y, x), Fortran order the other way round: x is
/// fastest in memory either way. An axis of three u8 behind (Fortran: before) three or more others is red, green, blue.
pub(super) fn import(path: &Path, options: &ImportOptions) -> Result<Import> {
    let (probe, stored, file, start) = open(path, options)?;
    let payload =
        Payload { bytes: Bytes::File { file, path: path.to_owned(), start, spooled: 0 }, stored, layout: probe.layout };
    Ok(Import::plain(payload.open(path, options.dtype)?, Format::Npy, json!({ "format": "npy" })))
}

/// What the header says of the samples.
pub(super) fn probe(path: &Path, options: &ImportOptions) -> Result<Probe> {
    open(path, options).map(|(probe, ..)| probe)
}

fn open(path: &Path, options: &ImportOptions) -> Result<(Probe, Stored, File, u64)> {
    let (mut file, len) = payload::open(path)?;
    let (text, start) = read_header(path, &mut file, len)?;
    let header = parse(&text).map_err(|message| fault::foreign(path, "header", message))?;
    let mut stored = stored_of(path, &header.descr)?;
    let mut axes = header.shape.clone();
    if !header.fortran_order {
        axes.reverse();
    }
    let rgb_wanted = axes.len() >= 4 || options.dtype == Some(SampleType::Rgb8);
    if stored.kind == Kind::U8 && rgb_wanted && axes.first() == Some(&3) {
        stored.kind = Kind::Rgb8;
        axes.remove(0);
    }
    let refuse = |what: &str| {
        Err(fault::unsupported(path, "shape", format!("shape {:?} of {}: {what}", header.shape, stored.kind)))
    };
    // So few samples along the fastest axis of so many are values of a voxel, and none along x.
    if axes.len() > 3 && (2..=4).contains(&axes[0]) && axes[1..].iter().all(|n| *n > 8) {
        return refuse(
            "vectors come first: save them as (time, channel, z, y, x), with numpy.moveaxis(a, -1, 0)[None]",
        );
    }
    let (space, series) = axes.split_at(axes.len().min(3));
    let mut roles: Vec<(Role, u64)> = space.iter().enumerate().map(|(i, n)| (Role::Space(i), *n)).collect();
    match *series {
        [] => {}
        [time] => roles.push((Role::Time, time)),
        [channels, time] => roles.extend([(Role::Channel, channels), (Role::Time, time)]),
        _ => return refuse("arrays of more than space, channels and time come in a later version"),
    }
    let layout = Layout::new(path, "shape", &roles, stored.kind)?;
    let (expected, found) = (layout.bytes(stored.kind), len - start);
    if found != expected {
        let message = format!("shape {:?} needs {expected} bytes of samples, the file has {found}", header.shape);
        return Err(fault::foreign(path, "shape", message));
    }
    Ok((Probe { kind: stored.kind, layout, value_map: ValueMap::default() }, stored, file, start))
}

/// The header's text, and where the samples start.
fn read_header(path: &Path, file: &mut impl Read, len: u64) -> Result<(String, u64)> {
    let short = || fault::foreign(path, "header", format!("{len} bytes are too short for an npy file"));
    if len < 10 {
        return Err(short());
    }
    let mut exact = |out: &mut [u8]| file.read_exact(out).map_err(|e| fault::io(path, e));
    let mut head = [0; 8];
    exact(&mut head)?;
    if &head[..6] != MAGIC {
        return Err(fault::foreign(path, "magic", "the file does not start with \"\\x93NUMPY\""));
    }
    let (before, text_len) = match head[6] {
        1 => {
            let mut n = [0; 2];
            exact(&mut n)?;
            (10, u64::from(u16::from_le_bytes(n)))
        }
        2 | 3 if len >= 12 => {
            let mut n = [0; 4];
            exact(&mut n)?;
            (12, u64::from(u32::from_le_bytes(n)))
        }
        2 | 3 => return Err(short()),
        v => return Err(fault::unsupported(path, "version", format!("npy version {v} is none of 1, 2, 3"))),
    };
    if text_len > MAX_HEADER || before + text_len > len {
        let message = format!("a header of {text_len} bytes is longer than the file or than {MAX_HEADER}");
        return Err(fault::foreign(path, "header", message));
    }
    let mut text = vec![0; text_len as usize];
    exact(&mut text)?;
    let text = String::from_utf8(text).map_err(|_| fault::foreign(path, "header", "the header is not text"))?;
    Ok((text, before + text_len))
}

/// A cursor over the Python literal. Nothing nests, so nothing recurses.
struct Cursor<'a>(&'a str);

impl<'a> Cursor<'a> {
    fn eat(&mut self, c: char) -> bool {
        self.0 = self.0.trim_start();
        match self.0.strip_prefix(c) {
            Some(rest) => {
                self.0 = rest;
                true
            }
            None => false,
        }
    }

    fn expect(&mut self, c: char) -> Result<(), String> {
        if self.eat(c) { Ok(()) } else { Err(format!("{c:?} expected before {:?}", self.near())) }
    }

    fn near(&self) -> String {
        self.0.chars().take(24).collect()
    }

    fn string(&mut self) -> Result<&'a str, String> {
        let quote = ['\'', '"'].into_iter().find(|q| self.eat(*q));
        let quote = quote.ok_or_else(|| format!("a quoted string expected before {:?}", self.near()))?;
        let (text, rest) = self.0.split_once(quote).ok_or("a string without an end")?;
        self.0 = rest;
        Ok(text)
    }

    fn word(&mut self) -> &'a str {
        self.0 = self.0.trim_start();
        let end = self.0.find(|c: char| !c.is_ascii_alphanumeric()).unwrap_or(self.0.len());
        let (word, rest) = self.0.split_at(end);
        self.0 = rest;
        word
    }

    fn tuple(&mut self) -> Result<Vec<u64>, String> {
        self.expect('(')?;
        let mut axes = Vec::new();
        while !self.eat(')') {
            if !axes.is_empty() {
                self.expect(',')?;
                if self.eat(')') {
                    break;
                }
            }
            let near = self.near();
            // Python 2 wrote long integers as 3L.
            let word = self.word();
            let number = word.strip_suffix('L').unwrap_or(word).parse();
            axes.push(number.map_err(|_| format!("an axis length below 2^64 expected before {near:?}"))?);
            if axes.len() > 32 {
                return Err("more than 32 axes".into());
            }
        }
        Ok(axes)
    }
}

fn parse(text: &str) -> Result<Header, String> {
    let mut at = Cursor(text);
    let (mut descr, mut fortran_order, mut shape) = (None, None, None);
    at.expect('{')?;
    while !at.eat('}') {
        let key = at.string()?;
        at.expect(':')?;
        let fresh = match key {
            "descr" if at.0.trim_start().starts_with(['[', '(']) => descr.replace("structured".to_owned()).is_none(),
            "descr" => descr.replace(at.string()?.to_owned()).is_none(),
            "fortran_order" => match at.word() {
                "True" => fortran_order.replace(true).is_none(),
                "False" => fortran_order.replace(false).is_none(),
                word => return Err(format!("fortran_order {word:?} is neither True nor False")),
            },
            "shape" => shape.replace(at.tuple()?).is_none(),
            key => return Err(format!("unknown key {key:?}")),
        };
        if !fresh {
            return Err(format!("key {key:?} occurs twice"));
        }
        if descr.as_deref() == Some("structured") {
            break;
        }
        if !at.eat(',') {
            at.expect('}')?;
            break;
        }
    }
    let missing = |key: &str| format!("key {key:?} is missing");
    if descr.as_deref() == Some("structured") {
        return Ok(Header { descr: "structured".into(), fortran_order: false, shape: Vec::new() });
    }
    if !at.0.trim().is_empty() {
        return Err(format!("text after the header's literal: {:?}", at.near()));
    }
    Ok(Header {
        descr: descr.ok_or_else(|| missing("descr"))?,
        fortran_order: fortran_order.ok_or_else(|| missing("fortran_order"))?,
        shape: shape.ok_or_else(|| missing("shape"))?,
    })
}

/// Type and byte order of an array protocol type string, such as `<u2`.
fn stored_of(path: &Path, descr: &str) -> Result<Stored> {
    let unsupported = |what: &str| {
        let message = format!("{descr:?}: {what}; convert the array with astype() to uint8, uint16, int16 or float32");
        Err(fault::unsupported(path, "descr", message))
    };
    let mut rest = descr.chars();
    let big_endian = match rest.next() {
        Some('>') => true,
        Some('<' | '|') => false,
        Some('=') => cfg!(target_endian = "big"),
        _ if descr == "structured" => return unsupported("structured arrays have no single value per voxel"),
        _ => return Err(fault::foreign(path, "descr", format!("{descr:?} is not a type string"))),
    };
    let kind = match rest.as_str() {
        "b1" | "u1" => Kind::U8,
        "i1" => Kind::I8,
        "u2" => Kind::U16,
        "i2" => Kind::I16,
        "u4" => Kind::U32,
        "i4" => Kind::I32,
        "u8" => Kind::U64,
        "i8" => Kind::I64,
        "f4" => Kind::F32,
        "f8" => Kind::F64,
        "f2" => return unsupported("16-bit floats"),
        "f16" | "f12" => return unsupported("extended floats"),
        s if s.starts_with('c') => return unsupported("complex numbers come in a later version"),
        s if s.starts_with(['S', 'a', 'U', 'O', 'V', 'm', 'M']) => return unsupported("not a numeric type"),
        _ => return Err(fault::foreign(path, "descr", format!("{descr:?} is not a type string"))),
    };
    Ok(Stored { kind, big_endian })
}

/// Writes version 1.0, C order: shape (z, y, x), (time, z, y, x) or (time, channel, z, y, x), with a last axis of 3 for colours.
pub(super) fn write(out: &mut dyn Write, source: &mut dyn SlabReader) -> std::io::Result<()> {
    let Extent { x, y, z } = source.extent();
    let (descr, last) = match source.sample_type() {
        SampleType::U8 => ("|u1", ""),
        SampleType::U16 => ("<u2", ""),
        SampleType::I16 => ("<i2", ""),
        SampleType::F32 => ("<f4", ""),
        SampleType::Rgb8 => ("|u1", ", 3"),
    };
    let series = match source.series() {
        (1, 1) => String::new(),
        (steps, 1) => format!("{steps}, "),
        (steps, channels) => format!("{steps}, {channels}, "),
    };
    let mut text = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({series}{z}, {y}, {x}{last}), }}");
    // NumPy aligns the samples to 64 bytes; the text ends in a newline.
    let pad = (10 + text.len() + 1).next_multiple_of(64) - (10 + text.len() + 1);
    text.extend(std::iter::repeat_n(' ', pad));
    text.push('\n');
    out.write_all(MAGIC)?;
    out.write_all(&[1, 0])?;
    out.write_all(&(text.len() as u16).to_le_bytes())?;
    out.write_all(text.as_bytes())?;
    write_samples(out, source, &CHANNELS_THEN_TIME)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn header_literals() {
        let h = parse("{'descr': '<u2', 'fortran_order': False, 'shape': (3, 4, 5), }   \n").unwrap();
        assert_eq!(h, Header { descr: "<u2".into(), fortran_order: false, shape: vec![3, 4, 5] });
        let h = parse("{\"shape\":(7,),\"fortran_order\":True,\"descr\":\">f4\"}").unwrap();
        assert_eq!(h, Header { descr: ">f4".into(), fortran_order: true, shape: vec![7] });
        assert!(parse("{'descr': '<u2', 'fortran_order': False, 'shape': ()}").unwrap().shape.is_empty());
        assert_eq!(parse("{'descr': '<u2', 'fortran_order': False, 'shape': (3L,)}").unwrap().shape, [3]);
        let nested = format!("{{'shape': {}", "(".repeat(60_000));
        for bad in [
            "",
            "{",
            "{}",
            "{'descr': '<u2', 'fortran_order': False}",
            "{'descr': '<u2', 'fortran_order': 0, 'shape': (1,)}",
            "{'descr': '<u2', 'fortran_order': False, 'shape': (-1,)}",
            "{'descr': '<u2', 'fortran_order': False, 'shape': (99999999999999999999,)}",
            "{'descr': '<u2', 'fortran_order': False, 'shape': (1 2)}",
            "{'descr': '<u2', 'descr': '<u2', 'fortran_order': False, 'shape': (1,)}",
            "{'descr': '<u2', 'fortran_order': False, 'shape': (1,)} x",
            "{'descr': '<u2', 'fortran_order': False, 'shape': (1,), 'extra': 1}",
            &nested,
        ] {
            assert!(parse(bad).is_err(), "{bad:.40}");
        }
    }

    #[test]
    fn types_that_are_refused_say_so() {
        use crate::error::Code;
        for (descr, code, word) in [
            ("<c8", Code::Unsupported, "complex"),
            ("<f2", Code::Unsupported, "16-bit"),
            ("|O", Code::Unsupported, "numeric"),
            ("structured", Code::Unsupported, "structured"),
            ("u2", Code::Foreign, "type string"),
            ("<q9", Code::Foreign, "type string"),
            ("", Code::Foreign, "type string"),
        ] {
            let e = stored_of(Path::new("a.npy"), descr).unwrap_err();
            assert!(e.code() == code && e.message().contains(word) && e.message().contains("a.npy"), "{descr}: {e}");
        }
    }
}
