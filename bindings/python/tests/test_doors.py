# SPDX-License-Identifier: Apache-2.0
import csv
import gc
import json
import logging
import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import revisit


def test_five_lines_find_the_loop_of_kitti(shared):
    loops = revisit.detect(shared / "kitti00_mini", progress=False)
    assert (4501, 52) in [(loop.query, loop.match) for loop in loops]


def test_the_loops_are_those_of_the_program(short_past, tmp_path):
    settings = tmp_path / "drive.toml"
    settings.write_text('[simulation]\nworld = "warehouse"\nsensor = "vlp16"\nseed = 7\nframes = 150\ndifficulty = 1\n')
    revisit.run("detect", settings, "--out", tmp_path / "out", "--retrieval.exclude_s", "5.05")
    with open(tmp_path / "out" / "loops.csv") as file:
        rows = list(csv.DictReader(file))
    drive = revisit.simulate(world="warehouse", sensor="vlp16", seed=7, frames=150, difficulty=1)
    loops = revisit.detect(drive, short_past, progress=False)
    assert len(loops) > 20
    assert json.loads((tmp_path / "out" / "run.json").read_text())["counts"]["loops_found_later"] > 0
    assert [(int(row["query"]), int(row["match"])) for row in rows] == [(loop.query, loop.match) for loop in loops]
    for row, loop in zip(rows, loops):
        for name, value in {"score": loop.score, "inlier_ratio": loop.inlier_ratio, "rmse_m": loop.rmse_m,
                            **dict(zip(("tx", "ty", "tz"), loop.T_match_query[:3, 3]))}.items():
            assert row[name] == f"{value:.10g}", name
        x, y, z, w = (float(row[name]) for name in ("qx", "qy", "qz", "qw"))
        rotation = [[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                    [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                    [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]
        np.testing.assert_allclose(loop.T_match_query[:3, :3], rotation, atol=1e-8)


def test_results_are_easy_to_look_at(scans, short_past):
    detector = revisit.LoopDetector(short_past)
    found = [detector.process(scan) for scan in scans]
    assert len(detector) > 100
    loop = next(each.loop for each in reversed(found) if each.loop)
    assert loop.T_match_query.shape == (4, 4) and loop.information.shape == (6, 6) and 0.95 <= loop.probability <= 1
    assert set(loop.to_dict()) == set(loop._fields) and "yaw" in repr(loop)
    assert found[0].loop is None and found[0].reason == "no searchable past"
    candidates = found[-1].candidates
    assert candidates.dtype.names == ("match", "geometry_score", "intensity_score", "yaw_rad") and len(candidates) > 3


def test_scans_that_are_given_are_not_changed(scans):
    before = scans[3].points.copy()
    detector = revisit.LoopDetector()
    detector.process(scans[3])
    array = before.astype(np.float64)
    detector.process(array, stamp=1.0)
    np.testing.assert_array_equal(scans[3].points, before)
    np.testing.assert_array_equal(array, before)


def test_what_describes_no_place_is_an_error_and_the_next_scan_works(scans):
    detector = revisit.LoopDetector()
    with pytest.raises(revisit.Error, match="frame 0"):
        detector.process(np.ones((5, 3)))
    assert detector.process(scans[0]).frame == 0
    for pose in (np.full((4, 4), np.nan), np.eye(3), np.eye(4)[:3], "here"):
        with pytest.raises(ValueError, match="a pose"):
            detector.process(scans[1], pose=pose)


def test_a_frame_that_does_not_increase_is_refused_and_changes_nothing(scans, short_past):
    detector = revisit.LoopDetector(short_past)
    for scan in scans[:75]:
        detector.process(scan)
    for frame in range(60):
        with pytest.raises(ValueError, match="increasing"):
            detector.process(scans[75], frame=frame)
    undisturbed = revisit.LoopDetector(short_past)
    for scan in scans[:75]:
        undisturbed.process(scan)
    for scan in scans[75:110]:
        ours, theirs = detector.process(scan).loop, undisturbed.process(scan).loop
        assert (ours.match if ours else None) == (theirs.match if theirs else None)


def test_scans_without_numbers_follow_those_that_were_taken(scans):
    detector = revisit.LoopDetector()
    assert [detector.process(scan.points).frame for scan in scans[:3]] == [0, 1, 2]
    detector.localise(scans[0])
    with pytest.raises(ValueError):
        detector.process(scans[4].points, frame=1)
    with pytest.raises(revisit.Error):
        detector.process(np.ones((5, 3)))
    assert detector.process(scans[4].points).frame == 4


def test_a_call_from_its_own_callback_is_an_error(scans, tmp_path):
    slam = revisit.Slam()
    for scan in scans[:10]:
        slam.process(scan)
    with pytest.raises(RuntimeError, match="its own callback"):
        slam.write_map(tmp_path, lambda done: slam.trajectory())


def test_ctrl_c_ends_a_map(scans):
    slam = revisit.Slam()
    for scan in scans[:10]:
        slam.process(scan)
    with pytest.raises(KeyboardInterrupt):
        slam.map(lambda done: signal.raise_signal(signal.SIGINT))
    assert len(slam.map())  # nothing is lost


def test_ctrl_c_is_obeyed_while_a_map_is_settled(scans):
    slam = revisit.Slam()
    for scan in scans[:60]:
        slam.process(scan)
    began, go_on, ended = threading.Event(), threading.Event(), threading.Event()
    finish = slam._slam.finish

    class Slow:  # as of a large map
        def __getattr__(self, name):
            return getattr(slam_itself, name)

        def finish(self):
            began.set()
            go_on.wait(30.0)
            finish()
            ended.set()
    slam_itself, slam._slam = slam._slam, Slow()
    # Any thread may be given the signal: here it is one that does not wait for the map.
    threading.Thread(target=lambda: (began.wait(), time.sleep(0.3), signal.pthread_kill(threading.get_ident(), signal.SIGINT))).start()
    with pytest.raises(KeyboardInterrupt):
        slam.finish()
    assert not ended.is_set()
    slam._slam = slam_itself
    go_on.set()
    assert ended.wait(30.0)
    assert len(slam.trajectory()) == 60  # waits for what goes on behind the scenes
    with pytest.raises(revisit.Error):  # errors come through
        revisit.Slam("/proc/nowhere")


def test_ctrl_c_in_a_log_handler_is_not_swallowed(scans):
    class Handler(logging.Handler):
        def emit(self, record):
            raise KeyboardInterrupt
    logger, handler = logging.getLogger("revisit"), Handler()
    before = logger.level
    logger.setLevel(logging.DEBUG)
    logger.addHandler(handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            slam = revisit.Slam()
            for scan in scans[:10]:
                slam.process(scan.points, stamp=0.0)  # a stamp that does not increase is logged
            slam.map(lambda done: None)
    finally:
        logger.removeHandler(handler)
        logger.setLevel(before)


def test_a_thread_at_work_does_not_spoil_the_end():
    done = subprocess.run([sys.executable, "-c", """
import threading, time, numpy as np, revisit
points = np.random.default_rng(1).uniform(-20, 20, (100000, 3))
def work():
    while True:
        try:
            revisit.describe(points)
        except revisit.Error:
            pass
threading.Thread(target=work, daemon=True).start()
time.sleep(0.5)
"""], env=os.environ, timeout=60)
    assert done.returncode == 0


def test_two_scans_are_registered(drive, scans):
    found = revisit.register_scans(scans[5], scans[0])
    truth = np.linalg.inv(drive.pose(0)) @ drive.pose(5)
    assert found.is_accepted and found.reason == ""
    np.testing.assert_allclose(found.T_target_source, truth, atol=0.05)


def test_a_map_is_made_and_woken_up_in(drive, scans, tmp_path):
    slam = revisit.Slam(tmp_path / "map")
    steps = [slam.process(scan) for scan in scans[:120]]
    assert steps[0].is_keyframe and all(step.is_tracked for step in steps)
    slam.finish()
    trajectory = slam.trajectory()
    assert len(trajectory) == 120 and trajectory.poses.shape == (120, 4, 4)
    driven = np.linalg.inv(drive.pose(0)) @ drive.pose(119)
    np.testing.assert_allclose(trajectory.poses[-1][:3, 3], driven[:3, 3], atol=0.1)
    assert slam.map().shape[1] == 4 and len(slam.map()) > 1000
    done = []
    assert slam.write_map(tmp_path / "map", done.append) > 1000 and done
    del slam
    localiser = revisit.Localiser(tmp_path / "map")
    found = localiser.locate(scans[20])
    assert found.status == "found", found.reason
    np.testing.assert_allclose(found.T_map_lidar, np.linalg.inv(drive.pose(0)) @ drive.pose(20), atol=0.1)
    assert [localiser.follow(scan).status for scan in scans[30:35]][1:] == ["followed"] * 4


def test_an_odometry_of_ones_own(drive, scans):
    kept = []

    def odometry(scan):
        kept.append(scan.points)
        return drive.pose(scan.frame)

    slam = revisit.Slam(odometry=odometry)
    for scan in scans[:20]:
        slam.process(scan)
    np.testing.assert_array_equal(kept[7], scans[7].points)
    truth = np.linalg.inv(drive.pose(0)) @ drive.pose(19)
    np.testing.assert_allclose(slam.trajectory().poses[-1], truth, atol=1e-6)


def test_places_are_added_searched_saved_and_opened(scans, tmp_path):
    descriptors = [revisit.describe(scan) for scan in scans[:40]]
    assert descriptors[0].intensity.shape == (20, 30) and descriptors[0].occupancy.shape == (4, 20, 30)
    index = revisit.PlaceIndex()
    for frame, descriptor in enumerate(descriptors):
        index.add(frame, descriptor)
    best = index.search(descriptors[7])[0]
    assert best["match"] == 7 and best["geometry_score"] == 1.0
    index.save(tmp_path / "index")
    again = revisit.PlaceIndex.open(tmp_path / "index")
    for each in (index, again):
        assert each.frames.tolist() == list(range(len(index)))
        np.testing.assert_array_equal(each.intensities[7], revisit.describe(scans[7]).intensity)
        np.testing.assert_array_equal(each.occupancies[7], revisit.describe(scans[7]).occupancy)
    assert len(revisit.PlaceIndex().frames) == len(revisit.PlaceIndex().intensities) == 0
    assert len(again) == 40
    np.testing.assert_array_equal(again.search(descriptors[9]), index.search(descriptors[9]))
    with pytest.raises(ValueError):
        index.add(3, descriptors[3])


def test_errors_of_files_name_them(tmp_path):
    with pytest.raises(FileNotFoundError, match="nowhere"):
        revisit.open_recording(tmp_path / "nowhere")
    (tmp_path / "broken.bag").write_bytes(b"#ROSBAG V2.0\nnonsense")
    with pytest.raises(revisit.Error, match="broken.bag"):
        revisit.open_recording(tmp_path / "broken.bag")
    with pytest.raises(FileNotFoundError):
        revisit.Localiser(tmp_path / "nowhere")


def test_recordings_are_sequences(drive):
    assert len(list(drive)) == len(drive) == 150 and drive[-1].frame == drive.frame(149)
    assert drive.wheel_pose(3).shape == (4, 4)
    with pytest.raises(IndexError):
        drive[150]


def test_a_simulated_drive_is_described_by_a_file(tmp_path):
    options = {"world": "warehouse", "sensor": "vlp16", "seed": 6, "frames": 4}
    file = tmp_path / "drive.toml"
    file.write_text("[simulation]\n" + "".join(f"{key} = {json.dumps(value)}\n" for key, value in options.items()))
    described, named = revisit.open_recording(file), revisit.simulate(**options)
    assert len(described) == len(named) == 4
    np.testing.assert_array_equal(described[3].points, named[3].points)
    with pytest.raises(ValueError, match="exact poses"):
        revisit.open_recording(file, poses="poses.txt")
    file.write_text("[simulation]\nworld = 'moon'\n")
    with pytest.raises((ValueError, revisit.Error), match="moon"):
        revisit.open_recording(file)


def test_messages_go_to_logging(scans, caplog):
    with caplog.at_level(logging.INFO, logger="revisit"):
        revisit.LoopDetector().process(scans[0])
    assert any("rings" in record.message for record in caplog.records)


def test_threads_work_side_by_side_and_agree(scans, short_past):
    expected = [d.loop.to_dict()["match"] if d.loop else None for d in map(revisit.LoopDetector(short_past).process, scans)]
    shared, index, results = revisit.LoopDetector(short_past), revisit.PlaceIndex(), {}
    descriptors = [revisit.describe(scan) for scan in scans[:30]]

    def own(number):
        detector = revisit.LoopDetector(short_past)
        results[number] = [d.loop.match if d.loop else None for d in map(detector.process, scans)]

    def together(number):
        for i, scan in enumerate(scans[:30]):
            try:
                shared.process(scan, frame=1000 * number + i)
            except (ValueError, revisit.Error):  # another thread was faster: frames increase, stamps jump
                pass
            if number == 0:
                index.add(i, descriptors[i])
            else:
                index.search(descriptors[i])

    threads = [threading.Thread(target=own, args=(i,)) for i in range(2)]
    threads += [threading.Thread(target=together, args=(i,)) for i in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert results[0] == results[1] == expected


def test_memory_stays_where_it_is(scans):
    def resident_kB():
        with open("/proc/self/status") as file:
            return next(int(line.split()[1]) for line in file if line.startswith("VmRSS"))

    points = scans[0].points[::20].copy()
    index = revisit.PlaceIndex()
    index.add(0, revisit.describe(points))
    detector = revisit.LoopDetector()
    for scan in scans[:5]:
        detector.process(scan)

    def calls(times):  # six each
        for _ in range(times):
            scan = revisit.Scan(points)
            scan.points
            index.search(revisit.describe(scan))
            detector.localise(scan).to_dict()
        for _ in range(times // 50):
            revisit.register_scans(scans[3], scans[2])

    calls(100)
    gc.collect()
    before = resident_kB()
    calls(1700)
    gc.collect()
    assert resident_kB() - before < 8000


def test_the_program_comes_with_it(tmp_path):
    done = subprocess.run([sys.executable, "-m", "revisit", "--version"], capture_output=True, text=True, env=os.environ)
    assert done.returncode == 0 and revisit.__version__ in done.stdout
    with pytest.raises(revisit.Error, match="nowhere"):
        revisit.run("info", tmp_path / "nowhere")
    drive = tmp_path / "drive.toml"
    drive.write_text('[simulation]\nworld = "warehouse"\nsensor = "vlp16"\nseed = 5\nframes = 60\n')
    revisit.run("detect", drive, "--out", tmp_path / "out", "--retrieval.exclude_s", "2")
    tables = revisit.evaluate(tmp_path / "out", drive)
    assert json.dumps(tables) and tables


class RingKey:
    """A method of a few lines: how many points lie in each ring around the sensor."""

    def describe(self, scan):
        ranges = np.linalg.norm(scan.points[:, :2], axis=1)
        return np.histogram(ranges, bins=40, range=(0, 80))[0] / len(ranges)

    def similarity(self, query, places):
        return -np.abs(places - query).sum(axis=1)


def test_a_method_of_ones_own_is_measured_beside_ours(tmp_path, short_past):
    drive = tmp_path / "drive.toml"
    drive.write_text('[simulation]\nworld = "warehouse"\nsensor = "vlp16"\nseed = 5\nframes = 150\n')
    tables = revisit.compare(drive, tmp_path / "out", ["revisit"], own={"ring key": RingKey()},
                             parameters=short_past)
    assert set(tables) == {"program", "ring key"}
    assert (tmp_path / "out" / "ring key" / "evaluation.json").exists()


def test_pictures(scans, tmp_path):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from revisit import plot
    slam = revisit.Slam()
    for scan in scans[:30]:
        slam.process(scan)
    found = revisit.register_scans(scans[5], scans[0])
    for name, ax in {"trajectory": plot.trajectory(slam.trajectory(), slam.loops()), "scan": plot.scan(scans[0]),
                     "registration": plot.registration(scans[5], scans[0], found.T_target_source),
                     "descriptor": plot.descriptor(revisit.describe(scans[0])), "map": plot.map(slam.map()),
                     "curve": plot.precision_recall([3, 2, 1], [True, True, False], 4, label="ours")}.items():
        assert ax.get_xlabel() and ax.get_ylabel()
        ax.figure.savefig(tmp_path / f"{name}.png", dpi=60)
        plt.close(ax.figure)
