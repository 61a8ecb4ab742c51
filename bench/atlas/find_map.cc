// Is the right map of an atlas found, and how long does that take?
//   find_map ATLAS NAME=CAPTURE... [none=FOLDER...]
// Shows the atlas the queries of captures (queries.txt) of its maps, or all images of a folder that is of
// none of them, on one thread with default options.  A line for each, then all together: how many images have
// their map first, or among the first three, by the index alone; are localized in it, there and by its map
// alone; are localized in another map, and how many of those with P >= 0.9 and 0.99; and medians of the times
// of features, of the index and of all that follows.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <opencv2/core/utility.hpp>

#include "core/base/quantiles.h"
#include "core/capture/capture.h"
#include "core/colmap/image_list.h"
#include "core/features/sift.h"
#include "core/images/image_file.h"
#include "runtime/atlas/atlas_localizer.h"
#include "runtime/atlas/code_index.h"
#include "runtime/localize/localizer.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

struct Figures {
  int num_images = 0, num_first = 0, num_among_three = 0, num_localized = 0, num_alone = 0;
  int num_wrong = 0, num_wrong_90 = 0, num_wrong_99 = 0, num_shared = 0;
  std::vector<double> features_ms, index_ms, answer_ms;

  void Add(const Figures& other) {
    num_images += other.num_images;
    num_first += other.num_first;
    num_among_three += other.num_among_three;
    num_localized += other.num_localized;
    num_alone += other.num_alone;
    num_wrong += other.num_wrong;
    num_wrong_90 += other.num_wrong_90;
    num_wrong_99 += other.num_wrong_99;
    num_shared += other.num_shared;
    features_ms.insert(features_ms.end(), other.features_ms.begin(), other.features_ms.end());
    index_ms.insert(index_ms.end(), other.index_ms.begin(), other.index_ms.end());
    answer_ms.insert(answer_ms.end(), other.answer_ms.begin(), other.answer_ms.end());
  }
  void Print(const std::string& name) const {
    if (num_images == 0) return;
    std::printf("%-20s %6d %6d %6d %9d %6d %6d %6d %6d %6d %9.1f %6.2f %6.1f\n", name.c_str(), num_images,
                num_first, num_among_three, num_localized, num_alone, num_wrong, num_wrong_90, num_wrong_99,
                num_shared, Median(features_ms), Median(index_ms), Median(answer_ms));
  }
};

double MsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

// The images of a capture's queries, or of a folder.
Result<std::vector<std::string>> ImagesOf(const fs::path& folder, bool is_capture) {
  std::vector<std::string> images;
  if (is_capture) {
    std::vector<Reject> rejects;
    CAIRN_ASSIGN_OR_RETURN(const auto queries, ReadImagesText((folder / "queries.txt").string(), &rejects));
    for (const CaptureImage& image : queries) images.push_back((folder / "images" / image.name).string());
  } else {
    for (const auto& entry : fs::directory_iterator(folder)) images.push_back(entry.path().string());
    std::sort(images.begin(), images.end());
  }
  return images;
}

// `map`: the right one, or -1.
Status Show(const std::shared_ptr<const Atlas>& atlas, int map, const std::string& path, Figures* figures) {
  CAIRN_ASSIGN_OR_RETURN(const cv::Mat grey, ReadGreyImage(path));
  auto start = std::chrono::steady_clock::now();
  CAIRN_ASSIGN_OR_RETURN(const Features features, ExtractSift(grey, {}));
  figures->features_ms.push_back(MsSince(start));
  start = std::chrono::steady_clock::now();
  const std::vector<MapScore> ranked = atlas->Rank(features);
  figures->index_ms.push_back(MsSince(start));
  ++figures->num_images;
  for (size_t i = 0; i < ranked.size() && i < 3; ++i) {
    if (ranked[i].map != map) continue;
    figures->num_first += i == 0 ? 1 : 0;
    ++figures->num_among_three;
  }
  // An image of no map has a camera of its own; one with the same field of view is as good as any.
  std::optional<Camera> camera;
  if (map < 0) camera = GuessCamera(1, grey.cols, grey.rows);
  start = std::chrono::steady_clock::now();
  CAIRN_ASSIGN_OR_RETURN(const AtlasAnswer answer,
                         AtlasLocalizer(atlas).LocalizeFeatures(features, grey.cols, grey.rows, camera));
  figures->answer_ms.push_back(MsSince(start));
  for (const AtlasHypothesis& hypothesis : answer.hypotheses) {
    if (!hypothesis.found.has_fix()) continue;
    if (hypothesis.map == map) {
      ++figures->num_localized;
    } else if (&hypothesis == answer.hypotheses.data()) {
      ++figures->num_wrong;
      figures->num_wrong_90 += hypothesis.probability >= 0.9 ? 1 : 0;
      figures->num_wrong_99 += hypothesis.probability >= 0.99 ? 1 : 0;
    }
  }
  figures->num_shared += answer.hypotheses.size() > 1 ? 1 : 0;
  if (map < 0) return Ok();
  CAIRN_ASSIGN_OR_RETURN(const auto own, atlas->OpenMap(map));
  CAIRN_ASSIGN_OR_RETURN(const Camera own_camera, own->CameraForSize(grey.cols, grey.rows));
  CAIRN_ASSIGN_OR_RETURN(const Localization alone, Localizer(own).LocalizeFeatures(features, own_camera));
  figures->num_alone += alone.has_fix() ? 1 : 0;
  return Ok();
}

Status Run(int argc, char** argv) {
  if (argc < 3)
    return MakeError(ErrorCode::kInvalidArgument, "usage: find_map ATLAS NAME=CAPTURE... [none=FOLDER...]");
  cv::setNumThreads(1);
  CAIRN_ASSIGN_OR_RETURN(const auto atlas, Atlas::Open(argv[1]));
  std::printf("%-20s %6s %6s %6s %9s %6s %6s %6s %6s %6s %9s %6s %6s\n", "map", "images", "first", "in 3",
              "localized", "alone", "wrong", ">=0.9", ">=0.99", "shared", "SIFT, ms", "index", "answer");
  Figures known, unknown;
  for (int i = 2; i < argc; ++i) {
    const std::string argument = argv[i];
    const size_t equals = argument.find('=');
    if (equals == std::string::npos)
      return MakeError(ErrorCode::kInvalidArgument, "{}: expected NAME=FOLDER", argument);
    const std::string name = argument.substr(0, equals);
    int map = -1;
    if (name != "none") {
      CAIRN_ASSIGN_OR_RETURN(map, atlas->FindMap(name));
    }
    Figures figures;
    CAIRN_ASSIGN_OR_RETURN(const auto images, ImagesOf(argument.substr(equals + 1), map >= 0));
    for (const std::string& image : images) CAIRN_RETURN_IF_ERROR(Show(atlas, map, image, &figures));
    figures.Print(name);
    (map >= 0 ? known : unknown).Add(figures);
  }
  known.Print("all maps");
  unknown.Print("no map");
  return Ok();
}

}  // namespace
}  // namespace cairn

int main(int argc, char** argv) {
  const cairn::Status status = cairn::Run(argc, argv);
  if (!status.ok()) std::fprintf(stderr, "%s\n", status.error().message.c_str());
  return status.ok() ? 0 : 1;
}
