#include "stages/reconstruct/globally/map_globally.h"

#include <algorithm>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include <spdlog/spdlog.h>

#include "core/base/text.h"
#include "stages/reconstruct/globally/average_rotations.h"
#include "stages/reconstruct/globally/backbone.h"
#include "stages/reconstruct/globally/part_mapper.h"
#include "stages/reconstruct/globally/view_pairs.h"

namespace cairn::reconstruct {
namespace {

constexpr int kMinNumImages = 3;
constexpr int kMaxNumCuts = 10;
constexpr double kMaxTreeErrorDeg = 20;

// Images that pairs join, with indices of their own.
struct Part {
  std::vector<int> images;      // indices into the input's, in the order of their names
  std::vector<ViewPair> pairs;  // of indices into `images`
};

Part InOrderOfNames(const MapperInput& input, std::vector<ViewPair> pairs) {
  Part part;
  std::vector<std::string> names;
  for (const DatabaseImage& image : input.images) names.push_back(image.name);
  part.images = NaturalOrder(names);
  std::vector<int> place(part.images.size());
  for (size_t i = 0; i < part.images.size(); ++i) place[part.images[i]] = static_cast<int>(i);
  part.pairs = std::move(pairs);
  for (ViewPair& pair : part.pairs) {
    pair.image1 = place[pair.image1];
    pair.image2 = place[pair.image2];
  }
  return part;
}

std::vector<Part> PartsOf(const Part& whole) {
  std::vector<Part> parts;
  const int num_images = static_cast<int>(whole.images.size());
  std::vector<int> part_of(num_images, -1), place(num_images, -1);
  for (const std::vector<int>& members : ConnectedParts(num_images, whole.pairs)) {
    if (static_cast<int>(members.size()) < kMinNumImages) continue;
    Part& part = parts.emplace_back();
    for (const int i : members) {
      part_of[i] = static_cast<int>(parts.size()) - 1;
      place[i] = static_cast<int>(part.images.size());
      part.images.push_back(whole.images[i]);
    }
  }
  for (const ViewPair& pair : whole.pairs) {
    if (part_of[pair.image1] < 0) continue;
    std::vector<ViewPair>& pairs = parts[part_of[pair.image1]].pairs;
    pairs.push_back(pair);
    pairs.back().image1 = place[pair.image1];
    pairs.back().image2 = place[pair.image2];
  }
  return parts;
}

// The backbone of a part and its rotations, without the pairs that contradict them.
struct Untangled {
  std::vector<int> backbone;
  std::vector<Eigen::Quaterniond> rotations;
};

// Nothing where the part falls apart without the pairs that contradict its rotations, which are taken out of
// it.
std::optional<Untangled> Untangle(bool is_drive, Part* part) {
  const int num_images = static_cast<int>(part->images.size());
  const AverageRotationsOptions options;
  Untangled untangled;
  for (int cut = 0; cut < kMaxNumCuts; ++cut) {
    untangled.backbone = Backbone(num_images, part->pairs, is_drive);
    std::vector<ViewPair> pairs;
    for (const int p : untangled.backbone) pairs.push_back(part->pairs[p]);
    const auto contradicting = [&](const std::vector<Eigen::Quaterniond>& rotations, double max_error_deg) {
      std::vector<bool> is_wrong(part->pairs.size(), false);
      for (const int p : untangled.backbone)
        is_wrong[p] = RotationErrorDeg(part->pairs[p], rotations) > max_error_deg;
      return is_wrong;
    };
    const auto choose = [&](const std::vector<Eigen::Quaterniond>& rotations) {
      for (size_t k = 0; k < pairs.size(); ++k) {
        ChooseRotation(rotations[pairs[k].image2] * rotations[pairs[k].image1].conjugate(), &pairs[k]);
        part->pairs[untangled.backbone[k]] = pairs[k];
      }
    };
    // First those that contradict stronger ones.
    const std::vector<Eigen::Quaterniond> along_tree = RotationsAlongTree(num_images, pairs);
    choose(along_tree);
    std::vector<bool> is_wrong = contradicting(along_tree, kMaxTreeErrorDeg);
    if (std::find(is_wrong.begin(), is_wrong.end(), true) == is_wrong.end()) {
      untangled.rotations = AverageRotations(num_images, pairs, options);
      choose(untangled.rotations);
      is_wrong = contradicting(untangled.rotations, options.max_error_deg);
    }
    const bool any = std::find(is_wrong.begin(), is_wrong.end(), true) != is_wrong.end();
    spdlog::debug("reconstruct: {} images, a backbone of {} of {} pairs, {} of them contradict it{}",
                  num_images, untangled.backbone.size(), part->pairs.size(),
                  std::count(is_wrong.begin(), is_wrong.end(), true), is_drive ? "; in order" : "");
    if (!any) return untangled;
    size_t p = 0;
    std::erase_if(part->pairs, [&](const ViewPair&) { return is_wrong[p++]; });
    const std::vector<std::vector<int>> parts = ConnectedParts(num_images, part->pairs);
    if (parts.empty() || parts[0].size() < part->images.size()) return std::nullopt;
  }
  return untangled;
}

}  // namespace

Result<GlobalMap> MapGlobally(const MapperInput& input, const MapGloballyOptions& options, int num_threads,
                              Progress& progress) {
  const int num_images = static_cast<int>(input.images.size());
  progress.Begin("reconstruct", int64_t{num_images} * PartMapper::NumRounds(), "images in rounds");
  const std::map<CameraId, Camera> cameras = CalibrateFromPairs(input);
  Part whole = InOrderOfNames(input, EstimateViewPairs(input, cameras, {}, num_threads));
  std::vector<Part> found = PartsOf(whole);
  std::deque<Part> open(found.begin(), found.end());
  std::vector<std::pair<ColmapModel, bool>> models;  // and whether it is a drive
  while (!open.empty()) {
    Part part = std::move(open.front());
    open.pop_front();
    const bool is_drive = IsDrive(static_cast<int>(part.images.size()), part.pairs);
    SetWeights(is_drive, &part.pairs);
    const auto untangled = Untangle(is_drive, &part);
    if (!untangled) {
      std::vector<Part> smaller = PartsOf(part);
      open.insert(open.end(), smaller.begin(), smaller.end());
      continue;
    }
    ColmapModel model = PartMapper(input, cameras, options, num_threads, std::move(part.images),
                                   std::move(part.pairs), untangled->backbone, is_drive)
                            .Map(untangled->rotations, progress);
    if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "stopped while reconstructing");
    if (!model.images.empty()) models.emplace_back(std::move(model), is_drive);
  }
  progress.End();
  if (models.empty()) {
    return MakeError(
        ErrorCode::kNoData,
        "no {} of {} images could be joined: of {} verified pairs {} have a relative pose; neighbouring "
        "images must show the same things from places some steps apart",
        kMinNumImages, num_images, input.geometries.size(), whole.pairs.size());
  }
  std::stable_sort(models.begin(), models.end(), [](const auto& a, const auto& b) {
    return std::pair(a.first.images.size(), a.first.points.size()) >
           std::pair(b.first.images.size(), b.first.points.size());
  });
  GlobalMap map{.models = {}, .is_drive = models.front().second};
  for (auto& [model, is_drive] : models) map.models.push_back(std::move(model));
  return map;
}

}  // namespace cairn::reconstruct
