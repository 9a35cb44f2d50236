//! Kinds of plans that are cases as well. Their problem files explain the boxes.

use super::Kind;

macro_rules! case {
    ($file:literal) => {
        include_str!(concat!("../../../../../cases/", $file))
    };
}

pub(crate) const LAMP: Kind = Kind {
    name: "an end that needs the light of a lamp",
    domain: case!("lamp/domain.pddl"),
    problem: case!("lamp/problem.pddl"),
    plan: case!("lamp/plan.plan"),
    inside: &["dur_0=[0,100],dur_1=[0.002,6]"],
    outside: &["dur_1=[0.001,6]"],
    dynamic: &["dur_0=[8.75,11.25]", "dur_0=[7.502,12.5]"],
    not_dynamic: &["dur_0=[7.501,12.5]"],
};

pub(crate) const HATCHERY: Kind = Kind {
    name: "an end that must fall into another action",
    domain: case!("hatchery/domain.pddl"),
    problem: case!("hatchery/problem.pddl"),
    plan: case!("hatchery/plan.plan"),
    inside: &["dur_0=[0,100],dur_1=[0.002,6]"],
    outside: &["dur_1=[0.001,6]"],
    dynamic: &["dur_0=[7.501,12.499]", "dur_0=[8,13],dur_1=[5.002,9]"],
    not_dynamic: &["dur_0=[7.5,12.499]", "dur_0=[8,13],dur_1=[5.001,9]"],
};

pub(crate) const PAINTSHOP: Kind = Kind {
    name: "an end that must not come before a start",
    domain: case!("paintshop/domain.pddl"),
    problem: case!("paintshop/problem.pddl"),
    plan: case!("paintshop/plan.plan"),
    inside: &["dur_0=[0,100],dur_1=[0,100],dur_2=[0,100]"],
    outside: &[],
    dynamic: &[
        "dur_0=[6,24],dur_1=[5,20],dur_2=[2,8]",
        "dur_0=[0,100],dur_1=[0,100],dur_2=[0,100]",
    ],
    not_dynamic: &[],
};
