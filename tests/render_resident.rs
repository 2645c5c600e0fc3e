//! Another transfer function loads what it shows and no more.
#![cfg(feature = "gpu")]

mod render_support;

use render_support::*;
use vug::Extent;
use vug::gpu::{Sampler, Source};
use vug::render::transfer::TransferFunction;
use vug::render::{Backend, Renderer};
use vug::volume::{CodecChoice, EncodeOptions, Quality};

/// The opaque core alone.
fn core() -> TransferFunction {
    TransferFunction::new(vec![point(200.0, [0.9, 0.4, 0.1], 0.0), point(205.0, [1.0, 0.9, 0.8], 0.9)]).unwrap()
}

/// `D-38`: bricks that are there are not loaded again.
fn check(backend: &Backend, source: Source) {
    let extent = Extent::new(166, 163, 165);
    let volume = encoded(&mut hill_u8(extent), s3dc(4, [4, 4, 4]));
    let of = |transfer| {
        let mut scene = plain(&volume, transfer, [40, 40]);
        (scene.tf_cull, scene.empty_skip, scene.source) = (true, true, source);
        Renderer::new(scene, vec![volume.clone()], backend.clone(), &|_, _, _| {}).unwrap()
    };
    let (mut renderer, all) = (of(core()), of(fog()));
    let bytes = |r: &Renderer| r.filled()[0].payload_bytes + r.filled()[0].repacked_bytes;
    let few = bytes(&renderer);
    assert!(few > 0 && few < bytes(&all), "{few} of {}", bytes(&all));
    let first = renderer.picture(&|_, _, _| {}).unwrap().image;
    volume.reset_cost();
    renderer.set_transfer(0, fog(), &|_, _, _| {}).unwrap();
    // What was there and what came are each brick once.
    assert_eq!(bytes(&renderer), bytes(&all));
    let picture = renderer.picture(&|_, _, _| {}).unwrap().image;
    assert!(picture == all.picture(&|_, _, _| {}).unwrap().image);
    assert_seen(&picture, "fog");
    renderer.set_transfer(0, core(), &|_, _, _| {}).unwrap();
    assert_eq!(bytes(&renderer), bytes(&all));
    assert!(renderer.picture(&|_, _, _| {}).unwrap().image == first);
}

#[test] // D-38
fn bricks_stay_in_memory() {
    for source in [Source::Direct, Source::Decoded] {
        check(&Backend::CpuF32, source);
    }
}

#[test] // D-38
#[cfg_attr(feature = "skip-gpu-tests", ignore = "no GPU adapter: built with skip-gpu-tests")]
fn bricks_stay_on_the_device() {
    for source in [Source::Direct, Source::Deferred, Source::Decoded] {
        check(&Backend::Gpu(gpu(), None), source);
    }
}

/// Streams are few pages, however often the transfer function changes.
fn check_many_changes(backend: &Backend) {
    let extent = Extent::new(166, 163, 165);
    let options = EncodeOptions {
        codec: CodecChoice::Zerobit,
        quality: Quality::Keep(500_000),
        brick: Some(16),
        ..EncodeOptions::default()
    };
    let volume = encoded(&mut hill_u8(extent), options);
    let above = |v: u32| {
        let v = f64::from(v);
        TransferFunction::new(vec![point(v, [0.2, 0.5, 0.9], 0.0), point(v + 40.0, [1.0, 0.9, 0.2], 0.5)]).unwrap()
    };
    let of = |transfer| {
        let mut scene = plain(&volume, transfer, [24, 24]);
        (scene.tf_cull, scene.empty_skip, scene.sampler) = (true, true, Sampler::Nearest);
        Renderer::new(scene, vec![volume.clone()], backend.clone(), &|_, _, _| {}).unwrap()
    };
    let mut renderer = of(above(208));
    let bytes = |r: &Renderer| r.filled()[0].payload_bytes;
    let (mut before, mut more) = (bytes(&renderer), 0);
    for i in 1..=20 {
        renderer.set_transfer(0, above(208 - 10 * i), &|_, _, _| {}).unwrap();
        let now = bytes(&renderer);
        more += u32::from(now > before);
        before = now;
    }
    assert!(more > 16, "{more} changes loaded anything: a page for each would be had");
    let all = of(above(8));
    assert_eq!(bytes(&all), before);
    let picture = renderer.picture(&|_, _, _| {}).unwrap().image;
    assert_seen(&picture, "hill");
    assert!(picture == all.picture(&|_, _, _| {}).unwrap().image);
}

#[test]
fn many_changes_take_few_pages() {
    check_many_changes(&Backend::CpuF32);
}

#[test]
#[cfg_attr(feature = "skip-gpu-tests", ignore = "no GPU adapter: built with skip-gpu-tests")]
fn many_changes_take_few_pages_on_the_device() {
    check_many_changes(&Backend::Gpu(gpu(), None));
}
