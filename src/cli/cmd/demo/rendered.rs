//! Rendered pictures of the demo's grey volume: as it was, from its compressed file, and where the pictures differ.

use crate::cli::output::write_file;
use crate::cli::picture::{Picture, legend, panels, stacked};
use crate::cli::report::Piece;
use crate::error::Result;
use crate::gpu::key::Gradient;
use crate::gpu::{AdapterChoice, Gpu, Projection, Sampler};
use crate::metrics::image::{RgbImage, compare, difference};
use crate::render::camera::CameraSpec;
use crate::render::scene::{IsoSurface, Scene, SceneFile, Shading, TransferSpec, VolumeSpec};
use crate::render::transfer::{Point, TransferFunction};
use crate::render::{Backend, Renderer};
use crate::volume::Volume;
use indicatif::ProgressBar;
use std::path::Path;
use std::sync::Arc;

/// Edge of a picture, in pixels: on a GPU or a software adapter, and on the CPU alone.
const EDGE: [u32; 2] = [256, 128];
/// Stems of the files that are rendered: without loss, and with a quarter of the bits.
const LOSSLESS: &str = "lossless";
const COMPRESSED: &str = "4bit-16";
/// Value of the surface: bone.
const BONE: f64 = 1700.0;

/// Pictures that are rendered: what the progress bar counts.
pub(super) const PICTURES: u64 = 4;

/// What is rendered on.
pub(super) struct Studio {
    backend: Backend,
    size: [u32; 2],
}

impl Studio {
    /// The best adapter that there is; the CPU where there is none.
    pub(super) fn open() -> Studio {
        match Gpu::open(&AdapterChoice::default()) {
            Ok(gpu) => Studio { backend: Backend::Gpu(Arc::new(gpu), None), size: [EDGE[0]; 2] },
            Err(_) => Studio { backend: Backend::CpuF32, size: [EDGE[1]; 2] },
        }
    }

    /// The adapter, for people.
    pub(super) fn adapter(&self) -> String {
        self.backend.describe()
    }

    /// Renders the files in `dir`, writes `rendered.png` there, and gives the page's section.
    pub(super) fn section(&self, dir: &Path, force: bool, bar: &ProgressBar) -> Result<(String, Vec<Piece>)> {
        let open = |stem: &str| Volume::open_path(dir.join(format!("{stem}.vug"))).map(Arc::new);
        let (lossless, compressed) = (open(LOSSLESS)?, open(COMPRESSED)?);
        let take = |scene: &Scene, volume: &Arc<Volume>, sampler| {
            let image = self.take(Scene { sampler, ..scene.clone() }, volume)?;
            bar.inc(1);
            Ok::<_, crate::Error>(image)
        };
        // One scene for all: camera and colours are those of the volume that has lost nothing.
        let scene = self.composed()?.resolve(&[&lossless], dir)?;
        let reference = take(&scene, &lossless, Sampler::Linear)?;
        let mut shots = Vec::new();
        for (sampler, fetches) in [(Sampler::Nearest, "2 fetches"), (Sampler::LinearOpt, "6 of 16 fetches, on average")]
        {
            let image = take(&scene, &compressed, sampler)?;
            let c = compare(&reference, &image)?;
            let caption = format!(
                "s3dc, 4 bit, blocks of 16³, {sampler} ({fetches}): PSNR {:.2} dB, SSIM {:.4}",
                c.psnr, c.ssim.mean
            );
            shots.push((caption, image));
        }
        let surface = SceneFile {
            projection: Projection::Iso,
            iso_surface: Some(IsoSurface { value: BONE }),
            ..self.composed()?
        };
        let surface = take(&surface.resolve(&[&compressed], dir)?, &compressed, Sampler::LinearOpt)?;

        let mut pictures = Vec::new();
        let mut row = vec![Picture::from(reference.clone())];
        for (caption, image) in shots {
            let error = Picture::from(difference(&reference, &image)?);
            row.truncate(1); // the last one, with the better sampler, is the one that is kept
            row.extend([Picture::from(image.clone()), error.clone()]);
            pictures.push(("uncompressed, linear".to_owned(), Picture::from(reference.clone())));
            pictures.push((caption, Picture::from(image)));
            pictures.push(("difference of both".to_owned(), error));
        }
        let row = panels(&row, 2, [255; 3])?;
        let row = stacked(&[row.clone(), legend(row.size().0)?], 0, [255; 3])?;
        write_file(&dir.join("rendered.png"), force, &row.to_png()?)?;
        let text = format!(
            "The grey head, sampled straight from what its files store, on {}. {}×{} pixels, synthetic data; pixels in classes \
             of their largest difference of a colour.",
            self.adapter(),
            self.size[0],
            self.size[1]
        );
        let command = format!("vug render {COMPRESSED}.vug -o bone.png --iso {BONE} --force");
        let section = vec![
            Piece::Text(text),
            Piece::Pictures(3, pictures),
            Piece::Pictures(3, vec![(format!("iso-surface at {BONE}, lit, from the compressed file"), surface.into())]),
            Piece::Commands(vec![command]),
        ];
        Ok(("Rendered".to_owned(), section))
    }

    fn take(&self, scene: Scene, volume: &Arc<Volume>) -> Result<RgbImage> {
        let background = scene.background;
        let renderer = Renderer::new(scene, vec![volume.clone()], self.backend.clone(), &|_, _, _| {})?;
        let image = renderer.picture(&|_, _, _| {})?.image;
        RgbImage::new(image.width, image.height, image.over(background))
    }

    /// Skin and brain as a veil, bone, and what is harder.
    fn composed(&self) -> Result<SceneFile> {
        let point = |value, color, alpha| Point { value, color, alpha };
        let points = vec![
            point(700.0, [0.85, 0.45, 0.3], 0.0),
            point(1000.0, [0.9, 0.55, 0.4], 0.02),
            point(1150.0, [0.9, 0.5, 0.4], 0.01),
            point(1500.0, [0.95, 0.85, 0.7], 0.05),
            point(2300.0, [1.0, 0.96, 0.88], 0.6),
            point(4095.0, [0.8, 0.9, 1.0], 0.9),
        ];
        let transfer = TransferSpec::Points(TransferFunction::new(points)?);
        Ok(SceneFile { volume: vec![VolumeSpec { transfer, ..VolumeSpec::default() }], ..self.lit() })
    }

    fn lit(&self) -> SceneFile {
        let shading = Some(Shading { gradient: Gradient::Naive, ..Shading::default() });
        let camera = CameraSpec { zoom: 1.2, ..CameraSpec::default() };
        SceneFile { size: self.size, camera, shading, level: Some(0), ..SceneFile::default() }
    }
}
