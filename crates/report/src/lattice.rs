//! Picture of all orders of a plan's happenings, as SVG.
//!
//! A [`LatticePicture`] shows the sets of happenings that an order can have executed, from the
//! empty set on the left to the full set on the right, with a line for each possible next
//! happening. The darkness of a set shows the success probability of the best order through it. One
//! order is highlighted. No fonts are read, and the same picture gives the same bytes.

use std::fmt::Write as _;

use crate::svg::{self, escaped, float, text};

/// The picture of a lattice.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LatticePicture {
    /// The title.
    pub title: String,
    /// The text below the title.
    pub subtitle: String,
    /// The sets. A line leads from an earlier to a later one.
    pub nodes: Vec<PictureNode>,
    /// The lines.
    pub edges: Vec<PictureEdge>,
    /// Positions of the sets along the highlighted order.
    pub shown: Vec<usize>,
}

/// A set of happenings.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PictureNode {
    /// Number of happenings in the set; determines its column.
    pub level: usize,
    /// The label.
    pub words: String,
    /// Success probability.
    pub value: f64,
    /// `true` if an order may end there.
    pub is_end: bool,
}

/// A line between two sets.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PictureEdge {
    /// Position of the smaller set.
    pub from: usize,
    /// Position of the larger set.
    pub to: usize,
    /// The happening.
    pub words: String,
    /// Success probability.
    pub value: f64,
}

/// Pixels from one level to the next.
const COLUMN: f64 = 118.0;
/// Pixels from one set of a level to the next.
const ROW: f64 = 34.0;
const MARGIN: f64 = 40.0;
/// Pixels from one line of words to the next.
const LINE: f64 = 16.0;
/// Height of the area for the titles.
const HEAD: f64 = 84.0;
/// Maximum number of sets on a level at which probabilities are printed. In larger pictures, they
/// are shown on hover only.
const MAX_LABELLED_NODES: usize = 14;

impl LatticePicture {
    /// Renders the picture as an SVG document.
    pub fn svg(&self) -> String {
        let places = self.node_centres();
        let levels = self.nodes.iter().map(|node| node.level).max().unwrap_or(0);
        let tallest = self.tallest();
        let width = (2.0 * MARGIN + COLUMN * float(levels)).max(640.0);
        let steps = float(self.steps().count());
        let height = HEAD + 1.5 * MARGIN + ROW * float(tallest.max(3)) + LINE * steps;
        let mut svg = svg::begin(width, height);
        text(&mut svg, (MARGIN / 2.0, 26.0), 16, "start", &self.title);
        text(&mut svg, (MARGIN / 2.0, 46.0), 12, "start", &self.subtitle);
        for edge in self.edges.iter().filter(|edge| !self.is_shown(edge)) {
            self.draw_edge(&mut svg, edge, &places);
        }
        for edge in self.edges.iter().filter(|edge| self.is_shown(edge)) {
            self.draw_edge(&mut svg, edge, &places);
        }
        let best = self.nodes.iter().map(|node| node.value).fold(0.0, f64::max);
        for (position, node) in self.nodes.iter().enumerate() {
            self.draw_node(&mut svg, (position, node), places[position], best, tallest);
        }
        // Names would overlap lines and sets, so the lines of the highlighted order are numbered,
        // and a legend below has the names.
        for (step, edge) in self.steps().enumerate() {
            let (from, to) = (places[edge.from], places[edge.to]);
            let middle = f64::midpoint(from.0, to.0);
            let number = (step + 1).to_string();
            let above = f64::midpoint(from.1, to.1) - 7.0;
            text(&mut svg, (middle, above), 11, "middle", &number);
            let line = format!("{number}  {}", edge.words);
            let below = HEAD + ROW * float(tallest.max(3)) + MARGIN + LINE * float(step);
            text(&mut svg, (MARGIN / 2.0, below), 11, "start", &line);
        }
        svg.push_str("</svg>\n");
        svg
    }

    /// Returns the lines along the highlighted order.
    fn steps(&self) -> impl Iterator<Item = &PictureEdge> {
        let pairs = self.shown.windows(2);
        pairs.filter_map(|pair| {
            let mut edges = self.edges.iter();
            edges.find(|edge| [edge.from, edge.to] == *pair)
        })
    }

    fn tallest(&self) -> usize {
        let count = |level| self.nodes.iter().filter(|node| node.level == level).count();
        let levels = self.nodes.iter().map(|node| node.level);
        levels.map(count).max().unwrap_or(0)
    }

    fn is_shown(&self, edge: &PictureEdge) -> bool {
        let mut pairs = self.shown.windows(2);
        pairs.any(|pair| [edge.from, edge.to] == *pair)
    }

