#pragma once

#include <map>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/base/ids.h"
#include "core/camera/camera.h"
#include "core/features/features.h"
#include "core/geometry/pose.h"

namespace cairn {

// One keypoint of a feature class.
struct Observation {
  ImageId image_id = 0;
  KeypointIdx keypoint_idx = 0;
  Keypoint keypoint;
};

// How often the images of one session could have seen a feature class, and did.
struct SessionSightings {
  float expected =
      0;  // images of the session that see the class if it is there, from what other sessions saw
  int32_t num_seen = 0;  // images that see it
  float there = 1;       // probability that it was there, by this session alone; 1 where nothing says
};

// What the sessions of a survey say of a class (group_classes/persistence).
struct ClassAge {
  std::vector<SessionSightings> sessions;  // per session, in the order of time; empty: one survey
  float presence = 1;                      // probability that it is there now, after the last session
};

// Where a place changed between two sessions, by the classes that vanished and those that appeared there.
struct PlaceChange {
  int session = 0;                                     // the first that shows it
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // mean of the classes', world frame
  double radius_m = 0;                                 // root mean square of their distances from it
  int32_t num_vanished = 0;
  int32_t num_appeared = 0;
  // The image of an earlier session that shows best what was there, and that of this session which shows what
  // is there now; 0: none.
  ImageId image_before = 0;
  ImageId image_after = 0;
  // Where what was there is now: the change of the same session, by position in Classes::changes, where most
  // of it appears (it may be this one), and how many classes show that; -1, 0: nowhere.
  int32_t moved_to = -1;
  int32_t num_moved = 0;
};

// Equivalence class of keypoints = one scene feature [Sala06 §VI-B], triangulated.
struct FeatureClass {
  ClassId class_id = 0;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();    // world frame, metres
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // of the position, m^2
  double reprojection_error_px = 0;                      // root mean square over the observations
  DescriptorRow descriptor = DescriptorRow::Zero(kSiftDescriptorDim);  // of Classes::descriptor_kind
  std::vector<Observation> observations;                               // ascending image_id, one per image
  ClassAge age;
};

struct SurveyImage {
  ImageId image_id = 0;
  std::string name;
  CameraId camera_id = 0;
  Pose cam_from_world;        // refined; in the capture's world frame
  Pose given_cam_from_world;  // as stated by the capture
};

// How many of something were dropped, and why ("ambiguous", "few_observations", ...).
using DropCounts = std::map<std::string, int64_t>;

// What group_classes knows of a capture: images in their refined poses, cameras, and the feature classes.
struct Classes {
  DescriptorKind descriptor_kind;
  std::vector<Camera> cameras;         // ascending camera_id; intrinsics as refined
  std::vector<Camera> stated_cameras;  // the same as the capture states them, where they are others
  std::vector<SurveyImage>
      images;  // ascending image_id; all posed images of the capture, with classes or without
  std::vector<FeatureClass> classes;  // ascending class_id
  std::vector<std::string> sessions;  // of the survey, in the order of time; empty: one
  // Classes that are probably gone: no longer of the map.  Ascending class_id, none of which is in `classes`.
  std::vector<FeatureClass> vanished;
  std::vector<PlaceChange> changes;  // ascending session, then the largest first
  // Constant offset between the pose that the capture states and its camera, if refined, else identity:
  // cam_from_world = camera_from_given * given_cam_from_world, up to noise.
  Pose camera_from_given;
  // Where poses were refined: how far they moved from the stated ones, root mean square per axis of the
  // camera's place and rotation: how wrong those were, and truth of the same source is.
  double stated_pose_sigma_m = 0;
  double stated_pose_sigma_deg = 0;
  // Which part of a keypoint's variance it shares with the others of its image (KeypointNoise of
  // group_classes); 0: not measured.
  double keypoint_correlation = 0;
  DropCounts dropped;  // classes, by reason
};

// classes.db (schemas/classes.sql).
Result<Classes> ReadClasses(const std::string& path);
Status WriteClasses(const Classes& classes, const std::string& path);

}  // namespace cairn
