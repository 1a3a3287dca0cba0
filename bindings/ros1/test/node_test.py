#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""The ROS 1 node against a real master, a bag that rosbag plays, and the program on the same bag.

usage: node_test.py REVISIT_PROGRAM NODE GENERATED_PYTHON_MESSAGES
"""
import copy
import csv
import math
import os
import shutil
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time
import unittest

PROGRAM, NODE, MESSAGES = sys.argv[1:4]
RATE = 2  # times as fast as it was driven
EXCLUDE_S = "5.05"  # between two scans
SCANS = 150
LAST_S = 0.1 * (SCANS - 1) - 0.05


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


WORK = tempfile.mkdtemp(prefix="revisit_ros1_")
PORT = free_port()
os.environ.update(ROS_MASTER_URI=f"http://127.0.0.1:{PORT}", ROS_IP="127.0.0.1", ROS_HOSTNAME="127.0.0.1",
                  ROS_HOME=WORK, ROS_LOG_DIR=WORK, PYTHONUNBUFFERED="1")
sys.path.insert(0, MESSAGES)

import genpy  # noqa: E402
import genpy.dynamic  # noqa: E402
import numpy  # noqa: E402
import rosbag  # noqa: E402
import rosgraph  # noqa: E402  (both read the environment)
import rosnode  # noqa: E402
import rospy  # noqa: E402
import tf2_msgs.msg  # noqa: E402
import tf2_ros  # noqa: E402
from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from geometry_msgs.msg import PoseWithCovarianceStamped  # noqa: E402
from nav_msgs.msg import Odometry, Path  # noqa: E402
from nav_msgs.srv import GetMap  # noqa: E402
from revisit_ros.msg import Loop  # noqa: E402
from sensor_msgs.msg import PointCloud2  # noqa: E402
from sensor_msgs.point_cloud2 import read_points  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402
from visualization_msgs.msg import MarkerArray  # noqa: E402

BAG = os.path.join(WORK, "warehouse.bag")
MAP = os.path.join(WORK, "map")
TOPICS = {"/revisit/loops": Loop, "/revisit/pose": PoseWithCovarianceStamped, "/revisit/path": Path, "/tf": tf2_msgs.msg.TFMessage,
          "/revisit/graph": MarkerArray, "/revisit/map_cloud": PointCloud2, "/diagnostics": DiagnosticArray}


class LivoxMessage(genpy.Message):
    """What a Livox driver sends, whose package is not installed."""

    _type = "livox_ros_driver/CustomMsg"
    _md5sum = "e4d6829bdfe657cb6c21a746c86b21a6"
    _has_header = False
    _full_text = """std_msgs/Header header
