//! Worlds with durations inside the intervals of a box.

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom::execute::AdversarialWorld;
use elbowroom::execution::PreparationResult;
use elbowroom::execution::run::TimeoutRule;
use elbowroom::model::Task;
use elbowroom::num::{End, Interval, Rational};
use elbowroom::plan::uncertain::PlanNetwork;
use elbowroom::plan::{DecoupledEnvelope, InstanceId, ParameterId, ParameterKind};
use elbowroom::sim::{ControlledWorld, FixedDurations, SimWorld, WorldModel};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::deviations::Lagging;

/// Distribution of the durations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Kind {
    /// Uniform in the interval.
    Uniform,
    /// One of the two ends of the interval.
    Corner,
    /// The worst values for the executor, chosen by the spoiler during the run.
    Spoiler,
    /// In the sixteenth of the interval around the nominal value, and one action starts late.
    Late,
    /// One duration is outside its interval; the others are as with one of the other kinds except
    /// the spoiler.
    Outside,
    /// As [`Self::Late`], but one observation is late instead of a start.
    LateLook,
}

impl Kind {
    pub(crate) const ALL: [Self; 6] = [
        Self::Uniform,
        Self::Corner,
        Self::Spoiler,
        Self::Late,
        Self::Outside,
        Self::LateLook,
    ];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Uniform => "uniform",
            Self::Corner => "corners",
            Self::Spoiler => "spoiler",
            Self::Late => "late start",
            Self::Outside => "one outside",
            Self::LateLook => "late check",
        }
    }
}

/// Action that starts later than commanded.
pub(crate) struct LateStart {
    pub(crate) action: String,
    model: WorldModel,
}

/// All worlds inside a box of a plan.
pub(crate) struct Worlds<'a> {
    task: Arc<Task>,
    model: WorldModel,
    prepared: &'a PreparationResult,
    envelope: &'a DecoupledEnvelope,
    /// Instances of each action, in the order of their planned starts, with the parameters of their
    /// durations.
    instances: BTreeMap<String, Vec<(InstanceId, Option<ParameterId>)>>,
    network: Option<PlanNetwork>,
}

impl<'a> Worlds<'a> {
    pub(crate) fn new(
        task: &Arc<Task>,
        prepared: &'a PreparationResult,
        envelope: &'a DecoupledEnvelope,
    ) -> Self {
        let plan = &prepared.plan.plan;
        let mut open: BTreeMap<InstanceId, ParameterId> = BTreeMap::new();
        for (index, parameter) in prepared.plan.parameters.iter().enumerate() {
            if let ParameterKind::Duration(instance) = parameter.kind {
                open.insert(instance, ParameterId::from(index));
            }
        }
        let mut order: Vec<InstanceId> = (0..plan.instances.len()).map(InstanceId::from).collect();
        order.sort_by_key(|id| (&prepared.nominal[plan.start(*id)], *id));
        let mut instances: BTreeMap<String, Vec<_>> = BTreeMap::new();
        for id in order {
            let name = plan.instance(id).action.name.clone();
            let list = instances.entry(name).or_default();
            list.push((id, open.get(&id).copied()));
        }
        Self {
            task: Arc::clone(task),
            model: WorldModel::without_deviations(),
            network: prepared.plan.uncertain_network(envelope).ok(),
            prepared,
            envelope,
            instances,
        }
    }

