//! `docs/executors.md` lists the executors as the program does.

use std::fmt::Write;

use elbowroom::execution::executors::EXECUTORS;

const BEGIN: &str = "<!-- from the list of executors: begin -->\n";
const END: &str = "<!-- end -->";

/// `ELBOWROOM_UPDATE_DOCS=1 cargo test -p elbowroom --test elbowroom executors_page` updates the list.
#[test]
fn the_page_lists_the_executors_as_they_are_registered() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/executors.md");
    let page = std::fs::read_to_string(path).expect("the page");
    let (before, rest) = page.split_once(BEGIN).expect("a place for the list");
    let (listed, after) = rest.split_once(END).expect("an end of the list");
    let list = list();
    if listed == list {
        return;
    }
    if std::env::var_os("ELBOWROOM_UPDATE_DOCS").is_some() {
        let page = format!("{before}{BEGIN}{list}{END}{after}");
        std::fs::write(path, page).expect("the page can be written");
        return;
    }
    panic!("docs/executors.md is out of date; ELBOWROOM_UPDATE_DOCS=1 writes it anew:\n{list}");
}

fn list() -> String {
    let mut text = String::from("\n");
    for executor in EXECUTORS {
        let argument = match (executor.argument, executor.is_optional) {
            (None, _) => String::new(),
            (Some(_), false) => ":X".to_owned(),
            (Some(_), true) => "[:X]".to_owned(),
        };
        let _ = writeln!(text, "### `{}{argument}`\n", executor.name);
        let _ = writeln!(text, "{}\n", executor.summary);
        if let Some(meaning) = executor.argument {
            let _ = writeln!(text, "X: {meaning}.\n");
        }
        let _ = writeln!(text, "Source: {}.\n", executor.paper);
    }
    text
}
