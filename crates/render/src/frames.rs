//! The directory of an animation, written so that frames are whole or absent and foreign files are never touched.
//!
//! Every file is written under a temporary name and renamed, so that a frame is complete or absent whenever the process is killed;
//! `manifest.json` comes last and marks the render as complete. Until then a journal lists the files of the render, so that the next
//! render can take over the directory of one that was killed, and only of such a one.

use std::collections::BTreeSet;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use super::{Error, GENERATOR, Manifest};

/// Name of the manifest.
pub const MANIFEST: &str = "manifest.json";
/// Files that are being written; left behind only when the process is killed.
const TEMPORARY: &str = ".dlsys-tmp-";
/// Names of the files of a render under way, one a line.
const JOURNAL: &str = ".dlsys-journal";

fn io_error<'a>(action: &'static str, path: &'a Path) -> impl FnOnce(io::Error) -> Error + 'a {
    move |source| Error::Io { action, path: path.to_owned(), source }
}

/// The directory of a render in progress.
///
/// If it is dropped without [`finish`](FrameDirectory::finish), it stays like that of a render that was killed.
#[derive(Debug)]
pub struct FrameDirectory {
    path: PathBuf,
    /// Files of earlier renders that are still there.
    earlier: BTreeSet<String>,
    /// Files that are not ours and stay as they are.
    foreign: BTreeSet<String>,
    /// Files of this render, in the order of writing.
    written: Vec<String>,
    /// Their bytes.
    bytes: u64,
    /// Most bytes of all files, and how many there are so far, those that are being written included.
    limit: u64,
    spent: Arc<AtomicU64>,
    journal: fs::File,
    /// Held during the render; the system releases it when the process ends, in whatever way.
    _lock: Option<fs::File>,
}

/// Locks a directory for a render, where the file system has locks.
fn lock(path: &Path) -> Result<Option<fs::File>, Error> {
    // Of a directory where it can be opened, so that nothing is left behind; else of a file in it.
    let opened = match cfg!(unix) {
        true => fs::File::open(path),
        false => fs::OpenOptions::new().create(true).append(true).open(path.join(format!("{TEMPORARY}lock"))),
    };
    let Ok(file) = opened else { return Ok(None) };
    match file.try_lock() {
        Ok(()) => Ok(Some(file)),
        Err(fs::TryLockError::WouldBlock) => Err(Error::Busy(path.to_owned())),
        Err(fs::TryLockError::Error(_)) => Ok(None),
    }
}

impl FrameDirectory {
    /// Makes the directory, or takes over that of an earlier render. With `force`, also one with other
    /// files, which stay as they are: a frame with the name of one of them is an error.
    ///
    /// # Errors
    /// If the directory holds files that no earlier render made, or cannot be written to.
    pub fn create(path: &Path, force: bool) -> Result<FrameDirectory, Error> {
        match fs::metadata(path) {
            Ok(found) if !found.is_dir() => return Err(Error::NotADirectory(path.to_owned())),
            Ok(_) => {}
            Err(_) => fs::create_dir_all(path).map_err(io_error("make the directory", path))?,
        }
        let claimed = lock(path)?;
        let present = list(path)?;
        let mut ours = listed_by_manifest(&path.join(MANIFEST));
        ours.extend(listed_by_journal(&path.join(JOURNAL)));
        let foreign =
            |name: &&String| !ours.contains(*name) && *name != JOURNAL && !name.starts_with(TEMPORARY);
        if let Some(file) = present.iter().find(foreign)
            && !force
        {
            return Err(Error::Foreign { directory: path.to_owned(), file: file.clone() });
        }
        let is_lock = |name: &str| name.strip_prefix(TEMPORARY) == Some("lock");
        for name in present.iter().filter(|name| name.starts_with(TEMPORARY) && !is_lock(name)) {
            let file = path.join(name);
            fs::remove_file(&file).map_err(io_error("remove", &file))?;
        }
        let earlier: BTreeSet<String> = ours.intersection(&present).cloned().collect();
        // From here on the journal answers for the earlier files, and the directory is incomplete.
        let lines: String = earlier.iter().map(|name| format!("{name}\n")).collect();
        replace(path, JOURNAL, lines.as_bytes())?;
        if earlier.contains(MANIFEST) {
            let manifest = path.join(MANIFEST);
            fs::remove_file(&manifest).map_err(io_error("remove", &manifest))?;
        }
        let journal = path.join(JOURNAL);
        let journal =
            fs::OpenOptions::new().append(true).open(&journal).map_err(io_error("open", &journal))?;
        let foreign = present.iter().filter(foreign).cloned().collect();
        Ok(FrameDirectory {
            path: path.to_owned(),
            earlier,
            foreign,
            written: Vec::new(),
            bytes: 0,
            limit: u64::MAX,
            spent: Arc::default(),
            journal,
            _lock: claimed,
        })
    }

