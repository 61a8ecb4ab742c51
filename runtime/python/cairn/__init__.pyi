from os import PathLike
from typing import Literal, Sequence, final

import numpy as np
from numpy.typing import NDArray

__version__: str

class Error(RuntimeError):
    """What went wrong.  The message names what was found and what to do."""

    code: int  # the program's exit codes
    name: str  # "corrupt", "not_found", ...

@final
class Camera:
    """Intrinsics: a COLMAP model by its name, with its parameters in its order, px."""

    def __init__(self, model: str, width: int, height: int, params: Sequence[float]) -> None: ...
    @property
    def model(self) -> str: ...
    @property
    def width(self) -> int: ...
    @property
    def height(self) -> int: ...
    @property
    def params(self) -> list[float]: ...

@final
class Map:
    """An open map: immutable, shared by all threads."""

    @staticmethod
    def open(
        path: str | PathLike[str], *, memory_budget_bytes: int = ..., public_key: bytes | None = None,
        name: str = "", min_epoch: int = 0, key_ring: str | PathLike[str] | None = None
    ) -> Map:
        """Raises Error.  `public_key`: 32 bytes; maps that this key has not signed are refused.

        `key_ring`, in its place: file of a ring of keys (`cairn keys make`) or of a public key; maps that fewer keys of
        the ring have signed than it wants are refused (not_signed, wrong_key).

        So are maps of another `name` (other_map) and of an earlier epoch than `min_epoch` (not_newer).  Name and
        epoch are only to be trusted with a key: without one, anybody can write a map that says so.
        """
    def camera_for_size(self, width: int, height: int) -> Camera:
        """The survey's camera of this image size.  Raises Error (not_found) when none or more than one has it."""
    def find_image(self, name: str) -> int:
        """The number of a survey image, from 0.  O(images).  Raises Error (not_found)."""
    def image_name(self, image: int) -> str: ...
    def image_pose(self, image: int) -> NDArray[np.float64]:
        """Where a survey image was taken: cam_from_world as a fix of its pixels states it, homogeneous, (4, 4)."""
    def route(self, start: int, goal: int, weight: Literal["links", "matches", "entropy", "risk"] = "links") -> Route:
        """A way from survey image to survey image along which each shows what the next one shows.

        `weight`: what it minimises: links, the sum of 1 / matches of the links, the entropy of places, or the metres
        expected with what getting lost on the way costs.  Raises Error:
        not_found (no way, an image that is not in the map's appearance graph, or a map that has none).
        """
    @property
    def name(self) -> str: ...
    @property
    def descriptors(self) -> str:
        """What the landmarks' descriptors are: "sift", "binary 256 orb", "dense 64 xfeat-0a1b2c3d"."""
    @property
    def epoch(self) -> int:
        """Counts the signed releases of a map of this name; 0: never counted."""
    @property
    def num_landmarks(self) -> int: ...
    @property
    def num_images(self) -> int: ...
    @property
    def num_regions(self) -> int: ...
    @property
    def is_metric(self) -> bool:
        """False: nothing gave the survey its scale, and "metres" have an arbitrary length."""
    @property
    def scale_sigma_ratio(self) -> float:
        """Standard deviation of the map's scale, as a part of it; 0: its poses were stated.

        The covariance of a fix contains that of scale_sigma_ratio * (center - scale_centre), the same multiple of it
        in every fix.
        """
    @property
    def scale_centre(self) -> NDArray[np.float64]:
        """The place of the world frame that stays where it is when the scale errs: (3,)."""

@final
class Route:
    """A way for a robot that steers by its camera, from image to image."""

    @property
    def images(self) -> list[int]:
        """The start, one per place on the way, the goal"""
    @property
    def num_links(self) -> int: ...
    @property
    def cost(self) -> float:
        """Sum of the links' weights"""

