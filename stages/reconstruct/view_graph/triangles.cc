#include "stages/reconstruct/view_graph/triangles.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "core/base/parallel.h"

namespace cairn::reconstruct {
namespace {

// What is believed of a pair before any triangle: one in ten, as much as two triangles say.
constexpr double kNumBelieved = 2, kBelievedRatio = 0.1;

// A pair as seen from one of its images.
struct Side {
  int to = 0;  // the other image
  int pair = 0;
  bool is_forward = false;  // from the pair's first image to its second
};

std::vector<Eigen::Quaterniond> RotationsAlong(const ViewPair& pair, bool is_forward) {
  std::vector<Eigen::Quaterniond> rotations = {pair.cam2_from_cam1.rotation};
  for (const Pose& other : pair.alternatives) rotations.push_back(other.rotation);
  if (!is_forward) {
    for (Eigen::Quaterniond& rotation : rotations) rotation = rotation.conjugate();
  }
  return rotations;
}

}  // namespace

std::vector<double> CloseTriangles(int num_images, const std::vector<ViewPair>& pairs,
                                   const CloseTrianglesOptions& options, int num_threads) {
  std::vector<std::vector<Side>> sides(num_images);
  for (size_t p = 0; p < pairs.size(); ++p) {
    sides[pairs[p].image1].push_back({pairs[p].image2, static_cast<int>(p), true});
    sides[pairs[p].image2].push_back({pairs[p].image1, static_cast<int>(p), false});
  }
  for (std::vector<Side>& of_image : sides)
    std::sort(of_image.begin(), of_image.end(), [](const Side& a, const Side& b) { return a.to < b.to; });
  // |q . r| is the cosine of half the angle between two rotations.
  const double least_cosine = std::cos(0.5 * RadFromDeg(options.max_error_deg));
  std::vector<double> part(pairs.size());
  ParallelFor(static_cast<int64_t>(pairs.size()), num_threads, [&](int64_t p) {
    const ViewPair& pair = pairs[p];
    const std::vector<Eigen::Quaterniond> direct = RotationsAlong(pair, true);
    int64_t num_triangles = 0, num_closed = 0;
    const std::vector<Side>&from1 = sides[pair.image1], &from2 = sides[pair.image2];
    for (auto a = from1.begin(), b = from2.begin(); a != from1.end() && b != from2.end();) {
      if (a->to != b->to) {
        a->to < b->to ? ++a : ++b;
        continue;
      }
      const std::vector<Eigen::Quaterniond> first = RotationsAlong(pairs[a->pair], a->is_forward),
                                            second = RotationsAlong(pairs[b->pair], !b->is_forward);
      const bool closes = std::any_of(first.begin(), first.end(), [&](const Eigen::Quaterniond& to_third) {
        return std::any_of(second.begin(), second.end(), [&](const Eigen::Quaterniond& from_third) {
          const Eigen::Quaterniond around = from_third * to_third;
          return std::any_of(direct.begin(), direct.end(), [&](const Eigen::Quaterniond& rotation) {
            return std::abs(around.dot(rotation)) >= least_cosine;
          });
        });
      });
      ++num_triangles;
      if (closes) ++num_closed;
      ++a, ++b;
    }
    part[p] = (static_cast<double>(num_closed) + kBelievedRatio * kNumBelieved) /
              (static_cast<double>(num_triangles) + kNumBelieved);
  });
  return part;
}

}  // namespace cairn::reconstruct
