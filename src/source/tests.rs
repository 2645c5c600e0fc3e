use super::*;
use std::io::Write;

/// One suite for every source: the same bytes, the same errors.
fn suite(source: &dyn ByteSource, expected: &[u8]) {
    assert_eq!(source.len(), expected.len() as u64);
    for (offset, len) in [(0, 0), (0, expected.len()), (3, 5), (expected.len(), 0)] {
        let mut out = vec![0xEE; len];
        source.read_at(offset as u64, &mut out).unwrap();
        assert_eq!(out, expected[offset..offset + len]);
    }
    for (offset, len) in [(expected.len() as u64, 1), (u64::MAX, 1), (1, expected.len())] {
        let error = source.read_at(offset, &mut vec![0; len]).unwrap_err();
        assert_eq!((error.code(), error.offset()), (Code::Truncated, Some(offset)));
    }
}

#[test]
#[allow(unsafe_code, reason = "the test maps a file that nobody else touches")]
fn all_sources_agree() {
    let bytes: Vec<u8> = (0..100).collect();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.bin");
    std::fs::write(&path, &bytes).unwrap();
    suite(&MemorySource(bytes.clone()), &bytes);
    suite(&FileSource::open(&path).unwrap(), &bytes);
    // SAFETY: the file lies in this test's own folder.
    suite(&unsafe { MmapSource::open(&path) }.unwrap(), &bytes);
    assert_eq!(FileSource::open(folder.path()).err().unwrap().code(), Code::Source);
}

fn names(folder: &std::path::Path) -> Vec<String> {
    let mut names: Vec<_> =
        std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test] // C-14: nothing under the destination's name until commit; the old file is never harmed
fn atomic_file_appears_whole_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.vug");
    let mut file = AtomicFile::create(&path, false).unwrap();
    file.write_all(b"new").unwrap();
    assert!(!path.exists());
    drop(file);
    assert!(names(folder.path()).is_empty(), "an abandoned temporary is removed");

    let mut file = AtomicFile::create(&path, false).unwrap();
    file.write_all(b"one").unwrap();
    file.commit().unwrap();
    assert_eq!(names(folder.path()), ["a.vug"]);
    assert!(AtomicFile::create(&path, false).is_err(), "no overwriting unless asked");

    let mut file = AtomicFile::create(&path, true).unwrap();
    file.write_all(b"two").unwrap();
    drop(file);
    assert_eq!(std::fs::read(&path).unwrap(), b"one");
    let mut file = AtomicFile::create(&path, true).unwrap();
    file.write_all(b"two").unwrap();
    file.commit().unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), b"two");
}

#[test]
fn stale_temporaries_go_and_living_ones_stay() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.vug");
    std::fs::write(folder.path().join(".a.vug.999999-0.vug-tmp"), b"dead").unwrap();
    std::fs::write(folder.path().join(".a.vug.b.999999-0.vug-tmp"), b"of another destination").unwrap();
    let living = AtomicFile::create(&path, false).unwrap();
    let second = AtomicFile::create(&path, false).unwrap();
    assert_eq!(names(folder.path()).len(), 3, "two living ones and the other destination's");
    drop((living, second));
    assert_eq!(names(folder.path()), [".a.vug.b.999999-0.vug-tmp"]);
}

#[test]
fn two_writers_without_force_do_not_replace_each_other() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.vug");
    let (one, two) = (AtomicFile::create(&path, false).unwrap(), AtomicFile::create(&path, false).unwrap());
    one.commit().unwrap();
    assert_eq!(two.commit().unwrap_err().code(), Code::Param);
    assert_eq!(names(folder.path()), ["a.vug"]);
}

#[test]
fn a_parked_file_waits_closed_until_it_is_committed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    let write = || {
        let mut file = AtomicFile::create(&path, false).unwrap();
        file.write_all(b"one").unwrap();
        file.park().unwrap();
        file.park().unwrap();
        assert!(file.write_all(b"two").is_err() && file.flush().is_ok(), "it is closed");
        file
    };
    drop(write());
    assert!(names(folder.path()).is_empty(), "an abandoned temporary is removed");
    write().commit().unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), b"one");
    assert!(AtomicFile::check(&path, false).is_err() && AtomicFile::check(&path, true).is_ok());
}
