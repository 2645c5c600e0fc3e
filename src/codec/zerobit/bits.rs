//! The two bit orders of the zerobit streams, and counting bits in them (spec chapter 14, §6).
//!
//! Flags of cells (CBFT) are counted from the least significant bit, everything in ZSMS from the most significant one.
//! Nothing outside this file shifts flags.

/// Counts set bits, by the machine or by the paper's table; both give the same.
pub trait BitCount: Copy {
    /// Set bits of a word of 64.
    fn count(self, word: u64) -> u32;
}

/// Counts with the machine's instruction, or what the compiler makes of it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Popcount;

impl BitCount for Popcount {
    #[inline(always)]
    fn count(self, word: u64) -> u32 {
        word.count_ones()
    }
}

/// Counts 16 bits per look-up in a table of 65,536 entries (§3.3 of the paper).
#[derive(Clone, Copy, Debug)]
pub struct CountTable<'a>(&'a [u8; 1 << 16]);

impl CountTable<'_> {
    /// The table's entries.
    #[must_use]
    pub fn entries() -> Box<[u8; 1 << 16]> {
        let mut table = vec![0u8; 1 << 16];
        for i in 1..1 << 16 {
            table[i] = table[i >> 1] + (i as u8 & 1);
        }
        table.try_into().expect("65,536 entries")
    }
}

impl<'a> CountTable<'a> {
    /// A counter over these entries.
    #[must_use]
    pub fn new(entries: &'a [u8; 1 << 16]) -> Self {
        CountTable(entries)
    }
}

impl BitCount for CountTable<'_> {
    #[inline(always)]
    fn count(self, mut word: u64) -> u32 {
        let mut n = 0;
        // As in the paper: only the words up to the last flag that counts are looked at.
        while word != 0 {
            n += u32::from(self.0[(word & 0xFFFF) as usize]);
            word >>= 16;
        }
        n
    }
}

/// Whether cell `n` (0 to 63) is stored. // spec: ZBT-14
#[inline(always)]
#[must_use]
pub const fn has_cell(cbft: u64, n: u32) -> bool {
    cbft >> (n & 63) & 1 == 1
}

/// The flags of the cells before cell `n`: their number is the cell's rank.
#[inline(always)]
#[must_use]
pub const fn cells_before(cbft: u64, n: u32) -> u64 {
    cbft & ((1 << (n & 63)) - 1)
}

/// Whether level-1 node `i` (1 to 8) has details. // spec: ZBT-17
#[inline(always)]
#[must_use]
pub const fn has_node(zerobits: u8, i: u32) -> bool {
    zerobits >> (8 - i) & 1 == 1
}

/// The zerobits of the level-1 nodes before node `i`.
#[inline(always)]
#[must_use]
pub const fn nodes_before(zerobits: u8, i: u32) -> u8 {
    // In 16 bits, since node 1 has none before it.
    (zerobits as u16 & (0xFF00 >> (i - 1))) as u8
}

/// The zerobit of node `i`, to be set.
#[must_use]
pub const fn node_bit(i: u32) -> u8 {
    1 << (8 - i)
}

/// Whether detail `j` (1 to 7) of a node with this map is stored. // spec: ZBT-18
#[inline(always)]
#[must_use]
pub const fn has_detail(map: u8, j: u32) -> bool {
    map >> (7 - j) & 1 == 1
}

/// The flags of the details before detail `j`.
#[inline(always)]
#[must_use]
pub const fn details_before(map: u8, j: u32) -> u8 {
    (map as u16 & 0x7F & (0xFF00 >> j)) as u8
}

/// All flags of details in a map, without the flag of its level.
#[inline(always)]
#[must_use]
pub const fn details(map: u8) -> u8 {
    map & 0x7F
}

/// The flag of detail `j`, to be set.
#[must_use]
pub const fn detail_bit(j: u32) -> u8 {
    1 << (7 - j)
}

/// Set in the map of a level-0 node. // spec: ZBT-19
pub const LEVEL_0: u8 = 0x80;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_two_bit_orders_differ() {
        // spec: ZBT-14
        assert!(has_cell(1, 0) && has_cell(1 << 63, 63) && !has_cell(1, 63));
        assert_eq!(cells_before(u64::MAX, 0), 0);
        assert_eq!(cells_before(u64::MAX, 63).count_ones(), 63);
        // spec: ZBT-17, ZBT-18
        let nodes: Vec<u32> = (1..=8).filter(|&i| has_node(0x28, i)).collect();
        assert_eq!(nodes, [3, 5], "28h: by the other order these were nodes 4 and 6");
        let details: Vec<u32> = (1..=7).filter(|&j| has_detail(0x35, j)).collect();
        assert_eq!(details, [2, 3, 5, 7]);
        assert_eq!(details_before(0xFF, 1), 0);
        assert_eq!(details_before(0xFF, 7), 0x7E);
        assert_eq!((1..=8).fold(0, |all, i| all | node_bit(i)), 0xFF);
        for i in 1..=8 {
            assert_eq!(nodes_before(0xFF, i).count_ones(), i - 1);
            assert!(!has_node(nodes_before(0xFF, i), i));
        }
        for j in 1..=7 {
            assert_eq!(details_before(0xFF, j).count_ones(), j - 1);
            assert!(has_detail(detail_bit(j), j) && details_before(detail_bit(j), j) == 0);
        }
    }

    #[test]
    fn table_and_instruction_count_alike() {
        let entries = CountTable::entries();
        let table = CountTable::new(&entries);
        let mut word = 0x9E37_79B9_7F4A_7C15u64;
        for _ in 0..1000 {
            assert_eq!(table.count(word), Popcount.count(word));
            word = word.rotate_left(7).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        }
        assert_eq!(table.count(u64::MAX), 64);
        assert_eq!(table.count(0), 0);
    }
}
