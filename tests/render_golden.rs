//! A picture that is kept: the same for years, on the software adapter whose name is asserted.
#![cfg(all(feature = "gpu", feature = "convert"))]

mod render_support;

use render_support::*;
use std::io::Cursor;
use std::path::Path;
use vug::Extent;
use vug::gpu::key::Gradient;
use vug::gpu::{AdapterChoice, Gpu, Sampler};
use vug::render::{Backend, Image};

/// A lit hill, 64×64, from s3dc with 4 bits and blocks of 4³. Made by this test when `VUG_GOLDEN=write` is set: look at it then.
const GOLDEN: &str = "tests/golden/hill.png";

/// What versions of Mesa and processors may change of a channel.
const CLOSE: u8 = 1;

fn hill_in_light(backend: &Backend) -> Image {
    let volume = encoded(&mut hill_u8(Extent::new(40, 33, 37)), s3dc(4, [4, 4, 4]));
    let mut scene = lit(&plain(&volume, fog(), [64, 64]), Gradient::Naive);
    scene.sampler = Sampler::LinearOpt;
    let image = picture(&scene, &volume, backend);
    assert_seen(&image, "hill");
    image
}

fn golden() -> Vec<u8> {
    let bytes = std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join(GOLDEN)).unwrap();
    let mut reader = png::Decoder::new(Cursor::new(bytes)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    assert_eq!((info.width, info.height, info.color_type), (64, 64, png::ColorType::Rgb));
    pixels
}

fn write_golden(pixels: &[u8]) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(GOLDEN);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    let mut encoder = png::Encoder::new(std::fs::File::create(path).unwrap(), 64, 64);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header().unwrap().write_image_data(pixels).unwrap();
}

/// Largest difference of a channel.
fn off(a: &[u8], b: &[u8]) -> u8 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max().unwrap()
}

#[test]
#[cfg_attr(feature = "skip-gpu-tests", ignore = "no GPU adapter: built with skip-gpu-tests")]
fn the_software_adapter_makes_the_golden_picture() {
    let gpu = Gpu::open(&AdapterChoice::software())
        .unwrap_or_else(|e| panic!("{e}; golden pictures are of Mesa's llvmpipe (package mesa-vulkan-drivers)"));
    let name = gpu.adapter_info.name.clone();
    let image = hill_in_light(&Backend::Gpu(gpu.into(), None));
    let pixels = image.over([0.0; 3]).as_flattened().to_vec();
    if name.contains("llvmpipe") {
        if std::env::var("VUG_GOLDEN").is_ok_and(|v| v == "write") {
            write_golden(&pixels);
        }
        let off = off(&pixels, &golden());
        println!("{name}: off by {off} of 255");
        assert!(off <= CLOSE, "{name}: {off}");
    } else {
        println!("{name} is not llvmpipe, of which the golden picture is: compared with the CPU's mirror");
        assert_close(&image, &hill_in_light(&Backend::CpuF32), 2.0 / 255.0, &name);
    }
}

/// On every machine: the kept picture is what the CPU computes, so that a wrong one cannot become the truth.
#[test]
fn the_golden_picture_is_right() {
    let pixels = hill_in_light(&Backend::Cpu).over([0.0; 3]).as_flattened().to_vec();
    let off = off(&pixels, &golden());
    println!("f64 reference: off by {off} of 255");
    assert!(off <= 2, "{off}");
}
