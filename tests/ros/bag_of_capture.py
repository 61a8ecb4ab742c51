#!/usr/bin/env python3
"""A bag of a capture with poses: what a robot would have recorded on that way.

bag_of_capture.py CAPTURE BAG [--noise 0.02] [--common RATIO] [--noise-length 0] [--hz 10] [--compression none|bz2|lz4]
                  [--images FIRST,COUNT]

BAG ends in .bag (ROS 1), .mcap or .db3 (ROS 2).  Topics: /camera/image_raw/compressed (the capture's files),
/camera/camera_info, /odom, /tf_static.  Images follow each other in the order of names, one a tick.  The camera is mounted
0.2 m ahead of the robot's base, and looks ahead.  Odometry begins at the identity.  The length of each of its steps, and its
turn, are off by Gaussians of `noise` of themselves, drawn anew at each step, or after `noise-length` metres; all lengths by
`common` as well, as of wheels of another size (without it, by `noise`).  Seed 1.  Needs python3-rosbag, python3-nav-msgs,
python3-tf2-msgs.
"""
import argparse
import pathlib

import numpy as np
import rosbag
import rospy
from geometry_msgs.msg import Pose, TransformStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import CameraInfo, CompressedImage
from tf2_msgs.msg import TFMessage

from ros2_bags import write_db3, write_mcap

# The optical frame (x right, y down, z ahead) on a base whose x is ahead and whose z is up.
BASE_FROM_CAMERA = np.array([[0, 0, 1, 0.2], [-1, 0, 0, 0], [0, -1, 0, 0.5], [0, 0, 0, 1.0]])


def matrix(qw, qx, qy, qz, tx, ty, tz):
    m = np.eye(4)
    m[:3, :3] = [[1 - 2 * (qy * qy + qz * qz), 2 * (qx * qy - qw * qz), 2 * (qx * qz + qw * qy)],
                 [2 * (qx * qy + qw * qz), 1 - 2 * (qx * qx + qz * qz), 2 * (qy * qz - qw * qx)],
                 [2 * (qx * qz - qw * qy), 2 * (qy * qz + qw * qx), 1 - 2 * (qx * qx + qy * qy)]]
    m[:3, 3] = tx, ty, tz
    return m


def quaternion(r):
    """w x y z; the eigenvector of Bar-Itzhack's matrix, which has no special cases."""
    k = np.array([[r[0, 0] - r[1, 1] - r[2, 2], 0, 0, 0], [r[0, 1] + r[1, 0], r[1, 1] - r[0, 0] - r[2, 2], 0, 0],
                  [r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], r[2, 2] - r[0, 0] - r[1, 1], 0],
                  [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], np.trace(r)]]) / 3
    x, y, z, w = np.linalg.eigh(k)[1][:, -1]
    return (w, x, y, z) if w >= 0 else (-w, -x, -y, -z)


