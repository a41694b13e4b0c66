//! Files of `lf-validate export`, read by the libraries of other programs. See [`crate::swapped::python`].

use crate::swapped::{done, python};
use lf_core::field::{MEASURED, NO_DATA, REPLACED};
use lf_core::{Field, Grid, VectorGrid, history::Step, io, volume};
use lf_tests::Call;
use std::path::Path;
use tempfile::TempDir;

const GRID: Grid = Grid { shape: [5, 4, 3], spacing_mm: [0.0055, 0.011, 0.5], origin_mm: [-0.1, 2.0, -5.0] };

fn step(tool: &str) -> Step {
    Step { tool: tool.into(), version: "0.1.0".into(), arguments: vec!["\u{b5} \"a\"".into()] }
}

/// Every value encodes its component and its place; one vector is replaced, one has no data.
fn field(first: f32) -> Field {
    let mut field = Field::empty(VectorGrid {
        shape: [4, 3, 2],
        spacing_mm: [0.25, 0.5, 1.0],
        origin_mm: [-1.0, 2.0, 0.125],
        dt_s: Some(0.0005),
        history: vec![step("lf-mart"), step("lf-xcorr")],
        ..VectorGrid::default()
    });
    let Field { u, v, w, peak, ratio, su, sv, sw, count, flag, .. } = &mut field;
    for (k, component) in [u, v, w, peak, ratio, su, sv, sw, count].into_iter().enumerate() {
        component.iter_mut().enumerate().for_each(|(i, value)| *value = first + 100.0 * k as f32 + i as f32 + 0.1);
    }
    flag.fill(MEASURED);
    (flag[5], flag[7]) = (REPLACED, NO_DATA);
    field
}

/// A folder with two fields, a volume and a table of particles in two frames, and their exports.
fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name);
    field(0.0).save(&path("a.exr")).unwrap();
    field(1000.0).save(&path("b.exr")).unwrap();
    let indices = [0, 7, 13, 59];
    let columns: [(&str, &[f32]); 1] = [("intensity", &[1.0, 2.5, 4.0, 0.5])];
    let history = vec![step("lf-mart")];
    io::save(&path("v.lfv"), |out| volume::write(out, &GRID, &indices, &columns, &history)).unwrap();
    let rows = "0,5,1,2,3,10\n0,6,0,0,0,10\n1,5,1.5,2,3,11\n";
    let step = serde_json::to_string(&step("lf-fit")).unwrap();
    let text = format!("# frame: right-handed\n# {step}\nframe,id,x_mm,y_mm,z_mm,intensity\n{rows}");
    std::fs::write(path("p.csv"), text).unwrap();
    let export = |words: &[&str]| {
        Call::new("lf-validate").words(["export"]).words(words).within(folder.path()).with_history().run().done();
    };
    for name in ["a.nc", "a.vti"] {
        export(&["a.exr", "-o", name]);
    }
    export(&["a.exr", "b.exr", "-o", "run.nc", "--every", "0.5"]);
    for name in ["v.vti", "v.tif"] {
        export(&["v.lfv", "-o", name]);
    }
    export(&["v.lfv", "-o", "w.tif", "--bits", "16"]);
    export(&["p.csv", "-o", "p.vtp", "--dt", "0.5"]);
    folder
}

/// Runs Python text after `import lf` in the folder of the exports. Does nothing if a module is missing.
fn check(modules: &[&str], folder: &Path, text: &str) {
    let Some(mut python) = python(modules) else { return };
    let import = "import json, os, sys, numpy as np\nsys.path.insert(0, '.')\nimport lf\nos.chdir(sys.argv[1])\n";
    python.arg("-c").arg(format!("{import}{text}")).arg(folder);
    done(python);
}

