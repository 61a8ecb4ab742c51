#pragma once

#include <string>

namespace cairn {

// Whether a file is a film by its name or its first bytes: MP4, MOV, Matroska, WebM, AVI, MPEG streams.  It
// need not be a whole one.  False for what cannot be read.
bool IsFilm(const std::string& path);

// Whether a file begins as MP4 and MOV do, with a box of a known kind.
bool BeginsLikeMp4(const std::string& path);

}  // namespace cairn
