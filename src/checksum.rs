//! CRC-32 (IEEE polynomial, as in zlib and PNG), plain or seeded with a file id (spec chapter 1).

use crc32fast::Hasher;

/// CRC-32 of `bytes` (spec: GEN-4). The CRC of nothing is 0.
#[must_use]
pub fn crc32(bytes: &[u8]) -> u32 {
    crc32fast::hash(bytes)
}

/// CRC-32 of the file id followed by `bytes`: a leader of another file never matches.
#[must_use]
pub fn crc32_seeded(file_id: &[u8; 16], bytes: &[u8]) -> u32 {
    let mut hasher = Hasher::new();
    hasher.update(file_id);
    hasher.update(bytes);
    hasher.finalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test] // spec: GEN-4; C-03
    fn check_value_and_empty() {
        assert_eq!(crc32(b"123456789"), 0xCBF4_3926);
        assert_eq!(crc32(b""), 0);
        assert_eq!(crc32_seeded(b"0123456789abcdef", b"xyz"), crc32(b"0123456789abcdefxyz"));
    }
}
