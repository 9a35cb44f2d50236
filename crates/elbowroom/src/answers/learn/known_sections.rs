//! Learnt models for problems with other objects.

use elbowroom_model::Problem;
use elbowroom_sim::WorldModel;
use elbowroom_text::Source;

/// Returns a learnt world file without the sections that a problem cannot have, such as those of
/// actions with objects of earlier problems, and the number of these sections.
///
/// Sections are separated by blank lines, as `learn` writes them. A section with any other mistake
/// is also left out. The lines before the first section are kept.
pub fn known_sections(text: &str, problem: &Problem) -> (String, usize) {
    let mut sections = text.split("\n\n");
    let head = sections.next().unwrap_or_default();
    let (mut known, mut left_out) = (head.to_owned(), 0);
    for section in sections {
        let alone = Source::new("section", format!("{head}\n\n{section}"));
        if WorldModel::read(alone, problem).is_ok() {
            known.push_str("\n\n");
            known.push_str(section);
        } else {
            left_out += 1;
        }
    }
    (known, left_out)
}
