// Voxels out of zerobit streams as they are stored (Bajaj et al. 2001, §3.3): an average and two groups of seven details, 15 decodes at
// most. What a damaged stream says is taken as the CPU takes it: bytes behind the end of a payload are 0.
// spec: ZBT-9, ZBT-11, ZBT-12, ZBT-14 to ZBT-24, ZBT-30, ZBT-31

// Per brick, and one more for what is EMPTY: 0 or 1 and, in w, the value of all voxels; or 2 + page, first word, bytes, codebook.
@group(GROUP_V) @binding(1) var<storage, read> table_V: array<vec4u>;
// Per codebook 256 averages, then 256 details.
@group(GROUP_V) @binding(2) var<storage, read> books_V: array<u32>;
STREAMS_V

// Where a payload lies.
struct Payload_V {
    page: u32,
    first: u32,
    words: u32,
    book: u32,
}

fn voxel_V(c: vec3u) -> VALUE_V {
    let log2 = vec3u(BRICK_LOG2_V);
    let brick = c >> log2;
    let n = volume_V.bricks;
    let entry = table_V[brick.x + n.x * (brick.y + n.y * brick.z)];
    if (entry.x < 2u) {
        return VALUE_V(raw_value_V(entry.w));
    }
    let s = Payload_V(entry.x - 2u, entry.y, (entry.z + 3u) >> 2u, 512u * entry.w);
    let r = c - (brick << log2);
    // The last bricks of a level have fewer unit blocks.
    let units = (min(vec3u(1u) << log2, vec3u(volume_V.last + vec3i(1)) - (brick << log2)) + vec3u(15u)) >> vec3u(4u);
    let u = r >> vec3u(4u);
    let unit = word_V(s, 4u + u.x + units.x * (u.y + units.y * u.z));
    let cell = (r >> vec3u(2u)) & vec3u(3u);
    let flag = cell.x + 4u * cell.y + 16u * cell.z;
    let base = unit >> 8u;
    let cells = vec2u(word_V(s, base), word_V(s, base + 1u));
    if ((unit & 0xffu) == 0u || (seven_V(cells, flag) & 1u) == 0u) {
        return VALUE_V(raw_value_V(table_V[n.x * n.y * n.z].w));
    }
    return VALUE_V(clamp(cell_V(s, base, unit & 0xffu, below_V(cells, flag), r & vec3u(3u)), LEAST_V, MOST_V));
}

//+if new_stream_V
// Voxel `at` of the stored cell that `rank` others of `cells` precede, in the unit block that begins with word `base`.
fn cell_V(s: Payload_V, base: u32, cells: u32, rank: u32, at: vec3u) -> INT_V {
    let own = word_V(s, base + 2u + rank);
    let last = word_V(s, base + 1u + cells);
    // Zerobits and maps; behind those of the last cell, details.
    let zsms = 4u * base + 8u + 5u * cells;
    let end = zsms + ((last >> 16u) & 0x7fffu);
    let details = end + 1u + (last >> 31u) + countOneBits(byte_V(s, end)) + (own & 0xffffu);
    let zerobits = zsms + ((own >> 16u) & 0x7fffu);
    let level_0 = own >> 31u;
    let level_1 = byte_V(s, zerobits);
    let group = at >> vec3u(1u);
    var value = average_V(s, byte_V(s, 4u * base + 8u + 4u * cells + rank));
    if (level_0 == 1u) {
        value += node_V(s, byte_V(s, zerobits + 1u), details, group);
    }
    let node = group.x + 2u * group.y + 4u * group.z;
    if (((level_1 >> (7u - node)) & 1u) == 1u) {
        let before = level_0 + countOneBits(level_1 >> (8u - node));
        var earlier = 0u;
        for (var k = 0u; k < before; k++) {
            earlier += countOneBits(byte_V(s, zerobits + 1u + k) & 0x7fu);
        }
        value += node_V(s, byte_V(s, zerobits + 1u + before), details + earlier, at & vec3u(1u));
    }
    return value;
}
//+else
// Voxel `at` of the stored cell that `rank` others of `cells` precede, in the unit block that begins with word `base`.
fn cell_V(s: Payload_V, base: u32, cells: u32, rank: u32, at: vec3u) -> INT_V {
    let flags = vec2u(word_V(s, base + 2u + 2u * rank), word_V(s, base + 3u + 2u * rank));
    let offset = (word_V(s, base + 2u + 2u * cells + (rank >> 1u)) >> (16u * (rank & 1u))) & 0xffffu;
    let indices = 4u * base + 8u + 10u * cells + offset;
    var value = INT_V(0);
    if ((flags.x & 1u) == 1u) {
        value = average_V(s, byte_V(s, indices));
    }
    let group = at >> vec3u(1u);
    let node = 8u + 7u * (group.x + 2u * group.y + 4u * group.z);
    // Maps have their flags the other way round.
    value += node_V(s, reverseBits(seven_V(flags, 1u)) >> 25u, indices + (flags.x & 1u), group);
    value += node_V(s, reverseBits(seven_V(flags, node)) >> 25u, indices + below_V(flags, node), at & vec3u(1u));
    return value;
}
//+end

