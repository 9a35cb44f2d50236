//! Decides what to do next while a plan is executed, and says why. No clock, no I/O, no randomness.
