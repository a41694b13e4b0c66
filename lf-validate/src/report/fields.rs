//! The fields: a view of their layers, histograms and statistics.

use super::folder::spread;
use super::html::Section;
use super::motion::FieldStatistics;
use super::packed::{PackedField, bytes};
use super::source::Source;
use lf_core::{Camera, Field, Refusal};

/// Bytes of the page that fields may take.
const MOST_BYTES: usize = 3_600_000;
/// Upper limit of the fields that are read for statistics; they are spread over the run.
const MOST_FIELDS: usize = 200;
/// The page offers at most this many fields to choose from.
const MOST_CHOICES: usize = 12;

/// The controls and the canvas of the view. The script fills them.
const VIEW: &str = include_str!("page/view.html");

/// The parts of the page that come from the fields. They are empty without a field that can be read.
#[derive(Default)]
pub(super) struct FieldSections {
    pub view: Option<Section>,
    pub statistics: Option<Section>,
    /// Lines of the summary at the top.
    pub summary: Vec<(String, String)>,
    /// Sums over the fields.
    pub motion: Option<FieldStatistics>,
    /// The steps that led to the last field.
    pub history: Vec<String>,
}

/// Reads the fields and shows them.
pub(super) fn sections(
    source: &dyn Source,
    files: &[String],
    mean: Option<&str>,
    camera: Option<&Camera>,
    notes: &mut Vec<String>,
) -> FieldSections {
    let pixel_mm = camera.map(Camera::pixel_in_focus_mm);
    let mut view = FieldView { choices: Vec::new(), pixel_mm, bytes: 0, is_full: false };
    let many = mean.filter(|_| files.len() > 1 || files.is_empty());
    if let Some((file, field)) = many.and_then(|file| Some((file, open(source, file, notes)?))) {
        view.add("mean of all fields".into(), &field)
            .unwrap_or_else(|refusal| notes.push(refusal.about(file).to_string()));
    }
    let mut motion: Option<FieldStatistics> = None;
    let mut history = Vec::new();
    let chosen = spread(files, MOST_FIELDS);
    let mut last = None;
    for file in &chosen {
        let Some(field) = open(source, file, notes) else { continue };
        view.add((*file).to_owned(), &field).unwrap_or_else(|refusal| notes.push(refusal.about(*file).to_string()));
        history = lf_core::history::lines(&field.layout.history);
        let what = format!("statistics of {} vectors", field.len());
        if let Err(error) = source.allow(FieldStatistics::bytes(&field), file, &what) {
            notes.push(error.to_string());
            continue;
        }
        let motion = motion.get_or_insert_with(|| FieldStatistics::new(&field));
        if let Err(refusal) = motion.add(&field) {
            notes.push(format!("{}; statistics leave it out", refusal.about(*file)));
            continue;
        }
        last = Some(field.layout.clone());
    }
    let (Some(motion), Some(layout)) = (motion, last) else {
        return FieldSections { view: view.section(), ..FieldSections::default() };
    };
    let mut statistics = Section::new("statistics", "Statistics");
    let [measured, replaced, no_data] = motion.kinds;
    let total = (measured + replaced + no_data).max(1) as f64;
    let percent = |count: usize| format!("{:.1} %", 100.0 * count as f64 / total);
    statistics.table(
        &["of measured vectors, mm", "mean", "standard deviation", "stated, RMS"],
        &motion.rows(pixel_mm),
        1,
    );
    statistics.chart(
        &motion.histograms(),
        "Measured vectors only. Fractions of a voxel are shown where displacements spread over voxels; peaks at whole \
         voxels are peak locking.",
    );
    match motion.convergence() {
        Some(chart) => statistics.chart(
            &chart,
            "By the scatter of the fields at each place: it falls with the root of their number once they are enough.",
        ),
        None => statistics.text("The convergence of the mean is shown for three fields or more."),
    }
    if files.len() > chosen.len() {
        statistics.text(&format!("Statistics of {} fields, spread over all {}.", chosen.len(), files.len()));
    }
    let [nx, ny, nz] = layout.shape;
    let window: Vec<String> =
        (0..3).map(|axis| format!("{:.3}", layout.window[axis] as f64 * layout.voxel_mm[axis])).collect();
    let summary = vec![
        ("fields".to_owned(), format!("{}, of {nx} x {ny} x {nz} vectors", files.len())),
        ("window".to_owned(), format!("{} mm, overlap {:.0} %", window.join(" x "), 100.0 * layout.overlap)),
        (
            "vectors".to_owned(),
            format!(
                "{} measured, {} replaced, {} without data",
                percent(measured),
                percent(replaced),
                percent(no_data)
            ),
        ),
        ("time between volumes".to_owned(), layout.dt_s.map_or("not known".into(), |dt_s| format!("{dt_s} s"))),
    ];
    FieldSections { view: view.section(), statistics: Some(statistics), summary, motion: Some(motion), history }
}

