//! Deliveries of any size: the robot of `cases/delivery` fetches one parcel after the other.

use std::fmt::Write as _;

/// Domain of `cases/delivery`.
pub(crate) const DOMAIN: &str = include_str!("../../../../../cases/delivery/domain.pddl");

/// Durations of the four actions of a round: to the shelf, pick, to the office, drop.
const ROUND: [i64; 4] = [15, 2, 15, 3];

/// Returns a problem with this number of parcels, and a plan for it with `4 · parcels + 1` actions.
///
/// The robot begins at the office. Rounds take 35 each, without the separations of ε between
/// actions. The office closes after twice the total time.
pub(crate) fn rounds(parcels: usize) -> (String, String) {
    let round: i64 = ROUND.iter().sum();
    let closes = 2 * round * i64::try_from(parcels).expect("few parcels");
    let (mut objects, mut init, mut goal) = (String::new(), String::new(), String::new());
    let mut plan = "0.000: (unlock office) [6.000]\n".to_owned();
    // In thousandths, like ε.
    let mut now = 0;
    for parcel in 0..parcels {
        write!(objects, "parcel{parcel} ").expect("memory");
        write!(init, "(lies parcel{parcel} shelf) ").expect("memory");
        write!(goal, "(lies parcel{parcel} office) ").expect("memory");
        let actions = [
            "drive rover office shelf".to_owned(),
            format!("pick rover parcel{parcel} shelf"),
            "drive rover shelf office".to_owned(),
            format!("drop rover parcel{parcel} office"),
        ];
        for (action, duration) in actions.iter().zip(ROUND) {
            let (whole, part) = (now / 1000, now % 1000);
            writeln!(plan, "{whole}.{part:03}: ({action}) [{duration}.000]").expect("memory");
            now += 1000 * duration + 1;
        }
    }
    let problem = format!(
        "(define (problem rounds) (:domain delivery)
           (:objects rover - robot shelf office - place {objects}- parcel)
           (:init (at rover office) (idle rover) (counter-open office) {init}
                  (at {closes} (not (counter-open office)))
                  (= (drive-time office shelf) 15) (= (drive-time shelf office) 15))
           (:goal (and {goal})))"
    );
    (problem, plan)
}
