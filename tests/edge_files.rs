//! Real and broken files through the program: what is readable becomes a valid file, the rest is refused with the reason.
#![cfg(feature = "cli")]

#[path = "support/data.rs"]
mod data;

use assert_cmd::Command;
use std::collections::BTreeSet;
use std::path::Path;

/// Every volume and series of scalars or colours, vectors and colours of floats as channels.
const GOOD: &[&str] = &[
    "ct_visiblehuman_head_u8.nrrd",
    "ct_chest_lidc2.nhdr",
    "mri_stroke_t1.nii.gz",
    "mri_mni152_i16.nii.gz",
    "mr_cardiac_u16.nrrd",
    "tooth.nhdr",
    "turb_wmag91.nhdr",
    "density_acrolein_f32.nrrd",
    "cryoem_betagal.nhdr",
    "rgb_stroke_t1t2flair.nrrd",
    "rgb_dti_dec.nrrd",
    "rgb24_ct_perfusion.nii.gz",
    "edge/nifti-rs_minimal.nii",
    "edge/nifti-rs_minimal.nii.gz",
    "edge/minimal.hdr",
    "edge/minimal.img",
    "edge/minimal2.hdr",
    "edge/minimal2.img.gz",
    "edge/nifti-rs_minimal_extended_hdr.nii",
    "edge/nifti-rs_27_uint8.nii",
    "edge/nifti-rs_27_uint16.nii",
    "edge/nifti-rs_27_uint32.nii",
    "edge/nifti-rs_27_uint64.nii",
    "edge/nifti-rs_27_int8.nii",
    "edge/nifti-rs_27_int16.nii",
    "edge/nifti-rs_27_int32.nii",
    "edge/nifti-rs_27_int64.nii",
    "edge/nifti-rs_27_float32.nii",
    "edge/nifti-rs_27_float64.nii",
    "edge/nifti-rs_rgb_3D.nii",
    "edge/nifti-rs_f32.nii.gz",
    "edge/nibabel_standard.nii.gz",
    "edge/papaya_zstat1_f32be.nii.gz",
    "edge/BallBinary30x30x30.nhdr",
    "edge/BallBinary30x30x30_gz.nrrd",
    "edge/BallBinary30x30x30_bz2.nrrd",
    "edge/BallBinary30x30x30_gz_lineskip.nrrd",
    "edge/BallBinary30x30x30_gz_byteskip_minus_one.nrrd",
    "edge/BallBinary30x30x30_byteskip_minus_one.nhdr",
    "edge/BallBinary30x30x30_byteskip_minus_one_nifti.nhdr",
    "edge/BallBinary30x30x30.nii.gz",
    "edge/test1d_ascii.nrrd",
    "edge/test_customFields.nrrd",
    "edge/test2d_ascii.nrrd",
    "edge/const32x20x16.nhdr",
    "edge/seg3d_label_brain.nrrd",
    "edge/flair_oblique.nrrd",
    "bfield_femm_vec3_f32.nrrd",
    "rgbf32_lut_srgb.nrrd",
    "fmri4d_u16.nrrd",
    "edge/nifti-rs_rgb_4D.nii",
    "edge/nibabel_example_nifti2.nii.gz",
];

/// Everything else, its code, and words that the message must have. The message names the file too: the header where a
/// field is wrong, the data where there is too little of it.
const REFUSED: &[(&str, &str, &[&str])] = &[
    ("lf_shop_9x9_480x320_rgb.nrrd", "E_UNSUPPORTED", &["3×480×320×9×9", "light fields"]),
    ("density_acrolein.cube.gz", "E_UNSUPPORTED", &["ending"]),
    ("cryoem_betagal.mrc", "E_UNSUPPORTED", &["ending"]),
    ("lut_srgb.spi3d", "E_UNSUPPORTED", &["ending"]),
    ("edge/nifti-rs_rgba_4D.nii", "E_UNSUPPORTED", &["2304", "RGBA"]),
    ("edge/nifti-rs_complex_complex32.nii", "E_UNSUPPORTED", &["32", "complex"]),
    ("edge/nifti-rs_complex_complex64.nii", "E_UNSUPPORTED", &["1792", "complex"]),
    ("edge/nifti-rs_fuzz_artifacts_crash-1.nii", "E_FOREIGN", &[]),
    ("edge/nifti-rs_fuzz_artifacts_crash-2.nii", "E_FOREIGN", &[]),
    ("edge/nibabel_nifti1.hdr", "E_FOREIGN", &[]),
    ("edge/nibabel_nifti2.hdr", "E_FOREIGN", &[]),
    ("edge/nibabel_analyze.hdr", "E_UNSUPPORTED", &["Analyze"]),
    ("edge/BallBinary30x30x30_byteskip_minus_five.nhdr", "E_FOREIGN", &["minus_five.nhdr", "-5"]),
    ("edge/BallBinary30x30x30_nifti.nhdr", "E_FOREIGN", &["BallBinary30x30x30.nii.gz", "54000"]),
    ("edge/test_simple4d_raw.nrrd", "E_UNSUPPORTED", &["0.769", "--dtype"]),
];

