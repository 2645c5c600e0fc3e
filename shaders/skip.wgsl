// Bricks in which nothing can be seen are jumped over. The samples that are left lie where they would lie without it.

@group(GROUP_V) @binding(4) var visible_V: texture_3d<u32>;

// The number of the next sample that may be seen: k itself, or one not behind the end of the brick around p.
fn next_V(p: vec3f, direction: vec3f, k: u32) -> u32 {
    let c = vec3u(clamp(vec3i(floor(p + vec3f(0.5))), vec3i(0), volume_V.last));
    let brick = c >> vec3u(BRICK_LOG2_V);
//+if folded_V
    let seen = textureLoad(visible_V, fold_V(brick), 0).x;
//+else
    let seen = textureLoad(visible_V, brick, 0).x;
//+end
    if (seen != 0u) {
        return k;
    }
    let lo = vec3f(brick << vec3u(BRICK_LOG2_V)) - vec3f(0.5);
    let hi = lo + vec3f(f32(1u << BRICK_LOG2_V));
    var way = f32(frame.samples);
    for (var a = 0u; a < 3u; a++) {
        if (direction[a] != 0.0) {
            way = min(way, max((select(lo[a], hi[a], direction[a] > 0.0) - p[a]) / direction[a], 0.0) / frame.step);
        }
    }
    // One fewer than fit: rounding must not carry a sample over the face.
    return k + max(u32(min(way, f32(frame.samples))), 2u) - 1u;
}
