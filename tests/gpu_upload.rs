//! What lies on the GPU is what lies in the file, byte for byte: textures and buffers are read back.
#![cfg(feature = "gpu")]

mod gpu_support;
mod support;

use gpu_support::{encoded, gpu, host, of_all_types, options, part, upload};
use vug::codec::{Codec, s3dc};
use vug::gpu::level::{Fit, HostLevel, LevelLayout, Role, TABLE_STORED, TABLE_WORDS, TexelFormat};
use vug::gpu::{AdapterChoice, Gpu, GpuLevel, Source};
use vug::volume::{At, BrickPayload, CodecChoice, Volume};
use vug::{Extent, Region, error::Code};

/// Limits under which a level of a few bricks is cut into tiles.
fn tight() -> Fit {
    Fit { max_3d: 64, ..gpu().fit(None) }
}

/// The texels of a box of a texture that was read back.
fn texels(all: &[u8], size: [u32; 3], origin: [u32; 3], part: [u32; 3], bytes: u32) -> Vec<u8> {
    let row = (part[0] * bytes) as usize;
    let mut out = Vec::new();
    for z in origin[2]..origin[2] + part[2] {
        for y in origin[1]..origin[1] + part[1] {
            let at = (origin[0] + size[0] * (y + size[1] * z)) as usize * bytes as usize;
            out.extend_from_slice(&all[at..at + row]);
        }
    }
    out
}

/// Holds every stored brick's payload in the file against the texels that it should have become.
fn check_payloads(volume: &Volume, level: &GpuLevel) -> u64 {
    let layout = &level.layout;
    let textures: Vec<Vec<u8>> = level.textures.iter().map(|t| gpu().read_texture(t).unwrap()).collect();
    let (mut stored, [nx, ny, nz]) = (0, layout.bricks);
    for brick in (0..nz).flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z]))) {
        let BrickPayload::Stored { codec, extent, bytes } = volume.brick_payload(layout.at, brick).unwrap() else {
            continue;
        };
        let part = |role: Role| match codec {
            Codec::S3dc(p) => {
                let lies = s3dc::Layout::new(p, volume.info().sample_type, extent);
                if role == Role::Minmax { &bytes[..lies.mmv_bytes()] } else { &bytes[lies.iv_start()..] }
            }
            _ => &bytes[..],
        };
        for (t, all) in layout.textures.iter().zip(&textures) {
            let place = layout.fold.place(brick);
            let origin = std::array::from_fn(|a| place[a] * t.per_brick[a]);
            let found = texels(all, t.size, origin, t.texels(extent), t.format.bytes());
            assert!(found == part(t.role), "{:?} of brick {brick:?}, {:?}", t.role, layout.store);
            stored += found.len() as u64;
        }
    }
    stored
}

#[test] // S-16, S-17, S-44, V27
#[cfg_attr(feature = "skip-gpu-tests", ignore = "no GPU adapter: built with skip-gpu-tests")]
fn textures_hold_the_payloads_byte_for_byte() {
    let extent = Extent::new(35, 18, 85);
    for (codec, bits, block) in
        [(CodecChoice::S3dc, 4, [4; 3]), (CodecChoice::S3dc, 2, [3, 5, 7]), (CodecChoice::Raw, 4, [4; 3])]
    {
        for volume in of_all_types(extent, &options(codec, bits, block)) {
            for fit in [gpu().fit(None), tight()] {
                let layout = LevelLayout::new(&volume, At::default(), Source::Direct, &fit).unwrap();
                let level = upload(&volume, layout);
                assert_eq!(level.layout.fold.is_flat(), fit != tight());
                // Every byte that was sent is a byte of a payload, and every payload was sent once.
                assert_eq!(level.filled.payload_bytes, check_payloads(&volume, &level));
                assert_eq!(level.filled.repacked_bytes, 0);
                // CONSTANT and EMPTY bricks: the same texels as in memory.
                let expected = host(&volume, level.layout.clone());
                for (texture, expected) in level.textures.iter().zip(&expected.textures) {
                    assert!(gpu().read_texture(texture).unwrap() == *expected);
                }
                assert_eq!(level.filled, expected.filled);
            }
        }
    }
}

#[test]
#[cfg_attr(feature = "skip-gpu-tests", ignore = "no GPU adapter: built with skip-gpu-tests")]
fn decoded_and_coloured_samples_arrive() {
    let grey = encoded(Extent::new(35, 18, 85), &options(CodecChoice::S3dc, 4, [4; 3]), |c| {
        part(c, |h| (h % 65536) as f32) as u16
    });
    let colour = encoded(Extent::new(20, 18, 33), &options(CodecChoice::Zerobit, 4, [4; 3]), |c| {
        let [r, g, b, _] = support::hash(c.map(|v| v / 4)).to_le_bytes();
        [r, g, b]
    });
    for volume in [&grey, &colour] {
        let level = upload(volume, LevelLayout::new(volume, At::default(), Source::Decoded, &gpu().fit(None)).unwrap());
        let found = gpu().read_texture(&level.textures[0]).unwrap();
        let grid = volume.read_region(At::default(), Region::whole(level.layout.extent)).unwrap();
        let expected: Vec<u8> = match grid.bytes().len() == found.len() {
            true => grid.bytes().to_vec(),
            false => grid.bytes().chunks_exact(3).flat_map(|c| [c[0], c[1], c[2], 0]).collect(),
        };
        assert!(found == expected);
        assert_eq!((level.filled.payload_bytes, level.filled.repacked_bytes > 0), (0, true));
    }
}

