//! Particles and tracks as VTK polygonal data (`.vtp`).
//!
//! Every particle is a point and a vertex with its numbers. If the table has several frames, particles of one number
//! are joined in the order of their frames, a line a track, and `displacement_mm` leads to the next frame in which the
//! particle is known; it is NaN where the track ends.

use lf_core::{History, Particle, field::write_field_data};
use std::collections::BTreeMap;
use std::io::{Result, Write};

/// One array of the file: its type, its name, its components and its bytes.
struct VtkArray {
    kind: &'static str,
    name: &'static str,
    components: usize,
    bytes: Vec<u8>,
}

impl VtkArray {
    fn floats(name: &'static str, components: usize, values: impl Iterator<Item = f64>) -> Self {
        Self { kind: "Float64", name, components, bytes: values.flat_map(f64::to_le_bytes).collect() }
    }

    fn wholes(name: &'static str, values: impl Iterator<Item = u64>) -> Self {
        // VTK has no number above 2^63 in its tables of cells.
        let bytes = values.flat_map(|value| (value.min(i64::MAX as u64) as i64).to_le_bytes()).collect();
        Self { kind: "Int64", name, components: 1, bytes }
    }
}

/// Writes a table of particles. `history` may be empty.
pub fn write_polydata(particles: &[Particle], history: &History, dt_s: Option<f64>, out: &mut dyn Write) -> Result<()> {
    let tracks = tracks(particles);
    let count = particles.len();
    let points = vec![VtkArray::floats("places_mm", 3, particles.iter().flat_map(|particle| particle.place_mm))];
    let numbers = numbers(particles, &tracks);
    let vertices = cells(0..count as u64, (1..=count as u64).collect());
    let mut end = 0;
    let ends = tracks.iter().map(|track| {
        end += track.len() as u64;
        end
    });
    let lines = cells(tracks.iter().flatten().map(|n| *n as u64), ends.collect());
    writeln!(out, r#"<?xml version="1.0"?>"#)?;
    writeln!(out, r#"<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64">"#)?;
    writeln!(out, "<PolyData>")?;
    write_field_data(out, dt_s, history)?;
    let lines_count = tracks.len();
    writeln!(out, r#"<Piece NumberOfPoints="{count}" NumberOfVerts="{count}" NumberOfLines="{lines_count}">"#)?;
    let mut offset = 0;
    for (section, arrays) in [("PointData", &numbers), ("Points", &points), ("Verts", &vertices), ("Lines", &lines)] {
        writeln!(out, "<{section}>")?;
        for VtkArray { kind, name, components, bytes } in arrays {
            let about = format!(r#"type="{kind}" Name="{name}" NumberOfComponents="{components}""#);
            writeln!(out, r#"<DataArray {about} format="appended" offset="{offset}"/>"#)?;
            offset += size_of::<u64>() + bytes.len();
        }
        writeln!(out, "</{section}>")?;
    }
    write!(out, "</Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_")?;
    for VtkArray { bytes, .. } in [numbers, points, vertices, lines].iter().flatten() {
        out.write_all(&(bytes.len() as u64).to_le_bytes())?;
        out.write_all(bytes)?;
    }
    writeln!(out, "\n</AppendedData>\n</VTKFile>")
}

/// The tables of a list of cells: the points of all cells, and where each cell ends.
fn cells(points: impl Iterator<Item = u64>, ends: Vec<u64>) -> Vec<VtkArray> {
    vec![VtkArray::wholes("connectivity", points), VtkArray::wholes("offsets", ends.into_iter())]
}

/// The particles of each number that is known in several frames, in the order of the frames.
fn tracks(particles: &[Particle]) -> Vec<Vec<usize>> {
    let mut by_number = BTreeMap::<u64, Vec<usize>>::new();
    particles.iter().enumerate().for_each(|(n, particle)| by_number.entry(particle.id).or_default().push(n));
    let mut tracks: Vec<Vec<usize>> = by_number.into_values().filter(|track| track.len() > 1).collect();
    tracks.iter_mut().for_each(|track| track.sort_by_key(|n| particles[*n].frame));
    // Particles of one frame that share a number are no track.
    tracks.retain(|track| track.windows(2).all(|pair| particles[pair[0]].frame < particles[pair[1]].frame));
    tracks
}

/// The numbers of every particle.
fn numbers(particles: &[Particle], tracks: &[Vec<usize>]) -> Vec<VtkArray> {
    let mut arrays = vec![
        VtkArray::floats("intensity", 1, particles.iter().map(|particle| particle.intensity)),
        VtkArray::wholes("id", particles.iter().map(|particle| particle.id)),
        VtkArray::wholes("frame", particles.iter().map(|particle| particle.frame as u64)),
    ];
    if !particles.is_empty() && particles.iter().all(|particle| particle.uncertainty.is_some()) {
        let stated = || particles.iter().filter_map(|particle| particle.uncertainty);
        arrays.push(VtkArray::floats("uncertainty_mm", 3, stated().flat_map(|stated| stated.std_mm().to_array())));
        arrays.push(VtkArray::floats("uncertainty_intensity", 1, stated().map(|stated| stated.intensity)));
    }
    if !tracks.is_empty() {
        let mut steps = vec![[f64::NAN; 3]; particles.len()];
        for pair in tracks.iter().flat_map(|track| track.windows(2)) {
            let [from, to] = [pair[0], pair[1]].map(|n| particles[n].place_mm);
            steps[pair[0]] = [0, 1, 2].map(|axis| to[axis] - from[axis]);
        }
        arrays.insert(0, VtkArray::floats("displacement_mm", 3, steps.into_iter().flatten()));
    }
    arrays
}
