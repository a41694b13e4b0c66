//! The volume from any side: particles of the first frame and vectors, for the page's script to turn.

use super::folder::{RunFiles, spread};
use super::html::{Section, escape};
use super::source::Source;
use lf_core::field::{NO_DATA, REPLACED};
use lf_core::{Camera, Field, particles};
use serde::Serialize;

const VIEW: &str = include_str!("page/space.html");
/// Largest numbers of vectors and particles on the page.
const MOST_VECTORS: usize = 1500;
const MOST_PARTICLES: usize = 3000;

/// The data of the script. Places are mm, vectors have the unit.
#[derive(Serialize)]
struct Space {
    unit: &'static str,
    /// Displacement per frame interval, mm, of one unit.
    dt: f64,
    /// Pixels at the focal plane per frame interval, of one unit.
    px: Option<f64>,
    #[serde(rename = "box")]
    bounds: [[f64; 2]; 3],
    /// Smallest distance of two vectors, mm.
    step: f64,
    /// x, y, z, u, v, w, and 1 where it is replaced.
    vectors: Vec<[f64; 7]>,
    particles: Vec<[f64; 3]>,
}

/// The section: the mean field or else the first one, and the particles of the first frame. None without both, or
/// without a box. Other sections name files that cannot be read.
pub(super) fn section(source: &dyn Source, folder: &RunFiles, camera: Option<&Camera>) -> Option<Section> {
    let mean = folder.mean.as_ref().filter(|_| folder.fields.len() != 1);
    let field = mean.or(folder.fields.first()).and_then(|file| Some((file, source.field(file).ok()?)));
    let table = folder.particles.first().and_then(|file| Some((file, particles::read(&source.text(file).ok()?).ok()?)));
    let mut space = Space {
        unit: "mm",
        dt: 1.0,
        px: None,
        bounds: bounds(source, folder, field.as_ref().map(|(_, field)| field))?,
        step: 1.0,
        vectors: Vec::new(),
        particles: Vec::new(),
    };
    let mut shown = Vec::new();
    if let Some((file, field)) = &field {
        let stride = space.fill(field);
        let [x, y, z] = stride;
        let thinned = if stride == [1; 3] { String::new() } else { format!(" (one of {x} x {y} x {z})") };
        let known = (0..field.len()).filter(|n| is_known(field, *n)).count();
        shown.push(format!("{} of {known} vectors of {file}{thinned}", space.vectors.len()));
    }
    space.px = camera.map(|camera| space.dt / camera.pixel_in_focus_mm());
    if let Some((file, table)) = &table {
        let chosen = spread(table, MOST_PARTICLES);
        space.particles = chosen.iter().map(|particle| particle.place_mm.map(rounded)).collect();
        shown.push(format!("{} of {} particles of {file}", chosen.len(), table.len()));
    }
    let data = serde_json::to_string(&space).ok().filter(|_| !shown.is_empty())?;
    let mut section = Section::new("inside", "Inside the volume");
    section.content += VIEW;
    section.content += &format!("<script type=\"application/json\" id=\"space-data\">{data}</script>\n");
    section.content += &format!(
        "<p class=\"soft\">Shown: {}. Replaced vectors are hollow. The farther, the fainter; \
the scales of lengths hold across the line of sight, and depth has the larger errors.</p>\n",
        escape(&shown.join("; "))
    );
    Some(section)
}

/// The box of the first volume, or else of the field.
fn bounds(source: &dyn Source, folder: &RunFiles, field: Option<&Field>) -> Option<[[f64; 2]; 3]> {
    let volume = folder.volumes.first().or(folder.supports.first()).and_then(|file| source.volume(file).ok());
    let of_volume = volume.map(|volume| {
        let grid = volume.grid();
        [0, 1, 2].map(|axis| {
            let low = grid.centre_mm(axis, 0) - 0.5 * grid.spacing_mm[axis];
            [low, low + grid.shape[axis] as f64 * grid.spacing_mm[axis]].map(rounded)
        })
    });
    of_volume.or(field.map(|field| [0, 1, 2].map(|axis| field.layout.bounds_mm(axis))))
}

impl Space {
    /// Takes the vectors of a field that have data, evenly thinned until they fit. Returns the steps along x, y and z.
    fn fill(&mut self, field: &Field) -> [usize; 3] {
        let layout = &field.layout;
        self.unit = if layout.dt_s.is_some() { "mm/s" } else { "mm" };
        self.dt = layout.dt_s.unwrap_or(1.0);
        let [nx, ny, _] = layout.shape;
        let mut stride = [1; 3];
        let apart = |stride: &[usize; 3], axis: usize| stride[axis] as f64 * layout.spacing_mm[axis];
        let kept = loop {
            let place = |n: &usize| [n % nx, n / nx % ny, n / nx / ny];
            let first = [0, 1, 2].map(|axis| (layout.shape[axis] - 1) % stride[axis] / 2);
            let on_stride = |n: &usize| (0..3).all(|axis| place(n)[axis] % stride[axis] == first[axis]);
            let kept: Vec<usize> = (0..field.len()).filter(on_stride).filter(|n| is_known(field, *n)).collect();
            let open = (0..3).filter(|axis| stride[*axis] < layout.shape[*axis]);
            match open.min_by(|a, b| apart(&stride, *a).total_cmp(&apart(&stride, *b))) {
                Some(axis) if kept.len() > MOST_VECTORS => stride[axis] += 1,
                _ => break kept,
            }
        };
        self.step = (0..3).map(|axis| apart(&stride, axis)).fold(f64::INFINITY, f64::min);
        let vector = |n: usize| {
            let [[x, y, z], [u, v, w]] = [field.place_mm(n), field.displacement_mm(n).to_array().map(|d| d / self.dt)];
            [x, y, z, u, v, w, f64::from(u8::from(field.flag[n] == REPLACED))].map(rounded)
        };
        self.vectors = kept.into_iter().map(vector).collect();
        stride
    }
}

fn is_known(field: &Field, n: usize) -> bool {
    field.flag[n] != NO_DATA && field.displacement_mm(n).is_finite()
}

/// A number with four digits.
fn rounded(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}
