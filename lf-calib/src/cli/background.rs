//! `lf-calib background`: frames in, what stays the same in all of them out.

use super::arguments::BackgroundArguments;
use super::files::{Sizes, named_in};
use lf_calib::{Background, MeanImage, SlidingMinimum, haze};
use lf_core::image::{self, Channel, ClippedBlack, Image, Stack};
use lf_core::{Camera, Error, History, Refusal, Result, Session, Verdict, camera::Sensor, io};
use ndarray::Array2;
use std::collections::VecDeque;
use std::path::{Path, PathBuf};

/// Bytes of a pixel that a frame takes while it is read.
const READ_BYTES: f64 = 12.0;
/// Fewer frames leave light of particles in the background.
const ENOUGH: usize = 10;

pub fn background(arguments: &BackgroundArguments, session: &mut Session) -> Result<Verdict> {
    let BackgroundArguments { frames, quantile, mean, sliding, haze, camera, reading, output, memory, .. } = arguments;
    if !(0.0..=0.5).contains(quantile) {
        return Err(Error::new("--quantile", quantile.to_string(), "wanted 0 to 0.5"));
    }
    let inputs: Vec<&Path> =
        frames.iter().chain(haze).chain(&arguments.expected).chain(camera).map(PathBuf::as_path).collect();
    session.keep_apart(output, &inputs)?;
    if let Some(window) = sliding {
        return sliding_minimum(arguments, *window, session);
    }
    io::check_place(output)?;
    let camera = camera.as_deref().map(Camera::open).transpose()?;
    let sensor = camera.as_ref().map(|camera| camera.sensor.clone());
    let mut frames = FrameFiles::open(frames, sensor, reading.channel)?;
    let count = frames.count;
    let statistic = match (mean, *quantile > 0.0) {
        (true, _) => "mean".to_string(),
        (_, true) => format!("quantile {quantile}"),
        _ => "minimum".to_string(),
    };
    session.explain(format!("{statistic} of {count} frames, pixel by pixel"));
    let pixels = frames.pixels();
    let bytes = if *mean { 2.0 * READ_BYTES * pixels } else { Background::bytes(count, *quantile, pixels) };
    let what = || format!("the {statistic} of {count} frames of {pixels} pixels");
    let more = READ_BYTES * pixels * if haze.is_some() { 2.0 } else { 1.0 };
    session.allow_memory(*memory, bytes + more, "background", what)?;
    let (mut sum, mut lowest) = (MeanImage::default(), Background::new(count, *quantile));
    let (used, history) = frames.each(session, |mut frame| match mean {
        true => {
            // The mean of a clipped normal distribution is not that of its light.
            if let Some(black) = ClippedBlack::of(frame.view()) {
                black.unclip(&mut frame);
            }
            sum.add(&frame)
        }
        false => lowest.add(&frame),
    })?;
    let Some(pixels) = (if *mean { sum.mean().map(|mean| mean.mapv(|value| value.max(0.0))) } else { lowest.finish() })
    else {
        let none = || Error::new(format!("the {count} frames"), "none was read", "wanted at least one");
        return Err(frames.left_out.pop().unwrap_or_else(none));
    };
    let pixels = match (haze, &camera) {
        (Some(white), Some(camera)) => haze_of(pixels, white, camera, arguments, session)?,
        _ => pixels,
    };
    session.count("frames", used);
    session.count("left_out", frames.left_out.len());
    if !mean && haze.is_none() {
        match used {
            1 => session.warn(
                "the background of one frame is the frame itself, particles and all: give many frames, or --mean of \
                 frames without particles",
            ),
            2..ENOUGH => session.warn(format!(
                "light that lies in the same place in all {used} frames stays in the background, that of particles too: \
                 give at least {ENOUGH} frames, so far apart that particles have left their places, or --mean of \
                 frames without particles"
            )),
            _ => (),
        }
    }
    let history = session.history(&history);
    session.phase("write", |_| image::save(output, &pixels, &history))?;
    for error in frames.left_out {
        session.warn(format!("left out: {error}"));
    }
    Ok(Verdict::Done)
}

/// The haze in an image.
fn haze_of(
    mut pixels: Array2<f32>,
    white: &Path,
    camera: &Camera,
    arguments: &BackgroundArguments,
    session: &mut Session,
) -> Result<Array2<f32>> {
    let reach = arguments.reach;
    if !(0.5..=1000.0).contains(&reach) {
        return Err(Error::new("--reach", reach.to_string(), "wanted 0.5 to 1000 lenslets"));
    }
    let image = session.phase("read", |_| image::open_counts(white, arguments.reading.channel))?;
    if let Some(file) = &arguments.expected {
        let light = image::open(file)?.pixels;
        let (height, width) = light.dim();
        camera.check_image(&io::name(file), width, height)?;
        pixels -= &light;
    }
    let found = session.phase("haze", |_| {
        haze(&pixels, &image.pixels, camera.pitch_px(), reach).map_err(|refusal| refusal.about(io::name(white)))
    })?;
    let light = image::all_counts(&found.pixels) / image::all_counts(&pixels);
    session.explain(format!(
        "haze: {:.3} of the white image on {:.1} counts, {:.0} % of the light; {} rounds",
        found.share,
        found.offset,
        100.0 * light,
        found.rounds
    ));
    session.count("haze_share", found.share);
    session.count("offset_counts", found.offset);
    Ok(found.pixels)
}

