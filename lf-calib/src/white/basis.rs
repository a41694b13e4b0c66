//! The numbers of a lattice: its two shortest vectors, its layout, and which of equal rotations and offsets to write.

use glam::{DMat2, DVec2};
use lf_core::{Camera, camera::Layout, camera::Microlenses};

/// The lattice vectors of a layout in pitches, as columns.
pub(crate) fn unit_basis(is_hexagonal: bool) -> DMat2 {
    if is_hexagonal { DMat2::from_cols(DVec2::X, DVec2::new(0.5, 0.75f64.sqrt())) } else { DMat2::IDENTITY }
}

/// Describes a lattice by its two shortest vectors: 60 to 90 degrees apart, turned from first to second as from x to y,
/// the first as near to x as possible.
pub(crate) fn reduced(basis: DMat2) -> DMat2 {
    let (mut u, mut v) = (basis.x_axis, basis.y_axis);
    loop {
        if v.length_squared() < u.length_squared() {
            (u, v) = (v, u);
        }
        let shorter = v - (u.dot(v) / u.length_squared()).round() * u;
        // Vectors 60 degrees apart are as long as their difference. Without a margin they would be exchanged for ever.
        if shorter.length() < (1.0 - 1e-9) * v.length() {
            v = shorter;
        } else {
            break;
        }
    }
    if u.dot(v) < 0.0 {
        v = -v;
    }
    if u.perp_dot(v) < 0.0 {
        (u, v) = (v, u);
    }
    // Near 60 degrees the lattice has six shortest vectors, near 90 degrees four.
    let is_hexagonal = u.dot(v) > 0.25 * u.length() * v.length();
    let mut turned = [(u, v); 6];
    for n in 1..6 {
        let (u, v) = turned[n - 1];
        turned[n] = if is_hexagonal { (v, v - u) } else { (v, -u) };
    }
    let along = |pair: &(DVec2, DVec2)| pair.0.x / pair.0.length();
    let (u, v) = turned.into_iter().max_by(|a, b| along(a).total_cmp(&along(b))).unwrap_or((u, v));
    DMat2::from_cols(u, v)
}

pub(crate) fn shortest(basis: DMat2) -> f64 {
    basis.x_axis.length().min(basis.y_axis.length())
}

/// The layout that is nearest to a basis, and the distance from it (the strain) as a share of the vectors' length.
pub(crate) fn layout_of(basis_px: DMat2) -> (Layout, f64) {
    let strain = |is_hexagonal: bool| {
        let unit = unit_basis(is_hexagonal);
        let cells = [(DVec2::X, basis_px.x_axis), (DVec2::Y, basis_px.y_axis)];
        // The best turn and scale of the unit lattice about its own origin.
        let turn: DVec2 = cells.iter().map(|(n, x)| (unit * *n * DVec2::new(1.0, -1.0)).rotate(*x)).sum();
        let turn = turn / 2.0;
        let squares: f64 = cells.iter().map(|(n, x)| turn.rotate(unit * *n).distance_squared(*x)).sum();
        (squares / (2.0 * turn.length_squared())).sqrt()
    };
    let (square, hexagonal) = (strain(false), strain(true));
    if square <= hexagonal { (Layout::Square, square) } else { (Layout::Hexagonal, hexagonal) }
}

/// The rotation nearest to `to_rad` that gives the same lattice, which repeats after 90 (square) or 60 degrees.
pub(crate) fn nearest_turn(rotation_rad: f64, to_rad: f64, layout: Layout) -> f64 {
    let turn = match layout {
        Layout::Square => std::f64::consts::FRAC_PI_2,
        Layout::Hexagonal => std::f64::consts::FRAC_PI_3,
    };
    rotation_rad + turn * ((to_rad - rotation_rad) / turn).round()
}

/// The offset nearest to `to_mm` that gives the same perfect lattice. `offset_mm` of `camera` is a lenslet's centre.
pub(crate) fn nearest_offset(camera: &Camera, to_mm: [f64; 2]) -> [f64; 2] {
    let Microlenses { layout, pitch_mm, rotation_rad, offset_mm, .. } = camera.microlenses;
    let (centre, to) = (DVec2::from(offset_mm), DVec2::from(to_mm));
    match layout {
        Layout::Square => {
            let turn = DVec2::from_angle(rotation_rad);
            let offset = centre - turn.rotate(DVec2::splat(0.5 * pitch_mm));
            let steps = (DVec2::new(turn.x, -turn.y).rotate(to - offset) / pitch_mm).round();
            (offset + turn.rotate(steps * pitch_mm)).to_array()
        }
        Layout::Hexagonal => {
            // Every centre of a hexagonal lattice is an origin of the same lattice.
            let lattice = camera.lattice();
            let (i, j) = lattice.lenslet_at(to);
            lattice.centre_mm(i, j).to_array()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // Two vectors exactly 60 degrees apart were once exchanged for ever.
    #[test]
    fn a_basis_is_reduced_to_the_one_along_the_rows() {
        for angle in [60.0f64, 90.0] {
            let wanted = DMat2::from_cols(DVec2::X, DVec2::from_angle(angle.to_radians()));
            for turn in [-0.4, -0.1, 0.0, 0.2, 0.5] {
                let wanted = 14.0 * DMat2::from_angle(turn) * wanted;
                for (a, b, c, d) in [(1, 0, 0, 1), (0, 1, 1, 0), (3, 2, 1, 1), (-1, 4, 0, -1), (2, -5, 1, -2)] {
                    let mixed = DMat2::from_cols(
                        wanted * DVec2::new(a as f64, b as f64),
                        wanted * DVec2::new(c as f64, d as f64),
                    );
                    let found = reduced(mixed);
                    assert!((found - wanted).abs_diff_eq(DMat2::ZERO, 1e-9), "{angle} {turn} {mixed}: {found}");
                }
            }
        }
    }
}
