//! Structures that Rust and shaders share: declared once, written for both sides.

/// Declares a structure of WGSL's uniform address space: the Rust side as plain bytes, the WGSL side as text.
///
/// Fields must be named such that no padding arises: a `vec3` is followed by a scalar, the size is a multiple of 16. A test holds the
/// offsets of both sides against each other.
macro_rules! gpu_struct {
    ($(#[$doc:meta])* $name:ident { $($(#[$fdoc:meta])* $field:ident: $rust:ty = $wgsl:literal,)* }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
        #[repr(C)]
        #[allow(missing_docs, reason = "padding, and what is told once in `Frame`")]
        #[allow(unsafe_code, reason = "the derive of Pod implements a marker for plain bytes; it checks at compile time that there is no padding")]
        pub struct $name { $($(#[$fdoc])* pub $field: $rust,)* }

        impl $name {
            /// The structure in WGSL.
            pub const WGSL: &'static str =
                concat!("struct ", stringify!($name), " {\n", $("    ", stringify!($field), ": ", $wgsl, ",\n",)* "}\n");

            /// Names and byte offsets of the fields.
            pub const FIELDS: &'static [(&'static str, usize)] = &[$((stringify!($field), std::mem::offset_of!($name, $field)),)*];
        }
    };
}

/// Control points of a transfer function that fit into the parameters of a volume.
pub const MAX_POINTS: usize = 256;

gpu_struct! {
    /// A control point of a transfer function, and the way to the next one.
    Point {
        /// Red, green, blue, opacity of one reference length; not premultiplied.
        color: [f32; 4] = "vec4f",
        /// Colour of the next point minus this one's.
        slope: [f32; 4] = "vec4f",
        /// The value, in sample units.
        value: f32 = "f32",
        /// 1 / (the next value − this one); 0 where there is no way to go.
        per_value: f32 = "f32",
        pad0: f32 = "f32",
        pad1: f32 = "f32",
    }
}

gpu_struct! {
    /// The picture: film, camera in the world (relative to the scene's centre), light.
    Frame {
        /// Pixels of a row.
        width: u32 = "u32",
        /// Rows of this dispatch.
        rows: u32 = "u32",
        /// The first of them in the picture.
        first_row: u32 = "u32",
        /// Most samples of a ray.
        samples: u32 = "u32",
        /// Film coordinates of the centre of the first pixel of the first row.
        film: [f32; 2] = "vec2f",
        /// Width of a pixel on the film.
        pixel: f32 = "f32",
        /// Where rays begin: t at the eye, along the view direction.
        nearest: f32 = "f32",
        /// Distance of samples, world units.
        step: f32 = "f32",
        /// Opacity beyond which a ray ends.
        enough: f32 = "f32",
        /// Value of the iso-surface.
        iso: f32 = "f32",
        /// Light that has no direction, 0 to 1.
        ambient: f32 = "f32",
        /// Light of the lamp at the camera, 0 to 1.
        diffuse: f32 = "f32",
        /// Highlight, 0 to 1.
        specular: f32 = "f32",
        /// Exponent of the highlight.
        shininess: f32 = "f32",
        /// Where between two time steps the picture lies, 0 to 1.
        time: f32 = "f32",
        /// The ray of the middle of the film starts here.
        base: [f32; 3] = "vec3f",
        pad1: f32 = "f32",
        /// How far the start moves for a film coordinate of 1 to the right.
        right_at: [f32; 3] = "vec3f",
        pad2: f32 = "f32",
        /// And upward.
        up_at: [f32; 3] = "vec3f",
        pad3: f32 = "f32",
        /// View direction, unit length.
        forward: [f32; 3] = "vec3f",
        pad4: f32 = "f32",
        /// To the right, unit length.
        right: [f32; 3] = "vec3f",
        pad5: f32 = "f32",
        /// Upward, unit length.
        up: [f32; 3] = "vec3f",
        pad6: f32 = "f32",
        /// Lower corner of the clipping box.
        clip_lo: [f32; 3] = "vec3f",
        pad7: f32 = "f32",
        /// Upper corner of the clipping box.
        clip_hi: [f32; 3] = "vec3f",
        pad8: f32 = "f32",
        /// Unit normal of the cutting plane, and its distance from the scene's centre along it.
        plane: [f32; 4] = "vec4f",
    }
}

gpu_struct! {
    /// A volume: the camera in index coordinates of the level, how the level lies in its textures, the transfer function.
    VolumeParams {
        /// As in `Frame`, in index coordinates of the level: voxel i has its centre at i.
        base: [f32; 3] = "vec3f",
        /// Length of a step in reference lengths: the exponent of opacity.
        ratio: f32 = "f32",
        right_at: [f32; 3] = "vec3f",
        /// What a sampler's result is multiplied with: 255, 65535 or 1.
        full_scale: f32 = "f32",
        up_at: [f32; 3] = "vec3f",
        pad0: f32 = "f32",
        forward: [f32; 3] = "vec3f",
        pad1: f32 = "f32",
        right: [f32; 3] = "vec3f",
        pad2: f32 = "f32",
        up: [f32; 3] = "vec3f",
        pad3: f32 = "f32",
        /// The box of level 0, in index coordinates of the level.
        box_lo: [f32; 3] = "vec3f",
        pad4: f32 = "f32",
        box_hi: [f32; 3] = "vec3f",
        pad5: f32 = "f32",
        /// World gradient of a gradient along x, y and z.
        world_x: [f32; 3] = "vec3f",
        pad6: f32 = "f32",
        world_y: [f32; 3] = "vec3f",
        pad7: f32 = "f32",
        world_z: [f32; 3] = "vec3f",
        pad8: f32 = "f32",
        /// The last voxel along each axis.
        last: [i32; 3] = "vec3i",
        pad9: u32 = "u32",
        /// Bricks of a tile (folded levels).
        fold_tile: [u32; 3] = "vec3u",
        pad10: u32 = "u32",
        /// Tiles of the level.
        fold_tiles: [u32; 3] = "vec3u",
        pad11: u32 = "u32",
        /// Tiles side by side in the texture.
        fold_grid: [u32; 3] = "vec3u",
        pad12: u32 = "u32",
        /// Voxels of a brick, none longer than the level (folded levels).
        brick: [u32; 3] = "vec3u",
        pad14: u32 = "u32",
        /// Bricks of the level (zerobit).
        bricks: [u32; 3] = "vec3u",
        pad13: u32 = "u32",
        /// Control points of the transfer function, by ascending value.
        points: [Point; MAX_POINTS] = "array<Point, 256>",
    }
}

gpu_struct! {
    /// A level that is decoded: how it lies in its textures.
    DecodeParams {
        /// Voxels of the level.
        extent: [u32; 3] = "vec3u",
        pad0: u32 = "u32",
        /// The first invocation of this dispatch.
        first: [u32; 3] = "vec3u",
        pad1: u32 = "u32",
        /// The last voxel along each axis (zerobit).
        last: [i32; 3] = "vec3i",
        pad7: u32 = "u32",
        /// Bricks of a tile (folded levels).
        fold_tile: [u32; 3] = "vec3u",
        pad2: u32 = "u32",
        /// Tiles of the level.
        fold_tiles: [u32; 3] = "vec3u",
        pad3: u32 = "u32",
        /// Tiles side by side in the texture.
        fold_grid: [u32; 3] = "vec3u",
        pad4: u32 = "u32",
        /// Voxels of a brick, none longer than the level.
        brick: [u32; 3] = "vec3u",
        pad6: u32 = "u32",
        /// Bricks of the level (zerobit).
        bricks: [u32; 3] = "vec3u",
        pad5: u32 = "u32",
    }
}
