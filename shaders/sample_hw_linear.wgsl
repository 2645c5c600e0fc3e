// The value at a place, by the texture unit: one fetch. Its fractions have 8 bits on much hardware (hard case R-29).

@group(GROUP_V) @binding(1) var raw_V: texture_3d<f32>;
@group(GROUP_V) @binding(3) var filter_V: sampler;

fn sample_V(p: vec3f) -> VALUE_V {
    let at = (p + vec3f(0.5)) / vec3f(volume_V.last + vec3i(1));
    return VALUE_V(textureSampleLevel(raw_V, filter_V, at, 0.0).SWIZZLE_V) * volume_V.full_scale;
}

fn base_of_V(p: vec3f) -> vec3i {
    return vec3i(floor(p));
}

// Between voxels `base` and `base + 1`.
fn lerp_V(base: vec3i, f: vec3f) -> VALUE_V {
    return sample_V(vec3f(base) + f);
}
