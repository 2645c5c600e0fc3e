//! Text encoding: numbers separated by blanks, newlines or commas.

use super::axes::Axes;
use crate::convert::payload::Bytes;
use crate::convert::spool::Spool;
use crate::convert::stored::Kind;
use crate::convert::{ImportOptions, fault};
use crate::error::Result;
use std::fs::File;
use std::io::{BufRead, BufReader, Seek, SeekFrom};
use std::path::Path;

/// Longest number that is read: f64 in full takes some 1080 characters.
const MAX_TOKEN: usize = 2048;

/// Reads exactly as many numbers as the axes need, into this machine's byte order.
pub(super) fn read(
    path: &Path,
    mut file: File,
    start: u64,
    len: u64,
    axes: &Axes,
    options: &ImportOptions,
) -> Result<Bytes> {
    let (size, kind) = match axes.kind {
        Kind::Rgb8 => (1, Kind::U8),
        kind => (kind.bytes(), kind),
    };
    let expected = axes.layout.bytes(axes.kind);
    let numbers = expected / size as u64;
    // A number takes a digit, and all but the last a separator.
    if numbers > len.saturating_sub(start).saturating_add(1) / 2 {
        let message = format!("{} bytes of text cannot hold {numbers} numbers", len.saturating_sub(start));
        return Err(fault::foreign(path, "sizes", message));
    }
    let mut spool = Spool::new(path, expected, options)?;
    file.seek(SeekFrom::Start(start)).map_err(|e| fault::io(path, e))?;
    let mut tokens = Tokens { reader: BufReader::new(file), token: Vec::new() };
    let mut slot = [0; 8];
    for filled in 0..numbers {
        let token = tokens.next().map_err(|e| fault::io(path, e))?;
        if token.is_empty() {
            let message = format!("the sizes need {numbers} numbers, the text ends after {filled}");
            return Err(fault::foreign(path, "data", message));
        }
        let text = std::str::from_utf8(token).unwrap_or("");
        if !parse(kind, text, &mut slot[..size]) {
            let shown = String::from_utf8_lossy(&token[..token.len().min(40)]).into_owned();
            return Err(fault::foreign(path, "data", format!("number {filled}, {shown:?}, is not a {kind}")));
        }
        spool.put(&slot[..size])?;
    }
    if !tokens.next().map_err(|e| fault::io(path, e))?.is_empty() {
        let message = format!("the text goes on after the {numbers} numbers that the sizes need");
        return Err(fault::foreign(path, "data", message));
    }
    spool.finish(path)
}

struct Tokens<R> {
    reader: R,
    token: Vec<u8>,
}

impl<R: BufRead> Tokens<R> {
    /// The next word; empty at the end. Words are cut at `MAX_TOKEN`, which no number reaches.
    fn next(&mut self) -> std::io::Result<&[u8]> {
        self.token.clear();
        loop {
            let buffer = self.reader.fill_buf()?;
            if buffer.is_empty() {
                break;
            }
            let blank = |b: &u8| b.is_ascii_whitespace() || *b == b',';
            let lead = if self.token.is_empty() { buffer.iter().take_while(|b| blank(b)).count() } else { 0 };
            let word = &buffer[lead..];
            let end = word.iter().position(blank).unwrap_or(word.len());
            let ended = end < word.len() || self.token.len() + end > MAX_TOKEN;
            self.token.extend_from_slice(&word[..end.min(MAX_TOKEN)]);
            let used = lead + end;
            self.reader.consume(used);
            if ended {
                break;
            }
        }
        Ok(&self.token)
    }
}

/// Parses one number of `kind` into its bytes.
fn parse(kind: Kind, text: &str, out: &mut [u8]) -> bool {
    macro_rules! number {
        ($t:ty) => {
            text.parse::<$t>().is_ok_and(|v| {
                out.copy_from_slice(&v.to_ne_bytes());
                true
            })
        };
    }
    match kind {
        Kind::U8 | Kind::Rgb8 => number!(u8),
        Kind::I8 => number!(i8),
        Kind::U16 => number!(u16),
        Kind::I16 => number!(i16),
        Kind::U32 => number!(u32),
        Kind::I32 => number!(i32),
        Kind::U64 => number!(u64),
        Kind::I64 => number!(i64),
        Kind::F32 => number!(f32),
        Kind::F64 => number!(f64),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::convert::layout::Layout;
    use crate::geometry::Extent;
    use std::io::Write;

    fn numbers(kind: Kind, n: u32, text: &str) -> Result<Vec<u8>> {
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(text.as_bytes()).unwrap();
        let layout = Layout::single(Path::new("f"), "sizes", Extent::new(n, 1, 1), kind)?;
        let axes = Axes { kind, layout, domain: vec![0], time: None, dimension: 1 };
        let mut bytes = read(Path::new("f"), file, 0, text.len() as u64, &axes, &ImportOptions::default())?;
        let mut out = vec![0; layout.bytes(kind) as usize];
        bytes.read_at(0, &mut out).map(|()| out)
    }

    #[test]
    fn words() {
        assert_eq!(numbers(Kind::U8, 3, "1 2\n255\n").unwrap(), [1, 2, 255]);
        assert_eq!(numbers(Kind::U8, 3, " 1,2,\t3").unwrap(), [1, 2, 3]);
        assert_eq!(numbers(Kind::I16, 1, "-2").unwrap(), (-2i16).to_ne_bytes());
        assert_eq!(numbers(Kind::Rgb8, 1, "1 2 3").unwrap(), [1, 2, 3]);
        assert!(f32::from_ne_bytes(numbers(Kind::F32, 1, "nan").unwrap().try_into().unwrap()).is_nan());
        let long = format!("{}1", " ".repeat(20_000));
        assert_eq!(numbers(Kind::U8, 1, &long).unwrap(), [1]);
        for (n, bad) in
            [(1, ""), (1, "256"), (1, "x"), (1, "1 2"), (3, "1 2"), (1000, "1 2"), (1, "1.5"), (1, "\u{e9}")]
        {
            assert!(numbers(Kind::U8, n, bad).is_err(), "{bad:?}");
        }
        assert!(numbers(Kind::F64, 1, &"1".repeat(100_000)).is_err());
    }
}
