#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/capture/capture.h"
#include "core/colmap/colmap_model.h"
#include "core/geometry/geodesy.h"
#include "core/geometry/similarity.h"
#include "stages/reconstruct/find_frame.h"
#include "stages/reconstruct/inertial/inertial_scale.h"
#include "stages/reconstruct/reconstruct.h"

namespace cairn::reconstruct {

// What may say how large a reconstruction is.
struct ScaleQuestion {
  const ColmapModel& reconstruction;
  const ModelPoses& model;  // its poses
  const Capture& capture;
  const ReconstructOptions& options;
  const std::optional<Result<InertialScale>>& imu;  // what it says of scale and vertical; none: there is none
};

// Which way is up in the model, and how well that is known.
struct Vertical {
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();  // of length 1
  double sigma_deg = 0;
};
// By the IMU's gravity where there is one, else the cameras' mean up.
Vertical VerticalOf(const ScaleQuestion& question);

// What the capture's IMU says, which several sources need; none: it has none.
std::optional<Result<InertialScale>> AskImuOnce(const Capture& capture, const ModelPoses& model,
                                                const ReconstructOptions& options);

// What a source answers.
struct ScaleAnswer {
  std::string told_by;  // in words, for messages
  Similarity world_from_model;
  double sigma_ratio = 0;  // standard deviation of the scale, as a part of it
  // What stays where it is when the scale errs, world.
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  std::optional<GeodeticPosition> anchor;  // where the world is east, north, up
  std::vector<AlignmentResidual> residuals;
  std::vector<std::string> warnings;
};

// A source: a row of the table of those that there are.
struct ScaleSource {
  const char* name;  // as options.scale_from has it
  // Whether there is something to ask, and whether it is the recipe that names it: then it must answer.
  bool (*is_there)(const ScaleQuestion& question);
  bool is_named;
  // Errors: NoData (it says nothing of the scale, and why); those of its files.
  Result<ScaleAnswer> (*ask)(const ScaleQuestion& question);
};

// In the order of names.
std::vector<Pose> PosesOf(const ModelPoses& model);

// Most trusted first.
const std::vector<ScaleSource>& ScaleSources();

}  // namespace cairn::reconstruct
