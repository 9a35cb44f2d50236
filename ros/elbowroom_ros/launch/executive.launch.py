"""Starts the executive. `ros2 launch elbowroom_ros executive.launch.py --show-args` lists the arguments."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

TEXTS = {
    "domain": ("", "The domain, a PDDL file"),
    "problem": ("", "The problem, a PDDL file"),
    "mapping": ("", "The action servers for the actions of the domain, a YAML file"),
    "world": ("", "In place of a mapping: the command of a world, such as elbowroom-plansys2"),
    "executor": ("live", "The executor"),
    "journal": ("", "File with which the executive resumes after a crash"),
    "elbowroom": ("elbowroom", "Path of the command elbowroom"),
    "address": ("", "In place of a domain: HOST:PORT or socket of a running elbowroom serve"),
    "token": ("", "File with the token for that executive"),
}


def generate_launch_description():
    arguments = {**TEXTS, "use_sim_time": ("false", "Use the time of /clock"), "namespace": ("", "Namespace of the node")}
    parameters = {name: ParameterValue(LaunchConfiguration(name), value_type=str) for name in TEXTS}
    parameters["use_sim_time"] = ParameterValue(LaunchConfiguration("use_sim_time"), value_type=bool)
    node = Node(
        package="elbowroom_ros",
        executable="executive",
        namespace=LaunchConfiguration("namespace"),
        parameters=[parameters],
        output="screen",
        # Running actions are cancelled, and have five seconds to stop.
        sigterm_timeout="10",
    )
    declared = [DeclareLaunchArgument(name, default_value=value, description=text) for name, (value, text) in arguments.items()]
    return LaunchDescription([*declared, node])
