//! Page of an executive for its operator.

const TEMPLATE: &str = include_str!("operator/page.html");
const STYLES: &[&str] = &[include_str!("page.css"), include_str!("operator/page.css")];
/// Scripts of the page, ordered so that each one calls earlier ones only.
const SCRIPTS: &[&str] = &[
    include_str!("script/elements.js"),
    include_str!("operator/words.js"),
    include_str!("operator/stream.js"),
    include_str!("operator/requests.js"),
    include_str!("operator/goals.js"),
    include_str!("operator/lanes.js"),
    include_str!("operator/slack.js"),
    include_str!("operator/history.js"),
    include_str!("operator/page.js"),
];

/// Returns the page of an executive for its operator, as an HTML file. It has no data: its script reads
/// `v1/state/events` from its server.
pub fn operator_page() -> String {
    let page = TEMPLATE.replacen("{style}", &STYLES.concat(), 1);
    page.replacen("{script}", &SCRIPTS.concat(), 1)
}
