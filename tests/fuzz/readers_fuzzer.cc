// libFuzzer's entry for what others wrote besides maps (map_fuzzer.cc): keys, deltas, atlases, captures,
// COLMAP's files, plans, logs, recipes.  The first line of an input names the reader, the rest is the file;
// where a reader takes several files, lines of "====" divide them.  Whatever a file is, its reader ends with
// a value or with an error that says something.
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include <nlohmann/json.hpp>

#include "core/atlas/atlas_file.h"
#include "core/camera/camera.h"
#include "core/capture/capture.h"
#include "core/capture/capture_frame.h"
#include "core/capture/exif.h"
#include "core/capture/sessions.h"
#include "core/colmap/cameras_text.h"
#include "core/colmap/colmap_database.h"
#include "core/colmap/colmap_model.h"
#include "core/colmap/rig_config.h"
#include "core/delta/map_delta.h"
#include "core/feature_files/feature_files.h"
#include "core/files/database.h"
#include "core/learned/onnx_outline.h"
#include "core/line/json_report.h"
#include "core/options/toml_options.h"
#include "core/plan/views.h"
#include "core/seal/key_ring.h"
#include "core/seal/map_seal.h"
#include "core/seal/signature_list.h"
#include "core/vocabulary/vocabulary_tree.h"
#include "core/world/appearance.h"
#include "core/world/decomposition.h"
#include "core/world/feature_class.h"
#include "core/world/world.h"
#include "pipeline/exchange/bags/files/bag.h"
#include "runtime/scans/read_scans.h"
#include "stages/decompose_views/formats/occupancy_grid.h"
#include "stages/decompose_views/plan/read_plan.h"
#include "stages/reconstruct/inertial/imu_file.h"
#include "stages/reconstruct/known_places.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

// An error that says nothing helps nobody.
template <typename T>
bool Answered(const T& result) {
  if (result.ok()) return true;
  if (result.error().message.empty()) std::abort();
  return false;
}

// A folder of this process's own, which goes when it ends.
class OwnFolder {
 public:
  OwnFolder()
      : path_(std::string(access("/dev/shm", W_OK) == 0 ? "/dev/shm" : "/tmp") + "/cairn_readers_" +
              std::to_string(getpid())) {
    fs::create_directories(path_);
  }
  ~OwnFolder() {
    std::error_code error;
    fs::remove_all(path_, error);
  }
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

const std::string& Folder() {
  static const OwnFolder folder;
  return folder.path();
}

std::string Write(const std::string& name, std::string_view bytes) {
  const std::string path = Folder() + "/" + name;
  std::FILE* const file = std::fopen(path.c_str(), "wb");
  if (file == nullptr) std::abort();
  std::fwrite(bytes.data(), 1, bytes.size(), file);
  std::fclose(file);
  return path;
}

// A capture of these images, for readers that ask for names.
const Capture& TwoImages() {
  static const Capture capture = [] {
    Capture two;
    for (const char* const name : {"a.jpg", "b.jpg"}) {
      CaptureImage image;
      image.name = name;
      two.images.push_back(image);
    }
    return two;
  }();
  return capture;
}

struct EveryMessage : pipeline::BagVisitor {
  bool Wants(const pipeline::BagTopic&, int64_t) override { return ++num_messages % 2 == 0; }
  Status Take(const pipeline::BagMessage&) override { return Ok(); }
  int num_messages = 0;
};

void TryDatabase(const std::string& path) {
  (void)Answered(WithDatabaseErrors(path, [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenColmapDatabase(path));
    (void)Answered(ReadDatabaseCameras(database));
    (void)Answered(ReadDatabaseTwoViewGeometries(database, 0));
    CAIRN_ASSIGN_OR_RETURN(const std::vector<DatabaseImage> images, ReadDatabaseImages(database));
    for (size_t i = 0; i < std::min<size_t>(images.size(), 4); ++i) {
      (void)Answered(ReadDatabaseKeypoints(database, images[i].image_id));
      (void)Answered(ReadDatabaseDescriptors(database, images[i].image_id));
    }
    return Ok();
  }));
}

// Three files of COLMAP's model in one folder.
void TryModel(const std::vector<std::string_view>& files, const char* ending) {
  const char* const names[] = {"cameras", "images", "points3D"};
  for (size_t i = 0; i < 3; ++i)
    Write(std::string(names[i]) + ending, i < files.size() ? files[i] : std::string_view());
  (void)Answered(ReadColmapModel(Folder()));
  for (const char* const name : names) fs::remove(Folder() + "/" + name + ending);
}

void TryBag(const std::string& path) {
  const auto bag = pipeline::OpenBag(path);
  if (!Answered(bag)) return;
  EveryMessage visitor;
  (void)Answered((*bag)->Read(visitor));
}

void TryPlan(const std::string& path) {
  decompose_views::ReadPlanOptions options;
  for (const char* const units : {"", "m", "mm"}) {
    options.units = units;
    (void)Answered(decompose_views::ReadPlan(path, options));
  }
}

using Files = std::vector<std::string_view>;

