//! Bounds and child masks against what lies below (spec chapter 5).

use super::Strict;
use crate::container::node::{NODE_BYTES, value_bounds};
use crate::container::store::NodeStore;
use crate::container::{Node, NodeFlags, NodeKind, round_down_f32, round_up_f32};
use crate::error::{Code, Error};

impl Strict {
    /// Computes every node from its own brick and its children, and compares (spec: IDX-12, IDX-13).
    pub(super) fn check_bounds(&mut self) {
        let expected = self.expected_nodes();
        let mut errors = Vec::new();
        let ordinals: std::collections::BTreeSet<u64> =
            expected.pages.keys().chain(self.nodes.pages.keys()).copied().collect();
        for ordinal in ordinals {
            let level = self.head.octree.page_position(ordinal).1;
            for slot in 0..crate::container::PAGE_NODES {
                let (found, wanted) = (self.nodes.node(ordinal, slot), expected.node(ordinal, slot));
                if let Some((field, message)) = difference(found, wanted, level) {
                    let at = self.node_offset(ordinal, slot);
                    let field_offset = if field == "node.child_mask" { 18 } else { 20 };
                    errors.push(Error::at(Code::Canon, at.map_or(0, |at| at + field_offset), field, message));
                }
            }
        }
        for e in errors {
            self.report(e);
        }
    }

    /// The nodes as they should be: bounds of bricks as decoded, of CONSTANT bricks from their value, joined upwards.
    fn expected_nodes(&self) -> NodeStore {
        let d = &self.head.descriptor;
        let mut expected = NodeStore { pages: self.nodes.pages.clone() };
        for node in expected.pages.values_mut().flat_map(|page| page.iter_mut()) {
            match node.kind {
                NodeKind::Empty => *node = Node::EMPTY,
                NodeKind::Constant => {
                    if let Ok(value) = node.constant(d.sample_type) {
                        (node.min, node.max) = value_bounds(value);
                    }
                }
                NodeKind::Stored => {}
            }
        }
        for b in &self.bricks {
            if let Some((min, max)) = b.bounds {
                let node = &mut expected.page_mut(b.ordinal)[b.slot];
                (node.min, node.max) = (round_down_f32(min), round_up_f32(max));
            }
        }
        expected.join(&self.head.octree, d.null_sample());
        expected
    }

    /// Where a node lies in the file, if its page is stored.
    fn node_offset(&self, ordinal: u64, slot: usize) -> Option<u64> {
        self.page_entries.get(&ordinal).map(|entry| entry.offset + (slot * NODE_BYTES) as u64)
    }
}

fn difference(found: &Node, wanted: &Node, level: u8) -> Option<(&'static str, String)> {
    if found.child_mask != wanted.child_mask {
        let (a, b) = (found.child_mask, wanted.child_mask);
        return Some(("node.child_mask", format!("{a:#010b} instead of {b:#010b}: the children say otherwise")));
    }
    if (found.min.to_bits(), found.max.to_bits()) != (wanted.min.to_bits(), wanted.max.to_bits()) {
        let message = format!("[{}, {}] instead of [{}, {}]", found.min, found.max, wanted.min, wanted.max);
        return Some(("node.min", format!("bounds {message}, which the brick and its descendants have")));
    }
    let known = NodeFlags::ERROR_KNOWN;
    if found.flags.contains(known) != wanted.flags.contains(known)
        || found.max_error.to_bits() != wanted.max_error.to_bits()
    {
        return Some(("node.max_error", format!("{} is not what brick and descendants have", found.max_error)));
    }
    // spec: IDX-15
    let lossless = found.flags.contains(NodeFlags::LOSSLESS | known);
    if level == 0 && lossless && found.max_error != 0.0 {
        return Some(("node.max_error", format!("{} for a brick that is flagged as lossless", found.max_error)));
    }
    None
}
