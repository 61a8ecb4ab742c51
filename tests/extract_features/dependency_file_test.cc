#include "stages/extract_features/dependency_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn::extract_features {
namespace {

using testing::ElementsAre;

TEST(DependencyFile, ListsInputsAndLetsThemVanishBelowTheRoots) {
  EXPECT_EQ(DependencyFile({"/a/1.png", "/m/1.png"}, {"/a", "/m"}),
            "CAPTURE_IMAGES += \\\n  /a/1.png \\\n  /m/1.png\n/a/%: ;\n/m/%: ;\n");
}

TEST(DependencyFile, EscapesWhatMakeWouldTakeForMoreThanAName) {
  EXPECT_EQ(DependencyFile({"/a b:c#d$e;f|g*h?i[j].png"}, {}),
            "CAPTURE_IMAGES += \\\n  /a\\ b\\:c\\#d$$e\\;f\\|g\\*h\\?i\\[j].png\n");
  EXPECT_EQ(DependencyFile({"/a\\ b\\c.png"}, {}), "CAPTURE_IMAGES += \\\n  /a\\\\\\ b\\c.png\n");
  EXPECT_EQ(DependencyFile({}, {"/50% of b"}), "CAPTURE_IMAGES +=\n/50\\%\\ of\\ b/%: ;\n");
}

TEST(DependencyFile, LeavesOutNamesThatNoMakefileCanHold) {
  EXPECT_EQ(DependencyFile({"/a\nb.png", "/c.png", "/d\\"}, {}), "CAPTURE_IMAGES += \\\n  /c.png\n");
}

TEST(IsDependencyFile, WhatIsWrittenIsAndWhatElseMakeWouldDoIsNot) {
  for (const std::vector<std::string>& inputs :
       {std::vector<std::string>{},
        {"/a/1.png"},
        {"/a b:c#d$e;f|g*h?i[j].png", "/a\\ b\\c.png", "/x\\\\:y", "/$$(z)"}}) {
    for (const std::vector<std::string>& roots : {std::vector<std::string>{}, {"/a", "/50% of b$c\\%d"}})
      EXPECT_TRUE(IsDependencyFile(DependencyFile(inputs, roots))) << DependencyFile(inputs, roots);
  }
  const std::string good = DependencyFile({"/a/1.png"}, {"/a"});
  for (const std::string& bad :
       {std::string(), std::string("X := $(shell id)\n"), good + "X := $(shell id)\n", good + "\n",
        good + "/b/%: ; id\n", good + "/b/%: ;\n\tid\n", std::string("CAPTURE_IMAGES += \\\n  $(shell id)\n"),
        std::string("CAPTURE_IMAGES += \\\n  /a b\n"), std::string("CAPTURE_IMAGES += \\\n  /a;b\n"),
        std::string("CAPTURE_IMAGES += \\\n  /a"), std::string("CAPTURE_IMAGES +=\nx: y\n/a/%: ;\n"),
        std::string("CAPTURE_IMAGES +=\n$(shell id)/%: ;\n"), "SHELL=id\n" + good})
    EXPECT_FALSE(IsDependencyFile(bad)) << bad;
}

TEST(DependencyFile, FoldersAreAllThoseBetweenTheRootAndTheFiles) {
  EXPECT_THAT(FoldersOf({"/r/a/b/1.png", "/r/a/2.png", "/r/c d/3.png", "/s/4.png"}, "/r"),
              ElementsAre("/r", "/r/a", "/r/a/b", "/r/c d"));
}

}  // namespace
}  // namespace cairn::extract_features
