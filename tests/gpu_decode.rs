//! Decoding on the GPU is decoding on the CPU: to the bit for integers, within a stated tolerance for f32.
#![cfg(feature = "gpu")]

mod gpu_support;
mod support;

use gpu_support::{encoded, gpu, host, of_all_types, options, upload};
use vug::codec::s3dc::Scalar;
use vug::gpu::level::{Fit, HostLevel, LevelLayout, Role, Store};
use vug::gpu::pass::decode::{DecodePass, decode_words};
use vug::gpu::{GpuLevel, Source, tolerance};
use vug::volume::{At, CodecChoice, Volume};
use vug::voxel::SampleValue;
use vug::{Extent, SampleType};

/// Limits under which a level of a few bricks is cut into tiles.
fn tight() -> Fit {
    Fit { max_3d: 64, ..gpu().fit(None) }
}

fn each(e: Extent) -> impl Iterator<Item = [u32; 3]> {
    (0..e.z).flat_map(move |z| (0..e.y).flat_map(move |y| (0..e.x).map(move |x| [x, y, z])))
}

/// What the CPU makes of the texels of voxel `c`, and how far a shader may be from it.
fn expected(level: &HostLevel, c: [u32; 3]) -> (SampleValue, f32) {
    let read = |role| {
        let t = level.layout.texture_of(role).unwrap();
        level.texel(t, level.layout.texel(&level.layout.textures[t], c))
    };
    let Store::S3dc { sample, index_bits, .. } = level.layout.store else { panic!("s3dc only") };
    let ([lo, hi, ..], [word, ..]) = (read(Role::Minmax), read(Role::Index));
    let q = (1 << index_bits) - 1;
    let in_brick = c[0] & ((1 << level.layout.brick_log2) - 1);
    let index = word >> (in_brick % (16 / index_bits) * index_bits) & q;
    match sample {
        SampleType::U8 => (SampleValue::U8(u8::reconstruct(lo as u8, hi as u8, index, q)), 0.0),
        SampleType::U16 => (SampleValue::U16(u16::reconstruct(lo as u16, hi as u16, index, q)), 0.0),
        SampleType::I16 => (SampleValue::I16(i16::reconstruct(lo as i16, hi as i16, index, q)), 0.0),
        _ => {
            let (lo, hi) = (f32::from_bits(lo), f32::from_bits(hi));
            (SampleValue::F32(f32::reconstruct(lo.stored(), hi.stored(), index, q)), tolerance::decoded(lo, hi))
        }
    }
}

/// Decodes on the device both ways, and compares every voxel.
fn check(level: &GpuLevel, cpu: &HostLevel, what: &str) {
    let e = level.layout.extent;
    let words = decode_words(gpu(), level).unwrap();
    let pass = DecodePass::new(gpu(), level).unwrap();
    pass.run(gpu()).unwrap();
    let texels = gpu().read_texture(pass.output.as_ref().unwrap()).unwrap();
    let decoded = level.layout.deferred().unwrap();
    let size = decoded.textures[0].size;
    for (c, word) in each(e).zip(words) {
        let (value, tolerance) = expected(cpu, c);
        let at = decoded.texel(&decoded.textures[0], c);
        let at = 4 * (at[0] + size[0] * (at[1] + size[1] * at[2])) as usize;
        let texel = f32::from_le_bytes(texels[at..at + 4].try_into().unwrap());
        match value {
            SampleValue::F32(v) => {
                let found = f32::from_bits(word);
                assert!((found - v).abs() <= tolerance, "{what} {c:?}: {found} for {v} ± {tolerance}");
                assert!((texel - v).abs() <= tolerance, "{what} {c:?}: {texel} in the texture for {v}");
            }
            SampleValue::I16(v) => assert_eq!((word.cast_signed(), texel), (v.into(), v.into()), "{what} {c:?}"),
            v => assert_eq!((word, texel), (v.to_raw(), v.to_raw() as f32), "{what} {c:?}"),
        }
    }
}

fn check_volume(volume: &Volume, fit: &Fit, what: &str) {
    let layout = LevelLayout::new(volume, At::default(), Source::Deferred, fit).unwrap();
    let cpu = host(volume, layout.clone());
    // What is expected is what the volume itself decodes.
    for c in each(layout.extent).step_by(97) {
        assert_eq!(expected(&cpu, c).0, volume.voxel(At::default(), c).unwrap(), "{what} {c:?}");
    }
    check(&upload(volume, layout), &cpu, what);
}

