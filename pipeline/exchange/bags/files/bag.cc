#include "pipeline/exchange/bags/files/bag.h"

#include <filesystem>

#include <yaml-cpp/yaml.h>

#include "core/capture/bag_file.h"
#include "core/files/file.h"
#include "core/files/input_file.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;

Result<std::unique_ptr<Bag>> OpenBagFile(const std::string& path) {
  if (path.ends_with(".zstd") || path.ends_with(".zst")) {
    return MakeError(ErrorCode::kUnsupported,
                     "{}: a bag that is compressed as a whole; unpack it with unzstd --rm, or 'ros2 bag "
                     "convert', first",
                     path);
  }
  CAIRN_RETURN_IF_ERROR(CheckInputFile(path));
  std::error_code error;
  if (fs::file_size(path, error) == 0 && !error)
    return MakeError(ErrorCode::kEmptyFile, "{}: no bytes, expected a bag", path);
  switch (BagStorageOf(path)) {
    case BagStorage::kSqlite:
      return OpenSqliteBag(path);
    case BagStorage::kMcap:
      return OpenMcapBag(path);
    case BagStorage::kRos1:
      return OpenRos1Bag(path);
    case BagStorage::kNone:
      break;
  }
  return MakeError(
      ErrorCode::kCorrupt,
      "{}: not a bag: it does not begin as SQLite's files (.db3), MCAP or ROS 1's bags do; is it "
      "truncated, or another kind of file?",
      path);
}

// Files that were recorded one after the other.
class SeveralFilesBag : public Bag {
 public:
  explicit SeveralFilesBag(std::vector<std::string> paths) : paths_(std::move(paths)) {}

  Result<std::vector<std::string>> Read(BagVisitor& visitor) override {
    std::vector<std::string> damage;
    for (const std::string& path : paths_) {
      CAIRN_ASSIGN_OR_RETURN(const std::unique_ptr<Bag> bag, OpenBagFile(path));
      CAIRN_ASSIGN_OR_RETURN(const std::vector<std::string> sentences, bag->Read(visitor));
      damage.insert(damage.end(), sentences.begin(), sentences.end());
    }
    return damage;
  }

 private:
  std::vector<std::string> paths_;
};

Result<std::vector<std::string>> ListedFiles(const std::string& folder) {
  const std::string path = folder + "/" + kBagMetadataFile;
  CAIRN_ASSIGN_OR_RETURN(const std::string text, ReadFile(path));
  std::vector<std::string> files;
  try {
    const YAML::Node list = YAML::Load(text)["rosbag2_bagfile_information"]["relative_file_paths"];
    for (const YAML::Node& item : list) files.push_back(item.as<std::string>());
  } catch (const YAML::Exception& exception) {
    return MakeError(ErrorCode::kCorrupt, "{}: YAML says: {}; remove it, then the folder's bags are read",
                     path, exception.what());
  }
  if (files.empty()) {
    return MakeError(ErrorCode::kCorrupt,
                     "{}: no rosbag2_bagfile_information with relative_file_paths: not a bag's metadata; "
                     "remove it, then the folder's bags are read",
                     path);
  }
  for (std::string& file : files) {
    // Old versions of rosbag2 wrote BAG/BAG_0.db3; nothing outside of the folder is opened.
    const std::string name = fs::path(file).filename().string();
    file = folder + "/" + name;
    std::error_code error;
    if (!fs::exists(file, error)) {
      return MakeError(ErrorCode::kNotFound, "{}: lists {}, which is not there; copy the whole folder", path,
                       name);
    }
  }
  return files;
}

}  // namespace

std::string TypeWithoutMsg(const std::string& type) {
  const size_t middle = type.find("/msg/");
  return middle == std::string::npos ? type : type.substr(0, middle) + type.substr(middle + 4);
}

Result<std::unique_ptr<Bag>> OpenBag(const std::string& path) {
  std::error_code error;
  if (!fs::is_directory(path, error)) return OpenBagFile(path);
  std::vector<std::string> files = BagsInFolder(path);
  if (fs::exists(path + "/" + kBagMetadataFile, error)) {
    CAIRN_ASSIGN_OR_RETURN(files, ListedFiles(path));
  }
  if (files.empty())
    return MakeError(ErrorCode::kNoData, "{}: no bag in it: no metadata.yaml, .db3, .mcap or .bag", path);
  // What is wrong with a file is said before anything is read.
  for (const std::string& file : files) {
    if (const auto bag = OpenBagFile(file); !bag.ok()) return bag.error();
  }
  return std::unique_ptr<Bag>(std::make_unique<SeveralFilesBag>(std::move(files)));
}

}  // namespace cairn::pipeline
