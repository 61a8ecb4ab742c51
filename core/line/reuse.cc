#include "core/line/reuse.h"

#include <algorithm>
#include <filesystem>

#include "core/base/blob.h"
#include "core/files/file.h"
#include "core/line/program_identity.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

// Layout: this line, the program's identity (32 characters), the number of entries, the entries, and the hash
// of all that.
constexpr std::string_view kMagic = "cairn reuse 1\n";
constexpr size_t kIdentityBytes = 32;
constexpr size_t kEntryBytes = 48;
constexpr size_t kHashBytes = 16;
constexpr size_t kMinBytes = kMagic.size() + kIdentityBytes + sizeof(uint64_t) + kHashBytes;
// Databases that are open at the same time.
constexpr int kMaxNumOpen = 64;

}  // namespace

std::string ReusePath(const std::string& output_path) { return output_path + ".reuse"; }

Status WriteReuseFile(const std::string& output_path, std::vector<ReuseEntry> entries) {
  const std::string path = ReusePath(output_path);
  if (ProgramIdentity().empty()) {
    std::error_code error;
    fs::remove(path, error);
    return Ok();
  }
  std::sort(entries.begin(), entries.end(),
            [](const ReuseEntry& a, const ReuseEntry& b) { return a.key < b.key; });
  BlobWriter blob;
  blob.Bytes(kMagic);
  blob.Bytes(ProgramIdentity());
  blob.UInt64(entries.size());
  for (const ReuseEntry& entry : entries) {
    WriteHash(entry.key, &blob);
    WriteHash(entry.contents, &blob);
    blob.UInt64(static_cast<uint64_t>(entry.row));
    blob.UInt64(static_cast<uint64_t>(entry.count));
  }
  std::string bytes = blob.Take();
  BlobWriter end;
  WriteHash(HashContents(bytes), &end);
  bytes += end.Take();
  return WriteFileAtomically(path, bytes);
}

Result<std::vector<ReuseEntry>> ReadReuseFile(const std::string& output_path) {
  const std::string path = ReusePath(output_path);
  CAIRN_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path));
  const std::string_view view = bytes;
  if (view.size() < kMinBytes || !view.starts_with(kMagic)) {
    return MakeError(ErrorCode::kCorrupt, "{}: {} bytes, not what this program writes there", path,
                     view.size());
  }
  const std::string_view contents = view.substr(0, view.size() - kHashBytes);
  BlobReader end(view.substr(contents.size()));
  if (ReadHash(&end) != HashContents(contents))
    return MakeError(ErrorCode::kCorrupt, "{}: damaged: its hash does not fit its contents", path);
  if (contents.substr(kMagic.size(), kIdentityBytes) != ProgramIdentity())
    return MakeError(ErrorCode::kUnsupported, "{}: written by another program, or on another kind of machine",
                     path);
  BlobReader reader(contents.substr(kMagic.size() + kIdentityBytes));
  const uint64_t num_entries = reader.UInt64();
  if (reader.num_left() % kEntryBytes != 0 || reader.num_left() / kEntryBytes != num_entries)
    return MakeError(ErrorCode::kCorrupt, "{}: {} bytes for {} entries", path, reader.num_left(),
                     num_entries);
  std::vector<ReuseEntry> entries(num_entries);
  for (ReuseEntry& entry : entries) {
    entry.key = ReadHash(&reader);
    entry.contents = ReadHash(&reader);
    entry.row = static_cast<int64_t>(reader.UInt64());
    entry.count = static_cast<int64_t>(reader.UInt64());
  }
  return entries;
}

SQLite::Database& ReuseSources::Source::Database() {
  if (!database_) {
    database_ = std::make_unique<SQLite::Database>(OpenImmutable(path_));
    std::error_code error;
    const uintmax_t num_bytes = fs::file_size(path_, error);
    LimitSteps(*database_, error ? 0 : num_bytes);
  }
  return *database_;
}

Status ReuseSources::Add(const std::string& path) {
  CAIRN_RETURN_IF_ERROR(CheckSqliteFile(path));
  AddIfReadable(path);
  return Ok();
}

void ReuseSources::AddIfReadable(const std::string& path) {
  const Status status = CheckSqliteFile(path);
  const auto entries = status.ok() ? ReadReuseFile(path) : status.error();
  if (!entries.ok()) {
    unusable_.push_back(entries.error().message);
    return;
  }
  sources_.push_back(std::make_unique<Source>(path));
  for (const ReuseEntry& entry : *entries) entries_.push_back({entry, sources_.back().get()});
  is_sorted_ = false;
}

std::vector<std::pair<const ReuseEntry*, ReuseSources::Source*>> ReuseSources::Candidates(
    const ContentHash& key) {
  if (!is_sorted_) {
    std::stable_sort(entries_.begin(), entries_.end(),
                     [](const Located& a, const Located& b) { return a.entry.key < b.entry.key; });
    is_sorted_ = true;
  }
  std::vector<std::pair<const ReuseEntry*, Source*>> candidates;
  auto it = std::lower_bound(entries_.begin(), entries_.end(), key,
                             [](const Located& a, const ContentHash& b) { return a.entry.key < b; });
  for (; it != entries_.end() && it->entry.key == key; ++it) candidates.emplace_back(&it->entry, it->source);
  return candidates;
}

ReuseSources::Source& ReuseSources::OpenSoon(Source& source) {
  if (source.database_) return source;
  const auto num_open = std::count_if(sources_.begin(), sources_.end(),
                                      [](const auto& other) { return other->database_ != nullptr; });
  if (num_open >= kMaxNumOpen) {
    for (const auto& other : sources_) other->database_.reset();
  }
  return source;
}

Result<std::vector<std::string>> AddReuseSources(const ReuseOptions& options, const std::string& output_path,
                                                 ReuseSources* named, ReuseSources* previous) {
  for (const std::string& file : options.files) CAIRN_RETURN_IF_ERROR(named->Add(file));
  if (options.previous) previous->AddIfReadable(output_path);
  std::vector<std::string> unusable = named->unusable();
  if (previous != named)
    unusable.insert(unusable.end(), previous->unusable().begin(), previous->unusable().end());
  return unusable;
}

}  // namespace cairn
