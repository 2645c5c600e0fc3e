//! `vug encode`: a foreign volume becomes a `.vug` file.

use crate::cli::args::{
    CodecArg, DownsampleArg, Encode, EndpointsArg, Import, NanArg, NormArg, StreamArg, ThresholdArg, TrainingArg,
    ZerobitArgs,
};
use crate::cli::fetch;
use crate::cli::load::{check_import, import_options, is_vug, load};
use crate::cli::output::{Verdict, bytes_text, check_target, number, progress, psnr_text, small_text};
use crate::codec::s3dc::Endpoints;
use crate::codec::zerobit;
use crate::container::Downsample;
use crate::convert::{Format, ImportOptions, Kind};
use crate::error::{Error, Result};
use crate::geometry::Extent;
use crate::source::{AtomicFile, GrowingFile, is_url};
use crate::volume::{self, CodecChoice, EncodeOptions, EncodeReport, NonFinite, Quality, Selection, ZerobitOptions};
use crate::voxel::SampleType;
use serde_json::{Value, json};
use std::path::Path;

/// What zerobit keeps where nothing else is said, in millionths.
const DEFAULT_KEEP: u32 = 30_000;

pub(super) fn run(args: &Encode) -> Result<Verdict> {
    check(args)?;
    let import = import_options(&args.source, &args.import)?;
    let import = ImportOptions { memory: args.memory / 2, temp_dir: args.temp_dir.clone(), ..import };
    let mut source = fetch::import(&args.source, &import)?;
    if source.spooled > 0 && !args.common.quiet {
        eprintln!("note: {} of samples wait in a temporary file: memory has no room", bytes_text(source.spooled));
    }
    let mut options = options(args);
    if args.codec.is_none() && !is_zerobit(args) && source.reader.sample_type() == SampleType::Rgb8 {
        options.codec = CodecChoice::Auto; // s3dc is for scalars
    }
    let labels = args.labels || source.labels;
    if labels {
        options.downsample = Downsample::Nearest;
        // Who asks for another codec by name gets it.
        if args.labels || !(args.codec.is_some() || is_zerobit(args) || has_bound(args)) {
            options.codec = CodecChoice::Raw;
        }
    }
    if let Some(operator) = args.downsample {
        options.downsample = downsample(operator);
    }
    if let Some(mask) = &args.select {
        options.selection = Some(Selection::from_mask(&mut load(mask, &of_mask(mask, source.reader.extent()))?.grid)?);
    }
    options.placement = source.placement.clone();
    options.value_map = source.value_map;
    options.times = source.times.clone();
    options.meta = Some(meta(args, &source.header));
    options.scene = args.scene.as_deref().map(scene).transpose()?;
    let (extent, sample_type) = (source.reader.extent(), source.reader.sample_type());
    let (time_steps, channels) = source.reader.series();
    let to_stdout = is_stdout(&args.target);
    let bar = progress(args.common.quiet || args.common.json, "encoding");
    let mut advance = |done, total| {
        bar.set_length(total);
        bar.set_position(done);
    };
    let reader = &mut *source.reader;
    let report = if to_stdout {
        volume::encode_log(reader, std::io::stdout().lock(), &options, &mut advance)?
    } else if args.log {
        // Under its own name as soon as there is something to read, not in the end.
        let mut file = GrowingFile::create(&args.target, args.force)?;
        let report = volume::encode_log(reader, &mut file, &options, &mut advance)?;
        file.finish()?;
        report
    } else {
        let mut file = AtomicFile::create(&args.target, args.force)?;
        let report = volume::encode(reader, &mut file, &options, &mut advance)?;
        file.commit()?;
        report
    };
    bar.finish_and_clear();
    if to_stdout {
        // Standard output is the file.
    } else if args.common.json {
        let mut json = report_json(&report);
        json["dims"] = json!(extent.to_array());
        json["sample_type"] = json!(sample_type.name());
        (json["time_steps"], json["channels"]) = (json!(time_steps), json!(channels));
        println!("{json:#}");
    } else if !args.common.quiet {
        println!("{} → {}", args.source.display(), args.target.display());
        let trees = match (time_steps, channels) {
            (1, 1) => String::new(),
            (steps, channels) => format!(", {steps} time step(s), {channels} channel(s)"),
        };
        println!("volume      {extent} {sample_type} (x, y, z){trees}");
        print!("{}", report_text(&report));
    }
    let mut notes = report.notes;
    if source.labels && !args.labels {
        let how = if report.codec == "raw" { "stored without loss, " } else { "" };
        let levels = if args.levels == 1 { "" } else { "coarser levels take the nearest voxel" };
        let levels = if options.downsample == Downsample::Mean { "yet coarser levels mix them" } else { levels };
        let what = format!("{how}{levels}");
        notes.push(format!("the source says that it holds labels: {}", what.trim_end_matches(", ")));
    }
    for note in notes.iter().filter(|_| !args.common.quiet) {
        eprintln!("note: {note}");
    }
    Ok(Verdict::Ok)
}

