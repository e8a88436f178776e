//! The field file, written beside the computation: frames are handed to a thread of their own, which compresses and writes them in order.
//!
//! Few frames wait at a time: where the disk is slower than the computation, the computation waits, and memory stays bounded. What is written
//! is what would have been written at once.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::JoinHandle;

use super::vtkhdf::FieldFile;
use super::{Field, OutputError, Snapshot};

/// Frames that may wait.
const WAITING: usize = 2;

/// A frame that owns what it shows.
#[derive(Debug, Clone)]
pub struct Frame {
    /// Time (or load factor of a static problem).
    pub time: f64,
    /// Number of the time step or load increment.
    pub step: u64,
    /// Displacement of each point; unused components are zero.
    pub displacement: Vec<[f64; 3]>,
    /// The other fields.
    pub fields: Vec<Field>,
}

impl Frame {
    fn snapshot(&self) -> Snapshot<'_> {
        Snapshot { time: self.time, step: self.step, displacement: &self.displacement, fields: &self.fields }
    }
}

/// A field file with its thread. Dropped without [`finish`](Self::finish), it still writes the frames that it has been given.
#[derive(Debug)]
pub struct BackgroundFile {
    sender: Option<SyncSender<Frame>>,
    writer: Option<JoinHandle<Result<(), OutputError>>>,
}

impl BackgroundFile {
    /// Starts the thread; the file is created with the first frame. `id`, `reference` and `triangles`: see
    /// [`FieldFile::create_with`].
    ///
    /// # Errors
    /// [`OutputError::Io`] where no thread can be started.
    pub fn start(path: PathBuf, id: Arc<[i64]>, reference: Arc<[[f64; 3]]>, triangles: Vec<[u32; 3]>) -> Result<Self, OutputError> {
        let (sender, frames) = sync_channel::<Frame>(WAITING);
        let at = path.clone();
        let write = move || {
            let mut file: Option<FieldFile> = None;
            // ends with the first error: the sender then finds nobody listening
            for frame in frames {
                match &mut file {
                    Some(file) => file.append(&frame.snapshot())?,
                    None => file = Some(FieldFile::create_with(&path, &id, &reference, &triangles, &[], &frame.snapshot())?),
                }
            }
            Ok(())
        };
        let writer = std::thread::Builder::new().name("field file".into()).spawn(write);
        let writer = writer.map_err(|source| OutputError::Io { action: "start a thread to write", path: at, source })?;
        Ok(Self { sender: Some(sender), writer: Some(writer) })
    }

    /// Hands over a frame; waits while too many are being written.
    ///
    /// # Errors
    /// The error that an earlier frame met.
    pub fn push(&mut self, frame: Frame) -> Result<(), OutputError> {
        match &self.sender {
            Some(sender) if sender.send(frame).is_ok() => Ok(()),
            _ => self.join(),
        }
    }

    /// Waits until all frames are written.
    ///
    /// # Errors
    /// The first error that a frame met.
    pub fn finish(mut self) -> Result<(), OutputError> {
        self.join()
    }

    fn join(&mut self) -> Result<(), OutputError> {
        self.sender = None;
        match self.writer.take().map(JoinHandle::join) {
            Some(Ok(written)) => written,
            Some(Err(panic)) => std::panic::resume_unwind(panic),
            None => Ok(()),
        }
    }
}

impl Drop for BackgroundFile {
    fn drop(&mut self) {
        self.sender = None;
        if let Some(writer) = self.writer.take() {
            // nobody is left to tell
            let _ = writer.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::FieldValues;

    fn frame(step: u64, points: usize) -> Frame {
        let value = |p: usize| (p as f64 * 0.37 + step as f64).sin();
        Frame {
            time: step as f64 * 0.25,
            step,
            displacement: (0..points).map(|p| [value(p), -value(p), 0.0]).collect(),
            fields: vec![Field::new("damage", FieldValues::Scalar((0..points).map(value).collect()))],
        }
    }

    #[test]
    fn frames_are_written_in_order_as_if_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let (beside, at_once) = (folder.path().join("beside.vtkhdf"), folder.path().join("at_once.vtkhdf"));
        let n = 500;
        let (id, reference): (Vec<i64>, Vec<[f64; 3]>) = ((0..n as i64).collect(), (0..n).map(|p| [p as f64, 0.0, 0.0]).collect());
        let mut file = BackgroundFile::start(beside.clone(), id.clone().into(), reference.clone().into(), vec![]).unwrap();
        let frames: Vec<Frame> = (0..9).map(|step| frame(step, n)).collect();
        frames.iter().for_each(|f| file.push(f.clone()).unwrap());
        file.finish().unwrap();
        let mut direct = FieldFile::create(&at_once, &id, &reference, &[], &frames[0].snapshot()).unwrap();
        frames[1..].iter().for_each(|f| direct.append(&f.snapshot()).unwrap());
        assert_eq!(std::fs::read(beside).unwrap(), std::fs::read(at_once).unwrap());
    }

    #[test]
    fn the_first_error_ends_it_and_comes_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("fields.vtkhdf");
        let mut file = BackgroundFile::start(path, [0, 1].into(), [[0.0; 3]; 2].into(), vec![]).unwrap();
        // a frame of another number of points is refused; the error comes with one of the next frames or at the end
        let pushed: Result<(), OutputError> =
            [2, 3, 2, 2, 2, 2].into_iter().enumerate().try_for_each(|(k, n)| file.push(frame(k as u64, n)));
        let error = pushed.and_then(|()| file.finish()).unwrap_err();
        assert!(matches!(error, OutputError::Length { .. }), "{error}");
    }
}
