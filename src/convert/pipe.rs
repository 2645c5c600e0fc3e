//! Raw samples from a pipe: read once, in order, and never kept, unless they have to be looked at twice.

use super::layout::Layout;
use super::narrow;
use super::payload::Payload;
use super::slabs::{check_turn, to_native};
use super::spool::Spool;
use super::stored::{Kind, Stored};
use super::{Format, Import, ImportOptions, fault};
use crate::error::{Code, Error, Result};
use crate::geometry::Extent;
use crate::grid::SlabReader;
use crate::voxel::SampleType;
use serde_json::json;
use std::fs::File;
use std::io::Read;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Whether this names the standard input (`-`), or a pipe among the files.
pub(super) fn is_pipe(path: &Path) -> bool {
    path == Path::new("-") || is_fifo(path)
}

#[cfg(unix)]
fn is_fifo(path: &Path) -> bool {
    use std::os::unix::fs::FileTypeExt;
    std::fs::metadata(path).is_ok_and(|m| m.file_type().is_fifo())
}

#[cfg(not(unix))]
fn is_fifo(_: &Path) -> bool {
    false
}

/// Opens a pipe. Samples that are of one of Vug's types, or forced to one, pass through; others are looked at before the
/// first is delivered, which takes a temporary file.
pub(super) fn import(path: &Path, stored: Stored, layout: Layout, options: &ImportOptions) -> Result<Import> {
    let stream: Box<dyn Read + Send> = match path == Path::new("-") {
        true => Box::new(std::io::stdin()),
        false => Box::new(File::open(path).map_err(|e| fault::io(path, e))?),
    };
    open(path, stream, stored, layout, options)
}

fn open(
    path: &Path,
    stream: Box<dyn Read + Send>,
    stored: Stored,
    layout: Layout,
    options: &ImportOptions,
) -> Result<Import> {
    let header = json!({ "format": "raw" });
    let mut pipe = Pipe { stream, path: path.to_owned(), stored, layout, volume: 0, plane: 0, row: 0, delivered: 0 };
    if let Some(native) = stored.kind.native().filter(|n| options.dtype.is_none_or(|t| t == *n)) {
        let opened = super::payload::Opened { reader: Box::new(Planes { pipe, native }), streamed: true, spooled: 0 };
        return Ok(Import::plain(opened, Format::Raw, header));
    }
    narrow::check_forced(path, stored, options.dtype)?;
    let mut spool = Spool::new(path, layout.bytes(stored.kind), options)?;
    spool.fill(|out| pipe.fill(out).map(|()| out.len()))?;
    pipe.check_end()?;
    let opened = Payload { bytes: spool.finish(path)?, stored, layout }.open(path, options.dtype)?;
    Ok(Import::plain(opened, Format::Raw, header))
}

/// What is left of a stream of samples.
struct Pipe {
    stream: Box<dyn Read + Send>,
    path: PathBuf,
    stored: Stored,
    layout: Layout,
    /// The volume that comes next or is being read, in the order of trees.
    volume: u64,
    /// Its next plane.
    plane: u32,
    /// The next row of that plane.
    row: u32,
    /// Bytes that have come.
    delivered: u64,
}

impl Pipe {
    fn fill(&mut self, out: &mut [u8]) -> Result<()> {
        let mut filled = 0;
        while filled < out.len() {
            match self.stream.read(&mut out[filled..]) {
                Ok(0) => {
                    let found = self.delivered + filled as u64;
                    return Err(self.wrong(format!("the pipe ends after {found}")));
                }
                Ok(n) => filled += n,
                Err(e) if e.kind() == std::io::ErrorKind::Interrupted => {}
                Err(e) => return Err(fault::io(&self.path, e)),
            }
        }
        self.delivered += filled as u64;
        Ok(())
    }

    /// After the last byte that is wanted there has to be none.
    fn check_end(&mut self) -> Result<()> {
        let mut surplus = Vec::new();
        self.stream.by_ref().take(1).read_to_end(&mut surplus).map_err(|e| fault::io(&self.path, e))?;
        if surplus.is_empty() { Ok(()) } else { Err(self.wrong("the pipe goes on behind them".into())) }
    }

