#include "stages/decompose_views/formats/dxf_plan.h"

#include <fnmatch.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/ranges.h>
#include <Eigen/Geometry>

#include "core/base/printable.h"
#include "core/base/text.h"
#include "core/geometry/pose.h"
#include "core/view_regions/derive_views.h"
#include "stages/decompose_views/formats/dxf_groups.h"

namespace cairn::decompose_views {
namespace {

using Vec2 = Eigen::Vector2d;

constexpr int kMaxBlockDepth = 32;  // of blocks in blocks
constexpr int64_t kMaxNumEntities = 2'000'000;

// Names of layers and blocks are the same in any case.
std::string LowerCase(std::string_view name) {
  std::string lower(name);
  std::transform(lower.begin(), lower.end(), lower.begin(), [](unsigned char c) { return std::tolower(c); });
  return lower;
}

struct Entity {
  std::string_view kind;
  int64_t line = 0;
  std::vector<DxfGroup> groups;

  const DxfGroup* Find(int code) const {
    const auto found =
        std::find_if(groups.begin(), groups.end(), [&](const DxfGroup& group) { return group.code == code; });
    return found == groups.end() ? nullptr : &*found;
  }
};

struct Layer {
  std::string name;
  bool is_frozen = false, is_off = false;
  int64_t num_walls = 0;
};

struct Block {
  std::string name;
  Vec2 base = Vec2::Zero();
  DxfPlace entities;
};

// Where an entity stands: in blocks, on the layer of the INSERT.
struct Setting {
  Eigen::Affine2d drawing_from_here = Eigen::Affine2d::Identity();
  Layer* inserted_on = nullptr;
  std::vector<const Block*> blocks;
};

struct BulgedPoint {
  Vec2 place = Vec2::Zero();
  double bulge = 0;  // of the arc to the next: the tangent of a quarter of its angle; 0: straight
};

class DxfReader {
 public:
  DxfReader(const std::string& text, const std::string& what, const DxfOptions& options)
      : text_(text), what_(what), options_(options), groups_(text, what) {
    for (const std::string& pattern : SplitFields(options.layers, ',')) {
      if (!pattern.empty()) patterns_.push_back(LowerCase(pattern));
    }
  }

  Result<DxfPlan> Run() {
    for (;;) {
      CAIRN_ASSIGN_OR_RETURN(const DxfGroup group, groups_.Next());
      if (group.Is(0, "EOF")) break;
      if (!group.Is(0, "SECTION"))
        return Corrupt(what_, "line {}: {:?} where a SECTION or the EOF is expected", group.line,
                       group.value.substr(0, 40));
      CAIRN_ASSIGN_OR_RETURN(const DxfGroup name, groups_.Next());
      CAIRN_RETURN_IF_ERROR(ReadSection(name.value));
    }
    return Finished();
  }

 private:
  Status ReadSection(std::string_view name) {
    if (name == "HEADER") return ReadHeader();
    if (name == "TABLES") return ReadLayers();
    if (name == "BLOCKS") return ReadBlocks();
    if (name == "ENTITIES") {
      CAIRN_RETURN_IF_ERROR(FindUnit());
      return ReadEntities(&groups_, "ENDSEC", Setting());
    }
    for (;;) {
      CAIRN_ASSIGN_OR_RETURN(const DxfGroup group, groups_.Next());
      if (group.Is(0, "ENDSEC")) return Ok();
    }
  }

  Status ReadHeader() {
    for (;;) {
      CAIRN_ASSIGN_OR_RETURN(const DxfGroup group, groups_.Next());
      if (group.Is(0, "ENDSEC")) return Ok();
      if (!group.Is(9, "$INSUNITS")) continue;
      CAIRN_ASSIGN_OR_RETURN(const DxfGroup value, groups_.Next());
      CAIRN_ASSIGN_OR_RETURN(insunits_, groups_.Integer(value));
      insunits_line_ = value.line;
    }
  }

