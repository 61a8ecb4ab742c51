#include "pipeline/program/progress.h"

#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace cairn::pipeline {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::StartsWith;

// A clock that the test sets and a screen that it reads.
struct Screen {
  double seconds = 100;
  std::string text;
  ProgressOutput Output() {
    return {.write = [this](const std::string& t) { text += t; }, .seconds = [this] { return seconds; }};
  }
  std::vector<std::string> Lines() const {
    std::vector<std::string> lines(1);
    for (const char c : text) {
      if (c == '\n') {
        lines.emplace_back();
      } else {
        lines.back() += c;
      }
    }
    lines.pop_back();
    return lines;
  }
};

TEST(Progress, StyleAutoIsABarOnATerminalAndLinesElsewhere) {
  EXPECT_EQ(ParseProgressStyle("auto", true).value(), ProgressStyle::kBar);
  EXPECT_EQ(ParseProgressStyle("auto", false).value(), ProgressStyle::kLines);
  EXPECT_EQ(ParseProgressStyle("json", true).value(), ProgressStyle::kJson);
  EXPECT_FALSE(ParseProgressStyle("dots", true).ok());
}

TEST(Progress, LinesComePerTenPercentWithRateAndTimeLeft) {
  Screen screen;
  const auto progress = MakeProgress(ProgressStyle::kLines, screen.Output());
  progress->Begin("match", 200, "pairs");
  for (int i = 0; i < 200; ++i) {
    screen.seconds += 0.5;
    progress->Advance();
  }
  progress->End();
  const auto lines = screen.Lines();
  ASSERT_EQ(lines.size(), 11u);
  EXPECT_EQ(lines[0], "match: 200 pairs");
  EXPECT_EQ(lines[1], "match: 10 %, 2.0 pairs/s, 1:30 min left");
  EXPECT_EQ(lines[9], "match: 90 %, 2.0 pairs/s, 10 s left");
  EXPECT_EQ(lines[10], "match: 200 pairs in 1:40 min (2.0 pairs/s)");
}

TEST(Progress, BarIsRedrawnInPlaceAtMostTenTimesASecond) {
  Screen screen;
  const auto progress = MakeProgress(ProgressStyle::kBar, screen.Output());
  progress->Begin("extract", 1000, "images");
  for (int i = 0; i < 1000; ++i) {
    screen.seconds += 0.001;
    progress->Advance();
  }
  EXPECT_EQ(screen.Lines().size(), 0u);  // one line, not ended
  EXPECT_LE(std::count(screen.text.begin(), screen.text.end(), '\r'), 11);
  progress->End();
  EXPECT_THAT(screen.text, HasSubstr("50 %"));
  EXPECT_THAT(screen.Lines().back(), HasSubstr("extract: 1000 images in 1 s (1000 images/s)"));
}

TEST(Progress, JsonIsOneObjectPerLine) {
  Screen screen;
  const auto progress = MakeProgress(ProgressStyle::kJson, screen.Output());
  progress->Begin("extract", 4, "images");
  screen.seconds += 1.25;
  progress->Advance(3);
  progress->Advance();
  progress->End();
  std::vector<std::string> events;
  for (const std::string& line : screen.Lines()) events.push_back(nlohmann::json::parse(line)["event"]);
  EXPECT_THAT(events, ElementsAre("begin", "advance", "end"));
  EXPECT_EQ(screen.Lines()[2], R"({"event":"end","task":"extract","done":4,"total":4,"seconds":1.25})");
}

TEST(Progress, NoneWritesNothing) {
  Screen screen;
  const auto progress = MakeProgress(ProgressStyle::kNone, screen.Output());
  progress->Begin("extract", 4, "images");
  screen.seconds += 1;
  progress->Advance(4);
  progress->End();
  EXPECT_EQ(screen.text, "");
}

TEST(Progress, CountsFromManyThreads) {
  Screen screen;
  const auto progress = MakeProgress(ProgressStyle::kLines, screen.Output());
  progress->Begin("extract", 4000, "images");
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&] {
      for (int i = 0; i < 1000; ++i) progress->Advance();
    });
  }
  for (std::thread& thread : threads) thread.join();
  progress->End();
  EXPECT_THAT(screen.Lines().back(), StartsWith("extract: 4000 images"));
}

TEST(Progress, EmptyTaskIsDoneAtOnce) {
  for (const auto style : {ProgressStyle::kBar, ProgressStyle::kLines, ProgressStyle::kJson}) {
    Screen screen;
    const auto progress = MakeProgress(style, screen.Output());
    progress->Begin("extract", 0, "images");
    progress->End();
    EXPECT_THAT(screen.text, HasSubstr("0"));
  }
}

}  // namespace
}  // namespace cairn::pipeline
