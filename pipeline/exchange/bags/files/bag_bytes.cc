#include "pipeline/exchange/bags/files/bag_bytes.h"

#include <filesystem>

#include "core/files/input_file.h"

namespace cairn::pipeline {

Result<BagBytes> BagBytes::Open(const std::string& path) {
  CAIRN_RETURN_IF_ERROR(CheckInputFile(path));
  BagBytes bytes;
  bytes.path_ = path;
  bytes.file_.open(path, std::ios::binary);
  std::error_code error;
  bytes.num_bytes_ = std::filesystem::file_size(path, error);
  if (!bytes.file_ || error) return MakeError(ErrorCode::kIo, "{}: cannot be opened", path);
  return bytes;
}

Result<std::string> BagBytes::At(uint64_t place, uint64_t length) {
  std::string bytes(length, '\0');
  file_.clear();
  file_.seekg(static_cast<std::streamoff>(place));
  if (file_.read(bytes.data(), static_cast<std::streamsize>(length))) return bytes;
  return MakeError(ErrorCode::kIo, "{}: cannot be read at byte {}", path_, place);
}

std::vector<std::string> BagDamage::Sentences(const BagBytes& file) const {
  std::vector<std::string> sentences;
  if (is_cut) {
    sentences.push_back(fmt::format(
        "{}: ends in the middle of a record, at byte {} of {}: the file was cut off, or a length in "
        "it is wrong; what is before is read",
        file.path(), place, file.num_bytes()));
  } else if (!is_closed) {
    sentences.push_back(
        fmt::format("{}: the recording was not closed; what came to be written is read", file.path()));
  }
  if (chunks.count > 0) {
    sentences.push_back(fmt::format("{}: {} damaged chunks are left out, the first {}", file.path(),
                                    chunks.count, chunks.first));
  }
  if (records.count > 0) {
    sentences.push_back(fmt::format("{}: {} damaged records are left out, the first {}", file.path(),
                                    records.count, records.first));
  }
  return sentences;
}

}  // namespace cairn::pipeline