@final
class PlaceScores:
    """What an image says about where it was taken: one number for each place of the map."""

    def __init__(self, scores: NDArray[np.float64], probabilities: NDArray[np.float64]) -> None:
        """Of a caller who knows better than words do, such as by matches."""
    @property
    def scores(self) -> NDArray[np.float64]:
        """In [0, 1]: (places,); all 0: the image shares nothing with the map"""
    @property
    def probabilities(self) -> NDArray[np.float64]:
        """Sum to 1: (places,); all equal where all scores are 0"""

@final
class PlaceModel:
    """Which places an image may show, by the map's visual words.  Immutable, shared by all threads.

    Places are the nodes of the map's appearance graph, numbered from 0: images that show the same.
    """

    def __init__(self, map: Map, **options: bool | int | float | str) -> None:
        """`options`: score_exponent, those of features (max_image_side_px=512), of a closer look (num_candidates=10).

        Raises Error: not_found (the map has no words, or no appearance graph).
        """
    @property
    def num_places(self) -> int: ...
    def place_of_image(self, image: int) -> int:
        """The place of a survey image; -1: of none."""
    def images_of_place(self, place: int) -> list[int]:
        """Survey images, ascending, at least one."""
    def look(self, image: NDArray[np.uint8]) -> PlaceScores:
        """What an image says, by its words.  Grey pixels, as Localizer.localize takes them."""
    def look_at_features(self, descriptors: NDArray[np.uint8]) -> PlaceScores:
        """The same of features that the caller has: RootSIFT as the survey's, (n, 128)."""
    def look_closer(self, image: NDArray[np.uint8], camera: Camera | None = None) -> PlaceScores:
        """For a robot that stands still because it is lost: the best places are verified by geometry."""
    def expected(self, place: int) -> NDArray[np.float64]:
        """The probabilities that an image taken there should have: (places,)"""

@final
class StartHypothesis:
    """Where the robot may have started."""

    @property
    def start(self) -> int:
        """A place"""
    @property
    def score(self) -> float:
        """Of the first image"""
    @property
    def posterior(self) -> float:
        """p(start | all images); those of all starts sum to 1"""
    @property
    def way(self) -> list[int]:
        """Places, from the start to the goal"""
    @property
    def way_cost(self) -> float: ...

@final
class StartHypotheses:
    """Which of several places a robot started at, found out while it is under way to a goal.

    One per robot: use by two threads at once raises Error (busy).
    """

    def __init__(self, model: PlaceModel, first: PlaceScores, goal: int, **options: bool | int | float | str) -> None:
        """From what the first image says; `goal`: a place; `options`: those of the starts in `cairn drive --help`.

        Raises Error: no_data (the image shares nothing with the map), not_found (no way leads to the goal).
        """
    def observe(self, places: PlaceScores) -> Literal["follow", "switch", "lost"]:
        """An image at the next place of the followed way: go on; another start leads; none explains the image."""
    def refute(self) -> bool:
        """The robot does not see what the next image of the followed way shows.  False: no other start is left."""
    def restart(self) -> None:
        """The robot is back at its start: what it has learnt about starts is kept."""
    @property
    def hypotheses(self) -> list[StartHypothesis]:
        """Best score of the first image first."""
    @property
    def followed(self) -> int:
        """Its index among the hypotheses."""
    @property
    def num_images(self) -> int:
        """Since the first one, or the last restart()."""
    def whereabouts(self, hypothesis: int) -> int:
        """The place where the robot most likely is by now if it started there."""
    def replan(self, hypothesis: int) -> list[int] | None:
        """The way from there to the goal; None where there is none."""

