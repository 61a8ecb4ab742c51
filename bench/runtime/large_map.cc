// A map of many rooms, as large as asked, and what a robot pays for it:
//   large_map make MAP NUM_ROOMS                   about 190 kB a room, 8 regions each; signed, with the key
//                                                  MAP.key
//   large_map make MAP NUM_ROOMS NUM_NEW same-tree|new-tree
//                                                  this many rooms surveyed again: other landmarks, and
//                                                  fewer; with the tree of the map without new rooms, or a
//                                                  new one
//   large_map query MAP NUM_QUERIES BUDGET_MIB [IMAGE]
//                                                  opening time, memory, fixes; every query in another room;
//                                                  beside SIFT on an image, which takes memory of its own
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>

#include "bench/runtime/fix_figures.h"
#include "bench/runtime/opencv_sift.h"
#include "core/features/sift.h"
#include "core/images/image_file.h"
#include "core/seal/map_seal.h"
#include "core/vocabulary/grow_vocabulary.h"
#include "runtime/localize/localizer.h"
#include "runtime/map/block_cache.h"
#include "stages/emit_map/map_vocabulary.h"
#include "stages/emit_map/quantize_descriptors.h"
#include "tests/runtime/localize/synthetic_room.h"

namespace cairn {
namespace {

constexpr int kLandmarksPerRoom = 1600;
constexpr int kLandmarksOfNewRoom = 1500;
constexpr int kRoomsPerRow = 64;
constexpr int kNumHeadings = 8;

// World frame, metres.
Eigen::Vector3d RoomOrigin(int room_number) {
  return {12.0 * (room_number % kRoomsPerRow), 10.0 * (room_number / kRoomsPerRow), 0};
}

// The same room for the same number.
SyntheticRoom MakeRoom(int room_number, bool is_new = false) {
  SyntheticRoom room = MakeUnmappedRoom(MixSeed(is_new ? 2 : 1, room_number),
                                        is_new ? kLandmarksOfNewRoom : kLandmarksPerRoom);
  for (Eigen::Vector3d& point : room.points) point += RoomOrigin(room_number);
  return room;
}

Pose RoomPose(int room_number, double x, double y, double heading_deg) {
  return PoseAt(RoomOrigin(room_number) + Eigen::Vector3d(x, y, 1.2), heading_deg);
}

// Six places with eight headings each; a region per heading.
void AddRoom(int room_number, bool is_new, MapRows* rows) {
  const SyntheticRoom room = MakeRoom(room_number, is_new);
  const auto first = static_cast<LandmarkIdx>(rows->landmarks.size());
  for (const Eigen::Vector3d& point : room.points) {
    rows->landmarks.push_back({.class_id = static_cast<ClassId>(rows->landmarks.size()),
                               .position = point,
                               .covariance = 1e-4 * Eigen::Matrix3d::Identity(),
                               .num_observations = 12});
  }
  rows->descriptors.middleRows(first, room.descriptors.rows()) = room.descriptors;
  for (int heading = 0; heading < kNumHeadings; ++heading) {
    std::vector<LandmarkIdx> seen;
    MapRegion& region = rows->regions.emplace_back();
    for (const double x : {-3.0, 0.0, 3.0}) {
      for (const double y : {-1.5, 1.5}) {
        const auto station = static_cast<StationIdx>(rows->stations.size());
        MapImage image{.image_id = static_cast<ImageId>(station + 1),
                       .name = fmt::format("room{:05}/image{:07}.jpg", room_number, station),
                       .camera_id = 1,
                       .cam_from_world = RoomPose(room_number, x, y, 45.0 * heading),
                       .station = station};
        for (size_t i = 0; i < room.points.size(); ++i) {
          const auto pixel = ImageFromCamera(room.camera, image.cam_from_world * room.points[i]);
          if (pixel && pixel->x() > 0 && pixel->y() > 0 && pixel->x() < 640 && pixel->y() < 480) {
            image.landmarks.push_back(first + static_cast<LandmarkIdx>(i));
          }
        }
        seen.insert(seen.end(), image.landmarks.begin(), image.landmarks.end());
        rows->images.push_back(std::move(image));
        rows->stations.push_back({.position = Eigen::Vector2d(x, y) + RoomOrigin(room_number).head<2>(),
                                  .heading_deg = 45.0 * heading});
        region.stations.push_back(station);
      }
    }
    std::sort(seen.begin(), seen.end());
    seen.erase(std::unique(seen.begin(), seen.end()), seen.end());
    region.landmarks = std::move(seen);
  }
}

// The descriptors of all rooms before any was surveyed again.
DescriptorMatrix OldDescriptors(int num_rooms) {
  DescriptorMatrix descriptors(static_cast<Eigen::Index>(num_rooms) * kLandmarksPerRoom, kSiftDescriptorDim);
  for (int room = 0; room < num_rooms; ++room)
    descriptors.middleRows(room * kLandmarksPerRoom, kLandmarksPerRoom) = MakeRoom(room).descriptors;
  emit_map::QuantizeDescriptorValues(4, &descriptors);
  return descriptors;
}

Status Make(const std::string& path, int num_rooms, int num_new, bool same_tree) {
  MapRows rows;
  rows.name = "large";
  rows.writer = "large_map";
  rows.cameras = {MakeRoom(0).camera};
  rows.descriptors.resize(static_cast<Eigen::Index>(num_rooms) * kLandmarksPerRoom, kSiftDescriptorDim);
  // New rooms evenly among the others.
  for (int room = 0; room < num_rooms; ++room) {
    const bool is_new = (int64_t{room} + 1) * num_new / num_rooms > int64_t{room} * num_new / num_rooms;
    AddRoom(room, is_new, &rows);
  }
  rows.descriptors.conservativeResize(static_cast<Eigen::Index>(rows.landmarks.size()), Eigen::NoChange);
  emit_map::QuantizeDescriptorValues(4, &rows.descriptors);
  const DescriptorMatrix all_training = same_tree ? OldDescriptors(num_rooms) : rows.descriptors;
  const Eigen::Index num_training = std::min<Eigen::Index>(all_training.rows(), 200'000);
  NoProgress progress;
  CAIRN_ASSIGN_OR_RETURN(const Vocabulary tree,
                         GrowVocabulary(all_training.topRows(num_training), {}, all_training.rows(),
                                        {.depth = 5, .min_num_descriptors_to_split = 8}, 0, 0, progress));
  const double landmarks_per_word = std::max(40.0, static_cast<double>(rows.descriptors.rows()) / 65536);
  rows.vocabulary = emit_map::CutVocabulary(tree, rows.descriptors, rows.images,
                                            std::vector<char>(rows.images.size(), 1), landmarks_per_word);
  CAIRN_RETURN_IF_ERROR(WriteMapRows(rows, path));
  const KeyPair keys = MakeKeyPair();
  std::filesystem::remove(path + ".key");
  std::filesystem::remove(path + ".key.pub");
  CAIRN_RETURN_IF_ERROR(WriteKeyPair(keys, path + ".key"));
  CAIRN_RETURN_IF_ERROR(SignMap(path, keys.secret_key, path));
  return Ok();
}

double ResidentMib() {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;) {
    double kib = 0;
    if (word == "VmRSS:" && status >> kib) return kib / 1024;
  }
  return 0;
}

double MillisecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

// What an image's features cost, in the same run as the queries: processor milliseconds.
class SiftTimes {
 public:
  explicit SiftTimes(cv::Mat grey) : grey_(std::move(grey)) {}

