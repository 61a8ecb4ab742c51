#pragma once

#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/line/arguments.h"
#include "core/line/reuse.h"

namespace cairn {

// `--reuse FILE`, `--no-reuse` and `--shard I/N` of a stage that takes over what did not change.
class ReuseArguments {
 public:
  // `results`: what the stage takes over, for --help ("images", "pairs").  Returns --shard.
  Argument Add(ArgumentParser& parser, const std::string& results);
  // Errors: InvalidArgument (an invalid shard, or one that would replace a file that it reads).
  // `writes_part`: the output is not whole without a shard, either.
  Result<ReuseOptions> Apply(const std::string& output_path, bool writes_part = false) const;

 private:
  std::vector<std::string> files_;
  bool no_reuse_ = false;
  std::string shard_;
};

}  // namespace cairn
