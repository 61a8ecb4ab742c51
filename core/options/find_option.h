#pragma once

#include <string>

#include "core/options/options.h"

namespace cairn {

// The option of this name.  Errors: InvalidArgument, with the nearest name, or with `if_none_is_near` ("valid
// are a, b") where no name is similar.
Result<const Option*> FindOption(const OptionTable& table, const std::string& name,
                                 const std::string& if_none_is_near);

}  // namespace cairn
