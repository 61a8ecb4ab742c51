#include <iterator>
#include <limits>
#include <stdexcept>

#include <nlohmann/json.hpp>

#include "core/files/file.h"
#include "core/world/decomposition.h"

namespace cairn {
namespace {

constexpr char kFormat[] = "cairn-regions";
constexpr int kRegionsJsonVersion = 1;

// nlohmann::json would truncate 1.5 and 99999999999 to some int.
int IntegerOf(const nlohmann::json& value) {
  const bool fits =
      value.is_number_unsigned()
          ? value.get<uint64_t>() <= static_cast<uint64_t>(std::numeric_limits<int>::max())
          : value.is_number_integer() && value.get<int64_t>() >= std::numeric_limits<int>::min();
  if (!fits) throw std::domain_error(fmt::format("{} is not an integer of 32 bits", value.dump()));
  return value.get<int>();
}

std::vector<int32_t> IndicesOf(const nlohmann::json& list) {
  if (!list.is_array()) throw std::domain_error(fmt::format("found {}, expected a list", list.type_name()));
  std::vector<int32_t> indices;
  for (const nlohmann::json& value : list) indices.push_back(IntegerOf(value));
  return indices;
}

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
    if (const int version = IntegerOf(member(document, "version")); version != kRegionsJsonVersion) {
      return MakeError(ErrorCode::kUnsupported, "{}: regions version {}, this program reads {}", path,
                       version, kRegionsJsonVersion);
    }
    Decomposition decomposition;
    decomposition.algorithm = member(document, "algorithm").get<std::string>();
    decomposition.k = IntegerOf(member(document, "k"));
    decomposition.tau = IntegerOf(member(document, "tau"));
    decomposition.rho = IntegerOf(member(document, "rho"));
    decomposition.seed = member(document, "seed").get<uint64_t>();
    if (document.contains("lower_bound") && !document["lower_bound"].is_null()) {
      decomposition.lower_bound = IntegerOf(member(document, "lower_bound"));
    }
    if (document.contains("uncovered_limit")) {
      decomposition.uncovered_limit = IntegerOf(member(document, "uncovered_limit"));
    }
    for (const nlohmann::json& region : member(document, "regions")) {
      where = fmt::format("regions[{}]", decomposition.regions.size());
      decomposition.regions.push_back({IndicesOf(region.at("features")), IndicesOf(region.at("poses"))});
    }
    decomposition.uncovered = IndicesOf(member(document, "uncovered"));
    return decomposition;
  } catch (const nlohmann::json::parse_error& error) {
    return MakeError(ErrorCode::kCorrupt, "{}: byte {}: not JSON (is the file truncated?)", path, error.byte);
  } catch (const nlohmann::json::exception& error) {
    return MakeError(ErrorCode::kCorrupt, "{}: {}: {}", path, where, error.what());
  } catch (const std::domain_error& error) {
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
      kFormat, kRegionsJsonVersion, nlohmann::json(decomposition.algorithm).dump(), decomposition.k,
      decomposition.tau, decomposition.rho, decomposition.seed,
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
