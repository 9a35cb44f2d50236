//! `docs/reference/executors.md` lists the executors as the program does.

use std::fmt::Write;

use elbowroom_execution::PlanForm;
use elbowroom_execution::executors::{EXECUTORS, ExecutorEntry, Need, Role};

const BEGIN: &str = "<!-- from the list of executors: begin -->\n";
const END: &str = "<!-- end -->";

/// `ELBOWROOM_UPDATE_DOCS=1 cargo test -p elbowroom-execution --test execution executors_page` updates the list.
#[test]
fn the_page_lists_the_executors_as_they_are_registered() {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../docs/reference/executors.md"
    );
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
    panic!(
        "docs/reference/executors.md is out of date; ELBOWROOM_UPDATE_DOCS=1 writes it anew:\n{list}"
    );
}

fn list() -> String {
    let mut text = String::from("\n");
    for executor in EXECUTORS {
        let _ = writeln!(text, "### `{}`\n", executor.usage());
        let _ = writeln!(text, "{}\n", executor.summary);
        if let Some(meaning) = executor.argument {
            let _ = writeln!(text, "X: {meaning}.\n");
        }
        let _ = writeln!(text, "Source: {}.\n", executor.paper);
    }
    text.push_str(
        "### Needs and roles\n\n\
         | executor | plan | odds | action values | rollouts | orders | roles |\n\
         |---|---|---|---|---|---|---|\n",
    );
    for executor in EXECUTORS {
        let _ = writeln!(text, "| `{}` | {} |", executor.usage(), cells(executor));
    }
    text.push('\n');
    text
}

fn cells(executor: &ExecutorEntry) -> String {
    let needs = executor.needs;
    let plan = match needs.plan {
        PlanForm::Orderings => "orderings",
        PlanForm::PartialOrder => "partial order",
        PlanForm::Network => "network",
        PlanForm::OpenNetwork => "open network",
        PlanForm::Envelope => "envelope",
    };
    let odds = match needs.odds {
        Need::Never => "",
        Need::WithArgument => "with X",
        Need::Always => "yes",
    };
    let yes = |needed: bool| if needed { "yes" } else { "" };
    let roles = Role::NAMES
        .iter()
        .filter(|(role, _)| executor.roles.contains(role));
    let roles = roles.map(|(_, name)| *name);
    let (values, rollouts, orders) = (needs.action_values, needs.rollouts, needs.orders);
    let cells = [plan, odds, yes(values), yes(rollouts), yes(orders)].join(" | ");
    format!("{cells} | {}", roles.collect::<Vec<_>>().join(", "))
}
