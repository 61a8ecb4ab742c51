#include "stages/reconstruct/verdict/verdict_json.h"

#include <cmath>
#include <initializer_list>

#include <nlohmann/json.hpp>

#include "stages/reconstruct/verdict/verdict_text.h"

namespace cairn::reconstruct {
namespace {

using Json = nlohmann::ordered_json;

// No map reaches farther, and no list of images or points is longer.
constexpr double kMaxLength = 1e7;
constexpr int64_t kMaxCount = 1000000000;

Json LoopsJson(const Verdict& verdict) {
  Json list = Json::array();
  for (const LoopPair& loop : verdict.loops) {
    list.push_back({{"from", verdict.images[loop.image1].name},
                    {"to", verdict.images[loop.image2].name},
                    {"way", loop.way},
                    {"num_points", loop.num_points},
                    {"image1", loop.image1},
                    {"image2", loop.image2}});
  }
  return list;
}

Json LinksJson(const Verdict& verdict, const std::vector<int>& links) {
  Json list = Json::array();
  for (const int l : links) {
    const ImageLink& link = verdict.links[l];
    list.push_back({{"from", verdict.images[link.image1].name},
                    {"to", verdict.images[link.image2].name},
                    {"num_points", link.num_points},
                    {"length", link.length},
                    {"num_missing", link.num_missing},
                    {"link", l}});
  }
  return list;
}

// A table by column.
Json Columns(std::initializer_list<const char*> names) {
  Json columns = Json::object();
  for (const char* name : names) columns[name] = Json::array();
  return columns;
}

Json IndexOrNull(int image) { return image < 0 ? Json() : Json(image); }

// Takes values out of an object, and remembers the first that is not as it should be.
class Reader {
 public:
  bool Flag(const Json& object, const char* key) {
    const Json* value = Find(object, key);
    if (value != nullptr && value->is_boolean()) return value->get<bool>();
    Complain(key, "true or false");
    return false;
  }
  double Length(const Json& value, const char* key) {
    if (value.is_number() && std::abs(value.get<double>()) <= kMaxLength) return value.get<double>();
    Complain(key, "a length");
    return 0;
  }
  int Count(const Json& value, const char* key, int64_t end = kMaxCount) {
    if (value.is_number_integer() && value >= 0 && value < end) return value.get<int>();
    Complain(key, "a number of things that are there");
    return 0;
  }
  std::string Text(const Json& value, const char* key) {
    if (value.is_string()) return value.get<std::string>();
    Complain(key, "a text");
    return "";
  }
  const Json& List(const Json& object, const char* key) {
    static const Json kEmpty = Json::array();
    const Json* value = Find(object, key);
    if (value != nullptr && value->is_array()) return *value;
    Complain(key, "a list");
    return kEmpty;
  }
  const Json& At(const Json& object, const char* key) {
    static const Json kNothing;
    const Json* value = Find(object, key);
    if (value == nullptr) Complain(key, "there");
    return value == nullptr ? kNothing : *value;
  }
  // Lists of columns that belong together: as long as the first.
  const Json& Column(const Json& object, const char* key, size_t size) {
    const Json& list = List(object, key);
    if (list.size() == size) return list;
    Complain(key, "as long as the lists beside it");
    static const Json kEmpty = Json::array();
    return kEmpty;
  }
  void Complain(const char* key, const char* expected) {
    if (complaint_.empty()) complaint_ = fmt::format("'{}' is not {}", key, expected);
  }
  const std::string& complaint() const { return complaint_; }

 private:
  const Json* Find(const Json& object, const char* key) const {
    if (!object.is_object()) return nullptr;
    const auto found = object.find(key);
    return found == object.end() ? nullptr : &*found;
  }
  std::string complaint_;
};

class Parser {
 public:
  explicit Parser(const Json& json) : json_(json) {}

