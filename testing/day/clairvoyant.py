"""A schedule of a shift with all tasks and durations known in advance, for comparison."""

import heapq
import random

import depot

SEARCHES = 1500


class Map:
    """Driving times of each robot on its day, without the deviations of single drives."""

    def __init__(self, truth, robots):
        self.times = {}
        for robot in robots:
            for start in [*depot.STATIONS, *depot.WAYS]:
                self.times[robot, start] = self.shortest(truth, robot, start)

    @staticmethod
    def shortest(truth, robot, start):
        found, waiting = {}, [(0.0, start)]
        while waiting:
            time, place = heapq.heappop(waiting)
            if place in found:
                continue
            found[place] = time
            for a, b in depot.roads():
                if a == place:
                    seconds = truth.mean("drive", [robot, a, b]) * truth.factor[robot]
                    heapq.heappush(waiting, (time + seconds, b))
        return found


def value_of(tasks, order, skipped, truth, robots, roads):
    """Value of the tasks that end in time if they are assigned in this order, each to the robot that ends it first."""
    free = {robot: (0.0, place) for robot, place in zip(robots, ["dock", "ward", "wash"])}
    totes = {number: (0.0, depot.STATIONS[number % 6]) for number in range(depot.TOTES)}
    value = 0.0
    for number in order:
        task = tasks[number]
        if number in skipped:
            continue
        best = None
        for robot, (since, place) in free.items():
            work = {name: truth.mean(name, [robot]) * truth.factor[robot] for name in depot.DURATIONS}
            # A clairvoyant robot is on its way before the task is released.
            if task.kind == "check":
                end = max(since + roads.times[robot, place][task.target], task.release) + work["check"]
            else:
                there, source = totes[task.tote]
                begin = max(since + roads.times[robot, place][source], there, task.release)
                end = begin + work["load"] + roads.times[robot, source][task.target] + work["unload"]
                end = task.release if source == task.target else end
            if best is None or end < best[0]:
                best = (end, robot)
        if best[0] <= task.deadline:
            value += task.value
            free[best[1]] = (max(best[0], free[best[1]][0]), task.target)
            if task.tote is not None:
                totes[task.tote] = (best[0], task.target)
    return value


def clairvoyant_value(tasks, truth, robots, seed=0):
    """Value of the best schedule that a local search finds. A better one may exist."""
    dice, roads = random.Random(seed), Map(truth, robots)
    can = [number for number, task in enumerate(tasks) if task.kind not in ("vault", "torn")]
    keys = {number: tasks[number].release for number in can}
    skipped, best = set(), -1.0
    for _ in range(SEARCHES):
        tried, left_out = dict(keys), set(skipped)
        for number in dice.sample(can, min(3, len(can))):
            tried[number] += dice.gauss(0, 200)
            left_out ^= {number} if dice.random() < 0.2 else set()
        value = value_of(tasks, sorted(can, key=tried.get), left_out, truth, robots, roads)
        if value >= best:
            best, keys, skipped = value, tried, left_out
    return best
