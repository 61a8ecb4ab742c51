#pragma once

#include <string>

#include <toml++/toml.h>

#include "core/base/error.h"
#include "core/options/options.h"

namespace cairn {

// The file as a TOML document.  Errors: NotFound, Io, Corrupt (not TOML; file and line).
Result<toml::table> ReadTomlFile(const std::string& path);

// The same of a text; `path` is for messages.  Errors: Corrupt.
Result<toml::table> ParseToml(const std::string& contents, const std::string& path);

// Sets options from the keys of one table of the document in `path`.
// Errors: InvalidArgument, naming file and line: an unknown key (with the nearest valid one), a wrong type, a
// value outside its range.
Status SetOptionsFromToml(const toml::table& keys, const std::string& path, const OptionTable& table);

// "PATH:LINE" of a node of a document, as messages name it.
std::string TomlPlace(const std::string& path, const toml::node& node);

}  // namespace cairn
