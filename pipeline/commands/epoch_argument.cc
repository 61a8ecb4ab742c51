#include "pipeline/commands/epoch_argument.h"

#include <limits>
#include <string>

#include "core/base/error.h"
#include "core/base/text.h"

namespace cairn::pipeline {

CLI::Option* AddEpochArgument(CLI::App& app, const char* name, uint64_t* epoch, uint64_t least,
                              const char* help) {
  return app.add_option(name, *epoch, help)->type_name("N")->check([least](const std::string& text) {
    uint64_t number = 0;
    if (ParseNumber(text, &number) && number >= least) return std::string();
    return fmt::format("'{}': expected a whole number of {} to {}", text, least,
                       std::numeric_limits<uint64_t>::max());
  });
}

}  // namespace cairn::pipeline
