//! Tables of text.

use std::fmt::Write as _;

/// A table: a heading for each column, and rows of as many cells.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Table {
    /// The caption.
    pub caption: String,
    /// One heading for each column.
    pub headings: Vec<String>,
    /// Number of leading columns that identify a row; at least 1. They are repeated if a table is
    /// folded.
    pub keys: usize,
    /// Rows.
    pub rows: Vec<Vec<String>>,
    /// Notes on the rows, printed below the table in Markdown only.
    pub notes: Vec<String>,
}

impl Table {
    /// Renders the table as Markdown, with the caption above it.
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
        if !self.notes.is_empty() {
            text.push('\n');
        }
        for note in &self.notes {
            let _ = writeln!(text, "- {note}");
        }
        text
    }

    /// Renders the table as comma-separated values (RFC 4180), without the caption.
    pub fn csv(&self) -> String {
        let mut text = String::new();
        for row in std::iter::once(&self.headings).chain(&self.rows) {
            let cells: Vec<String> = row.iter().map(|cell| quoted(cell)).collect();
            let _ = write!(text, "{}\r\n", cells.join(","));
        }
        text
    }

    /// Renders the table for a terminal, with two spaces between columns.
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

    /// Renders the table for a terminal of `width` columns. Headings are broken between words.
    /// Columns that do not fit follow in further blocks, which repeat the keys.
    pub fn fit_to_width(&self, width: usize) -> String {
        let longest_word = |heading: &String| {
            let words = heading.split(' ').map(|word| word.chars().count());
            words.max().unwrap_or(0)
        };
        let of_cells = |column: usize| {
            let cells = self.rows.iter().filter_map(|row| row.get(column));
            cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
        };
        let headings = self.headings.iter().enumerate();
        let widths: Vec<usize> = headings
            .map(|(column, heading)| of_cells(column).max(longest_word(heading)))
            .collect();
        let mut text = String::new();
        for line in self.caption.lines() {
            let _ = writeln!(text, "{}", wrap_lines(line, width).join("\n"));
        }
        for columns in blocks(&widths, self.keys.max(1), width) {
            text.push('\n');
            self.write_block(&mut text, &columns, &widths);
        }
        text
    }

    /// Writes some columns, with their headings.
    fn write_block(&self, text: &mut String, columns: &[usize], widths: &[usize]) {
        let heading = |column: &usize| wrap_lines(&self.headings[*column], widths[*column]);
        let headings: Vec<Vec<String>> = columns.iter().map(heading).collect();
        let height = headings.iter().map(Vec::len).max().unwrap_or(0);
        let lines = (0..height).map(|line| {
            let part = |heading: &Vec<String>| heading.get(line).cloned().unwrap_or_default();
            headings.iter().map(part).collect()
        });
        let rows = self.rows.iter().map(|row| {
            let cell = |column: &usize| row.get(*column).cloned().unwrap_or_default();
            columns.iter().map(cell).collect::<Vec<String>>()
        });
        for cells in lines.chain(rows) {
            let mut line = String::new();
            for (cell, column) in cells.iter().zip(columns) {
                let pad = widths[*column].saturating_sub(cell.chars().count());
                let _ = write!(line, "{cell}{}  ", " ".repeat(pad));
            }
            let _ = writeln!(text, "{}", line.trim_end());
        }
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

/// Divides the columns into blocks: the keys, and as many others as fit, but at least one.
fn blocks(widths: &[usize], keys: usize, width: usize) -> Vec<Vec<usize>> {
    let keys = keys.min(widths.len());
    if keys == 0 {
        return Vec::new();
    }
    let start = || (0..keys).collect::<Vec<usize>>();
    let of_keys = widths[..keys].iter().sum::<usize>() + 2 * (keys - 1);
    let mut blocks = Vec::new();
    let (mut block, mut used) = (start(), of_keys);
    for (column, own) in widths.iter().enumerate().skip(keys) {
        if block.len() > keys && used + 2 + own > width {
            blocks.push(std::mem::replace(&mut block, start()));
            used = of_keys;
        }
        block.push(column);
        used += 2 + own;
    }
    blocks.push(block);
    blocks
}

/// Breaks a text into lines of at most `width` characters. Longer words are not broken.
fn wrap_lines(text: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split(' ') {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
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
    fn wide_table_is_split_without_loss() {
        let headings = ["who", "one: coverage [95 %]", "two: coverage [95 %]"];
        let row = ["a", "1.0 [0.5, 2.0]", "3.0 [2.5, 4.0]"];
        let table = Table {
            caption: "How often it works".to_owned(),
            headings: headings.map(str::to_owned).to_vec(),
            keys: 1,
            rows: vec![row.map(str::to_owned).to_vec()],
            notes: Vec::new(),
        };
        let expected = "How often it works\n\n\
                        who  one: coverage\n     [95 %]\na    1.0 [0.5, 2.0]\n\n\
                        who  two: coverage\n     [95 %]\na    3.0 [2.5, 4.0]\n";
        assert_eq!(table.fit_to_width(20), expected);
        let all = table.fit_to_width(80);
        assert!(all.contains("one: coverage   two: coverage\n"), "{all}");
    }

    #[test]
    fn wrapped_rows_are_distinguishable() {
        let cells = |row: [&str; 4]| row.map(str::to_owned).to_vec();
        let table = Table {
            caption: "Who wins".to_owned(),
            headings: cells(["case", "executor", "success", "replans"]),
            keys: 2,
            rows: vec![
                cells(["p1", "stn", "10", "1"]),
                cells(["p1", "live", "20", "2"]),
            ],
            notes: Vec::new(),
        };
        let expected = "Who wins\n\n\
                        case  executor  success\np1    stn       10\np1    live      20\n\n\
                        case  executor  replans\np1    stn       1\np1    live      2\n";
        assert_eq!(table.fit_to_width(24), expected);
    }

    #[test]
    fn cells_are_aligned_and_commas_quoted() {
        let table = Table {
            caption: "Two".to_owned(),
            headings: vec!["a".to_owned(), "long".to_owned()],
            keys: 1,
            rows: vec![vec!["x, y".to_owned(), "1".to_owned()]],
            notes: vec!["1 is one".to_owned()],
        };
        assert_eq!(
            table.markdown(),
            "Two\n\n| a    | long |\n| ---- | ---- |\n| x, y | 1    |\n\n- 1 is one\n"
        );
        assert_eq!(table.csv(), "a,long\r\n\"x, y\",1\r\n");
        assert_eq!(table.plain(), "Two\n\na     long\nx, y  1\n");
    }
}
