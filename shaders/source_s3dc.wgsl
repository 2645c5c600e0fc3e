// Voxels of s3dc textures: a word of indices and a pair of end points, two fetches (S3Dc, §4.2). spec: S3D-7, S3D-9, S3D-18

@group(GROUP_V) @binding(1) var index_V: texture_3d<u32>;
@group(GROUP_V) @binding(2) var minmax_V: texture_3d<TEXEL_V>;

override INDEX_BITS_V: u32 = 4u;
// log2 of the indices in a word.
override WORD_LOG2_V: u32 = 2u;
override BLOCK_X_V: u32 = 4u;
override BLOCK_Y_V: u32 = 4u;
override BLOCK_Z_V: u32 = 4u;
// Whether the grid of blocks goes through: blocks divide bricks, or there is but one along an axis.
override ALIGNED_V: bool = true;

fn voxel_V(c: vec3u) -> VALUE_V {
    return reconstruct_V(pair_V(block_V(c)), index_of_V(word_V(c), c.x));
}

// The word that holds the index of voxel c.
fn word_V(c: vec3u) -> u32 {
//+if folded_V
    let words = vec3u((volume_V.brick.x + (1u << WORD_LOG2_V) - 1u) >> WORD_LOG2_V, volume_V.brick.yz);
    let r = c & vec3u((1u << BRICK_LOG2_V) - 1u);
    let at = fold_V(c >> vec3u(BRICK_LOG2_V)) * words + vec3u(r.x >> WORD_LOG2_V, r.y, r.z);
    return textureLoad(index_V, at, 0).x;
//+else
    return textureLoad(index_V, vec3u(c.x >> WORD_LOG2_V, c.y, c.z), 0).x;
//+end
}

fn index_of_V(word: u32, x: u32) -> u32 {
    return (word >> ((x & ((1u << WORD_LOG2_V) - 1u)) * INDEX_BITS_V)) & ((1u << INDEX_BITS_V) - 1u);
}

// The texel with the end points of the block of voxel c.
fn block_V(c: vec3u) -> vec3u {
    let block = vec3u(BLOCK_X_V, BLOCK_Y_V, BLOCK_Z_V);
//+if folded_V
    let blocks = (volume_V.brick + block - vec3u(1u)) / block;
    return fold_V(c >> vec3u(BRICK_LOG2_V)) * blocks + (c & vec3u((1u << BRICK_LOG2_V) - 1u)) / block;
//+else
    if (ALIGNED_V) {
        return c / block;
    }
    let size = vec3u(1u << BRICK_LOG2_V);
    return (c >> vec3u(BRICK_LOG2_V)) * ((size + block - vec3u(1u)) / block) + (c & (size - vec3u(1u))) / block;
//+end
}

fn pair_V(block: vec3u) -> vec2<TEXEL_V> {
    return textureLoad(minmax_V, block, 0).xy;
}

// spec: S3D-10, S3D-11, S3D-12
fn reconstruct_V(pair: vec2<TEXEL_V>, index: u32) -> VALUE_V {
    let q = (1u << INDEX_BITS_V) - 1u;
//+if float_V
    if (!(pair.y > pair.x) || index == 0u) {
        return pair.x;
    }
    if (index == q) {
        return pair.y;
    }
    let a = f32(index) / f32(q);
    return (1.0 - a) * pair.x + a * pair.y;
//+else
    let range = u32(max(i32(pair.y) - i32(pair.x), 0));
    return f32(i32(pair.x) + i32((2u * range * index + q) / (2u * q)));
//+end
}
