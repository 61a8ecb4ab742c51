"""Floor plans in Python: where a scan was taken, where a robot with a laser is.

python_plan_test.py POSTER PROGRAM [PLAN LOG [NUM]]: the folder of make_poster_map (tests/install/laser_room.h draws its room), the program
`cairn`.  With a plan and a log it compares what both believe of this log's first NUM scans, all by default.
"""
import json
import math
import pathlib
import subprocess
import sys
import tempfile
import threading
import unittest

import numpy

import cairn

POSTER = pathlib.Path(sys.argv[1])
PROGRAM = sys.argv[2]
PLAN = POSTER / "laser.cairn"
LOG = sys.argv[3:5]
NUM_SCANS = int(sys.argv[5]) if len(sys.argv) > 5 else None
START = numpy.array([-4, 0, 0.1])  # x, y, heading of the drive's first scan


def read_pgm(path):
    contents = pathlib.Path(path).read_bytes()
    size, rest = contents.split(b"\n255\n", 1)
    width, height = (int(number) for number in size.split()[-2:])
    return numpy.frombuffer(rest, numpy.uint8).reshape(height, width)


def drive():
    """Motions (ahead, left, turn) and ranges of scans."""
    for line in (POSTER / "scans.txt").read_text().splitlines():
        if not line.startswith("#"):
            numbers = numpy.array(line.split(), float)
            yield numbers[:3], numbers[3:]


def scan_of(ranges, **others):
    return cairn.Scan(ranges, **{"first_angle_rad": -math.pi, "step_rad": math.radians(2), "max_range_m": 6, **others})


def moved(pose, motion):
    x, y, heading = pose
    c, s = math.cos(heading), math.sin(heading)
    return numpy.array([x + c * motion[0] - s * motion[1], y + s * motion[0] + c * motion[1], heading + motion[2]])


def told(places):
    """Of a place all that the program prints."""
    return [[*place.position, place.heading_rad * 180 / math.pi, place.probability, place.is_determined, *place.covariance.T.ravel()]
            for place in places]


def printed(line):
    return [[place["x"], place["y"], place["heading_deg"], place["probability"], place["determined"], *place["covariance"]]
            for place in line["places"]]


class Drive(unittest.TestCase):
    def setUp(self):
        self.plan = cairn.Plan.open(PLAN)
        self.steps = list(drive())

    def assertIsAt(self, place, pose, delta=0.05):
        numpy.testing.assert_allclose(place.position, pose[:2], atol=delta)
        self.assertAlmostEqual(math.remainder(place.heading_rad - pose[2], 2 * math.pi), 0, delta=delta)


