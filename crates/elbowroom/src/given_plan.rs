//! Plans with constraints, in the form of the checker of certificates: [`given_plan`].

use elbowroom_num::End;
use elbowroom_plan::{Bound, ParametrizedPlan, Reason};
use elbowroom_verify::{Exact, GivenConstraint, GivenInstance, GivenParameter, GivenPlan, Limit};

/// Returns the instances, the constraints and the parameters of an STN plan file, as written. The
/// checker derives everything else from them.
pub fn given_plan(plan: &ParametrizedPlan) -> GivenPlan {
    let limit = |bound: &Bound| match bound {
        Bound::Infinite => Limit::None,
        Bound::Finite(value) => Limit::Number(Exact(value.clone())),
        Bound::Parameter(id) => Limit::Parameter(id.index()),
    };
    let given = plan.plan.constraints.iter();
    let given = given.filter(|own| own.reason == Reason::Given);
    GivenPlan {
        instances: plan
            .plan
            .instances
            .iter()
            .map(|own| GivenInstance {
                label: own.label.clone(),
                schema: own.action.schema,
                arguments: own.action.arguments.clone(),
            })
            .collect(),
        constraints: given
            .map(|own| GivenConstraint {
                from: own.from.index(),
                to: own.to.index(),
                lower: limit(&own.lower),
                upper: limit(&own.upper),
            })
            .collect(),
        parameters: plan
            .parameters
            .iter()
            .map(|own| GivenParameter {
                name: own.name.clone(),
                nominal: own.nominal.clone(),
                weight: own.weight.clone(),
                range: [&own.range.lower, &own.range.upper].map(|end: &End| end.value().cloned()),
            })
            .collect(),
    }
}
