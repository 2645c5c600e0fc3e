// The gradient of the sampled field by central differences of one voxel: 6 more samples. Per voxel along x, y and z.

fn gradient_V(p: vec3f) -> vec3f {
    let base = base_of_V(p);
    let f = p - vec3f(base);
//+if zerobit_V
    // One after the other, as in sample_linear.
    var g = vec3f(0.0);
    for (var i = 0u; i < 6u; i++) {
        let axis = vec3u(i >> 1u) == vec3u(0u, 1u, 2u);
        let to = select(-1, 1, (i & 1u) == 0u);
        let v = grey_V(lerp_V(base + select(vec3i(0), vec3i(to), axis), f));
        g += select(vec3f(0.0), vec3f(v * f32(to)), axis);
    }
    return 0.5 * g;
//+else
    let x = grey_V(lerp_V(base + vec3i(1, 0, 0), f)) - grey_V(lerp_V(base - vec3i(1, 0, 0), f));
    let y = grey_V(lerp_V(base + vec3i(0, 1, 0), f)) - grey_V(lerp_V(base - vec3i(0, 1, 0), f));
    let z = grey_V(lerp_V(base + vec3i(0, 0, 1), f)) - grey_V(lerp_V(base - vec3i(0, 0, 1), f));
    return 0.5 * vec3f(x, y, z);
//+end
}

// The gradient in world units, along the axes of the world.
fn world_V(g: vec3f) -> vec3f {
    return g.x * volume_V.world_x + g.y * volume_V.world_y + g.z * volume_V.world_z;
}
