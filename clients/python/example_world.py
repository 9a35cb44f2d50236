"""A world for `elbowroom run --world-process "python3 clients/python/example_world.py"`: on the wall clock,
at ten times its speed. In place of a robot, each action sleeps."""

from elbowroom_world import World

world = World("sleeper", speed=10)


@world.action("*")
def work(action):
    action.sleep(action.duration or 0)  # ends early when the action is cancelled


world.run()
