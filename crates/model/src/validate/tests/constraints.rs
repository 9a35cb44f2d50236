//! Trajectory constraints, and preferences.

#![allow(
    clippy::format_collect,
    clippy::format_push_string,
    reason = "the tests put texts together, and know what is in them"
)]

use elbowroom_num::Rational;

use super::world::World;

/// Truth values of `(p)` and `(q)` from a time on.
type State = (Rational, [bool; 2]);

/// Returns `true` if a sequence of states satisfies a constraint, by the literal definition of
/// Gerevini & Long.
fn is_satisfied(states: &[State], name: &str, times: &[i64]) -> bool {
    let n = states.len();
    let time = |i: usize| states[i].0.clone();
    let after = |i: usize, wait: i64| states[i].0.clone() + Rational::from(wait);
    let p = |i: usize| states[i].1[0];
    let q = |i: usize| states[i].1[1];
    let limit = |k: usize| Rational::from(times[k]);
    let mut all = 0..n;
    match name {
        "at end" => p(n - 1),
        "always" => all.all(p),
        "sometime" => all.any(p),
        "within" => all.any(|i| p(i) && time(i) <= limit(0)),
        "at-most-once" => {
            all.all(|i| !p(i) || (i..n).any(|j| (i..=j).all(p) && (j + 1..n).all(|k| !p(k))))
        }
        "sometime-after" => all.all(|i| !p(i) || (i..n).any(q)),
        "sometime-before" => all.all(|i| !p(i) || (0..i).any(q)),
        "always-within" => {
            all.all(|i| !p(i) || (i..n).any(|j| q(j) && time(j) <= after(i, times[0])))
        }
        "hold-during" | "hold-after" => {
            let is_in = |t: &Rational| *t >= limit(0) && (times.len() < 2 || *t < limit(1));
            let is_under_way =
                |i: usize| time(i) <= limit(0) && (i + 1 == n || limit(0) < time(i + 1));
            all.all(|i| p(i) || !is_in(&time(i)) && !is_under_way(i))
        }
        other => panic!("{other}"),
    }
}

/// Pseudorandom numbers.
struct Rng(u64);

impl Rng {
    fn below(&mut self, limit: u64) -> u64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (self.0 >> 33) % limit
    }
}

#[test]
fn validator_agrees_with_definition_on_random_trajectories() {
    let forms = [
        ("at end", 0, 1),
        ("always", 0, 1),
        ("sometime", 0, 1),
        ("within", 1, 1),
        ("at-most-once", 0, 1),
        ("sometime-after", 0, 2),
        ("sometime-before", 0, 2),
        ("always-within", 1, 2),
        ("hold-during", 2, 1),
        ("hold-after", 1, 1),
    ];
    let mut dice = Rng(1);
    let mut kept = [0; 10];
    for round in 0..2000 {
        let kind = round % forms.len();
        let (name, times, conditions) = forms[kind];
        let begin = i64::try_from(dice.below(5)).unwrap();
        let numbers = [begin, begin + 1 + i64::try_from(dice.below(4)).unwrap()];
        let numbers = &numbers[..times];
        let initial = [dice.below(2) == 1, dice.below(2) == 1];
        let mut states = vec![(Rational::ZERO, initial)];
        let mut plan = String::new();
        for time in 1..=6 {
            let mut now = states.last().unwrap().1;
            match dice.below(6) {
                0 => now[0] = true,
                1 => now[0] = false,
                2 => now[1] = true,
                3 => now[1] = false,
                4 => now = [!now[0], !now[1]],
                _ => continue,
            }
            let word = |truth, name| if truth { name } else { "not" };
            plan += &format!(
                "{time}: {}-p-{}-q\n",
                word(now[0], "is"),
                word(now[1], "is")
            );
            states.push((Rational::from(time), now));
        }
        let mut facts = String::new();
        for (is_true, fact) in initial.into_iter().zip(["(p) ", "(q) "]) {
            if is_true {
                facts += fact;
            }
        }
        let shown: String = numbers.iter().map(|number| format!(" {number}")).collect();
        let conditions = &["(p)", "(q)"][..conditions];
        let text = format!("({name}{shown} {})", conditions.join(" "));
        let world = World::new(&facts)
            .instant("is-p-is-q", "", "(p) (q)")
            .instant("is-p-not-q", "", "(p) (not (q))")
            .instant("not-p-is-q", "", "(not (p)) (q)")
            .instant("not-p-not-q", "", "(not (p)) (not (q))")
            .constraint(&text);
        let expected = is_satisfied(&states, name, numbers);
        let verdict = world.judge(&plan);
        assert_eq!(
            verdict == "valid",
            expected,
            "{facts}{text}\n{plan}{verdict}"
        );
        assert!(expected || verdict.contains("is violated"), "{verdict}");
        kept[kind] += usize::from(expected);
    }
    assert!(kept.iter().all(|&kept| kept > 0 && kept < 200), "{kept:?}");
}