  // AutoCAD's numbers of units.
  Status FindUnit() {
    if (options_.units != kUnitOfFile) {
      claim_ = {.unit = options_.units, .is_given = true};
      return Ok();
    }
    static const std::map<int, std::string> kUnits = {{1, "in"}, {2, "ft"}, {4, "mm"}, {5, "cm"}, {6, "m"}};
    if (insunits_ == 0) return Ok();  // as if it were in metres, if a building can have that size
    const auto unit = kUnits.find(insunits_);
    if (unit == kUnits.end()) {
      return MakeError(
          ErrorCode::kUnsupported,
          "{}: line {}: $INSUNITS is {}, none of 1 (in), 2 (ft), 4 (mm), 5 (cm), 6 (m) and 0 (not stated); "
          "say in which unit the drawing is by units (--units)",
          what_, insunits_line_, insunits_);
    }
    claim_ = {.unit = unit->second, .by = fmt::format("$INSUNITS = {}", insunits_)};
    return Ok();
  }

  // The groups up to the next entity.
  Result<Entity> Rest(DxfGroups* groups, const DxfGroup& first) {
    Entity entity{first.value, first.line, {}};
    if (++num_entities_ > kMaxNumEntities) {
      return MakeError(ErrorCode::kUnsupported,
                       "{}: line {}: more than {} entities, with those of inserted blocks", what_, first.line,
                       kMaxNumEntities);
    }
    for (;;) {
      const DxfPlace before = groups->place();
      CAIRN_ASSIGN_OR_RETURN(const DxfGroup group, groups->Next());
      if (group.code == 0) {
        groups->Return(before);
        return entity;
      }
      entity.groups.push_back(group);
    }
  }

  Status ReadLayers() {
    for (;;) {
      CAIRN_ASSIGN_OR_RETURN(const DxfGroup group, groups_.Next());
      if (group.Is(0, "ENDSEC")) return Ok();
      if (!group.Is(0, "LAYER")) continue;
      CAIRN_ASSIGN_OR_RETURN(const Entity entity, Rest(&groups_, group));
      CAIRN_ASSIGN_OR_RETURN(const int flags, IntegerOf(entity, 70));
      CAIRN_ASSIGN_OR_RETURN(const int colour, IntegerOf(entity, 62));
      Layer* layer = LayerOf(entity.Find(2) == nullptr ? "0" : entity.Find(2)->value);
      layer->is_frozen = (flags & 1) != 0;
      layer->is_off = colour < 0;
    }
  }

  Layer* LayerOf(std::string_view name) {
    Layer& layer = layers_[LowerCase(name)];
    if (layer.name.empty()) layer.name = Printable(name);
    return &layer;
  }

  Status ReadBlocks() {
    for (;;) {
      CAIRN_ASSIGN_OR_RETURN(const DxfGroup group, groups_.Next());
      if (group.Is(0, "ENDSEC")) return Ok();
      if (!group.Is(0, "BLOCK")) continue;
      CAIRN_ASSIGN_OR_RETURN(const Entity entity, Rest(&groups_, group));
      Block block;
      if (entity.Find(2) != nullptr) block.name = entity.Find(2)->value;
      CAIRN_ASSIGN_OR_RETURN(block.base, PointOf(entity, 10));
      block.entities = groups_.place();
      blocks_[LowerCase(block.name)] = block;
    }
  }

  // Entities up to `0 end`.
  Status ReadEntities(DxfGroups* groups, std::string_view end, const Setting& setting) {
    for (;;) {
      CAIRN_ASSIGN_OR_RETURN(const DxfGroup group, groups->Next());
      if (group.Is(0, end)) return Ok();
      if (group.code != 0 || group.value == "EOF" || group.value == "SECTION" || group.value == "ENDSEC")
        return Corrupt(what_, "line {}: {:?} where an entity or {} is expected", group.line,
                       group.value.substr(0, 40), end);
      CAIRN_ASSIGN_OR_RETURN(const Entity entity, Rest(groups, group));
      std::vector<Entity> vertices;
      while (entity.kind == "POLYLINE") {
        CAIRN_ASSIGN_OR_RETURN(const DxfGroup next, groups->Next());
        CAIRN_ASSIGN_OR_RETURN(Entity vertex, Rest(groups, next));
        if (vertex.kind == "SEQEND") break;
        if (vertex.kind != "VERTEX") {
          return Corrupt(what_,
                         "line {}: {:?} in the POLYLINE of line {}, where a VERTEX or SEQEND is expected",
                         vertex.line, vertex.kind.substr(0, 40), entity.line);
        }
        vertices.push_back(std::move(vertex));
      }
      CAIRN_RETURN_IF_ERROR(ReadEntity(entity, vertices, setting));
    }
  }