@final
class PlaceBelief:
    """Where a robot that woke up may be, image after image: a probability of each place of the map and of none.

    One per robot: use by two threads at once raises Error (busy).
    """

    def __init__(self, map: Map, **options: bool | int | float | str) -> None:
        """`options`: those that `cairn where --help` lists.  Raises Error: no_data (a map without images)."""
    def move(self, ahead_m: float, left_m: float, turn_left_rad: float) -> None:
        """Odometry since the last image; calls add up.  Raises Error: unsupported (the map's unit is not the metre)."""
    def elapse(self, seconds: float) -> None:
        """Seconds since the last image [1], so that images may come at any rate; calls add up."""
    def sense_up(self, up_in_camera: Sequence[float], sigma_deg: float) -> None:
        """Gravity, at the next image: which way is up in the camera's frame (x right, y down, z ahead; of any length), and its
        standard deviation, degrees.  A pose that says otherwise is refuted."""
    def see(self, image: NDArray[np.uint8], camera: Camera | None = None) -> Fix:
        """The next image; returns what it says by itself."""
    def places(self, max_num: int = 3) -> list[tuple[int, float]]:
        """The likeliest first: the number of a survey image of each, and P(about there)."""
    @property
    def elsewhere(self) -> float:
        """P(at no place of the map)"""

@final
class ServoCommand:
    """How a robot is to drive until the next image."""

    @property
    def speed_m_s(self) -> float:
        """Ahead; negative: backwards"""
    @property
    def turn_rad_s(self) -> float:
        """To the left"""
    @property
    def state(self) -> Literal["turning", "approaching", "arrived", "lost"]:
        """"lost": the target is not in sight, and the robot stands"""
    @property
    def num_matches(self) -> int:
        """With what the target shows"""
    @property
    def num_inliers(self) -> int:
        """Of these, that agree on one motion"""
    @property
    def why(self) -> str: ...

@final
class Servo:
    """Steers a robot with wheels to where a survey image was taken, by its camera alone, which looks ahead.

    One for each image of a way: use by two threads at once raises Error (busy).
    """

    def __init__(self, map: Map, image: int, **options: bool | int | float | str) -> None:
        """`options`: of where the camera is on the robot (camera_ahead_m and camera_left_m of the middle of its axle,
        camera_turn_deg; without: above it, and it looks ahead), of driving (max_speed_m_s=0.3, step_s=0.1), of arriving
        (for an image on the way arrive_distance_ratio=0.04 and arrive_heading_deg=4 will do), of motions (min_num_inliers=12) and of features (max_num_features=800).

        Raises Error: invalid_argument (no such image), no_data (it shows no landmarks).
        """
    def step(self, image: NDArray[np.uint8], camera: Camera | None = None) -> ServoCommand:
        """The command after an image, which should come every step_s; as Localizer.localize, and the same camera for all images.

        After an Error the servo is as before; the robot had better stand.
        """
    def blocked(self) -> None:
        """The last command did not move the robot, since something stands in the way: it goes the other way."""
    @property
    def step_s(self) -> float:
        """How long a command holds, seconds: a robot without another one by then stops."""

@final
class Atlas:
    """Many maps of a site as one (`cairn atlas`): immutable, shared by all threads.  Maps' files are opened when they are needed."""

    @staticmethod
    def open(
        path: str | PathLike[str], *, public_key: bytes | None = None, name: str = "", min_epoch: int = 0,
        key_ring: str | PathLike[str] | None = None
    ) -> Atlas:
        """Raises Error.  `public_key`, `key_ring`, `name`, `min_epoch`: the atlas's, as for Map.open."""
    @property
    def map_names(self) -> list[str]: ...
    def find_map(self, name: str) -> int:
        """The number of a map, from 0.  Raises Error (not_found)."""
    def open_map(self, map: int) -> Map:
        """For a localizer or tracker of the map in which the robot turned out to be.

        Raises Error: other_map (not the file that the atlas was made of), and those of Map.open.
        """
    def __len__(self) -> int: ...

@final
class AtlasPlace:
    """Where an image may have been taken."""

    @property
    def map(self) -> int:
        """The number of the map"""
    @property
    def fix(self) -> Fix:
        """In this map alone: a fix, or that several places of it explain the image"""
    @property
    def probability(self) -> float:
        """P(it was taken here), all maps considered"""

