"""ROS 1's bags as rosbag itself writes them: what is left of a cut one is imported, and `cairn compile` makes a map of a drive.

bag_to_map_test.py CAIRN
"""
import json
import math
import pathlib
import subprocess
import sys
import tempfile
import unittest

import rosbag
import rospy
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import CameraInfo, Image
from tf2_msgs.msg import TFMessage

CAIRN = str(pathlib.Path(sys.argv[1]).resolve())
BAG_OF_CAPTURE = pathlib.Path(__file__).with_name("bag_of_capture.py")
NUM_IMAGES = 20
WIDTH, HEIGHT = 64, 48


def image(stamp, seed):
    message = Image(width=WIDTH, height=HEIGHT, encoding="mono8", step=WIDTH)
    message.header.stamp = stamp
    message.header.frame_id = "/camera_optical"  # tf 1 had slashes
    message.data = bytes((7 * x + 13 * y * seed) % 256 for y in range(HEIGHT) for x in range(WIDTH))
    return message


def camera_info(header):
    return CameraInfo(header=header, width=WIDTH, height=HEIGHT, distortion_model="plumb_bob", D=[0.1, 0.01, 0, 0, 0],
                      K=[50, 0, 32, 0, 51, 24, 0, 0, 1], P=[50, 0, 32, 0, 0, 51, 24, 0, 0, 0, 1, 0])


def odometry(stamp, x):
    message = Odometry(child_frame_id="base_link")
    message.header.stamp = stamp
    message.header.frame_id = "odom"
    message.pose.pose.position.x = x
    message.pose.pose.orientation.w = 1
    return message


def camera_on_robot(stamp):
    """Half a metre above the base; looks ahead: its z is the robot's x, its x the robot's -y."""
    link = TransformStamped(child_frame_id="camera_optical")
    link.header.stamp = stamp
    link.header.frame_id = "base_link"
    link.transform.translation.z = 0.5
    r = link.transform.rotation
    r.x, r.y, r.z, r.w = -0.5, 0.5, -0.5, 0.5
    return TFMessage([link])


def write_bag(path, compression):
    """A robot that drives a decimetre between two images; chunks of some images each."""
    with rosbag.Bag(str(path), "w", compression=compression, chunk_threshold=15000) as bag:
        for i in range(NUM_IMAGES):
            stamp = rospy.Time(1000 + i, 500)
            picture = image(stamp, i)
            if i == 0:
                bag.write("/tf_static", camera_on_robot(stamp), stamp)
            bag.write("/camera/image_raw", picture, stamp)
            bag.write("/camera/camera_info", camera_info(picture.header), stamp)
            bag.write("/odom", odometry(stamp, 0.1 * i), stamp)


def run_import(bag, capture):
    return subprocess.run([CAIRN, "import", bag, "-o", capture, "--keyframes", "all"], capture_output=True, text=True)


