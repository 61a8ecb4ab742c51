#pragma once

#include <map>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/capture/capture.h"
#include "core/capture/exif.h"
#include "core/geometry/pose.h"

namespace cairn::reconstruct {

// What is known of the images of a capture besides their pixels: positions of some, distances between them,
// or odometry.

// A distance between the cameras of two images.
struct KnownDistance {
  std::string name1;
  std::string name2;
  double distance_m = 0;
};

// "IMAGE1 IMAGE2 METRES" a line; empty lines and lines that begin with '#' are skipped.  Errors: NotFound,
// Io; Corrupt, with the line (an image that the capture lacks, equal images, a distance that is
// not positive).
Result<std::vector<KnownDistance>> ReadKnownDistances(const std::string& path, const Capture& capture);

// "FOLDER1 FOLDER2 METRES" a line: how far two cameras of a rig are apart.  Their images of the same name
// below the two folders were taken at once.  The distances of all such pairs, in the order of names.  Errors
// as above; Corrupt too for a folder without an image and for two without images of the same name.
Result<std::vector<KnownDistance>> ReadRigBaselines(const std::string& path, const Capture& capture);

// "IMAGE X Y Z" a line, metres: the position of the camera of an image in a frame of the user's choice, z up
// (the form of COLMAP's model_aligner).  Errors as above; an image listed twice is Corrupt.
Result<std::map<std::string, Eigen::Vector3d>> ReadControlPoints(const std::string& path,
                                                                 const Capture& capture);

// What a robot's wheels, or a tracker, say of the images of a capture without poses: right over short ways,
// in metres and level, and drifting over long ones.
struct OdometryPose {
  std::string name;     // of the image
  Pose world_from_cam;  // the world is the odometry's own: metres, z up; camera axes as everywhere
};

// "IMAGE TX TY TZ QX QY QZ QW" a line, separated by spaces or commas, in the order in which the images were
// taken; or, where no line names an image, the lines of TUM's trajectories, a time in place of IMAGE (seconds
// or nanoseconds): then images whose names are times (inertial/image_times.h) have the pose between the two
// stated ones around it that are at most 0.2 s off.  Empty lines, those that begin with '#' and headers are
// skipped. Errors: NotFound, Io; Corrupt, with the line (not seven finite numbers, a quaternion that is not
// of length 1 to 0.01, an image or a time listed twice); NoData (no line tells of an image of the capture).
// Images that the capture lacks are left out.
Result<std::vector<OdometryPose>> ReadOdometry(const std::string& path, const Capture& capture);

// GPS tags of the images that have them, by name.
std::map<std::string, ExifTags> ReadGpsTags(const Capture& capture);

// Component-wise median, rounded to 1e-7 degrees and 1 cm: the anchor of a frame.  REQUIRES: not empty.
// Longitudes are taken relative to the first one, so that the 180th meridian may run through the capture.
GeodeticPosition MedianPosition(const std::map<std::string, ExifTags>& tags);

}  // namespace cairn::reconstruct