#[test] // S-15, V6
#[cfg_attr(feature = "skip-gpu-tests", ignore = "no GPU adapter: built with skip-gpu-tests")]
fn every_voxel_is_decoded_as_on_the_cpu() {
    // Partial bricks along every axis; blocks that divide bricks and blocks that do not.
    for bits in [1, 2, 4, 8] {
        for block in [[2; 3], [4; 3], [16; 3], [3, 5, 7], [1, 16, 2], [13, 1, 1]] {
            for volume in of_all_types(Extent::new(35, 18, 33), &options(CodecChoice::S3dc, bits, block)) {
                check_volume(&volume, &gpu().fit(None), &format!("{bits} {block:?} {}", volume.info().sample_type));
            }
        }
    }
}

#[test] // hard case: D-59
#[cfg_attr(feature = "skip-gpu-tests", ignore = "no GPU adapter: built with skip-gpu-tests")]
fn levels_in_tiles_are_decoded_into_tiles() {
    for block in [[4; 3], [3, 5, 7]] {
        for volume in of_all_types(Extent::new(35, 18, 85), &options(CodecChoice::S3dc, 2, block)) {
            check_volume(&volume, &tight(), &format!("folded {block:?} {}", volume.info().sample_type));
        }
    }
    let long = encoded(Extent::new(70_000, 2, 2), &options(CodecChoice::S3dc, 4, [4; 3]), |c| support::hash(c) as u8);
    check_volume(&long, &Fit { max_3d: 2048, ..gpu().fit(None) }, "long");
}

#[test] // hard case: K-14: end points out of order decode to the first
#[cfg_attr(feature = "skip-gpu-tests", ignore = "no GPU adapter: built with skip-gpu-tests")]
fn hostile_end_points_and_indices_decode_alike() {
    for bits in [1, 2, 4, 8] {
        for volume in of_all_types(Extent::new(35, 18, 20), &options(CodecChoice::S3dc, bits, [3, 4, 5])) {
            let layout = LevelLayout::new(&volume, At::default(), Source::Deferred, &gpu().fit(None)).unwrap();
            let mut cpu = host(&volume, layout);
            let float = volume.info().sample_type == SampleType::F32;
            for (i, byte) in cpu.textures.iter_mut().flat_map(|t| t.iter_mut().enumerate()) {
                let noise = (support::hash([i as u32, 5, 77]) >> 8) as u8;
                // Finite floats of either sign: the exponent stays low.
                *byte = if float && i % 4 == 3 { noise & 0xBF } else { noise };
            }
            if float {
                // As bytes of index words are not floats, any will do; pairs are finite now.
                let t = cpu.layout.texture_of(Role::Minmax).unwrap();
                assert!(cpu.textures[t].chunks_exact(4).all(|b| f32::from_le_bytes(b.try_into().unwrap()).is_finite()));
            }
            check(
                &GpuLevel::of_host(gpu(), &cpu).unwrap(),
                &cpu,
                &format!("hostile {bits} {}", volume.info().sample_type),
            );
        }
    }
}

/// A volume of one type from given samples, along x.
fn row<T: vug::voxel::Sample>(bits: u8, block: u32, samples: &[T]) -> Volume {
    let extent = Extent::new(samples.len() as u32, 1, 1);
    encoded(extent, &options(CodecChoice::S3dc, bits, [block, 1, 1]), |c| samples[c[0] as usize])
}

#[test] // hard cases: K-05, K-06, K-07, K-08, K-09, K-10, K-11, K-12, K-19
#[cfg_attr(feature = "skip-gpu-tests", ignore = "no GPU adapter: built with skip-gpu-tests")]
fn edges_of_the_number_range_decode_alike() {
    let fit = gpu().fit(None);
    let wide: Vec<u16> = (0..48).map(|i| if i % 4 == 0 { 65_535 } else { i * 1365 }).collect();
    let signed: Vec<i16> = (0..48).map(|i| [i16::MIN, i16::MAX, -1, i * 680][i as usize % 4]).collect();
    let ties: Vec<u8> = [0, 2, 1, 1].repeat(12);
    let far: Vec<f32> = [-3e38, 3e38, 0.0, 1e38].repeat(12);
    let near: Vec<f32> = [1.0f32, 1.0f32.next_up(), 1.0, 1.0].repeat(12);
    let tiny: Vec<f32> = [1e-45, 1e-40, 0.0, -1e-42].repeat(12);
    let zeros: Vec<f32> = [-0.0, 0.0, -0.0, 5.0].repeat(12);
    for bits in [1, 2, 4, 8] {
        for block in [2, 4, 16] {
            check_volume(&row(bits, block, &wide), &fit, "wide");
            check_volume(&row(bits, block, &signed), &fit, "signed");
            check_volume(&row(bits, block, &ties), &fit, "ties");
            check_volume(&row(bits, block, &far), &fit, "far");
            check_volume(&row(bits, block, &near), &fit, "near");
            check_volume(&row(bits, block, &tiny), &fit, "tiny");
            check_volume(&row(bits, block, &zeros), &fit, "zeros");
        }
    }
}