    fn wrong(&self, what: String) -> Error {
        let (expected, kind): (u64, Kind) = (self.layout.bytes(self.stored.kind), self.stored.kind);
        let message = format!(
            "{}: {} voxels of {kind} are {expected} bytes, {what}; check --shape, --dtype, --time-steps and --channels",
            self.path.display(),
            self.layout.text()
        );
        Error::new(Code::Size, "shape", message)
    }
}

/// Planes of a pipe, each of which can be had once.
struct Planes {
    pipe: Pipe,
    native: SampleType,
}

impl Planes {
    fn out_of_order(&self, wanted: impl std::fmt::Display) -> Error {
        let Pipe { path, layout, volume, plane, row, .. } = &self.pipe;
        let channels = u64::from(layout.channels);
        let message = format!(
            "{}: {wanted} is wanted, but a pipe delivers its planes once and in order, and row {row} of plane {plane} of time \
             step {}, channel {} comes next",
            path.display(),
            volume / channels,
            volume % channels
        );
        Error::new(Code::Range, "z", message)
    }
}

impl SlabReader for Planes {
    fn extent(&self) -> Extent {
        self.pipe.layout.extent
    }

    fn sample_type(&self) -> SampleType {
        self.native
    }

    fn read_slab(&mut self, z: Range<u32>, out: &mut [u8]) -> Result<()> {
        self.read_rows(z, 0..self.pipe.layout.extent.y, out)
    }

    fn read_rows(&mut self, z: Range<u32>, y: Range<u32>, out: &mut [u8]) -> Result<()> {
        let e = self.pipe.layout.extent;
        let (rows, planes) = (y.end.saturating_sub(y.start), z.end.saturating_sub(z.start));
        let samples = u64::from(e.x) * u64::from(rows) * u64::from(planes);
        if z.end > e.z || y.end > e.y || out.len() as u64 != samples * self.native.bytes() as u64 {
            let message = format!("rows {y:?} of planes {z:?} of {e} into {} bytes", out.len());
            return Err(Error::new(Code::Range, "z", message));
        }
        if samples == 0 {
            return Ok(());
        }
        // Parts of several planes do not follow each other.
        let follows = planes == 1 || rows == e.y;
        if (z.start, y.start) != (self.pipe.plane, self.pipe.row) || !follows {
            return Err(self.out_of_order(format_args!("row {} of plane {}", y.start, z.start)));
        }
        self.pipe.fill(out)?;
        to_native(self.pipe.stored, out);
        (self.pipe.plane, self.pipe.row) = if y.end == e.y { (z.end, 0) } else { (z.start, y.end) };
        let volumes = u64::from(self.pipe.layout.time_steps) * u64::from(self.pipe.layout.channels);
        if self.pipe.plane == e.z && self.pipe.volume + 1 == volumes {
            self.pipe.check_end()?;
        }
        Ok(())
    }

    fn series(&self) -> (u32, u32) {
        (self.pipe.layout.time_steps, self.pipe.layout.channels)
    }

    fn turn_to(&mut self, time: u32, channel: u32) -> Result<()> {
        check_turn(self.series(), time, channel)?;
        let volume = u64::from(time) * u64::from(self.pipe.layout.channels) + u64::from(channel);
        let pipe = &mut self.pipe;
        if volume == pipe.volume {
            return Ok(());
        }
        if volume != pipe.volume + 1 || pipe.plane != pipe.layout.extent.z {
            return Err(self.out_of_order(format_args!("time step {time}, channel {channel}")));
        }
        (pipe.volume, pipe.plane) = (volume, 0);
        Ok(())
    }

