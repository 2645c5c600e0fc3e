//! The superblock: the first 256 bytes of every file (spec chapter 2).
//!
//! | off | size | field |
//! |---|---|---|
//! | 0 | 12 | magic |
//! | 12 | 2+2 | major, minor |
//! | 16 | 4 | header length, 256 |
//! | 20 | 4 | CRC-32 of these 256 bytes with this field zero |
//! | 24 | 16 | file id |
//! | 40 | 8 | file length |
//! | 48 | 8×3 | feature masks: required, optional to read, optional |
//! | 72 | 1×4 | layout, clustered, resource level, reserved |
//! | 76 | 4 | section count |
//! | 80 | 8+4 | section table offset, CRC |
//! | 92 | 164 | reserved |

use super::features::{KNOWN_REQUIRED, unknown_required};
use super::wire;
use crate::checksum::crc32;
use crate::error::{Code, Error, Result};
use binrw::binrw;

/// Bytes of the superblock.
pub const SUPERBLOCK_BYTES: usize = 256;

/// The first 12 bytes of every file: `AB "VUG 10" BB CR LF ^Z LF` (spec: HDR-1).
pub const MAGIC: [u8; 12] = [0xAB, 0x56, 0x55, 0x47, 0x20, 0x31, 0x30, 0xBB, 0x0D, 0x0A, 0x1A, 0x0A];
/// The version that is written. Any minor of this major is read (spec: HDR-2, VER-1).
pub(super) const MAJOR: u16 = 1;
const MINOR: u16 = 0;
const CRC_FIELD: std::ops::Range<usize> = 20..24;

/// How the file is organised (spec: HDR-6).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum FileLayout {
    /// Tables first, immutable.
    Head = 0,
    /// A sequence of records and commits, for streams and appending.
    Log = 1,
}

/// The first 256 bytes, checked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Superblock {
    /// Major version; a reader refuses all but its own.
    pub major: u16,
    /// Minor version; informational.
    pub minor: u16,
    /// Names this file's content; seeds the CRCs of its leaders.
    pub file_id: [u8; 16],
    /// Length of the file in bytes; of a log, up to the end of the commit.
    pub file_len: u64,
    /// Features without which the file cannot be read.
    pub required: u64,
    /// Features that a reader may ignore and an editor must not.
    pub read_optional: u64,
    /// Features that anybody may ignore.
    pub optional: u64,
    /// How the file is organised.
    pub layout: FileLayout,
    /// Whether bricks are stored coarsest level first, then by tree, page and Morton order.
    pub clustered: bool,
    /// 1: default limits of WebGPU; 2: a workstation's; 3: the caps of the format.
    pub resource_level: u8,
    /// Entries of the section table.
    pub section_count: u32,
    /// Where the section table starts.
    pub section_table_offset: u64,
    /// CRC-32 of the section table.
    pub section_table_crc: u32,
}

#[binrw]
#[brw(little)]
struct Wire {
    magic: [u8; 12],
    major: u16,
    minor: u16,
    header_len: u32,
    crc: u32,
    file_id: [u8; 16],
    file_len: u64,
    required: u64,
    read_optional: u64,
    optional: u64,
    layout: u8,
    clustered: u8,
    resource_level: u8,
    reserved_byte: u8,
    section_count: u32,
    section_table_offset: u64,
    section_table_crc: u32,
    reserved: [u8; 164],
}

impl Superblock {
    /// A superblock of this version, with everything that the tables decide still zero.
    #[must_use]
    pub(super) fn new() -> Self {
        Superblock {
            major: MAJOR,
            minor: MINOR,
            file_id: [0; 16],
            file_len: 0,
            required: 0,
            read_optional: 0,
            optional: 0,
            layout: FileLayout::Head,
            clustered: false,
            resource_level: 3,
            section_count: 0,
            section_table_offset: SUPERBLOCK_BYTES as u64,
            section_table_crc: 0,
        }
    }

