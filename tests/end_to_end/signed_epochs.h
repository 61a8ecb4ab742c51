#pragma once

#include <sys/stat.h>

#include <cstdio>
#include <filesystem>
#include <map>
#include <string>

#include <gtest/gtest.h>

#include "core/files/file.h"
#include "core/map/map_file.h"
#include "core/seal/key_ring.h"
#include "core/seal/map_seal.h"
#include "tests/end_to_end/program_run.h"

namespace cairn {

// The files of a folder, by name.
using Contents = std::map<std::string, std::string>;

// Epochs 1, 2 and 3 of a small map, a delta from the second to the third, a key; and a folder to work in.
class SignedEpochs : public testing::Test {
 public:
  // A command that must succeed.
  static void Run(const std::string& command) {
    const ProgramRun run = RunShell(command);
    EXPECT_EQ(run.exit_code, 0) << command << ": " << run.err;
  }

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

// Two of a ring of three sign each epoch: Alice in the seal, Bob beside it; a robot has the second epoch in
// place and the first one before it.
class RingEpochs {
 public:
  // `folder`: of SignedEpochs; the delta gets signatures.
  explicit RingEpochs(const TemporaryFolder& folder) : work_(folder / "work") {
    SignedEpochs::Run("cairn keygen " + folder / "bob");
    SignedEpochs::Run("cairn keygen " + folder / "carol");
    SignedEpochs::Run("cairn keys make alice=" + folder / "key.pub" + " bob=" + folder / "bob.pub" +
                      " carol=" + folder / "carol.pub" + " --threshold 2 -o " + folder / "ring");
    for (const std::string epoch : {"1", "2", "3"})
      SignedEpochs::Run("cairn sign " + folder / epoch + " --key " + folder / "bob" + " --add");
    std::filesystem::rename(folder / "3.signatures", folder / "delta.signatures");
    ring_ = ReadTrustedKeys(folder / "ring").value();
    const auto bytes = [&](const std::string& name) { return ReadFile(folder / name).value(); };
    before_ = {{"map", bytes("2")},
               {"map.previous", bytes("1")},
               {"map.signatures", bytes("1.signatures") + bytes("2.signatures")}};
    apply_ = "cairn update apply " + work_ + "/map " + folder / "delta" + " --in-place --public-key " +
             folder / "ring";
    rollback_ = "cairn update rollback " + work_ + "/map --public-key " + folder / "ring";
  }

  // What the robot has before an update, and the commands for it.
  const Contents& before() const { return before_; }
  const std::string& apply() const { return apply_; }
  const std::string& rollback() const { return rollback_; }

  // Of a map of the robot; 0: none that the ring trusts.
  uint64_t TrustedEpoch(const std::string& name) const {
    const Result<MapFile> map = MapFile::Open(work_ + "/" + name, {.public_key = ring_});
    return map.ok() && CheckFileHash(work_ + "/" + name).ok() ? map->head().epoch : 0;
  }

 private:
  std::string work_;
  KeyRing ring_;
  Contents before_;
  std::string apply_, rollback_;
};

}  // namespace cairn
