# SPDX-License-Identifier: Apache-2.0
"""What Python costs a scan: arrays into LoopDetector.process() against the same object of the library fed with scans that
are there already, turn about. usage: overhead.py [SCANS] [SENSOR]"""
import sys
import time

import numpy as np

import revisit
from revisit import _core

count, sensor = int(sys.argv[1]) if len(sys.argv) > 1 else 200, sys.argv[2] if len(sys.argv) > 2 else "hdl64e"
recording = revisit.simulate(world="town", sensor=sensor, seed=3, frames=count)
scans = [recording[i] for i in range(count)]
arrays = [np.array(scan.points) for scan in scans]
times = {"library": [], "Python": []}
detector, core = revisit.LoopDetector(), _core.LoopDetector(revisit.Parameters()._values, None)
for i, (scan, array) in enumerate(zip(scans, arrays)):
    ready = revisit.Scan(array, stamp=0.1 * i, frame=i)
    turns = [("library", lambda: core.process(ready, None)),
             ("Python", lambda: detector.process(array, stamp=0.1 * i, frame=i))]
    for name, work in turns if i % 2 == 0 else reversed(turns):
        start = time.perf_counter()
        work()
        times[name].append(time.perf_counter() - start)
times = {name: 1e3 * np.array(each) for name, each in times.items()}
library, cost = np.median(times["library"]), np.median(times["Python"] - times["library"])
print(f"{count} scans of {np.mean([len(scan) for scan in scans]):.0f} points ({sensor}): library {library:.2f} ms a scan, Python "
      f"{cost:.2f} ms more: {100 * cost / library:+.1f} % (medians, the second of differences scan by scan)")
