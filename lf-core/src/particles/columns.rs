//! The columns of a table, by the names in its header.

/// The names of the columns, before the first particle.
pub const HEADER: &str = "frame,id,x_mm,y_mm,z_mm,intensity";
/// The names of the columns of particles with uncertainties.
pub const FITTED_HEADER: &str = "frame,id,x_mm,y_mm,z_mm,intensity,sx_mm,sy_mm,sz_mm,s_intensity,\
                                 cxx_mm2,cxy_mm2,cxz_mm2,cyy_mm2,cyz_mm2,czz_mm2";

/// Units of lengths in the names of columns, and their millimetres.
const UNITS: [(&str, f64); 3] = [("mm", 1.0), ("um", 1e-3), ("m", 1e3)];

/// A column of numbers.
#[derive(Debug, Clone, Copy)]
pub(super) struct Column {
    /// Its place in a line.
    pub place: usize,
    /// Millimetres, or counts, of its unit.
    pub unit: f64,
}

/// Where a line holds what.
pub(super) struct Columns {
    /// The header.
    pub header: String,
    /// Number of columns.
    pub count: usize,
    pub frame: Option<usize>,
    pub id: Option<usize>,
    /// x, y, z.
    pub places: [Column; 3],
    pub intensity: Option<Column>,
    /// Standard uncertainties of x, y, z, and of the intensity if it has one. Empty without them.
    pub stds: Vec<Column>,
    /// The covariance by rows, upper half. Empty without one.
    pub covariance: Vec<Column>,
}

impl Columns {
    /// The columns of a header. The error says what is wrong with the header, and what was wanted.
    pub(super) fn new(header: &str) -> Result<Self, [&'static str; 2]> {
        let names: Vec<&str> = header.split(',').map(str::trim).collect();
        let place = |name: &str| names.iter().position(|known| *known == name);
        let counts = |name: &str| place(name).map(|place| Column { place, unit: 1.0 });
        let length = |name: &str| {
            let in_unit =
                |(unit, mm): (&str, f64)| place(&format!("{name}_{unit}")).map(|place| Column { place, unit: mm });
            UNITS.into_iter().find_map(in_unit)
        };
        let all = |columns: &[Option<Column>]| columns.iter().copied().collect::<Option<Vec<Column>>>();
        let places = ["x", "y", "z"].map(length);
        let [Some(x), Some(y), Some(z)] = places else { return Err(["not the header", HEADER]) };
        let stds = ["sx", "sy", "sz"].map(length);
        let covariance = ["cxx_mm2", "cxy_mm2", "cxz_mm2", "cyy_mm2", "cyz_mm2", "czz_mm2"].map(counts);
        let is_partial = |columns: &[Option<Column>]| columns.iter().any(Option::is_some) && all(columns).is_none();
        let [stds_whole, covariance_whole] = [all(&stds), all(&covariance)];
        if is_partial(&stds) || is_partial(&covariance) || covariance_whole.is_some() && stds_whole.is_none() {
            return Err(["another header", FITTED_HEADER]);
        }
        let light = counts("s_intensity").filter(|_| stds_whole.is_some());
        Ok(Self {
            count: names.len(),
            frame: place("frame"),
            id: place("id"),
            places: [x, y, z],
            intensity: counts("intensity"),
            stds: stds_whole.into_iter().flatten().chain(light).collect(),
            covariance: covariance_whole.unwrap_or_default(),
            header: header.to_owned(),
        })
    }
}
