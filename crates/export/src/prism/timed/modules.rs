//! The modules of actions and of events.

use std::fmt::Write as _;

use elbowroom_mdp::EndProbabilities;
use elbowroom_mdp::process::{ActionModel, Facts};
use elbowroom_num::Rational;

use super::super::bare;
use super::super::formula::{Formula, choice, exact};
use super::{Bound, Happening, Owner, Process};

impl Process<'_> {
    /// Writes the module of an action: the time of its start, and its known end.
    pub(super) fn act_module(&self, act: usize, happenings: &[Happening], text: &mut String) {
        let (name, world_act) = (&self.acts[act], &self.world.acts[act]);
        let (since, ends) = (format!("a_{name}"), format!("o_{name}"));
        let cells = self.chances.cells;
        let most = match self.bound {
            Bound::Lower => 2,
            Bound::Upper => 4,
        };
        let _ = writeln!(
            text,
            "module act_{name} // {}\n  // 0: not running; n: for n-1 cells.\n  {since} : [0..{}] init 0;",
            bare(&world_act.name),
            cells + 1
        );
        text.push_str(match self.bound {
            Bound::Lower => "  // Its outcome in this cell: 1 success, 2 failure.\n",
            Bound::Upper => {
                "  // 1 ends well, 2 badly, in this cell or the next; 3 and 4 in this one.\n"
            }
        });
        let _ = writeln!(text, "  {ends} : [0..{most}] init 0;");
        for happening in happenings {
            self.act_command(act, happening, text);
        }
        match self.bound {
            Bound::Lower => {
                let _ = writeln!(
                    text,
                    "  [tick] {ends}=0 -> ({since}'=({since}>0 ? {since}+1 : 0));"
                );
                let _ = writeln!(text, "  [wait] {since}=0 -> true;");
                self.draws(act, "wait", "", text);
            }
            Bound::Upper => {
                // The elapsed time is irrelevant once the end is known.
                let _ = writeln!(
                    text,
                    "  [pass] {ends}<3 -> ({since}'=({ends}>0 ? 1 : ({since}>0 ? {since}+1 : 0)))\
                     &({ends}'=({ends}>0 ? {ends}+2 : 0));"
                );
                let _ = writeln!(text, "  [reveal] {since}=0 | {ends}>0 -> true;");
                self.draws(act, "reveal", &format!(" & {ends}=0"), text);
            }
        }
        text.push_str("endmodule\n\n");
    }

    /// Writes the random draw of its end in the present cell, by elapsed time.
    fn draws(&self, act: usize, label: &str, guard: &str, text: &mut String) {
        let since = format!("a_{}", self.acts[act]);
        let ends = format!("o_{}", self.acts[act]);
        let hazards: Vec<String> = self.chances.ends[act]
            .iter()
            .map(|hazard| choice(&ends_of(&ends, hazard, "true")))
            .collect();
        for (from, to) in runs(&hazards) {
            let _ = writeln!(
                text,
                "  [{label}] {}{guard} -> {};",
                range(&since, from + 1, to + 1),
                hazards[from]
            );
        }
    }

    /// Writes the command of an action for a happening.
    fn act_command(&self, act: usize, happening: &Happening, text: &mut String) {
        let (since, ends) = (
            format!("a_{}", self.acts[act]),
            format!("o_{}", self.acts[act]),
        );
        let Happening {
            label,
            adds,
            deletes,
            ..
        } = happening;
        let may_continue = self.over_all_after(&self.world.acts[act], *adds, *deletes);
        match happening.owner {
            Owner::Started(own) if own == act => {
                let begins = format!("({since}'=1)");
                let ways = match self.bound {
                    Bound::Lower => begins,
                    // It may end in the same cell.
                    Bound::Upper => {
                        let ways = ends_of(&ends, &self.chances.ends[act][0], "");
                        let ways = ways.map(|(p, end)| match end.as_str() {
                            "" => (p, begins.clone()),
                            end => (p, format!("{begins}&{end}")),
                        });
                        choice(&ways)
                    }
                };
                let _ = writeln!(text, "  [{label}] {since}=0 -> {ways};");
            }
            Owner::Ended(own, is_well) if own == act => {
                let guard = match (is_well, self.bound) {
                    (None, _) => format!("{since}>0"),
                    (Some(true), Bound::Lower) => format!("{ends}=1"),
                    (Some(false), Bound::Lower) => format!("{ends}=2"),
                    (Some(true), Bound::Upper) => format!("{ends}=1 | {ends}=3"),
                    (Some(false), Bound::Upper) => format!("{ends}=2 | {ends}=4"),
                };
                let _ = writeln!(text, "  [{label}] {guard} -> ({since}'=0)&({ends}'=0);");
            }
            _ => {
                if let Some(may_continue) = may_continue {
                    let keep = |name: &str| format!("({name}'=(({may_continue}) ? {name} : 0))");
                    let _ = writeln!(
                        text,
                        "  [{label}] true -> {}&{};",
                        keep(&since),
                        keep(&ends)
                    );
                }
            }
        }
    }

    /// Returns the condition that an action can start and its over-all conditions hold right after the start.
    pub(super) fn can_start(&self, act: &ActionModel) -> Formula {
        let needs = self.holds(&act.start.needs);
        let over_all = act.rest.iter().map(|(over_all, _)| {
            let may_continue = self.over_all_after(act, act.start.adds, act.start.deletes);
            may_continue.unwrap_or_else(|| self.holds(over_all))
        });
        Formula::all(std::iter::once(needs).chain(over_all))
    }

    /// Returns the over-all conditions of an action after these effects; `None` if the effects do
    /// not concern them.
    fn over_all_after(&self, act: &ActionModel, adds: Facts, deletes: Facts) -> Option<Formula> {
        let (over_all, _) = act.rest.as_ref()?;
        (over_all.mentions() & (adds | deletes) != 0).then(|| self.after(over_all, adds, deletes))
    }

    /// Writes the module of an event, with the states 0 (may still happen), 1 (happens in this
    /// cell) and 2 (over).
    pub(super) fn event_module(&self, event: usize, happenings: &[Happening], text: &mut String) {
        let name = format!("e_{event}");
        let world_event = &self.world.events[event];
        let words = |facts: Facts, truth: &str| -> Vec<String> {
            let names = self.facts.iter().enumerate();
            names
                .filter(|(place, _)| facts & (1 << place) != 0)
                .map(|(_, name)| format!("{name} {truth}"))
                .collect()
        };
        let mut changes = words(world_event.adds, "true");
        changes.extend(words(world_event.deletes & !world_event.adds, "false"));
        let _ = writeln!(
            text,
            "module event_{event} // makes {}\n  // 0 to come, 1 in this cell, 2 over.\n  {name} : [0..2] init 0;",
            changes.join(", ")
        );
        for happening in happenings {
            if happening.owner == Owner::Event(event) {
                let _ = writeln!(text, "  [{}] {name}=1 -> ({name}'=2);", happening.label);
            }
        }
        let (label, done) = match self.bound {
            Bound::Lower => ("wait", "tick"),
            Bound::Upper => ("reveal", "pass"),
        };
        let _ = writeln!(text, "  [{done}] {name}!=1 -> true;");
        let _ = writeln!(text, "  [{label}] {name}>0 -> true;");
        let drawn = |p: f64| {
            let p = exact(p);
            let rest = &Rational::ONE - &p;
            choice(&[(p, format!("({name}'=1)")), (rest, "true".to_owned())])
        };
        let hazards = self.chances.events[event].iter();
        let hazards: Vec<String> = hazards.map(|p| drawn(*p)).collect();
        for (from, to) in runs(&hazards) {
            let _ = writeln!(
                text,
                "  [{label}] {name}=0 & {} -> {};",
                range("cell", from, to),
                hazards[from]
            );
        }
        if self.bound == Bound::Lower && self.has_initial_events() {
            let _ = writeln!(
                text,
                "  [begin] true -> {};",
                drawn(self.chances.initial[event])
            );
            let _ = writeln!(text, "  [begun] {name}!=1 -> true;");
        }
        text.push_str("endmodule\n\n");
    }
}

