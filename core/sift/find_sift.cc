#include "core/sift/find_sift.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <tuple>

#include "core/base/pooled.h"
#include "core/sift/gaussian.h"
#include "core/sift/octave.h"
#include "core/sift/sift_memory.h"
#include "core/threads/of_thread.h"

namespace cairn {
namespace {

constexpr int kOctaveBorder = 5;  // pixels without keypoints, as OpenCV
constexpr size_t kMaxFloatsKept = size_t{64} << 18;

cv::Rect Grown(const cv::Rect& rect, int by, cv::Size within) {
  return cv::Rect(rect.x - by, rect.y - by, rect.width + 2 * by, rect.height + 2 * by) &
         cv::Rect({0, 0}, within);
}

// The part of an octave where keypoints of a region of the image begin.
cv::Rect SoughtIn(const OctavePlan& plan, const cv::Rect& region) {
  const cv::Rect inside(kOctaveBorder, kOctaveBorder, plan.size.width - 2 * kOctaveBorder,
                        plan.size.height - 2 * kOctaveBorder);
  if (inside.width <= 0 || inside.height <= 0) return {};
  if (region.empty()) return inside;
  const double scale = 1 / plan.pixel;
  // A pixel for the quarter and the half that positions are off, one for rounding, and the drift.
  constexpr int kSlack = kSiftMaxDrift + 3;
  const auto from = [&](int at) { return static_cast<int>(std::floor(at * scale)) - kSlack; };
  const auto to = [&](int at) { return static_cast<int>(std::ceil(at * scale)) + kSlack; };
  return cv::Rect(cv::Point(from(region.x), from(region.y)),
                  cv::Point(to(region.br().x), to(region.br().y))) &
         inside;
}

// The octaves that are searched, and those that they begin with: octave 0, or where the image is not doubled
// octave 1, which are made of the image.
PooledVector<OctavePlan> OctavesOf(cv::Size image, const SiftSearch& search) {
  PooledVector<OctavePlan> plans;
  OctavePlan next{.size = image * 2};
  if (!search.doubled) {
    next = {.source = OctaveSource::kImage, .pixel = 1, .sigma = kSiftSigma / 2, .size = image};
  }
  const int end = std::min(NumOctaves(image), search.end_octave);
  for (; next.octave < end && std::min(next.size.width, next.size.height) > 2 * kOctaveBorder;
       ++next.octave) {
    if (search.doubled || next.octave > 0 || search.first_octave <= 0) plans.push_back(next);
    if (next.sigma < kSiftSigma) {
      next.sigma = kSiftSigma;  // the same pixels
      continue;
    }
    next.source = OctaveSource::kOctaveBefore;
    next.pixel *= 2;
    next.size = next.size / 2;
  }
  return plans;
}

// The same with the windows that are computed, and without those at the end where nothing is sought.
PooledVector<OctavePlan> PlanOctaves(cv::Size image, const cv::Rect& region, const SiftSearch& search) {
  PooledVector<OctavePlan> plans = OctavesOf(image, search);
  for (OctavePlan& plan : plans) {
    if (plan.octave >= search.first_octave) plan.sought = SoughtIn(plan, region);
  }
  while (!plans.empty() && plans.back().sought.empty()) plans.pop_back();
  cv::Rect needed;  // of this octave by the next one
  for (auto plan = plans.rbegin(); plan != plans.rend(); ++plan) {
    const cv::Rect own =
        plan->sought.empty() ? cv::Rect() : Grown(plan->sought, kSiftSearchReach, plan->size);
    cv::Rect& w = plan->window;
    w = own | needed;
    needed = {};
    if (plan->source == OctaveSource::kOctaveBefore) {
      if (!w.empty())
        needed = Grown({2 * w.x, 2 * w.y, 2 * w.width, 2 * w.height}, kSiftLevelReach + 1, (plan + 1)->size);
      continue;
    }
    w = Grown(w, kSiftImageReach, plan->size);
    if (plan->source == OctaveSource::kDoubledImage) {  // from a pixel of the image to a pixel of the image
      const int right = (w.br().x + 1) & ~1, bottom = (w.br().y + 1) & ~1;
      w.x &= ~1;
      w.y &= ~1;
      w.width = right - w.x;
      w.height = bottom - w.y;
    }
  }
  return plans;
}

bool IsBefore(const SiftExtremum& a, const SiftExtremum& b) {
  return std::tie(a.octave, a.layer, a.y, a.x) < std::tie(b.octave, b.layer, b.y, b.x);
}

bool SamePlace(const SiftExtremum& a, const SiftExtremum& b) {
  return a.octave == b.octave && a.layer == b.layer && a.x == b.x && a.y == b.y;
}

// A keypoint in the image, as OpenCV states it (SiftFeature), at first without its orientation.
struct Located {
  SiftExtremum extremum;
  const Octave* octave = nullptr;
  float x = 0;
  float y = 0;
  float size = 0;
  float angle_deg = 0;
};

// Extrema that are wanted, each once, ordered by octave and place.
PooledVector<Located> SelectExtrema(std::span<const Octave> octaves, const cv::Mat& mask,
                                    const SiftSearch& search, const cv::Rect& region,
                                    PooledVector<SiftExtremum> extrema) {
  std::sort(extrema.begin(), extrema.end(), IsBefore);
  extrema.erase(std::unique(extrema.begin(), extrema.end(), SamePlace), extrema.end());
  // The doubled image's pixels are where OpenCV states them; those of the image a quarter pixel before.
  const float offset = search.doubled ? 0 : 0.25f;
  PooledVector<Located> located;
  located.reserve(extrema.size());
  auto octave = octaves.begin();
  for (const SiftExtremum& e : extrema) {
    while (octave->plan().octave < e.octave) ++octave;
    const float pixel = octave->plan().pixel;
    const Located l{.extremum = e,
                    .octave = &*octave,
                    .x = e.octave_x * pixel + offset,
                    .y = e.octave_y * pixel + offset,
                    .size = 2 * e.octave_sigma * pixel};
    if (!region.empty() && !(l.x >= static_cast<float>(region.x) && l.x < static_cast<float>(region.br().x) &&
                             l.y >= static_cast<float>(region.y) && l.y < static_cast<float>(region.br().y)))
      continue;
    if (!mask.empty() && mask.at<uint8_t>(static_cast<int>(l.y + 0.5f), static_cast<int>(l.x + 0.5f)) == 0)
      continue;
    if (search.is_wanted && !search.is_wanted(l.x, l.y, l.size)) continue;
    located.push_back(l);
  }
  return located;
}

SiftPatch PatchOf(const Octave& octave, int layer, int x, int y) {
  return {.level = octave.Row(layer, 0),
          .stride = octave.stride(),
          .cols = octave.window().width,
          .rows = octave.window().height,
          .x = x - octave.window().x,
          .y = y - octave.window().y};
}

auto PlaceOf(const Located& l) { return std::tie(l.y, l.x, l.size, l.angle_deg); }

using PatchWeights = std::array<float, kSiftMaxPatchRadius + 1>;

// The smoothed histogram of directions around a keypoint, with one more value before it and behind it.
std::array<float, kSiftDirections + 2> SmoothHistogram(const Octave& octave, const SiftExtremum& extremum,
                                                       const SiftKernels& kernels) {
  SiftPatch patch = PatchOf(octave, extremum.layer, extremum.x, extremum.y);
  const float sigma = 1.5f * extremum.octave_sigma;
  patch.radius = static_cast<int>(std::nearbyint(4.5f * extremum.octave_sigma));
  PatchWeights weights;
  GaussianWeights(sigma * sigma, patch.radius, weights.data());
  patch.weights = weights.data();
  float sums[kSiftDirections + 6];  // three of the other end at either end
  float* first = sums + 3;
  kernels.orientation_histogram(patch, first);
  for (int b = 0; b < 3; ++b) {
    sums[b] = first[kSiftDirections - 3 + b];
    first[kSiftDirections + b] = first[b];
  }
  std::array<float, kSiftDirections + 2> smooth;
  for (int b = -1; b <= kSiftDirections; ++b) {
    smooth[b + 1] = (first[b - 2] + first[b + 2]) * (1 / 16.0f) +
                    (first[b - 1] + first[b + 1]) * (4 / 16.0f) + first[b] * (6 / 16.0f);
  }
  return smooth;
}

// A keypoint for each of the histogram's peaks [Lowe04 §5].
void AddOriented(const Located& located, const SiftKernels& kernels, PooledVector<Located>* oriented) {
  const auto smooth = SmoothHistogram(*located.octave, located.extremum, kernels);
  const float least = 0.8f * *std::max_element(smooth.begin(), smooth.end());
  for (int b = 0; b < kSiftDirections; ++b) {
    const float before = smooth[b], here = smooth[b + 1], after = smooth[b + 2];
    if (!(here > before && here > after && here >= least)) continue;
    // The vertex of the parabola through the three.
    float place = static_cast<float>(b) + 0.5f * (before - after) / (before - 2 * here + after);
    if (place < 0) place += kSiftDirections;
    const float angle = 360.0f - 360.0f / kSiftDirections * place;
    oriented->push_back(located);
    oriented->back().angle_deg = angle >= 360.0f ? 0.0f : angle;
  }
}

// The strongest features, those as strong as the weakest one in the order of their places.  Orientations
// are found only as far down as they are needed.
PooledVector<Located> OrientStrongest(PooledVector<Located> located, size_t max_num,
                                      const SiftKernels& kernels) {
  if (located.size() > max_num) {
    std::sort(located.begin(), located.end(), [](const Located& a, const Located& b) {
      return a.extremum.response != b.extremum.response ? a.extremum.response > b.extremum.response
                                                        : IsBefore(a.extremum, b.extremum);
    });
  }
  PooledVector<Located> oriented;
  oriented.reserve(std::min(located.size(), max_num) + located.size() / 4);
  size_t num_done = 0;
  while (num_done < located.size() && oriented.size() < max_num) {
    size_t end = std::min(located.size(), num_done + max_num - oriented.size());
    while (end < located.size() && located[end].extremum.response == located[end - 1].extremum.response)
      ++end;
    for (; num_done < end; ++num_done) AddOriented(located[num_done], kernels, &oriented);
  }
  if (oriented.size() > max_num) {
    std::nth_element(oriented.begin(), oriented.begin() + static_cast<int64_t>(max_num), oriented.end(),
                     [](const Located& a, const Located& b) {
                       return a.extremum.response != b.extremum.response
                                  ? a.extremum.response > b.extremum.response
                                  : PlaceOf(a) < PlaceOf(b);
                     });
    oriented.resize(max_num);
  }
  std::sort(oriented.begin(), oriented.end(),
            [](const Located& a, const Located& b) { return PlaceOf(a) < PlaceOf(b); });
  return oriented;
}

void Describe(const Located& oriented, const SiftKernels& kernels, uint8_t* root_sift) {
  const SiftExtremum& extremum = oriented.extremum;
  SiftPatch patch =
      PatchOf(*oriented.octave, extremum.layer, static_cast<int>(std::nearbyint(extremum.octave_x)),
              static_cast<int>(std::nearbyint(extremum.octave_y)));
  const float cell = 3 * extremum.octave_sigma;
  patch.radius = static_cast<int>(std::nearbyint(cell * 1.41421356f * (kSiftCells + 1) * 0.5f));
  // A Gaussian of half the descriptor's width [Lowe04 §6.1].
  const float sigma = cell * kSiftCells / 2;
  PatchWeights weights;
  GaussianWeights(sigma * sigma, patch.radius, weights.data());
  patch.weights = weights.data();
  const float angle_deg = oriented.angle_deg == 0 ? 0.0f : 360.0f - oriented.angle_deg;
  const SineCosine turn = ExactSineCosine(angle_deg);
  patch.cosine = static_cast<float>(turn.cosine) / cell;
  patch.sine = static_cast<float>(turn.sine) / cell;
  patch.orientation = angle_deg * (kSiftCellDirections / 360.0f);
  kernels.describe(patch, root_sift);
}

// Descriptors of keypoints, octave by octave, as neighbours share what is in the caches.
PooledVector<SiftFeature> DescribeAll(std::span<const Octave> octaves, std::span<const Located> oriented,
                                      const SiftKernels& kernels) {
  PooledVector<SiftFeature> features(oriented.size());
  for (const Octave& octave : octaves) {
    for (size_t i = 0; i < oriented.size(); ++i) {
      const Located& o = oriented[i];
      if (o.octave != &octave) continue;
      features[i] = {.x = o.x,
                     .y = o.y,
                     .size = o.size,
                     .angle_deg = o.angle_deg,
                     .response = o.extremum.response,
                     .octave = o.extremum.octave};
      Describe(o, kernels, features[i].root_sift.data());
    }
  }
  return features;
}

}  // namespace

PooledVector<SiftFeature> FindSift(const cv::Mat& grey, const cv::Mat& mask, const SiftSearch& search,
                                   const SiftKernels& kernels) {
  SiftMemory& memory = RequiredOfThread<SiftMemory>();
  const cv::Rect region = search.region & cv::Rect({0, 0}, grey.size());
  if (region.empty() && !search.region.empty()) return {};
  const PooledVector<OctavePlan> plans = PlanOctaves(grey.size(), region, search);
  size_t num_floats = 0;
  for (const OctavePlan& plan : plans) num_floats += Octave::NumFloats(plan);
  float* next = memory.Take(num_floats);
  PooledVector<Octave> octaves;
  octaves.reserve(plans.size());
  PooledVector<SiftExtremum> extrema;
  const SiftThresholds thresholds{search.contrast_threshold, search.edge_threshold};
  for (const OctavePlan& plan : plans) {
    Octave& octave = octaves.emplace_back(plan, next, kernels);
    next += Octave::NumFloats(plan);
    if (plan.source == OctaveSource::kOctaveBefore) {
      octave.Sweep(octaves[octaves.size() - 2], thresholds, &extrema);
    } else {
      octave.Sweep(grey, thresholds, &extrema);
    }
  }
  const PooledVector<Located> oriented =
      OrientStrongest(SelectExtrema(octaves, mask, search, region, std::move(extrema)),
                      static_cast<size_t>(search.max_num_features), kernels);
  PooledVector<SiftFeature> features = DescribeAll(octaves, oriented, kernels);
  memory.Trim(kMaxFloatsKept);
  return features;
}

}  // namespace cairn
