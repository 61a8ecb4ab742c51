#pragma once

#include <cstdint>

namespace cairn {

// What record_calls.cc writes for each call that changes files or syncs them, in the order in which they were
// done: this, the bytes of `path` and those of `other`.
struct RecordedCall {
  enum Kind : uint32_t {
    kOpen,      // path: of a file that may be written; offset: 1 if it was made, 2 if it was emptied
    kWrite,     // other: the bytes written at `offset`
    kTruncate,  // offset: the new size
    kSetDate,   // offset: the new date
    kSync,      // a file or, where `path` is one, a folder
    kSyncAll,   // files and folders
    kRename,    // path -> other
    kExchange,  // path <-> other
    kLink,      // path, another name of which is `other` now
    kUnlink,    // a file or folder
    kMakeFolder,
  };
  Kind kind = kOpen;
  uint32_t path_bytes = 0;
  uint64_t other_bytes = 0;
  uint64_t inode = 0;  // of kOpen to kSync
  int64_t offset = 0;
  int64_t date_ns = 0;  // when it was done, since 1970
};

}  // namespace cairn
