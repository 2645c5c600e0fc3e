//! What does zerobit keep of real volumes, and for how many bits? Tables in Markdown, and a chart.
//!
//! `cargo bench --bench zerobit_quality [-- FILE-WORD... | --write docs/zerobit-quality.md | --stride N | --crop X0:X1,Y0:Y1,Z0:Z1]`
//!
//! The volumes lie in the folder that `VUG_DATA` names, else in `../shared/data`; those that do not are skipped. With
//! `--write` the page goes to that file and the chart beside it; without, the page goes to the standard output.
//! `--stride` and `--crop` say which voxels count for PSNR; volumes are encoded whole.

mod files;
mod measure;
mod page;
mod plot;

use files::Case;
use measure::{Part, Point, Variant};
use std::path::PathBuf;
use vug::Region;

/// The ratios of coefficients to keep, in per cent.
const KEEP: [u32; 6] = [1, 2, 3, 5, 7, 10];
/// Those at which encoders are compared.
const COMPARED: [u32; 2] = [3, 10];

/// One volume's results.
struct Results {
    case: Case,
    extent: String,
    sample_type: &'static str,
    range: (f64, f64),
    non_empty: f64,
    points: Vec<Point>,
    /// For each of [`COMPARED`]: the variants in the order of [`Variant::ALL`].
    compared: Vec<Vec<Point>>,
}

struct Arguments {
    words: Vec<String>,
    write: Option<PathBuf>,
    part: Part,
}

fn arguments() -> Result<Arguments, String> {
    let mut out = Arguments { words: Vec::new(), write: None, part: Part::default() };
    let mut rest = std::env::args().skip(1);
    while let Some(argument) = rest.next() {
        let mut value = || rest.next().ok_or(format!("{argument} wants a value"));
        match argument.as_str() {
            "--bench" => {} // cargo says so
            "--write" => out.write = Some(value()?.into()),
            "--stride" => {
                out.part.stride = value()?.parse().ok().filter(|&n| n > 0).ok_or("--stride wants a number above 0")?;
            }
            "--crop" => out.part.crop = Some(region(&value()?)?),
            word if word.starts_with('-') => return Err(format!("{word} is not known")),
            word => out.words.push(word.to_owned()),
        }
    }
    Ok(out)
}

/// `X0:X1,Y0:Y1,Z0:Z1`, ends excluded.
fn region(text: &str) -> Result<Region, String> {
    let mut region = Region { start: [0; 3], end: [0; 3] };
    let wrong = || format!("{text:?} is not X0:X1,Y0:Y1,Z0:Z1");
    let axes: Vec<_> = text.split(',').map(|axis| axis.split_once(':')).collect();
    if axes.len() != 3 {
        return Err(wrong());
    }
    for (a, axis) in axes.into_iter().enumerate() {
        let (start, end) = axis.ok_or_else(wrong)?;
        (region.start[a], region.end[a]) = (start.parse().map_err(|_| wrong())?, end.parse().map_err(|_| wrong())?);
    }
    Ok(region)
}

fn run(case: Case, part: &Part) -> vug::Result<Option<Results>> {
    let Some(mut grid) = case.load()? else { return Ok(None) };
    eprintln!("{}: {} {}", case.title, grid.extent(), grid.sample_type());
    let (extent, sample_type) = (grid.extent().to_string(), grid.sample_type().name());
    let mut source = measure::Source::new(&mut grid, *part)?;
    let (range, non_empty) = (source.range, source.non_empty_share());
    let default = Variant::ALL[0];
    let points = KEEP.iter().map(|&keep| source.both_streams(keep, default)).collect::<vug::Result<Vec<_>>>()?;
    let mut compared = Vec::new();
    for keep in COMPARED {
        let one = |variant| source.point(keep, variant);
        compared.push(Variant::ALL.into_iter().map(one).collect::<vug::Result<Vec<_>>>()?);
    }
    Ok(Some(Results { case, extent, sample_type, range, non_empty, points, compared }))
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments = arguments()?;
    let mut results = Vec::new();
    for case in files::cases() {
        if !arguments.words.is_empty() && !arguments.words.iter().any(|w| case.file.contains(w.as_str())) {
            continue;
        }
        let title = case.title;
        match run(case, &arguments.part)? {
            Some(result) => results.push(result),
            None => eprintln!("skipped: {title}: the file is not there; set VUG_DATA"),
        }
    }
    if results.is_empty() {
        return Ok(());
    }
    let Some(path) = arguments.write else {
        print!("{}", page::markdown(&results, &arguments.part, None));
        return Ok(());
    };
    let chart = path.with_extension("svg");
    std::fs::write(&chart, plot::svg(&results))?;
    let name = chart.file_name().map(|n| n.to_string_lossy().into_owned());
    std::fs::write(&path, page::markdown(&results, &arguments.part, name.as_deref()))?;
    eprintln!("wrote {} and {}", path.display(), chart.display());
    Ok(())
}