#[test] // S-22; hard case: R-31
#[cfg_attr(feature = "skip-gpu-tests", ignore = "no GPU adapter: built with skip-gpu-tests")]
fn streams_lie_whole_in_pages() {
    let volume = encoded(Extent::new(35, 18, 85), &options(CodecChoice::Zerobit, 4, [4; 3]), |c| {
        part(c, |h| (h % 256) as f32) as u8
    });
    let fit = Fit { max_binding: 6000, storage_buffers: 64, ..gpu().fit(None) };
    let level = upload(&volume, LevelLayout::new(&volume, At::default(), Source::Direct, &fit).unwrap());
    let pages: Vec<Vec<u8>> = level.pages.iter().map(|p| gpu().read_buffer(p).unwrap()).collect();
    assert!(pages.len() > 1 && pages.iter().all(|p| p.len() <= 6000 && p.len() % 4 == 0));
    let table = gpu().read_buffer(&level.tables.as_ref().unwrap()[0]).unwrap();
    let words: Vec<u32> = table.chunks_exact(4).map(|b| u32::from_le_bytes(b.try_into().unwrap())).collect();
    let (mut total, [nx, ny, nz]) = (0, level.layout.bricks);
    for (i, entry) in (0..nx * ny * nz).zip(words.chunks_exact(TABLE_WORDS as usize)) {
        let brick = [i % nx, i / nx % ny, i / nx / ny];
        if let BrickPayload::Stored { bytes, .. } = volume.brick_payload(At::default(), brick).unwrap() {
            let from = entry[1] as usize * 4;
            assert_eq!(pages[(entry[0] - TABLE_STORED) as usize][from..from + entry[2] as usize], *bytes);
            total += bytes.len() as u64;
        } else {
            assert!(entry[0] < TABLE_STORED);
        }
    }
    assert_eq!(level.filled.payload_bytes, total);
}

#[test] // hard case: D-59
#[cfg_attr(feature = "skip-gpu-tests", ignore = "no GPU adapter: built with skip-gpu-tests")]
fn a_row_of_seventy_thousand_voxels_is_laid_in_tiles() {
    let volume =
        encoded(Extent::new(70_000, 2, 2), &options(CodecChoice::S3dc, 4, [4; 3]), |c| (support::hash(c) % 256) as u8);
    let layout =
        LevelLayout::new(&volume, At::default(), Source::Direct, &Fit { max_3d: 2048, ..gpu().fit(None) }).unwrap();
    assert!(!layout.fold.is_flat() && layout.textures.iter().all(|t| t.size.iter().all(|&n| n <= 2048)), "{layout:?}");
    let level = upload(&volume, layout);
    assert_eq!(check_payloads(&volume, &level), level.filled.payload_bytes);
}

#[test] // V27: all formats are core; the others are only used where the adapter has them
#[cfg_attr(feature = "skip-gpu-tests", ignore = "no GPU adapter: built with skip-gpu-tests")]
fn a_device_with_the_least_limits_is_enough() {
    let least = Gpu::open(&AdapterChoice { portable: true, ..AdapterChoice::default() }).unwrap();
    assert_eq!(least.fit(None), Fit::portable());
    assert!(least.features.is_empty());
    for volume in of_all_types(Extent::new(35, 18, 85), &options(CodecChoice::S3dc, 4, [4; 3])) {
        for source in [Source::Direct, Source::Decoded] {
            let layout = LevelLayout::new(&volume, At::default(), source, &least.fit(None)).unwrap();
            let level = GpuLevel::upload(&least, &volume, layout, &|_| true, &mut |_, _| {}).unwrap();
            let expected = host(&volume, level.layout.clone());
            for (texture, expected) in level.textures.iter().zip(&expected.textures) {
                assert!(least.read_texture(texture).unwrap() == *expected);
            }
        }
    }
}

