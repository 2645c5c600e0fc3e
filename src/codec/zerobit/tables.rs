//! Codebooks as the fast decoders read them: always 256 words of a kind, in forms that add whole words at once.

use super::book::Word;

/// Bits of a component in a packed word. Fifteen words of any codebook, added and subtracted, stay within: at most
/// 65,535 + 14 · 32,768 < 2^20.
const FIELD: u32 = 21;

/// The words of a codebook; those that are not there are 0.
#[derive(Clone, PartialEq, Eq)]
pub(super) struct Tables {
    /// Averages, packed: three signed components in one number, `c0 + c1 · 2^21 + c2 · 2^42`, so that words are added and
    /// negated as numbers.
    pub(super) average: Box<[i64; 256]>,
    /// Details, packed.
    pub(super) detail: Box<[i64; 256]>,
    /// Averages, a component per lane, the last lane 0. Components of 16 bits do not fit: all 0.
    pub(super) average_lanes: Box<[[i16; 4]; 256]>,
    /// Details in lanes.
    pub(super) detail_lanes: Box<[[i16; 4]; 256]>,
    /// Details of 8 bits, a table per component, signed; of 16 bits: all 0.
    pub(super) detail_planes: Box<[[[u8; 64]; 4]; 3]>,
}

impl std::fmt::Debug for Tables {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Tables")
    }
}

impl Tables {
    pub(super) fn new(average: &[Word], detail: &[Word]) -> Self {
        let packed = |words: &[Word]| {
            let mut table = Box::new([0; 256]);
            table.iter_mut().zip(words).for_each(|(to, &word)| *to = pack(word));
            table
        };
        let lanes = |words: &[Word]| {
            let mut table = Box::new([[0; 4]; 256]);
            for (to, word) in table.iter_mut().zip(words) {
                for (to, &v) in to.iter_mut().zip(word) {
                    *to = i16::try_from(v).unwrap_or(0);
                }
            }
            table
        };
        let mut detail_planes = Box::new([[[0; 64]; 4]; 3]);
        for (i, word) in detail.iter().enumerate().take(256) {
            for (plane, &v) in detail_planes.iter_mut().zip(word) {
                plane[i / 64][i % 64] = i8::try_from(v).unwrap_or(0).cast_unsigned();
            }
        }
        Tables {
            average: packed(average),
            detail: packed(detail),
            average_lanes: lanes(average),
            detail_lanes: lanes(detail),
            detail_planes,
        }
    }
}

/// Three components as one number.
pub(super) const fn pack(word: Word) -> i64 {
    word[0] as i64 + ((word[1] as i64) << FIELD) + ((word[2] as i64) << (2 * FIELD))
}

/// The components of a number.
#[inline(always)]
pub(super) const fn unpack(packed: i64) -> Word {
    const fn field(v: i64) -> i32 {
        (v << (64 - FIELD) >> (64 - FIELD)) as i32
    }
    let c0 = field(packed);
    let rest = (packed - c0 as i64) >> FIELD;
    let c1 = field(rest);
    [c0, c1, ((rest - c1 as i64) >> FIELD) as i32]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_of_packed_words_are_packed_sums() {
        // K-37: no carry runs from one component into the next.
        let words = [[255, 0, 255], [-128, 127, -128], [127, -128, 127], [65535, -1, 3], [-32768, 32767, -32768]];
        let mut sum = [0i32; 3];
        let mut packed = 0;
        for round in 0..3 {
            for word in words {
                let sign = if round == 1 { -1 } else { 1 };
                packed += i64::from(sign) * pack(word);
                sum = std::array::from_fn(|c| sum[c] + sign * word[c]);
                assert_eq!(unpack(packed), sum);
            }
        }
    }
}
