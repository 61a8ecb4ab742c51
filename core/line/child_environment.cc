#include "core/line/child_environment.h"

#include <unistd.h>

#include <algorithm>

namespace cairn {
namespace {

constexpr std::string_view kNames[] = {
    "PATH",
    "HOME",
    "USER",
    "LOGNAME",
    "TMPDIR",
    "LD_LIBRARY_PATH",
    "LD_PRELOAD",  // places
    "LANG",
    "LANGUAGE",
    "TZ",
    "TERM",
    "COLUMNS",
    "LINES",
    "QT_QPA_PLATFORM",  // surface
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "CUDA_VISIBLE_DEVICES",
    "NVIDIA_VISIBLE_DEVICES",  // processors
    "ASAN_OPTIONS",
    "LSAN_OPTIONS",
    "TSAN_OPTIONS",
    "UBSAN_OPTIONS",  // sanitizers
    "KRB5CCNAME",
    "SSH_AUTH_SOCK",  // launchers
};
constexpr std::string_view kPrefixes[] = {
    "LC_",    "OMP_",                                                              // as above
    "SLURM_", "MUNGE_", "PBS_", "SGE_", "LSF_", "LSB_", "FLUX_", "PMI_", "PMIX_",  // schedulers
};

std::string_view NameOf(std::string_view entry) { return entry.substr(0, entry.find('=')); }

}  // namespace

bool IsPassedOn(std::string_view variable) {
  const auto begins = [&](std::string_view prefix) { return variable.starts_with(prefix); };
  return std::find(std::begin(kNames), std::end(kNames), variable) != std::end(kNames) ||
         std::any_of(std::begin(kPrefixes), std::end(kPrefixes), begins);
}

std::vector<std::string> ChildEnvironment(const std::vector<std::string>& added) {
  std::vector<std::string> entries = added;
  for (char** entry = environ; *entry != nullptr; ++entry) {
    const std::string_view name = NameOf(*entry);
    const bool is_added = std::any_of(added.begin(), added.end(),
                                      [&](const std::string& other) { return NameOf(other) == name; });
    if (IsPassedOn(name) && !is_added) entries.emplace_back(*entry);
  }
  return entries;
}

}  // namespace cairn
