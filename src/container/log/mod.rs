//! The log layout: a superblock that never changes, then records one after the other, each with a leader (spec chapter 15).
//!
//! | record | leader | content |
//! |---|---|---|
//! | brick | `VBRK`, [`Leader`](super::Leader) | payload and guard; CONSTANT: nothing |
//! | page, chunk, section | `VREC`, [`Record`] | the bytes, as in a head file |
//! | commit | `VREC` | a head of its own: superblock, section table, `VOLD`, `FNAM`, `PDIR`, trailer |
//!
//! The last whole commit owns the file. What lies behind it is what a writer did not finish.

mod commit;
mod forward;
mod locate;
mod record;
mod resume;
mod said;
mod walk;
mod write;

pub use commit::Commit;
pub use write::LogWriter;

pub(super) use commit::{CommitParts, FIRST_RECORD, check_commit_at};
pub(super) use locate::{Locate, Located};
pub(super) use record::{RECORD_BYTES, Record, RecordKind, section_key};
pub(super) use walk::{Item, Walk, Walked};
