# . PREFIX/setup.bash, without a catkin workspace: ROS finds the package and its node.
prefix=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
export CMAKE_PREFIX_PATH=$prefix${CMAKE_PREFIX_PATH:+:$CMAKE_PREFIX_PATH}
export ROS_PACKAGE_PATH=$prefix/share:${ROS_PACKAGE_PATH:-/usr/share}
export PYTHONPATH=$prefix/lib/python3/dist-packages${PYTHONPATH:+:$PYTHONPATH}
export ROS_MASTER_URI=${ROS_MASTER_URI:-http://localhost:11311}