    /// Limits the bytes of all files together.
    pub fn limited(self, limit: u64) -> FrameDirectory {
        FrameDirectory { limit, ..self }
    }

    /// Name of a frame: `frame-0000.svg`. All frames of a render of `count` have the same number of digits,
    /// at least 4.
    pub fn frame_name(index: usize, count: usize, extension: &str) -> String {
        let digits = count.saturating_sub(1).max(index).to_string().len().max(4);
        format!("frame-{index:0digits$}.{extension}")
    }

    /// Writes a file, completely or not at all.
    ///
    /// # Errors
    /// If `name` is not a plain file name, or the file cannot be written.
    pub fn write(&mut self, name: &str, bytes: &[u8]) -> Result<(), Error> {
        self.check(name)?;
        let staged = self.staging().write(|file| file.write_all(bytes))?;
        self.put(name, staged)
    }

    /// Bytes of the files that were written so far.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// The place where files are written before they have their name.
    pub fn staging(&self) -> Staging {
        Staging { path: self.path.clone(), limit: self.limit, spent: self.spent.clone() }
    }

    fn check(&self, name: &str) -> Result<(), Error> {
        if !is_plain(name) || name == MANIFEST {
            return Err(Error::Name(name.to_owned()));
        }
        if self.foreign.contains(name) {
            return Err(Error::Taken(self.path.join(name)));
        }
        Ok(())
    }

    /// Gives a staged file its name.
    ///
    /// # Errors
    /// If `name` is not a plain file name, or the file cannot be renamed.
    pub fn put(&mut self, name: &str, staged: Staged) -> Result<(), Error> {
        self.check(name)?;
        let journal = self.path.join(JOURNAL);
        self.journal.write_all(format!("{name}\n").as_bytes()).map_err(io_error("write", &journal))?;
        self.bytes += staged.0.as_file().metadata().map_or(0, |found| found.len());
        staged.persist(&self.path.join(name))?;
        self.written.push(name.to_owned());
        Ok(())
    }

    /// Removes the remaining files of earlier renders, and writes the manifest, which lists all files.
    ///
    /// # Errors
    /// If a file cannot be removed or written.
    pub fn finish(self, manifest: &Manifest) -> Result<(), Error> {
        for name in &self.earlier {
            if name != MANIFEST && !self.written.contains(name) {
                let file = self.path.join(name);
                fs::remove_file(&file).map_err(io_error("remove", &file))?;
            }
        }
        let mut manifest = manifest.clone();
        manifest.files = self.written;
        let target = self.path.join(MANIFEST);
        let mut bytes = serde_json::to_vec_pretty(&manifest).map_err(|error| Error::Io {
            action: "write",
            path: target,
            source: error.into(),
        })?;
        bytes.push(b'\n');
        replace(&self.path, MANIFEST, &bytes)?;
        let journal = self.path.join(JOURNAL);
        fs::remove_file(&journal).map_err(io_error("remove", &journal))
    }
}

