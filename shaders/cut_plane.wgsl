// One plane through the volumes, in any orientation: a sample per pixel, where its ray meets the plane.

@compute @workgroup_size(8, 8)
fn cut_plane(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= frame.width || id.y >= frame.rows) {
        return;
    }
    picture[id.y * frame.width + id.x] = cut(ray_of(id.x, id.y + frame.first_row));
}

fn cut(ray: Ray) -> vec4f {
    let origin = origin_of(ray, frame.base, frame.right_at, frame.up_at);
    let direction = direction_of(ray, frame.forward, frame.right, frame.up);
    // Rays along the plane never meet it.
    let toward = dot(frame.plane.xyz, direction);
    if (toward == 0.0) {
        return vec4f(0.0);
    }
    let t = (frame.plane.w - dot(frame.plane.xyz, origin)) / toward;
    var scene = vec2f(frame.nearest * ray.norm, 3.0e38);
//+if clip_box
    scene = clip_ray(origin, direction, frame.clip_lo, frame.clip_hi, scene);
//+end
    var sum = vec4f(0.0);
//+each
    let origin_V = origin_of(ray, volume_V.base, volume_V.right_at, volume_V.up_at);
    let direction_V = direction_of(ray, volume_V.forward, volume_V.right, volume_V.up);
    let span_V = clip_ray(origin_V, direction_V, volume_V.box_lo, volume_V.box_hi, scene);
    if (t >= span_V.x && t < span_V.y) {
        let c_V = classify_V(value_V(origin_V + t * direction_V));
        sum += (1.0 - sum.a) * vec4f(c_V.a * c_V.rgb, c_V.a);
    }
//+end
    return sum;
}
