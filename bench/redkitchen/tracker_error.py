#!/usr/bin/env python3
"""How the tracker's poses of redkitchen err, without any fix: beside those of redkitchen_sfm, once the frames and an
offset between the cameras are fitted over all 189 images.  Prints its size by axis of the camera, how alike it is from
one query to the next, how much of it lies within the 90 % ellipsoid of the sigmas given (those that stage 3 finds), and
which share a fix without any error of its own could expect to see there if the sigmas were exact.  Needs numpy.

  bench/redkitchen/tracker_error.py [TRACKER SFM] [--sigma-m 0.0169 --sigma-deg 1.06]
"""
import argparse
import os

import numpy as np

from pose_errors import read_poses

CHI_SQUARE_90 = 10.645  # of 6 degrees of freedom


class Pose:
    """cam_from_world."""

    def __init__(self, rotation, translation):
        self.rotation, self.translation = rotation, translation

    def center(self):
        return -self.rotation.T @ self.translation


def rotation_of(quaternion):
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def exp(vector):
    angle = np.linalg.norm(vector)
    return rotation_of(np.r_[np.cos(angle / 2), np.sinc(angle / 2 / np.pi) / 2 * vector])


def log(rotation):
    angle = np.arccos(np.clip((np.trace(rotation) - 1) / 2, -1, 1))
    axis = np.array([rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]])
    return axis / 2 / np.sinc(angle / np.pi)


def poses_of(path):
    return {name: Pose(rotation_of(np.array(quaternion)), np.array(translation))
            for name, (quaternion, translation) in read_poses(path).items()}


def errors_of(tracked, true, names, rounds=30):
    """Rows of rotation (rad) and translation (m) by which the tracker errs, in axes of the camera: Cauchy's loss."""
    places = np.array([tracked[n].center() for n in names])
    targets = np.array([true[n].center() for n in names])
    u, scales, v = np.linalg.svd((targets - targets.mean(0)).T @ (places - places.mean(0)))
    sign = np.diag([1, 1, np.linalg.det(u @ v)])
    turn = u @ sign @ v
    scale = np.trace(np.diag(scales) @ sign) / ((places - places.mean(0)) ** 2).sum()
    fit = (turn, targets.mean(0) - scale * turn @ places.mean(0), scale, np.eye(3), np.zeros(3))

    def moved(fit, x):
        turn, shift, scale, offset, arm = fit
        return exp(x[:3]) @ turn, shift + x[3:6], scale * np.exp(x[6]), exp(x[7:10]) @ offset, arm + x[10:]

    def residuals(fit):
        turn, shift, scale, offset, arm = fit
        rows = []
        for n in names:
            camera = Pose(offset @ tracked[n].rotation, offset @ tracked[n].translation + arm)
            rotation = camera.rotation @ turn.T
            center = scale * turn @ camera.center() + shift
            rows.append(np.r_[log(true[n].rotation @ rotation.T), true[n].rotation @ (center - true[n].center())])
        return np.array(rows)

    units = np.r_[[np.radians(1)] * 3, [0.02] * 3]
    for _ in range(rounds):
        now = residuals(fit) / units
        jacobian = np.array([(residuals(moved(fit, 1e-6 * e)) / units - now).ravel() / 1e-6 for e in np.eye(13)]).T
        weights = np.repeat(1 / np.sqrt(1 + (now ** 2).sum(1) / 4), 6)
        step = -np.linalg.lstsq(jacobian * weights[:, None], now.ravel() * weights, rcond=None)[0]
        fit = moved(fit, step)
        if np.linalg.norm(step) < 1e-9:
            break
    return residuals(fit)


def shares_of_walks(correlations, length, num=20000):
    """Shares within the ellipsoid of Gaussian errors of exactly the sigmas, with these correlations to the next."""
    random = np.random.default_rng(0)
    error = random.standard_normal((num, 6))
    inside = np.zeros(num)
    for _ in range(length):
        inside += (error ** 2).sum(1) <= CHI_SQUARE_90
        error = correlations * error + np.sqrt(1 - correlations ** 2) * random.standard_normal((num, 6))
    return inside / length


def main():
    data = os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../../shared/data")
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("tracker", nargs="?", default=os.path.join(data, "redkitchen"))
    parser.add_argument("sfm", nargs="?", default=os.path.join(data, "redkitchen_sfm"))
    parser.add_argument("--sigma-m", type=float, default=0.0169)
    parser.add_argument("--sigma-deg", type=float, default=1.06)
    args = parser.parse_args()
    lists = [[poses_of(os.path.join(folder, name)) for folder in (args.tracker, args.sfm)]
             for name in ("images.txt", "queries.txt")]
    tracked, true = ({**lists[0][k], **lists[1][k]} for k in range(2))
    names = sorted(set(tracked) & set(true))
    errors = dict(zip(names, errors_of(tracked, true, names)))
    sigmas = np.r_[[np.radians(args.sigma_deg)] * 3, [args.sigma_m] * 3]
    shown = np.r_[[np.degrees(1)] * 3, [100] * 3]
    for what, (listed, _) in zip(("survey", "queries"), lists):
        rows = np.array([errors[n] for n in sorted(listed) if n in errors])
        to_next = np.array([np.corrcoef(rows[1:, k], rows[:-1, k])[0, 1] for k in range(6)])
        squared = ((rows / sigmas) ** 2).sum(1)
        print(f"{what}: {len(rows)} images")
        print("  root mean square  ", "deg, cm:", np.round(np.sqrt((rows ** 2).mean(0)) * shown, 2))
        print("  correlation with the next image  ", np.round(to_next, 2))
        print(f"  in units of the sigmas: mean square {squared.mean():.1f} of 6,"
              f" {100 * (squared <= CHI_SQUARE_90).mean():.1f} % within the 90 % ellipsoid")
        print("  outside:", " ".join(n for n, s in zip(sorted(listed), squared) if s > CHI_SQUARE_90))
        for kind, correlations in (("correlated so", to_next), ("independent", np.zeros(6))):
            shares = 100 * shares_of_walks(correlations, len(rows))
            low, high = np.quantile(shares, [0.025, 0.975])
            print(f"  exact sigmas, {kind}: share {shares.mean():.1f} %, 95 % of all runs {low:.0f} to {high:.0f} %,"
                  f" {100 * ((shares >= 85) & (shares <= 95)).mean():.0f} % of them 85 to 95 %")


if __name__ == "__main__":
    main()
