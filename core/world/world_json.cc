// World JSON.  A million stations with a hundred features each are a file of 700 MB, so the reader is a
// handler for a streaming parser: it never holds the document, only the world.
#include <algorithm>
#include <fstream>
#include <iterator>
#include <limits>

#include <nlohmann/json.hpp>

#include "core/files/file.h"
#include "core/files/input_file.h"
#include "core/world/world.h"

namespace cairn {
namespace {

constexpr char kFormat[] = "cairn-world";
constexpr int kWorldJsonVersion = 1;

// Receives the parser's events.  A member of the document's object is a number, a string, an array of
// numbers, or an array of arrays of numbers.  Unknown members are skipped, whatever they hold.
class WorldHandler : public nlohmann::json_sax<nlohmann::json> {
 public:
  World world;
  std::string format;
  double version = 0;
  Error error;
  bool has_poses = false, has_edges = false, has_features = false;

  bool key(std::string& name) override {
    if (objects_ == 0) member_ = name;
    return true;
  }
  bool start_object(size_t) override {
    if (!in_document_) {
      in_document_ = true;
      return true;
    }
    if (member_is_known()) return Refuse("an object");
    ++objects_;
    return true;
  }
  bool end_object() override {
    if (objects_ > 0) --objects_;
    return true;
  }
  bool start_array(size_t) override {
    if (!in_document_) return Refuse("an array");
    ++in_array_;
    if (!member_is_known()) return true;
    if (in_array_ == 1) return StartMember();
    if (in_array_ == 2 && is_nested()) {
      row_.clear();
      return true;
    }
    return Refuse("an array");
  }
  bool end_array() override {
    const int level = in_array_--;
    if (!member_is_known()) return true;
    if (level == 2) return EndRow();
    if (member_ == "floor_from_world") return EndFloor();
    return true;
  }
  bool number_integer(number_integer_t value) override {
    return Number(static_cast<double>(value), value, true);
  }
  bool number_unsigned(number_unsigned_t value) override {
    const bool fits = value <= static_cast<uint64_t>(std::numeric_limits<int64_t>::max());
    return Number(static_cast<double>(value), fits ? static_cast<int64_t>(value) : 0, fits);
  }
  bool number_float(number_float_t value, const string_t&) override { return Number(value, 0, false); }
  bool string(string_t& value) override {
    if (!member_is_known()) return true;
    if (member_ == "format" && !in_array_) {
      format = value;
      return true;
    }
    return Refuse("a text");
  }
  bool null() override { return member_is_known() ? Refuse("null") : true; }
  bool boolean(bool) override { return member_is_known() ? Refuse("a boolean") : true; }
  bool binary(binary_t&) override { return Refuse("binary"); }
  bool parse_error(size_t position, const std::string&,
                   const nlohmann::detail::exception& exception) override {
    const std::string what = exception.what();
    const size_t tail = what.find("syntax error");
    error = MakeError(ErrorCode::kCorrupt, "byte {}: not JSON: {} (is the file truncated?)", position,
                      tail == std::string::npos ? what : what.substr(tail));
    return false;
  }