uint64 timebase
uint32 point_num
uint8 lidar_id
uint8[3] rsvd
CustomPoint[] points
================================================================================
MSG: std_msgs/Header
uint32 seq
time stamp
string frame_id
================================================================================
MSG: livox_ros_driver/CustomPoint
uint32 offset_time
float32 x
float32 y
float32 z
uint8 reflectivity
uint8 tag
uint8 line
"""
    __slots__ = ["stamp_s", "points"]

    def serialize(self, buff):
        buff.write(struct.pack("<IIII5s", 0, int(self.stamp_s), round(self.stamp_s % 1 * 1e9), 5, b"lidar"))
        buff.write(struct.pack("<QI4BI", int(self.stamp_s * 1e9), len(self.points), 0, 0, 0, 0, len(self.points)))
        for x, y, z, intensity in self.points:
            buff.write(struct.pack("<IfffBBB", 0, x, y, z, min(255, int(intensity)), 0, 0))


def wait_until(condition, seconds=20):
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            raise AssertionError("waited in vain")
        time.sleep(0.02)


class Master:
    def __init__(self):
        self.process = subprocess.Popen(["rosmaster", "--core", "-p", str(PORT)], stdout=subprocess.DEVNULL,
                                        stderr=subprocess.DEVNULL)
        wait_until(rosgraph.is_master_online)

    def stop(self):
        self.process.send_signal(signal.SIGINT)
        self.process.wait(10)


def publish_frames():
    """As robot_state_publisher does: a bag that is played from its middle has no frames."""
    publisher = rospy.Publisher("/tf_static", tf2_msgs.msg.TFMessage, latch=True, queue_size=1)
    with rosbag.Bag(BAG) as bag:
        publisher.publish(next(message for _, message, _ in bag.read_messages(["/tf_static"])))
    return publisher


class Node:
    """The node at work, and all that it publishes."""

    def __init__(self, mode, *parameters, map=None, launch=None):
        self.heard = {topic: [] for topic in TOPICS}
        self.subscribers = [rospy.Subscriber(topic, kind, self.heard[topic].append, queue_size=10000)
                            for topic, kind in TOPICS.items()]
        if rospy.has_param("/revisit"):
            rospy.delete_param("/revisit")
        arguments = [f"_mode:={mode}", f"_retrieval/exclude_s:={EXCLUDE_S}", *parameters]
        if map:
            arguments.append(f"_map:={map}")
        self.log = open(os.path.join(WORK, "node.log"), "a+")
        command = ["roslaunch", "revisit_ros", launch, f"map:={map}"] if launch else [NODE, *arguments]
        if launch:
            rospy.set_param("/revisit/retrieval/exclude_s", float(EXCLUDE_S))
        self.process = subprocess.Popen(command, stdout=self.log, stderr=subprocess.STDOUT)
        wait_until(lambda: all(s.get_num_connections() for s in self.subscribers[:2]) or self.process.poll() is not None)

    def last(self, topic):
        return self.heard[topic][-1]

    def health(self):
        wait_until(lambda: self.heard["/diagnostics"])
        return {pair.key: pair.value for pair in self.last("/diagnostics").status[0].values}

    def wait_for(self, scans):
        wait_until(lambda: int(self.health()["scans"]) >= scans)

    def call(self, name):
        return rospy.ServiceProxy("/revisit/" + name, Trigger)()

    def end(self, how=signal.SIGINT):
        self.process.send_signal(how)
        code = self.process.wait(30)
        for each in self.subscribers:
            each.unregister()
        if how == signal.SIGKILL:
            rosnode.cleanup_master_blacklist(rosgraph.Master("/test"), ["/revisit"])
        return code


def play(*options, bag=BAG):
    return subprocess.Popen(["/usr/lib/rosbag/play", "-q", "-r", str(RATE), "-d", "0.5", *options, bag], stdout=subprocess.DEVNULL,
                            stderr=subprocess.DEVNULL)


def matrix(position, quaternion):
    """Of a pose: x y z, and x y z w."""
    v, w = numpy.array(quaternion[:3]), quaternion[3]
    cross = numpy.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    T = numpy.eye(4)
    T[:3, :3] += 2 * w * cross + 2 * cross @ cross
    T[:3, 3] = position
    return T


def quaternion(T):
    """x y z w: the eigenvector that belongs to the largest eigenvalue (Bar-Itzhack, 2000)."""
    R = T[:3, :3]
    K = numpy.zeros((4, 4))
    K[:3, :3] = R + R.T - numpy.trace(R) * numpy.eye(3)
    K[:3, 3] = K[3, :3] = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    K[3, 3] = numpy.trace(R)
    return numpy.linalg.eigh(K)[1][:, 3]


def true_poses():
    with open(BAG + ".poses.tum") as file:
        rows = [[float(x) for x in line.split()] for line in file if line.strip() and not line.startswith("#")]
    return [matrix(row[1:4], row[4:8]) for row in rows]


def position_of(pose):
    return pose.position.x, pose.position.y, pose.position.z


class NodeTest(unittest.TestCase):
    def assertNear(self, a, b, most):
        self.assertLess(max(abs(x - y) for x, y in zip(a, b)), most)

    def test_0_the_bag_says_what_ros_expects(self):
        with rosbag.Bag(BAG) as bag:
            for each in bag._get_connections():
                made = genpy.dynamic.generate_dynamic(each.datatype, each.msg_def)[each.datatype]
                self.assertEqual(made._md5sum, each.md5sum, each.datatype)

    def test_1_detect_gives_the_loops_of_the_program(self):
        node = Node("detect")
        self.assertEqual(play().wait(60), 0)
        node.wait_for(SCANS)
        self.assertEqual(node.end(), 0)
        out = os.path.join(WORK, "detected")
        subprocess.run([PROGRAM, "detect", BAG, "--out", out, "--retrieval.exclude_s", EXCLUDE_S], check=True,
                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        with open(os.path.join(out, "loops.csv")) as file:
            expected = {(int(row["query"]), int(row["match"])): row for row in csv.DictReader(file)}
        heard = {(loop.query, loop.match): loop for loop in node.heard["/revisit/loops"]}
        self.assertGreater(len(expected), 20)
        # The program takes the scale of intensities from the whole bag, the node from the first scans: of two places side
        # by side, either may come first.
        self.assertEqual({query for query, _ in heard}, {query for query, _ in expected})
        other = sorted(set(heard) ^ set(expected))
        self.assertLessEqual(len(other), 2, other)
        self.assertLessEqual(max((match for _, match in other), default=0) - min((match for _, match in other), default=0), 1)
        for pair, loop in heard.items():
            row = expected.get(pair)
            if row is None:
                continue
            self.assertNear(position_of(loop.t_match_query.pose), [float(row[k]) for k in ("tx", "ty", "tz")], 1e-6)
            self.assertNear([loop.header.stamp.to_sec(), loop.match_stamp.to_sec()], [0.1 * pair[0], 0.1 * pair[1]], 1e-6)
            self.assertEqual(loop.header.frame_id, "lidar")
            self.assertGreater(loop.probability, 0.5)
            self.assertGreater(min(loop.t_match_query.covariance[7 * i] for i in range(6)), 0.0)

    def test_2_slam_is_killed_and_resumed(self):
        node = Node("slam", map=MAP)
        player = play()
        wait_until(lambda: len(node.heard["/revisit/pose"]) >= 85)
        node.end(signal.SIGKILL)
        player.kill()
        player.wait()
        before = node.last("/revisit/pose").header.stamp.to_sec()
        again = Node("slam", map=MAP)
        self.assertEqual(again.process.wait(30), 1, "a map that is there is not overwritten")
        again.end()
        node = Node("slam", "_resume:=true", map=MAP)
        buffer = tf2_ros.Buffer(rospy.Duration(1000))
        listener = tf2_ros.TransformListener(buffer)
        self.assertEqual(play("-s", f"{before + 0.1:.1f}").wait(60), 0)
        wait_until(lambda: node.heard["/revisit/pose"] and node.last("/revisit/pose").header.stamp.to_sec() > LAST_S)
        # Others ask tf where odometry is in the map.
        wait_until(lambda: buffer.can_transform("map", "odom", rospy.Time(0)))
        seen = buffer.lookup_transform("map", "odom", rospy.Time(0))
        self.assertGreater(seen.header.stamp.to_sec(), LAST_S - 1)
        self.assertNear((seen.transform.rotation.x, seen.transform.rotation.y), (0, 0), 0.05)
        listener.unregister()
        answer = node.call("publish_map")
        self.assertTrue(answer.success, answer.message)
        wait_until(lambda: node.heard["/revisit/map_cloud"])
        cloud = node.last("/revisit/map_cloud")
        self.assertGreater(cloud.width, 10000)
        self.assertEqual(cloud.header.frame_id, "map")
        # Whoever comes late gets all tiles of the last publish, not only the last one.
        answer = node.call("publish_map")
        self.assertTrue(answer.success, answer.message)
        tiles = []
        late = rospy.Subscriber("/revisit/map_tiles", PointCloud2, tiles.append)
        wait_until(lambda: sum(tile.width for tile in tiles) >= cloud.width)
        time.sleep(0.5)
        self.assertEqual(sum(tile.width for tile in tiles), cloud.width)
        self.assertEqual(len({tile.header.stamp.to_nsec() for tile in tiles}), 1)
        self.assertGreater(len(tiles), 1)
        late.unregister()
        grid = rospy.ServiceProxy("/revisit/get_map", GetMap)().map
        self.assertEqual(grid.header.frame_id, "map")
        self.assertEqual(len(grid.data), grid.info.width * grid.info.height)
        self.assertEqual(set(grid.data), {-1, 0, 100})
        answer = node.call("save_map")
        self.assertTrue(answer.success, answer.message)
        self.assertTrue(os.path.exists(os.path.join(MAP, "map.ply")))
        # tf: the map above odometry, which the bag has as a topic.
        frames = [t for message in node.heard["/tf"] for t in message.transforms]
        self.assertEqual({(t.header.frame_id, t.child_frame_id) for t in frames if t.header.frame_id == "map"},
                         {("map", "odom")})
        # The path begins where the killed run began, and is where it was driven.
        path = node.last("/revisit/path")
        self.assertLess(path.poses[0].header.stamp.to_sec(), 1.0)
        with open(BAG + ".poses.tum") as file:
            truth = [[float(x) for x in line.split()] for line in file if line.strip() and not line.startswith("#")]
        first, last = truth[0], truth[round(10 * path.poses[-1].header.stamp.to_sec())]
        yaw, dx, dy = 2 * math.atan2(first[6], first[7]), last[1] - first[1], last[2] - first[2]
        driven = (math.cos(yaw) * dx + math.sin(yaw) * dy, math.cos(yaw) * dy - math.sin(yaw) * dx, last[3] - first[3])
        self.assertNear(position_of(path.poses[-1].pose), driven, 0.3)
        self.assertEqual(node.health()["scans left out, since too many waited"], "0")
        self.assertEqual(node.end(), 0)

    def test_3_localise_in_that_map(self):
        node = Node("localise", map=MAP)
        self.assertEqual(play("-s", "9").wait(60), 0)
        wait_until(lambda: node.heard["/revisit/pose"] and node.last("/revisit/pose").header.stamp.to_sec() > LAST_S)
        self.assertGreater(len(node.heard["/revisit/pose"]), 45)
        self.assertGreater(node.last("/revisit/pose").pose.covariance[0], 0.0)
        answer = node.call("load_map")
        self.assertTrue(answer.success, answer.message)
        self.assertFalse(node.call("save_map").success)
        wait_until(lambda: node.last("/diagnostics").status[0].message == "no scan yet")
        self.assertEqual(play("-s", "9").wait(60), 0)
        wait_until(lambda: node.last("/diagnostics").status[0].message.startswith("followed"))
        self.assertEqual(node.end(), 0)

    def test_5_goes_on_while_the_master_is_restarted(self):
        global master
        node = Node("detect")
        player = play()
        wait_until(lambda: int(node.health()["scans"]) >= 20)
        master.stop()
        master = Master()
        self.assertEqual(player.wait(60), 0)
        node.wait_for(SCANS)
        self.assertEqual(node.end(), 0)

    def test_4_livox_messages_and_parameters_that_change(self):
        node = Node("detect")
        publisher = rospy.Publisher("/points", LivoxMessage, queue_size=10)
        wait_until(publisher.get_num_connections)
        with rosbag.Bag(BAG) as bag:
            for i, (_, cloud, _) in enumerate(bag.read_messages(["/points"])):
                points = list(read_points(cloud, ("x", "y", "z", "intensity"), skip_nans=True))
                publisher.publish(LivoxMessage(stamp_s=1000 + 0.1 * i, points=points))
                if i == 4:
                    break
        node.wait_for(5)
        self.assertEqual(node.health()["scans that could not be used"], "0")
        rospy.set_param("/revisit/geometric/min_probability", 0.99)
        answer = node.call("update_parameters")
        self.assertTrue(answer.success, answer.message)
        self.assertIn("geometric.min_probability", answer.message)
        rospy.set_param("/revisit/descriptor/rings", 10)
        answer = node.call("update_parameters")
        self.assertFalse(answer.success)
        self.assertIn("descriptor.rings", answer.message)
        publisher.unregister()
        self.assertEqual(node.end(), 0)

    def test_3b_by_the_clock_of_the_bag(self):
        rospy.set_param("/use_sim_time", True)
        try:
            node = Node("detect")
            self.assertEqual(play("--clock").wait(60), 0)
            wait_until(lambda: node.heard["/diagnostics"] and len(node.heard["/revisit/loops"]) > 20)
            self.assertLess(node.last("/diagnostics").header.stamp.to_sec(), 60, "not the time of day")
        finally:
            rospy.delete_param("/use_sim_time")
        self.assertEqual(node.end(signal.SIGTERM), 0)

    def test_9_corrects_fast_lio(self):
        """A bag with FAST-LIO's topics and frames, whose odometry turns by a tenth of a degree with each scan."""
        truth = true_poses()
        turn = matrix((0, 0, 0), (0, 0, math.sin(math.radians(0.05)), math.cos(math.radians(0.05))))
        odometry = [numpy.eye(4)]
        for before, after in zip(truth, truth[1:]):
            odometry.append(odometry[-1] @ numpy.linalg.inv(before) @ after @ turn)
        bag = os.path.join(WORK, "fast_lio.bag")
        with rosbag.Bag(bag, "w") as out, rosbag.Bag(BAG) as made:
            for i, (_, cloud, when) in enumerate(made.read_messages(["/points"])):
                cloud.header.frame_id = "body"
                message = Odometry(header=cloud.header, child_frame_id="body")
                message.header = copy.deepcopy(cloud.header)
                message.header.frame_id = "camera_init"
                position, q = message.pose.pose.position, message.pose.pose.orientation
                position.x, position.y, position.z = odometry[i][:3, 3]
                q.x, q.y, q.z, q.w = quaternion(odometry[i])
                out.write("/Odometry", message, when)
                out.write("/cloud_registered_body", cloud, when)
        node = Node("slam", map=os.path.join(WORK, "fast_lio"), launch="fast_lio.launch")
        self.assertEqual(play(bag=bag).wait(60), 0)
        wait_until(lambda: node.heard["/revisit/pose"] and node.last("/revisit/pose").header.stamp.to_sec() > LAST_S)
        time.sleep(0.5)
        corrections = [t for message in node.heard["/tf"] for t in message.transforms]
        self.assertEqual({(t.header.frame_id, t.child_frame_id) for t in corrections}, {("map", "camera_init")})
        last = corrections[-1]
        i = round(10 * last.header.stamp.to_sec())
        T, r = last.transform.translation, last.transform.rotation
        seen = matrix((T.x, T.y, T.z), (r.x, r.y, r.z, r.w)) @ odometry[i]
        driven = numpy.linalg.inv(truth[0]) @ truth[i]
        self.assertGreater(numpy.linalg.norm(odometry[i][:3, 3] - driven[:3, 3]), 1.0, "odometry alone has drifted")
        self.assertLess(numpy.linalg.norm(seen[:3, 3] - driven[:3, 3]), 0.3)
        self.assertEqual(node.end(), 0)

    def test_8_launch_files_say_which_nodes_they_start(self):
        folder = os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), "launch")
        for name in sorted(os.listdir(folder)):
            if name.endswith(".launch"):
                listed = subprocess.run(["roslaunch", "--nodes", os.path.join(folder, name)], capture_output=True, text=True, timeout=60)
                self.assertIn("/revisit", listed.stdout.split(), f"{name}: {listed.stdout} {listed.stderr}")

    def test_6_says_what_is_wrong(self):
        log = subprocess.run([NODE, "_mode:=fly"], capture_output=True, text=True, timeout=30)
        self.assertEqual(log.returncode, 1)
        self.assertIn("allowed: detect, slam, localise", log.stdout + log.stderr)
        rospy.delete_param("/revisit")
        log = subprocess.run([NODE, "_mode:=detect", "_retreival/top_k:=5"], capture_output=True, text=True, timeout=30)
        self.assertEqual(log.returncode, 1)
        self.assertIn("retrieval.top_k", log.stdout + log.stderr, "the nearest that there is")

    def test_7_ends_without_a_master(self):
        environment = dict(os.environ, ROS_MASTER_URI=f"http://127.0.0.1:{free_port()}")
        node = subprocess.Popen([NODE, "_mode:=detect"], env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        time.sleep(1)
        node.send_signal(signal.SIGINT)
        self.assertNotEqual(node.wait(10), 0)


subprocess.run([PROGRAM, "simulate", "--out", BAG, "--world", "warehouse", "--frames", str(SCANS), "--sensor", "vlp16",
                "--imu", "true", "--gps", "true", "--seed", "5"], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
# As installed, so that roslaunch finds the package and its node.
HERE = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
for folder in ("share/revisit_ros", "lib/revisit_ros"):
    os.makedirs(os.path.join(WORK, "prefix", folder))
for name in ("launch", "rviz", "package.xml"):
    os.symlink(os.path.join(HERE, name), os.path.join(WORK, "prefix/share/revisit_ros", name))
os.symlink(NODE, os.path.join(WORK, "prefix/lib/revisit_ros/revisit_node"))
open(os.path.join(WORK, "prefix/.catkin"), "w").close()
os.environ.update(CMAKE_PREFIX_PATH=os.path.join(WORK, "prefix"), ROS_PACKAGE_PATH=os.path.join(WORK, "prefix/share") + ":/usr/share")
master = Master()
try:
    rospy.init_node("test", anonymous=True, disable_signals=True)
    frames = publish_frames()
    result = unittest.main(argv=sys.argv[:1], verbosity=2, exit=False, warnings="ignore").result
finally:
    master.stop()
    if len(sys.argv) < 5:
        shutil.rmtree(WORK, ignore_errors=True)
    else:
        print("left:", WORK)
os._exit(0 if result.wasSuccessful() else 1)  # rospy's threads wait for ever
