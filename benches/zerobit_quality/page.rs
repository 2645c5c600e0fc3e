//! The results as Markdown.

use crate::files;
use crate::measure::{Part, Point, Variant};
use crate::{COMPARED, KEEP, Results};
use std::fmt::Write;

/// What the tables say to somebody who chooses; true of these volumes.
const READING: &str = "
## How to read this

* **Below λ = 1.6 % there is less than one coefficient per cell of 64 voxels.** Volumes with a large background do well there, since \
its cells take none; those without one, as the light field, fall apart.
* **NEW costs bytes in the file.** Before zstd it is up to 44 % shorter than OLD, and 7 % longer at worst; but zstd packs OLD's flags \
better than NEW's maps, so that files with OLD are 1 to 21 % smaller. Use NEW for speed, and `--stream old` as a baseline.
* **The energy norm is worth 0.5 to 1.7 dB** at the same λ, mostly with fewer bits (nothing, where λ = 10 % keeps all there is of the CT).
* **The adaptive threshold, the paper's, loses against the global one** on all six: by 0.1 to 2 dB, and by 6 dB on the CT at 3 %. It shares \
out coefficients by how many of a unit block's are not 0, and grain counts as much as bone. Where details are so small that they round \
to 0, their share is lost: hence the CT's λ *got*. `--threshold global` is better wherever two or three more looks at the source are no matter.
* **Refining codebooks is worth up to 1.3 dB in colour** and next to nothing in grey, where 256 words hold (nearly) every coefficient anyway. \
It costs time for encoding only.
* PSNR over the whole volume flatters those with much background: it is 3 to 6.5 dB lower over the cells that hold something.
";

// Writing to a String cannot fail.

/// The whole page. `chart`: name of the file that lies beside it.
pub fn markdown(results: &[Results], part: &Part, chart: Option<&str>) -> String {
    let mut out = String::new();
    let o = &mut out;
    let _ = writeln!(o, "# Codec zerobit: size and quality\n");
    let _ = writeln!(
        o,
        "Made by `cargo bench --bench zerobit_quality -- --write docs/zerobit-quality.md`. Bricks of 64³, one level, one codebook per \
         file; norm *energy*, threshold *adaptive*, training *median cut*, zstd, unless a column says otherwise. The figures do not \
         depend on machine or threads.\n"
    );
    let _ =
        writeln!(o, "| volume | voxels (x, y, z) | type | range | cells not empty | what |\n|---|---|---|---|---|---|");
    for r in results {
        let (lo, hi) = r.range;
        let _ = writeln!(
            o,
            "| {} | {} | {} | {lo} … {hi} | {:.1} % | {} |",
            r.case.title,
            r.extent,
            r.sample_type,
            100.0 * r.non_empty,
            r.case.about
        );
    }
    if let Some(chart) = chart {
        let _ = writeln!(o, "\n![PSNR over bits per voxel, one line per volume]({chart})\n");
        let _ = writeln!(o, "*Payloads and codebooks before zstd; marks at λ = 1, 2, 3, 5, 7, 10 %.*");
    }
    let _ = writeln!(o, "\n## Figures\n\n{}\n", terms(part));
    for r in results {
        let _ = writeln!(o, "### {}\n", r.case.title);
        o.push_str(
            "| λ | λ got | bits per voxel | ratio before zstd | ratio after | PSNR | PSNR of cells not empty | γ0 stored / all | γ1 stored / all |\n\
             |---|---|---|---|---|---|---|---|---|\n",
        );
        for (keep, p) in KEEP.iter().zip(&r.points) {
            let (s, share) = (&p.stats, |v: Option<f64>| v.map_or("-".into(), |v| format!("{v:.3}")));
            let _ = writeln!(
                o,
                "| {keep} % | {:.2} % | {:.3} | {:.1} | {:.1} | {} | {} | {} / {} | {} / {} |",
                100.0 * p.kept,
                p.bits_per_voxel(),
                p.original as f64 / p.bytes as f64,
                p.original as f64 / p.file_bytes as f64,
                db(p.psnr),
                db(p.psnr_non_empty),
                share(s.gamma_0(s.stored_cells)),
                share(s.gamma_0(p.cells)),
                share(s.gamma_1(s.stored_cells)),
                share(s.gamma_1(p.cells)),
            );
        }
        o.push('\n');
    }
    parts(o, results);
    streams(o, results);
    encoders(o, results);
    if results.len() == files::cases().len() && part.is_whole() {
        out.push_str(READING);
    }
    out
}

