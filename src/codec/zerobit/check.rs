//! Strict validation of a payload (spec chapter 14, §10): what a writer must have done and a reader need not look at.

use super::bits;
use super::book::Book;
use super::layout::{CELL_EDGE, Layout, NEW_RECORD, OLD_RECORD, PREFIX_BYTES, UNIT_EDGE, Unit, Zerobits, byte, bytes};
use super::params::Stream;
use crate::error::{Code, Error, Result};

/// Checks a payload whose length is possible, in the order of the chapter. Offsets are relative to the payload.
// spec: ZBT-33
///
/// # Errors
/// `E_SIZE`, `E_RESERVED`, `E_CANON`, `E_OFFSET`, `E_NNNC`, `E_CODEBOOK_INDEX`, `E_PADDING`.
pub(super) fn check(stream: Stream, layout: &Layout, payload: &[u8], book: &Book) -> Result<()> {
    check_prefix(layout, payload)?;
    let count = layout.units.voxels() as usize;
    let mut next = PREFIX_BYTES + 4 * count;
    for index in 0..count {
        let at = PREFIX_BYTES + 4 * index;
        let entry = u32::from_le_bytes(bytes(payload, at));
        let (cells, base) = ((entry & 0xFF) as usize, 4 * (entry >> 8) as usize);
        let fail = |code, field, message| Err(Error::at(code, at as u64, field, message));
        // spec: ZBT-11
        if cells == 0 && entry != 0 {
            return fail(Code::Canon, "zerobit.directory", "a void unit block has a place; its entry must be 0".into());
        }
        if cells == 0 {
            continue;
        }
        if cells > 64 {
            return fail(Code::Nnnc, "zerobit.nnnc", format!("{cells} cells in a unit block of 64"));
        }
        // spec: ZBT-28
        if base != next {
            return fail(Code::Offset, "zerobit.directory", format!("the unit block lies at {base}, not at {next}"));
        }
        let unit = Unit { payload, base, cells };
        check_flags(layout, &unit, index)?;
        let end = match stream {
            Stream::New => check_new(&unit, book)?,
            Stream::Old => check_old(&unit, book)?,
        };
        next = end.next_multiple_of(4);
        // spec: ZBT-28
        if let Some(i) = (end..next).find(|&i| i >= payload.len() || byte(payload, i) != 0) {
            return Err(Error::at(
                Code::Padding,
                i as u64,
                "zerobit.padding",
                "padding to 4 bytes is not there, or not 0",
            ));
        }
    }
    if payload.len() != next {
        let message = format!("the payload has {} bytes, its unit blocks end at {next}", payload.len());
        return Err(Error::at(Code::Canon, next as u64, "zerobit.payload", message));
    }
    Ok(())
}

// spec: ZBT-10
fn check_prefix(layout: &Layout, payload: &[u8]) -> Result<()> {
    let (found, count) = (u32::from_le_bytes(bytes(payload, 4)), layout.units.voxels());
    if u64::from(found) != count {
        let message = format!("{found} unit blocks declared for a brick that has {count}");
        return Err(Error::at(Code::Size, 4, "zerobit.unit_count", message));
    }
    if bytes::<8>(payload, 8) != [0; 8] {
        return Err(Error::at(Code::Reserved, 8, "zerobit.reserved", "a reserved byte of the prefix is not 0"));
    }
    Ok(())
}

/// CBFT against NNNC, and no cell where the brick has no voxels.
fn check_flags(layout: &Layout, unit: &Unit<'_>, index: usize) -> Result<()> {
    let cbft = unit.cbft();
    let fail = |code, field, message| Err(Error::at(code, unit.base as u64, field, message));
    // spec: ZBT-14
    if cbft.count_ones() as usize != unit.cells {
        let message = format!("NNNC is {}, but {} cells are flagged", unit.cells, cbft.count_ones());
        return fail(Code::Nnnc, "zerobit.nnnc", message);
    }
    // spec: ZBT-27
    let [ux, uy] = [layout.units.x as usize, layout.units.y as usize];
    let place = [index % ux, index / ux % uy, index / ux / uy];
    let extent = layout.brick.to_array();
    let outside = (0..64u32).find(|&n| {
        let cell = [n & 3, n >> 2 & 3, n >> 4];
        let start = |a: usize| place[a] as u32 * UNIT_EDGE + cell[a] * CELL_EDGE;
        bits::has_cell(cbft, n) && (0..3).any(|a| start(a) >= extent[a])
    });
    match outside {
        Some(n) => fail(Code::Canon, "zerobit.cbft", format!("cell {n} lies outside the brick, yet is stored")),
        None => Ok(()),
    }
}