    fn is_sequential(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn open_bytes(bytes: &[u8], kind: Kind, series: (u32, u32), options: &ImportOptions) -> Result<Import> {
        let path = Path::new("-");
        let layout = Layout::series(path, "shape", Extent::new(2, 1, 3), series, kind)?;
        open(path, Box::new(std::io::Cursor::new(bytes.to_vec())), kind.into(), layout, options)
    }

    #[test]
    fn planes_come_once_and_in_order() {
        let bytes: Vec<u8> = (0..24).collect();
        let mut import = open_bytes(&bytes, Kind::U8, (2, 2), &ImportOptions::default()).unwrap();
        let reader = &mut import.reader;
        assert!(reader.is_sequential() && reader.series() == (2, 2) && import.streamed);
        let mut out = [0; 6];
        for (i, (t, c)) in [(0, 0), (0, 1), (1, 0), (1, 1)].into_iter().enumerate() {
            reader.turn_to(t, c).unwrap();
            reader.turn_to(t, c).unwrap();
            if i < 3 {
                let e = reader.turn_to(1, 1).unwrap_err();
                assert!(e.code() == Code::Range && e.message().contains("in order"), "{e}");
            }
            reader.read_slab(0..1, &mut out[..2]).unwrap();
            assert_eq!(reader.read_slab(0..1, &mut out[..2]).unwrap_err().code(), Code::Range);
            assert_eq!(reader.read_slab(2..3, &mut out[..2]).unwrap_err().code(), Code::Range);
            assert_eq!(reader.read_slab(1..3, &mut out[..3]).unwrap_err().code(), Code::Range);
            reader.read_slab(1..3, &mut out[2..]).unwrap();
            assert_eq!(out, *bytes[i * 6..][..6].as_array().unwrap());
        }
        assert_eq!(reader.turn_to(2, 0).unwrap_err().code(), Code::Range);
    }

    #[test]
    fn rows_come_in_order_too() {
        let layout = Layout::series(Path::new("-"), "shape", Extent::new(2, 3, 2), (1, 1), Kind::U8).unwrap();
        let bytes: Vec<u8> = (0..12).collect();
        let stream = Box::new(std::io::Cursor::new(bytes.clone()));
        let mut import = open(Path::new("-"), stream, Kind::U8.into(), layout, &ImportOptions::default()).unwrap();
        let (reader, mut out) = (&mut import.reader, [0; 12]);
        reader.read_rows(0..1, 0..2, &mut out[..4]).unwrap();
        for (z, y) in [(0..1, 1..2), (1..2, 2..3), (0..2, 2..3)] {
            let len = 2 * z.len() * y.len();
            assert_eq!(reader.read_rows(z, y, &mut [0; 4][..len]).unwrap_err().code(), Code::Range);
        }
        reader.read_rows(0..1, 2..3, &mut out[4..6]).unwrap();
        reader.read_slab(1..2, &mut out[6..]).unwrap();
        assert_eq!(out[..], bytes);
    }

    #[test]
    fn too_few_and_too_many_bytes() {
        let read = |n: usize, kind| {
            let bytes = vec![0; n];
            let mut import = open_bytes(&bytes, kind, (1, 1), &ImportOptions::default())?;
            import.reader.read_slab(0..3, &mut vec![0; 6 * import.reader.sample_type().bytes()])
        };
        read(12, Kind::U16).unwrap();
        read(24, Kind::U32).unwrap();
        for (n, kind, word) in [
            (11, Kind::U16, "after 11"),
            (13, Kind::U16, "goes on"),
            (23, Kind::U32, "ends after"),
            (25, Kind::U32, "goes on"),
        ] {
            let e = read(n, kind).unwrap_err();
            assert!(e.code() == Code::Size && e.message().contains(word), "{e}");
        }
    }

    #[test] // samples that have to be looked at twice can be had in any order
    fn what_is_narrowed_goes_to_a_file() {
        let bytes: Vec<u8> = (0..6i32).flat_map(|v| (v - 3).to_le_bytes()).collect();
        let options = ImportOptions { memory: 0, ..ImportOptions::default() };
        let mut import = open_bytes(&bytes, Kind::I32, (1, 1), &options).unwrap();
        assert!(!import.reader.is_sequential() && import.spooled == 24);
        let mut out = [0; 4];
        import.reader.read_slab(1..2, &mut out).unwrap();
        assert_eq!(out, *[(-1i16).to_ne_bytes(), 0i16.to_ne_bytes()].concat().as_array().unwrap());
        let forced = ImportOptions { dtype: Some(SampleType::Rgb8), ..options };
        assert_eq!(open_bytes(&bytes, Kind::I32, (1, 1), &forced).err().unwrap().code(), Code::Param);
    }
}
