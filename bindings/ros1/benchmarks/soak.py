#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""A long drive through the ROS 1 node in mode slam, at the speed at which it was driven: what is left out, how late poses
are, and how memory grows.

usage: soak.py NODE MESSAGES_FOLDER BAG MAP   (`revisit simulate --out drive.bag --imu true ...` makes the bag)
"""
import os
import signal
import subprocess
import sys
import time

NODE, MESSAGES, BAG, MAP = sys.argv[1:5]
PORT = os.environ.get("PORT", "11511")
os.environ.update(ROS_MASTER_URI=f"http://127.0.0.1:{PORT}", ROS_HOSTNAME="127.0.0.1", ROS_IP="127.0.0.1", PYTHONUNBUFFERED="1")
sys.path.insert(0, MESSAGES)

import rospy  # noqa: E402  (reads the environment)
from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from geometry_msgs.msg import PoseWithCovarianceStamped  # noqa: E402
from sensor_msgs.msg import Imu  # noqa: E402

HALF_A_SWEEP_S = 0.05  # simulated scans are stamped at the middle


def start(*command):
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.STDOUT)


def resident_mb(process):
    with open(f"/proc/{process.pid}/status") as status:
        return int(next(line for line in status if line.startswith("VmRSS")).split()[1]) // 1024


class Listener:
    def __init__(self):
        rospy.init_node("soak", disable_signals=True)
        self.poses, self.clock_lag_s, self.health = [], float("inf"), {}
        rospy.Subscriber("/revisit/pose", PoseWithCovarianceStamped, self.on_pose, queue_size=1000, tcp_nodelay=True)
        rospy.Subscriber("/imu", Imu, self.on_imu, queue_size=1000)
        rospy.Subscriber("/diagnostics", DiagnosticArray, self.on_health)

    def on_pose(self, message):
        self.poses.append(time.time() - message.header.stamp.to_sec() - HALF_A_SWEEP_S)

    def on_imu(self, message):  # small messages, at once: they tell the bag's clock from this one
        self.clock_lag_s = min(self.clock_lag_s, time.time() - message.header.stamp.to_sec())

    def on_health(self, message):
        self.health = {each.key: each.value for each in message.status[0].values}

    def latency_ms(self):
        return sorted(1e3 * (each - self.clock_lag_s) for each in self.poses)


def main():
    master = start("rosmaster", "--core", "-p", PORT)
    time.sleep(2)
    node = start(NODE, "_mode:=slam", "_map:=" + MAP, "odom:=no_odom")
    listener = Listener()
    time.sleep(2)
    player = start("/usr/lib/rosbag/play", "-q", "-d", "1", BAG)
    began = time.time()
    print("  time    scans  left out  memory  slowest scan")
    while player.poll() is None:
        time.sleep(min(60, max(1, 0.01 * (time.time() - began) + 5)))
        say = listener.health.get
        print(f"{time.time() - began:5.0f} s {say('scans', '-'):>8} {say('scans left out, since too many waited', '-'):>9} "
              f"{resident_mb(node):4} MB {float(say('slowest scan took, ms', 0)):9.0f} ms", flush=True)
    time.sleep(3)
    late = listener.latency_ms()
    print(f"{len(late)} poses; from the end of a sweep to its pose, ms: " +
          ", ".join(f"{late[int(q * (len(late) - 1))]:.0f} at {100 * q:g} %" for q in (0.5, 0.95, 0.99, 0.999, 1)))
    print(", ".join(f"{key}: {value}" for key, value in listener.health.items()))
    asked = time.time()
    node.send_signal(signal.SIGINT)
    print(f"ended with {node.wait(600)}, settled and closed {time.time() - asked:.1f} s after Ctrl-C")
    master.send_signal(signal.SIGINT)
    os._exit(0)  # rospy's threads do not end


main()
