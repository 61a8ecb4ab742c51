#include "core/modules/module.h"

#include <cstdlib>
#include <new>
#include <thread>

#include <gtest/gtest.h>

namespace cairn {
namespace {

bool HasNoMemory() {
  try {
    (void)LoadModule(CAIRN_THROWING_MODULE, {.symbol = "none", .version = "1", .needs = "", .packages = ""});
  } catch (const std::bad_alloc&) {
    return true;
  }
  return false;
}

// 0: all as expected.
int LoadWhereConstructorsThrow() {
  if (LoaderIsHeld()) return 1;
  bool has_no_memory = false;
  std::thread([&] { has_no_memory = HasNoMemory(); }).join();
  if (!has_no_memory) return 2;
  if (!LoaderIsHeld()) return 3;
  return HasNoMemory() ? 0 : 4;  // dlopen would wait for the thread that has ended
}

// In a process of its own: no other could load anything afterwards.
TEST(LoadModule, OfConstructorsWithoutMemoryThrowsAndSaysThatTheLoaderIsHeld) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "a sanitizer's dlopen lets no exception pass";
#endif
  testing::GTEST_FLAG(death_test_style) = "threadsafe";
  EXPECT_EXIT(std::_Exit(LoadWhereConstructorsThrow()), testing::ExitedWithCode(0), "");
}

TEST(LoadModule, OfNoModuleIsAnErrorThatHoldsNothing) {
  const Result<const void*> module =
      LoadModule("/none.so", {.symbol = "none", .version = "1", .needs = "", .packages = ""});
  ASSERT_FALSE(module.ok());
  EXPECT_EQ(module.error().code, ErrorCode::kUnsupported);
  EXPECT_FALSE(LoaderIsHeld());
}

}  // namespace
}  // namespace cairn
