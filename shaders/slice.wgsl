// Slabs parallel to the picture, one instance of a quad each, from the front to the back; the blending unit adds what is still seen of
// them: C + (1 − A)·c, A + (1 − A)·a. A sample lies in the middle of the part of its slab that is inside (S3Dc, §4.3).

struct Corner {
    @builtin(position) place: vec4f,
    @location(0) @interpolate(flat) slab: u32,
}

// The quad covers the film: a triangle strip of four corners.
@vertex
fn corner(@builtin(vertex_index) i: u32, @builtin(instance_index) slab: u32) -> Corner {
    return Corner(vec4f(2.0 * f32(i & 1u) - 1.0, 2.0 * f32(i >> 1u) - 1.0, 0.0, 1.0), slab);
}

@fragment
fn slice(at: Corner) -> @location(0) vec4f {
    return seen(ray_of(u32(at.place.x), u32(at.place.y) + frame.first_row), at.slab);
}

// What slab k adds to a ray that nothing hides.
fn seen(ray: Ray, k: u32) -> vec4f {
    var scene = vec2f(frame.nearest + f32(k) * frame.step, frame.nearest + f32(k + 1u) * frame.step) * ray.norm;
//+if clip_box
    scene = clip_ray(origin_of(ray, frame.base, frame.right_at, frame.up_at), direction_of(ray, frame.forward, frame.right, frame.up), frame.clip_lo, frame.clip_hi, scene);
//+end
    var sum = vec4f(0.0);
//+each
    let origin_V = origin_of(ray, volume_V.base, volume_V.right_at, volume_V.up_at);
    let direction_V = direction_of(ray, volume_V.forward, volume_V.right, volume_V.up);
    let span_V = clip_ray(origin_V, direction_V, volume_V.box_lo, volume_V.box_hi, scene);
    if (span_V.x < span_V.y) {
        let p_V = origin_V + 0.5 * (span_V.x + span_V.y) * direction_V;
        let c_V = classify_V(value_V(p_V));
        if (c_V.a > 0.0) {
            var color = c_V.rgb;
//+if gradient_shading
            color = shade(color, world_V(slope_V(p_V)), direction_of(ray, frame.forward, frame.right, frame.up));
//+end
            let part = (span_V.y - span_V.x) / frame.step;
            let a = (1.0 - sum.a) * correct(c_V.a, part * volume_V.ratio);
            sum += vec4f(a * color, a);
        }
    }
//+end
    return sum;
}
