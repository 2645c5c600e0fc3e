//! Where the samples of a NRRD file lie, and how they are unpacked.

use super::axes::Axes;
use super::header::Header;
use super::text;
use crate::convert::inflate::{Packed, Packing, Skip};
use crate::convert::payload::{self, Bytes, Payload};
use crate::convert::stored::{Kind, Stored};
use crate::convert::{ImportOptions, fault};
use crate::error::Result;
use std::fs::File;
use std::io::{BufRead, BufReader, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// How samples are written down.
enum Encoding {
    Raw,
    Text,
    Packed(Packing),
}

fn encoding(path: &Path, header: &Header) -> Result<Encoding> {
    let name = header.get("encoding").ok_or_else(|| fault::foreign(path, "encoding", "the field is missing"))?;
    match name.to_ascii_lowercase().as_str() {
        "raw" => Ok(Encoding::Raw),
        "txt" | "text" | "ascii" => Ok(Encoding::Text),
        "gz" | "gzip" => Ok(Encoding::Packed(Packing::Gzip)),
        "bz2" | "bzip2" => Ok(Encoding::Packed(Packing::Bzip2)),
        "hex" | "zrl" | "zrlencoding" | "zstd" | "zst" => {
            let message = format!("encoding {name:?} is not read; save the file as raw or gzip");
            Err(fault::unsupported(path, "encoding", message))
        }
        _ => Err(fault::foreign(path, "encoding", format!("{name:.40?} is not an encoding of NRRD"))),
    }
}

/// The detached data file, where the header names one.
fn data_file(path: &Path, header: &Header) -> Result<Option<PathBuf>> {
    let Some(name) = header.get("datafile") else { return Ok(None) };
    let words: Vec<&str> = name.split_whitespace().collect();
    let numbered = words.len() >= 4 && words[0].contains('%') && words[1..4].iter().all(|w| w.parse::<i64>().is_ok());
    if words.first() == Some(&"LIST") || numbered {
        let message = format!("{name:.60?}: data in several files come in a later version; join them into one");
        return Err(fault::unsupported(path, "data file", message));
    }
    if name.is_empty() {
        return Err(fault::foreign(path, "data file", "the name is empty"));
    }
    // Relative to the header, wherever the program runs.
    Ok(Some(path.parent().unwrap_or(Path::new("")).join(name)))
}

/// Byte order of the samples.
fn big_endian(path: &Path, header: &Header, kind: Kind) -> Result<bool> {
    match header.get("endian") {
        Some(e) if e.eq_ignore_ascii_case("little") => Ok(false),
        Some(e) if e.eq_ignore_ascii_case("big") => Ok(true),
        Some(e) => Err(fault::foreign(path, "endian", format!("{e:.20?} is neither little nor big"))),
        None if matches!(kind, Kind::U8 | Kind::I8 | Kind::Rgb8) => Ok(false),
        None => {
            let message = "the field is missing; add \"endian: little\" or \"endian: big\"";
            Err(fault::foreign(path, "endian", message))
        }
    }
}

/// Finds the samples; unpacks them where they are packed.
pub(super) fn locate(
    header_path: &Path,
    header: &Header,
    axes: &Axes,
    len: u64,
    options: &ImportOptions,
) -> Result<Payload> {
    let path = header_path;
    let encoding = encoding(path, header)?;
    let (path, (mut file, len), start) = match (data_file(path, header)?, header.data_start) {
        (Some(data), _) => {
            let opened = payload::open(&data)?;
            (data, opened, 0)
        }
        (None, Some(start)) => (path.to_owned(), (payload::open(path)?.0, len), start),
        (None, None) => {
            let message = "no empty line ends the header, and no \"data file\" field names another file";
            return Err(fault::foreign(path, "header", message));
        }
    };
    // What is wrong with a field is the header's fault, wherever the data lie.
    let (at, path) = (header_path, path.as_path());
    let start = skip_lines(at, path, header, &mut file, start)?;
    let skip = match header.get("byteskip") {
        None => Skip::First(0),
        Some("-1") => Skip::ToLast,
        Some(text) => Skip::First(text.parse().map_err(|_| {
            fault::foreign(at, "byte skip", format!("{text:.20?} is neither a number of bytes nor -1"))
        })?),
    };
    let expected = axes.layout.bytes(axes.kind);
    let stored = match encoding {
        Encoding::Text => Stored { kind: axes.kind, big_endian: cfg!(target_endian = "big") },
        _ => Stored { kind: axes.kind, big_endian: big_endian(at, header, axes.kind)? },
    };
    let bytes = match encoding {
        Encoding::Raw => {
            let start = raw_start(path, len, start, skip, expected)?;
            Bytes::File { file, path: path.to_owned(), start, spooled: 0 }
        }
        Encoding::Packed(packing) => Packed { path, file, len, start, packing }.unpack(skip, expected, options)?,
        Encoding::Text => {
            let skip = match skip {
                Skip::First(n) => n,
                Skip::ToLast => return Err(fault::foreign(at, "byte skip", "-1 has no meaning for text")),
            };
            let start = start.saturating_add(skip);
            text::read(path, file, start, len, axes, options)?
        }
    };
    Ok(Payload { bytes, stored, layout: axes.layout })
}

/// Where the samples of a raw file start.
fn raw_start(path: &Path, len: u64, start: u64, skip: Skip, expected: u64) -> Result<u64> {
    let found = len.saturating_sub(start);
    let wrong = |found: u64| {
        let message =
            format!("the sizes need {expected} bytes of samples, the file has {found}; check sizes, type, skips");
        fault::foreign(path, "sizes", message)
    };
    match skip {
        Skip::ToLast if found < expected => Err(wrong(found)),
        Skip::ToLast => Ok(len - expected),
        Skip::First(n) => {
            let found = found.saturating_sub(n);
            // One byte more is the newline that an editor or a test suite has put behind the data.
            if found < expected || found > expected.saturating_add(1) { Err(wrong(found)) } else { Ok(start + n) }
        }
    }
}

/// Byte after `line skip` lines. Lines are skipped before anything is unpacked, bytes after.
fn skip_lines(header_path: &Path, path: &Path, header: &Header, file: &mut File, start: u64) -> Result<u64> {
    let Some(text) = header.get("lineskip") else { return Ok(start) };
    let lines: u64 = text
        .parse()
        .map_err(|_| fault::foreign(header_path, "line skip", format!("{text:.20?} is not a number of lines")))?;
    file.seek(SeekFrom::Start(start)).map_err(|e| fault::io(path, e))?;
    let mut reader = BufReader::new(file);
    let mut at = start;
    for _ in 0..lines {
        let n = reader.skip_until(b'\n').map_err(|e| fault::io(path, e))?;
        if n == 0 {
            return Err(fault::foreign(path, "line skip", format!("the file has fewer than {lines} lines")));
        }
        at += n as u64;
    }
    Ok(at)
}
