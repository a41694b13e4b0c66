//! Opening and saving: files, pipes, devices, links, and every way to fail.

use lf_core::io::{open, open_text, same_file, save, save_text};
use std::fs;
use std::io::{Error, Read, Write};
use std::os::fd::AsRawFd;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};

fn entries(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

fn by_descriptor(stream: &impl AsRawFd) -> PathBuf {
    format!("/dev/fd/{}", stream.as_raw_fd()).into()
}

fn refusal<T>(outcome: lf_core::Result<T>) -> String {
    match outcome {
        Ok(_) => panic!("should be refused"),
        Err(error) => error.to_string(),
    }
}

#[test]
fn a_pipe_and_a_file_give_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("input");
    let content: Vec<u8> = (0..300_001u32).map(|i| (i * 7) as u8).collect();
    fs::write(&path, &content).unwrap();
    let mapped = open(&path).unwrap();
    assert!(mapped.is_mapped());

    let (reader, mut writer) = std::io::pipe().unwrap();
    let sent = content.clone();
    let sender = std::thread::spawn(move || {
        for piece in sent.chunks(4097) {
            writer.write_all(piece).unwrap();
        }
    });
    let piped = open(&by_descriptor(&reader)).unwrap();
    sender.join().unwrap();
    assert!(!piped.is_mapped());
    assert!(*mapped == *content && *piped == *content);
    for bytes in [&mapped, &piped] {
        assert_eq!(bytes.as_ptr().align_offset(8), 0);
    }
}

#[test]
fn an_empty_file_and_a_file_of_proc_are_read() {
    assert!(open(Path::new("/dev/null")).unwrap().is_empty());
    assert!(!open(Path::new("/proc/self/status")).unwrap().is_empty());
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("empty"), "").unwrap();
    assert!(open(&folder.path().join("empty")).unwrap().is_empty());
}

#[test]
fn an_unreadable_file_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("missing.exr");
    assert_eq!(refusal(open(&missing)), format!("{}: no such file; wanted a file to read", missing.display()));
    assert_eq!(
        refusal(open(folder.path())),
        format!("{}: is a folder; wanted a file to read", folder.path().display())
    );
    let text = folder.path().join("camera.json");
    fs::write(&text, b"\xef\xbb\xbf{}").unwrap();
    assert_eq!(open_text(&text).unwrap(), "{}");
    fs::write(&text, b"{\"a\xff").unwrap();
    assert!(refusal(open_text(&text)).contains("byte 3 is not part of UTF-8"));
}

#[test]
fn a_saved_file_is_whole_and_readable_by_colleagues() {
    let folder = tempfile::tempdir().unwrap();
    let ordinary = folder.path().join("ordinary");
    fs::write(&ordinary, "").unwrap();
    let wanted = fs::metadata(&ordinary).unwrap().permissions().mode();

    let path = folder.path().join("out");
    save(&path, |out| out.write_all(b"first")).unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"first");
    assert!(cfg!(feature = "portable") || fs::metadata(&path).unwrap().permissions().mode() == wanted);

    fs::set_permissions(&path, fs::Permissions::from_mode(0o640)).unwrap();
    let before = open(&path).unwrap();
    save(&path, |out| out.write_all(b"second")).unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"second");
    assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o7777, 0o640);
    assert_eq!(*before, *b"first", "a mapped input outlives its replacement");
    assert_eq!(entries(folder.path()), ["ordinary", "out"]);
}

#[test]
fn a_name_as_long_as_names_may_be_is_saved() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("n".repeat(255));
    save(&path, |out| out.write_all(b"x")).unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"x");
}

#[test]
fn a_failure_leaves_the_old_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out");
    let fails = |path: &Path| {
        save(path, |out| {
            out.write_all(&[7; 1 << 20])?;
            Err(Error::other("the source ran dry"))
        })
    };
    assert!(refusal(fails(&path)).contains("the source ran dry"));
    assert!(entries(folder.path()).is_empty());

    fs::write(&path, "old").unwrap();
    fails(&path).unwrap_err();
    let panicked = std::panic::catch_unwind(|| save(&path, |_| panic!("in the middle")));
    assert!(panicked.is_err());
    assert_eq!(fs::read(&path).unwrap(), b"old");
    assert_eq!(entries(folder.path()), ["out"]);
}

