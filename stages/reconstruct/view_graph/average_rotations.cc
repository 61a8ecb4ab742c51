#include "stages/reconstruct/view_graph/average_rotations.h"

#include <algorithm>
#include <cmath>
#include <queue>

#include "core/geometry/rotations.h"
#include "core/structure/disjoint_sets.h"
#include "stages/reconstruct/view_graph/differences.h"

namespace cairn::reconstruct {
namespace {

constexpr int kNumAbsoluteIterations = 8;
constexpr double kLeastErrorRad = 1e-4;  // below, absolute values are not told apart
constexpr double kConvergedRad = 1e-6;
constexpr double kLeastWeight = 1e-3;

// How a pair's rotation differs from that of the images, a rotation vector in the world's frame.
Eigen::Vector3d ErrorOf(const ViewPair& pair, const std::vector<Eigen::Quaterniond>& rotations) {
  return VectorFromQuaternion(
      (rotations[pair.image2].conjugate() * pair.cam2_from_cam1.rotation * rotations[pair.image1])
          .normalized());
}

std::vector<std::vector<int>> PairsOfImages(int num_images, const std::vector<ViewPair>& pairs) {
  std::vector<std::vector<int>> of_images(num_images);
  for (size_t p = 0; p < pairs.size(); ++p) {
    of_images[pairs[p].image1].push_back(static_cast<int>(p));
    of_images[pairs[p].image2].push_back(static_cast<int>(p));
  }
  return of_images;
}

}  // namespace

std::vector<std::vector<int>> ConnectedParts(int num_images, const std::vector<ViewPair>& pairs) {
  DisjointSets sets(num_images);
  std::vector<bool> has_pair(num_images, false);
  for (const ViewPair& pair : pairs) {
    has_pair[pair.image1] = has_pair[pair.image2] = true;
    sets.Join(pair.image1, pair.image2);
  }
  std::vector<std::vector<int>> by_root(num_images), parts;
  for (int i = 0; i < num_images; ++i) {
    if (has_pair[i]) by_root[sets.Find(i)].push_back(i);
  }
  for (std::vector<int>& part : by_root) {
    if (!part.empty()) parts.push_back(std::move(part));
  }
  std::stable_sort(parts.begin(), parts.end(),
                   [](const auto& a, const auto& b) { return a.size() > b.size(); });
  return parts;
}

std::vector<Eigen::Quaterniond> RotationsAlongTree(int num_images, const std::vector<ViewPair>& pairs) {
  const std::vector<std::vector<int>> of_images = PairsOfImages(num_images, pairs);
  std::vector<Eigen::Quaterniond> rotations(num_images, Eigen::Quaterniond::Identity());
  std::vector<bool> is_placed(num_images, false);
  const auto is_worse = [&](int a, int b) {
    return std::pair(pairs[a].weight, -a) < std::pair(pairs[b].weight, -b);
  };
  std::priority_queue<int, std::vector<int>, decltype(is_worse)> open(is_worse);
  const auto place = [&](int image) {
    is_placed[image] = true;
    for (const int p : of_images[image]) open.push(p);
  };
  const auto first = std::max_element(of_images.begin(), of_images.end(),
                                      [](const auto& a, const auto& b) { return a.size() < b.size(); });
  if (first == of_images.end()) return rotations;
  place(static_cast<int>(first - of_images.begin()));
  while (!open.empty()) {
    const ViewPair& pair = pairs[open.top()];
    open.pop();
    if (is_placed[pair.image1] == is_placed[pair.image2]) continue;
    const bool forward = is_placed[pair.image1];
    const int image = forward ? pair.image2 : pair.image1;
    rotations[image] = forward ? pair.cam2_from_cam1.rotation * rotations[pair.image1]
                               : pair.cam2_from_cam1.rotation.conjugate() * rotations[pair.image2];
    rotations[image].normalize();
    place(image);
  }
  return rotations;
}

std::vector<Eigen::Quaterniond> AverageRotations(int num_images, const std::vector<ViewPair>& pairs,
                                                 const AverageRotationsOptions& options) {
  std::vector<Eigen::Quaterniond> rotations = RotationsAlongTree(num_images, pairs);
  if (num_images < 2) return rotations;
  std::vector<Link> links;
  for (const ViewPair& pair : pairs) links.push_back({pair.image1, pair.image2});
  Eigen::MatrixXd errors(std::ssize(pairs), 3);
  std::vector<double> weights(pairs.size());
  // Returns the largest turn.
  const auto step = [&](const auto& weight_of) {
    for (size_t p = 0; p < pairs.size(); ++p) {
      const Eigen::Vector3d error = ErrorOf(pairs[p], rotations);
      errors.row(static_cast<Eigen::Index>(p)) = error.transpose();
      weights[p] = weight_of(error.squaredNorm()) * std::max(pairs[p].weight, kLeastWeight);
    }
    const Eigen::MatrixXd turns = SolveDifferences(num_images, links, errors, weights);
    double largest = 0;
    for (int i = 1; i < num_images; ++i) {
      const Eigen::Vector3d turn = turns.row(i).transpose();
      const double angle = turn.norm();
      largest = std::max(largest, angle);
      if (angle > 0) rotations[i] = (rotations[i] * Eigen::AngleAxisd(angle, turn / angle)).normalized();
    }
    return largest;
  };
  for (int iteration = 0; iteration < kNumAbsoluteIterations; ++iteration)
    step([](double squared) { return 1 / std::max(std::sqrt(squared), kLeastErrorRad); });
  for (const double scale_deg : options.robust_scales_deg) {
    const double scale = RadFromDeg(scale_deg);
    const auto weight_of = [&](double squared) {
      return std::pow(scale * scale / (scale * scale + squared), 2);
    };
    for (int iteration = 0; iteration < options.max_num_iterations; ++iteration) {
      if (step(weight_of) < kConvergedRad) break;
    }
  }
  return rotations;
}

double RotationErrorDeg(const ViewPair& pair, const std::vector<Eigen::Quaterniond>& rotations) {
  const Eigen::Quaterniond between = rotations[pair.image2] * rotations[pair.image1].conjugate();
  double least = between.angularDistance(pair.cam2_from_cam1.rotation);
  for (const Pose& other : pair.alternatives)
    least = std::min(least, between.angularDistance(other.rotation));
  return DegFromRad(least);
}

}  // namespace cairn::reconstruct
