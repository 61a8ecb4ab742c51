// [Sala06 Fig. 9, Fig. 10] The visibility areas of a lattice survey's features, before the filter and after
// it: their sizes, their holes, a histogram and a few of them as pictures.
//
//   survey_areas CLASSES.db WORLD.db FOLDER
//
// FOLDER gets areas.csv (a line for each feature class), fig9.svg and fig10.svg.
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <map>
#include <numeric>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "core/base/quantiles.h"
#include "core/files/file.h"
#include "core/picture/svg.h"
#include "core/world/feature_class.h"
#include "core/world/world.h"
#include "stages/filter_visibility/lattice_area.h"

namespace cairn {
namespace {

using filter_visibility::HoleSizes;
using filter_visibility::Stations;

struct Arguments {
  std::string classes, world, folder;
  int min_num_stations = 16;  // the source's
};

struct Areas {
  std::vector<ClassId> class_ids;
  std::vector<std::vector<StationIdx>> areas;
};

// Where each class was observed, and nothing left out but classes that fewer stations see.
Areas AreasBefore(const Classes& classes, const Stations& stations, int min_num_stations) {
  Areas before;
  for (const FeatureClass& each : classes.classes) {
    std::vector<StationIdx> area;
    for (const Observation& observation : each.observations)
      area.push_back(stations.station_of_image.at(observation.image_id));
    std::sort(area.begin(), area.end());
    area.erase(std::unique(area.begin(), area.end()), area.end());
    if (static_cast<int>(area.size()) < min_num_stations) continue;
    before.class_ids.push_back(each.class_id);
    before.areas.push_back(std::move(area));
  }
  return before;
}

std::vector<double> SizesOf(const Areas& areas) {
  std::vector<double> sizes;
  for (const std::vector<StationIdx>& area : areas.areas) sizes.push_back(static_cast<double>(area.size()));
  return sizes;
}

void PrintLine(const char* name, const Areas& areas, const Stations& stations) {
  const std::vector<double> sizes = SizesOf(areas);
  int64_t num_holes = 0, num_in_holes = 0;
  int num_with = 0;
  for (const std::vector<StationIdx>& area : areas.areas) {
    const std::vector<int> holes = HoleSizes(area, stations);
    num_with += !holes.empty();
    num_holes += static_cast<int64_t>(holes.size());
    num_in_holes += std::accumulate(holes.begin(), holes.end(), int64_t{0});
  }
  const auto count = static_cast<double>(std::max<size_t>(sizes.size(), 1));
  fmt::print("{},{},{:.1f},{},{},{:.3f},{:.2f}\n", name, sizes.size(),
             std::accumulate(sizes.begin(), sizes.end(), 0.0) / count,
             sizes.empty() ? 0.0 : UpperMedian(sizes), num_with, static_cast<double>(num_holes) / count,
             num_holes > 0 ? static_cast<double>(num_in_holes) / static_cast<double>(num_holes) : 0.0);
}

std::string Csv(const Areas& before, const Areas& after, const Stations& stations) {
  std::map<ClassId, size_t> size_after;
  for (size_t i = 0; i < after.class_ids.size(); ++i) size_after[after.class_ids[i]] = after.areas[i].size();
  std::string csv = "class,stations,holes,stations_in_holes,stations_after\n";
  for (size_t i = 0; i < before.class_ids.size(); ++i) {
    const std::vector<int> holes = HoleSizes(before.areas[i], stations);
    csv += fmt::format("{},{},{},{},{}\n", before.class_ids[i], before.areas[i].size(), holes.size(),
                       std::accumulate(holes.begin(), holes.end(), 0), size_after[before.class_ids[i]]);
  }
  return csv;
}

std::string Text(double x, double y, const std::string& text, const char* anchor = "start") {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\">{}</text>\n", x, y, anchor,
                     EscapeXml(text));
}

// [Sala06 Fig. 9] Areas of features at even steps of size, on the lattice: what stays after the filter is
// dark.
std::string AreasPicture(const Areas& before, const Areas& after, const Stations& stations) {
  constexpr int kNumColumns = 4, kNumRows = 3;
  constexpr double kCellPx = 9, kGapPx = 34;
  auto [min_column, min_row] = stations.cells.at(0);  // a world has stations
  int max_column = min_column, max_row = min_row;
  for (const auto& [column, row] : stations.cells) {
    min_column = std::min(min_column, column);
    max_column = std::max(max_column, column);
    min_row = std::min(min_row, row);
    max_row = std::max(max_row, row);
  }
  std::map<ClassId, const std::vector<StationIdx>*> stays;
  for (size_t i = 0; i < after.class_ids.size(); ++i) stays[after.class_ids[i]] = &after.areas[i];
  std::vector<size_t> order(before.areas.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return before.areas[a].size() < before.areas[b].size(); });
  const double width = kCellPx * (max_column - min_column + 1), height = kCellPx * (max_row - min_row + 1);
  std::string svg =
      BeginSvg(kNumColumns * (width + kGapPx) + kGapPx, kNumRows * (height + kGapPx) + 2 * kGapPx, 13) +
      Text(kGapPx, 22, "From where features are visible: light before the filter, dark what stays");
  constexpr int kNumShown = kNumColumns * kNumRows;
  for (int i = 0; i < kNumShown && !order.empty(); ++i) {
    const size_t shown = order[(2 * i + 1) * order.size() / (2 * kNumShown)];
    const double left = kGapPx + i % kNumColumns * (width + kGapPx);
    const double top = 1.7 * kGapPx + i / kNumColumns * (height + kGapPx);
    const auto kept = stays.find(before.class_ids[shown]);
    svg += Text(left, top - 5,
                fmt::format("{} stations, {} stay", before.areas[shown].size(),
                            kept == stays.end() ? 0 : kept->second->size()));
    svg +=
        fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"#f2f2f2\"/>\n",
                    left, top, width, height);
    for (const StationIdx station : before.areas[shown]) {
      const auto [column, row] = stations.cells[station];
      const bool is_kept =
          kept != stays.end() && std::binary_search(kept->second->begin(), kept->second->end(), station);
      svg += fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{}\" height=\"{}\" fill=\"{}\"/>\n",
                         left + kCellPx * (column - min_column), top + kCellPx * (max_row - row), kCellPx - 1,
                         kCellPx - 1, is_kept ? kSvgBlue : kSvgSky);
    }
  }
  return svg + "</svg>\n";
}