  Result<Verdict> Parse() {
    verdict_.is_metric = reader_.Flag(json_, "is_metric");
    verdict_.is_drive = reader_.Flag(json_, "is_drive");
    verdict_.way = reader_.Length(reader_.At(json_, "way"), "way");
    verdict_.median_step = reader_.Length(reader_.At(json_, "median_step"), "median_step");
    ParseImages();
    ParseLinks();
    ParseLoops();
    ParseMissing();
    for (const Json& part : reader_.List(json_, "parts")) {
      verdict_.parts.push_back({.num_images = Count(part, "num_images"),
                                .first = Text(part, "first"),
                                .last = Text(part, "last")});
    }
    for (const Json& walk : reader_.List(json_, "folders")) {
      verdict_.walks.push_back({.folder = Text(walk, "folder"),
                                .num_images = Count(walk, "num_images"),
                                .num_joined = Count(walk, "num_joined"),
                                .num_points_of_others = Count(walk, "num_points_of_others")});
    }
    verdict_.weak_links = Links("weak_links");
    verdict_.long_steps = Links("long_steps");
    for (const Json& image : reader_.List(json_, "weak_images"))
      verdict_.weak_images.push_back(Image(image, "image"));
    for (const Json& stretch : reader_.List(json_, "open_stretches")) {
      verdict_.open_stretches.push_back({.image1 = Image(stretch, "image1"),
                                         .image2 = Image(stretch, "image2"),
                                         .length = reader_.Length(reader_.At(stretch, "length"), "length")});
    }
    if (reader_.complaint().empty()) return std::move(verdict_);
    return MakeError(ErrorCode::kCorrupt, "{}", reader_.complaint());
  }

 private:
  int Count(const Json& object, const char* key) { return reader_.Count(reader_.At(object, key), key); }
  std::string Text(const Json& object, const char* key) { return reader_.Text(reader_.At(object, key), key); }

  int Image(const Json& object, const char* key) {
    return reader_.Count(reader_.At(object, key), key, static_cast<int64_t>(verdict_.images.size()));
  }

  void ParseImages() {
    const Json& images = reader_.At(json_, "images");
    const Json& names = reader_.List(images, "name");
    const Json& x = reader_.Column(images, "x", names.size());
    const Json& y = reader_.Column(images, "y", names.size());
    const Json& num_points = reader_.Column(images, "num_points", names.size());
    if (names.empty()) reader_.Complain("images", "a list of one or more");
    if (!reader_.complaint().empty()) return;
    for (size_t i = 0; i < names.size(); ++i) {
      verdict_.images.push_back({.name = reader_.Text(names[i], "name"),
                                 .place = {reader_.Length(x[i], "x"), reader_.Length(y[i], "y")},
                                 .num_points = reader_.Count(num_points[i], "num_points")});
    }
  }

  void ParseLinks() {
    const Json& links = reader_.At(json_, "links");
    const Json& image1 = reader_.List(links, "image1");
    const Json& image2 = reader_.Column(links, "image2", image1.size());
    const Json& num_points = reader_.Column(links, "num_points", image1.size());
    const Json& num_missing = reader_.Column(links, "num_missing", image1.size());
    const Json& length = reader_.Column(links, "length", image1.size());
    if (!reader_.complaint().empty()) return;
    const auto num_images = static_cast<int64_t>(verdict_.images.size());
    for (size_t l = 0; l < image1.size(); ++l) {
      verdict_.links.push_back({.image1 = reader_.Count(image1[l], "image1", num_images),
                                .image2 = reader_.Count(image2[l], "image2", num_images),
                                .num_points = reader_.Count(num_points[l], "num_points"),
                                .num_missing = reader_.Count(num_missing[l], "num_missing"),
                                .length = reader_.Length(length[l], "length")});
    }
  }

  void ParseLoops() {
    for (const Json& loop : reader_.List(json_, "loops")) {
      verdict_.loops.push_back({.image1 = Image(loop, "image1"),
                                .image2 = Image(loop, "image2"),
                                .num_points = Count(loop, "num_points"),
                                .way = reader_.Length(reader_.At(loop, "way"), "way")});
    }
    const Json& pairs = reader_.At(json_, "loop_pairs");
    const Json& image1 = reader_.List(pairs, "image1");
    const Json& image2 = reader_.Column(pairs, "image2", image1.size());
    const Json& num_points = reader_.Column(pairs, "num_points", image1.size());
    const Json& way = reader_.Column(pairs, "way", image1.size());
    if (!reader_.complaint().empty()) return;
    const auto num_images = static_cast<int64_t>(verdict_.images.size());
    for (size_t p = 0; p < image1.size(); ++p) {
      verdict_.loop_pairs.push_back({.image1 = reader_.Count(image1[p], "image1", num_images),
                                     .image2 = reader_.Count(image2[p], "image2", num_images),
                                     .num_points = reader_.Count(num_points[p], "num_points"),
                                     .way = reader_.Length(way[p], "way")});
    }
  }