/// The text of a scene file, which must be a scene that can lie in a file.
fn scene(path: &Path) -> Result<String> {
    let len = std::fs::metadata(path).map_err(|e| Error::io(path.display(), e))?.len();
    crate::limits::check("scene", len, crate::limits::MAX_SCENE_BYTES)?;
    let text = std::fs::read_to_string(path).map_err(|e| Error::io(path.display(), e))?;
    #[cfg(feature = "gpu")]
    crate::render::scene::SceneFile::parse_stored(&text)?;
    Ok(text)
}

fn is_stdout(target: &Path) -> bool {
    target == Path::new("-")
}

/// How a mask is read: `--shape` and `--dtype` are for the source. A raw mask has its shape, and a byte per voxel.
fn of_mask(mask: &Path, shape: Extent) -> Import {
    let raw = Format::of_path(mask) == Some(Format::Raw);
    Import { shape: raw.then_some(shape), dtype: raw.then(|| Kind::U8.into()), ..Import::default() }
}

/// What no codec would notice: a target that would destroy the source or mislead, options that have no effect.
fn check(args: &Encode) -> Result<()> {
    if !is_stdout(&args.target) {
        check_target(&args.source, &args.target)?;
    }
    let is_local = !is_url(&args.source.to_string_lossy()) && !is_stdout(&args.source);
    if is_local && !args.source.to_string_lossy().contains('#') {
        std::fs::metadata(&args.source).map_err(|e| Error::io(args.source.display(), e))?;
        if args.source.is_file() && is_vug(&args.source)? {
            let message = format!(
                "{} is a .vug file already: `vug repack`, `pack` and `extract` make others of it; to code it anew, decode it first",
                args.source.display()
            );
            return Err(Error::param("source", message));
        }
    }
    if is_stdout(&args.target) && args.common.json {
        return Err(Error::param("json", "standard output is the file; leave --json out"));
    }
    if let Some(format) = Format::of_path(&args.target).filter(|_| !is_stdout(&args.target)) {
        let is = if args.target.is_dir() { "is a folder, as of" } else { "has the ending of" };
        let message = format!("{} {is} {}; give the .vug file another name", args.target.display(), format.name());
        return Err(Error::param("target", message));
    }
    let s3dc_only = args.index_bits.is_some() || args.block.is_some() || args.endpoints == EndpointsArg::Fitted;
    if args.codec == Some(CodecArg::Raw) && s3dc_only {
        return Err(Error::param("codec", "raw has no index bits, blocks or end points; leave them out, or use s3dc"));
    }
    if is_zerobit(args) && s3dc_only {
        return Err(Error::param(
            "codec",
            "zerobit has no index bits, blocks or end points; leave them out, or use s3dc",
        ));
    }
    if args.labels
        && (matches!(args.codec, Some(codec) if codec != CodecArg::Raw)
            || is_zerobit(args)
            || s3dc_only
            || has_bound(args))
    {
        return Err(Error::param("labels", "labels are stored without loss: leave out codec, quality and end points"));
    }
    if args.labels && args.downsample == Some(DownsampleArg::Mean) {
        return Err(Error::param("downsample", "there is no mean of labels; leave one of both out"));
    }
    if args.downsample.is_some() && args.levels == 1 {
        return Err(Error::param("downsample", "there is one level only; ask for more (--levels auto)"));
    }
    if has_zerobit_options(&args.zerobit) && !is_zerobit(args) {
        let message = "--keep, --threshold, --norm, --training, --codebook-region and --stream are for --codec zerobit";
        return Err(Error::param("codec", message));
    }
    check_import(&[&args.source], &args.import)
}