@final
class AtlasAnswer:
    """Which maps may show an image.  True where the most probable one has a fix."""

    @property
    def places(self) -> list[AtlasPlace]:
        """The most probable first; empty: no map knows the image"""
    @property
    def elsewhere(self) -> float:
        """P(in none of the maps)"""
    @property
    def maps_tried(self) -> list[int]: ...
    @property
    def failure(self) -> Fix:
        """Without places: why the map that knows most of the image has no fix"""
    def __bool__(self) -> bool: ...

@final
class AtlasLocalizer:
    """Finds the map, and the place.  One per thread: use by two at once raises Error (busy)."""

    def __init__(self, atlas: Atlas, **options: bool | int | float | str) -> None:
        """`options`: those that `cairn localize --help` lists."""
    def localize(self, image: NDArray[np.uint8], camera: Camera | None = None) -> AtlasAnswer:
        """`camera` None: each map's own camera of the image's size."""

@final
class Plan:
    """A floor plan: immutable, shared by all threads."""

    @staticmethod
    def open(path: str | PathLike[str]) -> Plan:
        """Of views.db, or of a map that has one.  Raises Error: not_found (no such file, or a map without a plan)."""
    @staticmethod
    def of_map(map: Map) -> Plan:
        """That of an open map, of one that had to be signed too.  Raises Error: not_found."""
    @property
    def walls(self) -> NDArray[np.float64]:
        """x and y of start and end of each, floor frame, metres: (walls, 4)"""

@final
class Scan:
    """One turn of a laser scanner that stands level, in the laser's frame: x ahead, angles counter-clockwise from it."""

    def __init__(
        self,
        ranges: Sequence[float] | NDArray[np.floating],
        angles: Sequence[float] | NDArray[np.floating] | None = None,
        *,
        first_angle_rad: float = 0.0,
        step_rad: float = 0.0,
        max_range_m: float = ...,
    ) -> None:
        """`ranges`: metres, (beams,); one that is not more than 0, or NaN, is left out; one of max_range_m or more, or infinite, met nothing.

        `angles`: radians, (beams,); None: first_angle_rad + i * step_rad.  Raises a ValueError for no beams, another number
        of angles, angles that are not finite or sweep more than a turn.
        """
    @property
    def ranges(self) -> NDArray[np.float64]:
        """Metres: (beams,)"""
    @property
    def angles(self) -> NDArray[np.float64]:
        """Radians: (beams,)"""
    @property
    def max_range_m(self) -> float: ...
    @property
    def odometry(self) -> NDArray[np.float64] | None:
        """Of a log's: where the wheels have the laser, x (m), y (m), heading (rad), in a frame of theirs: (3,)"""
    def __len__(self) -> int: ...

@final
class PlanPlace:
    """Where a robot or its laser may be on a plan."""

    def __init__(
        self,
        position: Sequence[float] | NDArray[np.float64],
        heading_rad: float,
        covariance: Sequence[Sequence[float]] | NDArray[np.float64],
        probability: float,
    ) -> None:
        """For what another sense says: PlanTracker.see_places."""
    @property
    def position(self) -> NDArray[np.float64]:
        """Floor frame, metres: (2,)"""
    @property
    def heading_rad(self) -> float:
        """Counter-clockwise from +x, [-pi, pi]"""
    @property
    def covariance(self) -> NDArray[np.float64]:
        """x (m), y (m), heading (rad): (3, 3)"""
    @property
    def probability(self) -> float: ...
    @property
    def is_determined(self) -> bool:
        """False: along some direction the place is not known, as in a corridor: to more than 0.25 m, or 10 degrees"""
    @property
    def explained_ratio(self) -> float | None:
        """Of a located scan: of the beams that met something, those that ended at walls of the plan"""

@final
class LocatedScan:
    """Where one scan may have been taken."""

    @property
    def places(self) -> list[PlanPlace]:
        """Of the laser, the most probable first; what their probabilities lack of 1 is for a place that the plan does not show"""
    @property
    def is_complete(self) -> bool:
        """False: there may be more places"""

