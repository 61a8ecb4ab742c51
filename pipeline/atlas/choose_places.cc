#include "pipeline/atlas/choose_places.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <queue>
#include <utility>

#include "core/atlas/atlas_file.h"

namespace cairn::pipeline {
namespace {

// About as many as one image shows (AtlasMap::places).
constexpr size_t kCodesOfPlace = 32;

std::vector<std::vector<int32_t>> ImagesOfLandmarks(const MapRows& rows) {
  std::vector<std::vector<int32_t>> images(rows.landmarks.size());
  for (size_t image = 0; image < rows.images.size(); ++image) {
    for (const LandmarkIdx landmark : rows.images[image].landmarks)
      images[landmark].push_back(static_cast<int32_t>(image));
  }
  return images;
}

// About the probability that another sighting has this code, but for bits that cost little: a coefficient
// moves by a normal deviate of `kSightingSigma` (CostOf).
double StabilityOf(const DescriptorCode& code) {
  constexpr double kSightingSigma = 20;
  // How often landmarks were found again (redkitchen) fell with this root of the probability of no change.
  constexpr double kExponent = 0.12;
  double log_same = 0;
  for (const int16_t margin : code.margins)
    log_same += std::log(1 - std::erfc(margin / kSightingSigma / std::numbers::sqrt2) / 2);
  return std::exp(kExponent * log_same);
}

}  // namespace

std::vector<LandmarkIdx> RankLandmarks(const MapRows& rows, const std::vector<DescriptorCode>& codes,
                                       const std::vector<int>& num_maps_alike) {
  const std::vector<std::vector<int32_t>> images = ImagesOfLandmarks(rows);
  std::vector<double> worth(codes.size());
  for (size_t i = 0; i < codes.size(); ++i) worth[i] = StabilityOf(codes[i]) / (1 + num_maps_alike[i]);
  std::vector<double> shown(rows.images.size());  // worth of the chosen landmarks that an image shows
  const auto gain = [&](LandmarkIdx landmark) {
    double sum = 0;
    for (const int32_t image : images[landmark]) sum += 1 / ((1 + shown[image]) * (1 + shown[image]));
    return worth[landmark] * sum;
  };
  using Entry = std::pair<double, LandmarkIdx>;
  const auto comes_later = [](const Entry& a, const Entry& b) {
    return a.first != b.first ? a.first < b.first : a.second > b.second;
  };
  std::priority_queue<Entry, std::vector<Entry>, decltype(comes_later)> open(comes_later);
  for (size_t i = 0; i < codes.size(); ++i)
    open.emplace(gain(static_cast<LandmarkIdx>(i)), static_cast<LandmarkIdx>(i));
  std::vector<LandmarkIdx> ranked;
  while (!open.empty()) {
    auto [old_gain, landmark] = open.top();
    open.pop();
    // What the others add only falls: the first whose gain is still what it was is the best.
    const double now = gain(landmark);
    if (now < old_gain && !open.empty() && comes_later({now, landmark}, open.top())) {
      open.emplace(now, landmark);
      continue;
    }
    for (const int32_t image : images[landmark]) shown[image] += worth[landmark];
    ranked.push_back(landmark);
  }
  return ranked;
}

std::vector<std::vector<uint32_t>> PlacesOf(const MapRows& rows, const std::vector<DescriptorCode>& codes,
                                            std::vector<LandmarkIdx> landmarks) {
  const std::vector<std::vector<int32_t>> images = ImagesOfLandmarks(rows);
  // The middle one of the images that see it: surveys go from place to place.
  const auto place = [&](LandmarkIdx landmark) {
    const std::vector<int32_t>& seen_in = images[landmark];
    return seen_in.empty() ? -1 : seen_in[seen_in.size() / 2];
  };
  std::sort(landmarks.begin(), landmarks.end(),
            [&](LandmarkIdx a, LandmarkIdx b) { return std::pair(place(a), a) < std::pair(place(b), b); });
  const size_t num_places = (landmarks.size() + kCodesOfPlace - 1) / kCodesOfPlace;
  std::vector<std::vector<uint32_t>> places(num_places);
  for (size_t i = 0; i < landmarks.size(); ++i)
    places[i * num_places / landmarks.size()].push_back(codes[landmarks[i]].bits);
  for (std::vector<uint32_t>& codes_there : places) {
    std::sort(codes_there.begin(), codes_there.end());
    codes_there.erase(std::unique(codes_there.begin(), codes_there.end()), codes_there.end());
  }
  return places;
}

std::vector<std::vector<uint32_t>> ChoosePlaces(const MapRows& rows, const std::vector<DescriptorCode>& codes,
                                                const std::vector<LandmarkIdx>& ranked, size_t max_num_bytes,
                                                int min_num_codes) {
  const auto places_of_first = [&](size_t num) {
    return PlacesOf(rows, codes, {ranked.begin(), ranked.begin() + static_cast<std::ptrdiff_t>(num)});
  };
  size_t enough = std::min(ranked.size(), static_cast<size_t>(min_num_codes));
  size_t too_many = ranked.size() + 1;
  while (enough + 1 < too_many) {
    const size_t middle = std::midpoint(enough, too_many);
    (NumBytesOfPlaces(places_of_first(middle)) <= max_num_bytes ? enough : too_many) = middle;
  }
  return places_of_first(enough);
}

}  // namespace cairn::pipeline
