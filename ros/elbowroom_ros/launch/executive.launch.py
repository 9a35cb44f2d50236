"""Starts the executive. `ros2 launch elbowroom_ros executive.launch.py --show-args` lists the arguments."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

PARAMETERS = {
    "domain": ("", str, "The domain, a PDDL file"),
    "problem": ("", str, "The problem, a PDDL file"),
    "plan": ("", str, "The plan to begin with, in place of one by the planner"),
    "mapping": ("", str, "The action servers for the actions of the domain, a YAML file"),
    "world": ("", str, "In place of a mapping: the command of a world, such as elbowroom-plansys2"),
    "executor": ("live", str, "The executor"),
    "journal": ("", str, "File with which the executive resumes after a crash"),
    "use_sim_time": ("false", bool, "Use the time of /clock"),
    "shared": ("false", bool, "Allow other executives to use the same action servers"),
    "restarts": ("5", int, "Number of restarts after failures"),
    "http": ("127.0.0.1:0", str, "Address of the HTTP interface"),
    "elbowroom": ("elbowroom", str, "Path of the command elbowroom"),
    "address": ("", str, "In place of a domain: HOST:PORT or socket of a running elbowroom serve"),
    "token": ("", str, "File with the token for that executive"),
}


def generate_launch_description():
    declared = [DeclareLaunchArgument("namespace", default_value="", description="Namespace of the node")]
    parameters = {}
    for name, (value, kind, text) in PARAMETERS.items():
        declared.append(DeclareLaunchArgument(name, default_value=value, description=text))
        parameters[name] = ParameterValue(LaunchConfiguration(name), value_type=kind)
    node = Node(
        package="elbowroom_ros",
        executable="executive",
        namespace=LaunchConfiguration("namespace"),
        parameters=[parameters],
        output="screen",
        # Running actions are cancelled, and have five seconds to stop.
        sigterm_timeout="10",
    )
    return LaunchDescription([*declared, node])
