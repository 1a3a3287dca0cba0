# SPDX-License-Identifier: Apache-2.0
"""ros2 launch revisit_ros revisit.launch.py sensor:=ouster mode:=slam map:=/tmp/map rviz:=true"""
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

# Clouds and IMU of the makers' drivers.
SENSORS = {
    "any": ("points", "imu"),
    "velodyne": ("/velodyne_points", "/imu/data"),
    "ouster": ("/ouster/points", "/ouster/imu"),
    "livox": ("/livox/lidar", "/livox/imu"),
    "hesai": ("/lidar_points", "/lidar_imu"),
    "robosense": ("/rslidar_points", "/rslidar_imu_data"),
    "fast_lio": ("/cloud_registered_body", "no_imu"),
}
ARGUMENTS = {
    "sensor": ("any", "one of " + ", ".join(SENSORS)),
    "mode": ("slam", "detect (loops for another SLAM), slam (a map), localise (in a saved map)"),
    "points": ("", "topic of the clouds; empty: the sensor's"),
    "cloud_type": ("sensor_msgs/msg/PointCloud2", "or livox_ros_driver2/msg/CustomMsg"),
    "imu": ("", "sensor_msgs/Imu; empty: the sensor's"),
    "odom": ("odom", "nav_msgs/Odometry; FAST-LIO: /Odometry"),
    "fix": ("fix", "sensor_msgs/NavSatFix"),
    "map": ("", "slam: the folder that keeps the map; localise: the map"),
    "resume": ("false", "slam: go on with the map that is there"),
    "map_frame": ("map", ""),
    "odom_frame": ("odom", "FAST-LIO: camera_init"),
    "base_frame": ("base_link", "FAST-LIO: body"),
    "use_sim_time": ("false", "with `ros2 bag play --clock`"),
    "rviz": ("false", ""),
}


def nodes(context):
    value = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    points, imu = SENSORS[value["sensor"]]
    parameters = {name: value[name] for name in ("mode", "map", "map_frame", "odom_frame", "base_frame", "cloud_type")}
    parameters.update({name: value[name] == "true" for name in ("resume", "use_sim_time")})
    remappings = [("points", value["points"] or points), ("imu", value["imu"] or imu), ("odom", value["odom"]),
                  ("fix", value["fix"])]
    launched = [Node(package="revisit_ros", executable="revisit_node", name="revisit", output="screen",
                     parameters=[parameters], remappings=remappings, sigterm_timeout="120", sigkill_timeout="120")]
    if value["rviz"] == "true":
        config = FindPackageShare("revisit_ros").perform(context) + f"/rviz/{value['mode']}.rviz"
        launched.append(Node(package="rviz2", executable="rviz2", arguments=["-d", config], remappings=remappings[:1]))
    return launched


def generate_launch_description():
    return LaunchDescription([DeclareLaunchArgument(name, default_value=default, description=help)
                              for name, (default, help) in ARGUMENTS.items()] + [OpaqueFunction(function=nodes)])
