#include <iterator>

#include <nlohmann/json.hpp>

#include "core/decomposition.h"
#include "core/file.h"

namespace cairn {
namespace {

constexpr char kFormat[] = "cairn-regions";
constexpr int kVersion = 1;

}  // namespace

Result<Decomposition> ReadDecompositionJson(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(const std::string contents, ReadFile(path));
  std::string where = "document";  // the member that is being read, for messages
  const auto member = [&](const nlohmann::json& object, const char* name) -> const nlohmann::json& {
    where = name;
    return object.at(name);
  };
  try {
    const nlohmann::json document = nlohmann::json::parse(contents);
    if (const std::string format = member(document, "format").get<std::string>(); format != kFormat) {
      return MakeError(ErrorCode::kCorrupt, "{}: \"format\" is '{}', expected '{}'", path, format, kFormat);
    }
    if (const int version = member(document, "version").get<int>(); version != kVersion) {
      return MakeError(ErrorCode::kUnsupported, "{}: regions version {}, this program reads {}", path,
                       version, kVersion);
    }
    Decomposition decomposition;
    decomposition.algorithm = member(document, "algorithm").get<std::string>();
    decomposition.k = member(document, "k").get<int>();
    decomposition.tau = member(document, "tau").get<int>();
    decomposition.rho = member(document, "rho").get<int>();
    decomposition.seed = member(document, "seed").get<uint64_t>();
    if (document.contains("lower_bound") && !document["lower_bound"].is_null()) {
      decomposition.lower_bound = member(document, "lower_bound").get<int>();
    }
    if (document.contains("uncovered_limit")) {
      decomposition.uncovered_limit = member(document, "uncovered_limit").get<int>();
    }
    for (const nlohmann::json& region : member(document, "regions")) {
      where = fmt::format("regions[{}]", decomposition.regions.size());
      decomposition.regions.push_back({region.at("features").get<std::vector<FeatureIdx>>(),
                                       region.at("poses").get<std::vector<StationIdx>>()});
    }
    decomposition.uncovered = member(document, "uncovered").get<std::vector<StationIdx>>();
    return decomposition;
  } catch (const nlohmann::json::parse_error& error) {
    return MakeError(ErrorCode::kCorrupt, "{}: byte {}: not JSON (is the file truncated?)", path, error.byte);
  } catch (const nlohmann::json::exception& error) {
    return MakeError(ErrorCode::kCorrupt, "{}: {}: {}", path, where, error.what());
  }
}

Status WriteDecompositionJson(const Decomposition& decomposition, const std::string& path) {
  fmt::memory_buffer text;
  auto out = std::back_inserter(text);
  fmt::format_to(
      out,
      "{{\"format\":\"{}\",\"version\":{},\"algorithm\":{},\"k\":{},\"tau\":{},\"rho\":{},\"seed\":{},"
      "\"lower_bound\":{},\"uncovered_limit\":{},\n\"regions\":[",
      kFormat, kVersion, nlohmann::json(decomposition.algorithm).dump(), decomposition.k, decomposition.tau,
      decomposition.rho, decomposition.seed,
      decomposition.lower_bound ? fmt::format("{}", *decomposition.lower_bound) : "null",
      decomposition.uncovered_limit);
  for (size_t i = 0; i < decomposition.regions.size(); ++i) {
    const Region& region = decomposition.regions[i];
    fmt::format_to(out, "{}\n{{\"features\":[{}],\"poses\":[{}]}}", i > 0 ? "," : "",
                   fmt::join(region.features, ","), fmt::join(region.stations, ","));
  }
  fmt::format_to(out, "],\n\"uncovered\":[{}]}}\n", fmt::join(decomposition.uncovered, ","));
  return WriteFileAtomically(path, std::string_view(text.data(), text.size()));
}

}  // namespace cairn