/// Offsets, zerobits, maps and indices of the new stream; returns where DIS ends.
fn check_new(unit: &Unit<'_>, book: &Book) -> Result<usize> {
    let payload = unit.payload;
    let (mut zerobit_offset, mut detail_offset) = (0, 0);
    for rank in 0..unit.cells {
        let at = (unit.base + 8 + 4 * rank) as u64;
        let offsets = unit.offsets(rank);
        let found = [offsets & 0xFFFF, offsets >> 16 & 0x7FFF];
        // spec: ZBT-16
        if found != [detail_offset, zerobit_offset] {
            let message = format!(
                "detail and zerobit offset {found:?} of stored cell {rank}, where {detail_offset} and {zerobit_offset} are due"
            );
            return Err(Error::at(Code::Offset, at, "zerobit.offsets", message));
        }
        let zerobits = Zerobits::read(unit, rank);
        for k in 0..zerobits.count() {
            let at = zerobits.maps + k as usize;
            let map = byte(payload, at);
            let level_0 = zerobits.level_0 && k == 0;
            // spec: ZBT-19, ZBT-29
            let fail = |message: &str| Err(Error::at(Code::Canon, at as u64, "zerobit.map", message.to_owned()));
            if (map & bits::LEVEL_0 != 0) != level_0 {
                return fail("the flag of the map's level is wrong");
            }
            if bits::details(map) == 0 {
                return fail("a node without details has a map: its zerobit must be 0");
            }
            detail_offset += bits::details(map).count_ones();
        }
        zerobit_offset += 1 + zerobits.count();
    }
    let averages = unit.base + 8 + 4 * unit.cells;
    check_indices(payload, averages, unit.cells, book.averages().len(), "average")?;
    let dis = unit.zsms() + zerobit_offset as usize;
    debug_assert_eq!(dis - unit.base, 8 + NEW_RECORD * unit.cells + zerobit_offset as usize);
    check_indices(payload, dis, detail_offset as usize, book.details().len(), "detail")?;
    Ok(dis + detail_offset as usize)
}

/// Flags, offsets and indices of the old stream; returns where the indices end.
// spec: ZBT-32
fn check_old(unit: &Unit<'_>, book: &Book) -> Result<usize> {
    let mut offset = 0;
    for rank in 0..unit.cells {
        let flags = unit.base + 8 + 8 * rank;
        let at = unit.base + 8 + 8 * unit.cells + 2 * rank;
        let cell = unit.old_cell_of_rank(rank);
        let found = usize::from(u16::from_le_bytes(bytes(unit.payload, at)));
        if found != offset {
            let message = format!("offset {found} of stored cell {rank}, where {offset} is due");
            return Err(Error::at(Code::Offset, at as u64, "zerobit.offsets", message));
        }
        if cell.flags == 0 {
            let message = "a stored cell has no coefficient; it must be null";
            return Err(Error::at(Code::Canon, flags as u64, "zerobit.flags", message));
        }
        let averages = (cell.flags & 1) as usize;
        let details = cell.flags.count_ones() as usize - averages;
        check_indices(unit.payload, cell.indices, averages, book.averages().len(), "average")?;
        check_indices(unit.payload, cell.indices + averages, details, book.details().len(), "detail")?;
        offset += averages + details;
    }
    Ok(unit.base + 8 + OLD_RECORD * unit.cells + offset)
}

// spec: ZBT-7
fn check_indices(payload: &[u8], start: usize, count: usize, words: usize, kind: &str) -> Result<()> {
    if count == 0 {
        return Ok(()); // no index lies anywhere
    }
    let field = || format!("zerobit.{kind}_index");
    let Some(indices) = payload.get(start..start + count) else {
        return Err(Error::at(Code::Offset, start as u64, field(), "the payload ends before its last index"));
    };
    match indices.iter().position(|&i| usize::from(i) >= words) {
        Some(i) => {
            let message = format!("index {} of a codebook of {words} {kind} words", indices[i]);
            Err(Error::at(Code::CodebookIndex, (start + i) as u64, field(), message))
        }
        None => Ok(()),
    }
}
