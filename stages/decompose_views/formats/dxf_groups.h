#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "core/base/error.h"

namespace cairn::decompose_views {

// A group of a DXF file: a line with its code, and one with its value.
struct DxfGroup {
  int code = 0;
  std::string_view value;  // without white space at its ends; of the text that is read
  int64_t line = 0;        // of the value, from 1

  bool Is(int that_code, std::string_view that_value) const {
    return code == that_code && value == that_value;
  }
};

// Where a reader of groups stands; a place in the text to which it can return.
struct DxfPlace {
  size_t offset = 0;
  int64_t line = 0;  // of the text before it
};

// Reads the groups of an ASCII DXF text one after the other, comments (999) left out.  The text and its name
// outlive it.
class DxfGroups {
 public:
  DxfGroups(std::string_view text, const std::string& what, DxfPlace place = {})
      : text_(text), what_(what), place_(place) {}

  // Errors: Corrupt: a code that is no number, an end of the text before the value, or before `0 EOF`.
  Result<DxfGroup> Next();

  DxfPlace place() const { return place_; }
  void Return(const DxfPlace& place) { place_ = place; }

  // The value of a group as a finite number.  Errors: Corrupt, with the line.
  Result<double> Number(const DxfGroup& group) const;
  Result<int> Integer(const DxfGroup& group) const;

 private:
  bool NextLine(std::string_view* line);

  std::string_view text_;
  const std::string& what_;
  DxfPlace place_;
};

}  // namespace cairn::decompose_views
