//! Inputs that another program changes while a tool reads them.

use super::names::{metadata, name};
use super::os::{FileId, file_id, is_guarded, stdin_file};
use crate::{Error, Result};
use std::collections::BTreeMap;
use std::fs::Metadata;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::SystemTime;

/// Identity of a file's content: the file, its length, and the time of the last change.
type Mark = (FileId, u64, Option<SystemTime>);

/// The inputs in use, and the first one that changed before it was out of use.
struct Inputs {
    next: u64,
    used: BTreeMap<u64, (PathBuf, Mark)>,
    changed: Option<PathBuf>,
}

static INPUTS: Mutex<Inputs> = Mutex::new(Inputs { next: 0, used: BTreeMap::new(), changed: None });

fn inputs() -> MutexGuard<'static, Inputs> {
    INPUTS.lock().unwrap_or_else(PoisonError::into_inner)
}

fn mark(path: &Path, found: &Metadata) -> Mark {
    (file_id(path, found), found.len(), found.modified().ok())
}

/// Whether the file was written to. A file that was removed or replaced keeps its content for those that hold it open.
fn has_changed((path, then): &(PathBuf, Mark)) -> bool {
    metadata(path, stdin_file).is_some_and(|now| {
        let now = mark(path, &now);
        now.0 == then.0 && now != *then
    })
}

/// An input in use. Dropping it ends the use.
pub(super) struct Used(u64);

impl Used {
    /// Begins the use of a file with the metadata `found`.
    pub fn new(path: &Path, found: &Metadata) -> Self {
        let mut inputs = inputs();
        inputs.next += 1;
        let number = inputs.next;
        inputs.used.insert(number, (path.to_owned(), mark(path, found)));
        Self(number)
    }
}

impl Drop for Used {
    fn drop(&mut self) {
        let mut inputs = inputs();
        if let Some(input) = inputs.used.remove(&self.0)
            && inputs.changed.is_none()
            && has_changed(&input)
        {
            inputs.changed = Some(input.0);
        }
    }
}

/// Refuses an input of this tool that another program has written to while it was in use: results may mix its old and
/// its new content. Outside a tool, before [`super::guard`], inputs may change.
pub fn check_inputs() -> Result<()> {
    if !is_guarded() {
        return Ok(());
    }
    let inputs = inputs();
    let changed = inputs.changed.as_ref().or_else(|| {
        let changed = inputs.used.values().find(|input| has_changed(input));
        changed.map(|(path, _)| path)
    });
    let wanted = "wanted a file that stays as it is during the run";
    changed.map_or(Ok(()), |path| Err(Error::new(name(path), "changed while it was read", wanted)))
}
