"""Processor time and memory of `elbowroom network`, by the size of the network.

    python3 testing/network_sizes.py PROGRAM [--stn 10000,100000,1000000] [--lanes 1000,2000,4000,10000]

An STN has about 3 bounds per point, in lanes with random bounds between them. Lanes with contingent links are tasks in
a row, half of them contingent, with a bound to the same task of the lane before. All networks are controllable.
Standard library only.
"""

import argparse
import json
import math
import os
import pathlib
import random
import tempfile


def bound(begin, end, lower, upper):
    return {"from": begin, "to": end, "lower": lower, "upper": upper}


def document(points, requirements, links):
    return {
        "format": "elbowroom-network",
        "version": 1,
        "points": points,
        "requirements": requirements,
        "links": links,
    }


def stn(count):
    """`count` points in lanes, with a bound to a random earlier point for every other point."""
    dice = random.Random(1)
    lanes = math.isqrt(count)
    points = [f"p{it}" for it in range(count)]
    times, requirements = [0], []
    for it in range(1, count):
        before = max(0, it - lanes)
        step = dice.randint(1, 20)
        times.append(times[before] + step)
        lower = max(0, step - dice.randint(0, 5))
        requirements.append(bound(points[before], points[it], lower, step + dice.randint(0, 5)))
        if it > 1 and dice.random() < 0.5:
            other = dice.randint(max(1, it - 2 * lanes), it - 1)
            distance = times[it] - times[other]
            lower = distance - dice.randint(5, 40)
            requirements.append(bound(points[other], points[it], lower, distance + dice.randint(5, 40)))
    return document(points, requirements, [])


def lanes(count):
    """About `count` points: lanes of 20 tasks; a quarter as many links as points."""
    dice = random.Random(2)
    tasks = 20
    points, requirements, links = ["start"], [], []
    for lane in range(max(1, count // (2 * tasks))):
        before, total = "start", 0
        for task in range(tasks):
            begin, end = f"b{lane}.{task}", f"e{lane}.{task}"
            points += [begin, end]
            shortest = dice.randint(3, 14)
            longest = shortest + dice.randint(1, 4)
            requirements.append(bound(before, begin, 0, 60))
            if (lane + task) % 2 == 0:
                links.append({"activation": begin, "end": end, "lower": shortest, "upper": longest})
            else:
                requirements.append(bound(begin, end, shortest, longest))
            if lane > 0:
                requirements.append(bound(f"e{lane - 1}.{task}", begin, -100, 100))
            before, total = end, total + longest
        requirements.append(bound("start", before, 0, total + 200))
    return document(points, requirements, links)


def write(make, size, file):
    """Writes a network. A process of its own does it: the memory of this one would count as that of the program."""
    child = os.fork()
    if child == 0:
        file.write_text(json.dumps(make(size)))
        os._exit(0)
    os.waitpid(child, 0)


def measured(program, file):
    """Returns the CPU seconds, the megabytes and the answer of one call."""
    answer = file.with_suffix(".answer")
    out = (os.POSIX_SPAWN_OPEN, 1, str(answer), os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    child = os.posix_spawn(program, [program, "network", "--json", str(file)], os.environ, file_actions=[out])
    _, status, usage = os.wait4(child, 0)
    if status != 0:
        raise SystemExit(f"{program} network: status {status}")
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1000, json.loads(answer.read_text())


def main():
    sizes = lambda text: [int(it) for it in text.split(",") if it]
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program")
    parser.add_argument("--stn", type=sizes, default=sizes("1000,10000,100000,1000000"))
    parser.add_argument("--lanes", type=sizes, default=sizes("1000,2000,4000,10000"))
    options = parser.parse_args()
    print("| network | points | links | CPU s | MB | exponent |\n|---|--:|--:|--:|--:|--:|")
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder, "network.json")
        for name, make, wanted in (("STN", stn, options.stn), ("lanes", lanes, options.lanes)):
            last = None
            for size in wanted:
                write(make, size, file)
                seconds, megabytes, answer = measured(options.program, file)
                points, links = answer["points"], answer["links"]
                growth = last and math.log(seconds / last[1]) / math.log(points / last[0])
                exponent = f"{growth:.1f}" if last else ""
                print(f"| {name} | {points} | {links} | {seconds:.2f} | {megabytes:.0f} | {exponent} |", flush=True)
                last = (points, max(seconds, 0.005))


main()
