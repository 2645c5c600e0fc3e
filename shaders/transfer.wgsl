// Colour and opacity of a value: piecewise linear between control points, found by halving.

override POINTS_V: u32 = 2u;
// The largest power of two below POINTS.
override POINTS_TOP_V: u32 = 1u;

fn classify_V(value: VALUE_V) -> vec4f {
    let v = grey_V(value);
    var i = 0u;
    for (var s = POINTS_TOP_V; s > 0u; s = s >> 1u) {
        if (i + s < POINTS_V && v >= volume_V.points[i + s].value) {
            i += s;
        }
    }
    let p = volume_V.points[i];
    let t = clamp((v - p.value) * p.per_value, 0.0, 1.0);
    let c = p.color + p.slope * t;
//+if colour_V
    return vec4f(value / 255.0, c.a);
//+else
    return c;
//+end
}

// What the transfer function looks at: the value, or the largest component of a colour.
fn grey_V(value: VALUE_V) -> f32 {
//+if colour_V
    return max(value.x, max(value.y, value.z));
//+else
    return value;
//+end
}
