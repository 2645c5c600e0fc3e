//! Feature bits and their names: the `FNAM` section (spec chapters 3 and 11).
//!
//! `FNAM` is a sequence of `mask u8 | bit u8 | length u16 | UTF-8 name`, sorted by mask and bit.

use crate::error::{Code, Error, Result};

/// Required bit 0: some payload is a zstd frame (spec: VER-4, BRK-8).
pub const REQUIRED_ZSTD: u64 = 1;
/// Optional bit 0: the writer replaced NaN or infinite samples by the null value (spec: VER-6).
pub const OPTIONAL_NAN_REPLACED: u64 = 1;
pub(super) const KNOWN_REQUIRED: u64 = REQUIRED_ZSTD;
pub(super) const KNOWN_READ_OPTIONAL: u64 = 0;
const KNOWN: [&[&str]; 3] = [&["ZSTD"], &[], &["NAN_REPLACED"]];
/// Longest name in bytes.
const MAX_NAME: usize = 64;

/// The name of one feature bit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FeatureName {
    /// 0 required, 1 optional to read, 2 optional.
    pub mask: u8,
    /// Bit number, 0 to 63.
    pub bit: u8,
    /// What to call it in messages.
    pub name: String,
}

/// The lowest required bit that this reader does not know (spec: HDR-5).
pub(super) fn unknown_required(required: u64) -> Option<u32> {
    let unknown = required & !KNOWN_REQUIRED;
    (unknown != 0).then(|| unknown.trailing_zeros())
}

/// Names for all bits that are set: those given, else the ones of this version.
pub(super) fn names(masks: [u64; 3], given: &[FeatureName]) -> Vec<FeatureName> {
    let mut names = Vec::new();
    for (mask, &bits) in (0u8..).zip(&masks) {
        for bit in (0u8..64).filter(|b| bits >> b & 1 == 1) {
            let known = KNOWN[usize::from(mask)].get(usize::from(bit)).map(|s| (*s).to_owned());
            let name = given.iter().find(|n| n.mask == mask && n.bit == bit).map(|n| n.name.clone());
            let name = known.or(name).unwrap_or_else(|| format!("BIT_{bit}"));
            names.push(FeatureName { mask, bit, name });
        }
    }
    names
}

/// Checks the lengths of names that are to be written.
///
/// # Errors
/// `E_PARAM`.
pub(super) fn check_names(names: &[FeatureName]) -> Result<()> {
    match names.iter().find(|n| n.name.is_empty() || n.name.len() > MAX_NAME) {
        None => Ok(()),
        Some(n) => Err(Error::param("feature_names", format!("{:?} is not 1 to {MAX_NAME} bytes long", n.name))),
    }
}

/// Bytes of the section (spec: SEC-14).
pub(super) fn write_to(names: &[FeatureName]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for n in names {
        let len = u16::try_from(n.name.len()).expect("names are at most 64 bytes");
        bytes.extend([n.mask, n.bit]);
        bytes.extend(len.to_le_bytes());
        bytes.extend(n.name.as_bytes());
    }
    bytes
}

/// Reads the section, whose bytes lie at `offset` (spec: SEC-14).
///
/// # Errors
/// `E_TRUNCATED`, `E_PARAM`, `E_ORDER`, `E_DUP`, `E_UTF8`, with the offset of the bad entry.
pub(super) fn read_from(bytes: &[u8], offset: u64) -> Result<Vec<FeatureName>> {
    let mut names: Vec<FeatureName> = Vec::new();
    let mut rest = bytes;
    while !rest.is_empty() {
        let at = offset + (bytes.len() - rest.len()) as u64;
        let bad = |code, message: String| Error::at(code, at, "FNAM", message);
        let [mask, bit, a, b, tail @ ..] = rest else {
            return Err(bad(Code::Truncated, "the section ends inside an entry".into()));
        };
        let len = usize::from(u16::from_le_bytes([*a, *b]));
        if *mask > 2 || *bit > 63 || len == 0 || len > MAX_NAME {
            return Err(bad(Code::Param, format!("mask {mask}, bit {bit}, name of {len} bytes: out of range")));
        }
        let Some((name, tail)) = tail.split_at_checked(len) else {
            return Err(bad(Code::Truncated, "the section ends inside a name".into()));
        };
        let name = std::str::from_utf8(name)
            .map_err(|e| bad(Code::Utf8, format!("{e}; the feature's name is not text")))?
            .to_owned();
        if let Some(last) = names.last() {
            match (last.mask, last.bit).cmp(&(*mask, *bit)) {
                std::cmp::Ordering::Less => {}
                std::cmp::Ordering::Equal => return Err(bad(Code::Dup, format!("bit {bit} is named twice"))),
                std::cmp::Ordering::Greater => return Err(bad(Code::Order, "names are not sorted".into())),
            }
        }
        names.push(FeatureName { mask: *mask, bit: *bit, name });
        rest = tail;
    }
    Ok(names)
}