  Status ReadEntity(const Entity& entity, const std::vector<Entity>& vertices, const Setting& setting) {
    static const std::vector<std::string_view> kNoWalls = {"ATTRIB", "SEQEND", "VIEWPORT"};
    if (std::find(kNoWalls.begin(), kNoWalls.end(), entity.kind) != kNoWalls.end()) return Ok();
    CAIRN_ASSIGN_OR_RETURN(const int in_paper_space, IntegerOf(entity, 67));
    CAIRN_ASSIGN_OR_RETURN(const int is_invisible, IntegerOf(entity, 60));
    if (in_paper_space != 0 || is_invisible != 0) return Ok();
    CAIRN_ASSIGN_OR_RETURN(const Vec2 normal, PointOf(entity, 210));
    CAIRN_ASSIGN_OR_RETURN(const double normal_z, NumberOf(entity, 230, 1));
    const bool is_line = entity.kind == "LINE";  // the only one that is not in the plane of its normal
    if (!is_line && normal.norm() > 1e-6 * std::abs(normal_z)) {
      LeaveOut(Printable(entity.kind) + " that lies aslant");
      return Ok();
    }
    const DxfGroup* layer_name = entity.Find(8);
    layer_ = LayerOf(layer_name == nullptr ? "0" : layer_name->value);
    if (layer_->name == "0" && setting.inserted_on != nullptr) layer_ = setting.inserted_on;
    line_ = entity.line;
    from_entity_ = setting.drawing_from_here;
    if (!is_line && normal_z < 0) from_entity_.scale(Vec2(-1, 1));
    if (entity.kind == "INSERT") return Insert(entity, setting.blocks);
    if (is_line) return AddLine(entity);
    if (entity.kind == "LWPOLYLINE") return AddLightPolyline(entity);
    if (entity.kind == "POLYLINE") return AddPolyline(entity, vertices);
    if (entity.kind == "ARC" || entity.kind == "CIRCLE") return AddArc(entity);
    LeaveOut(Printable(entity.kind));
    return Ok();
  }

  // Whether an entity's layer counts.
  bool IsTaken(const Layer& layer) const {
    if (patterns_.empty()) return !layer.is_frozen && !layer.is_off;
    const std::string name = LowerCase(layer.name);
    return std::any_of(patterns_.begin(), patterns_.end(), [&](const std::string& pattern) {
      return fnmatch(pattern.c_str(), name.c_str(), 0) == 0;
    });
  }

  void LeaveOut(const std::string& kind) {
    constexpr size_t kMostKinds = 30;
    ++left_out_[left_out_.size() < kMostKinds || left_out_.contains(kind) ? kind : "others"];
  }

