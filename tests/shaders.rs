//! Every shader that a scene can ask for is parsed and validated, and holds what it should: no GPU needed.
#![cfg(feature = "gpu")]

use naga::valid::{Capabilities, ValidationFlags, Validator};
use naga::{AddressSpace, TypeInner};
use vug::gpu::key::{Form, Gradient, Texel};
use vug::gpu::layout::{DecodeParams, Frame, Point, VolumeParams};
use vug::gpu::level::TexelFormat;
use vug::gpu::pass::decode;
use vug::gpu::{Effect, Effects, Lens, PipelineKey, Projection, Sampler, Traversal, VolumeKey};

fn forms() -> Vec<VolumeKey> {
    let mut all = Vec::new();
    for texel in [Texel::Uint, Texel::Sint, Texel::Float] {
        for form in [Form::Raw(texel), Form::S3dc(texel)] {
            for folded in [false, true] {
                all.push(VolumeKey { form, colour: false, folded });
            }
        }
    }
    all.push(VolumeKey { form: Form::Raw(Texel::Uint), colour: true, folded: false });
    for (pages, new, wide, signed, colour) in [
        (1, true, false, false, false),
        (1, false, false, false, false),
        (3, true, true, false, false),
        (16, false, true, true, false),
        (0, true, false, false, true),
        (2, false, false, false, true),
    ] {
        all.push(VolumeKey { form: Form::Zerobit { pages, new, wide, signed }, colour, folded: false });
    }
    all
}

fn keys() -> Vec<PipelineKey> {
    let mut all = Vec::new();
    let mut add = |key: PipelineKey| {
        if key.check().is_ok() {
            all.push(key);
        }
    };
    let base = |form: VolumeKey| PipelineKey {
        traversal: Traversal::Raycast,
        projection: Projection::Composite,
        lens: Lens::Perspective,
        sampler: Sampler::Linear,
        gradient: Gradient::Reuse,
        effects: Effects::NONE,
        volumes: vec![form],
    };
    for form in forms() {
        for &sampler in Sampler::ALL {
            for &projection in Projection::ALL {
                for gradient in [Gradient::Naive, Gradient::Reuse] {
                    let effects = Effects::all_sets().last().unwrap();
                    add(PipelineKey { sampler, projection, gradient, effects, volumes: vec![form; 2], ..base(form) });
                    add(PipelineKey {
                        sampler,
                        projection,
                        gradient,
                        volumes: vec![form; 3],
                        lens: Lens::Orthographic,
                        ..base(form)
                    });
                }
            }
        }
    }
    for form in forms() {
        for traversal in [Traversal::Slice, Traversal::CutPlane] {
            for (sampler, lens) in [(Sampler::Linear, Lens::Perspective), (Sampler::Nearest, Lens::Orthographic)] {
                let effects = Effects::all_sets().last().unwrap();
                add(PipelineKey { traversal, sampler, lens, effects, volumes: vec![form; 2], ..base(form) });
                add(PipelineKey { traversal, sampler, lens, volumes: vec![form; 3], ..base(form) });
                add(PipelineKey { traversal, sampler, lens, ..base(form) });
            }
        }
    }
    for effects in Effects::all_sets() {
        for &projection in Projection::ALL {
            let volumes = vec![forms()[2]; 1 + usize::from(effects.has(Effect::TimeInterp))];
            add(PipelineKey { effects, projection, volumes, ..base(forms()[2]) });
        }
    }
    all
}

fn parse(key: &PipelineKey) -> naga::Module {
    parse_text(&key.wgsl(), &format!("{key:?}"))
}

fn parse_text(text: &str, what: &str) -> naga::Module {
    let module =
        naga::front::wgsl::parse_str(text).unwrap_or_else(|e| panic!("{what}\n{}\n{text}", e.emit_to_string(text)));
    Validator::new(ValidationFlags::all(), Capabilities::empty())
        .validate(&module)
        .unwrap_or_else(|e| panic!("{what}\n{}\n{text}", e.emit_to_string(text)));
    module
}

/// Names and byte offsets.
type Fields = &'static [(&'static str, usize)];

fn check_structure(module: &naga::Module, name: &str, fields: Fields, size: usize) {
    let (_, ty) = module.types.iter().find(|(_, t)| t.name.as_deref() == Some(name)).unwrap();
    let TypeInner::Struct { members, span } = &ty.inner else { panic!("{name} is no structure") };
    assert_eq!(*span as usize, size, "{name}");
    let found: Vec<_> = members.iter().map(|m| (m.name.as_deref().unwrap(), m.offset as usize)).collect();
    assert_eq!(found, fields, "{name}");
}

#[test]
fn every_shader_is_valid_and_binds_what_its_key_says() {
    let keys = keys();
    assert!(keys.len() > 700, "{}", keys.len());
    for key in &keys {
        let module = parse(key);
        let mut found: Vec<(u32, u32, String)> = module
            .global_variables
            .iter()
            .filter_map(|(_, v)| Some((v.binding?.group, v.binding?.binding, v.name.clone()?)))
            .collect();
        found.sort();
        let mut due: Vec<_> = key
            .bindings()
            .iter()
            .map(|b| {
                let suffix = if b.group > 0 { format!("_{}", b.group - 1) } else { String::new() };
                (b.group, b.binding, format!("{}{suffix}", b.name))
            })
            .collect();
        due.sort();
        assert_eq!(found, due, "{key:?}");
        assert!(module.entry_points.iter().any(|e| e.name == key.entry()));
    }
}

#[test]
fn decode_passes_are_valid() {
    for key in forms().into_iter().filter(|k| !matches!(k.form, Form::Raw(_))) {
        let formats: &[TexelFormat] = match key.colour {
            true => &[TexelFormat::Rgba8Uint, TexelFormat::Rgba8Unorm],
            false => &[TexelFormat::R32Float],
        };
        for &format in formats {
            let text = decode::shader(&key, format).unwrap();
            let module = parse_text(&text, &format!("{key:?} {format:?}"));
            check_structure(&module, "DecodeParams", DecodeParams::FIELDS, size_of::<DecodeParams>());
        }
    }
}

#[test]
fn structures_lie_alike_on_both_sides() {
    let module = parse(&keys()[0]);
    let due: [(&str, Fields, usize); 3] = [
        ("Frame", Frame::FIELDS, size_of::<Frame>()),
        ("Point", Point::FIELDS, size_of::<Point>()),
        ("VolumeParams", VolumeParams::FIELDS, size_of::<VolumeParams>()),
    ];
    for (name, fields, size) in due {
        check_structure(&module, name, fields, size);
    }
    assert!(module.global_variables.iter().any(|(_, v)| v.space == AddressSpace::Uniform));
}
