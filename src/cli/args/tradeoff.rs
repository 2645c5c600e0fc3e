//! Arguments of `vug tradeoff`.

use super::parse::{numbers, parse_extent};
use super::{Common, Import};
use crate::geometry::Extent;
use crate::gpu::key::Sampler;
use clap::Args;
use std::path::PathBuf;

/// Pictures a volume with many settings, and shows what each costs in time and error: see DIR/index.html
#[derive(Args)]
#[command(
    after_help = "Each setting of s3dc is encoded in memory and rendered with each sampler and step; the reference is the
uncompressed volume, sampled linearly at --reference-step. DIR gets tradeoff.csv, tradeoff.json, index.html with plots
(error against time, Pareto front marked), and images/ with every picture and its difference.

--paper-table-1 takes 2 and 4 bits, blocks of 2³ to 128³, nearest, linear and optimised linear on a 768×768 picture,
of SOURCE, where one is given, and of a synthetic phantom of the paper's size, 512×512×486 voxels of 16 bits. Ratios
of the phantom are the paper's; all other figures are those of the data they name.

Examples:
  vug tradeoff head.nrrd -o out/
  vug tradeoff head.nrrd -o out/ --bits 2,4,8 --blocks 4,16,64 --steps 0.5,1,2 --size 512x512
  vug tradeoff head.vug -o out/ --adapter cpu --size 128x128 --frames 1
  vug tradeoff head.nrrd --paper-table-1 -o table1/
  vug tradeoff --paper-table-1 --phantom 128,128,122 --size 256x256 -o small/"
)]
pub(in crate::cli) struct Tradeoff {
    /// Volume: .vug or any other readable file
    #[arg(required_unless_present = "paper_table_1")]
    pub(in crate::cli) source: Option<PathBuf>,
    /// Folder for tables, pictures and index.html
    #[arg(short, long, value_name = "DIR")]
    pub(in crate::cli) output: PathBuf,
    /// Bits per index to try
    #[arg(long, value_name = "I,I", value_delimiter = ',', default_value = "2,4,8", conflicts_with = "paper_table_1")]
    pub(in crate::cli) bits: Vec<u8>,
    /// Edges of cubic blocks to try
    #[arg(long, value_name = "B,B", value_delimiter = ',', default_value = "4,16", conflicts_with = "paper_table_1")]
    pub(in crate::cli) blocks: Vec<u32>,
    /// Samplers to try: nearest, linear, linear_opt, hw_linear
    #[arg(
        long,
        value_name = "NAME,NAME",
        value_delimiter = ',',
        default_value = "nearest,linear,linear_opt",
        conflicts_with = "paper_table_1"
    )]
    pub(in crate::cli) samplers: Vec<Sampler>,
    /// Distances of samples to try, in units of the smallest spacing
    #[arg(long, value_name = "S,S", value_delimiter = ',', default_value = "0.5,1,2")]
    pub(in crate::cli) steps: Vec<f64>,
    /// Distance of samples of the reference picture [default: half of the smallest step; with --paper-table-1 the step]
    #[arg(long, value_name = "S", conflicts_with = "paper_table_1")]
    pub(in crate::cli) reference_step: Option<f64>,
    /// Make Table 1 of the S3Dc paper, its figures and its panels
    #[arg(long)]
    pub(in crate::cli) paper_table_1: bool,
    /// Size of the phantom of --paper-table-1 [default: 512,512,486]
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_extent, requires = "paper_table_1")]
    pub(in crate::cli) phantom: Option<Extent>,
    /// Width and height of pictures [default: 512,512; 768,768 with --paper-table-1]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub(in crate::cli) size: Option<[u32; 2]>,
    /// Frames to time for each picture
    #[arg(long, value_name = "N", default_value = "5", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(in crate::cli) frames: u32,
    /// Scene with camera, transfer function and effects; its volume, sampler and step give way
    #[arg(long, value_name = "TOML")]
    pub(in crate::cli) scene: Option<PathBuf>,
    /// Part of an adapter's name, `software`, or `cpu` for the reference renderer
    #[arg(long, value_name = "NAME")]
    pub(in crate::cli) adapter: Option<String>,
    /// Overwrite files that are there
    #[arg(long)]
    pub(in crate::cli) force: bool,
    #[command(flatten)]
    pub(in crate::cli) import: Import,
    #[command(flatten)]
    pub(in crate::cli) common: Common,
}

fn parse_size(s: &str) -> Result<[u32; 2], String> {
    match numbers::<u32>(&s.replace('x', ","), ',').as_deref() {
        Some(&[w, h]) if (1..=16384).contains(&w) && (1..=16384).contains(&h) => Ok([w, h]),
        _ => Err("wants WxH, each from 1 to 16384".into()),
    }
}