@final
class ScanLocator:
    """Finds where a scan was taken, without knowing anything before.  Immutable, shared by all threads."""

    def __init__(self, plan: Plan, **options: bool | int | float | str) -> None:
        """`options`: those that `cairn plan locate --help-all` lists under "Stage options", such as max_range_m=30 (20).

        Raises Error: no_data (a plan without walls), unsupported (one of more than 0.5 square kilometres).
        """
    def locate(self, scan: Scan) -> LocatedScan:
        """Raises Error: no_data (fewer than three beams met something).  Releases the interpreter's lock meanwhile."""

@final
class PlanTracker:
    """Where a robot is on a plan, by its scans, its wheels and what its camera's images say, any of them.

    In the beginning it may be anywhere.  One per robot: use by two threads at once raises Error (busy).
    """

    def __init__(self, plan: Plan, **options: bool | int | float | str) -> None:
        """`options`: those that `cairn plan follow --help-all` lists under "Stage options", such as max_range_m=30 (20), and
        where laser and camera stand on the robot: laser_ahead_m and laser_left_m of the middle of its axle, laser_turn_deg to
        the left; camera_ahead_m, camera_left_m, camera_turn_deg.

        Raises Error: as ScanLocator.
        """
    def move(self, ahead_m: float, left_m: float, turn_left_rad: float) -> None:
        """Odometry since the last call: this far in the robot's frame before, and then turned."""
    def move_to(self, x_m: float, y_m: float, heading_rad: float) -> None:
        """The same, by where the wheels have the robot in a frame of theirs.  The first call moves nothing."""
    def see_scan(self, scan: Scan) -> None:
        """Raises Error: no_data (fewer than three beams met something).  After an Error the tracker is as before."""
    def see_fix(self, map: Map, fix: Fix) -> None:
        """What an image says by itself: a Localizer's fix without a prior, in the map that the plan is of.  Of several places
        that look alike, all count; no fix at all changes nothing.  Raises Error: unsupported (the map's unit is not the metre)."""
    def see_places(self, places: Sequence[PlanPlace]) -> None:
        """What another sense says by itself: places of the robot.  What their probabilities lack of 1 is for a place that it
        does not know.  Raises Error: invalid_argument (not finite, no covariance, more than 1 in all)."""
    @property
    def places(self) -> list[PlanPlace]:
        """Of the robot, the most probable first; with `elsewhere` their probabilities sum to 1"""
    @property
    def elsewhere(self) -> float: ...

@final
class Up:
    """Which way is up, as an accelerometer says while the robot does not speed up or brake, or an IMU."""

    def __init__(self, direction: Sequence[float] | NDArray[np.float64], sigma_deg: float = 1) -> None:
        """`direction`: in the camera's frame (x right, y down, z ahead), of any length; of a rig in the rig's.  `sigma_deg`: per axis."""
    @property
    def direction(self) -> NDArray[np.float64]:
        """(3,)"""
    @property
    def sigma_deg(self) -> float: ...

@final
class RigImage:
    """What a camera of a rig sees."""

    def __init__(
        self,
        image: NDArray[np.uint8],
        rotation_wxyz: Sequence[float] | NDArray[np.float64] = (1, 0, 0, 0),
        translation: Sequence[float] | NDArray[np.float64] = (0, 0, 0),
        camera: Camera | None = None,
    ) -> None:
        """`image`: as Localizer.localize's; the pose: cam_from_rig, metres."""
    @property
    def image(self) -> NDArray[np.uint8]: ...
    @property
    def rotation_wxyz(self) -> NDArray[np.float64]:
        """A unit quaternion: (4,)"""
    @property
    def translation(self) -> NDArray[np.float64]:
        """Metres: (3,)"""
    @property
    def camera(self) -> Camera | None: ...