class Answers(Drive):
    def test_a_plan_is_that_of_a_map(self):
        self.assertEqual(self.plan.walls.shape, (13, 4))
        self.assertEqual(self.plan.walls[0].tolist(), [-5, -2.5, 3, -2.5])
        self.assertEqual(cairn.Plan.of_map(cairn.Map.open(PLAN)).walls.tolist(), self.plan.walls.tolist())
        self.assertIn("13 walls", repr(self.plan))

    def test_a_scan_is_located(self):
        locator = cairn.ScanLocator(self.plan)
        pose = START
        for motion, ranges in self.steps[:1]:
            found = locator.locate(scan_of(ranges))
            self.assertTrue(found.is_complete)
            first = found.places[0]
            self.assertIsAt(first, pose)
            self.assertGreater(first.probability, 0.9)
            self.assertGreater(first.explained_ratio, 0.9)
            self.assertTrue(first.is_determined)
            self.assertEqual(first.covariance.shape, (3, 3))
            self.assertGreater(numpy.linalg.eigvalsh(first.covariance)[0], 0)
            self.assertIn("PlanPlace at (-4.0", repr(first))
            self.assertLessEqual(sum(place.probability for place in found.places), 1 + 1e-9)
            probabilities = [place.probability for place in found.places]
            self.assertEqual(probabilities, sorted(probabilities, reverse=True))

    def test_angles_may_be_stated_one_by_one(self):
        locator = cairn.ScanLocator(self.plan)
        _, ranges = self.steps[0]
        equal = scan_of(ranges)
        stated = cairn.Scan(ranges, equal.angles, max_range_m=6)
        self.assertEqual(told(locator.locate(stated).places), told(locator.locate(equal).places))
        order = numpy.random.default_rng(1).permutation(len(ranges))  # beams in any order
        self.assertIsAt(locator.locate(cairn.Scan(ranges[order], equal.angles[order], max_range_m=6)).places[0], START)
        turned = cairn.Scan(ranges.tolist(), (equal.angles - 0.5).tolist(), max_range_m=6)
        self.assertIsAt(locator.locate(turned).places[0], START + [0, 0, 0.5])
        self.assertEqual(len(stated), len(ranges))
        numpy.testing.assert_array_equal(stated.ranges, ranges)
        self.assertIsNone(stated.odometry)

    def test_is_believed_as_the_program_believes(self):
        """Messages of ROS as JSON lines, with wheels that began elsewhere; by moves and by poses of the wheels."""
        wheels = numpy.array([20, 10, 2.0])
        lines, poses = [], []
        for number, (motion, ranges) in enumerate(self.steps):
            wheels = moved(wheels, motion)
            stamp = {"stamp": {"sec": number, "nanosec": 0}}
            lines.append({"header": stamp, "pose": {"pose": {"position": {"x": wheels[0], "y": wheels[1], "z": 0}, "orientation": {
                "x": 0, "y": 0, "z": math.sin(wheels[2] / 2), "w": math.cos(wheels[2] / 2)}}}, "twist": {}})
            lines.append({"header": stamp, "angle_min": -math.pi, "angle_increment": math.radians(2), "range_min": 0, "range_max": 6,
                          "ranges": list(ranges)})
            poses.append(wheels)
        with tempfile.TemporaryDirectory() as folder:
            log = pathlib.Path(folder) / "drive.jsonl"
            log.write_text("".join(json.dumps(line) + "\n" for line in lines))
            tracker, by_moves = self.compare(PLAN, log), cairn.PlanTracker(self.plan)
            scans = cairn.read_scans(log)
        self.assertEqual(len(scans), len(self.steps))
        for number, (motion, ranges) in enumerate(self.steps):
            numpy.testing.assert_allclose(scans[number].odometry, poses[number], atol=1e-9)
            numpy.testing.assert_array_equal(scans[number].ranges, ranges)
            by_moves.move(*motion)
            by_moves.see_scan(scan_of(ranges))
        self.assertGreater(tracker.places[0].probability, 0.99)
        for one, other in zip(tracker.places, by_moves.places):
            numpy.testing.assert_allclose(told([one])[0], told([other])[0], atol=1e-6)

    def compare(self, plan, log, num_scans=None):
        """A tracker that was told a log's scans and wheels: after each scan it believed what the program prints."""
        run = subprocess.run([PROGRAM, "plan", "follow", plan, log], capture_output=True, check=True, text=True)
        lines = [json.loads(line) for line in run.stdout.splitlines()]
        scans = cairn.read_scans(log)
        self.assertEqual(len(scans), len(lines))
        tracker = cairn.PlanTracker(cairn.Plan.open(plan))
        for line, scan in list(zip(lines, scans))[:num_scans]:
            tracker.move_to(*scan.odometry)
            try:
                tracker.see_scan(scan)
            except cairn.Error as error:
                self.assertEqual((error.name, str(error)), ("no_data", line["reason"]))
            places = [place for place in tracker.places if place.probability >= 0.001][:20]
            numpy.testing.assert_array_equal(told(places), printed(line))
            self.assertEqual(tracker.elsewhere, line["elsewhere"])
        print(f"\n{log}: what is believed after {len(lines[:num_scans])} scans is what the program prints, to the last bit")
        return tracker

    @unittest.skipUnless(LOG, "no log is given")
    def test_of_a_log_of_yours_as_the_program(self):
        self.compare(*LOG, NUM_SCANS)

    def test_where_laser_and_camera_stand_counts(self):
        tracker = cairn.PlanTracker(self.plan, laser_ahead_m=0.5, laser_left_m=-0.1, laser_turn_deg=20)
        tracker.see_scan(scan_of(self.steps[0][1]))
        heading = START[2] - math.radians(20)
        self.assertIsAt(tracker.places[0], moved(moved(START, (0, 0, -math.radians(20))), (-0.5, 0.1, 0)))
        self.assertAlmostEqual(tracker.places[0].heading_rad, heading, delta=0.02)
        tracker.move(0, 0, 1)  # on the spot: the robot stays, its laser does not
        self.assertIsAt(tracker.places[0], moved(moved(START, (0, 0, -math.radians(20))), (-0.5, 0.1, 1)))

    def test_images_count_too(self):
        map = cairn.Map.open(PLAN)
        fix = cairn.Localizer(map).localize(read_pgm(POSTER / "room8.pgm"))  # from (-3.6, 0)
        tracker = cairn.PlanTracker(cairn.Plan.of_map(map), camera_ahead_m=0.4)
        tracker.see_fix(map, fix)
        self.assertIsAt(tracker.places[0], START - [0, 0, 0.1])
        before = tracker.places[0].probability
        self.assertGreater(before, 0.5)
        tracker.see_fix(map, cairn.Localizer(map).localize(numpy.full((240, 320), 90, numpy.uint8)))  # nothing
        self.assertEqual(tracker.places[0].probability, before)
        tracker.move(0, 0, 0.1)
        tracker.see_scan(scan_of(self.steps[0][1]))
        self.assertIsAt(tracker.places[0], START)
        self.assertGreater(tracker.places[0].probability, max(before, 0.99))

    def test_another_sense_says_its_places(self):
        tracker = cairn.PlanTracker(self.plan)
        near = cairn.PlanPlace([-4, 0], 0.1, 0.01 * numpy.eye(3), 0.6)
        self.assertTrue(near.is_determined)
        self.assertFalse(cairn.PlanPlace([-4, 0], 0.1, numpy.eye(3), 0.6).is_determined)
        tracker.see_places([near, cairn.PlanPlace([1, 0], 3, 0.01 * numpy.eye(3), 0.3)])
        self.assertAlmostEqual(tracker.places[0].probability, 0.6, delta=0.02)
        self.assertAlmostEqual(tracker.places[0].probability + tracker.places[1].probability + tracker.elsewhere, 1, places=9)
        for wrong, words in (([cairn.PlanPlace([0, 0], 0, numpy.eye(3), 2)], "probability of 2"), ([near, near], "sum to 1.2"),
                             ([cairn.PlanPlace([0, math.nan], 0, numpy.eye(3), 0.5)], "not finite"),
                             ([cairn.PlanPlace([0, 0], 0, -numpy.eye(3), 0.5)], "no variance")):
            with self.assertRaises(cairn.Error) as refused:
                tracker.see_places(wrong)
            self.assertIn(words, str(refused.exception))
            self.assertEqual(refused.exception.name, "invalid_argument")
        for wrong in (lambda: cairn.PlanPlace([0], 0, numpy.eye(3), 1), lambda: cairn.PlanPlace([0, 0], 0, numpy.eye(2), 1),
                      lambda: cairn.PlanPlace([0, 0], 0, [[1, 2], [3]], 1)):
            self.assertRaises(ValueError, wrong)


