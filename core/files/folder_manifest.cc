#include "core/files/folder_manifest.h"

#include <filesystem>
#include <map>
#include <optional>
#include <vector>

#include "core/base/text.h"
#include "core/files/file.h"
#include "core/files/temporary.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kHead = "cairn folder 1\nkind ";
constexpr std::string_view kUnfinished = "unfinished";

// Path relative to the folder, escaped -> "folder", "file SIZE HASH" or "link HASH".
using Entries = std::map<std::string, std::string>;

struct Manifest {
  std::string kind;
  bool is_finished = false;
  Entries entries;
};

// A path may contain line ends.
std::string Escaped(const std::string& path) {
  std::string text;
  for (const char c : path) {
    if (c == '\n' || c == '\r' || c == '\\') text += '\\';
    text += c == '\n' ? 'n' : c == '\r' ? 'r' : c;
  }
  return text;
}

std::string ManifestText(const Manifest& manifest) {
  std::string text = fmt::format("{}{}\n", kHead, manifest.kind);
  if (!manifest.is_finished) text += fmt::format("{}\n", kUnfinished);
  for (const auto& [path, what] : manifest.entries) text += fmt::format("{} {}\n", what, path);
  return text;
}

// The fields of a line before its path: "file SIZE HASH" has three.
size_t NumFields(std::string_view line) {
  if (line.starts_with("file ")) return 3;
  if (line.starts_with("link ")) return 2;
  return line.starts_with("folder ") ? 1 : 0;
}

// Nothing where it is not complete: then the folder counts as one that cairn did not make.
std::optional<Manifest> ParseManifest(std::string_view text) {
  if (!text.starts_with(kHead) || !text.ends_with('\n')) return std::nullopt;
  text.remove_prefix(kHead.size());
  Manifest manifest{.is_finished = true};
  bool is_first = true;
  for (const std::string_view line : SplitLines(text)) {
    if (is_first) {
      manifest.kind = line;
      is_first = false;
    } else if (line == kUnfinished) {
      manifest.is_finished = false;
    } else {
      const size_t num_fields = NumFields(line);
      size_t end = 0;
      for (size_t i = 0; i < num_fields && end != std::string_view::npos; ++i)
        end = line.find(' ', i == 0 ? 0 : end + 1);
      if (num_fields == 0 || end == std::string_view::npos) return std::nullopt;
      manifest.entries.emplace(line.substr(end + 1), line.substr(0, end));
    }
  }
  return manifest;
}

std::optional<Manifest> ReadManifest(const std::string& folder) {
  const fs::path path = fs::path(folder) / kFolderManifestFile;
  std::error_code error;
  if (!fs::is_regular_file(fs::symlink_status(path, error))) return std::nullopt;
  const Result<std::string> text = ReadFile(path.string());
  return text.ok() ? ParseManifest(*text) : std::nullopt;
}

// What an entry of a folder is, in the manifest's form; with `expected`, a file of another size is not
// hashed.  Nothing for what cairn never makes: a pipe, a socket, a device.
Result<std::optional<std::string>> Describe(const fs::directory_entry& entry, const std::string* expected) {
  std::error_code error;
  const fs::file_status status = entry.symlink_status(error);
  if (error) return MakeError(ErrorCode::kIo, "{}: {}", entry.path().string(), error.message());
  if (fs::is_symlink(status)) {
    const std::string target = fs::read_symlink(entry.path(), error).string();
    if (error) return MakeError(ErrorCode::kIo, "{}: {}", entry.path().string(), error.message());
    return std::optional(fmt::format("link {}", HashBytes(target)));
  }
  if (fs::is_directory(status)) return std::optional<std::string>("folder");
  if (!fs::is_regular_file(status)) return std::optional<std::string>();
  const std::string size = fmt::format("file {} ", fs::file_size(entry.path(), error));
  if (expected != nullptr && !expected->starts_with(size)) return std::optional(size);
  CAIRN_ASSIGN_OR_RETURN(const std::string hash, HashFile(entry.path().string()));
  return std::optional(size + hash);
}

