#include "pipeline/exchange/bags/bag.h"

#include <algorithm>
#include <filesystem>
#include <fstream>

#include <yaml-cpp/yaml.h>

#include "core/base/text.h"
#include "core/files/file.h"
#include "core/files/input_file.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;

struct BagKind {
  std::string_view suffix;
  std::string_view magic;
  Result<std::unique_ptr<Bag>> (*open)(const std::string&);
};

constexpr BagKind kBagKinds[] = {
    {".db3", "SQLite format 3", OpenSqliteBag},
    {".mcap", "\x89MCAP", OpenMcapBag},
    {".bag", "#ROSBAG V", OpenRos1Bag},
};
constexpr size_t kMaxMagicBytes = 16;

std::string BagHead(const std::string& path) {
  if (!CheckInputFile(path).ok()) return {};
  std::string head(kMaxMagicBytes, '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(head.data(), static_cast<std::streamsize>(head.size()));
  head.resize(static_cast<size_t>(file.gcount()));
  return head;
}

bool HasBagSuffix(const std::string& path) {
  return std::any_of(std::begin(kBagKinds), std::end(kBagKinds),
                     [&](const BagKind& kind) { return path.ends_with(kind.suffix); });
}

Result<std::unique_ptr<Bag>> OpenBagFile(const std::string& path) {
  if (path.ends_with(".zstd") || path.ends_with(".zst")) {
    return MakeError(ErrorCode::kUnsupported,
                     "{}: a bag that is compressed as a whole; unpack it with unzstd --rm, or 'ros2 bag "
                     "convert', first",
                     path);
  }
  CAIRN_RETURN_IF_ERROR(CheckInputFile(path));
  const std::string head = BagHead(path);
  if (head.empty()) return MakeError(ErrorCode::kEmptyFile, "{}: no bytes, expected a bag", path);
  for (const BagKind& kind : kBagKinds) {
    if (head.starts_with(kind.magic)) return kind.open(path);
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
  const std::string path = folder + "/metadata.yaml";
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
    // Old versions of rosbag2 wrote BAG/BAG_0.db3.
    const std::string name = fs::path(file).filename().string();
    const fs::path relative(file);
    const bool leads_out = relative.is_absolute() || std::any_of(relative.begin(), relative.end(),
                                                                 [](const auto& p) { return p == ".."; });
    std::error_code error;
    file = !leads_out && fs::exists(folder + "/" + file, error) ? folder + "/" + file : folder + "/" + name;
    if (!fs::exists(file, error)) {
      return MakeError(ErrorCode::kNotFound, "{}: lists {}, which is not there; copy the whole folder", path,
                       name);
    }
  }
  return files;
}

std::vector<std::string> BagsIn(const std::string& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    if (HasBagSuffix(name)) names.push_back(name);
  }
  std::sort(names.begin(), names.end());
  std::vector<std::string> paths;
  for (const int i : NaturalOrder(names)) paths.push_back(folder + "/" + names[i]);
  return paths;
}

}  // namespace

std::string TypeWithoutMsg(const std::string& type) {
  const size_t middle = type.find("/msg/");
  return middle == std::string::npos ? type : type.substr(0, middle) + type.substr(middle + 4);
}

bool IsBag(const std::string& path) {
  std::error_code error;
  if (fs::is_directory(path, error)) {
    if (!BagsIn(path).empty()) return true;
    const Result<std::string> text = ReadFile(path + "/metadata.yaml");
    return text.ok() && text->find("rosbag2_bagfile_information") != std::string::npos;
  }
  if (HasBagSuffix(path)) return true;
  const std::string head = BagHead(path);
  return std::any_of(std::begin(kBagKinds), std::end(kBagKinds),
                     [&](const BagKind& kind) { return head.starts_with(kind.magic); });
}

Result<std::unique_ptr<Bag>> OpenBag(const std::string& path) {
  std::error_code error;
  if (!fs::is_directory(path, error)) return OpenBagFile(path);
  std::vector<std::string> files = BagsIn(path);
  if (fs::exists(path + "/metadata.yaml", error)) {
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
