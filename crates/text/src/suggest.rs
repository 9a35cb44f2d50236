//! "Did you mean …?"

/// Maximum length of a compared name; the comparison takes quadratic time.
const LONGEST: usize = 60;
/// Maximum number of compared candidates, for the same reason.
const MAX_CANDIDATES: usize = 2000;

/// Returns the candidate most similar to `name`, if one is similar. Ignores case.
pub fn nearest<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let name: Vec<char> = name.to_ascii_lowercase().chars().collect();
    if name.len() > LONGEST {
        return None;
    }
    let length = name.iter().map(|letter| letter.len_utf8()).sum::<usize>();
    let tolerated = (name.len() / 3).clamp(1, 3);
    candidates
        .into_iter()
        .take(MAX_CANDIDATES)
        .filter(|candidate| candidate.len().abs_diff(length) <= tolerated)
        .map(|candidate| {
            let letters: Vec<char> = candidate.to_ascii_lowercase().chars().collect();
            (distance(&name, &letters), candidate)
        })
        .filter(|(distance, _)| *distance <= tolerated)
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, candidate)| candidate)
}

/// Returns the number of insertions, deletions, replacements and swaps of neighbours that lead from
/// `a` to `b`.
fn distance(a: &[char], b: &[char]) -> usize {
    let mut before_last: Vec<usize> = vec![0; b.len() + 1];
    let mut last: Vec<usize> = (0..=b.len()).collect();
    for i in 1..=a.len() {
        let mut row = vec![i; b.len() + 1];
        for j in 1..=b.len() {
            let replaced = last[j - 1] + usize::from(a[i - 1] != b[j - 1]);
            row[j] = replaced.min(last[j] + 1).min(row[j - 1] + 1);
            let is_swap = i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
            if is_swap {
                row[j] = row[j].min(before_last[j - 2] + 1);
            }
        }
        before_last = std::mem::replace(&mut last, row);
    }
    last[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_swap_of_neighbours_is_one_mistake() {
        assert_eq!(nearest("rovre", ["waypoint", "rover"]), Some("rover"));
    }

    #[test]
    fn unlike_name_has_no_suggestion() {
        assert_eq!(nearest("truck", ["waypoint", "rover"]), None);
        assert_eq!(nearest("", ["waypoint"]), None);
    }
}
