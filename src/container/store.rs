//! All nodes of a file in memory, by page: memory follows the bricks there are, not the dims (spec chapter 5).

use super::directory::PAGE_NODES;
use super::node::value_bounds;
use super::{Node, NodeFlags, NodeKind, Octree};
use crate::error::{Code, Error, Result};
use crate::geometry::{Coord, unmorton8};
use crate::voxel::SampleValue;
use std::collections::BTreeMap;

/// Pages by ordinal. A page that is absent is all EMPTY.
#[derive(Debug, Default)]
pub(super) struct NodeStore {
    pub(super) pages: BTreeMap<u64, Box<[Node]>>,
}

/// Nodes by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Counts {
    pub(super) stored: u64,
    pub(super) constant: u64,
}

impl NodeStore {
    /// The page with this ordinal, made if it is absent.
    pub(super) fn page_mut(&mut self, ordinal: u64) -> &mut [Node] {
        self.pages.entry(ordinal).or_insert_with(|| vec![Node::EMPTY; PAGE_NODES].into())
    }

    pub(super) fn node(&self, ordinal: u64, slot: usize) -> &Node {
        self.pages.get(&ordinal).map_or(&Node::EMPTY, |page| &page[slot])
    }

    /// Puts a node where no other is yet.
    ///
    /// # Errors
    /// `E_RANGE` where the brick does not exist, `E_DUP` where it has been put before.
    pub(super) fn put(
        &mut self,
        octree: &Octree,
        tree: u32,
        level: u8,
        brick: Coord,
        node: Node,
    ) -> Result<(u64, usize)> {
        if !octree.contains(tree, level, brick) {
            let message =
                format!("tree {tree}, level {level}, brick {brick:?} (x, y, z) does not exist in this volume");
            return Err(Error::new(Code::Range, "brick", message));
        }
        let (ordinal, slot) = octree.locate(tree, level, brick);
        let place = &mut self.page_mut(ordinal)[slot];
        if place.kind != NodeKind::Empty {
            let message = format!("tree {tree}, level {level}, brick {brick:?} (x, y, z) was written before");
            return Err(Error::new(Code::Dup, "brick", message));
        }
        *place = node;
        Ok((ordinal, slot))
    }

    pub(super) fn counts(&self) -> Counts {
        let mut counts = Counts::default();
        for node in self.pages.values().flatten() {
            match node.kind {
                NodeKind::Stored => counts.stored += 1,
                NodeKind::Constant => counts.constant += 1,
                NodeKind::Empty => {}
            }
        }
        counts
    }

    /// Sets child masks and makes the bounds of every node include its descendants (spec: IDX-12, IDX-13).
    ///
    /// Joining twice changes nothing.
    pub(super) fn join(&mut self, octree: &Octree, null: SampleValue) {
        let empty = Bounds::of_value(null);
        for tree in self.trees(octree) {
            for level in 1..octree.levels.len() {
                #[allow(clippy::cast_possible_truncation, reason = "at most 22 levels")]
                self.join_level(octree, tree, level as u8, empty);
            }
        }
        self.pages.retain(|_, page| page.iter().any(|n| !n.is_empty_subtree()));
    }

    /// The trees that have pages, ascending: found by jumping from one to the next, not by looking at every page.
    fn trees(&self, octree: &Octree) -> Vec<u32> {
        let (mut trees, mut next) = (Vec::new(), 0);
        while let Some((&ordinal, _)) = self.pages.range(next..).next() {
            let tree = ordinal / octree.pages_per_tree;
            trees.push(u32::try_from(tree).expect("an ordinal below the page count"));
            next = (tree + 1) * octree.pages_per_tree;
        }
        trees
    }

    /// A copy of the pages of one tree.
    pub(super) fn tree(&self, octree: &Octree, tree: u32) -> NodeStore {
        let first = u64::from(tree) * octree.pages_per_tree;
        let pages = self.pages.range(first..first + octree.pages_per_tree);
        NodeStore { pages: pages.map(|(&ordinal, page)| (ordinal, page.clone())).collect() }
    }

