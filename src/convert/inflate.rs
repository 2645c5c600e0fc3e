//! gzip and bzip2: unpacks exactly the bytes that a header promises, never more.
//!
//! The promised size is checked against the limit and against what the packed bytes can possibly hold; a stream that ends
//! early costs no more than it delivered. One byte is asked for beyond the end, so that a surplus is an error.

use super::payload::Bytes;
use super::spool::Spool;
use super::{ImportOptions, fault};
use crate::error::{Error, Result};
use bzip2::read::MultiBzDecoder;
use flate2::read::MultiGzDecoder;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

/// How a data stream is packed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Packing {
    /// One or more gzip members.
    Gzip,
    /// One or more bzip2 streams.
    Bzip2,
}

/// Which of the unpacked bytes are wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Skip {
    /// Those after so many.
    First(u64),
    /// The last ones, however many come before.
    ToLast,
}

/// Most unpacked bytes that may come before the wanted ones with [`Skip::ToLast`].
const MAX_PREFIX: u64 = 1 << 30;

impl Packing {
    /// Most bytes that one packed byte can become. gzip: a match of 258 bytes in two bits. bzip2: a block of 900 kB whose
    /// every 5 bytes are a run of 259, in no less than 25 bytes.
    const fn max_ratio(self) -> u64 {
        match self {
            Packing::Gzip => 1032,
            Packing::Bzip2 => 1_900_000,
        }
    }

    const fn name(self) -> &'static str {
        match self {
            Packing::Gzip => "gzip",
            Packing::Bzip2 => "bzip2",
        }
    }

    /// A decoder of everything from the file's position on.
    pub(super) fn reader(self, file: File) -> Box<dyn Read> {
        let file = BufReader::with_capacity(64 << 10, file);
        match self {
            Packing::Gzip => Box::new(MultiGzDecoder::new(file)),
            Packing::Bzip2 => Box::new(MultiBzDecoder::new(file)),
        }
    }
}

/// A packed stream in a file.
pub(super) struct Packed<'a> {
    /// For messages.
    pub path: &'a Path,
    /// The open file.
    pub file: File,
    /// Its length in bytes.
    pub len: u64,
    /// Where the stream starts.
    pub start: u64,
    /// How it is packed.
    pub packing: Packing,
}

