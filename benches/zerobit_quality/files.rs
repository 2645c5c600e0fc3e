//! The volumes, and how each becomes a grid.

use std::io::Read;
use std::path::{Path, PathBuf};
use vug::convert::{self, ImportOptions};
use vug::{Extent, Grid, SampleType};

/// A volume that may lie in the folder.
pub struct Case {
    /// Name of its file.
    pub file: &'static str,
    /// A few words for tables and the chart.
    pub title: &'static str,
    /// What it is and whose.
    pub about: &'static str,
    load: fn(&Path) -> vug::Result<Grid>,
}

pub fn cases() -> Vec<Case> {
    let case = |file, title, about| Case { file, title, about, load: whole };
    vec![
        case(
            "rgb_stroke_t1t2flair.nrrd",
            "stroke T1/T2/FLAIR",
            "MRI of a head, three contrasts as red, green and blue; stroke images of VolumeRenderingData (MIT)",
        ),
        case(
            "rgb_dti_dec.nrrd",
            "DTI directions",
            "colours of nerve directions, made of direction and anisotropy of a diffusion tensor MRI; test data of Papaya (BSD-3)",
        ),
        case(
            "rgb24_ct_perfusion.nii.gz",
            "CT perfusion",
            "a coloured perfusion map of a head; demo image of NiiVue (BSD-2)",
        ),
        Case {
            file: "lf_shop_9x9_480x320_rgb.nrrd",
            title: "light field, 9 views",
            about: "a light field's middle row of cameras, view behind view as z (480×320×9 of 480×320×9×9): no arrangement for \
                    light fields; scene shop of light-field-renderer (MIT)",
            load: camera_row,
        },
        case(
            "ct_visiblehuman_head_u8.nrrd",
            "visible human CT",
            "CT of a head, grey; Visible Human, National Library of Medicine",
        ),
        case(
            "mri_mni152_i16.nii.gz",
            "MNI152 MRI",
            "averaged MRI of 152 heads, grey, 16 bits; MNI ICBM 152 template of 2009, McGill University",
        ),
    ]
}

impl Case {
    /// The volume, or `None` where it is not there.
    pub fn load(&self) -> vug::Result<Option<Grid>> {
        let folder = std::env::var_os("VUG_DATA")
            .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/data"), PathBuf::from);
        let path = folder.join(self.file);
        if path.exists() { (self.load)(&path).map(Some) } else { Ok(None) }
    }
}

fn whole(path: &Path) -> vug::Result<Grid> {
    let mut source = convert::import(path, &ImportOptions::default())?.reader;
    let mut grid = Grid::zeros(source.extent(), source.sample_type())?;
    source.read_slab(0..grid.extent().z, grid.bytes_mut())?;
    Ok(grid)
}

/// Views 0 to 8 of row 4 out of a light field of 9 × 9 views. Its NRRD has five axes, which no volume has.
fn camera_row(path: &Path) -> vug::Result<Grid> {
    let wrong = |what: &str| vug::Error::param("light field", what.to_owned());
    let io = |e| vug::Error::io(path.display(), e);
    let file = std::fs::read(path).map_err(io)?;
    let end = file.windows(2).position(|w| w == b"\n\n").ok_or_else(|| wrong("no header"))?;
    if !String::from_utf8_lossy(&file[..end]).contains("sizes: 3 480 320 9 9") {
        return Err(wrong("other sizes than 3 480 320 9 9"));
    }
    let mut grid = Grid::zeros(Extent::new(480, 320, 9), SampleType::Rgb8)?;
    let mut samples = flate2::read::GzDecoder::new(&file[end + 2..]);
    for _ in 0..=4 {
        samples.read_exact(grid.bytes_mut()).map_err(io)?;
    }
    Ok(grid)
}
