//! Elbowroom: which deviations a plan survives.
