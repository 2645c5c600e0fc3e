//! Texels: the formats that levels are stored in.

use crate::voxel::SampleType;

/// Format of a texture; the names are those of WebGPU.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum TexelFormat {
    /// Samples of u8.
    R8Uint,
    /// Samples of u16, or words of indices.
    R16Uint,
    /// Samples of i16.
    R16Sint,
    /// Samples of f32, or integers turned into f32 for a texture unit to filter.
    R32Float,
    /// End points of u8.
    Rg8Uint,
    /// End points of u16.
    Rg16Uint,
    /// End points of i16.
    Rg16Sint,
    /// End points of f32.
    Rg32Float,
    /// Samples of rgb8, with a fourth byte of 0.
    Rgba8Uint,
    /// Samples of u8 for a texture unit to filter: read as value / 255.
    R8Unorm,
    /// Samples of u16 for a texture unit to filter: read as value / 65535.
    R16Unorm,
    /// Samples of rgb8 for a texture unit to filter: read as value / 255.
    Rgba8Unorm,
}

impl TexelFormat {
    /// Bytes of a texel.
    #[must_use]
    pub const fn bytes(self) -> u32 {
        match self {
            TexelFormat::R8Uint | TexelFormat::R8Unorm => 1,
            TexelFormat::R16Uint | TexelFormat::R16Sint | TexelFormat::R16Unorm | TexelFormat::Rg8Uint => 2,
            TexelFormat::Rg32Float => 8,
            _ => 4,
        }
    }

    /// Channels of a texel.
    #[must_use]
    pub const fn channels(self) -> usize {
        match self {
            TexelFormat::Rg8Uint | TexelFormat::Rg16Uint | TexelFormat::Rg16Sint | TexelFormat::Rg32Float => 2,
            TexelFormat::Rgba8Uint | TexelFormat::Rgba8Unorm => 4,
            _ => 1,
        }
    }

    /// What a value read in a shader is multiplied with to be the sample.
    #[must_use]
    pub const fn scale(self) -> f32 {
        match self {
            TexelFormat::R8Unorm | TexelFormat::Rgba8Unorm => 255.0,
            TexelFormat::R16Unorm => 65535.0,
            _ => 1.0,
        }
    }

    /// The texel in `bytes`, each channel as its 32 bits in a shader: integers extended, floats as they are. Channels of
    /// normalised formats are the stored integers.
    ///
    /// # Panics
    /// Where there are fewer bytes than a texel has.
    #[must_use]
    pub fn read(self, bytes: &[u8]) -> [u32; 4] {
        let size = self.bytes() as usize / self.channels();
        let mut out = [0; 4];
        for (out, b) in out.iter_mut().zip(bytes[..self.bytes() as usize].chunks_exact(size)) {
            *out = match (b, self) {
                (&[b], _) => u32::from(b),
                (&[a, b], TexelFormat::R16Sint | TexelFormat::Rg16Sint) => {
                    i32::from(i16::from_le_bytes([a, b])).cast_unsigned()
                }
                (&[a, b], _) => u32::from(u16::from_le_bytes([a, b])),
                (b, _) => u32::from_le_bytes([b[0], b[1], b[2], b[3]]),
            };
        }
        out
    }

    /// Format of samples of type `t` as they are.
    pub(super) const fn of_samples(t: SampleType) -> TexelFormat {
        match t {
            SampleType::U8 => TexelFormat::R8Uint,
            SampleType::U16 => TexelFormat::R16Uint,
            SampleType::I16 => TexelFormat::R16Sint,
            SampleType::F32 => TexelFormat::R32Float,
            SampleType::Rgb8 => TexelFormat::Rgba8Uint,
        }
    }

    /// Format of samples that a texture unit filters; f32 where there is no normalised format with the same numbers.
    pub(super) const fn of_filtered(t: SampleType, norm16: bool) -> TexelFormat {
        match t {
            SampleType::U8 => TexelFormat::R8Unorm,
            SampleType::U16 if norm16 => TexelFormat::R16Unorm,
            SampleType::U16 | SampleType::I16 | SampleType::F32 => TexelFormat::R32Float,
            SampleType::Rgb8 => TexelFormat::Rgba8Unorm,
        }
    }

    /// Format of pairs of end points; s3dc holds scalars only.
    pub(super) const fn of_pairs(t: SampleType) -> TexelFormat {
        match t {
            SampleType::U8 | SampleType::Rgb8 => TexelFormat::Rg8Uint,
            SampleType::U16 => TexelFormat::Rg16Uint,
            SampleType::I16 => TexelFormat::Rg16Sint,
            SampleType::F32 => TexelFormat::Rg32Float,
        }
    }
}