/// Writes files under temporary names in the directory, from any thread.
#[derive(Clone, Debug)]
pub struct Staging {
    path: PathBuf,
    limit: u64,
    spent: Arc<AtomicU64>,
}

/// A file that is being written, as long as there is room for it.
pub struct Measured<'f> {
    file: &'f mut fs::File,
    staging: &'f Staging,
}

impl Write for Measured<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let before = self.staging.spent.fetch_add(bytes.len() as u64, Ordering::Relaxed);
        if before.saturating_add(bytes.len() as u64) > self.staging.limit {
            return Err(io::Error::new(io::ErrorKind::QuotaExceeded, "too many bytes"));
        }
        self.file.write_all(bytes)?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Staging {
    /// Writes a file under a temporary name.
    ///
    /// # Errors
    /// If it cannot be made, and those of `fill`.
    pub fn write(&self, fill: impl FnOnce(&mut Measured<'_>) -> io::Result<()>) -> Result<Staged, Error> {
        let mut file = aside(&self.path)?;
        let filled = fill(&mut Measured { file: file.as_file_mut(), staging: self });
        if filled.is_err() && self.spent.load(Ordering::Relaxed) > self.limit {
            return Err(Error::TooLarge { limit: self.limit });
        }
        filled.map_err(io_error("write to", &self.path))?;
        Ok(Staged(file))
    }
}

/// A file with a temporary name; removed when it is dropped.
#[derive(Debug)]
pub struct Staged(tempfile::NamedTempFile);

impl Staged {
    fn persist(self, target: &Path) -> Result<(), Error> {
        self.0.persist(target).map_err(|error| io_error("write", target)(error.error))?;
        Ok(())
    }
}

/// Writes a file under a temporary name and renames it.
pub fn replace(directory: &Path, name: &str, bytes: &[u8]) -> Result<(), Error> {
    let target = directory.join(name);
    // A device or a pipe is written to; a file in its place would be the end of it.
    if fs::metadata(&target).is_ok_and(|found| !found.is_file() && !found.is_dir()) {
        return fs::write(&target, bytes).map_err(io_error("write", &target));
    }
    let mut file = aside(directory)?;
    file.write_all(bytes).map_err(io_error("write", &target))?;
    Staged(file).persist(&target)
}

/// A new file with a temporary name, to be given its own when it is whole.
///
/// # Errors
/// If it cannot be made.
pub fn aside(directory: &Path) -> Result<tempfile::NamedTempFile, Error> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(TEMPORARY);
    // As any other file: what the user's mask leaves of this.
    #[cfg(unix)]
    let builder = {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o666))
    };
    builder.tempfile_in(directory).map_err(io_error("write to", directory))
}

/// Names of all entries of a directory, parts that are not Unicode replaced.
fn list(directory: &Path) -> Result<BTreeSet<String>, Error> {
    let failed = || io_error("read", directory);
    let mut names = BTreeSet::new();
    for entry in fs::read_dir(directory).map_err(failed())? {
        names.insert(entry.map_err(failed())?.file_name().to_string_lossy().into_owned());
    }
    Ok(names)
}

/// The files listed in the manifest of an earlier render, and the manifest; nothing if it is of another program.
fn listed_by_manifest(path: &Path) -> BTreeSet<String> {
    let parsed =
        fs::read(path).ok().and_then(|bytes| serde_json::from_slice::<serde_json::Value>(&bytes).ok());
    let Some(manifest) = parsed else { return BTreeSet::new() };
    let program = |text: &str| text.split(' ').next().map(str::to_owned);
    if manifest["generator"].as_str().and_then(program) != program(GENERATOR) {
        return BTreeSet::new();
    }
    let files = manifest["files"].as_array().into_iter().flatten().filter_map(serde_json::Value::as_str);
    // A manifest may have been tampered with; no name in it leads out of the directory.
    files.chain([MANIFEST]).filter(|name| is_plain(name)).map(str::to_owned).collect()
}