    /// Reads the superblock from the first bytes of a file, checking in the order of spec chapter 9 (spec: VAL-1).
    ///
    /// The length of the file is not known here and not checked.
    ///
    /// # Errors
    /// `E_TRUNCATED`, `E_MAGIC`, `E_VERSION`, `E_SIZE`, `E_HEADER_CRC`, `E_FEATURE`, `E_PARAM`, `E_RESERVED`.
    pub fn read_from(bytes: &[u8]) -> Result<Self> {
        check_magic(bytes)?;
        check_version(bytes)?;
        let Some(bytes) = bytes.get(..SUPERBLOCK_BYTES) else {
            return Err(truncated(bytes.len()));
        };
        let wire: Wire = wire::read(bytes, 0, "superblock")?;
        // spec: HDR-3
        let computed = superblock_crc(bytes);
        if computed != wire.crc {
            return Err(Error::at(
                Code::HeaderCrc,
                20,
                "superblock.crc",
                format!(
                    "CRC {computed:08x} computed, {:08x} stored; the first 256 bytes are damaged, fetch the file again",
                    wire.crc
                ),
            ));
        }
        wire.check()
    }

    /// Checks that the superblock of a log says nothing that only a commit can say (spec: LOG-1).
    ///
    /// # Errors
    /// `E_RESERVED`.
    pub(super) fn check_log(&self) -> Result<()> {
        for (at, field, value) in [
            (40, "superblock.file_length", self.file_len),
            (48, "superblock.required", self.required),
            (56, "superblock.read_optional", self.read_optional),
            (64, "superblock.optional", self.optional),
            (73, "superblock.clustered", u64::from(self.clustered)),
            (76, "superblock.section_count", u64::from(self.section_count)),
            (80, "superblock.section_table_offset", self.section_table_offset),
            (88, "superblock.section_table_crc", u64::from(self.section_table_crc)),
        ] {
            if value != 0 {
                let message = format!("{value} instead of 0: in a log, commits say it");
                return Err(Error::at(Code::Reserved, at, field, message));
            }
        }
        Ok(())
    }

    /// The bytes of the superblock, its CRC included (spec: HDR-3).
    #[must_use]
    pub fn write_to(&self) -> [u8; SUPERBLOCK_BYTES] {
        let mut bytes: [u8; SUPERBLOCK_BYTES] = wire::write(&Wire {
            magic: MAGIC,
            major: self.major,
            minor: self.minor,
            header_len: SUPERBLOCK_BYTES as u32,
            crc: 0,
            file_id: self.file_id,
            file_len: self.file_len,
            required: self.required,
            read_optional: self.read_optional,
            optional: self.optional,
            layout: self.layout as u8,
            clustered: u8::from(self.clustered),
            resource_level: self.resource_level,
            reserved_byte: 0,
            section_count: self.section_count,
            section_table_offset: self.section_table_offset,
            section_table_crc: self.section_table_crc,
            reserved: [0; 164],
        });
        let crc = superblock_crc(&bytes);
        bytes[CRC_FIELD].copy_from_slice(&crc.to_le_bytes());
        bytes
    }
}

impl Wire {
    fn check(self) -> Result<Superblock> {
        // spec: HDR-5, VER-2
        if let Some(bit) = unknown_required(self.required) {
            return Err(Error::at(
                Code::Feature,
                48,
                "superblock.required",
                format!("the file needs feature bit {bit}, which this reader does not know; use a newer reader"),
            ));
        }
        debug_assert_eq!(self.required & !KNOWN_REQUIRED, 0);
        let param = |offset, field, message: String| Err(Error::at(Code::Param, offset, field, message));
        // spec: HDR-6
        let layout = match self.layout {
            0 => FileLayout::Head,
            1 => FileLayout::Log,
            n => return param(72, "superblock.layout", format!("layout {n} is neither 0 (head) nor 1 (log)")),
        };
        // spec: HDR-7
        if self.clustered > 1 {
            return param(73, "superblock.clustered", format!("{} is neither 0 nor 1", self.clustered));
        }
        // spec: HDR-8
        if !(1..=3).contains(&self.resource_level) {
            return param(74, "superblock.resource_level", format!("{} is not 1, 2 or 3", self.resource_level));
        }
        // spec: HDR-12
        wire::check_zero(&[self.reserved_byte], 75, "superblock.reserved")?;
        wire::check_zero(&self.reserved, 92, "superblock.reserved")?;
        Ok(Superblock {
            major: self.major,
            minor: self.minor,
            file_id: self.file_id,
            file_len: self.file_len,
            required: self.required,
            read_optional: self.read_optional,
            optional: self.optional,
            layout,
            clustered: self.clustered == 1,
            resource_level: self.resource_level,
            section_count: self.section_count,
            section_table_offset: self.section_table_offset,
            section_table_crc: self.section_table_crc,
        })
    }
}

