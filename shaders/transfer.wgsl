// Colour and opacity of a value: piecewise linear between control points. Of a few, each is looked at, at an address that is the
// same for all rays; of many, the one is found by halving.

override POINTS_V: u32 = 2u;
// The largest power of two below POINTS.
override POINTS_TOP_V: u32 = 1u;

fn classify_V(value: VALUE_V) -> vec4f {
    let v = grey_V(value);
    var p = volume_V.points[0];
    if (POINTS_V <= 8u) {
        p = later_V(p, 1u, v);
        p = later_V(p, 2u, v);
        p = later_V(p, 3u, v);
        p = later_V(p, 4u, v);
        p = later_V(p, 5u, v);
        p = later_V(p, 6u, v);
        p = later_V(p, 7u, v);
    } else {
        var i = 0u;
        for (var s = POINTS_TOP_V; s > 0u; s = s >> 1u) {
            if (i + s < POINTS_V && v >= volume_V.points[i + s].value) {
                i += s;
            }
        }
        p = volume_V.points[i];
    }
    let t = clamp((v - p.value) * p.per_value, 0.0, 1.0);
    let c = p.color + p.slope * t;
//+if colour_V
    return vec4f(value / 255.0, c.a);
//+else
    return c;
//+end
}

// Point i where v lies at or behind it, else the one before.
fn later_V(before: Point, i: u32, v: f32) -> Point {
    if (i >= POINTS_V) {
        return before;
    }
    var p = volume_V.points[i];
    let here = v >= p.value;
    p.color = select(before.color, p.color, here);
    p.slope = select(before.slope, p.slope, here);
    p.value = select(before.value, p.value, here);
    p.per_value = select(before.per_value, p.per_value, here);
    return p;
}

// What the transfer function looks at: the value, or the largest component of a colour.
fn grey_V(value: VALUE_V) -> f32 {
//+if colour_V
    return max(value.x, max(value.y, value.z));
//+else
    return value;
//+end
}
