#include "stages/emit_map/previous/match_previous.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <unordered_map>
#include <utility>

#include "core/base/quantiles.h"
#include "core/features/features.h"
#include "core/features/transform_code.h"

namespace cairn::emit_map {
namespace {

// A keypoint this far from where the map has a landmark in the same image may be it, px: poses and places are
// other estimates of the same.
constexpr double kMaxErrorPx = 6;
// And with a descriptor this near (norms are 512).  What descriptors of a map lose by their levels, up to 75,
// is within it.
constexpr double kMaxDescriptorDistance = 220;
// A landmark looks otherwise than it did where its class is farther from it than what its levels lose, by
// this.
constexpr double kMaxDescriptorDrift = 60;
// Standard deviations.
constexpr double kMaxDeviations = 4;
// Frames are the same where half of all landmarks lie within this part of their distance from the cameras.
constexpr double kMaxFrameErrorRatio = 0.01;

double DescriptorDistance(const MapRows& previous, int32_t landmark, const FeatureClass& feature_class) {
  const DescriptorKind& kind = previous.descriptor_kind;
  DescriptorMatrix look = feature_class.descriptor;
  if (kind.type == DescriptorType::kBinary) RoundToBits(kind, &look);
  const double distance =
      (previous.descriptors.row(landmark).cast<float>() - look.row(0).cast<float>()).norm();
  return distance * 512 / std::sqrt(kind.space().squared_norm);
}

std::vector<int32_t> RowsOfImages(const Classes& classes, const MapRows& previous) {
  std::unordered_map<std::string, int32_t> row_of_name;
  for (size_t i = 0; i < previous.images.size(); ++i)
    row_of_name[previous.images[i].name] = static_cast<int32_t>(i);
  // The first survey's images have its name before theirs since there is a second.
  const std::string first =
      previous.sessions.empty() && !classes.sessions.empty() ? classes.sessions[0] + "/" : std::string();
  std::vector<int32_t> rows;
  for (const SurveyImage& image : classes.images) {
    const bool is_of_first = image.name.starts_with(first);
    const auto found = row_of_name.find(is_of_first ? image.name.substr(first.size()) : image.name);
    rows.push_back(found == row_of_name.end() ? kNotBefore : found->second);
  }
  return rows;
}

struct Sighting {
  size_t i = 0;  // position in Classes::classes
  const Observation* observation = nullptr;
};

// Per image of the survey, the classes that it sees.
std::vector<std::vector<Sighting>> SightingsByImage(const Classes& classes) {
  std::unordered_map<ImageId, size_t> index;
  for (size_t i = 0; i < classes.images.size(); ++i) index[classes.images[i].image_id] = i;
  std::vector<std::vector<Sighting>> sightings(classes.images.size());
  for (size_t i = 0; i < classes.classes.size(); ++i) {
    for (const Observation& observation : classes.classes[i].observations) {
      const auto image = index.find(observation.image_id);
      if (image != index.end()) sightings[image->second].push_back({i, &observation});
    }
  }
  return sightings;
}

// In how many images each pair of a landmark and a class is seen at one place.
using Votes = std::map<std::pair<int32_t, size_t>, int>;

Votes CountVotes(const Classes& classes, const MapRows& previous, const std::vector<int32_t>& row_of_image) {
  std::unordered_map<CameraId, const Camera*> cameras;
  for (const Camera& camera : previous.cameras) cameras[camera.camera_id] = &camera;
  const auto sightings = SightingsByImage(classes);
  Votes votes;
  for (size_t i = 0; i < row_of_image.size(); ++i) {
    if (row_of_image[i] == kNotBefore) continue;
    const MapImage& image = previous.images[row_of_image[i]];
    const Camera& camera = *cameras.at(image.camera_id);
    for (const LandmarkIdx landmark : image.landmarks) {
      const auto pixel =
          ImageFromCamera(camera, image.cam_from_world * previous.landmarks[landmark].position);
      if (!pixel) continue;
      for (const Sighting& sighting : sightings[i]) {
        const Keypoint& keypoint = sighting.observation->keypoint;
        if (std::hypot(keypoint.x - pixel->x(), keypoint.y - pixel->y()) > kMaxErrorPx) continue;
        if (DescriptorDistance(previous, landmark, classes.classes[sighting.i]) <= kMaxDescriptorDistance)
          ++votes[{landmark, sighting.i}];
      }
    }
  }
  return votes;
}

// The pairs that have most votes first, each landmark and each class in one.
std::vector<int32_t> PairUp(const Votes& votes, const Classes& classes, const MapRows& previous) {
  struct Pair {
    int num = 0;
    double distance = 0;
    int32_t landmark = 0;
    size_t i = 0;
  };
  std::vector<Pair> pairs;
  for (const auto& [pair, num] : votes) {
    const auto& [landmark, i] = pair;
    pairs.push_back({num, DescriptorDistance(previous, landmark, classes.classes[i]), landmark, i});
  }
  // Of as many votes the nearer; the rest in the order of the map, which is that of landmarks and classes.
  std::stable_sort(pairs.begin(), pairs.end(), [](const Pair& a, const Pair& b) {
    return a.num != b.num ? a.num > b.num : a.distance < b.distance;
  });
  std::vector<int32_t> landmark_of_class(classes.classes.size(), kNotBefore);
  std::vector<char> is_taken(previous.landmarks.size(), 0);
  for (const Pair& pair : pairs) {
    if (is_taken[pair.landmark] != 0 || landmark_of_class[pair.i] != kNotBefore) continue;
    landmark_of_class[pair.i] = pair.landmark;
    is_taken[pair.landmark] = 1;
  }
  return landmark_of_class;
}

// How far the map's landmarks lie from their classes, as a part of their distance from an image that sees
// them. REQUIRES: a landmark that has a class
double FrameErrorRatio(const Classes& classes, const MapRows& previous,
                       const std::vector<int32_t>& landmark_of_class) {
  std::vector<double> distances(previous.landmarks.size(), 0);
  for (const MapImage& image : previous.images) {
    for (const LandmarkIdx landmark : image.landmarks)
      distances[landmark] = (image.cam_from_world * previous.landmarks[landmark].position).norm();
  }
  std::vector<double> ratios;
  for (size_t i = 0; i < landmark_of_class.size(); ++i) {
    const int32_t landmark = landmark_of_class[i];
    if (landmark == kNotBefore) continue;
    ratios.push_back((classes.classes[i].position - previous.landmarks[landmark].position).norm() /
                     distances[landmark]);
  }
  return Median(ratios);
}

// Whether the descriptor that the map has is the class's, but for what its levels lose.
bool LooksSo(const MapRows& previous, int32_t landmark, const FeatureClass& feature_class) {
  DescriptorMatrix stored = feature_class.descriptor;
  if (previous.descriptor_code) QuantizeByCode(*previous.descriptor_code, &stored);
  const double loss = (stored.cast<float>() - feature_class.descriptor.cast<float>()).norm();
  return DescriptorDistance(previous, landmark, feature_class) <= std::hypot(loss, kMaxDescriptorDrift);
}

bool IsThere(const FeatureClass& feature_class, const MapLandmark& landmark) {
  const double variance = feature_class.covariance.trace() + landmark.covariance.trace();
  return (feature_class.position - landmark.position).squaredNorm() <=
         kMaxDeviations * kMaxDeviations * variance;
}

}  // namespace

size_t PreviousMatches::NumMatched() const {
  return landmark_of_class.size() -
         static_cast<size_t>(std::count(landmark_of_class.begin(), landmark_of_class.end(), kNotBefore));
}

Result<PreviousMatches> MatchPrevious(const Classes& classes, const MapRows& previous,
                                      const std::string& path) {
  CAIRN_RETURN_IF_ERROR(CheckSameKind(previous.descriptor_kind, classes.descriptor_kind, path));
  PreviousMatches matches{.row_of_image = RowsOfImages(classes, previous)};
  const auto none =
      static_cast<size_t>(std::count(matches.row_of_image.begin(), matches.row_of_image.end(), kNotBefore));
  if (none == matches.row_of_image.size()) {
    const auto example = [](const auto& images) { return images.empty() ? "none" : images[0].name; };
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: none of its {} images (such as {}) is among the {} of this survey (such as {}): a "
                     "previous map is one of the same survey, before something was added to it",
                     path, previous.images.size(), example(previous.images), classes.images.size(),
                     example(classes.images));
  }
  matches.landmark_of_class = PairUp(CountVotes(classes, previous, matches.row_of_image), classes, previous);
  matches.holds.assign(classes.classes.size(), 0);
  if (matches.NumMatched() == 0) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: none of its {} landmarks is among the {} classes of this survey, though {} of its "
                     "images are: its features are others",
                     path, previous.landmarks.size(), classes.classes.size(),
                     matches.row_of_image.size() - none);
  }
  const double error = FrameErrorRatio(classes, previous, matches.landmark_of_class);
  if (!(error <= kMaxFrameErrorRatio)) {
    return MakeError(
        ErrorCode::kInvalidArgument,
        "{}: its landmarks lie elsewhere than in this survey, by {:.0f} % of their distance from "
        "the cameras: the frames of the two differ; leave the capture that gives the frame where "
        "it was, the first",
        path, 100 * error);
  }
  for (size_t i = 0; i < matches.holds.size(); ++i) {
    const int32_t landmark = matches.landmark_of_class[i];
    if (landmark == kNotBefore) continue;
    const FeatureClass& feature_class = classes.classes[i];
    const bool holds =
        IsThere(feature_class, previous.landmarks[landmark]) && LooksSo(previous, landmark, feature_class);
    matches.holds[i] = holds ? 1 : 0;
  }
  return matches;
}

}  // namespace cairn::emit_map
