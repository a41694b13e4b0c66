//! The one choice of how weights are made, and its reason.

use super::lenslets::{self, Lenslets};
use super::model::{Basis, Model, RowSet, check_depth, sections};
use super::pieces::{self, Pieces};
use super::{
    aligned::Aligned,
    geometry::Geometry,
    micro::{Micro, OneByOne},
    sphere::Sphere,
};
use crate::{Camera, Grid, Refusal};

/// The weights of every voxel of a grid, made when asked for.
#[derive(Debug, Clone)]
pub struct Weights {
    /// The way to make the weights.
    pub path: Path,
    /// Why it is this path, in words.
    pub reason: String,
}

/// A way to make weights, the fastest first.
#[derive(Debug, Clone)]
pub enum Path {
    /// A square lattice aligned with the pixels: products of column and row profiles.
    Aligned(Aligned),
    /// Exact weights of any camera, made micro-image by micro-image where they are used.
    Micro(Box<Micro>),
    /// Sampled apertures on a lattice that is not aligned: integrated lenslet by lenslet.
    Pieces(Pieces),
    /// Tomographic PIV's weights.
    Sphere(Sphere),
}

/// Buffers of [`Weights`]; one a thread.
#[derive(Debug, Default)]
pub struct Scratch {
    pieces: pieces::PieceBuffers,
    lenslets: lenslets::LookupBuffers,
}

impl Weights {
    /// Chooses the fastest path for a camera, a grid, a model and a basis. Refuses a grid as [`check_depth`] does, a
    /// model that cannot follow the camera, a blob outside 0 to 10 voxels, and sections outside [`super::SECTIONS`].
    pub fn choose(camera: &Camera, grid: &Grid, model: Model, basis: Basis) -> Result<Self, Refusal> {
        check_depth(camera, grid)?;
        if let Some(block) = camera.bends().filter(|_| model != Model::Exact) {
            return Err(Refusal::new(format!("the camera has '{block}'"), "wanted exact weights: no others follow it"));
        }
        if let Basis::Blob { sigma_px } = basis
            && !(sigma_px > 0.0 && sigma_px <= 10.0)
        {
            return Err(Refusal::new(format!("a blob of {sigma_px} px"), "wanted more than 0, 10 at most"));
        }
        let sections = sections(camera, if let Model::Drt { sections } = model { sections } else { None })?;
        let aligned = camera.aligned();
        let geometry = Geometry::new(aligned.as_ref().unwrap_or(camera), grid, model, basis, sections);
        let reason = match model {
            Model::Sphere => "the weights are spheres".into(),
            _ => camera.misalignment().unwrap_or_else(|| "the lattice is aligned with the pixels".into()),
        };
        let path = match model {
            Model::Sphere => Path::Sphere(Sphere::new(camera, geometry)),
            _ if aligned.is_some() => {
                let lenslets = (model == Model::Exact).then(|| Box::new(Lenslets::new(geometry.clone())));
                Path::Aligned(Aligned { geometry, lenslets })
            }
            Model::Drt { .. } => Path::Pieces(Pieces { geometry }),
            Model::Exact => Path::Micro(Box::new(Micro::new(geometry))),
        };
        Ok(Self { path, reason })
    }

    /// Upper bound of the bytes of the lists of slices that [`Weights::choose`] makes before any weight.
    pub fn list_bytes(camera: &Camera, grid: &Grid, model: Model) -> u64 {
        let has_lists = model == Model::Exact && camera.aligned().is_none();
        if has_lists { (Micro::LIST_BYTES as u64).saturating_mul(grid.shape[2] as u64) } else { 0 }
    }

    /// The grid.
    #[inline]
    pub fn grid(&self) -> &Grid {
        &self.geometry().grid
    }

    /// Columns and rows of the sensor.
    pub fn sensor_px(&self) -> [usize; 2] {
        self.geometry().optics.sensor_px
    }

