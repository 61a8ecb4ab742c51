#pragma once

#include <string>

#include "core/error.h"
#include "stages/link_appearance/link_appearance.h"

namespace cairn {

// appearance.db (schemas/appearance.sql).
Status WriteAppearance(const Appearance& appearance, const std::string& path);
// Errors: as OpenDatabaseReadOnly; Corrupt (another file, or rows that do not fit together; says which),
// Unsupported (a version that this program does not read).
Result<Appearance> ReadAppearance(const std::string& path);

}  // namespace cairn