// [Sala06 Fig. 10] Numbers of features by the size of their area, before the filter and after it.
std::string SizesPicture(const Areas& before, const Areas& after) {
  constexpr int kBin = 10;
  constexpr double kBarPx = 22, kHeightPx = 320, kLeftPx = 70, kTopPx = 44;
  std::vector<int> counts[2];
  for (const auto& [which, areas] : {std::pair(0, &before), {1, &after}}) {
    for (const double size : SizesOf(*areas)) {
      const auto bin = static_cast<size_t>(size / kBin);
      for (std::vector<int>& each : counts) each.resize(std::max(each.size(), bin + 1), 0);
      ++counts[which][bin];
    }
  }
  const int highest = std::max(1, *std::max_element(counts[0].begin(), counts[0].end()));
  const double width = kBarPx * static_cast<double>(counts[0].size()), bottom = kTopPx + kHeightPx;
  std::string svg =
      BeginSvg(kLeftPx + width + 40, bottom + 60, 13) +
      Text(kLeftPx, 24, "Features by the stations that see them: light before the filter, dark after it");
  for (size_t bin = 0; bin < counts[0].size(); ++bin) {
    for (const int which : {0, 1}) {
      const double height = kHeightPx * std::min(1.0, static_cast<double>(counts[which][bin]) / highest);
      svg += fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{}\" height=\"{:.1f}\" fill=\"{}\"/>\n",
                         kLeftPx + kBarPx * static_cast<double>(bin) + (which == 0 ? 1 : 11), bottom - height,
                         9, height, which == 0 ? kSvgSky : kSvgBlue);
    }
    if (bin % 2 == 0)
      svg += Text(kLeftPx + kBarPx * static_cast<double>(bin), bottom + 18, fmt::format("{}", bin * kBin),
                  "middle");
  }
  svg += Text(kLeftPx - 8, kTopPx + 5, fmt::format("{}", highest), "end") +
         Text(kLeftPx - 8, bottom, "0", "end") +
         Text(kLeftPx + width / 2, bottom + 42, "stations that see a feature", "middle");
  return svg + "</svg>\n";
}

Status Run(const Arguments& arguments) {
  CAIRN_ASSIGN_OR_RETURN(const Classes classes, ReadClasses(arguments.classes));
  CAIRN_ASSIGN_OR_RETURN(const World world, ReadWorld(arguments.world));
  CAIRN_ASSIGN_OR_RETURN(const Stations stations, filter_visibility::FindStations(classes.images, {}));
  if (!stations.is_lattice)
    return MakeError(ErrorCode::kInvalidArgument, "{}: not a lattice survey", arguments.classes);
  const Areas after{world.class_ids, world.areas};
  const Areas before = AreasBefore(classes, stations, arguments.min_num_stations);
  fmt::print("areas,features,mean_stations,median_stations,with_holes,holes_per_feature,stations_per_hole\n");
  PrintLine("before", before, stations);
  PrintLine("after", after, stations);
  std::error_code error;
  std::filesystem::create_directories(arguments.folder, error);
  CAIRN_RETURN_IF_ERROR(WriteFileAtomically(arguments.folder + "/areas.csv", Csv(before, after, stations)));
  CAIRN_RETURN_IF_ERROR(
      WriteFileAtomically(arguments.folder + "/fig9.svg", AreasPicture(before, after, stations)));
  return WriteFileAtomically(arguments.folder + "/fig10.svg", SizesPicture(before, after));
}

}  // namespace
}  // namespace cairn

int main(int argc, char** argv) {
  CLI::App app(
      "The visibility areas of a lattice survey before and after the filter, as Figs. 9 and 10 of Sala06");
  cairn::Arguments arguments;
  app.add_option("classes", arguments.classes, "classes.db")->required();
  app.add_option("world", arguments.world, "world.db")->required();
  app.add_option("folder", arguments.folder, "Folder for areas.csv, fig9.svg and fig10.svg")->required();
  app.add_option("--min-num-stations", arguments.min_num_stations,
                 "Stations that must see a class that counts before")
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  const cairn::Status status = cairn::Run(arguments);
  if (!status.ok()) std::fprintf(stderr, "%s\n", status.error().message.c_str());
  return status.ok() ? 0 : 1;
}
