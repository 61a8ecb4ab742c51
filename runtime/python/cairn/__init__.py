"""Where is this camera?  The runtime of cairn's landmark maps.

    map = cairn.Map.open("kitchen.cairn")   # immutable, shared by all threads
    localizer = cairn.Localizer(map)        # one per thread
    fix = localizer.localize(image)         # numpy uint8, height x width, grey
    if fix:
        print(fix.center, fix.covariance)   # metres; rotation (rad), translation (m)

A robot that was switched on anywhere keeps several starts in mind: StartHypotheses, of what a PlaceModel says of its images; or all places, with
or without a goal: PlaceBelief.

A robot that may be in any of many maps asks an Atlas of them: AtlasLocalizer.

A way over survey images is Map.route; a Servo steers a robot from one to the next by its camera.

A robot with a laser asks a floor plan: a ScanLocator where one scan was taken, a PlanTracker where it is by scans, wheels and images.

Frames in order go to a Tracker (in space) or a VisualTracker (on the floor), with odometry where there is any, one per camera.

Poses are cam_from_world, in the frame of the surveyed capture: metres, the camera looks along +z, x right, y down.
"""
from ._cairn import (
    Atlas,
    AtlasAnswer,
    AtlasLocalizer,
    AtlasPlace,
    Camera,
    Error,
    Fix,
    FloorFix,
    Localizer,
    LocatedScan,
    Log,
    Map,
    PlaceBelief,
    PlaceModel,
    PlaceScores,
    Plan,
    PlanPlace,
    PlanTracker,
    Prior,
    RigImage,
    Route,
    Scan,
    ScanLocator,
    Servo,
    ServoCommand,
    StartHypotheses,
    StartHypothesis,
    Tracker,
    UncertainPose,
    Up,
    VisualTracker,
    __version__,
    accept_key_ring,
    read_scans,
    roll_back_map,
    update_map,
)

__all__ = [
    "Atlas",
    "AtlasAnswer",
    "AtlasLocalizer",
    "AtlasPlace",
    "Camera",
    "Error",
    "Fix",
    "FloorFix",
    "Localizer",
    "LocatedScan",
    "Log",
    "Map",
    "PlaceBelief",
    "PlaceModel",
    "PlaceScores",
    "Plan",
    "PlanPlace",
    "PlanTracker",
    "Prior",
    "RigImage",
    "Route",
    "Scan",
    "ScanLocator",
    "Servo",
    "ServoCommand",
    "StartHypotheses",
    "StartHypothesis",
    "Tracker",
    "UncertainPose",
    "Up",
    "VisualTracker",
    "__version__",
    "accept_key_ring",
    "read_scans",
    "roll_back_map",
    "update_map",
]
