#include "stages/decompose_views/plan/read_plan.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <utility>

#include "core/base/text.h"
#include "core/files/file.h"
#include "stages/decompose_views/formats/dxf_plan.h"
#include "stages/decompose_views/formats/geojson_plan.h"
#include "stages/decompose_views/formats/occupancy_grid.h"

namespace cairn::decompose_views {
namespace {

constexpr uintmax_t kMaxFileBytes = uintmax_t{1} << 29;

Result<InputPlan> ParseSegments(const std::string& text, const std::string& what) {
  InputPlan plan;
  int number = 0;
  for (const std::string_view line : SplitLines(text)) {
    ++number;
    const std::string_view trimmed = Trim(line);
    if (trimmed.empty() || trimmed[0] == '#') continue;
    const std::vector<double> values = ParseNumbers(trimmed).value_or(std::vector<double>());
    const bool is_near =
        std::all_of(values.begin(), values.end(), [](double v) { return std::abs(v) <= kMaxCoordinateM; });
    if (values.size() != 4 || !is_near) {
      return Corrupt(
          what,
          "line {}: {:?} is not x0,y0,x1,y1 in metres (four finite numbers up to {:g}); other plans are "
          "GeoJSON, DXF, or the YAML file of a ROS map, named .yaml",
          number, trimmed.substr(0, 80), kMaxCoordinateM);
    }
    plan.segments.push_back({{values[0], values[1]}, {values[2], values[3]}, number});
  }
  if (plan.segments.empty()) {
    return MakeError(
        ErrorCode::kNoData,
        "{}: no walls in it; expected lines x0,y0,x1,y1, GeoJSON, DXF, or the YAML file of a ROS map", what);
  }
  return plan;
}

// What files that are often taken for plans are; empty: none of these.
std::string KnownOtherKind(const std::string& text) {
  const auto is_dwg = [&] {
    return text.size() >= 6 && text.starts_with("AC10") &&
           std::isdigit(static_cast<unsigned char>(text[4])) != 0;
  };
  if (text.starts_with("AutoCAD Binary DXF")) return "binary DXF, which is not read; save it as ASCII DXF";
  if (is_dwg())
    return "DWG, which is not read; save it as ASCII DXF, as with LibreCAD or ODA's File Converter";
  if (text.starts_with("\x89PNG") || text.starts_with("P5") || text.starts_with("P2"))
    return "an image, which does not say how large its cells are; name the map's YAML file that names it";
  if (text.starts_with("%PDF")) return "PDF, which is not read; export DXF or GeoJSON";
  if (text.starts_with("ISO-10303-21")) return "IFC (STEP), which is not read; export DXF";
  return "";
}

bool IsOccupancyGrid(const std::string& path) {
  const std::string suffix = std::filesystem::path(path).extension().string();
  return suffix == ".yaml" || suffix == ".yml";
}

Status CheckReadOptions(const ReadPlanOptions& options) {
  ReadPlanOptions checked = options;
  return CheckOptions(DescribeOptions(&checked));
}

Error NoLayers(const std::string& what, const std::string& kind) {
  return MakeError(ErrorCode::kInvalidArgument, "{}: layers: {} has none; leave the option out", what, kind);
}

}  // namespace

OptionTable DescribeOptions(ReadPlanOptions* o) {
  return {
      {.name = "units",
       .value = &o->units,
       .help = "unit of the plan's coordinates; auto: what a DXF says, else metres, refused where a building "
               "cannot "
               "have that size",
       .choices = PlanUnits()},
      {.name = "layers",
       .value = &o->layers,
       .help = "DXF: layers that have walls, between commas, with * and ? as in names of files; empty: all "
               "that are "
               "neither off nor frozen"},
      {.name = "curve_tolerance_m",
       .value = &o->curve_tolerance_m,
       .help = "DXF: how far a chord that stands for a part of an arc may lie beside it, metres",
       .min = 1e-4,
       .max = 10},
      {.name = "min_blob_m",
       .value = &o->grid.min_blob_m,
       .help = "ROS maps: groups of occupied cells that extend no farther than this are left out, and gaps "
               "as small "
               "within walls filled, metres",
       .min = 0,
       .max = 100},
      {.name = "thin_wall_m",
       .value = &o->grid.thin_wall_m,
       .help = "ROS maps: walls up to this thick become one line in their middle, thicker ones their faces, "
               "metres",
       .min = 0,
       .max = 10},
      {.name = "trace_tolerance_cells",
       .value = &o->grid.trace_tolerance_cells,
       .help = "ROS maps: how far a wall's cells may lie beside its line, in cells",
       .min = 0.5,
       .max = 10},
  };
}

Result<InputPlan> ParsePlan(const std::string& text, const std::string& what,
                            const ReadPlanOptions& options) {
  CAIRN_RETURN_IF_ERROR(CheckReadOptions(options));
  if (const std::string kind = KnownOtherKind(text); !kind.empty())
    return MakeError(ErrorCode::kUnsupported, "{}: {}", what, kind);
  InputPlan plan;
  UnitClaim claim;
  const bool is_told = options.units != kUnitOfFile;
  if (is_told) claim = {.unit = options.units, .is_given = true};
  if (LooksLikeDxf(text)) {
    CAIRN_ASSIGN_OR_RETURN(DxfPlan drawing,
                           ParseDxf(text, what, {options.units, options.layers, options.curve_tolerance_m}));
    plan = std::move(drawing.plan);
    claim = drawing.claim;
  } else if (Trim(text).starts_with('{')) {
    if (!options.layers.empty()) return NoLayers(what, "GeoJSON");
    CAIRN_ASSIGN_OR_RETURN(GeoJsonPlan geo, ParseGeoJson(text, what));
    plan = std::move(geo.plan);
    if (!is_told && !geo.crs_of_degrees.empty())
      claim.degrees_by = fmt::format("\"crs\": {}", geo.crs_of_degrees.substr(0, 80));
    ScalePlan(MetresOf(claim.unit), &plan);
  } else {
    if (!options.layers.empty()) return NoLayers(what, "a list of lines x0,y0,x1,y1");
    CAIRN_ASSIGN_OR_RETURN(plan, ParseSegments(text, what));
    ScalePlan(MetresOf(claim.unit), &plan);
  }
  CAIRN_RETURN_IF_ERROR(CheckPlanSize(plan, claim, what));
  return plan;
}

Result<InputPlan> ReadPlan(const std::string& path, const ReadPlanOptions& options) {
  if (!IsOccupancyGrid(path)) {
    std::error_code error;
    if (const uintmax_t num_bytes = std::filesystem::file_size(path, error);
        !error && num_bytes > kMaxFileBytes) {
      return MakeError(ErrorCode::kUnsupported,
                       "{}: {} bytes, at most {} are read; divide the plan by buildings and floors", path,
                       num_bytes, kMaxFileBytes);
    }
    CAIRN_ASSIGN_OR_RETURN(const std::string text, ReadFile(path));
    return ParsePlan(text, path, options);
  }
  CAIRN_RETURN_IF_ERROR(CheckReadOptions(options));
  if (!options.layers.empty()) return NoLayers(path, "a ROS map");
  if (options.units != kUnitOfFile && options.units != "m") {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: units: a ROS map's resolution is in metres a cell; leave the option out", path);
  }
  CAIRN_ASSIGN_OR_RETURN(const OccupancyGrid grid, ReadOccupancyGrid(path));
  Result<std::vector<InputSegment>> walls = TraceGridWalls(grid, options.grid);
  if (!walls.ok()) return MakeError(walls.error().code, "{}: {}", path, walls.error().message);
  InputPlan plan;
  plan.segments = std::move(*walls);
  plan.notes.push_back(fmt::format("a ROS map of {} x {} cells of {:g} m: {} walls", grid.cells.cols,
                                   grid.cells.rows, grid.resolution_m, plan.segments.size()));
  return plan;
}

std::vector<std::string> OtherFilesOfPlan(const std::string& path) {
  if (!IsOccupancyGrid(path)) return {};
  const Result<std::string> image = ImageOfOccupancyGrid(path);
  std::error_code error;
  if (!image.ok() || !std::filesystem::is_regular_file(*image, error)) return {};
  return {*image};
}

}  // namespace cairn::decompose_views
