//! Elbowroom: PDDL and plan text to the model and back.
