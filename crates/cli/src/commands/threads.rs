//! `--jobs`: number of threads of the embedded planner.

use crate::exit::Failure;

/// Value of `jobs` that requests one thread per processor.
pub(super) const ALL_PROCESSORS: usize = 0;

/// Returns the requested number of threads, or else `usual`.
pub(super) fn thread_count(
    jobs: Option<usize>,
    usual: usize,
    is_embedded: bool,
) -> Result<usize, Failure> {
    if jobs.is_some() && !is_embedded {
        return Err(Failure::new(
            "--jobs applies only to the embedded planner",
            "leave out --jobs, or add the planner's own option to its command line",
        ));
    }
    Ok(match jobs.unwrap_or(usual) {
        ALL_PROCESSORS => std::thread::available_parallelism().map_or(1, usize::from),
        jobs => jobs,
    })
}
