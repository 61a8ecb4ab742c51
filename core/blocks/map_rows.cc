#include "core/blocks/map_rows.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "core/base/printable.h"
#include "core/blocks/map_documents.h"
#include "core/capture/sessions.h"
#include "core/world/appearance.h"

namespace cairn {
namespace {

template <typename... Args>
Error Invalid(fmt::format_string<Args...> format, Args&&... args) {
  return MakeError(ErrorCode::kInvalidArgument, "map: {}", fmt::format(format, std::forward<Args>(args)...));
}

// Stored in 32 bits of 0.1 mm: farther than 200 km is a mistake, not a map.
constexpr double kMaxExtentM = 2e5;

bool IsPose(const Pose& pose) {
  return pose.translation.allFinite() && std::abs(pose.rotation.norm() - 1) < 1e-6;  // false for NaN
}

// Strictly ascending, in [0, limit).
bool IsAscending(const std::vector<int32_t>& values, size_t limit) {
  for (size_t i = 0; i < values.size(); ++i) {
    if (values[i] < 0 || static_cast<size_t>(values[i]) >= limit || (i > 0 && values[i] <= values[i - 1]))
      return false;
  }
  return true;
}

Status CheckImages(const MapRows& rows) {
  std::set<CameraId> camera_ids;
  for (const Camera& camera : rows.cameras) camera_ids.insert(camera.camera_id);
  for (size_t i = 0; i < rows.images.size(); ++i) {
    const MapImage& image = rows.images[i];
    if (i > 0 && image.image_id <= rows.images[i - 1].image_id)
      return Invalid("image {} is out of order", image.image_id);
    if (!camera_ids.contains(image.camera_id))
      return Invalid("image {} has camera {}, which the map lacks", image.image_id, image.camera_id);
    if (!IsPose(image.cam_from_world) || image.cam_from_world.translation.cwiseAbs().maxCoeff() > kMaxExtentM)
      return Invalid("image {}: its pose is not valid", image.image_id);
    if (image.station < -1 || image.station >= static_cast<StationIdx>(rows.stations.size())) {
      return Invalid("image {}: station {} of {}", image.image_id, image.station, rows.stations.size());
    }
    if (image.name.size() > kMaxNameBytes)
      return Invalid("image {}: a name of {} bytes", image.image_id, image.name.size());
    if (HasControlCharacter(image.name))
      return Invalid("image {}: its name has a control character", image.image_id);
    if (image.landmarks.size() > kMaxImageLandmarks) {
      return Invalid("image {}: {} landmarks, at most {} are stored", image.image_id, image.landmarks.size(),
                     kMaxImageLandmarks);
    }
    if (!IsAscending(image.landmarks, rows.landmarks.size())) {
      return Invalid("image {}: its landmarks are not ascending below {}", image.image_id,
                     rows.landmarks.size());
    }
  }
  return Ok();
}

Status CheckRegions(const MapRows& rows) {
  for (size_t i = 0; i < rows.stations.size(); ++i) {
    if (!(rows.stations[i].position.array().abs() <= kMaxExtentM).all() ||  // nor NaN, which maxCoeff misses
        !std::isfinite(rows.stations[i].heading_deg.value_or(0))) {
      return Invalid("station {}: its place is not finite", i);
    }
  }
  for (size_t i = 0; i < rows.station_edges.size(); ++i) {
    const auto& [u, v] = rows.station_edges[i];
    if (u < 0 || u >= v || v >= static_cast<StationIdx>(rows.stations.size()) ||
        (i > 0 && rows.station_edges[i] <= rows.station_edges[i - 1])) {
      return Invalid("edge {}: stations {} and {} of {}", i, u, v, rows.stations.size());
    }
  }
  if (rows.uncovered_limit < 0 || rows.lower_bound.value_or(0) < 0 ||
      rows.lower_bound.value_or(0) > static_cast<int64_t>(rows.regions.size())) {
    return Invalid("{} regions with a lower bound of {}, {} stations uncovered", rows.regions.size(),
                   rows.lower_bound.value_or(0), rows.uncovered_limit);
  }
  // Each region has a station, or a place and heading of the promise, that no other one before it has.
  if (const auto& promise = rows.findings.promise; promise && rows.regions.size() > promise->nodes.size())
    return Invalid("{} regions of {} promises", rows.regions.size(), promise->nodes.size());
  if (!rows.findings.promise && rows.regions.size() > rows.stations.size())
    return Invalid("{} regions of {} stations", rows.regions.size(), rows.stations.size());
  for (size_t i = 0; i < rows.regions.size(); ++i) {
    if (rows.regions[i].stations.empty()) return Invalid("region {} has no station", i);
    if (!IsAscending(rows.regions[i].stations, rows.stations.size()) ||
        !IsAscending(rows.regions[i].landmarks, rows.landmarks.size())) {
      return Invalid("region {}: its stations or landmarks are not ascending below {} and {}", i,
                     rows.stations.size(), rows.landmarks.size());
    }
  }
  return Ok();
}

Status CheckAmbiguity(const MapRows& rows) {
  const auto num_nodes = static_cast<int64_t>(rows.appearance.size());
  for (int64_t i = 0; i < num_nodes; ++i) {
    const MapAppearanceNode& node = rows.appearance[i];
    if (node.entropy.has_value() != rows.appearance[0].entropy.has_value())
      return Invalid("appearance node {}: some nodes have an entropy and others have none", i);
    if (!(node.entropy.value_or(0) >= 0 && node.entropy.value_or(0) <= kMaxEntropy) ||
        (!node.entropy && !node.look_alikes.empty()))
      return Invalid("appearance node {}: an entropy of {} nats", i, node.entropy.value_or(0));
    for (size_t k = 0; k < node.look_alikes.size(); ++k) {
      const int64_t before = k == 0 ? i : node.look_alikes[k - 1].node;
      const MapAppearanceNode::LookAlike& other = node.look_alikes[k];
      if (other.node <= before || other.node >= num_nodes || !(other.score > 0 && other.score <= 1))
        return Invalid("appearance node {}: look-alike {} makes no sense", i, k);
    }
  }
  return Ok();
}

Status CheckAppearance(const MapRows& rows) {
  const auto num_nodes = static_cast<int64_t>(rows.appearance.size());
  std::vector<char> is_taken(rows.images.size(), 0);
  bool is_any_kept = false;
  for (int64_t i = 0; i < num_nodes; ++i) {
    const MapAppearanceNode& node = rows.appearance[i];
    is_any_kept = is_any_kept || node.is_kept;
    if (node.images.empty() || !IsAscending(node.images, rows.images.size())) {
      return Invalid("appearance node {}: its images are not ascending below {}", i, rows.images.size());
    }
    for (const int32_t image : node.images) {
      if (is_taken[image]) return Invalid("image {} is of two appearance nodes", image);
      is_taken[image] = 1;
    }
    for (size_t k = 0; k < node.links.size(); ++k) {
      const int64_t before = k == 0 ? i : node.links[k - 1].node;
      const int64_t other = node.links[k].node;
      if (other <= before || other >= num_nodes || node.links[k].num_inliers <= 0 ||
          !(node.is_kept || rows.appearance[other].is_kept)) {
        return Invalid("appearance node {}: link {} makes no sense", i, k);
      }
    }
  }
  CAIRN_RETURN_IF_ERROR(CheckAmbiguity(rows));
  if (rows.documents == "kept" && !is_any_kept) return Invalid("retrieval on kept images, but none is kept");
  return Ok();
}

Status CheckPlan(const Views& views) {
  if (views.plan.walls.empty() && !views.parents.empty())
    return Invalid("{} regions of a floor plan without walls", views.num_faces());
  if (const Status status = CheckViews(views, "floor plan"); !status.ok())
    return Invalid("{}", status.error().message);
  if (!IsNumberedByUse(views)) return Invalid("floor plan: vertices are not numbered as regions name them");
  return Ok();
}

}  // namespace

std::vector<std::vector<int>> LandmarkSessions(const MapRows& rows) {
  std::vector<std::vector<int>> sessions(rows.landmarks.size());
  if (rows.sessions.empty()) return sessions;
  for (const MapImage& image : rows.images) {
    const int session = SessionOfImage(rows.sessions, image.name);
    if (session < 0) continue;
    for (const LandmarkIdx landmark : image.landmarks) {
      std::vector<int>& of_landmark = sessions[landmark];
      const auto place = std::lower_bound(of_landmark.begin(), of_landmark.end(), session);
      if (place == of_landmark.end() || *place != session) of_landmark.insert(place, session);
    }
  }
  return sessions;
}

std::string TriedWord(const MapHead& head) {
  return head.self_test.contains(kLeftOutRunsFigure) ? "left-out" : "held-out";
}

Status CheckMapHead(const MapHead& head) {
  for (const std::string* text : {&head.name, &head.writer, &head.instruction_set, &head.landmark_choice,
                                  &head.algorithm, &head.frame.unit, &head.frame.source}) {
    if (HasControlCharacter(*text)) return Invalid("'{}' has a control character", *text);
  }
  for (const auto& [stage, options] : head.stage_options) {
    if (HasControlCharacter(stage)) return Invalid("stage '{}' has a control character", stage);
  }
  for (const auto& [file, hash] : head.input_hashes) {
    if (HasControlCharacter(file) || HasControlCharacter(hash))
      return Invalid("input '{}' has a control character", file);
  }
  CAIRN_RETURN_IF_ERROR(CheckCaptureFrame(head.frame));
  if (head.sessions.size() > kMaxNumSessions)
    return Invalid("{} sessions, at most {} are stored", head.sessions.size(), kMaxNumSessions);
  for (size_t i = 0; i < head.sessions.size(); ++i) {
    if (!IsSessionName(head.sessions[i]))
      return Invalid("session '{}': the name is not valid", head.sessions[i]);
    const auto place = head.sessions.begin() + static_cast<std::ptrdiff_t>(i);
    if (std::find(head.sessions.begin(), place, head.sessions[i]) != place)
      return Invalid("session '{}' is listed twice", head.sessions[i]);
  }
  for (size_t i = 0; i < head.cameras.size(); ++i) {
    CAIRN_RETURN_IF_ERROR(CheckCamera(head.cameras[i]));
    if (i > 0 && head.cameras[i].camera_id <= head.cameras[i - 1].camera_id) {
      return Invalid("camera {} is out of order", head.cameras[i].camera_id);
    }
  }
  for (const Pose& frame : {head.floor_from_world, head.camera_from_given}) {
    if (!IsPose(frame) || frame.translation.cwiseAbs().maxCoeff() > kMaxExtentM)
      return Invalid("the rotation of a frame, or its place, is not valid");
  }
  if (!(head.stated_pose_sigma_m >= 0 && head.stated_pose_sigma_m < 1e3) ||
      !(head.stated_pose_sigma_deg >= 0 && head.stated_pose_sigma_deg <= 180)) {
    return Invalid("the noise of the stated poses is not a valid number");
  }
  if (!(head.covariance_scale == 0 || (head.covariance_scale >= 1 && head.covariance_scale < 1e6)))
    return Invalid("the scale of covariances is neither 0 nor in 1 .. 10^6");
  if (!(head.keypoint_correlation >= 0 && head.keypoint_correlation <= 1))
    return Invalid("the correlation of keypoints is not in 0 .. 1");
  for (size_t i = 0; i < head.stated_cameras.size(); ++i) {
    const Camera& stated = head.stated_cameras[i];
    CAIRN_RETURN_IF_ERROR(CheckCamera(stated));
    const auto is_same = [&](const Camera& camera) {
      return camera.camera_id == stated.camera_id && camera.width == stated.width &&
             camera.height == stated.height;
    };
    if (std::none_of(head.cameras.begin(), head.cameras.end(), is_same) ||
        (i > 0 && stated.camera_id <= head.stated_cameras[i - 1].camera_id)) {
      return Invalid("stated camera {} is out of order, or no camera of the map", stated.camera_id);
    }
  }
  if (head.documents != "all" && head.documents != "kept")
    return Invalid("documents = '{}', expected all or kept", head.documents);
  for (const auto& [name, value] : head.self_test) {
    if (!std::isfinite(value)) return Invalid("self-test figure '{}' is not finite", name);
    if (HasControlCharacter(name)) return Invalid("self-test figure '{}' has a control character", name);
  }
  return Ok();
}

Status CheckMapRows(const MapRows& rows) {
  CAIRN_RETURN_IF_ERROR(CheckMapHead(rows));
  CAIRN_RETURN_IF_ERROR(CheckImages(rows));
  CAIRN_RETURN_IF_ERROR(CheckAppearance(rows));
  CAIRN_RETURN_IF_ERROR(CheckRegions(rows));
  CAIRN_RETURN_IF_ERROR(CheckPlan(rows.views));
  CAIRN_RETURN_IF_ERROR(CheckVisualMap(rows.visual_map, static_cast<int64_t>(rows.landmarks.size()),
                                       static_cast<int64_t>(rows.images.size())));
  if (rows.descriptors.rows() != static_cast<Eigen::Index>(rows.landmarks.size())) {
    return Invalid("{} landmarks, but {} descriptors", rows.landmarks.size(), rows.descriptors.rows());
  }
  const DescriptorKind& kind = rows.descriptor_kind;
  if (!rows.landmarks.empty() && rows.descriptors.cols() != kind.num_values)
    return Invalid("descriptors of {} values, expected {}", rows.descriptors.cols(), kind.num_values);
  const Vocabulary& words = rows.vocabulary;
  if (!words.nodes.empty() && (words.kind != kind || words.centres.cols() != kind.num_values)) {
    return Invalid("words of descriptors of the kind '{}', {} values, but landmarks of the kind '{}'",
                   ToString(words.kind), words.centres.cols(), ToString(kind));
  }
  if (rows.descriptor_code && !kind.is_sift())
    return Invalid("a code of SIFT's descriptors for those of the kind '{}'", ToString(kind));
  for (size_t i = 0; i < rows.landmarks.size(); ++i) {
    const MapLandmark& landmark = rows.landmarks[i];
    if (!landmark.position.allFinite() || !landmark.covariance.allFinite() || !(landmark.scale_m >= 0) ||
        (landmark.covariance.diagonal().array() < 0).any()) {
      return Invalid("landmark {}: its position, covariance or scale is not a valid number", i);
    }
    if (landmark.position.cwiseAbs().maxCoeff() > kMaxExtentM || landmark.scale_m > kMaxExtentM) {
      return Invalid("landmark {} lies more than 200 km from the origin of its frame", i);
    }
  }
  const std::vector<char> is_document = DocumentImages(rows);
  size_t image = 0;
  for (const ImageId image_id : rows.vocabulary.document_ids) {
    while (image < rows.images.size() && rows.images[image].image_id < image_id) ++image;
    if (image == rows.images.size() || rows.images[image].image_id != image_id) {
      return Invalid("the vocabulary knows image {}, which the map lacks", image_id);
    }
    if (!is_document[image]) return Invalid("the vocabulary knows image {}, which is not kept", image_id);
  }
  return CheckMapFindings(rows.findings, {.num_regions = rows.regions.size(),
                                          .num_stations = rows.stations.size(),
                                          .num_images = rows.images.size(),
                                          .num_sessions = rows.sessions.size()});
}

std::vector<int> LandmarksSeenAt(const MapRows& rows) {
  return LandmarksSeenAt(rows, std::vector<char>(rows.landmarks.size(), 1));
}

std::vector<int> LandmarksSeenAt(const MapRows& rows, const std::vector<char>& counts) {
  std::vector<std::vector<LandmarkIdx>> seen(rows.stations.size());
  for (const MapImage& image : rows.images) {
    if (image.station < 0) continue;
    for (const LandmarkIdx landmark : image.landmarks) {
      if (counts[landmark] != 0) seen[image.station].push_back(landmark);
    }
  }
  std::vector<int> numbers;
  for (std::vector<LandmarkIdx>& at_station : seen) {
    std::sort(at_station.begin(), at_station.end());
    numbers.push_back(
        static_cast<int>(std::unique(at_station.begin(), at_station.end()) - at_station.begin()));
  }
  return numbers;
}

}  // namespace cairn
