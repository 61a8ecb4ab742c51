#pragma once

#include <sys/stat.h>

#include <cstdio>
#include <filesystem>
#include <map>
#include <string>

#include <gtest/gtest.h>

#include "core/files/file.h"
#include "tests/end_to_end/program_run.h"

namespace cairn {

// The files of a folder, by name.
using Contents = std::map<std::string, std::string>;

// Epochs 1, 2 and 3 of a small map, a delta from the second to the third, a key; and a folder to work in.
class SignedEpochs : public testing::Test {
 protected:
  explicit SignedEpochs(const std::string& name) : folder_(name), work_(folder_ / "work") {
    std::filesystem::create_directories(work_);
    Run("cairn migrate " GOLDEN_DIR "/map_1.0.cairn -o " + folder_ / "unsigned");
    Run("cairn keygen " + folder_ / "key");
    for (const std::string epoch : {"1", "2", "3"})
      Run("cairn sign " + folder_ / "unsigned" + " --key " + folder_ / "key" + " --epoch " + epoch + " -o " +
          folder_ / epoch);
    Run("cairn update delta " + folder_ / "2" + " " + folder_ / "3" + " --key " + folder_ / "key" + " -o " +
        folder_ / "delta");
  }

  static void Run(const std::string& command) {
    const ProgramRun run = RunShell(command);
    EXPECT_EQ(run.exit_code, 0) << command << ": " << run.err;
  }

  std::string Bytes(const std::string& name) const { return ReadFile(folder_ / name).value(); }

  static void WriteFile(const std::string& path, const std::string& bytes) {
    std::FILE* const file = std::fopen(path.c_str(), "wb");
    std::fwrite(bytes.data(), 1, bytes.size(), file);
    std::fclose(file);
    chmod(path.c_str(), 0600);
  }

  // Makes the folder to work in anew, with these files.
  void FillWork(const Contents& files) const {
    std::filesystem::remove_all(work_);
    std::filesystem::create_directories(work_);
    for (const auto& [name, bytes] : files) WriteFile(work_ + "/" + name, bytes);
  }

  // What is in it.
  Contents Work() const {
    Contents contents;
    for (const std::filesystem::directory_entry& entry : std::filesystem::directory_iterator(work_))
      contents[entry.path().filename().string()] = ReadFile(entry.path().string()).value();
    return contents;
  }

  // The same, less what is temporary.
  Contents WorkThatStays() const {
    Contents contents = Work();
    std::erase_if(contents, [](const auto& file) { return file.first.find(".tmp-") != std::string::npos; });
    return contents;
  }

  TemporaryFolder folder_;
  std::string work_;
};

}  // namespace cairn