    /// Voxels along x, y and z in the standard deviation of a blob of `sigma_px`; see [`Basis::Blob`].
    pub fn blob_vox(&self, sigma_px: f64) -> [f64; 3] {
        let sigma_mm = sigma_px * self.geometry().focal_px_mm();
        let [dx, dy, _] = self.grid().spacing_mm;
        [sigma_mm / dx, sigma_mm / dy, sigma_px]
    }

    /// Image rows from one row of lenslets to the next; see [`crate::lattice::Lattice::period_y_mm`].
    pub fn lenslet_rows_px(&self) -> f64 {
        let optics = &self.geometry().optics;
        optics.lattice().period_y_mm() / optics.pixel_pitch_mm
    }

    fn geometry(&self) -> &Geometry {
        match &self.path {
            Path::Aligned(path) => &path.geometry,
            Path::Pieces(path) => &path.geometry,
            Path::Sphere(path) => &path.geometry,
            Path::Micro(path) => &path.geometry,
        }
    }

    /// Calls `found(column, row, weight)` for the pixels of a voxel on the rows that `wanted` accepts. A pixel may come
    /// more than once: its weight is the sum. Uses no table: slow and exact on every path.
    pub fn visit(
        &self,
        voxel: [usize; 3],
        scratch: &mut Scratch,
        wanted: impl Fn(u32) -> bool,
        found: impl FnMut(u32, u32, f32),
    ) {
        match &self.path {
            Path::Sphere(sphere) => sphere.visit(voxel, wanted, found),
            Path::Micro(micro) => match &micro.one_by_one {
                OneByOne::Bent(bent) => bent.visit(&micro.array, voxel, wanted, found),
                OneByOne::Lenslets(_) => self.geometry().visit(voxel, &mut scratch.pieces, wanted, found),
            },
            _ => self.geometry().visit(voxel, &mut scratch.pieces, wanted, found),
        }
    }

    /// The tables of a lenslet's image of a voxel, where the path looks weights up.
    #[inline(always)]
    fn lenslets(&self) -> Option<&Lenslets> {
        match &self.path {
            Path::Aligned(aligned) => aligned.lenslets.as_deref(),
            Path::Micro(micro) => match &micro.one_by_one {
                OneByOne::Lenslets(lenslets) => Some(lenslets),
                OneByOne::Bent(_) => None,
            },
            _ => None,
        }
    }

    /// Whether [`Weights::runs`] finds the rows of each lenslet's image of a voxel, so that few pixels come twice.
    pub fn finds_runs(&self) -> bool {
        self.lenslets().is_some()
    }

    /// Bytes of the tables that are made when first used, in all slices except those nearest focus.
    pub fn table_bytes(&self) -> u64 {
        self.lenslets().map_or(0, Lenslets::table_bytes)
    }

    /// Calls `found(row, first column, share, columns)` for the weights of a voxel on the wanted rows: `share *
    /// columns[n]` on pixel `first column + n`. Columns come in fours; up to three behind the sensor's last have no
    /// weight. A pixel may come more than once. Looks lenslets up where the path has them.
    #[inline(always)]
    pub fn runs(
        &self,
        voxel: [usize; 3],
        scratch: &mut Scratch,
        wanted: RowSet,
        mut found: impl FnMut(u32, u32, f32, &[f32]),
    ) {
        if let Some(lenslets) = self.lenslets() {
            lenslets.runs(voxel, &mut scratch.lenslets, wanted, found);
        } else {
            let in_set = |row| wanted.holds(row);
            self.visit(voxel, scratch, in_set, |column, row, weight| found(row, column, weight, &[1.0, 0.0, 0.0, 0.0]));
        }
    }
}

impl Path {
    /// The work of the path, in words that follow "weights".
    pub fn about(&self) -> &'static str {
        match self {
            Self::Aligned(_) => "from profiles of columns and rows, the fastest way",
            Self::Pieces(_) => "integrated lenslet by lenslet, a slow way",
            Self::Micro(_) => "from tables, micro-image by micro-image",
            Self::Sphere(_) => "by spheres and cylinders, a slow way",
        }
    }
}