/// Returns the possible ends of a running action, with `otherwise` for no end.
fn ends_of(name: &str, hazard: &EndProbabilities, otherwise: &str) -> [(Rational, String); 3] {
    let (well, badly) = (exact(hazard.success), exact(hazard.any_failure()));
    let rest = &(&Rational::ONE - &well) - &badly;
    // The rounding error is added to the likelier end.
    let is_over = rest.to_f64() < 1e-12;
    let one = Rational::ONE;
    let (well, badly, rest) = match (is_over, well >= badly) {
        (false, _) => (well, badly, rest),
        (true, true) => (&one - &badly, badly, Rational::ZERO),
        (true, false) => (well.clone(), &one - &well, Rational::ZERO),
    };
    [
        (well, format!("({name}'=1)")),
        (badly, format!("({name}'=2)")),
        (rest, otherwise.to_owned()),
    ]
}

/// Returns the first and the last position of each run of equal texts.
fn runs(texts: &[String]) -> Vec<(usize, usize)> {
    let mut runs: Vec<(usize, usize)> = Vec::new();
    for (place, text) in texts.iter().enumerate() {
        match runs.last_mut() {
            Some((first, last)) if texts[*first] == *text => *last = place,
            _ => runs.push((place, place)),
        }
    }
    runs
}

/// Returns the condition that a number is in a range.
fn range(name: &str, from: usize, to: usize) -> String {
    if from == to {
        format!("{name}={from}")
    } else {
        format!("{name}>={from} & {name}<={to}")
    }
}
