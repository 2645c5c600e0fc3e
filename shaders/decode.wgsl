// Voxels of a level, decoded into a texture that samplers read instead (source = "deferred"): each word and pair is fetched once per
// invocation. The same functions as in pictures decode them.

//+if s3dc
// One invocation decodes the voxels of one word: they are neighbours along x, in one brick.
@compute @workgroup_size(16, 4, 4)
fn decode(@builtin(global_invocation_id) id: vec3u) {
    let first = vec3u((id.x + volume_0.first.x) << WORD_LOG2_0, id.yz + volume_0.first.yz);
    if (any(first >= volume_0.extent)) {
        return;
    }
    let word = word_0(first);
    let end = min(first.x + (1u << WORD_LOG2_0), volume_0.extent.x);
    var block = block_0(first);
    var pair = pair_0(block);
    for (var x = first.x; x < end; x++) {
        let c = vec3u(x, first.yz);
        let own = block_0(c);
        if (own.x != block.x) {
            block = own;
            pair = pair_0(block);
        }
        store(c, reconstruct_0(pair, index_of_0(word, x)));
    }
}
//+else
@compute @workgroup_size(16, 4, 4)
fn decode(@builtin(global_invocation_id) id: vec3u) {
    let c = id + volume_0.first;
    if (any(c >= volume_0.extent)) {
        return;
    }
    store(c, voxel_0(c));
}
//+end

//+if words
@group(0) @binding(0) var<storage, read_write> out: array<u32>;

// The bits of the sample, x fastest: for comparing decoders.
fn store(c: vec3u, v: DECODED) {
    let at = c.x + volume_0.extent.x * (c.y + volume_0.extent.y * c.z);
//+if colour
    let rgb = vec3u(v);
    out[at] = rgb.x | (rgb.y << 8u) | (rgb.z << 16u);
//+else
//+if float
    out[at] = bitcast<u32>(v);
//+else
    out[at] = u32(i32(v));
//+end
//+end
}
//+else
//+if colour
//+if filtered
@group(0) @binding(0) var out: texture_storage_3d<rgba8unorm, write>;

fn store(c: vec3u, v: DECODED) {
    textureStore(out, place(c), vec4f(v / 255.0, 0.0));
}
//+else
@group(0) @binding(0) var out: texture_storage_3d<rgba8uint, write>;

fn store(c: vec3u, v: DECODED) {
    textureStore(out, place(c), vec4u(vec3u(v), 0u));
}
//+end
//+else
@group(0) @binding(0) var out: texture_storage_3d<r32float, write>;

fn store(c: vec3u, v: DECODED) {
    textureStore(out, place(c), vec4f(v, 0.0, 0.0, 0.0));
}
//+end

fn place(c: vec3u) -> vec3u {
//+if folded
    return fold_0(c >> vec3u(BRICK_LOG2_0)) * volume_0.brick + (c & vec3u((1u << BRICK_LOG2_0) - 1u));
//+else
    return c;
//+end
}
//+end