/// Raw data that a header beside it names.
const PARTS: &[&str] = &[
    "ct_chest_lidc2.raw.gz",
    "tooth.raw",
    "turb_wmag91.raw",
    "edge/BallBinary30x30x30.raw",
    "edge/const32x20x16.f32.raw",
];

struct Run {
    code: i32,
    out: String,
    err: String,
}

fn run(args: &[&str], paths: &[&Path]) -> Run {
    let output = Command::cargo_bin("vug").unwrap().args(args).args(paths).output().unwrap();
    let text = |b: Vec<u8>| String::from_utf8(b).unwrap();
    Run { code: output.status.code().expect("no signal"), out: text(output.stdout), err: text(output.stderr) }
}

#[test]
fn every_scalar_and_colour_volume_becomes_a_valid_file() {
    let Some(folder) = data::folder("every_scalar_and_colour_volume_becomes_a_valid_file") else { return };
    let temp = tempfile::tempdir().unwrap();
    let target = temp.path().join("a.vug");
    for name in GOOD {
        let colours = name.contains("rgb") && !name.contains("rgbf32");
        let codec = if colours { "raw" } else { "s3dc" };
        let source = folder.join(name);
        let r = run(&["encode", "--codec", codec, "--force", "--json"], &[&source, &target]);
        assert_eq!(r.code, 0, "{name}: {}", r.err);
        let report: serde_json::Value = serde_json::from_str(&r.out).unwrap();
        assert_eq!(report["sample_type"] == "rgb8", colours, "{name}");
        let checked = run(&["verify", "--json"], &[&target]);
        assert_eq!(checked.code, 0, "{name}: {}{}", checked.out, checked.err);
        let checked: serde_json::Value = serde_json::from_str(&checked.out).unwrap();
        assert_eq!(checked["ok"], true, "{name}: {checked}");
        let found = run(&["compare", "--json"], &[&source, &target]);
        assert_eq!(found.code, 0, "{name}: {}", found.err);
        let found: serde_json::Value = serde_json::from_str(&found.out).unwrap();
        assert_eq!(found["max_error"], report["max_error"], "{name}: what encode says is what compare finds");
        assert!(!colours || found["identical"] == true, "{name}: {found}");
    }
}

#[test]
fn everything_else_is_refused_with_the_reason() {
    let Some(folder) = data::folder("everything_else_is_refused_with_the_reason") else { return };
    let temp = tempfile::tempdir().unwrap();
    let target = temp.path().join("a.vug");
    for (name, code, words) in REFUSED {
        let r = run(&["encode"], &[&folder.join(name), &target]);
        println!("{}", r.err.trim_end());
        assert_eq!(r.code, 3, "{name}: {}", r.err);
        assert!(r.out.is_empty(), "{name}: {}", r.out);
        let stem = name.rsplit('/').next().unwrap().split('_').next().unwrap().split('.').next().unwrap();
        for word in words.iter().chain([code, &stem]) {
            assert!(r.err.contains(word), "{word:?} is not in {name}: {}", r.err);
        }
        assert_eq!(std::fs::read_dir(temp.path()).unwrap().count(), 0, "{name} left something behind");
    }
}

#[test]
fn no_file_is_forgotten() {
    let Some(folder) = data::folder("no_file_is_forgotten") else { return };
    let known: BTreeSet<&str> = GOOD.iter().chain(PARTS).copied().chain(REFUSED.iter().map(|r| r.0)).collect();
    assert_eq!(known.len(), GOOD.len() + PARTS.len() + REFUSED.len(), "each has one verdict");
    for sub in ["", "edge"] {
        for entry in std::fs::read_dir(folder.join(sub)).unwrap() {
            let entry = entry.unwrap();
            let name = entry.file_name().into_string().unwrap();
            let name = if sub.is_empty() { name } else { format!("{sub}/{name}") };
            let text = name.ends_with(".md") || name.ends_with("SHA256SUMS");
            if entry.path().is_file() && !text {
                assert!(known.contains(name.as_str()), "{name} has no verdict here");
            }
        }
    }
}
