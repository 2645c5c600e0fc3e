// Voxels of an uncompressed texture: one fetch.

@group(GROUP_V) @binding(1) var raw_V: texture_3d<TEXEL_V>;

fn voxel_V(c: vec3u) -> VALUE_V {
    return VALUE_V(textureLoad(raw_V, texel_V(c), 0).SWIZZLE_V);
}

fn texel_V(c: vec3u) -> vec3u {
//+if folded_V
    return fold_V(c >> vec3u(BRICK_LOG2_V)) * volume_V.brick + (c & vec3u((1u << BRICK_LOG2_V) - 1u));
//+else
    return c;
//+end
}
