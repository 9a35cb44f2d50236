//! Integration tests of probabilities, compared with enumerated and simulated worlds.

mod account;
mod best_order;
mod dispatch;
mod exact;
mod following;
mod likelihoods;
mod optimum;
mod partial_order;
mod pgmpy;
mod published;
mod shared;
mod twin;
mod untimed_worlds;
