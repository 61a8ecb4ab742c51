#include "stages/reconstruct/globally/map_globally.h"

#include <algorithm>
#include <deque>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "core/base/text.h"
#include "stages/reconstruct/globally/part_mapper.h"
#include "stages/reconstruct/view_graph/average_rotations.h"
#include "stages/reconstruct/view_graph/backbone.h"
#include "stages/reconstruct/view_graph/calibrate_from_pairs.h"
#include "stages/reconstruct/view_graph/triangles.h"
#include "stages/reconstruct/view_graph/view_pairs.h"

namespace cairn::reconstruct {
namespace {

constexpr int kMinNumImages = 3;
constexpr double kMaxTreeErrorDeg = 20;
// A focal length that is off by this much bends what turns: by some per cent of the scale in every sharp
// turn.
constexpr double kMaxFocalChangeRatio = 0.01;
constexpr int kMaxNumBegun = 3;

// What rotations are averaged from.
ViewPair WithoutMatches(const ViewPair& pair) {
  return {.image1 = pair.image1,
          .image2 = pair.image2,
          .cam2_from_cam1 = pair.cam2_from_cam1,
          .alternatives = pair.alternatives,
          .matches = {},
          .strength = pair.strength,
          .closed = pair.closed,
          .weight = pair.weight};
}

// Images that pairs and motions join, with indices of their own.
struct Part {
  std::vector<int> images;           // indices into the input's, in the order of their names
  std::vector<ViewPair> pairs;       // of indices into `images`
  std::vector<ImageMotion> motions;  // likewise