// By the name of a reader: what it does with a file's path, and with all files.
const std::map<std::string, std::function<void(const std::string& path, const Files& files)>>& Readers() {
  static const std::map<std::string, std::function<void(const std::string&, const Files&)>> readers = {
      {"public_key", [](const std::string& path, const Files&) { (void)Answered(ReadPublicKey(path)); }},
      {"secret_key", [](const std::string& path, const Files&) { (void)Answered(ReadSecretKey(path)); }},
      {"key_ring",
       [](const std::string& path, const Files& files) {
         const auto ring = DecodeKeyRing(files[0], path);
         // What is read can be written, and is read as the same.
         if (Answered(ring) && !DecodeKeyRing(*EncodeKeyRing(*ring), path).ok()) std::abort();
         (void)Answered(ReadTrustedKeys(path));
       }},
      {"signatures", [](const std::string& path, const Files&) { (void)Answered(ReadSignatures(path)); }},
      {"seal", [](const std::string& path, const Files&) { (void)Answered(ReadSeal(path)); }},
      {"delta", [](const std::string& path, const Files&) { (void)Answered(ReadMapDelta(path, {})); }},
      {"atlas", [](const std::string& path, const Files&) { (void)Answered(ReadAtlas(path, {})); }},
      {"images_text",
       [](const std::string& path, const Files&) {
         std::vector<Reject> rejects;
         (void)Answered(ReadImagesText(path, &rejects));
       }},
      {"cameras_text", [](const std::string& path, const Files&) { (void)Answered(ReadCamerasText(path)); }},
      {"capture_frame",
       [](const std::string& path, const Files&) { (void)Answered(ReadCaptureFrame(path)); }},
      {"sessions", [](const std::string& path, const Files&) { (void)Answered(ReadSessionsText(path)); }},
      {"rig", [](const std::string& path, const Files&) { (void)Answered(ReadRigConfig(path)); }},
      {"colmap_text", [](const std::string&, const Files& files) { TryModel(files, ".txt"); }},
      {"colmap_binary", [](const std::string&, const Files& files) { TryModel(files, ".bin"); }},
      {"colmap_database", [](const std::string& path, const Files&) { TryDatabase(path); }},
      {"npz",
       [](const std::string&, const Files& files) {
         fs::create_directories(Folder() + "/npz");
         Write("npz/a.jpg.npz", files[0]);
         const auto reader = OpenNpzFeatures(Folder() + "/npz");
         if (!Answered(reader)) return;
         const auto kind = (*reader)->Kind({});
         if (Answered(kind)) (void)Answered((*reader)->Read("a.jpg", *kind));
       }},
      {"toml", [](const std::string& path, const Files&) { (void)Answered(ReadTomlFile(path)); }},
      {"report",
       [](const std::string& path, const Files&) { (void)Answered(ReadJsonReport(path, "a report")); }},
      {"vocabulary", [](const std::string& path, const Files&) { (void)Answered(ReadVocabulary(path)); }},
      {"world", [](const std::string& path, const Files&) { (void)Answered(ReadWorld(path)); }},
      {"regions", [](const std::string& path, const Files&) { (void)Answered(ReadDecomposition(path)); }},
      {"appearance", [](const std::string& path, const Files&) { (void)Answered(ReadAppearance(path)); }},
      {"classes", [](const std::string& path, const Files&) { (void)Answered(ReadClasses(path)); }},
      {"views", [](const std::string& path, const Files&) { (void)Answered(ReadViews(path)); }},
      {"scans",
       [](const std::string& path, const Files&) {
         (void)Answered(ReadScans(path, {}));
         (void)Answered(ReadRangeScans(path));
       }},
      {"plan", [](const std::string& path, const Files&) { TryPlan(path); }},
      {"grid",
       [](const std::string&, const Files& files) {
         const std::string path = Write("map.yaml", files[0]);
         for (const char* const name : {"map.pgm", "map.png"})
           Write(name, files.size() > 1 ? files[1] : std::string_view());
         (void)Answered(decompose_views::ReadOccupancyGrid(path));
         TryPlan(path);
       }},
      {"imu", [](const std::string& path, const Files&) { (void)Answered(reconstruct::ReadImu(path)); }},
      {"odometry",
       [](const std::string& path, const Files&) {
         (void)Answered(reconstruct::ReadOdometry(path, TwoImages()));
         (void)Answered(reconstruct::ReadKnownDistances(path, TwoImages()));
         (void)Answered(reconstruct::ReadControlPoints(path, TwoImages()));
       }},
      {"bag_sqlite", [](const std::string&, const Files& files) { TryBag(Write("it.db3", files[0])); }},
      {"bag_mcap", [](const std::string&, const Files& files) { TryBag(Write("it.mcap", files[0])); }},
      {"bag_ros1", [](const std::string&, const Files& files) { TryBag(Write("it.bag", files[0])); }},
      {"onnx",
       [](const std::string& path, const Files& files) { (void)Answered(ReadOnnxOutline(files[0], path)); }},
      {"exif", [](const std::string& path, const Files&) { (void)ReadExif(path); }},
  };
  return readers;
}

}  // namespace
}  // namespace cairn

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* bytes, size_t size) {
  using namespace cairn;
  const std::string_view input(reinterpret_cast<const char*>(bytes), size);
  const size_t end_of_name = input.find('\n');
  if (end_of_name == std::string_view::npos) return -1;
  const auto reader = Readers().find(std::string(input.substr(0, end_of_name)));
  if (reader == Readers().end()) return -1;  // not worth to be kept
  constexpr std::string_view kDivider = "\n====\n";
  Files files;
  std::string_view rest = input.substr(end_of_name + 1);
  for (size_t at = rest.find(kDivider); at != std::string_view::npos; at = rest.find(kDivider)) {
    files.push_back(rest.substr(0, at));
    rest.remove_prefix(at + kDivider.size());
  }
  files.push_back(rest);
  reader->second(Write("it", files[0]), files);
  return 0;
}