#[test]
fn scipy_and_tifffile_read_the_exports() {
    let folder = folder();
    let volume = "volume = lf.read_volume('v.lfv')\nwhole = volume.dense('intensity')\n";
    check(
        &["numpy", "xxhash", "tifffile"],
        folder.path(),
        &format!(
            "{volume}import tifffile\nassert (lf.read_stack('v.tif') == whole).all()\n\
             file = tifffile.TiffFile('w.tif')\nmeta = file.imagej_metadata\n\
             assert (meta['slices'], meta['spacing'], meta['unit']) == (3, 0.5, 'mm'), meta\n\
             assert json.loads(meta['lf_history'])[0]['arguments'] == ['\\u00b5 \"a\"'], meta\n\
             scaled = lf.read_stack('w.tif') / meta['lf_scale']\n\
             assert scaled.shape == whole.shape and abs(scaled - whole).max() < 1e-4\n\
             number, part = file.pages[0].tags['XResolution'].value\nassert abs(part / number - 0.0055) < 1e-9\n"
        ),
    );
    check(
        &["numpy", "scipy", "OpenEXR"],
        folder.path(),
        "layout, field = lf.read_field('a.exr')\nagain, same = lf.read_netcdf('a.nc')\nassert again == layout\n\
         known = field['flag'] != 2\n\
         assert all(np.array_equal(field[key][known], same[key][known]) for key in lf.FIELD_UNITS)\n\
         assert np.isnan(same['u'][~known]).all() and (same['flag'] == field['flag']).all()\n\
         _, series = lf.read_netcdf('run.nc')\nassert series['w'].shape == (2, 2, 3, 4)\n\
         assert (series['w'][1][known] == field['w'][known] + 1000).all()\n",
    );
}

#[test]
fn xarray_knows_the_units_and_joins_files() {
    let folder = folder();
    check(
        &["numpy", "scipy", "xarray"],
        folder.path(),
        "import xarray\none = xarray.open_dataset('a.nc', engine='scipy')\n\
         assert one.u.dims == ('z', 'y', 'x') and one.u.units == 'mm' and one.x.axis == 'X'\n\
         assert one.flag.flag_meanings == 'measured replaced no_data' and list(one.flag.flag_values) == [0, 1, 2]\n\
         assert one.attrs['dt_s'] == 0.0005 and one.attrs['history'].startswith('lf-mart 0.1.0: ')\n\
         assert abs(float(one.u.sel(x=-0.5, y=2.5, z=0.125, method='nearest')) - 6.1) < 1e-5\n\
         series = xarray.open_dataset('run.nc', engine='scipy')\nassert list(series.t) == [0, 0.5]\n\
         both = xarray.concat([one, one], 't')\nassert both.u.shape == (2, 2, 3, 4)\n",
    );
    check(
        &["numpy", "scipy", "xarray", "dask"],
        folder.path(),
        "import xarray\nmany = {'combine': 'nested', 'concat_dim': 't', 'engine': 'scipy'}\n\
         assert xarray.open_mfdataset(['a.nc', 'a.nc'], **many).u.shape == (2, 2, 3, 4)\n",
    );
}

#[test]
fn vtk_reads_volumes_fields_and_tracks() {
    let folder = folder();
    check(
        &["numpy", "xxhash", "vtk"],
        folder.path(),
        "volume = lf.read_volume('v.lfv')\nplaces, arrays = lf.read_vtk('v.vti')\n\
         assert (arrays['intensity'] == volume.dense('intensity').ravel()).all()\n\
         x, y, z = volume.grid.centres_mm(volume.indices)\n\
         assert np.allclose(places[volume.indices.astype(int)], np.stack([x, y, z], 1))\n\
         places, arrays = lf.read_vtk('p.vtp')\nassert places.tolist() == [[1, 2, 3], [0, 0, 0], [1.5, 2, 3]]\n\
         assert arrays['displacement_mm'][0].tolist() == [0.5, 0, 0] and arrays['id'].tolist() == [5, 6, 5]\n\
         from vtkmodules.vtkIOXML import vtkXMLPolyDataReader\nreader = vtkXMLPolyDataReader()\n\
         reader.SetFileName('p.vtp')\nreader.Update()\nlines = reader.GetOutput().GetLines()\n\
         assert lines.GetNumberOfCells() == 1 and reader.GetOutput().GetNumberOfVerts() == 3\n\
         about = reader.GetOutput().GetFieldData()\nassert about.GetArray('dt_s').GetValue(0) == 0.5\n\
         assert about.GetAbstractArray('history').GetValue(0).startswith('lf-fit 0.1.0: ')\n",
    );
}

#[test]
fn a_field_of_python_goes_through_the_tools() {
    let folder = folder();
    check(
        &["numpy", "OpenEXR"],
        folder.path(),
        "layout, field = lf.read_field('a.exr')\nlf.write_field('c.exr', layout, field)\n\
         lf.write_field('d.exr', layout, {name: field[name] for name in 'uvw'})\n",
    );
    if !folder.path().join("c.exr").exists() {
        return;
    }
    assert_eq!(Field::open(&folder.path().join("c.exr")).unwrap(), field(0.0));
    let plain = Field::open(&folder.path().join("d.exr")).unwrap();
    assert!(plain.flag.iter().all(|flag| *flag == MEASURED) && plain.su.iter().all(|su| su.is_nan()));
}
