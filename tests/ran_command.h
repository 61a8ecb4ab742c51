#pragma once

#include <filesystem>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>
#include <CLI/CLI.hpp>

#include "core/base/progress.h"
#include "core/line/command.h"
#include "core/line/stage_report.h"

namespace cairn {

// What a command did: its results, what it logged, its report.
struct Ran {
  Status status = Ok();
  std::string out, said;
  StageReport report;
};

// Runs `cairn stage NAME WORDS... MORE...` within the test, on one thread with seed 5.
inline Ran RunWords(const Command& command, std::vector<std::string> words,
                    const std::vector<std::string>& more = {}, int64_t memory_mib = 1 << 20) {
  words.insert(words.end(), more.begin(), more.end());
  CLI::App app;
  ArgumentParser parser(app);
  command.add_arguments(parser);
  app.parse(std::vector<std::string>(words.rbegin(), words.rend()));
  Ran ran;
  NoProgress progress;
  std::ostringstream out, said;
  const auto before = spdlog::default_logger();
  spdlog::set_default_logger(
      std::make_shared<spdlog::logger>("said", std::make_shared<spdlog::sinks::ostream_sink_st>(said)));
  ran.status = command.run({.num_threads = 1,
                            .seed = 5,
                            .memory_mib = memory_mib,
                            .progress = &progress,
                            .report = &ran.report,
                            .out = &out});
  spdlog::set_default_logger(before);
  ran.out = out.str();
  ran.said = said.str();
  return ran;
}

// Has a folder of its own, which is empty when a test begins, and gone after it.
class CommandTest : public testing::Test {
 protected:
  CommandTest() {
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  ~CommandTest() override { std::filesystem::remove_all(folder_); }
  std::string Path(const std::string& name) const { return folder_ / name; }

  const std::filesystem::path folder_ =
      std::filesystem::path(testing::TempDir()) /
      testing::UnitTest::GetInstance()->current_test_info()->test_suite_name();
};

}  // namespace cairn
