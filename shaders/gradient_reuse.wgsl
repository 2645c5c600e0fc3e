// The gradient of the trilinear field by central differences of one voxel, like gradient.wgsl, from the 32 voxels that its six samples
// need together: 12 rows along x, in which each word is fetched once; pairs of end points are kept in a small table.

struct Row_V {
    before: f32,
    near: f32,
    far: f32,
    behind: f32,
}

// End points of the blocks from that of the first voxel on, two along each axis, and which of them are there.
struct Pairs_V {
    first: vec3u,
    have: u32,
    pairs: array<vec2<TEXEL_V>, 8>,
}

fn kept_V(kept: ptr<function, Pairs_V>, c: vec3u) -> vec2<TEXEL_V> {
    let block = block_V(c);
    let d = block - (*kept).first;
    if (any(d > vec3u(1u))) {
        return pair_V(block);
    }
    let slot = d.x + 2u * d.y + 4u * d.z;
    if (((*kept).have >> slot & 1u) == 0u) {
        (*kept).pairs[slot] = pair_V(block);
        (*kept).have |= 1u << slot;
    }
    return (*kept).pairs[slot];
}

// Voxels x, at row (y, z); the outer two of them only where `long`.
fn row_V(kept: ptr<function, Pairs_V>, x: vec4u, y: u32, z: u32, long: bool) -> Row_V {
    var r: Row_V;
    var word = 0u;
    var at = 0xffffffffu;
    if (long) {
        at = x.x >> WORD_LOG2_V;
        word = word_V(vec3u(x.x, y, z));
        r.before = reconstruct_V(kept_V(kept, vec3u(x.x, y, z)), index_of_V(word, x.x));
    }
    if (x.y >> WORD_LOG2_V != at) {
        at = x.y >> WORD_LOG2_V;
        word = word_V(vec3u(x.y, y, z));
    }
    r.near = reconstruct_V(kept_V(kept, vec3u(x.y, y, z)), index_of_V(word, x.y));
    if (x.z >> WORD_LOG2_V != at) {
        at = x.z >> WORD_LOG2_V;
        word = word_V(vec3u(x.z, y, z));
    }
    r.far = reconstruct_V(kept_V(kept, vec3u(x.z, y, z)), index_of_V(word, x.z));
    if (long) {
        if (x.w >> WORD_LOG2_V != at) {
            word = word_V(vec3u(x.w, y, z));
        }
        r.behind = reconstruct_V(kept_V(kept, vec3u(x.w, y, z)), index_of_V(word, x.w));
    }
    return r;
}

fn bilinear_V(v00: f32, v10: f32, v01: f32, v11: f32, f: vec2f) -> f32 {
    let v0 = v00 + (v10 - v00) * f.x;
    let v1 = v01 + (v11 - v01) * f.x;
    return v0 + (v1 - v0) * f.y;
}

fn gradient_V(p: vec3f) -> vec3f {
    let base = base_of_V(p);
    let f = p - vec3f(base);
    let last = volume_V.last;
    let x = vec4u(clamp(vec4i(base.x) + vec4i(-1, 0, 1, 2), vec4i(0), vec4i(last.x)));
    let y = vec4u(clamp(vec4i(base.y) + vec4i(-1, 0, 1, 2), vec4i(0), vec4i(last.y)));
    let z = vec4u(clamp(vec4i(base.z) + vec4i(-1, 0, 1, 2), vec4i(0), vec4i(last.z)));
    var kept: Pairs_V;
    kept.first = block_V(vec3u(x.x, y.x, z.x));
    let r11 = row_V(&kept, x, y.y, z.y, true);
    let r21 = row_V(&kept, x, y.z, z.y, true);
    let r12 = row_V(&kept, x, y.y, z.z, true);
    let r22 = row_V(&kept, x, y.z, z.z, true);
    let r01 = row_V(&kept, x, y.x, z.y, false);
    let r02 = row_V(&kept, x, y.x, z.z, false);
    let r31 = row_V(&kept, x, y.w, z.y, false);
    let r32 = row_V(&kept, x, y.w, z.z, false);
    let r10 = row_V(&kept, x, y.y, z.x, false);
    let r20 = row_V(&kept, x, y.z, z.x, false);
    let r13 = row_V(&kept, x, y.y, z.w, false);
    let r23 = row_V(&kept, x, y.z, z.w, false);
    // The same order of operations as trilinear samples: x, then y, then z.
    let x1 = tri_V(r11.far, r11.behind, r21.far, r21.behind, r12.far, r12.behind, r22.far, r22.behind, f);
    let x0 = tri_V(r11.before, r11.near, r21.before, r21.near, r12.before, r12.near, r22.before, r22.near, f);
    let y1 = tri_V(r21.near, r21.far, r31.near, r31.far, r22.near, r22.far, r32.near, r32.far, f);
    let y0 = tri_V(r01.near, r01.far, r11.near, r11.far, r02.near, r02.far, r12.near, r12.far, f);
    let z1 = tri_V(r12.near, r12.far, r22.near, r22.far, r13.near, r13.far, r23.near, r23.far, f);
    let z0 = tri_V(r10.near, r10.far, r20.near, r20.far, r11.near, r11.far, r21.near, r21.far, f);
    return 0.5 * vec3f(x1 - x0, y1 - y0, z1 - z0);
}

fn tri_V(v000: f32, v100: f32, v010: f32, v110: f32, v001: f32, v101: f32, v011: f32, v111: f32, f: vec3f) -> f32 {
    let v0 = bilinear_V(v000, v100, v010, v110, f.xy);
    let v1 = bilinear_V(v001, v101, v011, v111, f.xy);
    return v0 + (v1 - v0) * f.z;
}

// The gradient in world units, along the axes of the world.
fn world_V(g: vec3f) -> vec3f {
    return g.x * volume_V.world_x + g.y * volume_V.world_y + g.z * volume_V.world_z;
}
