"""A rendered drive as a bag of ROS 1, written by ROS's own library, and as one of ROS 2: cairn import gives it back.

bag_test.py CAIRN

The robot carries the camera 0.2 m ahead of its base, 1 m up.  Its wheels measure each step with an error of 2 %.
"""
import pathlib
import subprocess
import sys
import tempfile
import unittest

import genpy
import numpy
import rosbag
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import CameraInfo, CompressedImage
from tf2_msgs.msg import TFMessage

from ros2_bags import write_db3, write_mcap

CAIRN = sys.argv[1]
SECONDS_PER_IMAGE = 0.25
ODOMETRY_PER_IMAGE = 3  # between the images' stamps, not at them
START = 1_700_000_000
OPTICAL = (-0.5, 0.5, -0.5, 0.5)  # x y z w: x right, y down, z ahead in a frame with x ahead and z up


def rotation(q):
    x, y, z, w = q
    return numpy.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


def cairn(*arguments):
    run = subprocess.run([CAIRN, *map(str, arguments)], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    return run


def read_drive(capture):
    """Names and floor poses (x, y, yaw) of the base, in the order of the drive."""
    names, poses = [], []
    for line in (capture / "images.txt").read_text().splitlines():
        words = line.split()
        if len(words) != 10 or line.startswith("#"):
            continue
        w, x, y, z = map(float, words[1:5])
        turn = rotation((x, y, z, w))
        centre = -turn.T @ numpy.array(list(map(float, words[5:8])))
        ahead = turn[2]  # the optical axis in the world
        yaw = numpy.arctan2(ahead[1], ahead[0])
        names.append(words[9])
        poses.append((centre[0] - 0.2 * numpy.cos(yaw), centre[1] - 0.2 * numpy.sin(yaw), yaw))
    poses = numpy.array(poses)
    poses[:, 2] = numpy.unwrap(poses[:, 2])
    return names, poses


def measure(poses, seed):
    """Times and poses of wheel odometry, whose steps are each wrong by 2 %."""
    noise = numpy.random.default_rng(seed)
    fine = numpy.arange(len(poses) * ODOMETRY_PER_IMAGE + 1) / ODOMETRY_PER_IMAGE - 0.5 / ODOMETRY_PER_IMAGE
    truth = numpy.stack([numpy.interp(fine, numpy.arange(len(poses)), poses[:, i]) for i in range(3)], axis=1)
    measured = [(0.0, 0.0, 0.0)]
    for before, after in zip(truth, truth[1:]):
        ahead = after[:2] - before[:2]
        turned = numpy.array([[numpy.cos(before[2]), numpy.sin(before[2])], [-numpy.sin(before[2]), numpy.cos(before[2])]])
        step = turned @ ahead * (1 + 0.02 * noise.standard_normal())
        turn = (after[2] - before[2]) * (1 + 0.02 * noise.standard_normal())
        x, y, yaw = measured[-1]
        measured.append((x + numpy.cos(yaw) * step[0] - numpy.sin(yaw) * step[1],
                         y + numpy.sin(yaw) * step[0] + numpy.cos(yaw) * step[1], yaw + turn))
    return fine * SECONDS_PER_IMAGE, numpy.array(measured)


def stamp(seconds):
    return genpy.Time(*divmod(START * 10**9 + round(seconds * 1e9), 10**9))


def messages_of(capture, names, times, measured):
    """(topic, ROS 1 message, record time in seconds), in the order of time."""
    link = TransformStamped()
    link.header.frame_id, link.child_frame_id = "base_link", "camera_optical"
    link.transform.translation.x, link.transform.translation.z = 0.2, 1.0
    rotation_fields(link.transform.rotation, OPTICAL)
    result = [("/tf_static", TFMessage([link]), -0.2)]
    width, height, fx, fy, cx, cy = (float(v) for v in (capture / "cameras.txt").read_text().split()[-6:])
    for i, name in enumerate(names):
        time = i * SECONDS_PER_IMAGE
        info = CameraInfo(width=int(width), height=int(height), distortion_model="plumb_bob", D=[0] * 5,
                          K=[fx, 0, cx - 0.5, 0, fy, cy - 0.5, 0, 0, 1], R=[1, 0, 0, 0, 1, 0, 0, 0, 1],
                          P=[fx, 0, cx - 0.5, 0, 0, fy, cy - 0.5, 0, 0, 0, 1, 0])
        image = CompressedImage(format="jpeg", data=(capture / "images" / name).read_bytes())
        for message in (info, image):
            message.header.stamp, message.header.frame_id = stamp(time), "camera_optical"
        result += [("/camera/camera_info", info, time), ("/camera/image_raw/compressed", image, time)]
    for time, (x, y, yaw) in zip(times, measured):
        odometry = Odometry(child_frame_id="base_link")
        odometry.header.stamp, odometry.header.frame_id = stamp(time), "odom"
        odometry.pose.pose.position.x, odometry.pose.pose.position.y = x, y
        rotation_fields(odometry.pose.pose.orientation, (0, 0, numpy.sin(yaw / 2), numpy.cos(yaw / 2)))
        result.append(("/odom", odometry, time))
    return sorted(result, key=lambda message: message[2])


def rotation_fields(field, q):
    field.x, field.y, field.z, field.w = q


def write_ros1(path, messages, compression):
    with rosbag.Bag(str(path), "w", compression=compression, chunk_threshold=100_000) as bag:
        for topic, message, time in messages:
            bag.write(topic, message, stamp(time))


def write_ros2(path, messages):
    timed = [(topic, message, stamp(time).to_nsec()) for topic, message, time in messages]
    (write_db3 if path.suffix == ".db3" else write_mcap)(path, timed)


def read_odometry(capture):
    lines = [line.split() for line in (capture / "odometry.txt").read_text().splitlines()]
    return {words[0]: numpy.array(list(map(float, words[1:]))) for words in lines}


class ABagOfADrive(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.root = pathlib.Path(cls.temporary.name)
        cls.drive = cls.root / "drive"
        cairn("stage", "simulate", "--survey", "driven", "--step-m", 0.2, "--num-rooms", 2, "--num-queries", 0,
              "--image-width-px", 320, "--image-height-px", 240, "--progress", "none", "-o", cls.drive)
        cls.names, cls.poses = read_drive(cls.drive)
        cls.times, cls.measured = measure(cls.poses, 7)
        cls.messages = messages_of(cls.drive, cls.names, cls.times, cls.measured)
        cls.stamps = [f"{START + int(i * SECONDS_PER_IMAGE)}.{round(i * SECONDS_PER_IMAGE % 1 * 1e9):09}.jpg"
                      for i in range(len(cls.names))]

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def check(self, capture):
        self.assertFalse((capture / "images.txt").exists())
        original = dict(zip(self.stamps, self.names))
        images = sorted(path.name for path in (capture / "images").iterdir())
        for name in images:
            self.assertEqual((capture / "images" / name).read_bytes(),
                             (self.drive / "images" / original[name]).read_bytes(), name)
        words = [(folder / "cameras.txt").read_text().split()[-7:] for folder in (capture, self.drive)]
        self.assertEqual(words[0][0], words[1][0])
        numpy.testing.assert_allclose(*[numpy.array(w[1:], float) for w in words])
        odometry = read_odometry(capture)
        self.assertEqual(sorted(odometry), images)
        for i, name in enumerate(self.stamps):
            if name not in odometry:
                continue
            x, y, yaw = (numpy.interp(i * SECONDS_PER_IMAGE, self.times, self.measured[:, k]) for k in range(3))
            place = (x + 0.2 * numpy.cos(yaw), y + 0.2 * numpy.sin(yaw), 1)
            numpy.testing.assert_allclose(odometry[name][:3], place, atol=1e-6, err_msg=name)
            axes = rotation(odometry[name][3:])
            numpy.testing.assert_allclose(axes[:, 2], (numpy.cos(yaw), numpy.sin(yaw), 0), atol=1e-6)
            numpy.testing.assert_allclose(axes[:, 1], (0, 0, -1), atol=1e-6)
        return images, odometry

    def test_comes_back_from_ros_1_and_ros_2(self):
        captures = []
        for compression in (rosbag.Compression.NONE, rosbag.Compression.BZ2, rosbag.Compression.LZ4):
            path = self.root / f"{compression}.bag"
            write_ros1(path, self.messages, compression)
            captures.append(self.root / f"capture_{compression}")
            run = cairn("import", path, "-o", captures[-1], "--keyframes", "all")
            self.assertNotIn("warning", run.stderr)
        for form in ("db3", "mcap"):
            path = self.root / f"drive.{form}"
            write_ros2(path, self.messages)
            captures.append(self.root / f"capture_{form}")
            run = cairn("import", path, "-o", captures[-1], "--keyframes", "all")
            self.assertNotIn("warning", run.stderr)
        for capture in captures:
            images, _ = self.check(capture)
            self.assertEqual(images, self.stamps)
            self.assertEqual((capture / "odometry.txt").read_bytes(), (captures[0] / "odometry.txt").read_bytes())
        # Two in a hundred of each step, at random, are less of the whole way.
        odometry = numpy.array([pose[:2] for _, pose in sorted(read_odometry(captures[0]).items())])
        ways = [numpy.linalg.norm(numpy.diff(places, axis=0), axis=1).sum() for places in
                (odometry, self.poses[:, :2] + 0.2 * numpy.stack([numpy.cos(self.poses[:, 2]), numpy.sin(self.poses[:, 2])], 1))]
        self.assertLess(abs(ways[0] / ways[1] - 1), 0.02)

    def test_has_fewer_images_as_keyframes(self):
        path = self.root / "keyframes.bag"
        write_ros1(path, self.messages, rosbag.Compression.LZ4)
        run = cairn("import", path, "-o", self.root / "keyframes")
        images, _ = self.check(self.root / "keyframes")
        self.assertRegex(run.stdout, rf"import: {len(images)} of {len(self.names)} images of /camera/image_raw/compressed, "
                                     rf"{len(images)} of them with odometry, 1 cameras")
        self.assertGreater(len(images), 20)
        self.assertLess(len(images), len(self.names))


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1], verbosity=2)
