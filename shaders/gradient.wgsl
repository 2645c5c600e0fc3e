// The gradient of the sampled field by central differences of one voxel: 6 more samples. Per voxel along x, y and z.

fn gradient_V(p: vec3f) -> vec3f {
    let base = base_of_V(p);
    let f = p - vec3f(base);
    let x = grey_V(lerp_V(base + vec3i(1, 0, 0), f)) - grey_V(lerp_V(base - vec3i(1, 0, 0), f));
    let y = grey_V(lerp_V(base + vec3i(0, 1, 0), f)) - grey_V(lerp_V(base - vec3i(0, 1, 0), f));
    let z = grey_V(lerp_V(base + vec3i(0, 0, 1), f)) - grey_V(lerp_V(base - vec3i(0, 0, 1), f));
    return 0.5 * vec3f(x, y, z);
}

// The gradient in world units, along the axes of the world.
fn world_V(g: vec3f) -> vec3f {
    return g.x * volume_V.world_x + g.y * volume_V.world_y + g.z * volume_V.world_z;
}
