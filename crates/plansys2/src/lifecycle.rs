//! Lifecycle of the planner and the executor as managed nodes.

use crate::interface::Named;

/// State of a managed node. It serves from the beginning, for systems without a lifecycle manager.
/// After its first transition, it serves only while it is active.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lifecycle {
    state: State,
    is_managed: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Unconfigured,
    Inactive,
    Active,
    Finalized,
}

/// Transitions: source, number, name, target.
const TRANSITIONS: [(State, u8, &str, State); 7] = [
    (State::Unconfigured, 1, "configure", State::Inactive),
    (State::Inactive, 2, "cleanup", State::Unconfigured),
    (State::Inactive, 3, "activate", State::Active),
    (State::Active, 4, "deactivate", State::Inactive),
    (State::Unconfigured, 5, "shutdown", State::Finalized),
    (State::Inactive, 6, "shutdown", State::Finalized),
    (State::Active, 7, "shutdown", State::Finalized),
];

impl Default for Lifecycle {
    fn default() -> Self {
        Self {
            state: State::Unconfigured,
            is_managed: false,
        }
    }
}

impl Lifecycle {
    /// Returns the state, as in `lifecycle_msgs/msg/State`.
    pub fn state(&self) -> Named {
        let (id, label) = match self.state {
            State::Unconfigured => (1, "unconfigured"),
            State::Inactive => (2, "inactive"),
            State::Active => (3, "active"),
            State::Finalized => (4, "finalized"),
        };
        let label = label.to_owned();
        Named { id, label }
    }

    /// Makes a transition of `lifecycle_msgs/msg/Transition`. Returns `false` if the state does not
    /// have it.
    pub fn change(&mut self, transition: &Named) -> bool {
        let found = TRANSITIONS.iter().find(|(from, id, label, _)| {
            *from == self.state
                && (transition.id == *id || (transition.id == 0 && transition.label == *label))
        });
        let Some(&(_, _, _, next)) = found else {
            return false;
        };
        self.state = next;
        self.is_managed = true;
        true
    }

    /// Returns `true` if the node serves requests.
    pub fn serves(&self) -> bool {
        !self.is_managed || self.state == State::Active
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn change(lifecycle: &mut Lifecycle, id: u8, label: &str) -> bool {
        let label = label.to_owned();
        lifecycle.change(&Named { id, label })
    }

    #[test]
    fn managed_node_serves_only_while_active() {
        let mut node = Lifecycle::default();
        assert!(node.serves());
        assert!(!change(&mut node, 3, ""), "not from unconfigured");
        assert!(node.serves());
        assert!(change(&mut node, 1, ""));
        assert!(!node.serves());
        assert!(change(&mut node, 0, "activate"));
        assert_eq!(
            (node.state().id, node.state().label.as_str()),
            (3, "active")
        );
        assert!(node.serves());
        assert!(change(&mut node, 7, "") && !node.serves());
        assert!(!change(&mut node, 1, ""), "it is final");
    }
}
