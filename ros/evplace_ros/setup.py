"""The ROS 2 package of evplace: `colcon build --packages-select evplace_ros`."""

from pathlib import Path

from setuptools import setup

NAME = "evplace_ros"

setup(
    name=NAME,
    version="0.1.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", [str(file) for file in Path("launch").glob("*.py")]),
    ],
    install_requires=["setuptools", "evplace"],
    zip_safe=True,
    maintainer="the evplace authors",
    maintainer_email="evplace@example.org",
    description="Visual place recognition with event cameras as a ROS 2 node",
    license="Apache-2.0",
    entry_points={"console_scripts": [f"localizer = {NAME}.node:main"]},
)