  // What joins the images.
  std::vector<ViewPair> Links() const {
    std::vector<ViewPair> links = PairsOf(motions);
    for (const ViewPair& pair : pairs) links.push_back(WithoutMatches(pair));
    return links;
  }
};

Part InOrderOfNames(const MapperInput& input, std::vector<ViewPair> pairs, std::vector<ImageMotion> motions) {
  Part part;
  std::vector<std::string> names;
  for (const DatabaseImage& image : input.images) names.push_back(image.name);
  part.images = NaturalOrder(names);
  std::vector<int> place(part.images.size());
  for (size_t i = 0; i < part.images.size(); ++i) place[part.images[i]] = static_cast<int>(i);
  const auto renumber = [&](auto* links) {
    for (auto& link : *links) {
      link.image1 = place[link.image1];
      link.image2 = place[link.image2];
    }
  };
  part.pairs = std::move(pairs);
  part.motions = std::move(motions);
  renumber(&part.pairs);
  renumber(&part.motions);
  return part;
}

std::vector<Part> PartsOf(Part whole) {
  std::vector<Part> parts;
  const int num_images = static_cast<int>(whole.images.size());
  std::vector<int> part_of(num_images, -1), place(num_images, -1);
  for (const std::vector<int>& members : ConnectedParts(num_images, whole.Links())) {
    if (static_cast<int>(members.size()) < kMinNumImages) continue;
    Part& part = parts.emplace_back();
    for (const int i : members) {
      part_of[i] = static_cast<int>(parts.size()) - 1;
      place[i] = static_cast<int>(part.images.size());
      part.images.push_back(whole.images[i]);
    }
  }
  const auto share_out = [&](auto* links, auto links_of) {
    for (auto& link : *links) {
      const int p = part_of[link.image1];
      if (p < 0) continue;
      link.image1 = place[link.image1];
      link.image2 = place[link.image2];
      links_of(parts[p]).push_back(std::move(link));
    }
  };
  share_out(
      &whole.pairs, [](Part & part) -> auto& { return part.pairs; });
  share_out(
      &whole.motions, [](Part & part) -> auto& { return part.motions; });
  return parts;
}

// Leaves out the pairs between images of different lists, if there are such; returns whether.
bool CutApart(const std::vector<std::vector<int>>& lists, Part* part) {
  if (!lists.empty() && lists[0].size() == part->images.size()) return false;
  std::vector<int> list_of(part->images.size(), -1);
  for (size_t k = 0; k < lists.size(); ++k) {
    for (const int i : lists[k]) list_of[i] = static_cast<int>(k);
  }
  std::erase_if(part->pairs, [&](const ViewPair& pair) {
    return list_of[pair.image1] < 0 || list_of[pair.image1] != list_of[pair.image2];
  });
  return true;
}

// The backbone of a part and its rotations, without the pairs that contradict them.
struct Untangled {
  std::vector<int> backbone;
  std::vector<Eigen::Quaterniond> rotations;
};

// Nothing where no backbone joins the part, or where it falls apart without the pairs that contradict its
// rotations: these pairs are taken out of it.
std::optional<Untangled> Untangle(bool is_drive, Part* part) {
  const int num_images = static_cast<int>(part->images.size());
  const AverageRotationsOptions options;
  while (true) {
    Untangled untangled{.backbone = Backbone(num_images, part->pairs, part->motions, is_drive),
                        .rotations = {}};
    std::vector<ViewPair> pairs;
    for (const int p : untangled.backbone) pairs.push_back(WithoutMatches(part->pairs[p]));
    const size_t num_seen = pairs.size();
    for (ViewPair& motion : PairsOf(part->motions)) pairs.push_back(std::move(motion));
    if (CutApart(ConnectedParts(num_images, pairs), part)) return std::nullopt;
    // Chooses the rotations nearest to these, and says which contradict them all the same.
    const auto contradicting = [&](const std::vector<Eigen::Quaterniond>& rotations, double max_error_deg) {
      std::vector<bool> is_wrong(part->pairs.size(), false);
      for (size_t k = 0; k < num_seen; ++k) {
        const Eigen::Quaterniond between =
            rotations[pairs[k].image2] * rotations[pairs[k].image1].conjugate();
        ChooseRotation(between, &pairs[k]);
        ChooseRotation(between, &part->pairs[untangled.backbone[k]]);
        is_wrong[untangled.backbone[k]] = RotationErrorDeg(pairs[k], rotations) > max_error_deg;
      }
      return is_wrong;
    };
    const auto count = [](const std::vector<bool>& is_wrong) {
      return std::count(is_wrong.begin(), is_wrong.end(), true);
    };
    // First those that contradict stronger ones.
    std::vector<bool> is_wrong = contradicting(RotationsAlongTree(num_images, pairs), kMaxTreeErrorDeg);
    if (count(is_wrong) == 0) {
      untangled.rotations = AverageRotations(num_images, pairs, options);
      is_wrong = contradicting(untangled.rotations, options.max_error_deg);
    }
    spdlog::debug("reconstruct: {} images, a backbone of {} of {} pairs, {} of them contradict it{}",
                  num_images, untangled.backbone.size(), part->pairs.size(), count(is_wrong),
                  is_drive ? "; in order" : "");
    if (count(is_wrong) == 0) return untangled;
    size_t p = 0;
    std::erase_if(part->pairs, [&](const ViewPair&) { return is_wrong[p++]; });
    const std::vector<std::vector<int>> parts = ConnectedParts(num_images, part->Links());
    if (parts.empty() || parts[0].size() < part->images.size()) return std::nullopt;
  }
}

Error Stopped() { return MakeError(ErrorCode::kCancelled, "stopped while reconstructing"); }

// The map by these cameras; nothing where they turn out to be others by more than this ratio of their focal
// lengths, to which they are set.
Result<std::optional<GlobalMap>> MapBy(const MapperInput& input, std::vector<ImageMotion> motions,
                                       const MapGloballyOptions& options, double max_focal_change_ratio,
                                       int num_threads, std::map<CameraId, Camera>* cameras,
                                       Progress& progress) {
  const int num_images = static_cast<int>(input.images.size());
  std::vector<ViewPair> pairs = EstimateViewPairs(input, *cameras, {}, num_threads, progress);
  if (progress.Cancelled()) return Stopped();
  const size_t num_pairs = pairs.size();
  GlobalMap map;
  map.why_no_odometry = LeaveOutContradicted(pairs, &motions);
  Part whole = InOrderOfNames(input, std::move(pairs), std::move(motions));
  std::deque<Part> open;
  const auto add_parts = [&](Part part) {
    for (Part& smaller : PartsOf(std::move(part))) open.push_back(std::move(smaller));
  };
  add_parts(std::move(whole));
  std::vector<std::pair<ColmapModel, bool>> models;  // and whether it is a drive
  while (!open.empty()) {
    Part part = std::move(open.front());
    open.pop_front();
    const bool is_drive = IsDrive(static_cast<int>(part.images.size()), part.pairs, part.motions);
    if (!is_drive) {  // the order of a drive tells more
      const std::vector<double> closed =
          CloseTriangles(static_cast<int>(part.images.size()), part.pairs, {}, num_threads);
      for (size_t p = 0; p < part.pairs.size(); ++p) part.pairs[p].closed = closed[p];
    }
    SetWeights(is_drive, &part.pairs);
    const auto untangled = Untangle(is_drive, &part);
    if (!untangled) {
      add_parts(std::move(part));
      continue;
    }
    const size_t num_in_part = part.images.size();
    PartMapper mapper(input, *cameras, options, num_threads, std::move(part.images), std::move(part.pairs),
                      std::move(part.motions), untangled->backbone, is_drive);
    progress.Begin(fmt::format("{} of {} images joined, finding their places", num_in_part, num_images),
                   PartMapper::NumSteps(), "steps");
    std::optional<ColmapModel> model = mapper.Map(untangled->rotations, max_focal_change_ratio, progress);
    if (progress.Cancelled()) return Stopped();
    progress.End();
    if (!model) {
      for (const auto& [camera_id, camera] : mapper.Cameras()) cameras->insert_or_assign(camera_id, camera);
      return std::optional<GlobalMap>();
    }
    if (!model->images.empty()) models.emplace_back(std::move(*model), is_drive);
  }
  if (models.empty()) {
    return MakeError(
        ErrorCode::kNoData,
        "no {} of {} images could be joined: of {} verified pairs {} have a relative pose; neighbouring "
        "images must show the same things from places some steps apart",
        kMinNumImages, num_images, input.geometries.size(), num_pairs);
  }
  std::stable_sort(models.begin(), models.end(), [](const auto& a, const auto& b) {
    return std::pair(a.first.images.size(), a.first.points.size()) >
           std::pair(b.first.images.size(), b.first.points.size());
  });
  map.is_drive = models.front().second;
  for (auto& [model, is_drive] : models) map.models.push_back(std::move(model));
  return std::optional(std::move(map));
}

}  // namespace

Result<GlobalMap> MapGlobally(const MapperInput& input, const std::vector<ImageMotion>& motions,
                              const MapGloballyOptions& options, int num_threads, Progress& progress) {
  std::map<CameraId, Camera> cameras = CalibrateFromPairs(input);
  for (int num_begun = 1;; ++num_begun) {
    for (const auto& [camera_id, camera] : cameras)
      spdlog::debug("reconstruct: camera {}: {:.1f} px", camera_id, camera.MeanFocal());
    auto map =
        MapBy(input, motions, options,
              num_begun < kMaxNumBegun ? kMaxFocalChangeRatio : std::numeric_limits<double>::infinity(),
              num_threads, &cameras, progress);
    if (!map.ok()) return map.error();
    if (*map) return std::move(**map);
  }
}

}  // namespace cairn::reconstruct
