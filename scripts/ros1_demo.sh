#!/usr/bin/env bash
# The ROS 1 node at work: a simulated drive is written as a bag, rosbag plays it, the node makes the map. Ends by naming
# the map and its picture. PORT=N where a ROS master of yours has 11311.
set -euo pipefail
cd "$(dirname "$0")/.."
out=${OUT:-out/ros1}
export ROS_MASTER_URI=http://127.0.0.1:${PORT:-11311} ROS_IP=127.0.0.1 ROS_HOSTNAME=127.0.0.1 ROS_HOME=$PWD/$out/ros ROS_LOG_DIR=$PWD/$out/ros
export PATH=/usr/bin:$PATH PYTHONUNBUFFERED=1  # ROS's Python is Debian's
. build/ros1/setup.bash
mkdir -p "$out"
rm -rf "$out/map"
bag=$out/town.bag
[ -e "$bag" ] || build/revisit simulate --out "$bag" --world town --length_m 600 --sensor vlp16 --imu true
roslaunch revisit_ros revisit.launch mode:=slam map:="$PWD/$out/map" > "$out/node.log" 2>&1 &
launch=$!
trap 'kill -INT $launch 2>/dev/null || true; wait $launch || true' EXIT
is_ready() { rosservice list 2>/dev/null | grep -q /revisit/save_map; }
for _ in $(seq 100); do is_ready && break; sleep 0.2; done
is_ready || { tail -n 20 "$out/node.log" >&2; echo "the node did not start within 20 s: its last lines are above, all of them in $out/node.log" >&2; exit 1; }
echo "playing $bag, twice as fast as it was driven"
/usr/lib/rosbag/play -r 2 "$bag" > /dev/null
rosservice call /revisit/save_map
kill -INT $launch
wait $launch || true
trap - EXIT
build/revisit export "$out/map" --as png --out "$out" 2> "$out/export.log"
echo "Map: $out/map/map.ply   Picture: $out/map.png   What the node said: $out/node.log"
