//! What is kept of a scene: in a file of its own, inside a copy of the volume's file, or its transfer function alone.

use super::scene::Opened;
use crate::cli::args::Render;
use crate::cli::args::Write;
use crate::cli::cmd::copy::{self, Copy};
use crate::cli::output::{check_no_stdout, write_file};
use crate::error::{Error, Result};
use crate::render::scene::{Scene, SceneFile, TransferSpec, VolumeSpec};
use crate::source::is_url;
use crate::volume::CopyOptions;
use std::path::Path;

/// Writes what the options ask for. Transfer functions are written as points: they look the same for ever.
pub(super) fn keep(args: &Render, opened: &Opened, scene: &Scene) -> Result<()> {
    if let Some(path) = &args.save_transfer {
        let [volume] = &scene.volumes[..] else {
            return Err(Error::param(
                "save-transfer",
                "the scene has several transfer functions; --save-scene keeps all",
            ));
        };
        check_no_stdout(path)?;
        write_file(path, args.force, volume.transfer.to_json().as_bytes())?;
    }
    if let Some(path) = &args.save_scene {
        check_no_stdout(path)?;
        let mut file = with_points(&opened.scene, scene);
        if file.volume.iter().all(|v| v.path.is_none()) {
            file.volume[0].path = Some(from_everywhere(&args.source));
        } else {
            for spec in &mut file.volume {
                spec.path = spec
                    .path
                    .as_ref()
                    .map(|p| if is_url(p) { p.clone() } else { from_everywhere(&opened.folder.join(p)) });
            }
        }
        write_file(path, args.force, file.to_toml().as_bytes())?;
    }
    if let Some(target) = &args.store {
        let Some(source) = opened.file.as_ref().filter(|_| scene.volumes.len() == 1) else {
            let message = "a scene is stored in a copy of the .vug file that it shows; here is no such file, or there are several";
            return Err(Error::param("store", message));
        };
        let mut file = with_points(&opened.scene, scene);
        file.volume[0].path = None;
        file.check_stored()?;
        let copy = Copy {
            source,
            target,
            options: CopyOptions { scene: Some(file.to_toml()), ..CopyOptions::default() },
            write: &Write { force: args.force, file_id: None },
            common: &args.common,
            log: false,
            verb: "storing the scene",
        };
        copy::run_quietly(&copy)?;
    }
    Ok(())
}

/// The name of a file that holds wherever the scene is read; an address as it is.
fn from_everywhere(path: &Path) -> String {
    path.canonicalize().unwrap_or_else(|_| path.to_owned()).to_string_lossy().into_owned()
}

/// The scene with every transfer function as points.
fn with_points(file: &SceneFile, scene: &Scene) -> SceneFile {
    let mut file = file.clone();
    file.volume.resize_with(scene.volumes.len(), VolumeSpec::default);
    for (spec, volume) in file.volume.iter_mut().zip(&scene.volumes) {
        spec.transfer = TransferSpec::Points(volume.transfer.clone());
    }
    file
}