  // `blocks`: those in which it stands.
  Status Insert(const Entity& entity, const std::vector<const Block*>& blocks) {
    if (patterns_.empty() && layer_->is_frozen) return Ok();
    const std::string name(entity.Find(2) == nullptr ? "" : entity.Find(2)->value);
    const auto found = blocks_.find(LowerCase(name));
    if (found == blocks_.end())
      return Corrupt(what_, "line {}: inserts a block {:?}, which is not there", entity.line, name);
    const Block& block = found->second;
    if (std::find(blocks.begin(), blocks.end(), &block) != blocks.end())
      return Corrupt(what_, "line {}: the block {:?} is inserted in itself", entity.line, name);
    if (std::ssize(blocks) >= kMaxBlockDepth)
      return Corrupt(what_, "line {}: blocks in blocks, more than {} deep", entity.line, kMaxBlockDepth);
    CAIRN_ASSIGN_OR_RETURN(const Vec2 place, PointOf(entity, 10));
    CAIRN_ASSIGN_OR_RETURN(const double scale_x, NumberOf(entity, 41, 1));
    CAIRN_ASSIGN_OR_RETURN(const double scale_y, NumberOf(entity, 42, 1));
    CAIRN_ASSIGN_OR_RETURN(const double turn_deg, NumberOf(entity, 50, 0));
    CAIRN_ASSIGN_OR_RETURN(const double column_step, NumberOf(entity, 44, 0));
    CAIRN_ASSIGN_OR_RETURN(const double row_step, NumberOf(entity, 45, 0));
    CAIRN_ASSIGN_OR_RETURN(const int num_columns, IntegerOf(entity, 70));
    CAIRN_ASSIGN_OR_RETURN(const int num_rows, IntegerOf(entity, 71));
    const Eigen::Affine2d from_entity = from_entity_;
    Setting inside{from_entity, layer_, blocks};
    inside.blocks.push_back(&block);
    for (int row = 0; row < std::max(1, num_rows); ++row) {
      for (int column = 0; column < std::max(1, num_columns); ++column) {
        inside.drawing_from_here = from_entity;
        inside.drawing_from_here.translate(place);
        inside.drawing_from_here.rotate(RadFromDeg(turn_deg));
        inside.drawing_from_here.translate(Vec2(column * column_step, row * row_step));
        inside.drawing_from_here.scale(Vec2(scale_x, scale_y));
        inside.drawing_from_here.translate(-block.base);
        DxfGroups groups(text_, what_, block.entities);
        if (++num_entities_ > kMaxNumEntities) {
          return MakeError(ErrorCode::kUnsupported,
                           "{}: line {}: more than {} entities, with those of inserted blocks", what_,
                           entity.line, kMaxNumEntities);
        }
        CAIRN_RETURN_IF_ERROR(ReadEntities(&groups, "ENDBLK", inside));
      }
    }
    return Ok();
  }

  Status AddLine(const Entity& entity) {
    CAIRN_ASSIGN_OR_RETURN(const Vec2 start, PointOf(entity, 10));
    CAIRN_ASSIGN_OR_RETURN(const Vec2 end, PointOf(entity, 11));
    return AddWall(start, end);
  }

  Status AddLightPolyline(const Entity& entity) {
    std::vector<BulgedPoint> points;
    for (const DxfGroup& group : entity.groups) {
      if (group.code == 10) points.emplace_back();
      if (points.empty() || (group.code != 10 && group.code != 20 && group.code != 42)) continue;
      CAIRN_ASSIGN_OR_RETURN(const double value, groups_.Number(group));
      BulgedPoint& point = points.back();
      (group.code == 10 ? point.place.x() : group.code == 20 ? point.place.y() : point.bulge) = value;
    }
    CAIRN_ASSIGN_OR_RETURN(const int flags, IntegerOf(entity, 70));
    return AddPoints(points, (flags & 1) != 0);
  }

  Status AddPolyline(const Entity& entity, const std::vector<Entity>& vertices) {
    constexpr int kClosed = 1, kMesh = 16, kPolyface = 64, kFrameOfSpline = 16;
    CAIRN_ASSIGN_OR_RETURN(const int flags, IntegerOf(entity, 70));
    if ((flags & (kMesh | kPolyface)) != 0) {
      LeaveOut("POLYLINE of faces");
      return Ok();
    }
    std::vector<BulgedPoint> points;
    for (const Entity& vertex : vertices) {
      CAIRN_ASSIGN_OR_RETURN(const int vertex_flags, IntegerOf(vertex, 70));
      if ((vertex_flags & kFrameOfSpline) != 0) continue;
      BulgedPoint point;
      CAIRN_ASSIGN_OR_RETURN(point.place, PointOf(vertex, 10));
      CAIRN_ASSIGN_OR_RETURN(point.bulge, NumberOf(vertex, 42, 0));
      points.push_back(point);
    }
    return AddPoints(points, (flags & kClosed) != 0);
  }

  Status AddPoints(const std::vector<BulgedPoint>& points, bool is_closed) {
    for (size_t i = 0; i + (is_closed ? 0 : 1) < points.size(); ++i) {
      const Vec2 start = points[i].place, end = points[(i + 1) % points.size()].place;
      const double bulge = points[i].bulge;
      constexpr double kStraight = 1e-9;
      if (std::abs(bulge) < kStraight || start == end) {
        CAIRN_RETURN_IF_ERROR(AddWall(start, end));
        continue;
      }
      const Vec2 chord = end - start;
      const Vec2 centre =
          0.5 * (start + end) + (1 - bulge * bulge) / (4 * bulge) * Vec2(-chord.y(), chord.x());
      CAIRN_RETURN_IF_ERROR(AddChords(centre, start, end, 4 * std::atan(bulge)));
    }
    return Ok();
  }

