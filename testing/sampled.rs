//! The share of their inputs that long tests examine.

/// Returns `n`: such a test examines one input in `n`, or has an `n`-th of its random inputs. With
/// `ELBOWROOM_ALL_INPUTS`, it is 1, and all are examined (`.ci/nightly`).
pub(crate) fn one_in<N: From<u8>>(n: u8) -> N {
    let is_all = std::env::var_os("ELBOWROOM_ALL_INPUTS").is_some();
    N::from(if is_all { 1 } else { n })
}
