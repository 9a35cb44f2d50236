//! Seeded worlds to execute plans in.
