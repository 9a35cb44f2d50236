"""Computes one part of an experiment, in a job of Slurm. ``job.sh`` calls it."""

import sys

from .campaign import make_part

if __name__ == "__main__":
    make_part(sys.argv[1:])