/// Whether errors are bounded, or the rate is.
fn has_bound(args: &Encode) -> bool {
    args.max_error.is_some() || args.psnr.is_some() || args.rate.is_some()
}

fn downsample(operator: DownsampleArg) -> Downsample {
    match operator {
        DownsampleArg::Mean => Downsample::Mean,
        DownsampleArg::Min => Downsample::Min,
        DownsampleArg::Max => Downsample::Max,
        DownsampleArg::Nearest => Downsample::Nearest,
    }
}

fn has_zerobit_options(z: &ZerobitArgs) -> bool {
    let ZerobitArgs { keep, threshold, norm, training, codebook_region, stream } = z;
    keep.is_some()
        || threshold.is_some()
        || norm.is_some()
        || training.is_some()
        || codebook_region.is_some()
        || stream.is_some()
}

/// Whether zerobit was asked for, by name or by what only it has.
fn is_zerobit(args: &Encode) -> bool {
    args.codec == Some(CodecArg::Zerobit) || args.codec.is_none() && has_zerobit_options(&args.zerobit)
}

fn zerobit_options(z: &ZerobitArgs) -> ZerobitOptions {
    ZerobitOptions {
        stream: match z.stream {
            None | Some(StreamArg::New) => zerobit::Stream::New,
            Some(StreamArg::Old) => zerobit::Stream::Old,
        },
        threshold: match z.threshold {
            None | Some(ThresholdArg::Adaptive) => zerobit::Threshold::Adaptive,
            Some(ThresholdArg::Global) => zerobit::Threshold::Global,
        },
        norm: match z.norm {
            None | Some(NormArg::Energy) => zerobit::Norm::Energy,
            Some(NormArg::Plain) => zerobit::Norm::Plain,
        },
        training: match z.training {
            None | Some(TrainingArg::MedianCut) => zerobit::Training::MedianCut,
            Some(TrainingArg::Refined) => zerobit::Training::Refined,
        },
        codebook_region: z.codebook_region,
    }
}

fn options(args: &Encode) -> EncodeOptions {
    let bound = args.max_error.map(Quality::MaxError).or(args.psnr.map(Quality::Psnr)).or(args.rate.map(Quality::Rate));
    let keep = Quality::Keep(args.zerobit.keep.unwrap_or(DEFAULT_KEEP));
    let explicit =
        Quality::Explicit { index_bits: args.index_bits.unwrap_or(4), block: args.block.unwrap_or(Extent::cube(4)) };
    EncodeOptions {
        codec: match args.codec {
            Some(CodecArg::S3dc) => CodecChoice::S3dc,
            Some(CodecArg::Raw) => CodecChoice::Raw,
            Some(CodecArg::Auto) => CodecChoice::Auto,
            _ if is_zerobit(args) => CodecChoice::Zerobit,
            None if matches!(bound, Some(Quality::MaxError(_) | Quality::Psnr(_))) => CodecChoice::Auto,
            _ => CodecChoice::S3dc,
        },
        quality: bound.unwrap_or(if is_zerobit(args) { keep } else { explicit }),
        zerobit: zerobit_options(&args.zerobit),
        endpoints: match args.endpoints {
            EndpointsArg::Minmax => Endpoints::MinMax,
            EndpointsArg::Fitted => Endpoints::Fitted,
        },
        brick: args.brick,
        zstd: !args.no_zstd,
        levels: args.levels,
        non_finite: match args.nan {
            NanArg::Reject => NonFinite::Reject,
            NanArg::Null => NonFinite::Null,
        },
        null_value: args.null_value,
        memory: args.memory,
        temp_dir: args.temp_dir.clone(),
        file_id: args.file_id,
        ..EncodeOptions::default()
    }
}