// The manifest, or what a kill leaves of one that was being written.
bool IsOfManifest(const std::string& path) {
  return path == kFolderManifestFile || IsTemporaryName(path, kFolderManifestFile);
}

// Visits all that a folder holds by its escaped path, and stops at the first error; its manifest is left out.
template <typename Visit>
Status VisitEntries(const std::string& folder, const Visit& visit) {
  std::error_code error;
  fs::recursive_directory_iterator it(folder, error), end;
  for (; !error && it != end; it.increment(error)) {
    const std::string path = Escaped(it->path().lexically_relative(folder).generic_string());
    if (!IsOfManifest(path)) CAIRN_RETURN_IF_ERROR(visit(path, *it));
  }
  if (!error) return Ok();
  return MakeError(ErrorCode::kIo, "{}: the folder cannot be read: {}", folder, error.message());
}

// Ok where all that the folder holds is in the manifest, and unchanged.
Status CheckEntries(const std::string& folder, const Manifest& manifest, size_t* num_found) {
  *num_found = 0;
  return VisitEntries(folder, [&](const std::string& path, const fs::directory_entry& entry) -> Status {
    const auto listed = manifest.entries.find(path);
    const bool is_listed = listed != manifest.entries.end();
    if (is_listed) {
      CAIRN_ASSIGN_OR_RETURN(const std::optional<std::string> what, Describe(entry, &listed->second));
      *num_found += what == listed->second;
      if (what == listed->second) return Ok();
    }
    return MakeError(
        ErrorCode::kInvalidArgument,
        "{}: {}, and would be lost with the folder {}; nothing was changed: name another folder, "
        "or move this one away",
        entry.path().string(), is_listed ? "was changed since cairn wrote it" : "was not made by cairn",
        folder);
  });
}

Status WriteManifest(const std::string& folder, const Manifest& manifest) {
  return WriteFileAtomically(folder + "/" + kFolderManifestFile, ManifestText(manifest));
}

// Whether there is nothing in a folder but, perhaps, its manifest.
bool HoldsNothing(const std::string& folder) {
  size_t num_left = 0;
  const Status counted = VisitEntries(folder, [&](const std::string&, const fs::directory_entry&) {
    ++num_left;
    return Ok();
  });
  return counted.ok() && num_left == 0;
}

// REQUIRES: HoldsNothing(folder)
bool RemoveWithManifest(const std::string& folder) {
  std::error_code error;
  std::vector<fs::path> of_manifest;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    if (IsOfManifest(entry.path().filename().string())) of_manifest.push_back(entry.path());
  }
  for (const fs::path& path : of_manifest) fs::remove(path, error);
  return fs::remove(folder, error);
}

// Removes the listed files, then the folders that they leave empty, each after its contents.
bool RemoveEntries(const std::string& folder, const Manifest& manifest) {
  std::vector<fs::path> paths;
  const Status visited =
      VisitEntries(folder, [&](const std::string& path, const fs::directory_entry& entry) -> Status {
        if (manifest.entries.contains(path)) paths.push_back(entry.path());
        return Ok();
      });
  std::error_code error;
  for (auto path = paths.rbegin(); path != paths.rend(); ++path) fs::remove(*path, error);
  // Its manifest goes last: until then the rest is known to be cairn's.
  return visited.ok() && HoldsNothing(folder) && RemoveWithManifest(folder);
}

}  // namespace

Status BeginOwnFolder(const std::string& folder, const std::string& kind) {
  return WriteManifest(folder, {.kind = kind, .is_finished = false});
}

Status FinishOwnFolder(const std::string& folder, const std::string& kind) {
  Manifest manifest{.kind = kind, .is_finished = true};
  CAIRN_RETURN_IF_ERROR(
      VisitEntries(folder, [&](const std::string& path, const fs::directory_entry& entry) -> Status {
        CAIRN_ASSIGN_OR_RETURN(const std::optional<std::string> what, Describe(entry, nullptr));
        if (what) manifest.entries.emplace(path, *what);
        return Ok();
      }));
  return WriteManifest(folder, manifest);
}

