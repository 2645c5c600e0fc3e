// Rays from the camera through the volumes, one per pixel: samples in the middle of steps, front to back (S3Dc, §4.3).

// Neighbours in a group lie one above the other: most views show x, along which words of indices lie, across the film, so that they
// come to the end of a word together.
@compute @workgroup_size(8, 8)
fn raycast(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let id = 8u * group.xy + local.yx;
    if (id.x >= frame.width || id.y >= frame.rows) {
        return;
    }
    picture[id.y * frame.width + id.x] = trace(ray_of(id.x, id.y + frame.first_row));
}

fn trace(ray: Ray) -> vec4f {
    var scene = vec2f(frame.nearest * ray.norm, 3.0e38);
//+if clip_box
    scene = clip_ray(origin_of(ray, frame.base, frame.right_at, frame.up_at), direction_of(ray, frame.forward, frame.right, frame.up), frame.clip_lo, frame.clip_hi, scene);
//+end
    var all = vec2f(3.0e38, -3.0e38);
//+each
    let origin_V = origin_of(ray, volume_V.base, volume_V.right_at, volume_V.up_at);
    let direction_V = direction_of(ray, volume_V.forward, volume_V.right, volume_V.up);
    let span_V = clip_ray(origin_V, direction_V, volume_V.box_lo, volume_V.box_hi, scene);
    if (span_V.x < span_V.y) {
        all = vec2f(min(all.x, span_V.x), max(all.y, span_V.y));
    }
//+end
    if (all.x >= all.y) {
        return vec4f(0.0);
    }
    let steps = (all.y - all.x) / frame.step;
    let count = u32(ceil(min(steps, f32(frame.samples))));
    // The last step ends with the ray: it may be shorter.
    let tail = min(steps - f32(count - 1u), 1.0);
    return march(ray, all.x, count, tail, ARGUMENTS);
}

//+if composite
fn march(ray: Ray, start: f32, count: u32, tail: f32, PARAMETERS) -> vec4f {
    var sum = vec4f(0.0);
    var k = 0u;
    while (k < count) {
        let part = select(1.0, tail, k == count - 1u);
        let t = start + (f32(k) + 0.5 * part) * frame.step;
//+each
        let p_V = origin_V + t * direction_V;
//+end
//+if empty_skip
        var next = count;
//+each
        let hop_V = next_V(p_V, direction_V, k);
        next = min(next, hop_V);
//+end
        if (next > k) {
            k = next;
            continue;
        }
//+end
//+each
//+if many
//+if empty_skip
        // What another volume shows here says nothing of this one, whose brick may not be in memory.
        if (hop_V == k && t >= span_V.x && t < span_V.y) {
//+else
        if (t >= span_V.x && t < span_V.y) {
//+end
//+end
        let c_V = classify_V(value_V(p_V));
        if (c_V.a > 0.0) {
            var color = c_V.rgb;
//+if gradient_shading
            color = shade(color, world_V(slope_V(p_V)), direction_of(ray, frame.forward, frame.right, frame.up));
//+end
            let a = (1.0 - sum.a) * correct(c_V.a, part * volume_V.ratio);
            sum += vec4f(a * color, a);
        }
//+if many
        }
//+end
//+end
//+if early_out
        if (sum.a > frame.enough) {
            break;
        }
//+end
        k++;
    }
    return sum;
}
//+end

//+if extreme
fn march(ray: Ray, start: f32, count: u32, tail: f32, PARAMETERS) -> vec4f {
    var sum = vec4f(0.0);
//+each
    var seen_V = false;
    var best_V = VALUE_V(0.0);
    for (var k = 0u; k < count; k++) {
        let t = start + (f32(k) + 0.5 * select(1.0, tail, k == count - 1u)) * frame.step;
//+if many
        if (t < span_V.x || t >= span_V.y) {
            continue;
        }
//+end
        let v = value_V(origin_V + t * direction_V);
//+if maximum
        best_V = select(v, max(best_V, v), seen_V);
//+else
        best_V = select(v, min(best_V, v), seen_V);
//+end
        seen_V = true;
    }
    if (seen_V) {
        let c_V = classify_V(best_V);
        sum += (1.0 - sum.a) * vec4f(c_V.a * c_V.rgb, c_V.a);
    }
//+end
    return sum;
}
//+end

//+if mean
fn march(ray: Ray, start: f32, count: u32, tail: f32, PARAMETERS) -> vec4f {
    var sum = vec4f(0.0);
//+each
    // The mean over the ray's length: the last step counts for its part. A running mean: sums of 2^20 samples lose digits.
    var length_V = 0.0;
    var mean_V = VALUE_V(0.0);
    for (var k = 0u; k < count; k++) {
        let part = select(1.0, tail, k == count - 1u);
        let t = start + (f32(k) + 0.5 * part) * frame.step;
//+if many
        if (t < span_V.x || t >= span_V.y) {
            continue;
        }
//+end
        let v = value_V(origin_V + t * direction_V);
        length_V += part;
        mean_V += (v - mean_V) * (part / length_V);
    }
    if (length_V > 0.0) {
        let c_V = classify_V(mean_V);
        sum += (1.0 - sum.a) * vec4f(c_V.a * c_V.rgb, c_V.a);
    }
//+end
    return sum;
}
//+end
