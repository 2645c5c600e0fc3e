//! What a device must hold for a whole scene: each level by itself was checked when it was laid out.

use super::PlannedLevel;
use crate::error::{Code, Error, Result};
use crate::gpu::level::{Fit, LevelLayout, readable};
use crate::gpu::{Effect, PipelineKey, Sampler, Source, Traversal};
use crate::render::scene::Scene;
use crate::volume::{At, Volume};

/// Checks memory, storage buffers and the size of the picture. Shares the storage buffers that are left among the levels: streams
/// may turn out to be longer than the index says.
pub(super) fn check(
    scene: &Scene,
    volumes: &[&Volume],
    fit: &Fit,
    key: &PipelineKey,
    levels: &mut [PlannedLevel],
) -> Result<()> {
    if scene.traversal == Traversal::Slice && scene.size[0] > fit.max_2d {
        let message = format!(
            "slices of {} pixels are wider than a texture of this device, {} at most; take a narrower picture, or traversal raycast",
            scene.size[0], fit.max_2d
        );
        return Err(Error::new(Code::Limit, "size", message));
    }
    memory(scene, volumes, fit, levels)?;
    buffers(fit, key, levels)
}

/// The sum of all levels against the budget.
fn memory(scene: &Scene, volumes: &[&Volume], fit: &Fit, levels: &[PlannedLevel]) -> Result<()> {
    let sum = |layouts: &[LevelLayout]| layouts.iter().map(LevelLayout::bytes).fold(0, u64::saturating_add);
    let layouts: Vec<LevelLayout> = levels.iter().map(|l| l.layout.clone()).collect();
    let (bytes, most) = match fit.budget {
        Some(most) if sum(&layouts) > most => (sum(&layouts), most),
        _ => return Ok(()),
    };
    // The same levels, coarser or from another source.
    let laid = |lod: Option<u8>, source: Source| -> Option<u64> {
        let lay = |l: &PlannedLevel| {
            let volume = volumes[l.volume];
            let at = At { lod: lod.unwrap_or(l.at.lod), ..l.at };
            match (at.lod < volume.info().lod_count, scene.sampler) {
                (false, _) => None,
                (true, Sampler::HwLinear) => LevelLayout::new_filtered(volume, at, source, fit).ok(),
                (true, _) => LevelLayout::new(volume, at, source, fit).ok(),
            }
        };
        let bytes = sum(&levels.iter().map(lay).collect::<Option<Vec<_>>>()?);
        (bytes <= most).then_some(bytes)
    };
    let mut ways = Vec::new();
    let coarsest = volumes.iter().map(|v| v.info().lod_count).max().unwrap_or(1);
    let coarser = (1..coarsest).find_map(|lod| laid(Some(lod), scene.source).map(|bytes| (lod, bytes)));
    if let Some((lod, bytes)) = coarser {
        ways.push(format!("level {lod} of all ({})", readable(bytes)));
    }
    if let Some(bytes) = laid(None, Source::Direct).filter(|_| scene.source != Source::Direct) {
        ways.push(format!("source direct ({})", readable(bytes)));
    }
    let fewer = levels.len() - 1;
    let first = sum(&layouts[..fewer]);
    if first <= most && fewer > 0 {
        let what = if scene.time_interp { "a whole time step, without time_interp" } else { "one volume fewer" };
        ways.push(format!("{what} ({})", readable(first)));
    }
    let each: Vec<String> = levels
        .iter()
        .map(|l| {
            format!("volume {} at step {}, level {}: {}", l.volume, l.at.time, l.at.lod, readable(l.layout.bytes()))
        })
        .collect();
    let message = format!(
        "the scene takes {} as source {}, of {} allowed ({}); what fits: {}",
        readable(bytes),
        scene.source,
        readable(most),
        each.join("; "),
        if ways.is_empty() { "nothing of it: allow more".to_owned() } else { ways.join(", or ") }
    );
    Err(Error::new(Code::Limit, "gpu-mem", message))
}

/// The storage buffers of the picture's shader against those that one can have.
fn buffers(fit: &Fit, key: &PipelineKey, levels: &mut [PlannedLevel]) -> Result<()> {
    let (needed, most) = (key.storage_buffers(), fit.storage_buffers);
    if needed > most {
        let first = |n: usize| PipelineKey { volumes: key.volumes[..n].to_vec(), ..key.clone() }.storage_buffers();
        let fits = (1..key.volumes.len()).rev().find(|&n| first(n) <= most);
        let fewer = match fits {
            Some(_) if key.effects.has(Effect::TimeInterp) => "a whole time step, without time_interp, or ".to_owned(),
            Some(1) => "one of the volumes alone, or ".to_owned(),
            Some(n) => format!("{n} of the volumes, or "),
            None => String::new(),
        };
        let message = format!(
            "tables, codebooks and pages of streams of {} levels take {needed} storage buffers, of {most} that a shader of \
             this device has; what fits: {fewer}source decoded or deferred",
            key.volumes.len()
        );
        return Err(Error::new(Code::Limit, "source", message));
    }
    let direct = |l: &PlannedLevel| l.layout.pages.is_some() && l.layout.decoded.is_none();
    let sharers = levels.iter().filter(|l| direct(l)).count() as u32;
    let spare = (most - needed).checked_div(sharers).unwrap_or(0);
    for (level, key) in levels.iter_mut().zip(&key.volumes) {
        if let (true, Some(pages)) = (direct(level), &mut level.layout.pages) {
            pages.pages = pages.pages.min(key.pages().saturating_add(spare));
        }
    }
    Ok(())
}
