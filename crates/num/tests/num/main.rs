//! Integration tests of numbers: chances and normal distributions.

mod interval_probabilities;
mod normal;