impl Packed<'_> {
    fn damaged(&self, cause: std::io::Error) -> Error {
        // The decoders report bad data as io errors of their own; only the system's carry its error number.
        if cause.raw_os_error().is_some() {
            return fault::io(self.path, cause);
        }
        let message = format!("the {} stream is damaged or cut short ({cause})", self.packing.name());
        fault::foreign(self.path, "data", message)
    }

    fn rewound(&self) -> Result<Box<dyn Read>> {
        let mut file = self.file.try_clone().map_err(|e| fault::io(self.path, e))?;
        file.seek(SeekFrom::Start(self.start)).map_err(|e| fault::io(self.path, e))?;
        Ok(self.packing.reader(file))
    }

    /// Unpacks the `wanted` bytes that the header promises, into memory or into a temporary file.
    ///
    /// # Errors
    /// `E_LIMIT` above the caller's limit; `E_FOREIGN` where the stream is damaged or holds fewer or more bytes;
    /// `E_SOURCE` where there is no room for a temporary file.
    pub(super) fn unpack(&self, skip: Skip, wanted: u64, options: &ImportOptions) -> Result<Bytes> {
        let packed = self.len.saturating_sub(self.start);
        if wanted <= options.max_bytes && wanted > packed.saturating_mul(self.packing.max_ratio()) {
            let name = self.packing.name();
            let message = format!("{packed} bytes of {name} cannot hold the {wanted} bytes that the header promises");
            return Err(fault::foreign(self.path, "sizes", message));
        }
        let mut spool = Spool::new(self.path, wanted, options)?;
        // Both passes share one position in the file: the first has to be over before the second starts.
        let skip = match skip {
            Skip::First(n) => n,
            Skip::ToLast => self.unpacked_len(wanted)? - wanted,
        };
        let mut stream = self.rewound()?;
        let skipped =
            std::io::copy(&mut stream.by_ref().take(skip), &mut std::io::sink()).map_err(|e| self.damaged(e))?;
        let filled = if skipped < skip { 0 } else { spool.fill(|out| self.fill(&mut stream, out))? };
        if filled < wanted {
            let message = format!("the header promises {wanted} bytes of samples, the data end after {filled}");
            return Err(fault::foreign(self.path, "data", message));
        }
        if self.fill(&mut stream, &mut [0])? != 0 {
            let message = format!("the data go on after the {wanted} bytes of samples that the header promises");
            return Err(fault::foreign(self.path, "data", message));
        }
        spool.finish(self.path)
    }

    /// Reads until `out` is full or the stream ends.
    fn fill(&self, stream: &mut dyn Read, out: &mut [u8]) -> Result<usize> {
        let mut filled = 0;
        while filled < out.len() {
            match stream.read(&mut out[filled..]) {
                Ok(0) => break,
                Ok(n) => filled += n,
                Err(e) if e.kind() == std::io::ErrorKind::Interrupted => {}
                Err(e) => return Err(self.damaged(e)),
            }
        }
        Ok(filled)
    }

    /// Length of the whole stream, which must be at least `wanted`, and not absurdly more.
    fn unpacked_len(&self, wanted: u64) -> Result<u64> {
        let most = wanted.saturating_add(MAX_PREFIX);
        let len =
            std::io::copy(&mut self.rewound()?.take(most + 1), &mut std::io::sink()).map_err(|e| self.damaged(e))?;
        if len < wanted || len > most {
            let message = format!("the header promises {wanted} bytes of samples, the stream holds {len}");
            return Err(fault::foreign(self.path, "data", message));
        }
        Ok(len)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Code;
    use std::io::Write;

    fn packed(bytes: &[u8], packing: Packing) -> Vec<u8> {
        match packing {
            Packing::Gzip => {
                let mut e = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
                e.write_all(bytes).unwrap();
                e.finish().unwrap()
            }
            Packing::Bzip2 => {
                let mut e = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::fast());
                e.write_all(bytes).unwrap();
                e.finish().unwrap()
            }
        }
    }

    fn unpack(stream: &[u8], packing: Packing, skip: Skip, wanted: u64, max: u64) -> Result<Vec<u8>> {
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(stream).unwrap();
        let packed = Packed { path: Path::new("f"), file, len: stream.len() as u64, start: 0, packing };
        let unpack = |memory| {
            let options = ImportOptions { max_bytes: max, memory, ..ImportOptions::default() };
            let mut out = vec![0; usize::try_from(wanted).unwrap().min(stream.len() << 20)];
            packed.unpack(skip, wanted, &options)?.read_at(0, &mut out).map(|()| out)
        };
        // A temporary file holds the same.
        let (memory, file) = (unpack(u64::MAX), unpack(0));
        match (&memory, &file) {
            (Ok(a), Ok(b)) => assert!(a == b),
            (Err(a), Err(b)) => assert_eq!((a.code(), a.message()), (b.code(), b.message())),
            (a, b) => panic!("{a:?} {b:?}"),
        }
        memory
    }

    #[test]
    fn exactly_the_promised_bytes() {
        let data: Vec<u8> = (0..10_000u32).map(|i| (i / 7) as u8).collect();
        for packing in [Packing::Gzip, Packing::Bzip2] {
            let stream = packed(&data, packing);
            let all = data.len() as u64;
            assert_eq!(unpack(&stream, packing, Skip::First(0), all, all).unwrap(), data);
            assert_eq!(unpack(&stream, packing, Skip::First(100), all - 100, all).unwrap(), data[100..]);
            assert_eq!(unpack(&stream, packing, Skip::ToLast, 100, all).unwrap(), data[9900..]);
            for (skip, wanted) in [
                (Skip::First(0), all - 1),
                (Skip::First(0), all + 1),
                (Skip::First(u64::MAX), 1),
                (Skip::ToLast, all + 1),
            ] {
                let e = unpack(&stream, packing, skip, wanted, u64::MAX).unwrap_err();
                assert_eq!(e.code(), Code::Foreign, "{skip:?} {wanted}");
            }
            assert_eq!(unpack(&stream, packing, Skip::First(0), all, all - 1).unwrap_err().code(), Code::Limit);
            for cut in 0..stream.len() {
                assert!(unpack(&stream[..cut], packing, Skip::First(0), all, all).is_err(), "cut at {cut}");
            }
        }
    }

    #[test] // two members one after the other, as bgzip and parallel packers write them
    fn members_are_joined() {
        for packing in [Packing::Gzip, Packing::Bzip2] {
            let stream = [packed(b"vol", packing), packed(b"ume", packing)].concat();
            assert_eq!(unpack(&stream, packing, Skip::First(0), 6, 6).unwrap(), b"volume");
        }
    }

    #[test] // nothing is allocated for a promise that the packed bytes cannot keep
    fn impossible_promises() {
        let e = unpack(&packed(&[0; 64], Packing::Gzip), Packing::Gzip, Skip::First(0), 1 << 40, u64::MAX).unwrap_err();
        assert_eq!(e.code(), Code::Foreign);
        assert!(e.message().contains("cannot hold"), "{e}");
    }
}