 private:
  bool is_nested() const {
    return member_ == "poses" || member_ == "edges" || member_ == "features" || member_ == "station_images";
  }
  bool member_is_known() const {
    return is_nested() || member_ == "format" || member_ == "version" || member_ == "headings_deg" ||
           member_ == "class_ids" || member_ == "lattice_spacing_m" || member_ == "floor_from_world";
  }
  bool StartMember() {
    bool* seen = member_ == "poses" ? &has_poses : member_ == "edges" ? &has_edges : &has_features;
    if (member_ == "poses" || member_ == "edges" || member_ == "features") {
      if (*seen) {
        error = MakeError(ErrorCode::kInvalidArgument, "member '{}' occurs twice", member_);
        return false;
      }
      *seen = true;
    }
    return member_ == "format" || member_ == "version" || member_ == "lattice_spacing_m" ? Refuse("an array")
                                                                                         : true;
  }
  // An integer that fits the type of its list, or an error that names it.
  bool Integer(double value, int64_t integer, bool is_integer, int64_t max) {
    if (is_integer && integer >= 0 && integer <= max) return true;
    error = MakeError(ErrorCode::kInvalidArgument, "{}: {:g} is not an index (an integer from 0 to {})",
                      Where(), value, max);
    return false;
  }
  bool Number(double value, int64_t integer, bool is_integer) {
    if (!member_is_known()) return true;
    if (in_array_ == 0) {
      if (member_ == "version") {
        version = value;
      } else if (member_ == "lattice_spacing_m") {
        world.lattice_spacing_m = value;
      } else {
        return Refuse("a number");
      }
      return true;
    }
    if (in_array_ == 2) {
      if (member_ == "poses") {
        row_numbers_.push_back(value);
        return true;
      }
      if (!Integer(value, integer, is_integer, std::numeric_limits<int32_t>::max())) return false;
      row_.push_back(static_cast<int32_t>(integer));
      return true;
    }
    if (is_nested()) return Refuse("a number");
    if (member_ == "class_ids") {
      if (!Integer(value, integer, is_integer, kInvalidClassId - 1)) return false;
      world.class_ids.push_back(static_cast<ClassId>(integer));
    } else if (member_ == "headings_deg") {
      world.headings_deg.push_back(value);
    } else {
      row_numbers_.push_back(value);
    }
    return true;
  }
  bool EndRow() {
    if (member_ == "poses") {
      if (row_numbers_.size() != 2) return Refuse(fmt::format("{} numbers", row_numbers_.size()));
      world.positions.emplace_back(row_numbers_[0], row_numbers_[1]);
      row_numbers_.clear();
    } else if (member_ == "edges") {
      if (row_.size() != 2) return Refuse(fmt::format("{} indices", row_.size()));
      world.edges.emplace_back(std::min(row_[0], row_[1]), std::max(row_[0], row_[1]));
    } else if (member_ == "features") {
      world.areas.push_back(row_);
    } else {
      world.station_images.emplace_back(row_.begin(), row_.end());
    }
    return true;
  }
  bool EndFloor() {
    if (row_numbers_.size() != 7) return Refuse(fmt::format("{} numbers", row_numbers_.size()));
    const std::vector<double>& n = row_numbers_;
    world.floor_from_world.rotation = Eigen::Quaterniond(n[0], n[1], n[2], n[3]);
    world.floor_from_world.translation = Eigen::Vector3d(n[4], n[5], n[6]);
    row_numbers_.clear();
    return true;
  }
  std::string Where() const {
    if (member_.empty()) return "document";
    const size_t index = member_ == "poses"            ? world.positions.size()
                         : member_ == "edges"          ? world.edges.size()
                         : member_ == "features"       ? world.areas.size()
                         : member_ == "station_images" ? world.station_images.size()
                         : member_ == "class_ids"      ? world.class_ids.size()
                                                       : world.headings_deg.size();
    return in_array_ ? fmt::format("{}[{}]", member_, index) : member_;
  }
  bool Refuse(const std::string& found) {
    static const std::pair<const char*, const char*> kExpected[] = {
        {"poses", "[x, y]"},
        {"edges", "[station, station]"},
        {"features", "a list of station indices"},
        {"station_images", "a list of image ids"},
        {"headings_deg", "a list of numbers"},
        {"class_ids", "a list of class ids"},
        {"floor_from_world", "[qw, qx, qy, qz, tx, ty, tz]"},
        {"format", "a text"},
        {"version", "a number"},
        {"lattice_spacing_m", "a number"}};
    const auto expected = std::find_if(std::begin(kExpected), std::end(kExpected),
                                       [&](const auto& entry) { return member_ == entry.first; });
    error = MakeError(
        ErrorCode::kInvalidArgument, "{}: found {}, expected {}", Where(), found,
        expected == std::end(kExpected) ? "an object with the members of a world" : expected->second);
    return false;
  }

