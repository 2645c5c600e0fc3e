// The value at a place: trilinear between the 8 voxels around it, each decoded by its own block. 16 fetches from s3dc textures.

fn sample_V(p: vec3f) -> VALUE_V {
    let base = floor(p);
    return lerp_V(vec3i(base), p - base);
}

fn base_of_V(p: vec3f) -> vec3i {
    return vec3i(floor(p));
}

// Between voxels `base` and `base + 1`; outside of the volume, the nearest inside.
fn lerp_V(base: vec3i, f: vec3f) -> VALUE_V {
    let lo = vec3u(clamp(base, vec3i(0), volume_V.last));
    let hi = vec3u(clamp(base + vec3i(1), vec3i(0), volume_V.last));
//+if zerobit_V
    // One after the other: a shader that holds this long decoder eight times takes minutes to compile.
    var v: array<VALUE_V, 8>;
    for (var i = 0u; i < 8u; i++) {
        v[i] = voxel_V(select(lo, hi, (vec3u(i) & vec3u(1u, 2u, 4u)) != vec3u(0u)));
    }
    let v000 = v[0];
    let v100 = v[1];
    let v010 = v[2];
    let v110 = v[3];
    let v001 = v[4];
    let v101 = v[5];
    let v011 = v[6];
    let v111 = v[7];
//+else
    let v000 = voxel_V(lo);
    let v100 = voxel_V(vec3u(hi.x, lo.y, lo.z));
    let v010 = voxel_V(vec3u(lo.x, hi.y, lo.z));
    let v110 = voxel_V(vec3u(hi.x, hi.y, lo.z));
    let v001 = voxel_V(vec3u(lo.x, lo.y, hi.z));
    let v101 = voxel_V(vec3u(hi.x, lo.y, hi.z));
    let v011 = voxel_V(vec3u(lo.x, hi.y, hi.z));
    let v111 = voxel_V(hi);
//+end
    // a + (b − a)·t: constant fields stay constant.
    let v00 = v000 + (v100 - v000) * f.x;
    let v10 = v010 + (v110 - v010) * f.x;
    let v01 = v001 + (v101 - v001) * f.x;
    let v11 = v011 + (v111 - v011) * f.x;
    let v0 = v00 + (v10 - v00) * f.y;
    let v1 = v01 + (v11 - v01) * f.y;
    return v0 + (v1 - v0) * f.z;
}
