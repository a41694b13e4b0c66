//! Depths of a target's images from their names or from a table.
//!
//! In a name, the depth is the number after a `z` that no letter precedes: `dots_z-2.70.tif`, `z+4mm.png`, `a_Z=3.tif`.
//! `=` and `_` may stand between them, the unit is mm or um and mm without one. A table is a CSV file with the
//! columns `file` and `depth_mm`.

use lf_core::{Refusal, cli::length_mm};

const WANTED_NAME: &str = "wanted z and a number in every name, such as dots_z-2.70.tif or z+4mm.tif, or --depths";
const WANTED_TABLE: &str = "wanted a table with the columns file,depth_mm";

/// A depth as it stands in a name.
#[derive(Debug, Clone, Copy, PartialEq)]
struct NamedDepth {
    depth_mm: f64,
    /// Whether a minus stands before the number.
    has_minus: bool,
    /// Whether it is a whole number without sign and unit, as numbers of slices are.
    is_plain: bool,
}

/// The depths, mm, in the names of a target's images, without folders. Refuses names without a depth and names that can
/// be read in two ways, with the number of the name that it is about, if there is one.
pub fn depths_of_names(names: &[String]) -> Result<Vec<f64>, (Option<usize>, Refusal)> {
    let read = |(n, name): (usize, &String)| {
        named(before_end(name)).map_err(|found| (Some(n), Refusal::new(found, WANTED_NAME)))
    };
    let depths = names.iter().enumerate().map(read).collect::<Result<Vec<NamedDepth>, _>>()?;
    let refused = |found: &str, wanted: &str| Err((None, Refusal::new(found, wanted)));
    if depths.len() > 1 && depths.iter().all(|depth| depth.has_minus) {
        let found = "every name has a minus before its depth, which may only part the words";
        return refused(found, "wanted '+' or no sign in some of the names, or --depths");
    }
    let mut values: Vec<f64> = depths.iter().map(|depth| depth.depth_mm).collect();
    values.sort_by(f64::total_cmp);
    let is_series = values.windows(2).all(|pair| pair[1] - pair[0] == 1.0) && values[0] <= 1.0;
    if depths.len() > 2 && depths.iter().all(|depth| depth.is_plain) && is_series {
        let found = "the names count their images, and may not give depths in mm";
        return refused(found, "wanted a sign or a unit in the names, such as z+1mm, or --depths");
    }
    Ok(depths.iter().map(|depth| depth.depth_mm).collect())
}

/// A name without the end that names its format.
fn before_end(name: &str) -> &str {
    let is_format = |end: &str| end.starts_with(|first: char| first.is_ascii_alphabetic());
    name.rsplit_once('.').filter(|(_, end)| is_format(end)).map_or(name, |(stem, _)| stem)
}

/// The one depth in a name.
fn named(name: &str) -> Result<NamedDepth, String> {
    let letters: Vec<char> = name.chars().collect();
    let is_mark = |n: usize| letters[n].eq_ignore_ascii_case(&'z') && (n == 0 || !letters[n - 1].is_alphabetic());
    let mut found: Vec<NamedDepth> = Vec::new();
    for n in (0..letters.len()).filter(|n| is_mark(*n)) {
        found.extend(after_mark(&letters[n + 1..])?);
    }
    match found.as_slice() {
        [] => Err("no depth in its name".to_owned()),
        [depth, others @ ..] if others.iter().all(|other| other.depth_mm == depth.depth_mm) => Ok(*depth),
        _ => Err("two depths in its name".to_owned()),
    }
}

/// The depth at the start of some letters; none if they do not begin with a number.
fn after_mark(letters: &[char]) -> Result<Option<NamedDepth>, String> {
    let joint = usize::from(letters.first().is_some_and(|letter| ['=', '_'].contains(letter)));
    let letters = &letters[joint..];
    let has_minus = letters.first().is_some_and(|letter| ['-', '\u{2212}'].contains(letter));
    let signed = has_minus || letters.first() == Some(&'+');
    let number: String =
        letters[usize::from(signed)..].iter().take_while(|letter| letter.is_ascii_digit() || **letter == '.').collect();
    // A full stop at the end belongs to the name.
    let number = number.trim_end_matches('.');
    if !number.starts_with(|first: char| first.is_ascii_digit()) {
        return Ok(None);
    }
    let rest = &letters[usize::from(signed) + number.len()..];
    let is_digit = |letter: Option<&char>| letter.is_some_and(char::is_ascii_digit);
    if rest.first() == Some(&',') && is_digit(rest.get(1)) {
        return Err("a decimal comma in its name".to_owned());
    }
    let unit: String = rest.iter().take_while(|letter| letter.is_alphabetic()).collect();
    let (sign, is_unit) = (if has_minus { "-" } else { "" }, ["mm", "um", "µm"].contains(&unit.as_str()));
    if !unit.is_empty() && !is_unit {
        return Err(format!("'{unit}' after the number in its name"));
    }
    let depth_mm = length_mm(&format!("{sign}{number}{unit}")).map_err(|_| format!("'{number}' in its name"))?;
    let is_plain = !signed && !is_unit && !number.contains('.');
    Ok(Some(NamedDepth { depth_mm, has_minus, is_plain }))
}

