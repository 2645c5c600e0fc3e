// Light on a sample: a lamp at the camera, both sides of a surface alike (Blinn and Phong). Where there is no gradient there is no
// surface, and the colour stays as it is (hard case R-12).

fn shade(color: vec3f, normal: vec3f, direction: vec3f) -> vec3f {
    // Gradients of tiny fields must not vanish when they are squared.
    let size = max(abs(normal.x), max(abs(normal.y), abs(normal.z)));
    if (!(size > 0.0)) {
        return color;
    }
    let n = normal / size;
    let facing = min(abs(dot(n, direction)) / sqrt(dot(n, n)), 1.0);
    let light = frame.ambient + frame.diffuse * facing;
    return min(color * light + vec3f(frame.specular * pow(facing, frame.shininess)), vec3f(1.0));
}
