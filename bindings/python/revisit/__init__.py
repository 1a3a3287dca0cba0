# SPDX-License-Identifier: Apache-2.0
"""LiDAR place recognition: scans in; loops, trajectory, map and poses in a saved map out.

    import revisit
    recording = revisit.open_recording("drive.bag")
    detector = revisit.LoopDetector(recording=recording)
    loops = [loop for scan in recording for loop in detector.process(scan).loops]

Points are arrays N x 3 or N x 4 (x forward, y left, z up, metres; raw intensity), poses 4 x 4 arrays that map the frame
named last into the one named first (`T_match_query`). Messages go to `logging`, logger "revisit".
"""
import os as _os
import threading as _threading

import numpy as _np

from . import _core
from ._core import (Descriptor, Detection, Error, IntensityScale, Localisation, Loop, PlaceIndex as _PlaceIndex,
                    Recording, Registration, Scan, SlamStep, __version__)
from ._parameters import Parameters, parameter_infos
from ._compare import compare
from ._program import evaluate, run

__all__ = ["Descriptor", "Detection", "Error", "IntensityScale", "Localisation", "Localiser", "Loop", "LoopDetector",
           "Parameters", "PlaceIndex", "Recording", "Registration", "Scan", "Slam", "SlamStep", "Trajectory", "compare",
           "describe", "detect", "evaluate", "open_recording", "parameter_infos", "register_scans", "run", "simulate",
           "__version__"]


def _values(parameters):
    return (parameters if parameters is not None else Parameters())._values


def _to_dict(self):
    """All fields by name."""
    return {name: getattr(self, name) for name in self._fields}


def _repr(self):
    parts = []
    for name in self._fields:
        value = getattr(self, name)
        if isinstance(value, _np.ndarray):
            if value.shape == (4, 4):
                x, y, z = value[:3, 3]
                yaw = _np.degrees(_np.arctan2(value[1, 0], value[0, 0]))
                parts.append(f"{name}=<{x:.2f} {y:.2f} {z:.2f} m, yaw {yaw:.1f} deg>")
        elif isinstance(value, float):
            parts.append(f"{name}={value:.3f}")
        elif not isinstance(value, dict) and value is not None and value != "":
            parts.append(f"{name}={value!r}")
    return f"{type(self).__name__}({', '.join(parts)})"


for _kind, _names in {
        Loop: "query match T_match_query information probability score inlier_ratio rmse_m",
        Detection: "frame loop loops earlier reason searchable_places candidates score probability milliseconds",
        Registration: "T_target_source information probability inlier_ratio rmse_m is_accepted reason",
        SlamStep: "frame T_world_lidar is_tracked is_keyframe detection loops_entered",
        Localisation: "frame status T_map_lidar probability information match reason"}.items():
    _kind._fields = tuple(_names.split())
    _kind.to_dict = _to_dict
    _kind.__repr__ = _repr
for _kind in (Descriptor, Detection, Error, IntensityScale, Localisation, Loop, Recording, Registration, Scan, SlamStep):
    _kind.__module__ = "revisit"
Scan.__repr__ = lambda self: f"Scan(frame={self.frame}, stamp={self.stamp:.3f}, {len(self)} points)"
Recording.__repr__ = lambda self: f"<{self.kind}, {len(self)} scans>"
Descriptor.__repr__ = lambda self: f"<Descriptor, {self.rings} rings x {self.sectors} sectors>"


def _iterate(self):
    """Scans one by one; one that cannot be read is logged and left out."""
    import logging
    for index in range(len(self)):
        try:
            scan = self[index]
        except Error as error:
            logging.getLogger("revisit").warning("scan left out: %s", error)
            continue
        yield scan


Recording.__iter__ = _iterate


def _interruptible(work):
    """work() in a thread of its own, so that Ctrl-C is obeyed at once; the work then goes on behind the scenes."""
    if _threading.current_thread() is not _threading.main_thread():
        return work()
    outcome = {}

    def run():
        try:
            outcome["result"] = work()
        except BaseException as error:  # raised where it is waited for
            outcome["error"] = error
    thread = _threading.Thread(target=run, name="revisit", daemon=True)
    thread.start()
    while thread.is_alive():
        thread.join(0.2)  # a signal that another thread was given does not wake this one; its handler runs here all the same
    if "error" in outcome:
        raise outcome["error"]
    return outcome["result"]


class _Stream:
    """Numbers and stamps scans that come without; one thread at a time."""

    def __init__(self, next_frame=0, next_stamp=0.0):
        self._next_frame, self._next_stamp = next_frame, next_stamp
        self._lock = _threading.RLock()

    def _scan(self, points, intensity, time, ring, stamp, frame):
        if isinstance(points, Scan):
            frame = points.frame if frame is None else frame
            stamp = points.stamp if stamp is None else stamp
        frame = self._next_frame if frame is None else frame
        stamp = self._next_stamp if stamp is None else stamp
        return Scan(points, intensity, time, ring, stamp, frame)  # a copy: the library may change it

    def use(self, work, *scan):
        """work(scan). Scans that come without number and stamp follow the last one that was taken."""
        with self._lock:
            scan = self._scan(*scan)
            frame, stamp = scan.frame, scan.stamp
            try:
                result = work(scan)
            except Error:  # it shows no place, but has its number
                self._next_frame, self._next_stamp = frame + 1, stamp + 0.1
                raise
            self._next_frame, self._next_stamp = frame + 1, stamp + 0.1
            return result

    def look(self, work, *scan):
        """The same of a scan that leaves nothing behind."""
        with self._lock:
            return work(self._scan(*scan))


