#include "stages/decompose_views/formats/occupancy_grid.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <optional>
#include <vector>

#include <yaml-cpp/yaml.h>

#include "core/base/text.h"
#include "core/files/file.h"
#include "core/files/input_file.h"
#include "core/images/image_file.h"
#include "stages/decompose_views/formats/input_plan.h"

namespace cairn::decompose_views {
namespace {

namespace fs = std::filesystem;

constexpr double kMinResolutionM = 1e-3, kMaxResolutionM = 1;
constexpr uintmax_t kMaxYamlBytes = 1 << 20;  // map_server writes some 200

struct MapFile {
  std::string image;  // its path
  double resolution_m = 0;
  PlanarPose origin;
  bool negate = false;
  double occupied_thresh = 0, free_thresh = 0;
  std::string mode = "trinary";
};

class MapFileReader {
 public:
  explicit MapFileReader(const std::string& path) : path_(path) {}

  Result<MapFile> Read() {
    std::error_code error;
    if (const uintmax_t num_bytes = fs::file_size(path_, error); !error && num_bytes > kMaxYamlBytes) {
      return Corrupt(path_,
                     "{} bytes, expected the few lines of a map's YAML file (image, resolution, origin)",
                     num_bytes);
    }
    CAIRN_ASSIGN_OR_RETURN(const std::string text, ReadFile(path_));
    try {
      return Parse(text);
    } catch (const YAML::Exception& exception) {
      return Corrupt(path_, "YAML says: {}", exception.what());
    }
  }

 private:
  Result<MapFile> Parse(const std::string& text) {
    const YAML::Node root = YAML::Load(text);
    if (!root.IsMap()) {
      return Corrupt(path_,
                     "no map's YAML file: expected lines like `image: map.pgm` and `resolution: 0.05`");
    }
    root_ = &root;
    MapFile file;
    CAIRN_ASSIGN_OR_RETURN(file.image, Image());
    CAIRN_ASSIGN_OR_RETURN(file.resolution_m,
                           Number("resolution", kMinResolutionM, kMaxResolutionM, "metres a cell"));
    CAIRN_ASSIGN_OR_RETURN(file.origin, Origin());
    CAIRN_ASSIGN_OR_RETURN(file.negate, Negate());
    CAIRN_ASSIGN_OR_RETURN(file.occupied_thresh, Number("occupied_thresh", 0, 1, "a probability"));
    CAIRN_ASSIGN_OR_RETURN(file.free_thresh, Number("free_thresh", 0, 1, "a probability"));
    if (file.free_thresh > file.occupied_thresh) {
      return At("free_thresh", "free_thresh {:g} is above occupied_thresh {:g}", file.free_thresh,
                file.occupied_thresh);
    }
    if (!root["mode"]) return file;
    CAIRN_ASSIGN_OR_RETURN(file.mode, Word("mode"));
    if (file.mode != "trinary" && file.mode != "scale" && file.mode != "raw")
      return At("mode", "mode {:?} is not trinary, scale or raw", file.mode);
    return file;
  }

  template <typename... Args>
  Error At(const std::string& key, fmt::format_string<Args...> format, Args&&... args) const {
    return Corrupt(fmt::format("{}: line {}", path_, (*root_)[key].Mark().line + 1), format,
                   std::forward<Args>(args)...);
  }

  Result<std::string> Word(const std::string& key) const {
    const YAML::Node node = (*root_)[key];
    if (!node) {
      return Corrupt(path_,
                     "no key `{}`; a map's YAML file has image, resolution, origin, negate, "
                     "occupied_thresh and free_thresh",
                     key);
    }
    if (!node.IsScalar()) return At(key, "{} is not one value", key);
    return node.Scalar();
  }

  Result<double> Number(const std::string& key, double min, double max, const char* unit) const {
    CAIRN_ASSIGN_OR_RETURN(const std::string word, Word(key));
    double value = 0;
    if (!ParseNumber(word, &value) || !(value >= min && value <= max)) {
      return At(key, "{} is {:?}, expected {}, {:g} to {:g}", key, word.substr(0, 40), unit, min, max);
    }
    return value;
  }

