// A level that is longer than a texture may be lies in it in tiles of whole bricks. Where brick `b` lies, in bricks.

fn fold_V(b: vec3u) -> vec3u {
    let tile = volume_V.fold_tile;
    let t = b / tile;
    let n = t.x + volume_V.fold_tiles.x * (t.y + volume_V.fold_tiles.y * t.z);
    let grid = volume_V.fold_grid;
    let place = vec3u(n % grid.x, n / grid.x % grid.y, n / (grid.x * grid.y));
    return place * tile + b % tile;
}