    fn sim(&self) -> SimWorld<'_> {
        SimWorld::new(Arc::clone(&self.task), &self.model, 0)
    }

    /// World whose durations are drawn with this seed, none of them beyond its time-out.
    pub(crate) fn drawn(
        &self,
        kind: Kind,
        seed: u64,
        timeout: &TimeoutRule,
    ) -> ControlledWorld<'_, FixedDurations> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        ControlledWorld::new(self.sim(), self.durations(kind, &mut rng, timeout))
    }

    /// Draws a late start of an action that occurs once in the plan.
    pub(crate) fn late_start(&self, seed: u64) -> Option<LateStart> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let single = self.instances.iter().filter(|(_, all)| all.len() == 1);
        let names: Vec<&String> = single.map(|(name, _)| name).collect();
        let action = *names.get(rng.random_range(0..names.len().max(1)))?;
        let times = self.prepared.plan.plan.nodes();
        let whole = times.map(|(node, _)| &self.prepared.nominal[node]).max()?;
        let late = whole * Rational::new(rng.random_range(1..=200), 1000);
        let late = late.max(Rational::new(1, 100)).to_decimal(3);
        let text = format!(
            "format = \"elbowroom-world\"\nversion = 1\n\
             [[delay]]\naction = \"{action}\"\nconstant = {late}\n"
        );
        let model = WorldModel::read(&text, self.task.problem()).expect("a world file");
        let action = action.clone();
        Some(LateStart { action, model })
    }

    /// Returns a world with that late start; durations are drawn with this seed.
    pub(crate) fn late<'b>(
        &self,
        late: &'b LateStart,
        seed: u64,
    ) -> ControlledWorld<'b, FixedDurations> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let world = SimWorld::new(Arc::clone(&self.task), &late.model, 0);
        ControlledWorld::new(
            world,
            self.durations(Kind::Late, &mut rng, &TimeoutRule::Off),
        )
    }

    /// Returns a world with one duration outside its interval and the others of that kind, and the
    /// action with that duration. `None` if no duration can be outside.
    pub(crate) fn outside(
        &self,
        kind: Kind,
        seed: u64,
    ) -> Option<(ControlledWorld<'_, FixedDurations>, InstanceId)> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let all = self.instances.values().flatten();
        let open = all.filter_map(|(id, parameter)| Some((*id, (*parameter)?)));
        let mut strays: Vec<(InstanceId, Rational)> = Vec::new();
        for (id, parameter) in open {
            let interval = self.envelope.interval(parameter);
            let share = Rational::new(rng.random_range(0..1000_i64), 1000);
            // Two instances of an action with a duration of 0 could interfere with each other.
            let least = self.task.epsilon();
            if let Some(lower) = interval.lower.value().filter(|lower| *lower > least) {
                strays.push((id, least + (lower - least) * &share));
            }
            if let Some(upper) = interval.upper.value() {
                let nominal = &self.prepared.plan.parameter(parameter).nominal;
                let times = Rational::from(if rng.random_bool(0.2) { 20 } else { 1 });
                let more = (nominal * share * times).max(Rational::new(1, 1000));
                strays.push((id, upper + more));
            }
        }
        if strays.is_empty() {
            return None;
        }
        let stray = strays.swap_remove(rng.random_range(0..strays.len()));
        let durations = self.durations_but(kind, &mut rng, &TimeoutRule::Off, Some(&stray));
        Some((ControlledWorld::new(self.sim(), durations), stray.0))
    }

    /// Returns the world with one late observation, and the number of that observation. Durations
    /// are drawn with this seed.
    pub(crate) fn late_look(
        &self,
        seed: u64,
    ) -> (Lagging<ControlledWorld<'_, FixedDurations>>, u64) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let plan = &self.prepared.plan.plan;
        let looks = rng.random_range(0..=2 * plan.nodes.len() as u64);
        let times = plan.nodes().map(|(node, _)| &self.prepared.nominal[node]);
        let whole = times.max().cloned().unwrap_or_default();
        let lag = whole * Rational::new(rng.random_range(1..=200), 1000);
        let inner = ControlledWorld::new(
            self.sim(),
            self.durations(Kind::Late, &mut rng, &TimeoutRule::Off),
        );
        (Lagging { inner, looks, lag }, looks)
    }

    fn durations(&self, kind: Kind, rng: &mut ChaCha8Rng, timeout: &TimeoutRule) -> FixedDurations {
        self.durations_but(kind, rng, timeout, None)
    }

    /// Draws the durations, except `stray`, which may be outside its interval.
    fn durations_but(
        &self,
        kind: Kind,
        rng: &mut ChaCha8Rng,
        timeout: &TimeoutRule,
        stray: Option<&(InstanceId, Rational)>,
    ) -> FixedDurations {
        let stray = |id: InstanceId| stray.filter(|(own, _)| *own == id);
        let mut durations = BTreeMap::new();
        for (name, instances) in &self.instances {
            let values = instances.iter().map(|(id, parameter)| {
                if let Some((_, value)) = stray(*id) {
                    return value.clone();
                }
                match parameter {
                    Some(parameter) => drawn(
                        self.envelope.interval(*parameter),
                        &self.prepared.plan.parameter(*parameter).nominal,
                        kind,
                        timeout.of(name, &self.prepared.plan.parameter(*parameter).nominal),
                        rng,
                    ),
                    None => self.nominal(*id),
                }
            });
            durations.insert(name.clone(), values.collect());
        }
        FixedDurations::new(durations)
    }

    fn nominal(&self, id: InstanceId) -> Rational {
        let plan = &self.prepared.plan.plan;
        let time = |node: elbowroom::plan::NodeId| &self.prepared.nominal[node];
        time(plan.end(id)) - time(plan.start(id))
    }

    /// Returns a world with durations chosen by the spoiler within the box.
    pub(crate) fn spoiled(
        &self,
        timeout: &TimeoutRule,
    ) -> Option<ControlledWorld<'_, AdversarialWorld>> {
        let network = self.network.as_ref()?;
        let plan = &self.prepared.plan.plan;
        let spoiling = AdversarialWorld::new(plan, network, &self.prepared.nominal, timeout);
        Some(ControlledWorld::new(self.sim(), spoiling))
    }
}

/// Draws a value in an interval, up to the time-out of the action. If the interval is infinite, the
/// maximum is three times the nominal value, and in three runs of ten the time-out, or a thousand
/// times the nominal value if time-outs are off.
fn drawn(
    interval: &Interval,
    nominal: &Rational,
    kind: Kind,
    timeout: Option<Rational>,
    rng: &mut ChaCha8Rng,
) -> Rational {
    let thousandth = Rational::new(1, 1000);
    let lower = match &interval.lower {
        End::Closed(value) => value.clone(),
        End::Open(value) => value + &thousandth,
        End::Infinite => Rational::ZERO,
    };
    let upper = match &interval.upper {
        End::Closed(value) => value.clone(),
        End::Open(value) => value - &thousandth,
        End::Infinite => {
            let is_far = rng.random_bool(0.3);
            let least = nominal.max(&Rational::ONE).max(&lower).clone();
            match &timeout {
                Some(timeout) if is_far => timeout.clone(),
                None if is_far => least * Rational::from(1000),
                _ => least * Rational::from(3),
            }
        }
    };
    let upper = match timeout {
        Some(timeout) => upper.min(timeout),
        None => upper,
    };
    if kind == Kind::Corner {
        return if rng.random_bool(0.5) { lower } else { upper };
    }
    let share = Rational::new(rng.random_range(0..=1000_i64), 1000);
    let value = &lower + (&upper - &lower) * share;
    if kind == Kind::Late {
        // In an infinite interval, at most twice the nominal value.
        let value = nominal + (value - nominal) / Rational::from(16);
        return value.min(nominal * Rational::from(2));
    }
    // Rounded to three decimals if the interval permits.
    let rounded = (value * Rational::from(1000)).floor() * thousandth;
    rounded.max(lower)
}