def turn_about_z(angle):
    m = np.eye(4)
    m[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return m


def read_lists(capture):
    """{name: cam_from_world}, and the words of the first camera."""
    poses = {}
    lines = [line for line in (capture / "images.txt").read_text().splitlines() if line and not line.startswith("#")]
    for line in lines:
        words = line.split()
        if len(words) == 10:  # keypoints come in threes
            poses[words[9]] = matrix(*map(float, words[1:8]))
    camera = next(line for line in (capture / "cameras.txt").read_text().splitlines() if not line.startswith("#")).split()
    return dict(sorted(poses.items())), camera


def camera_info(camera):
    assert camera[1] == "PINHOLE", f"{camera[1]}: only PINHOLE is written"
    fx, fy, cx, cy = map(float, camera[4:8])
    cx, cy = cx - 0.5, cy - 0.5  # ROS counts from the first pixel's centre
    return CameraInfo(width=int(camera[2]), height=int(camera[3]), distortion_model="plumb_bob", D=[0.0] * 5,
                      K=[fx, 0, cx, 0, fy, cy, 0, 0, 1], R=[1, 0, 0, 0, 1, 0, 0, 0, 1], P=[fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0])


def message_pose(m):
    pose = Pose()
    pose.position.x, pose.position.y, pose.position.z = m[:3, 3]
    pose.orientation.w, pose.orientation.x, pose.orientation.y, pose.orientation.z = quaternion(m[:3, :3])
    return pose


def measured(poses, noise, common, noise_length_m):
    """odom_from_base of each image."""
    random = np.random.default_rng(1)
    base_from_world = [BASE_FROM_CAMERA @ cam_from_world for cam_from_world in poses]
    odom_from_base = [np.eye(4)]
    left_m = 0
    for before, after in zip(base_from_world, base_from_world[1:]):
        step = before @ np.linalg.inv(after)
        angle = np.arctan2(step[1, 0], step[0, 0])
        if left_m <= 0:
            length_error, turn_error = noise * random.standard_normal(2)
            left_m += noise_length_m
        left_m -= np.linalg.norm(step[:3, 3])
        step[:3, 3] *= (1 + common) * (1 + length_error)
        odom_from_base.append(odom_from_base[-1] @ step @ turn_about_z(angle * turn_error))
    return odom_from_base


def write_ros1(path, messages, compression):
    with rosbag.Bag(path, "w", compression=compression) as bag:
        for topic, message, time_ns in messages:
            bag.write(topic, message, rospy.Time(*divmod(time_ns, 10**9)))


def messages_of(capture, names, info, odom_from_base, hz):
    """(topic, message, time in ns), in the order of time."""
    for i, name in enumerate(names):
        stamp = rospy.Time(1_700_000_000) + rospy.Duration(i / hz)
        if i == 0:
            link = TransformStamped(child_frame_id="camera_optical")
            link.header.stamp, link.header.frame_id = stamp, "base_link"
            pose = message_pose(BASE_FROM_CAMERA)
            link.transform.translation.x, link.transform.translation.z = pose.position.x, pose.position.z
            link.transform.rotation = pose.orientation
            yield "/tf_static", TFMessage([link]), stamp.to_nsec()
        image = CompressedImage(format="jpeg", data=(capture / "images" / name).read_bytes())
        image.header.stamp, image.header.frame_id = stamp, "camera_optical"
        info.header = image.header
        odometry = Odometry(child_frame_id="base_link")
        odometry.header.stamp, odometry.header.frame_id = stamp, "odom"
        odometry.pose.pose = message_pose(odom_from_base[i])
        yield "/odom", odometry, stamp.to_nsec()
        yield "/camera/camera_info", info, stamp.to_nsec()
        yield "/camera/image_raw/compressed", image, stamp.to_nsec()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("capture", type=pathlib.Path)
    parser.add_argument("bag")
    parser.add_argument("--noise", type=float, default=0.02)
    parser.add_argument("--common", type=float, help="ratio; without it, that of --noise")
    parser.add_argument("--noise-length", type=float, default=0, help="metres")
    parser.add_argument("--hz", type=float, default=10)
    parser.add_argument("--compression", default="lz4", choices=("none", "bz2", "lz4"))
    parser.add_argument("--images", default="0,1000000000", help="the first, from 0, and how many")
    arguments = parser.parse_args()
    poses, camera = read_lists(arguments.capture)
    first, count = map(int, arguments.images.split(","))
    names = list(poses)[first:first + count]
    common = arguments.noise if arguments.common is None else arguments.common
    odom_from_base = measured([poses[name] for name in names], arguments.noise, common, arguments.noise_length)
    messages = messages_of(arguments.capture, names, camera_info(camera), odom_from_base, arguments.hz)
    if arguments.bag.endswith(".db3"):
        write_db3(arguments.bag, messages)
    elif arguments.bag.endswith(".mcap"):
        write_mcap(arguments.bag, messages)
    else:
        write_ros1(arguments.bag, messages, arguments.compression)
    print(f"{arguments.bag}: {len(names)} images of {arguments.capture}, odometry off by {100 * arguments.noise:g} %")


if __name__ == "__main__":
    main()
