//! A scene as read from its files.

use super::arguments::SceneSource;
use super::images::{LAST_FILE, save_text};
use lf_core::image::{self, Channel};
use lf_core::scene::{CameraSource, WANTED};
use lf_core::{Camera, Error, Result, Session, cli::MemoryLimit, io, json};
use lf_synth::rays::Instrument;
use lf_synth::scene::{self, Scene};
use ndarray::Array2;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// A checked scene with its camera, its background image and the files it comes from.
pub struct Setup {
    /// Name of the scene's file for messages.
    pub name: String,
    pub scene: Scene,
    pub camera: Camera,
    pub background: Option<Array2<f32>>,
    inputs: Vec<PathBuf>,
    limit: MemoryLimit,
}

impl Setup {
    /// Reads and checks a scene and its files. Paths in it become relative to the current folder.
    pub fn open(source: &SceneSource, session: &mut Session) -> Result<Self> {
        session.phase("read", |session| {
            let name = io::name(&source.scene);
            let text = io::open_text(&source.scene)?;
            let mut scene = read(&text).map_err(|found| Error::new(&name, found, WANTED))?;
            let folder = source.scene.parent().unwrap_or(Path::new(""));
            let mut inputs = scene.join(folder);
            let mut camera = scene.camera.open(folder, &name)?;
            if let Some(lens) = &scene.thick_lens {
                camera = lens.camera(&camera).map_err(|refusal| refusal.about(&name))?;
            }
            scene::check(&scene, &camera).map_err(|refusal| refusal.about(&name))?;
            session.explain(format!("camera: {}", camera.about()));
            inputs.push(source.scene.clone());
            scene.seed = source.seed.unwrap_or(scene.seed);
            let origin = if source.seed.is_some() { "from --seed" } else { "from the scene" };
            session.explain(format!("seed {}, {origin}", scene.seed));
            let shape = (camera.sensor.height, camera.sensor.width);
            let file = scene.sensor_noise.as_ref().and_then(|noise| noise.background.as_deref());
            let background = file.map(|file| background(file, shape, source.reading.channel)).transpose()?;
            Ok(Self { name, scene, camera, background, inputs, limit: source.memory })
        })
    }

    /// The camera with the scene's effects.
    pub fn instrument(&self) -> Instrument {
        let Scene { second_stop, diffraction, thick_lens, .. } = &self.scene;
        let instrument = Instrument::new(&self.camera, *second_stop, diffraction.as_ref());
        let instrument = instrument.with_lens(thick_lens.as_ref(), &self.camera);
        if self.scene.coherent_light || self.camera.fresnel().is_some() {
            return instrument.in_coherent_light(&self.camera, diffraction.as_ref());
        }
        instrument
    }

    /// Refuses work that takes more memory than allowed; see [`Session::allow_memory`].
    pub fn allow_memory(&self, bytes: f64, what: impl FnOnce() -> String, session: &mut Session) -> Result<()> {
        session.allow_memory(self.limit, bytes, &self.name, what)
    }

    /// The sensor in words.
    pub fn sensor(&self) -> String {
        format!("a sensor of {} x {} px", self.camera.sensor.width, self.camera.sensor.height)
    }

    /// Refuses to overwrite a file that the scene comes from.
    pub fn keep_apart(&self, output: &Path, session: &Session) -> Result<()> {
        let inputs: Vec<&Path> = self.inputs.iter().map(PathBuf::as_path).collect();
        session.keep_apart(output, &inputs)
    }

    /// Records the expected counts of an image with the scene's sensor, in place. `number` is that of its noise.
    pub fn record(&self, name: &str, pixels: &mut Array2<f32>, number: usize, session: &mut Session) -> Result<()> {
        let Some(noise) = &self.scene.sensor_noise else { return Ok(()) };
        let recorded = session.phase("record", |_| {
            Ok(noise.record(pixels, self.background.as_ref(), self.scene.seed_of(&self.camera), number))
        })?;
        if recorded.clipped > 0 {
            session.warn(format!("{name}: {} pixels are full", recorded.clipped));
        }
        Ok(())
    }

    /// Writes the camera, and the scene as used: with the seed that was typed and the camera in place.
    pub fn save(&self, folder: &Path) -> Result<()> {
        save_text(&folder.join("camera.json"), &self.camera.to_json())?;
        let camera = serde_json::to_value(&self.camera).expect("a camera is plain data");
        let used = Scene { camera: CameraSource::Camera(camera), ..self.scene.clone() };
        let text = serde_json::to_string_pretty(&used).expect("a scene is plain data");
        save_text(&folder.join(LAST_FILE), &format!("{text}\n"))
    }
}

/// Reads a scene. The error names all its mistakes, those of a camera inside it too.
fn read(text: &str) -> std::result::Result<Scene, String> {
    check(&serde_json::from_str(text).map_err(|error| format!("not JSON ({error})"))?)
}

/// A scene from JSON. The error is that of a file.
pub fn check(value: &Value) -> std::result::Result<Scene, String> {
    let mut found = json::mistakes::<Scene>(value, "");
    if let Some(camera) = value.get("camera").filter(|camera| !camera.is_string()) {
        found.extend(json::mistakes::<Camera>(camera, "camera"));
    }
    if found.is_empty() { json::read(value) } else { Err(found.join(", ")) }
}

/// Reads an image of counts of shape (height, width), none of them negative.
fn background(file: &Path, shape: (usize, usize), channel: Option<Channel>) -> Result<Array2<f32>> {
    let pixels = image::open_counts(file, channel)?.pixels;
    if pixels.dim() != shape {
        let found = format!("background of {} x {} px", pixels.ncols(), pixels.nrows());
        return Err(Error::new(io::name(file), found, format!("wanted the sensor's {} x {} px", shape.1, shape.0)));
    }
    match pixels.iter().find(|counts| **counts < 0.0) {
        Some(counts) => {
            let found = format!("background with pixels of {counts} counts");
            Err(Error::new(io::name(file), found, "wanted light that is not negative"))
        }
        None => Ok(pixels),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lf_synth::scene::ready;

    #[test]
    fn all_mistakes_of_a_scene_and_its_camera_are_named_at_once() {
        let mut scene = ready::scene("tank").unwrap();
        assert!(read(&scene.to_string()).is_ok());
        let remove = |object: &mut Value, key: &str| drop(object.as_object_mut().unwrap().remove(key));
        remove(&mut scene["volume"], "z_mm");
        remove(&mut scene["camera"]["sensor"], "width");
        scene["camera"]["main_lens"]["aperture"] = "round".into();
        scene["particels"] = scene["particles"].clone();
        remove(&mut scene, "particles");
        scene["light"]["profile"] = "gauss".into();
        scene["flow"]["core"] = 1.into();
        let found = read(&scene.to_string()).unwrap_err();
        for words in [
            "without volume.z_mm",
            "particels should be 'particles'",
            "light.profile is 'gauss', which should be 'gaussian'",
            "flow.core should be 'core_mm'",
            "without camera.sensor.width",
            "camera.main_lens.aperture is 'round', which should be 'circle'",
        ] {
            assert!(found.contains(words), "{words}: {found}");
        }
        assert!(read("{").unwrap_err().starts_with("not JSON ("));
    }
}
