"""A world for `elbowroom run --world-process "python3 clients/python/example_world.py"`: it runs at 20 times
the speed of the wall clock. Each action only sleeps, in place of a robot."""

from elbowroom_world import World

world = World("sleeper", speed=20)


@world.action("*")
def work(action):
    for part in range(10):
        action.feedback(part / 10)
        if not action.sleep((action.duration or 0) / 10):
            return  # it was cancelled


world.run()
