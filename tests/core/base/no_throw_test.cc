#include "core/base/no_throw.h"

#include <new>
#include <stdexcept>
#include <system_error>

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

namespace cairn {
namespace {

template <typename Exception>
Error Thrown(const Exception& exception) {
  return WithoutExceptions("here", [&]() -> Status { throw exception; }).error();
}

TEST(WithoutExceptions, WhatIsThrownIsAnErrorAndALackOfMemoryHasItsOwn) {
  EXPECT_TRUE(WithoutExceptions("here", [] { return Ok(); }).ok());
  for (const Error& error :
       {Thrown(std::bad_alloc()), Thrown(cv::Exception(cv::Error::StsNoMem, "", "", "", 0)),
        Thrown(std::system_error(std::make_error_code(std::errc::resource_unavailable_try_again)))}) {
    EXPECT_EQ(error.code, ErrorCode::kNoMemory);
    EXPECT_EQ(error.message, "here: out of memory");
  }
  const Error of_opencv = Thrown(cv::Exception(cv::Error::StsBadArg, "bad", "f", "f.cc", 1));
  EXPECT_EQ(of_opencv.code, ErrorCode::kFailed);
  const Error of_system = Thrown(std::system_error(std::make_error_code(std::errc::permission_denied)));
  EXPECT_EQ(of_system.code, ErrorCode::kFailed);
  const Error other = Thrown(std::runtime_error("oops"));
  EXPECT_EQ(other.code, ErrorCode::kFailed);
  EXPECT_EQ(other.message, "here: oops");
  const Error unknown = Thrown(3);
  EXPECT_EQ(unknown.code, ErrorCode::kFailed);
  EXPECT_EQ(unknown.message, "here: an unknown exception");
}

}  // namespace
}  // namespace cairn
