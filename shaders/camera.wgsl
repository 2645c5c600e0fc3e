// The ray of a pixel. It starts on a plane `behind` ahead of the eye, close to the volumes, so that a far camera costs no digits.

struct Ray {
    film: vec2f,    // where on the film, in units of the film
    norm: f32,      // length of a step of 1 along the view direction, along this ray
}

fn ray_of(x: u32, y: u32) -> Ray {
    let film = vec2f(frame.film.x + f32(x) * frame.pixel, frame.film.y - f32(y) * frame.pixel);
    var norm = 1.0;
//+if perspective
    norm = sqrt(1.0 + film.x * film.x + film.y * film.y);
//+end
    return Ray(film, norm);
}

// Where the ray starts: t = 0.
fn origin_of(ray: Ray, base: vec3f, right_at: vec3f, up_at: vec3f) -> vec3f {
    return base + ray.film.x * right_at + ray.film.y * up_at;
}

// How far it goes for a world length of 1.
fn direction_of(ray: Ray, forward: vec3f, right: vec3f, up: vec3f) -> vec3f {
//+if perspective
    return (forward + ray.film.x * right + ray.film.y * up) / ray.norm;
//+else
    return forward;
//+end
}

// The part of a ray inside a box, from t = span.x to span.y; empty where span.x > span.y. Half open: a ray along a face is inside
// at the lower faces only.
fn clip_ray(origin: vec3f, direction: vec3f, lo: vec3f, hi: vec3f, within: vec2f) -> vec2f {
    var span = within;
    for (var a = 0u; a < 3u; a++) {
        let o = origin[a];
        let d = direction[a];
        if (d == 0.0) {
            if (o < lo[a] || o >= hi[a]) {
                span = vec2f(1.0, 0.0);
            }
        } else {
            let near = (select(hi[a], lo[a], d > 0.0) - o) / d;
            let far = (select(lo[a], hi[a], d > 0.0) - o) / d;
            span = vec2f(max(span.x, near), min(span.y, far));
        }
    }
    return span;
}
