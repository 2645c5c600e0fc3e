//! `vug recover`: what is whole of a damaged or unfinished file.

use crate::cli::args::Recover;
use crate::cli::open::open_source;
use crate::cli::output::{Verdict, bytes_text, check_target, error_json, progress};
use crate::container::VolumeDescriptor;
use crate::error::Result;
use crate::geometry::{Coord, Extent};
use crate::limits::Limits;
use crate::source::AtomicFile;
use crate::volume::{At, Recovered, recover};
use serde_json::{Value, json};

pub(super) fn run(args: &Recover) -> Result<Verdict> {
    check_target(&args.source, &args.target)?;
    let source = open_source(&args.source)?;
    let mut file = AtomicFile::create(&args.target, args.force)?;
    let bar = progress(args.common.quiet || args.common.json, "recovering");
    let (_, found) = recover(source, Limits::default(), &mut file, &mut |done, total| {
        bar.set_length(total);
        bar.set_position(done);
    })?;
    file.commit()?;
    bar.finish_and_clear();
    if args.common.json {
        println!("{:#}", to_json(&found));
    } else {
        if !args.common.quiet {
            println!("{} → {}", args.source.display(), args.target.display());
            print!("{}", to_text(&found));
        }
        found.damage.iter().for_each(|e| eprintln!("damaged: {e}"));
        for (at, brick, error) in &found.lost {
            eprintln!("lost: {}, brick {brick:?}: {error}", name(*at));
        }
        if !found.lost.is_empty() {
            eprintln!("{} bricks are lost", found.lost.len());
        }
    }
    Ok(if found.is_whole() { Verdict::Ok } else { Verdict::Bad })
}

fn to_json(found: &Recovered) -> Value {
    let place = |at: At, [x, y, z]: Coord| json!({ "time": at.time, "channel": at.channel, "level": at.lod, "brick": [x, y, z] });
    let live: Vec<Value> = found.live.iter().map(|&(at, brick)| place(at, brick)).collect();
    let lost = found.lost.iter().map(|(at, brick, error)| {
        let mut json = place(*at, *brick);
        json["error"] = error_json(error);
        json
    });
    let file = &found.file;
    json!({
        "commit": found.commit.map(|c| json!({ "generation": c.generation, "offset": c.offset, "end": c.end })),
        "bytes": file.len,
        "bricks": { "stored": file.stored, "constant": file.constant, "empty": file.empty },
        "by_leader": found.by_leader,
        "beyond_last_commit": found.beyond,
        "live": live,
        "lost": lost.collect::<Vec<Value>>(),
        "damage": found.damage.iter().map(error_json).collect::<Vec<Value>>(),
    })
}

fn to_text(found: &Recovered) -> String {
    let (d, file) = (&found.descriptor, &found.file);
    let mut text = format!(
        "volume      {} {} (x, y, z), {} level(s), {} time step(s), {} channel(s)\n",
        d.dims, d.sample_type, d.lod_count, d.time_steps, d.channels
    );
    if let Some(commit) = found.commit {
        text += &format!("commit      {}, which ends at byte {}\n", commit.generation, commit.end);
    }
    text += &format!("bricks      {} stored, {} constant, {} empty\n", file.stored, file.constant, file.empty);
    if found.by_leader > 0 {
        text += &format!("            {} of them were found without the index\n", found.by_leader);
    }
    if found.beyond > 0 {
        text += &format!("            {} more are of time steps that were not finished, and left out\n", found.beyond);
    }
    for group in found.live.chunk_by(|a, b| a.0 == b.0) {
        let at = group[0].0;
        let grid = bricks(d, at.lod);
        text +=
            &format!("live        {}: {} of {} bricks: {}\n", name(at), group.len(), grid.voxels(), runs(group, grid));
    }
    text + &format!("size        {}\n", bytes_text(file.len))
}

fn name(at: At) -> String {
    format!("time step {}, channel {}, level {}", at.time, at.channel, at.lod)
}

/// Bricks of a level per axis.
fn bricks(d: &VolumeDescriptor, lod: u8) -> Extent {
    d.dims.at_lod(lod).div_ceil(Extent::cube(1 << d.brick_log2))
}

/// Bricks as runs of neighbours, x fastest, then y, then z: `0,0,0 to 3,1,0; 2,2,0`.
fn runs(group: &[(At, Coord)], grid: Extent) -> String {
    let next = |a: &(At, Coord), b: &(At, Coord)| grid.index(a.1) + 1 == grid.index(b.1);
    let show = |[x, y, z]: Coord| format!("{x},{y},{z}");
    let runs = group.chunk_by(next).map(|run| match run {
        [one] => show(one.1),
        [first, .., last] => format!("{} to {}", show(first.1), show(last.1)),
        [] => String::new(),
    });
    runs.collect::<Vec<_>>().join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_are_told_as_runs() {
        let at = At::default();
        let group = [[1, 0, 0], [2, 0, 0], [0, 1, 0], [2, 1, 0]].map(|c| (at, c));
        assert_eq!(runs(&group, Extent::new(3, 2, 1)), "1,0,0 to 0,1,0; 2,1,0");
    }
}