/// The `META` section: what wrote the file, and what the source's header said unless it is to be dropped.
fn meta(args: &Encode, header: &Value) -> String {
    let mut meta = json!({ "generator": concat!("vug ", env!("CARGO_PKG_VERSION")) });
    if let Some(mask) = &args.select {
        // The file itself says it for zerobit only.
        meta["selected"] = json!(mask.file_name().map(|name| name.to_string_lossy()));
    }
    if !args.strip_metadata {
        meta["source"] = header.clone();
    }
    meta.to_string()
}

/// A report as JSON.
pub(super) fn report_json(r: &EncodeReport) -> Value {
    json!({
        "codec": r.codec,
        "index_bits": r.s3dc.map(|p| p.i_bits()),
        "block": r.s3dc.map(|p| p.block().to_array()),
        "keep": r.zerobit.map(|p| f64::from(p.keep_ppm()) / 1e6),
        "codebooks": r.codebooks,
        "selected_voxels": r.selected,
        "max_error": r.max_error,
        "mean_error": r.mean_error,
        "rmse": r.rmse,
        "psnr": r.psnr.map(number),
        "range": [r.source_range.0, r.source_range.1],
        "ratio": { "formula": r.ratio_formula.map(number), "payload": number(r.ratio_payload), "file": number(r.ratio_file) },
        "bits_per_voxel": number(r.bits_per_voxel),
        "bytes": r.bytes,
        "bricks": { "stored": r.bricks[0], "constant": r.bricks[1], "empty": r.bricks[2] },
        "replaced": r.replaced,
        "notes": r.notes,
    })
}

fn report_text(r: &EncodeReport) -> String {
    let codec = match (r.s3dc, r.zerobit) {
        (_, Some(p)) => format!(
            "zerobit, {:.4} % kept, {} thresholds, {} norm, {} codebook(s), {}",
            f64::from(p.keep_ppm()) / 1e4,
            p.threshold.name(),
            p.norm.name(),
            r.codebooks,
            p.training.name()
        ),
        (Some(p), _) => format!("s3dc, {} bits, blocks of {}, {}", p.i_bits(), p.block(), p.endpoints().name()),
        (None, None) if r.selected.is_some() => "raw (lossless where selected)".into(),
        (None, None) => "raw (lossless)".into(),
    };
    let ratio = |v: f64| if v.is_finite() { format!("{v:.3}") } else { "-".into() };
    format!(
        "codec       {codec}\n\
         bricks      {} stored, {} constant, {} empty\n\
         size        {} ({:.3} bits per voxel)\n\
         ratio       {} formula, {} payload, {} file\n\
         max error   {}\n\
         mean error  {}\n\
         RMSE        {}\n\
         PSNR        {}\n",
        r.bricks[0],
        r.bricks[1],
        r.bricks[2],
        bytes_text(r.bytes),
        r.bits_per_voxel,
        r.ratio_formula.map_or("-".into(), ratio),
        ratio(r.ratio_payload),
        ratio(r.ratio_file),
        r.max_error,
        small_text(r.mean_error),
        small_text(r.rmse),
        psnr_text(r.psnr, r.max_error == 0.0),
    ) + &r.selected.map_or(String::new(), |n| {
        format!("selected    {n} voxels: errors are of these, all others are the null value now\n")
    })
}
