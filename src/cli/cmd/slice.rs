//! `vug slice`: one plane as a picture.

use crate::cli::args::Slice;
use crate::cli::load::{check_import, load_plane};
use crate::cli::output::{Verdict, write_file};
use crate::cli::picture::{ColorMap, Picture, difference, legend, scaled, slice, spacing_on_screen, stacked};
use crate::error::{Error, Result};
use crate::metrics::value_range;
use crate::volume::At;
use serde_json::json;

/// Pictures smaller than this are enlarged by whole numbers, so that voxels can be seen.
const SMALL: u32 = 256;

pub(super) fn run(args: &Slice) -> Result<Verdict> {
    let others = args.against.iter().map(|p| p.as_path());
    check_import(&std::iter::once(&*args.file).chain(others).collect::<Vec<_>>(), &args.import)?;
    if args.against.is_some() && args.level > 0 {
        return Err(Error::param("level", "a coarser level cannot be compared with the source; use level 0"));
    }
    let map: ColorMap = args.colormap.as_deref().map(str::parse).transpose()?.unwrap_or_default();
    let at = At { time: args.time, channel: args.channel, lod: args.level };
    let (loaded, index) = load_plane(&args.file, &args.import, at, args.axis, args.index)?;
    let view = loaded.plane.view();
    let (picture, window) = match &args.against {
        None => {
            let window = args.range.or_else(|| value_range(&view)).unwrap_or((0.0, 1.0));
            (slice(&view, args.axis, window, &map)?, Some(window))
        }
        Some(source) => {
            let (source, _) = load_plane(source, &args.import, At { lod: 0, ..at }, args.axis, Some(index))?;
            let (lo, hi) = source.volume_range;
            (difference(&source.plane.view(), &view, args.axis, hi - lo)?, None)
        }
    };
    let pixel = if args.no_aspect { (1.0, 1.0) } else { spacing_on_screen(args.axis, loaded.placement.spacing()) };
    let (w, h) = picture.size();
    let mut picture: Picture = scaled(&picture, pixel, (SMALL / w.max(h)).max(1))?;
    if args.against.is_some() {
        picture = stacked(&[picture.clone(), legend(picture.size().0)?], 0, [255; 3])?;
    }
    let (width, height) = picture.size();
    if args.output.extension().is_none_or(|e| !e.eq_ignore_ascii_case("png")) {
        return Err(Error::param("output", format!("{} does not end in .png", args.output.display())));
    }
    write_file(&args.output, args.force, &picture.to_png()?)?;
    let axis = ["x", "y", "z"][args.axis as usize];
    if args.common.json {
        let window = window.map(|(lo, hi)| [lo, hi]);
        println!("{:#}", json!({ "axis": axis, "index": index, "window": window, "width": width, "height": height }));
    } else if !args.common.quiet {
        let shown = window.map_or_else(|| "difference classes".into(), |(lo, hi)| format!("window {lo} … {hi}"));
        println!("{}: {axis} = {index}, {width}×{height} pixels, {shown}", args.output.display());
    }
    Ok(Verdict::Ok)
}