/// Writes a background for every frame. A frame that cannot be read ends the work: its neighbours need it.
fn sliding_minimum(arguments: &BackgroundArguments, window: usize, session: &mut Session) -> Result<Verdict> {
    let frames = image::frames(&arguments.frames);
    let places = named_in(&arguments.output, &frames)?;
    let inputs: Vec<&Path> = frames.iter().map(PathBuf::as_path).collect();
    for place in &places {
        session.keep_apart(place, &inputs)?;
        io::check_place(place)?;
    }
    if let Some(size) = Sizes::of(&frames)?.first() {
        let (held, [width, height]) = (window.min(frames.len()), size);
        let bytes = (4.0 * (held + 1) as f64 + READ_BYTES) * width as f64 * height as f64;
        let what = || format!("{held} frames of {width} x {height} px");
        session.allow_memory(arguments.memory, bytes, "--sliding", what)?;
    }
    let mut sliding = SlidingMinimum::new(window / 2);
    // A background comes later than its frame, whose history waits for it.
    let mut histories = VecDeque::new();
    let mut written = places.iter();
    let mut save = |pixels: Array2<f32>, histories: &mut VecDeque<History>, session: &mut Session| {
        let (Some(place), Some(history)) = (written.next(), histories.pop_front()) else { return Ok(()) };
        let history = session.history(&history);
        session.phase("write", |_| image::save(place, &pixels, &history))
    };
    let progress = session.progress("frames", frames.len() as u64);
    for file in &frames {
        let frame = session.phase("read", |_| image::open_counts(file, arguments.reading.channel))?;
        histories.push_back(frame.history);
        let found = sliding.add(frame.pixels).map_err(|refusal| refusal.about(io::name(file)))?;
        found.map_or(Ok(()), |pixels| save(pixels, &mut histories, session))?;
        progress.add(1);
    }
    std::iter::from_fn(|| sliding.rest()).try_for_each(|pixels| save(pixels, &mut histories, session))?;
    session.count("frames", frames.len());
    Ok(Verdict::Done)
}

struct FrameFiles {
    /// Files; those through a pipe are held in memory. Others are opened again: the number of mapped files is limited.
    files: Vec<(PathBuf, Option<Stack>)>,
    count: usize,
    /// Width and height of the first frame, px, if its header has them.
    size: Option<[usize; 2]>,
    sensor: Option<Sensor>,
    channel: Option<Channel>,
    left_out: Vec<Error>,
}

impl FrameFiles {
    /// Counts the frames, which a quantile needs to know before the first one.
    fn open(paths: &[PathBuf], sensor: Option<Sensor>, channel: Option<Channel>) -> Result<Self> {
        let mut frames = Self { files: Vec::new(), count: 0, size: None, sensor, channel, left_out: Vec::new() };
        for path in paths {
            match Stack::open(path) {
                Ok(stack) => {
                    frames.count += stack.images();
                    frames.size = frames.size.or_else(|| stack.size_px(0).ok());
                    frames.files.push((path.clone(), Some(stack).filter(|stack| !stack.is_mapped())));
                }
                Err(error) => frames.leave_out(error)?,
            }
        }
        if frames.count == 0 {
            let none = || Error::new("background", "no frame", "wanted at least one");
            return Err(frames.left_out.pop().unwrap_or_else(none));
        }
        Ok(frames)
    }

    /// Pixels of a frame: those of the camera, or of the first frame.
    fn pixels(&self) -> f64 {
        let size = self.sensor.as_ref().map(|sensor| [sensor.width, sensor.height]).or(self.size);
        size.map_or(0.0, |[width, height]| width as f64 * height as f64)
    }

    /// Takes every frame into a background. Returns the number of frames used, and the history of the first.
    fn each(
        &mut self,
        session: &mut Session,
        mut take: impl FnMut(Array2<f32>) -> std::result::Result<(), Refusal>,
    ) -> Result<(usize, History)> {
        let mut history = None;
        let mut used = 0;
        let progress = session.progress("frames", self.count as u64);
        for (path, stack) in std::mem::take(&mut self.files) {
            let stack = stack.map_or_else(|| Stack::open(&path), Ok)?;
            for number in 0..stack.images() {
                let frame = session.phase("read", |_| self.read(&stack, number));
                progress.add(1);
                match frame {
                    Ok(frame) => {
                        let refused = |refusal: Refusal| refusal.about(stack.name(number));
                        session.phase("sort", |_| take(frame.pixels).map_err(refused))?;
                        used += 1;
                        history.get_or_insert(frame.history);
                    }
                    Err(error) => self.leave_out(error)?,
                }
            }
        }
        Ok((used, history.unwrap_or_default()))
    }

    /// With a camera a frame must have the size of its sensor.
    fn read(&self, stack: &Stack, number: usize) -> Result<Image> {
        let frame = stack.read(number, self.channel)?;
        let (height, width) = frame.pixels.dim();
        match &self.sensor {
            Some(sensor) if (width, height) != (sensor.width, sensor.height) => {
                let wanted = format!("wanted {} x {} px, the camera's sensor", sensor.width, sensor.height);
                Err(Error::new(stack.name(number), format!("{width} x {height} px"), wanted))
            }
            _ => Ok(frame),
        }
    }

    /// With a camera, leaves out what `error` is about. Without one it cannot be known which frame is wrong.
    fn leave_out(&mut self, error: Error) -> Result<()> {
        if self.sensor.is_none() {
            return Err(error);
        }
        self.left_out.push(error);
        Ok(())
    }
}