  Status AddArc(const Entity& entity) {
    CAIRN_ASSIGN_OR_RETURN(const Vec2 centre, PointOf(entity, 10));
    CAIRN_ASSIGN_OR_RETURN(const double radius, NumberOf(entity, 40, 0));
    if (!(radius > 0))
      return Corrupt(what_, "line {}: {} with the radius {:g}", entity.line, entity.kind, radius);
    double first_deg = 0, turn_deg = 360;
    if (entity.kind == "ARC") {
      CAIRN_ASSIGN_OR_RETURN(first_deg, NumberOf(entity, 50, 0));
      CAIRN_ASSIGN_OR_RETURN(const double last_deg, NumberOf(entity, 51, 360));
      turn_deg = std::fmod(last_deg - first_deg, 360);
      if (turn_deg <= 0) turn_deg += 360;
    }
    const auto at = [&](double deg) {
      return Vec2(centre + radius * Vec2(std::cos(RadFromDeg(deg)), std::sin(RadFromDeg(deg))));
    };
    const Vec2 start = at(first_deg);
    return AddChords(centre, start, turn_deg == 360 ? start : at(first_deg + turn_deg), RadFromDeg(turn_deg));
  }

  // Chords of the arc around `centre` from start to end, counter-clockwise where `turn_rad` > 0.
  Status AddChords(const Vec2& centre, const Vec2& start, const Vec2& end, double turn_rad) {
    // The largest factor by which lengths grow: the singular value of the linear part.
    const Eigen::Matrix2d linear = from_entity_.linear();
    const double squares = linear.squaredNorm(), det = linear.determinant();
    const double growth =
        std::sqrt(0.5 * (squares + std::sqrt(std::max(0.0, squares * squares - 4 * det * det))));
    const double radius_m = (start - centre).norm() * growth * MetresOf(claim_.unit);
    // A chord over the angle a lies r (1 - cos(a / 2)) beside its arc.
    const double most_rad = std::min(std::numbers::pi / 2,
                                     2 * std::acos(std::max(0.0, 1 - options_.curve_tolerance_m / radius_m)));
    const double num = std::ceil(std::abs(turn_rad) / most_rad - 1e-9);
    if (!(num <= static_cast<double>(kMaxNumDividedWalls))) return TooManyWalls();
    const int num_chords = std::max(1, static_cast<int>(num));
    Vec2 before = start;
    for (int i = 1; i <= num_chords; ++i) {
      const Eigen::Rotation2Dd turn(turn_rad * i / num_chords);
      const Vec2 next = i == num_chords ? end : Vec2(centre + turn * (start - centre));
      CAIRN_RETURN_IF_ERROR(AddWall(before, next));
      before = next;
    }
    return Ok();
  }

  Error TooManyWalls() const {
    return MakeError(
        ErrorCode::kUnsupported,
        "{}: line {}: more than {} walls, and more are not divided; choose the layers that have walls "
        "(--layers), or a larger --curve-tolerance-m",
        what_, line_, kMaxNumDividedWalls);
  }

  Status AddWall(const Vec2& start, const Vec2& end) {
    const double metres = MetresOf(claim_.unit);
    const InputSegment wall{metres * (from_entity_ * start), metres * (from_entity_ * end),
                            static_cast<int>(line_)};
    if (!(std::max(wall.start.cwiseAbs().maxCoeff(), wall.end.cwiseAbs().maxCoeff()) <= kMaxCoordinateM))
      return Corrupt(what_, "line {}: an end lies beyond {:g} m", line_, kMaxCoordinateM);
    ++layer_->num_walls;
    if (!IsTaken(*layer_)) return Ok();
    plan_.segments.push_back(wall);
    return std::ssize(plan_.segments) > kMaxNumDividedWalls ? Status(TooManyWalls()) : Ok();
  }

