//! Uploading compressed levels, and decoding them on the device.
//!
//! `cargo bench --bench upload [words of a row's name]`. Upload: against writing the same bytes into a plain buffer. Decode pass:
//! bytes read and written, against those of copying a buffer on the device. Ratios within one run are what counts; on a software
//! adapter they say little of a real one.

mod support;

use std::hint::black_box;
use support::{Contestant, interleave, volume, wanted};
use vug::Grid;
use vug::gpu::level::{HostLevel, LevelLayout};
use vug::gpu::pass::decode::DecodePass;
use vug::gpu::{AdapterChoice, Gpu, GpuLevel, Source};
use vug::source::MemorySource;
use vug::volume::{self, At, CodecChoice, EncodeOptions, Quality, Volume};

fn encoded(mut grid: Grid, index_bits: u8, block: u32) -> Volume {
    let quality = Quality::Explicit { index_bits, block: vug::Extent::cube(block) };
    let options =
        EncodeOptions { codec: CodecChoice::S3dc, quality, levels: 1, zstd: false, ..EncodeOptions::default() };
    let mut file = std::io::Cursor::new(Vec::new());
    volume::encode(&mut grid, &mut file, &options, &mut |_, _| {}).expect("a synthetic volume");
    Volume::open(MemorySource(file.into_inner()), Default::default()).expect("what was just written")
}

/// Writes `bytes` into fresh buffers of 64 MiB, and waits.
fn plain_upload(gpu: &Gpu, bytes: &[u8]) {
    for part in bytes.chunks(64 << 20) {
        let usage = wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::STORAGE;
        let wanted = wgpu::BufferDescriptor { label: None, size: part.len() as u64, usage, mapped_at_creation: false };
        let buffer = gpu.device.create_buffer(&wanted);
        gpu.queue.write_buffer(&buffer, 0, part);
        gpu.queue.submit([]);
        gpu.wait().expect("the upload");
        black_box(&buffer);
    }
}

fn main() {
    let gpu = Gpu::open(&AdapterChoice::default()).expect("a GPU adapter");
    let edge: u32 = std::env::var("VUG_BENCH_EDGE").ok().and_then(|v| v.parse().ok()).unwrap_or(256);
    println!("{gpu:?}\nvolume: synthetic {edge}³; rounds interleaved, medians");
    println!(
        "{:<28} {:>9} {:>9} {:>7} | {:>9} {:>9} {:>7}",
        "", "upload", "buffer", "ratio", "decode", "copy", "ratio"
    );
    for (name, bits, block, wide) in [
        ("u8 i=4 b=4", 4, 4, false),
        ("u16 i=4 b=4", 4, 4, true),
        ("u16 i=4 b=16", 4, 16, true),
        ("u16 i=8 b=16", 8, 16, true),
        ("u8 i=2 b=8", 2, 8, false),
    ] {
        if !wanted(name) {
            continue;
        }
        let grid = if wide { volume(edge, |v| (v * 4095.0) as u16) } else { volume(edge, |v| (v * 255.0) as u8) };
        let volume = encoded(grid, bits, block);
        let layout =
            LevelLayout::new(&volume, At::default(), Source::Deferred, &gpu.fit(None)).expect("room for the level");
        let upload = || GpuLevel::upload(&gpu, &volume, layout.clone(), &|_| true, &mut |_, _| {}).expect("the upload");
        let level = upload();
        let host = HostLevel::load(&volume, layout.clone(), &|_| true, &mut |_, _| {}).expect("memory");
        let bytes: Vec<u8> = host.textures.concat();
        assert!(level.filled.bytes() <= bytes.len() as u64);

        let pass = DecodePass::new(&gpu, &level).expect("the pass");
        let size = layout.decoded.expect("source deferred").bytes();
        let usage = wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let wanted = wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false };
        let (from, to) = (gpu.device.create_buffer(&wanted), gpu.device.create_buffer(&wanted));
        let copy = || {
            let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            encoder.copy_buffer_to_buffer(&from, 0, &to, 0, size);
            gpu.queue.submit([encoder.finish()]);
            gpu.wait().expect("the copy");
        };
        let mut contestants: Vec<Contestant<'_>> = vec![
            ("upload".into(), Box::new(|| drop(black_box(upload())))),
            ("buffer".into(), Box::new(|| plain_upload(&gpu, &bytes))),
            ("decode".into(), Box::new(|| pass.run(&gpu).expect("the pass"))),
            ("copy".into(), Box::new(copy)),
        ];
        let rounds = std::env::var("VUG_BENCH_ROUNDS").ok().and_then(|v| v.parse().ok()).unwrap_or(15);
        let times = interleave(rounds, &mut contestants);
        let rate = |i: usize, bytes: u64| bytes as f64 / times[i].median.as_secs_f64() / 1e9;
        let sent = level.filled.bytes();
        let rates = [rate(0, sent), rate(1, bytes.len() as u64), rate(2, sent + size), rate(3, 2 * size)];
        println!(
            "{name:<28} {:>5.2} GB/s {:>4.2} GB/s {:>6.2}× | {:>4.2} GB/s {:>4.2} GB/s {:>6.2}×",
            rates[0],
            rates[1],
            rates[0] / rates[1],
            rates[2],
            rates[3],
            rates[2] / rates[3]
        );
    }
}