  std::vector<int> Links(const char* key) {
    std::vector<int> links;
    for (const Json& link : reader_.List(json_, key)) {
      links.push_back(
          reader_.Count(reader_.At(link, "link"), "link", static_cast<int64_t>(verdict_.links.size())));
    }
    return links;
  }

  void ParseMissing() {
    for (const Json& missing : reader_.List(json_, "missing")) {
      const auto neighbour = [&](const char* key) {
        return missing.is_object() && missing.contains(key) && missing[key].is_null() ? -1
                                                                                      : Image(missing, key);
      };
      verdict_.missing.push_back({.name = Text(missing, "name"),
                                  .reason = Text(missing, "reason"),
                                  .before = neighbour("before"),
                                  .after = neighbour("after")});
    }
  }

  const Json& json_;
  Reader reader_;
  Verdict verdict_;
};

}  // namespace

nlohmann::ordered_json VerdictJson(const Verdict& verdict) {
  Json images = Columns({"name", "x", "y", "num_points"});
  for (const JoinedImage& image : verdict.images) {
    images["name"].push_back(image.name);
    images["x"].push_back(image.place.x());
    images["y"].push_back(image.place.y());
    images["num_points"].push_back(image.num_points);
  }
  Json links = Columns({"image1", "image2", "num_points", "num_missing", "length"});
  for (const ImageLink& link : verdict.links) {
    links["image1"].push_back(link.image1);
    links["image2"].push_back(link.image2);
    links["num_points"].push_back(link.num_points);
    links["num_missing"].push_back(link.num_missing);
    links["length"].push_back(link.length);
  }
  Json json = {{"text", WholeText(verdict)},
               {"is_whole", verdict.is_whole()},
               {"is_drive", verdict.is_drive},
               {"is_metric", verdict.is_metric},
               {"num_images", verdict.num_images()},
               {"num_joined", verdict.images.size()},
               {"num_parts", verdict.parts.size() + 1},
               {"way", verdict.way},
               {"median_step", verdict.median_step},
               {"loops", LoopsJson(verdict)},
               {"weak_links", LinksJson(verdict, verdict.weak_links)},
               {"long_steps", LinksJson(verdict, verdict.long_steps)},
               {"weak_images", Json::array()},
               {"open_stretches", Json::array()},
               {"parts", Json::array()},
               {"folders", Json::array()},
               {"missing", Json::array()}};
  for (const int i : verdict.weak_images) {
    json["weak_images"].push_back(
        {{"name", verdict.images[i].name}, {"num_points", verdict.images[i].num_points}, {"image", i}});
  }
  for (const OpenStretch& stretch : verdict.open_stretches) {
    json["open_stretches"].push_back({{"from", verdict.images[stretch.image1].name},
                                      {"to", verdict.images[stretch.image2].name},
                                      {"length", stretch.length},
                                      {"image1", stretch.image1},
                                      {"image2", stretch.image2}});
  }
  for (const SeparatePart& part : verdict.parts)
    json["parts"].push_back({{"num_images", part.num_images}, {"first", part.first}, {"last", part.last}});
  for (const Walk& walk : verdict.walks) {
    json["folders"].push_back({{"folder", walk.folder},
                               {"num_images", walk.num_images},
                               {"num_joined", walk.num_joined},
                               {"num_points_of_others", walk.num_points_of_others}});
  }
  for (const MissingImage& missing : verdict.missing) {
    json["missing"].push_back({{"name", missing.name},
                               {"reason", missing.reason},
                               {"before", IndexOrNull(missing.before)},
                               {"after", IndexOrNull(missing.after)}});
  }
  json["images"] = std::move(images);
  json["links"] = std::move(links);
  Json pairs = Columns({"image1", "image2", "num_points", "way"});
  for (const LoopPair& pair : verdict.loop_pairs) {
    pairs["image1"].push_back(pair.image1);
    pairs["image2"].push_back(pair.image2);
    pairs["num_points"].push_back(pair.num_points);
    pairs["way"].push_back(pair.way);
  }
  json["loop_pairs"] = std::move(pairs);
  return json;
}

Result<Verdict> ParseVerdict(const nlohmann::ordered_json& json) { return Parser(json).Parse(); }

}  // namespace cairn::reconstruct
