#include "core/map/map_epoch.h"

#include <limits>

#include "core/map/map_file.h"

namespace cairn {

Status CheckFollows(const MapHead& next, const std::string& next_path, const MapHead& old,
                    const std::string& old_path, bool allow_older) {
  if (next.name != old.name) {
    return MakeError(ErrorCode::kOtherMap,
                     "{}: is map '{}', but {} is map '{}': a map of another name never takes its place; give "
                     "it a path of its own",
                     next_path, next.name, old_path, old.name);
  }
  if (allow_older || next.epoch > old.epoch) return Ok();
  return MakeError(
      ErrorCode::kNotNewer,
      "{}: is of epoch {}, but {} of epoch {}: only a later one takes its place; sign the new map "
      "with `cairn sign --after {}`, or allow an older one (--allow-older)",
      next_path, next.epoch, old_path, old.epoch, old_path);
}

Status CheckAskedFor(const MapHead& head, const std::string& path, const std::string& name,
                     uint64_t min_epoch) {
  if (!name.empty() && head.name != name) {
    return MakeError(ErrorCode::kOtherMap, "{}: is map '{}', but '{}' was asked for", path, head.name, name);
  }
  if (head.epoch >= min_epoch) return Ok();
  return MakeError(ErrorCode::kNotNewer,
                   "{}: map '{}' is of epoch {}, but {} or later was asked for; fetch a later map", path,
                   head.name, head.epoch, min_epoch);
}

Result<uint64_t> EpochAfter(const std::string& previous_path, const std::string& name,
                            const KeyRing& trusted) {
  CAIRN_ASSIGN_OR_RETURN(const MapFile previous, MapFile::Open(previous_path, {.public_key = trusted}));
  CAIRN_RETURN_IF_ERROR(CheckAskedFor(previous.head(), previous_path, name, 0));
  if (previous.head().epoch < std::numeric_limits<uint64_t>::max()) return previous.head().epoch + 1;
  return MakeError(ErrorCode::kInvalidArgument,
                   "{}: is of epoch {}, the largest possible one; only a map of another name can follow",
                   previous_path, previous.head().epoch);
}

}  // namespace cairn
