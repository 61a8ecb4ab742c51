#include "core/line/reuse_arguments.h"

#include "core/files/output_path.h"

namespace cairn {

Argument ReuseArguments::Add(ArgumentParser& parser, const std::string& results) {
  const Argument reuse =
      parser
          .Add("--reuse", files_,
               "Earlier output of this command: unchanged " + results +
                   " are taken over from it, as from the file at -o; may be given more than once")
          .Type("FILE")
          .OneAtATime();
  parser.AddFlag("--no-reuse", no_reuse_, "Compute everything again").Excludes(reuse);
  return parser
      .Add("--shard", shard_,
           "Compute only the I-th of N shares of the " + results +
               " that no --reuse file has, and write only these; a run without --shard merges")
      .Type("I/N");
}

Result<ReuseOptions> ReuseArguments::Apply(const std::string& output_path, bool writes_part) const {
  ReuseOptions options{.previous = !no_reuse_, .files = files_};
  if (shard_.empty() && !writes_part) return options;
  if (!shard_.empty()) {
    CAIRN_ASSIGN_OR_RETURN(options.shard, ParseShard(shard_));
  }
  for (const std::string& file : files_) {
    if (!IsSameFile(file, output_path)) continue;
    return MakeError(
        ErrorCode::kInvalidArgument,
        "--reuse {} is also the output: a shard holds only its own share, and a plan no results, so "
        "the rest of the file would be lost; choose another -o",
        file);
  }
  return options;
}

}  // namespace cairn