@final
class UncertainPose:
    """A pose and how well it is known: a camera's cam_from_world, or how it moved from a frame to the next."""

    def __init__(
        self,
        rotation_wxyz: Sequence[float] | NDArray[np.float64],
        translation: Sequence[float] | NDArray[np.float64],
        covariance: Sequence[Sequence[float]] | NDArray[np.float64] | None = None,
    ) -> None:
        """`covariance`: (6, 6); None: it has no error."""
    @property
    def rotation_wxyz(self) -> NDArray[np.float64]:
        """A unit quaternion: (4,)"""
    @property
    def translation(self) -> NDArray[np.float64]:
        """Metres: (3,)"""
    @property
    def covariance(self) -> NDArray[np.float64]:
        """Rotation (rad), translation (m), of the left perturbation: (6, 6)"""

@final
class Prior:
    """Where the camera is believed to be: cam_from_world, and its standard deviations."""

    def __init__(
        self,
        rotation_wxyz: Sequence[float] | NDArray[np.float64],
        translation: Sequence[float] | NDArray[np.float64],
        *,
        sigma_m: float = 1.0,
        sigma_deg: float = 10.0,
    ) -> None: ...
    @property
    def rotation_wxyz(self) -> NDArray[np.float64]:
        """cam_from_world, a unit quaternion: (4,)"""
    @property
    def translation(self) -> NDArray[np.float64]:
        """cam_from_world, metres: (3,)"""
    @property
    def sigma_m(self) -> float:
        """Of the camera's place, per axis"""
    @property
    def sigma_deg(self) -> float:
        """Of its rotation"""

@final
class Fix:
    """A fix (true), or the reason for none (false; its pose is None)."""

    def __bool__(self) -> bool: ...
    @property
    def reason(self) -> str:
        """"none" for a fix, else "too_few_matches", "ambiguous", ..."""
    @property
    def message(self) -> str: ...
    @property
    def rotation_wxyz(self) -> NDArray[np.float64] | None:
        """cam_from_world, a unit quaternion: (4,)"""
    @property
    def translation(self) -> NDArray[np.float64] | None:
        """cam_from_world, metres: (3,)"""
    @property
    def center(self) -> NDArray[np.float64] | None:
        """Where the camera stands, world frame, metres: (3,)"""
    @property
    def cam_from_world(self) -> NDArray[np.float64] | None:
        """Homogeneous: (4, 4)"""
    @property
    def covariance(self) -> NDArray[np.float64] | None:
        """Rotation (rad), translation (m), of the left perturbation of cam_from_world: (6, 6)"""
    @property
    def probability(self) -> float:
        """P(the fix is right), by how much of what an image from there should show is found, and by what other places explain; without a fix 0, but for "improbable", and for "ambiguous": that one of several poses is right"""
    @property
    def work_ms(self) -> float:
        """What the answer took: milliseconds of the core on which work was measured, counted and not timed; at most budget_ms times core_speed"""
    @property
    def region(self) -> int:
        """The one with most inliers; -1: none"""
    @property
    def scope(self) -> Literal["prior", "regions", "images", "all", "track", "votes"]:
        """Which landmarks it was matched with.  "track", "votes": a tracker's, following and lost"""
    @property
    def num_features(self) -> int: ...
    @property
    def num_matches(self) -> int: ...
    @property
    def num_inliers(self) -> int: ...
    @property
    def candidates(self) -> list[int]:
        """Survey images (their ids), most alike first"""
    @property
    def voted_regions(self) -> list[int]:
        """A tracker's, lost: regions with enough of their landmarks in view, most first"""

