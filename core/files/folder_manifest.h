#pragma once

#include <set>
#include <string>

#include "core/base/error.h"

namespace cairn {

// A folder that cairn made knows what it holds: its manifest lists every file with its size and hash, every
// link with where it leads, and every folder in it.  Only by this manifest does cairn decide whether a folder
// is its own and may be replaced or removed; it never guesses from the names in a folder.
//   cairn folder 1
//   kind a capture
//   folder images
//   file 8214 0f3c...  images/0001.jpg      size, XXH3 as 32 digits, path relative to the folder
//   link 90ab... images/session             XXH3 of the path that it leads to
// A temporary folder that is being filled has "unfinished" in place of these lines: everything in it
// is cairn's.
inline constexpr const char* kFolderManifestFile = ".cairn-folder";

// Mark a folder as one that is being filled, and as one that is whole.  `kind`: "a capture".  Same contents,
// same bytes.  Errors: those of WriteFileAtomically and of reading what the folder holds.
Status BeginOwnFolder(const std::string& folder, const std::string& kind);
Status FinishOwnFolder(const std::string& folder, const std::string& kind);

// Ok where nothing is lost if the folder is removed: it is empty, or cairn made all that it holds, as a
// folder of `kind`, and nobody has changed it since.  Files may be missing.  Links are not followed.  Errors:
// InvalidArgument, which names the first file that is foreign or changed and what to do; Io.
Status CheckOwnFolder(const std::string& folder, const std::string& kind);

// Whether two finished folders of cairn hold the same, and `folder` still does.
bool HoldsTheSame(const std::string& folder, const std::string& other);

// Gives the files that `old_folder` held with the same bytes the dates that they have there.
void KeepDates(const std::string& folder, const std::string& old_folder);

// Files and links in a finished folder that cairn wrote and nobody has changed since, the manifest among
// them; empty where it is not one of cairn's.
std::set<std::string> OwnFiles(const std::string& folder);

// Removes a folder that is empty, unfinished, or cairn's and unchanged (CheckOwnFolder of its own kind), the
// last file by file: what appears in it meanwhile stays.  Returns whether it is gone.
bool RemoveOwnFolder(const std::string& folder);

}  // namespace cairn
