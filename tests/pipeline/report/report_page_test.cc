#include "pipeline/report/report_page.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace cairn::pipeline {
namespace {

using testing::HasSubstr;
using testing::Not;

// Every text that a map brings to the page for paper is shown, none is markup.
TEST(PrintedReportPage, NoTextOfAMapIsMarkup) {
  const std::string hostile = "<script>alert(1)</script>\x1b&\"'";
  const std::string shown = "&lt;script&gt;alert(1)&lt;/script&gt;\ufffd&amp;&quot;&#39;";
  MapRows rows;
  rows.name = rows.writer = hostile;
  rows.stations.emplace_back();
  rows.stage_options[hostile] = hostile;
  rows.self_test[hostile] = 1;
  rows.images.push_back({.name = hostile});
  rows.sessions = {"old", hostile};
  rows.findings.changes = {{.session = 1, .num_vanished = 20, .image_before = 0, .image_after = 0}};
  const nlohmann::ordered_json data = {
      {"bytes", 1},
      {"unit", "metre"},
      {"held_out", {{{"name", hostile}, {"at", {1, 2}}, {"message", hostile}}}}};
  const std::string page = PrintedReportPage({.rows = &rows}, data);
  EXPECT_THAT(page, Not(HasSubstr("<script")));
  EXPECT_EQ(page.find('\x1b'), std::string::npos);
  EXPECT_THAT(page, HasSubstr("<h2>Options of " + shown + "</h2>\n<pre>" + shown + "</pre>"));
  EXPECT_THAT(page, HasSubstr("<h2>Changed places</h2>"));
  EXPECT_THAT(page, HasSubstr(shown + " -&gt; " + shown));
  EXPECT_THAT(page, HasSubstr("<h1>" + shown + "</h1>"));
}

}  // namespace
}  // namespace cairn::pipeline
