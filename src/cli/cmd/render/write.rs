//! Pictures as files: PNG, PFM, and turntables as single pictures, GIF or animated PNG.

use crate::error::{Code, Error, Result};
use crate::render::image::Image;
use std::path::{Path, PathBuf};

/// Hundredths of a second between the pictures of an animation.
const DELAY: u16 = 8;

/// What a file's name asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Png,
    Pfm,
    Gif,
    Apng,
}

/// The kind of file that `path` names, for one picture or for `frames`.
///
/// # Errors
/// `E_PARAM`, saying what there is.
pub(super) fn kind(path: &Path, frames: Option<usize>) -> Result<Kind> {
    let bad = |message: &str| Err(Error::param("output", format!("{}: {message}", path.display())));
    let ending = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let kind = match &*ending {
        "png" => Kind::Png,
        "pfm" => Kind::Pfm,
        "gif" => Kind::Gif,
        "apng" => Kind::Apng,
        _ => return bad("pictures end in .png or .pfm, turntables in .png, .pfm, .gif or .apng"),
    };
    let is_pattern = hashes(path).is_some();
    match (kind, frames) {
        (Kind::Gif | Kind::Apng, None) => bad("an animation needs --turntable N"),
        (Kind::Png | Kind::Pfm, Some(_)) if !is_pattern => {
            bad("name the pictures of a turntable with their number, as in turn_####.png; or take .gif or .apng")
        }
        (_, None) if is_pattern => bad("numbers in names are for --turntable"),
        _ => Ok(kind),
    }
}

/// The run of `#` in a file name: where it starts, and its length.
fn hashes(path: &Path) -> Option<(usize, usize)> {
    let name = path.file_name()?.to_str()?;
    let start = name.find('#')?;
    Some((start, name[start..].bytes().take_while(|b| *b == b'#').count()))
}

/// Name of picture `i`.
pub(super) fn numbered(path: &Path, i: u32) -> PathBuf {
    let Some(((start, len), name)) = hashes(path).zip(path.file_name().and_then(|n| n.to_str())) else {
        return path.to_owned();
    };
    path.with_file_name(format!("{}{i:0len$}{}", &name[..start], &name[start + len..]))
}

fn refused(e: impl std::fmt::Display) -> Error {
    Error::new(Code::Source, "output", format!("the picture cannot be encoded: {e}"))
}

/// One picture as the bytes of a PNG or PFM file.
pub(super) fn encoded(image: &Image, background: [f32; 3], kind: Kind) -> Result<Vec<u8>> {
    let mut out = Vec::new();
    if kind == Kind::Pfm {
        image.write_pfm(&mut out, background).map_err(refused)?;
        return Ok(out);
    }
    let mut encoder = png::Encoder::new(&mut out, image.width, image.height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().map_err(refused)?;
    writer.write_image_data(image.over(background).as_flattened()).map_err(refused)?;
    writer.finish().map_err(refused)?;
    Ok(out)
}

/// Pictures as an animation that runs for ever.
pub(super) fn animated(images: &[Image], background: [f32; 3], kind: Kind) -> Result<Vec<u8>> {
    let Some(first) = images.first() else { return Err(Error::param("turntable", "there are no pictures")) };
    let mut out = Vec::new();
    if kind == Kind::Gif {
        let side = |n: u32| u16::try_from(n).map_err(refused);
        let (w, h) = (side(first.width)?, side(first.height)?);
        let mut encoder = gif::Encoder::new(&mut out, w, h, &[]).map_err(refused)?;
        encoder.set_repeat(gif::Repeat::Infinite).map_err(refused)?;
        for image in images {
            let mut frame = gif::Frame::from_rgb(w, h, image.over(background).as_flattened());
            frame.delay = DELAY;
            encoder.write_frame(&frame).map_err(refused)?;
        }
        drop(encoder);
        return Ok(out);
    }
    let mut encoder = png::Encoder::new(&mut out, first.width, first.height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let count = u32::try_from(images.len()).map_err(refused)?;
    encoder.set_animated(count, 0).map_err(refused)?;
    encoder.set_frame_delay(DELAY, 100).map_err(refused)?;
    let mut writer = encoder.write_header().map_err(refused)?;
    for image in images {
        writer.write_image_data(image.over(background).as_flattened()).map_err(refused)?;
    }
    writer.finish().map_err(refused)?;
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(v: f32) -> Image {
        Image { width: 4, height: 3, pixels: (0..12).map(|i| [v, i as f32 / 12.0, 0.0, 1.0]).collect() }
    }

    #[test]
    fn names_say_what_is_written() {
        let of = |name: &str, frames| kind(Path::new(name), frames);
        assert_eq!((of("a.png", None).unwrap(), of("a.PFM", None).unwrap()), (Kind::Png, Kind::Pfm));
        assert_eq!((of("a.gif", Some(3)).unwrap(), of("a.apng", Some(3)).unwrap()), (Kind::Gif, Kind::Apng));
        assert_eq!(of("d/a_####.png", Some(3)).unwrap(), Kind::Png);
        for (name, frames) in [("a.jpg", None), ("a", None), ("a.gif", None), ("a.png", Some(3)), ("a_##.png", None)] {
            assert_eq!(of(name, frames).unwrap_err().code(), Code::Param, "{name}");
        }
        assert_eq!(numbered(Path::new("d/a_####b.png"), 17), Path::new("d/a_0017b.png"));
        assert_eq!(numbered(Path::new("#.png"), 17), Path::new("17.png"));
    }

    #[test]
    fn pictures_can_be_read_back() {
        let bytes = encoded(&image(0.5), [0.0; 3], Kind::Png).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        assert_eq!(pixels, image(0.5).over([0.0; 3]).as_flattened());
        let pfm = encoded(&image(0.5), [0.0; 3], Kind::Pfm).unwrap();
        assert!(pfm.starts_with(b"PF\n4 3\n-1.0\n") && pfm.len() == 12 + 4 * 3 * 12);

        let turn = [image(0.0), image(0.5), image(1.0)];
        let bytes = animated(&turn, [0.0; 3], Kind::Apng).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        assert_eq!(reader.info().animation_control().unwrap().num_frames, 3);
        for want in &turn {
            reader.next_frame(&mut pixels).unwrap();
            assert_eq!(pixels, want.over([0.0; 3]).as_flattened());
        }
        let bytes = animated(&turn, [0.0; 3], Kind::Gif).unwrap();
        let mut reader = gif::DecodeOptions::new().read_info(&bytes[..]).unwrap();
        let mut frames = 0;
        while let Some(frame) = reader.read_next_frame().unwrap() {
            assert_eq!((frame.width, frame.height, frame.delay), (4, 3, DELAY));
            frames += 1;
        }
        assert_eq!(frames, 3);
        assert!(animated(&turn, [0.0; 3], Kind::Gif).unwrap() == bytes, "the same pictures, the same bytes");
    }
}
