#include "stages/group_classes/adjust/bundle_solution.h"

#include <utility>

#include "core/base/blob.h"

namespace cairn::group_classes {
namespace {

// The hash of many numbers, in pieces: a large problem has a hundred megabytes of them.
class NumberHasher {
 public:
  template <typename... Numbers>
  void Add(Numbers... numbers) {
    (piece_.Double(static_cast<double>(numbers)), ...);
    num_numbers_ += sizeof...(numbers);
    if (num_numbers_ < kNumbersOfPiece) return;
    const ContentHash hash = piece_.Finish();
    piece_ = ContentHasher();
    piece_.Hash(hash);
    num_numbers_ = 0;
  }
  template <typename Derived>
  void AddAll(const Eigen::MatrixBase<Derived>& matrix) {
    for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
      for (Eigen::Index j = 0; j < matrix.cols(); ++j) Add(matrix(i, j));
    }
  }
  void AddAll(const std::vector<double>& numbers) {
    Add(numbers.size());
    for (const double number : numbers) Add(number);
  }
  void AddPose(const Pose& pose) {
    AddAll(pose.rotation.coeffs());
    AddAll(pose.translation);
  }
  ContentHash Finish() { return piece_.Finish(); }

 private:
  static constexpr size_t kNumbersOfPiece = 1 << 16;
  ContentHasher piece_;
  size_t num_numbers_ = 0;
};

void WritePose(const Pose& pose, BlobWriter* blob) {
  for (const double value : pose.rotation.coeffs()) blob->Float64(value);
  for (const double value : pose.translation) blob->Float64(value);
}

void ReadPose(BlobReader* reader, Pose* pose) {
  for (double& value : pose->rotation.coeffs()) value = reader->Float64();
  for (double& value : pose->translation) value = reader->Float64();
}

void WriteNoise(const NoiseEvidence& noise, BlobWriter* blob) {
  for (const double value : {noise.sum_of_squares, noise.num_residuals, noise.num_determined})
    blob->Float64(value);
}

void ReadNoise(BlobReader* reader, NoiseEvidence* noise) {
  for (double* value : {&noise->sum_of_squares, &noise->num_residuals, &noise->num_determined})
    *value = reader->Float64();
}

}  // namespace

ContentHash HashBundle(const BundleOptions& options, const BundleProblem& problem, bool with_evidence) {
  NumberHasher hasher;
  hasher.Add(options.loss_scale, options.max_num_iterations, options.function_tolerance,
             options.initial_trust_region_radius, options.points_follow, with_evidence);
  hasher.Add(problem.images.size());
  for (const BundleProblem::Image& image : problem.images) {
    hasher.Add(image.camera_idx, image.way_m, image.dispersion, image.is_fixed);
    for (const Pose* pose : {&image.stated, &image.cam_from_world, &image.drifted}) hasher.AddPose(*pose);
  }
  hasher.Add(problem.observations.size());
  for (const BundleProblem::Observation& observation : problem.observations) {
    hasher.Add(observation.image_idx, observation.point_idx, observation.sigma_px);
    hasher.AddAll(observation.ray.normal);
    hasher.AddAll(observation.ray.pixel_from_plane);
    hasher.Add(observation.camera.size());
    for (const ParameterSensitivity& parameter : observation.camera) {
      hasher.AddAll(parameter.by_param);
      hasher.AddAll(parameter.growth);
    }
  }
  hasher.Add(problem.points.size());
  for (const Eigen::Vector3d& point : problem.points) hasher.AddAll(point);
  hasher.Add(problem.cameras.size());
  for (const CameraBlock& camera : problem.cameras) {
    hasher.Add(camera.free.size());
    for (const int param : camera.free) hasher.Add(param);
    hasher.AddAll(camera.prior);
    hasher.AddAll(camera.sigma);
    hasher.AddAll(camera.delta);
    hasher.Add(camera.difference_prior, camera.difference_sigma);
  }
  hasher.AddPose(problem.camera_from_given);
  hasher.Add(problem.is_offset_free, problem.offset_sigma_m, problem.offset_sigma_deg, problem.noise.own_m,
             problem.noise.own_deg, problem.noise.walk_m, problem.noise.walk_deg);
  return hasher.Finish();
}

std::string WriteSolution(const BundleProblem& problem, const BundleOutcome& outcome,
                          const BundleEvidence* evidence) {
  BlobWriter blob;
  blob.UInt8(outcome.has_converged);
  blob.UInt32(static_cast<uint32_t>(outcome.num_steps));
  blob.Float64(outcome.trust_region_radius);
  for (const BundleProblem::Image& image : problem.images) {
    WritePose(image.cam_from_world, &blob);
    WritePose(image.drifted, &blob);
  }
  for (const Eigen::Vector3d& point : problem.points) {
    for (const double value : point) blob.Float64(value);
  }
  for (const CameraBlock& camera : problem.cameras) {
    for (const double value : camera.delta) blob.Float64(value);
  }
  WritePose(problem.camera_from_given, &blob);
  if (evidence == nullptr) return blob.Take();
  for (const NoiseEvidence* noise :
       {&evidence->own_m, &evidence->own_deg, &evidence->walk_m, &evidence->walk_deg})
    WriteNoise(*noise, &blob);
  blob.Float64(evidence->offset_chi_square);
  for (const std::vector<double>& of_camera : evidence->camera_sigma) {
    blob.UInt32(static_cast<uint32_t>(of_camera.size()));
    for (const double sigma : of_camera) blob.Float64(sigma);
  }
  return blob.Take();
}

std::optional<BundleOutcome> ReadSolution(std::string_view bytes, BundleProblem* problem,
                                          BundleEvidence* evidence) {
  BlobReader reader(bytes);
  BundleOutcome outcome;
  outcome.has_converged = reader.UInt8() != 0;
  outcome.num_steps = static_cast<int>(reader.UInt32());
  outcome.trust_region_radius = reader.Float64();
  std::vector<BundleProblem::Image> images = problem->images;
  for (BundleProblem::Image& image : images) {
    ReadPose(&reader, &image.cam_from_world);
    ReadPose(&reader, &image.drifted);
  }
  std::vector<Eigen::Vector3d> points(problem->points.size());
  for (Eigen::Vector3d& point : points) {
    for (double& value : point) value = reader.Float64();
  }
  std::vector<CameraBlock> cameras = problem->cameras;
  for (CameraBlock& camera : cameras) {
    for (double& value : camera.delta) value = reader.Float64();
  }
  Pose offset;
  ReadPose(&reader, &offset);
  BundleEvidence found;
  if (evidence != nullptr) {
    for (NoiseEvidence* noise : {&found.own_m, &found.own_deg, &found.walk_m, &found.walk_deg})
      ReadNoise(&reader, noise);
    found.offset_chi_square = reader.Float64();
    for (size_t c = 0; c < cameras.size(); ++c) {
      const uint32_t size = reader.UInt32();
      if (size > reader.num_left()) return std::nullopt;
      std::vector<double>& sigma = found.camera_sigma.emplace_back(size);
      for (double& value : sigma) value = reader.Float64();
    }
  }
  if (!reader.Finished()) return std::nullopt;
  problem->images = std::move(images);
  problem->points = std::move(points);
  problem->cameras = std::move(cameras);
  problem->camera_from_given = offset;
  if (evidence != nullptr) *evidence = std::move(found);
  return outcome;
}

}  // namespace cairn::group_classes