  Result<PlanarPose> Origin() const {
    const YAML::Node node = (*root_)["origin"];
    if (!node) return Word("origin").error();
    std::array<double, 3> values{};
    bool is_right = node.IsSequence() && node.size() == values.size();
    for (size_t i = 0; is_right && i < values.size(); ++i) {
      is_right = node[i].IsScalar() && ParseNumber(node[i].Scalar(), &values[i]) &&
                 std::abs(values[i]) <= kMaxCoordinateM;
    }
    if (!is_right)
      return At("origin", "origin is not [x, y, yaw] in metres and radians, up to {:g}", kMaxCoordinateM);
    return PlanarPose{{values[0], values[1]}, values[2]};
  }

  Result<bool> Negate() const {
    CAIRN_ASSIGN_OR_RETURN(const std::string word, Word("negate"));
    if (word == "0" || word == "false" || word == "False") return false;
    if (word == "1" || word == "true" || word == "True") return true;
    return At("negate", "negate is {:?}, expected 0 or 1", word.substr(0, 40));
  }

  // Nothing outside of the folder is opened, whoever wrote the file.
  Result<std::string> Image() const {
    CAIRN_ASSIGN_OR_RETURN(const std::string name, Word("image"));
    if (!IsPathBelow(name)) {
      return MakeError(
          ErrorCode::kInvalidArgument,
          "{}: line {}: image {:?} leads out of the file's folder; put the image beside the file and "
          "write its name alone",
          path_, (*root_)["image"].Mark().line + 1, name.substr(0, 200));
    }
    return (fs::path(path_).parent_path() / name).string();
  }

  const std::string& path_;
  const YAML::Node* root_ = nullptr;
};

struct ImageSize {
  int64_t width = 0, height = 0;
};

// The header of a PGM: its magic, three numbers with comments between, one white space.
struct PgmHeader {
  ImageSize size;
  int64_t max_grey = 0;
  size_t num_bytes = 0;
};

std::optional<PgmHeader> ParsePgmHeader(std::string_view bytes) {
  PgmHeader header;
  size_t at = 2;
  for (int64_t* value : {&header.size.width, &header.size.height, &header.max_grey}) {
    while (at < bytes.size() &&
           (std::isspace(static_cast<unsigned char>(bytes[at])) != 0 || bytes[at] == '#')) {
      if (bytes[at] == '#') at = std::min(bytes.find('\n', at), bytes.size() - 1);
      ++at;
    }
    const auto [end, error] = std::from_chars(bytes.data() + at, bytes.data() + bytes.size(), *value);
    if (error != std::errc()) return std::nullopt;
    at = static_cast<size_t>(end - bytes.data());
  }
  if (at >= bytes.size() || std::isspace(static_cast<unsigned char>(bytes[at])) == 0) return std::nullopt;
  header.num_bytes = at + 1;
  return header;
}

// How many words of a plain PGM's raster are there.
int64_t NumWords(std::string_view text) {
  int64_t num = 0;
  bool in_word = false;
  for (const char c : text) {
    const bool is_space = std::isspace(static_cast<unsigned char>(c)) != 0;
    num += !is_space && !in_word ? 1 : 0;
    in_word = !is_space;
  }
  return num;
}

uint32_t BigEndian(std::string_view bytes, size_t at) {
  uint32_t value = 0;
  for (size_t i = 0; i < 4; ++i) value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
  return value;
}

Status CheckSize(const ImageSize& size, const std::string& path) {
  if (size.width < 1 || size.height < 1)
    return Corrupt(path, "an image of {} x {} cells", size.width, size.height);
  // As OpenCV counts the width and height in an int, their product fits.
  constexpr int64_t kMaxSide = 1 << 30;
  if (size.width > kMaxSide || size.height > kMaxSide || size.width * size.height > kMaxNumCells) {
    return MakeError(
        ErrorCode::kUnsupported,
        "{}: {} x {} cells; at most {} are read.  Cut the map to the building, or make its cells larger",
        path, size.width, size.height, kMaxNumCells);
  }
  return Ok();
}

// Grey levels, row 0 at the top.
Result<cv::Mat> ReadGreyLevels(const std::string& path) {
  std::error_code error;
  // Two bytes a cell, as text four, and comments.
  if (const uintmax_t num_bytes = fs::file_size(path, error);
      !error && num_bytes > 8 * uintmax_t{kMaxNumCells}) {
    return MakeError(ErrorCode::kUnsupported, "{}: {} bytes; at most {} cells are read", path, num_bytes,
                     kMaxNumCells);
  }
  CAIRN_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path));
  constexpr size_t kPngHeader = 26;  // signature, IHDR's length, name, width, height, bit depth, colour type
  if (bytes.starts_with("\x89PNG") && bytes.size() >= kPngHeader) {
    CAIRN_RETURN_IF_ERROR(CheckSize({BigEndian(bytes, 16), BigEndian(bytes, 20)}, path));
    if ((bytes[25] & 4) != 0 || bytes.find("tRNS") < bytes.find("IDAT")) {
      return MakeError(
          ErrorCode::kUnsupported,
          "{}: a PNG with transparency, which map servers read in different ways; save it as grey "
          "levels without an alpha channel",
          path);
    }
  } else if (bytes.starts_with("P5") || bytes.starts_with("P2")) {
    const std::optional<PgmHeader> header = ParsePgmHeader(bytes);
    if (!header) return Corrupt(path, "a PGM without a width, a height and a largest grey level");
    CAIRN_RETURN_IF_ERROR(CheckSize(header->size, path));
    if (header->max_grey != 255) {
      return MakeError(ErrorCode::kUnsupported,
                       "{}: a PGM whose largest grey level is {}; thresholds are for 255: save it with that",
                       path, header->max_grey);
    }
    const int64_t expected = header->size.width * header->size.height;
    const std::string_view raster = std::string_view(bytes).substr(header->num_bytes);
    const int64_t found = bytes[1] == '5' ? static_cast<int64_t>(raster.size()) : NumWords(raster);
    if (found < expected) {
      return Corrupt(path, "a PGM that is cut short: {} of {} x {} cells; copy it again", found,
                     header->size.width, header->size.height);
    }
  } else {
    return MakeError(bytes.empty() ? ErrorCode::kEmptyFile : ErrorCode::kUnsupported,
                     "{}: {}; a map's image is PGM (P2, P5) or PNG", path,
                     bytes.empty() ? "no bytes at all" : "neither PGM nor PNG");
  }
  return DecodeGreyImage(bytes, path);
}