/// The depth of each image by a table, mm; none for an image that it does not name. Images go by their names without
/// folders, also in the table. Errors give the number of the line.
pub fn depths_of_table(text: &str, names: &[String]) -> Result<Vec<Option<f64>>, Refusal> {
    let text = text.trim_start_matches('\u{feff}');
    let mut lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'));
    let refused = |found: String| Refusal::new(found, WANTED_TABLE);
    let (_, header) = lines.next().ok_or_else(|| refused("no line".to_owned()))?;
    let cells = |line: &str| line.split(',').map(|cell| cell.trim().trim_matches('"').to_owned()).collect::<Vec<_>>();
    let header = cells(header);
    let column = |name: &str| header.iter().position(|cell| cell.eq_ignore_ascii_case(name));
    let (Some(file), Some(depth)) = (column("file"), column("depth_mm")) else {
        return Err(refused(format!("the columns {}", header.join(","))));
    };
    let mut depths: Vec<Option<f64>> = vec![None; names.len()];
    for (n, line) in lines {
        let cells = cells(line);
        let (Some(name), Some(depth)) = (cells.get(file), cells.get(depth)) else {
            return Err(refused(format!("line {} has {} columns", n + 1, cells.len())));
        };
        let depth = length_mm(depth).map_err(|_| refused(format!("line {} has the depth '{depth}'", n + 1)))?;
        let name = name.rsplit(['/', '\\']).next().unwrap_or_default();
        for (known, _) in depths.iter_mut().zip(names).filter(|(_, image)| *image == name) {
            if known.replace(depth).is_some_and(|before| before != depth) {
                return Err(refused(format!("line {} gives '{}' another depth", n + 1, cells[file])));
            }
        }
    }
    Ok(depths)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn depths(names: &[&str]) -> Result<Vec<f64>, String> {
        let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        depths_of_names(&names).map_err(|(_, refusal)| refusal.found)
    }

    #[test]
    fn depths_stand_after_z() {
        let found = depths(&["dots_z-2.70.tif", "z+4mm.png", "Z=1.5.tif", "x1_z_3um_2024.tif", "plate.z2.exr"]);
        assert_eq!(found.unwrap(), [-2.7, 4.0, 1.5, 0.003, 2.0]);
        assert_eq!(depths(&["z0.tif", "zz9_z-1.tif"]).unwrap(), [0.0, -1.0]);
        assert_eq!(depths(&["z-4_z-4.tif", "z4.tif"]).unwrap(), [-4.0, 4.0]);
        assert_eq!(depths(&["z-4..tif", "z4.tif"]).unwrap(), [-4.0, 4.0]);
    }

    #[test]
    fn names_that_can_be_read_in_two_ways_are_refused() {
        for (names, found) in [
            (vec!["dots.tif"], "no depth in its name"),
            (vec!["size4.tif"], "no depth in its name"),
            (vec!["z1_z2.tif"], "two depths in its name"),
            (vec!["z-2,7.tif"], "a decimal comma in its name"),
            (vec!["z2p70.tif"], "'p' after the number in its name"),
            (vec!["z-1.tif", "z-2.tif"], "every name has a minus before its depth, which may only part the words"),
            (vec!["z0.tif", "z1.tif", "z2.tif"], "the names count their images, and may not give depths in mm"),
            (vec!["z002.tif", "z001.tif", "z003.tif"], "the names count their images, and may not give depths in mm"),
        ] {
            assert_eq!(depths(&names).unwrap_err(), found, "{names:?}");
        }
        assert_eq!(depths(&["z1.0.tif", "z2.tif", "z3.tif"]).unwrap(), [1.0, 2.0, 3.0]);
    }

    #[test]
    fn tables_give_depths_by_name() {
        let names = ["a.tif", "b.tif", "c.tif"].map(str::to_owned);
        let read = |text: &str| depths_of_table(text, &names).map_err(|refusal| refusal.found);
        let text = "# traverse\nfile,time,depth_mm\nb.tif,1,-2.7\n\n\"old/a.tif\",2,4mm\nother.tif,3,1\n";
        assert_eq!(read(text).unwrap(), [Some(4.0), Some(-2.7), None]);
        assert_eq!(read("a.tif,4\n").unwrap_err(), "the columns a.tif,4");
        assert_eq!(read("file,depth_mm\na.tif\n").unwrap_err(), "line 2 has 1 columns");
        assert_eq!(read("file,depth_mm\na.tif,far\n").unwrap_err(), "line 2 has the depth 'far'");
        assert_eq!(read("file,depth_mm\na.tif,1\na.tif,2\n").unwrap_err(), "line 3 gives 'a.tif' another depth");
        assert_eq!(read("").unwrap_err(), "no line");
    }
}
