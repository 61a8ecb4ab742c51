// What a robot does for years, as often as asked: updates of its map and ways back, opens of a damaged map,
// queries.  Time, memory and open files in the course of it: all have to stay flat.
#include <algorithm>
#include <chrono>
#include <filesystem>
#include <functional>
#include <map>
#include <string>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <opencv2/core/utility.hpp>

#include "bench/runtime/process_figures.h"
#include "bench/runtime/some_features.h"
#include "core/base/random.h"
#include "core/files/file.h"
#include "runtime/localize/localizer.h"
#include "runtime/map/map.h"
#include "runtime/map/update_map.h"

namespace cairn {
namespace {

// A row for each tenth.
Status InTenths(const std::string& what, int64_t num, const std::function<Status()>& once) {
  if (num == 0) return Ok();
  fmt::print("| {} | us each | MiB held | open files |\n|--:|--:|--:|--:|\n", what);
  constexpr int kNumRows = 10;
  int64_t done = 0;
  for (int row = 1; row <= kNumRows; ++row) {
    const int64_t end = num * row / kNumRows, begin = done;
    const auto start = std::chrono::steady_clock::now();
    for (; done < end; ++done) CAIRN_RETURN_IF_ERROR(once());
    const std::chrono::duration<double, std::micro> took = std::chrono::steady_clock::now() - start;
    fmt::print("| {} | {:.1f} | {:.2f} | {} |\n", done,
               took.count() / static_cast<double>(std::max<int64_t>(1, end - begin)), ResidentMib(),
               NumOpenFiles());
    std::fflush(stdout);
  }
  fmt::print("\n");
  return Ok();
}

Status Update(const std::string& old_map, const std::string& delta, const std::string& folder, int64_t num) {
  const std::string map = folder + "/map";
  CAIRN_ASSIGN_OR_RETURN(const std::string old_bytes, ReadFile(old_map));
  CAIRN_RETURN_IF_ERROR(WriteFileAtomically(map, old_bytes));
  CAIRN_RETURN_IF_ERROR(InTenths("updates, each with its way back", num, [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const bool updated, UpdateMap(map, delta));
    if (!updated) return MakeError(ErrorCode::kFailed, "{}: was not updated", map);
    return RollBackMap(map);
  }));
  CAIRN_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(map));
  if (bytes != old_bytes) return MakeError(ErrorCode::kFailed, "{}: is not the map that it was", map);
  return Ok();
}

// Cut off, with a few bits flipped, or with bytes of another place.
std::string Damaged(std::string bytes, Random* random) {
  const auto place = [&] {
    return static_cast<size_t>(random->UniformInt(0, static_cast<int64_t>(bytes.size()) - 1));
  };
  switch (random->UniformInt(0, 2)) {
    case 0:
      bytes.resize(place());
      break;
    case 1:
      for (int64_t i = random->UniformInt(1, 8); i > 0; --i)
        bytes[place()] ^= static_cast<char>(1 << random->UniformInt(0, 7));
      break;
    default:
      const size_t from = place(), to = place(), num_bytes = std::min<size_t>(place(), 1000);
      bytes.replace(to, num_bytes, bytes.substr(from, num_bytes));
  }
  return bytes;
}

Status Open(const std::string& old_map, const Features& features, const std::string& folder, int64_t num) {
  CAIRN_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(old_map));
  const std::string path = folder + "/damaged";
  Random random(1);
  std::map<std::string, int64_t> ends;
  CAIRN_RETURN_IF_ERROR(InTenths("opens of a damaged map", num, [&]() -> Status {
    CAIRN_RETURN_IF_ERROR(WriteFileAtomically(path, Damaged(bytes, &random)));
    const auto map = Map::Open(path);
    if (!map.ok()) {
      ++ends[fmt::format("not opened: {}", ErrorCodeName(map.error().code))];
      return Ok();
    }
    Features asked = features;
    const auto found = Localizer(*map).LocalizeFeatures(std::move(asked), (*map)->head().cameras.front());
    ++ends[found.ok() ? "not touched by the query"
                      : fmt::format("query: {}", ErrorCodeName(found.error().code))];
    return Ok();
  }));
  for (const auto& [end, num_ends] : ends) fmt::print("{:8} {}\n", num_ends, end);
  return Ok();
}

Status Query(const std::shared_ptr<const Map>& map, const Features& features, int64_t num) {
  const Camera camera = map->head().cameras.front();
  Localizer localizer(map);
  return InTenths("queries", num, [&]() -> Status {
    Features asked = features;
    CAIRN_RETURN_IF_ERROR(localizer.LocalizeFeatures(std::move(asked), camera));
    return Ok();
  });
}

struct Counts {
  int64_t updates = 100'000, opens = 10'000, queries = 1'000'000;
};

Status Endure(const std::string& old_map, const std::string& delta, const std::string& folder,
              const Counts& counts) {
  cv::setNumThreads(1);
  CAIRN_ASSIGN_OR_RETURN(const std::shared_ptr<const Map> map, Map::Open(old_map));
  const Features features = SomeFeatures(map->head().cameras.front());
  CAIRN_RETURN_IF_ERROR(Update(old_map, delta, folder, counts.updates));
  CAIRN_RETURN_IF_ERROR(Open(old_map, features, folder, counts.opens));
  return Query(map, features, counts.queries);
}

}  // namespace
}  // namespace cairn

int main(int argc, char** argv) {
  std::string old_map, delta;
  cairn::Counts counts;
  CLI::App app("Updates, opens of damaged maps and queries, as often as asked");
  app.add_option("map", old_map, "signed map")->required();
  app.add_option("delta", delta, "delta to a later epoch of it")->required();
  app.add_option("--updates", counts.updates, "updates, each with its way back");
  app.add_option("--opens", counts.opens, "opens of a damaged copy, with a query where it opens");
  app.add_option("--queries", counts.queries, "queries with 60 features of no image");
  CLI11_PARSE(app, argc, argv);
  const std::string folder = fmt::format("/dev/shm/endure_{}", getpid());
  std::filesystem::create_directories(folder);
  const cairn::Status status = cairn::Endure(old_map, delta, folder, counts);
  if (!status.ok()) fmt::print(stderr, "{}\n", status.error().message);
  std::error_code error;
  std::filesystem::remove_all(folder, error);
  return status.ok() ? 0 : 1;
}