class LoopDetector:
    """Scans in, loops out, online. Threads wait for each other.

    parameters: revisit.Parameters. scale: IntensityScale; without, the first ten scans decide it, or the scans spread
    over `recording`, as the program does.
    """

    def __init__(self, parameters=None, *, scale=None, recording=None):
        if recording is not None:
            parameters = (parameters or Parameters()).copy()
            if not recording.has_times:
                parameters.retrieval.exclude_s = 0.0
            scale = scale or _core.intensity_scale_of(recording, parameters._values)
        self._detector, self._stream = _core.LoopDetector(_values(parameters), scale), _Stream()

    def process(self, points, intensity=None, time=None, ring=None, *, stamp=None, frame=None, pose=None):
        """Looks for the scan's place among those old enough, then adds it. Gives a Detection.

        points: Scan, or N x 3, N x 4 or structured array. intensity, time (seconds from the stamp), ring: one a point.
        stamp: seconds; without, a tenth of a second after the scan before. pose: 4 x 4, kept as evidence only.
        Raises Error where the scan describes no place; the next one may.
        """
        return self._stream.use(lambda scan: self._detector.process(scan, pose), points, intensity, time, ring, stamp, frame)

    def localise(self, points, intensity=None, time=None, ring=None, *, stamp=None, frame=None):
        """Looks for the scan's place among all, and adds nothing. Gives a Detection."""
        return self._stream.look(self._detector.localise, points, intensity, time, ring, stamp, frame)

    def __len__(self):
        """Places so far."""
        return len(self._detector)


def _progress(iterable, show, **arguments):
    if not show:
        return iterable
    try:
        from tqdm.auto import tqdm
    except ImportError:
        return iterable
    return tqdm(iterable, **arguments)


def detect(recording, parameters=None, *, progress=True):
    """The loops of a recording (or of what open_recording() takes): a list of Loop, by query. Scans that describe no place are
    left out and logged."""
    import logging
    if not isinstance(recording, Recording):
        recording = open_recording(recording)
    detector = LoopDetector(parameters, recording=recording)
    loops = []
    for scan in _progress(recording, progress, total=len(recording), unit=" scans", desc="detect"):
        try:
            detection = detector.process(scan)
        except Error as error:
            logging.getLogger("revisit").warning("scan left out: %s", error)
            continue
        loops += detection.loops
    return sorted(loops, key=lambda loop: loop.query)


def register_scans(source, target, parameters=None):
    """How two scans lie to each other, without a guess: a Registration. Each: Scan, or N x 3, N x 4 or structured array."""
    return _core.register_scans(Scan(source), Scan(target), _values(parameters))


def describe(points, parameters=None, *, scale=None, intensity=None):
    """The descriptor of one scan: arrays `intensity` (rings x sectors) and `occupancy` (layers x rings x sectors)."""
    return _core.describe(Scan(points, intensity), _values(parameters), scale)


class Trajectory:
    """frames (N), stamps (N, seconds) and poses (N x 4 x 4) as arrays."""

    _fields = ("frames", "stamps", "poses")
    to_dict = _to_dict

    def __init__(self, frames, stamps, poses):
        self.frames, self.stamps, self.poses = frames, stamps, poses

    def __len__(self):
        return len(self.frames)

    def __repr__(self):
        length = _np.linalg.norm(_np.diff(self.poses[:, :3, 3], axis=0), axis=1).sum() if len(self) > 1 else 0.0
        return f"<Trajectory, {len(self)} scans, {length:.0f} m>"