Status CheckOwnFolder(const std::string& folder, const std::string& kind) {
  std::error_code error;
  if (fs::is_empty(folder, error)) return Ok();
  const std::optional<Manifest> manifest = ReadManifest(folder);
  if (!manifest) {
    const fs::directory_iterator first(folder, error);
    return MakeError(
        ErrorCode::kInvalidArgument,
        "{}: holds {}, and nothing shows that cairn made it (there is no complete {} in it, which folders of "
        "earlier versions lack); nothing was changed: name another folder, or move this one away",
        folder, error || first == fs::directory_iterator() ? "files" : first->path().filename().string(),
        kFolderManifestFile);
  }
  if (manifest->kind != kind) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: is {}, not {}; nothing was changed: name another folder, or move this one away",
                     folder, manifest->kind, kind);
  }
  if (!manifest->is_finished) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: was never finished, so nothing shows what in it is cairn's; nothing was changed: "
                     "name another folder, or move this one away",
                     folder);
  }
  size_t num_found = 0;
  return CheckEntries(folder, *manifest, &num_found);
}

bool HoldsTheSame(const std::string& folder, const std::string& other) {
  const std::optional<Manifest> manifest = ReadManifest(folder), wanted = ReadManifest(other);
  if (!manifest || !wanted || !manifest->is_finished || !wanted->is_finished) return false;
  if (manifest->kind != wanted->kind || manifest->entries != wanted->entries) return false;
  size_t num_found = 0;
  return CheckEntries(folder, *manifest, &num_found).ok() && num_found == manifest->entries.size();
}

void KeepDates(const std::string& folder, const std::string& old_folder) {
  const std::optional<Manifest> manifest = ReadManifest(folder), old = ReadManifest(old_folder);
  if (!manifest || !old) return;
  for (const auto& [path, what] : manifest->entries) {
    const auto same = old->entries.find(path);
    if (same == old->entries.end() || same->second != what || !what.starts_with("file ")) continue;
    std::error_code error;  // a date that cannot be set is no error
    const auto date = fs::last_write_time(fs::path(old_folder) / path, error);
    if (!error) fs::last_write_time(fs::path(folder) / path, date, error);
  }
}

std::set<std::string> OwnFiles(const std::string& folder) {
  const std::optional<Manifest> manifest = ReadManifest(folder);
  if (!manifest || !manifest->is_finished) return {};
  std::set<std::string> files = {kFolderManifestFile};
  const Status visited =
      VisitEntries(folder, [&](const std::string& path, const fs::directory_entry& entry) -> Status {
        const auto listed = manifest->entries.find(path);
        if (listed == manifest->entries.end()) return Ok();
        CAIRN_ASSIGN_OR_RETURN(const std::optional<std::string> what, Describe(entry, &listed->second));
        if (what == listed->second && what != "folder")
          files.insert(entry.path().lexically_relative(folder).generic_string());
        return Ok();
      });
  return visited.ok() ? files : std::set<std::string>();
}

bool RemoveOwnFolder(const std::string& folder) {
  std::error_code error;
  if (!fs::is_directory(fs::symlink_status(folder, error))) return false;
  const std::optional<Manifest> manifest = ReadManifest(folder);
  if (!manifest) {  // killed before it had one
    const bool is_begun = !fs::exists(fs::symlink_status(fs::path(folder) / kFolderManifestFile, error));
    return is_begun && HoldsNothing(folder) && RemoveWithManifest(folder);
  }
  if (!manifest->is_finished) return fs::remove_all(folder, error) > 0 && !error;
  size_t num_found = 0;
  return CheckEntries(folder, *manifest, &num_found).ok() && RemoveEntries(folder, *manifest);
}

}  // namespace cairn
