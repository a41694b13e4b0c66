//! The key of a panel, in rows above it.

use super::chart::{Mark, Panel, Style};
use super::drawing::{Drawing, Pixel};
use super::palette::{EMPTY, GREY, REFERENCE_DASHES, SERIES_DASHES, SHADE};
use super::text::{Anchor, TEXT_PX, width, wrap};
use super::view::{Look, Looks, has_many_series, reference_number};
use super::{arrow::arrow, map};

/// Width of a symbol, its distance to the name, and that of a name to the next entry, px.
const SYMBOL: i32 = 30;
const GAP: i32 = 7;
const APART: i32 = 18;
/// Length of an arrow without a value, and height of a row, px.
const ARROW: i32 = 26;
const ROW: i32 = 20;

#[derive(Debug, Clone, Copy, PartialEq)]
enum Symbol {
    Line(Look, Style),
    Marker(Look),
    Steps(Look),
    Reference(usize),
    Region,
    Arrow { length: i32, is_hollow: bool },
    Empty,
}

/// A name with its symbols, which are drawn over each other.
struct Entry {
    name: String,
    symbols: Vec<Symbol>,
    lines: Vec<String>,
    place: Pixel,
}

pub(super) struct Key {
    entries: Vec<Entry>,
    pub width: i32,
    pub height: i32,
}

impl Key {
    /// The key of a panel, at most `room_px` wide. A unit of its axes takes `px_per_unit`.
    pub fn new(panel: &Panel, looks: &Looks, room_px: i32, px_per_unit: [f64; 2]) -> Self {
        let mut key = Self { entries: entries(panel, looks, px_per_unit), width: 0, height: 0 };
        let (mut x, mut y) = (0, 0);
        let mut row_lines = 0;
        for entry in &mut key.entries {
            entry.lines = wrap(&entry.name, TEXT_PX, room_px - entry.symbol_width() - GAP);
            let widest = entry.lines.iter().map(|line| width(line, TEXT_PX)).max().unwrap_or(0);
            let whole = entry.symbol_width() + GAP + widest;
            if x > 0 && x + whole > room_px {
                (x, y, row_lines) = (0, y + row_lines * ROW, 0);
            }
            entry.place = (x, y);
            key.width = key.width.max(x + whole);
            x += whole + APART;
            row_lines = row_lines.max(entry.lines.len() as i32);
        }
        key.height = y + row_lines * ROW;
        key
    }

    /// Draws it with its top left corner at a place.
    pub fn draw(&self, drawing: &mut Drawing, (left, top): Pixel) {
        for entry in &self.entries {
            let (x, y) = (left + entry.place.0, top + entry.place.1 + ROW / 2);
            for symbol in &entry.symbols {
                symbol.draw(drawing, (x, y));
            }
            for (n, line) in entry.lines.iter().enumerate() {
                drawing.text(line, (x + entry.symbol_width() + GAP, y + n as i32 * ROW), TEXT_PX, Anchor::Left);
            }
        }
    }
}

impl Entry {
    fn symbol_width(&self) -> i32 {
        let width = |symbol: &Symbol| if let Symbol::Arrow { length, .. } = symbol { *length } else { SYMBOL };
        self.symbols.iter().map(width).max().unwrap_or(0)
    }
}

impl Symbol {
    /// Draws it with its left end at a place, which is at half its height.
    fn draw(self, drawing: &mut Drawing, (x, y): Pixel) {
        let at = |right: i32, down: i32| [f64::from(x + right), f64::from(y + down)];
        let level = [at(0, 0), at(SYMBOL, 0)];
        let block = [(x, y - 7), (x + SYMBOL, y + 7)];
        match self {
            Self::Line(look, style) => {
                drawing.curve(&level, look.colour(), 2, (style == Style::Dashed).then_some(SERIES_DASHES));
            }
            Self::Marker(look) => look.marker(drawing, (x + SYMBOL / 2, y)),
            Self::Steps(look) => {
                let places = [at(0, 6), at(8, 6), at(8, -6), at(22, -6), at(22, 3), at(SYMBOL, 3)];
                drawing.curve(&places, look.colour(), 2, None);
            }
            Self::Reference(n) => {
                drawing.curve(&level, GREY, 2, Some(REFERENCE_DASHES[n % REFERENCE_DASHES.len()]));
            }
            Self::Region => {
                drawing.block(block, SHADE);
                drawing.frame(block, GREY);
            }
            Self::Arrow { length, is_hollow } => arrow(drawing, at(0, 0), at(length, 0), is_hollow),
            Self::Empty => drawing.block(block, EMPTY),
        }
    }
}

/// The entries of a panel's marks. Each name has one entry with the symbols of all its marks.
fn entries(panel: &Panel, looks: &Looks, px_per_unit: [f64; 2]) -> Vec<Entry> {
    let mut entries = Vec::new();
    for mark in &panel.marks {
        let look = looks.look(mark.name());
        let marker = |is_marked: bool| is_marked.then_some(Symbol::Marker(look));
        let has_many = has_many_series(panel);
        let name = mark.name().to_owned();
        let (name, symbols) = match mark {
            Mark::Line { style, .. } => {
                (name, [Symbol::Line(look, *style)].into_iter().chain(marker(has_many)).collect())
            }
            Mark::Steps { .. } => (name, [Symbol::Steps(look)].into_iter().chain(marker(has_many)).collect()),
            Mark::Reference { name: known, .. } => (name, vec![Symbol::Reference(reference_number(panel, known))]),
            Mark::Region { .. } => (name, vec![Symbol::Region]),
            Mark::Arrows(arrows) => {
                let sample = if name.is_empty() { arrows.sample(px_per_unit) } else { Some((f64::from(ARROW), name)) };
                let Some((length, name)) = sample else { continue };
                (name, vec![Symbol::Arrow { length: length.round() as i32, is_hollow: arrows.is_hollow }])
            }
            Mark::Map { .. } if map::has_empty(mark) => ("no data".to_owned(), vec![Symbol::Empty]),
            Mark::Map { .. } => continue,
        };
        add(&mut entries, name, symbols);
    }
    entries
}

/// Adds a name with its symbols, or the symbols to its entry. A reference with the name of a series has its own entry.
fn add(entries: &mut Vec<Entry>, name: String, symbols: Vec<Symbol>) {
    if name.is_empty() {
        return;
    }
    let is_series = |symbols: &[Symbol]| matches!(symbols.first(), Some(Symbol::Line(..) | Symbol::Steps(_)));
    let is_known = |entry: &&mut Entry| {
        entry.name == name && (entry.symbols == symbols || is_series(&entry.symbols) && is_series(&symbols))
    };
    match entries.iter_mut().find(is_known) {
        Some(entry) if entry.symbols != symbols => entry.symbols.extend(symbols),
        Some(_) => {}
        None => entries.push(Entry { name, symbols, lines: Vec::new(), place: (0, 0) }),
    }
}
