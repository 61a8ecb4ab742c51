#include "core/promise/later_views.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "core/capture/sessions.h"

namespace cairn {
namespace {

constexpr double kReach = 2;

}  // namespace

std::vector<int32_t> LaterViews(const Classes& classes, const ViewDistance& distance) {
  std::vector<int32_t> later(classes.images.size(), -1);
  if (classes.sessions.size() < 2) return later;
  std::vector<int> session;
  for (const SurveyImage& image : classes.images)
    session.push_back(SessionOfImage(classes.sessions, image.name));
  std::vector<int32_t> latest_first(later.size());
  std::iota(latest_first.begin(), latest_first.end(), 0);
  std::stable_sort(latest_first.begin(), latest_first.end(),
                   [&](int32_t a, int32_t b) { return session[a] > session[b]; });
  constexpr int32_t kNotYet = -1;
  std::vector<int32_t> turn(later.size(), kNotYet);  // of those of today so far: when they came
  for (int32_t n = 0; n < std::ssize(latest_first); ++n) {
    const int32_t image = latest_first[n];
    std::pair<double, int32_t> nearest(kReach * kReach, kNotYet);  // of equals the one that came first
    if (session[image] >= 0) {
      distance.tree().ForNear(image, kReach * kReach, [&](int32_t other, double squared) {
        if (turn[other] != kNotYet && session[other] > session[image])
          nearest = std::min(nearest, std::pair(squared, turn[other]));
      });
    }
    if (nearest.second != kNotYet) {
      later[image] = latest_first[nearest.second];
    } else {
      turn[image] = n;
    }
  }
  return later;
}

std::vector<int32_t> ImagesOfToday(const std::vector<int32_t>& later_views) {
  std::vector<int32_t> images;
  for (size_t i = 0; i < later_views.size(); ++i) {
    if (later_views[i] < 0) images.push_back(static_cast<int32_t>(i));
  }
  return images;
}

}  // namespace cairn