  // Layers that have walls, those with the most first.
  std::string LayersText(bool taken) const {
    std::vector<const Layer*> layers;
    for (const auto& [name, layer] : layers_) {
      if (layer.num_walls > 0 && IsTaken(layer) == taken) layers.push_back(&layer);
    }
    std::stable_sort(layers.begin(), layers.end(),
                     [](const Layer* a, const Layer* b) { return a->num_walls > b->num_walls; });
    constexpr size_t kMostNamed = 30;
    std::vector<std::string> texts;
    for (const Layer* layer : layers) {
      if (texts.size() == kMostNamed) {
        texts.push_back(fmt::format("{} more", layers.size() - kMostNamed));
        break;
      }
      texts.push_back(fmt::format("{} {}", layer->name, layer->num_walls));
    }
    return fmt::format("{}", fmt::join(texts, ", "));
  }

  Result<DxfPlan> Finished() {
    const std::string taken = LayersText(true), others = LayersText(false);
    if (plan_.segments.empty()) {
      if (!others.empty()) {
        return MakeError(ErrorCode::kNoData, "{}: no walls {}; there are, by layer: {}", what_,
                         patterns_.empty() ? "on layers that are neither off nor frozen"
                                           : fmt::format("on layers {:?}", options_.layers),
                         others);
      }
      return MakeError(ErrorCode::kNoData,
                       "{}: no walls in its model space: no LINE, LWPOLYLINE, POLYLINE, ARC or CIRCLE{}",
                       what_, left_out_.empty() ? "" : "; there are " + LeftOutText());
    }
    plan_.notes.push_back(
        "walls by layer: " + taken +
        (patterns_.empty() && taken.find(',') != std::string::npos ? "; --layers chooses" : ""));
    if (!others.empty()) {
      plan_.notes.push_back(fmt::format(
          "{}: {}", patterns_.empty() ? "left out, as their layers are off or frozen" : "on other layers",
          others));
    }
    if (!left_out_.empty()) plan_.notes.push_back("left out, as they are not read: " + LeftOutText());
    return DxfPlan{std::move(plan_), claim_};
  }

  std::string LeftOutText() const {
    std::vector<std::string> texts;
    for (const auto& [kind, num] : left_out_) texts.push_back(fmt::format("{} {}", num, kind));
    return fmt::format("{}", fmt::join(texts, ", "));
  }

  // x and y: groups `code` and `code` + 10; (0, 0) where they are missing.
  Result<Vec2> PointOf(const Entity& entity, int code) const {
    CAIRN_ASSIGN_OR_RETURN(const double x, NumberOf(entity, code, 0));
    CAIRN_ASSIGN_OR_RETURN(const double y, NumberOf(entity, code + 10, 0));
    return Vec2(x, y);
  }
  Result<double> NumberOf(const Entity& entity, int code, double otherwise) const {
    const DxfGroup* group = entity.Find(code);
    return group == nullptr ? Result<double>(otherwise) : groups_.Number(*group);
  }
  Result<int> IntegerOf(const Entity& entity, int code) const {
    const DxfGroup* group = entity.Find(code);
    return group == nullptr ? Result<int>(0) : groups_.Integer(*group);
  }

  const std::string& text_;
  const std::string& what_;
  const DxfOptions& options_;
  DxfGroups groups_;
  std::vector<std::string> patterns_;
  int insunits_ = 0;
  int64_t insunits_line_ = 0;
  UnitClaim claim_;
  std::map<std::string, Layer> layers_;
  std::map<std::string, Block> blocks_;
  int64_t num_entities_ = 0;
  std::map<std::string, int64_t> left_out_;
  // The entity that walls come from.
  Layer* layer_ = nullptr;
  int64_t line_ = 0;
  Eigen::Affine2d from_entity_ = Eigen::Affine2d::Identity();
  InputPlan plan_;
};

}  // namespace

bool LooksLikeDxf(const std::string& text) {
  static const std::string kNobody;
  DxfGroups groups(text, kNobody);
  const Result<DxfGroup> first = groups.Next();
  return first.ok() && first->Is(0, "SECTION");
}

Result<DxfPlan> ParseDxf(const std::string& text, const std::string& what, const DxfOptions& options) {
  return DxfReader(text, what, options).Run();
}

}  // namespace cairn::decompose_views
