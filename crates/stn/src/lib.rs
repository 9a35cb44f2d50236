//! Elbowroom: temporal networks.
