// The gradient of the trilinear field by central differences of one voxel, like gradient.wgsl, from the 32 voxels that its six samples
// need together: 12 rows along x. Each word is fetched once per row, and each pair of end points once. Loops run as often as there
// are words and blocks, once where all voxels lie in one; no array is indexed, so that all values stay in registers.

// Blocks of three voxels or more: four voxels in a row lie in two of them at most.
fn few_V() -> bool {
    return ALIGNED_V && BLOCK_X_V > 2u && BLOCK_Y_V > 2u && BLOCK_Z_V > 2u;
}

// Indices of the voxels x in row (y, z), of those in the word that begins at `at`; the others as they were.
fn row_V(had: vec4u, x: vec4u, at: u32, y: u32, z: u32) -> vec4u {
    let word = word_V(vec3u(at, y, z));
    let i = vec4u(index_of_V(word, x.x), index_of_V(word, x.y), index_of_V(word, x.z), index_of_V(word, x.w));
    return select(had, i, (x >> vec4u(WORD_LOG2_V)) == vec4u(at >> WORD_LOG2_V));
}

// Values of a row, of the voxels in the block that has this pair of end points; the others as they were.
fn fill_V(had: vec4f, pair: vec2<TEXEL_V>, i: vec4u, here: vec4<bool>) -> vec4f {
    return select(had, vec4f(reconstruct_V(pair, i.x), reconstruct_V(pair, i.y), reconstruct_V(pair, i.z), reconstruct_V(pair, i.w)), here);
}

// Values of a row, each by its own block.
fn each_V(x: vec4u, y: u32, z: u32, i: vec4u, long: bool) -> vec4f {
    var v = vec4f(0.0);
    if (long) {
        v.x = reconstruct_V(pair_V(block_V(vec3u(x.x, y, z))), i.x);
        v.w = reconstruct_V(pair_V(block_V(vec3u(x.w, y, z))), i.w);
    }
    v.y = reconstruct_V(pair_V(block_V(vec3u(x.y, y, z))), i.y);
    v.z = reconstruct_V(pair_V(block_V(vec3u(x.z, y, z))), i.z);
    return v;
}

