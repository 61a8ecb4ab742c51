#include "pipeline/commands/open_plan.h"

#include "runtime/map/open_views.h"

namespace cairn::pipeline {

Result<std::shared_ptr<const Views>> OpenPlanFor(const std::string& path, const ScanLocatorOptions& options,
                                                 const CommandEnvironment& environment) {
  if (options.search != "vir") return OpenPlan(path);
  return OpenViews(path, environment.num_threads, environment.memory_mib, *environment.progress);
}

}  // namespace cairn::pipeline