/// The files listed in the journal of a render that was killed.
fn listed_by_journal(path: &Path) -> BTreeSet<String> {
    let text = fs::read_to_string(path).unwrap_or_default();
    text.lines().filter(|name| is_plain(name)).map(str::to_owned).collect()
}

/// True for a plain name that is not that of a hidden file of renders.
fn is_plain(name: &str) -> bool {
    !name.is_empty()
        && !name.starts_with('.')
        && !name.contains(|c: char| c == '/' || c == '\\' || c == ':' || c.is_control())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn manifest() -> Manifest {
        Manifest::new("leaf.dls", None, serde_json::json!({"format": "svg"}))
    }

    fn render(path: &Path, frames: usize, force: bool) -> Result<(), Error> {
        let mut directory = FrameDirectory::create(path, force)?;
        for i in 0..frames {
            directory.write(&FrameDirectory::frame_name(i, frames, "svg"), b"<svg/>")?;
        }
        directory.finish(&manifest())
    }

    fn names(path: &Path) -> Vec<String> {
        list(path).expect("readable").into_iter().collect()
    }

    #[test]
    fn frames_are_numbered_with_the_same_digits() {
        assert_eq!(FrameDirectory::frame_name(7, 10, "svg"), "frame-0007.svg");
        assert_eq!(FrameDirectory::frame_name(7, 10_000, "obj"), "frame-0007.obj");
        assert_eq!(FrameDirectory::frame_name(7, 10_001, "obj"), "frame-00007.obj");
        assert_eq!(FrameDirectory::frame_name(0, 0, "svg"), "frame-0000.svg");
    }

    #[test]
    fn an_earlier_render_is_replaced_as_a_whole() {
        let home = tempfile::tempdir().expect("a directory");
        let path = home.path().join("deep/er");
        render(&path, 3, false).expect("new");
        assert_eq!(names(&path), ["frame-0000.svg", "frame-0001.svg", "frame-0002.svg", "manifest.json"]);
        render(&path, 1, false).expect("again");
        assert_eq!(names(&path), ["frame-0000.svg", "manifest.json"]);
        let text = fs::read(path.join(MANIFEST)).expect("a manifest");
        let manifest: serde_json::Value = serde_json::from_slice(&text).expect("JSON");
        assert_eq!(manifest["files"], serde_json::json!(["frame-0000.svg"]));
        assert_eq!(manifest["settings"]["format"], "svg");
    }

    #[test]
    fn two_renders_do_not_share_a_directory() {
        let home = tempfile::tempdir().expect("a directory");
        let first = FrameDirectory::create(home.path(), false).expect("new");
        let second = FrameDirectory::create(home.path(), false);
        assert!(matches!(second, Err(Error::Busy(_))), "{second:?}");
        drop(first);
        render(home.path(), 1, false).expect("given back");
        assert_eq!(names(home.path()), ["frame-0000.svg", "manifest.json"]);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_device_is_written_to_and_stays_a_device() {
        // By way of a link of our own: no test touches what belongs to the system.
        let home = tempfile::tempdir().expect("a directory");
        let link = home.path().join("page.html");
        std::os::unix::fs::symlink("/dev/null", &link).expect("a link");
        replace(home.path(), "page.html", b"text").expect("written");
        let kept = fs::symlink_metadata(&link).expect("there").file_type().is_symlink();
        assert!(kept && fs::read(&link).expect("readable").is_empty());
    }

    #[test]
    fn more_bytes_than_are_allowed_are_not_written() {
        let home = tempfile::tempdir().expect("a directory");
        let mut directory = FrameDirectory::create(home.path(), false).expect("new").limited(1000);
        directory.write("frame-0000.svg", &[b'x'; 900]).expect("there is room");
        let error = directory.write("frame-0001.svg", &[b'x'; 101]).expect_err("too many");
        assert!(matches!(error, Error::TooLarge { limit: 1000 }), "{error}");
        assert!(!home.path().join("frame-0001.svg").exists());
    }

    #[test]
    fn files_of_others_are_safe() {
        let home = tempfile::tempdir().expect("a directory");
        let path = home.path();
        fs::write(path.join("thesis.tex"), "years of work").expect("written");
        let error = render(path, 1, false).unwrap_err().to_string();
        assert!(error.contains("`thesis.tex`") && error.contains("--force"), "{error}");
        assert_eq!(names(path), ["thesis.tex"]);
        render(path, 2, true).expect("forced");
        assert_eq!(names(path), ["frame-0000.svg", "frame-0001.svg", "manifest.json", "thesis.tex"]);
        assert_eq!(fs::read_to_string(path.join("thesis.tex")).expect("still there"), "years of work");
        assert!(render(path, 1, false).is_err(), "the thesis is still not ours");
        let file = path.join("thesis.tex");
        assert!(matches!(FrameDirectory::create(&file, true), Err(Error::NotADirectory(_))));
    }

    #[test]
    fn a_manifest_of_somebody_else_proves_nothing() {
        let home = tempfile::tempdir().expect("a directory");
        let path = home.path();
        for other in ["not JSON", "[]", r#"{"generator": "other 1.0", "files": ["a.svg"]}"#] {
            fs::write(path.join("a.svg"), "").expect("written");
            fs::write(path.join(MANIFEST), other).expect("written");
            assert!(matches!(FrameDirectory::create(path, false), Err(Error::Foreign { .. })), "{other}");
        }
        let evil = format!(r#"{{"generator": "{GENERATOR}", "files": ["../b", "a.svg", ".profile"]}}"#);
        fs::write(path.join(MANIFEST), evil).expect("written");
        assert_eq!(
            listed_by_manifest(&path.join(MANIFEST)).into_iter().collect::<Vec<_>>(),
            ["a.svg", MANIFEST]
        );
    }

    #[test]
    fn a_killed_render_leaves_whole_frames_and_no_obstacle() {
        let home = tempfile::tempdir().expect("a directory");
        let path = home.path();
        render(path, 1, false).expect("new");
        let mut killed = FrameDirectory::create(path, false).expect("ours");
        assert!(!path.join(MANIFEST).exists(), "incomplete from now on");
        killed.write("frame-0000.svg", b"whole").expect("written");
        killed.write("frame-0001.svg", b"whole").expect("written");
        drop(killed);
        fs::write(path.join(".dlsys-tmp-x1"), "half a fra").expect("written");
        render(path, 1, false).expect("taken over");
        assert_eq!(names(path), ["frame-0000.svg", "manifest.json"]);
    }

    #[test]
    fn names_that_lead_elsewhere_are_refused() {
        let home = tempfile::tempdir().expect("a directory");
        let mut directory = FrameDirectory::create(home.path(), false).expect("new");
        for name in ["", "../x", "a/b", ".hidden", "a\nb", MANIFEST] {
            assert!(matches!(directory.write(name, b""), Err(Error::Name(_))), "{name}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn frames_have_ordinary_permissions_and_errors_name_the_path() {
        use std::os::unix::fs::PermissionsExt;
        let home = tempfile::tempdir().expect("a directory");
        render(home.path(), 1, false).expect("new");
        let mode = |name: &str| fs::metadata(home.path().join(name)).expect("there").permissions().mode();
        fs::write(home.path().join("usual"), "").expect("written");
        assert_eq!(mode("frame-0000.svg"), mode("usual"));
        fs::create_dir(home.path().join("frame-0007.svg")).expect("made");
        let mut directory = FrameDirectory::create(home.path(), true).expect("forced");
        let error = directory.write("frame-0007.svg", b"").unwrap_err().to_string();
        assert!(error.contains("frame-0007.svg"), "{error}");
    }
}
