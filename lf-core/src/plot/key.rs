//! The key of a panel, in rows above it.

use super::chart::{Mark, Panel, Style};
use super::map;
use super::marks::stroke;
use super::palette::{DASHES, EMPTY, GREY, Look, SERIES_DASH, SHADES};
use super::text::{From, TEXT_PX, text, width, wrap};
use super::view::{Looks, reference_number};
use super::{Area, Drawn, words};
use plotters::prelude::*;

/// Width of what an entry shows, distance to its name, and to the next entry, px.
const SYMBOL: i32 = 30;
const GAP: i32 = 7;
const APART: i32 = 18;
/// Height of a row.
pub(super) const ROW: i32 = 20;

/// What an entry shows.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Symbol {
    Line(Look, Style),
    Band(Look),
    Marker(Look),
    Steps(Look),
    Reference(usize),
    Region(usize),
    Empty,
}

/// A name in lines, and where it stands in the key.
struct Entry {
    name: String,
    symbols: Vec<Symbol>,
    lines: Vec<String>,
    place: (i32, i32),
}

/// The entries of a panel.
pub(super) struct Key {
    entries: Vec<Entry>,
    pub height: i32,
}

impl Key {
    /// The key of a panel no wider than `room_px`.
    pub fn new(panel: &Panel, looks: &Looks, room_px: i32) -> Self {
        let mut key = Self { entries: entries(panel, looks), height: 0 };
        let (mut x, mut y) = (0, 0);
        let mut row_lines = 0;
        for entry in &mut key.entries {
            entry.lines = wrap(&entry.name, TEXT_PX, room_px - SYMBOL - GAP);
            let widest = entry.lines.iter().map(|line| width(line, TEXT_PX)).max().unwrap_or(0);
            let whole = SYMBOL + GAP + widest;
            if x > 0 && x + whole > room_px {
                (x, y, row_lines) = (0, y + row_lines * ROW, 0);
            }
            entry.place = (x, y);
            x += whole + APART;
            row_lines = row_lines.max(entry.lines.len() as i32);
        }
        key.height = y + row_lines * ROW;
        key
    }

    /// Draws it with its top left corner at a place.
    pub fn draw(&self, area: &Area, (left, top): (i32, i32)) -> Drawn<()> {
        for entry in &self.entries {
            let (x, y) = (left + entry.place.0, top + entry.place.1 + ROW / 2);
            for symbol in &entry.symbols {
                symbol.draw(area, (x, y))?;
            }
            for (n, line) in entry.lines.iter().enumerate() {
                text(area, line, (x + SYMBOL + GAP, y + n as i32 * ROW), TEXT_PX, From::Left)?;
            }
        }
        Ok(())
    }
}

impl Symbol {
    /// Left end at a place, at half its height.
    fn draw(self, area: &Area, (x, y): (i32, i32)) -> Drawn<()> {
        let at = |right: i32, down: i32| [f64::from(x + right), f64::from(y + down)];
        let level = [at(0, 0), at(SYMBOL, 0)];
        let block = |colour: RGBAColor| {
            area.draw(&Rectangle::new([(x, y - 7), (x + SYMBOL, y + 7)], colour.filled())).map_err(words)
        };
        match self {
            Self::Line(look, style) => {
                let pattern = (style == Style::Dashed).then_some(SERIES_DASH);
                stroke(area, &level, look.colour().stroke_width(2), pattern)
            }
            Self::Band(look) => block(look.colour().mix(0.2)),
            Self::Marker(look) => look.marker(area, (x + SYMBOL / 2, y)),
            Self::Steps(look) => {
                let places = [at(0, 6), at(8, 6), at(8, -6), at(22, -6), at(22, 3), at(SYMBOL, 3)];
                stroke(area, &places, look.colour().stroke_width(2), None)
            }
            Self::Reference(n) => stroke(area, &level, GREY.stroke_width(2), Some(DASHES[n % DASHES.len()])),
            Self::Region(n) => {
                block(SHADES[n % SHADES.len()].into())?;
                area.draw(&Rectangle::new([(x, y - 7), (x + SYMBOL, y + 7)], GREY)).map_err(words)
            }
            Self::Empty => block(EMPTY.into()),
        }
    }
}

/// Every name once, with all that it stands for.
fn entries(panel: &Panel, looks: &Looks) -> Vec<Entry> {
    let several = Looks::of([panel]).0.len() > 1;
    let mut entries: Vec<Entry> = Vec::new();
    let mut add = |name: &str, symbols: &[Symbol]| {
        if name.is_empty() {
            return;
        }
        // A reference of a series' name is another thing.
        let is_series = |symbols: &[Symbol]| {
            !matches!(symbols.first(), Some(Symbol::Reference(_) | Symbol::Region(_) | Symbol::Empty))
        };
        let known = |entry: &&mut Entry| {
            entry.name == name && (entry.symbols == symbols || is_series(&entry.symbols) && is_series(symbols))
        };
        match entries.iter_mut().find(known) {
            Some(entry) if entry.symbols != symbols => entry.symbols.extend(symbols),
            Some(_) => {}
            None => {
                let (name, symbols) = (name.to_owned(), symbols.to_vec());
                entries.push(Entry { name, symbols, lines: Vec::new(), place: (0, 0) });
            }
        }
    };
    let mut regions = 0;
    for mark in &panel.marks {
        let look = looks.look(mark.name());
        match mark {
            Mark::Line { name, spread, style, with_points, .. } => {
                let band = spread.iter().map(|_| Symbol::Band(look));
                let marker = (*with_points || several).then_some(Symbol::Marker(look));
                add(name, &band.chain([Symbol::Line(look, *style)]).chain(marker).collect::<Vec<_>>());
            }
            Mark::Steps { name, .. } => {
                let marker = several.then_some(Symbol::Marker(look));
                add(name, &[Symbol::Steps(look)].into_iter().chain(marker).collect::<Vec<_>>());
            }
            Mark::Points { name, .. } => add(name, &[Symbol::Marker(look)]),
            Mark::Reference { name, .. } => add(name, &[Symbol::Reference(reference_number(panel, name))]),
            Mark::Region { name, .. } => {
                add(name, &[Symbol::Region(regions)]);
                regions += 1;
            }
            Mark::Arrows { .. } => {}
            Mark::Map { .. } => {
                if map::has_empty(mark) {
                    add("no data", &[Symbol::Empty]);
                }
            }
        }
    }
    entries
}