/// Magic, or the part of it that is there (spec: HDR-1).
fn check_magic(bytes: &[u8]) -> Result<()> {
    let there = bytes.len().min(MAGIC.len());
    if bytes[..there] == MAGIC[..there] {
        return if there < MAGIC.len() { Err(truncated(there)) } else { Ok(()) };
    }
    let at = (0..there).find(|&i| bytes[i] != MAGIC[i]).unwrap_or(0);
    let stripped = bytes.len() >= 8 && bytes.iter().zip(MAGIC).take(8).all(|(a, b)| a & 0x7F == b & 0x7F);
    let text_damage = at >= 8 || stripped;
    let message = if text_damage {
        "the file was damaged by a transfer in text mode (line ends or the eighth bit were changed); fetch it again in binary mode"
    } else {
        "this is not a Vug file; `vug encode` makes one from raw, npy, NRRD or NIfTI"
    };
    Err(Error::at(Code::Magic, at as u64, "superblock.magic", message))
}

/// Major version and header length, as far as they are there (spec: HDR-2, HDR-4).
fn check_version(bytes: &[u8]) -> Result<()> {
    if let Some(&[a, b]) = bytes.get(12..14) {
        let major = u16::from_le_bytes([a, b]);
        if major != MAJOR {
            return Err(Error::at(
                Code::Version,
                12,
                "superblock.major",
                format!("the file has version {major}, this reader knows {MAJOR}; use a reader of that version"),
            ));
        }
    }
    if let Some(&[a, b, c, d]) = bytes.get(16..20) {
        let len = u32::from_le_bytes([a, b, c, d]);
        if len as usize != SUPERBLOCK_BYTES {
            return Err(Error::at(
                Code::Size,
                16,
                "superblock.header_length",
                format!(
                    "{len} bytes instead of {SUPERBLOCK_BYTES}; the first 256 bytes are damaged, fetch the file again"
                ),
            ));
        }
    }
    Ok(())
}

fn truncated(len: usize) -> Error {
    Error::at(
        Code::Truncated,
        len as u64,
        "superblock",
        format!("the file ends after {len} bytes, inside the first {SUPERBLOCK_BYTES}; fetch it again"),
    )
}

/// CRC-32 with the CRC's own field taken as zero (spec: HDR-3).
fn superblock_crc(bytes: &[u8]) -> u32 {
    let mut copy = [0; SUPERBLOCK_BYTES];
    copy.copy_from_slice(&bytes[..SUPERBLOCK_BYTES]);
    copy[CRC_FIELD].fill(0);
    crc32(&copy)
}

/// The required mask and section table fields of a superblock that `read_from` refused, for a better message only.
pub(super) struct Glimpse {
    /// Required features.
    pub required: u64,
    /// Entries of the section table.
    pub section_count: u32,
    /// Where the section table starts.
    pub section_table_offset: u64,
}

/// Reads fields without checks; the caller has seen the CRC match.
pub(super) fn glimpse(bytes: &[u8]) -> Option<Glimpse> {
    let w: Wire = wire::read(bytes, 0, "superblock").ok()?;
    Some(Glimpse { required: w.required, section_count: w.section_count, section_table_offset: w.section_table_offset })
}