class Refuses(Drive):
    def test_scans_that_cannot_be(self):
        ranges = self.steps[0][1]
        for make, words in ((lambda: scan_of([]), "0 beams"), (lambda: scan_of(numpy.ones((3, 3))), "2 dimensions"),
                            (lambda: scan_of(numpy.ones(100001)), "100001 beams"), (lambda: cairn.Scan(ranges), "what is the step"),
                            (lambda: scan_of(ranges, step_rad=2), "degrees"), (lambda: scan_of(ranges, step_rad=math.nan), "angle of beam"),
                            (lambda: scan_of(ranges, max_range_m=-1), "largest range"), (lambda: scan_of(ranges, max_range_m=math.nan), "largest"),
                            (lambda: cairn.Scan(ranges, numpy.arange(5.0)), "180 ranges and 5 angles"),
                            (lambda: cairn.Scan(ranges, numpy.array([])), "angles are empty"),
                            (lambda: cairn.Scan(ranges, numpy.full(180, math.inf)), "angle of beam 0")):
            with self.assertRaises(ValueError) as refused:
                make()
            self.assertIn(words, str(refused.exception))
        for make in (lambda: scan_of("all around"), lambda: scan_of(None), lambda: cairn.Scan(ranges, angles="none")):
            self.assertRaises((TypeError, ValueError), make)

    def test_scans_that_say_nothing(self):
        locator, tracker = cairn.ScanLocator(self.plan), cairn.PlanTracker(self.plan)
        tracker.see_scan(scan_of(self.steps[0][1]))
        before = told(tracker.places)
        for value in (-1, 0, math.nan, math.inf):
            for ask in (locator.locate, tracker.see_scan):
                with self.assertRaises(cairn.Error) as refused:
                    ask(scan_of(numpy.full(180, value)))
                self.assertEqual(refused.exception.name, "no_data")
        self.assertEqual(told(tracker.places), before)

    def test_files_motions_options_and_types(self):
        tracker = cairn.PlanTracker(self.plan)
        for ask, name in ((lambda: cairn.Plan.open("/nowhere/plan.db"), "not_found"), (lambda: cairn.Plan.open(POSTER / "poster.cairn"), "not_found"),
                          (lambda: cairn.Plan.of_map(cairn.Map.open(POSTER / "poster.cairn")), "not_found"),
                          (lambda: cairn.read_scans("/nowhere/a.log"), "not_found"), (lambda: cairn.read_scans(__file__), "no_data"),
                          (lambda: tracker.move(math.nan, 0, 0), "invalid_argument"), (lambda: tracker.move_to(0, math.inf, 0), "invalid_argument"),
                          (lambda: cairn.PlanTracker(self.plan, surprise=0.1), "invalid_argument"),
                          (lambda: cairn.PlanTracker(self.plan, laser_turn_deg=200), "invalid_argument"),
                          (lambda: cairn.PlanTracker(self.plan, search="vir"), "invalid_argument"),
                          (lambda: cairn.ScanLocator(self.plan, surprise_ratio=0.1), "invalid_argument")):
            with self.assertRaises(cairn.Error) as refused:
                ask()
            self.assertEqual(refused.exception.name, name)
        for wrong in (lambda: cairn.Plan.open(""), lambda: cairn.PlanTracker(3), lambda: tracker.see_scan([1, 2]),
                      lambda: cairn.PlanTracker.__new__(cairn.PlanTracker).elsewhere, lambda: cairn.Scan.__new__(cairn.Scan).ranges,
                      lambda: tracker.see_fix(self.plan, None)):
            self.assertRaises((TypeError, ValueError), wrong)
        self.assertEqual((tracker.places, tracker.elsewhere), ([], 1))

    def test_a_tracker_is_for_one_thread_a_locator_for_all(self):
        tracker, locator = cairn.PlanTracker(self.plan), cairn.ScanLocator(self.plan)
        scan = scan_of(self.steps[0][1])
        expected, said = told(locator.locate(scan).places), []

        def ask():
            for _ in range(5):
                try:
                    tracker.see_scan(scan)
                    said.append("seen")
                except cairn.Error as error:
                    said.append(error.name)
                said.append(told(locator.locate(scan).places) == expected)

        threads = [threading.Thread(target=ask) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertIn("seen", said)
        self.assertLessEqual({str(each) for each in said}, {"seen", "busy", "True"})


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
