from glob import glob

from setuptools import setup

NAME = "elbowroom_ros"
SCRIPTS = ("executive", "action_world", "plansys2_world", "bag_to_trace")

setup(
    name=NAME,
    version="0.1.0",
    description="Executes temporal plans with ROS 2 action servers, under a guarantee",
    license="MIT OR Apache-2.0",
    packages=[NAME],
    # The library for worlds is a file of its own: clients/python/elbowroom_world.py.
    py_modules=["elbowroom_world"],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", glob("launch/*.py")),
        (f"share/{NAME}/config", glob("config/*")),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    entry_points={"console_scripts": [f"{it} = {NAME}.{it}:main" for it in SCRIPTS]},
)
