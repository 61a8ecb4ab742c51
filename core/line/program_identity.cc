#include "core/line/program_identity.h"

#include <link.h>

#include <algorithm>
#include <string_view>
#include <vector>

#include <opencv2/core/utility.hpp>

#include "core/features/packed_descriptors.h"
#include "core/files/file.h"
#include "core/modules/build_id.h"

namespace cairn {
namespace {

int CountObject(dl_phdr_info*, size_t, void* count) {
  ++*static_cast<int*>(count);
  return 0;
}

// Objects that the program is linked with; whatever is loaded later (OpenCV looks for OpenCL) follows them.
const int num_linked_objects = [] {
  int count = 0;
  dl_iterate_phdr(CountObject, &count);
  return count;
}();

struct Libraries {
  int num_objects = 0;
  std::vector<std::string> ids;
};

// Called for the executable first (its name is empty), then for each library.
int AddLibrary(dl_phdr_info* object, size_t, void* context) {
  auto& libraries = *static_cast<Libraries*>(context);
  if (++libraries.num_objects > num_linked_objects) return 1;
  const std::string_view name = object->dlpi_name;
  if (!name.starts_with('/')) return 0;  // the executable, and the kernel's own
  libraries.ids.push_back(IdOfLibrary(*object));
  return 0;
}

std::string MakeIdentity() {
  const auto executable = HashFile("/proc/self/exe");
  if (!executable.ok()) return "";
  Libraries libraries;
  dl_iterate_phdr(AddLibrary, &libraries);
  std::sort(libraries.ids.begin(), libraries.ids.end());
  std::string identity = *executable;
  for (const std::string& library : libraries.ids) identity += library;
  identity += cv::getVersionString();
  identity += cv::getCPUFeaturesLine();
  identity += NameOf(FastestKernel());
  return HashBytes(identity);
}

}  // namespace

const std::string& ProgramIdentity() {
  static const std::string identity = MakeIdentity();
  return identity;
}

}  // namespace cairn
