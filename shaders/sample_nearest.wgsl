// The value at a place: that of the nearest voxel. Halfway between two, the upper one.

fn sample_V(p: vec3f) -> VALUE_V {
    return lerp_V(vec3i(floor(p + vec3f(0.5))), vec3f(0.0));
}

fn base_of_V(p: vec3f) -> vec3i {
    return vec3i(floor(p + vec3f(0.5)));
}

// The voxel at `base`; outside of the volume, the nearest inside.
fn lerp_V(base: vec3i, f: vec3f) -> VALUE_V {
    return voxel_V(vec3u(clamp(base, vec3i(0), volume_V.last)));
}