    /// Returns the centre of each set. Sets on a level are sorted by the mean height of their
    /// predecessors.
    fn node_centres(&self) -> Vec<(f64, f64)> {
        let levels = self.nodes.iter().map(|node| node.level).max().unwrap_or(0);
        let tallest = float(self.tallest().max(3));
        let mut places = vec![(0.0, 0.0); self.nodes.len()];
        for level in 0..=levels {
            let at = |position: &usize| self.nodes[*position].level == level;
            let mut here: Vec<(f64, usize)> = (0..self.nodes.len())
                .filter(at)
                .map(|position| {
                    let before = self.edges.iter().filter(|edge| edge.to == position);
                    let heights: Vec<f64> = before.map(|edge| places[edge.from].1).collect();
                    let sum: f64 = heights.iter().sum();
                    (sum / float(heights.len().max(1)), position)
                })
                .collect();
            here.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let count = float(here.len());
            for (row, (_, position)) in here.into_iter().enumerate() {
                let offset = (tallest - count) / 2.0 + float(row) + 0.5;
                places[position] = (MARGIN + COLUMN * float(level), HEAD + ROW * offset);
            }
        }
        places
    }

    fn draw_edge(&self, svg: &mut String, edge: &PictureEdge, places: &[(f64, f64)]) {
        let ((x1, y1), (x2, y2)) = (places[edge.from], places[edge.to]);
        let (stroke, width) = if self.is_shown(edge) {
            ("#d55e00", 3.0)
        } else {
            ("#bbbbbb", 1.0)
        };
        let _ = writeln!(
            svg,
            "<line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" stroke=\"{stroke}\" \
             stroke-width=\"{width}\"><title>{}: {}</title></line>",
            escaped(&edge.words),
            percent(edge.value)
        );
    }

    fn draw_node(
        &self,
        svg: &mut String,
        (position, node): (usize, &PictureNode),
        (x, y): (f64, f64),
        best: f64,
        tallest: usize,
    ) {
        let share = if best > 0.0 { node.value / best } else { 0.0 };
        let (outline, width) = match (self.shown.contains(&position), node.is_end) {
            (true, _) => ("#d55e00", 3.0),
            (false, true) => ("#3c3c3c", 2.5),
            (false, false) => ("#3c3c3c", 0.8),
        };
        let _ = writeln!(
            svg,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{}\" fill=\"{}\" stroke=\"{outline}\" \
             stroke-width=\"{width}\"><title>{}: {}</title></circle>",
            if node.is_end { 9 } else { 7 },
            blue(share),
            escaped(&node.words),
            percent(node.value)
        );
        if tallest <= MAX_LABELLED_NODES {
            text(svg, (x, y + 20.0), 9, "middle", &percent(node.value));
        }
    }
}

/// Returns a colour between white and the blue of Okabe & Ito.
fn blue(share: f64) -> String {
    let share = share.clamp(0.0, 1.0);
    let mixed = |end: f64| 255.0 + (end - 255.0) * share;
    format!(
        "rgb({:.0},{:.0},{:.0})",
        mixed(0.0),
        mixed(114.0),
        mixed(178.0)
    )
}

fn percent(value: f64) -> String {
    format!("{:.1} %", 100.0 * value)
}

#[cfg(test)]
mod tests {
    use super::{LatticePicture, PictureEdge, PictureNode};

    fn diamond() -> LatticePicture {
        let node = |level, words: &str, value| PictureNode {
            level,
            words: words.to_owned(),
            value,
            is_end: level == 2,
        };
        let edge = |from, to, words: &str| PictureEdge {
            from,
            to,
            words: words.to_owned(),
            value: 0.5,
        };
        LatticePicture {
            title: "a < b & c".to_owned(),
            subtitle: String::new(),
            nodes: vec![
                node(0, "nothing", 0.5),
                node(1, "(a)", 0.5),
                node(1, "(b)", 0.25),
                node(2, "(a), (b)", 0.5),
            ],
            edges: vec![
                edge(0, 1, "(a)"),
                edge(0, 2, "(b)"),
                edge(1, 3, "(b)"),
                edge(2, 3, "(a)"),
            ],
            shown: vec![0, 1, 3],
        }
    }

    #[test]
    fn each_node_and_edge_is_drawn_once() {
        let svg = diamond().svg();
        assert_eq!(svg.matches("<circle").count(), 4);
        assert_eq!(svg.matches("<line").count(), 4);
        // The highlighted order is numbered, and its happenings are listed below.
        assert_eq!(svg.matches(">1  (a)</text>").count(), 1);
        assert_eq!(svg.matches(">2  (b)</text>").count(), 1);
        assert!(
            svg.contains("a &lt; b &amp; c") && svg.contains("(a), (b): 50.0 %"),
            "{svg}"
        );
        assert_eq!(svg, diamond().svg());
    }

    #[test]
    fn empty_lattice_is_drawn() {
        assert!(LatticePicture::default().svg().ends_with("</svg>\n"));
    }
}