// What each grey level says.
std::array<CellState, 256> StatesOf(const MapFile& file) {
  std::array<CellState, 256> states{};
  for (int grey = 0; grey < 256; ++grey) {
    const int lightness = file.negate ? 255 - grey : grey;
    const bool is_raw = file.mode == "raw";
    const double occupied = is_raw ? lightness / 100.0 : (255 - lightness) / 255.0;
    states[grey] = is_raw && lightness > 100         ? CellState::kUnknown
                   : occupied > file.occupied_thresh ? CellState::kOccupied
                   : occupied < file.free_thresh     ? CellState::kFree
                                                     : CellState::kUnknown;
  }
  return states;
}

}  // namespace

Result<std::string> ImageOfOccupancyGrid(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(const MapFile file, MapFileReader(path).Read());
  return file.image;
}

Result<OccupancyGrid> ReadOccupancyGrid(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(const MapFile file, MapFileReader(path).Read());
  CAIRN_ASSIGN_OR_RETURN(const cv::Mat grey, ReadGreyLevels(file.image));
  const std::array<CellState, 256> states = StatesOf(file);
  OccupancyGrid grid{cv::Mat(grey.size(), CV_8UC1), file.resolution_m, file.origin};
  for (int row = 0; row < grey.rows; ++row) {
    const auto* from = grey.ptr<uint8_t>(grey.rows - 1 - row);
    auto* to = grid.cells.ptr<uint8_t>(row);
    for (int column = 0; column < grey.cols; ++column)
      to[column] = static_cast<uint8_t>(states[from[column]]);
  }
  return grid;
}

}  // namespace cairn::decompose_views
