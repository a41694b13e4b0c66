use super::description::{Sheet, range, share, whole};
use super::summary::Summary;
use lf_core::history::History;

/// Describes an image of `width` x `height` pixels, the first of so many pages.
pub fn image<'a>(
    pages: usize,
    [width, height]: [usize; 2],
    pixels: impl IntoIterator<Item = &'a f32>,
    history: &History,
) -> Sheet {
    let summary = Summary::of(pixels);
    let mut sheet = Sheet::new("grey image (.exr, .tif or .png)");
    if pages > 1 {
        sheet.line(
            "pages",
            format!("{}: `lf-calib background` reads all, no other task any; the first:", whole(pages as u64)),
        );
    }
    sheet.line("size", format!("{width} x {height} px = {} pixels", whole(summary.count as u64)));
    sheet.line("counts", range(&summary));
    sheet.line("zero pixels", format!("{}, {}", whole(summary.zero as u64), share(summary.zero, summary.count)));
    if summary.min < 0.0 {
        sheet.line("", "some are negative: no tool takes this as a light-field image");
    }
    sheet.history(history);
    sheet
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
