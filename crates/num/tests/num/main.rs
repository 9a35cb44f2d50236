//! Integration tests of numbers: chances and normal distributions.

mod chance;
mod normal;
