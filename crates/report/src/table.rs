//! Tables of text.

use std::fmt::Write as _;

/// A table: a heading for each column, and rows of as many cells.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Table {
    /// What it shows.
    pub caption: String,
    /// One for each column.
    pub headings: Vec<String>,
    /// Rows.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// As Markdown, with the caption above it.
    pub fn markdown(&self) -> String {
        let widths = self.widths();
        let mut text = format!("{}\n\n", self.caption);
        let line = |text: &mut String, cells: &[String]| {
            for (cell, width) in cells.iter().zip(&widths) {
                let pad = width - cell.chars().count();
                let _ = write!(text, "| {cell}{} ", " ".repeat(pad));
            }
            text.push_str("|\n");
        };
        line(&mut text, &self.headings);
        for width in &widths {
            let _ = write!(text, "| {} ", "-".repeat(*width));
        }
        text.push_str("|\n");
        for row in &self.rows {
            line(&mut text, row);
        }
        text
    }

    /// As comma-separated values (RFC 4180), without the caption.
    pub fn csv(&self) -> String {
        let mut text = String::new();
        for row in std::iter::once(&self.headings).chain(&self.rows) {
            let cells: Vec<String> = row.iter().map(|cell| quoted(cell)).collect();
            let _ = write!(text, "{}\r\n", cells.join(","));
        }
        text
    }

    /// For a terminal: columns two spaces apart.
    pub fn plain(&self) -> String {
        let widths = self.widths();
        let mut text = format!("{}\n\n", self.caption);
        for row in std::iter::once(&self.headings).chain(&self.rows) {
            let mut line = String::new();
            for (cell, width) in row.iter().zip(&widths) {
                let pad = width - cell.chars().count();
                let _ = write!(line, "{cell}{}  ", " ".repeat(pad));
            }
            let _ = writeln!(text, "{}", line.trim_end());
        }
        text
    }

    fn widths(&self) -> Vec<usize> {
        let width = |column: usize| {
            let rows = std::iter::once(&self.headings).chain(&self.rows);
            rows.map(|row| row.get(column).map_or(0, |cell| cell.chars().count()))
                .max()
                .unwrap_or(0)
        };
        (0..self.headings.len()).map(width).collect()
    }
}

fn quoted(cell: &str) -> String {
    if cell.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", cell.replace('"', "\"\""))
    } else {
        cell.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::Table;

    #[test]
    fn cells_line_up_and_commas_are_quoted() {
        let table = Table {
            caption: "Two".to_owned(),
            headings: vec!["a".to_owned(), "long".to_owned()],
            rows: vec![vec!["x, y".to_owned(), "1".to_owned()]],
        };
        assert_eq!(
            table.markdown(),
            "Two\n\n| a    | long |\n| ---- | ---- |\n| x, y | 1    |\n"
        );
        assert_eq!(table.csv(), "a,long\r\n\"x, y\",1\r\n");
        assert_eq!(table.plain(), "Two\n\na     long\nx, y  1\n");
    }
}