// What the seven details of a node add to the voxel (or group) `odd` of it; their indices begin at byte `at`.
fn node_V(s: Payload_V, map: u32, at: u32, odd: vec3u) -> INT_V {
    let letters = 4u * odd.x + 2u * odd.y + odd.z;
    var place = at;
    var sum = INT_V(0);
    for (var j = 1u; j < 8u; j++) {
        if (((map >> (7u - j)) & 1u) == 1u) {
            let detail = detail_V(s, byte_V(s, place));
            sum += select(detail, -detail, (countOneBits(j & letters) & 1u) == 1u);
            place++;
        }
    }
    return sum;
}

// Of 64 flags, the seven from `p` on.
fn seven_V(flags: vec2u, p: u32) -> u32 {
    let seven = select(select(flags.x, (flags.x >> p) | (flags.y << (32u - p)), p > 0u), flags.y >> (p & 31u), p > 31u);
    return seven & 0x7fu;
}

// Of 64 flags, how many are set before `p`.
fn below_V(flags: vec2u, p: u32) -> u32 {
    let mask = (1u << (p & 31u)) - 1u;
    return select(countOneBits(flags.x & mask), countOneBits(flags.x) + countOneBits(flags.y & mask), p > 31u);
}

fn byte_V(s: Payload_V, at: u32) -> u32 {
    return (word_V(s, at >> 2u) >> (8u * (at & 3u))) & 0xffu;
}

fn word_V(s: Payload_V, at: u32) -> u32 {
    if (at >= s.words) {
        return 0u;
    }
    let w = s.first + at;
    PAGE_WORD_V
}

fn average_V(s: Payload_V, index: u32) -> INT_V {
//+if colour_V
    let w = books_V[s.book + index];
    return vec3i(vec3u(w, w >> 8u, w >> 16u) & vec3u(0xffu));
//+else
    return i32(books_V[s.book + index]);
//+end
}

fn detail_V(s: Payload_V, index: u32) -> INT_V {
//+if colour_V
    let w = books_V[s.book + 256u + index];
    return vec3i(vec3u(w << 24u, w << 16u, w << 8u)) >> vec3u(24u);
//+else
    return i32(books_V[s.book + 256u + index]);
//+end
}

// A sample of the volume, from its bytes.
fn raw_value_V(w: u32) -> INT_V {
//+if colour_V
    return vec3i(vec3u(w, w >> 8u, w >> 16u) & vec3u(0xffu));
//+else
//+if signed_V
    return i32(w << 16u) >> 16u;
//+else
    return i32(w);
//+end
//+end
}
