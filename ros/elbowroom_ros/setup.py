import os
import shutil
from glob import glob

from setuptools import setup

NAME = "elbowroom_ros"
SCRIPTS = ("executive", "action_world", "plansys2_world", "bag_to_trace")
HERE = os.path.dirname(os.path.abspath(__file__))
# These files are also used without ROS.
SHARED = {
    "elbowroom_world.py": os.path.join(HERE, "..", "..", "clients", "python", "elbowroom_world.py"),
    os.path.join(NAME, "plansys2_world.py"): os.path.join(HERE, "..", "..", "examples", "plansys2_world.py"),
}

for target, source in SHARED.items():
    target = os.path.join(HERE, target)
    if os.path.exists(source):
        shutil.copyfile(source, target)
    elif not os.path.exists(target):
        raise SystemExit(f"{source} is missing: build this package in a clone of the whole repository of Elbowroom")

setup(
    name=NAME,
    version="0.1.0",
    description="Executes temporal plans with ROS 2 action servers, under a guarantee",
    license="MIT OR Apache-2.0",
    packages=[NAME],
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
