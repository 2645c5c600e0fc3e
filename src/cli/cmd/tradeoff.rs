//! `vug tradeoff`: what accuracy costs in time, on the user's volume.

mod page;
mod subject;
mod table1;
mod view;

use crate::cli::args::Tradeoff;
use crate::cli::load::check_import;
use crate::cli::output::{Verdict, number, progress, write_file};
use crate::cli::picture::Picture;
use crate::cli::report::{Page, Piece};
use crate::error::{Error, Result};
use crate::grid::Grid;
use crate::tradeoff::{self, Outcome, Row, Setting, Sweep, paper};
use serde_json::{Value, json};
use subject::{Subject, subjects};
use view::Photographer;

pub(super) fn run(args: &Tradeoff) -> Result<Verdict> {
    let dir = &args.output;
    let page = dir.join("index.html");
    if page.exists() && !args.force {
        let message = format!("{} exists; give another folder, or --force to overwrite it", page.display());
        return Err(Error::param("output", message));
    }
    check_import(&args.source.iter().map(|p| p.as_path()).collect::<Vec<_>>(), &args.import)?;
    let sweep = sweep_of(args)?;
    sweep.check()?;
    let photographer = Photographer::new(args)?;
    std::fs::create_dir_all(dir.join("images")).map_err(|e| Error::io(dir.display(), e))?;
    let (mut sections, mut summary) = (Vec::new(), Vec::new());
    let mut facts = photographer.facts();
    for which in subjects(args) {
        let mut subject = which.open(args)?;
        facts.push((subject.stem.clone(), subject.data.clone()));
        let bar = progress(args.common.quiet || args.common.json, &subject.stem);
        let mut take = photographer.of_one_volume();
        let outcome = tradeoff::sweep(&mut subject.grid, &subject.base, &sweep, &mut take, &mut |done, all| {
            bar.set_length(all as u64);
            bar.set_position(done as u64);
        })?;
        bar.finish_and_clear();
        write_files(args, &subject, &outcome)?;
        if args.paper_table_1 {
            let (extent, bits) = (subject.grid.extent(), component_bits(&subject.grid));
            let heading = format!("Table 1 of the {}", subject.stem);
            sections.push((heading, table1::pieces(&outcome, extent, bits, &subject.data)?));
        } else {
            sections.extend(page::sections(&outcome)?);
        }
        if !args.common.json && !args.common.quiet {
            print_table(&subject, &outcome);
        }
        summary.push(subject_json(&subject, &outcome));
    }
    sections.push(("Again, by hand".into(), vec![Piece::Commands(vec![command_line()])]));
    let html = Page {
        title: if args.paper_table_1 { "Table 1 of S3Dc, again" } else { "What accuracy costs in time" }.into(),
        label: photographer.adapter(),
        intro: "Each setting was encoded, rendered several times, and compared pixel by pixel with a picture of the uncompressed \
                volume. Times are medians on the adapter named above."
            .into(),
        facts,
        sections,
    };
    write_file(&page, args.force, html.to_html()?.as_bytes())?;
    if args.common.json {
        println!("{:#}", json!({ "page": page, "adapter": photographer.adapter(), "volumes": summary }));
    } else if !args.common.quiet {
        println!("Look at {}", page.display());
    }
    Ok(Verdict::Ok)
}

/// The command line that was given.
fn command_line() -> String {
    let quoted = |a: String| if a.contains([' ', '\'', '"', '$', '*']) { format!("{a:?}") } else { a };
    let rest = std::env::args_os().skip(1).map(|a| quoted(a.to_string_lossy().into_owned()));
    std::iter::once("vug".to_owned()).chain(rest).collect::<Vec<_>>().join(" ")
}

fn sweep_of(args: &Tradeoff) -> Result<Sweep> {
    if args.paper_table_1 {
        // One step: what is compared is codec and sampler.
        let step = args.steps.first().copied().unwrap_or(0.5);
        return paper::sweep_of_table_1(step);
    }
    let mut settings = vec![Setting::Raw];
    for &bits in &args.bits {
        for &block in &args.blocks {
            let setting = Setting::s3dc(bits, block)?;
            if !settings.contains(&setting) {
                settings.push(setting);
            }
        }
    }
    let finest = args.steps.iter().copied().fold(f64::INFINITY, f64::min);
    Ok(Sweep {
        settings,
        samplers: args.samplers.clone(),
        steps: args.steps.clone(),
        reference_step: args.reference_step.unwrap_or(finest / 2.0),
    })
}

fn component_bits(grid: &Grid) -> u32 {
    (8 * grid.sample_type().bytes() / grid.sample_type().components()) as u32
}

/// Tables and pictures of one volume.
fn write_files(args: &Tradeoff, subject: &Subject, o: &Outcome) -> Result<()> {
    let dir = &args.output;
    let write = |name: String, bytes: &[u8]| write_file(&dir.join(name), args.force, bytes);
    let stem = if args.paper_table_1 { format!("table-1-{}", subject.stem) } else { "tradeoff".into() };
    write(format!("{stem}.json"), format!("{:#}\n", subject_json(subject, o)).as_bytes())?;
    if args.paper_table_1 {
        write(format!("{stem}.csv"), paper::csv(&paper::table_1(o), &subject.data).as_bytes())?;
        write(format!("{stem}-rows.csv"), tradeoff::csv(&o.rows).as_bytes())?;
        let figure = table1::figure_5_csv(subject.grid.extent(), component_bits(&subject.grid));
        write(format!("figure-5-{}.csv", subject.stem), figure.as_bytes())?;
    } else {
        write(format!("{stem}.csv"), tradeoff::csv(&o.rows).as_bytes())?;
    }
    let image = |name: &str| format!("images/{}-{name}.png", subject.stem);
    write(image("reference"), &Picture::from(o.reference.clone()).to_png()?)?;
    for row in &o.rows {
        write(image(&row.stem()), &Picture::from(row.image.clone()).to_png()?)?;
        let difference = page::difference_picture(&o.reference, &row.image)?;
        write(image(&format!("{}-difference", row.stem())), &difference.to_png()?)?;
    }
    Ok(())
}

fn subject_json(subject: &Subject, o: &Outcome) -> Value {
    let shot = &o.reference_shot;
    json!({
        "volume": subject.stem,
        "data": subject.data,
        "reference": {
            "setting": "raw", "source": shot.source.name(), "sampler": shot.sampler.name(), "step": number(shot.step),
            "width": o.reference.width, "height": o.reference.height,
        },
        "rows": tradeoff::json(&o.rows),
        "left_out": o.left_out.iter().map(|(name, why)| json!({ "name": name, "why": why })).collect::<Vec<_>>(),
    })
}

fn print_table(subject: &Subject, o: &Outcome) {
    println!("{}:", subject.data);
    println!(
        "{:<38} {:>10} {:>8} {:>9} {:>8} {:>8}",
        "setting, sampler, step", "ms", "ratio", "PSNR dB", "SSIM", "FLIP"
    );
    for r in &o.rows {
        let (flip, mark) = (r.flip.map_or("–".into(), |v| format!("{v:.4}")), if r.pareto { " *" } else { "" });
        println!(
            "{:<38} {:>10.2} {:>8.3} {:>9.2} {:>8.5} {flip:>8}{mark}",
            Row::name(r),
            r.seconds[0] * 1e3,
            r.encoded.ratio_formula,
            r.error.psnr,
            r.error.ssim.mean
        );
    }
    o.left_out.iter().for_each(|(name, why)| println!("{name}: left out: {why}"));
    println!("* on the Pareto front of time and squared error");
}