#[test]
fn an_error_carried_through_a_writer_arrives_unchanged() {
    let folder = tempfile::tempdir().unwrap();
    let inner = lf_core::Error::new("frame.exr", "two channels", "wanted one");
    let carried = save(&folder.path().join("out"), |_| Err(Error::other(inner.clone())));
    assert_eq!(carried.unwrap_err(), inner);
}

#[test]
fn links_stay_links() {
    let folder = tempfile::tempdir().unwrap();
    let [real, link, chain, dangling, ring] =
        ["real", "link", "chain", "dangling", "ring"].map(|name| folder.path().join(name));
    fs::create_dir(&real).unwrap();
    fs::write(real.join("a"), "old").unwrap();
    symlink("real/a", &link).unwrap();
    symlink("link", &chain).unwrap();
    symlink("real/new", &dangling).unwrap();
    symlink("ring", &ring).unwrap();
    save(&chain, |out| out.write_all(b"new")).unwrap();
    save(&dangling, |out| out.write_all(b"born")).unwrap();
    assert_eq!(fs::read(real.join("a")).unwrap(), b"new");
    assert_eq!(fs::read(real.join("new")).unwrap(), b"born");
    for path in [&link, &chain, &dangling] {
        assert!(fs::symlink_metadata(path).unwrap().is_symlink());
    }
    assert_eq!(entries(&real), ["a", "new"]);
    assert!(refusal(save(&ring, |_| Ok(()))).contains("symbolic links"));
}

#[test]
fn devices_and_fifos_are_written_through() {
    save(Path::new("/dev/null"), |out| out.write_all(b"gone")).unwrap();
    assert!(!fs::metadata("/dev/null").unwrap().is_file());
    let full = refusal(save(Path::new("/dev/full"), |out| out.write_all(b"x")));
    assert_eq!(full, "/dev/full: no space left on device; wanted room for the whole output");
    let full = refusal(save(Path::new("/dev/full"), |out| out.write_all(&[0; 1 << 20])));
    assert!(full.contains("no space left on device"), "{full}");

    let (mut reader, writer) = std::io::pipe().unwrap();
    save_text(&by_descriptor(&writer), |out| writeln!(out, "hello")).unwrap();
    drop(writer);
    let mut heard = String::new();
    reader.read_to_string(&mut heard).unwrap();
    assert_eq!(heard, "hello\n");
}

#[test]
fn a_closed_pipe_is_one_clear_error() {
    let (reader, writer) = std::io::pipe().unwrap();
    let path = by_descriptor(&writer);
    // The name of a descriptor can be opened for writing only while someone reads.
    let outcome = save(&path, |out| {
        drop(reader);
        out.write_all(&[0; 1 << 20])
    });
    assert!(refusal(outcome).contains("closed by its reader before the end"));
}

#[test]
fn a_descriptor_of_a_plain_file_is_appended_to_and_not_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log");
    let mut file = fs::File::create(&path).unwrap();
    file.write_all(b"kept,").unwrap();
    save(&by_descriptor(&file), |out| out.write_all(b"added")).unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"kept,added");
}

#[test]
fn places_that_take_no_file_are_named() {
    let folder = tempfile::tempdir().unwrap();
    assert!(refusal(save(folder.path(), |_| Ok(()))).contains("is a folder"));
    let nowhere = folder.path().join("no/such/out");
    let message = format!("{}: its folder does not exist; wanted an existing folder", nowhere.display());
    assert_eq!(refusal(save(&nowhere, |_| Ok(()))), message);
}

#[test]
fn one_file_under_two_names_is_known() {
    let folder = tempfile::tempdir().unwrap();
    let [a, b, hard, soft] = ["a", "b", "hard", "soft"].map(|name| folder.path().join(name));
    fs::write(&a, "").unwrap();
    fs::write(&b, "").unwrap();
    fs::hard_link(&a, &hard).unwrap();
    symlink(&a, &soft).unwrap();
    assert!(same_file(&a, &a) && same_file(&soft, &a));
    assert!(cfg!(feature = "portable") || same_file(&hard, &a));
    assert!(!same_file(&a, &b) && !same_file(&folder.path().join("none"), &a));
    assert!(!same_file(Path::new("/dev/null"), Path::new("/dev/null")));
}
