// The first place along a ray where the value reaches the iso-surface's: between two samples on different sides, found by halving.

override HALVINGS: u32 = 8u;

fn inside(value: f32) -> bool {
    return value >= frame.iso;
}

fn march(ray: Ray, start: f32, count: u32, tail: f32, PARAMETERS) -> vec4f {
    // The first sample is where the ray enters: a surface that is cut open by the box has a lid.
    let entry = origin_0 + start * direction_0;
    var outside = false;
//+if empty_skip
    // What can be jumped over lies outside, and may not be in memory.
    outside = next_0(entry, direction_0, 0u) > 0u;
//+end
    if (!outside && inside(grey_0(value_0(entry)))) {
        return surface(ray, start, origin_0, direction_0);
    }
    var last = start;
    var k = 0u;
    while (k < count) {
        // Samples lie at the ends of steps.
        let t = start + (f32(k) + select(1.0, tail, k == count - 1u)) * frame.step;
//+if empty_skip
        let next = next_0(origin_0 + t * direction_0, direction_0, k);
        if (next > k) {
            k = next;
            last = start + f32(k) * frame.step;
            continue;
        }
//+end
        if (inside(grey_0(value_0(origin_0 + t * direction_0)))) {
            return surface(ray, halve(last, t, origin_0, direction_0), origin_0, direction_0);
        }
        last = t;
        k++;
    }
    return vec4f(0.0);
}

// Where in (outer, inner] the surface lies: `outer` is outside, `inner` inside.
fn halve(outer: f32, inner: f32, origin_0: vec3f, direction_0: vec3f) -> f32 {
    var a = outer;
    var b = inner;
    for (var i = 0u; i < HALVINGS; i++) {
        let middle = 0.5 * (a + b);
        if (inside(grey_0(value_0(origin_0 + middle * direction_0)))) {
            b = middle;
        } else {
            a = middle;
        }
    }
    return b;
}

fn surface(ray: Ray, t: f32, origin_0: vec3f, direction_0: vec3f) -> vec4f {
    let p = origin_0 + t * direction_0;
    var color = classify_0(value_0(p)).rgb;
//+if gradient_shading
    color = shade(color, world_0(slope_0(p)), direction_of(ray, frame.forward, frame.right, frame.up));
//+end
    return vec4f(color, 1.0);
}
