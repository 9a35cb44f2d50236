//! Elbowroom.
