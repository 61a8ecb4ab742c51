#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/error.h"

namespace cairn {

// What an ONNX file says of its net before a library builds it: a damaged file is told from one of another
// net.
struct OnnxTensor {
  std::string name;
  std::vector<int64_t> sizes;  // 0: not fixed
  friend bool operator==(const OnnxTensor&, const OnnxTensor&) = default;
};
struct OnnxOutline {
  std::vector<OnnxTensor> inputs;  // without weights, which older files list among the inputs
  std::vector<OnnxTensor> outputs;
};

// Of the file's bytes; `path` is for messages.  Errors: Corrupt for no ONNX, for one that is cut short and
// for weights that are no numbers.
Result<OnnxOutline> ReadOnnxOutline(std::string_view bytes, const std::string& path);

// "1 x 3 x ? x ?"
std::string SizesText(const std::vector<int64_t>& sizes);

}  // namespace cairn