fn gradient_V(p: vec3f) -> vec3f {
    let base = base_of_V(p);
    let f = p - vec3f(base);
    let last = volume_V.last;
    let x = vec4u(clamp(vec4i(base.x) + vec4i(-1, 0, 1, 2), vec4i(0), vec4i(last.x)));
    let y = vec4u(clamp(vec4i(base.y) + vec4i(-1, 0, 1, 2), vec4i(0), vec4i(last.y)));
    let z = vec4u(clamp(vec4i(base.z) + vec4i(-1, 0, 1, 2), vec4i(0), vec4i(last.z)));
    // Rows by y and z: four of four voxels, eight of the two in the middle.
    var i11 = vec4u(0u);
    var i21 = i11;
    var i12 = i11;
    var i22 = i11;
    var at = x.x;
    loop {
        i11 = row_V(i11, x, at, y.y, z.y);
        i21 = row_V(i21, x, at, y.z, z.y);
        i12 = row_V(i12, x, at, y.y, z.z);
        i22 = row_V(i22, x, at, y.z, z.z);
        if (at >> WORD_LOG2_V == x.w >> WORD_LOG2_V) {
            break;
        }
        at = ((at >> WORD_LOG2_V) + 1u) << WORD_LOG2_V;
    }
    var i01 = vec4u(0u);
    var i02 = i01;
    var i31 = i01;
    var i32 = i01;
    var i10 = i01;
    var i20 = i01;
    var i13 = i01;
    var i23 = i01;
    at = x.y;
    loop {
        i01 = row_V(i01, x, at, y.x, z.y);
        i02 = row_V(i02, x, at, y.x, z.z);
        i31 = row_V(i31, x, at, y.w, z.y);
        i32 = row_V(i32, x, at, y.w, z.z);
        i10 = row_V(i10, x, at, y.y, z.x);
        i20 = row_V(i20, x, at, y.z, z.x);
        i13 = row_V(i13, x, at, y.y, z.w);
        i23 = row_V(i23, x, at, y.z, z.w);
        if (at >> WORD_LOG2_V == x.z >> WORD_LOG2_V) {
            break;
        }
        at = x.z;
    }
    var v11 = vec4f(0.0);
    var v21 = v11;
    var v12 = v11;
    var v22 = v11;
    var v01 = v11;
    var v02 = v11;
    var v31 = v11;
    var v32 = v11;
    var v10 = v11;
    var v20 = v11;
    var v13 = v11;
    var v23 = v11;
    if (few_V()) {
        // Which voxels along an axis lie in another block than the first: bits of the number of their block.
        let lo = vec3u(x.x, y.x, z.x);
        let hi = vec3u(x.w, y.w, z.w);
        let dx = (x / vec4u(BLOCK_X_V)) != vec4u(lo.x / BLOCK_X_V);
        let ny = select(vec4u(0u), vec4u(2u), (y / vec4u(BLOCK_Y_V)) != vec4u(lo.y / BLOCK_Y_V));
        let nz = select(vec4u(0u), vec4u(4u), (z / vec4u(BLOCK_Z_V)) != vec4u(lo.z / BLOCK_Z_V));
        let nx = select(vec4u(0u), vec4u(1u), dx);
        let d = nx.w | ny.w | nz.w;
        var i = 0u;
        loop {
            let m = pair_V(block_V(select(lo, hi, (vec3u(i) & vec3u(1u, 2u, 4u)) != vec3u(0u))));
            v11 = fill_V(v11, m, i11, (nx | vec4u(ny.y | nz.y)) == vec4u(i));
            v21 = fill_V(v21, m, i21, (nx | vec4u(ny.z | nz.y)) == vec4u(i));
            v12 = fill_V(v12, m, i12, (nx | vec4u(ny.y | nz.z)) == vec4u(i));
            v22 = fill_V(v22, m, i22, (nx | vec4u(ny.z | nz.z)) == vec4u(i));
            v01 = fill_V(v01, m, i01, (nx | vec4u(ny.x | nz.y)) == vec4u(i));
            v02 = fill_V(v02, m, i02, (nx | vec4u(ny.x | nz.z)) == vec4u(i));
            v31 = fill_V(v31, m, i31, (nx | vec4u(ny.w | nz.y)) == vec4u(i));
            v32 = fill_V(v32, m, i32, (nx | vec4u(ny.w | nz.z)) == vec4u(i));
            v10 = fill_V(v10, m, i10, (nx | vec4u(ny.y | nz.x)) == vec4u(i));
            v20 = fill_V(v20, m, i20, (nx | vec4u(ny.z | nz.x)) == vec4u(i));
            v13 = fill_V(v13, m, i13, (nx | vec4u(ny.y | nz.w)) == vec4u(i));
            v23 = fill_V(v23, m, i23, (nx | vec4u(ny.z | nz.w)) == vec4u(i));
            if (i == d) {
                break;
            }
            i = ((i | ~d) + 1u) & d;
        }
    } else {
        v11 = each_V(x, y.y, z.y, i11, true);
        v21 = each_V(x, y.z, z.y, i21, true);
        v12 = each_V(x, y.y, z.z, i12, true);
        v22 = each_V(x, y.z, z.z, i22, true);
        v01 = each_V(x, y.x, z.y, i01, false);
        v02 = each_V(x, y.x, z.z, i02, false);
        v31 = each_V(x, y.w, z.y, i31, false);
        v32 = each_V(x, y.w, z.z, i32, false);
        v10 = each_V(x, y.y, z.x, i10, false);
        v20 = each_V(x, y.z, z.x, i20, false);
        v13 = each_V(x, y.y, z.w, i13, false);
        v23 = each_V(x, y.z, z.w, i23, false);
    }
    // The same order of operations as trilinear samples: x, then y, then z.
    let x1 = tri_V(v11.zw, v21.zw, v12.zw, v22.zw, f);
    let x0 = tri_V(v11.xy, v21.xy, v12.xy, v22.xy, f);
    let y1 = tri_V(v21.yz, v31.yz, v22.yz, v32.yz, f);
    let y0 = tri_V(v01.yz, v11.yz, v02.yz, v12.yz, f);
    let z1 = tri_V(v12.yz, v22.yz, v13.yz, v23.yz, f);
    let z0 = tri_V(v10.yz, v20.yz, v11.yz, v21.yz, f);
    return 0.5 * vec3f(x1 - x0, y1 - y0, z1 - z0);
}

// Between four pairs of voxels along x, at (y, z), (y + 1, z), (y, z + 1), (y + 1, z + 1).
fn tri_V(v00: vec2f, v10: vec2f, v01: vec2f, v11: vec2f, f: vec3f) -> f32 {
    let a = vec4f(v00.x, v10.x, v01.x, v11.x);
    let b = vec4f(v00.y, v10.y, v01.y, v11.y);
    let c = a + (b - a) * f.x;
    let d = c.xz + (c.yw - c.xz) * f.y;
    return d.x + (d.y - d.x) * f.z;
}

// The gradient in world units, along the axes of the world.
fn world_V(g: vec3f) -> vec3f {
    return g.x * volume_V.world_x + g.y * volume_V.world_y + g.z * volume_V.world_z;
}
