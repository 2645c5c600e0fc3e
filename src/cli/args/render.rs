//! `vug render`, declared.

use super::parse::{
    parse_bytes, parse_color, parse_plane, parse_range, parse_size, parse_span, parse_vector, parse_world_box,
};
use super::{Common, Import};
use crate::gpu::{Effect, Lens, Projection, Sampler, Source, Traversal};
use crate::render::scene::{ClipBox, Plane};
use clap::Args;
use std::path::PathBuf;

/// Makes a picture of a volume: on a GPU, on a software adapter, or on the CPU alone
#[derive(Args)]
#[command(
    after_help = "Scenes are TOML files; options override what they say. A .vug file may hold one itself (--store).
Presets: auto, grey, ct-bone, ct-soft, ct-chest, mri, density, heat. Anything else is a JSON file of points.
Effects: gradient_shading, empty_skip, tf_cull, lod, early_out, clip_box, time_interp. What is not named is in no shader.
World units are those of the volume's placement (vug info). Rays hold at most 2^20 samples.

Examples:
  vug render head.vug -o head.png
  vug render head.vug -o bone.png --transfer ct-bone --shading --size 1024x1024 --azimuth 40
  vug render ct.nii.gz -o skull.png --iso 300                           any readable file, uncompressed
  vug render scene.toml -o view.png --report view.json                  how true the picture is, and what it took
  vug render head.vug --explain                                         passes, bytes, fetches, what is left out
  vug render head.vug -o head.png --measure                             what each effect costs and changes
  vug render head.vug -o cut.png --plane 80,100,60:0,0,1                a cut through a point, across a direction
  vug render head.vug -o 'turn_####.png' --turntable 36                 or turn.gif, turn.apng
  vug render head.vug -o view.png --adapter cpu                         the reference, in 64-bit floats
  vug render head.vug --transfer ct-bone --azimuth 60 --store seen.vug  a copy that is rendered so from now on"
)]
pub(in crate::cli) struct Render {
    /// Scene (.toml), .vug file, or any other readable volume
    pub(in crate::cli) source: PathBuf,
    /// Picture to write: .png, or .pfm for floats; of a turntable NAME_####.png, .gif or .apng
    #[arg(short, long, value_name = "FILE", required_unless_present_any = ["explain", "store", "save_scene", "save_transfer"])]
    pub(in crate::cli) output: Option<PathBuf>,
    /// Width and height in pixels [default: 768x768]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub(in crate::cli) size: Option<[u32; 2]>,
    /// Transfer function: a preset, or a JSON file
    #[arg(long, visible_alias = "tf", value_name = "NAME|FILE", help_heading = "Scene")]
    pub(in crate::cli) transfer: Option<String>,
    /// Values that a preset is laid over, as stored [default: those of the volume]
    #[arg(long, value_name = "LO,HI", value_parser = parse_range, allow_hyphen_values = true, help_heading = "Scene")]
    pub(in crate::cli) transfer_range: Option<(f64, f64)>,
    /// nearest, linear, linear_opt (the same image, fewer fetches), hw_linear [default: linear_opt]
    #[arg(long, value_name = "NAME", help_heading = "Scene")]
    pub(in crate::cli) sampler: Option<Sampler>,
    /// direct (from the compressed form), deferred (decoded on the device), decoded (uncompressed) [default: direct]
    #[arg(long = "from", value_name = "SOURCE", help_heading = "Scene")]
    pub(in crate::cli) from: Option<Source>,
    /// raycast, slice, cut_plane [default: raycast]
    #[arg(long, value_name = "NAME", help_heading = "Scene")]
    pub(in crate::cli) traversal: Option<Traversal>,
    /// composite, maximum, minimum, mean, iso [default: composite]
    #[arg(long, value_name = "NAME", help_heading = "Scene")]
    pub(in crate::cli) projection: Option<Projection>,
    /// The effects, these and no others
    #[arg(long, value_name = "A,B,…", value_delimiter = ',', num_args = 0.., help_heading = "Scene")]
    pub(in crate::cli) effects: Option<Vec<Effect>>,
    /// An effect to leave out
    #[arg(long, value_name = "EFFECT", help_heading = "Scene")]
    pub(in crate::cli) without: Vec<Effect>,
    /// Light by the gradient (the effect gradient_shading)
    #[arg(long, help_heading = "Scene")]
    pub(in crate::cli) shading: bool,
    /// The surface where the value is V, as stored
    #[arg(long, value_name = "V", allow_hyphen_values = true, help_heading = "Scene")]
    pub(in crate::cli) iso: Option<f64>,
    /// A cut through the point P across the direction N, in world units
    #[arg(long, value_name = "PX,PY,PZ:NX,NY,NZ", value_parser = parse_plane, allow_hyphen_values = true, help_heading = "Scene")]
    pub(in crate::cli) plane: Option<Plane>,
    /// The part that is shown, in world units
    #[arg(long, value_name = "X0:X1,Y0:Y1,Z0:Z1", value_parser = parse_world_box, allow_hyphen_values = true, help_heading = "Scene")]
    pub(in crate::cli) clip: Option<ClipBox>,
    /// Distance of samples, in voxels of the smallest spacing [default: 0.5]
    #[arg(long, value_name = "VOXELS", allow_hyphen_values = true, help_heading = "Scene")]
    pub(in crate::cli) step: Option<f64>,
    /// Level of detail; 0 is the finest [default: as fine as can be seen]
    #[arg(long, value_name = "L", conflicts_with = "lod_pixels", help_heading = "Scene")]
    pub(in crate::cli) level: Option<u8>,
    /// Size of a voxel on the screen, at most [default: 1]
    #[arg(long, value_name = "PIXELS", help_heading = "Scene")]
    pub(in crate::cli) lod_pixels: Option<f64>,
    /// Colour behind the volume: R,G,B from 0 to 1, #rrggbb, black or white [default: black]
    #[arg(long, value_name = "COLOUR", value_parser = parse_color, help_heading = "Scene")]
    pub(in crate::cli) background: Option<[f32; 3]>,
    /// Time step, from 0; a fraction mixes two (the effect time_interp)
    #[arg(long, value_name = "T", help_heading = "Scene")]
    pub(in crate::cli) time: Option<f64>,
    /// Channel, from 0
    #[arg(long, value_name = "K", help_heading = "Scene")]
    pub(in crate::cli) channel: Option<u32>,
    /// perspective or orthographic
    #[arg(long, value_name = "LENS", help_heading = "Camera")]
    pub(in crate::cli) lens: Option<Lens>,
    /// Perspective: degrees from the upper to the lower edge [default: 30]
    #[arg(long, value_name = "DEGREES", allow_hyphen_values = true, help_heading = "Camera")]
    pub(in crate::cli) fov: Option<f64>,
    /// Orthographic: height of the picture in world units [default: all of the volume]
    #[arg(long, value_name = "LENGTH", help_heading = "Camera")]
    pub(in crate::cli) height: Option<f64>,
    /// Degrees around the vertical axis; 0: from the front, 90: from the left side of whom is seen [default: 30]
    #[arg(long, value_name = "DEGREES", allow_hyphen_values = true, help_heading = "Camera")]
    pub(in crate::cli) azimuth: Option<f64>,
    /// Degrees above the horizon [default: 15]
    #[arg(long, value_name = "DEGREES", allow_hyphen_values = true, help_heading = "Camera")]
    pub(in crate::cli) elevation: Option<f64>,
    /// Enlarges the picture
    #[arg(long, value_name = "FACTOR", help_heading = "Camera")]
    pub(in crate::cli) zoom: Option<f64>,
    /// Where the camera stands, in world units
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true, help_heading = "Camera")]
    pub(in crate::cli) eye: Option<[f64; 3]>,
    /// What it looks at, in world units [default: the middle]
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true, help_heading = "Camera")]
    pub(in crate::cli) target: Option<[f64; 3]>,
    /// What is up [default: the third axis of the world]
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true, help_heading = "Camera")]
    pub(in crate::cli) up: Option<[f64; 3]>,
    /// Part of an adapter's name, software, or cpu [default: the fastest there is, else cpu]
    #[arg(long, value_name = "NAME|software|cpu")]
    pub(in crate::cli) adapter: Option<String>,
    /// Most memory for a level, as 500M or 2G
    #[arg(long, value_name = "BYTES", value_parser = parse_bytes)]
    pub(in crate::cli) gpu_mem: Option<u64>,
    /// Pictures all around, so many; pictures A:B of them with --frames
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=10_000))]
    pub(in crate::cli) turntable: Option<u32>,
    /// Of a turntable only these pictures, half open, or one of them; from 0
    #[arg(long, value_name = "K|A:B", value_parser = parse_span::<u32>, requires = "turntable")]
    pub(in crate::cli) frames: Option<std::ops::Range<u32>>,
    /// Write how true the picture is to its source: level, error bound, bytes, device, times
    #[arg(long, value_name = "JSON")]
    pub(in crate::cli) report: Option<PathBuf>,
    /// Print the plan: levels, passes, bindings, fetches, and what is left out and why
    #[arg(long)]
    pub(in crate::cli) explain: bool,
    /// Leave each effect out in turn: what it costs, and what it changes
    #[arg(long, conflicts_with = "turntable")]
    pub(in crate::cli) measure: bool,
    /// Write a copy of the .vug file that holds this scene
    #[arg(long, value_name = "VUG")]
    pub(in crate::cli) store: Option<PathBuf>,
    /// Write the scene as it is with all options
    #[arg(long, value_name = "TOML")]
    pub(in crate::cli) save_scene: Option<PathBuf>,
    /// Write the transfer function's points
    #[arg(long, value_name = "JSON")]
    pub(in crate::cli) save_transfer: Option<PathBuf>,
    /// Overwrite files that are there
    #[arg(long)]
    pub(in crate::cli) force: bool,
    #[command(flatten)]
    pub(in crate::cli) import: Import,
    #[command(flatten)]
    pub(in crate::cli) common: Common,
}
