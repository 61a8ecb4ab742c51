#include "core/promise/later_views.h"

#include <algorithm>
#include <numeric>

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
  std::vector<int32_t> of_today;  // so far
  for (const int32_t image : latest_first) {
    double least = kReach * kReach;
    for (const int32_t other : of_today) {
      if (session[other] <= session[image]) break;
      const double squared = distance.Squared(image, other);
      if (session[image] >= 0 && squared < least) least = squared, later[image] = other;
    }
    if (later[image] < 0) of_today.push_back(image);
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