@final
class FloorFix:
    """A fix on the floor (true), or the reason for none (false)."""

    def __bool__(self) -> bool: ...
    @property
    def reason(self) -> str:
        """"none" for a fix, else "too_few_matches", "one_spot", "disagree" or "outside" (the map)"""
    @property
    def message(self) -> str: ...
    @property
    def position(self) -> NDArray[np.float64] | None:
        """Floor frame, metres: (2,); None without a fix"""
    @property
    def heading_deg(self) -> float | None:
        """Counter-clockwise from +x, [0, 360); None without a fix"""
    @property
    def covariance(self) -> NDArray[np.float64]:
        """x (m), y (m), heading (rad): (3, 3).  Without a fix, x and y of the belief"""
    @property
    def mean(self) -> NDArray[np.float64]:
        """Of the belief after this image, with a fix or without: floor frame, metres: (2,)"""
    @property
    def entropy(self) -> float:
        """Of the belief over places, nats"""
    @property
    def scope(self) -> Literal["all", "track", "votes"]:
        """Which landmarks it was matched with"""
    @property
    def regions(self) -> list[int]:
        """Of "track" and "votes": whose landmarks these are"""
    @property
    def num_matches(self) -> int: ...
    @property
    def num_agreeing(self) -> int: ...

@final
class Log:
    """What a robot brings home for a later compile: the folder that `cairn localize --log` writes.

    Localizers and trackers that are given it offer it each frame with a fix; one log may be that of several, in any
    threads.  A log that can no longer be written keeps nothing more, and fixes are as ever: see `error`.
    """

    def __init__(self, map: Map, folder: str | PathLike[str], *, max_mb_per_day: float = 50.0) -> None:
        """Makes the folder, or goes on with it; it grows by at most `max_mb_per_day` 10^6 bytes in any 24 hours.

        Raises Error: busy (another log writes there), invalid_argument (something else is in the folder, or the log of
        a map of another name or frame).
        """
    @property
    def num_kept(self) -> int:
        """Frames that were kept since it was opened."""
    @property
    def error(self) -> str | None:
        """Why it can no longer be written."""
    def close(self) -> None:
        """Its localizers and trackers go on without it; another process may write to it."""

@final
class Localizer:
    """Finds where a camera is.  One per thread: use by two at once raises Error (busy)."""

    def __init__(self, map: Map, *, log: Log | None = None, **options: bool | int | float | str) -> None:
        """`log`: of the same map; `options`: any that `cairn localize --help` lists under "Stage options", such as min_num_inliers=9."""
    def localize(
        self, image: NDArray[np.uint8], camera: Camera | None = None, prior: Prior | None = None, up: Up | None = None
    ) -> Fix:
        """From grey pixels, (height, width); rows may have gaps; other memory layouts raise a ValueError.

        `camera` None: the survey's camera of the image's size.  `up`: no pose tilts the camera, and where it is known well, two
        landmarks make one, not three.  Releases the interpreter's lock meanwhile.
        """
    def localize_features(
        self, keypoints: NDArray[np.floating], descriptors: NDArray[np.floating] | NDArray[np.uint8], camera: Camera,
        prior: Prior | None = None, up: Up | None = None
    ) -> Fix:
        """From features that another program found, as those of the map's survey (Map.descriptors).

        `keypoints`: (n, 2 to 4): x, y, scale, orientation; the first pixel's centre is (0.5, 0.5), so add 0.5 to OpenCV's.
        `descriptors`: (n, m), of a float or dense kind its values, of any length; of SIFT 128 bytes, of a binary kind its bits,
        eight in a byte.  Raises a TypeError or ValueError for others.  Nothing of it is logged.
        """
    def localize_rig(self, images: Sequence[RigImage], prior: Prior | None = None, up: Up | None = None) -> Fix:
        """One fix of what the cameras of a rig see at the same time: fix, prior and up are the rig's.  Nothing of it is logged."""

