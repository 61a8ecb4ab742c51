// Runs the fuzzer's entry on files without libFuzzer:  map_fuzzer_replay FILE|FOLDER...
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <string>

#include "core/files/file.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* bytes, size_t size);

int main(int argc, char** argv) {
  namespace fs = std::filesystem;
  int num_files = 0;
  const auto replay = [&](const fs::path& path) {
    const auto bytes = cairn::ReadFile(path.string());
    if (!bytes.ok()) return;
    std::printf("%s\n", path.c_str());
    std::fflush(stdout);
    LLVMFuzzerTestOneInput(reinterpret_cast<const uint8_t*>(bytes->data()), bytes->size());
    ++num_files;
  };
  for (int i = 1; i < argc; ++i) {
    if (!fs::is_directory(argv[i])) {
      replay(argv[i]);
      continue;
    }
    for (const auto& entry : fs::directory_iterator(argv[i])) replay(entry.path());
  }
  std::printf("%d files\n", num_files);
  return num_files > 0 ? 0 : 1;
}
