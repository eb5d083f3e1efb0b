"""`ros2 launch evplace_ros localizer.launch.py map:=campus.evp`."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def generate_launch_description() -> LaunchDescription:
    """The node, with its map and its camera's topic."""
    return LaunchDescription(
        [
            DeclareLaunchArgument("map", description="A map that evplace train wrote"),
            DeclareLaunchArgument("events", default_value="/event_camera/events"),
            Node(
                package="evplace_ros",
                executable="localizer",
                parameters=[{"map": LaunchConfiguration("map")}],
                remappings=[("events", LaunchConfiguration("events"))],
            ),
        ]
    )
