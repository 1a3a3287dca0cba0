# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

import revisit

XYZI = np.array([[1, 2, 3, 0.5], [4, 5, 6, 7], [-1, 0, 2, 0]], dtype=np.float32)


def of(*arguments, **named):
    return revisit.Scan(*arguments, **named).points


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_layouts_of_memory(kind):
    array = XYZI.astype(kind)
    wide = np.full((6, 9), np.nan, dtype=kind)
    wide[::2, 1::2] = array
    read_only = array.copy()
    read_only.flags.writeable = False
    for same in (array, np.asfortranarray(array), wide[::2, 1::2], array[::-1][::-1], read_only, array.tolist()):
        before = np.array(same, copy=True)
        np.testing.assert_array_equal(of(same), XYZI)
        np.testing.assert_array_equal(np.array(same), before)
    np.testing.assert_array_equal(of(array[:, :3])[:, 3], 0)
    np.testing.assert_array_equal(of(array[:, :3], intensity=[9, 8, 7])[:, 3], [9, 8, 7])


def test_structured_arrays():
    records = np.zeros(3, dtype=[("pad", "u1"), ("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "u2"), ("ring", "u1"),
                                 ("time", "<f8")])
    records["x"], records["y"], records["z"] = XYZI[:, 0], XYZI[:, 1], XYZI[:, 2]
    records["intensity"], records["ring"], records["time"] = [3, 2, 1], [0, 1, 2], [0.0, 0.05, 0.09]
    scan = revisit.Scan(records)
    np.testing.assert_array_equal(scan.points[:, :3], XYZI[:, :3])
    np.testing.assert_array_equal(scan.points[:, 3], [3, 2, 1])
    np.testing.assert_array_equal(scan.rings, [0, 1, 2])
    np.testing.assert_allclose(scan.times, [0.0, 0.05, 0.09], atol=1e-6)
    np.testing.assert_array_equal(of(records[::-1])[:, 3], [1, 2, 3])
    with pytest.raises(ValueError, match="x"):
        revisit.Scan(np.zeros(3, dtype=[("a", "f4")]))


def test_points_that_are_none_go_with_their_columns():
    array = np.array([[np.nan, 0, 0], [1, 1, 1], [0, 0, 0], [2, np.inf, 0], [3, 3, 3]])
    scan = revisit.Scan(array, intensity=range(5), time=[0, 0.1, 0.2, 0.3, 0.4], ring=range(5))
    np.testing.assert_array_equal(scan.points[:, 3], [1, 4])
    np.testing.assert_array_equal(scan.rings, [1, 4])
    np.testing.assert_allclose(scan.times, [0.1, 0.4])
    assert len(scan) == 2


@pytest.mark.parametrize("place", [0, 1, 1023, 1024, 4099, 4100, 4101, 4102])
@pytest.mark.parametrize("none", [[0, 0, 0, 1], [1, np.nan, 1, 1], [1, 1, -np.inf, 1], [-0.0, 0, -0.0, np.nan]])
def test_one_point_that_is_none_is_found_wherever_it_lies(place, none):
    array = np.full((4103, 4), 2, dtype=np.float32)
    array[place] = none
    assert len(revisit.Scan(array)) == 4102
    array[place] = [0, 1, 1, 1]  # to the left of the sensor
    assert len(revisit.Scan(array)) == 4103


@pytest.mark.parametrize("points, says", [
    (np.zeros((3, 5)), r"\(3, 5\) of float64; allowed: \(N, 3\)"), (np.zeros(4), "allowed"), (np.zeros((2, 3), dtype=int), "int64"),
    (np.zeros((2, 3), dtype=">f4"), "allowed"), (np.zeros((2, 3), dtype=np.float16), "float16"), ("text", "allowed")])
def test_others_are_refused(points, says):
    with pytest.raises(ValueError, match=says):
        revisit.Scan(points)


def test_what_columns_may_hold():
    for named in ({"ring": [-1, 0, 1]}, {"ring": [0, 1.5, 2]}, {"ring": [0, np.nan, 2]}, {"time": [0, 1e9, 0]},
                  {"intensity": ["a", "b", "c"]}, {"stamp": np.nan}):
        with pytest.raises(ValueError):
            revisit.Scan(XYZI, **named)
    for dtype in ([("x", ">f4"), ("y", ">f4"), ("z", ">f4")], [("x", "f4"), ("y", "f4"), ("z", "f4"), ("intensity", "i8")]):
        with pytest.raises(ValueError, match="field"):
            revisit.Scan(np.ones(3, dtype=dtype))
    with pytest.raises(ValueError):
        revisit.Scan([[1, 2, 3], [1, 2]])
    for full_scale in (0, -1, np.nan):
        with pytest.raises(ValueError):
            revisit.IntensityScale(full_scale)


def test_times_count_from_the_stamp():
    records = np.ones(3, dtype=[("x", "f4"), ("y", "f4"), ("z", "f4"), ("timestamp", "f8")])
    records["timestamp"] = 100.0 + np.array([-0.05, 0.0, 0.04])
    np.testing.assert_allclose(revisit.Scan(records, stamp=100.0).times, [-0.05, 0.0, 0.04], atol=1e-6)


def test_columns_of_another_length_are_refused():
    with pytest.raises(ValueError, match=r"intensity has shape \(2\).*one value a point, 3"):
        revisit.Scan(XYZI, intensity=[1, 2])
    with pytest.raises(ValueError, match="its own"):
        revisit.Scan(revisit.Scan(XYZI), time=[1, 2, 3])


def test_views_keep_their_scan_and_cannot_be_written():
    points = revisit.Scan(XYZI).points
    np.testing.assert_array_equal(points, XYZI)
    with pytest.raises(ValueError):
        points[0, 0] = 1