  Status Measure() {
    std::vector<cv::KeyPoint> keypoints;
    cv::Mat descriptors;
    const double before = CpuSeconds();
    opencv_->detectAndCompute(grey_, {}, keypoints, descriptors);
    const double middle = CpuSeconds();
    CAIRN_ASSIGN_OR_RETURN(const Features features, ExtractSift(grey_, {}));
    ours_ms_.push_back(1000 * (CpuSeconds() - middle));
    opencv_ms_.push_back(1000 * (middle - before));
    num_features_ = features.keypoints.size();
    return Ok();
  }

  void Print(double query_ms) const {
    const double opencv_ms = QuantileOf(opencv_ms_, 0.5), ours_ms = QuantileOf(ours_ms_, 0.5);
    std::printf(
        "SIFT of the image (%zu features): OpenCV %.1f ms, ours %.1f ms; with a query's %.1f ms: %.2f times "
        "OpenCV's SIFT\n",
        num_features_, opencv_ms, ours_ms, query_ms, (ours_ms + query_ms) / opencv_ms);
  }

 private:
  const cv::Mat grey_;
  const cv::Ptr<cv::SIFT> opencv_ = OpenCvSift();
  std::vector<double> opencv_ms_, ours_ms_;
  size_t num_features_ = 0;
};

constexpr int kNumSiftTimes = 50;
// As an image has many features that are none of the map.
constexpr int kNumOutliers = 1700;

Status Ask(const std::string& path, int num_queries, int64_t budget_mib, const std::string& image_path) {
  std::optional<SiftTimes> sift;
  if (!image_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(cv::Mat grey, ReadGreyImage(image_path));
    sift.emplace(std::move(grey));
  }
  CAIRN_ASSIGN_OR_RETURN(const PublicKey key, ReadPublicKey(path + ".key.pub"));
  const double before = ResidentMib();
  const auto start = std::chrono::steady_clock::now();
  const std::clock_t cpu = std::clock();
  CAIRN_ASSIGN_OR_RETURN(const auto map,
                         Map::Open(path, {.memory_budget_bytes = budget_mib << 20, .public_key = key}));
  std::printf(
      "%.0f MB, %lld landmarks, %lld images; opened in %.1f ms (%.1f ms of processor), resident %.1f MiB "
      "before, %.1f after\n",
      static_cast<double>(std::filesystem::file_size(path)) / 1e6,
      static_cast<long long>(map->num_landmarks()), static_cast<long long>(map->num_images()),
      MillisecondsSince(start), 1e3 * static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC, before,
      ResidentMib());
  const int num_rooms = static_cast<int>(map->num_landmarks() / kLandmarksPerRoom);
  Localizer localizer(map);
  Random random(7);
  int num_fixes = 0, num_wrong = 0;
  double sum_ms = 0, num_features = 0;
  std::vector<double> query_ms;
  for (int i = 0; i < num_queries; ++i) {
    const int number = static_cast<int>(random.UniformInt(0, num_rooms - 1));
    const Pose truth = RoomPose(number, random.Uniform(-3, 3), random.Uniform(-2, 2), random.Uniform(0, 360));
    const SyntheticRoom room = MakeRoom(number);
    Features features = RenderFeatures(room, truth, {.num_outliers = kNumOutliers}, i);
    num_features += static_cast<double>(features.keypoints.size());

    const auto begin = std::chrono::steady_clock::now();
    const double cpu_begin = CpuSeconds();
    CAIRN_ASSIGN_OR_RETURN(const Localization found,
                           localizer.LocalizeFeatures(std::move(features), room.camera));
    sum_ms += MillisecondsSince(begin);
    query_ms.push_back(1000 * (CpuSeconds() - cpu_begin));
    num_fixes += found.has_fix() ? 1 : 0;
    num_wrong += found.has_fix() && CenterErrorM(found.cam_from_world, truth) > 0.5 ? 1 : 0;
    if (i == 0) std::printf("first fix %.1f ms after the start of opening\n", MillisecondsSince(start));
    if (sift && i % std::max(1, num_queries / kNumSiftTimes) == 0) CAIRN_RETURN_IF_ERROR(sift->Measure());
    if ((i + 1) % std::max(1, num_queries / 10) == 0) {
      std::printf(
          "%6d queries: %d fixes, %d wrong, %.1f ms each, resident %.1f MiB, %lld loads, %.1f MiB kept\n",
          i + 1, num_fixes, num_wrong, sum_ms / (i + 1), ResidentMib(),
          static_cast<long long>(map->cache().num_loads()),
          static_cast<double>(map->cache().num_bytes()) / (1 << 20));
      std::fflush(stdout);
    }
  }
  std::printf("processor ms of a query with %.0f features: median %.1f, 90 %% %.1f\n",
              num_features / num_queries, QuantileOf(query_ms, 0.5), QuantileOf(query_ms, 0.9));
  if (sift) sift->Print(QuantileOf(query_ms, 0.5));
  return Ok();
}

}  // namespace
}  // namespace cairn

int main(int argc, char** argv) {
  const std::string verb = argc > 1 ? argv[1] : "";
  cairn::Status status = cairn::MakeError(cairn::ErrorCode::kInvalidArgument,
                                          "usage: large_map make MAP NUM_ROOMS [NUM_NEW same-tree|new-tree] "
                                          "| large_map query MAP NUM BUDGET_MIB [IMAGE]");
  if (verb == "make" && argc == 4) status = cairn::Make(argv[2], std::atoi(argv[3]), 0, false);
  if (verb == "make" && argc == 6)
    status =
        cairn::Make(argv[2], std::atoi(argv[3]), std::atoi(argv[4]), std::string(argv[5]) == "same-tree");
  if (verb == "query" && (argc == 5 || argc == 6))
    status = cairn::Ask(argv[2], std::atoi(argv[3]), std::atoi(argv[4]), argc == 6 ? argv[5] : "");
  if (!status.ok()) std::fprintf(stderr, "%s\n", status.error().message.c_str());
  return status.ok() ? 0 : 1;
}
