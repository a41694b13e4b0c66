//! Description of an image.

use super::numbers::{percent, whole};
use super::{description::Description, summary::Summary};
use lf_core::History;

/// Describes an image of `width` x `height` pixels, the first of `pages`.
pub fn image<'a>(
    pages: usize,
    [width, height]: [usize; 2],
    pixels: impl IntoIterator<Item = &'a f32>,
    history: &History,
) -> Description {
    let summary = Summary::of(pixels);
    let mut about = Description::new("grey image (.exr, .tif or .png)");
    if pages > 1 {
        about.line("pages", format!("{}: only `lf-calib background` reads them. The first:", whole(pages as u64)));
    }
    about.line("size", format!("{width} x {height} px = {} pixels", whole(summary.count as u64)));
    about.line("counts", summary.to_string());
    about.line("zero pixels", format!("{}, {}", whole(summary.zero as u64), percent(summary.zero, summary.count)));
    if summary.min < 0.0 {
        about.line("", "some are negative: no tool takes this as a light-field image");
    }
    about.history(history);
    about
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_of_a_small_image() {
        let text = image(1, [3, 1], &[0.0, 4.0, 5.0], &Vec::new()).to_string();
        assert!(text.contains("3 x 1 px") && text.contains("mean 3, sum 9") && text.contains("1, 33.3333 %"));
        assert!(!text.contains("negative"));
        assert!(!text.contains("pages"));
        assert!(image(2, [1, 1], &[1.0], &Vec::new()).to_string().contains("pages        2: "));
        assert!(image(1, [1, 1], &[-1.0], &Vec::new()).to_string().contains("negative"));
    }
}