/// Returns a world with a tank that is filled from 0 to 10, by 1 per unit of time.
fn tank() -> World {
    World::new("(= level 0)").durative("fill", &[("duration", "(= 10)"), ("rate", "level 1")])
}

#[test]
fn continuously_changing_numbers_are_checked_between_happenings() {
    let judge = |text: &str| tank().constraint(text).judge("1: fill [10]");
    assert_eq!(judge("(within 4 (>= level 3))"), "valid");
    assert_eq!(
        judge("(within 3.9 (>= level 3))"),
        "at 3.900: the constraint (within 3.9 (>= level 3)) is violated: \
         (>= level 3) does not hold until 3.9"
            .replace("level", "(level)")
    );
    // The condition becomes true only right after 4.
    assert_ne!(judge("(within 4 (> level 3))"), "valid");
    assert_eq!(judge("(within 4.001 (> level 3))"), "valid");
    assert_eq!(judge("(at-most-once (= level 5))"), "valid");
    assert_eq!(judge("(sometime-before (> level 5) (= level 5))"), "valid");
    assert_eq!(
        judge("(always-within 2 (= level 5) (> level 6.9))"),
        "valid"
    );
    assert_ne!(judge("(always-within 2 (= level 5) (> level 7))"), "valid");
    assert_eq!(judge("(always-within 2 (= level 5) (>= level 7))"), "valid");
    assert_eq!(judge("(hold-during 0 6 (<= level 5))"), "valid");
    assert_eq!(
        judge("(hold-during 0 6.5 (<= level 5))"),
        "just after 6.000: the constraint (hold-during 0 6.5 (<= (level) 5)) is violated: \
         (<= (level) 5) does not hold"
    );
}

#[test]
fn irrational_times_are_compared_within_known_precision() {
    let world = |text: &str| {
        let fall = [("duration", "(= 10)"), ("rate", "speed 1 level speed")];
        World::new("(= level 0) (= speed 0)")
            .durative("fall", &fall)
            .constraint(text)
            .judge("0: fall [10]")
    };
    // The level is 1 at the square root of 2, 1.41421356….
    assert_eq!(world("(within 1.41422 (>= level 1))"), "valid");
    assert!(world("(within 1.41421 (>= level 1))").contains("is violated"));
    assert!(world("(within 1.4142135 (>= level 1))").starts_with("undecided"));
}

#[test]
fn constraint_includes_the_initial_state() {
    let world = |text: &str| {
        World::new("(p)")
            .instant("end", "", "(not (p))")
            .constraint(text)
            .judge("0: end")
    };
    assert!(world("(always (not (p)))").contains("at 0.000"));
    assert_eq!(world("(within 0 (p))"), "valid");
    assert_eq!(world("(hold-after 0 (not (p)))"), "valid");
}

#[test]
fn violated_preferences_leave_plan_valid() {
    let world = World::new("")
        .instant("do", "", "(p)")
        .prefer("never", "(always (not (p)))")
        .prefer("some", "(sometime (p))")
        .prefer("number", "(at end (> x 1))");
    let report = world.report("1: do");
    let violated = &report.preferences.violated;
    let said: Vec<_> = violated.iter().map(|one| one.preference.index()).collect();
    // A preference that reads a number without a value does not hold.
    assert_eq!(said, [0, 2]);
    assert!(report.preferences.undecided.is_empty());
}

#[test]
fn constraint_on_past_states_is_undecided() {
    let world = World::new("")
        .instant("do", "", "(p)")
        .constraint("(always (not (q)))");
    let (task, plan) = world.task_and_plan("3: do");
    let mut situation = crate::Situation::initial(&task);
    let judge = |situation: &crate::Situation| {
        crate::validate_from(&task, situation, &plan, &world.settings)
    };
    assert!(judge(&situation).is_valid());
    situation.time = 2.into();
    assert!(matches!(judge(&situation), crate::Verdict::Undecided(_)));
    let rest = situation.remaining_task(&task);
    let verdict = crate::validate(&rest, &plan, &world.settings);
    assert!(matches!(verdict, crate::Verdict::Undecided(_)));
}