    fn join_level(&mut self, octree: &Octree, tree: u32, level: u8, empty: Bounds) {
        let below = level_range(octree, tree, level - 1);
        // Eight children lie side by side in one page, and the 64 parents of a page in one octant of theirs.
        let parents: Vec<u64> = self
            .pages
            .range(below)
            .filter(|(_, page)| page.iter().any(|n| !n.is_empty_subtree()))
            .map(|(&ordinal, _)| octree.page_ordinal(tree, level, octree.page_position(ordinal).2.map(|v| v / 2)))
            .collect();
        for ordinal in parents {
            self.page_mut(ordinal);
        }
        let here: Vec<u64> = self.pages.range(level_range(octree, tree, level)).map(|(&o, _)| o).collect();
        for ordinal in here {
            self.join_page(octree, tree, level, ordinal, empty);
        }
    }

    fn join_page(&mut self, octree: &Octree, tree: u32, level: u8, ordinal: u64, empty: Bounds) {
        let (_, _, page) = octree.page_position(ordinal);
        let bricks = octree.levels[usize::from(level)].bricks;
        let below = octree.levels[usize::from(level) - 1].bricks;
        for slot in 0..PAGE_NODES {
            let local = unmorton8(slot);
            let brick: Coord = std::array::from_fn(|a| page[a] * 8 + local[a]);
            if !bricks.contains(brick) {
                continue;
            }
            let mut node = *self.node(ordinal, slot);
            let mut bounds = if node.kind == NodeKind::Empty { empty } else { Bounds::of_node(&node) };
            node.child_mask = 0;
            for child in 0..8u32 {
                let at: Coord = std::array::from_fn(|a| brick[a] * 2 + (child >> a & 1));
                if !below.contains(at) {
                    continue;
                }
                let (o, s) = octree.locate(tree, level - 1, at);
                let child_node = self.node(o, s);
                if child_node.is_empty_subtree() {
                    bounds = bounds.join(empty);
                } else {
                    bounds = bounds.join(Bounds::of_node(child_node));
                    node.child_mask |= 1 << child;
                }
            }
            if !node.is_empty_subtree() {
                bounds.write(&mut node);
                self.page_mut(ordinal)[slot] = node;
            }
        }
    }
}

/// Ordinals of the pages of one level of one tree.
fn level_range(octree: &Octree, tree: u32, level: u8) -> std::ops::Range<u64> {
    let first = octree.page_ordinal(tree, level, [0; 3]);
    first..first + octree.levels[usize::from(level)].pages.voxels()
}

/// Value bounds, and the error if it is known.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Bounds {
    min: f32,
    max: f32,
    max_error: Option<f32>,
}

impl Bounds {
    /// EMPTY bricks are the null value, exactly.
    fn of_value(value: SampleValue) -> Self {
        let (min, max) = value_bounds(value);
        Bounds { min, max, max_error: Some(0.0) }
    }

    fn of_node(n: &Node) -> Self {
        let max_error = n.flags.contains(NodeFlags::ERROR_KNOWN).then_some(n.max_error);
        Bounds { min: n.min, max: n.max, max_error }
    }

    fn join(self, o: Bounds) -> Self {
        Bounds {
            min: self.min.min(o.min),
            max: self.max.max(o.max),
            max_error: self.max_error.zip(o.max_error).map(|(a, b)| a.max(b)),
        }
    }

    fn write(self, n: &mut Node) {
        (n.min, n.max) = (self.min, self.max);
        n.max_error = self.max_error.unwrap_or(0.0);
        let own = NodeFlags(n.flags.0 & NodeFlags::IN_LEADER);
        n.flags = if self.max_error.is_some() { own | NodeFlags::ERROR_KNOWN } else { own };
    }
}
