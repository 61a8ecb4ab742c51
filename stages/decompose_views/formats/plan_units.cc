#include "stages/decompose_views/formats/plan_units.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string_view>
#include <utility>

#include "core/base/quantiles.h"

namespace cairn::decompose_views {
namespace {

using Vec2 = Eigen::Vector2d;

constexpr double kMinExtentM = 0.1;
constexpr double kMaxExtentTimesWallM2 = 20000;

constexpr std::array<std::pair<std::string_view, double>, 5> kUnits = {
    {{"m", 1}, {"cm", 0.01}, {"mm", 0.001}, {"in", 0.0254}, {"ft", 0.3048}}};

// Of a plan's numbers.
struct PlanSize {
  Vec2 low = Vec2::Zero(), high = Vec2::Zero();
  double median_wall = 0;

  double Extent() const { return (high - low).maxCoeff(); }
};

PlanSize SizeOf(const InputPlan& plan) {
  std::vector<InputSegment> walls = plan.segments;
  for (const std::vector<Vec2>& ring : plan.rings) {
    for (size_t i = 0; i < ring.size(); ++i) walls.push_back({ring[i], ring[(i + 1) % ring.size()]});
  }
  PlanSize size;
  if (walls.empty()) return size;
  size.low = size.high = walls[0].start;
  std::vector<double> lengths;
  for (const InputSegment& wall : walls) {
    size.low = size.low.cwiseMin(wall.start).cwiseMin(wall.end);
    size.high = size.high.cwiseMax(wall.start).cwiseMax(wall.end);
    if (wall.start != wall.end) lengths.push_back((wall.end - wall.start).norm());
  }
  if (lengths.empty()) return size;
  size.median_wall = UpperMedian(std::move(lengths));
  return size;
}

// A length to three digits.
std::string Short(double metres) {
  return metres >= 100 ? fmt::format("{:.0f} m", metres) : fmt::format("{:.3g} m", metres);
}

std::string SizeText(const PlanSize& size, double metres) {
  const Vec2 extent = metres * (size.high - size.low);
  return fmt::format("{} x {}, walls of {} (median)", Short(extent.x()), Short(extent.y()),
                     Short(metres * size.median_wall));
}

bool LookLikeDegrees(const PlanSize& size) {
  constexpr double kMaxLongitude = 180, kMaxLatitude = 90;
  return size.low.x() >= -kMaxLongitude && size.high.x() <= kMaxLongitude && size.low.y() >= -kMaxLatitude &&
         size.high.y() <= kMaxLatitude;
}

// The command that brings degrees into metres: UTM's zone there.
std::string ReprojectText(const PlanSize& size) {
  const Vec2 middle = 0.5 * (size.low + size.high);
  const int zone = std::clamp(static_cast<int>(std::floor((middle.x() + 180) / 6)) + 1, 1, 60);
  constexpr double kMetresOfDegree = 111320;
  const double shrink = std::cos(middle.y() * std::numbers::pi / 180);
  const Vec2 extent = kMetresOfDegree * (size.high - size.low).cwiseProduct(Vec2(shrink, 1));
  return fmt::format(
      "as longitude and latitude {} x {} near ({:.5f}, {:.5f}); plans are plane metres: reproject it, as "
      "with `ogr2ogr "
      "-t_srs EPSG:{} metres.geojson FILE`",
      Short(extent.x()), Short(extent.y()), middle.x(), middle.y(), (middle.y() < 0 ? 32700 : 32600) + zone);
}

// The units in which a building can have this size, and what it is then; empty where none fits.
std::string FittingUnitsText(const PlanSize& size) {
  constexpr double kLeastM = 2, kMostM = 2000, kMostWallM = 50;
  std::string text;
  for (const auto& [unit, metres] : kUnits) {
    const double extent = metres * size.Extent(), wall = metres * size.median_wall;
    if (extent < kLeastM || extent > kMostM || wall > kMostWallM) continue;
    text += fmt::format("{}{}: {}", text.empty() ? "" : "; ", unit, SizeText(size, metres));
  }
  return text;
}

}  // namespace

std::vector<std::string> PlanUnits() {
  std::vector<std::string> units = {kUnitOfFile};
  for (const auto& [unit, metres] : kUnits) units.emplace_back(unit);
  return units;
}

double MetresOf(const std::string& unit) {
  return std::find_if(kUnits.begin(), kUnits.end(), [&](const auto& known) { return known.first == unit; })
      ->second;
}

void ScalePlan(double factor, InputPlan* plan) {
  if (factor == 1) return;
  for (std::vector<Vec2>& ring : plan->rings) {
    for (Vec2& point : ring) point *= factor;
  }
  for (InputSegment& segment : plan->segments) {
    segment.start *= factor;
    segment.end *= factor;
  }
}

Status CheckPlanSize(const InputPlan& plan, const UnitClaim& claim, const std::string& what) {
  const double metres = MetresOf(claim.unit);
  PlanSize size = SizeOf(plan);  // of the file's numbers
  size.low /= metres;
  size.high /= metres;
  size.median_wall /= metres;
  const double extent_m = metres * size.Extent(), wall_m = metres * size.median_wall;
  if (size.median_wall == 0) return Ok();  // cleaning says that there is no wall
  const std::string anyway =
      claim.is_given
          ? ""
          : fmt::format("; if it is right so, give units = {:?} (--units {})", claim.unit, claim.unit);
  const bool is_small = extent_m < kMinExtentM, is_claimed = claim.is_given || !claim.by.empty();
  if (!claim.degrees_by.empty() || (is_small && !is_claimed && LookLikeDegrees(size))) {
    const Vec2 extent = size.high - size.low;
    return MakeError(ErrorCode::kUnsupported, "{}: coordinates in degrees ({}): {:.3g} x {:.3g}, {}{}", what,
                     claim.degrees_by.empty() ? "by their size" : claim.degrees_by, extent.x(), extent.y(),
                     ReprojectText(size), anyway);
  }
  if (!is_small && (claim.is_given || extent_m * wall_m <= kMaxExtentTimesWallM2)) return Ok();
  const std::string by = claim.is_given     ? "as units says"
                         : claim.by.empty() ? "the file does not say in which unit"
                                            : claim.by;
  const std::string fitting = FittingUnitsText(size);
  return MakeError(ErrorCode::kUnsupported, "{}: no building has this size: in {} ({}) it has {}{}{}", what,
                   claim.unit, by, SizeText(size, metres),
                   fitting.empty() ? "" : "; say its unit by units (--units), " + fitting, anyway);
}

}  // namespace cairn::decompose_views