fn open(source: &dyn Source, file: &str, notes: &mut Vec<String>) -> Option<Field> {
    source.field(file).map_err(|error| notes.push(error.to_string())).ok()
}

/// The fields that the page holds.
struct FieldView {
    choices: Vec<PackedField>,
    /// Side of a pixel at the focal plane, if the camera is known.
    pixel_mm: Option<f64>,
    bytes: usize,
    is_full: bool,
}

impl FieldView {
    /// Adds a field if there is room. The first is thinned until it fits. Refuses layers that are too many even with
    /// one vector each.
    fn add(&mut self, name: String, field: &Field) -> Result<(), Refusal> {
        let is_first = self.choices.is_empty();
        if self.choices.len() == MOST_CHOICES || !is_first && self.bytes + bytes(field.len()) > MOST_BYTES {
            self.is_full = true;
            return Ok(());
        }
        let [nx, ny, nz] = field.layout.shape;
        let fits = |stride: &usize| bytes(nx.div_ceil(*stride) * ny.div_ceil(*stride) * nz) <= MOST_BYTES;
        let found = || format!("{nz} layers, too many for the page");
        let stride = (1..=nx.max(ny)).find(fits).ok_or_else(|| Refusal::new(found(), "wanted fewer to show them"))?;
        let thin = (stride > 1).then(|| thinned(field, stride));
        let name = if stride > 1 { format!("{name}, one of {stride} vectors along x and y") } else { name };
        let shown = thin.as_ref().unwrap_or(field);
        self.bytes += bytes(shown.len());
        self.choices.push(PackedField::new(name, shown, self.pixel_mm));
        Ok(())
    }

    fn section(self) -> Option<Section> {
        let data = serde_json::to_string(&self.choices).ok().filter(|_| !self.choices.is_empty())?;
        let mut section = Section::new("field", "Field");
        let options = (0..self.choices.len()).map(|n| {
            let name = super::html::escape(self.choices[n].name());
            format!("<option value=\"{n}\">{name}</option>")
        });
        section.content += &VIEW.replace("{{options}}", &options.collect::<String>());
        // `<` could end the element early.
        let data = data.replace('<', "\\u003c");
        section.content += &format!("<script type=\"application/json\" id=\"fields-data\">{data}</script>\n");
        if self.is_full {
            section.text("The page has room for these fields; the others are in the folder.");
        }
        Some(section)
    }
}

/// Every `stride`th vector along x and y.
fn thinned(field: &Field, stride: usize) -> Field {
    let mut layout = field.layout.clone();
    for axis in [0, 1] {
        layout.shape[axis] = layout.shape[axis].div_ceil(stride);
        layout.spacing_mm[axis] *= stride as f64;
    }
    let mut thin = Field::empty(layout);
    let [nx, ny, _] = thin.layout.shape;
    for n in 0..thin.len() {
        let from = field.layout.index([n % nx * stride, n / nx % ny * stride, n / nx / ny]);
        (thin.u[n], thin.v[n], thin.w[n]) = (field.u[from], field.v[from], field.w[from]);
        (thin.su[n], thin.sv[n], thin.sw[n]) = (field.su[from], field.sv[from], field.sw[from]);
        thin.flag[n] = field.flag[from];
    }
    thin
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scores::fixtures;

    #[test]
    fn layers_that_never_fit_are_refused_and_others_are_thinned() {
        let mut view = FieldView { choices: Vec::new(), pixel_mm: None, bytes: 0, is_full: false };
        let refusal = view.add("deep".into(), &fixtures::field([2, 2, 300_000], |_| [0.0; 3])).unwrap_err();
        assert_eq!(refusal.found, "300000 layers, too many for the page");
        view.add("thin".into(), &fixtures::field([3, 3, 100_000], |_| [0.0; 3])).unwrap();
        assert_eq!(view.choices[0].name(), "thin, one of 3 vectors along x and y");
    }

    #[test]
    fn a_thinned_field_keeps_every_second_vector_in_place() {
        let field = fixtures::field([5, 4, 3], |place| place);
        let thin = thinned(&field, 2);
        assert_eq!(thin.layout.shape, [3, 2, 3]);
        assert!((0..thin.len()).all(|n| thin.place_mm(n)[0] as f32 == thin.u[n]));
        assert!((0..thin.len()).all(|n| thin.place_mm(n)[1] as f32 == thin.v[n]));
    }
}