fn terms(part: &Part) -> String {
    let mut out = String::from(
        "λ is the ratio of coefficients that the encoder was asked to keep; *got* is more, where coefficients tie or a cell's \
         average has to stay for its details, and less, where indices turn out to stand for 0. Ratios count codebooks; *before zstd* \
         is payloads and codebooks, as is bits per voxel, and *after* is the whole file. PSNR: peak = range of the volume, mean \
         square over all components. Cells not empty: those of 4³ voxels that have a voxel other than 0 in the source. γ0 and γ1: \
         shares of null nodes of level 0 and 1 in stored cells, and in all cells.",
    );
    if part.stride > 1 {
        let _ = write!(out, " **PSNR here is that of every {}th slice.**", part.stride);
    }
    if let Some(crop) = part.crop {
        let [a, b] = [crop.start, crop.end];
        let _ = write!(
            out,
            " **PSNR here is that of the voxels x {} to {}, y {} to {}, z {} to {} (ends excluded).**",
            a[0], b[0], a[1], b[1], a[2], b[2]
        );
    }
    out
}

/// What PSNR of a part says, for the first volume.
fn parts(o: &mut String, results: &[Results]) {
    let Some(r) = results.first() else { return };
    let _ = writeln!(
        o,
        "### PSNR of parts: {}\n\nOptions `--stride N` and `--crop X0:X1,Y0:Y1,Z0:Z1` measure a part; the volume is encoded whole, \
         and the peak is its range.\n\n| λ | all voxels | cells not empty | every 10th slice | the middle half along each axis |\n\
         |---|---|---|---|---|",
        r.case.title
    );
    for (keep, p) in KEEP.iter().zip(&r.points) {
        let [stride, crop] = p.psnr_of_parts.map(db);
        let _ = writeln!(o, "| {keep} % | {} | {} | {stride} | {crop} |", db(p.psnr), db(p.psnr_non_empty));
    }
    o.push('\n');
}

/// Bytes of the streams NEW and OLD.
fn streams(o: &mut String, results: &[Results]) {
    o.push_str(
        "## NEW against OLD\n\n\
         Bytes of the two streams for the same coefficients; each volume was decoded from both, to the same voxels. *As the paper \
         counts*: a byte of NNNC per unit block, neither directory nor prefix, padding or codebook.\n\n\
         | volume | λ | NEW | OLD | NEW / OLD | NEW, file | OLD, file | NEW / OLD | as the paper counts | nodes with details per cell |\n\
         |---|---|---|---|---|---|---|---|---|---|\n",
    );
    for r in results {
        for (keep, p) in KEEP.iter().zip(&r.points) {
            let s = &p.stats;
            let Some((old, old_file)) = p.old else { continue };
            let ratio = |a: u64, b: u64| format!("{:.3}", a as f64 / b as f64);
            let paper = ratio(s.new.as_in_the_paper(s.unit_blocks), s.old.as_in_the_paper(s.unit_blocks));
            let _ = writeln!(
                o,
                "| {} | {keep} % | {} | {old} | {} | {} | {old_file} | {} | {paper} | {:.2} |",
                r.case.title,
                p.bytes,
                ratio(p.bytes, old),
                p.file_bytes,
                ratio(p.file_bytes, old_file),
                (s.nodes_0 + s.nodes_1) as f64 / s.stored_cells as f64,
            );
        }
    }
    o.push_str(
        "\nA stored cell takes 6 bytes, one for each node with details, and its details in NEW; 11 and its details in OLD. NEW is thus \
         shorter below five nodes with details per cell, and longer above, where much is kept of few cells. What NEW buys is speed: null \
         nodes cost no look-ups and no arithmetic.\n",
    );
}

/// Variants of the encoder, against the default and against the paper's rules.
fn encoders(o: &mut String, results: &[Results]) {
    o.push_str("\n## Choices of the encoder\n\nThe same stream, the same decoder. PSNR in dB, and bits per voxel before zstd.\n\n| volume | λ |");
    for v in Variant::ALL {
        let _ = write!(o, " {} |", v.name);
    }
    let _ = writeln!(o, "\n|---|---|{}", "---|".repeat(Variant::ALL.len()));
    for r in results {
        for (keep, points) in COMPARED.iter().zip(&r.compared) {
            let _ = write!(o, "| {} | {keep} % |", r.case.title);
            for p in points {
                let _ = write!(o, " {} @{:.3} |", db(p.psnr), p.bits_per_voxel());
            }
            o.push('\n');
        }
    }
    o.push_str(
        "\nWhat each choice is worth, as PSNR at the same λ (not at the same bits, which are above):\n\n\
         | volume | λ | energy over plain norm | adaptive over global | refined over median cut | all: global, energy, refined over plain, adaptive, median cut |\n\
         |---|---|---|---|---|---|\n",
    );
    for r in results {
        for (keep, points) in COMPARED.iter().zip(&r.compared) {
            let [default, plain, global, refined, best] = points.as_slice() else { continue };
            let gain = |a: &Point, b: &Point| format!("{:+.2} dB", a.psnr - b.psnr);
            let _ = writeln!(
                o,
                "| {} | {keep} % | {} | {} | {} | {} |",
                r.case.title,
                gain(default, plain),
                gain(default, global),
                gain(refined, default),
                gain(best, plain)
            );
        }
    }
}

fn db(v: f64) -> String {
    if v.is_finite() { format!("{v:.2}") } else { "exact".into() }
}
