//! Fixed structures to and from bytes: the one place where binrw's errors become ours (spec chapter 1).

use crate::error::{Code, Error, Result};
use binrw::meta::{ReadEndian, WriteEndian};
use binrw::{BinRead, BinWrite};
use std::io::Cursor;

/// Reads one fixed structure from the start of `bytes`, which lie at `offset` in the file (spec: GEN-1, GEN-2).
///
/// Field by field, so that the bytes may start at any address (spec: SAF-5).
///
/// # Errors
/// `E_TRUNCATED` where `bytes` is too short, `E_PARAM` where binrw refuses a value; both with absolute offset.
pub(super) fn read<T>(bytes: &[u8], offset: u64, field: &'static str) -> Result<T>
where
    T: BinRead + ReadEndian,
    for<'a> T::Args<'a>: Default,
{
    T::read(&mut Cursor::new(bytes)).map_err(|e| convert(&e, bytes.len(), offset, field))
}

/// Bytes of one fixed structure of `N` bytes.
pub(super) fn write<const N: usize, T>(value: &T) -> [u8; N]
where
    T: BinWrite + WriteEndian,
    for<'a> T::Args<'a>: Default,
{
    let mut bytes = [0; N];
    let mut cursor = Cursor::new(&mut bytes[..]);
    value.write(&mut cursor).expect("a fixed structure has a fixed size");
    debug_assert_eq!(cursor.position(), N as u64, "a fixed structure has a fixed size");
    bytes
}

/// binrw reports a short slice as an I/O error without a place, and others relative to the slice.
fn convert(e: &binrw::Error, len: usize, base: u64, field: &'static str) -> Error {
    match e {
        binrw::Error::Io(_) => {
            let end = base.saturating_add(len as u64);
            Error::at(Code::Truncated, end, field, format!("the bytes end here, inside {field}; fetch the file again"))
        }
        binrw::Error::AssertFail { pos, message } => {
            Error::at(Code::Param, base.saturating_add(*pos), field, message.clone())
        }
        binrw::Error::BadMagic { pos, .. } => {
            Error::at(Code::Param, base.saturating_add(*pos), field, "unexpected bytes; the file is damaged")
        }
        other => Error::at(Code::Param, base, field, first_line(other)),
    }
}

fn first_line(e: &binrw::Error) -> String {
    e.to_string().lines().find(|l| !l.trim().is_empty()).unwrap_or("unreadable").trim().to_owned()
}

/// Checks that reserved bytes are zero, naming the first one that is not (spec: GEN-6).
///
/// # Errors
/// `E_RESERVED`.
pub(super) fn check_zero(bytes: &[u8], offset: u64, field: &'static str) -> Result<()> {
    match bytes.iter().position(|&b| b != 0) {
        None => Ok(()),
        Some(i) => Err(Error::at(
            Code::Reserved,
            offset.saturating_add(i as u64),
            field,
            format!("reserved byte is {:#04x}, not 0; the file is damaged or of a newer version", bytes[i]),
        )),
    }
}