#[test] // V6
#[cfg_attr(feature = "skip-gpu-tests", ignore = "no GPU adapter: built with skip-gpu-tests")]
fn all_numbers_of_16_bits_come_back_from_normalised_texels() {
    for v in 0..=u16::MAX {
        assert_eq!((f32::from(v) / 65535.0 * 65535.0).round(), f32::from(v));
    }
    if !gpu().features.contains(wgpu::Features::TEXTURE_FORMAT_16BIT_NORM) {
        println!("this adapter has no 16-bit normalised textures: the texels are f32 instead");
    }
    let volume = encoded(Extent::new(64, 64, 16), &options(CodecChoice::Raw, 4, [4; 3]), |c| {
        (c[0] + 64 * c[1] + 4096 * c[2]) as u16
    });
    let fit = gpu().fit(None);
    if !fit.norm16 && !fit.filter_f32 {
        return assert!(LevelLayout::new_filtered(&volume, At::default(), Source::Direct, &fit).is_err());
    }
    let level = upload(&volume, LevelLayout::new_filtered(&volume, At::default(), Source::Direct, &fit).unwrap());
    let found = gpu().read_texture(&level.textures[0]).unwrap();
    for (v, texel) in (0..=u16::MAX).zip(found.chunks_exact(level.layout.textures[0].format.bytes() as usize)) {
        match level.layout.textures[0].format {
            TexelFormat::R16Unorm => assert_eq!(texel, v.to_le_bytes()),
            _ => assert_eq!(texel, f32::from(v).to_le_bytes()),
        }
    }
}

#[test]
#[cfg_attr(feature = "skip-gpu-tests", ignore = "no GPU adapter: built with skip-gpu-tests")]
fn errors_say_what_would_do() {
    let volume =
        encoded(Extent::cube(64), &options(CodecChoice::S3dc, 8, [4; 3]), |c| (support::hash(c) % 60000) as u16);
    let error = LevelLayout::new(&volume, At::default(), Source::Direct, &gpu().fit(Some(200_000))).unwrap_err();
    assert_eq!((error.code(), error.field()), (Code::Limit, "gpu-mem"));
    assert!(error.message().contains("what fits: level 1 (34.0 KiB)"), "{error}");
    let none =
        Gpu::open(&AdapterChoice { name: Some("no such thing".into()), ..AdapterChoice::default() }).unwrap_err();
    assert!(none.message().contains(&gpu().adapter_info.name) && none.message().contains("--adapter cpu"), "{none}");
    assert!(Gpu::list().contains(&gpu().adapter_info));
    // What the device itself refuses comes as an error, not as a panic.
    let huge = gpu().checked(|| {
        gpu().device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: gpu().limits.max_buffer_size + 4,
            usage: wgpu::BufferUsages::STORAGE,
            mapped_at_creation: false,
        })
    });
    assert_eq!(huge.unwrap_err().code(), Code::Source);
}

#[test] // D-38: what is there is not sent again
#[cfg_attr(feature = "skip-gpu-tests", ignore = "no GPU adapter: built with skip-gpu-tests")]
fn bricks_are_added_to_those_that_are_there() {
    let extent = Extent::new(35, 18, 85);
    for codec in [CodecChoice::S3dc, CodecChoice::Zerobit] {
        let volume = encoded(extent, &options(codec, 4, [4; 3]), |c| part(c, |h| (h % 256) as f32) as u8);
        for fit in [gpu().fit(None), tight()] {
            let layout = LevelLayout::new(&volume, At::default(), Source::Direct, &fit).unwrap();
            let odd = |b: [u32; 3]| (b[0] + b[1] + b[2]) % 2 == 1;
            let some = |b: [u32; 3]| odd(b) && b[2] > 0;
            let mut level = GpuLevel::upload(gpu(), &volume, layout.clone(), &some, &mut |_, _| {}).unwrap();
            let mut memory = HostLevel::load(&volume, layout.clone(), &some, &mut |_, _| {}).unwrap();
            assert!(level.resident.has(&layout, [0, 0, 1]) && !level.resident.has(&layout, [0, 0, 0]));
            let wanted: [&dyn Fn([u32; 3]) -> bool; 3] = [&odd, &|_| true, &|_| true];
            let more: Vec<_> = wanted
                .iter()
                .map(|wanted| {
                    let added = level.add(gpu(), &volume, wanted, &mut |_, _| {}).unwrap();
                    assert_eq!(added, memory.add(&volume, wanted, &mut |_, _| {}).unwrap());
                    added
                })
                .collect();
            assert_eq!((more[2].bricks, more[2].payload_bytes), (0, 0));
            assert!(more[0].bricks > 0 && more[1].bricks > more[0].bricks);
            // In the end all is there once.
            let all = host(&volume, layout);
            assert_eq!(
                (level.filled.payload_bytes, level.filled.bricks),
                (all.filled.payload_bytes, all.filled.bricks)
            );
            assert!(memory.textures == all.textures);
            for (texture, expected) in level.textures.iter().zip(&all.textures) {
                assert!(gpu().read_texture(texture).unwrap() == *expected);
            }
            for (page, expected) in level.pages.iter().zip(&memory.pages) {
                let found = gpu().read_buffer(page).unwrap();
                assert!(found[..expected.len() * 4].chunks_exact(4).zip(expected).all(|(b, w)| *b == w.to_le_bytes()));
            }
            if let Some([table, _]) = &level.tables {
                let found = gpu().read_buffer(table).unwrap();
                assert!(found.chunks_exact(4).zip(&memory.table).all(|(b, w)| *b == w.to_le_bytes()));
                assert_eq!(level.pages.len(), 1, "what is added goes on in the last page");
            }
        }
    }
}
