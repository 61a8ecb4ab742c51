#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace cairn::extract_features {

// A fragment for GNU Make that adds every input to the variable CAPTURE_IMAGES, as words of a rule's
// prerequisites: blanks, colons and the like are escaped.  Below each folder of `roots` a missing file counts
// as changed instead of being an error.  Names that cannot be written in a Makefile (line breaks, a backslash
// at the end) are left out.  Paths are written as they are given; absolute ones let the fragment be read from
// any folder.
std::string DependencyFile(const std::vector<std::string>& inputs, const std::vector<std::string>& roots);

// Whether DependencyFile writes exactly this for some inputs and roots: Make does no more with it than to set
// the variable, whoever has put it there.
bool IsDependencyFile(std::string_view text);

// Every folder between `root` and the files, the root first, then ascending: adding or removing a file
// changes the date of its folder.  Files that do not lie below the root are skipped.
std::vector<std::string> FoldersOf(const std::vector<std::string>& files, const std::string& root);

}  // namespace cairn::extract_features