class ABag(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def contents(self, capture):
        return {str(p.relative_to(capture)): p.read_bytes() for p in sorted(capture.rglob("*")) if p.is_file()}

    def test_a_cut_bag_gives_what_is_whole(self):
        bag = self.folder / "whole.bag"
        write_bag(bag, "lz4")
        whole = run_import(bag, self.folder / "whole")
        self.assertEqual(whole.returncode, 0, whole.stderr)
        contents = bag.read_bytes()
        cut = self.folder / "cut.bag"
        cut.write_bytes(contents[:len(contents) // 2])
        with self.assertRaises(rosbag.bag.ROSBagException):  # the index is gone, without which rosbag reads nothing
            rosbag.Bag(str(cut))
        run = run_import(cut, self.folder / "cut")
        self.assertEqual(run.returncode, 0, run.stderr)
        self.assertIn("in the middle of a record", run.stderr)
        before, after = self.contents(self.folder / "whole"), self.contents(self.folder / "cut")
        images = [name for name in after if name.startswith("images/")]
        self.assertTrue(0 < len(images) < NUM_IMAGES, images)
        for name in images:
            self.assertEqual(after[name], before[name])

    def test_a_rendered_drive_becomes_a_capture(self):
        """Odometry that measures all lengths 2 % too long, and each step by 2 % more or less."""
        (self.folder / "simulate.toml").write_text("width_m = 5.5\ndepth_m = 6\nnum_rooms = 2\nsurvey = 'driven'\nstep_m = 0.15\n"
                                                   "image_width_px = 320\nimage_height_px = 240\nnum_queries = 0\n")
        truth, bag, capture = self.folder / "truth", self.folder / "drive.bag", self.folder / "drive"
        for command in ([CAIRN, "stage", "simulate", self.folder / "simulate.toml", "-o", truth],
                        [sys.executable, BAG_OF_CAPTURE, truth, bag, "--images", "0,40"]):
            subprocess.run(command, check=True, capture_output=True)
        run = run_import(bag, capture)
        self.assertEqual(run.returncode, 0, run.stderr)
        self.assertNotIn("warning", run.stderr)
        # Where the cameras were, one after the other: images are copied as they are.
        self.assertEqual([p.read_bytes() for p in sorted((capture / "images").iterdir())],
                         [p.read_bytes() for p in sorted((truth / "images").iterdir())[:40]])
        lines = (capture / "odometry.txt").read_text().splitlines()
        measured = [list(map(float, line.split()[1:4])) for line in lines]
        true = [self.centre(line) for line in sorted((line for line in (truth / "images.txt").read_text().splitlines()
                                                      if line.endswith(".jpg")), key=lambda line: line.split()[9])[:40]]
        self.assertAlmostEqual(length(measured) / length(true), 1.02, delta=0.01)

    def test_one_command_makes_a_map_in_metres_of_a_bag(self):
        (self.folder / "simulate.toml").write_text("width_m = 5.5\ndepth_m = 6\nnum_rooms = 2\nsurvey = 'driven'\nstep_m = 0.08\n"
                                                   "max_turn_deg = 5\ntexel_m = 0.006\nimage_width_px = 400\n"
                                                   "image_height_px = 300\nnum_queries = 0\n")
        for command in ([CAIRN, "stage", "simulate", self.folder / "simulate.toml", "-o", self.folder / "truth"],
                        [sys.executable, BAG_OF_CAPTURE, self.folder / "truth", self.folder / "drive.bag", "--images", "0,150"]):
            subprocess.run(command, check=True, capture_output=True)

        def compile_again(what):
            run = subprocess.run([CAIRN, "compile", what, "-o", "map.cairn"], capture_output=True, text=True, cwd=self.folder)
            self.assertEqual(run.returncode, 0, run.stderr)
            return run
        self.assertIn("map.toml: the recipe of drive.bag", compile_again("drive.bag").stdout)
        frame = json.loads((self.folder / "map.build/poses/frame.json").read_text())
        self.assertEqual((frame["unit"], frame["source"]), ("metre", "odometry"))
        inspected = subprocess.run([CAIRN, "inspect", "map.cairn"], capture_output=True, text=True, cwd=self.folder)
        self.assertRegex(inspected.stdout, r"unit +metre\n")
        self.assertIn("up to date", compile_again("drive.bag").stdout)
        with open(self.folder / "map.toml", "a") as recipe:
            recipe.write("topic = '/camera/image_raw/compressed'\n")
        self.assertIn("bag-drive: options/bag-drive changed", compile_again("map.toml").stderr)
        self.assertIn("up to date", compile_again("map.toml").stdout)

    def centre(self, line):
        w, x, y, z, *t = map(float, line.split()[1:8])
        rows = [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]
        return [-sum(rows[i][j] * t[i] for i in range(3)) for j in range(3)]


def length(places):
    return sum(math.dist(a, b) for a, b in zip(places, places[1:]))


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