@final
class Tracker:
    """Follows a camera in space, frame after frame, and finds it again when it was carried away.

    One per camera: use by two threads at once raises Error (busy).
    """

    def __init__(self, map: Map, *, log: Log | None = None, **options: bool | int | float | str) -> None:
        """`log`: of the same map; `options`: any that `cairn localize --sequence` takes, such as step_sigma_m=0.3 or min_num_inliers=9."""
    def track(self, image: NDArray[np.uint8], camera: Camera | None = None) -> Fix:
        """The next frame; as Localizer.localize.  After an Error the tracker is as before."""
    def move(self, ahead_m: float, left_m: float, turn_left_rad: float) -> None:
        """How the camera moved over the floor since the last frame, in the frame that it had on it; several calls add up.

        Without it, or move_camera, it follows a constant velocity.  Raises Error: unsupported (a map whose unit is not the metre).
        """
    def move_camera(self, next_from_last: UncertainPose) -> None:
        """The same in space, from the camera's frame at the last frame to that now, as visual or inertial odometry has it."""
    def sense_up(self, up_in_camera: Sequence[float], sigma_deg: float) -> None:
        """Which way is up at the next frame, as Up has it."""
    def elapse(self, seconds: float) -> None:
        """Seconds from the last frame to the next [1]: as PlaceBelief's.

        With min_place_probability=0.9 a fix is published only where its place has this probability by all frames so far.  Raises Error:
        invalid_argument (the option is 0, the default).
        """
    def predict(self) -> Prior | None:
        """Where the next frame is expected; None when lost."""
    def believe(self) -> UncertainPose | None:
        """Where the camera was at the last frame: its fix, or where it moved since the last one; after a move, where it is now.

        None before the first fix.
        """

@final
class VisualTracker:
    """Follows a robot on the floor, frame after frame, by the map's visual map and its odometry.

    One per camera: use by two threads at once raises Error (busy).
    """

    def __init__(self, map: Map, **options: bool | int | float | str) -> None:
        """`options`: any that `cairn localize --sequence --estimator visual-map` reads, such as unknown_way_sigma_m=0.5.

        Raises Error: not_found (the map has no visual map).
        """
    def move(self, ahead_m: float, left_m: float, turn_left_rad: float) -> None:
        """Since the last frame the robot drove this far, in its frame at the start, and then turned.

        Several calls before a frame add up.  Without any, it may have gone anywhere within unknown_way_sigma_m.
        """
    def track(self, image: NDArray[np.uint8], camera: Camera | None = None) -> FloorFix:
        """The next frame; as Localizer.localize.  After an Error the tracker is as before."""

def read_scans(path: str | PathLike[str]) -> list[Scan]:
    """The scans of a Carmen log, or of ROS messages as JSON lines, with their odometry.  Raises Error: not_found, corrupt, no_data."""

def update_map(
    map: str | PathLike[str], delta: str | PathLike[str], *, public_key: bytes | None = None, name: str = "",
    min_epoch: int = 0, allow_older: bool = False, key_ring: str | PathLike[str] | None = None,
    signatures: str | PathLike[str] | None = None
) -> bool:
    """Replaces the map's file by the one that a delta (`cairn update delta`) leads to; the old one stays beside it.  False: it already is the new one.

    Raises Error: invalid_argument (the delta leads from another map), not_signed and wrong_key (with `public_key`), busy;
    not_newer and other_map (with `public_key`, or where the map is signed: the new one must have its name and a later epoch,
    unless `allow_older`; also what `name` and `min_epoch` refuse).  `key_ring`: as for Map.open.  `signatures`: file with
    more signatures of the new map [DELTA.signatures, where it is there].
    """

def roll_back_map(
    map: str | PathLike[str], *, public_key: bytes | None = None, name: str = "", min_epoch: int = 0,
    key_ring: str | PathLike[str] | None = None
) -> None:
    """Exchanges the map and the one before the last update; a second call exchanges them back.

    Raises Error: not_found, other_map (the one before is another map), not_newer (before `min_epoch`).
    """

def accept_key_ring(ring: str | PathLike[str], next: str | PathLike[str]) -> int:
    """Replaces a robot's ring of keys by the one after it, whose signatures are beside it in NEXT.signatures.

    Returns the version that is then in place.  Raises Error: not_newer (an earlier version, or one that leaves out others),
    not_signed and wrong_key (enough keys of either ring must have signed it), busy.
    """