class Slam:
    """Scans in; trajectory, loops and map out.

    folder: keeps the map (map.revisit) and continues the one that is there; without, a temporary file. odometry: a
    callable that gets each Scan and gives the LiDAR's 4 x 4 pose in a frame of its own, in place of the library's own
    odometry. new_session: another recording enters the map that is there.
    """

    def __init__(self, folder=None, parameters=None, *, scale=None, odometry=None, new_session=False):
        self._slam = _interruptible(lambda: _core.Slam("" if folder is None else _os.fspath(folder), _values(parameters),
                                                       scale, odometry is not None, new_session))
        self._odometry, self._stream = odometry, _Stream()
        if self._slam.last_frame() is not None:
            before = self._slam.trajectories()[0]
            self._stream = _Stream(self._slam.last_frame() + 1, before["stamps"].max() + 0.1)

    def process(self, points, intensity=None, time=None, ring=None, *, stamp=None, frame=None, wheel_pose=None):
        """The next scan (LoopDetector.process). wheel_pose: 4 x 4, a first guess from wheels. Gives a SlamStep."""
        def work(scan):
            pose = wheel_pose
            if self._odometry:
                pose = self._odometry(Scan(scan, stamp=scan.stamp, frame=scan.frame))  # its own: it may keep it
            return self._slam.process(scan, pose)
        return self._stream.use(work, points, intensity, time, ring, stamp, frame)

    def finish(self):
        """Decides about loops that wait, and settles the graph: some seconds a thousand key frames. More scans may follow.

        After Ctrl-C it goes on behind the scenes; the next call waits for it."""
        _interruptible(self._slam.finish)

    def trajectory(self):
        """The corrected Trajectory, of all scans so far."""
        return Trajectory(**self._slam.trajectories()[0])

    def odometry_trajectory(self):
        """The Trajectory as odometry alone has it."""
        return Trajectory(**self._slam.trajectories()[1])

    def loops(self):
        """The loops in the graph, as a list of Loop."""
        return self._slam.loops()

    def map(self, progress=None):
        """The map's points, N x 4 float32, without what moved; intensities in [0, 1]. progress(done) is called with the
        key frames done."""
        return self._slam.map(progress)

    def write_map(self, folder, progress=None):
        """map.ply, map.pcd and tiles; gives the number of points. progress(done) is called with the key frames done."""
        return self._slam.write_map(_os.fspath(folder), progress)


class Localiser:
    """A saved map answers: where am I? map: what `revisit slam` or Slam(folder) wrote."""

    def __init__(self, map, parameters=None):
        map = _os.fspath(map)
        if not _os.path.exists(map):
            raise FileNotFoundError(2, "no such map", map)
        self._localiser, self._stream = _interruptible(lambda: _core.Localiser(map, _values(parameters))), _Stream()

    def locate(self, points, intensity=None, time=None, ring=None):
        """One scan without a prior: a Localisation."""
        return self._stream.look(self._localiser.locate, points, intensity, time, ring, None, None)

    def follow(self, points, intensity=None, time=None, ring=None, *, stamp=None, frame=None, wheel_pose=None):
        """The next scan of a drive: found, then followed. Gives a Localisation."""
        return self._stream.use(lambda scan: self._localiser.follow(scan, wheel_pose), points, intensity, time, ring, stamp,
                                frame)

    def expect(self, T_map_lidar):
        """Where the next scan is, to a few metres and 40 degrees."""
        self._localiser.expect(T_map_lidar)

    def __len__(self):
        """Places of the map."""
        return len(self._localiser)


class PlaceIndex:
    """Places by their descriptors, searched in two stages (docs/retrieval.md). One thread may add while others search."""

    def __init__(self, parameters=None, *, _index=None):
        self._index = _PlaceIndex(_values(parameters)) if _index is None else _index

    @classmethod
    def open(cls, path, parameters=None):
        """A saved index, in milliseconds however large it is."""
        if not _os.path.exists(path):
            raise FileNotFoundError(2, "no such index", _os.fspath(path))
        return cls(_index=_PlaceIndex.open(_os.fspath(path), _values(parameters)))

    def add(self, frame, descriptor, stamp=0.0):
        """Frames increase; otherwise ValueError."""
        self._index.add(frame, descriptor, stamp)

    def search(self, descriptor, places=None):
        """The best of the first `places` (all): structured array of match, geometry_score, intensity_score, yaw_rad."""
        return self._index.search(descriptor, places)

    def save(self, path):
        self._index.save(_os.fspath(path))

    @property
    def frames(self):
        """Of the places, in the order in which they were added: N, int64."""
        return self._index.frames

    @property
    def intensities(self):
        """Of all descriptors: N x rings x sectors, uint8; a copy."""
        return self._index.intensities

    @property
    def occupancies(self):
        """Of all descriptors: N x layers x rings x sectors, bool; a copy."""
        return self._index.occupancies

    def __len__(self):
        return len(self._index)


def open_recording(path, *, topic="", poses="", odometry_topic=""):
    """A Recording of anything that the program reads: KITTI folders, folders of scans, ROS bags (.bag, .mcap, .db3),
    packet captures, the .toml of a simulated drive. Indexable and iterable. topic: of the scans, where a bag has
    several. poses: a file of reference poses; a simulated drive has its own."""
    path = _os.fspath(path)
    if not _os.path.exists(path):
        raise FileNotFoundError(2, "no such recording", path)
    if path.endswith(".toml"):
        if poses:
            raise ValueError(f"poses is {poses!r}; a simulated recording has its own, exact poses")
        return _core.simulate(Parameters(file=path)._values)
    return _core.open_recording(path, topic, poses, odometry_topic)


def simulate(**options):
    """A Recording that is simulated: simulate(world="building", sensor="vlp16", seed=3); names and ranges:
    Parameters().simulation."""
    return _core.simulate(Parameters(simulation=options)._values)
