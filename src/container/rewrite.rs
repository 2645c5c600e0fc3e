//! A strictly valid file, taken apart and written again: the same bytes, or, of a log, the head file of the same content
//! (spec chapters 3 and 9).

use super::assemble::content_id;
use super::directory::write_refs;
use super::kept::check_editable;
use super::section::SectionFlags;
use super::strict::{Read, Strict};
use super::{BrickSink, FileSummary, FileWriter, FinishOptions, NodeKind};
use crate::error::Result;
use crate::geometry::unmorton8;
use crate::limits::Limits;
use std::io::{Seek, Write};

/// Writes the file of `len` bytes that `read` delivers into `out`, brick by brick in the same order. Payloads are copied as
/// they are stored.
///
/// Sections that this version does not know are kept if they are COPY_SAFE, else dropped (spec: SEC-11). Where none is
/// dropped and the file is strictly valid and of this minor version, the bytes are the same (spec: VAL-11).
///
/// # Errors
/// The first error of strict validation of the structure; `E_FEATURE` where an editor must know a feature that this one
/// does not (spec: VER-3); `E_SOURCE`.
pub fn rewrite<W: Write + Seek>(len: u64, limits: &Limits, read: &mut Read<'_>, out: W) -> Result<(W, FileSummary)> {
    let mut strict = Strict::open(len, limits, read)?;
    if !strict.errors.is_empty() {
        return Err(strict.errors.swap_remove(0));
    }
    let Strict { head, nodes, others, codebooks, times, .. } = &strict;
    check_editable(head)?;
    let mut writer = FileWriter::new(out, &head.descriptor)?;
    for brick in strict.bricks() {
        let window = brick.window();
        #[allow(clippy::cast_possible_truncation, reason = "a payload is at most 64 MiB")]
        let bytes = read(window.start, (window.end - window.start) as usize)?;
        let payload = strict.check_brick(brick, &bytes)?;
        writer.put_stored(brick.tree, brick.level, brick.brick, &brick.node, payload)?;
    }
    for (&ordinal, page) in &nodes.pages {
        let (tree, level, position) = head.octree.page_position(ordinal);
        for (slot, node) in page.iter().enumerate().filter(|(_, n)| n.kind == NodeKind::Constant) {
            let local = unmorton8(slot);
            let brick = std::array::from_fn(|a| position[a] * 8 + local[a]);
            writer.put_constant(tree, level, brick, node)?;
        }
    }
    // An id that followed from the content follows from the new content; one that was given stays. That of a log says
    // nothing of its content.
    let codebooks = codebooks.as_ref().map(|s| (s.bytes.clone(), s.entry.item_count));
    let books = codebooks.as_ref().map_or(&[][..], |c| &c.0);
    let derived = content_id(&head.descriptor.write_to(), &write_refs(&head.directory), books);
    let given = head.commit.is_none() && derived != head.superblock.file_id;
    let options = FinishOptions {
        meta: None,
        times: times.clone(),
        file_id: given.then_some(head.superblock.file_id),
        optional: head.superblock.optional,
        feature_names: head.feature_names.clone(),
        codebooks,
        extra: others.iter().filter(|s| s.entry.flags.contains(SectionFlags::COPY_SAFE)).cloned().collect(),
    };
    writer.finish(&head.descriptor, options)
}
