//! Folding: a level that is longer than a 3D texture may be is cut into tiles of bricks, which are laid side by side along
//! the other axes.
//!
//! ```text
//! t = brick / tile;  n = t.x + tiles.x·(t.y + tiles.y·t.z)
//! place = (n mod grid.x, n / grid.x mod grid.y, n / (grid.x·grid.y));  folded = place·tile + brick mod tile
//! ```

/// How bricks of a level are placed in its textures. Counted in bricks, so that all textures of a level share it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fold {
    /// Bricks of a tile, per axis.
    pub tile: [u32; 3],
    /// Tiles of the level, per axis.
    pub tiles: [u32; 3],
    /// Tiles of the textures, per axis; room for at least as many as the level has.
    pub grid: [u32; 3],
}

impl Fold {
    /// The placement of `bricks` where textures hold at most `most` bricks per axis; `None` where they hold too few.
    ///
    /// Of all placements with the fewest tiles the one with the least unused room.
    #[must_use]
    pub fn new(bricks: [u32; 3], most: [u32; 3]) -> Option<Fold> {
        if most.contains(&0) || bricks.contains(&0) {
            return None;
        }
        let tiles: [u32; 3] = std::array::from_fn(|a| bricks[a].div_ceil(most[a]));
        let tile: [u32; 3] = std::array::from_fn(|a| bricks[a].div_ceil(tiles[a]));
        let count = tiles.iter().try_fold(1u64, |n, &t| n.checked_mul(u64::from(t)))?;
        let room: [u64; 3] = std::array::from_fn(|a| u64::from(most[a] / tile[a]).min(count));
        let mut best: Option<[u64; 3]> = None;
        for x in 1..=room[0] {
            for y in 1..=room[1].min(count.div_ceil(x)) {
                let z = count.div_ceil(x * y);
                if z <= room[2] && best.is_none_or(|b| x * y * z < b.iter().product()) {
                    best = Some([x, y, z]);
                }
            }
        }
        #[allow(clippy::cast_possible_truncation, reason = "each is at most `most`, which is u32")]
        best.map(|grid| Fold { tile, tiles, grid: grid.map(|v| v as u32) })
    }

    /// Whether bricks lie where they do in the level, so that a texture unit may filter across them.
    #[must_use]
    pub const fn is_flat(&self) -> bool {
        matches!(self.tiles, [1, 1, 1])
    }

    /// Where a brick of the level lies, in bricks of the textures.
    #[must_use]
    pub fn place(&self, brick: [u32; 3]) -> [u32; 3] {
        let t: [u32; 3] = std::array::from_fn(|a| brick[a] / self.tile[a]);
        let n = t[0] + self.tiles[0] * (t[1] + self.tiles[1] * t[2]);
        let grid = self.grid;
        let place = [n % grid[0], n / grid[0] % grid[1], n / (grid[0] * grid[1])];
        std::array::from_fn(|a| place[a] * self.tile[a] + brick[a] % self.tile[a])
    }

    /// Bricks of the textures, per axis.
    #[must_use]
    pub fn bricks(&self) -> [u32; 3] {
        std::array::from_fn(|a| self.grid[a] * self.tile[a])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn bricks_that_fit_lie_where_they_are() {
        let fold = Fold::new([5, 3, 2], [5, 8, 2]).unwrap();
        assert!(fold.is_flat());
        assert_eq!((fold.place([4, 2, 1]), fold.bricks()), ([4, 2, 1], [5, 3, 2]));
    }

    #[test] // hard case: D-59
    fn every_brick_has_a_place_of_its_own_within_the_limits() {
        let cases =
            [([1094, 1, 1], [4, 4, 70]), ([7, 11, 3], [3, 4, 40]), ([1, 1, 100], [5, 5, 5]), ([9, 9, 9], [10, 9, 10])];
        for (bricks, most) in cases {
            let fold = Fold::new(bricks, most).unwrap();
            let size = fold.bricks();
            assert!((0..3).all(|a| size[a] <= most[a]), "{fold:?}");
            let mut seen = HashSet::new();
            for z in 0..bricks[2] {
                for y in 0..bricks[1] {
                    for x in 0..bricks[0] {
                        let p = fold.place([x, y, z]);
                        assert!((0..3).all(|a| p[a] < size[a]) && seen.insert(p), "{fold:?} {p:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn what_has_no_room_is_refused() {
        assert_eq!(Fold::new([65, 1, 1], [4, 4, 4]), None);
        assert!(Fold::new([64, 1, 1], [4, 4, 4]).is_some());
        assert_eq!(Fold::new([1, 1, 1], [0, 4, 4]), None);
        assert_eq!(Fold::new([u32::MAX; 3], [1; 3]), None);
    }
}
