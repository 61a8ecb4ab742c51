#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/base/content_hash.h"
#include "core/base/error.h"
#include "core/files/database.h"
#include "core/line/shard.h"

namespace cairn {

// Takes over results that did not change.  A stage whose output X holds many independent results (the
// features of an image, the matches of a pair) writes X.reuse beside it: for each result a hash of everything
// that it depends on (its key), and one of its value.  A later run of the same program looks up its keys
// there, reads the results from X, and takes one only if it still has its hash.  X.reuse may be absent,
// damaged, old, or belong to another X: then results are computed again, and nothing else changes.  Keys are
// not in X, so that X depends on its contents alone, not on the program's build.
struct ReuseEntry {
  ContentHash key;
  ContentHash contents;
  int64_t row = 0;    // where it is in X; the stage chooses the meaning
  int64_t count = 0;  // a number that belongs to it; the stage chooses the meaning
};

// Where a run looks for results, and which part of the work it does.
struct ReuseOptions {
  bool previous = false;           // also in the output's earlier state
  std::vector<std::string> files;  // earlier outputs
  // With a shard, the run computes its share of the results that `files` lack and writes only that.
  std::optional<Shard> shard;
};

std::string ReusePath(const std::string& output_path);

// Writes ReusePath(output_path), atomically, entries in the order of their keys.  Without a ProgramIdentity
// nothing is written, and an existing file is removed.  Errors: Io.
Status WriteReuseFile(const std::string& output_path, std::vector<ReuseEntry> entries);

// The entries beside an output.  Errors: NotFound, Io, Corrupt (another kind of file, damaged), Unsupported
// (of another program).
Result<std::vector<ReuseEntry>> ReadReuseFile(const std::string& output_path);

// Earlier outputs with their entries.
class ReuseSources {
 public:
  // Where a result was found; Database() is open for as long as the result is read.
  class Source {
   public:
    explicit Source(std::string path) : path_(std::move(path)) {}
    // Throws SQLite::Exception when it cannot be opened.
    SQLite::Database& Database();
    const std::string& path() const { return path_; }

   private:
    friend class ReuseSources;
    std::string path_;
    std::unique_ptr<SQLite::Database> database_;
  };

  // An earlier output that the user names.  Errors: NotFound, Corrupt (not a SQLite database); a missing
  // reuse file is no error.
  Status Add(const std::string& path);
  // An earlier output that may be missing or damaged.
  void AddIfReadable(const std::string& path);
  // Why added outputs give no results, one message for each.
  const std::vector<std::string>& unusable() const { return unusable_; }

  bool empty() const { return sources_.empty(); }

  // The first result of this key for which `read(const ReuseEntry&, Source&)` returns one (a std::optional);
  // SQLite's exceptions count as none.  May be called from any thread.
  template <typename Read>
  auto Find(const ContentHash& key, const Read& read)
      -> std::invoke_result_t<Read, const ReuseEntry&, Source&> {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (const auto& [entry, source] : Candidates(key)) {
      try {
        if (auto result = read(*entry, OpenSoon(*source))) return result;
      } catch (const SQLite::Exception&) {
        continue;
      }
    }
    return std::nullopt;
  }

 private:
  struct Located {
    ReuseEntry entry;
    Source* source;
  };
  std::vector<std::pair<const ReuseEntry*, Source*>> Candidates(const ContentHash& key);
  // Opens the source; closes others where too many are open.
  Source& OpenSoon(Source& source);

  std::mutex mutex_;
  std::vector<std::unique_ptr<Source>> sources_;
  std::vector<Located> entries_;  // ascending keys, if is_sorted_
  bool is_sorted_ = true;
  std::vector<std::string> unusable_;
};

// Adds options.files to `named` and, with options.previous, what the output's last run left to `previous`;
// the two may be the same object.  Returns why added outputs give no results, one message for each.  Errors:
// those of ReuseSources::Add.
Result<std::vector<std::string>> AddReuseSources(const ReuseOptions& options, const std::string& output_path,
                                                 ReuseSources* named, ReuseSources* previous);

}  // namespace cairn
