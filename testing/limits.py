"""Distribution of the time by which `elbowroom plan` exceeds a time limit, on many problems.

    python3 testing/limits.py target/release/elbowroom FOLDER… [--limit 1] [--only TEXT]… [-o FILE.csv]

plans sequentially for each problem in the `manifest.csv` of a folder. Its first line names the columns: `domain`,
`instance`, `domain_file`, `problem_file`, and optionally `collection`. `--only` selects the lines that contain one of the
texts. Each run adds a line: domain, instance, exit code, wall-clock seconds, processor seconds. At the end the distribution
of the excess times is printed. Lines are appended to an existing file. Standard library only.
"""

import argparse
import csv
import pathlib
import resource
import subprocess
import time


def problems(folders, only):
    """Domain, instance, and the two files."""
    for folder in map(pathlib.Path, folders):
        with open(folder / "manifest.csv", encoding="utf-8") as manifest:
            for row in csv.DictReader(manifest):
                if only and not any(text in ",".join(row.values()) for text in only):
                    continue
                domain = f"{row.get('collection', folder.name)}/{row['domain']}"
                files = [folder / row["domain_file"], folder / row["problem_file"]]
                yield domain, row["instance"], [str(file) for file in files]


def measured(command):
    """Exit code, wall-clock seconds, processor seconds."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    begun = time.monotonic()
    code = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False).returncode
    wall = time.monotonic() - begun
    now = resource.getrusage(resource.RUSAGE_CHILDREN)
    return code, wall, now.ru_utime + now.ru_stime - used.ru_utime - used.ru_stime


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("folders", nargs="+")
    parser.add_argument("--limit", type=float, default=1.0)
    parser.add_argument("--only", action="append", default=[])
    parser.add_argument("-o", "--output", type=pathlib.Path)
    arguments = parser.parse_args()
    lines = []
    if arguments.output and arguments.output.exists():
        lines = [line.split(",") for line in arguments.output.read_text(encoding="utf-8").splitlines()]
    done = {(line[0], line[1]) for line in lines}
    for domain, instance, files in problems(arguments.folders, arguments.only):
        if (domain, instance) in done:
            continue
        code, wall, cpu = measured([arguments.program, "plan", *files, "--time-limit", str(arguments.limit)])
        lines.append([domain, instance, str(code), f"{wall:.3f}", f"{cpu:.3f}"])
        if arguments.output:
            with open(arguments.output, "a", encoding="utf-8") as output:
                output.write(",".join(lines[-1]) + "\n")
    over = sorted((max(0.0, float(line[3]) - arguments.limit), line) for line in lines)
    if not over:
        print("no problems")
        return
    for share in (0.5, 0.9, 0.99, 1.0):
        index = min(len(over) - 1, int(share * len(over)))
        print(f"{share:.0%} of {len(over)} runs overshoot by {over[index][0]:.3f} s at most")
    for seconds, line in over[-10:][::-1]:
        print(f"{seconds:.3f} s: {' '.join(line[:2])}, exit code {line[2]}, {line[4]} s of the processor")


if __name__ == "__main__":
    main()
