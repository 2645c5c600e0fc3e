//! Zerobit streams on the GPU: every voxel to the bit, whatever the streams say.
#![cfg(feature = "gpu")]

mod gpu_support;
mod support;

use gpu_support::{encoded, gpu, host};
use vug::codec::zerobit::Stream;
use vug::gpu::level::{Fit, HostLevel, LevelLayout};
use vug::gpu::pass::decode::{DecodePass, decode_words};
use vug::gpu::{GpuLevel, Source};
use vug::render::mirror::{Free, source_zerobit};
use vug::volume::{At, CodecChoice, EncodeOptions, Quality, Volume, ZerobitOptions};
use vug::voxel::{Sample, SampleValue};
use vug::{Extent, SampleType};

fn options(stream: Stream) -> EncodeOptions {
    EncodeOptions {
        codec: CodecChoice::Zerobit,
        quality: Quality::Keep(300_000),
        zerobit: ZerobitOptions { stream, codebook_region: Some(1), ..ZerobitOptions::default() },
        brick: Some(32),
        null_value: 5.0,
        ..EncodeOptions::default()
    }
}

/// Noise with holes, one value, nothing: STORED, CONSTANT and EMPTY bricks, null cells in stored ones.
fn field(c: [u32; 3]) -> u32 {
    match c[0] {
        0..40 if c[1] % 13 > 3 || c[2] > 20 => 90 * c[0] % 250 + support::hash(c) % 40,
        40..64 => 7,
        _ => 5,
    }
}

fn volumes(stream: Stream) -> [Volume; 4] {
    fn one<T: Sample>(stream: Stream, f: impl Fn(u32) -> T) -> Volume {
        encoded(Extent::new(98, 37, 35), &options(stream), |c| f(field(c)))
    }
    [
        one(stream, |v| v as u8),
        one(stream, |v| if v == 5 { 5 } else { (v * 223) as u16 }),
        one(stream, |v| if v == 5 { 5 } else { (v as i32 * 200 - 29_000) as i16 }),
        one(stream, |v| if v == 5 { [5; 3] } else { [v as u8, (v / 2) as u8, 255 - v as u8] }),
    ]
}

fn coords(e: Extent) -> impl Iterator<Item = [u32; 3]> {
    (0..e.z).flat_map(move |z| (0..e.y).flat_map(move |y| (0..e.x).map(move |x| [x, y, z])))
}

/// The bits that a shader has of voxel `c`, by the mirror.
fn expected(level: &HostLevel, c: [u32; 3]) -> u32 {
    let [r, g, b] = source_zerobit::voxel(level, c, &mut Free).map(i32::cast_unsigned);
    if level.layout.store.sample() == SampleType::Rgb8 { r | g << 8 | b << 16 } else { r }
}

fn bits(value: SampleValue) -> u32 {
    match value {
        SampleValue::I16(v) => i32::from(v).cast_unsigned(),
        v => v.to_raw(),
    }
}

#[test] // spec: ZBT-9, ZBT-12
#[cfg_attr(feature = "skip-gpu-tests", ignore = "no GPU adapter: built with skip-gpu-tests")]
fn every_voxel_is_that_of_the_codec() {
    let small = Fit { max_binding: 48_000, ..gpu().fit(None) };
    for stream in [Stream::New, Stream::Old] {
        for volume in volumes(stream) {
            for fit in [gpu().fit(None), small] {
                let what = format!("{stream:?} {}", volume.info().sample_type);
                let layout = LevelLayout::new(&volume, At::default(), Source::Deferred, &fit).unwrap();
                let mut cpu = host(&volume, layout);
                assert!(cpu.pages.len() > 1 || fit != small, "{what}: {} pages", cpu.pages.len());
                let level = GpuLevel::of_host(gpu(), &cpu).unwrap();
                let words = decode_words(gpu(), &level).unwrap();
                for (c, found) in coords(cpu.layout.extent).zip(words) {
                    assert_eq!(found, bits(volume.voxel(At::default(), c).unwrap()), "{what} {c:?}");
                }
                // Streams of noise: unit blocks that lie anywhere, offsets beyond the end, cells that are none.
                for (i, w) in (0u32..).zip(cpu.pages.iter_mut().flatten()) {
                    if support::hash([i, 1, 2]).is_multiple_of(3) {
                        *w = support::hash([i, 3, 4]) >> (8 * (support::hash([i, 5, 6]) % 3));
                    }
                }
                let words = decode_words(gpu(), &GpuLevel::of_host(gpu(), &cpu).unwrap()).unwrap();
                for (c, found) in coords(cpu.layout.extent).zip(words) {
                    assert_eq!(found, expected(&cpu, c), "{what}, damaged: {c:?}");
                }
            }
        }
    }
}

#[test]
#[cfg_attr(feature = "skip-gpu-tests", ignore = "no GPU adapter: built with skip-gpu-tests")]
fn streams_are_decoded_into_a_texture() {
    for volume in volumes(Stream::New) {
        let t = volume.info().sample_type;
        let layout = LevelLayout::new(&volume, At::default(), Source::Deferred, &gpu().fit(None)).unwrap();
        let level = gpu_support::upload(&volume, layout);
        let pass = DecodePass::new(gpu(), &level).unwrap();
        pass.run(gpu()).unwrap();
        let texels = gpu().read_texture(pass.output.as_ref().unwrap()).unwrap();
        for (c, texel) in coords(level.layout.extent).zip(texels.chunks_exact(4)) {
            let texel = <[u8; 4]>::try_from(texel).unwrap();
            match volume.voxel(At::default(), c).unwrap() {
                SampleValue::Rgb8([r, g, b]) => assert_eq!(texel, [r, g, b, 0], "{c:?}"),
                v => assert_eq!(f64::from(f32::from_le_bytes(texel)), v.component(0), "{t} {c:?}"),
            }
        }
    }
}