  bool in_document_ = false;
  int in_array_ = 0;  // nesting of arrays below the current member
  int objects_ = 0;   // nesting of objects below an unknown member
  std::string member_;
  std::vector<int32_t> row_;
  std::vector<double> row_numbers_;
};

Status CheckDocument(const WorldHandler& handler) {
  if (handler.format != kFormat) {
    return MakeError(ErrorCode::kCorrupt, "\"format\" is '{}', expected '{}'", handler.format, kFormat);
  }
  if (handler.version != kWorldJsonVersion) {
    return MakeError(ErrorCode::kUnsupported, "world version {:g}, this program reads {}", handler.version,
                     kWorldJsonVersion);
  }
  for (const auto& [has, name] :
       {std::pair(handler.has_poses, "poses"), std::pair(handler.has_edges, "edges"),
        std::pair(handler.has_features, "features")}) {
    if (!has) return MakeError(ErrorCode::kCorrupt, "member '{}' is missing", name);
  }
  return Ok();
}

}  // namespace

Result<World> ReadWorldJson(const std::string& path) {
  CAIRN_RETURN_IF_ERROR(CheckInputFile(path));
  std::ifstream file(path, std::ios::binary);
  if (!file) return MakeError(ErrorCode::kIo, "{}: cannot be read", path);
  WorldHandler handler;
  const bool parsed = nlohmann::json::sax_parse(file, &handler);
  const Status status = parsed ? CheckDocument(handler) : Status(handler.error);
  if (!status.ok()) return MakeError(status.error().code, "{}: {}", path, status.error().message);
  World world = std::move(handler.world);
  std::sort(world.edges.begin(), world.edges.end());
  for (std::vector<StationIdx>& area : world.areas) std::sort(area.begin(), area.end());
  if (Status check = CheckWorld(world); !check.ok()) {
    return MakeError(check.error().code, "{}: {}", path, check.error().message);
  }
  return world;
}

Status WriteWorldJson(const World& world, const std::string& path) {
  CAIRN_RETURN_IF_ERROR(CheckWorld(world));
  fmt::memory_buffer text;
  auto out = std::back_inserter(text);
  // Writes `"name":[item,item...]`, each item by `write`.
  const auto list = [&](const char* name, size_t size, const auto& write) {
    fmt::format_to(out, ",\n\"{}\":[", name);
    for (size_t i = 0; i < size; ++i) {
      if (i > 0) text.push_back(',');
      write(i);
    }
    text.push_back(']');
  };
  fmt::format_to(out, "{{\"format\":\"{}\",\"version\":{}", kFormat, kWorldJsonVersion);
  list("poses", world.positions.size(),
       [&](size_t i) { fmt::format_to(out, "[{},{}]", world.positions[i].x(), world.positions[i].y()); });
  list("edges", world.edges.size(),
       [&](size_t i) { fmt::format_to(out, "[{},{}]", world.edges[i].first, world.edges[i].second); });
  list("features", world.areas.size(),
       [&](size_t i) { fmt::format_to(out, "[{}]", fmt::join(world.areas[i], ",")); });
  if (!world.headings_deg.empty()) {
    list("headings_deg", world.headings_deg.size(),
         [&](size_t i) { fmt::format_to(out, "{}", world.headings_deg[i]); });
  }
  if (!world.class_ids.empty()) {
    list("class_ids", world.class_ids.size(),
         [&](size_t i) { fmt::format_to(out, "{}", world.class_ids[i]); });
  }
  if (!world.station_images.empty()) {
    list("station_images", world.station_images.size(),
         [&](size_t i) { fmt::format_to(out, "[{}]", fmt::join(world.station_images[i], ",")); });
  }
  if (world.lattice_spacing_m > 0)
    fmt::format_to(out, ",\n\"lattice_spacing_m\":{}", world.lattice_spacing_m);
  const Pose& floor = world.floor_from_world;
  if (floor.Matrix() != Pose().Matrix()) {
    const double numbers[] = {floor.rotation.w(),   floor.rotation.x(),    floor.rotation.y(),
                              floor.rotation.z(),   floor.translation.x(), floor.translation.y(),
                              floor.translation.z()};
    list("floor_from_world", 7, [&](size_t i) { fmt::format_to(out, "{}", numbers[i]); });
  }
  fmt::format_to(out, "}}\n");
  return WriteFileAtomically(path, std::string_view(text.data(), text.size()));
}

}  // namespace cairn
